"""The README's commands are the ones that CI runs, and its links lead somewhere."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent


def test_ci_runs_the_readmes_commands() -> None:
    readme, ci = (ROOT / "README.md").read_text(), (ROOT / ".ci" / "run").read_text()
    commands = re.findall(r"^python3 -m venv .*$", readme, re.MULTILINE)
    assert len(commands) == 2
    for command in commands:
        assert command in ci


def test_links_of_all_pages_lead_to_files() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    broken = []
    for page in pages:
        text = re.sub(r"```.*?```|`[^`\n]*`", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        for target in re.findall(r"\]\(([^)#:]+?)(?:#[^)]*)?\)", text):
            if not (page.parent / target).exists():
                broken.append(f"{page.name}: {target}")
    assert broken == []


def test_files_that_pages_name_are_there() -> None:
    """By their whole path, and in CONTRIBUTING too; what is written by a run or in a workspace has other places."""
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    named = [
        (page, path)
        for page in pages
        for path in re.findall(r"(?<![\w/.<-])(?:avow|tests|backends|docs|benchmarks)/[\w./-]*\w", page.read_text())
        if "NAME" not in path
    ]
    assert len(named) > 100
    assert [
        (page.name, path) for page, path in named if not (ROOT / path).exists() and not (page.parent / path).exists()
    ] == []


def test_every_page_is_in_the_readmes_map() -> None:
    readme = (ROOT / "README.md").read_text()
    pages = [*(ROOT / "docs").glob("*.md"), *(ROOT / "docs/backends").glob("*.md"), ROOT / "docs/examples/README.md"]
    assert [p.name for p in pages if f"({p.relative_to(ROOT).as_posix()})" not in readme] == []


UNREADABLE = (
    r"is another one, of which",
    r"what they would have settled",
    r"the ledger was believed",
    r"exhaustive yes",
    r"indices i in",
    r"- review +# no options",
    r"python3 -P test_",
    r"weakest link",
)
"""Sentences that readers in trials could not understand, or that were not true."""


def test_no_sentence_is_back_that_readers_could_not_understand() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "avow/report/templates").glob("*")]
    pages += [*(ROOT / "avow").rglob("*.py"), *(ROOT / "backends").rglob("*.py")]
    found = [
        f"{page.name}: {words}"
        for page in pages
        for words in UNREADABLE
        if re.search(words, " ".join(page.read_text(encoding="utf-8").split()))
    ]
    assert found == []


def test_the_plan_page_needs_no_source_file() -> None:
    for page in (ROOT / "docs/plan.md", ROOT / "docs/policy.md", ROOT / "docs/tutorial.md"):
        assert re.findall(r"avow/[a-z_/]+\.py", page.read_text()) == [], page.name


def test_the_trace_format_has_an_example_that_is_judged(tmp_path: Path) -> None:
    import json

    text = (ROOT / "docs/backends/rosmonitoring.md").read_text()
    lines = re.findall(r'^ *(\{"topic".*\})$', text, re.MULTILINE)
    assert lines
    assert all("topic" in json.loads(line) for line in lines)
