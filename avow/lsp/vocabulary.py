"""The words of RCL as an editor offers them: how each is used, and what it means.

Every operator of the table and every one that refers to other steps has an entry here (tests check it).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from avow.base.packaged import packaged
from avow.language.operators import OPERATORS
from avow.language.terms import Builtin


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


_WORDS = packaged("avow.lsp", "vocabulary.yaml")
FORMS: Mapping[str, Form] = {
    name: Form(
        name,
        tuple(said["operands"]),
        said["means"] if "means" in said else OPERATORS[Builtin(name)].typing,
        said.get("limit", ""),
        said.get("infix", False),
    )
    for name, said in _WORDS["forms"].items()
}
QUANTIFIERS: Mapping[str, str] = _WORDS["quantifiers"]
CONNECTIVES: Mapping[str, str] = {
    name: OPERATORS[name].typing for name in ("and", "or", "not", "->", "<=>", "==", "!=", "<", "<=", ">", ">=")
}
BUILTIN_TYPES: Mapping[str, str] = _WORDS["types"]
SECTIONS: Mapping[str, tuple[str, str]] = {
    word: (said["template"], said["about"]) for word, said in _WORDS["sections"].items()
}
NODE: str = _WORDS["node"]
CONTEXT: str = _WORDS["context"]
