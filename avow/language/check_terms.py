"""The formula checker, part two: function and operator applications, tuples, sets and sequences, comparisons."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

from avow.base.diagnostics import Span
from avow.base.optional import complete
from avow.base.plain import count
from avow.language import sorts as s
from avow.language import syntax
from avow.language import terms as t
from avow.language.check_names import Names
from avow.language.conversions import NUMERIC, WHOLE, alike, common, convert, joined, widen
from avow.language.foreign import APART
from avow.language.lexer import Token
from avow.language.operators import OPERATORS, Mistyped, operation
from avow.language.printer import show_sort, show_term

_BUILTINS = frozenset(t.Builtin)
"""Names that are operators directly before a parenthesis, unless the contract declares them."""
_PAST = frozenset(t.Past) - {t.Past.SINCE, t.Past.UNTIL}
_ORDERINGS = frozenset(("<", "<=", ">", ">="))
_OPERATORS = {"EQ": "==", "NE": "!=", "LE": "<=", "GE": ">=", "LT": "<", "GT": ">"}


class Terms(Names):
    """Applications, collections, arithmetic, comparisons, membership."""

    # --- applications ------------------------------------------------------------------------------------------------

    def application(self, tree: syntax.Application) -> t.Term | None:
        head, arguments = syntax.unparenthesised(tree.function), tree.arguments
        if isinstance(head, syntax.Name):
            name = head.text
            if self.scope.taken(name) is None:
                if name == "length":
                    return self.length(tree, arguments)
                if name == "indices":
                    return self.indices(tree, arguments)
                if name in ("norm", "dot"):
                    return self.product_of_vectors(tree, name, arguments)
                if name in _BUILTINS:
                    return self.builtin_operation(tree, t.Builtin(name), arguments)
                if name in _PAST:
                    return self.history(tree, t.Past(name), arguments)
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
            case s.FunctionSort(parameters=parameters, result=result):
                given = self.arguments(tree, arguments, parameters, self.text(head))
                return None if given is None else t.Apply(function, given, result, self.span(tree))
            case s.SequenceSort(item=item):
                return self.index(tree, function, arguments, item)
        self.terms(arguments)
        message = f"`{self.text(head)}` is of type {show_sort(function.sort)}: it is no function and takes no arguments"
        self.error("RCL304", message, tree, hint=APART if isinstance(function.sort, s.TupleSort) else None)
        return None

    def arguments(
        self, tree: syntax.Syntax, given: Sequence[syntax.TermSyntax], parameters: Sequence[s.Sort], name: str
    ) -> tuple[t.Term, ...] | None:
        if len(given) != len(parameters):
            self.terms(given)
            shown = ", ".join(show_sort(p) for p in parameters)
            wanted = count(len(parameters), "argument")
            message = f"`{name}` takes {wanted} and is given {len(given) or 'none'}"
            self.error("RCL305", message, tree, hint=f"its parameters are ({shown})" if parameters else None)
            return None
        pairs, what = zip(given, parameters, strict=True), f"this argument of `{name}`"
        made: list[t.Term] | None = complete([self.wanted(each, sort, what) for each, sort in pairs])
        return None if made is None else tuple(made)

    def construct(self, tree: syntax.Syntax, name: str, arguments: Sequence[syntax.TermSyntax]) -> t.Term | None:
        sort = self.scope.environment.elements[name]
        if isinstance(sort, s.EnumSort):
            self.terms(arguments)
            message = f"`{name}` is an element of {sort.name}: it is no function and takes no arguments"
            self.error("RCL304", message, tree)
            return None
        given = self.arguments(tree, arguments, sort.constructor(name).parameters, name)
        return None if given is None else t.Construct(name, given, sort, self.span(tree))

    def index(
        self, tree: syntax.Syntax, sequence: t.Term, arguments: Sequence[syntax.TermSyntax], item: s.Sort
    ) -> t.Term | None:
        index = self.only(tree, arguments, "a sequence takes one position")
        if index is None or not self.has_sort(
            arguments[0], index, WHOLE, "RCL303", "a position in a sequence is a whole number"
        ):
            return None
        return t.Index(sequence, index, item, self.span(tree))

    def length(self, tree: syntax.Syntax, arguments: Sequence[syntax.TermSyntax]) -> t.Term | None:
        made = self.only(tree, arguments, "`length` takes one sequence")
        if made is None or not self.has_sort(arguments[0], made, s.SequenceSort, "RCL303", "`length` is of a sequence"):
            return None
        return t.Length(made, s.NATURAL, self.span(tree))

    def only(self, tree: syntax.Syntax, arguments: Sequence[syntax.TermSyntax], takes: str) -> t.Term | None:
        """The argument of what takes one; another number of arguments is reported."""
        made = self.terms(arguments)
        if len(made) == 1:
            return made[0]
        self.error("RCL305", f"{takes} and is given {len(made) or 'none'}", tree)
        return None

    def indices(self, tree: syntax.Application, arguments: Sequence[syntax.TermSyntax]) -> t.Term | None:
        """``indices(s)`` is ``<0 upto length(s) - 1>``."""
        length = self.length(tree, arguments)
        if length is None:
            return None
        span = self.span(tree)
        last = t.Arithmetic("-", length, t.Literal(1, s.NATURAL, span), s.INTEGER, span)
        return t.SequenceRange(t.Literal(0, s.NATURAL, span), last, s.SequenceSort(s.NATURAL), span)

    def builtin_operation(
        self, tree: syntax.Syntax, name: t.Builtin, arguments: Sequence[syntax.TermSyntax]
    ) -> t.Term | None:
        formulas = OPERATORS[name].typing.takes_formulas
        terms: list[t.Term] | None = complete([self.formula(a) if formulas else self.term(a) for a in arguments])
        if terms is None:
            return None
        found = operation(name, terms, self.span(tree))
        if not isinstance(found, Mistyped):
            return found
        at = tree if found.at is None else arguments[found.at]
        shown = "" if found.at is None else show_sort(terms[found.at].sort)
        notes = () if found.at is None else self.declared(terms[found.at])
        self.error(found.code, found.message.format(shown), at, hint=found.hint, notes=notes)
        return None

    def product_of_vectors(
        self, tree: syntax.Syntax, name: str, arguments: Sequence[syntax.TermSyntax]
    ) -> t.Term | None:
        """``dot(v, w)``, of tuples or records of two or three numbers, is ``v.x * w.x + v.y * w.y``. ``norm(v)``, or
        ``norm(x, y)``, is the root of such a product with itself."""
        terms: list[t.Term] | None = complete(map(self.term, arguments))
        if terms is None:
            return None
        vectors = [_items(term) for term in terms]
        if name == "norm":
            vectors = [terms if len(terms) > 1 else vectors[0]] * 2 if terms else []
        takes = "a vector, or two or three numbers" if name == "norm" else "two vectors of one length"
        if len(vectors) != 2 or not 2 <= len(vectors[0]) == len(vectors[1]) <= 3:
            hint = "a vector is a tuple or a record of two or three numbers"
            self.error("RCL305", f"`{name}` takes {takes}", tree, hint=hint)
            return None
        for part in (*vectors[0], *vectors[1]):
            if not isinstance(part.sort, NUMERIC):
                message = f"`{name}` takes {takes}, and `{show_term(part, 'rcl')}` is of type {show_sort(part.sort)}"
                self.error("RCL308", message, tree)
                return None
        span = self.span(tree)
        total = reduce(
            lambda one, other: _combined("+", one, other, span),
            [_combined("*", one, other, span) for one, other in zip(*vectors, strict=True)],
        )
        return t.Operation(t.Builtin.SQRT, (widen(total),), s.REAL, span) if name == "norm" else total

    # --- collections -------------------------------------------------------------------------------------------------

    def tuple_of(self, tree: syntax.TupleDisplay, expected: s.Sort | None) -> t.Term | None:
        wanted: Sequence[s.Sort | None] = [None] * len(tree.items)
        if isinstance(expected, s.TupleSort) and len(expected.items) == len(tree.items):
            wanted = expected.items
        items: list[t.Term] | None = complete([self.term(term, w) for term, w in zip(tree.items, wanted, strict=True)])
        if items is None:
            return None
        return t.TupleTerm(tuple(items), s.TupleSort(tuple(i.sort for i in items)), self.span(tree))

    def items(self, trees: Sequence[syntax.TermSyntax], what: str, expected: s.Sort | None) -> list[t.Term] | None:
        items: list[t.Term] | None = complete([self.term(term, expected) for term in trees])
        if items is None:
            return None
        unified = common(items)
        if unified is None:
            wrong = [(term, i) for term, i in zip(trees, items, strict=True) if common([items[0], i]) is None]
            at, first = wrong[0] if wrong else (trees[-1], items[-1])
            message = f"the items of a {what} are of one type: this is {show_sort(first.sort)}, "
            self.error("RCL302", message + f"the first is {show_sort(items[0].sort)}", at)
        return unified

    def sequence(self, tree: syntax.SequenceDisplay, expected: s.Sort | None) -> t.Term | None:
        item = expected.item if isinstance(expected, s.SequenceSort) else None
        if not tree.items:
            if item is None:
                self.error("RCL306", "the type of `<>` cannot be told here", tree, hint="compare it with a sequence")
                return None
            return t.SequenceTerm((), s.SequenceSort(item), self.span(tree))
        items = self.items(tree.items, "sequence", item)
        if items is None:
            return None
        return t.SequenceTerm(tuple(items), s.SequenceSort(joined(items)), self.span(tree))

    def range_of(self, tree: syntax.RangeDisplay) -> t.Term | None:
        low, high = self.term(tree.low), self.term(tree.high)
        if low is None or high is None:
            return None
        for part, term in ((tree.low, low), (tree.high, high)):
            if not self.has_sort(part, term, WHOLE, "RCL303", "a range goes over whole numbers"):
                return None
        sort = s.NATURAL if low.sort == s.NATURAL else s.INTEGER
        return t.SequenceRange(low, high, s.SequenceSort(sort), self.span(tree))

    def set_of(self, tree: syntax.SetDisplay, expected: s.Sort | None) -> t.Term | None:
        item = expected.item if isinstance(expected, s.SetSort) else None
        if not tree.items:
            if item is None:
                self.error("RCL306", "the type of the empty set cannot be told here", tree)
                return None
            return t.SetTerm((), s.SetSort(item), self.span(tree))
        items = self.items(tree.items, "set", item)
        return None if items is None else t.SetTerm(tuple(items), s.SetSort(joined(items)), self.span(tree))

    def collection(self, tree: syntax.TermSyntax, item: s.Sort | None) -> t.Term | None:
        """The right-hand side of ``in``, or a quantifier's domain that is not a type: a set or a sequence."""
        tree = syntax.unparenthesised(tree)
        if isinstance(tree, syntax.Name) and self.scope.taken(tree.text) is not None:
            sort = self.scope.environment.sort(tree.text)
            if isinstance(sort, s.EnumSort) and tree.text not in self.scope.bound:
                members = tuple(t.EnumValue(m, sort, self.span(tree)) for m in sort.members)
                return t.SetTerm(members, s.SetSort(sort), self.span(tree))
            if sort is not None and self.scope.environment.constants.get(tree.text) is None:
                self.not_a_set(tree, show_sort(sort))
                return None
        expected: s.Sort | None = None
        if item is not None:
            expected = s.SetSort(item) if isinstance(tree, syntax.SetDisplay) else s.SequenceSort(item)
        made = self.term(tree, expected)
        hint = "write a set as `{a, b}`, a sequence as `<a, b>`, an interval as `low < x < high`"
        kinds, what = (s.SetSort, s.SequenceSort), "`in` wants a set or a sequence"
        return made if made is not None and self.has_sort(tree, made, kinds, "RCL307", what, hint) else None

    def not_a_set(self, tree: syntax.Syntax, shown: str) -> None:
        hint = "what a variable ranges over is said in its quantifier: `forall(x in REAL | …)`"
        self.error("RCL307", f"the type {shown} is not a set of values that `in` can ask about", tree, hint=hint)

    # --- arithmetic --------------------------------------------------------------------------------------------------

    def numeric(self, tree: syntax.TermSyntax, operator: str) -> t.Term | None:
        term = self.term(tree)
        what = f"`{operator}` is of numbers"
        return term if term is not None and self.has_sort(tree, term, NUMERIC, "RCL308", what) else None

    def arithmetic(self, tree: syntax.Calculation) -> t.Term | None:
        trees = tree.operands
        operators = [token.text for token in tree.operators]
        operands: list[t.Term] = []
        for operand, operator in zip(trees, [operators[0], *operators], strict=True):
            term = self.numeric(operand, operator)
            if term is None:
                continue
            if operator == "/" and operand is not trees[0] and isinstance(term, t.Literal) and term.value == 0:
                self.error("RCL309", "division by zero", operand)
                continue
            operands.append(term)
        if len(operands) < len(trees):
            return None
        result = operands[0]
        for operator, right, place in zip(operators, operands[1:], trees[1:], strict=True):
            result = _combined(operator, result, right, self.between(trees[0], place))
        return result

    def negative(self, tree: syntax.Minus) -> t.Term | None:
        if isinstance(tree.body, syntax.Number):
            return self.number(tree.body, self.span(tree), sign=-1)
        term = self.numeric(tree.body, "-")
        if term is None:
            return None
        return t.Negative(term, s.REAL if term.sort == s.REAL else s.INTEGER, self.span(tree))

    # --- comparisons -------------------------------------------------------------------------------------------------

    def comparison(self, tree: syntax.Comparison) -> t.Term | None:
        operands, relations = tree.operands, tree.relations
        if len(relations) == 1 and relations[0].type in ("IN", "NOT_IN"):
            return self.membership(tree, operands[0], relations[0], operands[1])
        if not self.check_chain(relations):
            self.terms(operands)
            return None
        made: list[t.Term | None] = [None] * len(operands)
        late = []
        hint: s.Sort | None = None
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
        links: list[t.Term] = []
        for i, relation in enumerate(relations):
            left, right = made[i], made[i + 1]
            if left is None or right is None:
                continue
            link = self.compare(tree, relation, operands[i], left, operands[i + 1], right)
            if link is not None:
                links.append(link)
        if len(links) != len(relations):
            return None
        return links[0] if len(links) == 1 else t.And(tuple(links), self.span(tree))

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
        self,
        tree: syntax.Comparison,
        relation: Token,
        left_tree: syntax.TermSyntax,
        left: t.Term,
        right_tree: syntax.TermSyntax,
        right: t.Term,
    ) -> t.Term | None:
        operator = _OPERATORS[relation.type]
        if operator in _ORDERINGS:
            sides, what = ((left_tree, left), (right_tree, right)), f"`{operator}` is of numbers"
            numbers = [self.has_sort(at, term, NUMERIC, "RCL308", what) for at, term in sides]  # each is reported
            if not all(numbers):
                return None
        if isinstance(left.sort, s.SetSort) or isinstance(right.sort, s.SetSort):
            message = f"sets are not compared by `{operator}`: they only stand after `in`"
            self.error("RCL302", message, tree, hint="say what is in it: `forall(x in S | …)`")
            return None
        pair = common([left, right])
        if pair is None:
            shown = f"{show_sort(left.sort)} and {show_sort(right.sort)}"
            message = f"`{operator}` between different types: {shown}"
            hint = self.mismatch_hint(left_tree, left, right_tree, right)
            self.error("RCL302", message, tree, hint=hint)
            return None
        if len(tree.relations) > 1 and left.sort == s.BOOL:
            if relation is tree.relations[0]:
                hint = "join comparisons by `and`, or use `<=>`"
                self.error("RCL121", "truth values are not chained", relation, hint=hint)
            return None
        return t.Compare(operator, pair[0], pair[1], self.between(left_tree, right_tree))

    def mismatch_hint(
        self, left_tree: syntax.Syntax, left: t.Term, right_tree: syntax.Syntax, right: t.Term
    ) -> str | None:
        for tree, one, other in ((left_tree, left, right), (right_tree, right, left)):
            if isinstance(one.sort, s.FunctionSort) and one.sort.result == other.sort:
                return f"apply `{self.text(tree)}` to its {count(len(one.sort.parameters), 'argument')} first"
            if isinstance(one.sort, s.EnumSort) and other.sort in (s.BOOL, s.STRING, s.NATURAL):
                return f"the values of {one.sort.name} are {', '.join(one.sort.members[:6])}"
            if one.sort == s.BOOL and other.sort == s.NATURAL and isinstance(one, t.Variable):
                return f"write `{self.text(tree)}`, or `not {self.text(tree)}`"
        return None

    def membership(
        self, tree: syntax.Syntax, item_tree: syntax.TermSyntax, relation: Token, of_tree: syntax.TermSyntax
    ) -> t.Term | None:
        item = self.term(item_tree)
        of = self.collection(of_tree, item.sort if item is not None else None)
        if item is None or of is None:
            return None
        of_sort = of.sort
        assert isinstance(of_sort, s.SetSort | s.SequenceSort)
        inside: t.In | None = None
        span = self.span(tree)
        if alike(item.sort, of_sort.item):
            inside = t.In(item, of, span)
        elif isinstance(of, t.SetTerm):
            pool = common([item, *of.items])
            if pool is not None:
                inside = t.In(pool[0], t.SetTerm(tuple(pool[1:]), s.SetSort(joined(pool[1:])), of.span), span)
        else:
            converted = convert(item, of_sort.item) or None
            collected = convert(of, s.SequenceSort(item.sort))
            if converted is not None:
                inside = t.In(converted, of, span)
            elif collected is not None:
                inside = t.In(item, collected, span)
        if inside is None:
            shown = f"{show_sort(item.sort)} in a collection of {show_sort(of_sort.item)}"
            self.error("RCL302", f"`{relation.text}` between different types: {shown}", tree)
            return None
        return inside if relation.type == "IN" else t.Not(inside, span)


def _is_open(tree: syntax.TermSyntax) -> bool:
    tree = syntax.unparenthesised(tree)
    if isinstance(tree, syntax.TupleDisplay):
        return any(_is_open(term) for term in tree.items)
    return isinstance(tree, syntax.SequenceDisplay | syntax.SetDisplay) and not tree.items


def _items(vector: t.Term) -> Sequence[t.Term]:
    """The items of a tuple or record; none of another term."""
    sorts = vector.sort.items if isinstance(vector.sort, s.TupleSort) else ()
    return [t.Item(vector, k, sort, vector.span).rebuild((vector,)) for k, sort in enumerate(sorts)]


def _combined(operator: str, left: t.Term, right: t.Term, span: Span) -> t.Arithmetic:
    """``left operator right``: REAL if a side is REAL, or for `/`; a difference of naturals is an INTEGER."""
    if operator == "/" or s.REAL in (left.sort, right.sort):
        return t.Arithmetic(operator, widen(left), widen(right), s.REAL, span)
    natural = left.sort == s.NATURAL and right.sort == s.NATURAL and operator != "-"
    return t.Arithmetic(operator, left, right, s.NATURAL if natural else s.INTEGER, span)
