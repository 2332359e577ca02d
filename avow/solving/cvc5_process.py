"""cvc5 in a process of its own (`avow.solving.question_process`): questions are ``[script, steps]``.

There are scripts on which cvc5 does not keep its own limits (seen: sequences of tuples), and a call into a library
cannot be ended from Python.
"""

from __future__ import annotations

import re
from typing import Any

from avow.solving.question_process import serve

_PRODUCT = re.compile(r"\(\* (?!\(?[-/]? ?\d)(?!\S+ \(?[-/]? ?\d)")
"""Of what are not numbers."""


def answer(script: str, limit: int) -> tuple[str, int]:
    """``sat``, ``unsat`` or ``unknown``, nothing where cvc5 cannot read the script; and how many of its own steps it
    took, of so many that it has."""
    import cvc5

    terms = cvc5.TermManager()
    solver = cvc5.Solver(terms)
    solver.setOption("rlimit-per", str(limit))
    solver.setOption("full-saturate-quant", "true")
    if _PRODUCT.search(script) and re.search(r"\((forall|exists) ", script):
        solver.setOption("cegqi", "false")  # it never ends there, and counts no steps (seen: ``exists x. x * x == y``)
    parser = cvc5.InputParser(solver)
    parser.setStringInput(cvc5.InputLanguage.SMT_LIB_2_6, script, "query")
    symbols = parser.getSymbolManager()
    found = ""
    try:
        while True:
            command = parser.nextCommand()
            if command.isNull():
                return found, _steps(solver)
            said = command.invoke(solver, symbols).strip()
            if said.split(" ")[0] in {"sat", "unsat", "unknown"}:
                found = said.split(" ")[0]  # "unknown (INCOMPLETE)"
            elif said and said != "success":
                return "", 0
    except RuntimeError:
        return "", 0


def _steps(solver: Any) -> int:
    counted = solver.getStatistics().get(internal=True).get("resource::resourceUnitsUsed", {})
    return int(counted.get("value", 0))


if __name__ == "__main__":
    serve(lambda question: answer(*question)[0], tuple[str, int])
