"""The assurance report: every format rendered from one `avow.assurance.model.Case`, so that they cannot disagree.

    render_all(case, folder)            writes index.html claims.html report.json report.md comment.md report.pdf
                                        report.sarif findings.sarif junit.xml attestation.jsonl gsn.yaml gsn.svg
                                        cae.yaml traceability.html traceability.csv report.tex
    write_index(cases, folder)          writes <folder>/index.html over all systems, with the trend over runs

Both are idempotent and write each file in one step. They return what they wrote, and what they left out and why.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from avow.assurance.answers import EARLIER
from avow.assurance.model import Case
from avow.base.files import sha256, write
from avow.base.records import dataclass
from avow.evidence.envelope import seal_lines

ATTESTATION = "attestation.jsonl"


@dataclass(frozen=True, slots=True)
class Rendered:
    """`left_out` maps a file name to the reason why it was not written (an extra that is not installed)."""

    written: tuple[Path, ...]
    left_out: tuple[tuple[str, str], ...] = ()


def render_all(case: Case, folder: Path, key: Path | None = None) -> Rendered:
    """Write every format of one case into `folder`; with a private key the attestations are signed, each in an envelope
    on a line of its own. Raises OSError, and Rejected for a key that cannot be used."""
    written, left_out = [], []
    for name, content in formats(case):
        if key is not None and name == ATTESTATION and isinstance(content, str):
            content = seal_lines(content, key)
        if isinstance(content, LeftOut):
            left_out.append((name, content.reason))
            (folder / name).unlink(missing_ok=True)  # an older run's must not stand beside this one's
        else:
            write(folder / name, content)
            written.append(folder / name)
    return Rendered(tuple(written), tuple(left_out))


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A format that cannot be rendered here."""

    reason: str


def formats(case: Case) -> Iterator[tuple[str, str | bytes | LeftOut]]:
    """Every format by its file name. Same case, same bytes."""
    for name, content in _formats(case):
        # a tool's words may hold half a character, which no file can
        yield name, content.encode("utf-8", "replace").decode() if isinstance(content, str) else content


def _formats(case: Case) -> Iterator[tuple[str, str | bytes | LeftOut]]:
    from avow.assurance.traceability import Row, to_csv, trace
    from avow.report import answers_page, exchange, gsn, gsn_svg, latex, markdown, page, short

    rows = trace(case)
    told = (Row(remark=f"{EARLIER}: the system cannot be read as it stands now"),) if case.earlier else ()
    as_json = exchange.render_json(case)
    yield "report.json", as_json
    yield "index.html", answers_page.render_answers(case, sha256(as_json))
    yield "claims.html", page.render_page(case, sha256(as_json))
    yield "report.md", markdown.render_markdown(case)
    yield "comment.md", short.comment(case)
    yield "report.sarif", exchange.render_sarif(case)
    yield "findings.sarif", exchange.render_sarif(case, findings_only=True)
    yield "junit.xml", exchange.render_junit(case)
    yield ATTESTATION, exchange.render_attestation(case)
    yield "gsn.yaml", gsn.render_gsn(case)
    yield "gsn.svg", gsn_svg.draw(case)
    yield "cae.yaml", gsn.render_cae(case)
    yield "traceability.csv", to_csv((*told, *rows))
    yield "traceability.html", page.render_traceability(case, rows)
    yield "report.tex", latex.render_latex(case)
    yield "report.pdf", _pdf(case)


def _pdf(case: Case) -> bytes | LeftOut:
    from avow.report.pdf import NoTypst, render_pdf

    try:
        return render_pdf(case)
    except NoTypst as missing:
        return LeftOut(str(missing))
    except Exception as error:  # typst's own exception types differ between versions
        return LeftOut(f"typst failed: {str(error).splitlines()[0] if str(error) else type(error).__name__}")


def write_index(cases: Sequence[Case], folder: Path, earlier: Sequence[str] = ()) -> Rendered:
    """Write the page over all systems, `folder`/index.html; a system's own page is `folder`/<system>/index.html.
    `earlier`: systems that have a report and cannot be read now."""
    from avow.report.answers_page import render_index

    path = folder / "index.html"
    write(path, render_index(cases, earlier))
    return Rendered((path,))
