"""Expressions with every name resolved and every sort known: surface syntax to the core's typed terms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from fractions import Fraction

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.records import dataclass
from avow.base.suggestions import did_you_mean
from avow.language.operators import OPERATORS, Why
from avow.language.printer import show_sort
from avow.language.sorts import (
    BOOL,
    INTEGER,
    NATURAL,
    REAL,
    STRING,
    FunctionSort,
    SequenceSort,
    SetSort,
    Sort,
    TupleSort,
    components,
)
from avow.language.terms import (
    And,
    Apply,
    Arithmetic,
    Compare,
    Construct,
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
    SequenceTerm,
    SetTerm,
    Term,
    TupleTerm,
    Variable,
    Widen,
)

from . import syntax
from .names import UNKNOWN, Names, join
from .program import variable

_NUMERIC = (NATURAL, INTEGER, REAL)


@dataclass(frozen=True, slots=True)
class Scope:
    """What an expression may speak of. `ports` are readings of ``in.…``, in assertions; None elsewhere."""

    names: Names
    local: Mapping[str, Variable] = field(default_factory=dict)
    ports: Mapping[str, Term] | None = None
    quantifiers: bool = False


def term(expression: syntax.Expression, scope: Scope) -> Term:
    """The typed term. Raises Rejected (codes ``HOARE200``, ``HOARE300``). Depth is bounded by the parser."""
    match expression:
        case syntax.Number(value=value, whole=whole, span=span):
            return Literal(int(value), NATURAL, span) if whole else Literal(value, REAL, span)
        case syntax.Truth(value=truth, span=span):
            return Literal(truth, BOOL, span)
        case syntax.Text(value=text, span=span):
            return Literal(text, STRING, span)
        case syntax.Name():
            return _name(expression, scope)
        case syntax.Call():
            return _call(expression, scope)
        case syntax.Unary(operator="-", operand=operand, span=span):
            inner = _number(term(operand, scope), span)
            return Negative(inner, REAL if inner.sort == REAL else INTEGER, span)
        case syntax.Unary(operand=operand, span=span):
            return Not(formula(operand, scope), span)
        case syntax.Binary(operator=operator, left=left, right=right, span=span):
            return _binary(operator, left, right, span, scope)
        case syntax.Chain(items=items, operators=operators, span=span):
            parts = [term(item, scope) for item in items]
            pairs = zip(operators, parts, parts[1:], strict=False)
            return And(tuple(compare(operator, a, b, span) for operator, a, b in pairs), span)
        case syntax.Member(item=item, choices=choices, negated=negated, span=span):
            one = term(item, scope)
            others = tuple(fit(term(choice, scope), one.sort, choice.span) for choice in choices)
            inside = In(one, SetTerm(others, SetSort(one.sort)), span)
            return Not(inside, span) if negated else inside
        case syntax.Inside(item=item, collection=collection, negated=negated, span=span):
            among = _inside(term(item, scope), term(collection, scope), span)
            return Not(among, span) if negated else among
        case syntax.Tuple(items=items, span=span):
            values = tuple(term(item, scope) for item in items)
            return TupleTerm(values, TupleSort(tuple(v.sort for v in values)), span)
        case syntax.Sequence(items=items, span=span):
            return _sequence(tuple(term(item, scope) for item in items), span)
        case syntax.Quantification():
            return _quantified(expression, scope)


def formula(expression: syntax.Expression, scope: Scope) -> Term:
    """A term of sort BOOL. Raises Rejected."""
    return fit(term(expression, scope), BOOL, expression.span)


def fit(given: Term, sort: Sort, span: Span | None) -> Term:
    """The term as one of the sort: integers widen to REAL, INTEGER passes for NATURAL (a condition is proved of it)."""
    if given.sort == sort or (sort == INTEGER and given.sort == NATURAL) or (sort == NATURAL and given.sort == INTEGER):
        return given
    if sort == REAL and given.sort in (INTEGER, NATURAL):
        return real(given)
    match given, sort:  # what is written out widens part by part
        case TupleTerm(items=items), TupleSort(items=sorts) if len(items) == len(sorts):
            return TupleTerm(tuple(fit(i, s, i.span or span) for i, s in zip(items, sorts, strict=True)), sort, span)
        case SequenceTerm(items=items), SequenceSort(item=item):
            return SequenceTerm(tuple(fit(i, item, i.span or span) for i in items), sort, span)
    raise rejected("HOARE300", f"this is {show_sort(given.sort)}, but {show_sort(sort)} is wanted here", span)


def real(given: Term) -> Term:
    """An integer term as a REAL one."""
    if isinstance(given, Literal) and not isinstance(given.value, str):
        return Literal(Fraction(given.value), REAL, given.span)
    return Widen(given, REAL, given.span)


def compare(operator: str, left: Term, right: Term, span: Span | None) -> Term:
    """A comparison of terms of one sort, up to widening. Raises Rejected."""
    sort = join(left.sort, right.sort)
    assert sort is not None
    if UNKNOWN in components(sort):
        raise rejected("HOARE300", "nothing says of what these sequences are", span)
    left, right = fit(left, sort, left.span or span), fit(right, sort, right.span or span)
    if operator in {"<", "<=", ">", ">="} and sort not in _NUMERIC:
        raise rejected("HOARE300", f"{operator} compares numbers; these are {show_sort(sort)}", span)
    if isinstance(sort, FunctionSort):
        raise rejected("HOARE300", "whole functions cannot be compared", span)
    if sort == BOOL:
        return Iff(left, right, span) if operator == "==" else Not(Iff(left, right, span), span)
    return Compare(operator, left, right, span)


def _sequence(items: tuple[Term, ...], span: Span | None) -> Term:
    sort: Sort = UNKNOWN
    for item in items:
        sort = join(sort, item.sort) or sort
    return SequenceTerm(tuple(fit(item, sort, item.span or span) for item in items), SequenceSort(sort), span)


def _inside(item: Term, collection: Term, span: Span | None) -> Term:
    """In a sequence, or in a set that the contract names."""
    if not isinstance(collection.sort, SequenceSort | SetSort):
        raise rejected("HOARE300", f"`in` wants a set or a sequence; this is {show_sort(collection.sort)}", span)
    wanted = collection.sort.item
    if isinstance(collection, SequenceTerm):
        wanted = join(item.sort, wanted) or wanted
        collection = fit(collection, SequenceSort(wanted), span)
    return In(fit(item, wanted, span), collection, span)


def rejected(code: str, message: str, span: Span | None, hint: str | None = None) -> Rejected:
    return Rejected(Diagnostic(code, message, span, hint=hint))


def _name(name: syntax.Name, scope: Scope) -> Term:
    if name.prefix is not None:
        return _port(name, scope)
    if name.name in scope.local:
        return scope.local[name.name]
    if name.name in scope.names.sorts:
        return variable(name.name, scope.names.sorts[name.name])
    words = scope.names.vocabulary
    if name.name in words.values:
        return words.values[name.name]
    if name.name in words.constructors:
        data, constructor = words.constructors[name.name]
        if constructor.parameters:
            raise rejected("HOARE300", f"{name.name} needs {len(constructor.parameters)} argument(s)", name.span)
        return Construct(name.name, (), data, name.span)
    if name.name in OPERATORS and isinstance(why := OPERATORS[name.name].program, Why):
        raise rejected("HOARE200", f"a program has no `{name.name}`: {why.reason}", name.span)
    known = [*scope.local, *scope.names.sorts, *words.values, *words.constructors]
    raise rejected(
        "HOARE200",
        f"nothing is called `{name.name}` here, or nothing says of which sort it is",
        name.span,
        did_you_mean(name.name, known)
        or "declare it (VAR name : REAL; or GIVEN name : REAL;) or map it to a port in the plan",
    )


def _port(name: syntax.Name, scope: Scope) -> Term:
    if scope.ports is None or name.prefix != "in":
        what = "assertions only (INVARIANT)" if name.prefix == "in" else "the contract only"
        raise rejected("HOARE200", f"`{name}` belongs into {what}: a program has variables", name.span)
    if name.name not in scope.ports:
        raise rejected(
            "HOARE200", f"the node has no input `{name.name}`", name.span, did_you_mean(name.name, [*scope.ports])
        )
    return scope.ports[name.name]


def _call(call: syntax.Call, scope: Scope) -> Term:
    words = scope.names.vocabulary
    name = call.function
    arguments = [term(argument, scope) for argument in call.arguments]
    if str(name) == "length" and name.name not in scope.names.sorts and name.name not in scope.local:
        return _length(call, arguments)
    if name.prefix is None and name.name not in scope.local and name.name in words.constructors:
        data, constructor = words.constructors[name.name]
        return Construct(name.name, _fitted(call, arguments, constructor.parameters), data, call.span)
    function = _name(name, scope)
    if isinstance(function.sort, SequenceSort):
        return Index(function, _fitted(call, arguments, (NATURAL,))[0], function.sort.item, call.span)
    if not isinstance(function.sort, FunctionSort):
        raise rejected("HOARE300", f"`{name}` is {show_sort(function.sort)}, not a function", call.span)
    if not isinstance(function, Variable):
        raise rejected("HOARE300", f"`{name}` cannot be applied here: it is not one function of the program", call.span)
    return Apply(function, _fitted(call, arguments, function.sort.parameters), function.sort.result, call.span)


def _length(call: syntax.Call, arguments: list[Term]) -> Term:
    if len(arguments) != 1 or not isinstance(arguments[0].sort, SequenceSort):
        raise rejected("HOARE300", "length(…) takes one sequence", call.span)
    if arguments[0].sort.item == UNKNOWN:
        return Literal(0, NATURAL, call.span)
    return Length(arguments[0], NATURAL, call.span)


def _fitted(call: syntax.Call, arguments: list[Term], parameters: tuple[Sort, ...]) -> tuple[Term, ...]:
    if len(arguments) != len(parameters):
        message = f"`{call.function}` takes {len(parameters)} argument(s), not {len(arguments)}"
        raise rejected("HOARE300", message, call.span)
    return tuple(fit(a, p, e.span) for a, p, e in zip(arguments, parameters, call.arguments, strict=True))


def _binary(operator: str, left: syntax.Expression, right: syntax.Expression, span: Span, scope: Scope) -> Term:
    if operator in {"and", "or", "->", "<=>"}:
        one, other = formula(left, scope), formula(right, scope)
        match operator:
            case "and":
                return And((one, other), span)
            case "or":
                return Or((one, other), span)
            case "->":
                return Implies(one, other, span)
            case _:  # <=>
                return Iff(one, other, span)
    one, other = term(left, scope), term(right, scope)
    if operator in {"+", "-", "*", "/"}:
        one, other = _number(one, left.span), _number(other, right.span)
        sort: Sort = REAL if operator == "/" else join(one.sort, other.sort) or REAL
        if operator == "-" and sort == NATURAL:
            sort = INTEGER
        if sort == REAL:
            one, other = fit(one, REAL, left.span), fit(other, REAL, right.span)
        return Arithmetic(operator, one, other, sort, span)
    return compare(operator, one, other, span)


def _number(given: Term, span: Span | None) -> Term:
    if given.sort not in _NUMERIC:
        raise rejected("HOARE300", f"a number is wanted here; this is {show_sort(given.sort)}", span)
    return given


def _quantified(expression: syntax.Quantification, scope: Scope) -> Term:
    if not scope.quantifiers:
        raise rejected("HOARE300", f"a program cannot compute {expression.quantifier}", expression.span)
    local = dict(scope.local)
    bound: list[Variable] = []
    for names, sort_name in expression.groups:
        sort = scope.names.vocabulary.types.get(sort_name)
        if sort is None:
            hint = did_you_mean(sort_name, [*scope.names.vocabulary.types])
            raise rejected("HOARE200", f"there is no type `{sort_name}`", expression.span, hint)
        for name in names:
            if name.name in local or name.name in scope.names.sorts:
                raise rejected("HOARE200", f"`{name.name}` is in use already", name.span)
            local[name.name] = variable(name.name, sort)
            bound.append(local[name.name])
    inner = Scope(scope.names, local, scope.ports, True)
    kind = Quantifier.FORALL if expression.quantifier == "forall" else Quantifier.EXISTS
    return Quantified(kind, tuple(bound), formula(expression.body, inner), expression.span)
