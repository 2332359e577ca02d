"""cvc5 as a process: a line ``[milliseconds, script]`` in, a line with the answer out."""

from __future__ import annotations

import json
import sys

from avow.kernel.solvers import answer_cvc5

if __name__ == "__main__":
    for line in sys.stdin:
        limit, script = json.loads(line)
        print(answer_cvc5(script, limit), flush=True)
