"""A node's own class, as far as its text shows, without running it, that it fails: callbacks, imports of messages,
undefined names."""

from __future__ import annotations

import ast
import contextlib
import functools
import re
from collections.abc import Callable, Iterator, Mapping

from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.base.files import inside, read_regular
from avow.base.plain import count
from avow.base.python_names import unbound
from avow.base.suggestions import suggest
from avow.ros.definitions import Message
from avow.ros.sources import definitions
from avow.system.plan import Plan

_GIVES: Mapping[str, tuple[int, str, tuple[str, ...], int]] = {
    "create_subscription": (2, "callback", ("message",), 1),  # and the message's info, in newer distributions
    "create_timer": (1, "callback", (), 0),
    "create_service": (2, "callback", ("request", "response"), 0),
    "add_on_set_parameters_callback": (0, "callback", ("parameters",), 0),
    "rospy.Subscriber": (2, "callback", ("message",), 1),  # and `callback_args`
    "rospy.Timer": (1, "callback", ("event",), 0),
    "rospy.Service": (2, "handler", ("request",), 0),
}
"""ROS' functions that take a callback: its position and keyword, what it is called with, and how much more that may
be."""


def misused(plan: Plan) -> Iterator[Diagnostic]:
    """Callbacks that do not take what ROS calls them with, and a warning for each name that nothing defines, in the
    Python files that the plan names as sources. A file that is no Python is left to the methods."""
    messages = functools.cache(lambda: definitions(plan.messages, plan.ros.distro)[0].messages)  # read if a file asks
    for entry in plan.nodes:
        path = inside(plan.root, entry.source.python) if entry.source and entry.source.python else None
        if path is None:
            continue
        with contextlib.suppress(OSError, SyntaxError, ValueError, RecursionError):
            tree = ast.parse(read_regular(path))
            faults = [*_callbacks(tree, str(path)), *_imports(tree, str(path), messages)]
            yield from faults
            remedied = set(
                re.findall(r"\w+", " ".join(re.findall("`([^`]*)`", " ".join(d.hint or "" for d in faults))))
            )
            for name, hint in unbound(tree):
                if name.id in remedied:
                    continue
                packages = sorted(kind.partition("/")[0] for kind in messages() if kind.endswith(f"/{name.id}"))
                if packages:
                    hint = f"write `from {packages[0]}.msg import {name.id}`"
                message = f"`{name.id}` is not defined: the file neither imports nor assigns it"
                yield Diagnostic("DRIVE106", message, _span(name, str(path)), Severity.WARNING, hint)


def _imports(tree: ast.Module, file: str, messages: Callable[[], Mapping[str, Message]]) -> Iterator[Diagnostic]:
    """A warning for each message that is imported from a known package without it."""
    wanted = [(node, part) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for part in node.names]
    wanted = [(node, part) for node, part in wanted if (node.module or "").endswith(".msg") and not node.level]
    known = messages() if wanted else {}
    for node, part in wanted:
        package = (node.module or "").removesuffix(".msg")
        own = [name.removeprefix(f"{package}/") for name in known if name.startswith(f"{package}/")]
        if own and part.name not in (*own, "*"):
            at = Span(file, part.lineno, part.col_offset + 1, part.lineno, part.col_offset + 1 + len(part.name))
            message = f"there is no message {package}/{part.name}"
            yield Diagnostic("DRIVE107", message, at, Severity.WARNING, suggest(part.name, own))


def _callbacks(tree: ast.Module, file: str) -> Iterator[Diagnostic]:
    stored = {
        node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)
    }
    for owner in (statement for statement in tree.body if isinstance(statement, ast.ClassDef)):
        methods = {one.name: one for one in owner.body if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef)}
        for call in (each for each in ast.walk(owner) if isinstance(each, ast.Call)):
            called = getattr(call.func, "attr", "")
            called = f"rospy.{called}" if getattr(getattr(call.func, "value", None), "id", "") == "rospy" else called
            position, keyword, names, more = _GIVES.get(called, (0, "", (), 0))
            given = [k.value for k in call.keywords if k.arg == keyword] or call.args[position : position + 1]
            match given:
                case [ast.Attribute(value=ast.Name(id="self"), attr=name)] if called in _GIVES:
                    act = methods.get(name)
                case _:  # no callback, or none that its text decides
                    continue
            if act is None or act.decorator_list or name in stored or _takes(act.args, 1 + len(names), more):
                continue
            what = " and ".join(("the object", *(f"the {each}" for each in names)))
            takes = count(len(act.args.posonlyargs + act.args.args), "argument")
            message = f"{called} calls `{name}` with {what}, and it takes {takes}"
            hint = f"write `def {name}({', '.join(('self', *names))})`"
            notes = (("it is registered here", _span(call, file)),)
            yield Diagnostic("DRIVE105", message, _span(act, file), hint=hint, notes=notes)


def _takes(arguments: ast.arguments, given: int, more: int) -> bool:
    most = len(arguments.posonlyargs + arguments.args)
    least = most - len(arguments.defaults)
    return (
        least <= given + more and (given <= most or arguments.vararg is not None) and None not in arguments.kw_defaults
    )


def _span(node: ast.stmt | ast.expr, file: str) -> Span:
    """Of a name, the name of a function, or the beginning of something else."""
    start = node.col_offset + 1
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        start += len("def ") if isinstance(node, ast.FunctionDef) else len("async def ")
    length = len(getattr(node, "name", getattr(node, "id", " ")))
    return Span(file, node.lineno, start, node.lineno, start + length)
