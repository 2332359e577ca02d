"""Local definitions: expanded in the formulas that use them, and folded back when a formula is shown to people.

Engines do not see definitions: the terms that they work on, and the digests of these, have them expanded.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from avow.base.diagnostics import Span
from avow.base.remembered import by_identity
from avow.language.contract import Clause, Definition, Node
from avow.language.printer import StyleName, show_number, show_term
from avow.language.sorts import FunctionSort
from avow.language.subterms import subterms
from avow.language.terms import TRUE, Apply, Quantified, Role, Term, Variable


def expand(
    definition: Definition, given: Sequence[Term], span: Span | None = None, taken: Callable[[str], bool] | None = None
) -> Term:
    """The body with these terms in place of the parameters, at one place in the text. Its quantified variables are
    renamed if their names are `taken` there."""
    named = {part.name for part in subterms(definition.body) if isinstance(part, Variable)}
    free = {part.name for term in given for part in subterms(term) if isinstance(part, Variable)}

    def new(variable: Variable) -> Variable:
        name = variable.name
        while name in free or (taken is not None and taken(name)) or (name != variable.name and name in named):
            name += "'"
        return Variable(Role.BOUND, name, variable.sort, span)

    def put(term: Term, values: Mapping[Variable, Term]) -> Term:
        match term:
            case Variable() if term in values:
                return values[term]
            case Quantified(quantifier=quantifier, variables=variables, body=body):
                inner = {v: new(v) for v in variables}
                return Quantified(quantifier, tuple(inner.values()), put(body, {**values, **inner}), span)
            case _:  # the parameters are in its parts
                parts = tuple(put(child, values) for child in term.children)
                return replace(term.rebuild(parts) if parts else term, span=span)

    return put(definition.body, dict(zip(definition.parameters, given, strict=True)))


@by_identity(20_000)
def show_clause(clause: Clause, node: Node, style: StyleName = "unicode") -> str:
    """The clause's formula for people: instances of the definitions that its text uses are shown by name, followed by
    the definitions."""
    known = used(clause.text, node.definitions)

    def said(term: Term) -> str:
        return show_term(folded(term, known), style)

    shown = said(clause.formula)
    if (chance := clause.chance) is not None:
        given = f" given {said(chance.given)}" if chance.given != TRUE else ""
        least = show_number(chance.least)[0]
        shown = f"{said(chance.claim)}{given}, with probability ≥ {least}{' per run' * chance.per_run}"
    return ", where ".join((shown, "; ".join(_said(d, known, style) for d in known))) if known else shown


def _said(definition: Definition, known: Sequence[Definition], style: StyleName) -> str:
    body = folded(definition.body, [d for d in known if d is not definition])
    return f"{show_term(_by_name(definition, definition.parameters), style)} = {show_term(body, style)}"


def used(text: str, definitions: Iterable[Definition]) -> tuple[Definition, ...]:
    """The definitions that a text names, directly or through other definitions."""
    found: list[Definition] = []
    waiting, left = [text], list(definitions)
    while waiting:
        words = set(re.findall(r"[A-Za-z_][A-Za-z0-9_']*", waiting.pop()))
        named = [d for d in left if d.name in words]
        left = [d for d in left if d not in named]
        waiting += [d.text for d in named]
        found += named
    return tuple(found)


def folded(term: Term, definitions: Sequence[Definition]) -> Term:
    """The term with each instance of a definition's body shown by name: for printers, never for an engine."""
    for definition in definitions:
        values: dict[Variable, Term] = {}
        if definition.body.children and _matches(definition.body, term, set(definition.parameters), values, {}):
            if values.keys() != set(definition.parameters):
                continue
            given = tuple(folded(values[p], definitions) for p in definition.parameters)
            return _by_name(definition, given, term.span)
    parts = tuple(folded(child, definitions) for child in term.children)
    return term.rebuild(parts) if parts else term


def _by_name(definition: Definition, given: tuple[Term, ...], span: Span | None = None) -> Term:
    sort = definition.body.sort
    if not given:
        return Variable(Role.BOUND, definition.name, sort, span)
    function = FunctionSort(tuple(p.sort for p in definition.parameters), sort)
    return Apply(Variable(Role.BOUND, definition.name, function), given, sort, span)


def _matches(
    body: Term,
    term: Term,
    parameters: set[Variable],
    values: dict[Variable, Term],
    bound: Mapping[Variable, Variable],
) -> bool:
    """Whether a term is the body with some `values` of the parameters; `bound` are the body's quantified variables."""
    if isinstance(body, Variable):
        if body in parameters:
            inside = {part for part in subterms(term) if isinstance(part, Variable)} & set(bound.values())
            return not inside and values.setdefault(body, term) == term and term.sort == body.sort
        return bound.get(body, body) == term
    if type(body) is not type(term) or len(body.children) != len(term.children):
        return False
    inner = dict(bound)
    if isinstance(body, Quantified) and isinstance(term, Quantified):
        if [v.sort for v in body.variables] != [v.sort for v in term.variables]:
            return False
        inner.update(zip(body.variables, term.variables, strict=True))
        body = replace(body, variables=term.variables)
    same = body.rebuild(term.children) if body.children else body
    return same == term and all(
        _matches(one, other, parameters, values, inner) for one, other in zip(body.children, term.children, strict=True)
    )
