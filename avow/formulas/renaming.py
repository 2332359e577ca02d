"""Bound variables: which a term mentions, and giving every quantifier names of its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping

from avow.language.terms import Quantified, Role, Term, Variable


def map_children(term: Term, change: Callable[[Term], Term]) -> Term:
    """The term with its direct subterms changed; a quantifier's variables stay."""
    return term.rebuild(tuple(map(change, term.children)))


def bound_names(term: Term) -> frozenset[str]:
    """The names of role BOUND that occur free in the term."""
    if isinstance(term, Variable):
        return frozenset((term.name,)) if term.role is Role.BOUND else frozenset()
    found: frozenset[str] = frozenset()
    for child in term.children:
        found |= bound_names(child)
    if isinstance(term, Quantified):
        found -= {v.name for v in term.variables}
    return found


def has_variables(term: Term) -> bool:
    """Whether any variable, of any role, occurs in the term."""
    stack = [term]
    while stack:
        term = stack.pop()
        if isinstance(term, Variable):
            return True
        stack.extend(term.children)
    return False


def rename_apart(term: Term) -> Term:
    """The same meaning, with no bound name used by two quantifiers or both bound and free."""
    used = set(bound_names(term))

    def visit(part: Term, names: Mapping[str, str]) -> Term:
        match part:
            case Variable(role=Role.BOUND, name=name) if name in names:
                return part if names[name] == name else dataclasses.replace(part, name=names[name])
            case Quantified(variables=variables):
                inner = dict(names)
                for variable in variables:
                    inner[variable.name] = _fresh(variable.name, used)
                    used.add(inner[variable.name])
                return dataclasses.replace(
                    part,
                    variables=tuple(dataclasses.replace(v, name=inner[v.name]) for v in variables),
                    body=visit(part.body, inner),
                )
            case _:  # binds nothing
                return map_children(part, lambda child: visit(child, names))

    return visit(term, {})


def _fresh(name: str, used: set[str]) -> str:
    candidate, k = name, 1
    while candidate in used:
        k += 1
        candidate = f"{name}~{k}"
    return candidate
