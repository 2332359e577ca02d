"""Five nodes, each right and with four mutants, and twenty programs that look like the first and behave otherwise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from avow.backend_kit.protocol import Job, Limits
from avow.backends.python import BACKEND
from avow.base.verdict import Outcome
from avow.pipeline.methods import method_job
from avow.system.load import load_system

LIMITER = """
class Limiter:
    def __init__(self, params):
        self.vmax = params["vmax"]
    def step(self, v: float) -> float:
        if v > self.vmax:
            return self.vmax
        if v < -self.vmax:
            return -self.vmax
        return v
"""
LIMITER_RCL = """context { Vmax = 1.5; }
node limiter { inputs( v : REAL ) outputs( u : REAL ) topics()
 guarantee bounded ( -Vmax <= out.u and out.u <= Vmax )
 guarantee same ( -Vmax <= in.v and in.v <= Vmax -> out.u == in.v )
 guarantee upper ( in.v > Vmax -> out.u == Vmax ) guarantee lower ( in.v < -Vmax -> out.u == -Vmax ) }"""
DEBOUNCER = """
class Debouncer:
    def __init__(self, params):
        self.need = params["need"]
        self.count = 0
    def step(self, raw: bool) -> bool:
        if raw:
            self.count = min(self.count + 1, self.need)
        else:
            self.count = 0
        return self.count >= self.need
"""
DEBOUNCER_RCL = """context { Need = 3; }
node debouncer { inputs( raw : BOOL, count : NATURAL ) outputs( on : BOOL, count : NATURAL ) topics()
 assume range ( in.count <= Need )
 guarantee inv ( out.count <= Need )
 guarantee reset ( not raw -> out.count == 0 and not on )
 guarantee rise ( raw and in.count < Need -> out.count == in.count + 1 )
 guarantee stay ( raw and in.count == Need -> out.count == Need )
 guarantee says ( on <=> out.count == Need ) }"""
MEDIAN = """
class Median:
    def __init__(self, params):
        pass
    def step(self, a: float, b: float, c: float) -> float:
        return max(min(a, b), min(max(a, b), c))
"""
MEDIAN_RCL = """node median { inputs( a : REAL, b : REAL, c : REAL ) outputs( m : REAL ) topics()
 guarantee one ( m == a or m == b or m == c )
 guarantee two_below ( (a <= m and b <= m) or (a <= m and c <= m) or (b <= m and c <= m) )
 guarantee two_above ( (a >= m and b >= m) or (a >= m and c >= m) or (b >= m and c >= m) ) }"""
WATCHDOG = """
class Watchdog:
    def __init__(self, params):
        self.timeout = params["timeout"]
        self.last = 0.0
    def step(self, now: float, beat: bool) -> bool:
        if beat:
            self.last = now
        return now - self.last > self.timeout
"""
WATCHDOG_RCL = """context { Timeout = 0.3; }
node watchdog { inputs( now : REAL, beat : BOOL, last : REAL ) outputs( stop : BOOL, last : REAL ) topics()
 assume forward ( 0 <= in.last and in.last <= now and now <= 4000000000 )
 guarantee fresh ( beat -> not stop and out.last == now )
 guarantee keep ( not beat -> out.last == in.last )
 guarantee late ( not beat and now - in.last > Timeout -> stop )
 guarantee calm ( now - in.last <= Timeout -> not stop ) }"""
SCAN = """
class Scan:
    def __init__(self, params):
        self.range_max = params["range_max"]
    def step(self, scan: list[float]) -> float:
        best = self.range_max
        for x in scan:
            if x < best:
                best = x
        return best
"""
SCAN_RCL = """context { Far = 30; }
node scanmin { inputs( scan : <REAL> ) outputs( m : REAL ) topics()
 guarantee below ( forall(i in NATURAL | i < length(in.scan) -> out.m <= in.scan(i)) )
 guarantee top ( out.m <= Far )
 guarantee real_one ( out.m == Far or exists(i in NATURAL | i < length(in.scan) and out.m == in.scan(i)) ) }"""


@dataclass(frozen=True)
class Example:
    """A class, its contract, and what the plan says of it."""

    source: str
    rcl: str
    class_name: str
    params: Mapping[str, Any] = field(default_factory=dict)
    memory: Mapping[str, str] = field(default_factory=dict)
    numbers: str = "float64"
    options: Mapping[str, Any] = field(default_factory=dict)
    mutants: tuple[tuple[str, str], ...] = ()
    false: frozenset[str] = frozenset()
    """Guarantees that the right class does not meet: what it computes with is not exact."""

    @property
    def node(self) -> str:
        return self.rcl.split("node ")[1].split()[0]

    def job(self, folder: Path) -> Job:
        """The example as a system in a folder, read back."""
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "node.py").write_text(self.source)
        (folder / "system.rcl").write_text(self.rcl)
        (folder / "params.yaml").write_text(yaml.safe_dump(dict(self.params)))
        declared = {"python": "node.py", "class": self.class_name, "parameters": "params.yaml"}
        node: dict[str, Any] = {
            "source": declared,
            "numbers": self.numbers,
            "methods": [{"python": dict(self.options)}],
        }
        if self.memory:
            node["memory"] = {port: f"self.{name}" for port, name in self.memory.items()}
        (folder / "plan.yaml").write_text(yaml.safe_dump({"nodes": {self.node: node}}))
        system = load_system(folder)
        (method,) = system.plan.node(self.node).methods
        return method_job(system, system.contract.node(self.node), method)

    def settled(self, folder: Path) -> dict[str, Outcome]:
        job = self.job(folder)
        report = BACKEND.discharge(job, folder, Limits())
        names = {o.id: o.name for o in job.obligations}
        return {names[o.obligation]: o for o in report.outcomes}


NODES = {
    "limiter": Example(
        LIMITER,
        LIMITER_RCL,
        "Limiter",
        {"vmax": 1.5},
        mutants=(
            ("v < -self.vmax", "v < 0"),
            ("return -self.vmax", "return self.vmax"),
            ("v > self.vmax", "v > self.vmax + 0.1"),
            ("        if v < -self.vmax:\n            return -self.vmax\n", ""),
        ),
    ),
    "debouncer": Example(
        DEBOUNCER,
        DEBOUNCER_RCL,
        "Debouncer",
        {"need": 3},
        {"count": "count"},
        mutants=(
            (">= self.need", "> self.need"),
            (
                "self.count = 0\n        return",
                "self.count = self.count - 1 if self.count > 0 else 0\n        return",
            ),
            ("self.count + 1, self.need", "self.count + 2, self.need"),
            ("min(self.count + 1, self.need)", "self.count + 1"),
        ),
    ),
    "median": Example(
        MEDIAN,
        MEDIAN_RCL,
        "Median",
        mutants=(
            ("min(max(a, b), c)", "max(max(a, b), c)"),
            ("max(min(a, b), min(max(a, b), c))", "(a + b + c) / 3"),
            ("min(a, b),", "min(a, c),"),
            ("min(max(a, b), c)", "min(b, c)"),
        ),
    ),
    "watchdog": Example(
        WATCHDOG,
        WATCHDOG_RCL,
        "Watchdog",
        {"timeout": 0.3},
        {"last": "last"},
        mutants=(
            ("> self.timeout", ">= self.timeout"),
            ("now - self.last", "self.last - now"),
            ("self.last = now", "self.last = self.last"),
            ("if beat:", "if not beat:"),
        ),
        false=frozenset({"late"}),
    ),
    "scanmin": Example(
        SCAN,
        SCAN_RCL,
        "Scan",
        {"range_max": 30.0},
        mutants=(
            ("x < best", "x > best"),
            ("for x in scan:", "for x in scan[1:]:"),
            ("best = self.range_max\n", "best = 0.0\n"),
            ("best = x", "best = x + 0.001"),
        ),
    ),
}


def mutants() -> Iterator[tuple[str, Example]]:
    for name, example in NODES.items():
        for k, (old, new) in enumerate(example.mutants, start=1):
            assert old in example.source, (name, old)
            changed = example.source.replace(old, new, 1)
            yield f"{name}-{k}", Example(changed, example.rcl, example.class_name, example.params, example.memory)


def _with_step(body: str, argument: str = "v") -> str:
    head = "class Limiter:\n    def __init__(self, params):\n        self.vmax = params['vmax']\n"
    return f"{head}    def step(self, {argument}):\n{body}"


SEQUENCE_RCL = """node limiter { inputs( s : <REAL> ) outputs( u : REAL ) topics()
 guarantee among ( length(in.s) > 0 -> exists(i in NATURAL | i < length(in.s) and out.u == in.s(i)) )
 guarantee trivial ( out.u == out.u ) }"""
TRIVIAL_RCL = LIMITER_RCL.rstrip("} ") + "\n guarantee trivial ( out.u == out.u ) }"
MEDIAN_TRIVIAL = MEDIAN_RCL.rstrip("} ") + "\n guarantee trivial ( out.m == out.m ) }"

_DECORATOR = "def bad(anything):\n    return lambda *a: 9.0\n"
_BASE = "class Base:\n    def __setattr__(self, name, value):\n        object.__setattr__(self, name, 9.0)\n"
TRICKS: dict[str, Example] = {
    name: Example(
        source,
        MEDIAN_TRIVIAL if cls == "Median" else SEQUENCE_RCL if "(self, s" in source else TRIVIAL_RCL,
        cls,
        {"vmax": 1.5},
    )
    for name, (source, cls) in {
        "min rebound": ("min = max\n" + MEDIAN, "Median"),
        "min rebound by def": ("def min(a, b):\n    return a\n" + MEDIAN, "Median"),
        "min rebound by import": ("from math import fmod as min\n" + MEDIAN, "Median"),
        "step decorated": (_DECORATOR + LIMITER.replace("    def step", "    @bad\n    def step"), "Limiter"),
        "base class with __setattr__": (_BASE + LIMITER.replace("class Limiter:", "class Limiter(Base):"), "Limiter"),
        "class decorated": (_DECORATOR + "@bad" + LIMITER, "Limiter"),
        "step rebound after the class": (LIMITER + "\nLimiter.step = lambda self, v: v\n", "Limiter"),
        "step rebound in a class body": (LIMITER + "\nclass X:\n    Limiter.step = lambda self, v: v\n", "Limiter"),
        "a second class of the name": (
            LIMITER + "\nclass Limiter:\n    def __init__(self, p): pass\n    def step(self, v): return v\n",
            "Limiter",
        ),
        "a second def step": (LIMITER + "\n    def step(self, v): return v\n", "Limiter"),
        "__getattribute__": (LIMITER + "\n    def __getattribute__(self, n): return 9.0\n", "Limiter"),
        "__class__ assigned": (LIMITER + "\nclass O:\n    pass\ndef f(n): n.__class__ = O\n", "Limiter"),
        "written by setattr": (LIMITER + "\n    def poke(self): setattr(self, 'vmax', 9)\n", "Limiter"),
        "written by another method": (LIMITER + "\n    def poke(self): self.vmax = 9\n", "Limiter"),
        "property of the same name": (LIMITER + "\n    @property\n    def vmax(self): return 9.0\n", "Limiter"),
        "written from outside": (LIMITER + "\ndef tune(n): n.vmax = 9\n", "Limiter"),
        "written by the main block": (
            LIMITER + "\nif __name__ == '__main__':\n    Limiter.step = None\n",
            "Limiter",
        ),
        "a loop at the top": (LIMITER + "\nfor c in [Limiter]:\n    c.step = lambda self, v: v\n", "Limiter"),
        "metaclass": (LIMITER.replace("class Limiter:", "class Limiter(metaclass=type):"), "Limiter"),
        "whole quotient": (_with_step("        return v // 2\n"), "Limiter"),
        "remainder": (_with_step("        return v % 2\n"), "Limiter"),
        "and returns an operand": (_with_step("        return v and 3.0\n"), "Limiter"),
        "a number as a condition": (_with_step("        return 1.0 if v else 0.0\n"), "Limiter"),
        "arithmetic with truth values": (_with_step("        return v + (v > 1)\n"), "Limiter"),
        "generator": (_with_step("        yield v\n"), "Limiter"),
        "negative index": (_with_step("        return s[-1]\n", "s"), "Limiter"),
        "negative part": (
            _with_step("        for x in s[-1:]:\n            return x\n        return 0.0\n", "s"),
            "Limiter",
        ),
        "loop variable after a loop": (
            _with_step("        for x in s:\n            pass\n        return x\n", "s"),
            "Limiter",
        ),
        "sequence changed while looping": (
            _with_step(
                "        b = 0.0\n        for x in s:\n            s = [1.0]\n            b = x\n        return b\n",
                "s",
            ),
            "Limiter",
        ),
        "sequence sorted": (_with_step("        s.sort()\n        return s[0]\n", "s"), "Limiter"),
        "local without a value on one path": (
            _with_step("        if v > 1:\n            y = 2.0\n        return y\n"),
            "Limiter",
        ),
        "falls off the end": (_with_step("        if v > 1:\n            return 1.0\n"), "Limiter"),
        "walrus": (_with_step("        return (y := v)\n"), "Limiter"),
        "hidden state": (_with_step("        self.vmax = self.vmax + 1.0\n        return self.vmax\n"), "Limiter"),
        "parameter changed": (
            (
                "class Limiter:\n    def __init__(self, params):\n        self.p = params\n    def step(self, v):\n"
                "        self.p['vmax'] = 9.0\n        return self.p['vmax']\n"
            ),
            "Limiter",
        ),
        "default argument": (_with_step("        return w\n", "v, w=[]"), "Limiter"),
        "recursion": (_with_step("        return self.step(v)\n"), "Limiter"),
        "exec": (LIMITER + "\n    def poke(self): exec('Limiter.step = None')\n", "Limiter"),
        "import that patches": ("import builtins\n" + LIMITER, "Limiter"),
        "star import": ("from math import *\n" + LIMITER, "Limiter"),
        "a function rebound when imported": (
            "def clip(x):\n    return 1.0\nif __name__ != '__main__':\n    def clip(x):\n        return x\n"
            + _with_step("        return clip(v)\n"),
            "Limiter",
        ),
        "a constant rebound when run": (
            "LIMIT = 1.0\nif __name__ == '__main__':\n    LIMIT = 9.0\n" + _with_step("        return LIMIT\n"),
            "Limiter",
        ),
        "a main block that is none": (
            "LIMIT = 1.0\nif __name__ == '__main__':\n    pass\nelse:\n    LIMIT = 9.0\n"
            + _with_step("        return LIMIT\n"),
            "Limiter",
        ),
        "hidden by its encoding": ("# -*- coding: utf-7 -*-\n" + LIMITER + "\n# +AAo-Limiter.step = None\n", "Limiter"),
        "a call in an annotation": (
            "def patch(c):\n    return c\n" + LIMITER + "\ndef f(x: patch(Limiter)): pass\n",
            "Limiter",
        ),
        "math that is not imported": (
            _with_step("        if v == 12345.678 and v < 0.0:\n            return math.pi\n        return v\n"),
            "Limiter",
        ),
        "overflow": (_with_step("        return v * 1e308 * 0.0\n"), "Limiter"),
    }.items()
}
