"""The theorem behind the kernel and its instances are what Dafny has checked."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

PROOFS = Path(__file__).parents[2] / "avow/calculus/proofs"


@pytest.mark.slow
@pytest.mark.needs_dafny
@pytest.mark.parametrize("name", ["kernel.dfy", pytest.param("instances.dfy", marks=pytest.mark.nightly)])
def test_dafny_verifies(name: str) -> None:
    dafny = shutil.which("dafny") or shutil.which("Dafny")
    if dafny is None:
        pytest.skip("dafny is not installed")
    done = subprocess.run([dafny, "/compile:0", "/timeLimit:100", name], cwd=PROOFS, capture_output=True, text=True)
    assert ", 0 errors" in done.stdout, done.stdout + done.stderr


INSTANCES = {
    "rules.py": ("Nodes", "Latched"),
    "induction.py": ("Sound",),
    "subsystem_contracts.py": ("Derived",),
    "export.py": ("Derived",),
    "refinement.py": ("Refined",),
    "wiring.py": ("SoundWithMemory",),
    "finder.py": ("Nodes", "Derived"),
    "../kernel/check.py": ("SoundFromAnyBeginning", "Apart"),
}


@pytest.mark.parametrize("module", INSTANCES)
def test_the_code_of_each_rule_names_its_instance(module: str) -> None:
    proofs = "".join((PROOFS / name).read_text() for name in ("kernel.dfy", "instances.dfy"))
    code = (PROOFS.parent / module).read_text()
    for name in INSTANCES[module]:
        assert f"`{name}`" in code
        assert f"lemma {name}<" in proofs
