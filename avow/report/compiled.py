"""Templates as compiled before, kept in this user's cache and sealed: to compile them costs more than to fill them.

What is kept is code. So one that was edited, made up or made by another version of Jinja is none, and is made again.
"""

from __future__ import annotations

import io
from pathlib import Path

from jinja2 import __version__
from jinja2.bccache import Bucket, BytecodeCache

from avow.base.files import sha256, write
from avow.base.notes import cache_folder, sealed, unsealed


class Compiled(BytecodeCache):
    """Jinja's interface; what is kept is bound to the template's text by Jinja, and to its place by a seal."""

    def load_bytecode(self, bucket: Bucket) -> None:
        kept = unsealed(_place(bucket))
        if kept is not None:
            bucket.load_bytecode(io.BytesIO(kept))

    def dump_bytecode(self, bucket: Bucket) -> None:
        made = io.BytesIO()
        bucket.write_bytecode(made)
        try:
            write(_place(bucket), sealed(_place(bucket), made.getvalue()))
        except OSError:  # a read-only home: it is compiled in each run
            return


def _place(bucket: Bucket) -> Path:
    return cache_folder() / "templates" / sha256(f"{__version__} {bucket.key}")
