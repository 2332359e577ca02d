"""Dafny 4, by a stand-in that answers as Dafny 4 is documented to: which commands it is given, and that nothing but a
whole and clean answer is a proof. No Dafny 4 was at hand; the forms are those of its manual and of output that others
have published."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from helpers import some
from test_dafny_tricks import CONTRACT, GOOD

from avow.backend_kit.protocol import Job, Limits
from avow.backends.dafny import BACKEND, modern
from avow.backends.dafny.dafny_tool import has_commands
from avow.base.tools import find_tool
from avow.base.verdict import Outcome, Verdict

MakeJob = Callable[..., Job]

STAND_IN = """#!/bin/sh
printf '%s\\t' "$@" >> {place}/seen
echo >> {place}/seen
again={place}/$1.$(grep -c "^$1" {place}/seen)
[ -d "$again" ] && answer=$again || answer={place}/$1
case "$*" in *--allow-warnings*)
  [ -e "$answer/old" ] && {{ echo "Unrecognized command or argument '--allow-warnings'."; exit 1; }}
esac
for argument; do case "$argument" in "--log-format:csv;LogFileName="*)
  [ -e "$answer/csv" ] && cat "$answer/csv" > "${{argument#*=}}"
esac; done
cat "$answer/text"
exit "$(cat "$answer/code")"
"""

HEAD = "TestResult.DisplayName,TestResult.Outcome,TestResult.Duration,TestResult.ResourceCount,RandomSeed\n"
ROWS = (
    "Contract.low (well-formedness),Passed,00:00:00.1,12,0\n"
    "LampImpl.EnvNotEmpty (correctness),Passed,00:00:00.1,12,0\n"
    "LampImpl.Step (well-formedness),Passed,00:00:00.1,12,0\n"
    "LampImpl.Step (correctness),Passed,00:00:00.1,12,0\n"
    "LampProbe.Call (correctness),Passed,00:00:00.1,12,0\n"
    "LampProbe.EnvAlways (correctness),Passed,00:00:00.1,12,0\n"
)
FINISHED = "\nDafny program verifier finished with 6 verified, 0 errors"
VERIFIED: dict[str, Any] = {"csv": HEAD + ROWS, "text": FINISHED}
AUDITED: dict[str, Any] = {
    "text": "Dafny auditor completed with 0 findings\n\nDafny program verifier did not attempt verification"
}
FAILED = (
    "lamp_impl.dfy(8,2): Error: a postcondition could not be proved on this return path\n"
    "lamp_spec.dfy({line},12): Related location: this is the postcondition that could not be proved\n"
    "\nDafny program verifier finished with 3 verified, 1 error"
)


@pytest.fixture
def dafny4(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., list[list[str]]]]:
    """dafny4(verify=…, audit=…): put the stand-in in the way; the returned list fills with what it is asked."""
    place = tmp_path / "bin"
    place.mkdir()
    seen = place / "seen"
    program = place / "dafny"
    program.write_text(STAND_IN.format(place=place))
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{place}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    find_tool.cache_clear()

    def asked() -> list[list[str]]:
        return [line.split("\t")[:-1] for line in seen.read_text().splitlines()]

    def answer(name: str, files: dict[str, Any]) -> None:
        (place / name).mkdir(parents=True)
        for file, text in {"text": "", "code": 0, **files}.items():
            (place / name / file).write_text(f"{text}\n" if file == "text" else str(text))

    def told(**answers: Any) -> Callable[[], list[list[str]]]:
        answer("version", {"text": "Dafny 4.9.1.0"})
        for command, each in {"verify": VERIFIED, "audit": AUDITED, **answers}.items():
            for k, files in enumerate(each if isinstance(each, list) else [each]):
                answer(f"{command}.{k + 1}" if isinstance(each, list) else command, files)
        return asked

    yield told  # type: ignore[misc]
    find_tool.cache_clear()


def settle(make_job: MakeJob, root: Path, text: str = GOOD) -> dict[str, Outcome]:
    (root / "lamp.dfy").write_text(text, encoding="utf-8")
    job = make_job(CONTRACT, "lamp", implementation="lamp.dfy")
    report = BACKEND.discharge(job, root, Limits(seconds=60))
    return {o.obligation.rsplit("/", 1)[1]: o for o in report.outcomes}


def test_the_commands_are_those_of_version_4(make_job: MakeJob, tmp_path: Path, dafny4: Any) -> None:
    asked = dafny4()
    outcomes = settle(make_job, tmp_path)
    assert {o.verdict for o in outcomes.values()} == {Verdict.PROVED}
    version, verify, audit = asked()
    assert version == ["/version"]
    files = ["types.dfy", "lamp_contract.dfy", "lamp_spec.dfy", "lamp_impl.dfy", "probe.dfy"]
    assert verify == [
        "verify", "--allow-warnings", "--verification-time-limit:30", "--log-format:csv;LogFileName=answer.csv",
        "--show-snippets:false", *files,
    ]  # fmt: skip
    assert audit == ["audit", *files]


def test_an_option_that_an_early_4_does_not_know_is_left_out(make_job: MakeJob, tmp_path: Path, dafny4: Any) -> None:
    asked = dafny4(verify={**VERIFIED, "old": True})
    assert {o.verdict for o in settle(make_job, tmp_path).values()} == {Verdict.PROVED}
    assert ["--allow-warnings" in a for a in asked() if a[0] == "verify"] == [True, False]


@pytest.mark.parametrize(
    ("version", "commands"),
    [
        ("2.3.0.10506", False),
        ("3.13.1", False),
        ("4.0.0", True),
        ("4.11.0", True),
        ("10.1.0", True),
        ("unknown", False),
    ],
)
def test_the_version_decides(version: str, commands: bool) -> None:
    assert has_commands(version) is commands


@pytest.mark.parametrize(("again", "others"), some([(VERIFIED, Verdict.PROVED), (None, Verdict.UNKNOWN)], 1, slow=1))
def test_only_the_guarantee_whose_ensures_failed_is_unproved(
    make_job: MakeJob, tmp_path: Path, dafny4: Any, again: dict[str, Any] | None, others: Verdict
) -> None:
    spec = BACKEND.export(make_job(CONTRACT, "lamp", implementation="lamp.dfy"))["lamp_spec.dfy"].split("\n")
    line = next(k for k, text in enumerate(spec, start=1) if "ensures Contract.high(" in text)
    failing = {
        "csv": HEAD + ROWS.replace("Step (correctness),Passed", "Step (correctness),Failed"),
        "text": FAILED.format(line=line),
        "code": 4,
    }
    asked = dafny4(verify=[failing, again or failing])
    outcomes = settle(make_job, tmp_path)
    assert {n: o.verdict for n, o in outcomes.items()} == {"low": others, "high": Verdict.UNKNOWN, "count": others}
    assert "postcondition could not be proved" in outcomes["high"].summary
    assert len([a for a in asked() if a[0] == "verify"]) == 2


NOT_PROVED: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "no log, though the code is 0": ({"text": FINISHED}, AUDITED),
    "an empty log": ({"csv": HEAD, "text": FINISHED}, AUDITED),
    "a log of another form": ({"csv": "Step: ok\n", "text": FINISHED}, AUDITED),
    "a row of another form": ({"csv": HEAD + ROWS + "LampImpl.Step,Passed\n", "text": FINISHED}, AUDITED),
    "Step is not in it": (
        {"csv": HEAD + ROWS.replace("LampImpl.Step (c", "LampImpl.Stop (c"), "text": FINISHED},
        AUDITED,
    ),
    "Step of another module": ({"csv": HEAD + ROWS.replace("LampImpl.Step", "Other.Step"), "text": FINISHED}, AUDITED),
    "only well-formed": (
        {"csv": HEAD + ROWS.replace("Step (correctness)", "Step (sanity)"), "text": FINISHED},
        AUDITED,
    ),
    "EnvNotEmpty is missing": ({"csv": HEAD + ROWS.replace("EnvNotEmpty", "Env"), "text": FINISHED}, AUDITED),
    "one batch failed": (
        {
            "csv": HEAD + ROWS + "LampImpl.Step (correctness) (assertion batch 2),Failed,00:00:00.1,12,0\n",
            "text": FINISHED,
        },
        AUDITED,
    ),
    "another outcome": ({"csv": HEAD + ROWS.replace("Passed", "Skipped"), "text": FINISHED}, AUDITED),
    "a failed member": ({"csv": HEAD + ROWS + "Contract.high (x),Failed,0,1,0\n", "text": FINISHED}, AUDITED),
    "an error is counted": ({"csv": HEAD + ROWS, "text": FINISHED.replace("0 errors", "1 error")}, AUDITED),
    "a time-out is counted": ({"csv": HEAD + ROWS, "text": FINISHED + ", 1 time out"}, AUDITED),
    "nothing was verified": ({"csv": HEAD + ROWS, "text": FINISHED.replace("6 verified", "0 verified")}, AUDITED),
    "it did not finish": ({"csv": HEAD + ROWS, "text": "Dafny program verifier did not attempt verification"}, AUDITED),
    "another exit code": ({**VERIFIED, "code": 2}, AUDITED),
    "no audit": (VERIFIED, {"text": "Unrecognized command or argument 'audit'.", "code": 1}),
    "an audit that finds something": (
        VERIFIED,
        {
            "text": "lamp_impl.dfy(5,15): Warning: LampImpl.No: Declaration has explicit `{:axiom}` attribute. "
            "Possible mitigation: Provide a proof or test.\nDafny auditor completed with 1 findings"
        },
    ),
    "an audit in the other form": (
        VERIFIED,
        {
            "text": "lamp_impl.dfy(5,15):No: Declaration has no body. Possible mitigation: Provide one.\n"
            "Dafny auditor completed with 1 findings"
        },
    ),
    "an audit that counts what it does not show": (VERIFIED, {"text": "Dafny auditor completed with 2 findings"}),
    "an audit with a warning of another kind": (
        VERIFIED,
        {"text": "lamp_impl.dfy(5,15): Warning: something new\nDafny auditor completed with 0 findings"},
    ),
    "an audit with an error": (
        VERIFIED,
        {"text": "lamp_impl.dfy(5,15): Error: rbrace expected\nDafny auditor completed with 0 findings"},
    ),
}


@pytest.mark.parametrize("name", some(NOT_PROVED, 2, slow=6))
def test_anything_less_than_a_whole_and_clean_answer_is_no_proof(
    make_job: MakeJob, tmp_path: Path, dafny4: Any, name: str
) -> None:
    verify, audit = NOT_PROVED[name]
    dafny4(verify=verify, audit=audit)
    outcomes = settle(make_job, tmp_path)
    assert {o.verdict for o in outcomes.values()} <= {Verdict.UNKNOWN, Verdict.ERROR}, outcomes


def test_what_the_auditor_says_of_triggers_is_harmless(make_job: MakeJob, tmp_path: Path, dafny4: Any) -> None:
    said = "lamp_impl.dfy(5,15): Warning: Could not find a trigger for this quantifier.\n" + AUDITED["text"]
    dafny4(audit={"text": said})
    assert {o.verdict for o in settle(make_job, tmp_path).values()} == {Verdict.PROVED}


def test_the_auditor_is_told_about_the_generated_types_only_by_us(
    make_job: MakeJob, tmp_path: Path, dafny4: Any
) -> None:
    said = "types.dfy(7,11): Warning: Types.Beyond: Declaration has no body. Possible mitigation: Provide a body.\n"
    dafny4(audit={"text": said + "Dafny auditor completed with 1 findings"})
    assert {o.verdict for o in settle(make_job, tmp_path).values()} == {Verdict.PROVED}


def test_nested_names() -> None:
    found = modern.read_log(HEAD + "M.C.f (correctness),Passed,0,1,0\nf (correctness),Failed,0,1,0\n", "")
    assert found is not None
    assert [(m.module, m.scope, m.name, m.outcome) for m in found] == [
        ("M", "C", "f", "correct"),
        ("", "_default", "f", "errors"),
    ]
