"""What a subject prints: read while it runs, for what reads as a result, and not kept.

Nobody takes an answer from there. But who reads a log, or a program behind us that does, would take a forged line for
one; so a subject that prints one gets no answer at all.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import select
import time
from collections.abc import Sequence

from avow.base.tuning.running import PRINTED_GATHERS
from avow.base.tuning.sizes import PRINTED_AT_ONCE, PRINTED_KEPT, PRINTED_LINE
from avow.isolation.forged import Names, forged

_LINE_ENDS = (b"\n", b"\r")
_CUT = b"\x1a"
"""Before the rest of a line whose beginning was read before."""


class Printed:
    """The standard streams of one process and of all that it starts; each is read by itself.

    Start the process with `theirs` as its streams, and call `begun` then. Call `wait` wherever it is waited for: what
    it prints is read meanwhile, so that it never has to wait for us.
    """

    def __init__(self, names: Names, *, keeps: bool = False) -> None:
        self.result = ""
        """The first line that reads as a result, as it may be shown. Empty: there is none."""
        pairs = [os.pipe(), os.pipe()]
        self.theirs = tuple(theirs for _, theirs in pairs)
        """Where its standard output and its standard error go."""
        self._names = names
        self._rests = {ours: b"" for ours, _ in pairs}
        """Of each stream that is open, the line that has no end yet."""
        self._errors = pairs[1][0] if keeps else -1
        self._log = b""
        for ours, _ in pairs:
            os.set_blocking(ours, False)
            with contextlib.suppress(OSError):  # a user may have no more than so much in pipes
                fcntl.fcntl(ours, fcntl.F_SETPIPE_SZ, PRINTED_AT_ONCE)

    def begun(self) -> None:
        """The process is there, and has its streams."""
        for theirs in self.theirs:
            os.close(theirs)

    def wait(self, reading: Sequence[int], writing: Sequence[int], seconds: float) -> bool:
        """Until one of these descriptors is ready, or the time is over; whether one is."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            can_read, can_write, _ = select.select([*reading, *self._rests], writing, [], left)
            if can_write or any(one in reading for one in can_read):
                return True
            if can_read:  # who prints much does so line by line: each need not wake us
                self.read()
                ready = select.select(reading, writing, [], min(left, PRINTED_GATHERS))
                if ready[0] or ready[1]:
                    return True
        return False

    def read(self) -> None:
        """What has been printed up to now."""
        for ours in tuple(self._rests):
            room = PRINTED_AT_ONCE  # no pipe holds more, and who prints without end is not to keep us
            while room > 0 and ours in self._rests:
                try:
                    part = os.read(ours, min(room, 1 << 18))
                except BlockingIOError:
                    break
                room -= len(part)
                self._came(ours, part)

    def end(self) -> None:
        """The rest, once nobody is left who could print."""
        self.read()
        for ours in tuple(self._rests):
            self._came(ours, b"")

    def told(self) -> str:
        """What is wrong with the `result`, and what to do."""
        return (
            f"prints what reads as a result (`{self.result}`): what it returns is judged, and nothing that it prints; "
            "leave that line out, or word it otherwise"
        )

    def log(self) -> str:
        """The end of its standard error, if that is kept."""
        return self._log.decode("utf-8", "replace")

    def _came(self, ours: int, part: bytes) -> None:
        if ours == self._errors:
            self._log = (self._log + part)[-PRINTED_KEPT:]
        text = self._rests[ours] + part
        if part:
            whole = max(map(text.rfind, _LINE_ENDS)) + 1
            self._rests[ours] = text[whole:]
            if len(text) - whole > PRINTED_LINE:
                whole, self._rests[ours] = len(text), _CUT + text[-PRINTED_LINE // 16 :]
                text = _once(text)
            text = text[:whole]
        else:
            del self._rests[ours]
            os.close(ours)
            text = _once(text)
        if text and not self.result:
            self.result = forged(text, self._names)


def _once(text: bytes) -> bytes:
    """Of a line without an end what it has again and again: each step may have printed it."""
    return text[: (text + text).find(text, 1)]
