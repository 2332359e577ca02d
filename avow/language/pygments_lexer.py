"""RCL for Pygments: `pip install` registers it, so that `pygmentize -l rcl`, Sphinx and friends colour contracts."""

from __future__ import annotations

from typing import Any, ClassVar

from pygments.lexer import RegexLexer, bygroups, words
from pygments.token import Comment, Keyword, Name, Number, Operator, Punctuation, String, Text, Whitespace

_NAME = r"[A-Za-z_][A-Za-z0-9_']*"
_ROS = ("bool", "byte", "char", "string", "wstring", "time", "duration", "float32", "float64")


class RclLexer(RegexLexer):  # type: ignore[misc]  # pygments has no types
    """The ROS Contract Language."""

    name = "RCL"
    url = "https://github.com/autonomy-and-verification/ros-contract-language"
    aliases: ClassVar[list[str]] = ["rcl"]
    filenames: ClassVar[list[str]] = ["*.rcl"]
    mimetypes: ClassVar[list[str]] = ["text/x-rcl"]
    version_added = ""

    tokens: ClassVar[dict[str, list[Any]]] = {
        "root": [
            (r"\s+", Whitespace),
            (r"//[^\n]*", Comment.Single),
            (r"/\*", Comment.Multiline, "comment"),
            (rf"(node)(\s+)({_NAME})", bygroups(Keyword.Declaration, Whitespace, Name.Class)),
            (
                rf"(assume|guarantee|A|G)(\s+)({_NAME})(?=\s*[\"(])",
                bygroups(Keyword.Declaration, Whitespace, Name.Label),
            ),
            (
                words(
                    ("context", "node", "inputs", "outputs", "topics", "define", "assume", "guarantee"), suffix=r"\b"
                ),
                Keyword.Declaration,
            ),
            (r"\b[AG](?=\s*[\"(])", Keyword.Declaration),
            (rf"(in|out)(\s*\.\s*)({_NAME})", bygroups(Name.Variable.Instance, Punctuation, Name.Variable)),
            (
                words(
                    ("forall", "exists_unique", "exists", "matches", "upto", "if", "then", "else", "since", "until"),
                    suffix=r"\b(?!')",
                ),
                Keyword,
            ),
            (r"!\s*in\b", Operator.Word),
            (words(("and", "or", "not", "in"), suffix=r"\b(?!')"), Operator.Word),
            (words(("REAL", "INTEGER", "NATURAL", "BOOL", "STRING"), suffix=r"\b(?!')"), Keyword.Type),
            (words(("TRUE", "FALSE"), suffix=r"\b(?!')"), Keyword.Constant),
            (
                rf"({_NAME})(/)({_NAME})(?:(/)({_NAME}))?",
                bygroups(Name.Namespace, Punctuation, Name.Class, Punctuation, Name.Class),
            ),
            (words(_ROS, suffix=rf"\b(?=\s+{_NAME})"), Keyword.Type),
            (rf"{_NAME}(?=\s*\()", Name.Function),
            (_NAME, Name),
            (r"[0-9]+\.[0-9]+", Number.Float),
            (r"[0-9]+", Number.Integer),
            (r'"(?:[^"\\\n]|\\.)*"', String.Double),
            (r"-->|<=>|->|==|!=|<=|>=|[-+*/<>=|]", Operator),
            (r"[(){},;:.]", Punctuation),
            (r".", Text),
        ],
        "comment": [
            (r"\*/", Comment.Multiline, "#pop"),
            (r"[^*]+|\*", Comment.Multiline),
        ],
    }
