"""What a program in machine code can ask without a call of the system, by the names that it takes from libraries.

The kernel hands the clock out without being asked, and so no trace tells who read it.
"""

from __future__ import annotations

import struct
from pathlib import Path

from avow.base.files import read_regular

_NAMES = {
    "the clock": "clock_gettime gettimeofday time ftime timespec_get clock getrusage "
    "_ZNSt6chrono3_V212system_clock3nowEv _ZNSt6chrono3_V212steady_clock3nowEv",
    "random numbers": "getrandom getentropy arc4random arc4random_buf arc4random_uniform "
    "_ZNSt13random_device9_M_getvalEv",
}
_ASKED = {name: what for what, names in _NAMES.items() for name in names.split()}
_OF_THE_SYSTEM = (
    "libc.so",
    "libc-",
    "ld-linux",
    "ld-musl",
    "libm.so",
    "libpthread.so",
    "libdl.so",
    "librt.so",
    "libstdc++.so",
)
"""Libraries that have such functions for others, and use none for themselves."""

_SECTIONS = 0x28
"""Where a file of 64 bits says where its table of sections is."""


def asks(path: str) -> tuple[str, ...]:
    """What the program or library can ask for so; what it is, where it does not say which names it takes (a static
    program). Nothing for what is no machine code of 64 bits, or is not there."""
    file = Path(path)
    if file.name.startswith(_OF_THE_SYSTEM):
        return ()
    try:
        data = read_regular(file)
    except OSError:
        return ()
    if data[:6] != b"\x7fELF\x02\x01":
        return ("what only it knows",) if data[:4] == b"\x7fELF" else ()
    try:
        names = _taken(data)
    except (struct.error, IndexError):
        names = None
    return ("what only it knows",) if names is None else tuple(sorted({_ASKED[n] for n in names if n in _ASKED}))


def _taken(data: bytes) -> set[str] | None:
    """The names that it takes from others; None where it has no list of them. Raises struct.error, IndexError."""
    (table,) = struct.unpack_from("<Q", data, _SECTIONS)
    size, count = struct.unpack_from("<HH", data, 0x3A)
    sections = [struct.unpack_from("<IIQQQQII", data, table + k * size) for k in range(count)]
    for _, kind, _, _, at, length, link, _ in sections:
        if kind != 11:  # SHT_DYNSYM
            continue
        strings = sections[link][4]
        found = set()
        for place in range(at, at + length, 24):
            name, _, _, section = struct.unpack_from("<IBBH", data, place)
            if section == 0 and name:
                found.add(data[strings + name : data.index(b"\0", strings + name)].decode("ascii", "replace"))
        return found
    return None
