"""Tests a node's guarantees on its C++ source: fuzz it, repeat the runs with new coverage, and judge these exactly."""

from __future__ import annotations

import json
import os
import random
import re
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

from avow.backend_kit.given import summarized
from avow.backend_kit.linked import recorded
from avow.backend_kit.protocol import Job, Limits, Report
from avow.base.codec import canonical, to_json
from avow.base.diagnostics import Rejected
from avow.base.files import sha256
from avow.base.plain import ALLOWS_MORE
from avow.base.process import Stopwatch, ToolMissing
from avow.base.tuning.running import WALL
from avow.base.verdict import Isolation, Object, Outcome, Verdict
from avow.drive.steps import coded, plain
from avow.evidence.obligation import ProgramClaim
from avow.evidence.record import RETRY
from avow.isolation import judge
from avow.isolation.level import Unavailable, available
from avow.isolation.observed import Observed
from avow.isolation.outside import Outside

from . import building
from .building import Build, NotBuilt
from .clang_tool import fuzzes, tools
from .drawn import NEW, Step, asking, command, steps
from .reading import Reading, load
from .runner import Answered, Campaign, Campaigned, Question, Run, Runs, Show, Shown
from .tables import drawable
from .tuning import (
    DRAWN_TOGETHER,
    HANGS,
    LONGEST_RUN,
    MOST_CRASHES,
    MOST_JUDGED,
    RESIDENT,
    SEED_BYTES,
    SEEDS,
    SHORTENED,
    SWEPT,
    UNGUIDED,
)
from .unseen import Unseen
from .verdicts import Bench, Broken, Counts, Misused

T = TypeVar("T")
TOOL = "libfuzzer"


def settle(job: Job, limits: Limits) -> Report:
    """One outcome for each obligation and claim."""
    tool = tools()[0]
    version = f"{'clang' if fuzzes(tool) else tool.name} {tool.version}"
    if not job.every:
        return Report((), TOOL, version)
    try:
        available()
        if not tool.present:
            return Report.alike(job, Verdict.NOT_RUN, building.missing(tool), TOOL, version)
        reading = load(job)
    except Unavailable as missing:
        return Report.unsealed(job, missing, TOOL, version)
    except Rejected as rejected:
        return Report.alike(job, Verdict.ERROR, summarized(job, rejected.diagnostics), TOOL, version)
    with tempfile.TemporaryDirectory(prefix="avow-fuzz-") as scratch:
        work = Work(reading, limits, Path(scratch).resolve())
        try:
            outcomes = work.outcomes()
        except NotBuilt as error:
            outcomes = work.alike(Verdict.ERROR, f"it cannot be compiled: {error}", again=error.late)
        except Misused as error:
            outcomes = work.alike(Verdict.ERROR, str(error))
        except Unanswered as error:
            outcomes = work.alike(error.verdict, str(error), again=error.silent)
        except ToolMissing as missing:
            outcomes = work.alike(Verdict.NOT_RUN, str(missing))
    what = {"of": Object.BINARY, "numbers": reading.source.numbers.value}
    outcomes = tuple(replace(o, **what) for o in outcomes)  # type: ignore[arg-type]
    return Report(outcomes, TOOL, version, work.command, work.logs, tuple(work.observed), work.isolation)


class Unanswered(Exception):  # noqa: N818 - it names what happened
    """The judge gave no answer (`silent`: for an unknown reason), or the program did something forbidden: nothing is
    concluded."""

    def __init__(self, verdict: Verdict, why: str, silent: bool = False) -> None:
        super().__init__(why)
        self.verdict, self.silent = verdict, silent


@dataclass(slots=True)
class Work:
    reading: Reading
    limits: Limits
    folder: Path
    observed: dict[Observed, None] = field(default_factory=dict)
    isolation: Isolation = Isolation.SEALED
    logs: dict[str, str] = field(default_factory=dict)
    command: tuple[str, ...] = ()
    _spent: Stopwatch = field(init=False)
    _outside: Outside = field(init=False)

    def __post_init__(self) -> None:
        self._spent = Stopwatch()
        self._outside = Outside(tools())

    @property
    def job(self) -> Job:
        return self.reading.job

    def alike(self, verdict: Verdict, summary: str, *, again: bool = False) -> tuple[Outcome, ...]:
        """`again`: the next run asks again."""
        details: dict[str, object] = {RETRY: True} if again else {}
        return tuple(Outcome(o.id, verdict, summary, details=details) for o in self.job.every)

    def outcomes(self) -> tuple[Outcome, ...]:
        reading = self.reading
        made = drawable(reading)
        building.write(reading, made, self.folder)
        built: dict[Build, building.Built] = {}
        fuzzed = fuzzes(tools()[0])
        try:
            for wanted in (*([Build.FUZZED] if fuzzed else []), Build.PLAIN, Build.FILLED):
                built[wanted] = building.build(wanted, reading, self.folder, self._outside, self._left())
            asked = built[Build.PLAIN].asked
            unseen = building.looked_into(reading, self.folder, self._outside, asked, self._left())
            self._spent = self._spent if fuzzed else Stopwatch()  # the wheel's first build takes a minute
        finally:  # also if the build fails: it may succeed once a library is installed
            self.observed.update(dict.fromkeys(building.observed(reading, tuple(built.values()), self._outside)))
        program = built[Build.PLAIN].program
        bench = Bench(reading)
        kept = self.folder / "kept"
        seeds = self._seeds(kept / "corpus", SEEDS if fuzzed else UNGUIDED)
        campaign = self._campaign(kept) if fuzzed else None
        faults = _files(kept, "fault-", 10)
        drawn = self._drawn(program, (*seeds, *_files(kept / "corpus", "", MOST_JUDGED * 2)))
        bench.recorded = recorded(self.job, [port.name for port in reading.asked])
        shown = _different([[dict(step) for step in run] for run in bench.recorded.runs])
        runs = _different([*shown, *self._earlier(), *bench.sweep(made, SWEPT), *drawn])[: MOST_JUDGED + SEEDS]
        answer = self._asked(program, map(self._words, runs), built[Build.FILLED].program)
        judged = 0
        for run, reply in zip(runs, answer.runs, strict=False):
            bench.judge(run, reply)
            judged += 1
            bench.kept = len(bench.compared) if judged <= len(shown) else bench.kept
        self._confirm(bench, program)
        if answer.unsteady is not None and not bench.broken:
            words = bench.words(runs[answer.unsteady])
            why = "asked again, where what nothing was written to holds other bytes, it answers otherwise"
            raise Unanswered(Verdict.UNKNOWN, f"undeclared input: {why} ({words})")
        fault = self._fault(self._drawn(program, faults))
        if campaign is not None and not faults and campaign.done < reading.runs and not bench.crash:
            raise Unanswered(Verdict.ERROR, "libFuzzer ended without having made its runs, and without a report")
        apart = bench.apart(self._special(bench, program)) if judged else []
        counts = Counts(None if campaign is None else campaign.done, len(runs), judged, self.limits.seed)
        return tuple(_doubted(o, unseen) for o in bench.outcomes(counts, fault, bool(faults), tuple(apart)))

    # -- steps -------------------------------------------------------------------------------------------

    def _left(self) -> float:
        return max(1.0, self.limits.seconds * 0.9 - self._spent())

    def _ask(self, kind: type[T], ask: Campaign | Runs | Show) -> T:
        place = self.folder / "question.json"
        question = Question(ask, str(self.job.root.resolve()), self._left())
        place.write_text(canonical(to_json(question)), encoding="utf-8")
        done, answer = judge.ask(
            kind,
            str(Path(__file__).with_name("runner.py").resolve()),
            [str(place)],
            cwd=self.folder,
            seconds=self._left() * WALL + 20.0,
            megabytes=0,  # sanitizers reserve terabytes of addresses
            env={"PYTHONHASHSEED": "0"},
        )
        if answer is None:
            if done.timed_out:
                raise Unanswered(
                    Verdict.UNKNOWN, f"it did not end within {self.limits.seconds * WALL:g} s; {ALLOWS_MORE}", True
                )
            last = done.stderr.strip().splitlines()[-1:] or ["no message"]
            raise Unanswered(Verdict.ERROR, f"its judge ended without an answer: {last[0][:200]}", True)
        return answer

    def _seeds(self, corpus: Path, count: int) -> list[bytes]:
        corpus.mkdir(parents=True)
        chance = random.Random(self.limits.seed)
        seeds = [chance.randbytes(SEED_BYTES[k % len(SEED_BYTES)]) for k in range(count)]
        for seed in seeds:
            (corpus / sha256(seed.hex())[:40]).write_bytes(seed)
        return seeds

    def _campaign(self, kept: Path) -> Campaigned:
        options = (
            f"-runs={self.reading.runs}",
            f"-seed={self.limits.seed + 1}",  # 0 means a random seed
            f"-max_len={LONGEST_RUN}",
            f"-timeout={HANGS}",
            f"-rss_limit_mb={RESIDENT}",
            "-detect_leaks=0",
            "-verbosity=0",
        )
        self.command = ("./fuzz", *options)
        answer = self._ask(Campaigned, Campaign(str(self.folder), str(kept), options))
        self._kept_apart(answer.isolation)
        if answer.log.strip():
            self.logs["libfuzzer.log"] = answer.log.replace(str(self.folder), ".")
        if answer.fault:
            raise Unanswered(Verdict.ERROR, answer.fault)
        if answer.code is None:
            why = f"libFuzzer did not make its {self.reading.runs} runs in the time given; {ALLOWS_MORE}"
            raise Unanswered(Verdict.UNKNOWN, why, True)
        return answer

    def _kept_apart(self, isolation: Isolation) -> None:
        self.isolation = min(self.isolation, isolation, key=lambda level: level.rank)

    def _words(self, run: Sequence[Step]) -> tuple[str, ...]:
        return (NEW, *(command(self.reading.asked, step) for step in run))

    def _drawn(self, program: Path, data: Sequence[bytes]) -> list[list[Step]]:
        """The runs that the harness draws of these bytes."""
        found: list[list[Step]] = []
        for at in range(0, len(data), DRAWN_TOGETHER):
            part = data[at : at + DRAWN_TOGETHER]
            (answer,) = self._asked(program, [tuple(map(asking, part))]).runs or (Run((), ""),)
            if len(answer.replies) != len(part):
                raise Unanswered(Verdict.UNKNOWN, "the time ended before its inputs were drawn", True)
            found += [list(steps(self.reading.asked, reply)) for reply in answer.replies]
        return found

    def _asked(self, program: Path, runs: Iterable[tuple[str, ...]], twin: Path | None = None) -> Answered:
        ask = Runs(str(program), str(twin or ""), tuple(runs), MOST_CRASHES)
        answer = self._ask(Answered, ask)
        self._kept_apart(answer.isolation)
        self.observed.update(dict.fromkeys(answer.observed))
        if answer.fault:
            raise Unanswered(Verdict.UNKNOWN if answer.silent else Verdict.ERROR, answer.fault, answer.silent)
        return answer

    def _earlier(self) -> Iterator[list[Step]]:
        """The runs that refuted a guarantee earlier, if they fit the node as it is now."""
        names = {port.name for port in self.reading.asked}
        for cases in self.job.kept.values():
            for case in cases:
                try:
                    run = [{name: plain(value) for name, value in step.items()} for step in case]
                    self._words(run)
                except (ValueError, TypeError, KeyError, AttributeError):
                    continue
                if all(set(step) == names for step in run):
                    yield run

    def _confirm(self, bench: Bench, program: Path) -> None:
        """Reduce each run that violates a guarantee, and repeat the violation in a process with no other requests."""
        for name, broken in list(bench.broken.items()):
            best: Broken | None = None
            tries = [broken.run[-1:], broken.run]
            tried = 0
            while tries and tried < SHORTENED:
                run = tries.pop(0)
                tried += 1
                found = bench.again(name, run, self._asked(program, [self._words(run)]).runs)
                if found is not None and (best is None or len(found.run) < len(best.run)):
                    best = found
                    tries = [best.run[:k] + best.run[k + 1 :] for k in range(len(best.run) - 1)]
            if best is None:
                shown = bench.words(broken.run)
                raise Unanswered(Verdict.UNKNOWN, f"undeclared input: asked alone, it answers otherwise ({shown})")
            bench.broken[name] = best

    def _fault(self, runs: list[list[Step]]) -> Broken | None:
        """The first run at which libFuzzer stopped and the program with sanitizers stops too, if the assumptions allow
        it."""
        if not runs:
            return None
        built = building.build(Build.SANITIZED, self.reading, self.folder, self._outside, self._left())
        for run in runs:
            answer = self._ask(Shown, Show(str(built.program), self._words(run)))
            self.logs["fault.log"] = answer.log.replace(str(self.folder), ".")
            found = Bench(self.reading).stopped(run, answer.replies)
            if found is not None and answer.code not in (0, None):
                return replace(found, why=self._said(answer.log))
        return None

    def _said(self, log: str) -> str:
        """A sanitizer's report, with a place that is the same on every machine."""
        text = building.plainly(log, self.reading, self.folder)
        plainly = re.search(r"^(\S+:\d+:\d+): (runtime error: .+)$", text, re.MULTILINE)
        if plainly:
            return f"{plainly[1]}: {plainly[2]}"
        summary = re.search(r"^SUMMARY: (\w+): (.+)$", text, re.MULTILINE)
        own = re.search(
            r"^\s+#\d+ \S+ in .*? ((?!harness|replay|avow_)[^/\s][^\s:]*:\d+(?::\d+)?)$", text, re.MULTILINE
        )
        if summary:
            at = f" ({own[1]})" if own and own[1] not in summary[2] else ""
            return f"{summary[1]}: {summary[2]}{at}"
        return "the program ends by a signal or an exception"

    def _special(self, bench: Bench, program: Path) -> list[tuple[list[Step], str, str, Run]]:
        """Each REAL input in turn NaN and infinite, with a few steps' other inputs; with the replies."""
        asked = bench.special()
        replies = self._asked(program, [self._words(run) for run, _, _ in asked]).runs if asked else ()
        return [(run, name, word, reply) for (run, name, word), reply in zip(asked, replies, strict=False)]


def _doubted(outcome: Outcome, unseen: Unseen) -> Outcome:
    """The outcome, unknown instead of good if unobservable behaviour forbids a good one."""
    faultless = outcome.obligation.endswith(f"/{ProgramClaim.FAULTLESS}")
    why = unseen.undeclared or (unseen.faults if faultless else "")
    return replace(outcome, verdict=Verdict.UNKNOWN, summary=why) if why and outcome.verdict.supports else outcome


def _files(folder: Path, prefix: str, most: int) -> list[bytes]:
    """The contents of plain files of a folder in which the program could write; the shortest first."""
    found: list[bytes] = []
    names = sorted(entry.name for entry in os.scandir(folder) if entry.is_file(follow_symlinks=False))
    for name in names:
        if not name.startswith(prefix) or name.startswith(f"{prefix}slow-unit") or len(found) >= most:
            continue
        try:
            handle = os.open(folder / name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
            with os.fdopen(handle, "rb") as file:
                found.append(file.read(LONGEST_RUN))
        except OSError:
            continue
    return sorted(found, key=lambda data: (len(data), data))


def _different(runs: Sequence[list[Step]]) -> list[list[Step]]:
    found: dict[str, list[Step]] = {}
    for run in runs:
        if run:
            found.setdefault(json.dumps([{name: coded(v) for name, v in step.items()} for step in run]), run)
    return list(found.values())
