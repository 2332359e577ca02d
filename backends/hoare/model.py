"""The program as a model that can be run: from the contract's inputs to its outputs, exactly."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from avow.backend_kit.protocol import Job, NoModel
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.values import Value
from avow.language.terms import Role, Variable
from avow.solving.models import default_value
from avow.solving.translation import Unsupported

from .interpreter import Endless, Fault, Machine, NoEnd, State
from .work import load


def answering(job: Job) -> Callable[[Mapping[str, Value]], Mapping[str, Value]]:
    """Raises Rejected where the program is at fault, and NoModel where it is none of single steps on the contract's own
    inputs."""
    work = load(job)
    checked, machine = work.checked, Machine()
    terms = checked.reading.terms
    if work.steps is not None:
        raise NoModel("it keeps something from step to step")
    if checked.reading.predicates:
        raise NoModel("a relation is read as a formula")
    inputs: dict[str, Variable] = {}
    for port in job.node.inputs:
        term = terms.get((Role.INPUT, port.name))
        if isinstance(term, Variable):
            inputs[port.variable.qualified] = term
        elif term is not None:
            raise NoModel(f"in.{port.name} is read as an expression of the program")
    outputs = {
        p.variable.qualified: terms[Role.OUTPUT, p.name] for p in job.node.outputs if (Role.OUTPUT, p.name) in terms
    }
    ghosts = checked.program.ghosts

    def run(given: Mapping[str, Value]) -> Mapping[str, Value]:
        start: State = {}
        for name, variable in inputs.items():
            own = next((v for v, ghost in ghosts.items() if ghost == variable), variable)
            if name in given:  # one that a program is not given is anything
                start[own.name] = start[variable.name] = given[name]
        for variable in checked.program.state:
            try:
                start.setdefault(variable.name, default_value(variable.sort))
            except Unsupported:
                continue
        try:
            end = machine.run(checked.program.body, start)
            return {name: evaluate(term, end) for name, term in outputs.items()}
        except (Fault, NoEnd, Endless, NotEvaluable, KeyError) as error:
            raise NoModel(str(error)) from error

    return run
