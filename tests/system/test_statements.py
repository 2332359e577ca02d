"""What people say in a plan: of what is supposed, and of requirements in prose that they confirmed."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.system.statements import expired, not_validated, without_words

from .test_system import A, faults, make


@pytest.mark.parametrize(
    ("link", "edit", "suspect"),
    [
        ("a.g1", ("out.x <= 5", "out.x <= 6"), True),
        ("a", ("out.x <= 5", "out.x <= 6"), True),
        ("D", ("out.x <= 5", "out.x <= 6"), True),
        ("a.g1", ("Top = 9", "Top = 8"), True),
        ("a.g1", ("x : REAL )", "x : INTEGER )"), True),
        ("a.g1", ('"It stays low"', '"It stays"'), True),
        ("a.g1", ("out.x <= 7", "out.x <= 6"), False),
        ("a", ("out.x <= 7", "out.x <= 6"), True),
        ("a.g1", ("guarantee g1", "// nothing\n  guarantee g1"), False),
        ("a", ("( out.x <= 5 and out.x <= Top )", "(\n out.x <= 5 and  out.x <= Top )"), False),
    ],
)
def test_a_changed_guarantee_makes_what_is_linked_to_it_suspect(
    tmp_path: Path, link: str, edit: tuple[str, str], suspect: bool
) -> None:
    rcl = (
        "context { Top = 9; } node a { inputs( r : REAL ) outputs( x : REAL ) topics()\n"
        'guarantee g1 "It stays low" ( out.x <= 5 and out.x <= Top )\n guarantee g2 ( out.x <= 7 ) }\n'
    )
    plan = (
        "compose: {{D: {{select: [a]}}}}\n"
        "requirements: {{R: {{text: T, supported_by: [{0}], "
        "validation: {{who: A. P., date: 2026-01-01, sentence: '{1}', formula: '{2}'}}}}}}"
    )
    first = make(tmp_path / "a", rcl, plan.format(link, "?", "?"))
    assert len(list(not_validated(first))) == 1
    (asked,) = first.plan.requirements
    digests = asked.sentence_digest, asked.formula_digest
    assert not list(not_validated(make(tmp_path / "b", rcl, plan.format(link, *digests))))
    assert edit[0] in rcl
    changed = make(tmp_path / "c", rcl.replace(*edit), plan.format(link, *digests))
    assert [d.code for d in not_validated(changed)] == ["PLAN129"] * suspect


def test_what_is_supposed_without_plain_words_is_a_warning(tmp_path: Path) -> None:
    said = make(tmp_path / "a", A, "environment: {a.r: {assume: '0 <= in.r', because: b, says: It is small}}")
    silent = make(tmp_path / "b", A, "environment: {a.r: {assume: '0 <= in.r', because: b}}")
    assert [d.code for d in without_words(said)] == []
    assert [d.code for d in without_words(silent)] == ["PLAN128"]
    assert faults(tmp_path / "c", A, "assumptions: {nobody.word: {says: x}}")[0].code == "PLAN106"


def test_that_an_input_does_not_change_has_words_of_its_own(tmp_path: Path) -> None:
    """What is said for an assumption is no reason for this; without an assumption the entry's words are about it."""
    entry = "environment: {{a.r: {{because: b, says: It is small, {}}}}}"
    assumed = "assume: '0 <= in.r', constant: {}"
    own = "{because: c, says: It stays, who: W, until: 2030-01-01}"
    cases = {
        "constant: true": [("a.r", "It is small")],
        "constant: false": [],
        assumed.format("false"): [("a.r", "It is small")],
        assumed.format(own): [("a.r", "It is small"), ("a.r.constant", "It stays")],
        assumed.format("true"): [("a.r", "It is small"), ("a.r.constant", "")],
    }
    for at, (said, wanted) in enumerate(cases.items()):
        system = make(tmp_path / str(at), A, entry.format(said))
        found = [(s.place.removeprefix("environment."), s.says) for s in system.plan.statements]
        assert found == wanted, said
        assert system.plan.environment[0].constant is ("false" not in said)
        silent = [d.hint or "" for d in without_words(system)]
        assert [hint for hint in silent if "constant: {because" in hint] == silent
        assert len(silent) == sum(not words for _, words in wanted)
    gone = make(tmp_path / "gone", A, entry.format(f"until: 2020-02-02, {assumed.format(own)}"))
    assert [d.message for d in expired(gone)] == ["environment.a.r has expired: its last day was 2020-02-02"]
    known = (
        "{obligation: a/sanity/realizable, verdict: refuted, reason: b, who: A, date: 2020-01-01, expires: 2020-02-02}"
    )
    (found,) = expired(make(tmp_path / "known", A, f"accepted: [{known}]"))
    assert found.message == "accepted a/sanity/realizable has expired: its last day was 2020-02-02"
    late = "compose: {whole: {one_output: {because: b, until: 2020-02-02}}}"
    (found,) = expired(make(tmp_path / "late", A, late))
    assert (found.code, found.span and found.span.column) == ("PLAN138", late.index("2020") + 1)
    assert found.message.startswith("compose.whole.one_output has expired")
    assert [d.code for d in faults(tmp_path / "x", A, entry.format(f"constant: {own}"))] == ["PLAN110"]
    assert [d.code for d in faults(tmp_path / "y", A, entry.format("constant: {says: It stays}"))] == ["PLAN104"]


def test_an_entry_that_assumes_nothing_has_words_and_days_that_are_read(tmp_path: Path) -> None:
    entry = "environment: {{a.r: {{because: b, {}}}}}"
    for at, wrong in enumerate(("date: 2026-13-01", "date: 2999-01-01", f"says: {'word ' * 20}", "who: '?'")):
        found = faults(tmp_path / str(at), A, entry.format(wrong))
        assert [d.code for d in found] == ["PLAN115" if "says" in wrong else "PLAN105"], wrong
    gone = make(tmp_path / "gone", A, entry.format("until: 2020-02-02"))
    assert [d.message for d in expired(gone)] == ["environment.a.r has expired: its last day was 2020-02-02"]
    assert not list(without_words(gone))
