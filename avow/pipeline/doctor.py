"""What is installed on this machine that Avow can use."""

from __future__ import annotations

import shutil
import sys
from dataclasses import replace
from importlib import metadata

from avow.backend_kit.registry import backend, names
from avow.base.records import dataclass
from avow.base.tools import Tool, find_tool
from avow.isolation.tracing import INSTALL, remedy, traces

_PACKAGES = (
    ("logic", "z3-solver", "pip install z3-solver", False),
    ("second opinion", "cvc5", "pip install 'avow[cvc5]'", True),
    ("PDF report", "typst", "pip install typst", True),
    ("live monitoring", "websockets", "pip install 'avow[monitor]'", True),
    ("ROS 2 over DDS", "cyclonedds", "pip install 'avow[dds]'", True),
    ("verdicts as MCAP", "mcap", "pip install 'avow[monitor]'", True),
    ("language server", "pygls", "pip install 'avow[lsp]'", True),
    ("signatures", "cryptography", "pip install 'avow[signing]'", True),
)


@dataclass(frozen=True, slots=True)
class Finding:
    """A tool, and what it is used by; no version where it is missing."""

    used_by: str
    tool: str
    version: str | None
    path: str | None
    install: str
    optional: bool


def findings() -> tuple[Finding, ...]:
    strace = find_tool("strace", ("-V",), install=INSTALL)
    found = [
        ("everything", Tool("python", sys.version.split()[0], sys.executable, "", optional=False)),
        *((use, _package(name, install, optional)) for use, name, install, optional in _PACKAGES),
        ("what tools read", strace if traces() else replace(strace, version=None, install=remedy())),
        ("sandbox", find_tool("bwrap", install="sudo apt install bubblewrap")),
        *((name, tool) for name in names() for tool in backend(name).tools()),
    ]
    return tuple(Finding(use, t.name, t.version, t.path, t.install, t.optional) for use, t in found)


def _package(name: str, install: str, optional: bool) -> Tool:
    try:
        version = metadata.version(name)
    except metadata.PackageNotFoundError:
        return Tool(name, None, None, install, optional)
    return Tool(name, version, shutil.which(name), install, optional)
