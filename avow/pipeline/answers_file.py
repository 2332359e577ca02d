"""What the calculus proved before, carried from run to run: beside the evidence, under the digest that a record names.

A run that believes no earlier one gets none of it.
"""

from __future__ import annotations

import json

from avow.base.codec import Unreadable, from_text
from avow.base.files import is_intact, read_regular
from avow.base.workspace import Workspace
from avow.calculus.kept_answers import KeptAnswers
from avow.evidence.ledger import ledger_of
from avow.pipeline.run_info import Run
from avow.pipeline.work import COMPOSE, Work, engine_identity

ANSWERS = "answers.json"


def earlier(workspace: Workspace, work: Work, run: Run) -> str:
    """The text that the newest record of a work keeps, if it is what was kept."""
    if run.fresh or work.engine != COMPOSE:
        return ""
    for entry in reversed(ledger_of(workspace.ledger(work.system.name)).records()):
        record = entry.evidence
        path = next((path for path in record.outputs if path.endswith(f"/{ANSWERS}")), None)
        if record.method == COMPOSE and path is not None:
            try:
                whole = is_intact(workspace.root / path, record.outputs[path])
                return read_regular(workspace.root / path).decode() if whole else ""
            except (OSError, UnicodeDecodeError):
                return ""
    return ""


def read_answers(text: str) -> KeptAnswers:
    """Those of this engine and solver."""
    try:
        said = from_text(dict[str, str], text)
    except Unreadable:
        return KeptAnswers()
    return KeptAnswers.read(said.get("answers", "") if said.get("engine") == engine_identity() else "")


def write_answers(answers: KeptAnswers) -> str:
    return json.dumps({"engine": engine_identity(), "answers": answers.written()})
