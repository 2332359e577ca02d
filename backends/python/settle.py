"""Settling a node's guarantees of its own class: run it, compare it with its translation, prove, or show the fault."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

from avow.backend_kit.given import summarized
from avow.backend_kit.linked import Recorded, recorded, settled
from avow.backend_kit.programs.cpython import Subject, ask, case_of
from avow.backend_kit.programs.judging import Formula, Seen, meets, seen, started
from avow.backend_kit.programs.samples import Drawing, beside, leaves, numbers_of, pool, shifted, written
from avow.backend_kit.protocol import Job, Limits, Report
from avow.base.diagnostics import Rejected
from avow.base.process import ToolMissing
from avow.base.tuning.bounds import CASES_KEPT
from avow.base.verdict import Counterexample, Isolation, Object, Outcome, Verdict
from avow.drive.steps import coded
from avow.evidence.obligation import Obligation
from avow.evidence.record import OUTPUT_FOR_EVERY_INPUT, RETRY
from avow.formulas.values import Element, SequenceValue, Value
from avow.isolation.level import Unavailable, available
from avow.isolation.observed import Observed
from avow.language.sorts import RealSort, SequenceSort
from avow.language.terms import Variable
from avow.solving.checking import z3_version
from avow.solving.limits import from_seconds, until
from avow.solving.settling import Settler

from .conditions import Conditions, Found
from .program import fraction, run
from .reading import Reading, load
from .translate import kind_of
from .tuning import APART, RUN_SECONDS, VALIDATED

TOOL = "python conditions"
NOT_FINITE = "inputs are finite"
NOT_ROUNDED = "what is computed with are fractions, and nothing is rounded"


def settle(job: Job, limits: Limits) -> Report:
    """One outcome for each obligation."""
    version = f"z3 {z3_version()}"
    try:
        available()
        reading = load(job)
    except Unavailable as missing:
        return Report.unsealed(job, missing, TOOL, version)
    except Rejected as rejected:
        return Report.alike(job, Verdict.ERROR, summarized(job, rejected.diagnostics), TOOL, version)
    if not job.every:
        return Report((), TOOL, version)
    try:
        work = Work(reading, limits)
        outcomes = work.outcomes()
        outcomes += settled(job, work.compared, "", work.recorded, work.kept)
    except ToolMissing as missing:
        return Report.alike(job, Verdict.NOT_RUN, str(missing), TOOL, version)
    what = {"of": Object.SOURCE, "numbers": reading.source.numbers.value}
    outcomes = tuple(replace(o, **what, details={**o.details, **work.said}) for o in outcomes)  # type: ignore[arg-type]
    return Report(outcomes, TOOL, version, (), work.logs, tuple(work.observed), work.isolation)


@dataclass(slots=True)
class Work:
    """One reading, and what was found of it."""

    reading: Reading
    limits: Limits
    observed: dict[Observed, None] = field(default_factory=dict)
    isolation: Isolation = Isolation.SEALED
    deed: bool = False
    """A run did what no subject may do."""
    silent: bool = False
    """A run had no answer for a reason that says nothing of the class: the next run asks again."""
    logs: dict[str, str] = field(default_factory=dict)
    said: dict[str, object] = field(default_factory=dict)
    ran: int = 0
    broken: dict[str, Counterexample] = field(default_factory=dict)
    """Guarantee → the first case of it that CPython showed."""
    unkept: tuple[str, ...] = ()
    """What is assumed of memory and not shown of every step."""
    allowed: int = 0
    """Cases that met the assumptions."""
    compared: list[Mapping[str, Value]] = field(default_factory=list)
    """What CPython made of them."""
    recorded: Recorded = field(default_factory=Recorded)
    kept: int = 0
    """How many of those compared were recorded."""

    @property
    def job(self) -> Job:
        return self.reading.job

    def outcomes(self) -> tuple[Outcome, ...]:
        job, reading = self.job, self.reading
        formulas = {o.id: Formula.of(job.clause(o)) for o in job.obligations}
        assumed = tuple(map(Formula.of, job.node.assumptions))
        begins = (*assumed, *map(Formula.of, job.begins))
        cases = self.cases(assumed)
        if cases is None:
            return self.alike(Verdict.UNKNOWN, self.refusals())
        fault = self.try_recorded(formulas, assumed) or self.try_all(cases, formulas, assumed)
        if fault:
            outside = reading.step is None and not self.deed
            return self.alike(Verdict.ERROR, f"{self.refusals()} ({fault})" if outside else fault)
        if reading.step is None:
            return tuple(self.refuted(o) or Outcome(o.id, Verdict.UNKNOWN, self.refusals()) for o in job.obligations)
        made = {port: reading.step.start[attribute] for port, attribute in reading.step.memory.items()}
        if (begun := started(job.node, begins, made, "__init__")) is not None:
            wrong = Outcome("", Verdict.REFUTED, begun.text(), begun)
            return tuple(self.refuted(o) or replace(wrong, obligation=o.id) for o in job.obligations)
        if job.options.get("nan") == "possible" and self.reals():
            return self.apart(cases, formulas, assumed)
        still = [o for o in job.obligations if o.id not in self.broken]
        found: dict[str, Found] = {}
        if still:
            numbers = self.numbers(with_program=True)
            conditions = Conditions(reading, reading.step, numbers, until(from_seconds(self.limits.seconds)))
            found = conditions.settle([(o.id, job.clause(o)) for o in still])
            self.unkept = conditions.unkept
            left = [(o.id, job.clause(o)) for o in still if found[o.id].verdict is Verdict.UNKNOWN]
            if left and any(found[name].details.get("rounded_at_lines") for name, _ in left) and not reading.exact:
                again = replace(conditions, combined=True, settler=Settler(), proved=[], scripts={})
                found |= {n: f for n, f in again.settle(left).items() if f.verdict is Verdict.PROVED}
                self.logs |= {f"again-{name}": text for name, text in again.scripts.items()}
            self.logs |= {"conditions.log": conditions.log(), **conditions.scripts}
            shown = [case for f in found.values() for case in f.models]
            wanted = [c for model in shown for c in self.near(model)]
            if wanted:
                fault = self.try_all(wanted, formulas, assumed)
                if fault:
                    return self.alike(Verdict.ERROR, fault)
        return tuple(self.refuted(o) or self.settled(o, found[o.id]) for o in job.obligations)

    def alike(self, verdict: Verdict, summary: str) -> tuple[Outcome, ...]:
        details: dict[str, object] = {RETRY: True} if self.silent else {}
        return tuple(Outcome(o.id, verdict, summary, details=dict(details)) for o in self.job.obligations)

    def refusals(self) -> str:
        name = self.reading.file.name
        lines = [f"{name}:{r.line}: {r.why}" for r in self.reading.refused[:3]]
        more = len(self.reading.refused) - len(lines)
        return f"not understood: {'; '.join(lines)}" + (f"; and {more} more" if more > 0 else "")

    # -- running -----------------------------------------------------------------------------------------

    def numbers(self, *, with_program: bool) -> frozenset[Fraction]:
        """What contract, parameters and, where it is asked, the program write down."""
        clauses = (*self.job.node.assumptions, *(self.job.clause(o) for o in self.job.obligations))
        found = set(numbers_of(c.formula for c in clauses))
        found |= set(leaves(self.reading.params))
        if with_program:
            found |= set(written(self.reading.text))
        return frozenset(found)

    def cases(self, assumed: tuple[Formula, ...]) -> list[dict[str, Any]] | None:
        """Inputs to be tried; None where this method draws none of the node's types."""
        sorts = {p.name: p.sort for p in self.job.node.inputs}
        for sort in sorts.values():
            if kind_of(sort.item if isinstance(sort, SequenceSort) else sort) is None:
                return None
        drawn = Drawing(pool(self.numbers(with_program=True)), sorts, random.Random(self.limits.seed))
        return list(drawn.cases(VALIDATED, meets(assumed)))

    def try_recorded(self, formulas: Mapping[str, Formula], assumed: tuple[Formula, ...]) -> str:
        """As `try_all`, of the steps that recordings of the node show."""
        self.recorded = recorded(self.job, [port.name for port in self.job.node.inputs])
        fault = self.try_all([dict(case) for run in self.recorded.runs for case in run], formulas, assumed)
        self.kept = len(self.compared)
        return fault

    def try_all(
        self,
        cases: Sequence[Mapping[str, Any]],
        formulas: Mapping[str, Formula],
        assumed: tuple[Formula, ...],
        exactly: bool = False,
    ) -> str:
        """Ask CPython, compare with the translation, judge; why nothing counts, if nothing does. Where the plan has
        exact numbers, what is judged are runs on fractions in which no float came in between."""
        if not cases:
            return ""
        subject = self.reading.subject
        if exactly:
            subject = replace(subject, params=_exactly(subject.params))
        replies, fault = self.ask(subject, cases, max(2.0, min(RUN_SECONDS, self.limits.seconds)))
        if fault:
            return fault
        allowed = meets(assumed)
        for case, reply in zip(cases, replies, strict=True):
            if not isinstance(reply, dict) or "steps" not in reply:
                return f"the class cannot be driven: {_reason(reply)}"
            why = self.differs(case, reply) if not exactly else ""
            if why:
                return why
            if self.reading.exact and not (exactly and self.agrees(case, reply)):
                continue
            if allowed(case):
                self.allowed += 1
                answer = seen(self.job.node, self.reading.source.memory, case, reply)
                self.compared += [answer.values] if not answer.wrong else []
                self.judge(answer, formulas)
        if exactly:
            return ""
        self.ran += len(cases)
        self.said["validated"] = {"cases": self.ran, "seed": self.limits.seed}
        return self.try_all([_exactly(case) for case in cases], formulas, assumed, True) if self.reading.exact else ""

    def parted(self, case: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """A case's inputs, and its memory."""
        memory = self.reading.source.memory
        return {n: v for n, v in case.items() if n not in memory}, {n: v for n, v in case.items() if n in memory}

    def ask(self, subject: Subject, cases: Sequence[Mapping[str, Any]], seconds: float) -> tuple[Sequence[Any], str]:
        """CPython's answers, or why none of them counts."""
        asked = [case_of(*self.parted(case)) for case in cases]
        found = ask(subject, asked, seconds=seconds, megabytes=self.limits.megabytes)
        self.observed.update(dict.fromkeys(found.observed))
        self.isolation = min(self.isolation, found.isolation, key=lambda level: level.rank)
        self.silent |= found.silent
        self.deed |= found.deed
        whole = len(found.replies) == len(cases)
        return found.replies, found.fault or ("" if whole else "the class did not answer every case")

    def differs(self, case: Mapping[str, Any], reply: Mapping[str, Any]) -> str:
        """How class and translation differ on a case, bit for bit."""
        step = self.reading.step
        if step is None:
            return ""
        start = {name: coded(value) for name, value in step.start.items()}
        if reply["start"] != {**start, **{a: reply["start"].get(a) for a in step.memory.values()}}:
            return f"class and translation differ in what __init__ makes: {_short(reply['start'])}, not {_short(start)}"
        ours = run(step, *self.parted(case))
        (theirs,) = reply["steps"]
        if theirs["changed"]:
            return f"a step changes {', '.join(theirs['changed'])}, which the text does not show"
        if "error" in theirs or ours.error:
            if theirs.get("error", "") == ours.error:
                return ""
            what = theirs.get("why", "no exception")
            return f"class and translation differ on {_short(case)}: {what}, and {ours.error or 'none'}"
        outputs = {name: coded(value) for name, value in ours.outputs.items()}
        held = {name: coded(v) for name, v in ours.memory.items()}
        if not _same(theirs["value"], outputs) or theirs["memory"] != held:
            return f"class and translation differ on {_short(case)}: {_short(theirs['value'])}, and {_short(outputs)}"
        return ""

    def agrees(self, case: Mapping[str, Any], reply: Mapping[str, Any]) -> bool:
        """Whether CPython's answer on fractions is the translation's, as numbers."""
        step = self.reading.step
        if step is None:
            return False
        ours = run(step, *self.parted(case), exact=True)
        (theirs,) = reply["steps"]
        if ours.error or "error" in theirs:
            return bool(ours.error == theirs.get("error", ""))
        outputs = {name: coded(fraction(v)) for name, v in ours.outputs.items()}
        ours_held = {name: coded(fraction(v)) for name, v in ours.memory.items()}
        held = {name: _in_fractions(v) for name, v in theirs["memory"].items()}
        return _same(_in_fractions(theirs["value"]), outputs) and held == ours_held

    def judge(self, case: Seen, formulas: Mapping[str, Formula]) -> None:
        for name, formula in formulas.items():
            if name in self.broken:
                continue
            if case.wrong:
                self.broken[name] = Counterexample(case.pairs(), f"{case.wrong}: there is no output")
            elif formula.holds(case.values) is False:
                why = f"CPython answers so, and guarantee {formula.name} does not hold of it"
                self.broken[name] = Counterexample(case.pairs(), why)

    def near(self, model: Mapping[Variable, Any]) -> list[dict[str, Any]]:
        """A solver's values as cases of doubles."""
        case: dict[str, Any] = {}
        for port in self.job.node.inputs:
            value = model.get(port.variable)
            plain = _plain(value)
            if plain is None:
                return []
            case[port.name] = plain
        if self.reading.exact:
            return [case]
        return [*beside(case)[:CASES_KEPT], *shifted(case, random.Random(self.limits.seed))]

    # -- outcomes ----------------------------------------------------------------------------------------

    def refuted(self, obligation: Obligation) -> Outcome | None:
        shown = self.broken.get(obligation.id)
        return None if shown is None else Outcome(obligation.id, Verdict.REFUTED, shown.text(), shown)

    def settled(self, obligation: Obligation, found: Found) -> Outcome:
        if found.verdict is not Verdict.PROVED:
            return Outcome(obligation.id, found.verdict, found.why, details=found.details)
        summary = (
            f"{found.conditions} verification conditions of the source proved; "
            f"CPython and their translation agree on {self.ran} inputs, bit for bit"
        )
        if not self.allowed:
            vacuous = "none of the inputs tried meets the assumptions"
            return Outcome(obligation.id, Verdict.PROVED, f"{summary}; but {vacuous}", vacuous=True)
        details = {**found.details, OUTPUT_FOR_EVERY_INPUT: True}
        at = found.details.get("rounded_at_lines")
        lines = at if isinstance(at, list) else []
        return Outcome(obligation.id, Verdict.PROVED, summary, hypotheses=self.hypotheses(lines), details=details)

    def reals(self) -> list[str]:
        """The inputs that are REAL, or sequences of such."""

        def real(sort: object) -> bool:
            return isinstance(sort.item if isinstance(sort, SequenceSort) else sort, RealSort)

        return [p.name for p in self.job.node.inputs if real(p.sort)]

    def hypotheses(self, lines: Sequence[int]) -> tuple[str, ...]:
        """`lines`: where floats would be rounded."""
        names = [f"in.{name}" for name in self.reals()]
        if self.reading.exact:
            at = ", ".join(map(str, lines))
            return (f"{NOT_ROUNDED}: {self.reading.file.name}, line {at}", *self.unkept) if lines else self.unkept
        if not names:
            return self.unkept
        return (f"{NOT_FINITE}: {', '.join(names)}: no NaN, no infinity", *self.unkept)

    def apart(
        self, cases: Sequence[dict[str, Any]], formulas: Mapping[str, Formula], assumed: tuple[Formula, ...]
    ) -> tuple[Outcome, ...]:
        """Where NaN and the infinities are possible: each REAL input in its turn is one, beside a few cases' others. An
        output that is no REAL breaks every guarantee."""
        allowed = meets(assumed)
        asked: list[tuple[dict[str, Any], str, str]] = []
        for case in [c for c in cases if allowed(c)][:APART]:
            for name in self.reals():
                for special in (math.nan, math.inf, -math.inf):
                    held: Any = [special, *case[name][1:]] if isinstance(case[name], list) else special
                    asked.append(({**case, name: held}, name, str(special)))
        replies, fault = self.ask(self.reading.subject, [case for case, _, _ in asked], RUN_SECONDS)
        if fault:
            return self.alike(Verdict.ERROR, fault)
        for (case, name, word), reply in zip(asked, replies, strict=True):
            zero = {**case, name: [0.0, *case[name][1:]] if isinstance(case[name], list) else 0.0}
            answer = seen(self.job.node, self.reading.source.memory, zero, reply)
            pairs = tuple((n, word if n == f"in.{name}" else v) for n, v in answer.pairs())
            for o in self.job.obligations:
                formula = formulas[o.id]
                if o.id in self.broken:
                    continue
                if answer.wrong or formula.compared(answer.values, f"in.{name}", float(word)) is False:
                    why = answer.wrong or f"as IEEE 754 compares, {formula.name} does not hold of it"
                    self.broken[o.id] = Counterexample(pairs, why)
        why = "NaN and the infinities are possible: none that was tried does harm, and nothing is proved of them"
        return tuple(self.refuted(o) or Outcome(o.id, Verdict.UNKNOWN, why) for o in self.job.obligations)


def _plain(value: Any) -> Any:
    match value:
        case None:
            return None
        case Element(name=name):
            return name
        case SequenceValue(items=items):
            return [_plain(item) for item in items]
        case _:  # a number or truth value
            return value


def _same(value: Any, outputs: Mapping[str, Any]) -> bool:
    """Whether what a step returned, coded, is these outputs by name, or the only one of them."""
    given = dict(value["d"]) if isinstance(value, dict) and "d" in value else None
    return given == outputs if given is not None else [value] == list(outputs.values())


def _exactly(data: Any) -> Any:
    """With the fraction that it is in the place of every float."""
    match data:
        case dict():
            return {key: _exactly(value) for key, value in data.items()}
        case list():
            return [_exactly(item) for item in data]
        case _:  # a value
            return fraction(data)


def _in_fractions(data: Any) -> Any:
    match data:
        case {"f": str(text)}:
            number = float.fromhex(text)
            return coded(Fraction(number)) if math.isfinite(number) else data
        case {"d": pairs}:
            return {"d": [[key, _in_fractions(value)] for key, value in pairs]}
        case _:  # no float
            return data


def _reason(reply: Any) -> str:
    return str(reply.get("error", reply) if isinstance(reply, dict) else reply)[:300]


def _short(data: Any) -> str:
    return json.dumps(data, default=str)[:200]
