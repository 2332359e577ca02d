"""Surface formulas to typed terms: every name resolved, every widening explicit, every error reported.

A part in error becomes None and is not mentioned again, so that one run reports every independent error of a formula.
Recursion is as deep as the formula, which the parser bounds (`avow.language.parser.MAX_DEPTH`). The checker is a class
in four parts: `check_names`, `check_applications`, `check_relations`, and here connectives and quantifiers.
"""

from __future__ import annotations

from collections.abc import Iterable

from avow.base.diagnostics import Span
from avow.language.chains import equivalence, implication
from avow.language.check_names import BUILTINS
from avow.language.check_relations import Relations
from avow.language.environment import did_you_mean
from avow.language.foreign import FOREIGN_TYPES
from avow.language.lexer import Token
from avow.language.sorts import (
    REAL,
    FunctionSort,
    SequenceSort,
    SetSort,
    Sort,
    TupleSort,
)
from avow.language.syntax import Tree
from avow.language.terms import (
    And,
    Implies,
    In,
    Not,
    Or,
    Quantified,
    Quantifier,
    Role,
    Term,
    Variable,
)


class Checker(Relations):
    """Types formulas of one scope: `formula` what must be true or false, `term` anything, `wanted` a given sort."""

    # --- connectives -------------------------------------------------------------------------------------------------

    def formulas(self, trees: Iterable[Tree]) -> tuple[Term, ...] | None:
        made = [self.formula(t) for t in trees]
        done = tuple(m for m in made if m is not None)
        return done if len(done) == len(made) else None

    def _and(self, tree: Tree, expected: Sort | None) -> Term | None:
        items = self.formulas(tree.parts)
        return None if items is None else And(items, self.span(tree))

    def _or(self, tree: Tree, expected: Sort | None) -> Term | None:
        items = self.formulas(tree.parts)
        return None if items is None else Or(items, self.span(tree))

    def _not(self, tree: Tree, expected: Sort | None) -> Term | None:
        body = self.formula(tree.parts[0])
        return None if body is None else Not(body, self.span(tree))

    def _implies(self, tree: Tree, expected: Sort | None) -> Term | None:
        items = self.formulas(tree.parts)
        return None if items is None else implication(items, self.places(tree.parts))

    def _iff(self, tree: Tree, expected: Sort | None) -> Term | None:
        items = self.formulas(tree.parts)
        return None if items is None else equivalence(items, self.places(tree.parts))

    # --- quantifiers -------------------------------------------------------------------------------------------------

    def _quantified(self, tree: Tree, expected: Sort | None) -> Term | None:
        quantifier_text, binders, body_tree = tree.parts
        quantifier = Quantifier(quantifier_text)
        variables: list[Variable] = []
        guards: list[Term] = []
        before, broken_before = dict(self.scope.bound), set(self.scope.broken)
        sound = True
        for binder in binders.parts:
            *names, domain = binder.parts
            found = self.domain(domain)
            if found is None:
                sound = False
                self.scope.broken.update(n.text for n in names)
            for name in names:
                if not self.fresh(name):
                    sound = False
                    continue
                if found is None:
                    continue
                sort, collection = found
                variable = Variable(Role.BOUND, name.text, sort, self.span(name))
                variables.append(variable)
                self.scope.bound[name.text] = variable
                if collection is not None:
                    guards.append(In(variable, collection, self.span(binder)))
        body = self.formula(body_tree)
        self.scope.bound.clear()
        self.scope.bound.update(before)
        self.scope.broken.clear()
        self.scope.broken.update(broken_before)
        if body is None or not sound:
            return None
        span = self.span(tree)
        if guards and quantifier is Quantifier.FORALL:
            body = Implies(guards[0] if len(guards) == 1 else And(tuple(guards), span), body, span)
        elif guards:
            body = And((*guards, body), span)
        return Quantified(quantifier, tuple(variables), body, span)

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

    def domain(self, tree: Tree) -> tuple[Sort, Term | None] | None:
        """What a quantified variable ranges over: a sort, and the set or sequence of it where it is less than that."""
        while tree.kind == "parenthesised":
            tree = tree.parts[0]
        sort = self.type_in_term(tree)
        if sort is not None:
            if isinstance(sort, FunctionSort):
                message = "a variable ranges over values, not over functions"
                self.error("RCL310", message, tree, hint="RCL is first-order logic")
                return None
            return sort, None
        if tree.kind == "name" and self.scope.taken(tree.parts[0]) is None:
            name = tree.parts[0]
            if not self.scope.is_broken(name):
                environment = self.scope.environment
                known = (*environment.types, *environment.constants, *BUILTINS)
                near = FOREIGN_TYPES.get(name.casefold())
                hint = f"did you mean `{near}`?" if near else did_you_mean(name, known)
                self.error("RCL208", f"the type or set `{name}` is not declared", tree, hint=hint)
            return None
        if tree.kind == "port_name" and self.scope.environment.sort(tree.parts[1]) is not None:
            role, name = tree.parts
            if name not in self.scope.ports(Role(role)):
                message = f"`{name}` is declared in the context, not an {'input' if role == 'in' else 'output'}"
                self.error("RCL203", message, tree, hint=f"write `{name}` alone")
                return None
        collection = self.collection(tree, None)
        if collection is None:
            return None
        sort = collection.sort
        assert isinstance(sort, SetSort | SequenceSort)
        return sort.item, collection

    def type_in_term(self, tree: Tree) -> Sort | None:
        """The sort that a term-like text names: ``REAL``, ``RadStat``, ``(REAL, REAL)``; None where it names none."""
        match tree.kind:
            case "builtin":
                return BUILTINS.get(tree.parts[0], REAL)
            case "name":
                name = tree.parts[0]
                return None if name in self.scope.bound else self.scope.environment.sort(name)
            case "tuple":
                items = [self.type_in_term(t) for t in tree.parts]
                return TupleSort(tuple(i for i in items if i is not None)) if all(items) else None
            case "sequence" if len(tree.parts) == 1:
                item = self.type_in_term(tree.parts[0])
                return None if item is None else SequenceSort(item)
        return None
