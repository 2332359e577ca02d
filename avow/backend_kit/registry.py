"""Finds the verification backends: entry points of installed packages, and modules that a plan names."""

from __future__ import annotations

import contextlib
import functools
import importlib
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import EntryPoint, entry_points

from avow.backend_kit.protocol import Backend, lacks
from avow.base import process
from avow.base.codes import Code, core_codes
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.suggestions import suggest

GROUP = "avow.backends"


@functools.cache
def installed() -> dict[str, EntryPoint]:
    """Name → entry point; imports nothing. Raises Rejected if two packages claim one name."""
    found: dict[str, EntryPoint] = {}
    for point in entry_points(group=GROUP):
        other = found.get(point.name)
        if other is not None and other.value != point.value:
            raise Rejected(
                Diagnostic(
                    "BACKEND001",
                    f"two installed packages provide a backend named '{point.name}': {other.value} and {point.value}",
                    hint="uninstall one of them",
                )
            )
        found[point.name] = point
    return found


def names() -> tuple[str, ...]:
    return tuple(sorted(installed()))


@functools.cache
def backend(name: str, plugins: tuple[str, ...] = ()) -> Backend:
    """The backend of that name, imported now. Raises Rejected with the reason if it cannot be imported."""
    for plugin in _plugins(plugins):
        if plugin.name == name:
            if name in installed():
                raise Rejected(Diagnostic("BACKEND001", f"a plugin redefines the installed backend '{name}'"))
            return plugin
    point = installed().get(name)
    if point is None:
        known = sorted({*installed(), *(p.name for p in _plugins(plugins))})
        raise Rejected(Diagnostic("BACKEND002", f"there is no backend named '{name}'", hint=suggest(name, known)))
    try:
        found = point.load()
    except Exception as error:
        broken = Diagnostic("BACKEND003", f"the backend '{name}' ({point.value}) does not load: {error}")
        raise Rejected(broken) from error
    return _promise(found, point.value)


@functools.cache
def every_code() -> Mapping[str, Code]:
    """The diagnostic codes of the core and of every installed backend that loads."""
    found = dict(core_codes())
    for name in names():
        with contextlib.suppress(Rejected):
            found |= backend(name).codes
    return found


def translators(plugins: tuple[str, ...] = ()) -> dict[str, Backend]:
    """Notation → the backend that translates into it. A backend that does not load offers none; if two offer one
    notation, the first by name counts."""
    found: dict[str, Backend] = {}
    for one in (*_offered(plugins), *_plugins(plugins)):
        for notation in one.translations:
            found.setdefault(notation, one)
    return found


def judge_of_runs() -> Backend | None:
    """The installed backend, the first by name, that judges runs of messages."""
    return next((one for one in _offered(()) if one.judges_runs), None)


def _offered(plugins: tuple[str, ...]) -> Iterator[Backend]:
    for name in names():
        with contextlib.suppress(Rejected):
            yield backend(name, plugins)


def trust_plugins() -> None:
    """Allow this process to import a plan's plug-ins: called by commands that run a workspace's code anyway."""
    process.here.trusts_plugins = True


def _plugins(modules: Iterable[str]) -> tuple[Backend, ...]:
    modules = tuple(modules)
    if modules and not process.here.trusts_plugins:
        raise Rejected(
            Diagnostic(
                "BACKEND005",
                f"the plug-ins of this plan ({', '.join(modules)}) are code, and this command executes none",
                hint="`avow verify` loads them",
            )
        )
    return tuple(_plugin(module) for module in modules)


@functools.cache
def _plugin(module: str) -> Backend:
    try:
        found = importlib.import_module(module).BACKEND
    except Exception as error:
        raise Rejected(Diagnostic("BACKEND003", f"the plugin module '{module}' does not load: {error}")) from error
    return _promise(found, module)


def _promise(found: object, where: str) -> Backend:
    why = lacks(found)
    if why or not isinstance(found, Backend):
        hint = "docs/developers/adding-a-backend.md has an example"
        raise Rejected(Diagnostic("BACKEND003", f"{where} does not keep a backend's promise: {why}", hint=hint))
    return found
