"""What only a scenario decides is checked within its ranges, and says so."""

from __future__ import annotations

from pathlib import Path

from avow.base.verdict import Verdict
from avow.calculus.scenario import ranges
from avow.calculus.variables import frame
from avow.formulas.finite import Ranges, interpretation
from avow.language.sorts import NATURAL
from avow.language.subterms import subterms
from avow.language.terms import Quantified
from avow.sanity.analysis import analyse
from avow.sanity.results import Bounds, SanityResult
from avow.solving.questions import entails
from avow.system.load import load_system

from .contracts import formula, node

SQUARES = """node n { inputs( n : NATURAL ) outputs( a : NATURAL, b : NATURAL, c : NATURAL, d : NATURAL ) topics()
  assume( in.n != 7 )
  guarantee( out.a * out.a + out.b * out.b + out.c * out.c + out.d * out.d == in.n ) }"""


def realizable(folder: Path, domain: str) -> SanityResult:
    """Every number but 7 is the sum of three squares: true up to 14, and beyond any solver in general."""
    (folder / "system.rcl").write_text(SQUARES)
    (folder / "plan.yaml").write_text(f"scenario:\n  domains: {{in.n: {domain}}}\n")
    system = load_system(folder)
    of = system.contract.nodes[0]
    given, few = interpretation(of, system.plan.scenario), ranges(frame(system), of)
    (found,) = analyse(of, scenario=given, ranges=few, bounds=Bounds(200), wanted=["realizable"])
    return found


def test_a_claim_that_holds_within_the_ranges_is_checked(tmp_path: Path) -> None:
    found = realizable(tmp_path, "0..3")
    assert found.verdict is Verdict.CHECKED
    assert found.bounded


def test_no_input_in_the_ranges_checks_nothing(tmp_path: Path) -> None:
    assert realizable(tmp_path, "[7]").verdict is not Verdict.CHECKED


def test_quantifiers_range_over_the_values() -> None:
    within = node("inputs( f : NATURAL --> NATURAL ) outputs( v : NATURAL )| guarantee( out.v == 0 )")
    few = Ranges({NATURAL: (1, 2, 5)})

    def same(one: str, other: str) -> bool:
        changed = few.within(formula(one, within))
        assert not [part for part in subterms(changed) if isinstance(part, Quantified)]
        wanted = formula(other, within)
        return entails([changed], wanted).verdict is entails([wanted], changed).verdict is Verdict.PROVED

    assert same("forall(i in NATURAL | in.f(i) > i)", "in.f(1) > 1 and in.f(2) > 2 and in.f(5) > 5")
    assert same("exists(i in NATURAL | in.f(i) == 3)", "in.f(1) == 3 or in.f(2) == 3 or in.f(5) == 3")
    assert same(
        "exists_unique(i in NATURAL | i > 1 and in.f(i) == 3)",
        "(in.f(2) == 3 and in.f(5) != 3) or (in.f(2) != 3 and in.f(5) == 3)",
    )
