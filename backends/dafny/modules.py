"""The generated Dafny files of one node: its types, its contract, its specification, and a skeleton to fill in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from avow.backend_kit.stepping import stepping
from avow.base.plain import one_line
from avow.base.records import dataclass
from avow.formulas.formula import free_variables
from avow.formulas.temporal.cell import CELL
from avow.formulas.temporal.cells import remembers
from avow.language.contract import Clause, Node
from avow.language.operators import OPERATORS, Level
from avow.language.sorts import DataSort, EnumSort, OpaqueSort
from avow.language.terms import Variable
from avow.sanity.claims import triggers

from .history import ESTABLISHED, History, declared, history
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

_HELPERS = """\
  // Partial operations: nothing is known of what they yield outside their domains.
  function DivideByZero(a: real): real
  function Divide(a: real, b: real): real { if b != 0.0 then a / b else DivideByZero(a) }
  function Beyond<T>(s: seq<T>, i: int): T
  function Nth<T>(s: seq<T>, i: int): T { if 0 <= i < |s| then s[i] else Beyond(s, i) }
  // The integers from a to b, both included.
  function Upto(a: int, b: int): seq<int>
    decreases b - a
  { if b < a then [] else [a] + Upto(a + 1, b) }
"""
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
        if row.level is Level.ATOM and row.dafny.startswith("Types.")
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
    outline: str
    """The implementation's module, to be filled in."""
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

    def skeleton(self) -> str:
        """A first implementation, beside the generated files."""
        return f'include "{self.spec_file}"\n{self.outline}'

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
    clauses = list(zip(node.assumptions, assumed, strict=True)) + promised
    written = _contract(past, clauses, words, types_file)
    spec, ensures = _spec(node, past, assumed, promised, words, spec_module, contract_file, uncovered)
    probe, probe_ensures = _probe(node, past, assumed, promised, words, probe_module, impl_module)
    outline = _outline(past, inputs, outputs, words, spec_module, impl_module)
    types = _types(words)
    situations, excluded, conditions = _excluded(node, past, assumed, promised, words, impl_module)
    return Generated(
        node.name, spec_module, impl_module, types_file, contract_file, spec_file, impl_file, types, written,
        spec, outline, ensures, probe_module, probe, probe_ensures, tuple(uncovered), situations, excluded, conditions,
        bool(past.cells),
    )  # fmt: skip


def _excluded(
    node: Node,
    past: History,
    assumed: Sequence[tuple[Predicate, ...]],
    promised: Sequence[tuple[Clause, tuple[Predicate, ...]]],
    words: Vocabulary,
    impl_module: str,
) -> tuple[str, str, tuple[str, ...]]:
    """Predicates for conditions of guarantees, a module that checks what excludes them, and the guarantee of each."""
    taken = signature([p.variable for p in (*node.inputs, *node.outputs)], words)
    env = f"Implementation.Env({', '.join(words.local(p.variable) for p in node.inputs)})"
    sane = [f"    requires {past.call(p[-1], words)}" for p in assumed]
    predicates, lemmas, whose = list[str](), list[str](), list[str]()
    for clause, _ in promised:
        for situation in triggers(clause.formula):
            try:
                found = print_clause(f"{clause.name} condition {len(whose)}", situation, words)
            except NotExpressible:
                continue
            for predicate in found:
                predicates += declared(predicate, "bool", words)
            for name, more in ((BY_ENV, [f"    requires {env}"]), (ANYWAY, [])):
                lemmas += ["", f"  lemma {name}{len(whose)}({past.given(taken, program=False)})", *sane, *more]
                lemmas += [f"    ensures !{past.call(found[-1], words)}", "  { }"]
            whose.append(clause.name)
    head = ["  import Types", "  import Contract", f"  import Implementation = {impl_module}"]
    module = "\n".join([f"{_MODULE} {words.names.fresh('Excluded')} {{", *head, *lemmas, "}", ""])
    return "\n".join(predicates), module, tuple(whose)


def _types(words: Vocabulary) -> str:
    lines = ["// Generated: the types of the contract. Do not edit.", f"{_MODULE} Types {{"]
    # The types of constructors' parameters may add further types, so this is not a plain loop.
    done: set[object] = set()
    body: list[str] = []
    while pending := [sort for sort in words.types if sort not in done]:
        for sort in pending:
            done.add(sort)
            body.append(_type(sort, words))
    used = (f"  function {name}{rest}" for name, rest in _FUNCTIONS.items() if name in words.functions)
    return "\n".join([*lines, *body, _HELPERS.rstrip("\n"), *used, "}", ""])


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


def _contract(
    past: History, clauses: Sequence[tuple[Clause, tuple[Predicate, ...]]], words: Vocabulary, types_file: str
) -> str:
    lines = [
        "// Generated: one predicate for each clause of the contract, and one for each quantifier's body. Do not edit.",
        f'include "{types_file}"',
        f"{_MODULE} Contract {{",
        "  import Types",
        *past.contract(words),
    ]
    for clause, predicates in clauses:
        lines.append("")
        lines.append(f"  // {clause.kind} {one_line(clause.name)}" + _sentence(clause))
        for predicate in predicates:
            lines += declared(predicate, "bool", words)
    return "\n".join([*lines, "}", ""])


def _spec(
    node: Node,
    past: History,
    assumed: Sequence[tuple[Predicate, ...]],
    promised: Sequence[tuple[Clause, tuple[Predicate, ...]]],
    words: Vocabulary,
    spec_module: str,
    contract_file: str,
    uncovered: Sequence[tuple[str, str]],
) -> tuple[str, tuple[tuple[int, str], ...]]:
    inputs = signature([p.variable for p in node.inputs], words)
    outputs = signature([p.variable for p in node.outputs], words)
    env = f"Env({', '.join(words.local(p.variable) for p in node.inputs)})"
    lines = [
        f"// Generated: what an implementation of node {one_line(node.name)} must do. Do not edit.",
        *(
            f"// Not here: guarantee {one_line(name)}: Dafny has no counterpart for {one_line(why)}"
            for name, why in uncovered
        ),
        f'include "{contract_file}"',
        f"abstract {_MODULE} {spec_module} {{",
        "  import Types",
        "  import Contract",
        "",
        *past.specification(),
        "  // The implementer's: what else is assumed of the inputs (reported as an added assumption), or true.",
        f"  predicate Env({inputs})",
        "",
        "  // The implementer's: inputs that meet every assumption, so that nothing is proved of no case at all.",
        f"  lemma EnvNotEmpty({past.given('', program=False)}){f' returns ({inputs})' if inputs else ''}",
        *(("    requires Contract.Begins(h)",) if past.cells else ()),
        *(f"    ensures {past.call(p[-1], words)}" for p in assumed),
        f"    ensures {env}",
        "",
        f"  method Step({past.given(inputs)})" + (f" returns ({left})" if (left := past.left(outputs)) else ""),
        *(f"    requires {past.call(p[-1], words)}" for p in assumed),
        f"    requires {env}",
        *(("    requires Linked(h, m)",) if past.cells else ()),
    ]
    ensures = []
    for clause, predicates in promised:
        lines.append(f"    ensures {past.call(predicates[-1], words)}")
        ensures.append((len(lines), clause.name))
    if past.cells:
        lines.append(f"    ensures Linked({past.advanced(words)}, n)")
    return "\n".join([*lines, "}", ""]), tuple(ensures)


def _probe(
    node: Node,
    past: History,
    assumed: Sequence[tuple[Predicate, ...]],
    promised: Sequence[tuple[Clause, tuple[Predicate, ...]]],
    words: Vocabulary,
    probe_module: str,
    impl_module: str,
) -> tuple[str, tuple[tuple[int, str], ...]]:
    taken = signature([p.variable for p in node.inputs], words)
    given = signature([p.variable for p in node.outputs], words)
    arguments = ", ".join(words.local(p.variable) for p in node.inputs)
    results = ", ".join(words.local(p.variable) for p in node.outputs)
    sane = [f"    requires {past.call(p[-1], words)}" for p in assumed]
    left = past.left(given, "Implementation.Memory")
    asked = past.given(taken).replace("m: Memory", "m: Implementation.Memory", 1)
    passed = ", ".join((*(("h", "m") if past.cells else ()), *((arguments,) if arguments else ())))
    found = ", ".join((*(("n",) if past.cells else ()), *((results,) if results else ())))
    lines = [
        f"// Generated: {impl_module} used from outside. Do not edit.",
        f"{_MODULE} {probe_module} {{",
        "  import Types",
        "  import Contract",
        f"  import Implementation = {impl_module}",
        "",
        f"  method {CALL}({asked})" + (f" returns ({left})" if left else ""),
        *sane,
        f"    requires Implementation.Env({arguments})",
        *(("    requires Implementation.Linked(h, m)",) if past.cells else ()),
    ]
    ensures = []
    for clause, predicates in promised:
        lines.append(f"    ensures {past.call(predicates[-1], words)}")
        ensures.append((len(lines), clause.name))
    if past.cells:
        lines.append(f"    ensures Implementation.Linked({past.advanced(words)}, n)")
    lines.append(f"  {{ {f'{found} := ' if found else ''}Implementation.Step({passed}); }}")
    lines += past.probe()
    lines += [
        "",
        f"  lemma {ENV_ALWAYS}({past.given(taken, program=False)})",
        *sane,
        f"    ensures Implementation.Env({arguments})",
        "  { }",
    ]
    return "\n".join([*lines, "}", ""]), tuple(ensures)


def without_env_always(probe: str) -> str:
    """The probe for an implementation whose Env excludes something."""
    return probe[: probe.index(f"\n  lemma {ENV_ALWAYS}(")] + "}\n"


def _outline(
    past: History,
    inputs: Sequence[Variable],
    outputs: Sequence[Variable],
    words: Vocabulary,
    spec_module: str,
    impl_module: str,
) -> str:
    taken = signature(inputs, words)
    given = signature(outputs, words)
    lines = [
        f"{_MODULE} {impl_module} refines {spec_module} {{",
        *past.skeleton(),
        f"  predicate Env({taken}) {{ true }}",
        "",
        f"  lemma EnvNotEmpty({past.given('', program=False)}){f' returns ({taken})' if taken else ''}",
        "  {",
        "    // give inputs that meet every assumption",
        "  }",
        "",
        f"  method Step({past.given(taken)})" + (f" returns ({left})" if (left := past.left(given)) else ""),
        "  {",
        "    // set the outputs; name the witnesses of existential guarantees, for example",
        "    // assert Contract.guarantee_ex1(…, witness);",
        "  }",
        "}",
        "",
    ]
    return "\n".join(lines)


def _sentence(clause: Clause) -> str:
    return f": {one_line(clause.sentence)}" if clause.sentence else ""
