"""What a document belongs to: the other files of its system, its plan, and what the plan switches off."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pygls.uris import to_fs_path

from avow.base.diagnostics import Diagnostic, Rejected
from avow.language.load import clean_text, read_source
from avow.language.source import Source
from avow.system.load import PLAN_FILE, load_system
from avow.system.plan_file import read_plan


def file_of(uri: str) -> str:
    """The file that a URI names; of what is no file (``untitled:1``, ``git:…``), the URI itself."""
    path = to_fs_path(uri)
    return path if path and "\0" not in path else uri.replace("\0", "\ufffd")


def is_file(file: str) -> bool:
    return Path(file).is_absolute()


def companions(file: str, texts: Mapping[str, str]) -> tuple[tuple[Source, ...], frozenset[str]]:
    """The other files of the system that a file belongs to, where its folder has a plan that names it, and the codes of
    the lints that the plan switches off. `texts` are documents that are open, which may not be saved yet."""
    path = Path(file)
    if not is_file(file) or not (path.parent / PLAN_FILE).is_file():
        return (), frozenset()
    try:
        plan = read_plan(path.parent / PLAN_FILE)[0]
    except Rejected:
        return (), frozenset()
    names = [f.resolve() for f in plan.contract_files]
    if path.resolve() not in names:
        return (), frozenset()
    by_path = {Path(name).resolve(): text for name, text in texts.items() if is_file(name)}
    found = [
        clean_text(by_path[name], str(name)) if name in by_path else read_source(name)
        for name in names
        if name != path.resolve()
    ]
    return tuple(f for f in found if isinstance(f, Source)), frozenset(plan.lints_off)


def about_plan(file: str) -> tuple[Diagnostic, ...]:
    """What there is to say of a plan, as it is on the disk."""
    if not is_file(file) or not Path(file).is_file():
        return ()
    try:
        load_system(Path(file).parent)
    except Rejected as rejected:
        mine = Path(file).resolve()
        return tuple(d for d in rejected.diagnostics if d.span is not None and Path(d.span.file).resolve() == mine)
    return ()
