"""Behaviour of a source that no run shows: places that sanitizers do not check, and inputs that cannot be recorded.

Both are read from the source as the compiler sees it: its preprocessed text, and the functions that its object files
name. A finding of this module never refutes; it only prevents a good answer.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Iterator
from itertools import zip_longest
from pathlib import Path

from avow.base.records import dataclass

_CLOCK = "the clock"
_CHANCE = "chance"
_MACHINE = "the machine or its processes"
_HIDDEN = "functions that are named as it runs"
_CAUGHT = "catches signals, by which faults are told"

UNDECLARED = {
    **dict.fromkeys(("clock_gettime", "time", "gettimeofday", "clock", "times", "timespec_get", "ftime"), _CLOCK),
    **dict.fromkeys((f"_ZNSt6chrono3_V21{n}_clock3nowEv" for n in ("2system", "2steady")), _CLOCK),
    **dict.fromkeys(("getrandom", "getentropy", "arc4random", "arc4random_buf", "arc4random_uniform"), _CHANCE),
    "_ZNSt13random_device9_M_getvalEv": _CHANCE,
    **dict.fromkeys((f"_ZNSt3__16chrono12{n}_clock3nowEv" for n in ("system", "steady")), _CLOCK),  # of libc++
    "_ZNSt3__113random_deviceclEv": _CHANCE,
    "_ZNSt3__16thread20hardware_concurrencyEv": _MACHINE,
    **dict.fromkeys(("gethostname", "uname", "getpid", "getppid", "gettid", "getloadavg", "getrusage"), _MACHINE),
    "_ZNSt6thread20hardware_concurrencyEv": _MACHINE,
    **dict.fromkeys(("getenv", "secure_getenv", "environ"), "the environment"),
    **dict.fromkeys(("syscall", "dlopen", "dlsym"), _HIDDEN),
}
"""A function → the unrecorded input that it gives."""

CATCHING = ("signal", "sigaction", "sysv_signal", "__sysv_signal", "bsd_signal", "sigset", "sigvec")
"""Functions after which a fault no longer ends the program."""

_ASSEMBLER = re.compile(r'\b(?:asm|__asm|__asm__)\b(?:\s*(?:volatile|__volatile__|goto|inline))*\s*\(\s*(?!""\s*[:)])')
_COUNTER = re.compile(r"\b(__rdtscp?|_rdrand\w*|_rdseed\w*|__builtin_ia32_rd\w+|__builtin_readcyclecounter)\b")
_SWITCHED = re.compile(
    r"\b(\w*no_sanitize\w*|no_address_safety_analysis|disable_sanitizer_instrumentation"
    r"|__(?:asan|ubsan|lsan|sanitizer|sancov)_\w+|LLVMFuzzer\w+)\b"
)
_SYMBOLS = 2
"""The kind of an ELF section that has symbols."""
_TEXT = re.compile(r'"(?:\\.|[^"\\])*"')
_MARKER = re.compile(r'# (\d+) "((?:\\.|[^"\\])*)"([ \d]*)$')


@dataclass(frozen=True, slots=True)
class Unseen:
    """Why no obligation can have a good answer; why the absence of faults cannot. Empty: it can."""

    undeclared: str = ""
    faults: str = ""


@dataclass(frozen=True, slots=True)
class Line:
    """A line of the user's own files, preprocessed."""

    file: str
    number: int
    text: str

    @property
    def place(self) -> str:
        return f"{self.file}:{self.number}"


def own(preprocessed: str, generated: Path, adapter: Path) -> Iterator[Line]:
    """The lines that are in no system's file and in no generated one."""
    file, number, ours = "", 0, False
    for text in preprocessed.splitlines():
        marker = _MARKER.match(text)
        if marker:
            file, number = re.sub(r"\\(.)", r"\1", marker[2]), int(marker[1])
            path = Path(file)
            mine = path.is_absolute() and path.is_relative_to(generated) and path.resolve() != adapter
            ours = "3" not in marker[3].split() and not mine and not file.startswith("<")
            continue
        if ours and text.strip():
            yield Line(file, number, text)
        number += 1


def undefined(data: bytes) -> Iterator[str]:
    """The undefined names of an object file (64-bit ELF, little-endian). Raises ValueError for another format."""
    if data[:6] != b"\x7fELF\x02\x01":
        raise ValueError("an object file is no ELF of 64 bits")
    start, size, count = (struct.unpack_from(form, data, at)[0] for form, at in (("<Q", 40), ("<H", 58), ("<H", 60)))
    # kind, offset, size and link of each section; the first one's size is their number if the header has no room
    sections = [struct.unpack_from("<4xI16xQQI", data, start)]
    sections += (struct.unpack_from("<4xI16xQQI", data, start + k * size) for k in range(1, count or sections[0][2]))
    for kind, offset, length, link in sections:
        for at in range(offset, offset + length, 24) if kind == _SYMBOLS else ():
            name, section = struct.unpack_from("<I2xH", data, at)
            if name and section == 0:
                begin = sections[link][1] + name
                yield data[begin : data.index(b"\0", begin)].decode("utf-8", "replace")


def unseen(plain: list[Line], fuzzed: list[Line], asked: Iterable[str]) -> Unseen:
    """The findings for a source as the plain and the sanitizers' build see it, and for its objects' undefined names."""
    undeclared = faults = ""
    for line in plain:
        bare = _TEXT.sub('"x"', line.text)
        if _ASSEMBLER.search(_TEXT.sub(lambda m: '""' if m[0] == '""' else '"x"', line.text)):
            undeclared = undeclared or f"{line.place}: what assembler reads and does is seen by nothing"
        if found := _COUNTER.search(bare):
            undeclared = undeclared or f"{line.place}: undeclared input: {found[1]}"
    for line in (*plain, *fuzzed):
        if found := _SWITCHED.search(_TEXT.sub('"x"', line.text)):
            faults = faults or f"{line.place}: `{found[1]}` changes what sanitizers see"
    for one, other in zip_longest(plain, fuzzed):
        if one is None or other is None or one.text != other.text:
            at = one or other
            faults = faults or f"{at.place}: built with sanitizers the source is another program than without"
            break
    for name in dict.fromkeys(asked):
        if name in UNDECLARED:
            undeclared = undeclared or f"undeclared input: it uses {UNDECLARED[name]} (`{_short(name)}`)"
        elif name in CATCHING:
            faults = faults or f"it {_CAUGHT} (`{name}`)"
    return Unseen(undeclared, faults)


def _short(name: str) -> str:
    """The readable part of a mangled name."""
    found = re.findall(r"\d([a-z_]{3,})", name)
    return "::".join(found[-2:]) if name.startswith("_Z") and found else name
