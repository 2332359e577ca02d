"""What is wrong with a text that is no YAML or no XML: where, in words, and what to write."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from xml.parsers import expat

import yaml

from avow.base.diagnostics import Malformed
from avow.base.packaged import packaged

# -- YAML --------------------------------------------------------------------------------------------------------------


def yaml_fault(text: str, error: yaml.YAMLError | RecursionError) -> Malformed:
    """`error`: what PyYAML raised for the text."""
    if isinstance(error, RecursionError):
        return Malformed("nested too deeply")
    if isinstance(error, yaml.reader.ReaderError):
        before = text[: error.position]
        shown = f"character U+{ord(text[error.position]):04X}" if error.position < len(text) else "a character"
        return Malformed(f"{shown} does not belong in YAML", before.count("\n") + 1, len(before) - before.rfind("\n"))
    if not isinstance(error, yaml.MarkedYAMLError):
        return Malformed("not YAML")
    mark, begun = error.problem_mark or error.context_mark, error.context_mark
    noticed = mark.line if mark else 0
    if begun and begun.line < noticed and re.search("flow|simple key|quoted", error.context or ""):
        mark = begun  # what is not ended is the fault, not the line at which that is noticed
    line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
    if quote := _open_quote(text, noticed):
        message = f"the text that begins with this {text[quote.index]} is closed only on a later line, or never"
        return Malformed(message, quote.line + 1, quote.column + 1, f"close it with {text[quote.index]} where it ends")
    problem, hint = _in_words("yaml", error.problem or "not YAML")
    return _line_before(text.splitlines(), line - 1) or Malformed(problem, line, column, hint)


def _open_quote(text: str, noticed: int) -> yaml.Mark | None:
    """Where a quoted text begins that runs over several lines to the one at which a fault is noticed: its quotation
    mark is probably not closed, and the next text's closes it."""
    try:
        for token in yaml.scan(text):
            mark: yaml.Mark = token.start_mark
            if getattr(token, "style", None) in ("'", '"') and mark.line < token.end_mark.line == noticed:
                return mark
    except yaml.MarkedYAMLError as error:
        if "quoted" in (error.context or ""):
            return error.context_mark
    return None


def _line_before(lines: Sequence[str], at: int) -> Malformed | None:
    """The fault of the line before line `at`, if that one begins no item of a list although this one does, in the same
    column, or lacks the blank between a key and its value."""
    before = next((k for k in range(at - 1, -1, -1) if lines[k].strip() and lines[k].lstrip()[0] != "#"), None)
    if before is None or at >= len(lines):
        return None
    column = len(lines[before]) - len(lines[before].lstrip())
    if found := re.match(r"\s*(?:- )?(\w+):[\w.]+$", lines[before]):
        return Malformed(f"a blank is missing after `{found[1]}:`", before + 1, column + 1, "write `key: value`")
    undashed = lines[at].lstrip().startswith("- ") and column == len(lines[at]) - len(lines[at].lstrip())
    if not undashed or lines[before].lstrip().startswith("-"):
        return None
    return Malformed("this line begins no item of the list below", before + 1, column + 1, "write `- ` before it")


def _in_words(kind: str, problem: str) -> tuple[str, str | None]:
    for pattern, words, *hint in packaged("avow.base", "malformed.yaml")[kind]:
        if found := re.search(pattern, problem):
            said = words.format(*(f"`{part}`" if "{0}`" not in words else part for part in found.groups()))
            return said, "".join(hint) or None
    return problem, None


# -- XML ---------------------------------------------------------------------------------------------------------------


def xml_fault(text: str | bytes, error: expat.ExpatError) -> Malformed:
    """`error`: what expat raised for the text."""
    opened: list[tuple[str, int]] = []
    parser = expat.ParserCreate()
    parser.StartElementHandler = lambda tag, _: opened.append((tag, parser.CurrentLineNumber))
    parser.EndElementHandler = lambda _: opened.pop()
    with suppress(expat.ExpatError):
        parser.Parse(text, True)
    said = expat.ErrorString(error.code)
    message, hint = _in_words("xml", said)
    if opened and said in ("mismatched tag", "no element found"):
        tag, line = opened[-1]
        message = f"<{tag}> of line {line} is not closed before this"
        hint = f"write `</{tag}>` here, or end its first tag on line {line} with `/>`"
    return Malformed(f"this is not XML: {message}", error.lineno, error.offset + 1, hint)
