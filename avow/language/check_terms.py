"""The formula checker, part two: functions and operators applied, tuples, sets and sequences, comparisons."""

from __future__ import annotations

from collections.abc import Sequence

from avow.base.optional import complete
from avow.base.plain import count
from avow.language.chains import arithmetic
from avow.language.check_names import Names
from avow.language.conversions import NUMERIC, WHOLE, alike, common, convert, joined
from avow.language.lexer import Token
from avow.language.operators import OPERATORS, Mistyped, operation
from avow.language.printer import show_sort
from avow.language.sorts import (
    BOOL,
    INTEGER,
    NATURAL,
    REAL,
    STRING,
    EnumSort,
    FunctionSort,
    SequenceSort,
    SetSort,
    Sort,
    TupleSort,
)
from avow.language.syntax import (
    Application,
    BuiltinName,
    Calculation,
    Comparison,
    Minus,
    Name,
    Number,
    RangeDisplay,
    SequenceDisplay,
    SetDisplay,
    Syntax,
    TermSyntax,
    TupleDisplay,
    unparenthesised,
)
from avow.language.terms import (
    And,
    Apply,
    Arithmetic,
    Builtin,
    Compare,
    Construct,
    EnumValue,
    In,
    Index,
    Length,
    Literal,
    Negative,
    Not,
    Past,
    SequenceRange,
    SequenceTerm,
    SetTerm,
    Term,
    TupleTerm,
)

_BUILTINS = frozenset(Builtin)
"""Words that are operators directly before a parenthesis, unless the contract gives them another meaning."""
_PAST = frozenset(Past) - {Past.SINCE, Past.UNTIL}
_ORDERINGS = frozenset(("<", "<=", ">", ">="))
_OPERATORS = {"EQ": "==", "NE": "!=", "LE": "<=", "GE": ">=", "LT": "<", "GT": ">"}


class Terms(Names):
    """Applications, collections, arithmetic, comparisons, membership."""

    # --- applications ------------------------------------------------------------------------------------------------

    def application(self, tree: Application) -> Term | None:
        head, arguments = unparenthesised(tree.function), tree.arguments
        if isinstance(head, Name):
            name = head.text
            if self.scope.taken(name) is None:
                if name == "length":
                    return self.length(tree, arguments)
                if name == "indices":
                    return self.indices(tree, arguments)
                if name in _BUILTINS:
                    return self.builtin_operation(tree, Builtin(name), arguments)
                if name in _PAST:
                    return self.history(tree, Past(name), arguments)
                if name not in self.scope.nodes:
                    self.undeclared(name, head, "function or constructor")
                    if name.casefold() not in ("forall", "exists", "exist"):  # whose variables are unknown
                        self.terms(arguments)
                    return None
            if name in self.scope.defined and name not in self.scope.bound and self.scope.defined[name].parameters:
                return self.defined(tree, name, arguments)
            shadowed = name in self.scope.bound or name in self.scope.inputs or name in self.scope.outputs
            if name in self.scope.environment.elements and not shadowed:
                return self.construct(tree, name, arguments)
        function = self.term(head)
        if function is None:
            self.terms(arguments)
            return None
        match function.sort:
            case FunctionSort(parameters=parameters, result=result):
                given = self.arguments(tree, arguments, parameters, self.text(head))
                return None if given is None else Apply(function, given, result, self.span(tree))
            case SequenceSort(item=item):
                return self.index(tree, function, arguments, item)
        self.terms(arguments)
        if self.reports.source.text[tree.function.end : tree.function.end + 1] == "[":
            return None  # reported by the lexer
        message = f"`{self.text(head)}` is of type {show_sort(function.sort)}: it is no function and takes no arguments"
        hint = None
        if isinstance(function.sort, TupleSort):
            hint = f"take a tuple apart by its items: `exists(a, b in REAL | {self.text(head)} == (a, b) and …)`"
        elif len(arguments) == 1:
            hint = f"compare it: `{self.text(head)} == {self.text(arguments[0])}`"
        self.error("RCL304", message, tree, hint=hint)
        return None

    def arguments(
        self, tree: Syntax, given: Sequence[TermSyntax], parameters: Sequence[Sort], name: str
    ) -> tuple[Term, ...] | None:
        if len(given) != len(parameters):
            self.terms(given)
            shown = ", ".join(show_sort(p) for p in parameters)
            wanted = count(len(parameters), "argument")
            message = f"`{name}` takes {wanted} and is given {len(given) or 'none'}"
            self.error("RCL305", message, tree, hint=f"its parameters are ({shown})" if parameters else None)
            return None
        pairs, what = zip(given, parameters, strict=True), f"this argument of `{name}`"
        made: list[Term] | None = complete([self.wanted(each, sort, what) for each, sort in pairs])
        return None if made is None else tuple(made)

    def construct(self, tree: Syntax, name: str, arguments: Sequence[TermSyntax]) -> Term | None:
        sort = self.scope.environment.elements[name]
        if isinstance(sort, EnumSort):
            self.terms(arguments)
            message = f"`{name}` is an element of {sort.name}: it is no function and takes no arguments"
            self.error("RCL304", message, tree)
            return None
        given = self.arguments(tree, arguments, sort.constructor(name).parameters, name)
        return None if given is None else Construct(name, given, sort, self.span(tree))

    def index(self, tree: Syntax, sequence: Term, arguments: Sequence[TermSyntax], item: Sort) -> Term | None:
        made = self.terms(arguments)
        if len(made) != 1:
            self.error("RCL305", f"a sequence takes one position and is given {len(made) or 'none'}", tree)
            return None
        index = made[0]
        if index is None:
            return None
        if not isinstance(index.sort, WHOLE):
            message = f"a position in a sequence is a whole number, and this is of type {show_sort(index.sort)}"
            self.error("RCL303", message, arguments[0])
            return None
        return Index(sequence, index, item, self.span(tree))

    def length(self, tree: Syntax, arguments: Sequence[TermSyntax]) -> Term | None:
        made = self.terms(arguments)
        if len(made) != 1:
            self.error("RCL305", f"`length` takes one sequence and is given {len(made) or 'none'}", tree)
            return None
        if made[0] is None:
            return None
        if not isinstance(made[0].sort, SequenceSort):
            message = f"`length` is of a sequence, and this is of type {show_sort(made[0].sort)}"
            self.error("RCL303", message, arguments[0])
            return None
        return Length(made[0], NATURAL, self.span(tree))

    def indices(self, tree: Application, arguments: Sequence[TermSyntax]) -> Term | None:
        """``indices(s)`` is ``<0 upto length(s) - 1>``."""
        length = self.length(tree, arguments)
        if length is None:
            return None
        span = self.span(tree)
        last = Arithmetic("-", length, Literal(1, NATURAL, span), INTEGER, span)
        return SequenceRange(Literal(0, NATURAL, span), last, SequenceSort(NATURAL), span)

    def builtin_operation(self, tree: Syntax, name: Builtin, arguments: Sequence[TermSyntax]) -> Term | None:
        formulas = OPERATORS[name].typing.takes_formulas
        terms: list[Term] | None = complete([self.formula(a) if formulas else self.term(a) for a in arguments])
        if terms is None:
            return None
        found = operation(name, terms, self.span(tree))
        if not isinstance(found, Mistyped):
            return found
        at = tree if found.at is None else arguments[found.at]
        shown = "" if found.at is None else show_sort(terms[found.at].sort)
        self.error(found.code, found.message.format(shown), at, hint=found.hint)
        return None

    # --- collections -------------------------------------------------------------------------------------------------

    def tuple_of(self, tree: TupleDisplay, expected: Sort | None) -> Term | None:
        wanted: Sequence[Sort | None] = [None] * len(tree.items)
        if isinstance(expected, TupleSort) and len(expected.items) == len(tree.items):
            wanted = expected.items
        items: list[Term] | None = complete([self.term(t, w) for t, w in zip(tree.items, wanted, strict=True)])
        if items is None:
            return None
        return TupleTerm(tuple(items), TupleSort(tuple(i.sort for i in items)), self.span(tree))

    def items(self, trees: Sequence[TermSyntax], what: str, expected: Sort | None) -> list[Term] | None:
        items: list[Term] | None = complete([self.term(t, expected) for t in trees])
        if items is None:
            return None
        unified = common(items)
        if unified is None:
            wrong = [(t, i) for t, i in zip(trees, items, strict=True) if common([items[0], i]) is None]
            at, first = wrong[0] if wrong else (trees[-1], items[-1])
            message = f"the items of a {what} are of one type: this is {show_sort(first.sort)}, "
            self.error("RCL302", message + f"the first is {show_sort(items[0].sort)}", at)
        return unified

    def sequence(self, tree: SequenceDisplay, expected: Sort | None) -> Term | None:
        item = expected.item if isinstance(expected, SequenceSort) else None
        if not tree.items:
            if item is None:
                self.error("RCL306", "the type of `<>` cannot be told here", tree, hint="compare it with a sequence")
                return None
            return SequenceTerm((), SequenceSort(item), self.span(tree))
        items = self.items(tree.items, "sequence", item)
        if items is None:
            return None
        return SequenceTerm(tuple(items), SequenceSort(joined(items)), self.span(tree))

    def range_of(self, tree: RangeDisplay) -> Term | None:
        low, high = self.term(tree.low), self.term(tree.high)
        if low is None or high is None:
            return None
        for part, term in ((tree.low, low), (tree.high, high)):
            if not isinstance(term.sort, WHOLE):
                message = f"a range goes over whole numbers, and this is of type {show_sort(term.sort)}"
                self.error("RCL303", message, part)
                return None
        sort = NATURAL if low.sort == NATURAL else INTEGER
        return SequenceRange(low, high, SequenceSort(sort), self.span(tree))

    def set_of(self, tree: SetDisplay, expected: Sort | None) -> Term | None:
        item = expected.item if isinstance(expected, SetSort) else None
        if not tree.items:
            if item is None:
                self.error("RCL306", "the type of the empty set cannot be told here", tree)
                return None
            return SetTerm((), SetSort(item), self.span(tree))
        items = self.items(tree.items, "set", item)
        return None if items is None else SetTerm(tuple(items), SetSort(joined(items)), self.span(tree))

    def collection(self, tree: TermSyntax, item: Sort | None) -> Term | None:
        """The right-hand side of ``in``, or a quantifier's domain that is no type: a set or a sequence."""
        tree = unparenthesised(tree)
        if isinstance(tree, Name) and self.scope.taken(tree.text) is not None:
            sort = self.scope.environment.sort(tree.text)
            if isinstance(sort, EnumSort) and tree.text not in self.scope.bound:
                members = tuple(EnumValue(m, sort, self.span(tree)) for m in sort.members)
                return SetTerm(members, SetSort(sort), self.span(tree))
            if sort is not None and self.scope.environment.constants.get(tree.text) is None:
                self.not_a_set(tree, show_sort(sort))
                return None
        if isinstance(tree, BuiltinName):
            self.not_a_set(tree, tree.text)
            return None
        expected: Sort | None = None
        if item is not None:
            expected = SetSort(item) if isinstance(tree, SetDisplay) else SequenceSort(item)
        made = self.term(tree, expected)
        if made is None or isinstance(made.sort, SetSort | SequenceSort):
            return made
        message = f"`in` wants a set or a sequence, and this is of type {show_sort(made.sort)}"
        hint = "write a set as `{a, b}`, a sequence as `<a, b>`"
        if isinstance(made.sort, TupleSort):
            hint += ", an interval as `low < x < high`"
        elif isinstance(made.sort, EnumSort):
            hint = f"this is one value of type {made.sort.name}; all of them are `{made.sort.name}`"
        self.error("RCL307", message, tree, hint=hint)
        return None

    def not_a_set(self, tree: Syntax, shown: str) -> None:
        hint = "what a variable ranges over is said in its quantifier: `forall(x in REAL | …)`"
        self.error("RCL307", f"the type {shown} is not a set of values that `in` can ask about", tree, hint=hint)

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
