"""More programs that answer otherwise than they look, by parts of Python that the subset has not: none is proved."""

from __future__ import annotations

from pathlib import Path

import pytest
from helpers import some
from source_nodes import Example
from test_names import PARAMETERS, RCL, program

STATE = "self.x = 1.0"
TRICKS = {
    "__getattr__ of the module": program("K", head="def __getattr__(name):\n    return 9.0"),
    "a descriptor": program(
        "self.x", head="class Nine:\n    def __get__(self, a, b):\n        return 9.0", body="x = Nine()"
    ),
    "__init_subclass__": program(
        "1.0", head="class Base:\n    def __init_subclass__(cls, **k):\n        cls.step = lambda self, v, n, m: 9.0"
    ).replace("class N:", "class N(Base):"),
    "__class_getitem__": program("N[1]", body="def __class_getitem__(cls, k): return 9.0"),
    "__set_name__": program(
        "1.0", head="class S:\n    def __set_name__(self, o, n):\n        o.step = 9", body="s = S()"
    ),
    "__slots__": program("self.x", body="__slots__ = ('x',)", init=STATE),
    "a walrus": program("1.0 if (v := 9.0) < 0.0 else v"),
    "a default that is kept": program(
        "self.f()", body="def f(self, kept=[1.0]):\n        kept[0] += 8.0\n        return kept[0]"
    ),
    "a constant bound through an import": program("K", head="K = 1.0\nimport __main__\n__main__.K = 9.0"),
    "del": program("x", first="x = 1.0\n        del x"),
    "nonlocal": program(
        "g()", first="x = 1.0\n        def g():\n            nonlocal x\n            x = 9.0\n            return x"
    ),
    "finally returns": program(
        "1.0", first="try:\n            pass\n        finally:\n            return 9.0 if m == 31337 else 1.0"
    ),
    "a comparison that changes": program(
        "1.0 if 0.0 < self.f() < 3.0 else 9.0",
        init="self.x = 0.0",
        body="def f(self):\n        self.x = self.x + 2.0\n        return self.x",
    ),
    "a value read before a call that changes it": program(
        "self.x + self.f()",
        init="self.x = 1.0",
        body="def f(self):\n        self.x = 5.0\n        return 0.0 if self.x > 6.0 else 4.0",
    ),
    "NaN written down": program("1.0 if float('nan') < v or float('nan') >= v else 9.0"),
    "infinity written down": program("1.0 if v < 1e999 else 9.0 - 1e999 + 1e999"),
    "is, of ints": program("1.0 if n is 31337 + 3 * m else 9.0"),
    "sorted by a key": program("sorted((1.0, 9.0), key=lambda x: -x)[0]"),
    "a generator that is used up": program("g and sum(g) + 1.0 - sum(g)", first="g = (x for x in (8.0,))"),
    "an f-string": program("1.0 if f'{n}' == '31337' else 9.0"),
    "a match": program("1.0", first="match n:\n            case 31337:\n                return 9.0"),
    "__debug__": program("1.0 if __debug__ else 9.0"),
    "an assertion": program("1.0", first="assert n != 31337 or m != 0"),
    "a bool as an index": program("(1.0, 9.0)[v < 1.0]"),
    "a bool as a number": program("1.0 * (v < 1.0) + 9.0 * (v >= 1.0)"),
    "or of numbers": program("0.0 or 9.0"),
    "a text repeated": program("1.0 if 'a' * n == 'a' else 9.0"),
    "a power of ints": program("1.0 if n ** 2 >= 0 else 9.0", first="x = 2 ** -n"),
    "rounding to even": program("round(0.5) + 9.0"),
    "an int that truncates": program("1.0 * int(-0.5) + 9.0"),
    "a shift": program("1.0 if (n << 70) > 0 else 9.0"),
    "a bitwise not": program("1.0 if ~n < 0 else 9.0"),
    "a complex number": program("(1j * 1j).real + 10.0"),
    "a class within a function": program("K.x", first="class K:\n            x = 9.0"),
    "a star": program("max(*(1.0, 9.0))"),
    "a keyword": program("max(1.0, 9.0, key=lambda x: -x)"),
    "min of one sequence": program("min((9.0,))"),
    "else of a loop": program(
        "x", first="x = 1.0\n        for i in range(3):\n            pass\n        else:\n            x = 9.0"
    ),
    "a while": program("x", first="x = 1.0\n        while x < 9.0:\n            x = x + 1.0"),
    "one without end": program("1.0", first="while n == 31337 + 3 * m:\n            pass"),
    "a local called as an import": program("1.0", head="import math", first="math = 3.0\n        x = math.pi"),
    "two targets": program("x", first="x = y = 1.0\n        y = 9.0\n        x, y = y, x"),
    "an attribute of a class changed": program("N.x", body="x = 1.0", init="N.x = 9.0"),
    "a name only typed": program("x", first="x: float"),
    "a text that is code": program("1.0", head="exec('N = 1')"),
    "raise": program("1.0", last="raise ValueError", first="if n == 31337 + 3 * m: raise ValueError"),
    "with": program("1.0", first="with open('x') as f: pass"),
    "async": program("1.0").replace("    def step", "    async def step"),
    "division of an int by nothing": program("1.0 if n / (n - 3 * m - 31337) > 0.0 else 1.0"),
    "a remainder of nothing": program("1.0 if n % (n - 3 * m - 31337) == 0 else 1.0"),
    "a remainder that C would have": program("1.0 if (0 - n) % 7 <= 0 else 9.0"),
    "a quotient that C would have": program("1.0 if (0 - n) // 7 == 0 - n // 7 else 9.0"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", some(sorted(TRICKS), 6))
def test_no_trick_is_proved(name: str, tmp_path: Path) -> None:
    found = Example(TRICKS[name], RCL, "N", PARAMETERS).settled(tmp_path)["one"]
    assert not found.verdict.supports, found.summary
