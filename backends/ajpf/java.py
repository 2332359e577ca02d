"""The plan's environment as a Java class for AIL. Pure: the same environment gives the same text.

The class follows AIL's contract for environments (percepts are given once until they change; `done` is called when the
agent sleeps), and draws through AJPF's choices, so that AJPF explores every draw.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment as Templates
from jinja2 import FileSystemLoader, StrictUndefined

from avow.base.files import read_text

from .builtin import number
from .environment import Choice, Environment
from .terms import CONS, NIL, Struct, Term, Var

CLASS = "AvowEnvironment"
MARK = "avow: "
"""The prefix of the output lines in which a scripted environment reports events."""


@dataclass(frozen=True, slots=True)
class Script:
    """One run's draws, and the names of the agents that take turns when the scheduler has a choice."""

    draws: Sequence[Choice]
    turns: Sequence[str] = ()
    probed: bool = False
    """The environment draws percepts before the agents ask, as AJPF does for properties that use them."""

    def text(self) -> str:
        draws = [f"draw {' '.join(map(str, choice))}" for choice in self.draws]
        probe = ["probe "] if self.probed else []
        return "\n".join([*probe, *draws, *(f"turn {name}" for name in self.turns)]) + "\n"


RUNS = "AvowRuns"
"""The class that runs scripts one after the other."""
_FOLDER = Path(__file__).with_name("java")


def runs_class() -> str:
    """The source of `RUNS`."""
    return read_text(_FOLDER / f"{RUNS}.java")


def environment_class(environment: Environment, *, agents: int = 1, scripted: bool = False) -> str:
    """The class's source. A `scripted` one makes exactly the choices of a `Script` beside it, and reports the events.
    Several agents have the scheduler of `DefaultEnvironment`; in a script, one that follows the script."""
    groups = environment.groups
    everything = {group: tuple(range(len(words))) for group, words in groups}
    templates = Templates(
        loader=FileSystemLoader(_FOLDER),
        undefined=StrictUndefined,
        variable_start_string="<<",
        variable_end_string=">>",
        trim_blocks=True,
        keep_trailing_newline=True,
    )
    return templates.get_template(f"{CLASS}.java.j2").render(
        agents=agents,
        scripted=scripted,
        at_quiescence=environment.at_quiescence,
        now="{" + ", ".join("-1" for _ in groups) + "}",
        begun=str(not environment.at_start).lower(),
        percepts=[
            (group, at, _term(percept))
            for group, (_, words) in enumerate(groups)
            for at, percept in enumerate(words)
            if percept is not None
        ],
        quiet=" || ".join(f"action.equals({_text(action)})" for action in sorted(environment.quiet | {"print"})),
        after=[
            (_text(action), _options(groups, {**everything, **narrowed}))
            for action, narrowed in sorted(environment.after.items())
        ],
        any=_options(groups, everything),
        start=_options(groups, {**everything, **environment.start}),
    )


def _options(groups: Sequence[tuple[str, object]], places: Mapping[str, tuple[int, ...]]) -> str:
    return "{" + ", ".join("{" + ", ".join(map(str, places[group])) + "}" for group, _ in groups) + "}"


def _term(term: Term) -> str:
    if isinstance(term, Var):
        raise ValueError(term)
    value = number(term)
    if value is not None:
        return f"number({value!r})"
    if term.functor in (CONS, NIL):
        return f"listed({', '.join(map(_term, _items(term)))})"
    if term.functor[:1] in ("'", '"'):
        return f"new StringTermImpl({_text(term.functor[1:-1])})"
    return f"make({', '.join((_text(term.functor), *map(_term, term.args)))})"


def _items(term: Term) -> Iterator[Term]:
    while isinstance(term, Struct) and term.functor == CONS:
        yield term.args[0]
        term = term.args[1]


def _text(text: str) -> str:
    """A Java string of ASCII characters."""
    units = text.encode("utf-16-be")
    codes = [int.from_bytes(units[at : at + 2], "big") for at in range(0, len(units), 2)]
    return '"' + "".join(map(_character, codes)) + '"'


def _character(code: int) -> str:
    if 32 <= code < 127 and chr(code) not in '"\\':
        return chr(code)
    return f"\\u{code:04x}" if code >= 127 else f"\\{code:03o}"
