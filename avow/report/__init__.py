"""The assurance report: every format rendered from one `avow.assurance.model.Case`, so that they cannot disagree.

    render_all(case, folder)            writes index.html argument.html claims.html system.html node-NAME.html
                                        contracts.html report.json report.md comment.md report.sarif
                                        findings.sarif junit.xml attestation.jsonl gsn.yaml gsn.svg sacm.xml
                                        traceability.html traceability.csv traceability.reqif qualification.html
    pdf.write_pdf(case, folder)         writes report.pdf, on demand: Typst needs longer than all others together
    write_index(cases, folder)          writes <folder>/index.html over all systems, with the trend over runs

All are idempotent, write each file in one step and leave unchanged files alone. They return the paths of the files.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from avow.assurance.answers import EARLIER
from avow.assurance.model import Case
from avow.assurance.traceability import Row, to_csv, trace
from avow.base.files import sha256, write
from avow.evidence.envelope import seal_lines
from avow.report import answers_page, exchange, gsn, gsn_svg, markdown, page, qualification, reqif, sacm, short

ATTESTATION = "attestation.jsonl"
PDF = "report.pdf"


def render_all(case: Case, folder: Path, key: Path | None = None) -> tuple[Path, ...]:
    """Write every format of one case into `folder`, except the PDF: an existing one shows another state and is removed.
    With a private key the attestations are signed, each in an envelope on a line of its own. Raises OSError, and
    Rejected for a key that cannot be used."""
    written = []
    for name, content in formats(case):
        if key is not None and name == ATTESTATION:
            content = seal_lines(content, key)
        write(folder / name, content)
        written.append(folder / name)
    (folder / PDF).unlink(missing_ok=True)
    for name in left_over(folder, (path.name for path in written)):
        (folder / name).unlink()
    return tuple(written)


def left_over(folder: Path, names: Iterable[str]) -> list[str]:
    """The pages in a report's folder of nodes that its system no longer has."""
    return sorted({path.name for path in folder.glob("node-*.html")} - set(names))


def formats(case: Case) -> Iterator[tuple[str, str]]:
    """Every format except the PDF, by its file name. Same case, same text."""
    for name, content in _formats(case):
        yield name, content.encode("utf-8", "replace").decode()  # a tool's text may hold half a character


def _formats(case: Case) -> Iterator[tuple[str, str]]:
    rows = trace(case)
    told = (Row(remark=f"{EARLIER}: the system cannot be read as it stands now"),) if case.earlier else ()
    as_json = exchange.render_json(case)
    yield "report.json", as_json
    yield "index.html", answers_page.render_answers(case, sha256(as_json))
    yield "argument.html", answers_page.render_argument(case, sha256(as_json))
    yield "claims.html", page.render_page(case, sha256(as_json))
    yield from page.render_details(case)
    yield "report.md", markdown.render_markdown(case)
    yield "comment.md", short.comment(case)
    yield "report.sarif", exchange.render_sarif(case)
    yield "findings.sarif", exchange.render_sarif(case, findings_only=True)
    yield "junit.xml", exchange.render_junit(case)
    yield ATTESTATION, exchange.render_attestation(case)
    yield "gsn.yaml", gsn.render_gsn(case)
    yield "gsn.svg", gsn_svg.draw(case)
    yield "sacm.xml", sacm.render_sacm(case)
    yield "traceability.csv", to_csv((*told, *rows))
    yield "traceability.reqif", reqif.render_reqif(case, rows)
    yield "traceability.html", page.render_traceability(case, rows)
    yield "qualification.html", qualification.render_qualification(case)


def write_index(cases: Sequence[Case], folder: Path, earlier: Sequence[str] = ()) -> Path:
    """Write the page over all systems, `folder`/index.html; a system's own page is `folder`/<system>/index.html.
    `earlier`: systems that have a report and cannot be read now."""
    path = folder / "index.html"
    write(path, answers_page.render_index(cases, earlier))
    return path
