"""Damaged plans, and what must hold of each: a system, or located diagnostics. A long run:

cd tests; python -m system.plan_fuzzing --plans 10000 --seed 7 --keep /tmp/found
"""

from __future__ import annotations

import argparse
import functools
import random
import re
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from avow.base.codec import to_json
from avow.base.diagnostics import Rejected
from avow.base.rendering import render, to_sarif, told
from avow.language import load as language_load
from avow.system.load import load_system
from avow.system.plan import System

SECONDS = 20.0


class Slow(Exception):  # noqa: N818 - it reads as what the text was
    """A text that took longer than it may."""


@contextmanager
def at_most(seconds: float) -> Iterator[None]:
    """Raises `Slow` after so much CPU time of this process."""

    def stop(signal_number: int, frame: object) -> None:
        raise Slow

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


_TOKEN = re.compile(r"[A-Za-z_][\w.'-]*|\d+(?:\.\d+)?|\s+|.", re.DOTALL)
_WORDS = (
    *(
        "~",
        "null",
        "true",
        "no",
        "0",
        "-1",
        "1e999",
        "9" * 400,
        "1.5",
        '""',
        "''",
        "[]",
        "{}",
        "[[]]",
        "{a: b}",
        "x",
        "é∀",
    ),
    *("&a 1", "*a", "!!python/object:os.system x", "<<: {a: 1}", "? ", "- ", ": ", "|", ">", "---", "...", "#", "%TAG"),
    *(
        "\t",
        "\n",
        "\r\n",
        "\x00",
        "\x1b[31m",
        "\ufeff",
        "\u202e",
        "\u2028",
        "../..",
        "/etc/passwd",
        "in.r",
        "out.x",
        "agent",
    ),
    *(
        "[" * 300,
        "{a: " * 200,
        "(" * 4000,
        "not " * 4000,
        "a" * 70_000,
        "medium",
        "forall(x in REAL | x > 0)",
        "'",
        '"',
    ),
)


def folders(root: Path, into: Path) -> list[Path]:
    """The shipped systems, copied, so that their plans can be damaged."""
    made = []
    for plan in sorted(root.glob("contracts/*/plan.yaml")):
        folder = into / plan.parent.name
        shutil.copytree(plan.parent, folder, ignore=shutil.ignore_patterns("traces", "*.bag"))
        made.append(folder)
    return made


def damaged(text: str, source: random.Random, others: Sequence[str]) -> str:
    for _ in range(source.choice((1, 1, 1, 2, 3, 8))):
        lines = text.split("\n")
        at = source.randrange(len(lines))
        match source.randrange(14):
            case 0 | 1 | 2:
                parts = _TOKEN.findall(text)
                words = [i for i, p in enumerate(parts) if not p.isspace()]
                if words:
                    place = source.choice(words)
                    parts[place] = source.choice((parts[source.choice(words)], source.choice(_WORDS)))
                text = "".join(parts)
            case 3:
                text = "\n".join([*lines[:at], lines[at], *lines[at:]])
            case 4 | 5:
                text = "\n".join(lines[:at] + lines[at + 1 :])
            case 6:
                shift = source.choice((-2, -1, 1, 2, 4))
                line = " " * shift + lines[at] if shift > 0 else lines[at][-shift:]
                text = "\n".join([*lines[:at], line, *lines[at + 1 :]])
            case 7:
                other = source.choice(others).split("\n")
                text = "\n".join([*lines[:at], *other[source.randrange(len(other)) :][:5], *lines[at:]])
            case 8:
                place = source.randrange(len(text) + 1)
                text = text[:place] + source.choice(_WORDS) + text[place:]
            case 9:
                text = text[: source.randrange(len(text) + 1)]
            case 10:
                key, colon, _ = lines[at].partition(":")
                text = "\n".join([*lines[:at], key + colon + " " + source.choice(_WORDS), *lines[at + 1 :]])
            case 11:
                names = sorted(set(re.findall(r"[A-Za-z_]\w+", text)))
                if names:
                    old, new = source.choice(names), source.choice(names)
                    text = re.sub(rf"\b{old}\b", new, text)
            case 12:
                other_at = source.randrange(len(lines))
                lines[at], lines[other_at] = lines[other_at], lines[at]
                text = "\n".join(lines)
            case _:
                text = source.choice(
                    (text.replace("\n", "\r\n"), "\ufeff" + text, text.replace("  ", "\t"), text.upper())
                )
    return text


def plans(systems: Sequence[Path], seed: int, count: int) -> Iterator[tuple[Path, str]]:
    """Folders and damaged texts for their plan.yaml, the same for the same seed."""
    source = random.Random(seed)
    texts = {folder: (folder / "plan.yaml").read_text("utf-8") for folder in systems}
    for _ in range(count):
        folder = source.choice(systems)
        yield folder, damaged(texts[folder], source, list(texts.values()))


def examine(folder: Path, text: str) -> System | None:
    """Raises AssertionError, `Slow`, or what should not be raised."""
    path = folder / "plan.yaml"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    with at_most(SECONDS):
        try:
            return load_system(folder)
        except Rejected as rejected:
            found = rejected.diagnostics
    assert any(d.is_error for d in found)
    shown = render(found, {str(path): text})
    assert not any(c in shown for c in "\x00\x1b\u202e")
    to_json(told(found)), to_sarif(found)
    lines = re.split(r"\r\n|[\n\r\x85\u2028\u2029]", text)
    for diagnostic in found:
        span = diagnostic.span
        assert diagnostic.message
        if span is not None and span.file == str(path):
            assert 1 <= span.line <= len(lines) + 1, diagnostic
            assert span.column >= 1
            assert (span.line, span.column) <= (span.end_line, span.end_column), diagnostic
    return None


@functools.cache
def _contract(paths: tuple[Path, ...]):  # type: ignore[no-untyped-def]
    return _load(paths)


def remembered(paths: Sequence[Path], shelf: object = None):  # type: ignore[no-untyped-def]
    """In the place of `load_contract`: the contracts stay as they are, and reading them takes most of the time."""
    return _contract(tuple(paths))


_load = language_load.load_contract


def main() -> int:
    """Runs many plans; each kind of failure is written down once."""
    reader = argparse.ArgumentParser()
    reader.add_argument("--plans", type=int, default=1000)
    reader.add_argument("--seed", type=int, default=1)
    reader.add_argument("--keep", type=Path, default=Path("fuzz-found"))
    options = reader.parse_args()
    language_load.load_contract = remembered
    failures: Counter[str] = Counter()
    counts: Counter[str] = Counter()
    began = time.process_time()
    with tempfile.TemporaryDirectory() as made:
        systems = folders(Path(__file__).parents[2], Path(made))
        for folder, text in plans(systems, options.seed, options.plans):
            counts["plans"] += 1
            try:
                counts["accepted"] += examine(folder, text) is not None
            except Exception as error:
                last = traceback.extract_tb(error.__traceback__)[-1]
                kind = f"{type(error).__name__} {Path(last.filename).name}:{last.lineno}"
                failures[kind] += 1
                if failures[kind] == 1:
                    options.keep.mkdir(parents=True, exist_ok=True)
                    name = f"{folder.name}_{re.sub(r'[^A-Za-z0-9]+', '_', kind)}.yaml"
                    (options.keep / name).write_bytes(text.encode("utf-8", "surrogatepass"))
                    print(kind, traceback.format_exc(limit=-4), sep="\n", flush=True)
            if counts["plans"] % 500 == 0:
                print(dict(counts), dict(failures), f"{time.process_time() - began:.0f} s CPU", flush=True)
    print("END", dict(counts), dict(failures))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
