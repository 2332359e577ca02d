"""Signing a report, and what changed since: through the real commands, with and without keys, and with forged files."""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest
from assurance.sample import case, evidence, guarantee, obligation, system
from click.testing import CliRunner
from helpers import every_text

from avow.assurance.answers import Baseline
from avow.assurance.codec import read_case
from avow.assurance.model import Case
from avow.assurance.signed import newest_signed, sign_case
from avow.assurance.state import baseline_of
from avow.base.diagnostics import Rejected
from avow.base.files import sha256
from avow.base.verdict import Verdict
from avow.cli.diff import command as diff
from avow.cli.sign import command as sign
from avow.evidence.envelope import seal, unseal
from avow.evidence.obligation import SYSTEM_LEVEL, Kind
from avow.evidence.signing import new_key_pair
from avow.recount import recounted
from avow.report import render_all
from avow.report.answers_page import render_answers
from avow.system.plan import Requirement

G = guarantee("n", "g", "n does g", "x > 1")
SUBJECT = system({"n": ["g"]}, requirements=[Requirement("R", "It is safe.", None, None, ("n.g",))])
OWN = obligation(SYSTEM_LEVEL, Kind.REQUIREMENT, "R")
TODAY, LAST = date(2026, 11, 21), date(2027, 11, 21)


def made(verdict: Verdict = Verdict.PROVED, baseline: Baseline | None = None) -> Case:
    return case(SUBJECT, [G], [evidence(G, verdict)], baseline=baseline)


def signed(
    folder: Path, who: str = "A. Person, safety", private: Path | None = None, found: Case | None = None
) -> Path:
    (folder / "report.json").write_text("{}")
    what = found or made()
    return sign_case(what, folder / "report.json", folder / "signed", who=who, until=LAST, today=TODAY, private=private)


def test_a_signature_by_name_is_the_baseline(tmp_path: Path) -> None:
    path = signed(tmp_path)
    found, refused = newest_signed(tmp_path / "signed", "rover")
    assert found is not None
    assert (found.who, found.until, found.name, refused) == ("A. Person, safety", "2027-11-21", path.name, ())
    same = made(baseline=found)
    assert same.answers.signed == "signed by A. Person, safety on 2026-11-21 until 2027-11-21"
    late = made(baseline=replace(found, until="2026-11-20"))
    assert late.answers.signed == "not signed; what A. Person, safety signed on 2026-11-21 stood until 2026-11-20"
    worse = made(Verdict.REFUTED, found)
    assert worse.changes.entries[0].kind == "open"
    assert worse.answers.changed[0][0] == "✘"
    other = replace(G, formula="x > 2", digest="e" * 64)
    moved = case(SUBJECT, [other], [evidence(other, Verdict.REFUTED)], baseline=found)
    (line,) = [entry for entry in moved.changes.entries if entry.subject == "R" and entry.kind == "open"]
    assert line.edits[0] == "“n does g” was “x > 1”, is “x > 2”"
    assert "was “x &gt; 1”, is “x &gt; 2”" in render_answers(moved)


def test_a_constant_of_a_requirement_is_a_change_of_its_meaning() -> None:
    """The requirement's own words stay the same; the excerpt has whole parentheses."""
    asked = Requirement("R", "It is safe.", "n.x >= Margin * (n.y + 1)", None, ("n.g",))
    subject = system({"n": ["g"]}, requirements=[asked])

    def resolved(text: str) -> Case:
        own = replace(OWN, formula=text, digest=sha256(text))
        return case(subject, [G, own], [evidence(G), evidence(own, Verdict.PROVED, "compose")])

    old, new = "n.x ≥ (2 + 1 + n.y) · 5 ∧ n.y < 1", "n.x ≥ (2 + 1 + n.y) · 4 ∧ n.y < 1"
    before = resolved(old)
    after = case(
        subject,
        [G, replace(OWN, formula=new, digest=sha256(new))],
        [evidence(G)],
        baseline=baseline_of(before),
    )
    (line,) = [entry for entry in after.changes.entries if entry.kind == "meaning"]
    assert (line.subject, line.before, line.after) == ("R", old, new)
    assert line.words == "R was “(2 + 1 + n.y) · 5”, is “(2 + 1 + n.y) · 4”"


def test_the_page_shows_the_signed_sentence(tmp_path: Path) -> None:
    """Also after a run that makes no answer again, and if today's sentence has other words."""
    found = made()
    said = found.answers.statement.replace("I know of", "I knew of")
    later = replace(found, answers=replace(found.answers, statement=said))
    path = signed(tmp_path, found=later)
    baseline, _ = newest_signed(tmp_path / "signed", "rover")
    rerun = case(SUBJECT, [G], [evidence(G, run="earlier")], baseline=baseline)
    assert json.loads(base64.b64decode(json.loads(path.read_text())["payload"]))["predicate"]["says"] == said
    for again in (made(baseline=baseline), rerun):
        assert (again.changes.entries, again.answers.statement) == ((), said)
        texts = dict(every_text(again))
        assert f"<p>{said}</p>" in texts["index.html"]
        assert recounted(texts["index.html"], texts["report.json"].encode()) == []
    worse = made(Verdict.REFUTED, baseline)
    assert "I know of" in worse.answers.statement


def test_signing_warns_of_assumptions_without_words_and_of_an_end_before_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("avow.cli.sign.check", lambda *_: ())
    monkeypatch.setattr("avow.cli.sign.stale", lambda *_: ())
    monkeypatch.chdir(tmp_path)
    (tmp_path / "contracts").mkdir()
    (tmp_path / "dodo.py").touch()
    found = made()
    first, *rest = found.assumptions
    told = replace(found, assumptions=(replace(first, says="", until="2027-01-01"), *rest))
    render_all(told, tmp_path / "reports" / "rover")

    def warned(until: str) -> str:
        arguments = ("--report", "reports/rover", "--as", "A. Person", "--until", until)
        done = CliRunner().invoke(sign, arguments, standalone_mode=False)
        assert done.exception is None, done.exception
        return done.stderr

    assert f"without plain words: {first.number}\n" in warned("2027-01-01")
    assert "the first assumption" not in warned("2027-01-01")
    assert "ends on 2027-01-02, the first assumption on 2027-01-01" in warned("2027-01-02")


def test_the_newest_that_verifies_counts(tmp_path: Path) -> None:
    pytest.importorskip("cryptography")
    first, second = signed(tmp_path), signed(tmp_path, "B. Person")
    assert (first.name[:4], second.name[:4]) == ("0001", "0002")
    body = json.loads(second.read_text())
    payload = json.loads(base64.b64decode(body["payload"]))
    payload["predicate"]["baseline"]["verdict"] = "Holds"
    second.write_text(json.dumps(body | {"payload": base64.b64encode(json.dumps(payload).encode()).decode()}))
    found, refused = newest_signed(tmp_path / "signed", "rover")
    assert found is not None
    assert found.who == "A. Person, safety"
    assert refused == (f"{second.name}: what it names is not what it signs",)


def test_with_trusted_keys_only_theirs_count(tmp_path: Path) -> None:
    pytest.importorskip("cryptography")
    new_key_pair(tmp_path / "mine")
    new_key_pair(tmp_path / "other")
    (tmp_path / "signed" / "keys").mkdir(parents=True)
    (tmp_path / "signed" / "keys" / "mine.pub").write_bytes((tmp_path / "mine.pub").read_bytes())
    signed(tmp_path, "with the key", tmp_path / "mine")
    signed(tmp_path, "another key", tmp_path / "other")
    signed(tmp_path, "no key")
    found, refused = newest_signed(tmp_path / "signed", "rover")
    assert found is not None
    assert found.who == "with the key"
    assert found.checked.startswith("with a trusted key")
    assert [line.partition(": ")[2] for line in refused] == ["no trusted key has signed it"] * 2


@pytest.mark.parametrize("at", range(0, 400, 23))
def test_no_byte_of_a_signed_statement_can_be_changed(tmp_path: Path, at: int) -> None:
    pytest.importorskip("cryptography")
    new_key_pair(tmp_path / "k")
    body = json.loads(seal({"a": "b" * 200, "n": [1, 2, 3] * 20}, tmp_path / "k"))
    payload = bytearray(base64.b64decode(body["payload"]))
    payload[at % len(payload)] ^= 1
    text = json.dumps(body | {"payload": base64.b64encode(bytes(payload)).decode()})
    assert isinstance(unseal(text, [tmp_path / "k.pub"]), str)


@pytest.mark.parametrize(
    "text", ["", "{}", "[]", '{"payload": "x"}', '{"payload":"e30=","payloadType":"x","signatures":[]}']
)
def test_what_is_no_envelope_is_told(text: str, tmp_path: Path) -> None:
    assert isinstance(unseal(text), str)
    (tmp_path / "signed" / "rover").mkdir(parents=True)
    (tmp_path / "signed" / "rover" / "0009-x.json").write_text(text)
    assert newest_signed(tmp_path / "signed", "rover")[0] is None


def test_a_signature_of_another_system_is_none(tmp_path: Path) -> None:
    path = signed(tmp_path)
    (tmp_path / "signed" / "crane").mkdir()
    path.rename(tmp_path / "signed" / "crane" / path.name)
    assert newest_signed(tmp_path / "signed", "crane") == (None, (f"{path.name}: it is of another system",))


def test_diff_fails_on_what_is_worse_and_names_both_formulas(tmp_path: Path) -> None:
    other = replace(G, formula="x > 2", digest="e" * 64)
    for name, found in (
        ("good", made()),
        ("bad", made(Verdict.REFUTED)),
        ("moved", case(SUBJECT, [other], [evidence(other)])),
    ):
        render_all(found, tmp_path / name)
    ask = CliRunner().invoke

    def run(*arguments: str) -> tuple[int, str]:
        done = ask(diff, arguments, standalone_mode=False)
        return int(done.return_value), done.output

    good, bad, moved = (str(tmp_path / name) for name in ("good", "bad", "moved"))
    assert run(good, bad, "--fail-on", "never")[0] == 0
    code, text = run(good, bad)
    assert code == 1
    lines = text.splitlines()
    assert lines[1] == "  ✘ R was argued, and is not shown"
    assert run(bad, good)[0] == 0
    code, text = run(good, moved)
    assert code == 0
    assert "  ≠ “n does g” was “x > 1”, is “x > 2”" in text


def test_diff_against_a_signature_compares_what_was_signed(tmp_path: Path) -> None:
    path = signed(tmp_path)
    other = replace(G, formula="x > 2", digest="e" * 64)
    moved = case(SUBJECT, [other, guarantee("n", "h")], [evidence(other)])
    for name, found in (("same", made()), ("bad", made(Verdict.REFUTED)), ("moved", moved)):
        render_all(found, tmp_path / "reports" / name)

    def run(*arguments: object) -> tuple[int, list[str]]:
        done = CliRunner().invoke(diff, [str(a) for a in arguments], standalone_mode=False)
        assert done.exception is None, done.exception
        return int(done.return_value), done.output.splitlines()

    reports = tmp_path / "reports"
    for given in (path, path.parent, path.parent.parent):
        assert run(given, reports / "same") == (0, ["nothing changed"])
        code, lines = run(given, reports / "bad")
        assert (code, lines[1]) == (1, "  ✘ R was argued, and is not shown")
        code, lines = run(given, reports / "moved")
        assert "  ≠ “n does g” was “x > 1”, is “x > 2”" in lines
        assert [line for line in lines if line.startswith("  + new claim, missing: “")]
    path.write_text("{}")
    done = CliRunner().invoke(diff, [str(path), str(reports / "same")], standalone_mode=False)
    assert isinstance(done.exception, Rejected)
    assert done.exception.diagnostics[0].code == "DIFF001"
    with pytest.raises(Rejected, match="no report, ledger") as caught:
        CliRunner().invoke(diff, ["signed", str(reports / "same")], catch_exceptions=False)
    assert "avow sign --report" in (caught.value.diagnostics[0].hint or "")
    with pytest.raises(Rejected) as caught:
        read_case(reports / "none/report.json")
    assert "`avow verify` writes it" in (caught.value.diagnostics[0].hint or "")
