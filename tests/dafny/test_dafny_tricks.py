"""False implementations and all the ways to make Dafny say "0 errors": none of them may ever be proved."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from helpers import some

from avow.backend_kit.protocol import Job, Limits
from avow.backends.dafny import BACKEND, judge, scanner
from avow.backends.dafny.scanner import Scan, scan, tokens
from avow.base.verdict import Outcome, Verdict

MakeJob = Callable[..., Job]

CONTRACT = """
context { Light : {red, green}; }
node lamp {
  inputs( r : REAL )
  outputs( light : Light, n : NATURAL )
  topics( )
  assume sane ( 0 <= in.r )
  guarantee low ( in.r < 10 -> out.light == green )
  guarantee high ( 10 <= in.r -> out.light == red )
  guarantee count ( out.n > 0 )
}
"""

GOOD = """\
include "lamp_spec.dfy"
module LampImpl refines LampSpec {
  predicate Env(in_r: real) { true }
  lemma EnvNotEmpty() returns (in_r: real) { in_r := 0.0; }
  method Step(in_r: real) returns (out_light: Types.Light, out_n: nat)
  {
    out_n := 1;
    if in_r < 10.0 { out_light := Types.Light.green; } else { out_light := Types.Light.red; }
  }
}
"""
WRONG = GOOD.replace("Types.Light.red", "Types.Light.green")


def settle(make_job: MakeJob, root: Path, text: str) -> dict[str, Outcome]:
    (root / "lamp.dfy").write_text(text, encoding="utf-8")
    job = make_job(CONTRACT, "lamp", implementation="lamp.dfy")
    BACKEND.check(job)
    report = BACKEND.discharge(job, root, Limits(seconds=120))
    return {o.obligation.rsplit("/", 1)[1]: o for o in report.outcomes}


def wrong(old: str, new: str) -> str:
    assert old in WRONG, old
    return WRONG.replace(old, new)


STEP = "  method Step("
BODY = "    out_n := 1;\n"
HEAD = "module LampImpl refines LampSpec {\n"

TRICKS = {
    "assume false": wrong(BODY, BODY + "    assume false;\n"),
    "verify false": wrong("method Step", "method {:verify false} Step"),
    "verify false on the module": wrong("module LampImpl", "module {:verify false} LampImpl"),
    "an axiom": wrong(STEP, "  lemma {:axiom} No() ensures false\n" + STEP).replace(BODY, BODY + "    No();\n"),
    "a lemma without body": wrong(STEP, "  lemma No() ensures false\n" + STEP).replace(BODY, BODY + "    No();\n"),
    "a lemma that calls itself": wrong(STEP, "  lemma No() ensures false decreases * { No(); }\n" + STEP),
    "a function without body": wrong(
        STEP, "  function No(): int\n    ensures false\n" + STEP
    ).replace(BODY, BODY + "    ghost var x := No();\n"),
    "a function with a match in its ensures and no body": wrong(
        STEP,
        "  function No(l: Types.Light): int\n    ensures match l { case red => false case green => false }\n" + STEP,
    ).replace(BODY, BODY + "    ghost var x := No(out_light);\n"),
    "no termination": wrong(
        "returns (out_light: Types.Light, out_n: nat)\n",
        "returns (out_light: Types.Light, out_n: nat)\n    decreases *\n",
    ).replace(BODY, BODY + "    while true decreases * { }\n"),
    "a step without body": GOOD[: GOOD.index("  {\n    out_n")] + "}\n",
    "an empty module": 'include "lamp_spec.dfy"\n' + HEAD + "}\n",
    "an empty file": "",
    "another module's name": GOOD.replace("LampImpl", "OtherImpl"),
    "no refinement": GOOD.replace(" refines LampSpec", ""),
    "an abstract module": GOOD.replace("module LampImpl", "abstract module LampImpl"),
    "within another module": f"module Outer {{\n{WRONG.replace(chr(10), ' ', 1)}}}\n",
    "options on the module": wrong("module LampImpl", 'module {:options "/noVerify"} LampImpl'),
    "extern": wrong("method Step", "method {:extern} Step"),
    "an extern lemma": wrong(STEP, "  lemma {:extern} No() ensures false\n" + STEP).replace(BODY, BODY + "    No();\n"),
    "an inclusion": 'include "other.dfy"\n' + WRONG,
    "an inclusion that escapes": 'include "../../etc/lamp_spec.dfy.dfy"\n' + WRONG,
    "a constant of no type": wrong(
        STEP, "  type No = x: int | false witness *\n  const no: No\n" + STEP
    ),
    "a false predicate of the same name": wrong(
        STEP, "  predicate high(in_r: real, out_light: Types.Light) { true }\n" + STEP
    ),
    "a module Contract inside": wrong(
        STEP, "  module Contract { predicate high(r: real, l: int) { true } }\n" + STEP
    ),
    "another import of that name": "module Evil { }\n" + wrong(HEAD, HEAD + "  import Contract = Evil\n"),
    "another datatype of that name": wrong(STEP, "  datatype Light = red | green\n" + STEP),
    "an Env that nothing meets": wrong("{ true }", "{ in_r < 0.0 }"),
    "an Env that nothing meets, with a lemma that assumes": wrong("{ true }", "{ in_r < 0.0 }").replace(
        "in_r := 0.0;", "assume in_r < 0.0 && 0.0 <= in_r;"
    ),
    "its own precondition": wrong(
        "out_n: nat)\n", "out_n: nat)\n    requires in_r < 10.0\n"
    ),
    "a forall without body": wrong(BODY, BODY + "    forall x: int ensures x == x + 1;\n    assert 0 == 1;\n"),
    "a loop without body": wrong(BODY, BODY + "    var k := 0;\n    while k < 3 invariant k == 0 decreases 3 - k;\n"),
    "a false function in an abstract module": "abstract module Evil {\n  function No(): int ensures false\n}\n"
    + wrong(HEAD, HEAD + "  import E : Evil\n").replace(BODY, BODY + "    ghost var x := E.No();\n"),
    "a false function in a class": wrong(
        STEP, "  class C { static function No(): int ensures false }\n" + STEP
    ).replace(BODY, BODY + "    ghost var x := C.No();\n"),
    "a class with another Step": GOOD[: GOOD.index("  method Step")]
    + "  class C { method Step(in_r: real) returns (out_light: int) { } }\n"
    + GOOD[GOOD.index("  method Step") : GOOD.index("  {\n    out_n")]
    + "}\n",
    "a step left to the specification": GOOD[: GOOD.index("  method Step")]
    + "  class C { method Step(in_r: real) { } }\n}\n",
    "not Dafny at all": "}}}} \x00 {:verify",
    "only a comment": "/* " + GOOD + " */",
    "an attribute of a later Dafny": wrong(STEP, "  @Verify(false)\n" + STEP),
    "assume by another name": wrong(BODY, BODY + "    assume/**/ false;\n"),
    "assume in a helper's calc": wrong(
        STEP, "  lemma No() ensures false { calc { 1; { assume 1 == 2; } 2; } }\n" + STEP
    ).replace(BODY, BODY + "    No();\n"),
    "a false claim about division": wrong(BODY, BODY + "    assert 1 / 0 == 2;\n"),
}  # fmt: skip


@pytest.mark.needs_dafny
@pytest.mark.nightly  # each costs some seconds of Dafny; what the scanner says of each is tested for all, below
@pytest.mark.parametrize("name", TRICKS)
def test_no_trick_is_proved(make_job: MakeJob, tmp_path: Path, name: str) -> None:
    outcomes = settle(make_job, tmp_path, TRICKS[name])
    verdicts = {outcome.verdict for outcome in outcomes.values()}
    # `low` and `count` may be proved of the wrong lamp where nothing else is amiss, but never `high`
    assert outcomes["high"].verdict in (Verdict.UNKNOWN, Verdict.ERROR), outcomes["high"]
    assert verdicts <= {Verdict.UNKNOWN, Verdict.ERROR, Verdict.PROVED}


@pytest.mark.needs_dafny
@pytest.mark.slow
def test_the_good_lamp_is_proved(make_job: MakeJob, tmp_path: Path) -> None:
    for outcome in settle(make_job, tmp_path, GOOD).values():
        assert outcome.verdict is Verdict.PROVED, outcome


@pytest.mark.slow
@pytest.mark.needs_dafny
def test_only_the_broken_guarantee_is_unproved(make_job: MakeJob, tmp_path: Path) -> None:
    outcomes = settle(make_job, tmp_path, WRONG)
    assert outcomes["high"].verdict is Verdict.UNKNOWN
    assert "postcondition" in outcomes["high"].summary
    assert outcomes["low"].verdict is Verdict.PROVED
    assert outcomes["count"].verdict is Verdict.PROVED


@pytest.mark.needs_dafny
@pytest.mark.slow
def test_what_env_adds_is_a_hypothesis(make_job: MakeJob, tmp_path: Path) -> None:
    outcome = settle(make_job, tmp_path, WRONG.replace("{ true }", "{ in_r < 10.0 }"))["high"]
    assert outcome.verdict is Verdict.PROVED
    assert outcome.hypotheses == ("added assumption of the implementation, Env: in_r < 10.0",)


@pytest.mark.needs_dafny
@pytest.mark.slow
@pytest.mark.parametrize("name", some(["assume false", "an axiom", "extern", "no termination"], 1))
def test_what_is_taken_for_granted_is_shown(make_job: MakeJob, tmp_path: Path, name: str) -> None:
    """Here on the good lamp: all verifies, and still it is no proof."""
    good = TRICKS[name].replace("else { out_light := Types.Light.green; }", "else { out_light := Types.Light.red; }")
    for outcome in settle(make_job, tmp_path, good).values():
        assert outcome.verdict in (Verdict.UNKNOWN, Verdict.ERROR), outcome


ENV = "  predicate Env(in_r: real) { true }\n"
NARROW = "  predicate Env(in_r: real) { in_r < 10.0 }\n"
DECOY = "predicate Env(in_r: real) { true }"
DECOYS = {
    "another module before": f"module Decoy {{ {DECOY} }}\n" + WRONG.replace(ENV, NARROW),
    "another module behind": WRONG.replace(ENV, NARROW) + f"module Decoy {{ {DECOY} }}\n",
    "the top level": f"{DECOY}\n" + WRONG.replace(ENV, NARROW),
    "a module within": WRONG.replace(ENV, f"  module Inner {{ {DECOY} }}\n" + NARROW),
    "a module of the same name within": WRONG.replace(ENV, f"  module LampImpl {{ {DECOY} }}\n" + NARROW),
    "a module of the same name within another": f"module Out {{ module LampImpl {{ {DECOY} }} }}\n"
    + WRONG.replace(ENV, NARROW),
    "a module of a longer name": f"module LampImplementation {{ {DECOY} }}\n" + WRONG.replace(ENV, NARROW),
    "a class": WRONG.replace(ENV, f"  class C {{ static {DECOY} }}\n" + NARROW),
    "a datatype's member": WRONG.replace(ENV, f"  class C {{ {DECOY} }}\n" + NARROW),
    "a comment": WRONG.replace(ENV, f"  // {DECOY}\n  /* {DECOY} */\n" + NARROW),
    "a string": WRONG.replace(ENV, f'  const s := "{DECOY}";\n' + NARROW),
    "a verbatim string": WRONG.replace(ENV, f'  const s := @"{DECOY}";\n' + NARROW),
    "a clause": WRONG.replace(ENV, NARROW.replace("{", "decreases {true} {")),
    "a clause with more": WRONG.replace(ENV, NARROW.replace("{", "decreases {true} + {false} {")),
    "an imported module": f"module Decoy {{ {DECOY} }}\n"
    + WRONG.replace(ENV, "  import opened Decoy\n" + NARROW),
    "a refined module": f"module Decoy refines LampSpec {{ {DECOY} lemma EnvNotEmpty() returns (in_r: real)"
    " { in_r := 0.0; } }\n" + WRONG.replace(ENV, NARROW),
    "attributes": WRONG.replace(ENV, f"  module M {{ {DECOY} }}\n" + NARROW.replace("Env(", "{:opaque} Env(")),
    "a helper": WRONG.replace(ENV, "  predicate Env(in_r: real) { Free(in_r) } predicate Free(r: real) { r < 10.0 }\n"),
    "a predicate called true": WRONG.replace(ENV, "  predicate Env(in_r: real) { True() && in_r < 10.0 }\n"
    "  predicate True() { true }\n"),
    "a chain": WRONG.replace("include \"lamp_spec.dfy\"\nmodule LampImpl", "module Mid").replace(ENV, NARROW)
    + "module LampImpl refines Mid { }\n",
    "braces in Env": WRONG.replace(ENV, "  predicate Env(in_r: real) { in_r in (set x: int | x in {1, 2} :: 1.0) }\n"),
    "nothing meets it": WRONG.replace(ENV, f"  module M {{ {DECOY} }}\n  predicate Env(in_r: real) {{ false }}\n"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.needs_dafny
@pytest.mark.parametrize(
    "name",
    [n if n == "a clause" else pytest.param(n, marks=pytest.mark.nightly) for n in DECOYS],
)
def test_no_decoy_hides_what_env_adds(make_job: MakeJob, tmp_path: Path, name: str) -> None:
    """`high` is false of this lamp; it can be proved only under the real Env, and then that is a hypothesis."""
    outcome = settle(make_job, tmp_path, DECOYS[name])["high"]
    if outcome.verdict is Verdict.PROVED:
        (told,) = outcome.hypotheses
        assert told.startswith("added assumption of the implementation, Env: ")
        assert told.removeprefix("added assumption of the implementation, Env: ") not in ("", "true")
    else:
        assert outcome.verdict in (Verdict.UNKNOWN, Verdict.ERROR), outcome


@pytest.mark.slow
@pytest.mark.needs_dafny
@pytest.mark.parametrize(
    ("asked", "about_nothing"),
    some(
        [
            ("in_r < 10.0", {"high"}), ("in_r < 12.0", set()), ("10.0 <= in_r", {"low"}),
            ("exists k: int :: k < 4 && in_r == k as real", {"high"}),
        ],
        0, slow=2,
    ),
)  # fmt: skip
def test_a_guarantee_that_env_leaves_nothing_to_say_is_vacuous(
    make_job: MakeJob, tmp_path: Path, asked: str, about_nothing: set[str]
) -> None:
    env = ENV.replace("true", asked)
    given = "in_r := 11.0" if "10.0 <=" in asked else "assert 3 < 4 && 3.0 == 3 as real; in_r := 3.0"
    told = settle(make_job, tmp_path, GOOD.replace(ENV, env).replace("in_r := 0.0", given))
    assert {o.verdict for o in told.values()} == {Verdict.PROVED}, told
    assert {name for name, o in told.items() if o.vacuous} == about_nothing


@pytest.mark.slow
@pytest.mark.needs_dafny
@pytest.mark.parametrize("text", some(["in_r < 10.0", "true"], 1))
def test_a_wrong_scanner_proves_nothing(
    make_job: MakeJob, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    """Whatever the scan takes Env to be, Dafny's own word counts."""
    told = "true" if text != "true" else "in_r < 10.0"
    monkeypatch.setattr(scanner, "_body_of_env", lambda *_: told)
    monkeypatch.setattr(judge, "resolved_environment", lambda program, module: told)
    for outcome in settle(make_job, tmp_path, WRONG.replace("{ true }", f"{{ {text} }}")).values():
        if told == "true":
            assert outcome.verdict is Verdict.UNKNOWN, outcome
        else:
            assert outcome.verdict is Verdict.UNKNOWN or outcome.hypotheses, outcome


def scanned(text: str) -> Scan:
    return scan(text, "LampSpec", "LampImpl", ("types.dfy", "lamp_contract.dfy", "lamp_spec.dfy"))


class TestScan:
    def test_the_good_lamp_takes_nothing_for_granted(self) -> None:
        found = scanned(GOOD)
        assert found.hypotheses == ()
        assert found.problems == ()
        assert found.environment == "true"
        assert found.members == (("lemma", "EnvNotEmpty"), ("method", "Step"))
        assert "include" not in found.text
        assert found.text.count("\n") == GOOD.count("\n")

    @pytest.mark.parametrize(
        "text",
        [
            "// assume false {:axiom}\n",
            "/* assume /* nested */ {:verify false} */",
            'const s := "assume {:axiom} /* ";',
            'const s := @"a""assume";',
            "method M() { var c := '\"'; var d := '\\''; }",
            'module {:options "--function-syntax:4"} M { }',
            "method M(x': int, x'': int) { }",
            "lemma {:induction false} L() { }",
        ],
    )
    def test_comments_and_strings_hide_and_show_nothing(self, text: str) -> None:
        assert scanned(GOOD + text).hypotheses == ()

    @pytest.mark.parametrize(
        "text",
        [
            "method M() { assume false; }",
            "/* */ assume x;",
            "/* /* */ */ assume x;",
            "// \nassume x;",
            '"\\"" assume x;',
            "'\"' assume x;",
            "method {:axiom} M()",
            "method {: axiom} M()",
            "method { :axiom} M()",
            "method {/* */:/* */axiom} M()",
            "// a comment\rassume false;",
            "#if X\n/*\n#endif\nassume false;\n#if X\n*/\n#endif\n",
            "method M() { var x := 0.assume; }",
            "method {:verify\nfalse} M()",
            'module {:options "--function-syntax:3", "/noVerify"} M { }',
            'module {:options "/noVerify"} M { }',
            "const c: int",
            "const c: int\nmethod M() { var x := 1; }",
            "type T",
            "type T(==)",
            "decreases *",
            "witness *",
            "expect x;",
            "@Axiom method M()",
            "trait T { }",
            "abstract module M { }",
            "method {:unheard_of} M() { }",
        ],
    )
    def test_openings_are_seen(self, text: str) -> None:
        assert scanned(GOOD + text).hypotheses

    @pytest.mark.parametrize("name", DECOYS)
    def test_decoys_are_not_read_as_env(self, name: str) -> None:
        assert scanned(DECOYS[name]).environment != "true"

    def test_env_is_read_as_dafny_resolves_it(self) -> None:
        resolved = """
/* module LampImpl refines LampSpec { predicate Env(in_r: real) { false } } */
module Decoy { predicate Env(in_r: real) { true } }
module LampImpl refines LampSpec {
  module LampImpl { predicate Env(in_r: real) { true } }
  class C { predicate Env(in_r: real) { true } }
  predicate Env(in_r: real)
    decreases in_r
  {
    in_r < 5.0 /* a comment */ &&
    forall x: real ::
      x == in_r
  }
}
"""
        assert scanner.resolved_environment(resolved, "LampImpl") == "in_r < 5.0 && forall x: real :: x == in_r"
        assert scanner.resolved_environment(resolved, "LampSpec") is None
        assert scanner.resolved_environment(resolved + resolved, "LampImpl") is None

    def test_an_unended_comment_or_string_ends_the_scan_quietly(self) -> None:
        for text in ("/* /* */", '"abc', '@"abc', "'", "{:", "include", "module", "const", "type", "predicate Env("):
            scanned(text)
            tokens(text)
