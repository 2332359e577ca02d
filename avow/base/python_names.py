"""Names of a Python file that nothing in it binds."""

from __future__ import annotations

import ast
import builtins
import sys

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
