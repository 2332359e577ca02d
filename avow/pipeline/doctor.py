"""What is installed on this machine that Avow can use, and whether it works."""

from __future__ import annotations

import importlib
import shutil
import sys
from dataclasses import replace
from importlib import metadata

from avow.backend_kit.registry import backend, names
from avow.base.records import dataclass
from avow.base.tools import Tool, find_tool, z3_tool
from avow.isolation.level import seals
from avow.isolation.tracing import INSTALL, remedy, traces

_PACKAGES = (
    ("second opinion", "cvc5", "cvc5", "pip install 'avow[cvc5]'"),
    ("PDF report", "typst", "typst", "pip install typst"),
    ("live monitoring", "websockets", "websockets", "pip install 'avow[monitor]'"),
    ("ROS 2 over DDS", "cyclonedds", "cyclonedds", "pip install 'avow[dds]'"),
    ("verdicts as MCAP", "mcap", "mcap", "pip install 'avow[monitor]'"),
    ("language server", "pygls", "pygls", "pip install 'avow[lsp]'"),
    ("signatures", "cryptography", "cryptography", "pip install 'avow[signing]'"),
)
"""What each is for, the distribution, its module, and the command that installs it."""


@dataclass(frozen=True, slots=True)
class Finding:
    """A tool, and what it is used by; no version where it is missing. `fault`: what went wrong when it was tried."""

    used_by: str
    tool: str
    version: str | None
    path: str | None
    install: str
    optional: bool
    fault: str = ""


def findings(*, tried: bool = False) -> tuple[Finding, ...]:
    """`tried`: each tool that is here does a one-line job, which takes some seconds."""
    found = [
        ("everything", Tool("python", sys.version.split()[0], sys.executable, "", optional=False)),
        ("logic", z3_tool()),
        *((use, _package(name, module, install)) for use, name, module, install in _PACKAGES),
        ("what tools read", _strace()),
        ("sandbox", replace(find_tool("bwrap", install="sudo apt install bubblewrap"), trial=_try_bubblewrap)),
        *((name, tool) for name in names() for tool in backend(name).tools()),
    ]
    return tuple(
        Finding(use, t.name, t.version, t.path, t.install, t.optional, _fault(t) if tried else "") for use, t in found
    )


def _fault(tool: Tool) -> str:
    return tool.trial() if tool.present and tool.trial is not None else ""


def _strace() -> Tool:
    found = find_tool("strace", ("-V",), install=INSTALL)
    return found if traces() else replace(found, version=None, install=remedy())


def _try_bubblewrap() -> str:
    return "" if seals() else "it cannot seal a program here: a container may forbid namespaces"


def _package(name: str, module: str, install: str) -> Tool:
    try:
        version = metadata.version(name)
    except metadata.PackageNotFoundError:
        return Tool(name, None, None, install)
    return Tool(name, version, shutil.which(name), install, trial=lambda: _imported(module))


def _imported(module: str) -> str:
    try:
        importlib.import_module(module)
    except Exception as error:  # a broken package raises anything
        return f"it cannot be imported: {error}"[:200]
    return ""
