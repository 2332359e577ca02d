"""What a subject prints: read while it runs, for what reads as a result, and not kept.

Nobody takes an answer from there. But who reads a log, or a program behind us that does, would take a forged line for
one; so a subject that prints one gets no answer at all.

Which lines read as a result is told by their form, since nobody knows who reads what is printed: a message of Avow's, a
verdict, a test runner's end. A line that only uses such a word ("command passed to motors", "camera: error"), or is
nothing but a word of every log ("error", "OK", "passed"), is an honest one: it says nothing of a claim, a node or a
method, and no answer is taken from it.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import select
import time
import unicodedata
from collections.abc import Iterator, Sequence

from avow.base.plain import SEEN_AS
from avow.base.records import dataclass
from avow.base.tuning.running import PRINTED_GATHERS
from avow.base.tuning.shown import PRINTED_SHOWN
from avow.base.tuning.sizes import PRINTED_AT_ONCE, PRINTED_KEPT, PRINTED_LINE
from avow.base.verdict import Isolation, Verdict


@dataclass(frozen=True, slots=True)
class Names:
    """What a verdict may be given to, in small letters: obligations, by their ids and by what they are called; nodes
    and methods."""

    claims: frozenset[str] = frozenset()
    others: frozenset[str] = frozenset()

    @classmethod
    def of(cls, names: Sequence[str]) -> Names:
        """Of obligations, which are ids (``system/node/guarantee/name``), and with them their nodes; of whatever else
        has an outcome, by its name."""
        parted = [name.lower().split("/") for name in names]
        ids = [parts for parts in parted if len(parts) > 1]
        claims = {*map("/".join, ids), *("/".join(parts[1:]) for parts in ids), *(parts[-1] for parts in ids)}
        claims |= {f"{parts[-3]}.{parts[-1]}" for parts in ids if len(parts) > 2}
        nodes = {parts[-3] for parts in ids if len(parts) > 2}
        others = {name for (name, *more) in parted if not more}
        return cls(frozenset(n for n in claims if not n.isdigit()), frozenset({*nodes, *others}))


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


# -- which lines read as a result --------------------------------------------------------------------------------------


def forged(text: bytes, names: Names) -> str:
    """The first of these lines that reads as a result, escaped and cut as it may be shown; empty: none does."""
    plain = text.translate(_ENDS, _NOTHING)
    if not plain.isascii():
        plain = _written(plain.decode("utf-8", "replace")).encode("latin-1")
    for shape in _shapes(plain):
        found = _forged(shape.decode("latin-1"), names)
        if found:
            return _shown(ascii(found.strip().replace(_FOREIGN, "?"))[1:-1])
    return ""


def _written(text: str) -> str:
    """The text in letters of ASCII, as a reader sees them. A letter of another alphabet stays one, which no word here
    has, so that "датчик: error" is not the word alone; a sign parts words; what is not seen is left out."""
    text = unicodedata.normalize("NFKD", text).translate(SEEN_AS)
    return text.translate({ord(each): _seen(each) for each in set(text) if not each.isascii()})


def _seen(character: str) -> str:
    if character.isalnum():
        return "" if character in _FILLERS else _FOREIGN
    if character in _LINES:
        return "\n"
    return "" if character == "\ufffd" or unicodedata.category(character)[0] in "CM" else " "


_FOREIGN = "\xaa"
"""What stands for each other letter: a letter and one byte, and never left of a text in its normal form."""
_FILLERS = "\u115f\u1160\u3164\uffa0"
"""Letters by their kind, which show nothing."""
_LINES = "\x85\u2028\u2029"


def _shown(line: str) -> str:
    half = PRINTED_SHOWN // 2
    return line if len(line) <= PRINTED_SHOWN else f"{line[:half]} ... {line[-half:]}"


_NOTHING = bytes({*range(32), 127} - {*b"\a\b\t\n\v\f\r\x1a\x1b\x1c\x1d\x1e"})
"""Bytes that show nothing: between the letters of a word, or of UTF-16, they hide it from who looks for it only."""
_ENDS = bytes.maketrans(b"\v\f\r\x1c\x1d\x1e", b"\n" * 6)


def _shapes(text: bytes) -> Iterator[bytes]:
    """The text as different readers have it: a terminal's sequences do nothing, or begin another line; what is
    overstruck is gone."""
    if not _MOVES.search(text):
        yield text
        return
    plain = _COLOUR.sub(b"", text)
    yield _overstruck(_SEQUENCE.sub(b"", _TITLE.sub(b"", plain)))
    yield _SEQUENCE.sub(b"\n", plain).translate(None, b"\b")


_MOVES = re.compile(rb"[\x07\x08\x1b]")
_COLOUR = re.compile(rb"\x1b\[[\d;:]*m")
_TITLE = re.compile(rb"\x1b[\]PX^_][^\x07\x1b\n]*(?:\x07|\x1b\\)?")
_SEQUENCE = re.compile(rb"\x1b(?:\[[0-?]*[ -/]*[@-~]|\][\d;]*|[ -/]*[0-~])|\x1b|\x07")


def _overstruck(text: bytes) -> bytes:
    left = bytearray()
    for byte in text:
        if byte != 8:
            left.append(byte)
        elif left and left[-1] != 10:
            left.pop()
    return bytes(left)


def _forged(text: str, names: Names) -> str:
    """The line; empty: there is none. Most lines have none of the words, and nobody looks at them any further."""
    low = text.lower()
    for word in _VERDICTS:
        for begin, end, at in _lines(low, word):
            after = at + len(word)
            if _whole(low, at, after) and _gives(low[begin:at], word, low[after:end], names):
                return text[begin:end]
    for word, reads in _READS:
        for begin, end, at in _lines(low, word, _WIDE // 2):
            if reads.search(low, max(begin, at - _WIDE), min(end, at + _WIDE)):
                return text[begin:end]
    return ""


def _lines(text: str, word: str, step: int = 1) -> Iterator[tuple[int, int, int]]:
    """Where the lines that hold a word begin and end, and where it stands in them: in each the first time, and again
    after so many characters."""
    at = text.find(word)
    while at >= 0:
        end = text.find("\n", at)
        end = end if end >= 0 else len(text)
        yield text.rfind("\n", 0, at) + 1, end, at
        at = text.find(word, max(at + 1, min(end, at + step)))


def _whole(text: str, begin: int, end: int) -> bool:
    return not (_letter(text[begin - 1 : begin]) or _letter(text[end : end + 1]))


def _letter(character: str) -> bool:
    return character.isalnum() or character == "_"


# -- verdicts ------------------------------------------------------------------------------------------------------

_VERDICTS = tuple(dict.fromkeys(word.replace("-", sign) for word in Verdict for sign in "-_ "))
_ORDINARY = frozenset({Verdict.ERROR, Verdict.UNKNOWN, Verdict.PARTIAL})
"""Words that any log has: alone, or of a node ("camera: unknown"), they are no verdict, of a claim they are."""
_COMMON = _ORDINARY | {Verdict.CHECKED, Verdict.MONITORED, Verdict.REVIEWED}
"""Words that are no verdict of a key that is not Avow's alone ("status: checked")."""
_KEYS = frozenset({"verdict", "verdicts"})
_KINDS = frozenset({"guarantee", "obligation", "claim", "property"})
_LOOSE_KEYS = frozenset({"status", "outcome", "conclusion", "result"})


def _gives(left: str, word: str, right: str, names: Names) -> bool:
    """Whether the word, between these in its line, is a verdict: alone, or given to what has one."""
    alone = _WORDLESS.fullmatch(right) is not None
    begins = _WORDLESS.fullmatch(left) is not None
    if begins:
        return (alone and word not in _ORDINARY) or (len(right) < _FAR and _given(right, word, names))
    if not alone and right[:1] not in _CLOSING and not _more(left, word, right):
        return "verdict" in left[-_NEAR:] and _label(left)[1] in _KEYS
    kind, name = _label(left)
    if _named(kind, name, word, names) or (name in names.others | _KINDS and word not in _ORDINARY):
        return True
    return name in _LOOSE_KEYS and word not in _COMMON


def _more(left: str, word: str, right: str) -> bool:
    """Whether the line goes on after a verdict that a sign gives: ``low: tested (200 cases)``."""
    return word not in _ORDINARY and left.rstrip().endswith(_GIVERS) and right.lstrip().startswith(_ADDING)


def _label(left: str) -> tuple[str, str]:
    """What a word is given to that stands after this: ``guarantee "low" is``, ``"low":``, ``low ..... ``; and the
    word before."""
    before = _LABEL.match(left[-_FAR:][::-1])
    return ((before[2] or "")[::-1], before[1][::-1]) if before is not None else ("", "")


def _given(right: str, word: str, names: Names) -> bool:
    """Whether the line that a verdict begins gives it to something: ``tested G1``."""
    after = _AFTER.fullmatch(right)
    return after is not None and _named(after[1], after[2], word, names, first=True)


def _named(kind: str, name: str, word: str, names: Names, *, first: bool = False) -> bool:
    if kind in _KINDS or _NUMBERED.fullmatch(name) is not None:
        return True
    if first and word in _ORDINARY:  # "unknown speed"
        return False
    return name in names.claims or (name in names.others if first else name in _KEYS)


_FAR, _NEAR, _WIDE = 300, 40, 1000
"""Characters beside a word in which its name is looked for; a key of one; the rest of a message. Beyond them nothing is
near, and a line that is made to be looked at for long is not."""
_CLOSING = ("'", '"', "]", ")", "}")
_GIVERS = (":", "=", ">", "..", "|")
_ADDING = ("(", "[", ",", ";", "|")
_NUMBERED = re.compile(r"g\d+")
_WORDLESS = re.compile(r"\W*")
_LABEL = re.compile(r"[\W_]*(?:(?:si|saw)\W+)?([\w./-]*\w)(?:[\s\"']+(\w+)\b)?")
"""Of the text backwards."""
_AFTER = re.compile(r"[\s:=\"'(\[]+(?:(\w+)[\s\"']+)?([\w./-]*\w)\W*")

# -- messages and test runners -------------------------------------------------------------------------------------

_COUNTED = r"\d+ (?:[a-z]+ )?"
_ENDED = r"""["']answer["']\s*:.*["']ended["']\s*:\s*(?:true|false)"""
_ENDED += r"""|["']ended["']\s*:\s*(?:true|false).*["']answer["']\s*:"""
_SEEN = r"""["']seen["']\s*:\s*\[.*["'](?:ready|end|faults)["']\s*:"""
_SEEN += r"""|["'](?:ready|end|faults)["']\s*:.*["']seen["']\s*:\s*\["""
_PASSED = rf"^\W*(?:{_COUNTED}[a-z]+[,;] )*{_COUNTED}passed\b(?:[,;.] ?\d+ [a-z ]+)*(?:,? in [\d.:]+ ?[a-z]*)?\W*"
_PASSED += r"(?:\([\d:. a-z]*\))?\W*$|^\W*passed\W*\d+ tests?\W*$"
_PASSED += r"|\.(?:py|cpp|cc|c)::\S+ passed\b|^\W*passed \S+::\S+"
_PASS = r"tests?(?: have| were)?(?: all)? (?:pass(?:ed)?|succeeded|ok|successful)\b\W*"
_TESTS = rf"^\W*(?:\d+% |all |\d+ )(?:\d+ )?{_PASS}(?:\d.*|\(.*)?$|^\W*{_PASS}\d.*$"
_CAMPAIGN = r"^\W*[0-9a-f]{32} (?:done|left) \d+\W*$"
_READS = tuple(
    (word, re.compile(pattern.replace("^", r"(?:^|(?<=\n))").replace("$", r"(?=\n|$)").replace(r"\W", r"[^\w\n]")))
    for word, pattern in (
        # the subject's answers, the judge's line, what a judge answers, a campaign's end
        ("replies", r"""["']replies["']\s*:\s*[\[(]\s*[{\])]"""),
        ("isolation", rf"""["']isolation["']\s*:\s*["'](?:{"|".join(Isolation)})["']"""),
        ("ended", _ENDED),
        ("seen", _SEEN),
        (" done ", _CAMPAIGN),
        (" left ", _CAMPAIGN),
        # pytest, unittest, JUnit, GoogleTest, CTest, cargo, Go, Hypothesis
        ("passed", _PASSED),
        ("test pass", _TESTS),
        ("tests ", _TESTS),
        ("ran ", r"^\W*ran \d+ tests? in [\d.]+ ?s"),
        ("ok (", r"^\W*ok \((?:\d+ tests?\b|(?:skipped|expected failures|unexpected successes)=\d)"),
        ("test result: ok", r"^test result: ok\b"),
        ("--- pass: ", r"^--- pass: "),
        ("ok  \t", r"^ok  \t\S+\t(?:[\d.]+s|\(cached\))"),
        ("falsifying example", r"^\W*falsifying example\b"),
        ("you can reproduce this ", r"^\W*you can reproduce this (?:example|failure) by"),
    )
)
"""A word, and how a line with it reads as a message or as the end of a test run: with a count, with a test's name, or
of all tests."""
