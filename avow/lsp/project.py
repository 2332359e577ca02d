"""The system of a document: its contract files and its plan, with the texts that are open and not saved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pygls.uris import to_fs_path

from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import read_text
from avow.language.contract import Contract
from avow.language.load import check_in_part, clean_text, read_source
from avow.language.source import Source
from avow.lsp.plan_names import PlanText
from avow.system.load import PLAN_FILE, load_system, load_texts
from avow.system.plan_file import read_plan


@dataclass(frozen=True, slots=True)
class Project:
    """The texts of a system, and what they declare as far as it can be read. `off`: lints that are switched off."""

    sources: tuple[Source, ...]
    contract: Contract
    diagnostics: tuple[Diagnostic, ...]
    off: frozenset[str] = frozenset()
    plan: PlanText | None = None

    def text_of(self, file: str) -> str:
        """The text of one of its files; empty for any other."""
        if self.plan is not None and self.plan.file == file:
            return self.plan.text
        return next((source.text for source in self.sources if source.file == file), "")


def file_of(uri: str) -> str:
    """The file that a URI names; if it is not a file (``untitled:1``, ``git:…``), the URI itself."""
    path = to_fs_path(uri)
    return path if path and "\0" not in path else uri.replace("\0", "\ufffd")


def is_file(file: str) -> bool:
    return Path(file).is_absolute()


def is_plan(file: str) -> bool:
    return Path(file).name == PLAN_FILE


def project_of(file: str, texts: Mapping[str, str]) -> Project:
    """The system that a contract or a plan belongs to: that of the plan in its folder, if this names it, otherwise the
    file alone. `texts` are documents that are open, by file; the others are read from the disk."""
    path = Path(file)
    by_path = {Path(name).resolve(): (name, text) for name, text in texts.items() if is_file(name)}
    beside = path.parent / PLAN_FILE
    own = clean_text(texts.get(file, ""), file)
    alone = (own,) if isinstance(own, Source) and not is_plan(file) else ()
    if not is_file(file) or not beside.is_file():
        return _project(alone, frozenset(), None)
    name, text = by_path.get(beside.resolve(), (str(beside), None))
    try:
        plan = read_plan(beside, text)[0]
        shown = text if text is not None else read_text(beside, "utf-8")
    except (Rejected, OSError, UnicodeError):
        return _project(alone, frozenset(), None)
    names = [f.resolve() for f in plan.contract_files]
    if not is_plan(file) and path.resolve() not in names:
        return _project(alone, frozenset(), None)
    found = [clean_text(by_path[n][1], by_path[n][0]) if n in by_path else read_source(n) for n in names]
    sources = tuple(f for f in found if isinstance(f, Source))
    return _project(sources, plan.off, PlanText(name, shown))


def _project(sources: tuple[Source, ...], off: frozenset[str], plan: PlanText | None) -> Project:
    contract, diagnostics = check_in_part(sources, off=off)
    return Project(sources, contract, diagnostics, off, plan)


def faults_of_plan(project: Project) -> tuple[Diagnostic, ...]:
    """The faults that prevent a plan, with its current text, from being loaded; empty if there are none."""
    if project.plan is None:
        return ()
    try:
        load_texts(Path(project.plan.file), project.plan.text, project.contract)
    except Rejected as rejected:
        return rejected.diagnostics
    return ()


def about_plan(file: str) -> tuple[Diagnostic, ...]:
    """The diagnostics of a plan, as it is on the disk."""
    if not is_file(file) or not Path(file).is_file():
        return ()
    try:
        load_system(Path(file).parent)
    except Rejected as rejected:
        mine = Path(file).resolve()
        return tuple(d for d in rejected.diagnostics if d.span is not None and Path(d.span.file).resolve() == mine)
    return ()
