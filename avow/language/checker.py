"""Surface formulas to typed terms: every name resolved, every widening explicit, every error reported.

A part in error becomes None and is not mentioned again, so that one run reports every independent error of a formula.
Recursion is as deep as the formula, which the parser bounds (`avow.language.parser.MAX_DEPTH`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction

from avow.diagnostics import Span
from avow.language.conversions import NUMERIC, WHOLE, alike, common, convert, joined, widen
from avow.language.environment import did_you_mean
from avow.language.lexer import Token, unquote
from avow.language.printer import show_sort
from avow.language.scope import Scope
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
from avow.language.source import Reports
from avow.language.syntax import Tree
from avow.language.terms import (
    And,
    Apply,
    Arithmetic,
    Compare,
    Construct,
    EnumValue,
    Iff,
    Implies,
    In,
    Index,
    Length,
    Literal,
    Negative,
    Not,
    Or,
    Quantified,
    Quantifier,
    Role,
    SequenceRange,
    SequenceTerm,
    SetTerm,
    Term,
    TupleTerm,
    Variable,
)

BUILTINS: dict[str, Sort] = {"REAL": REAL, "INTEGER": INTEGER, "NATURAL": NATURAL, "BOOL": BOOL, "STRING": STRING}
_ORDERINGS = frozenset(("<", "<=", ">", ">="))


class Checker:
    """Types formulas of one scope. The scope's `bound` variables change on the way and are as before afterwards."""

    def __init__(self, scope: Scope, reports: Reports) -> None:
        self.scope = scope
        self.reports = reports

    # --- entry -------------------------------------------------------------------------------------------------------

    def formula(self, tree: Tree) -> Term | None:
        """A term of sort BOOL."""
        term = self.term(tree, BOOL)
        if term is None or term.sort == BOOL:
            return term
        shown = show_sort(term.sort)
        hint = "compare it with something: `… == …`"
        if isinstance(term.sort, FunctionSort) and term.sort.result == BOOL:
            hint = f"apply it to its {len(term.sort.parameters)} argument(s)"
        self.error("RCL301", f"this must be true or false, and it is of type {shown}", tree, hint=hint)
        return None

    def term(self, tree: Tree, expected: Sort | None = None) -> Term | None:
        """A term of any sort; `expected` helps only where the text leaves the sort open (``<>``)."""
        while tree.kind == "parenthesised":
            tree = tree.parts[0]
        return getattr(self, f"_{tree.kind}")(tree, expected)  # type: ignore[no-any-return]

    def error(
        self,
        code: str,
        message: str,
        at: Tree | Token,
        *,
        hint: str | None = None,
        notes: tuple[tuple[str, Span | None], ...] = (),
    ) -> None:
        self.reports.error(code, message, at.start, at.end, hint=hint, notes=notes)

    def span(self, tree: Tree | Token) -> Span:
        return self.reports.source.span(tree.start, tree.end)

    # --- literals ----------------------------------------------------------------------------------------------------

    def _number(self, tree: Tree, expected: Sort | None, sign: int = 1) -> Term:
        text: str = tree.parts[0]
        if "." in text:
            return Literal(sign * Fraction(text), REAL, self.span(tree))
        value = sign * int(text)
        return Literal(value, NATURAL if value >= 0 else INTEGER, self.span(tree))

    def _string(self, tree: Tree, expected: Sort | None) -> Term:
        return Literal(unquote(tree.parts[0]), STRING, self.span(tree))

    def _truth(self, tree: Tree, expected: Sort | None) -> Term:
        return Literal(tree.parts[0] == "TRUE", BOOL, self.span(tree))

    # --- names -------------------------------------------------------------------------------------------------------

    def _builtin(self, tree: Tree, expected: Sort | None) -> None:
        hint = "a type is declared with `:`, a constant with `=`" if not self.scope.node else None
        self.error("RCL204", f"{tree.parts[0]} is a type, not a value", tree, hint=hint)

    def _name(self, tree: Tree, expected: Sort | None) -> Term | None:
        name: str = tree.parts[0]
        scope, environment = self.scope, self.scope.environment
        if name in scope.bound:
            bound = scope.bound[name]
            return Variable(bound.role, bound.name, bound.sort, self.span(tree))
        candidates = [r for r in (Role.INPUT, Role.OUTPUT) if name in scope.ports(r) and r in scope.roles]
        if len(candidates) == 2:
            hint = f"write `in.{name}` or `out.{name}`"
            self.error("RCL202", f"`{name}` is both an input and an output of node `{scope.node}`", tree, hint=hint)
            return None
        if candidates:
            return self.port(candidates[0], name, tree)
        if name in environment.elements:
            return self.element(name, tree)
        if name in environment.constants:
            return environment.constants[name]
        if environment.sort(name) is not None:
            self.error("RCL204", f"`{name}` is a type, not a value", tree)
        elif name in scope.nodes:
            hint = f"name one of its inputs or outputs: `{name}.…`"
            self.error("RCL204", f"`{name}` is a node, not a value", tree, hint=hint)
        else:
            self.undeclared(name, tree)
        return None

    def undeclared(self, name: str, tree: Tree, what: str = "name") -> None:
        if self.scope.is_broken(name):
            return
        hint = did_you_mean(name, self.scope.known()) or _FOREIGN_NAMES.get(name)
        self.error("RCL201", f"the {what} `{name}` is not declared", tree, hint=hint)

    def element(self, name: str, tree: Tree) -> Term | None:
        sort = self.scope.environment.elements[name]
        if isinstance(sort, EnumSort):
            return EnumValue(name, sort, self.span(tree))
        wanted = len(sort.constructor(name).parameters)
        if wanted:
            shown = ", ".join(show_sort(p) for p in sort.constructor(name).parameters)
            hint = f"write `{name}({shown})` with a term for each type"
            self.error("RCL305", f"`{name}` needs {_count(wanted, 'argument')}", tree, hint=hint)
            return None
        return Construct(name, (), sort, self.span(tree))

    def port(self, role: Role, name: str, tree: Tree) -> Term | None:
        port = self.scope.ports(role).get(name)
        if port is None or role not in self.scope.roles:
            self.no_port(role, name, tree)
            return None
        return Variable(role, name, port.sort, self.span(tree))

    def no_port(self, role: Role, name: str, tree: Tree) -> None:
        scope = self.scope
        if scope.is_broken(name):
            return
        words = {Role.INPUT: "input", Role.OUTPUT: "output"}
        other = Role.OUTPUT if role is Role.INPUT else Role.INPUT
        if scope.node is None:
            self.error(
                "RCL203", f"no node is meant here, so `{role}.{name}` has no meaning", tree, hint="write `node.port`"
            )
            return
        hint: str | None = did_you_mean(name, scope.ports(role))
        if name in scope.ports(role):
            self.error("RCL203", f"the {words[role]}s of a node have no place here: `{role}.{name}`", tree)
            return
        if name in scope.ports(other):
            hint = f"it is an {words[other]}: write `{other}.{name}`"
        elif scope.environment.sort(name) is not None or name in scope.environment.constants:
            hint = f"`{name}` is declared in the context: write `{name}` alone"
        elif name in scope.environment.elements:
            hint = f"`{name}` is an element of a type: write `{name}` alone"
        self.error("RCL203", f"node `{scope.node}` has no {words[role]} `{name}`", tree, hint=hint)

    def _port_name(self, tree: Tree, expected: Sort | None) -> Term | None:
        role, name = tree.parts
        return self.port(Role(role), name, tree)

    def _node_port(self, tree: Tree, expected: Sort | None) -> Term | None:
        node_name, role_text, name = tree.parts
        scope = self.scope
        if not scope.nodes:
            hint = f"write `in.{name}` or `out.{name}`: a contract speaks of its own inputs and outputs only"
            self.error("RCL205", f"`{node_name}.{name}` has no meaning inside a node", tree, hint=hint)
            return None
        node = scope.nodes.get(node_name)
        if node is None:
            self.error("RCL206", f"there is no node `{node_name}`", tree, hint=did_you_mean(node_name, scope.nodes))
            return None
        roles = [Role(role_text)] if role_text else [Role.INPUT, Role.OUTPUT]
        ports = [
            p for p in (*node.inputs, *node.outputs) if p.name == name and p.role in roles and p.role in scope.roles
        ]
        if not ports:
            near = did_you_mean(name, (p.name for p in (*node.inputs, *node.outputs)))
            self.error("RCL203", f"node `{node_name}` has no input or output `{name}`", tree, hint=near)
            return None
        if len(ports) > 1:
            hint = f"write `{node_name}.in.{name}` or `{node_name}.out.{name}`"
            self.error("RCL202", f"`{name}` is both an input and an output of node `{node_name}`", tree, hint=hint)
            return None
        return Variable(ports[0].role, f"{node_name}.{name}", ports[0].sort, self.span(tree))

    # --- applications ------------------------------------------------------------------------------------------------

    def _application(self, tree: Tree, expected: Sort | None) -> Term | None:
        head, arguments = tree.parts[0], tree.parts[1:]
        while head.kind == "parenthesised":
            head = head.parts[0]
        if head.kind == "name":
            name = head.parts[0]
            if self.scope.taken(name) is None:
                if name == "length":
                    return self.length(tree, arguments)
                if name not in self.scope.nodes:
                    self.undeclared(name, head, "function or constructor")
                    self.terms(arguments)
                    return None
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
        message = f"`{self.text(head)}` is of type {show_sort(function.sort)}: it is no function and takes no arguments"
        hint = None
        if len(arguments) == 1:
            hint = f"compare it: `{self.text(head)} == {self.text(arguments[0])}`"
        self.error("RCL304", message, tree, hint=hint)
        return None

    def text(self, tree: Tree) -> str:
        text = " ".join(self.reports.source.text[tree.start : tree.end].split())
        return text if len(text) <= 40 else text[:39] + "…"

    def terms(self, trees: Iterable[Tree]) -> list[Term | None]:
        return [self.term(t) for t in trees]

    def arguments(
        self, tree: Tree, given: Sequence[Tree], parameters: Sequence[Sort], name: str
    ) -> tuple[Term, ...] | None:
        if len(given) != len(parameters):
            self.terms(given)
            shown = ", ".join(show_sort(p) for p in parameters)
            wanted = _count(len(parameters), "argument")
            message = f"`{name}` takes {wanted} and is given {len(given) or 'none'}"
            self.error("RCL305", message, tree, hint=f"its parameters are ({shown})" if parameters else None)
            return None
        made: list[Term | None] = []
        for argument, parameter in zip(given, parameters, strict=True):
            made.append(self.wanted(argument, parameter, f"this argument of `{name}`"))
        done = tuple(m for m in made if m is not None)
        return done if len(done) == len(made) else None

    def wanted(self, tree: Tree, sort: Sort, what: str) -> Term | None:
        """The term, converted to the sort that its place asks for."""
        term = self.term(tree, sort)
        if term is None:
            return None
        converted = convert(term, sort)
        if converted is None:
            hint = None
            if sort == NATURAL and term.sort == INTEGER:
                hint = "it may be negative; say it the other way round, as in `exists(j in NATURAL | j + 1 == i and …)`"
            message = f"{what} must be of type {show_sort(sort)} and is of type {show_sort(term.sort)}"
            self.error("RCL303", message, tree, hint=hint)
        return converted

    def construct(self, tree: Tree, name: str, arguments: Sequence[Tree]) -> Term | None:
        sort = self.scope.environment.elements[name]
        if isinstance(sort, EnumSort):
            self.terms(arguments)
            message = f"`{name}` is an element of {sort.name}: it is no function and takes no arguments"
            self.error("RCL304", message, tree)
            return None
        given = self.arguments(tree, arguments, sort.constructor(name).parameters, name)
        return None if given is None else Construct(name, given, sort, self.span(tree))

    def index(self, tree: Tree, sequence: Term, arguments: Sequence[Tree], item: Sort) -> Term | None:
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

    def length(self, tree: Tree, arguments: Sequence[Tree]) -> Term | None:
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

    # --- collections -------------------------------------------------------------------------------------------------

    def _tuple(self, tree: Tree, expected: Sort | None) -> Term | None:
        wanted: Sequence[Sort | None] = [None] * len(tree.parts)
        if isinstance(expected, TupleSort) and len(expected.items) == len(tree.parts):
            wanted = expected.items
        made = [self.term(t, w) for t, w in zip(tree.parts, wanted, strict=True)]
        items = tuple(m for m in made if m is not None)
        if len(items) != len(made):
            return None
        return TupleTerm(items, TupleSort(tuple(i.sort for i in items)), self.span(tree))

    def items(self, tree: Tree, what: str, expected: Sort | None) -> list[Term] | None:
        made = [self.term(t, expected) for t in tree.parts]
        items = [m for m in made if m is not None]
        if len(items) != len(made):
            return None
        unified = common(items)
        if unified is None:
            at, first = next((t, i) for t, i in zip(tree.parts, items, strict=True) if common([items[0], i]) is None)
            message = f"the items of a {what} are of one type: this is {show_sort(first.sort)}, "
            self.error("RCL302", message + f"the first is {show_sort(items[0].sort)}", at)
        return unified

    def _sequence(self, tree: Tree, expected: Sort | None) -> Term | None:
        item = expected.item if isinstance(expected, SequenceSort) else None
        if not tree.parts:
            if item is None:
                self.error("RCL306", "the type of `<>` cannot be told here", tree, hint="compare it with a sequence")
                return None
            return SequenceTerm((), SequenceSort(item), self.span(tree))
        items = self.items(tree, "sequence", item)
        if items is None:
            return None
        return SequenceTerm(tuple(items), SequenceSort(joined(items)), self.span(tree))

    def _range(self, tree: Tree, expected: Sort | None) -> Term | None:
        low, high = self.term(tree.parts[0]), self.term(tree.parts[1])
        if low is None or high is None:
            return None
        for part, term in zip(tree.parts, (low, high), strict=True):
            if not isinstance(term.sort, WHOLE):
                message = f"a range goes over whole numbers, and this is of type {show_sort(term.sort)}"
                self.error("RCL303", message, part)
                return None
        sort = NATURAL if low.sort == NATURAL else INTEGER
        return SequenceRange(low, high, SequenceSort(sort), self.span(tree))

    def _set(self, tree: Tree, expected: Sort | None) -> Term | None:
        item = expected.item if isinstance(expected, SetSort) else None
        if not tree.parts:
            if item is None:
                self.error("RCL306", "the type of the empty set cannot be told here", tree)
                return None
            return SetTerm((), SetSort(item), self.span(tree))
        items = self.items(tree, "set", item)
        return None if items is None else SetTerm(tuple(items), SetSort(joined(items)), self.span(tree))

    def collection(self, tree: Tree, item: Sort | None) -> Term | None:
        """The right-hand side of ``in``, or a quantifier's domain that is no type: a set or a sequence."""
        while tree.kind == "parenthesised":
            tree = tree.parts[0]
        if tree.kind == "name" and self.scope.taken(tree.parts[0]) is not None:
            sort = self.scope.environment.sort(tree.parts[0])
            if isinstance(sort, EnumSort) and tree.parts[0] not in self.scope.bound:
                members = tuple(EnumValue(m, sort, self.span(tree)) for m in sort.members)
                return SetTerm(members, SetSort(sort), self.span(tree))
            if sort is not None and self.scope.environment.constants.get(tree.parts[0]) is None:
                self.not_a_set(tree, show_sort(sort))
                return None
        if tree.kind == "builtin":
            self.not_a_set(tree, tree.parts[0])
            return None
        expected: Sort | None = None
        if item is not None:
            expected = SetSort(item) if tree.kind == "set" else SequenceSort(item)
        made = self.term(tree, expected)
        if made is None or isinstance(made.sort, SetSort | SequenceSort):
            return made
        message = f"`in` wants a set or a sequence, and this is of type {show_sort(made.sort)}"
        self.error("RCL307", message, tree, hint="write a set as `{a, b}`, a sequence as `<a, b>`")
        return None

    def not_a_set(self, tree: Tree, shown: str) -> None:
        hint = "what a variable ranges over is said in its quantifier: `forall(x in REAL | …)`"
        self.error("RCL307", f"the type {shown} is not a set of values that `in` can ask about", tree, hint=hint)

    # --- arithmetic --------------------------------------------------------------------------------------------------

    def numeric(self, tree: Tree, operator: str) -> Term | None:
        term = self.term(tree)
        if term is not None and not isinstance(term.sort, NUMERIC):
            self.error("RCL308", f"`{operator}` is of numbers, and this is of type {show_sort(term.sort)}", tree)
            return None
        return term

    def _arithmetic(self, tree: Tree, expected: Sort | None) -> Term | None:
        left_tree, operator, right_tree = tree.parts
        left, right = self.numeric(left_tree, operator), self.numeric(right_tree, operator)
        if left is None or right is None:
            return None
        if operator == "/" and isinstance(right, Literal) and right.value == 0:
            self.error("RCL309", "division by zero", right_tree)
            return None
        if operator == "/" or REAL in (left.sort, right.sort):
            return Arithmetic(operator, widen(left), widen(right), REAL, self.span(tree))
        natural = left.sort == NATURAL and right.sort == NATURAL and operator != "-"
        return Arithmetic(operator, left, right, NATURAL if natural else INTEGER, self.span(tree))

    def _negative(self, tree: Tree, expected: Sort | None) -> Term | None:
        inner = tree.parts[0]
        if inner.kind == "number":
            return self._number(inner._replace(start=tree.start), None, sign=-1)
        term = self.numeric(inner, "-")
        if term is None:
            return None
        return Negative(term, REAL if term.sort == REAL else INTEGER, self.span(tree))

    # --- comparisons -------------------------------------------------------------------------------------------------

    def _comparison(self, tree: Tree, expected: Sort | None) -> Term | None:
        operands: tuple[Tree, ...] = tree.parts[::2]
        relations: tuple[Token, ...] = tree.parts[1::2]
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
        texts = {r.text for r in relations if r.text != "=="}
        if len(relations) == 1:
            return True
        for relation in relations:
            if relation.type in ("IN", "NOT_IN", "NE"):
                message = f"`{relation.text}` cannot be part of a chain of comparisons"
                self.error("RCL121", message, relation, hint="join comparisons by `and`")
                return False
        if texts <= {"<", "<="} or texts <= {">", ">="}:
            return True
        message = "a chain of comparisons goes one way, as in `0 <= r < 120`"
        self.error("RCL121", message, relations[-1], hint="join comparisons by `and`")
        return False

    def compare(
        self, tree: Tree, relation: Token, left_tree: Tree, left: Term, right_tree: Tree, right: Term
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
            self.error("RCL302", message, tree, hint=self.mismatch_hint(left_tree, left, right_tree, right))
            return None
        if len(tree.parts) > 3 and left.sort == BOOL:
            self.error(
                "RCL121", "truth values are not chained", relation, hint="join comparisons by `and`, or use `<=>`"
            )
            return None
        span = self.span(tree) if len(tree.parts) == 3 else self.reports.source.span(left_tree.start, right_tree.end)
        return Compare(operator, pair[0], pair[1], span)

    def mismatch_hint(self, left_tree: Tree, left: Term, right_tree: Tree, right: Term) -> str | None:
        for tree, one, other in ((left_tree, left, right), (right_tree, right, left)):
            if isinstance(one.sort, FunctionSort) and one.sort.result == other.sort:
                return f"apply `{self.text(tree)}` to its {_count(len(one.sort.parameters), 'argument')} first"
            if isinstance(one.sort, EnumSort) and isinstance(other, Literal) and other.value in one.sort.members:
                return f"write `{other.value}` without quotation marks"
            if isinstance(one.sort, EnumSort) and other.sort == BOOL:
                return f"the values of {one.sort.name} are {', '.join(one.sort.members[:6])}"
        return None

    def membership(self, tree: Tree, item_tree: Tree, relation: Token, of_tree: Tree) -> Term | None:
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
        both = self.formulas(tree.parts)
        return None if both is None else Implies(both[0], both[1], self.span(tree))

    def _iff(self, tree: Tree, expected: Sort | None) -> Term | None:
        both = self.formulas(tree.parts)
        return None if both is None else Iff(both[0], both[1], self.span(tree))

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
                hint = did_you_mean(name, known) or _FOREIGN_TYPES.get(name.casefold())
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


def _is_open(tree: Tree) -> bool:
    while tree.kind == "parenthesised":
        tree = tree.parts[0]
    if tree.kind == "tuple":
        return any(_is_open(t) for t in tree.parts)
    return tree.kind in ("sequence", "set") and not tree.parts


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


_OPERATORS = {"EQ": "==", "NE": "!=", "LE": "<=", "GE": ">=", "LT": "<", "GT": ">"}
_FOREIGN_NAMES = {
    "true": "write `TRUE`",
    "True": "write `TRUE`",
    "false": "write `FALSE`",
    "False": "write `FALSE`",
    "EmptySet": "the empty set is written `{}`",
}
_FOREIGN_TYPES = {
    **dict.fromkeys(("string", "str"), "did you mean `STRING`?"),
    **dict.fromkeys(("bool", "boolean"), "did you mean `BOOL`?"),
    **dict.fromkeys(("int", "integer", "ints", "z"), "did you mean `INTEGER`?"),
    **dict.fromkeys(("nat", "natural", "unsigned", "uint", "n"), "did you mean `NATURAL`?"),
    **dict.fromkeys(("float", "double", "real", "number", "decimal", "r"), "did you mean `REAL`?"),
}
