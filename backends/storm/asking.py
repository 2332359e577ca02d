"""Runs Storm, in a process of its own: `python asking.py MODEL` reads questions from its input and prints answers.

It imports nothing of Avow. All numbers are exact fractions, as texts.
"""

from __future__ import annotations

import json
import sys
from fractions import Fraction
from typing import Any


def main(path: str) -> None:
    import stormpy

    asked = json.load(sys.stdin)
    program = stormpy.parse_prism_program(path)
    texts = [text for each in asked for text in (each["prop"], each["number"]) if text]
    parsed = {text: stormpy.parse_properties(text, program)[0] for text in texts}
    options = stormpy.BuilderOptions([each.get_raw_formula() for each in parsed.values()])
    options.set_build_all_labels()
    options.set_build_all_reward_models()
    options.set_build_state_valuations()
    model = stormpy.build_model[stormpy.Rational](program, options=options)
    states = range(model.nr_states)
    labels = [model.get_labels_of_state(state) for state in states]
    initial = [int(state) for state in model.initial_states]
    choices = [[[(e.column, Fraction(str(e.value))) for e in a.transitions] for a in s.actions] for s in model.states]
    if any(sum(p for _, p in choice) != 1 for own in choices for choice in own):
        raise SystemExit("the probabilities of a command do not add up to 1")  # Storm accepts that
    answers = []
    for each in asked:
        truth = stormpy.model_checking(model, parsed[each["prop"]])
        among = initial if each["initial"] else states
        true = truth.get_truth_values_vector()
        answer: dict[str, Any] = {"holds": all(true.get(state) for state in among)}
        if each["number"]:
            found = stormpy.model_checking(model, parsed[each["number"]])
            answer["number"] = str(min(Fraction(str(found.get_value(state))) for state in among))
        if each["least"]:
            answer |= _worst(choices, labels, each["given"], each["kept"])
        elif not answer["holds"]:
            wrong = [each["kept"] not in own and (not each["given"] or each["given"] in own) for own in labels]
            answer["run"] = _run(choices, initial, wrong)
        answer["unmet"] = [when for when in each["whens"] if not any(when in own for own in labels)]
        answers.append(answer)
    shown = {state for answer in answers for state in answer.get("run", ())}
    shown |= {answer["state"] for answer in answers if "state" in answer}
    values = {state: _values(model.state_valuations, state) for state in shown}
    size = {"states": model.nr_states, "transitions": model.nr_transitions}
    print(json.dumps({"answers": answers, "values": values, **size}))


def _worst(choices: Any, labels: Any, given: str, kept: str) -> dict[str, Any]:
    """The least probability, over all states and choices, of `kept` among next states that are `given`."""
    worst, at = Fraction(1), None
    for state, own in enumerate(choices):
        for choice in own:
            among = sum((p for to, p in choice if given in labels[to]), Fraction(0))
            met = sum((p for to, p in choice if kept in labels[to]), Fraction(0))
            if among and met / among < worst:
                worst, at = met / among, state
    return {"worst": str(worst), **({"state": at} if at is not None else {})}


def _run(choices: Any, initial: list[int], wrong: list[bool]) -> list[int]:
    """A shortest run to a state that is `wrong`."""
    before: dict[int, int | None] = dict.fromkeys(initial)
    waiting = list(initial)
    for state in waiting:
        if wrong[state]:
            run: list[int] = []
            at: int | None = state
            while at is not None:
                run.insert(0, at)
                at = before[at]
            return run
        for to in {to for choice in choices[state] for to, p in choice if p and to not in before}:
            before[to] = state
            waiting.append(to)
    return []


def _values(valuations: Any, state: int) -> dict[str, str]:
    return {name: json.dumps(value) for name, value in json.loads(str(valuations.to_json(state))).items()}


if __name__ == "__main__":
    main(sys.argv[1])
