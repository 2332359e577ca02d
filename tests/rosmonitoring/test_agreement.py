"""The key test: on generated contracts and traces the RML text, our engine and a brute-force reading agree.

Three programs that share no evaluation code: the RML file is read back by our grammar and executed by an interpreter of
RML's semantics; the engine runs compiled clauses; the brute force below rebuilds each snapshot from the events so far
and lets quantifiers range over every value that occurs and some that do not.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

import pytest
from helpers import some
from oracle.domains import as_written
from oracle.rml import Interpreter
from reference.meaning import Meaning

from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.options import setup
from avow.backends.rosmonitoring.rml.translate import translate
from avow.backends.rosmonitoring.watched import Fault
from avow.language.sorts import NATURAL, REAL
from avow.language.terms import Term, Variable
from avow.system.plan import System

RCL = """
context {{
  Colour : {{red, green}};
  Command : {{ move(REAL), tell(NATURAL, Colour), stop }};
  Place : REAL x NATURAL --> BOOL;
  Marks : NATURAL --> BOOL;
}}
node n {{
  inputs( r : REAL, k : NATURAL, colour : Colour, command : Command, at : Place, last : Marks, done : Marks )
  outputs( flag : BOOL, s : REAL, marks : Marks, light : Colour )
  topics( a/R r matches(in.r), a/K k matches(in.k), a/C colour matches(in.colour), a/D command matches(in.command),
          a/P at matches(in.at), a/F flag matches(out.flag), a/S s matches(out.s), a/M marks matches(out.marks),
          a/L light matches(out.light), a/X done matches(in.done) )
  guarantee g ( {formula} )
}}
"""

MAPPING: dict[str, Any] = {
    "in.r": "data",
    "in.k": "value.k",
    "in.colour": {"field": "level", "values": {"0": "green", "rouge": "red"}},
    "in.command": {"constructor": "what", "move": ["to"], "tell": ["to", "c"], "values": {"halt": "stop"}},
    "in.at": ["x", "id"],
    "in.last": {"previous": "out.marks", "initial": []},
    "out.flag": {"field": "on", "initial": True},
    "out.s": {"field": "data", "initial": -1.5},
    "out.marks": ["id"],
    "out.light": "light",
    "in.done": {"fields": ["id"], "hold": "seen", "initial": [[2]]},
}


# -- formulas, as text -------------------------------------------------------------------------------------------------


def formula(rng: random.Random, depth: int, reals: tuple[str, ...] = (), naturals: tuple[str, ...] = ()) -> str:
    def real() -> str:
        plain = ("in.r", "out.s", "0", "1", "2.5", "(0 - 1.5)", *reals, *reals)
        if rng.random() < 0.15:
            calls = ("min({}, {})", "max({}, {})", "(if out.flag then {} else {})")
            return rng.choice(calls).format(rng.choice(plain), rng.choice(plain))
        return rng.choice(plain)

    def natural() -> str:
        plain = ("in.k", "0", "1", "in.k + 1", *naturals, *naturals)
        if rng.random() < 0.15:
            calls = ("min({}, {})", "max({}, {})", "abs({})", "(if in.colour == red then {} else {})", "mod({}, 2)")
            return rng.choice(calls).format(rng.choice(plain), rng.choice(plain))
        return rng.choice(plain)

    def colour() -> str:
        return rng.choice(("red", "green", "in.colour", "out.light", "(if out.flag then red else in.colour)"))

    if depth == 0:
        order = rng.choice(("<", "<=", ">", ">=", "==", "!="))
        return rng.choice(
            (
                f"{real()} {order} {real()}",
                f"{natural()} {order} {natural()}",
                f"{colour()} {rng.choice(('==', '!='))} {colour()}",
                f"{colour()} in {{red}}",
                f"in.command == move({real()})",
                f"in.command != tell({natural()}, {colour()})",
                "in.command == stop",
                f"in.at({real()}, {natural()})",
                f"out.marks({natural()})",
                f"in.last({natural()})",
                f"in.done({rng.choice(('0', '1', '2', natural()))})",
                "out.flag",
                "out.flag == FALSE",
            )
        )

    def sub(more_reals: tuple[str, ...] = (), more_naturals: tuple[str, ...] = ()) -> str:
        return f"({formula(rng, depth - 1, (*reals, *more_reals), (*naturals, *more_naturals))})"

    x, n = f"x{len(reals)}", f"n{len(naturals)}"
    return rng.choice(
        (
            lambda: f"{sub()} and {sub()}",
            lambda: f"{sub()} or {sub()}",
            lambda: f"{sub()} -> {sub()}",
            lambda: f"{sub()} <=> {sub()}",
            lambda: f"not {sub()}",
            lambda: f"xor({sub()}, {sub()})",
            lambda: f"if {sub()} then {sub()} else {sub()}",
            lambda: f"forall({x} in REAL | (in.command == move({x})) -> {sub((x,))})",
            lambda: f"exists({x} in REAL, {n} in NATURAL | in.at({x}, {n}) and {sub((x,), (n,))})",
            lambda: f"forall({n} in NATURAL | (out.marks({n}) <=> in.last({n})) or {sub((), (n,))})",
            lambda: f"forall({n} in NATURAL | out.marks({n}) -> (in.last({n}) or {sub((), (n,))}))",
            lambda: f"exists_unique({x} in REAL, {n} in NATURAL | in.at({x}, {n}) and {sub((x,), (n,))})",
            lambda: f"exists({n} in NATURAL | {sub((), (n,))})",
        )
    )()


# -- traces ------------------------------------------------------------------------------------------------------------


def trace(rng: random.Random, length: int) -> list[dict[str, Any]]:
    def number() -> Any:
        return rng.choice((0, 1, 2.5, -1.5, 7))

    def small() -> int:
        return rng.choice((0, 1, 2))

    def message() -> dict[str, Any]:
        topic = rng.choice(("r", "k", "colour", "command", "at", "flag", "s", "marks", "light", "done", "other"))
        body: dict[str, Any]
        match topic:
            case "r" | "s":
                return {"topic": topic, "data": number()}
            case "k":
                body = {"value": {"k": small()}}
            case "colour":
                body = {"level": rng.choice(("red", "green", 0, "rouge"))}
            case "command":
                body = rng.choice(
                    (
                        {"what": "move", "to": number()},
                        {"what": "tell", "to": small(), "c": rng.choice(("red", "green"))},
                        {"what": "halt"},
                        {"what": "stop"},
                    )
                )
            case "at":
                body = {"x": number(), "id": small()}
            case "flag":
                body = {"on": rng.random() < 0.5}
            case "marks" | "done":
                body = {"id": small()}
            case "light":
                body = {"light": rng.choice(("red", "green"))}
            case _:
                body = {"anything": [1]}
        if rng.random() < 0.02:
            body = dict.fromkeys(body, "nonsense")
        return {"topic": topic, "data": body} if rng.random() < 0.3 else {"topic": topic, **body}

    return [{**message(), "time": k / 10} for k in range(length)]


# -- brute force -------------------------------------------------------------------------------------------------------

UNREADABLE = "unreadable"
Snapshot = dict[str, Any]


def read(event: Mapping[str, Any]) -> tuple[str, Any] | None:
    """(variable, value): numbers as Fraction, elements as strings, commands as tuples, relations as sets of tuples."""
    body = event["data"] if isinstance(event.get("data"), dict) else event
    try:
        match event["topic"]:
            case "r":
                return "in.r", real(event["data"])
            case "s":
                return "out.s", real(event["data"])
            case "k":
                return "in.k", whole(body["value"]["k"])
            case "colour":
                return "in.colour", {"red": "red", "rouge": "red", "green": "green", 0: "green"}[body["level"]]
            case "light":
                return "out.light", {"red": "red", "green": "green"}[body["light"]]
            case "command":
                match body["what"]:
                    case "move":
                        return "in.command", ("move", real(body["to"]))
                    case "tell":
                        colour = {"red": "red", "green": "green"}[body["c"]]
                        return "in.command", ("tell", whole(body["to"]), colour)
                    case "halt" | "stop":
                        return "in.command", ("stop",)
                return "in.command", UNREADABLE
            case "at":
                return "in.at", {(real(body["x"]), whole(body["id"]))}
            case "marks":
                return "out.marks", {(whole(body["id"]),)}
            case "done":
                return "in.done", {(whole(body["id"]),)}
            case "flag":
                return "out.flag", body["on"] if isinstance(body["on"], bool) else UNREADABLE
            case _:
                return None
    except (KeyError, TypeError, ValueError):
        names = {"r": "in.r", "s": "out.s", "k": "in.k", "colour": "in.colour", "command": "in.command"}
        names |= {"at": "in.at", "marks": "out.marks", "flag": "out.flag", "light": "out.light"}
        names["done"] = "in.done"
        return names[event["topic"]], UNREADABLE


def real(raw: Any) -> Fraction:
    if isinstance(raw, bool) or not isinstance(raw, int | float):
        raise ValueError
    return Fraction(str(raw))


def whole(raw: Any) -> Fraction:
    if real(raw).denominator != 1 or raw < 0:
        raise ValueError
    return real(raw)


REALS = {Fraction(v, 2) for v in (-5, -3, -1, 0, 1, 2, 4, 5, 8, 14, 17)}
NATURALS = {Fraction(v) for v in range(5)}
"""Large enough for these formulas: every value that occurs in them and in the traces, one between each two neighbours,
and one beyond each end."""
MEANING = Meaning(ranges={REAL: REALS, NATURAL: NATURALS})


def brute_force(system: System, events: list[dict[str, Any]], when: str = "outputs") -> int | None:
    """The index (from 1) of the first event that breaks the guarantee or cannot be read, by the definition."""
    clause = system.contract.node("n").guarantees[0]
    mentioned = names_of(clause.formula)
    needed = mentioned | ({"out.marks"} if "in.last" in mentioned else set())
    outputs = {n for n in mentioned if n.startswith("out.")}
    triggers = mentioned - {"in.last"} if when == "every" else outputs or mentioned - {"in.last"}
    triggers = triggers or {"out.marks"}
    awaited = triggers if when == "outputs" and any(n.startswith("out.") for n in triggers) else set()
    fresh: set[str] = set()
    snapshot: Snapshot = {"out.flag": True, "out.s": Fraction(-3, 2), "in.last": set()}
    snapshot["in.done"] = {(Fraction(2),)}
    for index, event in enumerate(events, start=1):
        update = read(event)
        if update is None:
            continue
        name, content = update
        if content == UNREADABLE:
            if name in needed:
                return index
            if name != "in.done":
                snapshot.pop(name, None)
            continue
        snapshot[name] = snapshot[name] | content if name == "in.done" else content
        fresh |= {name} & triggers
        due = name in triggers and awaited <= fresh
        if due:
            fresh = set()
        judged = due and mentioned <= snapshot.keys()
        if judged and not MEANING.met(as_written(clause), [snapshot]):
            return index
        if "out.marks" in awaited and len(awaited) > 1:
            if due:
                snapshot["in.last"] = snapshot["out.marks"]  # of the answer that has just been judged
        elif name == "out.marks":
            snapshot["in.last"] = content
    return None


def names_of(term: Term) -> set[str]:
    from avow.language.terms import Role

    found = {term.qualified} if isinstance(term, Variable) and term.role is not Role.BOUND else set()
    for child in term.children:
        found |= names_of(child)
    return found


# -- the comparison ----------------------------------------------------------------------------------------------------


def flat(event: dict[str, Any]) -> dict[str, Any]:
    """As ROSMonitoring sends it: the message's fields beside its topic."""
    inside = event.get("data")
    return {**event, **inside} if isinstance(inside, dict) else event


def first_rejected(text: str, events: list[dict[str, Any]]) -> int | None:
    monitor = Interpreter(text)
    for index, event in enumerate(events, start=1):
        if monitor.step(flat(event)) == "false":
            return index
    return None


def first_reported(system: System, events: list[dict[str, Any]], needed: set[str]) -> int | None:
    found, faults = setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)
    assert not faults
    monitor = Monitor(found)
    for event in events:
        for violation in monitor.step(event):
            if "whatever the rest" in violation.explanation:  # of answers that are not whole, RML says nothing
                continue
            if violation.fault is not Fault.MAPPING or violation.clause in needed:
                return violation.index
    assert monitor.tallies["g"].undecided == 0
    return None


@pytest.mark.slow
@pytest.mark.parametrize("seed", some(range(5), 2))
def test_rml_engine_and_brute_force_agree(seed: int, make_system: Callable[..., System]) -> None:
    rng = random.Random(seed)
    translated = broken = clean = 0
    for _ in range(10):
        text = formula(rng, rng.choice((1, 2, 2, 3)))
        when = rng.choice(("outputs", "outputs", "any", "every"))
        system = make_system(RCL.format(formula=text), MAPPING, when=when)
        node = system.contract.node("n")
        found, _ = setup(system, node, system.plan.node("n").methods[0].options)
        made = translate(found, node.guarantees)
        mentioned = names_of(node.guarantees[0].formula)
        needed = mentioned | ({"out.marks"} if "in.last" in mentioned else set())
        for _ in range(4):
            events = trace(rng, 30)
            expected = brute_force(system, events, when) if mentioned - {"in.last"} or mentioned else None
            if mentioned:
                assert first_reported(system, events, needed) == expected, (text, events)
            if not made.refused:
                assert first_rejected(made.text, events) == expected, (text, made.text, events)
                translated += 1
                broken += expected is not None
                clean += expected is None
    assert translated >= 12
    assert broken >= 3
    assert clean >= 2


def test_the_interpreter_notices_a_changed_threshold(make_system: Callable[..., System]) -> None:
    """A control: a wrong translation does not pass the comparison."""
    system = make_system(RCL.format(formula="in.r < 2.5 -> out.flag"), MAPPING)
    node = system.contract.node("n")
    found, _ = setup(system, node, system.plan.node("n").methods[0].options)
    text = translate(found, node.guarantees).text
    events = [{"topic": "r", "data": 2.4}, {"topic": "flag", "on": False}]
    assert first_rejected(text, events) == 2
    assert "2.5" in text
    assert first_rejected(text.replace("2.5", "2.3"), events) is None


@pytest.mark.parametrize(
    ("when", "first"),
    [("outputs", 7), ("any", 4), ("every", 4)],
)
def test_several_outputs_are_judged_together(when: str, first: int, make_system: Callable[..., System]) -> None:
    """A node that publishes the parts of an answer one after the other has not broken a guarantee in between."""
    system = make_system(RCL.format(formula="out.flag <=> out.light == green"), MAPPING, when=when)
    node = system.contract.node("n")
    found, _ = setup(system, node, system.plan.node("n").methods[0].options)
    events = [
        {"topic": "flag", "on": True},
        {"topic": "light", "light": "green"},
        {"topic": "r", "data": 1},
        {"topic": "flag", "on": False},  # the second answer begins
        {"topic": "light", "light": "red"},
        {"topic": "light", "light": "green"},  # the third: false
        {"topic": "flag", "on": False},
    ]
    text = translate(found, node.guarantees).text
    assert first_reported(system, events, set()) == brute_force(system, events, when) == first_rejected(text, events)
    assert first_rejected(text, events) == first


@pytest.mark.parametrize("order", [("marks", "flag"), ("flag", "marks")])
def test_a_previous_value_is_that_of_the_answer_before_in_whichever_order_this_one_comes(
    order: tuple[str, str], make_system: Callable[..., System]
) -> None:
    formula = "out.flag <=> exists(i in NATURAL | out.marks(i) and not in.last(i))"
    system = make_system(RCL.format(formula=formula), MAPPING)
    node = system.contract.node("n")
    found, _ = setup(system, node, system.plan.node("n").methods[0].options)
    text = translate(found, node.guarantees).text
    answers = [(1, True), (1, False), (2, True), (2, True)]  # the last: nothing is new, and the flag says otherwise
    events = [
        {"topic": topic, **({"id": mark} if topic == "marks" else {"on": flag})}
        for mark, flag in answers
        for topic in order
    ]
    assert first_reported(system, events, set()) == brute_force(system, events) == first_rejected(text, events) == 8
