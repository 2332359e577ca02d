"""Expressions with every name resolved and every sort known: surface syntax to the core's typed terms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from fractions import Fraction

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.records import dataclass
from avow.base.suggestions import did_you_mean
from avow.language import sorts as s
from avow.language import terms as t
from avow.language.operators import OPERATORS, Why
from avow.language.printer import show_sort

from . import syntax
from .names import UNKNOWN, Names, join
from .program import variable

_NUMERIC = (s.NATURAL, s.INTEGER, s.REAL)


@dataclass(frozen=True, slots=True)
class Scope:
    """What an expression may speak of. `ports` are readings of ``in.…``, in assertions; None elsewhere."""

    names: Names
    local: Mapping[str, t.Variable] = field(default_factory=dict)
    ports: Mapping[str, t.Term] | None = None
    quantifiers: bool = False


def term(expression: syntax.Expression, scope: Scope) -> t.Term:
    """The typed term. Raises Rejected (codes ``HOARE200``, ``HOARE300``). Depth is bounded by the parser."""
    match expression:
        case syntax.Number(value=value, whole=whole, span=span):
            return t.Literal(int(value), s.NATURAL, span) if whole else t.Literal(value, s.REAL, span)
        case syntax.Truth(value=truth, span=span):
            return t.Literal(truth, s.BOOL, span)
        case syntax.Text(value=text, span=span):
            return t.Literal(text, s.STRING, span)
        case syntax.Name():
            return _name(expression, scope)
        case syntax.Call():
            return _call(expression, scope)
        case syntax.Unary(operator="-", operand=operand, span=span):
            inner = _number(term(operand, scope), span)
            return t.Negative(inner, s.REAL if inner.sort == s.REAL else s.INTEGER, span)
        case syntax.Unary(operand=operand, span=span):
            return t.Not(formula(operand, scope), span)
        case syntax.Binary(operator=operator, left=left, right=right, span=span):
            return _binary(operator, left, right, span, scope)
        case syntax.Chain(items=items, operators=operators, span=span):
            parts = [term(item, scope) for item in items]
            pairs = zip(operators, parts, parts[1:], strict=False)
            return t.And(tuple(compare(operator, a, b, span) for operator, a, b in pairs), span)
        case syntax.Member(item=item, choices=choices, negated=negated, span=span):
            one = term(item, scope)
            others = tuple(fit(term(choice, scope), one.sort, choice.span) for choice in choices)
            inside = t.In(one, t.SetTerm(others, s.SetSort(one.sort)), span)
            return t.Not(inside, span) if negated else inside
        case syntax.Inside(item=item, collection=collection, negated=negated, span=span):
            among = _inside(term(item, scope), term(collection, scope), span)
            return t.Not(among, span) if negated else among
        case syntax.Tuple(items=items, span=span):
            values = tuple(term(item, scope) for item in items)
            return t.TupleTerm(values, s.TupleSort(tuple(v.sort for v in values)), span)
        case syntax.Sequence(items=items, span=span):
            return _sequence(tuple(term(item, scope) for item in items), span)
        case syntax.Quantification():
            return _quantified(expression, scope)


def formula(expression: syntax.Expression, scope: Scope) -> t.Term:
    """A term of sort BOOL. Raises Rejected."""
    return fit(term(expression, scope), s.BOOL, expression.span)


def fit(given: t.Term, sort: s.Sort, span: Span | None) -> t.Term:
    """The term as one of the sort: integers widen to REAL, INTEGER passes for NATURAL (a condition is proved of it)."""
    if (
        given.sort == sort
        or (sort == s.INTEGER and given.sort == s.NATURAL)
        or (sort == s.NATURAL and given.sort == s.INTEGER)
    ):
        return given
    if sort == s.REAL and given.sort in (s.INTEGER, s.NATURAL):
        return real(given)
    match given, sort:  # what is written out widens part by part
        case t.TupleTerm(items=items), s.TupleSort(items=sorts) if len(items) == len(sorts):
            return t.TupleTerm(
                tuple(fit(i, part, i.span or span) for i, part in zip(items, sorts, strict=True)), sort, span
            )
        case t.SequenceTerm(items=items), s.SequenceSort(item=item):
            return t.SequenceTerm(tuple(fit(i, item, i.span or span) for i in items), sort, span)
    raise rejected("HOARE300", f"this is {show_sort(given.sort)}, but {show_sort(sort)} is wanted here", span)


def real(given: t.Term) -> t.Term:
    """An integer term as a REAL one."""
    if isinstance(given, t.Literal) and not isinstance(given.value, str):
        return t.Literal(Fraction(given.value), s.REAL, given.span)
    return t.Widen(given, s.REAL, given.span)


def compare(operator: str, left: t.Term, right: t.Term, span: Span | None) -> t.Term:
    """A comparison of terms of one sort, up to widening. Raises Rejected."""
    sort = join(left.sort, right.sort)
    assert sort is not None
    if UNKNOWN in s.components(sort):
        raise rejected("HOARE300", "nothing says of what these sequences are", span)
    left, right = fit(left, sort, left.span or span), fit(right, sort, right.span or span)
    if operator in {"<", "<=", ">", ">="} and sort not in _NUMERIC:
        raise rejected("HOARE300", f"{operator} compares numbers; these are {show_sort(sort)}", span)
    if isinstance(sort, s.FunctionSort):
        raise rejected("HOARE300", "whole functions cannot be compared", span)
    if sort == s.BOOL:
        return t.Iff(left, right, span) if operator == "==" else t.Not(t.Iff(left, right, span), span)
    return t.Compare(operator, left, right, span)


def _sequence(items: tuple[t.Term, ...], span: Span | None) -> t.Term:
    sort: s.Sort = UNKNOWN
    for item in items:
        sort = join(sort, item.sort) or sort
    return t.SequenceTerm(tuple(fit(item, sort, item.span or span) for item in items), s.SequenceSort(sort), span)


def _inside(item: t.Term, collection: t.Term, span: Span | None) -> t.Term:
    """In a sequence, or in a set that the contract names."""
    if not isinstance(collection.sort, s.SequenceSort | s.SetSort):
        raise rejected("HOARE300", f"`in` wants a set or a sequence; this is {show_sort(collection.sort)}", span)
    wanted = collection.sort.item
    if isinstance(collection, t.SequenceTerm):
        wanted = join(item.sort, wanted) or wanted
        collection = fit(collection, s.SequenceSort(wanted), span)
    return t.In(fit(item, wanted, span), collection, span)


def rejected(code: str, message: str, span: Span | None, hint: str | None = None) -> Rejected:
    return Rejected(Diagnostic(code, message, span, hint=hint))


def _name(name: syntax.Name, scope: Scope) -> t.Term:
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
        return t.Construct(name.name, (), data, name.span)
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


def _port(name: syntax.Name, scope: Scope) -> t.Term:
    if scope.ports is None or name.prefix != "in":
        what = "assertions only (INVARIANT)" if name.prefix == "in" else "the contract only"
        raise rejected("HOARE200", f"`{name}` belongs into {what}: a program has variables", name.span)
    if name.name not in scope.ports:
        raise rejected(
            "HOARE200", f"the node has no input `{name.name}`", name.span, did_you_mean(name.name, [*scope.ports])
        )
    return scope.ports[name.name]


def _call(call: syntax.Call, scope: Scope) -> t.Term:
    words = scope.names.vocabulary
    name = call.function
    arguments = [term(argument, scope) for argument in call.arguments]
    if str(name) == "length" and name.name not in scope.names.sorts and name.name not in scope.local:
        return _length(call, arguments)
    if name.prefix is None and name.name not in scope.local and name.name in words.constructors:
        data, constructor = words.constructors[name.name]
        return t.Construct(name.name, _fitted(call, arguments, constructor.parameters), data, call.span)
    function = _name(name, scope)
    if isinstance(function.sort, s.SequenceSort):
        return t.Index(function, _fitted(call, arguments, (s.NATURAL,))[0], function.sort.item, call.span)
    if not isinstance(function.sort, s.FunctionSort):
        raise rejected("HOARE300", f"`{name}` is {show_sort(function.sort)}, not a function", call.span)
    if not isinstance(function, t.Variable):
        raise rejected("HOARE300", f"`{name}` cannot be applied here: it is not one function of the program", call.span)
    return t.Apply(function, _fitted(call, arguments, function.sort.parameters), function.sort.result, call.span)


def _length(call: syntax.Call, arguments: list[t.Term]) -> t.Term:
    if len(arguments) != 1 or not isinstance(arguments[0].sort, s.SequenceSort):
        raise rejected("HOARE300", "length(…) takes one sequence", call.span)
    if arguments[0].sort.item == UNKNOWN:
        return t.Literal(0, s.NATURAL, call.span)
    return t.Length(arguments[0], s.NATURAL, call.span)


def _fitted(call: syntax.Call, arguments: list[t.Term], parameters: tuple[s.Sort, ...]) -> tuple[t.Term, ...]:
    if len(arguments) != len(parameters):
        message = f"`{call.function}` takes {len(parameters)} argument(s), not {len(arguments)}"
        raise rejected("HOARE300", message, call.span)
    return tuple(fit(a, p, e.span) for a, p, e in zip(arguments, parameters, call.arguments, strict=True))


def _binary(operator: str, left: syntax.Expression, right: syntax.Expression, span: Span, scope: Scope) -> t.Term:
    if operator in {"and", "or", "->", "<=>"}:
        one, other = formula(left, scope), formula(right, scope)
        match operator:
            case "and":
                return t.And((one, other), span)
            case "or":
                return t.Or((one, other), span)
            case "->":
                return t.Implies(one, other, span)
            case _:  # <=>
                return t.Iff(one, other, span)
    one, other = term(left, scope), term(right, scope)
    if operator in {"+", "-", "*", "/"}:
        one, other = _number(one, left.span), _number(other, right.span)
        sort: s.Sort = s.REAL if operator == "/" else join(one.sort, other.sort) or s.REAL
        if operator == "-" and sort == s.NATURAL:
            sort = s.INTEGER
        if sort == s.REAL:
            one, other = fit(one, s.REAL, left.span), fit(other, s.REAL, right.span)
        return t.Arithmetic(operator, one, other, sort, span)
    return compare(operator, one, other, span)


def _number(given: t.Term, span: Span | None) -> t.Term:
    if given.sort not in _NUMERIC:
        raise rejected("HOARE300", f"a number is wanted here; this is {show_sort(given.sort)}", span)
    return given


def _quantified(expression: syntax.Quantification, scope: Scope) -> t.Term:
    if not scope.quantifiers:
        raise rejected("HOARE300", f"a program cannot compute {expression.quantifier}", expression.span)
    local = dict(scope.local)
    bound: list[t.Variable] = []
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
    kind = t.Quantifier.FORALL if expression.quantifier == "forall" else t.Quantifier.EXISTS
    return t.Quantified(kind, tuple(bound), formula(expression.body, inner), expression.span)
