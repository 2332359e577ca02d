"""What a command that asks many questions says of them while it does: one line on a terminal's stderr."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field


@dataclass(slots=True)
class Progress:
    """Of questions by their names: the answers so far. Nothing is written where stderr is no terminal."""

    total: int
    answers: dict[str, str] = field(default_factory=dict)

    def tell(self, name: str, answer: str) -> None:
        self.answers[name] = answer
        self._line(f"… {len(self.answers)} of {self.total}: {name} {answer}")

    def _line(self, text: str) -> None:
        if sys.stderr.isatty():
            width = shutil.get_terminal_size().columns - 1
            printable = "".join(c if c.isprintable() else "?" for c in text)
            sys.stderr.write(f"\r{printable[:width].ljust(width)}\r")
            sys.stderr.flush()

    def end(self) -> None:
        self._line("")


@contextmanager
def progress(total: int) -> Iterator[Progress]:
    """Who is interrupted loses nothing: the answers so far are listed on stderr, and said not to be final."""
    telling = Progress(total)
    try:
        yield telling
    except KeyboardInterrupt:
        telling.end()
        for name, answer in telling.answers.items():
            print(f"{answer:9} {name}", file=sys.stderr)
        print(f"{len(telling.answers)} of {total}, as far as the search came: none is final", file=sys.stderr)
        raise
    telling.end()
