"""The sorts of names, and expressions as the core's typed terms.

Expressions are RCL's own, and RCL's checker types them, except for what a program cannot compute. A name's sort comes
from a declaration, the plan's table, the ports, or what is assigned. A name without a sort is reported where it is
used.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from typing import assert_never

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.optional import complete
from avow.base.records import dataclass
from avow.base.suggestions import did_you_mean
from avow.language import sorts as s
from avow.language import syntax as rcl
from avow.language import terms as t
from avow.language.checker import Checker
from avow.language.conversions import widen, widest
from avow.language.lexer import Token
from avow.language.operators import OPERATORS, Why
from avow.language.printer import show_sort
from avow.language.scope import Environment, Scope
from avow.language.source import Reports, Source

from . import syntax
from .program import variable

_NUMBERS: tuple[s.Sort, ...] = (s.NATURAL, s.INTEGER, s.REAL)


@dataclass(slots=True)
class Names:
    """The contract's names, and the sort of every name of the program that is known so far."""

    environment: Environment
    sorts: dict[str, s.Sort] = field(default_factory=dict)
    inferred: set[str] = field(default_factory=set)
    """Those whose sort comes from assignments, and may still widen."""

    def type(self, word: str) -> s.Sort | None:
        return s.BUILTINS.get(word) or self.environment.sort(word)

    def unknown_type(self, word: str, span: Span) -> Diagnostic:
        hint = did_you_mean(word, [*s.BUILTINS, *self.environment.types])
        return Diagnostic("HOARE200", f"there is no type `{word}`", span, hint=hint)

    def is_value(self, name: str) -> bool:
        """Whether the contract has a value or a constructor of this name."""
        return name in self.environment.constants or name in self.environment.elements

    def parameters(self, constructor: str) -> tuple[s.Sort, ...] | None:
        """None if it is no constructor of a data type."""
        sort = self.environment.elements.get(constructor)
        return sort.constructor(constructor).parameters if isinstance(sort, s.DataSort) else None


Local = Mapping[str, s.Sort]
"""The variables of patterns, arguments and quantifiers around an expression."""


class Expressions(Checker):
    """`ports` are the terms for ``in.…``, in assertions; None elsewhere. `asserts`: quantifiers are allowed."""

    def __init__(
        self,
        names: Names,
        text: Source,
        local: Local,
        ports: Mapping[str, t.Term] | None = None,
        *,
        asserts: bool = False,
    ) -> None:
        bound = {name: variable(name, sort) for name, sort in (*names.sorts.items(), *local.items())}
        super().__init__(Scope(names.environment, bound=bound), Reports(text))
        self.ports, self.asserts = ports, asserts
        self.found: list[Diagnostic] = []

    def read(self, tree: rcl.TermSyntax, sort: s.Sort | None = None) -> t.Term:
        """The term, of a sort if that is given. Raises Rejected (codes ``HOARE200``, ``HOARE300``)."""
        made = self.term(tree) if sort is None else self.wanted(tree, sort, "this")
        if made is None or self.found:
            raise Rejected(*dict.fromkeys(self.found))
        return made

    def error(
        self,
        code: str,
        message: str,
        at: rcl.Syntax | Token,
        *,
        hint: str | None = None,
        notes: tuple[tuple[str, Span | None], ...] = (),
    ) -> None:
        if code not in ("HOARE200", "HOARE300"):  # RCL's: names are 2xx, types are 3xx
            code = "HOARE200" if code.startswith("RCL2") else "HOARE300"
        self.found.append(Diagnostic(code, message, self.span(at), hint=hint))

    def wanted(self, tree: rcl.TermSyntax, sort: s.Sort, what: str) -> t.Term | None:
        made = self.term(tree, sort)
        fitted = None if made is None else fit(made, sort)
        if made is not None and fitted is None:
            message = f"{what} is {show_sort(made.sort)}, but {show_sort(sort)} is wanted here"
            self.error("HOARE300", message, tree)
        return fitted

    def compare(
        self,
        tree: rcl.Comparison,
        relation: Token,
        left_tree: rcl.TermSyntax,
        left: t.Term,
        right_tree: rcl.TermSyntax,
        right: t.Term,
    ) -> t.Term | None:
        made = super().compare(tree, relation, left_tree, left, right_tree, right)
        if isinstance(made, t.Compare) and isinstance(made.left.sort, s.FunctionSort):
            self.error("HOARE300", "whole functions cannot be compared", tree)
            return None
        if isinstance(made, t.Compare) and made.left.sort == s.BOOL:
            alike = t.Iff(made.left, made.right, made.span)
            return alike if made.operator == "==" else t.Not(alike, made.span)
        return made

    def sequence(self, tree: rcl.SequenceDisplay, expected: s.Sort | None) -> t.Term | None:
        if not tree.items and not isinstance(expected, s.SequenceSort):
            self.error(
                "HOARE300", "nothing says of what this sequence is", tree, hint="declare the variable: VAR s : T;"
            )
            return None
        return super().sequence(tree, expected)

    def undeclared(self, name: str, tree: rcl.Syntax, what: str = "name", *, text: bool = False) -> None:
        message = f"nothing is called `{name}` here, or nothing says of which sort it is"
        declare = "declare it (VAR name : REAL; or GIVEN name : REAL;) or map it to a port in the plan"
        self.error("HOARE200", message, tree, hint=did_you_mean(name, self.scope.known()) or declare)

    def port(self, role: t.Role, name: str, tree: rcl.Syntax) -> t.Term | None:
        if self.ports is not None and role is t.Role.INPUT:
            if name not in self.ports:
                hint = did_you_mean(name, self.ports)
                self.error("HOARE200", f"the node has no input `{name}`", tree, hint=hint)
            return self.ports.get(name)
        what = "assertions only (INVARIANT)" if role is t.Role.INPUT else "the contract only"
        self.error("HOARE200", f"`{role}.{name}` belongs into {what}: a program has variables", tree)
        return None

    def quantified(self, tree: rcl.Quantification) -> t.Term | None:
        if not self.asserts:
            self.error("HOARE300", f"a program cannot compute {tree.quantifier}", tree)
            return None
        return super().quantified(tree)

    def history(
        self,
        tree: rcl.TermSyntax,
        operator: t.Past,
        arguments: Sequence[rcl.TermSyntax],
        limit: rcl.LimitSyntax | None = None,
    ) -> t.Term | None:
        return self._lacks(tree, operator)

    def builtin_operation(
        self, tree: rcl.Syntax, name: t.Builtin, arguments: Sequence[rcl.TermSyntax]
    ) -> t.Term | None:
        return self._lacks(tree, name)

    def product_of_vectors(self, tree: rcl.Syntax, name: str, arguments: Sequence[rcl.TermSyntax]) -> t.Term | None:
        return self._lacks(tree, name)

    def _lacks(self, tree: rcl.Syntax, name: str) -> t.Term | None:
        why = OPERATORS[name].program if name in OPERATORS else None
        self.error("HOARE200", f"a program has no `{name}`{f': {why.reason}' if isinstance(why, Why) else ''}", tree)
        return None


def fit(given: t.Term, sort: s.Sort) -> t.Term | None:
    """The term as one of the sort: integers widen to REAL, INTEGER passes for NATURAL (a condition is proved of it).
    None if it is of another sort."""
    if given.sort == sort or {given.sort, sort} == {s.INTEGER, s.NATURAL}:
        return given
    if sort == s.REAL and given.sort in _NUMBERS:
        return widen(given)
    match given, sort:  # what is written out widens part by part
        case t.TupleTerm(items=items), s.TupleSort(items=sorts) if len(items) == len(sorts):
            parts: list[t.Term] | None = complete(map(fit, items, sorts))
            return None if parts is None else t.TupleTerm(tuple(parts), sort, given.span)
        case t.SequenceTerm(items=items), s.SequenceSort(item=part):
            parts = complete(fit(item, part) for item in items)
            return None if parts is None else t.SequenceTerm(tuple(parts), sort, given.span)
    return None


def fitted(given: t.Term, sort: s.Sort, span: Span | None) -> t.Term:
    """As `fit`. Raises Rejected."""
    made = fit(given, sort)
    if made is None:
        raise rejected("HOARE300", f"this is {show_sort(given.sort)}, but {show_sort(sort)} is wanted here", span)
    return made


def rejected(code: str, message: str, span: Span | None, hint: str | None = None) -> Rejected:
    return Rejected(Diagnostic(code, message, span, hint=hint))


# -- the sorts of names ------------------------------------------------------------------------------------------------


def expect(tree: rcl.TermSyntax, sort: s.Sort, names: Names, text: Source) -> None:
    """Give unknown names the sort that the place asks for: `f(i)` for a REAL makes f a function to REAL."""
    match tree:
        case rcl.Name(text=name) if not names.is_value(name):
            names.sorts.setdefault(name, sort)
        case rcl.TupleDisplay(items=items) if isinstance(sort, s.TupleSort):
            for item, part in zip(items, sort.items, strict=False):
                expect(item, part, names, text)
        case rcl.SequenceDisplay(items=items) if isinstance(sort, s.SequenceSort):
            for item in items:
                expect(item, sort.item, names, text)
        case rcl.Application(function=rcl.Name(text=name), arguments=arguments):
            parameters = names.parameters(name)
            if parameters is not None:
                for argument, parameter in zip(arguments, parameters, strict=False):
                    expect(argument, parameter, names, text)
            elif name not in names.sorts and name != "length":
                known: list[s.Sort] | None = complete(_estimate(argument, names, text, {}) for argument in arguments)
                if known is not None:
                    names.sorts[name] = s.FunctionSort(tuple(known), sort)
        case _:  # says nothing of a name's sort
            pass


def _estimate(tree: rcl.TermSyntax, names: Names, text: Source, local: Local) -> s.Sort | None:
    """The sort of an expression, as far as its names' sorts are known."""
    made = Expressions(names, text, local).term(tree)
    return None if made is None else made.sort


def spread(source: syntax.ProgramText, names: Names) -> None:
    """Sorts of assigned variables, from what is assigned to them, until nothing more is learnt."""
    fixed = frozenset(names.sorts) - names.inferred
    learnt = True
    while learnt:
        learnt = False
        for statement, local in assignments(source.body, names):
            name = statement.target.name
            if statement.arguments or name in fixed or name in local:
                continue
            old, new = names.sorts.get(name), _estimate(statement.value, names, source.text, local)
            if old is not None and new is not None:
                new = widest(old, new)  # of sorts that do not fit, the first stays
            if new is not None and new != old:
                names.sorts[name] = new
                names.inferred.add(name)
                learnt = True


def assignments(body: tuple[syntax.Statement, ...], names: Names) -> Iterator[tuple[syntax.Assign, Local]]:
    """Every assignment, with the sorts of the MATCH variables around it."""
    stack: list[tuple[syntax.Statement, Local]] = [(statement, {}) for statement in reversed(body)]
    while stack:
        statement, local = stack.pop()
        match statement:
            case syntax.Assign():
                yield statement, local
            case syntax.If(then=then, otherwise=otherwise):
                stack.extend((statement, local) for statement in reversed((*then, *otherwise)))
            case syntax.Match(constructor=constructor, variables=variables, then=then, otherwise=otherwise):
                parameters = names.parameters(constructor.name) or ()
                inner = {**local, **{v.name: p for v, p in zip(variables, parameters, strict=False)}}
                stack.extend((statement, local) for statement in reversed(otherwise))
                stack.extend((statement, inner) for statement in reversed(then))
            case syntax.While(body=inside):
                stack.extend((statement, local) for statement in reversed(inside))
            case syntax.Skip():  # holds no statement
                pass
            case _:
                assert_never(statement)
