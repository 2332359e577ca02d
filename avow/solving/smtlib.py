"""Questions as SMT-LIB 2.6 text, for another solver, for a reader, and for the archive.

The text is Z3's own printing of the one translation, with what is Z3's dialect in it put in the standard's words.
"""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import pairwise

from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.tuning.effort import CVC5_START_SECONDS, CVC5_STEPS, QUESTION_EFFORT
from avow.formulas.formula import free_variables
from avow.formulas.temporal.cells import compile_node
from avow.language.contract import Contract
from avow.language.printer import show_term
from avow.language.terms import Term
from avow.solving.limits import net
from avow.solving.question_process import Answering, NoAnswer
from avow.solving.translation import Translator, Unsupported
from avow.solving.z3_module import z3
from avow.solving.z3_sorts import Sorts


def formulas_script(
    formulas: Mapping[str, Term] | Iterable[Term], *, comment: str = "", beside: Sorts | None = None
) -> str:
    """A script that asks whether the formulas hold together; each is named by its label. `beside`: in whose context it
    is made, where there are many. Raises Unsupported."""
    labelled = dict(formulas) if isinstance(formulas, Mapping) else {str(k): f for k, f in enumerate(formulas)}
    translator = Translator(beside)
    free = frozenset(v for formula in labelled.values() for v in free_variables(formula))
    background = translator.background(free)
    named = [(label, translator.term(formula)) for label, formula in labelled.items()]
    solver = z3.Tactic("skip", translator.context).solver()  # it only prints: one that solves costs six times as much
    solver.add(*background, *(expr for _, expr in named))
    # Z3 prints declarations first; the assertions are printed one by one, so that each can bear its name.
    declarations = _ASSERTION.split(solver.sexpr(), maxsplit=1)[0].strip()
    lines = [f"; {_harmless(line)}" for line in comment.splitlines()]
    lines += ["(set-logic ALL)", *_in_order(declarations)]
    lines += [f"(assert {expr.sexpr()})" for expr in background]
    lines += [f"(assert (! {expr.sexpr()} :named |clause {_harmless(label)}|))" for label, expr in named]
    script = _quoted("\n".join([*lines, "(check-sat)", ""]))
    # An option in the script itself would be an error to Z3.
    return f"; cvc5 reads sequences with --strings-exp\n{script}" if "(seq." in script else script


_ASSERTION = re.compile(r"^\(assert\s", re.MULTILINE)  # not the element of a type that is called `assert`
_PIECE = re.compile(r'\|[^|]*\||"(?:[^"]|"")*"|;[^\n]*|[^\s()|";]+')


_COMMAND = re.compile(r"^\(", re.MULTILINE)
_DECLARED = re.compile(r"\(declare-(?:sort |datatypes \(\()(\|[^|]*\||[^\s()]+)")


def _in_order(declarations: str) -> list[str]:
    """The declarations, each after those of the sorts that it speaks of. (Z3 forgets sequences of sequences.)"""
    text = _quoted(declarations)
    starts = [m.start() for m in _COMMAND.finditer(text)]
    waiting = [text[a:b].strip() for a, b in pairwise([*starts, len(text)])]
    names = {line: m[1] for line in waiting if (m := _DECLARED.match(line))}
    made: list[str] = []
    while waiting:
        missing = {names[line] for line in waiting if line in names}
        ready = [line for line in waiting if not (missing - {names.get(line)}) & set(_PIECE.findall(line))]
        made += ready or waiting  # in a circle there is no order; RCL's types have none
        waiting = [line for line in waiting if line not in ready] if ready else []
    return made


def _quoted(script: str) -> str:
    """The script with bars around each symbol that needs them. (Z3 prints what a datatype declares without.)"""
    return _PIECE.sub(lambda m: f"|{m[0]}|" if "'" in m[0] and m[0][0] not in '|";' else m[0], script)


def _harmless(text: str) -> str:
    """Text for a comment or a quoted symbol: no bars, backslashes or line ends."""
    return "".join(c if c.isprintable() and c not in "|\\" else "?" for c in text)


def ask_cvc5(script: str, *, effort: int = QUESTION_EFFORT) -> str | None:
    """cvc5's answer to a script (``unknown`` where it takes more effort), or None where the package is not installed or
    cannot read the script. Its own steps are counted, as Z3's are; the clock only ends what hangs."""
    if importlib.util.find_spec("cvc5") is None:
        return None
    steps, seconds = max(1, effort * CVC5_STEPS), net(effort) + CVC5_START_SECONDS
    for _ in range(2):  # another process may have been ended by somebody else
        try:
            found, _ = _cvc5.ask(("cvc5", script, steps), tuple[str, int], seconds)
        except TimeoutError:
            return "unknown"
        except NoAnswer:
            continue
        return found or None
    return None


_cvc5 = Answering("avow.solving.apart")


def end_cvc5() -> None:
    """End the process that answers for it; the next question starts another."""
    _cvc5.close()


def to_smtlib(contract: Contract) -> str:
    """One script, which asks of each node whether its assumptions and guarantees can hold together; between nodes the
    solver is reset. Of clauses that speak of other steps it is one step, whatever was before: what is remembered are
    constants, and what the step leaves is said by an equation for each; first values are told in the comment. Raises
    `Rejected` where SMT-LIB cannot say a formula."""
    scripts = []
    for node in contract.nodes:
        compiled = compile_node(node)
        for name, unsaid in compiled.unsaid.items():
            message = f"node `{node.name}` has no SMT-LIB form: {name} speaks of {unsaid.reason}"
            raise Rejected(Diagnostic("SMT001", message, node.clause(name).span))
        formulas = {clause.name: clause.formula for clause in compiled.node.clauses}
        comment = f"node {node.name}: {', '.join(formulas)}"
        for cell in compiled.cells:
            formulas[f"next {cell.name}"] = cell.leaves(replace(cell.before, name=f"{cell.name}'"))
            first = " ".join(show_term(cell.begins(), "rcl").split())
            comment += f"\nbefore the first step: {first}" if cell.initial is not None else ""
        try:
            scripts.append(formulas_script(formulas, comment=comment))
        except Unsupported as unsupported:
            raise Rejected(
                Diagnostic("SMT001", f"node `{node.name}` has no SMT-LIB form: {unsupported}", node.span)
            ) from None
    return "(reset)\n".join(scripts)
