"""Each engine of the one bridge to Z3 runs, and decides what it is there for."""

from __future__ import annotations

import pytest

from avow.solving.checking import Engine, check
from avow.solving.translation import Translator
from avow.solving.z3_module import z3

SQUARES = "squares of reals"
LINEAR = "linear arithmetic"


def asked(kind: str, translator: Translator, possible: bool) -> list[object]:
    """`exists x in [-2, top]. forall y. not (x, y) on the curve and y >= 0`: only a wider range has such an x."""
    x, y = (z3.Real(name, translator.context) for name in "xy")
    top = 3 if possible else 2
    curve = x * x + y * y == 4 if kind == SQUARES else y == 2 - x
    return [x >= -2, x <= top, z3.ForAll([y], z3.Implies(curve, z3.Not(y >= 0)))]


@pytest.mark.parametrize("possible", [True, False])
@pytest.mark.parametrize("kind", [SQUARES, LINEAR])
@pytest.mark.parametrize("engine", ["smt", "qsat"])
def test_an_engine_decides(engine: Engine, kind: str, possible: bool) -> None:
    translator = Translator()
    assertions = asked(kind, translator, possible)
    answer = check(translator, assertions, effort=1000, engine=engine)
    assert answer.reason == ""
    assert answer.status == ("sat" if possible else "unsat")


def test_a_fault_of_ours_is_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """A parameter that an engine does not know once made each of its answers `unknown`, unseen."""
    monkeypatch.setattr("avow.solving.checking.configured", lambda solver, *_: solver.set("no_such_parameter", 1))
    translator = Translator()
    with pytest.raises(RuntimeError, match="unknown parameter"):
        check(translator, [translator.true()])
