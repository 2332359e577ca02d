"""Questions as SMT-LIB 2.6 text, for another solver, for readers, and for the archive.

The text is Z3's own printing of the one translation, with Z3's dialect replaced by the standard's syntax.
"""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import pairwise

from avow.base.diagnostics import Diagnostic, Severity
from avow.base.tuning.effort import CVC5_EFFORT_A_SECOND, CVC5_SECONDS, CVC5_STEPS, QUESTION_EFFORT
from avow.formulas.formula import free_variables
from avow.formulas.temporal.cells import compile_node
from avow.language.contract import Contract, Partial
from avow.language.printer import show_term
from avow.language.terms import Term
from avow.solving.apart import Apart, NoAnswer
from avow.solving.translation import Translator, Unsupported
from avow.solving.z3_module import z3


def formulas_script(formulas: Mapping[str, Term] | Iterable[Term], *, comment: str = "") -> str:
    """A script that asks whether the formulas hold together; each is named by its label. Raises Unsupported."""
    labelled = dict(formulas) if isinstance(formulas, Mapping) else {str(k): f for k, f in enumerate(formulas)}
    translator = Translator()
    free = frozenset(v for formula in labelled.values() for v in free_variables(formula))
    background = translator.background(free)
    named = [(label, translator.term(formula)) for label, formula in labelled.items()]
    background += translator.facts_of(translator.root_facts(expr for _, expr in named))
    solver = z3.Tactic("skip", translator.context).solver()  # it only prints: one that solves costs six times as much
    solver.add(*background, *(expr for _, expr in named))
    # Z3 prints declarations first; the assertions are printed one by one, so that each can have its name.
    declarations = _ASSERTION.split(solver.sexpr(), maxsplit=1)[0].strip()
    lines = [f"; {_harmless(line)}" for line in comment.splitlines()]
    lines += ["(set-logic ALL)", *_in_order(declarations)]
    lines += [f"(assert {expr.sexpr()})" for expr in background]
    lines += [f"(assert (! {expr.sexpr()} :named |clause {_harmless(label)}|))" for label, expr in named]
    script = _quoted("\n".join([*lines, "(check-sat)", ""]))
    # An option in the script itself would be an error to Z3.
    return f"; cvc5 reads sequences with --strings-exp\n{script}" if "(seq." in script else script


_ASSERTION = re.compile(r"^\(assert\s", re.MULTILINE)  # not the element of a type named `assert`
_PIECE = re.compile(r'\|[^|]*\||"(?:[^"]|"")*"|;[^\n]*|[^\s()|";]+')


_COMMAND = re.compile(r"^\(", re.MULTILINE)
_DECLARED = re.compile(r"\(declare-(?:sort |datatypes \(\()(\|[^|]*\||[^\s()]+)")


def _in_order(declarations: str) -> list[str]:
    """The declarations, each after those of the sorts that it uses. (Z3 omits sequences of sequences.)"""
    text = _quoted(declarations)
    starts = [m.start() for m in _COMMAND.finditer(text)]
    waiting = [text[a:b].strip() for a, b in pairwise([*starts, len(text)])]
    names = {line: m[1] for line in waiting if (m := _DECLARED.match(line))}
    made: list[str] = []
    while waiting:
        missing = {names[line] for line in waiting if line in names}
        ready = [line for line in waiting if not (missing - {names.get(line)}) & set(_PIECE.findall(line))]
        made += ready or waiting  # a cycle has no order; RCL's types have none
        waiting = [line for line in waiting if line not in ready] if ready else []
    return made


def _quoted(script: str) -> str:
    """The script with bars around each symbol that needs them. (Z3 prints a datatype's symbols without.)"""
    return _PIECE.sub(lambda m: f"|{m[0]}|" if "'" in m[0] and m[0][0] not in '|";' else m[0], script)


def _harmless(text: str) -> str:
    """Text for a comment or a quoted symbol: no bars, backslashes or line ends."""
    return "".join(c if c.isprintable() and c not in "|\\" else "?" for c in text)


def ask_cvc5(script: str, *, effort: int = QUESTION_EFFORT) -> str | None:
    """cvc5's answer to a script (``unknown`` if it needs more effort), or None if the package is not installed or
    cannot read the script. Its own steps are counted, as Z3's are; the clock only ends a call that hangs."""
    if importlib.util.find_spec("cvc5") is None:
        return None
    seconds = CVC5_SECONDS + effort / CVC5_EFFORT_A_SECOND
    for _ in range(2):  # another process may have been ended by something else
        try:
            return CVC5.ask(script, max(1, effort * CVC5_STEPS), seconds)[0] or None
        except TimeoutError:
            return "unknown"
        except NoAnswer:
            continue
    return None


CVC5 = Apart("cvc5")


def to_smtlib(contract: Contract) -> Partial:
    """One script, which checks for each node whether its assumptions and guarantees can hold together; the solver is
    reset between nodes. Clauses about other steps are given for one step, with any past: remembered values are
    constants, and an equation for each gives the value after the step; first values are in the comment. A clause that
    SMT-LIB cannot express is left out, and named."""
    scripts: list[str] = []
    missing: list[Diagnostic] = []
    for node in contract.nodes:
        compiled = compile_node(node)
        refused = {name: f"it speaks of {unsaid.reason}" for name, unsaid in compiled.unsaid.items()}
        refused |= {c.name: "it has a probability" for c in node.guarantees if c.chance}
        formulas = {c.name: c.formula for c in compiled.node.clauses if c.name not in refused}
        comment = ""
        for cell in compiled.cells:
            formulas[f"next {cell.name}"] = cell.leaves(replace(cell.before, name=f"{cell.name}'"))
            first = " ".join(show_term(cell.begins(), "rcl").split())
            comment += f"\nbefore the first step: {first}" if cell.initial is not None else ""
        refused |= {name: why for name, formula in formulas.items() if (why := _unsaid(formula))}
        expressible = {name: formula for name, formula in formulas.items() if name not in refused}
        names = ", ".join(clause.name for clause in node.clauses if clause.name in expressible)
        if names:
            scripts.append(formulas_script(expressible, comment=f"node {node.name}: {names}{comment}"))
        clauses = {clause.name: clause.span for clause in node.clauses}
        missing += [
            Diagnostic(
                "SMT001", f"{node.name}.{name} is left out: {why}", clauses.get(name, node.span), Severity.WARNING
            )
            for name, why in refused.items()
        ]
    return Partial("(reset)\n".join(scripts), tuple(missing))


def _unsaid(formula: Term) -> str:
    """Why SMT-LIB cannot express a formula; empty if it can."""
    try:
        formulas_script([formula])
    except Unsupported as unsupported:
        return str(unsupported)
    return ""
