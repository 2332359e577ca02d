"""What a report keeps of each node from one report to the next: it saves time, and changes no byte."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import pytest
from assurance.sample import case, chain, rover_parts

from avow.base.notes import cache_folder
from avow.base.verdict import Verdict
from avow.evidence.currency import changed_since
from avow.evidence.record import Evidence
from avow.report import formats, page, render_all
from avow.report.parts import Parts


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def edited(record: Evidence, rng: random.Random) -> Evidence:
    match rng.randrange(4):
        case 0:
            return replace(record, verdict=rng.choice(list(Verdict)))
        case 1:
            return replace(record, key=f"another {rng.random()}")
        case 2:
            return replace(record, summary=f"{record.summary}, {rng.random()}")
        case _:
            return replace(record, seconds=rng.random())


def test_kept_parts_change_no_byte(tmp_path: Path) -> None:
    """Each edit on top of the one before, with what was kept of it; every third time the cache is gone or forged."""
    subject, obligations, records, keys, extras = rover_parts()
    rng = random.Random(29)
    for step in range(24):
        at = rng.randrange(len(records))
        records = [*records[:at], edited(records[at], rng), *records[at + 1 :]]
        some = obligations if step % 5 else obligations[: rng.randrange(1, len(obligations))]
        found = case(subject, some, records, keys=keys, **extras)
        made = {name: text.encode() for name, text in formats(found)}
        parts = Parts(tmp_path / "report")
        render_all(found, tmp_path / "report", parts=parts)
        parts.keep()
        files = {path.name: path.read_bytes() for path in (tmp_path / "report").iterdir()}
        assert files == made, step
        for path in (cache_folder() / "parts").rglob("*" if step % 3 == 0 else "none"):
            if path.is_file():
                path.write_bytes(path.read_bytes().replace(b"proved", b"tested") if step % 2 else b"")


def test_only_what_depends_on_an_edited_record_is_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    subject, obligations, records, keys, extras = rover_parts()
    made: list[str] = []
    fill = page.fill
    monkeypatch.setattr(
        page, "fill", lambda name, **given: made.append(given.get("title", name)) or fill(name, **given)
    )

    def pages(some: list[Evidence]) -> list[str]:
        made.clear()
        parts = Parts(tmp_path)
        render_all(case(subject, obligations, some, keys=keys, **extras), tmp_path, parts=parts)
        parts.keep()
        return [title for title in made if title in {o.node for o in obligations}]

    assert len(pages(records)) > 1
    assert pages(records) == []
    edit = replace(records[-1], summary="another")
    assert pages([*records[:-1], edit]) == [edit.obligation.split("/")[1]]


def test_a_record_as_of_an_earlier_state_is_another_argument(tmp_path: Path) -> None:
    """It keeps its hash."""
    (entry,) = chain(rover_parts()[2][:1])
    for found in (entry, changed_since(entry)):
        parts = Parts(tmp_path)
        assert parts.text("n", "key", lambda e: e.evidence.key, found) == found.evidence.key
        parts.keep()
