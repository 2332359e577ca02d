"""Random texts and damaged contracts, and what must hold of each of them. A long run:

cd tests; python -m language.fuzzing --texts 100000 --seed 7 --keep /tmp/found
"""

from __future__ import annotations

import argparse
import random
import re
import resource
import signal
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from drawn.contracts import CONTRACT, Varied

from avow.base.codec import to_json
from avow.base.codes import CODES
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.rendering import render, to_sarif, told
from avow.base.tuning.shown import DIAGNOSTICS
from avow.formulas.formula import node_digest
from avow.language.contract import Contract
from avow.language.format import format_text
from avow.language.load import check_text
from avow.language.translate import FORMATS
from avow.solving.smtlib import to_smtlib

SECONDS = 10.0
"""CPU time for all that is done with one text (of some 10 kB at most)."""

MEGABYTES = 600
"""What the whole process may grow by, over any number of texts."""

FIRST = """\
context { Wayp = {wayA, wayB, origin}; Limit = 120; T : (REAL, <NATURAL>); U : {}; F : REAL x REAL --> NATURAL; }
node a { inputs( f : F, t : T ) outputs( w : Wayp, u : U ) topics( pkg/msg/T w matches(out.w), int16 f )
A( forall(x, y in REAL; in.f(x, y) < Limit) )
guarantee exit_on_danger "Go to the exit on dangerous radiation" ( exists_unique(x, y in REAL, i in NATURAL |
  in.f(x, y) == i + 1 and 0 <= x < 120) -> out.w in {wayA, wayB} or out.w !in Wayp ) }
"""
SECOND = """\
node b{
inputs( r : REAL, s : <REAL>, st : {stop, go}, n : NATURAL )
outputs( c : { move(REAL, REAL), halt } )
topics()
assume( 0 <= in.r )
G( (in.r >= 2.5 <=> in.st == go) and in.s == <0.5, r> )
G( n in <1 upto length(s)> -> out.c == move(in.r, -1 / 2) or not c == halt )
}
"""


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


# --- texts -----------------------------------------------------------------------------------------------------------


def seeds(root: Path) -> list[str]:
    """The texts that the fuzzer starts from: shipped contracts, whole and node by node, and what the grammar has."""
    texts = [CONTRACT, FIRST, SECOND]
    for path in sorted(root.glob("contracts/*/*.rcl")):
        text = path.read_text("utf-8")
        texts.append(text)
        head, *nodes = re.split(r"(?m)^(?=node )", text)
        texts += [head + node for node in nodes]
        texts += nodes
    return texts


_SAME_KIND = (
    ("and", "or", "->", "<=>"),
    ("==", "!=", "<", "<=", ">", ">=", "in", "!in"),
    ("+", "-", "*", "/"),
    ("forall", "exists", "exists_unique"),
    ("REAL", "INTEGER", "NATURAL", "BOOL", "STRING"),
    ("inputs", "outputs", "topics"),
    ("assume", "guarantee", "A", "G"),
    ("TRUE", "FALSE", "0", "1", "2.5", "0.125", "<>", "{}"),
    ("in.", "out.", ""),
    ("(", ")", "{", "}", "<", ">"),
    (",", ";", "|", ":", "=", "."),
    ("x", "y", "i", "red", "r"),
)
_KIND = {word: kind for kind in _SAME_KIND for word in kind}
_TOKEN = re.compile(r"in\.|out\.|-->|<=>|->|==|!=|<=|>=|!in\b|<>|[A-Za-z_][\w']*|\d+(?:\.\d+)?|\s+|.", re.DOTALL)
_ODD = (
    *(
        "\u202e",
        "\u0301",
        "🤖",
        "\ufeff",
        "\u2028",
        "\x85",
        "\r",
        "\x0b",
        "\x0c",
        "\x1b[2J",
        "\x7f",
        "\x00",
        "\ud800",
        "ſ",
    ),
    *(
        "𝒳",
        "１",
        "٣",
        "·",
        "′",
        "“x”",
        "\u00a0",
        "\u200b",
        "x" * 20_000,
        " " * 20_000,
        "9" * 499,
        "9" * 501,
        "0." + "3" * 800,
    ),
    *(
        "1e999",
        "0x1F",
        "1_000",
        "-0",
        "00",
        "9" * 30 + "." + "9" * 30,
        '"' + "é" * 3000 + '"',
        "// " + "x" * 9000,
        "''''",
    ),
    *("/*" * 400, "*/", "--", "\\\n", "%s%n", "{{7*7}}", "${x}", "`id`", "'; DROP", "<!--", "\\end{document}"),
)
_REWRITTEN: tuple[Callable[[str], str], ...] = (
    lambda text: text.replace("\n", "\r\n"),
    lambda text: text.replace("\n", "\r"),
    lambda text: text.replace(" ", "\t"),
    lambda text: "\ufeff" + text,
    lambda text: text.replace("\n", " "),
    lambda text: text.replace(" ", ""),
    str.rstrip,
    str.upper,
    str.lower,
    str.swapcase,
)


def mutated(text: str, source: random.Random, others: Sequence[str]) -> str:
    """The text after some changes that keep it nearer to a contract than `damaged` does."""
    for _ in range(source.choice((1, 1, 1, 2, 3, 6))):
        if not text:
            break
        lines = text.split("\n")
        at = source.randrange(len(lines))
        match source.randrange(16):
            case 0 | 1 | 2 | 3:  # another word of its kind
                parts = _TOKEN.findall(text)
                places = [i for i, part in enumerate(parts) if part in _KIND]
                if places:
                    place = source.choice(places)
                    parts[place] = source.choice(_KIND[parts[place]])
                text = "".join(parts)
            case 4:
                text = "\n".join([*lines[:at], *[lines[at]] * source.choice((2, 3, 50)), *lines[at + 1 :]])
            case 5:
                text = "\n".join(lines[:at] + lines[at + 1 :])
            case 6:
                other = source.choice(others).split("\n")
                text = "\n".join([*lines[:at], *other[source.randrange(len(other)) :][:6], *lines[at:]])
            case 7:
                source.shuffle(lines)
                text = "\n".join(lines)
            case 8:
                text = _put(text, source.choice(_ODD), source)
            case 9:
                count = source.choice((3, 140, 160, 2000))
                before, after = source.choice(
                    (("(", ")"), ("not ", ""), ("{", "}"), ("<", ">"), ("-", ""), ("x -> ", ""), ("f(", ")"))
                )
                text = _put(
                    text, before * count + source.choice(("", "x", "TRUE")) + after * source.choice((count, 0)), source
                )
            case 10:
                chain = source.choice(
                    (" and b", " or TRUE", " -> b", " + 1", " * r", " <=> b", ", x", " == 1", "; x : REAL", " x REAL")
                )
                text = _put(text, chain * source.choice((2, 200, 1500)), source)
            case 11:
                text = source.choice(_REWRITTEN)(text)
            case 12:
                text = text[: source.randrange(len(text))]
            case 13:
                text = text[source.randrange(len(text)) :]
            case 14:
                names = sorted(set(re.findall(r"[A-Za-z_][\w']*", text)))
                if names:
                    old, new = source.choice(names), source.choice([*names, "x'", "A", "G", "x", "length"])
                    text = re.sub(rf"\b{re.escape(old)}(?![\w'])", new, text)
            case _:
                start = source.randrange(len(text))
                piece = text[start : start + source.randrange(200)]
                text = _put(text, piece, source)
    return text


def _put(text: str, piece: str, source: random.Random) -> str:
    place = source.randrange(len(text) + 1)
    return text[:place] + piece + text[place:]


SHORT = 2_000
"""Characters of what `--short` runs on: many more texts in the same time."""


def texts(root: Path, seed: int, count: int, *, short: bool = False) -> Iterator[str]:
    """Texts of every kind, the same for the same seed."""
    source = random.Random(seed)
    sources = [text for text in seeds(root) if not short or len(text) < SHORT]
    made = 0
    for text in _endless(source, sources, Varied(seed)):
        if not short or len(text) <= SHORT:
            yield text
            made += 1
        if made >= count:
            return


def _endless(source: random.Random, sources: Sequence[str], formulas: Varied) -> Iterator[str]:
    while True:
        match source.randrange(20):
            case 0:
                alphabet = source.choice((128, 256, 0x300, 0x11000))
                yield "".join(chr(source.randrange(alphabet)) for _ in range(source.randrange(400)))
            case 1:
                words = [w for kind in _SAME_KIND for w in kind] + [
                    "context",
                    "node",
                    "matches",
                    "upto",
                    "\n",
                    '"a"',
                    "n",
                    "f",
                ]
                yield " ".join(source.choice(words) for _ in range(source.randrange(300)))
            case 2 | 3 | 4:
                formula = formulas.formula(1 + source.randrange(4))
                text = CONTRACT.replace("guarantee( TRUE )", f"guarantee( {formula} )")
                yield text if source.random() < 0.5 else mutated(text, source, sources)
            case 5 | 6 | 7 | 8:
                yield damaged(source.choice(sources), source)
            case _:
                yield mutated(source.choice(sources), source, sources)


_PIECES = re.compile(r"\w+'*|[^\w\s]+|\s+")
_WORDS = (
    *("context", "node", "inputs", "outputs", "topics", "matches", "assume", "guarantee", "forall", "exists", "in"),
    *("exists_unique", "upto", "length", "TRUE", "REAL", "STRING", "A", "G", "x", "not", "!in", "out", ".", "1.5"),
    *("<", ">", "<>", "<=>", "->", "-->", "--", "==", "=", "{", "}", "(", ")", "|", ";", "//", "/*", "*/", '"', "\n"),
    *("∀", "é", "\x00", "\x1b[31m", "\\", "9" * 600, "'", "\ufeff", "\u202e"),
)


def damaged(text: str, source: random.Random) -> str:
    """The text with a few of its words replaced, dropped, doubled, swapped or reversed, or junk put between them."""
    if source.random() < 0.4:
        start = source.randrange(len(text))
        text = text[start : start + source.randrange(3000)]
    parts = _PIECES.findall(text)
    for _ in range(source.randrange(1, 12)):
        if not parts:
            break
        at = source.randrange(len(parts))
        match source.randrange(7):
            case 0 | 1:
                parts[at] = source.choice(_WORDS)
            case 2:
                del parts[at]
            case 3:
                parts.insert(at, source.choice(_WORDS))
            case 4:
                other = source.randrange(len(parts))
                parts[at], parts[other] = parts[other], parts[at]
            case 5:
                parts[at] = parts[at][::-1]
            case _:
                parts.insert(at, "".join(chr(source.randrange(0x3000)) for _ in range(source.randrange(6))))
    return "".join(parts)


# --- what must hold --------------------------------------------------------------------------------------------------


def examine(text: str) -> Contract | None:
    """Checks all that must hold of any text. Raises AssertionError, `Slow`, or what should not be raised."""
    with at_most(SECONDS):
        contract, found = check_text(text, "f")
        assert (contract is None) == any(d.is_error for d in found)
        assert len(found) <= DIAGNOSTICS + 1
        lines = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n").split("\n")
        for diagnostic in found:
            _place(diagnostic, lines)
        shown = render(found, {"f": text})
        assert not any(c in shown for c in "\x00\x1b\u202e\x7f\x85\u2028")
        to_json(told(found)), to_sarif(found)
        formatted = _format(text)
        if contract is not None:
            assert formatted is not None
            _accepted(contract, formatted)
        return contract


def _place(diagnostic: Diagnostic, lines: Sequence[str]) -> None:
    assert diagnostic.code in CODES
    assert diagnostic.span is not None
    assert diagnostic.message
    places = (diagnostic.span, *(span for _, span in diagnostic.notes if span is not None))
    for span in places:
        assert _inside(span, lines), (diagnostic, len(lines))


def _inside(span: Span, lines: Sequence[str]) -> bool:
    return (
        1 <= span.line <= span.end_line <= len(lines)
        and 1 <= span.column <= len(lines[span.line - 1]) + 1
        and 1 <= span.end_column <= len(lines[span.end_line - 1]) + 1
        and (span.line, span.column) <= (span.end_line, span.end_column)
    )


def _format(text: str) -> str | None:
    try:
        formatted = format_text(text, "f")
    except Rejected as rejected:
        assert rejected.diagnostics  # noqa: PT017
        return None
    assert format_text(formatted, "f") == formatted
    return formatted


def _accepted(contract: Contract, formatted: str) -> None:
    again = check_text(formatted, "f")[0]
    assert again == contract
    assert digests(again) == digests(contract)
    try:
        written = FORMATS["rcl"](contract)
    except Rejected as rejected:
        assert {d.code for d in rejected.diagnostics} <= {"RCL110", "RCL202"}  # noqa: PT017
    else:
        back, found = check_text(written, "f")
        assert back == contract, [str(d) for d in found if d.is_error]
    for style in ("text", "unicode", "latex", "json"):
        assert FORMATS[style](contract).encode("utf-8", "surrogatepass")
    try:
        assert bool(to_smtlib(contract)) == bool(contract.nodes)
    except Rejected as rejected:
        assert {d.code for d in rejected.diagnostics} == {"SMT001"}  # noqa: PT017


def digests(contract: Contract) -> list[str]:
    """What a ledger knows the contract's clauses by."""
    return [node_digest(node, clause) for node in contract.nodes for clause in node.clauses]


def smaller(text: str, wrong: Callable[[str], bool]) -> str:
    """A part of the text with which the same is wrong, by leaving out ever smaller pieces."""
    size = max(1, len(text) // 2)
    while size:
        at = 0
        while at < len(text):
            shorter = text[:at] + text[at + size :]
            if wrong(shorter):
                text = shorter
            else:
                at += size
        size //= 2
    return text


def memory() -> float:
    """The largest size of this process so far, in megabytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _signature(error: BaseException) -> str:
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__} {Path(last.filename).name}:{last.lineno}"


def main() -> int:
    """Runs many texts; each kind of failure is written down once, made small."""
    reader = argparse.ArgumentParser()
    reader.add_argument("--texts", type=int, default=10_000)
    reader.add_argument("--seed", type=int, default=1)
    reader.add_argument("--short", action="store_true")
    reader.add_argument("--keep", type=Path, default=Path("fuzz-found"))
    options = reader.parse_args()
    root = Path(__file__).parents[2]
    resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
    failures: Counter[str] = Counter()
    counts: Counter[str] = Counter()
    before, began, slowest = memory(), time.process_time(), 0.0
    for text in texts(root, options.seed, options.texts, short=options.short):
        counts["texts"] += 1
        start = time.process_time()
        try:
            counts["accepted"] += examine(text) is not None
        except Exception as error:
            kind = _signature(error)
            failures[kind] += 1
            if failures[kind] == 1:
                options.keep.mkdir(parents=True, exist_ok=True)
                name = re.sub(r"\W+", "_", kind)
                small = text if isinstance(error, Slow) else smaller(text, lambda t, k=kind: _fails(t) == k)  # type: ignore[misc]
                (options.keep / f"{name}.rcl").write_bytes(small.encode("utf-8", "surrogatepass"))
                print(kind, traceback.format_exc(limit=-4), sep="\n", flush=True)
        slowest = max(slowest, time.process_time() - start)
        if counts["texts"] % 5000 == 0:
            print(
                counts,
                dict(failures),
                f"{time.process_time() - began:.0f} s CPU",
                f"{memory() - before:.0f} MB",
                flush=True,
            )
    print("END", dict(counts), dict(failures), f"slowest {slowest:.2f} s", f"grown by {memory() - before:.0f} MB")
    return 1 if failures or memory() - before > MEGABYTES else 0


def _fails(text: str) -> str | None:
    try:
        examine(text)
    except Exception as error:
        return _signature(error)
    return None


if __name__ == "__main__":
    sys.exit(main())
