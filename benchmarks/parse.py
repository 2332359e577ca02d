"""How fast contracts are read, against an Earley parser over the grammar of the paper's table, in one run.

    python benchmarks/parse.py [--json]

Ours is the whole check (tokens, trees, names, types, lints); the Earley parser only parses. CPU seconds of the process:
the best of several runs for what is short. The exit code is 1 where a bound of the design is not kept.
"""

from __future__ import annotations

import argparse
import gc
import itertools
import json
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path

from lark import Lark

from avow.base.tuning.running import COLLECTED
from avow.language.load import check_text

ROOT = Path(__file__).parent.parent
CASE_STUDY = ROOT / "contracts" / "remote_inspection_published" / "system.rcl"
SENTENCE = re.compile(r'\b(assume|guarantee)\s+(?:\w+\s+)?"[^"]*"\s*\(')
NODE = "node n {{ inputs( r : REAL, b : BOOL ) outputs( c : BOOL ) topics() guarantee( {} ) }}"


def seconds(job: Callable[[], object], runs: int) -> float:
    """The CPU time of the fastest of several runs."""
    times = []
    for _ in range(runs):
        began = time.process_time()
        job()
        times.append(time.process_time() - began)
    return min(times)


RUNS = itertools.count()


def ours(text: str) -> None:
    """The whole check, of a text that was not there before: what was read once is kept."""
    contract, found = check_text(f"{text}\n// {next(RUNS)}", "benchmark.rcl")
    assert contract is not None, [f"{d.span}: {d.message}" for d in found if d.is_error]


def copies(text: str, count: int) -> str:
    """The case study with its nodes repeated under other names."""
    at = text.index("node ")
    return text[:at] + "".join(text[at:].replace("node ", f"node copy{i}_") for i in range(count))


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--json", action="store_true")
    options = arguments.parse_args()
    gc.set_threshold(COLLECTED)  # as commands do
    text = SENTENCE.sub(r"\1(", CASE_STUDY.read_text("utf-8"))  # the paper's table knows no names and sentences
    earley = Lark((Path(__file__).parent / "paper.lark").read_text("utf-8"), parser="earley")
    ours(text)  # the tables are made once

    rows: list[tuple[str, int, float, float | None]] = []

    def row(what: str, sample: str, runs: int, *, slow: bool) -> float:
        took = seconds(lambda: ours(sample), runs)
        rows.append((what, len(sample), took, seconds(lambda: earley.parse(sample), 1) if slow else None))
        return took

    case = row("case study", text, 9, slow=True)
    sizes = [row(f"case study × {n}", copies(text, n), 3, slow=n <= 4) for n in (4, 16, 64)]
    megabyte = row("1 MB", copies(text, 1_000_000 // (len(text) - text.index("node ")) + 1), 1, slow=False)
    chains = [
        row(f"`and` chain of {n}", NODE.format(" and ".join("b" for _ in range(n))), 3, slow=n <= 20)
        for n in (10, 20, 1000, 4000, 16000)
    ]
    nested = NODE.format("(" * 10_000 + "b" + ")" * 10_000)
    contract, found = check_text(nested, "benchmark.rcl")
    bounds = {
        "case study in 30 ms": case <= 0.030,
        "1 MB in 3 s": megabyte < 3,
        "linear in size": sizes[-1] / sizes[0] < 16 * 2,
        "linear in the length of a chain": chains[-1] / chains[-3] < 16 * 2,
        "10,000 parentheses are an error message": contract is None and len(found) == 1 and found[0].span is not None,
    }
    if options.json:
        names = ("what", "characters", "seconds", "earley_seconds")
        print(json.dumps({"rows": [dict(zip(names, r, strict=True)) for r in rows], "bounds": bounds}, indent=1))
    else:
        print(f"{'':22}{'characters':>11}{'avow':>12}{'Earley':>12}")
        for what, size, took, other in rows:
            shown = f"{other * 1000:9.1f} ms" if other is not None else "-"
            print(f"{what:22}{size:11,}{took * 1000:9.1f} ms{shown:>12}")
        for what, kept in bounds.items():
            print(f"{'kept' if kept else 'NOT KEPT'}: {what}")
    return 0 if all(bounds.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
