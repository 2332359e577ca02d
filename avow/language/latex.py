"""A contract as a LaTeX document: a table for each node as the paper prints them, with the English beside the formula.

It needs nothing but what Debian's texlive-latex-base and -recommended hold, and compiles whatever the names and
sentences are (tests compile hostile ones).
"""

from __future__ import annotations

from collections.abc import Iterable

from avow.language.contract import Clause, Contract, Node, Port
from avow.language.definitions import show_clause
from avow.language.printer import show_term, show_type
from avow.language.styles import latex_escape, latex_name

_HEAD = r"""\documentclass[a4paper]{article}
\usepackage[T1]{fontenc}
\usepackage[utf8]{inputenc}
\usepackage{textcomp}
\usepackage{amsmath,amssymb}
\usepackage{array}
\usepackage{longtable}
\usepackage[margin=2cm]{geometry}
\setlength{\parindent}{0pt}
\setlength{\extrarowheight}{2pt}
\begin{document}
"""
_TABLE = r"""
\begin{longtable}{@{}>{\raggedright}p{0.15\textwidth}|l|>{\raggedright\arraybackslash}p{0.66\textwidth}@{}}
"""
_CONTEXT = r"\begin{longtable}[l]{@{}l@{\;}>{\raggedright\arraybackslash}p{0.75\textwidth}@{}}"


def to_latex(contract: Contract) -> str:
    """A whole document."""
    return _HEAD + "\n".join([*_context(contract), *(_node(n) for n in contract.nodes)]) + "\\end{document}\n"


def _context(contract: Contract) -> Iterable[str]:
    types = dict(contract.types)
    rows = [rf"${latex_name(name)}$ & ${{}}: {show_type(sort, 'latex')}$ \\" for name, sort in contract.types]
    rows += [
        rf"${latex_name(name)}$ & ${{}}= {show_term(term, 'latex')}$ \\"
        for name, term in contract.constants
        if name not in types
    ]
    if rows:
        yield r"\textbf{Context}" + "\n\n" + _CONTEXT
        yield "\n".join(rows)
        yield "\\end{longtable}\n"


def _node(node: Node) -> str:
    rows = [rf"\multicolumn{{3}}{{c}}{{\textbf{{{latex_escape(node.name)}}}}} \\* \hline\hline"]
    rows += _ports("Input", node.inputs)
    rows += _ports("Output", node.outputs)
    if node.topics:
        shown = r" \newline ".join(
            rf"\texttt{{{_breakable(t.ros_type)}}} {latex_escape(t.name)}"
            + (rf" matches ${latex_name(f'{t.port.role}.{t.port.name}')}$" if t.port is not None else "")
            for t in node.topics
        )
        rows.append(rf"Topics & & {shown} \\ \hline\hline")
    rows += _clauses("Assume", node, node.assumptions)
    rows += _clauses("Guarantee", node, node.guarantees)
    return _TABLE + "\n".join(rows) + "\n\\end{longtable}\n"


def _ports(word: str, ports: tuple[Port, ...]) -> Iterable[str]:
    shown = r",\quad ".join(f"${latex_name(p.name)} : {_type(p)}$" for p in ports) or "none"
    yield rf"{word} & \textbf{{FOL}} & {shown} \\ \hline\hline"


def _type(port: Port) -> str:
    if port.type_name.replace("_", "").isalnum():
        builtins = {"REAL", "INTEGER", "NATURAL", "BOOL", "STRING"}
        return show_type(port.sort, "latex") if port.type_name in builtins else latex_name(port.type_name)
    return show_type(port.sort, "latex")


def _clauses(word: str, node: Node, clauses: tuple[Clause, ...]) -> Iterable[str]:
    for clause in clauses:
        label = rf"{word}\newline {_breakable(clause.name)}"
        formula = rf"\textbf{{FOL}} & ${show_clause(clause, node, 'latex')}$ \\ \hline\hline"
        if clause.sentence is None:
            yield f"{label} & {formula}"
        else:
            yield rf"{label} & \textbf{{Text}} & {latex_escape(clause.sentence)} \\* \cline{{2-3}}"
            yield f" & {formula}"


def _breakable(text: str) -> str:
    """Text that may be broken after each underscore and slash."""
    return latex_escape(text).replace(r"\_", r"\_\allowbreak{}").replace("/", r"/\allowbreak{}")
