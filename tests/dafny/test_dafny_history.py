"""What the generated `Advance` makes of a history, against the definitions over all steps of a run: of random clauses
and runs Dafny proves at each step what the definitions say there."""

from __future__ import annotations

import random
from collections.abc import Sequence

import pytest
from drawn.memory import formula, response, run_of
from reference.meaning import Step, broken, value

from avow.backend_kit.protocol import Limits
from avow.backends.dafny.modules import Generated, generate
from avow.backends.dafny.runner import verify
from avow.isolation.outside import Outside
from avow.language.load import check_text
from avow.language.printer import show_term
from avow.language.terms import History, Implies, Term

GUARANTEES, RUNS, STEPS = 8, 3, 5
Said = tuple[Term, History | None]
"""A clause: a formula, or a trigger and its response."""


def holds(said: Said, run: Sequence[Step], k: int) -> bool | None:
    """Whether the clause is kept at step k, by the definitions; None after a response's first break."""
    trigger, wanted = said
    if wanted is None:
        return bool(value(trigger, run, k))
    first = broken(Implies(trigger, wanted), run)
    return None if first is not None and first < k else first != k


def generated(said: Sequence[Said]) -> Generated:
    shown = [show_term(t if w is None else Implies(t, w), "rcl") for t, w in said]
    text = "\n".join(f"guarantee g{k} ( {line} )" for k, line in enumerate(shown))
    ports = "inputs( a : BOOL, n : NATURAL ) outputs( b : BOOL ) topics()"
    contract, found = check_text(f"node n {{ {ports} {text} }}", "n.rcl")
    assert contract is not None, found
    made = generate(contract.nodes[0], [g.name for g in contract.nodes[0].guarantees])
    assert made.uncovered == ()
    return made


def claims(made: Generated, said: Sequence[Said], run: Sequence[Step]) -> list[str]:
    """The body of a lemma that walks through the run from `h`, a history with which one begins."""
    spec, lines = made.spec.split("\n"), []
    (advance,) = (x.strip() for x in made.spec.split("\n") if "Contract.Advance(" in x)
    moved = advance.removeprefix("ensures Linked(").removesuffix(", n)")
    for k, step in enumerate(run):
        a, n, b = (str(step[p]).lower() for p in ("in.a", "in.n", "out.b"))
        lines.append(f"in_a, in_n, out_b := {a}, {n}, {b};")
        for line, name in made.ensures:
            held = holds(said[int(name[1:])], run, k)
            if held is not None:
                lines.append(f"assert {'' if held else '!'}{spec[line - 1].strip().removeprefix('ensures ')};")
        lines.append(f"h := {moved};")
    return lines


def disagreements(seed: int, spoil: tuple[str, str] = ("", "")) -> list[str]:
    """The runs of which Dafny does not prove what the definitions say; `spoil` puts another text in the contract's."""
    rng = random.Random(seed)
    said: list[Said] = [response(rng) if k % 2 else (formula(rng, 2), None) for k in range(GUARANTEES)]
    made = generated(said)
    lemmas = ["  lemma Never(h: Contract.History) requires Contract.Begins(h) ensures false {}"]
    for number in range(RUNS):
        lemmas += [
            f"  lemma Run{number}(first: Contract.History) requires Contract.Begins(first) {{",
            "    var h, in_a: bool, in_n: nat, out_b: bool := first, false, 0, false;",
            *(f"    {line}" for line in claims(made, said, run_of(rng, STEPS))),
            "  }",
        ]
    check = "\n".join(["module Check {", "  import Types", "  import Contract", *lemmas, "}", ""])
    contract = made.contract.replace(*spoil) if spoil[0] else made.contract
    assert not spoil[0] or contract != made.contract, contract
    files = {made.types_file: made.types, made.contract_file: contract, "check.dfy": check}
    run = verify(files, Limits(seconds=400), Outside(()))
    assert run.members is not None, run.output
    proved = {m.name for m in run.members if m.kind == "Impl" and m.outcome == "correct"}
    assert "Never" not in proved, "no history is the first"
    return [f"Run{k}" for k in range(RUNS) if f"Run{k}" not in proved]


@pytest.mark.needs_dafny
@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(6))
def test_advance_is_what_the_definitions_say(seed: int) -> None:
    assert disagreements(seed) == []


@pytest.mark.needs_dafny
@pytest.mark.nightly
def test_a_history_that_stands_still_is_found() -> None:
    assert disagreements(0, (": History { History(", ": History { h } // ")) != []
