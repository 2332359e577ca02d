"""What a node may put out where it cannot be tried value by value: relations, a bit for each point, found by Z3."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from avow.base.tuning.bounds import CHOICES_FOUND
from avow.calculus.scenario import CannotRun, Point
from avow.formulas.formula import free_variables
from avow.formulas.values import FunctionValue, Value
from avow.language.contract import Clause, Node, Port
from avow.language.sorts import FunctionSort
from avow.language.terms import Apply, Iff, Quantified, Quantifier, Role, Term, Variable
from avow.solving.checking import put
from avow.solving.models import Model
from avow.solving.translation import Translator, Unsupported
from avow.solving.z3_module import z3

Values = dict[str, Value]


def by_variable(node: Node, values: Values) -> dict[Variable, Value]:
    ports = {p.variable.qualified: p.variable for p in (*node.inputs, *node.outputs)}
    return {ports[name]: value for name, value in values.items() if name in ports}


def definition(guarantees: Sequence[Clause], port: Port) -> tuple[tuple[Variable, ...], Term] | None:
    """``forall(x | out.p(x) <=> body)`` gives x and body, if body does not speak of outputs."""
    for clause in guarantees:
        formula = clause.formula
        if not (isinstance(formula, Quantified) and formula.quantifier is Quantifier.FORALL):
            continue
        if not isinstance(formula.body, Iff):
            continue
        for head, body in ((formula.body.left, formula.body.right), (formula.body.right, formula.body.left)):
            applied = isinstance(head, Apply) and head.function == port.variable and head.arguments == formula.variables
            if applied and all(v.role is not Role.OUTPUT for v in free_variables(body)):
                return formula.variables, body
    return None


def search(
    relations: Sequence[tuple[Port, tuple[Point, ...]]],
    plain: Sequence[tuple[Port, tuple[Value, ...]]],
    constraints: Sequence[Term],
    known: Mapping[Variable, Value],
    seed: int,
    effort: int,
) -> tuple[list[Values], bool]:
    """Every choice of outputs that meets the constraints: a bit for each point of a relation, found by Z3.

    Says too whether these are all. Raises CannotRun where Z3 cannot decide.
    """
    translator = Translator()
    solver = z3.Solver(ctx=translator.context)
    try:
        meanings: dict[Variable, Any] = {v: translator.value(value, v.sort) for v, value in known.items()}
        bits: list[tuple[Port, Point, Any]] = []
        for port, points in relations:
            assert isinstance(port.sort, FunctionSort)
            rows = []
            for k, point in enumerate(points):
                bit = z3.Bool(f"{port.name}#{k}", translator.context)
                bits.append((port, point, bit))
                rows.append(([translator.value(x, s) for x, s in zip(point, port.sort.parameters, strict=True)], bit))
            meanings[port.variable] = translator.table(rows, z3.BoolVal(False, translator.context))
        chosen = []
        for port, values in plain:
            constant = translator.variable(port.variable)
            solver.add(z3.Or([constant == translator.value(value, port.sort) for value in values]))
            chosen.append((port, constant))
        solver.add(*(translator.term(constraint, meanings) for constraint in constraints))
        found: list[Values] = []
        while True:
            said = put(translator, solver, effort, seed)
            if said.status == "unsat":
                return found, True
            if said.status != "sat":
                raise CannotRun(f"the solver cannot decide which outputs are allowed: {said.reason}")
            if len(found) >= CHOICES_FOUND:
                return found, False
            model = solver.model()
            reader = Model(translator, model)
            answer: Values = {port.name: reader.read(constant, port.sort) for port, constant in chosen}
            literals = [constant != model.eval(constant, model_completion=True) for _, constant in chosen]
            tables: dict[str, dict[tuple[Value, ...], Value]] = {port.name: {} for port, _ in relations}
            for port, point, bit in bits:
                truth = z3.is_true(model.eval(bit, model_completion=True))
                literals.append(z3.Not(bit) if truth else bit)
                if truth:
                    tables[port.name][point] = True
            answer.update({name: FunctionValue(table, False) for name, table in tables.items()})
            found.append(answer)
            solver.add(z3.Or(literals) if literals else z3.BoolVal(False, translator.context))
    except Unsupported as what:
        raise CannotRun(f"Avow cannot express {what.what} for the solver") from None
    except z3.Z3Exception as error:
        raise CannotRun(f"Z3: {error}") from None
