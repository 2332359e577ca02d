"""The formula checker, part three: operators that refer to other steps, and lengths of time."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from avow.base.optional import complete
from avow.base.plain import count
from avow.language import syntax
from avow.language.bounds import constant
from avow.language.check_terms import Terms
from avow.language.conversions import WHOLE, common, joined
from avow.language.lexer import LIMITED, LONG_UNITS, STEPS, UNITS
from avow.language.printer import show_sort
from avow.language.sorts import BOOL, NATURAL, REAL, FunctionSort, SetSort
from avow.language.subterms import timed
from avow.language.terms import RESPONSES, History, Limit, Literal, Past, Quantifier, Role, Term, Variable

_ALWAYS_LIMITED = (Past.HELD, Past.WITHIN, Past.FOR)
_PLACE = "a response stands as the whole right side of a clause's outermost `->`, or is the clause"


class Histories(Terms):
    """Past-time operators and responses."""

    response: syntax.TermSyntax | None = None
    """The only part that may be a response."""
    whole: syntax.TermSyntax | None = None
    """The clause's formula."""

    def clause(self, tree: syntax.TermSyntax) -> Term | None:
        """A clause's formula, which may refer to other steps and be a response."""
        self.response, self.whole = _right_side(tree), syntax.unparenthesised(tree)
        return self.formula(tree)

    def quantity(self, tree: syntax.Quantity) -> Term | None:
        scale = _scale(tree.unit.text)
        if scale is None:
            hint = f"units of time are {', '.join((*UNITS, *LONG_UNITS))}; steps are counted in a limit only"
            self.error("RCL320", f"`{tree.unit.text}` is no unit of time", tree.unit, hint=hint)
            return None
        return Literal(Fraction(tree.digits) * scale, REAL, self.span(tree), "s")

    def limited(self, tree: syntax.Limited) -> Term | None:
        return self.history(tree, Past(tree.name.text), tree.arguments, tree.limit)

    def lasting(self, tree: syntax.Lasting) -> Term | None:
        return self.history(tree, Past(tree.word), (tree.left, tree.right), tree.limit)

    def history(
        self,
        tree: syntax.TermSyntax,
        operator: Past,
        arguments: Sequence[syntax.TermSyntax],
        limit: syntax.LimitSyntax | None = None,
    ) -> Term | None:
        if not self.scope.remembers:
            self.error("RCL322", f"`{operator}` speaks of other steps than this one, and there is one here only", tree)
            return None
        if operator is Past.STEPS:
            self.no_pace(tree)
            return None
        if operator in RESPONSES and self.response is not tree:
            self.error("RCL321", f"`{operator}` is a response, and does not stand here: {_PLACE}", tree)
            return None
        sound = self._limits(tree, operator, limit)
        inside, self.response = self.response, None
        try:
            made = self._arguments(tree, operator, arguments)
        finally:
            self.response = inside
        bound = self.limit(limit) if limit is not None and sound else None
        if made is None or not sound or (limit is not None and bound is None):
            return None
        if operator is Past.PREVIOUS:
            return History(operator, made, joined(list(made)), None, self.span(tree))
        sort = NATURAL if operator is Past.COUNTED else BOOL
        return History(operator, made, sort, bound, self.span(tree))

    def pace(self, tree: syntax.PaceSyntax) -> Term | None:
        """A node's pace, which is a guarantee by itself."""
        told = " ".join(token.text for token in tree.words)
        relation = {"every": "==", "at most": "<="}.get(told)
        scale = _scale(tree.length.unit.text)
        head = syntax.unparenthesised(tree.head)
        if not isinstance(head, syntax.Name) or head.text != Past.STEPS or relation is None:
            self.no_pace(tree)
            return None
        if scale is None or Fraction(tree.length.digits) == 0:
            hint = f"units of time are {', '.join((*UNITS, *LONG_UNITS))}"
            self.error("RCL320", "how far apart steps are is a length of time", tree.length, hint=hint)
            return None
        if self.whole is not tree or not self.scope.remembers:
            self.error("RCL324", "how far apart steps are is a guarantee of its own, and does not stand here", tree)
            return None
        amount = Literal(Fraction(tree.length.digits) * scale, REAL, self.span(tree.length))
        return History(Past.STEPS, (), BOOL, Limit(relation, amount, False), self.span(tree))

    def no_pace(self, tree: syntax.TermSyntax) -> None:
        hint = "write `steps(every 20 ms)` or `steps(at most 100 ms)`"
        self.error("RCL324", f"`{self.text(tree)}` says nothing of how far apart steps are", tree, hint=hint)

    def _limits(self, tree: syntax.TermSyntax, operator: Past, limit: syntax.LimitSyntax | None) -> bool:
        """Whether the operator has a limit if it needs one, and one of the right kind; reports it if not."""
        if limit is None:
            if operator not in _ALWAYS_LIMITED:
                return True
            hint = f"write `{operator}[5 steps](…)` or `{operator}[200 ms](…)`"
            self.error("RCL323", f"`{operator}` has a limit", tree, hint=hint)
            return False
        if operator is Past.SINCE:
            if limit.relation:
                return True
            hint = "write `since[<= 5 steps]` or `since[>= 5 steps]`"
            self.error("RCL323", "the limit of `since` says whether it is the most or the least", limit, hint=hint)
            return False
        if operator not in LIMITED:
            self.error("RCL323", f"`{operator}` has no limit", limit, hint=f"write `{operator}(…)`")
            return False
        if limit.relation:
            hint = f"write `{operator}[{self.text(limit.amount)}{f' {limit.unit.text}' if limit.unit else ''}](…)`"
            self.error("RCL323", f"the limit of `{operator}` is only a length", limit, hint=hint)
            return False
        return True

    def _arguments(
        self, tree: syntax.TermSyntax, operator: Past, arguments: Sequence[syntax.TermSyntax]
    ) -> tuple[Term, ...] | None:
        wanted = 2 if operator in (Past.PREVIOUS, Past.SINCE, Past.UNTIL) else 1
        if len(arguments) != wanted:
            self.terms(arguments)
            hint = None
            if operator is Past.PREVIOUS:
                hint = "say what its value is at the first step: `previous(in.r, 0)`"
            message = f"`{operator}` takes {count(wanted, 'argument')} and is given {len(arguments) or 'none'}"
            self.error("RCL305", message, tree, hint=hint)
            return None
        if operator is Past.COUNTED:
            inner = syntax.unparenthesised(arguments[0])
            if not isinstance(inner, syntax.Lasting) or inner.word != Past.SINCE or inner.limit is not None:
                self.error("RCL323", "`counted` is of steps since another", tree, hint="write `counted(F since G)`")
                return None
            arguments = (inner.left, inner.right)
        if operator in (Past.PREVIOUS, Past.CHANGED, Past.ARRIVED):
            made = self.terms(arguments)
        else:
            made = [self.formula(each) for each in arguments]
        terms: list[Term] | None = complete(made)
        if terms is None:
            return None
        if operator is Past.ARRIVED:
            return self._input(arguments[0], terms[0])
        for each, term in zip(arguments, terms, strict=True):
            if operator in (Past.ROSE, Past.FELL, Past.CHANGED) and timed(term) is not None:
                message = f"`{operator}` is of steps, and this may change between steps: it has a limit in seconds"
                self.error("RCL324", message, each, hint="it may itself be the condition: `not once[2 s](F) -> …`")
                return None
            if isinstance(term.sort, FunctionSort | SetSort):
                message = f"what is remembered is a value, and this is of type {show_sort(term.sort)}"
                self.error("RCL302", message, each, hint="apply the function, or say what is in the set")
                return None
        if operator is not Past.PREVIOUS:
            return tuple(terms)
        same = common(terms)
        if same is None:
            message = f"the value at the first step is of type {show_sort(terms[1].sort)}, "
            self.error("RCL302", message + f"the others are of {show_sort(terms[0].sort)}", arguments[1])
            return None
        return tuple(same)

    def _input(self, tree: syntax.TermSyntax, term: Term) -> tuple[Term, ...] | None:
        if isinstance(term, Variable) and term.role is Role.INPUT:
            return (term,)
        hint = "write `arrived(in.scan)`, of an input of the node"
        self.error("RCL324", "what arrives is a message of an input", tree, hint=hint)
        return None

    def limit(self, tree: syntax.LimitSyntax) -> Limit | None:
        """A limit, in steps or in seconds."""
        amount, unit = tree.amount, tree.unit.text if tree.unit is not None else ""
        inner = syntax.unparenthesised(amount)
        if isinstance(inner, syntax.Quantity) and inner.unit.text in STEPS and not unit:
            unit = inner.unit.text
            amount = syntax.Number(inner.start, inner.unit.start, 1, inner.digits)
        if unit in STEPS:
            term = self.term(amount)
            if term is None or not self.has_sort(amount, term, WHOLE, "RCL303", "a number of steps is a whole number"):
                return None
            return self._constant(tree, term, True)
        if inner.start in self.reports.odd:
            return None  # reported by the lexer
        if not unit and isinstance(inner, syntax.Number):
            hint = f"write `[{inner.digits} steps]` or `[{inner.digits} s]`"
            self.error("RCL320", "a limit has a unit", tree, hint=hint)
            return None
        scale = _scale(unit) if unit else Fraction(1)
        if scale is None:
            hint = f"units are steps, {', '.join((*UNITS, *LONG_UNITS))}"
            self.error("RCL320", f"`{unit}` is no unit of time", tree.unit or tree, hint=hint)
            return None
        term = self.term(amount)
        if term is None:
            return None
        if not isinstance(term.sort, (*WHOLE, type(REAL))) or (not unit and term.sort != REAL):
            message = f"a limit without a unit is a REAL, in seconds, and this is of type {show_sort(term.sort)}"
            self.error("RCL320", message, tree, hint="write `[… steps]` or `[… s]`")
            return None
        return self._constant(tree, term, False, scale)

    def _constant(
        self, tree: syntax.LimitSyntax, term: Term, steps: bool, scale: Fraction = Fraction(1)
    ) -> Limit | None:
        number = constant(term)
        if number is None or number < 0:
            message = f"`{self.text(tree.amount)}` is no limit: it is a number from 0, calculated by `+ - * /` only"
            hint = "write the number itself or a declared constant; to choose between limits, write a clause for each"
            self.error("RCL323", message, tree.amount, hint=hint)
            return None
        amount = Literal(int(number), NATURAL, term.span) if steps else Literal(number * scale, REAL, term.span)
        return Limit(tree.relation, amount, steps)


def _right_side(tree: syntax.TermSyntax) -> syntax.TermSyntax:
    """The right side of a formula's outermost `->`, under universal quantifiers; the formula if it has none."""
    tree = syntax.unparenthesised(tree)
    while isinstance(tree, syntax.Quantification) and tree.quantifier is Quantifier.FORALL:
        tree = syntax.unparenthesised(tree.body)
    if isinstance(tree, syntax.Connective) and tree.sign is syntax.Sign.IMPLIES:
        return syntax.unparenthesised(tree.items[-1])
    return tree


def _scale(unit: str) -> Fraction | None:
    """The length of a unit in seconds; None if it is not a unit of time."""
    if unit in LONG_UNITS:
        return Fraction(LONG_UNITS[unit])
    return Fraction(1, 10 ** UNITS[unit]) if unit in UNITS else None
