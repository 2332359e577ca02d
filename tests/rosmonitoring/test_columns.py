"""Columns find what the engine finds: events that are only counted cause no false alarm and hide no breach."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import some

from avow.backends.rosmonitoring.batch import Regions
from avow.backends.rosmonitoring.columns import Columns
from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.options import Setup, setup
from avow.backends.rosmonitoring.session import session
from avow.backends.rosmonitoring.traces import read_trace
from avow.backends.rosmonitoring.watched import Violation
from avow.base.diagnostics import Rejected
from avow.evaluation.evaluate import compile_term
from avow.system.plan import System
from rosmonitoring.test_agreement import MAPPING, RCL, formula, trace


class Counting(Monitor):
    """An engine that counts what it has to judge itself."""

    steps = 0

    def step(self, event: Any, place: int = 0) -> list[Violation]:
        Counting.steps += 1
        return Monitor.step(self, event, place)


def both(found: Setup, path: Path) -> tuple[int, int]:
    """Judge a trace twice; the numbers of violations, and of events that were only counted."""
    plain, fast = Monitor(found), Counting(found)
    Counting.steps = 0
    expected = [(r.line, v) for r in read_trace(path) for v in plain.step(r.event, r.line)]
    expected += [(0, v) for v in plain.finish()]
    heard: dict[str, int] = {}

    def note(topic: str, count: int) -> None:
        heard[topic] = heard.get(topic, 0) + count

    got = [(line, v) for line, all_ in Columns([fast], heard=note).run(path) for v in all_]
    got += [(0, v) for v in fast.finish()]
    assert got == expected
    assert all(v.heard.items() <= w.heard.items() for (_, v), (_, w) in zip(got, expected, strict=True))
    if plain.pairing is not None and fast.pairing is not None:
        assert {**fast.pairing.answered} == {**plain.pairing.answered}
    assert fast.tallies == plain.tallies
    assert (fast.events, fast.relevant, fast.heard) == (plain.events, plain.relevant, plain.heard)
    assert (fast.backwards, fast.values) == (plain.backwards, plain.values)
    assert sum(heard.values()) == fast.events
    assert fast.timing.passages == plain.timing.passages
    return len(got), fast.events - Counting.steps


def setup_of(system: System, node: str = "n") -> Setup:
    found, faults = setup(system, system.contract.node(node), system.plan.node(node).methods[0].options)
    assert not faults
    return found


def written(path: Path, events: list[dict[str, Any]], rng: random.Random) -> Path:
    """As several programs would write them: some with other spaces, other orders, blank lines."""
    styles: list[dict[str, Any]] = [{}, {"separators": (",", ":")}, {"sort_keys": True}]
    lines = []
    for event in events:
        lines.append(json.dumps(event, **(rng.choice(styles) if rng.random() < 0.2 else {})))
        lines += [rng.choice(("", " ", "\r"))] * (rng.random() < 0.02)
    path.write_text("\n".join(lines) + rng.choice(("", "\n")), encoding="utf-8")
    return path


@pytest.mark.slow
@pytest.mark.parametrize("seed", some(range(12), 1))
def test_generated_contracts_are_judged_alike(seed: int, make_system: Callable[..., System], tmp_path: Path) -> None:
    rng = random.Random(seed)
    passed = broken = 0
    for at in range(8):
        when = rng.choice(("outputs", "outputs", "any", "every"))
        answers = rng.choice(({"by": "arrival", "because": "one"}, None))
        fresh = rng.choice(({}, {"in.r": "900 ms", "out.light": "2 s"}))
        rate = rng.choice(({}, {"in.r": "1 Hz ± 50 %", "out.s": "0.9 Hz +- 20 %"}))
        options = {k: v for k, v in (("answers", answers), ("fresh", fresh), ("rate", rate)) if v}
        text = " and ".join(f"({formula(rng, rng.choice((0, 1, 1, 2)))})" for _ in range(2))
        system = make_system(RCL.format(formula=text), MAPPING, when=when, **options)
        events = trace(rng, 400)
        clock = 0.0
        numbers: dict[str, int] = {}
        for event in events:
            clock += rng.choice((0, 0.05, 0.1, 0.1, 0.3)) if rng.random() < 0.995 else -0.5
            event["time"] = round(max(0.0, clock), 2)
            if event["topic"] in ("r", "k", "light"):
                numbers[event["topic"]] = numbers.get(event["topic"], 0) + (
                    1 if rng.random() < 0.98 else rng.choice((0, 3))
                )
                event["header"] = {"seq": numbers[event["topic"]]}
        found, quiet = both(setup_of(system), written(tmp_path / f"{at}.jsonl", events, rng))
        passed += quiet
        broken += found
    assert passed > 300
    assert broken > 20


ANSWERS: list[dict[str, Any]] = [
    {"by": "order", "because": "every link stood"},
    {"by": "key", "input": "id", "output": "id"},
    {"by": "stamp"},
    {"latency": "200 ms", "jitter": "20 ms", "because": "measured"},
]


@pytest.mark.slow
@pytest.mark.parametrize("answers", ANSWERS)
@pytest.mark.parametrize("seed", some(range(12), 1))
def test_paired_answers_are_judged_alike(
    seed: int, answers: dict[str, Any], make_system: Callable[..., System], tmp_path: Path
) -> None:
    """Generated contracts; keys that are missing, doubled, of another form; answers that come first, or late."""
    rng = random.Random(seed)
    passed = broken = 0
    for at in range(3):
        when = rng.choice(("outputs", "outputs", "any"))
        text = " and ".join(f"({formula(rng, rng.choice((0, 1, 1, 2)))})" for _ in range(2))
        assumed = rng.choice(("", f"assume a ( {rng.choice(('in.r <= 2', 'in.k < 4', 'in.colour == red'))} )\n"))
        alone = rng.choice(("", "guarantee alone ( out.s <= 2 or out.light == red )\n"))
        contract = RCL.format(formula=text).replace("  guarantee g", f"  {assumed}  {alone}  guarantee g")
        system = make_system(contract, MAPPING, when=when, answers=answers)
        events = trace(rng, 250)
        clock = 0.0
        counts: dict[str, int] = {}
        for event in events:
            clock += rng.choice((0, 0.01, 0.05, 0.1)) if rng.random() < 0.99 else -0.15
            event["time"] = round(max(0.0, clock), 2)
            number = counts[event["topic"]] = counts.get(event["topic"], 0) + (rng.random() > 0.01)
            event["id"] = event.get("id", number)
            if rng.random() < 0.98:
                stamp = {"secs": number, "nsecs": 0} if rng.random() < 0.9 else {"sec": number, "nanosec": 0}
                event["header"] = {"stamp": stamp}
            if rng.random() < 0.03:
                event["id"] = rng.choice((str(number), float(number), True, None))
        found, quiet = both(setup_of(system), written(tmp_path / f"{at}.jsonl", events, rng))
        passed += quiet
        broken += found
    assert passed > 30
    assert broken > 0


STEADY = """
context { Level : {low, high}; }
node n {
  inputs( r : REAL )
  outputs( s : Level )
  topics( a/R r matches(in.r), a/S s matches(out.s) )
  assume sane ( in.r >= 0 )
  guarantee low ( in.r < 10 -> out.s == low )
  guarantee high ( in.r >= 10 -> out.s == high )
  guarantee some ( out.s == low or out.s == high )
}
"""


@pytest.mark.parametrize("answers", some(ANSWERS, 2, slow=2))
def test_of_paired_answers_hardly_any_is_judged_anew(
    answers: dict[str, Any], make_system: Callable[..., System], tmp_path: Path
) -> None:
    """A fresh reading each time, now and then outside what is assumed; one answer in a hundred is wrong, some come
    before what they answer."""
    rng = random.Random(5)
    system = make_system(STEADY, {"in.r": "value", "out.s": "level"}, answers=answers)
    events = []
    for k in range(1000):
        value = round(rng.uniform(0, 20), 3) if rng.random() > 0.01 else -1.0
        level = "high" if (value >= 10) is not (rng.random() < 0.01) else "low"
        both_ = {"id": k, "header": {"stamp": {"secs": k, "nsecs": 5}}}
        pair = [{"topic": "r", "value": value, **both_}, {"topic": "s", "level": level, **both_}]
        if "latency" not in answers and rng.random() < 0.3:
            pair.reverse()
        events += [
            {**event, "time": round(k / 2 + at * (0.1 if "latency" in answers else 0.005), 3)}
            for at, event in enumerate(pair)
        ]
    found, quiet = both(setup_of(system), written(tmp_path / "t.jsonl", events, random.Random(1)))
    assert found > 10
    assert quiet > 1500


NODE = """
node n {{
  inputs( r : REAL )
  outputs( s : REAL )
  topics( std_msgs/{kind} r matches(in.r), std_msgs/{kind} s matches(out.s) )
  assume sane ( -5 <= in.r <= 400 )
  guarantee low ( out.s <= 120 )
  guarantee kept ( in.r > 250.5 -> out.s !in {{1, 2.5, -3}} )
}}
"""


@pytest.mark.parametrize("kind", ["Float64", "Float32", "Other"])
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_readings_at_the_numbers_that_matter(
    kind: str, seed: int, make_system: Callable[..., System], tmp_path: Path
) -> None:
    """The neighbours of each threshold, in doubles, in floats, and in digits that no double has."""
    rng = random.Random(seed)
    numbers = [
        f"{base}{tail}"
        for base in ("120", "250.5", "1", "2.5", "-3", "-5", "400", "0", "119.99999", "7")
        for tail in ("", "0000000000001" if "." in base else ".0000000000000001", "00001" if "." in base else ".00001")
    ]
    numbers += ["119.9999999999999999999", "1e2", "1.2E+2", "120e0", "-0", "3.5e38", "1e99", "249" * 6]
    lines = []
    for at in range(1500):
        number = rng.choice(numbers) if rng.random() < 0.3 else str(round(rng.uniform(0, 119), 3))
        lines.append(f'{{"topic": "{rng.choice("rs")}", "time": {at / 100}, "data": {number}}}\n')
    path = tmp_path / "t.jsonl"
    path.write_text("".join(lines), encoding="utf-8")
    mapping = {"in.r": "data", "out.s": "data"}
    system = make_system(NODE.format(kind=kind), mapping, ros={"distro": "noetic"})
    found, passed = both(setup_of(system), path)
    assert found > 50
    assert passed > 800


def test_a_region_holds_only_readings_of_one_verdict(make_system: Callable[..., System]) -> None:
    """Doubles are placed exactly, and digits are unsure where their nearest double has another place."""
    text = NODE.format(kind="Float64").replace("{1, 2.5, -3}", "{1, 2.5, -3, 0.1}")
    found = setup_of(make_system(text, {"in.r": "data", "out.s": "data"}))
    formulas = [clause.formula for clause in found.node.clauses]
    regions = Regions.of(found.rules["out.s"], formulas)
    assert regions is not None
    verdicts: dict[int, set[tuple[bool, ...]]] = {}
    rng = random.Random(3)
    readings = []
    for _ in range(3000):
        near = rng.choice((120, 1, 2.5, -3, 0.1, rng.uniform(-1e3, 1e3)))
        readings.append(Fraction(near) + Fraction(rng.choice((0, 1, -1, 3)), 10 ** rng.randrange(1, 20)))
    readings += [
        Fraction(1, 10),
        *(Fraction(math.nextafter(n, end)) for n in (120.0, 1.0, 2.5, -3.0, 0.1) for end in (-9e9, n, 9e9)),
    ]
    nearest = np.array([float(reading) for reading in readings])
    unsure = regions.unsure(nearest)
    for reading, double, place, odd in zip(readings, nearest, regions.places(nearest), unsure, strict=True):
        assert regions.place(Fraction(double)) == place
        assert odd or regions.place(reading) == place
        values = {"in.r": Fraction(300), "out.s": reading}
        verdicts.setdefault(regions.place(reading), set()).add(tuple(bool(compile_term(f)(values)) for f in formulas))
    assert len(verdicts) == regions.count == 11
    assert all(len(each) == 1 for each in verdicts.values())


def test_a_variable_that_is_calculated_with_has_no_regions(make_system: Callable[..., System]) -> None:
    text = NODE.format(kind="Float64").replace("out.s <= 120", "out.s + in.r <= 120")
    found = setup_of(make_system(text, {"in.r": "data", "out.s": "data"}))
    formulas = [clause.formula for clause in found.node.clauses]
    assert Regions.of(found.rules["out.s"], formulas) is None
    assert Regions.of(found.rules["in.r"], formulas) is None


def test_the_case_study_is_judged_alike(case_folder: Path, tmp_path: Path) -> None:
    """Laps of the nominal run, which break guarantees from the second on, with fresh readings."""
    from avow.system.load import load_system

    system = load_system(case_folder)
    rng = random.Random(1)
    nominal = (case_folder / "traces/nominal.jsonl").read_text(encoding="utf-8").splitlines()
    lines = []
    for line in nominal * 12:
        event = json.loads(line)
        if event["topic"] == "r":
            event["radiation"] = rng.randrange(30, 2600) / 10
        lines.append(json.dumps(event))
    path = tmp_path / "laps.jsonl"
    path.write_text("\n".join(lines), encoding="utf-8")
    slow, fast = session(system), session(system)
    expected = [(r.line, v) for r in read_trace(path) for v in slow.step(r.event)]
    expected += [(len(lines), v) for v in slow.finish()]
    assert list(fast.run(path)) == expected
    assert fast.summary() == slow.summary()
    assert len(expected) > 100


PLACES = """
context { Place : REAL x REAL --> BOOL; Cause : { near(REAL), far(REAL) }; }
node n {
  inputs( at : Place, cause : Cause )
  outputs( s : REAL, last : REAL )
  topics( a/P at matches(in.at), a/C cause matches(in.cause), a/S s matches(out.s), a/L last matches(out.last) )
  assume near_enough ( forall(x, y in REAL | in.at(x, y) -> x + y <= 7) )
  guarantee low ( out.s <= 4 )
  guarantee beside ( forall(x, y in REAL | in.at(x, y) -> out.s + y <= 9) )
  guarantee told ( in.cause == near(5) -> out.s <= 3 )
  guarantee ended ( out.last + 1 <= 6 )
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("seed", some(range(12), 3))
def test_whatever_a_path_leads_to_is_looked_at(seed: int, make_system: Callable[..., System], tmp_path: Path) -> None:
    """Items from the front and from the end, fields within fields, under `data`, of the event's own names; topics with
    a slash and without."""
    rng = random.Random(seed)
    forms = ["x", "ys[-1]", "ys[0]", "ys[-2]", "p.x", "ps[-1].x", "ps[1].ys[-1]", "time", "topic"]

    def number() -> float:
        return rng.choice((0.5, 1.5, 5.0)) if rng.random() < 0.9 else rng.choice((3.5, 6.5))

    def message() -> dict[str, Any]:
        own = {"x": number(), "ys": [number(), number()], "p": {"x": number()}}
        return {**own, "ps": [{"x": number()}, {"x": number(), "ys": [number()]}], "what": rng.choice(("near", "far"))}

    passed = broken = 0
    for at in range(3):
        one, two = rng.sample(forms, 2)
        mapping = {"in.at": [one, two], "out.s": rng.choice(forms), "out.last": rng.choice(forms)}
        mapping["in.cause"] = {"constructor": "what", "near": [rng.choice(forms)], "far": [rng.choice(forms)]}
        events: list[dict[str, Any]] = []
        body = {topic: message() for topic in ("at", "cause", "s", "last")}
        for k in range(250):
            topic = rng.choice([*body])
            if rng.random() < 0.2:
                body[topic] = {**body[topic], **{key: message()[key] for key in rng.sample([*body[topic]], 1)}}
            told = {"topic": number(), "time": number()} if rng.random() < 0.02 else {"topic": 1.5, "time": 0.5}
            inside = rng.random() < 0.5
            events.append(
                {
                    **({} if inside else body[topic]),
                    "data": {**told, **(body[topic] if inside else {})},
                    "topic": rng.choice(("", "/")) + topic,
                    "time": k / 10,
                }
            )
        found, quiet = both(
            setup_of(make_system(PLACES, mapping, when="any")), written(tmp_path / f"{at}.jsonl", events, rng)
        )
        passed += quiet
        broken += found
    assert passed > 40
    assert broken > 10


@pytest.mark.parametrize(
    ("second", "words"),
    [
        ('{"topic": "s", "time": 1, "data": 1', "not JSON"),
        ('{"topic": "s", "time": -1, "data": 1}', "negative"),
        ('{"topic": "s", "time": 01, "data": 1}', "not JSON"),
        ('{"topic": "s", "time": 1, "data": 1.}', "not JSON"),
        ('{"topic": "s", "time": 1, "data": 1} x', "not JSON"),
        ('{"topic": "s", "time": 1, "data": +1}', "not JSON"),
        ('{"topic": "s", "time": "1", "data": 1}', "no number of seconds"),
        ('{"time": 1, "data": 200}', "no `topic`"),
    ],
)
def test_what_is_no_event_is_told_after_many_that_are(
    second: str, words: str, make_system: Callable[..., System], tmp_path: Path
) -> None:
    found = setup_of(make_system(NODE.format(kind="Other"), {"in.r": "data", "out.s": "data"}))
    path = tmp_path / "t.jsonl"
    path.write_text('{"topic": "s", "time": 1, "data": 1}\n' * 50 + second + "\n", encoding="utf-8")
    monitor = Monitor(found)
    with pytest.raises(Rejected, match=words) as error:
        list(Columns([monitor]).run(path))
    (fault,) = error.value.diagnostics
    assert fault.span is not None
    assert fault.span.line == 51
