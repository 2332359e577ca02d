"""Random small systems of agents that send each other messages, with all that their reasoning cycles do about them."""

from __future__ import annotations

import random
from dataclasses import dataclass

NAMES = ("one", "two", "three")
CONTENTS = ("a", "b", "c(1)", "c(2)")
GOALS = ("g", "k(1)")
PERCEPTS = ("p", "q")
ACTIONS = ("act", "go(1)")
FORCES = ("tell", "tell", "perform", "achieve")


@dataclass(frozen=True)
class Case:
    program: str
    environment: str
    atoms: tuple[str, ...]
    formulas: tuple[str, ...]


def society(seed: int) -> Case:
    rng = random.Random(seed)
    names = NAMES[: rng.choice((2, 2, 2, 3))]
    agents = "\n".join(_agent(rng, name, names) for name in names)
    atoms = tuple(dict.fromkeys(_atom(rng, names) for _ in range(7)))
    formulas = tuple(_formula(rng, atoms) for _ in range(3))
    return Case(f"GWENDOLEN\n{agents}", _environment(rng), atoms, formulas)


def _kind(rng: random.Random) -> str:
    return rng.choice(("[perform]", "[perform]", "[achieve]"))


def _sent(rng: random.Random, others: tuple[str, ...], bound: tuple[str, ...]) -> str:
    force = rng.choice(FORCES)
    content = rng.choice(CONTENTS if force == "tell" else GOALS)
    if force == "tell" and "X" in bound and rng.random() < 0.3:
        content = "c(X)"
    to = "From" if "From" in bound and rng.random() < 0.5 else rng.choice(others)
    return f".send({to}, :{force}, {content})"


def _deeds(rng: random.Random, others: tuple[str, ...], bound: tuple[str, ...], depth: int) -> str:
    found = []
    for _ in range(rng.choice((0, 1, 1, 2, 2))):
        found.append(
            rng.choice(
                (
                    rng.choice(ACTIONS),
                    _sent(rng, others, bound) if depth < 3 else "act",
                    _sent(rng, others, bound) if depth < 2 else "act",
                    f"+{rng.choice(CONTENTS)}",
                    f"-{rng.choice(CONTENTS)}",
                    f"+!{rng.choice(GOALS)} {_kind(rng)}" if depth < 1 else "+b",
                    f"*{rng.choice((*CONTENTS, *PERCEPTS))}" if rng.random() < 0.4 else "+a",
                )
            )
        )
    return ", ".join(found)


def _guard(rng: random.Random, others: tuple[str, ...]) -> str:
    parts = []
    for _ in range(rng.choice((0, 0, 0, 1, 1, 2))):
        parts.append(f"{rng.choice(('', '~'))}B {rng.choice((*CONTENTS, *PERCEPTS, 'c(Y)'))}")
    if rng.random() < 0.2:
        parts.append(f"~.sent({rng.choice(others)}, :tell, {rng.choice(CONTENTS)})")
    return ", ".join(parts) or "True"


def _agent(rng: random.Random, name: str, names: tuple[str, ...]) -> str:
    others = tuple(other for other in names if other != name) + ((name,) if rng.random() < 0.1 else ())
    plans = []
    for goal in GOALS:
        for _ in range(rng.choice((0, 1, 1))):
            plans.append((f"+!{goal} {_kind(rng)}", (), 0))
    heard = [
        ("+.received(:tell, B)", "+B", ("From",)),
        ("+.received(:tell, c(X))", "+c(X)", ("From", "X")),
        ("+.received(:perform, G)", "+!G [perform]", ("From",)),
        ("+.received(:achieve, G)", "+!G [achieve]", ("From",)),
        ("+.received(:tell, a)", "+a", ("From",)),
    ]
    for trigger, deed, bound in rng.sample(heard, rng.randint(1, 3)):
        more = _deeds(rng, others, bound, 2)
        plans.append((trigger, bound, f"{deed}, {more}" if more and rng.random() < 0.4 else deed))
    for trigger in rng.sample(("+p", "-p", "+a", "+b", "+c(X)", "+q"), rng.randint(1, 2)):
        plans.append((trigger, ("X",) if "X" in trigger else (), 1))
    lines = []
    for trigger, bound, depth in plans:
        deeds = depth if isinstance(depth, str) else _deeds(rng, others, bound, depth)
        lines.append(f"{trigger} : {{ {_guard(rng, others)} }}{f' <- {deeds}' if deeds else ''};")
    goals = "\n".join(f"{goal} {_kind(rng)}" for goal in rng.sample(GOALS, rng.choice((0, 1, 1))))
    beliefs = "\n".join(rng.sample(CONTENTS, rng.choice((0, 0, 1))))
    body = "\n".join(lines)
    return f"\n:name: {name}\n\n:Initial Beliefs:\n\n{beliefs}\n\n:Initial Goals:\n\n{goals}\n\n:Plans:\n\n{body}\n"


def _environment(rng: random.Random) -> str:
    groups = rng.choice(
        ("{x: [nothing]}", "{x: [nothing]}", "{x: [p]}", "{x: [p, nothing]}", "{x: [p], y: [q, nothing]}")
    )
    when = rng.choice(("once", "once", "never", "repeatedly"))
    quiet = rng.choice(("[send]", "[send]", "[send, act]", "[]"))
    start = rng.choice(("true", "true", "false"))
    return f"draws: {{at_start: {start}, at_quiescence: {when}, quiet: {quiet}}}\npercepts: {groups}\n"


def _atom(rng: random.Random, names: tuple[str, ...]) -> str:
    modality = rng.choice("BBBBDDGI")
    sends = tuple(f"send({what}, {name})" for what in ("a", "g", "_") for name in names)
    word = {"B": (*CONTENTS, *PERCEPTS), "D": (*ACTIONS, *sends), "G": GOALS, "I": GOALS}[modality]
    return f"{modality}({rng.choice(names)}, {rng.choice(word)})"


def _formula(rng: random.Random, atoms: tuple[str, ...]) -> str:
    one, other = (f"(~{atom})" if rng.random() < 0.4 else atom for atom in (rng.choice(atoms), rng.choice(atoms)))
    forms = ("[] {0}", "<> {0}", "{0} U {1}", "{0} R {1}", "[] ({0} -> (<> {1}))", "[] ({0} -> {1})")
    return f"({rng.choice(forms).format(one, other)})"
