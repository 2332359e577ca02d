"""The generated Dafny files of one node: its types, its contract, its specification, and a skeleton to fill in."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

from avow.formulas.formula import free_variables
from avow.language.contract import Clause, Node
from avow.language.operators import OPERATORS, Level
from avow.language.sorts import DataSort, EnumSort, OpaqueSort
from avow.language.terms import Variable

from .names import RESERVED, Names, file_stem, identifier
from .printer import NotExpressible, Predicate, Vocabulary, call, print_clause, sort_text

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
"""Functions that are generated where a formula uses them: of each operator that is one, for each type it has."""


def _complete() -> None:
    """Raises where the table of operators names a function that would not be generated, or whose name is not kept."""
    wanted = {
        f"{row.dafny.removeprefix('Types.')}{kind}"
        for row in OPERATORS.values()
        if row.level is Level.ATOM and row.dafny.startswith("Types.")
        for kind in (("Bool",) if row.typing.startswith("formula") else ("Int", "Real"))
    }
    missing = wanted - set(_FUNCTIONS)
    unkept = set(_FUNCTIONS) - RESERVED
    if missing or unkept:
        raise TypeError(
            f"Dafny functions without a text: {sorted(missing)}; names that are not reserved: {sorted(unkept)}"
        )


_complete()


@dataclass(frozen=True, slots=True)
class Generated:
    """Everything for one node. `ensures` maps a line of the specification to the guarantee that stands there."""

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
    ensures: tuple[tuple[int, str], ...]
    probe_module: str
    probe: str
    """A module of Avow's own that calls the implementation from outside, by its qualified name: that its Step gives
    what the contract wants, and that its Env asks nothing, is then said of what Dafny takes these names for."""
    probe_ensures: tuple[tuple[int, str], ...]
    """The same map for its `ensures`."""
    uncovered: tuple[tuple[str, str], ...]
    """Guarantees that cannot be expressed, with the reason."""


PROBE_FILE = "probe.dfy"
ENV_ALWAYS, CALL = "EnvAlways", "Call"


def generate(node: Node, guarantees: Sequence[str]) -> Generated:
    """The files for some guarantees of a node. Raises NotExpressible for an assumption or port without counterpart."""
    names = Names()
    inputs = tuple(port.variable for port in node.inputs)
    outputs = tuple(port.variable for port in node.outputs)
    words = Vocabulary(names, Names(), inputs + outputs)
    stem = file_stem(node.name)
    title = identifier(node.name).replace("'", "")
    title = title[:1].upper() + title[1:]
    spec_module, impl_module = names.fresh(f"{title}Spec"), names.fresh(f"{title}Impl")
    probe_module = names.fresh(f"{title}Probe")
    for clause in node.clauses:  # clauses first: they keep their names whatever their quantifiers are called
        names("clause", clause.name)
    for port in inputs + outputs:
        words.local(port)
        sort_text(port.sort, words)
    for clause in node.assumptions:
        if told := [v.name for v in free_variables(clause.formula) if v in outputs]:
            raise NotExpressible(f"assumption {clause.name}: it speaks of the output {told[0]}", clause.span)
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
    contract = _contract(node, clauses, words, types_file)
    spec, ensures = _spec(node, assumed, promised, words, spec_module, contract_file)
    probe, probe_ensures = _probe(node, assumed, promised, words, probe_module, impl_module)
    skeleton = _skeleton(inputs, outputs, words, spec_module, impl_module, spec_file)
    return Generated(
        node.name, spec_module, impl_module, types_file, contract_file, spec_file, impl_file, _types(words), contract,
        spec, skeleton, ensures, probe_module, probe, probe_ensures, tuple(uncovered),
    )  # fmt: skip


def lines_map(generated: Generated) -> str:
    """The line-to-guarantee map, as it stands beside the files."""
    data = {
        "file": generated.spec_file,
        "ensures": {str(line): name for line, name in generated.ensures},
        "not covered": dict(generated.uncovered),
    }
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"


def signature(variables: Sequence[Variable], words: Vocabulary) -> str:
    return ", ".join(f"{words.local(v)}: {sort_text(v.sort, words)}" for v in variables)


def _types(words: Vocabulary) -> str:
    lines = ["// Generated: the types of the contract. Do not edit.", f"{_MODULE} Types {{"]
    # Asking for the types of constructors' parameters may bring further types in, so this is no plain loop.
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
    node: Node, clauses: Sequence[tuple[Clause, tuple[Predicate, ...]]], words: Vocabulary, types_file: str
) -> str:
    lines = [
        "// Generated: one predicate for each clause of the contract, and one for each quantifier's body. Do not edit.",
        f'include "{types_file}"',
        f"{_MODULE} Contract {{",
        "  import Types",
    ]
    for clause, predicates in clauses:
        lines.append("")
        lines.append(f"  // {clause.kind} {one_line(clause.name)}" + _sentence(clause))
        for predicate in predicates:
            lines.append(f"  predicate {predicate.name}({signature(predicate.parameters, words)})")
            lines.append(f"  {{ {predicate.body} }}")
    return "\n".join([*lines, "}", ""])


def _spec(
    node: Node,
    assumed: Sequence[tuple[Predicate, ...]],
    promised: Sequence[tuple[Clause, tuple[Predicate, ...]]],
    words: Vocabulary,
    spec_module: str,
    contract_file: str,
) -> tuple[str, tuple[tuple[int, str], ...]]:
    inputs = signature([p.variable for p in node.inputs], words)
    outputs = signature([p.variable for p in node.outputs], words)
    env = f"Env({', '.join(words.local(p.variable) for p in node.inputs)})"
    lines = [
        f"// Generated: what an implementation of node {one_line(node.name)} must do. Do not edit.",
        f'include "{contract_file}"',
        f"abstract {_MODULE} {spec_module} {{",
        "  import Types",
        "  import Contract",
        "",
        "  // The implementer's: what else is assumed of the inputs (reported as an added assumption), or true.",
        f"  predicate Env({inputs})",
        "",
        "  // The implementer's: inputs that meet every assumption, so that nothing is proved of no case at all.",
        f"  lemma EnvNotEmpty(){f' returns ({inputs})' if inputs else ''}",
        *(f"    ensures {call(p[-1], words, 'Contract.')}" for p in assumed),
        f"    ensures {env}",
        "",
        f"  method Step({inputs})" + (f" returns ({outputs})" if outputs else ""),
        *(f"    requires {call(p[-1], words, 'Contract.')}" for p in assumed),
        f"    requires {env}",
    ]
    ensures = []
    for clause, predicates in promised:
        lines.append(f"    ensures {call(predicates[-1], words, 'Contract.')}")
        ensures.append((len(lines), clause.name))
    return "\n".join([*lines, "}", ""]), tuple(ensures)


def _probe(
    node: Node,
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
    sane = [f"    requires {call(p[-1], words, 'Contract.')}" for p in assumed]
    lines = [
        f"// Generated: {impl_module} used from outside. Do not edit.",
        f"{_MODULE} {probe_module} {{",
        "  import Types",
        "  import Contract",
        f"  import Implementation = {impl_module}",
        "",
        f"  method {CALL}({taken})" + (f" returns ({given})" if given else ""),
        *sane,
        f"    requires Implementation.Env({arguments})",
    ]
    ensures = []
    for clause, predicates in promised:
        lines.append(f"    ensures {call(predicates[-1], words, 'Contract.')}")
        ensures.append((len(lines), clause.name))
    lines.append(f"  {{ {f'{results} := ' if results else ''}Implementation.Step({arguments}); }}")
    lines += [
        "",
        f"  lemma {ENV_ALWAYS}({taken})",
        *sane,
        f"    ensures Implementation.Env({arguments})",
        "  { }",
    ]
    return "\n".join([*lines, "}", ""]), tuple(ensures)


def without_env_always(probe: str) -> str:
    """The probe for an implementation whose Env asks for something."""
    return probe[: probe.index(f"\n  lemma {ENV_ALWAYS}(")] + "}\n"


def _skeleton(
    inputs: Sequence[Variable],
    outputs: Sequence[Variable],
    words: Vocabulary,
    spec_module: str,
    impl_module: str,
    spec_file: str,
) -> str:
    taken = signature(inputs, words)
    given = signature(outputs, words)
    lines = [
        "// A skeleton: copy it into the system's models/ and fill it in. Nothing is ever written over it there.",
        f'include "{spec_file}"',
        f"{_MODULE} {impl_module} refines {spec_module} {{",
        f"  predicate Env({taken}) {{ true }}",
        "",
        f"  lemma EnvNotEmpty(){f' returns ({taken})' if taken else ''}",
        "  {",
        "    // give inputs that meet every assumption",
        "  }",
        "",
        f"  method Step({taken})" + (f" returns ({given})" if given else ""),
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


def one_line(text: str) -> str:
    """Text of the contract within a line, such as a comment: no line break may end it early."""
    return "".join(c if c.isprintable() else " " for c in text)
