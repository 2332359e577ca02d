"""codac's intervals, which are right only while the processor rounds as codac sets it when it is imported. All other
code needs rounding to nearest: with codac's, even a decimal in a text becomes another number."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager

import codac
from codac import Interval

__all__ = ["Interval", "codac", "outward"]

_C = ctypes.CDLL(None)
_NEAREST = 0  # FE_TONEAREST of C's <fenv.h>, on x86 and ARM
_OUTWARD = _C.fegetround()
_C.fesetround(_NEAREST)


@contextmanager
def outward() -> Iterator[None]:
    """The processor rounds as codac needs it. Also a decorator."""
    before = _C.fegetround()
    _C.fesetround(_OUTWARD)
    try:
        yield
    finally:
        _C.fesetround(before)


with outward():
    _third = Interval(1) / 3
if not _third.lb() < _third.ub():  # codac was imported before, and its rounding was taken back
    raise ImportError("codac's intervals do not round outward in this process")
