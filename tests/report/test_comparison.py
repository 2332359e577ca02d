"""`avow diff`: what was gained, lost, re-run, and why; as a page that no name can break out of."""

from __future__ import annotations

import json
import random
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from assurance.sample import case, evidence, guarantee, keys_of, rover_parts, system
from click import UsageError
from click.testing import CliRunner

from avow.assurance.compare import ORDER, Change, Snapshot, compare, of_case
from avow.assurance.model import Case
from avow.assurance.naming import short
from avow.base.diagnostics import Rejected, Span
from avow.base.files import sha256
from avow.base.verdict import Verdict
from avow.cli.diff import command as diff
from avow.evidence.record import Evidence
from avow.report import render_all
from avow.report.comparison import render_comparison
from avow.system.plan import Requirement
from report.hostile import NAME, hostile_case
from report.test_page import Page

TARGET = guarantee("n", "g", "n does g")


def made(*records: Evidence, keys: dict[tuple[str, str], str] | None = None, target: Any = TARGET) -> Snapshot:
    return of_case(case(system({"n": ["g"]}), [target], records, keys=keys))


def only(old: Snapshot, new: Snapshot) -> Change:
    (found,) = [c for c in compare(old, new) if c.kind != "gate"]
    return found


def test_an_answer_where_there_was_none() -> None:
    change = only(made(), made(evidence(TARGET)))
    assert (change.kind, change.before, change.after) == ("better", "missing", "proved")
    assert change.why == ("hoare answers now: proved, proved by hoare",)
    assert change.title == "n does g"


def test_asked_again_because_a_file_changed() -> None:
    first = evidence(TARGET, inputs={"m/a.imp": "1" * 64, "m/b.imp": "3" * 64})
    again = evidence(TARGET, Verdict.REFUTED, key="k2", inputs={"m/a.imp": "2" * 64, "m/c.imp": "3" * 64})
    change = only(made(first), made(first, again))
    assert change.kind == "worse"
    files = "m/a.imp changed, m/b.imp is gone, m/c.imp is new"
    assert change.why == (f"hoare was re-run, since {files}: proved → refuted, refuted by hoare",)


def test_asked_again_with_the_same_verdict_by_another_version() -> None:
    first, again = evidence(TARGET), evidence(TARGET, key="k2", tool_version="2.0")
    change = only(made(first), made(first, again))
    assert change.kind == "rerun"
    assert change.text == "re-run: rover/n/guarantee/g (still proved)"
    assert "the tool is another (z3 1.0 → z3 2.0)" in change.why[0]
    assert change.why[0].endswith("proved as before")


def test_an_answer_that_does_not_count_any_more_says_why() -> None:
    record = evidence(TARGET)
    stale = only(made(record), made(record, keys={(TARGET.id, "hoare"): "another"}))
    assert (stale.kind, stale.after) == ("worse", "stale")
    assert stale.why == (
        "hoare's answer (proved) does not count any more: an input, an option or a tool has changed since",
    )
    withdrawn = only(made(record), made(record, keys={}))
    assert "the plan no longer uses the method" in withdrawn.why[0]


def test_another_meaning_is_no_loss_and_no_gain() -> None:
    other = replace(TARGET, digest="f" * 64)
    change = only(made(evidence(TARGET)), made(evidence(other), target=other))
    assert change.kind == "meaning"
    assert "the claim means something else" in change.why[0]


def test_another_meaning_is_named_where_the_old_answer_does_not_count() -> None:
    other = replace(TARGET, digest="f" * 64)
    record = evidence(TARGET)
    change = only(made(record), made(record, keys={(TARGET.id, "hoare"): "k"}, target=other))
    assert change.why == ("hoare's answer (proved) does not count any more: the claim means something else now",)


def test_consequences_name_their_cause() -> None:
    subject, obligations, records, keys, extras = rover_parts()
    old = of_case(case(subject, obligations, records, keys=keys, **extras))
    broken = [*records, evidence("agent.exit_on_danger", Verdict.REFUTED)]
    new = of_case(case(subject, obligations, broken, keys={**keys, **keys_of(broken)}, **extras))
    found = {c.subject: c for c in compare(old, new)}
    assert found["rover/agent/guarantee/exit_on_danger"].kind == "worse"
    resting = [c for c in found.values() if any("agent.exit_on_danger, which is not shown now" in w for w in c.why)]
    assert resting
    back = {c.subject: c for c in compare(new, old)}
    for change in resting:
        assert any("on which it rested" in line for line in back[change.subject].why)


def test_comparing_is_fair_both_ways() -> None:
    """What is lost one way is gained the other way, for random sets of evidence."""
    mirror = {"worse": "better", "better": "worse", "added": "removed", "removed": "added"}
    targets = [guarantee("n", f"g{k}") for k in range(6)]
    subject, claims = system({"n": [t.name for t in targets]}), {t.id for t in targets}
    for seed in range(25):
        rng = random.Random(seed)

        def some(rng: random.Random = rng) -> Snapshot:
            chosen = [t for t in targets if rng.random() < 0.8]
            records = [evidence(t, rng.choice([*Verdict]), rng.choice(["hoare", "dafny"])) for t in chosen * 2]
            return of_case(case(subject, chosen, records))

        old, new = some(), some()
        there, back = compare(old, new), compare(new, old)
        kinds = {c.subject: mirror.get(c.kind, c.kind) for c in there if c.subject in claims}
        assert kinds == {c.subject: c.kind for c in back if c.subject in claims}
        assert compare(old, old) == ()
        assert [ORDER.index(c.kind) for c in there] == sorted(ORDER.index(c.kind) for c in there)


LINES = ["const LOW = 18;", "node n {", "guarantee g ( x > 1 )", "guarantee h ( x > LOW )", "}"]
FILE = "contracts/rover/system.rcl"


def required(lines: list[str], *, moved: str = "", verdict: Verdict = Verdict.PROVED) -> Snapshot:
    """Two guarantees, each under a requirement of its own; `moved` means something else."""
    claims = [replace(guarantee("n", name), span=Span(FILE, line, 1, line, 20)) for name, line in (("g", 3), ("h", 4))]
    claims = [replace(claim, digest=sha256(moved + claim.id)) if claim.name in moved else claim for claim in claims]
    asked = [Requirement(name, f"It is {name}.", None, None, (f"n.{name.lower()}",)) for name in ("G", "H")]
    records = [evidence(claim, verdict if claim.name == "h" else Verdict.PROVED) for claim in claims]
    subject = system({"n": ["g", "h"]}, requirements=asked)
    return of_case(case(subject, claims, records, sources={FILE: "\n".join(lines)}))


def edited(at: int, text: str) -> list[str]:
    return [text if n == at else line for n, line in enumerate(LINES, 1)]


@pytest.mark.parametrize(
    ("after", "told"),
    [
        (required(LINES), {}),
        (required(edited(4, "guarantee h ( x > LOW ) // why")), {}),  # it changes no meaning
        (required(edited(4, "guarantee h ( x >= LOW )"), moved="h"), {"H": 4}),
        (required(edited(1, "const LOW = 19;"), moved="h"), {"H": 1}),
        (required(edited(1, "const LOW = 19;"), moved="gh"), {"G": 1, "H": 1}),
        (required(["// a rover", *LINES], verdict=Verdict.REFUTED), {"H": 1}),
        (required(LINES[:3] + LINES[4:], moved="h"), {"H": 4}),
    ],
)
def test_a_requirement_names_the_edits_that_concern_it(after: Snapshot, told: dict[str, int]) -> None:
    found = {c.subject: c for c in compare(required(LINES), after) if c.kind == "requirement"}
    assert set(found) == set(told)
    for name, line in told.items():
        lines = [why for why in found[name].why if why.startswith(FILE)]
        assert [why.split(":")[1] for why in lines] == [str(line)]
        assert any(f"n.{name.lower()}" in why for why in found[name].why)


def test_requirements_that_came_and_went_and_how_each_stands() -> None:
    before, after = required(LINES), required(LINES, verdict=Verdict.REFUTED)
    (worse,) = [c for c in compare(before, after) if c.kind == "requirement"]
    assert (worse.text, worse.is_worse) == ("H: argued → not shown", True)
    (better,) = [c for c in compare(after, before) if c.kind == "requirement"]
    assert (better.text, better.is_worse) == ("H: not shown → argued", False)
    fewer = replace(before, requirements={"G": before.requirements["G"]})
    (gone,) = compare(before, fewer)
    assert (gone.text, gone.is_worse) == ("H: argued → not claimed any more", True)
    (new,) = compare(fewer, before)
    assert (new.text, new.is_worse) == ("H: new → argued", False)
    said = replace(before.requirements["G"], meaning="0", words="It is quick.")
    (other,) = compare(before, replace(before, requirements={**before.requirements, "G": said}))
    assert (other.text, other.why) == ("G: still argued", ("its text, formula or support is another",))


def test_a_gate_that_needs_a_run_is_not_compared_with_a_conclusion_without_one() -> None:
    whole = case(rover_parts()[0], [TARGET], [], discrepancies=())
    bare = replace(whole, audited=False)
    (title,) = {g.title for g in whole.gates if g.id == "integrity"}
    assert title in of_case(whole).gates
    assert title not in of_case(bare).gates


def pages() -> list[str]:
    subject, obligations, records, keys, extras = rover_parts()
    old = case(subject, obligations, records, keys=keys, **extras)
    fewer = case(subject, obligations[3:], records[: len(records) // 2], keys=keys, **extras)
    evil = hostile_case()
    nothing = Snapshot(evil.system, {}, {})
    listed: list[tuple[str, Case | None, Case | None]] = [("rover", old, fewer), ("rover", fewer, old)]
    found = [
        render_comparison("a", "b", [(n, c) for c in compare(of_case(x), of_case(y))]) for n, x, y in listed if x and y
    ]
    for one, other in ((nothing, of_case(evil)), (of_case(evil), nothing)):
        found.append(render_comparison(NAME, NAME, [(NAME, c) for c in compare(one, other)]))
    hostile = [Change(kind, NAME, NAME, NAME, NAME, (NAME,) * 12) for kind in ORDER]
    found.append(render_comparison(NAME, NAME, [(NAME, c) for c in hostile]))
    return [*found, render_comparison("a", "b", [])]


def test_the_page_holds_against_hostile_names() -> None:
    for text in pages():
        page = Page(text)
        assert page.faults == []
        assert page.open == []
        assert "script" not in page.tags
        assert "img" not in page.tags
        assert not [a for a in page.attributes if a[1].startswith("on")]
        assert len(page.ids) == len(set(page.ids))
        assert ("meta", "http-equiv", "Content-Security-Policy") in page.attributes
        assert page.tags.count("h1") == 1
        assert page.tags.count("th") == len([a for a in page.attributes if a[0] == "th" and a[1] == "scope"])
        levels = [int(tag[1]) for tag in page.tags if re.fullmatch(r"h[1-6]", tag)]
        assert all(b <= a + 1 for a, b in pairwise(levels))


def test_the_page_says_what_the_terminal_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    subject, obligations, records, keys, extras = rover_parts()
    render_all(case(subject, obligations, records, keys=keys, **extras), tmp_path / "old")
    render_all(case(subject, obligations[1:], records[5:], keys=keys, **extras), tmp_path / "new")
    run = CliRunner()
    said = json.loads(run.invoke(diff, ["old", "new", "--json", "--html", "d.html"], standalone_mode=False).output)
    text = " ".join(Page((tmp_path / "d.html").read_text(encoding="utf-8")).text)
    assert len(said["changes"]) > 3
    for change in said["changes"]:
        assert short(change["subject"]) in text
        assert all(line in text for line in change["why"][:8])
    for nowhere in ("no/such/../\0/x.html", "", "x" * 5000):
        result = run.invoke(diff, ["old", "new", "--html", nowhere], standalone_mode=False)
        assert isinstance(result.exception, UsageError)
    (tmp_path / "blocked").write_text("")
    result = run.invoke(diff, ["old", "new", "--html", "blocked/x.html"], standalone_mode=False)
    assert isinstance(result.exception, Rejected)
    assert result.exception.diagnostics[0].code == "DIFF002"
