"""The assurance report: every format rendered from one `avow.assurance.model.Case`, so that they cannot disagree.

    render_all(case, folder)            writes index.html argument.html claims.html system.html node-NAME.html
                                        contracts.html report.json report.md comment.md findings.sarif junit.xml
                                        attestation.jsonl
    on_demand.export(case, folder, …)   writes report.pdf report.sarif gsn.yaml gsn.svg sacm.xml qualification.html
                                        traceability.html traceability.csv traceability.reqif
    write_index(cases, folder)          writes <folder>/index.html over all systems

All are idempotent, write each file in one step and leave unchanged files alone. They return the paths of the files.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from avow.assurance.model import Case
from avow.base.files import digest_once, sha256, write
from avow.base.workspace import WRITTEN_ON_DEMAND
from avow.evidence.envelope import seal_lines
from avow.report import answers_page, exchange, markdown, page, short
from avow.report.parts import NOTHING_KEPT, Parts

ATTESTATION = "attestation.jsonl"


def render_all(case: Case, folder: Path, key: Path | None = None, parts: Parts = NOTHING_KEPT) -> dict[Path, str]:
    """Write the formats of one case into `folder`. Files that are written on demand show another state and are removed.
    With a private key the attestations are signed, each in an envelope on a line of its own. Raises OSError, and
    Rejected for a key that cannot be used. Returns the digests of the files."""
    assert parts.folder in (None, folder)
    written = {}
    for name, content in _formats(case, parts):
        if content is None:
            written[folder / name] = digest_once(folder / name)
            continue
        if key is not None and name == ATTESTATION:
            content = seal_lines(content.decode(), key).encode()
        write(folder / name, content)
        written[folder / name] = sha256(content)
    for name in WRITTEN_ON_DEMAND:
        (folder / name).unlink(missing_ok=True)
    for name in left_over(folder, (path.name for path in written)):
        (folder / name).unlink()
    return written


def left_over(folder: Path, names: Iterable[str]) -> list[str]:
    """The pages in a report's folder of nodes that its system no longer has."""
    return sorted({path.name for path in folder.glob("node-*.html")} - set(names))


def formats(case: Case) -> Iterator[tuple[str, str]]:
    """The formats that every run writes, by file name. Same case, same text."""
    for name, content in _formats(case, NOTHING_KEPT):
        assert content is not None, "nothing is kept"
        yield name, content.decode()


def _formats(case: Case, parts: Parts) -> Iterator[tuple[str, bytes | None]]:
    """As `formats`, with the texts that are kept; None for a file that is there as it is to be."""
    for name, content in _texts(case, parts):  # a tool's text may hold half a character
        yield name, content.encode("utf-8", "replace") if isinstance(content, str) else content


def _texts(case: Case, parts: Parts) -> Iterator[tuple[str, str | bytes | None]]:
    as_json = exchange.render_json(case, parts)
    mark = sha256(as_json)
    yield "report.json", as_json
    yield "index.html", answers_page.render_answers(case, mark)
    yield "argument.html", answers_page.render_argument(case, mark, parts)
    yield "claims.html", page.render_page(case, mark, parts)
    yield from page.render_details(case, parts)
    yield "report.md", markdown.render_markdown(case)
    yield "comment.md", short.comment(case)
    yield "findings.sarif", exchange.render_sarif(case, findings_only=True)
    yield "junit.xml", exchange.render_junit(case, parts)
    yield ATTESTATION, exchange.render_attestation(case)


def write_index(cases: Sequence[Case], folder: Path, earlier: Sequence[str] = ()) -> Path:
    """Write the page over all systems, `folder`/index.html; a system's own page is `folder`/<system>/index.html.
    `earlier`: systems that have a report and cannot be read now."""
    path = folder / "index.html"
    write(path, answers_page.render_index(cases, earlier))
    return path
