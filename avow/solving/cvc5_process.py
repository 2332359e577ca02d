"""cvc5 in a process of its own: ``python -m avow.solving.cvc5_process STEPS``, the script on standard input, the
answer on standard output.

There are scripts on which cvc5 does not keep its own limits (seen: sequences of tuples), and a call into a library
cannot be ended from Python.
"""

from __future__ import annotations

import sys


def answer(script: str, limit: int, option: str = "tlimit-per") -> str | None:
    """``sat``, ``unsat`` or ``unknown``; None where cvc5 cannot read the script. `option` says what the limit is of:
    milliseconds, or its own steps (``rlimit-per``)."""
    import cvc5

    terms = cvc5.TermManager()
    solver = cvc5.Solver(terms)
    solver.setOption(option, str(limit))
    solver.setOption("full-saturate-quant", "true")
    parser = cvc5.InputParser(solver)
    parser.setStringInput(cvc5.InputLanguage.SMT_LIB_2_6, script, "query")
    symbols = parser.getSymbolManager()
    found = None
    try:
        while True:
            command = parser.nextCommand()
            if command.isNull():
                return found
            said = command.invoke(solver, symbols).strip()
            if said.split(" ")[0] in {"sat", "unsat", "unknown"}:
                found = said.split(" ")[0]  # "unknown (INCOMPLETE)"
            elif said and said != "success":
                return None
    except RuntimeError:
        return None


if __name__ == "__main__":
    print(answer(sys.stdin.read(), int(sys.argv[1]), "rlimit-per") or "")
