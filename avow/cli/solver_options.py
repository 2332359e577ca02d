"""The options of every command that asks the solver: how long for one question, and its seed."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import click

if TYPE_CHECKING:
    from collections.abc import Callable

Command = TypeVar("Command", bound="Callable[..., object]")

MAX_SECONDS = 86_400.0


class _Seconds(click.ParamType[float]):
    """A time above 0 and of at most a day; `nan` and `inf` are numbers to Python, not times."""

    name = "seconds"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            seconds = float(str(value))
        except ValueError:
            self.fail(f"{str(value)[:60]!r} is no number", param, ctx)
        if not 0 < seconds <= MAX_SECONDS:
            self.fail(f"{seconds}: a time above 0 is wanted, of at most a day", param, ctx)
        return seconds


def seconds_option(default: float) -> Callable[[Command], Command]:
    """``--seconds``: the time for one question to the solver."""
    return click.option(
        "--seconds",
        type=_Seconds(),
        metavar="SECONDS",
        default=default,
        show_default=True,
        help="Time for one question to the solver.",
    )


def seed_option() -> Callable[[Command], Command]:
    """``--seed``: where the solver's random choices start."""
    return click.option(
        "--seed", default=0, show_default=True, type=click.IntRange(0, 2**31 - 1), help="The solver's seed."
    )


def milliseconds(seconds: float) -> int:
    """As the solver wants it, never 0 (which it takes for no limit at all)."""
    return max(1, int(seconds * 1000))
