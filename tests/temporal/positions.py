"""What formulas with history mean, from the definitions over all steps of a run; no code is shared with the cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from avow.language.terms import (
    And,
    Apply,
    Compare,
    History,
    Iff,
    Implies,
    In,
    Literal,
    Not,
    Or,
    Past,
    Term,
    Variable,
)

Step = Mapping[str, Any]
_COMPARED = {
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
}


def value(term: Term, run: Sequence[Step], k: int) -> Any:
    """The value of a term of the past at step k of a run; a response is looked at as far as the run goes."""
    now = run[k]
    match term:
        case Literal(value=literal):
            return literal
        case Variable():
            return now[term.qualified]
        case Apply(function=function, arguments=arguments):
            return value(function, run, k)(*(value(a, run, k) for a in arguments))
        case In(item=item, collection=collection):
            return value(item, run, k) in value(collection, run, k).items
        case Not(body=body):
            return not value(body, run, k)
        case And(items=items):
            return all(value(i, run, k) for i in items)
        case Or(items=items):
            return any(value(i, run, k) for i in items)
        case Implies(left=left, right=right):
            return not value(left, run, k) or value(right, run, k)
        case Iff(left=left, right=right):
            return value(left, run, k) == value(right, run, k)
        case Compare(operator=sign, left=left, right=right):
            return _COMPARED[sign](value(left, run, k), value(right, run, k))
        case History():
            return _history(term, run, k)
    raise AssertionError(term)


def _history(term: History, run: Sequence[Step], k: int) -> Any:
    f, *others = term.arguments
    limit = None if term.limit is None else value(term.limit.amount, run, k)

    def at(formula: Term, j: int) -> Any:
        return value(formula, run, j)

    def all_along(formula: Term, first: int, last: int) -> bool:
        return all(at(formula, j) for j in range(first, last + 1))

    match term.operator:
        case Past.PREVIOUS:
            return at(f, k - 1) if k else at(others[0], 0)
        case Past.ROSE:
            return at(f, k) and not (k > 0 and at(f, k - 1))
        case Past.FELL:
            return k > 0 and at(f, k - 1) and not at(f, k)
        case Past.CHANGED:
            return k > 0 and at(f, k - 1) != at(f, k)
        case Past.ONCE:
            return any(at(f, j) for j in range(k + 1) if limit is None or k - j <= limit)
        case Past.HISTORICALLY:
            return all(at(f, j) for j in range(k + 1) if limit is None or k - j <= limit)
        case Past.HELD:
            return any(k - j >= limit and all_along(f, j, k) for j in range(k + 1))
        case Past.SINCE:
            sign = term.limit.relation if term.limit is not None else ">="
            fits = _COMPARED[sign]
            return any(
                at(others[0], j) and all_along(f, j + 1, k) and fits(k - j, 0 if limit is None else limit)
                for j in range(k + 1)
            )
        case Past.COUNTED:
            last = max((j for j in range(k + 1) if at(others[0], j)), default=-1)
            return sum(1 for j in range(last + 1, k + 1) if at(f, j))
    raise AssertionError(term.operator)


def broken(trigger: Term, response: History, run: Sequence[Step]) -> int | None:
    """The first step at which a run has broken `trigger -> response`, by what a response demands of the steps that
    follow its trigger; None where no step has."""
    wanted = response.arguments[0]
    limit = None if response.limit is None else response.limit.amount.value  # type: ignore[union-attr]
    found: list[int] = []
    for j in range(len(run)):
        if not value(trigger, run, j):
            continue
        match response.operator:
            case Past.NEXT:
                found += [k for k in (j + 1,) if k < len(run) and not value(wanted, run, k)]
            case Past.FOR:
                found += [k for k in range(j, j + limit + 1) if k < len(run) and not value(wanted, run, k)]
            case Past.WITHIN:
                due = j + limit
                if due < len(run) and not any(value(wanted, run, k) for k in range(j, due + 1)):
                    found.append(due)
            case Past.UNTIL:
                for k in range(j, len(run)):
                    if value(response.arguments[1], run, k):
                        break
                    if not value(wanted, run, k):
                        found.append(k)
                        break
            case _:
                raise AssertionError(response.operator)
    return min(found, default=None)
