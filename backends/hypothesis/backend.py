"""Running the generated test in a process of its own, and reading its answer."""

from __future__ import annotations

import pickle
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from importlib import metadata
from pathlib import Path

from avow.backend_kit.given import summarized
from avow.backend_kit.protocol import Job, Limits, Report
from avow.base.codec import document
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.percent import at_most
from avow.base.plain import ALLOWS_MORE
from avow.base.process import Completed, ToolMissing
from avow.base.tuning.running import WALL
from avow.base.verdict import Counterexample, Object, Outcome, Verdict, bound
from avow.evaluation.evaluate import evaluate
from avow.evidence.obligation import Obligation
from avow.evidence.record import CASE, RETRY
from avow.isolation import judge
from avow.isolation.level import Unavailable, available
from avow.language.contract import Clause, Node
from avow.solving.replay import opaque_sorts

from . import callbacks, export
from .convention import ANY, EXACT
from .exchange import QUESTION, Answer, Question, Tried
from .export import GeneratedTest
from .judging import MEANING, failure_bound
from .subject import subject
from .tuning import CONFIDENCE, REJECTED_CASES


def problems(job: Job) -> tuple[Diagnostic, ...]:
    try:
        found = subject(job)
        if callbacks.wanted(job):
            return callbacks.problems(job)
        GeneratedTest(job, found).files()
    except Rejected as rejected:
        return rejected.diagnostics
    except RecursionError:
        return (Diagnostic("HYPO105", "a formula of this node is nested too deeply to be tested", job.node.span),)
    return ()


def files(job: Job) -> Mapping[str, str]:
    return {} if callbacks.wanted(job) or problems(job) else GeneratedTest(job, subject(job)).files()


def settle(job: Job, folder: Path, limits: Limits) -> Report:
    """One outcome for each obligation."""
    version = f"hypothesis {metadata.version('hypothesis')}"
    try:
        available()
    except Unavailable as missing:
        return Report.unsealed(job, missing, "hypothesis", version)
    found = problems(job)
    if found:
        return Report.alike(job, Verdict.ERROR, summarized(job, found), "hypothesis", version)
    if callbacks.wanted(job):
        return callbacks.settle(job, limits, version)
    done, answer = _run(GeneratedTest(job, subject(job)), limits)
    command = ("pytest", export.test_name(job))
    logs = {"hypothesis.log": done.stdout + done.stderr} if done and (done.stdout + done.stderr).strip() else {}
    if answer is None:
        why = _silence(done, limits)
        verdict = Verdict.UNKNOWN if done is not None and done.timed_out else Verdict.ERROR
        return replace(Report.unanswered(job, verdict, why, "hypothesis", version), command=command, logs=logs)
    if answer.guarantees.keys() != {o.name for o in job.obligations}:
        return Report.unanswered(job, Verdict.ERROR, "the judge's answer is of other guarantees", "hypothesis", version)
    refuting = export.numbers(job) == ANY
    exact = export.numbers(job) == EXACT
    outcomes = tuple(
        _counted(_outcome(o, answer, limits.seed, export.cases(job), refuting, exact), job.clause(o), job.node)
        for o in job.obligations
    )
    if answer.crash_trace is not None:
        numbers = "exact" if exact else "float64"
        outcomes = tuple(replace(o, of=Object.SOURCE, numbers=numbers) for o in outcomes)
    logs["result.json"] = document(replace(answer, observed=())) + "\n"
    return Report(outcomes, "hypothesis", version, command, logs, answer.observed, answer.isolation)


def _question(test: GeneratedTest) -> Question:
    job, unit = test.job, test.subject
    fixed = export.constants(job, unit)
    return Question(
        test=export.test_name(job),
        root=job.root.resolve(),
        subject=replace(unit, path=unit.path.resolve()),
        constants={p.name: evaluate(p.value, {}) for p in fixed if p.value is not None},
        cases=export.cases(job),
        length=test.steps,
        numbers=export.numbers(job),
        names=test.names,
        inputs=test.inputs,
        outputs=test.outputs,
        assumptions=job.node.assumptions,
        begins=job.begins if unit.driven else (),
        guarantees=test.guarantees,
        untranslated=test.untranslated(),
        kept=tuple(tuple(case if isinstance(case, list) else [case]) for cases in job.kept.values() for case in cases),
    )


def _run(test: GeneratedTest, limits: Limits) -> tuple[Completed | None, Answer | None]:
    """The result of Avow's run of the generated test, if it completed."""
    with tempfile.TemporaryDirectory(prefix="avow-") as scratch:
        # the export is written afresh: a file changed in between would be tested instead of the contract
        place = Path(scratch)
        for name, text in test.files().items():
            (place / name).write_text(text, encoding="utf-8")
        (place / QUESTION).write_bytes(pickle.dumps(_question(test)))
        (place / "run.py").write_text("from avow.backends.hypothesis.running import main\n\nmain()\n", encoding="utf-8")
        try:
            return judge.ask(
                Answer,
                "run.py",
                [str(max(1.0, limits.seconds * 0.8)), str(limits.seed)],
                cwd=place,
                seconds=limits.seconds * WALL,
                megabytes=limits.megabytes,
                env={
                    "HYPOTHESIS_STORAGE_DIRECTORY": str(place / ".hypothesis"),
                    "PYTHONDONTWRITEBYTECODE": "",  # or every run would compile the same modules
                    "PYTHONHASHSEED": "0",
                },
            )
        except ToolMissing:
            return None, None


def _silence(done: Completed | None, limits: Limits) -> str:
    if done is None:
        return "Python could not be started"
    if done.timed_out:
        return f"the test did not end within {limits.seconds * WALL:g} s; {ALLOWS_MORE}"
    last = done.stderr.strip().splitlines()[-1:] or ["no message"]
    return f"the test ended without a result (code {done.code}): {last[0][:300]}"


def _outcome(obligation: Obligation, answer: Answer, seed: int, wanted: int, refuting: bool, exact: bool) -> Outcome:
    own = answer.guarantees[obligation.name]
    bound: dict[str, object] = {"cases": answer.valid, "rejected": answer.rejected, "seed": seed}
    details: dict[str, object] = {"triggers": [{"trigger": t.trigger, "met": t.cases} for t in own.triggers]}
    if answer.left_out:
        details["left out"] = list(answer.left_out)
    outcome = Outcome(obligation.id, Verdict.UNKNOWN, "", bound=bound, details=details)
    if own.failure is not None:
        why = f"guarantee {obligation.name} does not hold of these{_inexact(own.failure) if exact else ''}"
        shown = Counterexample(own.failure, why, own.trace)
        details[CASE] = own.case
        return replace(outcome, verdict=Verdict.REFUTED, summary=shown.text(), counterexample=shown)
    if answer.silent:  # regardless of other findings: the unit might have answered
        why = f"{answer.silent}: that says nothing of what it would answer, and the next run asks again"
        return replace(outcome, verdict=Verdict.ERROR, summary=why, details={**details, RETRY: True})
    if answer.fault:
        return replace(outcome, verdict=Verdict.ERROR, summary=answer.fault)
    if answer.crash is not None:
        shown = Counterexample(*answer.crash)
        # a class that raises has no output for inputs that the contract allows; a function may be unfit for testing
        verdict = Verdict.REFUTED if answer.crash_trace else Verdict.ERROR
        return replace(outcome, verdict=verdict, summary=shown.text(), counterexample=shown)
    apart = [Counterexample(case, why) for case, why in answer.apart]
    if apart:
        details["no numbers"] = [one.text() for one in apart]
    if apart and refuting:
        return replace(outcome, verdict=Verdict.REFUTED, summary=apart[0].text(), counterexample=apart[0])
    if answer.unsteady is not None:
        case = ", ".join(f"{name} = {value}" for name, value in answer.unsteady)
        why = f"undeclared input: another process, asked the same again or often, answers otherwise ({case})"
        return replace(outcome, summary=why)
    why = _doubt(answer, own, wanted)
    if why:
        return replace(outcome, summary=why)
    unmet = [t.trigger for t in own.triggers if not t.cases]
    if unmet:
        why = f"in none of {answer.valid} cases was its condition met: {unmet[0]}"
        return replace(outcome, summary=why, vacuous=True)
    return _tested(outcome, answer, own, wanted, seed)


def _tested(outcome: Outcome, answer: Answer, own: Tried, wanted: int, seed: int) -> Outcome:
    """The outcome if no case violates it, with the bound that so many cases justify."""
    # steps of one run depend on each other if the contract remembers: then runs are counted
    counted = answer.valid if answer.runs is None else answer.runs
    hits = [t.cases if answer.runs is None else t.in_runs for t in own.triggers]
    least = min(hits, default=counted)
    bound = {**outcome.bound, "confidence": CONFIDENCE, "failure_probability_below": failure_bound(counted)}
    if hits:
        bound["triggered"] = least
        bound["failure_probability_when_triggered_below"] = failure_bound(least)
    replayed = f", {answer.replayed} that once refuted a guarantee of this node" if answer.replayed else ""
    if answer.replayed:
        bound["replayed"] = answer.replayed
    what = "cases" if answer.runs is None else "runs"
    like = f"{what} like the {least} that met its condition" if least < counted else f"such {what}"
    chance = f"95 %: at most {at_most(failure_bound(least))} of {like} fail"
    cases = f"{answer.valid} drawn cases"
    if answer.runs is not None:
        bound["runs"] = counted
        cases = f"{counted} drawn run{'s'[: counted != 1]} of {answer.valid} steps"
    summary = f"{cases}{replayed}, none breaks it (seed {seed}; {chance})"
    if answer.valid < wanted:
        summary += f"; the generator has no more than these, of {wanted} wanted"
    details = {**outcome.details, "meaning": MEANING}
    return replace(outcome, verdict=Verdict.TESTED, summary=summary, bound=bound, details=details)


def _counted(outcome: Outcome, clause: Clause, node: Node) -> Outcome:
    """Elements of unspecified types are invented, by the cases and by the program: there may be fewer, or others."""
    sorts = {sort for c in (clause, *node.assumptions) for sort in opaque_sorts(c.formula)}
    if outcome.verdict is not Verdict.TESTED or not sorts:
        return outcome
    names = " and ".join(sorted(sort.name for sort in sorts))
    text = f"{names}: an unspecified type has the elements that the cases and the subject's answers name, and no fewer"
    made = bound(f"type.{'-'.join(sorted(sort.name for sort in sorts))}", text)
    return replace(outcome, rests_on=(*outcome.rests_on, made))


def _doubt(answer: Answer, own: Tried, wanted: int) -> str:
    """Why the cases do not count, if they do not."""
    valid, rejected = answer.valid, answer.rejected
    if valid == 0 or answer.stopped == "assumptions" or (valid < wanted and rejected > REJECTED_CASES * valid):
        return f"the assumptions are met too rarely: {valid} of {valid + rejected} generated inputs"
    if answer.stopped == "time" and valid < wanted:
        return f"only {valid} of {wanted} cases in the time given"
    if answer.stopped in ("time", "again"):
        return "the time ended before the subject was asked again whether another process answers the same"
    if own.undecided:
        return f"{own.undecided} of {valid} cases could not be judged"
    if answer.undecided:
        return f"of {answer.undecided} generated inputs it could not be told whether they meet the assumptions"
    return ""


def _inexact(values: Sequence[tuple[str, str]]) -> str:
    """A note on a number that differs from its Python float: a program may compare the two wrongly."""
    for name, text in values:
        if name.startswith("in.") and re.fullmatch(r"-?[0-9]+\.[0-9]+", text) and Fraction(text) != float(text):
            return f"; {name} is exactly {text}, and the float {text} is another number: see `numbers:`"
    return ""
