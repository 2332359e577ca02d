"""`report --check` believes no report what the kernel established: it is established again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from assurance.sample import rover_case
from calculus.make import make
from kernel.test_kernel import LOOP, PLAN, made

from avow.assurance.certification import KernelRun
from avow.base.codec import to_json
from avow.calculus.certificates import Certificates
from avow.calculus.obligations import reestablished
from avow.evidence.claims import Reestablished
from avow.pipeline import report_check as module


@pytest.mark.slow
def test_what_the_kernel_is_said_to_have_established_is_established_again(tmp_path: Path) -> None:
    """An edited certificate, another claim's key or scope, a claim that has no certificate: the kernel does not believe
    them, whatever else in the report agrees."""
    certificates, _ = made(tmp_path / "loop")
    claim = reestablished(Certificates(certificates.composition, certificates.made), "loop/system/requirement/R")
    assert claim is not None
    own = Reestablished("loop/system/requirement/R", claim.solvers, claim.key, claim.scope)
    kept = {scope: to_json(one) for scope, one in certificates.made.items()}
    honest = replace(
        rover_case(),
        system="loop",
        digests=(("loop/plan.yaml", ""), ("loop/system.rcl", "")),
        kernel=KernelRun("run", (own,), {}, kept),
    )

    def told(**changes: Any) -> list[str]:
        return list(module._kernel(replace(honest, kernel=replace(honest.kernel, **changes)), tmp_path))

    assert told() == []
    entries = kept[own.scope]["entries"]
    for forged in (
        {"certificates": {}},
        {"certificates": {own.scope: kept[own.scope] | {"entries": entries[:-1]}}},
        {"certificates": {own.scope: kept[own.scope] | {"entries": [entries[-1] | {"step": {"uses": []}}]}}},
        {"established": (replace(own, key="0" * 64),)},
        {"established": (replace(own, obligation="loop/system/requirement/Q"),)},
        {"established": (own, replace(own, obligation="loop/system/composition/whole.b.A1"))},
    ):
        assert any("does not establish" in line for line in told(**forged)), forged
    assert any("cannot be established again" in line for line in told(certificates={own.scope: {}}))
    make(tmp_path / "loop", LOOP.replace("out.z == in.y + 1", "out.z == in.y + 2"), PLAN)
    assert told() != []
