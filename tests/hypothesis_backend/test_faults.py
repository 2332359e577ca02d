"""Seeded faults of many kinds are found, each honest twin passes, and what is looked at decides no verdict."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from helpers import some
from hoare.systems import make_job

from avow.backend_kit.protocol import Limits
from avow.backends.hypothesis import BACKEND
from avow.backends.hypothesis.generate import Inputs
from avow.backends.hypothesis.knobs import at, knobs, put
from avow.backends.hypothesis.pools import variants
from avow.backends.hypothesis.steer import Steering, constants, repeats
from avow.base.verdict import Outcome, Verdict
from avow.conformance.seeded import settle
from avow.formulas.values import Data, FunctionValue, SequenceValue
from avow.isolation import scout
from avow.isolation.scout import Scout, Sight
from avow.language.sorts import (
    BOOL,
    INTEGER,
    NATURAL,
    REAL,
    STRING,
    Constructor,
    DataSort,
    EnumSort,
    FunctionSort,
    SequenceSort,
    Sort,
)

from .faults import FAULTS, Fault

UNSEEN = ("packed", "near a parabola", "an expression", "too large to square")
"""Faults that are still missed: nothing of what is compared moves until a number is larger than any that is tried; the
secant method goes astray; nothing is compared that moves."""


def outcome_of(folder: Path, fault: Fault, *, faulty: bool) -> Outcome:
    files = {"made.py": fault.program(faulty=faulty), **fault.files}
    options: dict[str, Any] = {"subject": "made.py:y", "cases": 300, "numbers": fault.numbers}
    job = make_job(folder, fault.contract(), "made", options, files, "hypothesis")
    (found,) = settle(BACKEND, job, folder / "made", Limits(seconds=120)).outcomes
    return found


@pytest.mark.parametrize("fault", some([f for f in FAULTS if f.name not in UNSEEN], 0, 28), ids=lambda f: f.name)
def test_a_fault_is_found(tmp_path: Path, fault: Fault) -> None:
    found = outcome_of(tmp_path, fault, faulty=True)
    assert found.verdict is Verdict.REFUTED, found.summary


@pytest.mark.parametrize("fault", some(FAULTS, 0, 14), ids=lambda f: f.name)
def test_its_honest_twin_passes(tmp_path: Path, fault: Fault) -> None:
    found = outcome_of(tmp_path, fault, faulty=False)
    assert found.verdict is Verdict.TESTED, found.summary


@pytest.mark.slow
@pytest.mark.parametrize(("here", "there"), [("True", "False"), ("False", "True")])
def test_only_the_subject_as_it_is_decides(tmp_path: Path, here: str, there: str) -> None:
    """One that finds out that it is looked at, and answers otherwise then, has gained nothing."""
    program = f"{there} if hasattr(__import__('builtins'), '__avow_see__') else {here}"
    found = outcome_of(tmp_path, Fault("looked at", program), faulty=True)
    assert found.verdict is (Verdict.TESTED if here == "True" else Verdict.REFUTED), found.summary


@pytest.mark.slow
def test_a_scout_that_is_lost_is_no_verdict(tmp_path: Path) -> None:
    """What goes wrong only where it is looked at is no fault of the subject's."""
    before = "import builtins, os\nif hasattr(builtins, '__avow_see__'):\n    os._exit(3)"
    found = outcome_of(tmp_path, Fault("lost", "True", before=before), faulty=True)
    assert found.verdict is Verdict.TESTED, found.summary


@pytest.mark.parametrize(
    "sight",
    [[0, "==", [1, 1], "1"], [0, "==", "1", [1, 1]], [0, "==", [1, 0], [1, 1]], [0, "=="], ["0", "==", "a", "a"], 7],
)
def test_a_sight_of_the_subjects_making_is_none(sight: object) -> None:
    """Whoever compares its sides would fail."""
    assert scout._read(sight) is None


# -- what steers, by itself --------------------------------------------------------------------------------------------

SORTS: dict[str, Sort] = {"a": REAL, "n": NATURAL, "k": INTEGER, "s": SequenceSort(REAL), "w": STRING, "p": BOOL}
PLAIN: Inputs = {"a": Fraction(0), "n": 0, "k": 0, "s": SequenceValue((Fraction(0),)), "w": "", "p": False}


def steered(compared: Callable[[Any], Sequence[tuple[int, Any, Any]]]) -> list[Inputs]:
    """The cases that come of a program that compares so, from one plain case."""

    def look(cases: Sequence[Inputs]) -> list[tuple[Sight, ...]]:
        return [tuple(Sight(place, "==", _side(one), _side(two)) for place, one, two in compared(c)) for c in cases]

    steering = Steering(SORTS, look, lambda inputs: True, doubles=False)
    return [case for cases in steering.cases([PLAIN]) for case in cases]


def _side(value: Any) -> Fraction | str:
    return value if isinstance(value, str) else Fraction(value)


@pytest.mark.parametrize(
    ("compared", "met"),
    [
        (lambda c: [(0, c["a"], 77)], lambda c: c["a"] == 77),
        (lambda c: [(0, c["a"] * 3 - 7, c["n"])], lambda c: 3 * c["a"] - 7 == c["n"]),
        (lambda c: [(0, c["a"] + c["k"], 1000)], lambda c: c["a"] + c["k"] == 1000),
        (lambda c: [(0, c["n"] ** 2, 144)], lambda c: c["n"] == 12),
        (lambda c: [(0, c["n"] // 97, 41)], lambda c: c["n"] // 97 == 41),
        (lambda c: [(0, c["n"] >> 13, 5)], lambda c: c["n"] >> 13 == 5),
        (lambda c: [(0, len(c["s"].items), 37)], lambda c: len(c["s"].items) == 37),
        (lambda c: [(0, sum(c["s"].items), 9)], lambda c: sum(c["s"].items) == 9),
        (lambda c: [(0, c["w"].strip(), "go")], lambda c: c["w"] != "go" and c["w"].strip() == "go"),
        (lambda c: [(0, len(c["w"]), 90)], lambda c: len(c["w"]) == 91),
        (lambda c: [(0, c["n"] ^ 0x5A5A, 0x1234)], lambda c: c["n"] ^ 0x5A5A == 0x1234),
        (lambda c: [(0, c["n"] & 0xFF, 0xA7)], lambda c: c["n"] & 0xFF == 0xA7),
        (
            lambda c: [(0, "=", c["w"]), *zip((1, 2), c["w"].split("=")[:2], ("mode", "off"), strict=False)],
            lambda c: c["w"] == "mode=off",
        ),
        (lambda c: [(0, int(n), 4711) for n in re.findall("^[0-9]+$", c["w"])], lambda c: c["w"] == "4711"),
        (
            lambda c: [(0, c["w"][-4:], ".tmp"), *[(1, len(c["w"]), 12)] * c["w"].endswith(".tmp")],
            lambda c: c["w"].endswith(".tmp") and len(c["w"]) > 12,
        ),
        (
            lambda c: [
                (0, c["n"], 50),
                *([(1, c["k"], -70), *([(2, c["a"], c["n"])] * (c["k"] < -70))] * (c["n"] > 50)),
            ],
            lambda c: c["n"] > 50 and c["k"] < -70 and c["a"] == c["n"],
        ),
    ],
    ids=range(16),
)
def test_inputs_are_steered_to_where_two_sides_meet(compared: Any, met: Any) -> None:
    assert any(met(case) for case in steered(compared))


def test_what_counts_is_told_from_what_does_not() -> None:
    def seen(*values: int) -> list[tuple[Sight, ...]]:
        return [(Sight(0, "<", Fraction(value), Fraction(100)),) for value in values]

    assert repeats(seen(1, 2, 3, 4, 5), 1000) == 100  # 95 more, and a few beyond
    assert repeats(seen(1, 2, 3, 4, 5), 50) == 0  # too many
    assert repeats(seen(7, 7, 7, 7, 7), 1000) == 0
    assert repeats(seen(200, 201, 202, 203, 204), 1000) == 0  # it is past
    assert repeats(seen(1, 9, 3, 4, 80), 1000) == 0


def test_constants_are_what_stays_the_same() -> None:
    def seen(k: int) -> tuple[Sight, ...]:
        return (
            Sight(0, "<", Fraction(k), Fraction(7)),
            Sight(1, "use", Fraction(k * k), None),
            Sight(2, "use", "31", None),
        )

    numbers, texts = constants([seen(k) for k in range(20)])
    assert numbers == {7, 31}
    assert texts == {"31"}


def test_every_part_of_a_case_can_be_turned() -> None:
    mode = EnumSort("Mode", ("idle", "go"))
    order = DataSort("Order", (Constructor("move", (REAL, mode)),))
    sorts: dict[str, Sort] = {
        **SORTS,
        "f": FunctionSort((NATURAL,), REAL),
        "at": FunctionSort((NATURAL,), BOOL),
        "o": order,
    }
    case: Inputs = {
        **PLAIN,
        "s": SequenceValue((Fraction(1), Fraction(2))),
        "f": FunctionValue({(3,): Fraction(4)}, Fraction(5)),
        "at": FunctionValue({}, False),
        "o": Data("move", (Fraction(6), "idle")),
    }
    found = knobs(case, sorts)
    assert {at(case, knob) for knob in found if knob.numeric} == {0, 1, 2, 4, 5, 6}
    for knob in found:
        if knob.numeric and (value := knob.fitting(Fraction(9))) is not None:
            changed = put(case, knob, value)
            assert at(changed, knob) == 9
            assert {name for name in case if changed[name] != case[name]} == {knob.path[0]}


def test_variants_are_other_texts_that_look_alike() -> None:
    found = variants("go")
    assert "go" not in found
    assert {" go", "GO", "Go", "gox", "og", "g\u043e", "\uff47\uff4f", "\u200bgo"} <= {*found}


@pytest.mark.slow
def test_a_module_is_the_same_when_it_is_looked_at(tmp_path: Path) -> None:
    """Operands are evaluated once, in their order, whatever expressions they stand in."""
    (tmp_path / "made.py").write_text(
        "said = []\n"
        "def t(x):\n    said.append(x)\n    return x\n"
        "class A:\n    def __init__(self): self.__x = [1, 2, 3]\n    def m(self, *, k=3): return self.__x[:k]\n"
        "class B(A):\n    def m(self): return super().m(k=t(2))\n"
        "def y(a):\n"
        "    said.clear()\n"
        "    match t(a), 1:\n        case (1 | 2 as x), _ if t(x) < 2: said.append('one')\n        case _: pass\n"
        "    found = [t(1) < t(2) > t(0) != t(9), B().m(), {t(i): i for i in range(t(3)) if t(i)}, max(t(1), t(5)),\n"
        "             [*map(t, (4, 5))][t(0):t(1)], (n := t(8)) and not t(0), f'{t(7)!r:>3}', t(3) in (t(1), t(3)),\n"
        "             'abc'.find(*[t('b')]), min([t(2)], default=t(4)), any(t(i) > 1 for i in (1, 2, 3)), n % t(3)]\n"
        "    if found and t(1) or t(2): pass\n"
        "    raise ValueError(repr((found, said)))\n"
    )
    from avow.isolation.subject import SubjectFailed, SubjectProcess

    asked = [
        SubjectProcess(tmp_path / "made.py", "y", 10.0, tmp_path),
        Looked(tmp_path / "made.py", "y", 10.0, tmp_path),
    ]
    said = []
    for process in asked:
        with pytest.raises(SubjectFailed) as raised:
            process.ask({"a": 1})
        said.append(str(raised.value))
        assert not process.close()
    assert said[0] == said[1]
    assert "'one'" in said[0]


class Looked(Scout):
    """A scout whose answers are kept."""

    def _reply(self, reply: Any) -> Any:
        return super(Scout, self)._reply(reply)
