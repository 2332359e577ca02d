"""Names of a Python file: what it defines and imports, and those that nothing in it binds."""

from __future__ import annotations

import ast
import builtins
import sys
from collections.abc import Mapping

from avow.base.suggestions import did_you_mean

_KNOWN = frozenset((*dir(builtins), "__file__", "__path__", "__class__"))


def unbound(tree: ast.Module) -> list[tuple[ast.Name, str]]:
    """The first use of each name that neither the file nor Python defines, with a hint; none if the file imports
    everything of a module (``*``)."""
    bound: set[str] = set(_KNOWN)
    used: dict[str, ast.Name] = {}
    for node in ast.walk(tree):
        match node:
            case ast.Name(ctx=ast.Load()):
                first = used.setdefault(node.id, node)
                used[node.id] = min(first, node, key=lambda each: (each.lineno, each.col_offset))
            case ast.Import(names=names) | ast.ImportFrom(names=names):
                bound |= {(each.asname or each.name).partition(".")[0] for each in names}
            case ast.Global(names=texts) | ast.Nonlocal(names=texts):
                bound |= set(texts)
            case ast.Name(id=str(name)) | ast.arg(arg=str(name)) | ast.MatchMapping(rest=str(name)):
                bound.add(name)
            case _:  # definitions, except and case clauses
                bound.add(getattr(node, "name", None) or "")
    lost = [] if "*" in bound else [node for name, node in used.items() if name not in bound]
    return [(node, _hint(node.id, bound - _KNOWN)) for node in sorted(lost, key=lambda n: (n.lineno, n.col_offset))]


def _hint(name: str, bound: set[str]) -> str:
    if name in sys.stdlib_module_names:
        return f"write `import {name}`"
    return did_you_mean(name, bound) or "import it, or define it in this file"


def inherited(definition: ast.ClassDef, name: str, defined: Mapping[str, ast.AST]) -> ast.FunctionDef | None:
    """A class' method, its own or that of a base in the same file."""
    seen: list[ast.ClassDef] = []
    waiting = [definition]
    while waiting:
        one = waiting.pop(0)
        seen.append(one)
        if (method := method_of(one, name)) is not None:
            return method
        bases = [defined.get(base.id) for base in one.bases if isinstance(base, ast.Name)]
        waiting += [base for base in bases if isinstance(base, ast.ClassDef) and base not in seen]
    return None


def method_of(definition: ast.ClassDef, name: str) -> ast.FunctionDef | None:
    """A class' own method."""
    return next((s for s in definition.body if isinstance(s, ast.FunctionDef) and s.name == name), None)


def imported(tree: ast.Module) -> set[str]:
    """The first names of the modules that a file imports, at any place."""
    names: set[str] = set()
    for node in ast.walk(tree):
        names |= {node.module or ""} if isinstance(node, ast.ImportFrom) else set()
        names |= {alias.name for alias in node.names} if isinstance(node, ast.Import) else set()
    return {name.partition(".")[0] for name in names} - {""}


def top_level(tree: ast.Module) -> dict[str, ast.stmt]:
    """What a file defines, assigns and imports outside of functions and classes, by name."""
    found: dict[str, ast.stmt] = {}
    for statement in tree.body:
        match statement:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                found[name] = statement
            case ast.Assign(targets=targets):
                found.update((t.id, statement) for t in targets if isinstance(t, ast.Name))
            case ast.AnnAssign(target=ast.Name(id=name)):
                found[name] = statement
            case ast.Import(names=names) | ast.ImportFrom(names=names):
                found.update(((a.asname or a.name).partition(".")[0], statement) for a in names)
            case _:  # imports nothing
                pass
    return found
