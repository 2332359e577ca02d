"""Paths on the command line: an empty one is a slip (an unset variable in a script), never the current folder."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import click


class PathArgument(click.Path):
    """As `click.Path`, giving `Path`; an empty path, or one that no file can have, is a usage error."""

    name = "path"

    def __init__(self, **more: Any) -> None:
        super().__init__(path_type=Path, **more)

    def convert(
        self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> str | bytes | os.PathLike[str]:
        text = os.fspath(value)
        if not text:
            self.fail("the path is empty; the current folder is written `.`", param, ctx)
        try:
            os.stat(text)  # noqa: PTH116 - a text that may be no path at all
        except ValueError as error:
            self.fail(f"{text[:60]!r}… is no path: {error}", param, ctx)
        except OSError as error:
            if error.errno == errno.ENAMETOOLONG:
                self.fail(f"{text[:60]!r}… is no path: {error.strerror}", param, ctx)
        return super().convert(value, param, ctx)
