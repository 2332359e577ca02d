"""The LaTeX appendix: pdflatex takes it as it is, whatever a contract's texts hold."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from assurance.sample import rover_case

from avow.report.latex import latex, render_latex
from report.hostile import hostile_case

pytestmark = pytest.mark.needs_latex


@pytest.mark.parametrize("make", [rover_case, hostile_case])
def test_the_appendix_compiles(make, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    (tmp_path / "report.tex").write_text(render_latex(make()), encoding="utf-8")
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "-no-shell-escape", "report.tex"],
        cwd=tmp_path,
        capture_output=True,
        timeout=120,
        check=False,
    )
    errors = [line for line in done.stdout.decode("latin-1").splitlines() if line.startswith("!")]
    assert (done.returncode, errors) == (0, [])
    assert (tmp_path / "report.pdf").stat().st_size > 10_000
    assert not list(tmp_path.glob("*.pwned"))


def test_a_fault_would_be_found(tmp_path: Path) -> None:
    """The test above can fail: a display within a display does not compile."""
    source = render_latex(rover_case()).replace(r"\begin{document}", r"\begin{document}\[\[x\]\]")
    (tmp_path / "report.tex").write_text(source, encoding="utf-8")
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "report.tex"],
        cwd=tmp_path,
        capture_output=True,
        timeout=120,
        check=False,
    )
    assert done.returncode != 0


def test_every_symbol_of_formulas_is_known() -> None:
    for c in "∀∃∧∨¬⇒⇔→↔∈∉≤≥≠⊢◇□·∪ℝℕℤ′″‴𝒜𝒢↦":
        assert "U+" not in latex(c), c
