"""Nodes of other kinds: a controller, a mean over steps, what is in front in a scan."""

from __future__ import annotations

from pathlib import Path

import pytest
from source_nodes import Example

from avow.base.verdict import Verdict

NODES = {
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
}


@pytest.mark.slow
@pytest.mark.parametrize("name", NODES)
def test_what_is_shown_of_a_node(name: str, tmp_path: Path) -> None:
    for clause, found in NODES[name].settled(tmp_path).items():
        assert found.verdict is Verdict.PROVED, (clause, found.summary)
