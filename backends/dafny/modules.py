"""The generated Dafny files of one node: its types, its contract, its specification, and a skeleton to fill in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from avow.backend_kit.stepping import stepping
from avow.base.plain import one_line
from avow.base.records import dataclass
from avow.formulas.formula import free_variables
from avow.formulas.temporal.cell import CELL
from avow.formulas.temporal.cells import remembers
from avow.language.contract import Clause, Node
from avow.language.operators import OPERATORS, Level
from avow.language.sorts import DataSort, EnumSort, OpaqueSort
from avow.sanity.claims import triggers

from .history import ESTABLISHED, History, history
from .printer import (
    RESERVED,
    Names,
    NotExpressible,
    Predicate,
    Vocabulary,
    file_stem,
    identifier,
    print_clause,
    signature,
    sort_text,
)

_MODULE = 'module {:options "--function-syntax:3"}'
"""Ignored by 2.3; makes `predicate` ghost in 4.x, as it is in 2.3."""

_FUNCTIONS = {
    "AbsInt": "(a: int): nat { if a < 0 then 0 - a else a }",
    "AbsReal": "(a: real): real { if a < 0.0 then 0.0 - a else a }",
    "MinInt": "(a: int, b: int): int { if b < a then b else a }",
    "MinReal": "(a: real, b: real): real { if b < a then b else a }",
    "MaxInt": "(a: int, b: int): int { if a < b then b else a }",
    "MaxReal": "(a: real, b: real): real { if a < b then b else a }",
}
"""Functions that are generated if a formula uses them: for each operator that is a function, one for each of its types.
"""


def _complete() -> None:
    """Raises TypeError if a function in the table of operators is not generated, or its name not reserved."""
    wanted = {
        f"{row.dafny.removeprefix('Types.')}{kind}"
        for row in OPERATORS.values()
        if row.level is Level.ATOM and isinstance(row.dafny, str) and row.dafny.startswith("Types.")
        for kind in (("Bool",) if row.typing.takes_formulas else ("Int", "Real"))
    }
    missing = wanted - set(_FUNCTIONS)
    unkept = set(_FUNCTIONS) - RESERVED
    if missing or unkept:
        raise TypeError(
            f"Dafny functions without a text in modules.py: {sorted(missing)}; "
            f"their names that printer.py does not reserve: {sorted(unkept)}"
        )


_complete()


@dataclass(frozen=True, slots=True)
class Generated:
    """Everything for one node. `ensures` maps a line of the specification to its guarantee."""

    node: str
    spec_module: str
    impl_module: str
    types_file: str
    contract_file: str
    spec_file: str
    impl_file: str
    types: str
    contract: str
    spec: str
    skeleton: str
    """A first implementation, to be filled in, beside the generated files."""
    ensures: tuple[tuple[int, str], ...]
    probe_module: str
    probe: str
    """A module of Avow's own that calls the implementation from outside, by its qualified name: the proofs that its
    Step meets the contract, and that its Env excludes nothing, are then about these names as Dafny resolves them."""
    probe_ensures: tuple[tuple[int, str], ...]
    """The same map for its `ensures`."""
    uncovered: tuple[tuple[str, str], ...]
    """Guarantees that cannot be expressed, with the reason."""
    situations: str = ""
    """More predicates of the contract's module: the conditions of guarantees."""
    excluded: str = ""
    """A module that checks for each of them whether Env, or the contract alone, excludes it."""
    conditions: tuple[str, ...] = ()
    """The guarantee of each of them."""
    remembers: bool = False
    """Whether the contract refers to other steps, so that there is a history."""

    @property
    def lemmas(self) -> tuple[str, ...]:
        """The lemmas that an implementation has to provide."""
        return ("EnvNotEmpty", ESTABLISHED) if self.remembers else ("EnvNotEmpty",)


PROBE_FILE, EXCLUDED_FILE = "probe.dfy", "excluded.dfy"
ENV_ALWAYS, CALL, BY_ENV, ANYWAY = "EnvAlways", "Call", "ByEnv", "Anyway"


def generate(node: Node, guarantees: Sequence[str]) -> Generated:
    """The files for some guarantees of a node. Raises NotExpressible for an assumption or port without counterpart."""
    names = Names()
    inputs = tuple(port.variable for port in node.inputs)
    outputs = tuple(port.variable for port in node.outputs)
    steps = stepping(node, guarantees) if remembers(node) else None
    cells = steps.cells if steps is not None else ()
    names.taken |= {"History", "Begins", "Advance"} if steps is not None else set()
    words = Vocabulary(names, Names(), (*inputs, *outputs, *(c.before for c in cells)))
    for number, cell in enumerate(cells, start=1):
        words.locals(str(cell.before.role), cell.name, f"{cell.name.partition(CELL)[0].replace(' ', '_')}{number}")
    stem = file_stem(node.name)
    title = identifier(node.name).replace("'", "")
    title = title[:1].upper() + title[1:]
    spec_module, impl_module = names.fresh(f"{title}Spec"), names.fresh(f"{title}Impl")
    probe_module = names.fresh(f"{title}Probe")
    for clause in node.clauses:  # clauses first: they keep their names, whatever their quantifiers' names are
        names("clause", clause.name)
    for port in inputs + outputs:
        words.local(port)
        sort_text(port.sort, words)
    past = history(steps, words) if steps is not None else History()
    node = replace(node, assumptions=steps.node.assumptions, guarantees=steps.node.guarantees) if steps else node
    for clause in node.assumptions:
        if outputs_used := [v.name for v in free_variables(clause.formula) if v in outputs]:
            raise NotExpressible(f"assumption {clause.name}: it speaks of the output {outputs_used[0]}", clause.span)
    assumed = [print_clause(c.name, c.formula, words) for c in node.assumptions]
    promised: list[tuple[Clause, tuple[Predicate, ...]]] = []
    uncovered: list[tuple[str, str]] = []
    for clause in node.guarantees:
        if clause.name not in guarantees:
            continue
        try:
            promised.append((clause, print_clause(clause.name, clause.formula, words)))
        except NotExpressible as problem:
            uncovered.append((clause.name, problem.what))
    types_file, contract_file, spec_file = "types.dfy", f"{stem}_contract.dfy", f"{stem}_spec.dfy"
    impl_file = f"{stem}_impl.dfy"
    render = _renderer(
        words,
        past,
        node=one_line(node.name),
        spec_module=spec_module,
        impl_module=impl_module,
        probe_module=probe_module,
        types_file=types_file,
        contract_file=contract_file,
        spec_file=spec_file,
        clauses=[
            (_head(clause), predicates)
            for clause, predicates in (*zip(node.assumptions, assumed, strict=True), *promised)
        ],
        assumed=[predicates[-1] for predicates in assumed],
        promised=[predicates[-1] for _, predicates in promised],
        uncovered=[(one_line(name), one_line(why)) for name, why in uncovered],
        inputs=signature(inputs, words),
        outputs=signature(outputs, words),
        arguments=", ".join(map(words.local, inputs)),
        results=", ".join(map(words.local, outputs)),
    )
    contract, spec, probe, skeleton = map(render, ("contract", "spec", "probe", "skeleton"))
    types = render(
        "types", body=_types(words), functions=[pair for pair in _FUNCTIONS.items() if pair[0] in words.functions]
    )
    conditions = _conditions([clause for clause, _ in promised], words)
    covered = [clause.name for clause, _ in promised]
    situations = render("situations", declarations=[each for _, made in conditions for each in made])
    excluded = render(
        "excluded", excluded_module=words.names.fresh("Excluded"), situations=[made[-1] for _, made in conditions]
    )
    return Generated(
        node.name, spec_module, impl_module, types_file, contract_file, spec_file, impl_file, types, contract, spec,
        skeleton, _ensures(spec, covered), probe_module, probe, _ensures(probe, covered), tuple(uncovered), situations,
        excluded, tuple(name for name, _ in conditions), bool(past.cells),
    )  # fmt: skip


def _renderer(words: Vocabulary, past: History, **values: object) -> Callable[..., str]:
    """Renders a template by name, with these values and more."""
    values |= {
        "module": _MODULE,
        "past": past,
        "history": "h: Contract.History" if past.cells else "",
        "kept": "ghost h: Contract.History, m: Memory" if past.cells else "",
        "left": "n: Memory" if past.cells else "",
        "advanced": f"Contract.Advance({', '.join(('h', *map(words.local, past.ports)))})",
        "signature": lambda variables: signature(variables, words),
        "sort": lambda variable: sort_text(variable.sort, words),
        "call": lambda predicate, module="Contract.": past.call(predicate, words, module),
    }
    return lambda name, **more: _templates().get_template(f"{name}.j2").render(values, **more)


@cache
def _templates() -> Environment:
    return Environment(
        loader=FileSystemLoader(Path(__file__).with_name("templates")),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def _conditions(promised: Sequence[Clause], words: Vocabulary) -> list[tuple[str, tuple[Predicate, ...]]]:
    """Predicates for conditions of guarantees, and the guarantee of each."""
    found: list[tuple[str, tuple[Predicate, ...]]] = []
    for clause in promised:
        for situation in triggers(clause.formula):
            with suppress(NotExpressible):
                found.append((clause.name, print_clause(f"{clause.name} condition {len(found)}", situation, words)))
    return found


def _ensures(text: str, promised: Sequence[str]) -> tuple[tuple[int, str], ...]:
    """For each promised guarantee, the line of its `ensures`: the first ones of the only method."""
    lines = list(enumerate(text.split("\n"), start=1))
    method = next(number for number, line in lines if line.startswith("  method "))
    after = (number for number, line in lines[method:] if line.startswith("    ensures "))
    return tuple(zip(after, promised, strict=False))  # after them comes that of the invariant


def _types(words: Vocabulary) -> list[str]:
    # The types of constructors' parameters may add further types, so this is not a plain loop.
    done: set[object] = set()
    body: list[str] = []
    while pending := [sort for sort in words.types if sort not in done]:
        for sort in pending:
            done.add(sort)
            body.append(_type(sort, words))
    return body


def _type(sort: object, words: Vocabulary) -> str:
    match sort:
        case EnumSort(members=members):
            name = words.declared(sort).removeprefix("Types.")
            made = " | ".join(words.constructor(sort, member).rsplit(".", 1)[1] for member in members)
            return f"  datatype {name} = {made}"
        case DataSort(constructors=constructors):
            name = words.declared(sort).removeprefix("Types.")
            shown = []
            for constructor in constructors:
                made = words.constructor(sort, constructor.name).rsplit(".", 1)[1]
                fields = [
                    f"{words.names(f'field of {name}.{made}', str(k), f'{made}_{k}')}: {_local_type(p, words)}"
                    for k, p in enumerate(constructor.parameters)
                ]
                shown.append(f"{made}({', '.join(fields)})" if fields else made)
            return f"  datatype {name} = {' | '.join(shown)}"
        case OpaqueSort():
            name = words.declared(sort).removeprefix("Types.")
            return (
                f"  type {name}(==,!new)\n  function {words.names.fresh(f'some_{name}')}(): {name}  // it is not empty"
            )
        case _:
            raise AssertionError(f"not a declared sort: {sort}")


def _local_type(sort: object, words: Vocabulary) -> str:
    return sort_text(sort, words).replace("Types.", "")  # type: ignore[arg-type]


def without_env_always(probe: str) -> str:
    """The probe for an implementation whose Env excludes something."""
    return probe[: probe.index(f"\n  lemma {ENV_ALWAYS}(")] + "}\n"


def _head(clause: Clause) -> str:
    return f"{clause.kind} {one_line(clause.name)}" + (f": {one_line(clause.sentence)}" if clause.sentence else "")
