"""avow recheck: the kernel alone over certificates."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from calculus.make import CONTRACTS, Limits, make, settle_all
from calculus.test_commands import invoke

from avow.assurance.naming import short
from avow.base.codec import to_json
from avow.base.diagnostics import Rejected
from avow.base.verdict import Verdict
from avow.calculus.certificates import Certificates
from avow.calculus.composition import compose
from avow.calculus.obligations import composition_obligations, reestablished
from avow.cli.recheck import command
from avow.solving.apart import Both
from avow.system.load import load_system
from kernel.test_kernel import LOOP, PLAN, made


@pytest.mark.parametrize("text", ["", "7", "[" * 100_000, '{"kernel": 7}', '{"a": 7}', "\x00"], ids=range(6))
def test_what_is_no_file_of_certificates_is_refused(tmp_path: Path, text: str) -> None:
    make(tmp_path, "node n { inputs( a : BOOL ) outputs( b : BOOL ) topics() guarantee( out.b ) }")
    (tmp_path / "certificates.json").write_text(text)
    with pytest.raises(Rejected) as told:
        invoke(command, str(tmp_path), str(tmp_path / "certificates.json"))
    assert [d.code for d in told.value.diagnostics] == ["CLI005"]


def test_recheck(tmp_path: Path) -> None:
    _, certificate = made(tmp_path / "system")
    kept = tmp_path / "certificates.json"
    kept.write_text(json.dumps({"requirement R": to_json(certificate)}))
    code, told = invoke(command, str(tmp_path / "system"), str(kept))
    assert code == 0
    assert "requirement R: R, on" in told
    report = tmp_path / "report.json"
    report.write_text(json.dumps({"kernel": {"certificates": {"requirement R": to_json(certificate)}}}))
    assert invoke(command, str(tmp_path / "system"), str(report)) == (code, told)
    sample = {"name": "", "trials": 34, "failures": 0, "bound": "0.086", "confidence": "0.95"}
    for bound, wanted in (("0.086", 0), ("0.085", 1)):
        rate = {"bound": bound, "confidence": "0.95", "leaves": [{"claim": "a", "strata": [sample]}]}
        whole = {"kernel": {"certificates": {"requirement R": to_json(certificate)}}, "requirements": [{"id": "R"}]}
        whole["requirements"][0]["rate"] = rate
        report.write_text(json.dumps(whole))
        assert invoke(command, str(tmp_path / "system"), str(report))[0] == wanted
    make(tmp_path / "system", LOOP.replace("out.z == in.y + 1", "out.z == in.y + 2"), PLAN)
    code, told = invoke(command, str(tmp_path / "system"), str(kept))
    assert code == 1
    assert "stale" in told


@pytest.mark.slow
def test_nothing_to_establish_and_wrong_labels_are_no_success(tmp_path: Path) -> None:
    _, certificate = made(tmp_path / "system")
    good, kept = to_json(certificate), tmp_path / "certificates.json"

    def recheck(data: object) -> tuple[int, str]:
        kept.write_text(json.dumps(data))
        try:
            return invoke(command, str(tmp_path / "system"), str(kept))
        except Rejected as rejected:
            return 2, str(rejected)

    for empty in ({}, {"requirement R": good | {"entries": []}}, {"kernel": {"certificates": {}}}):
        assert recheck(empty)[0] == 2
    for label, data in (
        ("requirement Q", good),
        ("requirement R", good | {"scope": "requirement Q"}),
        ("requirement Q", good | {"scope": "requirement Q"}),
        ("whole", good | {"scope": "whole"}),
        ("requirement R", good | {"entries": good["entries"][:-1]}),
    ):
        code, told = recheck({label: data})
        assert code == 1, label
        assert "label" in told


@pytest.mark.slow
@pytest.mark.parametrize("name", ["remote_inspection", "remote_inspection_delayed", "remote_inspection_published"])
def test_everything_that_is_proved_of_a_shipped_composition_has_a_certificate(name: str, tmp_path: Path) -> None:
    """And `avow recheck` gives each proof the key and the grade that a report gives it."""
    system = load_system(CONTRACTS / name)
    composition = compose(system)
    obligations = composition_obligations(system)
    proved = [o for o in settle_all(composition, obligations, Limits()) if o.verdict is Verdict.PROVED]
    assert proved
    told = []
    with Both() as solvers:
        again = Certificates(composition, composition.certificates.made, solvers=solvers)
        for outcome in proved:
            found = reestablished(again, outcome.obligation)
            assert found is not None, outcome.obligation
            assert outcome.details["certificate"]["key"] == found.key  # type: ignore[index]
            told.append(found)
    report = tmp_path / "report.json"
    kept = composition.certificates.made
    report.write_text(json.dumps({"kernel": {"certificates": to_json(kept), "established": to_json(told)}}))
    code, text = invoke(command, str(CONTRACTS / name), str(report))
    assert code == 0
    lines, _, rest = text.partition("proofs of the report without a line")
    for one in told:
        (line,) = [
            line for line in lines.splitlines() if line.endswith(f", in the report {short(one.obligation)}")
        ] or [""]
        if line:
            assert line.startswith(f"certified-{one.solvers}  {one.scope}: ")
            assert one.key[:12] in line
        else:
            assert ".loop." in one.obligation or ".joint." in one.obligation.replace("/", ".")  # of several claims
            assert short(one.obligation) in rest
