"""The meaning of a FRETish sentence, as clauses.

FRET's semantics (scopes, triggers and responses of `Sentence`'s fields) over the steps of a run: a scope is an interval
of steps, a requirement is triggered in it, and its demand ends with the interval. Compared in the tests with FRET's
published past-time formulas, template by template.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import assert_never

from .sentence import Condition, Duration, Expression, Scope, Sentence, Timing, denied


@dataclass(frozen=True, slots=True)
class Demand:
    """A clause in RCL, and the suffix of its name after its requirement's."""

    formula: str
    suffix: str = ""


Sayer = Callable[[Expression], str]
"""Writes an expression in RCL, in parentheses if needed."""


class Unsaid(Exception):  # noqa: N818 - it names what happened
    """A sentence that no clause can express; the text is the reason."""


def demands(sentence: Sentence, say: Sayer) -> list[Demand]:
    """The clauses. Raises Unsaid."""
    scope, outside = _scope(sentence, say)
    meant = _denied(sentence) if outside else sentence
    within = scope != _EVER
    ends = sentence.scope not in (Scope.ALWAYS, Scope.AFTER, Scope.ONLY_BEFORE)
    trigger = _trigger(meant, scope, say)
    response = say(meant.response)
    response = f"(not {response})" if outside else response
    gone = f" or not {scope}" if within else ""
    since = f"({scope} since {trigger})" if within else f"once({trigger})"
    pending = (
        f"previous(({f'{scope} and ' if within else ''}not {response}) since ({trigger} and not {response}), FALSE)"
    )
    match meant.timing:
        case Timing.IMMEDIATELY:
            return [Demand(f"{trigger} -> {response}")]
        case Timing.NEXT:
            return [Demand(f"{trigger} -> next({response}{gone})")]
        case Timing.WITHIN:
            return [Demand(f"{trigger} -> within[{_limit(meant.duration)}]({response}{gone})")]
        case Timing.FOR:
            return [Demand(_for(meant, scope, trigger, response))]
        case Timing.AFTER:
            longer = _limit(meant.duration, more=1)
            quiet = _for(meant, scope, trigger, f"not {response}")
            return [Demand(quiet, "_not_yet"), Demand(f"{trigger} -> within[{longer}]({response}{gone})", "_then")]
        case Timing.UNTIL:
            return [Demand(f"{trigger} -> {response} until ({say(_the(meant.stop))}{gone})")]
        case Timing.BEFORE:
            stop = say(_the(meant.stop)) + (f" and {scope}" if within else "")
            return [Demand(f"{stop} -> not {trigger} and not {pending}")]
        case Timing.ALWAYS | Timing.NEVER:
            held = f"not {response}" if meant.timing is Timing.NEVER else response
            if meant.condition is Condition.NONE:
                return [Demand(f"{scope} -> {held}" if within else held)]
            return [Demand(f"{since} -> {held}")]
        case Timing.EVENTUALLY:
            ever = Demand(f"{trigger} -> eventually({response}{gone})", "_ever" if ends else "")
            return [Demand(f"fell({scope}) -> not {pending}"), ever] if ends else [ever]
        case Timing.FINALLY:
            if not ends:
                raise Unsaid("`finally` speaks of the last step of the whole run, which no clause knows")
            return [Demand(f"fell({scope}) and previous({since}, FALSE) -> previous({response}, TRUE)")]
        case _:
            assert_never(meant.timing)


_EVER = "TRUE"


def _scope(sentence: Sentence, say: Sayer) -> tuple[str, bool]:
    """Where the requirement is in force, and whether its response must not occur there (`only`)."""
    if sentence.scope is Scope.ALWAYS:
        return _EVER, False
    mode = say(_the(sentence.mode))
    match sentence.scope:
        case Scope.IN:
            return mode, False
        case Scope.NOT_IN:
            return f"(not {mode})", False
        case Scope.BEFORE:
            return f"historically(not {mode})", False
        case Scope.AFTER:
            return f"once(fell({mode}))", False
        case Scope.ONLY_IN:
            return f"(not {mode})", True
        case Scope.ONLY_BEFORE:
            return f"once({mode})", True
        case Scope.ONLY_AFTER:
            return f"(not once(fell({mode})))", True
        case _:
            assert_never(sentence.scope)


_DENIALS = {
    Timing.WITHIN: Timing.FOR,
    Timing.FOR: Timing.WITHIN,
    Timing.EVENTUALLY: Timing.ALWAYS,
    Timing.ALWAYS: Timing.EVENTUALLY,
    Timing.UNTIL: Timing.BEFORE,
    Timing.BEFORE: Timing.UNTIL,
}
"""The timing demanded of the negated response, if a requirement's response must not occur with this timing."""


def _denied(sentence: Sentence) -> Sentence:
    if sentence.timing is Timing.AFTER:
        raise Unsaid("`only` with `after` a time is not read: say what has to hold outside")
    if sentence.timing is Timing.NEVER:
        return replace(sentence, timing=Timing.EVENTUALLY, response=denied(sentence.response))
    return replace(sentence, timing=_DENIALS.get(sentence.timing, sentence.timing))


def _trigger(sentence: Sentence, scope: str, say: Sayer) -> str:
    if sentence.condition is Condition.NONE:
        return f"rose({scope})"
    condition = say(_the(sentence.trigger))
    both = condition if scope == _EVER else f"({scope} and {condition})"
    return both if sentence.condition is Condition.HOLDING else f"rose({both})"


def _for(sentence: Sentence, scope: str, trigger: str, held: str) -> str:
    if scope == _EVER:
        return f"{trigger} -> for[{_limit(sentence.duration)}]({held})"
    return f"({scope} since[<= {_limit(sentence.duration)}] {trigger}) -> {held}"


def _limit(duration: Duration | None, more: int = 0) -> str:
    assert duration is not None
    if not more:
        return f"{duration.number} {duration.unit}"
    if duration.unit != "steps" or not duration.number.isdigit():
        raise Unsaid("`after` a time is not read: a clause cannot say the step that follows it; count ticks")
    return f"{int(duration.number) + more} {duration.unit}"


def remarks(sentence: Sentence) -> list[str]:
    """Where FRET's meaning often differs from the intended one: in words, with an alternative."""
    found = []
    if sentence.scope in (Scope.IN, Scope.NOT_IN) and sentence.timing is Timing.NEXT:
        found.append("where the scope ends at the next step, nothing is demanded there")
    if sentence.condition is Condition.REGULAR and sentence.timing in (Timing.ALWAYS, Timing.NEVER):
        found.append("from the first time that the condition becomes true it holds for ever; `whenever` looks at now")
    if sentence.scope in (Scope.AFTER, Scope.ONLY_AFTER):
        found.append("`after` is from the first end of the mode on, not after each")
    return found


def _the(expression: Expression | None) -> Expression:
    assert expression is not None
    return expression
