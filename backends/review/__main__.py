"""``python -m avow.backends.review FOLDER NODE``: stamp a review (the same as ``avow review stamp``)."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from avow.backends.review.stamp import stamp
from avow.base.diagnostics import Rejected


def main(arguments: list[str] | None = None) -> int:
    """0: stamped (or nothing to do); 2: refused, with the reasons."""
    parser = argparse.ArgumentParser(prog="python -m avow.backends.review", description="Fill a review's digests in.")
    parser.add_argument("folder", type=Path, help="the system's folder, with plan.yaml")
    parser.add_argument("node")
    parser.add_argument("--method", help="the review's id, where the node has several")
    parser.add_argument("--renewed", metavar="DATE", help="everything that changed was read again on this date")
    given = parser.parse_args(arguments)
    try:
        said = stamp(given.folder, given.node, method=given.method, renewed=given.renewed)
    except Rejected as error:
        for d in error.diagnostics:
            hint = f" ({d.hint})" if d.hint else ""
            sys.stderr.write(f"{d.span or given.folder}: {d.message}{hint} [{d.code}]\n")
        return 2
    sys.stdout.write("".join(f"{line}\n" for line in said) or "nothing to stamp: every digest is as it should be\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
