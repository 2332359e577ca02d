"""From Storm's answers to verdicts.

Storm answers each property and gives its number. For a probability per step, the least probability is computed a second
time, from the transitions that Storm built. A verdict needs all of them to agree.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

from avow.backend_kit.protocol import Job, Limits, Report
from avow.base import process
from avow.base.files import write
from avow.base.plain import count, decimal
from avow.base.verdict import Counterexample, Outcome, Verdict
from avow.evidence.record import LIKELY
from avow.language.contract import Clause

from .options import Given
from .tuning import STATES_SHOWN
from .writing import ASSUMED, TYPED, Asked, Written, label, written

_ASKING = Path(__file__).with_name("asking.py")


def written_of(job: Job, given: Given) -> Written:
    """Raises NoCounterpart if an assumption has none."""
    return written(given, (job.clause(o) for o in job.obligations), job.node.assumptions)


def settle(job: Job, given: Given, folder: Path, limits: Limits, version: str) -> Report:
    """Raises NoCounterpart if an assumption has none."""
    made = written_of(job, given)
    questions = [
        {
            "prop": each.prop,
            "number": each.number,
            "initial": each.least is None,
            "given": each.given,
            "kept": each.kept,
            "least": str(each.least or ""),
            "whens": list(each.whens),
        }
        for each in made.asked
    ]
    path = folder / "node.prism"
    write(path, made.model)
    command = (sys.executable, "-I", str(_ASKING), str(path.resolve()))
    done = process.run(command, seconds=limits.seconds, megabytes=limits.megabytes, stdin=json.dumps(questions))
    logs = {"storm.log": f"{done.stdout}\n{done.stderr}"}
    if done.timed_out or done.code != 0:
        lines = [line for line in done.stderr.splitlines() if line.strip()]
        why = (
            f"Storm took more than {limits.seconds:g} s" if done.timed_out else f"Storm failed: {(lines or ['?'])[-1]}"
        )
        verdict = Verdict.UNKNOWN if done.timed_out else Verdict.ERROR
        outcomes = tuple(Outcome(o.id, verdict, why) for o in job.obligations)
        return Report(outcomes, "storm", version, logs=logs)
    found = json.loads(done.stdout.splitlines()[-1])
    answers = {each.name: (each, answer) for each, answer in zip(made.asked, found["answers"], strict=True)}
    states = {int(state): _shown(values, given) for state, values in found["values"].items()}
    outcomes = tuple(_outcome(o.id, job.clause(o), made, answers, states, found["states"]) for o in job.obligations)
    return Report(outcomes, "storm", version, logs=logs)


_State = tuple[tuple[str, str], ...]


def _outcome(
    name: str,
    clause: Clause,
    made: Written,
    answers: Mapping[str, tuple[Asked, Mapping[str, Any]]],
    states: Mapping[int, _State],
    size: int,
) -> Outcome:
    if clause.name in made.refused:
        return Outcome(name, Verdict.UNKNOWN, made.refused[clause.name])
    for of, verdict, why in (
        (TYPED, Verdict.ERROR, "a port has no value of its type"),
        (ASSUMED, Verdict.UNKNOWN, "an assumption is broken, so the model leaves the use that the contract allows"),
    ):
        if not answers[of][1]["holds"]:
            return Outcome(name, verdict, f"in a state that the model reaches, {why}: {_text(answers[of][1], states)}")
    asked, answer = answers[label(clause.name)]
    number, holds = Fraction(answer["number"]), bool(answer["holds"])
    bound: dict[str, object] = {"states": size}
    chance = clause.chance
    if asked.least is None:
        agreed = holds == (number >= (1 if chance is None else chance.least))
        first, text = answer, f"it holds in all states of a run with probability {_number(number)}"
    else:
        first = answers[f"{asked.name}_first"][1]
        worst = Fraction(answer["worst"])
        agreed = holds == (number >= 1) == (worst >= asked.least)
        number = worst if first["holds"] else Fraction(0)
        holds = holds and bool(first["holds"])
        text = f"the least probability of a step is {_number(number)}"
    if not agreed:
        return Outcome(name, Verdict.ERROR, "Storm's answers contradict one another")
    text = f"{count(size, 'state')}: {text}"
    bound["probability"] = str(number)
    if holds:
        unmet = dict.fromkeys(asked.whens[when] for when in answer["unmet"])
        rests = ("the model has the probabilities and choices of the node in its use",)
        summary = f"{text}; no state meets {' or '.join(unmet)}" if unmet else text
        details: dict[str, object] = {} if chance is None else {LIKELY: str(chance.least)}
        return Outcome(
            name, Verdict.CHECKED, summary, bound=bound, hypotheses=rests, vacuous=bool(unmet), details=details
        )
    return Outcome(name, Verdict.REFUTED, text, _counterexample(clause, answer, first, states, number), bound=bound)


def _counterexample(
    clause: Clause, answer: Mapping[str, Any], first: Mapping[str, Any], states: Mapping[int, _State], number: Fraction
) -> Counterexample:
    if first.get("run"):
        run = tuple(states[state] for state in first["run"])[-STATES_SHOWN:]
        return Counterexample(run[-1], f"guarantee {clause.name} does not hold", run if len(run) > 1 else ())
    said = f"after this step, guarantee {clause.name} holds with probability {_number(number)} only"
    return Counterexample(states[answer["state"]], said)


def _text(answer: Mapping[str, Any], states: Mapping[int, _State]) -> str:
    return Counterexample(states[answer["run"][-1]]).text() or "see the log"


def _shown(values: Mapping[str, str], given: Given) -> _State:
    """The ports that are variables of the model; its other variables are in parentheses."""
    ports = {bound.name: (name, bound) for name, bound in given.ports.items()}
    found = []
    for variable, value in values.items():
        name, bound = ports.get(variable, (f"({variable})", None))
        if bound is not None and bound.values and int(value) in bound.values:
            value = bound.port.sort.members[bound.values.index(int(value))]  # type: ignore[union-attr]
        found.append((name, value))
    return tuple(sorted(found, key=lambda pair: pair[0].startswith("(")))


def _number(value: Fraction) -> str:
    return decimal(value) or f"{value} (about {float(value):.4g})"
