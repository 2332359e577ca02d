"""Diagnostic codes: each is declared once, used, and listed. AVOW_REFRESH=1 rewrites docs/diagnostics.md."""

from __future__ import annotations

import ast
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from helpers import nodes, parsed

from avow.backend_kit.registry import backend, names
from avow.base.codes import LANGUAGE, Code, advice, core_codes, declare, register, sections
from avow.base.diagnostics import Diagnostic, Severity
from avow.base.rendering import render, to_sarif, told
from avow.language.load import check_text
from avow.system.strict_yaml import read_yaml

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "diagnostics.md"
FORM = re.compile(r"[A-Z]{2,}[0-9]{3}")
RANK = {"Severity.NOTE": 0, "Severity.WARNING": 1, "Severity.ERROR": 2}
INTRO = """\
# Diagnostics

A code keeps its meaning from version to version. `avow check --explain` prints the entries of this page. An error stops
the command with exit code 2; a warning does not. The severity given is the greatest that the code can have.
"""


def modules() -> Iterator[tuple[Path, ast.Module]]:
    """The modules that speak of codes, but for those that declare them."""
    for folder in ("avow", "backends"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            text = path.read_text("utf-8")
            if not path.name.startswith("codes") and FORM.search(text):
                yield path, parsed(text)


def code_of(node: ast.AST) -> str | None:
    """The code that a node is, where it is one."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and FORM.fullmatch(node.value):
        return node.value
    return None


def used(modules: Iterable[tuple[Path, ast.Module]]) -> dict[str, set[str]]:
    """Code → the folders in which it stands as a string."""
    found: dict[str, set[str]] = {}
    for path, module in modules:
        for node in nodes(module):
            code = code_of(node)
            if code is not None:
                found.setdefault(code, set()).add(
                    path.relative_to(ROOT).parts[0] + "/" + path.relative_to(ROOT).parts[1]
                )
    return found


def severities(modules: Iterable[tuple[Path, ast.Module]]) -> dict[str, int]:
    """Code → the greatest severity with which a `Diagnostic(…)` names it; those made by way of helpers are not here."""
    found: dict[str, int] = {}
    for _, module in modules:
        for node in nodes(module):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Diagnostic":
                parts = [*node.args, *(k.value for k in node.keywords)]
                code = code_of(parts[0]) if parts else None
                said = [RANK[text] for text in map(ast.unparse, parts) if text in RANK]
                if code is not None:
                    found[code] = max(found.get(code, 0), *said, 2 if not said else 0)
    return found


def test_every_error_and_warning_says_what_to_do() -> None:
    """A diagnostic without a hint shows its code's remedy. A code has none only if its diagnostics have hints."""
    loaded = declared()
    for code in loaded.values():
        found = [d for d in check_text(code.text, "f")[1] if d.code == code.code] if code.code[:3] == "RCL" else []
        assert code.remedy or (found and all(d.hint for d in found)), code.code
    bare = [Diagnostic(code.code, "so it is") for code in loaded.values() if code.remedy]
    assert render(bare).count("= help: ") == len(bare)
    (shown,) = told([Diagnostic("MON203", "so it is")]).diagnostics
    assert shown.hint == "record it again, or export JSON lines"
    assert "(record it again" in str(to_sarif([Diagnostic("MON203", "so it is")]))
    assert advice(Diagnostic("MON203", "so it is", severity=Severity.NOTE)) == ""


def backends() -> dict[str, dict[str, Code]]:
    return {name: dict(backend(name).codes) for name in names() if (ROOT / "backends" / name).is_dir()}


def declared() -> dict[str, Code]:
    return register(*core_codes().values(), *(code for codes in backends().values() for code in codes.values()))


@pytest.fixture(scope="module")
def sources() -> list[tuple[Path, ast.Module]]:
    return list(modules())


@pytest.fixture(scope="module")
def where(sources: list[tuple[Path, ast.Module]]) -> dict[str, set[str]]:
    return used(sources)


def test_codes_are_found_where_they_stand() -> None:
    text = 'fail("NEW001", f"NEW002")\nDiagnostic("NEW003", m, span, Severity.WARNING)\nx = Diagnostic("NEW004", m)'
    sown = [(ROOT / "backends" / "x" / "y.py", ast.parse(text))]
    assert used(sown) == {f"NEW00{n}": {"backends/x"} for n in (1, 2, 3, 4)}
    assert severities(sown) == {"NEW003": 1, "NEW004": 2}


def test_every_code_used_is_declared(where: dict[str, set[str]]) -> None:
    assert sorted(set(where) - set(declared())) == [], "declare it (docs/developers/architecture.md, a message)"


def test_every_code_declared_is_used(where: dict[str, set[str]]) -> None:
    assert sorted(set(declared()) - set(where)) == []


def test_no_code_is_declared_twice() -> None:
    code = declare("A001", "a", "a", "a")
    with pytest.raises(ValueError, match="A001 is declared twice"):
        register(code, code)
    assert len(declared()) == len(core_codes()) + sum(map(len, backends().values()))
    for path in (ROOT / "avow/base/codes.yaml", *ROOT.glob("backends/*/codes.yaml")):
        assert [d for d in read_yaml(path.read_bytes(), path.name)[1] if "U+0000" not in d.message] == []


def test_backends_declare_their_own(where: dict[str, set[str]]) -> None:
    """A backend uses only its own codes; of the core, only the commands that are its own may use them."""
    for name, codes in backends().items():
        assert codes, name
        for code in codes:
            assert f"backends/{name}" in where[code]
            assert where[code] <= {f"backends/{name}", "avow/cli"}, code
    for code in core_codes():
        assert not any(place.startswith("backends/") for place in where[code]), code


def test_severities_are_those_declared(sources: list[tuple[Path, ast.Module]]) -> None:
    known, rank = declared(), {"note": 0, "warning": 1, "error": 2}
    found = severities(sources)
    assert len(found) > 60
    for code, greatest in found.items():
        assert greatest <= rank[known[code].severity], code


def test_every_code_says_what_it_means() -> None:
    for code in declared().values():
        assert FORM.fullmatch(code.code)
        assert code.title
        assert not code.explanation or code.explanation.endswith((".", "`)", ".)")), code.code
        assert code.explanation or code.remedy, code.code
        assert code.remedy.endswith((".", "`")) or code.code in sections()[LANGUAGE], code.code


def page_entry(code: Code) -> str:
    """A code in `docs/diagnostics.md`."""
    mark = "" if code.severity is Severity.ERROR else f" ({code.severity})"
    return " ".join(filter(None, (f"**{code.code}{mark}, {code.title}.**", code.explanation, code.remedy)))


def test_the_page_is_in_step() -> None:
    own = {f"The backend {name}": codes for name, codes in backends().items()}
    page = INTRO
    for title, codes in {**sections(), **own}.items():
        page += f"\n## {title}\n\n" + "\n\n".join(map(page_entry, codes.values())) + "\n"
    if os.environ.get("AVOW_REFRESH"):
        PAGE.write_text(page, "utf-8")
    assert PAGE.read_text("utf-8") == page, "AVOW_REFRESH=1 .venv/bin/pytest tests/core/test_codes.py"
