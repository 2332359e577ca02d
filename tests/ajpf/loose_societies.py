"""Random systems of agents that have little to do with each other: a few send messages to a few, some perceive."""

from __future__ import annotations

import random

from small_societies import Case

NAMES = ("one", "two", "three", "four")
CONTENTS = ("a", "b", "c")
FORMS = (
    "(~{0}) U {1}",
    "(~{0}) R (~{1})",
    "[] ({0} -> {1})",
    "[] ({0} -> (<> {1}))",
    "[] (~({0} & (~{1})))",
    "<> {0}",
    "(<> {0}) -> (<> {1})",
    "<> ([] {0})",
)


def loose_society(seed: int) -> Case:
    rng = random.Random(seed)
    names = NAMES[: rng.choice((2, 3, 3, 4))]
    wires = {name: tuple(other for other in names if rng.random() < 0.25) for name in names}
    acting = tuple(name for name in names if rng.random() < 0.3)
    agents = "\n".join(_agent(rng, name, wires[name], name in acting) for name in names)
    groups = rng.choice(("{x: [nothing]}", "{x: [nothing]}", "{x: [p]}", "{x: [p, nothing]}"))
    when = rng.choice(("once", "once", "never", "repeatedly"))
    quiet = rng.choice(("[send, act]", "[send, act]", "[send]", "[]"))
    draws = f"draws: {{at_start: {rng.choice(('true', 'false'))}, at_quiescence: {when}, quiet: {quiet}}}"
    formulas = []
    for _ in range(5):
        spoken = rng.sample(names, rng.choice((1, 2, 2)))
        atoms = [f"B({rng.choice(spoken)}, {rng.choice(CONTENTS)})" for _ in range(2)]
        if rng.random() < 0.25:
            atoms[rng.randrange(2)] = f"D({rng.choice(spoken)}, {rng.choice(('act', 'send(a, _)'))})"
        formulas.append(f"({rng.choice(FORMS).format(*atoms)})")
    return Case(f"GWENDOLEN\n{agents}", f"{draws}\npercepts: {groups}\n", (), tuple(formulas))


def _deeds(rng: random.Random, wires: tuple[str, ...], acts: bool, most: int) -> str:
    found = []
    for _ in range(rng.randint(1, most)):
        deeds = [f"+{rng.choice(CONTENTS)}", f"-{rng.choice(CONTENTS)}"]
        if wires:
            deeds += 2 * [f".send({rng.choice(wires)}, :tell, {rng.choice(CONTENTS)})"]
        if acts:
            deeds.append("act")
        found.append(rng.choice(deeds))
    return ", ".join(found)


def _agent(rng: random.Random, name: str, wires: tuple[str, ...], acts: bool) -> str:
    def guard() -> str:
        return rng.choice(("True", "True", f"{rng.choice(('', '~'))}B {rng.choice(CONTENTS)}"))

    plans = [f"+!g [perform] : {{ {guard()} }} <- {_deeds(rng, wires, acts, 3)};"]
    if rng.random() < 0.6:
        first = rng.choice((*CONTENTS, "B"))
        plans.append(f"+.received(:tell, {first}) : {{ {guard()} }} <- {_deeds(rng, wires, acts, 1)};")
    heard = rng.choice(("+B", "+B", "-B", "+a", "+B, +b", "+B, .send(From, :tell, B)", _deeds(rng, wires, acts, 2)))
    plans.append(f"+.received(:tell, B) : {{ True }} <- {heard};")
    for trigger in rng.sample(("+p", "+a", "+b", "-a"), rng.randint(0, 2)):
        plans.append(f"{trigger} : {{ {guard()} }} <- {_deeds(rng, (), acts, 2)};")
    goal = "g [perform]" if rng.random() < 0.8 else ""
    beliefs = rng.choice(("", "", "a"))
    lines = "\n".join(plans)
    return f"\n:name: {name}\n\n:Initial Beliefs:\n\n{beliefs}\n\n:Initial Goals:\n\n{goal}\n\n:Plans:\n\n{lines}\n"
