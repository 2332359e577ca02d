"""Random agents with what `small_agents` lacks: rules with variables, comparisons, cuts, groups, lists, computing.

MCAPL's own parser takes ``==`` in no rule.
"""

from __future__ import annotations

import random

from small_societies import Case

RULES = (
    "low(X) :- n(X), [X < 3];",
    "pair(X, Y) :- n(X), n(Y), [X < Y];",
    "first(X) :- n(X), !;",
    "first(9);",
    "empty :- ~(n(X), ~c(X));",
    "in(X, [X|T]);",
    "in(X, [H|T]) :- in(X, T);",
    "calm :- ~p, ~n(4);",
)
GUARDS = (
    "True",
    "B n(X)",
    "B low(X)",
    "B pair(X, Y)",
    "B first(X)",
    "~B empty",
    "B l(L), B in(X, L)",
    "B l(L), B in(X, L), ~B c(X)",
    "B n(X), X < 3",
    "B n(X), ~X < 2",
    "B calm",
    "B n(X), Y == X",
)
WORDS = ("n(1)", "n(2)", "n(4)", "c(1)", "c(2)", "c(3)", "d")


def rich_agent(seed: int) -> Case:
    rng = random.Random(seed)
    rules = "\n".join(rule for rule in RULES if rng.random() < 0.9)
    plans = []
    for trigger in ("+!g [perform]", "+!g [perform]", "+!k(V) [achieve]", "+p", "+n(V)", "-c(V)", "+q(V)"):
        if rng.random() < 0.7:
            guard = rng.choice(GUARDS)
            bound = [v for v in "XYV" if v in f"{guard} {trigger}"]
            plans.append(f"{trigger} : {{ {guard} }} <- {_deeds(rng, bound, 'k' in trigger or 'n(' in trigger)};")
    beliefs = "\n".join((*rng.sample(WORDS[:6], 3), rng.choice(("l([1, 2])", "l([2, 3, 1])", "l([])"))))
    groups = rng.choice(("[nothing]", "[p, nothing]", "['q(1)', 'q(2)', nothing]", "['n(4)', nothing]"))
    draws = f"draws: {{at_start: true, at_quiescence: {rng.choice(('once', 'once', 'never'))}}}"
    atoms = tuple(dict.fromkeys(f"B(ag, {rng.choice((*WORDS, 'low(_)', 'first(_)', 'empty'))})" for _ in range(3)))
    atoms += tuple(dict.fromkeys(f"D(ag, {rng.choice(('act(_)', 'act(2)', 'sum(_, _, _)', 'go'))})" for _ in range(2)))
    forms = ("[] {0}", "<> {0}", "{0} U {1}", "[] ({0} -> (<> {1}))", "(~{0}) R (~{1})")
    formulas = tuple(f"({rng.choice(forms).format(rng.choice(atoms), rng.choice(atoms))})" for _ in range(3))
    head = f":name: ag\n\n:Initial Beliefs:\n\n{beliefs}\n\n:Reasoning Rules:\n\n{rules}\n\n"
    body = "\n".join(plans)
    text = f"GWENDOLEN\n\n{head}:Initial Goals:\n\ng [perform]\n\n:Plans:\n\n{body}\n"
    return Case(text, f"{draws}\npercepts: {{x: {groups}}}\n", atoms, formulas)


def _deeds(rng: random.Random, bound: list[str], nested: bool) -> str:
    found, free = [], list(bound)
    for at in range(rng.randint(1, 3)):
        one = rng.choice((*free, "1", "2")) if free else rng.choice("12")
        deed = rng.choice(
            (
                f"act({one})",
                "go",
                f"+c({one})",
                f"-c({one})",
                "-n(_)",
                "+d",
                f"+c(({one} + 1))",
                f"sum({one}, 1, Z{at})",
                f"minus({one}, 1, Z{at})",
                "go" if nested else f"+!k({one}) [achieve]",
                f"*c({one})" if rng.random() < 0.3 else "+d",
            )
        )
        if f"Z{at}" in deed:
            free.append(f"Z{at}")
        found.append(deed)
    return ", ".join(found)
