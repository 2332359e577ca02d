"""``python -m avow.backends.dafny FOLDER NODE``: a skeleton of the implementation, at the path in the plan.

The skeleton includes the specification from the folder where `doit export` writes it, so that an editor opens both.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from avow.backend_kit.given import file_path, job_for
from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import write
from avow.base.workspace import Workspace

from .modules import generate
from .printer import NotExpressible


def _write_skeleton(folder: Path, node: str, *, method: str | None = None) -> Path:
    """Write the skeleton to the method's `implementation`; its path. Raises Rejected, also if the file exists."""
    hint = "add one: dafny: {implementation: models/….dfy}"
    job = job_for(folder, node, "dafny", method, wrong="DFY101", hint=hint)
    name, place = job.options.get("implementation"), job.method.options.at("implementation")
    path = file_path(job, "implementation") if name else None
    if path is None:
        raise Rejected(Diagnostic("DFY101", "dafny needs 'implementation': a file of the system's folder", place))
    if path.exists():
        raise Rejected(Diagnostic("DFY102", f"'{name}' is there already; nothing is ever written over it", place))
    try:
        write(path, generate(job.node, job.method.guarantees).skeleton(_generated_beside(job, path)))
    except NotExpressible as problem:
        message = f"node '{node}' cannot be put into Dafny: {problem.what}"
        raise Rejected(Diagnostic("DFY105", message, problem.span or job.node.span)) from None
    except OSError as error:
        raise Rejected(Diagnostic("DFY102", f"'{name}' cannot be written: {error}", place)) from None
    return path


def _generated_beside(job: Job, path: Path) -> str:
    """The folder of `doit export`'s files that the skeleton includes, relative to the skeleton's folder."""
    place = Workspace(job.root.resolve().parents[1]).node(job.system.name, job.node.name, job.method.id)
    return Path(os.path.relpath(place, path.resolve().parent)).as_posix() + "/"


def main(arguments: list[str] | None = None) -> int:
    """0: written; 2: rejected, with the reasons."""
    parser = argparse.ArgumentParser(
        prog="python -m avow.backends.dafny", description="Write a skeleton where the plan wants the implementation."
    )
    parser.add_argument("folder", type=Path, help="the system's folder, with plan.yaml")
    parser.add_argument("node")
    parser.add_argument("--method", help="the method's id, where the node has several of dafny")
    given = parser.parse_args(arguments)
    try:
        path = _write_skeleton(given.folder, given.node, method=given.method)
    except Rejected as error:
        for d in error.diagnostics:
            hint = f" ({d.hint})" if d.hint else ""
            sys.stderr.write(f"{d.span or given.folder}: {d.message}{hint} [{d.code}]\n")
        return 2
    sys.stdout.write(f"{path}\n`doit export` writes the files that it includes.\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
