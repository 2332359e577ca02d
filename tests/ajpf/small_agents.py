"""Random small agents, environments and properties, with everything that the reasoning cycle does in them."""

from __future__ import annotations

import random
from dataclasses import dataclass

GOALS = ("g", "h", "k(1)", "k(2)")
BELIEFS = ("a", "b", "c(1)", "c(2)")
PERCEPTS = ("p", "q", "r(1)", "r(2)")
ACTIONS = ("one", "two", "go(1)", "quiet(1)")


@dataclass(frozen=True)
class Case:
    program: str
    environment: str
    formulas: tuple[str, ...]


def case(seed: int) -> Case:
    rng = random.Random(seed)
    return Case(_program(rng), _environment(rng), tuple(formula(rng, rng.choice((1, 1, 2))) for _ in range(2)))


def _kind(rng: random.Random) -> str:
    return rng.choice(("[perform]", "[perform]", "[achieve]"))


def _guard(rng: random.Random, bound: str | None) -> str:
    parts = []
    for _ in range(rng.choice((0, 0, 1, 1, 2))):
        belief = rng.choice((*BELIEFS, *PERCEPTS, "d", "c(X)", "r(X)"))
        sign = rng.choice(("", "~"))
        parts.append(f"{sign}B {belief}")
    if rng.random() < 0.12:
        parts.append(f"{rng.choice(('', '~'))}G {rng.choice(GOALS)} {_kind(rng)}")
    return ", ".join(parts) or "True"


def _deeds(rng: random.Random, depth: int) -> str:
    found = []
    for _ in range(rng.choice((0, 1, 1, 2, 2, 3))):
        found.append(
            rng.choice(
                (
                    rng.choice(ACTIONS),
                    rng.choice(ACTIONS),
                    f"+{rng.choice(BELIEFS)}",
                    f"+{rng.choice(BELIEFS)}",
                    f"-{rng.choice((*BELIEFS, *PERCEPTS, 'c(Z)'))}",
                    f"+!{rng.choice(GOALS[depth:])} {_kind(rng)}" if depth < len(GOALS) else "two",
                    f"+!{rng.choice(GOALS[depth:])} {_kind(rng)}" if depth < len(GOALS) else "one",
                    f"-!{rng.choice(GOALS)} {_kind(rng)}" if rng.random() < 0.4 else "+b",
                    f"*{rng.choice((*BELIEFS, *PERCEPTS, 'c(W)', '~a', '~p'))}" if rng.random() < 0.4 else "+a",
                    "sum(1, 1, S), +c(S)" if rng.random() < 0.3 else "one",
                )
            )
        )
    if len(found) > 1 and rng.random() < 0.1:
        found = ["+.lock", *found[:-1], "-.lock", found[-1]]
    return ", ".join(found)


def _program(rng: random.Random) -> str:
    plans = []
    for at, goal in enumerate(GOALS):
        for _ in range(rng.choice((0, 1, 1, 2))):
            trigger = rng.choice((goal, "k(X)")) if goal.startswith("k") else goal
            plans.append((f"+!{trigger} {_kind(rng)}", at + 1))
    for trigger in rng.sample(
        (*(f"+{p}" for p in (*PERCEPTS, *BELIEFS)), "-p", "-r(X)", "-a", "+c(X)"), rng.randint(1, 4)
    ):
        plans.append((trigger, rng.choice((1, 2, 3, 4))))
    if rng.random() < 0.3:
        plans.append((f"-!{rng.choice(GOALS)} {_kind(rng)}", 2))
    lines = []
    for trigger, depth in plans:
        deeds = _deeds(rng, depth)
        lines.append(f"{trigger} : {{ {_guard(rng, None)} }}{f' <- {deeds}' if deeds else ''};")
    goals = "\n".join(f"{goal} {_kind(rng)}" for goal in rng.sample(GOALS, rng.choice((0, 1, 1, 2))))
    rules = rng.choice(
        ("", "", ":Reasoning Rules:\n\nd :- a, ~p;\nd :- c(Y);\n\n", ":Reasoning Rules:\n\nd :- ~q;\n\n")
    )
    beliefs = "\n".join(rng.sample(BELIEFS, rng.choice((0, 0, 1, 2))))
    body = "\n".join(lines)
    head = f"GWENDOLEN\n\n:name: ag\n\n:Initial Beliefs:\n\n{beliefs}\n\n{rules}"
    return f"{head}:Initial Goals:\n\n{goals}\n\n:Plans:\n\n{body}\n"


def _environment(rng: random.Random) -> str:
    groups = rng.choice(
        (
            "{x: [p, nothing]}",
            "{x: [nothing]}",
            "{x: [p], y: [q, nothing]}",
            '{x: ["r(1)", "r(2)"]}',
            '{x: ["r(1)", nothing], y: [p]}',
            "{x: [p, q]}",
        )
    )
    when = rng.choice(("once", "once", "once", "repeatedly", "never"))
    lines = [
        f"draws: {{at_start: {rng.choice(('true', 'true', 'true', 'false'))}, at_quiescence: {when}, quiet: [quiet]}}"
    ]
    lines.append(f"percepts: {groups}")
    if rng.random() < 0.2:
        lines.append("after: {one: {x: [keep]}}")
    return "\n".join(lines) + "\n"


def _atom(rng: random.Random) -> str:
    modality = rng.choice("BBBBDDDGP")
    word = {"B": (*BELIEFS, *PERCEPTS, "d"), "D": ACTIONS, "G": GOALS, "P": PERCEPTS}[modality]
    atom = f"P({rng.choice(word)})" if modality == "P" else f"{modality}(ag, {rng.choice(word)})"
    return f"(~{atom})" if rng.random() < 0.35 else atom


def formula(rng: random.Random, depth: int) -> str:
    if depth == 0:
        return _atom(rng)
    one, other = formula(rng, depth - 1), formula(rng, depth - 1)
    forms = (
        "[] {0}",
        "<> {0}",
        "{0} U {1}",
        "{0} R {1}",
        "[] ({0} -> (<> {1}))",
        "[] ({0} -> {1})",
        "(<> {0}) & ([] {1})",
    )
    return "(" + rng.choice(forms).format(one, other) + ")"
