"""Is Spin here, and in which version? Apart from `spin`, as every run asks and few translate."""

from __future__ import annotations

import functools
import re
import shutil

from avow.base.process import ToolMissing, run
from avow.base.tools import Tool
from avow.base.tuning.running import VERSION_SECONDS


@functools.cache
def version() -> str | None:
    if shutil.which("gcc") is None:
        return None
    try:
        said = run(["spin", "-V"], seconds=VERSION_SECONDS, tied=False)
    except ToolMissing:
        return None
    found = re.search(r"Spin Version (\S+)", said.stdout + said.stderr)
    return found[1] if found else None


def tool() -> Tool:
    compiler = shutil.which("gcc")
    parts = (compiler,) if compiler is not None else ()
    return Tool("spin", version(), shutil.which("spin"), "apt-get install spin gcc", parts=parts)
