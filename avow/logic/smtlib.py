"""Questions as SMT-LIB 2.6 text, for another solver, for a reader, and for the archive.

The text is Z3's own printing of the one translation, with what is Z3's dialect in it put in the standard's words.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import z3

from avow.language.terms import Term
from avow.logic.formula import free_variables
from avow.logic.translation import Translator, Unsupported


def export(formulas: Mapping[str, Term] | Iterable[Term], *, comment: str = "") -> str:
    """A script that asks whether the formulas hold together; each is named by its label. Raises Unsupported."""
    labelled = dict(formulas) if isinstance(formulas, Mapping) else {str(k): f for k, f in enumerate(formulas)}
    translator = Translator()
    solver = z3.Solver(ctx=translator.context)
    free = frozenset(v for formula in labelled.values() for v in free_variables(formula))
    solver.add(*translator.background(free))
    solver.add(*(translator.term(formula) for formula in labelled.values()))
    body = solver.sexpr()
    header = [*(f"; {line}" for line in comment.splitlines()), "(set-logic ALL)"]
    return "\n".join([*header, body.rstrip(), "(check-sat)", ""])


def ask_cvc5(script: str, *, timeout_ms: int = 10_000) -> str | None:
    """cvc5's answer to a script, or None where the package is not installed or cannot read the script."""
    try:
        import cvc5
    except ImportError:
        return None
    try:
        terms = cvc5.TermManager()
        solver = cvc5.Solver(terms)
        solver.setOption("tlimit-per", str(timeout_ms))
        solver.setOption("full-saturate-quant", "true")
        parser = cvc5.InputParser(solver)
        parser.setStringInput(cvc5.InputLanguage.SMT_LIB_2_6, script, "query")
        symbols = parser.getSymbolManager()
        answer = None
        while True:
            command = parser.nextCommand()
            if command.isNull():
                return answer
            said = command.invoke(solver, symbols).strip()
            if said.split(" ")[0] in {"sat", "unsat", "unknown"}:
                answer = said.split(" ")[0]  # "unknown (INCOMPLETE)"
            elif said and said != "success":
                return None
    except (RuntimeError, Unsupported):
        return None
