"""Bound variables: those that a term mentions, and renaming so that every quantifier has its own names."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping

from avow.formulas.formula import free_variables, fresh
from avow.language.subterms import subterms
from avow.language.terms import Quantified, Role, Term, Variable


def map_children(term: Term, change: Callable[[Term], Term]) -> Term:
    """The term with its direct subterms changed; a quantifier's variables are kept."""
    return term.rebuild(tuple(map(change, term.children)))


def bound_names(term: Term) -> frozenset[str]:
    """The names of role BOUND that occur free in the term."""
    return frozenset(v.name for v in free_variables(term) if v.role is Role.BOUND)


def rename_apart(term: Term, taken: Iterable[str] = ()) -> Term:
    """The same meaning, with no bound name used by two quantifiers, both bound and free, or among those `taken`."""
    if not any(isinstance(part, Quantified) for part in subterms(term)):
        return term
    used = {*bound_names(term), *taken}

    def renamed(part: Term, names: Mapping[str, str]) -> Term:
        if isinstance(part, Variable):
            name = names.get(part.name, part.name) if part.role is Role.BOUND else part.name
            return part if name == part.name else dataclasses.replace(part, name=name)
        if isinstance(part, Quantified):
            names = dict(names)
            for variable in part.variables:
                names[variable.name] = fresh(variable.name, used)
                used.add(names[variable.name])
        children = tuple(renamed(child, names) for child in part.children)
        if isinstance(part, Quantified):
            variables = tuple(dataclasses.replace(v, name=names[v.name]) for v in part.variables)
            return dataclasses.replace(part, variables=variables, body=children[0])
        return part.rebuild(children) if children else part

    return renamed(term, {})
