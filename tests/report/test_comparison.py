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
from assurance.sample import case, evidence, guarantee, keys_of, obligation, rover_parts, system
from click import UsageError
from click.testing import CliRunner

from avow.assurance.answers import ChangeLine
from avow.assurance.changes import KINDS, compare, is_worse
from avow.assurance.model import Case
from avow.assurance.state import State, state_of
from avow.base.diagnostics import Rejected, Span
from avow.base.files import sha256
from avow.base.verdict import Object, Verdict
from avow.cli.diff import command as diff
from avow.evidence.obligation import Kind
from avow.evidence.record import Evidence
from avow.report import render_all
from avow.report.comparison import render_comparison
from avow.system.plan import Requirement
from report.hostile import NAME, hostile_case
from report.test_page import Page

TARGET = guarantee("n", "g", "n does g")


def made(*records: Evidence, keys: dict[tuple[str, str], str] | None = None, target: Any = TARGET) -> State:
    return state_of(case(system({"n": ["g"]}), [target], records, keys=keys))


def only(old: State, new: State) -> ChangeLine:
    (found,) = [c for c in compare(old, new) if c.about not in ("gate", "deficit", "assumption", "file")]
    return found


def test_an_answer_where_there_was_none() -> None:
    change = only(made(), made(evidence(TARGET)))
    assert (change.kind, change.before, change.after) == ("better", "missing", "proved")
    assert change.edits == ("n.g by hoare: proved (model)",)
    assert change.words == "missing → proved: “n does g”"


def test_a_changed_file_is_named_with_what_came_of_it() -> None:
    """Also if every verdict is as before; files of another method are no reason."""
    first = evidence(TARGET, inputs={"m/a.imp": "1" * 64, "m/b.imp": "3" * 64})
    again = {"key": "k2", "inputs": {"m/a.imp": "2" * 64, "m/c.imp": "3" * 64}}
    refuted = evidence(TARGET, Verdict.REFUTED, **again)
    found = {c.subject: c for c in compare(made(first), made(first, refuted))}
    assert found["m/a.imp"].words == "m/a.imp changed: proved → refuted: “n does g”"
    assert found[TARGET.id].edits[0] == "m/a.imp changed"
    same = {c.subject: c for c in compare(made(first), made(first, evidence(TARGET, **again)))}
    assert same["m/a.imp"].words == "m/a.imp changed: 1 claim re-run, same verdict"
    assert (same["m/b.imp"].words, same["m/c.imp"].words) == ("m/b.imp is read no more", "m/c.imp is read now")
    assert not any(is_worse(change) for change in same.values())


def test_asked_again_with_the_same_verdict_by_another_version() -> None:
    first, again = evidence(TARGET), evidence(TARGET, key="k2", tool_version="2.0")
    assert only(made(first), made(first, again)).kind == "rerun"


def test_an_answer_that_does_not_count_any_more_says_why() -> None:
    record = evidence(TARGET)
    stale = only(made(record), made(record, keys={(TARGET.id, "hoare"): "another"}))
    assert (stale.kind, stale.after) == ("open", "stale")
    assert "an input, an option or a tool has changed since" in stale.edits[0]
    withdrawn = only(made(record), made(record, keys={}))
    assert "the plan no longer uses the method" in withdrawn.edits[0]


def test_lost_evidence_is_a_loss_though_other_evidence_stays() -> None:
    """A method that is gone, or that shows less: more failures may be, fewer cases, a lower verdict, a model only."""
    other = evidence(TARGET, method="tests")

    def tested(cases: int, **of: Any) -> Evidence:
        bound = {"cases": cases, "failure_probability_below": round(3 / cases, 6)}
        return evidence(TARGET, Verdict.TESTED, **{"bound": bound, "of": Object.SOURCE, **of})

    whole = made(other, tested(100))
    gone = only(whole, made(other))
    assert (gone.kind, is_worse(gone)) == ("gone", True)
    assert gone.words == "n.g by hoare: the evidence is gone: tested (source), 100 judged, at most 3 % fail"
    for less, after in (
        (tested(50), "tested (source), 50 judged, at most 6 % fail"),
        (tested(50, bound={"cases": 50}), "tested (source), 50 judged"),
        (evidence(TARGET, Verdict.UNKNOWN, of=Object.SOURCE), "unknown (source)"),
        (tested(100, vacuous=True), "vacuous (source), 100 judged, at most 3 % fail"),
    ):
        change = only(whole, made(other, less))
        assert (change.kind, change.after) == ("weaker", after)
        assert is_worse(change)
    assert only(made(other, tested(50)), whole).kind == "better"
    assert only(whole, made(other, tested(100, of=Object.MODEL))).kind == "meaning"


def test_another_meaning_is_no_loss_and_no_gain() -> None:
    other = replace(TARGET, digest="f" * 64)
    found = {c.kind for c in compare(made(evidence(TARGET)), made(evidence(other), target=other))}
    assert found == {"meaning", "rerun"}


def test_consequences_name_their_cause() -> None:
    subject, obligations, records, keys, extras = rover_parts()
    old = state_of(case(subject, obligations, records, keys=keys, **extras))
    broken = [*records, evidence("agent.exit_on_danger", Verdict.REFUTED)]
    new = state_of(case(subject, obligations, broken, keys={**keys, **keys_of(broken)}, **extras))
    found = {c.subject: c for c in compare(old, new)}
    cause = found["rover/agent/guarantee/exit_on_danger"]
    assert cause.kind == "open"
    assert any(cause.words in c.edits for c in found.values() if c.about == "requirement")


def test_comparing_is_fair_both_ways() -> None:
    """What is lost one way is gained the other way, for random sets of evidence."""
    mirror = {"weaker": "better", "open": "better", "better": "lost", "gone": "new", "new": "gone"}
    targets = [guarantee("n", f"g{k}") for k in range(6)]
    subject, claims = system({"n": [t.name for t in targets]}), {t.id for t in targets}
    for seed in range(25):
        rng = random.Random(seed)

        def some(rng: random.Random = rng) -> State:
            chosen = [t for t in targets if rng.random() < 0.8]
            records = [evidence(t, rng.choice([*Verdict]), rng.choice(["hoare", "dafny"])) for t in chosen * 2]
            return state_of(case(subject, chosen, records))

        old, new = some(), some()
        there, back = compare(old, new), compare(new, old)
        kinds = {c.subject: mirror.get(c.kind, c.kind) for c in there if c.subject in claims}
        lost = {"weaker": "lost", "open": "lost"}
        assert kinds == {c.subject: lost.get(c.kind, c.kind) for c in back if c.subject in claims}
        assert compare(old, old) == ()
        assert [KINDS.index(c.kind) for c in there] == sorted(KINDS.index(c.kind) for c in there)


LINES = ["const LOW = 18;", "node n {", "guarantee g ( x > 1 )", "guarantee h ( x > LOW )", "}"]
FILE = "contracts/rover/system.rcl"


def required(lines: list[str], *, moved: str = "", verdict: Verdict = Verdict.PROVED) -> State:
    """Two guarantees, each under a requirement of its own; `moved` means something else."""
    claims = [replace(guarantee("n", name), span=Span(FILE, line, 1, line, 20)) for name, line in (("g", 3), ("h", 4))]
    claims = [replace(claim, digest=sha256(moved + claim.id)) if claim.name in moved else claim for claim in claims]
    asked = [Requirement(name, f"It is {name}.", None, None, (f"n.{name.lower()}",)) for name in ("G", "H")]
    records = [evidence(claim, verdict if claim.name == "h" else Verdict.PROVED) for claim in claims]
    subject = system({"n": ["g", "h"]}, requirements=asked)
    return state_of(case(subject, claims, records, sources={FILE: "\n".join(lines)}))


def edited(at: int, text: str) -> list[str]:
    return [text if n == at else line for n, line in enumerate(LINES, 1)]


@pytest.mark.parametrize(
    ("after", "told"),
    [
        (required(LINES), {}),
        (required(edited(4, "guarantee h ( x > LOW ) // why")), {}),  # it changes no meaning
        (required(edited(4, "guarantee h ( x >= LOW )"), moved="h"), {"h": 4}),
        (required(edited(1, "const LOW = 19;"), moved="h"), {"h": 1}),
        (required(edited(1, "const LOW = 19;"), moved="gh"), {"g": 1, "h": 1}),
        (required(["// a rover", *LINES], verdict=Verdict.REFUTED), {"h": 1, "H": 1}),
        (required(LINES[:3] + LINES[4:], moved="h"), {"h": 4}),
    ],
)
def test_a_change_names_the_edits_that_concern_it(after: State, told: dict[str, int]) -> None:
    found = compare(required(LINES), after)
    lines = [c.subject.rpartition(":") for c in found if c.about == "edit"]
    named = {c.subject.rpartition("/")[2]: c.edits for c in found if c.edits}
    assert {name: int(edits[0].split(":")[1]) for name, edits in named.items()} == told
    assert all((path, int(line)) == (FILE, n) for path, _, line in lines for n in told.values())
    if "H" in told:
        assert "proved → refuted: “n meets h”" in named["H"]


def test_a_requirement_that_moved_has_one_line_with_its_own_evidence() -> None:
    """Its claim's status, which counts a person's reasons below, would be another word for the same."""
    own = obligation("system", Kind.REQUIREMENT, "F")
    asked = Requirement("F", "It is so.", "n.x > 0", None, ())

    def state(verdict: Verdict) -> State:
        return state_of(case(system({"n": []}, requirements=[asked]), [own], [evidence(own, verdict, "compose")]))

    found = [c for c in compare(state(Verdict.PROVED), state(Verdict.REFUTED)) if c.about in ("requirement", "claim")]
    assert [(c.words, c.edits) for c in found] == [
        (
            "F was shown of models, and is refuted",
            ("system/requirement/F by compose: proved (model) → refuted (model)",),
        )
    ]


def test_requirements_that_came_and_went_and_how_each_stands() -> None:
    before, after = required(LINES), required(LINES, verdict=Verdict.REFUTED)

    def asked(old: State, new: State) -> list[tuple[str, bool]]:
        return [(c.words, is_worse(c)) for c in compare(old, new) if c.about == "requirement"]

    assert asked(before, after) == [("H was argued, and is not shown", True)]
    assert asked(after, before) == [("H was not shown, and is argued", False)]
    fewer = replace(before, items={key: of for key, of in before.items.items() if key[1] != "H"})
    assert asked(before, fewer) == [("H is not there any more", True)]
    assert asked(fewer, before) == [("H is new, and argued", False)]
    asks = before.items["requirement", "G"]
    said = replace(before, items={**before.items, ("requirement", "G"): {**asks, "text": ("It is quick.",)}})
    assert asked(before, said) == [("G, text: It is G. → It is quick.", False)]


def test_a_gate_that_needs_a_run_is_not_compared_with_a_conclusion_without_one() -> None:
    whole = case(rover_parts()[0], [TARGET], [], discrepancies=())
    bare = replace(whole, audited=False)
    (title,) = {g.title for g in whole.gates if g.id == "integrity"}
    assert [c.subject for c in compare(State(), state_of(whole)) if c.subject == title] == [title]
    assert compare(state_of(whole), state_of(bare)) == compare(state_of(bare), state_of(whole)) == ()


def pages() -> list[str]:
    subject, obligations, records, keys, extras = rover_parts()
    old = case(subject, obligations, records, keys=keys, **extras)
    fewer = case(subject, obligations[3:], records[: len(records) // 2], keys=keys, **extras)
    evil = hostile_case()
    nothing = State()
    listed: list[tuple[str, Case | None, Case | None]] = [("rover", old, fewer), ("rover", fewer, old)]
    found = [
        render_comparison("a", "b", [(n, c) for c in compare(state_of(x), state_of(y))])
        for n, x, y in listed
        if x and y
    ]
    for one, other in ((nothing, state_of(evil)), (state_of(evil), nothing)):
        found.append(render_comparison(NAME, NAME, [(NAME, c) for c in compare(one, other)]))
    hostile = [ChangeLine(kind, NAME, NAME, NAME, NAME, (NAME,) * 12) for kind in KINDS]
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
        if change["kind"] == "rerun":  # only counted, as on the terminal
            continue
        assert change["words"] in text
        assert all(line in text for line in change.get("edits", [])[:8])
    for nowhere in ("no/such/../\0/x.html", "", "x" * 5000):
        result = run.invoke(diff, ["old", "new", "--html", nowhere], standalone_mode=False)
        assert isinstance(result.exception, UsageError)
    (tmp_path / "blocked").write_text("")
    result = run.invoke(diff, ["old", "new", "--html", "blocked/x.html"], standalone_mode=False)
    assert isinstance(result.exception, Rejected)
    assert result.exception.diagnostics[0].code == "DIFF002"


def test_the_headline_counts_the_marks_of_the_rows() -> None:
    kinds = ("open", "weaker", "deficit", "edit", "better", "new", "rerun", "rerun")
    text = render_comparison("a", "b", [("s", ChangeLine(kind, kind, kind, "", "")) for kind in kinds])
    line = re.search(r"<b>(.*?)</b>", text)
    assert line is not None
    for mark, number in (("✘", 1), ("▼", 2), ("≠", 1), ("▲", 1), ("+", 1), ("⟲", 2)):
        assert f"{mark} {number} " in line[1]
        rows = len(re.findall(f'<span aria-hidden="true">{re.escape(mark)}</span> [a-z]', text))
        assert rows == (0 if mark == "⟲" else number)
