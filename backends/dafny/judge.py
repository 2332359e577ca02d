"""From Dafny's answers to a verdict for each guarantee.

Proved only if all of this holds: the file refines the generated specification and assumes nothing without proof (our
scan and Dafny's own complaints agree); every method and lemma that it declares, and Step and EnvNotEmpty among them, is
in the answer; everything in the answer is correct; and the printed count of errors is 0. Anything less is not a proof.

The condition Env is read from the program that Dafny prints once it has resolved all names, in the implementation's
module; that an Env that reads `true` excludes nothing is also proved, for the name as a module of Avow's own resolves
it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import field, replace

from avow.backend_kit.protocol import Limits
from avow.base.plain import ALLOWS_MORE
from avow.base.records import dataclass
from avow.base.verdict import Verdict
from avow.evidence.record import OUTPUT_FOR_EVERY_INPUT, SOLVER
from avow.isolation.outside import Outside

from .answer import Member
from .history import FIRST
from .modules import ANYWAY, BY_ENV, CALL, ENV_ALWAYS, EXCLUDED_FILE, PROBE_FILE, Generated, without_env_always
from .runner import Audit, Run, audit, verify
from .scanner import Scan, resolved_environment
from .tuning import PROBLEMS_SHOWN

_FINISHED = re.compile(r"Dafny program verifier finished with (\d+) verified, (\d+) errors?(.*)")


@dataclass(frozen=True, slots=True)
class Settled:
    verdict: Verdict
    summary: str
    hypotheses: tuple[str, ...] = ()
    details: Mapping[str, object] = field(default_factory=dict)
    vacuous: bool = False


@dataclass(frozen=True, slots=True)
class Judgement:
    verdicts: Mapping[str, Settled]
    """By guarantee; those that are not covered are left out."""
    command: tuple[str, ...]
    logs: Mapping[str, str]


def settle(generated: Generated, scanned: Scan, shown_name: str, limits: Limits, outside: Outside) -> Judgement:
    """Run Dafny and judge each guarantee. `shown_name` is the implementation's name in messages.

    Raises ToolMissing, OSError.
    """
    guarantees = tuple(name for _, name in generated.ensures)
    asks = scanned.environment != "true"
    files = _files(generated, scanned, guarantees, asks)
    run = verify(files, limits, outside)
    logs = {"verify.log": run.output}

    def alike(settled: Settled) -> Judgement:
        return Judgement(dict.fromkeys(guarantees, settled), run.command, logs)

    broken = _broken(run, scanned, generated, shown_name)
    if broken is not None:
        return alike(broken)
    audited = audit(files, limits, outside)
    logs["audit.log"] = audited.output
    taken = _taken_for_granted(audited, scanned, generated, shown_name)
    if taken is None:
        return alike(Settled(Verdict.ERROR, "Dafny did not say what the implementation leaves open", (), {}))
    environment = _environment(run, scanned, generated)
    lacking = _lacking(run.members or (), scanned, generated, environment)
    if lacking:
        return alike(Settled(Verdict.ERROR, f"missing: {'; '.join(lacking)}", taken))
    if asks != (environment != "true"):
        text = f"Env is not what it seems: {scanned.environment} in the file, {environment} for Dafny"
        return alike(Settled(Verdict.ERROR, text, taken))
    unproved = dict.fromkeys(guarantees, _unproved(run))
    spared = _spared(run, generated)
    if spared:
        # Only other guarantees failed. Dafny assumes a reported condition before it continues, so these are run
        # again without those.
        again = verify(_files(generated, scanned, spared, asks), limits, outside)
        logs["verify-again.log"] = again.output
        if _broken(again, scanned, generated, shown_name) is None:
            left = _unproved(again) or tuple(_lacking(again.members or (), scanned, generated, environment))
            unproved |= dict.fromkeys(spared, left)
    about_nothing: frozenset[str] = frozenset()
    unasked: frozenset[str] = frozenset()
    if environment != "true" and generated.conditions and not all(unproved.values()):
        answer = verify(_asked_of_env(files, generated), limits, outside)
        logs["excluded.log"] = answer.output
        unasked, about_nothing = _about_nothing(answer, generated)
    verdicts = {name: _verdict(unproved[name], taken, environment, scanned, generated) for name in guarantees}
    for name in unasked & {n for n, settled in verdicts.items() if settled.verdict is Verdict.PROVED}:
        text = f"proved, but Dafny does not answer whether Env ({environment}) excludes its condition"
        verdicts[name] = replace(verdicts[name], verdict=Verdict.UNKNOWN, summary=text)
    for name in about_nothing & {n for n, settled in verdicts.items() if settled.verdict is Verdict.PROVED}:
        text = f"vacuous: where Env holds ({environment}), what it is about never comes about"
        verdicts[name] = replace(verdicts[name], summary=text, vacuous=True)
    return Judgement(verdicts, run.command, logs)


def _verdict(
    unproved: tuple[str, ...],
    taken: tuple[str, ...],
    environment: str | None,
    scanned: Scan,
    generated: Generated,
) -> Settled:
    members = [name for _, name in scanned.members]
    details: dict[str, object] = {SOLVER: "z3", "module": generated.impl_module, "members": members}
    if unproved:
        details["not proved"] = list(unproved)
        return Settled(Verdict.UNKNOWN, f"not proved: {_few(unproved)}", taken, details)
    if taken:
        return Settled(
            Verdict.UNKNOWN, f"proved only if what it takes for granted holds: {_few(taken)}", taken, details
        )
    if environment != "true" and generated.remembers:
        why = "whether inputs can meet it for ever is not asked: make it an assumption of the contract"
        return Settled(Verdict.UNKNOWN, f"proved only where Env holds ({environment}); {why}", taken, details)
    added: tuple[str, ...] = ()
    summary = f"Step of {generated.impl_module} meets it for all inputs that meet the assumptions"
    if environment != "true":
        added = (f"added assumption of the implementation, Env: {environment}",)
        summary += " and Env"
    details[OUTPUT_FOR_EVERY_INPUT] = True  # the inputs that Env excludes are a hypothesis
    return Settled(Verdict.PROVED, summary, added, details)


def _broken(run: Run, scanned: Scan, generated: Generated, shown_name: str) -> Settled | None:
    """A run without an answer."""
    if run.timed_out:
        return Settled(Verdict.UNKNOWN, f"dafny did not end within its time limit; {ALLOWS_MORE}")
    printed = _FINISHED.search(run.output)
    if run.members is not None and printed is not None and run.code in (0, 4):
        return None
    failed = [c for c in run.complaints if c.message.startswith("Error")]
    errors = [f"{_name(c.file, generated, shown_name)}:{c.line}: {c.message}" for c in failed]
    count = run.counted or len(errors)
    problems = [what for _, what in scanned.problems]
    details: dict[str, object] = {"errors": errors, "problems": problems}
    if errors:
        summary = f"Dafny rejects it with {count} error{'s' if count != 1 else ''}: {_few(errors)}"
    else:
        last = [line for line in run.output.splitlines() if line.strip()][-1:]
        summary = f"dafny ended with code {run.code} and without a readable answer: {_few(last)}"
    return Settled(Verdict.ERROR, "; ".join([summary, *problems[:PROBLEMS_SHOWN]]), (), details)


def _taken_for_granted(audited: Audit, scanned: Scan, generated: Generated, shown_name: str) -> tuple[str, ...] | None:
    """The implementation's assumptions, by our scan and by Dafny's own report; None without such a report."""
    if audited.complaints is None:
        return None
    found = [f"{shown_name}:{line}: {what}" for line, what in scanned.hypotheses]
    # The generated types leave the partial operations undefined on purpose (see `modules`); nothing else may be.
    found += [
        f"{_name(c.file, generated, shown_name)}:{c.line}: {c.message}"
        for c in audited.complaints
        if c.file != generated.types_file
    ]
    return tuple(dict.fromkeys(found))


def _environment(run: Run, scanned: Scan, generated: Generated) -> str | None:
    """The body of Env: Dafny's own, if this version prints it; else as in the file, in the module itself."""
    if run.resolved is None:
        return scanned.environment
    return resolved_environment(run.resolved, generated.impl_module)


def _lacking(members: tuple[Member, ...], scanned: Scan, generated: Generated, environment: str | None) -> list[str]:
    """Members that are missing from the answer: Dafny does not report a method without a body."""
    there = {(m.module, m.name) for m in members if (m.kind, m.scope) == ("Impl", "_default")}
    names = {m.name for m in members if m.kind == "Impl"}
    found = [what for _, what in scanned.problems]
    own = [(generated.impl_module, n) for n in (*generated.lemmas, "Step")] + [(generated.probe_module, CALL)]
    own += [(generated.probe_module, FIRST)] if generated.remembers else []
    if environment == "true":
        own.append((generated.probe_module, ENV_ALWAYS))
    found += [f"no answer about {name}" for module, name in own if (module, name) not in there]
    found += [f"no answer about {kind} {name}" for kind, name in scanned.members if name not in names]
    if environment is None:
        found.append("predicate Env has no body")
    return list(dict.fromkeys(found))


def _unproved(run: Run) -> tuple[str, ...]:
    """Everything that is not proved, in words; empty only if all is proved."""
    found = []
    for member in run.members or ():
        if member.outcome == "correct" and not member.failures:
            continue
        what = f"{member.module}.{member.name}"
        if not member.failures:
            found.append(f"{what}: {member.outcome or 'no outcome'}")
        for failure in member.failures:
            found.append(f"{what}, line {failure.line}: {failure.message}")
    printed = _FINISHED.search(run.output)
    clean = printed is not None and int(printed[2]) == 0 and not printed[3].strip() and int(printed[1]) > 0
    if not found and not (clean and run.code == 0):
        found.append(f"dafny says: {printed[0] if printed else 'nothing'} (code {run.code})")
    return tuple(dict.fromkeys(found))


def _spared(run: Run, generated: Generated) -> tuple[str, ...]:
    """The guarantees that may still hold: all failures are `ensures` of Step, and theirs is not among them."""
    lines = dict(generated.ensures)
    failed = set()
    for member in run.members or ():
        if member.outcome == "correct" and not member.failures:
            continue
        if member.outcome != "errors" or (member.module, member.name) != (generated.impl_module, "Step"):
            return ()
        for failure in member.failures:
            places = {line for file, line in failure.related if file == generated.spec_file}
            if "postcondition" not in failure.message or len(places) != 1 or not places <= set(lines):
                return ()
            failed |= {lines[line] for line in places}
    return tuple(name for name in lines.values() if name not in failed) if failed else ()


def _only(text: str, ensures: Sequence[tuple[int, str]], guarantees: tuple[str, ...]) -> str:
    """A generated text with the `ensures` of some guarantees; every line keeps its number."""
    lines = text.split("\n")
    for number, name in ensures:
        if name not in guarantees:
            lines[number - 1] = ""
    return "\n".join(lines)


def _files(generated: Generated, scanned: Scan, guarantees: tuple[str, ...], asks: bool) -> dict[str, str]:
    """Dafny's input files. `asks`: whether Env, as in the file, excludes anything. A file that cannot be an
    implementation is not called from outside: then Dafny's complaints are only about the file."""
    probe = _only(generated.probe, generated.probe_ensures, guarantees)
    files = {
        generated.types_file: generated.types,
        generated.contract_file: generated.contract,
        generated.spec_file: _only(generated.spec, generated.ensures, guarantees),
        generated.impl_file: scanned.text,
    }
    return files if scanned.problems else {**files, PROBE_FILE: without_env_always(probe) if asks else probe}


def _asked_of_env(files: Mapping[str, str], generated: Generated) -> dict[str, str]:
    """Dafny's input files to determine what Env excludes."""
    head, end, _ = files[generated.contract_file].rpartition("}")
    whole = f"{head}{generated.situations}{end}\n"
    return {**files, generated.contract_file: whole, EXCLUDED_FILE: generated.excluded}


def _about_nothing(run: Run, generated: Generated) -> tuple[frozenset[str], frozenset[str]]:
    """The guarantees for whose conditions there is no answer, and those for which Dafny proves that Env excludes a
    condition that the contract alone does not exclude."""
    outcomes = {m.name: m.outcome for m in run.members or () if m.kind == "Impl"}
    answers = [
        (name, outcomes.get(f"{BY_ENV}{k}"), outcomes.get(f"{ANYWAY}{k}"))
        for k, name in enumerate(generated.conditions)
    ]
    return (
        frozenset(name for name, by_env, anyway in answers if by_env is None or anyway is None),
        frozenset(name for name, by_env, anyway in answers if by_env == "correct" and anyway not in (None, "correct")),
    )


def _name(file: str, generated: Generated, shown_name: str) -> str:
    return shown_name if file == generated.impl_file else file


def _few(items: tuple[str, ...] | list[str]) -> str:
    more = f"; and {len(items) - PROBLEMS_SHOWN} more" if len(items) > PROBLEMS_SHOWN else ""
    return "; ".join(items[:PROBLEMS_SHOWN]) + more
