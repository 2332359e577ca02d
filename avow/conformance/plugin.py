"""The pytest plugin of an installed Avow: the marker `conformance`, and `--avow-backend NAME`.

With the option only the suites of these backends run, and a backend without a suite is an error: a run that tested
nothing must not succeed. Nothing else in a session changes, and Avow is imported only when it is needed.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from avow.backend_kit.protocol import Backend

_ASKED: pytest.StashKey[tuple[Backend, ...]] = pytest.StashKey()
"""The backends of the suites that run."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.getgroup("avow", "Avow's verification backends").addoption(
        "--avow-backend",
        action="append",
        default=[],
        metavar="NAME",
        help="Run only the conformance suite of this backend (may be given several times).",
    )


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "conformance: the suite that every backend of Avow has to pass")


def pytest_report_header(config: pytest.Config) -> list[str]:
    """The requested backends, with the classes that provide them."""
    if not config.getoption("avow_backend"):
        return []
    from avow.backend_kit.registry import installed

    found = installed()
    return [
        f"avow backend {name}: {found[name].value if name in found else 'not installed as an entry point'}"
        for name in config.getoption("avow_backend")
    ]


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    suites = {id(item): backend for item in items if (backend := _backend(item)) is not None}
    for item in items:
        if id(item) in suites:
            item.add_marker("conformance")
    wanted = set(config.getoption("avow_backend"))
    if not wanted:
        return
    missing = wanted - {backend.name for backend in suites.values()}
    if missing:
        raise pytest.UsageError(
            f"no conformance suite here for {', '.join(sorted(missing))}: a class that inherits "
            "avow.conformance.Conformance, with `backend` and `seeded`"
        )
    kept = [item for item in items if id(item) in suites and suites[id(item)].name in wanted]
    config.hook.pytest_deselected(items=[item for item in items if item not in kept])
    items[:] = kept
    config.stash[_ASKED] = tuple(
        {backend.name: backend for backend in suites.values() if backend.name in wanted}.values()
    )


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """The available and missing tools of the requested backends."""
    for backend in config.stash.get(_ASKED, ()):
        for tool in backend.tools():
            state = tool.version or "is here" if tool.present else f"is missing: {tool.install}"
            terminalreporter.write_line(f"{backend.name}: {tool.name} {state}")


def _backend(item: pytest.Item) -> Backend | None:
    """The backend of the suite that the test belongs to. None for other tests."""
    suite = sys.modules.get("avow.conformance.suite")  # if it was not imported, nothing inherits from it
    cls = getattr(item, "cls", None)
    if suite is None or cls is None or not issubclass(cls, suite.Conformance):
        return None
    backend: Backend = cls.backend
    return backend
