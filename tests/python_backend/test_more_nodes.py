"""Nodes of other kinds: filters, a thermostat, limiters, counters, a controller, what is in front in a scan."""

from __future__ import annotations

from pathlib import Path

import pytest
from helpers import some
from source_nodes import Example

from avow.base.verdict import Verdict

NODES = {
    "lowpass": Example(
        """class LowPass:
    def __init__(self, params):
        self.alpha = params["alpha"]
        self.y = 0.0

    def step(self, u):
        self.y = self.y + self.alpha * (u - self.y)
        return self.y
""",
        """node lowpass { inputs( u : REAL, y : REAL ) outputs( v : REAL, y : REAL ) topics()
 assume bounded ( -100 <= in.u and in.u <= 100 )
 assume state ( -100 <= in.y and in.y <= 100 )
 guarantee range ( -100 <= out.v and out.v <= 100 )
 guarantee same ( out.v == out.y ) }""",
        "LowPass",
        {"alpha": 0.1},
        {"y": "y"},
    ),
    "thermostat": Example(
        """class Thermostat:
    LOW = 18.0
    HIGH = 22.0
    def __init__(self, params):
        self.mode = "off"
    def step(self, t):
        if t < self.LOW:
            self.mode = "heat"
        elif t > self.HIGH:
            self.mode = "off"
        return {"heater": self.mode == "heat"}
""",
        """context { Mode : { off, heat }; }
node thermostat { inputs( t : REAL, mode : Mode ) outputs( heater : BOOL, mode : Mode ) topics()
 guarantee cold ( in.t < 18 -> out.heater ) guarantee hot ( in.t > 22 -> not out.heater )
 guarantee keeps ( 18 <= in.t and in.t <= 22 -> out.mode == in.mode )
 guarantee says ( out.heater <=> out.mode == heat ) }""",
        "Thermostat",
        {},
        {"mode": "mode"},
    ),
    "ratelimit": Example(
        """def clamp(x, lo, hi):
    return max(lo, min(x, hi))

class RateLimiter:
    def __init__(self, params):
        self.params = params
        self.last = 0.0
    def step(self, target):
        d = self.params["max_step"]
        self.last = clamp(target, self.last - d, self.last + d)
        return self.last
""",
        """node ratelimit { inputs( target : REAL, last : REAL ) outputs( u : REAL, last : REAL ) topics()
 assume r ( -10 <= in.last and in.last <= 10 )
 assume t ( -10 <= in.target and in.target <= 10 )
 guarantee near ( out.u - in.last <= 0.25 and in.last - out.u <= 0.25 )
 guarantee range ( -10 <= out.u and out.u <= 10 )
 guarantee there ( in.last - 0.25 <= in.target and in.target <= in.last + 0.25 -> out.u == in.target ) }""",
        "RateLimiter",
        {"max_step": 0.25},
        {"last": "last"},
    ),
    "pid": Example(
        """class PController:
    def __init__(self, params):
        self.kp = params["kp"]
        self.limit = params["limit"]
    def _saturate(self, u):
        if u > self.limit:
            return self.limit
        if u < -self.limit:
            return -self.limit
        return u
    def step(self, ref, y):
        e = ref - y
        return self._saturate(self.kp * e)
""",
        """node pid { inputs( ref : REAL, y : REAL ) outputs( u : REAL ) topics()
 assume a ( -1000 <= in.ref and in.ref <= 1000 and -1000 <= in.y and in.y <= 1000 )
 guarantee sat ( -5 <= out.u and out.u <= 5 )
 guarantee sign ( in.ref >= in.y -> out.u >= 0 )
 guarantee zero ( in.ref == in.y -> out.u == 0 )
 guarantee big ( in.ref - in.y >= 3 -> out.u == 5 ) }""",
        "PController",
        {"kp": 2.0, "limit": 5.0},
    ),
    "battery": Example(
        """class Battery:
    def __init__(self, params):
        self.low = params["low"]
        self.samples = 0
    def step(self, volts, charging):
        low = volts < self.low and not charging
        if low:
            self.samples += 1
        else:
            self.samples = 0
        alarm = self.samples >= 3
        return {"alarm": alarm, "level": "low" if low else "ok"}
""",
        """context { Level : { ok, low }; }
node battery { inputs( volts : REAL, charging : BOOL, samples : NATURAL )
 outputs( alarm : BOOL, level : Level, samples : NATURAL ) topics()
 guarantee charging ( in.charging -> not out.alarm and out.level == ok )
 guarantee counts ( in.volts < 11.1 and not in.charging -> out.samples == in.samples + 1 )
 guarantee alarms ( out.alarm <=> out.samples >= 3 )
 guarantee lv ( in.volts < 11.1 and not in.charging <=> out.level == low ) }""",
        "Battery",
        {"low": 11.1},
        {"samples": "samples"},
    ),
    "front": Example(
        """class Front:
    def __init__(self, params):
        self.stop = params["stop"]
        self.width = params["width"]
    def step(self, scan):
        for i in range(len(scan)):
            if i < self.width and scan[i] < self.stop:
                return True
        return False
""",
        """node front { inputs( scan : <REAL> ) outputs( near : BOOL ) topics()
 guarantee stops ( exists(i in NATURAL | i < length(in.scan) and i < 5 and in.scan(i) < 0.5) -> out.near )
 guarantee only ( out.near -> exists(i in NATURAL | i < length(in.scan) and in.scan(i) < 0.5) ) }""",
        "Front",
        {"stop": 0.5, "width": 5},
    ),
    "count": Example(
        """class Count:
    def __init__(self, params):
        self.t = params["t"]
    def step(self, s):
        n = 0
        worst = 0.0
        for i, x in enumerate(s):
            if x > self.t:
                n += 1
            if x > worst:
                worst = x
        return dict(n=n, worst=worst)
""",
        """node count { inputs( s : <REAL> ) outputs( n : NATURAL, worst : REAL ) topics()
 guarantee few ( out.n <= length(in.s) )
 guarantee top ( forall(i in NATURAL | i < length(in.s) -> in.s(i) <= out.worst) )
 guarantee pos ( out.worst >= 0 )
 guarantee any ( out.n > 0 -> exists(i in NATURAL | i < length(in.s) and in.s(i) > 2) )
 guarantee none ( forall(i in NATURAL | i < length(in.s) -> in.s(i) <= 2) -> out.n == 0 ) }""",
        "Count",
        {"t": 2.0},
    ),
    "mean": Example(
        """class Mean:
    def __init__(self):
        self.a = 0.0
        self.b = 0.0
    def step(self, x):
        m = (self.a + self.b + x) / 3.0
        self.a = self.b
        self.b = x
        return m
""",
        """node mean { inputs( x : REAL, a : REAL, b : REAL ) outputs( m : REAL, a : REAL, b : REAL ) topics()
 assume r ( 0 <= in.x and in.x <= 10 ) assume m ( 0 <= in.a and in.a <= 10 and 0 <= in.b and in.b <= 10 )
 guarantee low ( out.m >= 0 )
 guarantee high ( out.m <= 10.001 )
 guarantee exact_high ( out.m <= 10 )
 guarantee shift ( out.a == in.b and out.b == in.x ) }""",
        "Mean",
        {},
        {"a": "a", "b": "b"},
    ),
    "fence": Example(
        """import math
class Fence:
    def __init__(self, params):
        self.r2 = params["radius"] * params["radius"]
    def step(self, x, y):
        if math.isnan(x) or math.isnan(y):
            return False
        return x * x + y * y <= self.r2
""",
        """node fence { inputs( x : REAL, y : REAL ) outputs( inside : BOOL ) topics()
 assume a ( -1000 <= in.x and in.x <= 1000 and -1000 <= in.y and in.y <= 1000 )
 guarantee centre ( -1 <= in.x and in.x <= 1 and -1 <= in.y and in.y <= 1 -> out.inside )
 guarantee far ( in.x > 11 -> not out.inside )
 guarantee exact_in ( out.inside -> in.x*in.x + in.y*in.y <= 100 ) }""",
        "Fence",
        {"radius": 10.0},
    ),
}
REFUTED = {("ratelimit", "near"), ("battery", "counts"), ("battery", "lv"), ("fence", "exact_in")}
"""What rounding, or a constant that is no double, makes false."""


@pytest.mark.slow
@pytest.mark.parametrize("name", some(["mean", "front", *sorted(NODES.keys() - {"mean", "front"})], 2))
def test_what_is_shown_of_a_node(name: str, tmp_path: Path) -> None:
    for clause, found in NODES[name].settled(tmp_path).items():
        at = (name, clause)
        wanted = Verdict.REFUTED if at in REFUTED else Verdict.PROVED
        assert found.verdict is wanted, (clause, found.summary)
