"""Programs that answer otherwise than they look, and only on inputs that nobody draws: none of them is proved, as
what their text means is decided as Python decides it, without a run."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from helpers import some
from source_nodes import Example

from avow.backends.python.whole_file import binders

RCL = """node n { inputs( v : REAL, n : INTEGER, m : INTEGER ) outputs( u : REAL ) topics()
 guarantee one ( out.u == 1 ) }"""
PARAMETERS = {"a": 1.0, "strict": True, "p": {"x": 9.0}, "q": {"x": 1.0}}


def program(
    rare: str,
    *,
    head: str = "",
    body: str = "",
    init: str = "pass",
    receiver: str = "self",
    first: str = "pass",
    last: str = "pass",
    argument: str = "v",
) -> str:
    """A class whose step gives 1.0, and `rare` where n is 31337 + 3 m."""
    return f"""{head}
class N:
    {body}
    def __init__(self, params):
        {init}
    def step({receiver}, {argument}, n, m):
        {first}
        if n - 3 * m == 31337 and m > 1000:
            return {rare}
        return 1.0
        {last}
"""


OTHER = "def other(a, b):\n    return 9.0 if a == 1.0 and b == 0.0 else a if a > b else b\n"
TRICKS = {
    "a name that the class changes": program("__K", head="__K = 1.0\n_N__K = 9.0"),
    "a local called as the class": program("N.real", body="real = 1.0", first="N = v"),
    "an object called as a module": program(
        "1.0 if math.pi < 4.0 else 0.5 * v", head="import math", body="pi = 5.0", receiver="math"
    ),
    "an object called as a constant": program("K", head="K = 1.0", receiver="K"),
    "an object called as a function": program("f(v)", head="def f(x):\n    return 1.0", receiver="f"),
    "looked for among what divides by zero": program("1.0 if v in (v, 1.0 / (n - 3 * m - 31337)) else 1.0"),
    "a default that divides by zero": program("self.p.get('a', 1.0 / (n - 3 * m - 31337))", init="self.p = params"),
    "asked whether it is finite": program("0.0 if math.isnan(1.0 / (n - 3 * m - 31337)) else 1.0", head="import math"),
    "a mapping by a condition": program(
        "self.p['x']", init="if params['strict']: self.p = params['p']\n        else: self.p = params['q']"
    ),
    "a method without its object": program("self.f()", body="def f(): return 1.0"),
    "an int that is no float": program("1.0 if n * 1.0 < 1" + "0" * 310 + ".0 - v else 9.0"),
    "an int that no float is near": program("1.0 if n * 1.0 < 1" + "0" * 310 + " else 9.0"),
    "bound by a pattern below": program("K", head="K = 1.0", last="match v:\n            case K: pass"),
    "bound by a part of a pattern": program("K", head="K = 1.0", last="match v:\n            case [*K]: pass"),
    "bound by the rest of a pattern": program("K", head="K = 1.0", last="match v:\n            case {**K}: pass"),
    "bound by a handler below": program("K", head="K = 1.0", last="try: pass\n        except ValueError as K: pass"),
    "bound by an annotation below": program("K", head="K = 1.0", last="K: float"),
    "a default that binds": program(
        "max(1.0, 0.0)", head=f"def clip(a, b):\n    return a\n{OTHER}def h(x=(clip := other)):\n    return x"
    ).replace("max(", "clip("),
    "bound by a pattern of the main block": program(
        "clip(1.0, 0.0)",
        head=(
            f"def clip(a, b):\n    return a\n{OTHER}if __name__ == '__main__':\n    match other:\n"
            "        case clip: pass\n"
        ),
    ),
    "a main block that runs always": program(
        "clip(1.0, 0.0)",
        head="__name__ = '__main__'\ndef clip(a, b):\n    return a\nif __name__ == '__main__':\n    print(clip)\n",
    ),
    "what a module leads to": program(
        "max(1.0, 0.0)", head=f"import enum\n{OTHER}if __name__ == '__main__':\n    enum.bltns.max = other"
    ),
    "what a module leads to, given away": program(
        "max(1.0, 0.0)",
        head=(
            f"import enum\n{OTHER}class Poke:\n    def poke(self):\n        self.max = other\n"
            "if __name__ == '__main__':\n    Poke.poke(enum.bltns)"
        ),
    ),
    "what is taken from a module": program(
        "max(1.0, 0.0)",
        head=f"from typing import sys\n{OTHER}if __name__ == '__main__':\n    sys.modules['builtins'].max = other",
    ),
    "the names of a frame": program(
        "max(1.0, 0.0)",
        head=(
            f"{OTHER}def patch():\n    b = (x for x in ()).gi_frame.f_builtins\n    b |= {{'max': other}}\n"
            "class Mode(Enum):\n    def __init__(self, v):\n        patch()\n    A = 1"
        ).replace("def patch", "from enum import Enum\ndef patch"),
    ),
    "a call in a constant's annotation": program(
        "clip(1.0, 0.0)", head="def clip(a, b):\n    return a\ndef patch():\n    return 1\nX: patch() = 1.0"
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", TRICKS)
def test_what_a_name_means_is_what_python_takes_it_for(name: str, tmp_path: Path) -> None:
    found = Example(TRICKS[name], RCL, "N", PARAMETERS).settled(tmp_path)["one"]
    assert not found.verdict.supports, found.summary


@pytest.mark.parametrize(
    "decoy", some(["enum.py", "enum.pyc", "enum.cpython-311-x86_64-linux-gnu.so", "enum"], 1, slow=3)
)
def test_what_stands_beside_a_file_may_be_what_it_imports(decoy: str, tmp_path: Path) -> None:
    place = tmp_path / decoy
    place.write_bytes(b"") if "." in decoy else place.mkdir()
    source = program("1.0", head="from enum import Enum\nclass Mode(Enum):\n    A = 1")
    found = Example(source, RCL, "N", PARAMETERS).settled(tmp_path)["one"]
    assert not found.verdict.supports
    assert "beside this one" in found.summary


def test_plain_programs_with_the_same_parts_are_proved(tmp_path: Path) -> None:
    """What is refused above is refused for what it does: the same statements, without it, are understood."""
    source = program(
        "self.p['x'] if v in (v, -1.0, self.a) and not math.isnan(v) else self.p.get('none', 1.0)",
        head=(
            "import math\nfrom enum import Enum\nK: float = 1.0\n__version__ = '1'\n"
            "class Mode(Enum):\n    A = 1\nclass Kept:\n    def __init__(self):\n        self.x = 1\n"
            "if __name__ == '__main__':\n    node = N({})\n    print(node, math.floor(K))"
        ),
        init="self.p = params['q']\n        self.a = params.get('a', K)",
    )
    found = Example(source, RCL, "N", PARAMETERS).settled(tmp_path)["one"]
    assert found.verdict.supports, found.summary


def test_every_way_of_binding_is_seen() -> None:
    """Whatever names of its own a text has, they are those that the compiler stores to."""
    text = """
import a.b, c as d
from e import f as g, h
def i(j, /, k, *l, m=1, **n): pass
class o: pass
p = (q := 1)
for r in s: pass
with t as u: pass
try: pass
except v as w: pass
match x:
    case [y, *z] | {1: aa, **bb} as cc: pass
[dd for dd in ee]
ff: int = 1
del gg
async def hh(): pass
"""
    bound = {*"adghijklmnopqruwyz", "aa", "bb", "cc", "dd", "ff", "gg", "hh"}
    assert {name for name, _ in binders(ast.parse(text))} == bound
