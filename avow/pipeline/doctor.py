"""What is installed on this machine that Avow can use, and whether it works."""

from __future__ import annotations

import shutil
import sys
from dataclasses import replace

from avow.backend_kit.registry import backend, names
from avow.base.records import dataclass
from avow.base.tools import Tool, find_tool, package_tool, z3_tool
from avow.isolation.level import seals
from avow.isolation.tracing import INSTALL, remedy, traces

_PACKAGES = (
    (
        *("second opinion", "cvc5", "pip install 'avow[cvc5]'"),
        "import cvc5; s = cvc5.Solver(); s.assertFormula(s.mkFalse()); assert s.checkSat().isUnsat()",
    ),
    ("PDF report", "typst", "pip install typst", "import typst; assert typst.compile(b'x')[:4] == b'%PDF'"),
    (
        *("ROSMonitoring's oracle", "websockets", "pip install 'avow[monitor]'"),
        "from websockets.sync import server; server.serve(print, '127.0.0.1', 0).socket.close()",
    ),
    (
        *("ROS 2 over DDS", "cyclonedds", "pip install 'avow[dds]'"),
        "from cyclonedds.domain import DomainParticipant; DomainParticipant(0)",
    ),
    (
        *("verdicts as MCAP", "mcap", "pip install 'avow[monitor]'"),
        "import io, mcap.writer; w = mcap.writer.Writer(io.BytesIO()); w.start(); w.finish()",
    ),
    (
        *("language server", "pygls", "pip install 'avow[lsp]'"),
        "from pygls.lsp.server import LanguageServer; LanguageServer('trial', '1')",
    ),
    (
        *("signatures", "cryptography", "pip install 'avow[signing]'"),
        "from cryptography.fernet import Fernet; f = Fernet(Fernet.generate_key()); f.decrypt(f.encrypt(b'x'))",
    ),
)
"""What each is for, the distribution, the command that installs it, and a line that uses it."""


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
        *((use, _package(*of)) for use, *of in _PACKAGES),
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


def _package(name: str, install: str, line: str) -> Tool:
    found = package_tool(name, install, line)
    return replace(found, path=shutil.which(name) if found.present else None)
