"""The words of RCL as an editor offers them: how each is used, and what it means.

Operators come from the table of operators and from the list of those that refer to other steps; a word of these lists
that has no entry here is an error at import.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from avow.language.operators import OPERATORS
from avow.language.terms import Builtin, Past


@dataclass(frozen=True, slots=True)
class Form:
    """A word with its operands: its syntax, with a place for each."""

    name: str
    parameters: tuple[str, ...]
    meaning: str
    limit: str = ""
    """The limit between the word and the parenthesis; in brackets of its own, if it is optional."""
    infix: bool = False

    @property
    def label(self) -> str:
        """``held[5 steps](F)``, ``F since G``."""
        if self.infix:
            return f" {self.name} ".join(self.parameters)
        return f"{self.name}{self.limit}({', '.join(self.parameters)})"

    @property
    def template(self) -> str:
        """As a snippet of the protocol, with a tab stop at each operand."""
        limit = "[${9:5} steps]" if self.limit else ""
        stops = [f"${{{k}:{name}}}" for k, name in enumerate(self.parameters, 1)]
        if self.infix:
            return f"{self.name} {stops[-1]}"
        return f"{self.name}{limit}({', '.join(stops)})"


def _builtin(name: Builtin, *parameters: str) -> Form:
    return Form(name, parameters, OPERATORS[name].typing)


_FORMS = (
    _builtin(Builtin.XOR, "F", "G"),
    _builtin(Builtin.ABS, "r"),
    _builtin(Builtin.MIN, "a", "b"),
    _builtin(Builtin.MAX, "a", "b"),
    _builtin(Builtin.MOD, "n", "3"),
    _builtin(Builtin.DIV, "n", "3"),
    Form("length", ("s",), "how many elements the sequence s has"),
    Form("indices", ("s",), "the positions of the sequence s: <0 upto length(s) - 1>"),
    Form(Past.PREVIOUS, ("t", "t0"), "the value of t at the step before; at the first step the value of t0"),
    Form(Past.ROSE, ("F",), "F has just become true; before the first step it counts as false"),
    Form(Past.FELL, ("F",), "F has just become false; at the first step nothing fell"),
    Form(Past.CHANGED, ("t",), "t has another value than at the step before; not at the first step"),
    Form(Past.ARRIVED, ("in.p",), "a message of the input has come since the step before"),
    Form(Past.STEPS, ("every 20 ms",), "a part of a node: how far apart its steps are"),
    Form(Past.ONCE, ("F",), "F at some step up to now; with a limit, at this step or one of so many before"),
    Form(Past.HISTORICALLY, ("F",), "F at every step up to now; with a limit, at this step and so many before"),
    Form(Past.HELD, ("F",), "F now and at each of the 5 steps before; false while the run is shorter", "[5 steps]"),
    Form(Past.SINCE, ("F", "G"), "G was so at some step up to now, and F at every step after it", infix=True),
    Form(Past.COUNTED, ("F since G",), "how many steps had F after the last with G"),
    Form(Past.NEXT, ("R",), "a response: R at the step after"),
    Form(Past.WITHIN, ("R",), "a response: R at this step or at one of the next 5", "[5 steps]"),
    Form(Past.FOR, ("R",), "a response: R at this step and at each of the next 5", "[5 steps]"),
    Form(Past.UNTIL, ("R", "U"), "a response: R from this step on, up to the step before one with U", infix=True),
    Form(Past.EVENTUALLY, ("R",), "a response: R at some time"),
)
FORMS: Mapping[str, Form] = {form.name: form for form in _FORMS}
QUANTIFIERS: Mapping[str, str] = {
    "forall": "for every value",
    "exists": "for some value",
    "exists_unique": "for exactly one value",
}
CONNECTIVES: Mapping[str, str] = {
    name: OPERATORS[name].typing for name in ("and", "or", "not", "->", "<=>", "==", "!=", "<", "<=", ">", ">=")
}
BUILTIN_TYPES: Mapping[str, str] = {
    "REAL": "the reals, exact",
    "INTEGER": "the integers",
    "NATURAL": "the integers that are at least 0",
    "BOOL": "TRUE and FALSE",
    "STRING": "texts",
}
SECTIONS: Mapping[str, tuple[str, str]] = {
    "inputs": ("inputs( ${1:name} : ${2:REAL} )", "what the node takes in"),
    "outputs": ("outputs( ${1:name} : ${2:REAL} )", "what the node gives out"),
    "topics": ("topics( ${1:package/Type} ${2:name} matches(${3:in.name}) )", "the ROS topics that carry them"),
    Past.STEPS: ("steps( ${1|every,at most|} ${2:20} ms )", "how far apart its steps are"),
    "define": ("define ${1:name}(${2:i : NATURAL}) = ${3:TRUE};", "a name for what several clauses say"),
    "assume": ('assume ${1:name} "${2:what the node may rely on}"\n  ( ${3:TRUE} )', "what the node may rely on"),
    "guarantee": ('guarantee ${1:name} "${2:what the node promises}"\n  ( ${3:TRUE} )', "what the node promises"),
}
NODE = (
    "node ${1:name} {\n  inputs( ${2:x} : ${3:REAL} )\n  outputs( ${4:y} : ${5:REAL} )\n  topics()\n"
    '  guarantee ${6:holds} "${7:what the node promises}"\n    ( ${8:TRUE} )\n}'
)
CONTEXT = "context {\n  ${1:Name} : ${2:{low, high\\}};\n}"


def _complete() -> None:
    missing = [word for word in (*Builtin, *Past) if word not in FORMS]
    if missing:
        raise TypeError(f"no form in avow/lsp/vocabulary.py for {missing}")


_complete()
