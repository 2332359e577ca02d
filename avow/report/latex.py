"""The case as a LaTeX appendix that compiles by itself, with pdflatex."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable

from avow.assurance.model import Case, DerivationView, ObligationView, SourceView
from avow.assurance.naming import short
from avow.base.tuning.shown import CONTRACT_LINES
from avow.report.exchange import headline
from avow.report.source import plain_lines
from avow.report.wording import clean, verdict_line, worth


def _read(table: str) -> dict[str, str]:
    """``character command`` pairs, two spaces between them."""
    return dict(pair.split(" ", 1) for line in table.split("\n") for pair in line.split("  "))


_SYMBOLS = _read(
    r"""∀ \forall  ∃ \exists  ∧ \land  ∨ \lor  ¬ \lnot  ⇒ \Rightarrow  ⇔ \Leftrightarrow  → \to
↔ \leftrightarrow  ⟹ \Longrightarrow  ⟺ \Longleftrightarrow  ∈ \in  ∉ \notin  ≤ \le  ≥ \ge  ≠ \ne
≡ \equiv  ⊤ \top  ⊥ \bot  ⊢ \vdash  ⊨ \models  ◇ \Diamond  □ \Box  ○ \bigcirc  · \cdot  • \bullet
× \times  ÷ \div  − -  ∪ \cup  ∩ \cap  ⊆ \subseteq  ∅ \emptyset  ∞ \infty  ⟨ \langle  ⟩ \rangle
ℝ \mathbb{R}  ℕ \mathbb{N}  ℤ \mathbb{Z}  𝔹 \mathbb{B}  ′ '  ″ ''  ‴ '''  … \ldots  λ \lambda
φ \varphi  ψ \psi  σ \sigma  ⁻ ^{-}  ¹ ^{1}  ₁ _{1}  ₂ _{2}  ₃ _{3}  ↦ \mapsto  ⊎ \uplus  ∘ \circ
─ -  — -  – -  𝒜 \mathcal{A}  𝒢 \mathcal{G}"""
)
"""Characters of formulas, set in mathematics."""

_TEXT = _read(r"""\ \textbackslash{}  { \{  } \}  $ \$  & \&  # \#  % \%  _ \_  ^ \textasciicircum{}
~ \textasciitilde{}  < \textless{}  > \textgreater{}  | \textbar{}  ` \textasciigrave{}  ’ '  “ ``  ” ''""")
_DANGEROUS = re.compile(
    r"\\(?:input|include|write|openout|openin|read|catcode|csname|def|edef|gdef|xdef|let|newcommand|renewcommand"
    r"|immediate|special|loop|usepackage|begin\s*\{document\}|end\s*\{document\}|directlua|ShellEscape"
    r"|verbatiminput|lstinputlisting)(?![A-Za-z])|\^\^"
)
"""Commands that do more than print: a derivation's LaTeX that holds one is shown as plain text instead."""


def latex(text: str) -> str:
    """Text as LaTeX that prints it and does nothing else."""
    return "".join(map(_latex_character, clean(text)))


@functools.lru_cache(maxsize=4096)
def _latex_character(c: str) -> str:
    if c == '"':
        return r"\textquotedbl{}"
    if c in _TEXT:
        return _TEXT[c]
    if c in _SYMBOLS:
        return rf"\ensuremath{{{_SYMBOLS[c]}}}"
    if c == "\n":
        return r"\hspace*{0pt}\newline "  # not \\: it would end a table's row
    if c.isascii():
        return c if c.isprintable() else " "
    return c if "\u00c0" <= c <= "\u017f" else rf"\texttt{{U+{ord(c):04X}}}"


def render_latex(case: Case) -> str:
    """An appendix: requirements, derivations, obligations with formulas and evidence."""
    lines = [
        r"\documentclass[10pt,a4paper]{article}",
        r"\usepackage[T1]{fontenc}\usepackage[utf8]{inputenc}\usepackage{amsmath,amssymb,graphicx,longtable,geometry}",
        r"\IfFileExists{proof.sty}{\usepackage{proof}}{\newcommand{\infer}[3][]{\frac{#3}{#2}\,#1}}",
        r"\geometry{margin=22mm}\setlength{\parindent}{0pt}\setlength{\parskip}{4pt}\sloppy",
        r"\newsavebox{\fitbox}\newcommand{\fitted}[1]{\sbox{\fitbox}{$\displaystyle #1$}%",
        r"\par\medskip\ifdim\wd\fitbox>\linewidth\resizebox{\linewidth}{!}{\usebox{\fitbox}}\else\usebox{\fitbox}\fi\par}",
        rf"\title{{{latex(case.title)}: assurance case}}\date{{{latex(case.today)}}}",
        rf"\author{{Avow {latex(case.run.avow_version)}}}",
        r"\begin{document}\maketitle",
        rf"\textbf{{{latex(case.answers.told)}}}. {latex(case.answers.beside)}.",
        rf"{latex(verdict_line(case))} Proofs: {case.grade.word}. Policy {latex(case.policy.name)}.",
        rf"Ledger \texttt{{{case.ledger_head[:16]}}}.",
        r"\section{Requirements}",
        r"\begin{longtable}{p{0.12\textwidth}p{0.5\textwidth}p{0.3\textwidth}}",
        *(rf"\textbf{{{latex(r.id)}}} & {latex(r.text)} & {latex(r.answer)} \\" for r in case.requirements),
        r"\end{longtable}",
    ]
    if case.derivations:
        lines.append(r"\section{Derivations}")
        for derived in case.derivations:
            lines += _latex_derivation(derived)
    lines.append(r"\section{Obligations}")
    for node in dict.fromkeys(view.obligation.node for view in case.obligations):
        lines.append(rf"\subsection*{{{latex(node)}}}")
        for view in case.obligations:
            if view.obligation.node == node:
                lines += _latex_obligation(view)
    lines += [r"\section{What is not shown}", r"\begin{itemize}"]
    lines += [rf"\item {latex(line)}" for line in case.not_shown]
    lines.append(r"\end{itemize}")
    for source in case.sources:
        if source.is_contract:
            lines += _latex_source(source)
    lines.append(r"\end{document}")
    return "\n".join(lines) + "\n"


def _latex_source(source: SourceView) -> Iterable[str]:
    """A contract as written, line by line: no verbatim, which its own text could end."""
    lines = list(plain_lines(source))
    yield rf"\section{{{latex(source.path)}, as written}}"
    yield r"{\footnotesize\ttfamily\raggedright\setlength{\parskip}{0pt}"
    for line in lines[:CONTRACT_LINES]:
        shown = line.expandtabs(2)
        margin = len(shown) - len(shown.lstrip(" "))
        yield rf"\hangindent={margin / 2 + 2:g}em {'~' * margin}{latex(shown[margin:])}\strut\par"
    if len(lines) > CONTRACT_LINES:
        yield rf"\normalfont and {len(lines) - CONTRACT_LINES} more lines: see report.json\par"
    yield "}"


def _latex_derivation(view: DerivationView) -> Iterable[str]:
    d = view.derivation
    yield rf"\subsection*{{{latex(d.name)} (rule {latex(d.rule)}): {view.status.word}}}"
    if d.latex and not _DANGEROUS.search(d.latex):
        start = d.latex.find(r"\[")  # the calculus sets its displays itself, under a title that stands above already
        shown = d.latex[start + 2 :].replace(r"\[", r"\fitted{").replace(r"\]", "}") if start >= 0 else d.latex + "}"
        yield r"\fitted{" + shown  # a premise may be wider than the page
    else:
        yield from (rf"\texttt{{{latex(line)}}}\\" for line in d.text.splitlines() if line.strip())
    yield ""
    conditions = "; ".join(c.text for c in d.side_conditions)
    if conditions:
        yield rf"Side conditions: {latex(conditions)}."


def _latex_obligation(view: ObligationView) -> Iterable[str]:
    o = view.obligation
    yield rf"\paragraph{{{latex(short(o.id))}}} \textit{{{view.standing.word}}}. {latex(o.claim.rstrip('.'))}."
    if o.formula:
        yield r"\begin{quote}" + latex(o.formula) + r"\end{quote}"
    for record in view.records:
        tool = latex(record.tool_told)
        yield rf"{latex(record.method)}: \textit{{{worth(record).word}}}, {tool}. {latex(record.summary)}."
        if record.counterexample:
            yield rf"Counterexample: {latex(record.counterexample.text())}."
    if not view.counting:
        yield latex(headline(view)) + "."
    yield ""
