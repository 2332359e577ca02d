"""A compiled program of the user's in a process of its own, asked as any subject is.

The program reads a line ``TURN|COMMAND|COMMAND…`` and answers with one line of JSON that has the same turn: what its
own code writes into the channel is no answer. Nothing of it is seen from within: what it reads is told by strace, and
where there is none, by nobody.
"""

from __future__ import annotations

import secrets
import signal
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from avow.isolation.subject import Message, SubjectProcess

CRASHES = frozenset((signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGABRT, signal.SIGTRAP))
"""How a program ends whose own code went wrong."""


class Program(SubjectProcess):
    """Each case is ``{"command": text}``; the text holds neither ``|`` nor the end of a line."""

    def __init__(self, path: Path, patience: float, root: Path, names: Sequence[str] = ()) -> None:
        super().__init__(path, "", patience, root, names)
        self._turn = ""
        self._events["program", f"the program {path.name}"] = None

    def crashed(self) -> str:
        """The signal that its own code ended with; empty where it ended otherwise."""
        code = self.code or 0
        number = -code if code < 0 else code - 128
        return signal.Signals(number).name if number in CRASHES else ""

    def _command(self, there: int, back: int, mark: str) -> tuple[list[str], tuple[Path, ...]]:
        command = [str(self.path), str(there), str(back), mark or "/avow-unmarked", self.isolation.value]
        return command, (self.path.parent,)

    def _written(self, cases: Sequence[Mapping[str, Any]]) -> bytes:
        self._turn = secrets.token_hex(8)
        return "|".join((self._turn, *(str(case["command"]) for case in cases))).encode() + b"\n"

    def _in_turn(self, message: Message) -> bool:
        return message.turn == self._turn
