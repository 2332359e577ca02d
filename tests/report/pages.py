"""The pages on claims together, for tests that ask for something wherever it stands."""

from __future__ import annotations

from avow.assurance.model import Case
from avow.report.page import render_details, render_page


def claim_pages(found: Case) -> dict[str, str]:
    """File name → page: the overview first."""
    return {
        "claims.html": render_page(found),
        **{name: text for name, text in render_details(found) if text is not None},
    }


def all_claims(found: Case) -> str:
    return "\n".join(claim_pages(found).values())
