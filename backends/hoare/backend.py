"""The Hoare backend: triples from a guarantee, proved of a small program by weakest preconditions."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from avow.backend_kit.given import summarized
from avow.backend_kit.protocol import Job, Limits, Report
from avow.backend_kit.stepping import Stepping
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.persons import unreadable, wrong_day
from avow.base.plain import count, is_blank
from avow.base.records import dataclass
from avow.base.verdict import Counterexample, Link, Outcome, Verdict
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.evidence.obligation import Obligation
from avow.evidence.record import OUTPUT_FOR_EVERY_INPUT
from avow.formulas.formula import conjunction, free_variables, negation
from avow.formulas.values import show
from avow.language.terms import FALSE, Not, Role, Term, Variable
from avow.solving.checking import z3_version
from avow.solving.limits import effort_told, from_seconds, spent, until
from avow.solving.questions import Entailment, entails
from avow.solving.second import CONTRADICTED, contradicted
from avow.solving.settling import Settler
from avow.solving.smtlib import formulas_script
from avow.solving.translation import Unsupported, new_session

from .memory import knowing, remembered
from .program import While, statements
from .triples import Triple, one_line
from .tuning import BRIEFLY_SECONDS
from .witness import Breach, breach
from .work import Work, left_unassigned, load, other_numbers, run_conditions
from .wp import Condition, TooLarge, conditions

GIVEN = frozenset({Verdict.PROVED, Verdict.PARTIAL, Verdict.JUSTIFIED})
"""What an obligation whose triples are proved gets: whether its loops are shown to end makes the difference."""


def problems(job: Job) -> tuple[Diagnostic, ...]:
    """What is wrong with the plan's options, the program, or a guarantee that the program has nothing for."""
    try:
        work = load(job)
        _ = work.triples
    except Rejected as rejected:
        return rejected.diagnostics
    clauses = (*job.node.assumptions, *(job.clause(o) for o in job.obligations))
    return (*_undated(job), *other_numbers(work.checked.program, clauses), *left_unassigned(work))


def _undated(job: Job) -> tuple[Diagnostic, ...]:
    accepted = Accepted.of(job)
    if accepted is None:
        return ()
    why, day = unreadable(accepted.who), wrong_day(accepted.until, past=False)
    wrong = {
        "who": f"names no person: {why}" if why else "",
        "because": "is blank" if is_blank(accepted.because) else "",
        "until": f"is no day: {day} (write it as 2027-06-30)" if day else "",
    }
    places = job.method.options
    return tuple(
        Diagnostic("HOARE400", f"termination.{key} {message}", places.at("termination", key))
        for key, message in wrong.items()
        if message
    )


# -- export ------------------------------------------------------------------------------------------------------------


@new_session()
def files(job: Job) -> Mapping[str, str]:
    """Triples and verification conditions of every obligation; nothing where the job is at fault."""
    try:
        work = load(job)
        all_triples = work.triples
    except Rejected:
        return {}
    made: dict[str, str] = {}
    for name, condition in work.firsts.items():
        made[f"{name}.first.smt2"] = _script(work.every_run, condition)
    for found in (*all_triples.values(), work.kept):
        for triple in found:
            made[f"{file_stem(triple.name)}.hoare"] = _triple_text(triple, work)
            with contextlib.suppress(TooLarge, RecursionError):  # the verdict says so
                for condition in conditions(triple, work.checked.program.body):
                    made[f"{file_stem(triple.name)}.{condition.name}.smt2"] = _script(triple, condition)
    with contextlib.suppress(TooLarge, RecursionError):
        for condition in run_conditions(work.every_run, work.checked.program):
            made[f"every-run.{condition.name}.smt2"] = _script(work.every_run, condition)
    return made


def file_stem(name: str) -> str:
    """What the names of a triple's files begin with."""
    return "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "_" for c in name)


def _triple_text(triple: Triple, work: Work) -> str:
    body = work.text.rstrip("\n")
    return f"{{{one_line(triple.full_pre)}}}\n{body}\n{{{one_line(triple.post)}}}\n"


def _script(triple: Triple, condition: Condition) -> str:
    """`unsat` means that the condition holds."""
    formulas = {f"H{k}": h for k, h in enumerate(condition.hypotheses, start=1)}
    try:
        return formulas_script(
            {**formulas, "goal": Not(condition.goal)},
            comment=f"{triple.name}: {condition.what}; valid if unsat",
        )
    except Unsupported as error:
        return f"; not expressible in SMT-LIB: {' '.join(error.what.split())}\n"


# -- discharge ---------------------------------------------------------------------------------------------------------


def settle(job: Job, limits: Limits) -> Report:
    """One outcome for each obligation."""
    version = f"z3 {z3_version()}"
    try:
        work = load(job)
        work.settler.seed = limits.seed
        found = work.triples
    except Rejected as rejected:
        return Report.alike(job, Verdict.ERROR, summarized(job, rejected.diagnostics), "weakest preconditions", version)
    logs: dict[str, str] = {}
    shown: Mapping[str, Outcome] = {}
    if work.steps is not None:
        work, shown = _remembered(work, work.steps, limits, logs)
        found = work.triples
    outcomes = tuple(shown.get(o.id) or _obligation(o, found[o.id], work, limits, logs) for o in job.obligations)
    open_ = {o.verdict for o in outcomes} & {*GIVEN, Verdict.UNKNOWN}
    if open_:
        # where nothing is proved that would rest on it, it is worth a look but not the time of another guarantee
        seconds = limits.seconds if open_ & GIVEN else min(limits.seconds, BRIEFLY_SECONDS)
        running = _settled(_every_run, work.every_run, work, until(from_seconds(seconds)))
        logs["every-run.log"] = f"{running.verdict} - {running.why}\n"
        if running.verdict is Verdict.REFUTED:  # it settles also what the guarantee's own triples leave open
            worse = {*GIVEN, Verdict.UNKNOWN}
        else:
            worse = set(GIVEN) if running.verdict is not Verdict.PROVED else set()
        outcomes = tuple(_stopped(o, running, work) if o.verdict in worse else _total(o, work) for o in outcomes)
    allowed = effort_told(from_seconds(limits.seconds))
    outcomes = tuple(replace(o, details={**o.details, **allowed}) for o in outcomes)
    return Report(outcomes, "weakest preconditions", version, logs=logs)


def _remembered(
    work: Work, steps: Stepping, limits: Limits, logs: dict[str, str]
) -> tuple[Work, Mapping[str, Outcome]]:
    """The work with all invariants that were found to hold, and the refutations that runs from the start have shown."""
    deadline = until(from_seconds(limits.seconds))
    clauses = [work.job.clause(o) for o in work.job.obligations]
    seen, found = remembered(steps, work.checked, clauses, lambda c: _holds(c, work.settler, deadline))
    texts = [one_line(each.formula) for each in found.invariants]
    logs["invariants.log"] = "\n".join((*(f"holds: {text}" for text in texts), *found.lacking)) + "\n"
    known = replace(work, job=knowing(work.job, steps, found.invariants), lacking=found.lacking)
    known.settler.seed = work.settler.seed
    link = Link.MAPPED if work.checked.reading.mapped else Link.GENERATED
    refuted: dict[str, Outcome] = {}
    for obligation in work.job.obligations:
        run = seen.broken.get(obligation.name) or seen.fault
        if run is not None:
            trace = run.shown(steps.own)
            values = Counterexample(trace[-1], run.why, tuple(trace) if len(trace) > 1 else ())
            refuted[obligation.id] = Outcome(obligation.id, Verdict.REFUTED, values.text(), values, link=link)
    return known, refuted


@dataclass(frozen=True, slots=True)
class Settled:
    """What was found of one triple."""

    triple: Triple
    verdict: Verdict
    why: str
    breach: Breach | None = None
    vacuous: str = ""
    """Why the triple says nothing of the program, if it does not."""
    conditions: int = 0


def _obligation(
    obligation: Obligation, found: Sequence[Triple], work: Work, limits: Limits, logs: dict[str, str]
) -> Outcome:
    deadline = until(from_seconds(limits.seconds))
    settled = [_settled(_triple, triple, work, deadline) for triple in found]
    log = [f"{s.triple.name}: {s.verdict} - {s.why}{f' ({s.vacuous})' if s.vacuous else ''}" for s in settled]
    logs[f"{file_stem(found[0].name)}.log" if found else f"{obligation.digest[:12]}.log"] = "\n".join(log) + "\n"
    worst = next(
        (s for v in (Verdict.REFUTED, Verdict.ERROR, Verdict.UNKNOWN) for s in settled if s.verdict is v), None
    )
    link = Link.MAPPED if work.checked.reading.mapped else Link.GENERATED
    details: dict[str, object] = {
        "triples": [
            {
                "name": s.triple.name,
                "pre": one_line(s.triple.full_pre),
                "post": one_line(s.triple.post),
                "verdict": str(s.verdict),
                "vacuous": s.vacuous,
            }
            for s in settled
        ]
    }
    if worst is not None:
        shown = _counterexample(worst, work) if worst.breach is not None else None
        summary = f"{worst.triple.name}: {worst.why}"
        return Outcome(obligation.id, worst.verdict, summary, shown, link=link, details=details)
    vacuous = bool(settled) and all(s.vacuous for s in settled)
    conditions = count(sum(s.conditions for s in settled), "verification condition")
    summary = f"{count(len(settled), 'Hoare triple')} proved: {conditions}"
    if vacuous:
        summary += f"; but {settled[0].vacuous}"
    endings = _termination(work)
    accepted = Accepted.of(work.job) if endings else None
    verdict = Verdict.PROVED
    if accepted is not None:
        verdict = Verdict.JUSTIFIED
        summary = f"partial correctness, {summary}; {accepted.text}"
        details |= {"who": accepted.who, "valid_until": accepted.until}
    elif endings:
        verdict = Verdict.PARTIAL
        summary = f"partial correctness, {summary}; not shown: {'; '.join(endings)}"
    return Outcome(
        obligation.id,
        verdict,
        summary,
        hypotheses=(*work.checked.reading.hypotheses, *endings),
        details=details,
        link=link,
        vacuous=vacuous,
    )


def _every_run(triple: Triple, work: Work, deadline: float) -> Settled:
    """Whether the program runs to its end on every input that is allowed. Where a loop has no variant, or one that is
    not shown to fall, it is run on some: one on which it comes back to the same state is refuted."""
    program = work.checked.program
    wanted = run_conditions(triple, program)
    failed = [c for c in wanted if not _holds(c, work.settler, deadline)]
    shown = None
    if not work.steps and (failed or _termination(work)):
        shown = breach(triple, program, failed, max(1000, _left(deadline)))
    if shown is not None:
        return Settled(triple, Verdict.REFUTED, f"{shown.why}: on this input there is no output", shown)
    if failed:
        why = "not shown that the program has an output for every input that the assumptions allow"
        return Settled(triple, Verdict.UNKNOWN, f"{why}: {failed[0].what}")
    return _proved(Settled(triple, Verdict.PROVED, "proved", conditions=len(wanted)), wanted, deadline)


def _proved(settled: Settled, wanted: Sequence[Condition], deadline: float, impossible: Term = FALSE) -> Settled:
    """What Z3 has proved; an error where a second solver finds values for which a condition fails, or such as are
    `impossible` where the triple is vacuous."""
    broken = [conjunction((*c.hypotheses, negation(c.goal))) for c in wanted]
    if contradicted([impossible, *broken], effort=_left(deadline)):
        return Settled(settled.triple, Verdict.ERROR, CONTRADICTED)
    return settled


def _holds(condition: Condition, settler: Settler, deadline: float) -> bool:
    return settler.proves(condition.hypotheses, condition.goal, effort=_left(deadline))


def _total(outcome: Outcome, work: Work) -> Outcome:
    """A current proof also shows that the same program has an output for every input, if each path assigns it."""
    if outcome.verdict is not Verdict.PROVED or work.checked.unassigned:
        return outcome
    return replace(outcome, details={**outcome.details, OUTPUT_FOR_EVERY_INPUT: True})


def _stopped(outcome: Outcome, running: Settled, work: Work) -> Outcome:
    """In place of an answer of the guarantee's own triples, where some run has no output."""
    shown = _counterexample(running, work) if running.breach is not None else None
    return replace(
        outcome, verdict=running.verdict, summary=running.why, counterexample=shown, hypotheses=(), vacuous=False
    )


@dataclass(frozen=True, slots=True)
class Accepted:
    """A person's word, in the plan, that a program's loops end."""

    because: str
    who: str
    until: str

    @classmethod
    def of(cls, job: Job) -> Accepted | None:
        match job.options.get("termination"):
            case {"because": because, "who": who, "until": until}:
                return cls(str(because), str(who), str(until))
        return None

    @property
    def text(self) -> str:
        return f"that its loops end {self.who} accepts until {self.until}: {self.because}"


def _termination(work: Work) -> tuple[str, ...]:
    """Loops without a variant: the triple is about runs that end."""
    return tuple(
        f"the loop at line {s.span.line} of {Path(s.span.file).name} terminates"
        for s in statements(work.checked.program.body)
        if isinstance(s, While) and s.variant is None
    )


def _settled(how: Callable[[Triple, Work, float], Settled], triple: Triple, work: Work, deadline: float) -> Settled:
    try:
        return how(triple, work, deadline)
    except TooLarge as error:
        return Settled(triple, Verdict.UNKNOWN, str(error))
    except RecursionError:
        return Settled(triple, Verdict.UNKNOWN, "its formulas are nested too deeply for this method")


def _triple(triple: Triple, work: Work, deadline: float) -> Settled:
    program = work.checked.program
    wanted = conditions(triple, program.body)
    failed: list[tuple[Condition, Entailment]] = []
    for condition in wanted:
        if work.settler.settles(condition.hypotheses, condition.goal, effort=_left(deadline)) == "unsat":
            continue
        answer = entails(condition.hypotheses, condition.goal, effort=_left(deadline), seed=work.settler.seed)
        if answer.verdict is not Verdict.PROVED:
            failed.append((condition, answer))
    if not failed:
        vacuous, impossible = _vacuous(triple, work, deadline)
        if not vacuous and _endless(triple, work, deadline):
            why = "its loops never end where it applies, and a node that never answers guarantees nothing"
            return Settled(triple, Verdict.UNKNOWN, why)
        proved = Settled(triple, Verdict.PROVED, "proved", None, vacuous, len(wanted))
        return _proved(proved, wanted, deadline, impossible)
    condition, answer = failed[0]
    if work.steps is not None:  # what breaks it may be a memory to which no run comes
        why = f"{condition.what}: not shown of every memory that is known to be possible; an invariant may be missing"
        return Settled(triple, Verdict.UNKNOWN, "; ".join((why, *work.lacking)))
    shown = breach(triple, program, [c for c, _ in failed], max(1000, _left(deadline)))
    if shown is not None:
        return Settled(triple, Verdict.REFUTED, shown.why, shown)
    if answer.verdict is Verdict.REFUTED and condition.name != "pre":
        why = f"{condition.what}: not so; the invariant may be too weak, for no run was found that breaks the triple"
    elif answer.verdict is Verdict.REFUTED:
        why = f"{condition.what}: the solver says no, but no run of the program shows it"
    else:
        why = f"{condition.what}: {answer.reason or 'no answer'}"
    return Settled(triple, Verdict.UNKNOWN, why)


def _vacuous(triple: Triple, work: Work, deadline: float) -> tuple[str, Term]:
    """A triple that every program meets says nothing of this one: why it is one (or nothing), and what was proved to
    be impossible. An invariant says something of the program."""
    settler, alone = work.settler, work.alone.get(triple.name)
    if settler.settles([triple.pre], triple.post, effort=min(2000, _left(deadline))) == "sat":
        return "", FALSE  # and then some input meets the precondition too
    if settler.proves([triple.pre], FALSE, effort=min(2000, _left(deadline))):
        return f"no input meets the precondition {one_line(triple.pre)}", triple.pre
    denied = conjunction((triple.pre, negation(triple.post)))
    if alone is not None and not settler.proves([alone.pre], alone.post, effort=min(2000, _left(deadline))):
        return "", FALSE
    if settler.proves([triple.pre], triple.post, effort=min(2000, _left(deadline))):
        return "it holds whatever a program does: it says nothing of this one", denied
    return "", FALSE


def _endless(triple: Triple, work: Work, deadline: float) -> bool:
    """Whether no run from the precondition ends: "terminates" would be a hypothesis that is known to be false."""
    if not _termination(work):
        return False
    return all(
        work.settler.proves(c.hypotheses, c.goal, effort=min(2000, _left(deadline)))
        for c in conditions(replace(triple, post=FALSE), work.checked.program.body)
    )


def _left(deadline: float) -> int:
    return max(100, min(20_000, int(deadline - spent())))


def _counterexample(settled: Settled, work: Work) -> Counterexample:
    """The breach in the contract's words, and then in the program's where it has more to say."""
    assert settled.breach is not None
    shown = settled.breach
    values: list[tuple[str, str]] = []
    mapped: set[Variable] = set()
    for role, ports, state in (
        (Role.INPUT, work.job.node.inputs, shown.start),
        (Role.OUTPUT, work.job.node.outputs, shown.end),
    ):
        for port in ports:
            term = work.checked.reading.terms.get((role, port.name))
            if term is None or state is None:
                continue
            try:
                values.append((f"{role}.{port.name}", show(evaluate(term, state))))
            except NotEvaluable:
                continue
            if isinstance(term, Variable):
                mapped.add(term)
    spoken = free_variables(conjunction((settled.triple.pre, settled.triple.post)))
    for variable in sorted(spoken - mapped - frozenset(work.checked.program.assigned), key=lambda v: v.name):
        if variable.name in shown.start and variable not in work.checked.program.ghosts.values():
            values.append((variable.name, show(shown.start[variable.name])))
    return Counterexample(tuple(values), settled.breach.why)
