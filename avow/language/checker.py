"""Surface formulas to typed terms: every name resolved, every widening explicit, every error reported.

A part in error becomes None and is not reported again, so that one run reports every independent error of a formula.
Recursion is as deep as the formula, which the parser limits (`NESTING`). The checker is a class in four parts:
`check_names`, `check_terms`, `check_history`, and here connectives, quantifiers and definitions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import assert_never

from avow.base.diagnostics import Span
from avow.base.optional import complete
from avow.base.suggestions import did_you_mean
from avow.language import syntax
from avow.language import terms as t
from avow.language.check_history import Histories
from avow.language.contract import Definition
from avow.language.definitions import expand
from avow.language.foreign import FOREIGN_TYPES
from avow.language.lexer import Token
from avow.language.operators import conditional
from avow.language.printer import show_sort
from avow.language.scope import Defined
from avow.language.sorts import BOOL, BUILTINS, FunctionSort, SequenceSort, SetSort, Sort, TupleSort
from avow.language.subterms import subterms
from avow.language.syntax import Syntax, TermSyntax


class Checker(Histories):
    """Types the formulas of one scope: `formula` for sort BOOL, `term` for any sort, `wanted` for a given sort."""

    def term(self, tree: syntax.TermSyntax, expected: Sort | None = None) -> t.Term | None:
        match tree:
            case syntax.PortName(role=role, name=name):
                return self.port(t.Role(role), name, tree)
            case syntax.Name():
                return self.name(tree, expected)
            case syntax.FieldOf(body=body, name=name):
                return self.field(self.term(body), name.text, tree)
            case syntax.Parentheses(body=body):
                return self.term(body, expected)
            case syntax.Comparison():
                return self.comparison(tree)
            case syntax.Connective():
                return self.connective(tree)
            case syntax.Application():
                return self.application(tree)
            case syntax.Number():
                return self.number(tree, self.span(tree))
            case syntax.Truth(value=value):
                return t.Literal(value, BOOL, self.span(tree))
            case syntax.Negation(body=negated):
                formula = self.formula(negated)
                return None if formula is None else t.Not(formula, self.span(tree))
            case syntax.Calculation():
                return self.arithmetic(tree)
            case syntax.Minus():
                return self.negative(tree)
            case syntax.Quantification():
                return self.quantified(tree)
            case syntax.IfThenElse():
                return self.if_then_else(tree, expected)
            case syntax.Limited():
                return self.limited(tree)
            case syntax.PaceSyntax():
                return self.pace(tree)
            case syntax.Lasting():
                return self.lasting(tree)
            case syntax.Quantity():
                return self.quantity(tree)
            case syntax.NodePort():
                return self.node_port(tree)
            case syntax.TupleDisplay():
                return self.tuple_of(tree, expected)
            case syntax.SetDisplay():
                return self.set_of(tree, expected)
            case syntax.SequenceDisplay():
                return self.sequence(tree, expected)
            case syntax.RangeDisplay():
                return self.range_of(tree)
            case syntax.Text():
                return self.string(tree)
            case _:
                assert_never(tree)

    # --- connectives -------------------------------------------------------------------------------------------------

    def connective(self, tree: syntax.Connective) -> t.Term | None:
        made: list[t.Term] | None = complete([self.formula(term) for term in tree.items])
        if made is None:
            return None
        items = tuple(made)
        match tree.sign:
            case syntax.Sign.AND:
                return t.And(items, self.span(tree))
            case syntax.Sign.OR:
                return t.Or(items, self.span(tree))
            case syntax.Sign.IMPLIES:
                conclusion = items[-1]
                for at in range(len(items) - 2, -1, -1):  # `a -> b -> c` is `a -> (b -> c)`
                    conclusion = t.Implies(items[at], conclusion, self.between(tree.items[at], tree.items[-1]))
                return conclusion
            case syntax.Sign.IFF:
                result = items[0]
                for part, place in zip(items[1:], tree.items[1:], strict=True):
                    result = t.Iff(result, part, self.between(tree.items[0], place))
                return result
            case _:
                assert_never(tree.sign)

    def if_then_else(self, tree: syntax.IfThenElse, expected: Sort | None) -> t.Term | None:
        condition = self.formula(tree.condition)
        then, otherwise = self.term(tree.then, expected), self.term(tree.otherwise, expected)
        if condition is None or then is None or otherwise is None:
            return None
        made = conditional(condition, then, otherwise, self.span(tree))
        if made is not None:
            return made
        message = f"the branches of `if` are values of one type: {show_sort(then.sort)} and {show_sort(otherwise.sort)}"
        self.error("RCL302", message, tree.otherwise)
        return None

    # --- quantifiers -------------------------------------------------------------------------------------------------

    def quantified(self, tree: syntax.Quantification) -> t.Term | None:
        quantifier = tree.quantifier
        variables: list[t.Variable] = []
        guards: list[t.Term] = []
        before, broken_before = dict(self.scope.bound), set(self.scope.broken)
        sound = True
        for binder in tree.binders:
            found = self.domain(binder.domain)
            if found is None:
                sound = False
                self.scope.broken.update(n.text for n in binder.names)
            for name in binder.names:
                if not self.fresh(name):
                    sound = False
                    continue
                if found is None:
                    continue
                sort, collection = found
                variable = t.Variable(t.Role.BOUND, name.text, sort, self.span(name))
                variables.append(variable)
                self.scope.bound[name.text] = variable
                if collection is not None:
                    guards.append(t.In(variable, collection, self.span(binder)))
        body = self.formula(tree.body)
        self.scope.bound.clear()
        self.scope.bound.update(before)
        self.scope.broken.clear()
        self.scope.broken.update(broken_before)
        if body is None or not sound:
            return None
        span = self.span(tree)
        if guards and quantifier is t.Quantifier.FORALL:
            body = t.Implies(guards[0] if len(guards) == 1 else t.And(tuple(guards), span), body, span)
        elif guards:
            body = t.And((*guards, body), span)
        return t.Quantified(quantifier, tuple(variables), body, span)

    def fresh(self, name: Token) -> bool:
        taken = self.scope.taken(name.text)
        if taken is None:
            return True
        what, place = taken
        notes: tuple[tuple[str, Span | None], ...] = ()
        if place is not None:
            notes = ((f"`{name.text}` is declared here", place),)
        hint = f"choose another name, such as `{name.text}'`"
        self.error("RCL207", f"`{name.text}` is already {what}", name, hint=hint, notes=notes)
        return False

    def domain(self, tree: syntax.TermSyntax) -> tuple[Sort, t.Term | None] | None:
        """The range of a quantified variable: a sort, and the set or sequence if it is only part of the sort."""
        tree = syntax.unparenthesised(tree)
        sort = self.type_in_term(tree)
        if sort is not None:
            if isinstance(sort, FunctionSort):
                message = "a variable ranges over values, not over functions"
                self.error("RCL310", message, tree, hint="RCL is first-order logic")
                return None
            return sort, None
        if isinstance(tree, syntax.Name) and self.scope.taken(tree.text) is None:
            name = tree.text
            if not self.scope.is_broken(name):
                environment = self.scope.environment
                known = (*environment.types, *environment.constants, *BUILTINS)
                near = FOREIGN_TYPES.get(name.casefold())
                hint = f"did you mean `{near}`?" if near else did_you_mean(name, known)
                self.error("RCL208", f"the type or set `{name}` is not declared", tree, hint=hint)
            return None
        collection = self.collection(tree, None)
        if collection is None:
            return None
        sort = collection.sort
        assert isinstance(sort, SetSort | SequenceSort)
        return sort.item, collection

    def type_in_term(self, tree: syntax.TermSyntax) -> Sort | None:
        """The sort that a term-like text names: ``REAL``, ``RadStat``, ``(REAL, REAL)``; None if it names none."""
        match tree:
            case syntax.Name(text=name):
                return None if name in self.scope.bound else self.scope.environment.sort(name)
            case syntax.TupleDisplay(items=parts):
                items = [self.type_in_term(term) for term in parts]
                return TupleSort(tuple(i for i in items if i is not None)) if all(items) else None
            case syntax.SequenceDisplay(items=(only,)):
                item = self.type_in_term(only)
                return None if item is None else SequenceSort(item)
            case _:  # a term that does not name a sort
                return None

    # --- local definitions, checked in place and expanded where they are used ----------------------------------------

    def defined(self, tree: Syntax, name: str, arguments: Sequence[TermSyntax]) -> t.Term | None:
        entry, scope = self.scope.defined[name], self.scope
        if scope.bare and (name in scope.inputs or name in scope.outputs):
            role = "in" if name in scope.inputs else "out"
            message = f"`{name}` is a definition, and an {role}put of node `{scope.node}`"
            hint = f"write `{role}.{name}` for that; to speak of the other, rename one of them"
            self.error("RCL202", message, tree, hint=hint)
            return None
        definition = self.definition(entry, tree)
        given = self.arguments(tree, arguments, [p.sort for p in entry.parameters], name)
        if definition is None or given is None:
            return None
        if not self.scope.remembers and any(isinstance(part, t.History) for part in subterms(definition.body)):
            self.error("RCL322", f"`{name}` speaks of other steps than this one, and there is one here only", tree)
            return None
        return expand(definition, given, self.span(tree), lambda other: self.scope.taken(other) is not None)

    def definition(self, entry: Defined, use: Syntax | None = None) -> Definition | None:
        """The definition, checked once in this node; None if it is in error, which is reported."""
        tree, reports = entry.tree, entry.reports
        if tree is None or reports is None or entry.state == "done":
            return entry.found
        name = tree.name
        if entry.state == "open":
            reports.error("RCL212", f"the definition of `{name.text}` refers to itself", name.start, name.end)
            return None
        entry.state, before = "open", len(reports.found)
        scope = replace(
            self.scope,
            bound={p.name: p for p in entry.parameters},
            broken=set(self.scope.broken),
            remembers=True,
            bare=entry.bare,
        )
        body = Checker(scope, reports).term(tree.body)
        entry.state = "done"
        if use is not None and not entry.bare and len(reports.found) > before:
            note = (f"it is used in node `{self.scope.node}` here", self.span(use))
            reports.found[before:] = [replace(d, notes=(*d.notes, note)) for d in reports.found[before:]]
        if body is None:
            return None
        text = reports.source.text[tree.start : tree.end]
        entry.found = Definition(name.text, entry.parameters, body, text, reports.source.span(name.start, name.end))
        return entry.found
