"""Random systems against all of their runs: nothing proved is false on any run, and what is refuted is on one."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest
from calculus.make import Limits, all_obligations, make, settle_all

from avow.base.diagnostics import Rejected
from avow.base.verdict import Verdict
from avow.calculus.certificates import Certificates, requirement_scope
from avow.calculus.composition import compose
from avow.calculus.discharge import Bounds
from avow.calculus.finder import Hint
from avow.kernel.certificate import Certificate, How
from avow.kernel.check import Kernel
from avow.kernel.statements import Claimed

from .drawn import System


def judged(folder: Path, seed: int, *, rich: bool = False) -> int:
    """How many claims of a random system are proved. Asserts that none is false on any run: each requirement, and each
    assumption of a node for which some certificate has an entry that the kernel takes."""
    system = System(seed, rich=rich)
    try:
        made = make(folder / str(seed), system.text, system.plan)
        composition = compose(made)
        obligations = all_obligations(composition)
        found = dict(zip((o.name for o in obligations), settle_all(composition, obligations, Limits()), strict=True))
    except Rejected:
        return 0
    certificates = composition.certificates
    proved = {name for name, outcome in found.items() if outcome.verdict is Verdict.PROVED}
    refuted = {f"R{k}" for k in range(2) if found[f"R{k}"].verdict is Verdict.REFUTED}
    shown = set[tuple[str, bool]]()
    for certificate in certificates.made.values():
        kernel = Kernel(certificates.known_with(certificate.lemmas), certificate, certificates.solvers)
        for k, entry in enumerate(certificate.entries):
            same = certificates.known.by_digest.get(entry.digest, ())
            claims = [s for s in same if s.node == entry.node and s.kind in (Claimed.ASSUMPTION, Claimed.REQUIREMENT)]
            if entry.how is not How.SHOWN or not claims or k not in kernel.checked[0] or k in kernel.checked[1]:
                continue
            needs = {need.kind for need in kernel.establish(k).hypotheses}
            if How.OPEN not in needs:
                shown |= {(claim.called, How.ENVIRONMENT in needs) for claim in claims}
    assert {name for name in proved if name in ("R0", "R1")} <= {name for name, _ in shown}
    for granted in (False, True):
        claims = {name for name, conditional in shown if granted or not conditional}
        broken = {name for name in refuted if not granted}
        for now, truths, outside in system.steps(granted=granted) if claims or broken else ():
            for name in claims & truths.keys():
                assert truths[name], (seed, name, now, outside)
            broken -= {name for name in broken if not truths[name]}
        assert not broken, (seed, broken)
    return len(shown)


def kept(folder: Path, seed: int) -> int:
    """How many requirements of a system the kernel establishes from the certificates of the system that it was before
    it was edited. Asserts that none is false on any run of what it is now."""
    system, random = System(seed), Random(seed)
    found = 0
    made: dict[str, Certificate] = {}
    for edit in range(4):
        try:
            composition = compose(make(folder / f"{seed}-{edit}", system.text, system.plan))
        except Rejected:
            return found
        certificates = Certificates(composition, made)
        for k in range(len(system.required)):
            claim = certificates.kept_for(requirement_scope(f"R{k}"), Claimed.REQUIREMENT, f"R{k}")
            if claim is not None and not any(need.kind is How.ENVIRONMENT for need in claim.hypotheses):
                found += 1
                for _, truths, _ in system.steps():
                    assert truths[f"R{k}"], (seed, edit, k)
            composition.certificates.requirement(f"R{k}", Hint(()), Bounds())
        made = {**made, **composition.certificates.made}
        system.edited(random)
    return found


@pytest.mark.slow
def test_no_certificate_of_what_was_shows_what_is_false_now(tmp_path: Path) -> None:
    assert sum(kept(tmp_path, seed) for seed in range(12)) > 0


@pytest.mark.nightly
def test_no_certificate_of_what_was_shows_what_is_false_now_at_length(tmp_path: Path) -> None:
    assert sum(kept(tmp_path, seed) for seed in range(100, 400)) > 20


@pytest.mark.slow
@pytest.mark.parametrize("rich", [False, True])
def test_nothing_proved_is_false(tmp_path: Path, rich: bool) -> None:
    assert sum(judged(tmp_path, seed, rich=rich) for seed in range(5)) > 0


@pytest.mark.nightly
@pytest.mark.parametrize("rich", [False, True])
def test_nothing_proved_is_false_at_length(tmp_path: Path, rich: bool) -> None:
    assert sum(judged(tmp_path, seed, rich=rich) for seed in range(100, 280)) > 12
