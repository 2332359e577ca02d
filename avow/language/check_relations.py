"""The formula checker, part three: arithmetic, comparisons, membership."""

from __future__ import annotations

from collections.abc import Sequence

from avow.base.plain import count
from avow.language.chains import arithmetic
from avow.language.check_applications import Applications
from avow.language.conversions import NUMERIC, alike, common, convert, joined
from avow.language.lexer import Token
from avow.language.printer import show_sort
from avow.language.sorts import BOOL, INTEGER, REAL, STRING, EnumSort, FunctionSort, SequenceSort, SetSort, Sort
from avow.language.syntax import (
    Calculation,
    Comparison,
    Minus,
    Number,
    SequenceDisplay,
    SetDisplay,
    Syntax,
    TermSyntax,
    TupleDisplay,
    unparenthesised,
)
from avow.language.terms import And, Compare, In, Literal, Negative, Not, SetTerm, Term

_ORDERINGS = frozenset(("<", "<=", ">", ">="))
_OPERATORS = {"EQ": "==", "NE": "!=", "LE": "<=", "GE": ">=", "LT": "<", "GT": ">"}


class Relations(Applications):
    """Arithmetic, comparisons, membership."""

    # --- arithmetic --------------------------------------------------------------------------------------------------

    def numeric(self, tree: TermSyntax, operator: str) -> Term | None:
        term = self.term(tree)
        if term is not None and not isinstance(term.sort, NUMERIC):
            self.error("RCL308", f"`{operator}` is of numbers, and this is of type {show_sort(term.sort)}", tree)
            return None
        return term

    def arithmetic(self, tree: Calculation) -> Term | None:
        trees = tree.operands
        operators = [token.text for token in tree.operators]
        operands: list[Term] = []
        for operand, operator in zip(trees, [operators[0], *operators], strict=True):
            term = self.numeric(operand, operator)
            if term is None:
                continue
            if operator == "/" and operand is not trees[0] and isinstance(term, Literal) and term.value == 0:
                self.error("RCL309", "division by zero", operand)
                continue
            operands.append(term)
        if len(operands) < len(trees):
            return None
        made = arithmetic(operators, operands, self.places(trees))
        if made is None:
            message = f"a chain of {len(operators)} operators, with a `/` between most of them, is too long"
            self.error("RCL110", message, tree.operators[0], hint="put parentheses around its parts")
        return made

    def negative(self, tree: Minus) -> Term | None:
        if isinstance(tree.body, Number):
            return self.number(tree.body, self.span(tree), sign=-1)
        term = self.numeric(tree.body, "-")
        if term is None:
            return None
        return Negative(term, REAL if term.sort == REAL else INTEGER, self.span(tree))

    # --- comparisons -------------------------------------------------------------------------------------------------

    def comparison(self, tree: Comparison) -> Term | None:
        operands, relations = tree.operands, tree.relations
        if len(relations) == 1 and relations[0].type in ("IN", "NOT_IN"):
            return self.membership(tree, operands[0], relations[0], operands[1])
        if not self.check_chain(relations):
            self.terms(operands)
            return None
        made: list[Term | None] = [None] * len(operands)
        late = []
        hint: Sort | None = None
        for i, operand in enumerate(operands):
            if _is_open(operand):
                late.append(i)
                continue
            made[i] = self.term(operand, hint)
            hint = made[i].sort if made[i] is not None else hint  # type: ignore[union-attr]
        for i in late:
            if hint is not None or any(made):
                made[i] = self.term(operands[i], hint)
            elif len(late) == len(operands):
                made[i] = self.term(operands[i])
        links: list[Term] = []
        for i, relation in enumerate(relations):
            left, right = made[i], made[i + 1]
            if left is None or right is None:
                continue
            link = self.compare(tree, relation, operands[i], left, operands[i + 1], right)
            if link is not None:
                links.append(link)
        if len(links) != len(relations):
            return None
        return links[0] if len(links) == 1 else And(tuple(links), self.span(tree))

    def check_chain(self, relations: Sequence[Token]) -> bool:
        texts = {_OPERATORS.get(r.type, "") for r in relations if r.type != "EQ"}
        if len(relations) == 1:
            return True
        for relation in relations:
            if relation.type in ("IN", "NOT_IN", "NE"):
                message = f"`{relation.text}` cannot be part of a chain of comparisons"
                self.error("RCL121", message, relation, hint="join comparisons by `and`, or put one in parentheses")
                return False
        if texts <= {"<", "<="} or texts <= {">", ">="}:
            return True
        message = "a chain of comparisons goes one way, as in `0 <= r < 120`"
        self.error("RCL121", message, relations[-1], hint="join comparisons by `and`")
        return False

    def compare(
        self, tree: Comparison, relation: Token, left_tree: TermSyntax, left: Term, right_tree: TermSyntax, right: Term
    ) -> Term | None:
        operator = _OPERATORS[relation.type]
        if operator in _ORDERINGS:
            wrong = [(t, x) for t, x in ((left_tree, left), (right_tree, right)) if not isinstance(x.sort, NUMERIC)]
            for at, term in wrong:
                self.error("RCL308", f"`{operator}` is of numbers, and this is of type {show_sort(term.sort)}", at)
            if wrong:
                return None
        if isinstance(left.sort, SetSort) or isinstance(right.sort, SetSort):
            hint = "say what is in it: `forall(x in S | …)`" if operator == "==" else None
            self.error("RCL302", f"sets are not compared by `{operator}`: they only stand after `in`", tree, hint=hint)
            return None
        pair = common([left, right])
        if pair is None:
            shown = f"{show_sort(left.sort)} and {show_sort(right.sort)}"
            message = f"`{operator}` between different types: {shown}"
            hint = self.mismatch_hint(left_tree, left, right_tree, right)
            if len(tree.relations) > 1:
                hint = hint or "`a < b == c` says `a < b and b == c`; put parentheses if it should not"
            self.error("RCL302", message, tree, hint=hint)
            return None
        if len(tree.relations) > 1 and left.sort == BOOL:
            if relation is tree.relations[0]:
                hint = "join comparisons by `and`, or use `<=>`"
                self.error("RCL121", "truth values are not chained", relation, hint=hint)
            return None
        span = (
            self.span(tree) if len(tree.relations) == 1 else self.reports.source.span(left_tree.start, right_tree.end)
        )
        return Compare(operator, pair[0], pair[1], span)

    def mismatch_hint(self, left_tree: Syntax, left: Term, right_tree: Syntax, right: Term) -> str | None:
        for tree, one, other in ((left_tree, left, right), (right_tree, right, left)):
            if isinstance(one.sort, FunctionSort) and one.sort.result == other.sort:
                return f"apply `{self.text(tree)}` to its {count(len(one.sort.parameters), 'argument')} first"
            if isinstance(one.sort, EnumSort) and isinstance(other, Literal) and other.value in one.sort.members:
                return f"write `{other.value}` without quotation marks"
            if isinstance(one.sort, EnumSort) and (other.sort in (BOOL, STRING) or isinstance(other.sort, NUMERIC)):
                return f"the values of {one.sort.name} are {', '.join(one.sort.members[:6])}"
        return None

    def membership(self, tree: Syntax, item_tree: TermSyntax, relation: Token, of_tree: TermSyntax) -> Term | None:
        item = self.term(item_tree)
        of = self.collection(of_tree, item.sort if item is not None else None)
        if item is None or of is None:
            return None
        of_sort = of.sort
        assert isinstance(of_sort, SetSort | SequenceSort)
        inside: In | None = None
        span = self.span(tree)
        if alike(item.sort, of_sort.item):
            inside = In(item, of, span)
        elif isinstance(of, SetTerm):
            pool = common([item, *of.items])
            if pool is not None:
                inside = In(pool[0], SetTerm(tuple(pool[1:]), SetSort(joined(pool[1:])), of.span), span)
        else:
            converted = convert(item, of_sort.item) or None
            collected = convert(of, SequenceSort(item.sort))
            if converted is not None:
                inside = In(converted, of, span)
            elif collected is not None:
                inside = In(item, collected, span)
        if inside is None:
            shown = f"{show_sort(item.sort)} in a collection of {show_sort(of_sort.item)}"
            self.error("RCL302", f"`{relation.text}` between different types: {shown}", tree)
            return None
        return inside if relation.type == "IN" else Not(inside, span)


def _is_open(tree: TermSyntax) -> bool:
    tree = unparenthesised(tree)
    if isinstance(tree, TupleDisplay):
        return any(_is_open(t) for t in tree.items)
    return isinstance(tree, SequenceDisplay | SetDisplay) and not tree.items
