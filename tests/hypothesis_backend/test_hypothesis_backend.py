"""The Hypothesis backend end to end: faults are found and shrunk, and nothing that a subject does makes it green."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from helpers import some
from hoare.systems import make_job, sensor

from avow.backend_kit.protocol import Backend, Job, Limits, Report
from avow.backends.hypothesis import BACKEND
from avow.backends.hypothesis.backend import failure_bound
from avow.base.diagnostics import Rejected
from avow.base.verdict import Outcome, Verdict

GOLDEN = Path(__file__).parent / "golden"

STEP = """
def step(r, command, before):
    done = set(before.points())
    if command[0] == "inspect":
        done.add(command[1])
    colour = "green" if r < 120 else "orange" if r < 250 else "red"
    return {"colour": colour, "done": done}
"""


def job(folder: Path, text: str = STEP, rcl: str | None = None, node: str = "sensor", **options: Any) -> Job:
    given = {"subject": "s.py:step", "cases": 150, **options}
    return make_job(folder, rcl or sensor(), node, given, {"s.py": text}, "hypothesis")


def run(wanted: Job, seconds: float = 60.0, seed: int = 0) -> Report:
    return BACKEND.discharge(wanted, wanted.root, Limits(seconds=seconds, seed=seed))


def settle(wanted: Job, seconds: float = 60.0, seed: int = 0) -> dict[str, Outcome]:
    return {o.obligation.rpartition("/")[2]: o for o in run(wanted, seconds, seed).outcomes}


def test_it_is_a_backend() -> None:
    assert isinstance(BACKEND, Backend)


def test_a_right_subject_is_tested_and_no_more(tmp_path: Path) -> None:
    found = settle(job(tmp_path))
    assert {o.verdict for o in found.values()} == {Verdict.TESTED}
    assert not any(o.vacuous for o in found.values())
    low = found["low"]
    assert low.bound["cases"] == 150
    assert low.bound["seed"] == 0
    assert low.bound["failure_probability_below"] == pytest.approx(3 / 150, rel=0.02)
    triggers = low.details["triggers"]
    assert isinstance(triggers, list)
    assert triggers[0]["met"] == low.bound["triggered"]
    assert f"% of cases like the {low.bound['triggered']} that met its condition fail)" in low.summary


@pytest.mark.parametrize(
    ("old", "new", "broken", "reading"),
    [
        pytest.param("r < 120", "r < 130", {"medium"}, ("120", "130"), marks=pytest.mark.nightly),
        ("r < 120", "r <= 120", {"medium"}, ("120", "120")),
        pytest.param("r < 250", "r <= 250", {"high"}, ("250", "250"), marks=pytest.mark.slow),
        pytest.param('"green" if', '"orange" if', {"low"}, ("0", "120"), marks=pytest.mark.nightly),
        pytest.param(
            '"orange" if r < 250 else "red"',
            '"red" if r < 250 else "orange"',
            {"medium", "high"},
            None,
            marks=pytest.mark.slow,
        ),
        pytest.param("done.add(command[1])", "done.add(command[1] + 1)", {"marks"}, None, marks=pytest.mark.nightly),
        pytest.param("done.add(command[1])", "done = {command[1]}", {"marks"}, None, marks=pytest.mark.slow),
        pytest.param('== "inspect"', '!= "halt"', {"marks"}, None, marks=pytest.mark.slow),
    ],
)
def test_seeded_faults_are_found(
    tmp_path: Path, old: str, new: str, broken: set[str], reading: tuple[str, str] | None
) -> None:
    assert old in STEP
    changed = STEP.replace(old, new)
    if new == '!= "halt"':
        changed = changed.replace("done.add(command[1])", "done.add(int(abs(command[1])))")
    found = settle(job(tmp_path, changed))
    assert {name for name, o in found.items() if o.verdict is Verdict.REFUTED} == broken
    for name in broken:
        shown = found[name].counterexample
        assert shown is not None
        if reading is not None:
            value = float(dict(shown.values)["in.r"])
            assert float(reading[0]) <= value <= float(reading[1])
            assert dict(shown.values)["in.before"] == "{}"  # shrunk: what does not matter is empty


@pytest.mark.nightly
def test_the_same_seed_gives_the_same_answer(tmp_path: Path) -> None:
    wanted = job(tmp_path, STEP.replace("r < 120", "r < 130"))
    assert run(wanted, seed=3).outcomes == run(wanted, seed=3).outcomes


@pytest.mark.slow
def test_hypothesis_leaves_nothing_behind(tmp_path: Path) -> None:
    wanted = job(tmp_path)
    before = sorted(p.name for p in tmp_path.rglob("*"))
    run(wanted)
    assert sorted(p.name for p in tmp_path.rglob("*")) == before


# -- subjects that do not behave ---------------------------------------------------------------------------------------

HOSTILE = {
    "raises": "def step(**inputs):\n    raise RuntimeError('no')",
    "raises at times": STEP.replace("    done =", "    assert r != 250\n    done =", 1),
    "leaves": "import sys\ndef step(**inputs):\n    sys.exit(0)",
    "leaves hard": "import os\ndef step(**inputs):\n    os._exit(0)",
    "leaves at import": "import sys\nsys.exit(0)\ndef step(**inputs): pass",
    "kills": "import os, signal\ndef step(**inputs):\n    os.kill(os.getpid(), signal.SIGKILL)",
    "recurses": "def step(**inputs):\n    return step(**inputs)",
    "returns nothing": "def step(**inputs): pass",
    "returns junk": "def step(**inputs): return object()",
    "lies about types": "def step(**inputs): return {'colour': 'purple', 'done': set()}",
    "lacks an output": "def step(**inputs): return {'colour': 'green'}",
    "has another": "def step(**inputs): return {'colour': 'green', 'done': set(), 'x': 1}",
    "returns a lambda": "def step(**inputs): return {'colour': 'green', 'done': lambda i: True}",
    "returns a cycle": "def step(**inputs):\n    a = []\n    a.append(a)\n    return {'colour': 'green', 'done': a}",
    "no syntax": "def step(:",
    "breaks equality": "class S(str):\n    def __eq__(self, o): return True\n    __hash__ = str.__hash__\n"
    "def step(**inputs): return {'colour': S('purple'), 'done': set()}",
}


QUICK = ("lies about types", "leaves hard", "returns junk")
"""Some kinds; every subject costs a process or two."""


@pytest.mark.parametrize(
    "name",
    [*some(QUICK, 1, slow=2), *(pytest.param(n, marks=pytest.mark.nightly) for n in sorted({*HOSTILE} - {*QUICK}))],
)
def test_nothing_that_a_subject_does_is_green(tmp_path: Path, name: str) -> None:
    found = settle(job(tmp_path, HOSTILE[name], cases=60), seconds=20)
    assert not any(o.verdict.supports for o in found.values()), name


@pytest.mark.slow
def test_an_endless_subject_is_stopped(tmp_path: Path) -> None:
    found = settle(job(tmp_path, "import time\ndef step(**inputs):\n    while True: time.sleep(0.01)"), seconds=10)
    assert {o.verdict for o in found.values()} == {Verdict.ERROR}
    assert all("does not answer" in o.summary for o in found.values())


@pytest.mark.slow
def test_a_crash_is_shown_with_its_smallest_input(tmp_path: Path) -> None:
    found = settle(job(tmp_path, HOSTILE["raises at times"]))
    low = found["low"]
    assert low.verdict is Verdict.ERROR
    assert low.counterexample is not None
    assert dict(low.counterexample.values)["in.r"] == "250"
    assert "AssertionError" in low.summary
    assert "s.py, line 3" in low.summary


@pytest.mark.slow
def test_an_assumption_without_a_value_is_not_met(tmp_path: Path) -> None:
    rcl = "node n {{ inputs( a : REAL, b : REAL ) outputs( y : REAL ) topics() {} guarantee g ( out.y == in.a ) }}"
    text = "def step(a, b): return a if b else a + 1"
    divides = rcl.format("assume( 1 <= in.a / in.b )")
    assert settle(job(tmp_path, text, divides, "n", cases=30))["g"].verdict is Verdict.TESTED
    either = rcl.format("assume( in.b == 0 or 1 <= in.a / in.b )")
    assert settle(job(tmp_path, text, either, "n", cases=30))["g"].verdict is Verdict.REFUTED


@pytest.mark.slow
def test_printing_does_not_disturb(tmp_path: Path) -> None:
    noisy = STEP.replace("    done =", "    print('{}' * 1000, flush=True)\n    done =", 1)
    assert {o.verdict for o in settle(job(tmp_path, noisy)).values()} == {Verdict.TESTED}


def test_what_the_search_for_a_simple_case_violates_is_refuted(tmp_path: Path) -> None:
    """`early` is simplified to x = 70, which violates `late` too: none of the two cases that were drawn does."""
    text = "node n { inputs( x : REAL, z : REAL ) outputs( y : INTEGER ) topics() assume up ( in.x >= 0 and in.z >= 0 )"
    text += " guarantee early ( in.x * in.x * in.x <= 70 or out.y == 0 )"
    text += " guarantee late ( abs(in.x * in.x * in.x - 343000) >= 0.001 or out.y == 0 ) }"
    found = settle(job(tmp_path, "def step(x, z):\n    return {'y': 1}", text, "n", cases=2))
    assert {name: o.verdict for name, o in found.items()} == dict.fromkeys(("early", "late"), Verdict.REFUTED)


@pytest.mark.slow
def test_a_faulty_guarantee_is_refuted_even_if_the_subject_crashes_elsewhere(tmp_path: Path) -> None:
    text = STEP.replace("r < 120", "r < 110").replace("    done =", "    assert r < 590\n    done =", 1)
    found = settle(job(tmp_path, text, cases=400))
    assert found["low"].verdict in {Verdict.REFUTED, Verdict.ERROR}
    assert not any(o.verdict.supports for o in found.values())


# -- coverage, assumptions, judging ------------------------------------------------------------------------------------

FREE = """
context {{ P : INTEGER x INTEGER --> BOOL; C : {{on, off}}; D : {{ leaf(INTEGER), pair(INTEGER, INTEGER) }};
          F : INTEGER --> INTEGER; U : {{}}; }}
node n {{
  inputs( {inputs} ) outputs( {outputs} ) topics( a/B c matches({topic}) )
  assume( {assume} )
  guarantee g ( {guarantee} )
}}
"""


def free(
    tmp_path: Path, guarantee: str, subject: str, assume: str = "TRUE", inputs: str = "a : INTEGER", **more: Any
) -> Outcome:
    outputs = more.pop("outputs", "y : INTEGER")
    topic = "in." + inputs.split(":")[0].strip()
    rcl = FREE.format(inputs=inputs, outputs=outputs, assume=assume, guarantee=guarantee, topic=topic)
    return settle(job(tmp_path, subject, rcl, "n", **more))["g"]


@pytest.mark.slow
@pytest.mark.parametrize(("guarantee", "supposed"), [("out.y != out.z", 1), ("in.a > 3 -> in.a > 2", 0)])
def test_made_up_elements_are_a_hypothesis(tmp_path: Path, guarantee: str, supposed: int) -> None:
    """A type of which nothing is known may have one element only: then no subject answers with two."""
    subject = "def step(**inputs):\n    return {'y': 'U#0', 'z': 'U#1'}\n"
    found = free(tmp_path, guarantee, subject, outputs="y : U, z : U")
    assert found.verdict is Verdict.TESTED, found.summary
    assert len(found.rests_on) == supposed
    assert all(text.startswith("U: ") for text in found.hypotheses)


@pytest.mark.parametrize(
    ("text", "verdict"),
    [
        pytest.param(
            "def f(x):\n    return id(object()) // 16 % 997 / 1000\n", Verdict.UNKNOWN, marks=pytest.mark.slow
        ),
        pytest.param(
            "import _random\nr = _random.Random()\ndef f(x):\n    return r.random()\n",
            Verdict.UNKNOWN,
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "n = 0\ndef f(x):\n    global n\n    n += 1\n    return 1 / n\n", Verdict.TESTED, marks=pytest.mark.slow
        ),
        pytest.param("def f(x):\n    return {object() for _ in 'ab'} and 1\n", Verdict.TESTED, marks=pytest.mark.slow),
    ],
)
def test_what_comes_of_chance_is_not_green(tmp_path: Path, text: str, verdict: Verdict) -> None:
    rcl = "node n { inputs( x : REAL ) outputs( y : REAL ) topics() guarantee g ( out.y <= 1 ) }"
    (found,) = settle(job(tmp_path, text, rcl, "n", subject="s.py:f")).values()
    assert found.verdict is verdict
    assert ("undeclared input" in found.summary) is (verdict is Verdict.UNKNOWN)


@pytest.mark.slow
def test_an_antecedent_that_is_never_met_is_not_green(tmp_path: Path) -> None:
    found = free(tmp_path, "in.a * in.a == 2 -> out.y == 5", "def step(a): return 0")
    assert (found.verdict, found.vacuous) == (Verdict.UNKNOWN, True)


@pytest.mark.slow
def test_assumptions_that_are_never_met_are_not_green(tmp_path: Path) -> None:
    found = free(tmp_path, "out.y == 5", "def step(a): return 5", assume="in.a * in.a == 2")
    assert found.verdict is Verdict.UNKNOWN
    assert "assumptions" in found.summary


@pytest.mark.slow
def test_a_rare_condition_is_aimed_at(tmp_path: Path) -> None:
    found = free(
        tmp_path,
        "in.a == 77 and in.b == 11 -> out.y == 0",
        "def step(a, b): return 1",
        inputs="a : INTEGER, b : INTEGER",
    )
    assert found.verdict is Verdict.REFUTED


@pytest.mark.slow
def test_assumptions_are_repaired(tmp_path: Path) -> None:
    found = free(
        tmp_path,
        "out.y == in.a",
        "def step(a, p): return a",
        assume="exists(i, j in INTEGER | in.p(i, j)) and 5 <= in.a <= 6",
        inputs="a : INTEGER, p : P",
    )
    assert found.verdict is Verdict.TESTED
    assert found.bound["cases"] == 150


@pytest.mark.slow
def test_a_small_space_of_inputs(tmp_path: Path) -> None:
    found = free(tmp_path, "in.c == on -> out.y == 1", 'def step(c): return 1 if c == "on" else 0', inputs="c : C")
    assert found.verdict is Verdict.TESTED


@pytest.mark.slow
def test_data_sequences_tuples_functions_and_unspecified_sorts(tmp_path: Path) -> None:
    subject = """
def step(d, f, u, p):
    kind, *parts = d
    assert isinstance(u, str) and f(parts[0]) == dict(f.items()).get(parts[0], f.default)
    g = f.updated(parts[0], 7)
    return {"e": ("pair", parts[0], parts[-1]), "g": g, "v": u, "h": {1: 5, ...: 2}}
"""
    found = free(
        tmp_path,
        "(forall(i in INTEGER | in.d == leaf(i) -> out.e == pair(i, i) and out.g(i) == 7)) and out.v == in.u"
        " and out.h(1) == 5 and out.h(2) == 2",
        subject,
        inputs="d : D, f : F, u : U, p : P",
        outputs="e : D, g : F, v : U, h : F",
    )
    assert found.verdict is Verdict.TESTED, found.summary


@pytest.mark.slow
def test_what_cannot_be_judged_is_not_green(tmp_path: Path) -> None:
    hard = "forall(i in INTEGER | i * i * i + out.y * i != 42 * in.a + 11 * i * i) or out.y == 1 / (in.a - in.a)"
    found = free(tmp_path, hard, "def step(a): return a", cases=3)
    assert not found.verdict.supports or found.verdict is Verdict.TESTED
    if found.verdict is Verdict.TESTED:
        pytest.fail("an undecidable formula passed for tested")


@pytest.mark.parametrize(("cases", "bound"), [(1, 0.95), (59, 0.0495), (300, 0.00994), (2000, 0.0015)])
def test_the_confidence_statement(cases: int, bound: float) -> None:
    assert failure_bound(cases) == pytest.approx(bound, rel=0.01)


# -- bad plans ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("subject", "text", "code", "file"),
    [
        ("s.py", STEP, "HYPO100", "plan.yaml"),
        ("s.py:1x", STEP, "HYPO100", "plan.yaml"),
        ("t.py:step", STEP, "HYPO101", "plan.yaml"),
        ("../s.py:step", STEP, "HYPO101", "plan.yaml"),
        ("s.py:stepp", STEP, "HYPO102", "plan.yaml"),
        ("s.py:step", "def step(:", "HYPO103", "s.py"),
        ("s.py:step", "\0", "HYPO103", None),
        ("s.py:step", "def step(R): pass", "HYPO104", "s.py"),
        ("s.py:step", "def step(r, /): pass", "HYPO104", "s.py"),
        ("s.py:step", "async def step(r): pass", "HYPO104", "s.py"),
    ],
)
def test_bad_subjects_are_located(tmp_path: Path, subject: str, text: str, code: str, file: str | None) -> None:
    wanted = make_job(tmp_path, sensor(), "sensor", {"subject": subject}, {"s.py": text}, "hypothesis")
    found = BACKEND.check(wanted)
    assert [d.code for d in found] == [code]
    assert found[0].span is not None
    assert file is None or Path(found[0].span.file).name == file
    assert {o.verdict for o in run(wanted).outcomes} == {Verdict.ERROR}
    assert BACKEND.export(wanted) == {}


def test_files_beside_the_subject_count(tmp_path: Path) -> None:
    wanted = job(tmp_path, "import os\nfrom limits import LOW\nimport helper.more\n" + STEP)
    for name, text in {"limits.py": "import s", "helper/__init__.py": "", "other.py": ""}.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    names = [path.relative_to(tmp_path).as_posix() for path in BACKEND.files(wanted)]
    assert names == ["helper/__init__.py", "limits.py", "s.py"]


def test_optional_arguments_and_keywords(tmp_path: Path) -> None:
    assert BACKEND.check(job(tmp_path / "a", "def step(r, *, mode=1, **more): pass")) == ()
    assert BACKEND.check(job(tmp_path / "b", "from x import step")) == ()


# -- names and texts ---------------------------------------------------------------------------------------------------


STRANGE = """
context {{ S : {{a, b}}; }}
node n {{
  inputs( x' : STRING, class : S ) outputs( import : S ) topics( a/B c matches(in.class) )
  assume( TRUE )
  {guarantees}
}}
"""
GUARANTEE = """guarantee {name} "\\"\\"\\" + __import__('os') {{}} " ( in.x' == "{text}" -> out.import == in.class )
"""
NAMES = ("os", "os'", "exec", "exec'", "import_os", "_")
TEXTS = ("'''", "{}{0}%s", "*/ -->", "); import os #", "ünïcode \U0001f916", "$(x) `y`")


@pytest.mark.slow
def test_names_that_python_has_for_itself_and_strange_texts(tmp_path: Path) -> None:
    guarantees = "".join(GUARANTEE.format(name=name, text=text) for name, text in zip(NAMES, TEXTS, strict=True))
    subject = "def step(**inputs):\n    return inputs['class']"
    found = settle(job(tmp_path, subject, STRANGE.format(guarantees=guarantees), "n", cases=120))
    assert len(found) == len(TEXTS)
    assert {o.verdict for o in found.values()} == {Verdict.TESTED}, found


@pytest.mark.parametrize("depth", [100, 250, 3000])
def test_deep_contracts_do_not_crash(tmp_path: Path, depth: int) -> None:
    deep = "not (" * depth + "out.y == 0" + ")" * depth
    try:
        found = free(tmp_path, deep, "def step(a): return 0", cases=5)
    except Rejected:
        return  # the language has its own limit
    assert found.verdict in {Verdict.TESTED, Verdict.UNKNOWN, Verdict.ERROR}


def test_a_threshold_that_no_float_is_is_called_so() -> None:
    from avow.backends.hypothesis.backend import _inexact

    told = _inexact((("in.green", "0.6"), ("out.weed", "TRUE")))
    assert told == "; in.green is exactly 0.6, and the float 0.6 is another number: see `numbers:`"
    assert _inexact((("in.green", "0.5"), ("in.on", "TRUE"), ("out.x", "0.6"))) == ""
