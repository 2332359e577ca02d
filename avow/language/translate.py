"""A contract in other notations: RCL again, Unicode mathematics, JSON.

The caller adds further notations that need more than the language layer (SMT-LIB, a backend's own):
`avow.cli.translate` holds the whole table. The JSON is a notation, too: the kind and sort of each node for other
programs, and formulas also as text. It is not read back.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

from avow.base.codec import document, plain
from avow.base.diagnostics import Diagnostic, Rejected
from avow.language.contract import Clause, Contract, Port, Topic
from avow.language.definitions import show_clause
from avow.language.format import format_text
from avow.language.lexer import quote
from avow.language.load import check_text
from avow.language.nodes import PARAMETER
from avow.language.printer import show_number, show_sort, show_term, show_type
from avow.language.sorts import BOOL
from avow.language.terms import TRUE, Conditional, Literal, Term


def to_rcl(contract: Contract) -> str:
    """The contract as an RCL file, which reads back as the equal contract. Constants are expanded in formulas.

    Raises `Rejected` if that text could not be read: a formula is nested too deeply, or a constant denotes an element
    whose name a port of the node has.
    """
    out: list[str] = []
    declarations = list(_declarations(contract))
    if declarations:
        out += ["context {", *declarations, "}", ""]
    for node in contract.nodes:
        out += [f"node {node.name} {{"]
        for word, ports in (("inputs", node.inputs), ("outputs", node.outputs)):
            shown = ", ".join(f"{_called(p)} : {_typed(p)}" for p in ports)
            out.append(f"  {word}( {shown} )" if shown else f"  {word}()")
        topics = ",\n          ".join(_topic(t) for t in node.topics)
        out.append(f"  topics( {topics} )" if topics else "  topics()")
        out += [f"  {show_term(c.formula, 'rcl')}" for c in node.guarantees if _is_own_section(c)]
        for clause in node.clauses:
            if _is_own_section(clause) or clause.name in node.implied:
                continue
            word = "assume" if clause in node.assumptions else "guarantee"
            claim = clause.formula if clause.chance is None else clause.chance.claim
            out.append(f"  {word}{_head(clause)}( {show_term(claim, 'rcl')} )")
        out += ["}", ""]
    try:
        text = format_text("\n".join(out), "contract.rcl")
        faults = tuple(d for d in check_text(text, "contract.rcl")[1] if d.is_error)
    except Rejected as rejected:
        text, faults = "", rejected.diagnostics
    if faults:
        place = contract.nodes[0].span if contract.nodes else None
        hint = "rename what has two meanings, or split the deepest clause"
        first = f"with its constants written out, the contract is no RCL: {faults[0].message}"
        raise Rejected(Diagnostic(faults[0].code, first, place, hint=hint))
    return text


def _is_own_section(clause: Clause) -> bool:
    """Whether a clause is written as ``steps(every 20 ms)``."""
    return clause.pace is not None and clause.name == "steps" and clause.sentence is None


def _declarations(contract: Contract) -> Iterator[str]:
    """The context's lines, in an order that preserves those of the types and of the constants."""
    names, constants = dict(contract.types).keys(), dict(contract.constants)
    waiting = iter(contract.constants)
    for name, sort in contract.types:
        if name not in constants:
            yield f"  {name} : {show_sort(sort, named=names - {name})};"
            continue
        for constant, term in waiting:  # an enumeration given as a constant: first the constants before it
            if constant == name:
                break
            yield f"  {constant} = {_value(term)};"
        yield f"  {name} = {show_type(sort)};"
    for constant, term in waiting:
        yield f"  {constant} = {_value(term)};"


def _value(term: Term) -> str:
    """A constant's value in the form of a declaration: a formula has parentheses."""
    shown = show_term(term, "rcl")
    bare = isinstance(term, Conditional) or (term.sort == BOOL and not isinstance(term, Literal))
    return f"({shown})" if bare else shown


def _called(port: Port) -> str:
    return f"{PARAMETER} {port.name}" if port.parameter else port.name


def _typed(port: Port) -> str:
    return f"{port.type_name} in {port.unit}" if port.unit else port.type_name


def _head(clause: Clause) -> str:
    letter = "A" if clause.kind == "assumption" else "G"
    name = "" if clause.name == f"{letter}{clause.position}" else f" {clause.name}"
    said = name + (f" {quote(clause.sentence)} " if clause.sentence is not None else "")
    if (chance := clause.chance) is None:
        return said
    given = f"given ( {show_term(chance.given, 'rcl')} ) " if chance.given != TRUE else ""
    least = show_number(chance.least)[0]
    return f"{said} with probability >= {least} {'per run ' * chance.per_run}{given}"


def _topic(topic: Topic) -> str:
    matched = f" matches({topic.port.role}.{topic.port.name})" if topic.port is not None else ""
    frame = f" in {topic.frame}" if topic.frame else ""
    return f"{topic.ros_type} {topic.name}{frame}{matched}"


# --- for people ------------------------------------------------------------------------------------------------------


def to_unicode(contract: Contract) -> str:
    """The contract in mathematical notation."""
    out: list[str] = []
    if contract.types:
        out.append("Types")
        out += [f"  {name} : {show_type(sort, 'unicode')}" for name, sort in contract.types]
        out.append("")
    scalar = [(n, t) for n, t in contract.constants if n not in dict(contract.types)]
    if scalar:
        out += ["Constants", *(f"  {name} = {show_term(term)}" for name, term in scalar), ""]
    for node in contract.nodes:
        out.append(f"Node {node.name}")
        for word, ports in (("Inputs", node.inputs), ("Outputs", node.outputs)):
            out.append(f"  {word}: {', '.join(f'{_called(p)} : {_typed(p)}' for p in ports) or 'none'}")
        if node.topics:
            out.append("  Topics")
            out += [f"    {_topic(t)}" for t in node.topics]
        for word, clauses in (("Assumes", node.assumptions), ("Guarantees", node.guarantees)):
            if clauses:
                out.append(f"  {word}")
            for clause in clauses:
                out.append(f"    {clause.name}" + (f": {clause.sentence}" if clause.sentence else ""))
                out.append(f"      {show_clause(clause, node)}")
        out.append("")
    return "\n".join(out)


# --- for machines ----------------------------------------------------------------------------------------------------


def to_json(contract: Contract) -> str:
    """The contract as data: its dataclasses, without places, each with its `kind`. The sort of a port or term is its
    declared name, or written out."""
    named = dict(contract.types).keys()

    def data(value: Any) -> Any:
        if isinstance(value, tuple):
            return [data(item) for item in value]
        if not dataclasses.is_dataclass(value):
            return plain(value)
        found: dict[str, Any] = {"kind": type(value).__name__.removesuffix("Sort").lower()}
        for field in dataclasses.fields(value):
            part = getattr(value, field.name)
            if field.name == "sort":
                found["sort"] = show_sort(part, named=named)
            elif field.name not in _INTERNAL and (field.name != "chance" or part is not None):
                found[field.name] = data(part)
        return found

    return document(data(contract)) + "\n"


_INTERNAL = ("files", "span", "sentence_span", "written", "relay")
