"""The formats that are written on demand, because few read them and they cost more than all others together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

from avow.assurance.answers import EARLIER
from avow.assurance.model import Case
from avow.assurance.traceability import Row, to_csv, trace
from avow.base.files import write
from avow.base.remembered import by_identity
from avow.base.workspace import ON_DEMAND
from avow.report.exchange import render_sarif
from avow.report.gsn import render_gsn
from avow.report.gsn_svg import draw
from avow.report.page import render_traceability
from avow.report.pdf import render_pdf
from avow.report.qualification import render_qualification
from avow.report.reqif import render_reqif
from avow.report.sacm import render_sacm


def export(case: Case, folder: Path, names: Iterable[str]) -> Iterator[Path]:
    """Write the files of these formats of `ON_DEMAND`; their paths. Raises OSError, and Rejected (``CLI023``) if Typst
    is missing or fails."""
    for file in dict.fromkeys(file for name in names for file in ON_DEMAND[name]):
        write(folder / file, rendered(case, file))
        yield folder / file


def rendered(case: Case, file: str) -> bytes:
    """The content of a file of `ON_DEMAND`: same case, same bytes. Raises Rejected (``CLI023``)."""
    return _TEXTS[file](case).encode("utf-8", "replace") if file in _TEXTS else render_pdf(case)


@by_identity(1)
def _rows(case: Case) -> tuple[Row, ...]:
    return trace(case)


def _csv(case: Case) -> str:
    told = (Row(remark=f"{EARLIER}: the system cannot be read as it stands now"),) if case.earlier else ()
    return to_csv((*told, *_rows(case)))


_TEXTS: Mapping[str, Callable[[Case], str]] = {
    "gsn.yaml": render_gsn,
    "gsn.svg": draw,
    "qualification.html": render_qualification,
    "report.sarif": render_sarif,
    "sacm.xml": render_sacm,
    "traceability.csv": _csv,
    "traceability.html": lambda case: render_traceability(case, _rows(case)),
    "traceability.reqif": lambda case: render_reqif(case, _rows(case)),
}
