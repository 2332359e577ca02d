"""What a node's source creates: publishers, subscriptions, services, actions and parameters, read and never run."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from avow.base.diagnostics import Span
from avow.base.files import read_regular
from avow.base.tuning.sizes import LAUNCH_BYTES
from avow.ros.code.created import Code, Created
from avow.ros.code.cxx import from_cxx
from avow.ros.code.python import from_python

__all__ = ["Code", "Created", "read_code"]


def read_code(path: Path, class_name: str = "", beside: Collection[str] = ()) -> Code:
    """What a file in Python or C++ creates; in Python only for one class, if it is named. `beside`: the names of files
    that are read too. Never raises."""
    try:
        text = read_regular(path).decode("utf-8")
        if len(text) > LAUNCH_BYTES:
            raise ValueError(f"it has more than {LAUNCH_BYTES} characters")
        if path.suffix == ".py":
            return from_python(text, str(path), class_name, beside)
        return from_cxx(text, str(path), beside)
    except SyntaxError as error:
        where, why = error.lineno or 1, f"this is not Python: {error.msg}"
    except (OSError, ValueError, RecursionError, MemoryError) as error:
        where, why = 1, f"it cannot be read: {error}"
    return Code((), ((why, Span(str(path), where, 1, where, 2)),))
