"""Five nodes in C++, each right and with four mutants, with adapters; and what runs them through the backend."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import yaml
from python_backend.source_nodes import DEBOUNCER_RCL, LIMITER_RCL, MEDIAN_RCL, SCAN_RCL, WATCHDOG_RCL

from avow.backend_kit.protocol import Job, Limits, Report
from avow.backends.fuzz import BACKEND
from avow.base.verdict import Outcome, Verdict
from avow.pipeline.methods import method_job
from avow.system.load import load_system

NODES = """\
#pragma once
#include <algorithm>
#include <vector>
struct Limiter {
  double vmax = 1.5;
  double step(double v) {
    if (v > vmax + (M == 3 ? 0.1 : 0)) return vmax;
    if (v < (M == 1 ? 0 : -vmax)) {
      if (M != 4) return M == 2 ? vmax : -vmax;
    }
    return v;
  }
};
struct Debouncer {
  int need = 3;
  int count = 0;
  bool step(bool raw) {
    if (raw) {
      count += (M == 3 ? 2 : 1);
      if (M != 4 && count > need) count = need;
    } else {
      count = (M == 2 && count > 0) ? count - 1 : 0;
    }
    return M == 1 ? count > need : count >= need;
  }
};
struct Median {
  double step(double a, double b, double c) {
    if (M == 2) return (a + b + c) / 3;
    if (M == 1) return std::max(std::min(a, b), std::max(std::max(a, b), c));
    if (M == 3) return std::max(std::min(a, c), std::min(std::max(a, b), c));
    if (M == 4) return std::max(std::min(a, b), std::min(b, c));
    return std::max(std::min(a, b), std::min(std::max(a, b), c));
  }
};
struct Watchdog {
  double timeout = 0.5, last = 0;
  bool step(double now, bool beat) {
    if (M == 4 ? !beat : beat) last = M == 3 ? last : now;
    if (M == 2) return last - now > timeout;
    return M == 1 ? now - last >= timeout : now - last > timeout;
  }
};
struct Scan {
  double range_max = 30;
  double step(const std::vector<double>& s) {
    double best = M == 3 ? 0 : range_max;
    for (size_t i = (M == 2 ? 1 : 0); i < s.size(); ++i)
      if (M == 1 ? s[i] > best : s[i] < best) best = s[i] + (M == 4 ? 0.001 : 0);
    return best;
  }
};
"""

_ADAPTER = """\
#define M 0
#include "avow_node.hpp"
#include "nodes.hpp"
struct AvowNode {{
  {name} node;
  {made}
  void step(const avow::Inputs& in, avow::Outputs& out) {{ {step} }}
  void memory(avow::Outputs& out) const {{ {memory} }}
}};
"""


@dataclass(frozen=True, slots=True)
class Cpp:
    """A node's adapter, as text; its contract; what the plan says of it."""

    node: str
    rcl: str
    adapter: str
    params: Mapping[str, Any] = field(default_factory=dict)
    memory: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    numbers: str = "float64"
    files: Mapping[str, str] = field(default_factory=dict)

    def mutant(self, number: int) -> Cpp:
        assert "#define M 0" in self.adapter
        return replace(self, adapter=self.adapter.replace("#define M 0", f"#define M {number}"))

    def written(self, folder: Path) -> Job:
        for name, text in {"adapter.hpp": self.adapter, "nodes.hpp": NODES, **self.files}.items():
            (folder / "src" / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / "src" / name).write_text(text, encoding="utf-8")
        source = {"cpp": "src/adapter.hpp"}
        if self.params:
            (folder / "params.yaml").write_text(yaml.safe_dump(dict(self.params)), encoding="utf-8")
            source["parameters"] = "params.yaml"
        entry: dict[str, Any] = {"source": source, "numbers": self.numbers}
        entry |= {"memory": dict(self.memory)} if self.memory else {}
        entry["methods"] = [{"fuzz": {"runs": 500, **self.options}}]
        (folder / "system.rcl").write_text(self.rcl, encoding="utf-8")
        plan = {"contract": "system.rcl", "nodes": {self.node: entry}}
        (folder / "plan.yaml").write_text(yaml.safe_dump(plan, sort_keys=False), encoding="utf-8")
        system = load_system(folder)
        (method,) = system.plan.node(self.node).methods
        return method_job(system, system.contract.node(self.node), method)

    def report(self, folder: Path, seconds: float = 300.0) -> Report:
        return BACKEND.discharge(self.written(folder), folder / "made", Limits(seconds=seconds))

    def outcomes(self, folder: Path) -> dict[str, Outcome]:
        return {o.obligation.rpartition("/")[2]: o for o in self.report(folder).outcomes}

    def verdicts(self, folder: Path) -> dict[str, Verdict]:
        return {name: o.verdict for name, o in self.outcomes(folder).items()}


def adapter(name: str, made: str, step: str, memory: str = "(void)out;") -> str:
    constructor = f"explicit AvowNode(const avow::Parameters& given) {{ {made} }}" if made else ""
    return _ADAPTER.format(name=name, made=constructor, step=step, memory=memory)


LIMITER = Cpp(
    "limiter",
    LIMITER_RCL,
    adapter("Limiter", 'node.vmax = given.real("vmax");', 'out.real("u", node.step(in.real("v")));'),
    {"vmax": 1.5},
)
DEBOUNCER = Cpp(
    "debouncer",
    DEBOUNCER_RCL,
    adapter(
        "Debouncer",
        'node.need = int(given.integer("need"));',
        'out.truth("on", node.step(in.truth("raw")));',
        'out.integer("count", node.count);',
    ),
    {"need": 3},
    {"count": "self.count"},
)
MEDIAN = Cpp(
    "median",
    MEDIAN_RCL,
    adapter("Median", "", 'out.real("m", node.step(in.real("a"), in.real("b"), in.real("c")));'),
)
WATCHDOG = Cpp(
    "watchdog",
    WATCHDOG_RCL,
    adapter(
        "Watchdog",
        'node.timeout = given.real("timeout");',
        'out.truth("stop", node.step(in.real("now"), in.truth("beat")));',
        'out.real("last", node.last);',
    ),
    {"timeout": 0.3},
    {"last": "self.last"},
)
SCAN = Cpp(
    "scanmin",
    SCAN_RCL,
    adapter("Scan", 'node.range_max = given.real("range_max");', 'out.real("m", node.step(in.reals("scan")));'),
    {"range_max": 30.0},
)
FIVE = (LIMITER, DEBOUNCER, MEDIAN, WATCHDOG, SCAN)
