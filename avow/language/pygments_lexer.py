"""RCL for Pygments: `pip install` registers it, so that `pygmentize -l rcl`, Sphinx and friends highlight contracts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from pygments.lexer import RegexLexer, bygroups
from pygments.token import Comment, Keyword, Name, Number, Operator, Punctuation, String, Text, Whitespace

from avow.language.textmate import grammar

_TOKENS = {
    "comment": Comment,
    "string": String,
    "keyword.control": Keyword.Declaration,
    "keyword.operator.word": Operator.Word,
    "keyword.operator": Operator,
    "support.function": Name.Builtin,
    "variable.language": Name.Variable,
    "support.type": Keyword.Type,
    "constant.language": Keyword.Constant,
    "constant.numeric": Number,
    "entity.name.type": Name.Class,
    "entity.name.function": Name.Label,
}
"""Token types by prefixes of TextMate's scope names."""


def _token(scope: str) -> Any:
    return next(token for name, token in _TOKENS.items() if scope.startswith(name))


def _rules() -> Iterator[tuple[str, Any]]:
    """The patterns of the TextMate grammar as rules."""
    yield r"\s+", Whitespace
    for pattern in grammar()["patterns"]:
        if "captures" in pattern:
            kinds = [_token(capture["name"]) for capture in pattern["captures"].values()]
            yield pattern["match"].replace(r"\s+", r"(\s+)"), bygroups(kinds[0], Whitespace, kinds[1])
        elif "begin" in pattern:
            yield rf"{pattern['begin']}(?:\\.|[^\\])*?(?:{pattern['end']})", _token(pattern["name"])
        else:
            yield pattern["match"], _token(pattern["name"])
    yield r"[A-Za-z_][A-Za-z0-9_']*", Name
    yield r"[][:;,.|(){}=]", Punctuation
    yield r".", Text


class RclLexer(RegexLexer):  # type: ignore[misc]  # pygments has no types
    """The ROS Contract Language."""

    name = "RCL"
    url = "https://github.com/autonomy-and-verification/ros-contract-language"
    aliases: ClassVar[list[str]] = ["rcl"]
    filenames: ClassVar[list[str]] = ["*.rcl"]
    mimetypes: ClassVar[list[str]] = ["text/x-rcl"]
    version_added = ""
    tokens: ClassVar[dict[str, list[Any]]] = {"root": list(_rules())}
