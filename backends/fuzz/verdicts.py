"""Judges the plain program's answers exactly, and makes the outcome of each obligation."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from avow.backend_kit.linked import Recorded, settled
from avow.backend_kit.programs.judging import Formula, NoValue, Seen, exact, returned, seen, started, triggers
from avow.backend_kit.programs.samples import as_single, next_single
from avow.base.files import read_text
from avow.base.suggestions import nearest, suggest
from avow.base.verdict import Counterexample, Hypothesis, HypothesisKind, Outcome, Verdict
from avow.drive.steps import coded, plain
from avow.evaluation.truth import as_shown
from avow.evidence.obligation import Obligation, ProgramClaim
from avow.evidence.record import CASE
from avow.formulas.values import Value
from avow.language import sorts as s

from .clang_tool import clang
from .drawn import Step
from .reading import Reading
from .runner import Run
from .tables import Drawable, sort_name
from .tuning import APART

SPECIAL = {"NaN": math.nan, "infinity": math.inf, "-infinity": -math.inf}


class Misused(Exception):  # noqa: N818 - it names what happened
    """The adapter does not fit the contract."""


@dataclass(frozen=True, slots=True)
class Counts:
    """The counts: libFuzzer's runs (None if it is not installed), runs to be judged, runs judged, the seed."""

    fuzzed: int | None
    kept: int
    judged: int
    seed: int


@dataclass(frozen=True, slots=True)
class Broken:
    """A run whose last step is a violation: its inputs, its steps in the contract's words, and why."""

    run: list[Step]
    trace: tuple[Seen, ...]
    why: str

    def shown(self) -> Counterexample:
        steps = tuple(step.pairs() for step in self.trace)
        return Counterexample(steps[-1] if steps else (), self.why, steps if len(steps) > 1 else ())


@dataclass(slots=True)
class Guarded:
    """A guarantee, and how often its triggers were met."""

    formula: Formula
    triggers: tuple[Formula, ...]
    hits: list[int]
    undecided: int = 0


@dataclass(slots=True)
class Bench:
    """Judges the steps of runs, and counts them."""

    reading: Reading
    assumed: tuple[Formula, ...] = field(init=False)
    begins: tuple[Formula, ...] = field(init=False)
    """The conditions on memory before the first step."""
    guarded: dict[str, Guarded] = field(init=False)
    broken: dict[str, Broken] = field(default_factory=dict)
    """Guarantee → the first run that violates it."""
    crash: Broken | None = None
    """The first run in which the program ended by a signal or an exception."""
    begun: Counterexample | None = None
    """The memory after construction, if it is not allowed."""
    steps: int = 0
    undecided: int = 0
    samples: list[list[Step]] = field(default_factory=list)
    compared: list[Mapping[str, Value]] = field(default_factory=list)
    """The program's allowed steps with their results."""
    recorded: Recorded = field(default_factory=Recorded)
    kept: int = 0
    """The number of `compared` steps that were recorded."""

    def __post_init__(self) -> None:
        job = self.reading.job
        self.assumed = tuple(map(Formula.of, job.node.assumptions))
        self.begins = (*self.assumed, *map(Formula.of, job.begins))
        self.guarded = {}
        for o in job.obligations:
            found = triggers(job.clause(o))
            self.guarded[o.name] = Guarded(Formula.of(job.clause(o)), found, [0] * len(found))

    def words(self, run: list[Step]) -> str:
        last = run[-1] if run else {}
        return ", ".join(f"in.{name} = {value}" for name, value in last.items())

    # -- judging -----------------------------------------------------------------------------------------

    def judge(self, run: list[Step], reply: Run) -> None:
        """Count a run's steps, and keep its violations."""
        if run and len(self.samples) < APART:
            self.samples.append(run)
        for at, step in self._steps(run, reply):
            self.steps += 1
            self.compared += [step[-1].values] if not step[-1].wrong else []
            for name, each in self.guarded.items():
                if name in self.broken:
                    continue
                for k, trigger in enumerate(each.triggers):
                    each.hits[k] += trigger.holds(step[-1].values) is True
                held = each.formula.holds(step[-1].values) if not step[-1].wrong else False
                if held is None:
                    each.undecided += 1
                elif not held:
                    zeros = [n for n, v in run[at].items() if str(v) == "-0.0"]
                    signed = f" ({', '.join(f'in.{n}' for n in zeros)} is -0.0)" if zeros else ""
                    signed += as_shown(each.formula.term, step[-1].values)
                    why = step[-1].wrong or f"guarantee {name} does not hold of these{signed}"
                    self.broken[name] = Broken(
                        run[: at + 1], step, f"{why}: there is no output"[:400] if step[-1].wrong else why
                    )

    def again(self, name: str, run: list[Step], replies: Sequence[Run]) -> Broken | None:
        """A repeated run's violation of a guarantee; None if there is none."""
        other = Bench(self.reading)
        for reply in replies:
            other.judge(run, reply)
        return other.broken.get(name)

    def _steps(self, run: list[Step], reply: Run) -> Iterator[tuple[int, tuple[Seen, ...]]]:
        """The steps that the assumptions allow, each with those before it, up to the first that they forbid."""
        node, memory = self.reading.node, dict.fromkeys(self.reading.memory, "")
        answers = reply.replies
        trace: tuple[Seen, ...] = ()
        if not answers:
            self.crash = self.crash or Broken(run[:1], (Seen({}),), f"making the node ends with {reply.crash}")
            return
        held = self._held(answers[0], "held")
        wrong = started(node, self.begins, held, "the constructor")
        if wrong is not None:
            self.begun = self.begun or wrong
            return
        for at, step in enumerate(run):
            answer = answers[at + 1] if at + 1 < len(answers) else None
            if answer is None and not reply.crash:
                return
            if answer is not None and "misuse" in answer:
                raise self._misfit(answer["why"])
            if answer is not None and "before" in answer:
                held = self._held(answer, "before")
            case = {**step, **held}
            allowed = self._allowed(case)
            if allowed is None:
                self.undecided += 1
            if not allowed:
                if answer is not None and answer.get("skipped"):
                    continue
                return
            if answer is not None and answer.get("skipped"):
                continue
            if answer is None or "error" in answer:
                why = f"the program ends with {reply.crash}" if answer is None else f"the step throws {answer['why']}"
                values = {f"in.{name}": exact(value) for name, value in case.items()}
                found = (*trace, Seen(values, why))
                self.crash = self.crash or Broken(run[: at + 1], found, why)
                yield at, found
                return
            self._fits(answer)
            trace = (*trace, seen(node, memory, case, {"steps": [answer]}))
            yield at, trace
            if trace[-1].wrong:
                return
            held = self._held(answer, "memory")

    def stopped(self, run: list[Step], answers: Sequence[Mapping[str, Any]]) -> Broken | None:
        """The step at which a program with these answers stopped; None if the assumptions do not allow it, or no step
        was in progress."""
        for _ in self._steps(run, Run(tuple(answers), "a fault")):
            pass
        return self.crash if self.begun is None else None

    def _held(self, answer: Mapping[str, Any], key: str) -> dict[str, Any]:
        if "misuse" in answer:
            raise self._misfit(answer["why"])
        data = answer.get(key)
        if not isinstance(data, dict) or set(data) != self.reading.memory:
            names = ", ".join(sorted(self.reading.memory)) or "nothing"
            raise Misused(f"memory() of the adapter has to give {names}")
        self._of_types(data.items(), {p.name: p.sort for p in self.reading.node.inputs})
        return {name: plain(value) for name, value in data.items()}

    def _fits(self, answer: Mapping[str, Any]) -> None:
        """Raises Misused if the outputs are not the contract's: not a fault of the node."""
        names = {p.name for p in self.reading.node.outputs} - self.reading.memory
        given = {name for name, _ in answer["value"]["d"]}
        if given != names:
            missing, extra = sorted(names - given), sorted(given - names)
            faults = [f"has {', '.join(f'`{name}`' for name in extra)}, which is no output"] if extra else []
            faults += [f"lacks {', '.join(missing)}"] if missing else []
            raise self._misfit(f"what it gives {' and '.join(faults)}", names)
        sorts = {p.name: p.sort for p in self.reading.node.outputs}
        self._of_types((*answer["value"]["d"], *answer["memory"].items()), sorts)
        wide = [name for name, data in answer["value"]["d"] if self.reading.single and not _single(data)]
        if wide:
            raise Misused(f"the adapter gives {wide[0]} as a double that is no float: numbers: float32")

    def _of_types(self, given: Iterable[tuple[str, Any]], sorts: Mapping[str, s.Sort]) -> None:
        """Raises Misused where a value is not of its port's type, or no element of it."""
        for name, data in given:
            sort = sorts.get(name)
            if not _of(data, sort):
                raise self._misfit(f"it gives `{name}` as another type than the contract's")
            sort = sort.item if isinstance(sort, s.SequenceSort) else sort
            if isinstance(sort, s.EnumSort):
                for element in data["l"] if isinstance(data, dict) else (data,):
                    if element not in sort.members:
                        raise self._misfit(
                            f"it gives `{element}` for {name}, whose type has no such element", sort.members
                        )

    def _misfit(self, message: str, known: Iterable[str] = ()) -> Misused:
        """What the adapter has wrong: where, and the name that was probably meant by one that is not known."""
        reading = self.reading
        name = found[1] if (found := re.search("`([^`]*)`", message)) else ""
        ports = (*reading.node.inputs, *reading.node.outputs)
        names = {*known} or {*reading.params, *(port.name for port in ports)}
        hint = suggest(name, sorted(names)) if name and name not in names else None
        lines = read_text(reading.adapter, errors="replace").splitlines()
        line = next((f":{at}" for at, text in enumerate(lines, 1) if f'"{name}"' in text), "")
        why = message.removeprefix("the adapter: ")
        place = f"{reading.source.cpp}{line}"
        if near := [each for each in nearest(name, reading.params) if hint and f"`{each}`" in hint]:
            return Misused(f"{place} asks for the parameter `{name}`, and {reading.source.parameters} sets `{near[0]}`")
        return Misused(f"{place}: the adapter does not fit the contract: {why}{f': {hint}' if hint else ''}")

    def _allowed(self, case: Mapping[str, Any]) -> bool | None:
        node = self.reading.node
        try:
            values = {
                f"in.{n}": returned(n, v, node.input(n).sort) if not isinstance(v, list) else exact(v)
                for n, v in case.items()
            }
        except NoValue:
            return False
        unknown = False
        for assumption in self.assumed:
            holds = assumption.holds(values)
            if holds is False:
                return False
            unknown = unknown or holds is None
        return None if unknown else True

    # -- runs that are not random ------------------------------------------------------------------------

    def sweep(self, made: Drawable, most: int) -> list[list[Step]]:
        """Each threshold, and its neighbours, in turn for each input, with simple values for the others."""
        ports = self.reading.asked
        simple: Step = {p.name: _simple(p.sort) for p in ports}
        streams = [[(p.name, value) for value in _values(p.sort, made, self.reading.single)] for p in ports]
        found = [
            [{**simple, name: value}]
            for row in itertools.zip_longest(*streams)
            for pair in row
            if pair is not None
            for name, value in [pair]
        ]
        return found[:most]

    def special(self) -> list[tuple[list[Step], str, str]]:
        """Runs of one step in which one REAL is not a number: the run, the input, the word for its value."""
        found = []
        for run in self.samples:
            for port, word in itertools.product(self.reading.asked, SPECIAL):
                value = run[0][port.name]
                if isinstance(port.sort, s.RealSort):
                    found.append(([{**run[0], port.name: SPECIAL[word]}], port.name, word))
                elif isinstance(port.sort, s.SequenceSort) and isinstance(port.sort.item, s.RealSort) and value:
                    found.append(([{**run[0], port.name: [SPECIAL[word], *value[1:]]}], port.name, word))
        return found

    def apart(self, asked: Sequence[tuple[list[Step], str, str, Run]]) -> list[Counterexample]:
        """The failures with inputs that are not REAL: a missing or invalid output, or a guarantee that does not hold by
        IEEE 754 comparison."""
        node, memory = self.reading.node, dict.fromkeys(self.reading.memory, "")
        found: dict[str, Counterexample] = {}
        for run, name, word, reply in asked:
            zero = {k: _finite(v) for k, v in run[0].items()}
            answers = reply.replies
            answer = answers[1] if len(answers) > 1 else None
            if answer is not None and (answer.get("skipped") or "misuse" in answer):
                continue
            case = {**zero, **self._held(answers[0], "held")} if answers else zero
            if not self._allowed(case):
                continue
            if answer is not None and "error" not in answer:
                self._fits(answer)
            if answer is None:
                step = Seen({f"in.{k}": exact(v) for k, v in case.items()}, f"the program ends with {reply.crash}")
            else:
                step = seen(node, memory, case, {"steps": [answer]})
            broken = [g.formula.name for g in self.guarded.values() if self._breaks(g, step, name, word)]
            why = step.wrong or (f"as IEEE 754 compares, {', '.join(broken)} does not hold of it" if broken else "")
            pairs = tuple((n, word if n == f"in.{name}" else v) for n, v in step.pairs())
            if why:
                found.setdefault(why, Counterexample(pairs, why))
        return list(found.values())

    def _breaks(self, each: Guarded, step: Seen, name: str, word: str) -> bool:
        return not step.wrong and each.formula.compared(step.values, f"in.{name}", SPECIAL[word]) is False

    # -- outcomes ----------------------------------------------------------------------------------------

    def outcomes(
        self, counts: Counts, fault: Broken | None, stopped: bool, apart: tuple[Counterexample, ...]
    ) -> tuple[Outcome, ...]:
        job = self.reading.job
        faulty = self.crash or fault
        refuting = job.options.get("nan") == "possible"
        own = tuple(self._own(o, counts, stopped and faulty is None, apart, refuting) for o in job.obligations)
        faultless = [claim for claim in job.claims if claim.name == ProgramClaim.FAULTLESS]
        links = settled(job, self.compared, "", self.recorded, self.kept)
        claims = (*(self._claim(c, counts, faulty, stopped) for c in faultless), *links)
        rests = tuple(Hypothesis(HypothesisKind.CLAIM, c.local_id, c.digest, c.claim) for c in faultless)
        open_ones = self.reading.left_out
        remarks = (
            (f"what it answers does not hang on {', '.join(open_ones)}, which it is not given",) if open_ones else ()
        )
        good = {"rests_on": rests, "hypotheses": remarks}
        answered = tuple(replace(o, **good) if o.verdict is Verdict.TESTED else o for o in own)  # type: ignore[arg-type]
        others = tuple(
            replace(o, hypotheses=(*o.hypotheses, *remarks)) if o.verdict is Verdict.TESTED else o for o in claims
        )
        return (*answered, *others)

    def _own(
        self,
        o: Obligation,
        counts: Counts,
        unclear: bool,
        apart: tuple[Counterexample, ...],
        refuting: bool,
    ) -> Outcome:
        each = self.guarded[o.name]
        met = [{"trigger": t.name, "met": n} for t, n in zip(each.triggers, each.hits, strict=True)]
        details: dict[str, object] = {"triggers": met}
        if apart:
            details["no numbers"] = [one.text() for one in apart]
        bound: dict[str, object] = {"cases": self.steps, "kept_runs": counts.judged}
        bound |= {} if counts.fuzzed is None else {"fuzzed_runs": counts.fuzzed}
        bound |= {"seed": counts.seed}
        outcome = Outcome(o.id, Verdict.UNKNOWN, "", bound=bound, details=details)
        if o.name in self.broken:
            shown = self.broken[o.name].shown()
            case = [{name: coded(v) for name, v in step.items()} for step in self.broken[o.name].run]
            kept = {**details, CASE: case}
            return replace(outcome, verdict=Verdict.REFUTED, summary=shown.text(), counterexample=shown, details=kept)
        if self.begun is not None:
            return replace(outcome, verdict=Verdict.REFUTED, summary=self.begun.text(), counterexample=self.begun)
        if apart and refuting:
            return replace(outcome, verdict=Verdict.REFUTED, summary=apart[0].text(), counterexample=apart[0])
        why = self._doubt(each.undecided, counts, unclear)
        if why:
            return replace(outcome, summary=why)
        unmet = [t.name for t, n in zip(each.triggers, each.hits, strict=True) if not n]
        if unmet:
            return replace(
                outcome, summary=f"in none of {self.steps} steps was its condition met: {unmet[0]}", vacuous=True
            )
        if each.hits:
            bound["triggered"] = min(each.hits)
        source = "drawn" if counts.fuzzed is None else f"what was new in {counts.fuzzed} runs of libFuzzer"
        summary = f"{self.steps} steps of {counts.judged} runs judged, none breaks it ({source}, seed {counts.seed})"
        return replace(outcome, verdict=Verdict.TESTED, summary=summary)

    def _doubt(self, undecided: int, counts: Counts, unclear: bool) -> str:
        if counts.judged < counts.kept:
            return f"only {counts.judged} of {counts.kept} runs were judged in the time given"
        if not self.steps:
            return "the assumptions are met too rarely: no step was judged"
        if unclear:
            return "libFuzzer stopped at a run that the assumptions do not allow, or that does not stop again"
        if undecided:
            return f"{undecided} of {self.steps} steps could not be judged"
        if self.undecided:
            return f"of {self.undecided} inputs it could not be told whether they meet the assumptions"
        return ""

    def _claim(self, claim: Obligation, counts: Counts, faulty: Broken | None, stopped: bool) -> Outcome:
        runs = counts.judged if counts.fuzzed is None else counts.fuzzed
        bound: dict[str, object] = {"runs": runs, "failures": int(faulty is not None), "seed": counts.seed}
        outcome = Outcome(claim.id, Verdict.UNKNOWN, "", bound=bound)
        if faulty is not None:
            shown = faulty.shown()
            return replace(outcome, verdict=Verdict.REFUTED, summary=shown.text(), counterexample=shown)
        if stopped or not self.steps or counts.judged < counts.kept:
            return replace(outcome, summary=self._doubt(0, counts, stopped))
        if counts.fuzzed is None:
            return Outcome(claim.id, Verdict.NOT_RUN, f"the sanitizer of addresses is clang's: {clang().install}")
        summary = f"{counts.fuzzed} runs with sanitizers of addresses and undefined behaviour, none reports a fault"
        return replace(outcome, verdict=Verdict.TESTED, summary=f"{summary} (seed {counts.seed})")


def _of(data: Any, sort: s.Sort | None) -> bool:
    """Whether the adapter gave a value by the function of its type; memory that is not an output has no type."""
    match sort, data:
        case None, _:
            return True
        case s.SequenceSort(item=item), {"l": list(items)}:
            return all(_of(each, item) for each in items)
        case s.RealSort(), {"f": _}:
            return True
        case ((s.IntegerSort() | s.NaturalSort()), {"i": _}):
            return True
        case s.BoolSort(), bool():
            return True
        case s.EnumSort(), str():
            return True
    return False


def _single(data: Any) -> bool:
    """Whether an output has float32 numbers only."""
    match data:
        case {"l": list(items)}:
            return all(map(_single, items))
        case {"f": str(text)}:
            value = float.fromhex(text)
            return not math.isfinite(value) or as_single(value) == value
        case _:  # not a REAL
            return True


def _simple(sort: s.Sort) -> Any:
    if isinstance(sort, s.EnumSort):
        return sort.members[0]
    return [] if isinstance(sort, s.SequenceSort) else {"truth": False, "integer": 0, "real": 0.0}[sort_name(sort)]


def _values(sort: s.Sort, made: Drawable, single: bool) -> list[Any]:
    match sort:
        case s.BoolSort():
            return [True]
        case s.EnumSort(members=members):
            return list(members)
        case s.RealSort():
            step, near = (next_single, as_single) if single else (math.nextafter, float)
            found = [n for r in made.reals for n in (r, step(r, math.inf), step(r, -math.inf))]
            return [near(n) for n in found if math.isfinite(n)]
        case s.SequenceSort(item=item):
            one = _values(item, made, single)
            return [[_simple(item)] * n for n in made.lengths] + [row for v in one for row in ([v], [_simple(item), v])]
        case _:  # a whole number: `reading` rejects a source with a port of any other sort
            return [n for n in made.integers if n >= 0 or not isinstance(sort, s.NaturalSort)]


def _finite(value: Any) -> Any:
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return 0.0 if isinstance(value, float) and not math.isfinite(value) else value
