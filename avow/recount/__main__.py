"""``python -m avow.recount REPORT...``"""

import sys
from pathlib import Path

from avow.recount import recount


def main(folders: list[str]) -> int:
    """0 where every number is borne out, 1 where one is not, 2 where a report cannot be read."""
    wrong = 0
    for folder in folders:
        try:
            found = recount(Path(folder))
        except (OSError, ValueError, LookupError) as error:
            print(f"{folder}: cannot be read: {error}", file=sys.stderr)
            return 2
        print(*(f"{folder}: {line}" for line in found or ["every number is borne out"]), sep="\n")
        wrong += len(found)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
