"""A node's own class, as far as its text shows, without running it, that it fails: callbacks, imports of messages,
undefined names."""

from __future__ import annotations

import ast
import contextlib
import functools
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.base.files import inside, read_regular
from avow.base.plain import count
from avow.base.python_names import imported, inherited, top_level, unbound
from avow.base.suggestions import did_you_mean, suggest
from avow.ros.definitions import Message
from avow.ros.sources import definitions
from avow.system.plan import Driving, Plan, Source

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


_FIRST = {".msg": "", ".srv": "_Request", ".action": "_Goal"}
"""A module of generated classes → how the first of the messages that define each class ends."""


def misused(plan: Plan) -> Iterator[Diagnostic]:
    """Callbacks that do not take what ROS calls them with, and a warning for each name that nothing defines, in the
    Python files that the plan names as sources. A file that is no Python is left to the methods."""
    messages = functools.cache(lambda: definitions(plan.messages, plan.ros.distro)[0].messages)  # read if a file asks
    for entry in plan.nodes:
        if entry.source is None or not entry.source.python or (path := inside(plan.root, entry.source.python)) is None:
            continue
        with contextlib.suppress(OSError, SyntaxError, ValueError, RecursionError):
            tree = parsed(path)
            faults = [*_callbacks(tree, str(path)), *_imports(tree, str(path), messages)]
            faults += [*source_faults(entry.source, tree), *_named(tree, plan, entry.node, entry.source, str(path))]
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


def parsed(path: Path) -> ast.Module:
    """A Python file. Raises OSError, SyntaxError, ValueError and RecursionError."""
    return ast.parse(read_regular(path))


def _named(tree: ast.Module, plan: Plan, node: str, source: Source, file: str) -> Iterator[Diagnostic]:
    """A warning if a class of rclpy names its node otherwise than the plan, and no launch file can rename it: private
    topics and parameters have another name on the robot."""
    declared, placed = top_level(tree).get(source.class_name), plan.ros.names.placed(node).name
    if source.kind is not Driving.RCLPY or plan.launched or not isinstance(declared, ast.ClassDef):
        return
    for call in ast.walk(declared):
        match call:
            case ast.Call(
                func=ast.Attribute(value=ast.Call(func=ast.Name(id="super")), attr="__init__"),
                args=[ast.Constant(value=str(name)) as said, *_],
            ) if name != placed.rpartition("/")[2]:
                message = f"the class names its node `{name}`, and in the plan it is {placed}"
                hint = f"write `ros: {{nodes: {{{node}: {{name: {name}}}}}}}`, or name it alike"
                at = Span(file, said.lineno, said.col_offset + 1, said.lineno, (said.end_col_offset or 0) + 1)
                yield Diagnostic("DRIVE109", message, at, Severity.WARNING, hint)
            case _:  # not the node's name
                pass


def source_faults(source: Source, tree: ast.Module) -> tuple[Diagnostic, ...]:
    """What is wrong with the class that a plan declares, as far as its file's text shows: there is none of that name,
    or it is of another kind."""
    defined = top_level(tree)
    declared = defined.get(source.class_name)
    if not isinstance(declared, ast.ClassDef):
        hint = suggest(source.class_name, [name for name, one in defined.items() if isinstance(one, ast.ClassDef)])
        message = f"`{source.python}` defines no class `{source.class_name}`"
        return (Diagnostic("DRIVE108", message, source.place.at("source", "class"), hint=hint),)
    meant = [kind for kind in (Driving.RCLPY, Driving.ROSPY) if kind in imported(tree)]
    if len(meant) == 1 and source.kind not in meant and inherited(declared, "step", defined) is None:
        message = f"`{source.python}` imports {meant[0]}, and `kind` is {source.kind}"
        return (Diagnostic("DRIVE108", message, source.place.at("source"), hint=f"write `kind: {meant[0]}`"),)
    return ()


def _imports(tree: ast.Module, file: str, messages: Callable[[], Mapping[str, Message]]) -> Iterator[Diagnostic]:
    """A warning for each message that is imported from a known package without it."""
    wanted = [(node, part) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for part in node.names]
    wanted = [(node, part) for node, part in wanted if (node.module or "").endswith(tuple(_FIRST)) and not node.level]
    known = messages() if wanted else {}
    for node, part in wanted:
        package, _, kind = (node.module or "").rpartition(".")
        names = (re.fullmatch(rf"{package}/([^_]*){_FIRST[f'.{kind}']}", name, re.ASCII) for name in known)
        own, calls = [name[1] for name in names if name], list[str]()
        if kind == "srv":  # ROS 1 has classes for the parts of a call
            calls = [f"{name}{end}" for name in own for end in ("Request", "Response")]
        elif kind == "msg":  # and messages for those of an action
            ends = [name.partition("/")[2] for name in known if name.startswith(f"{package}/") and "_" in name]
            own += [name.replace("_", "") for name in ends]
            own += [f"{name.removesuffix('_Goal')}Action" for name in ends if name.endswith("_Goal")]
        if own and part.name not in (*own, *calls, "*"):
            at = Span(file, part.lineno, part.col_offset + 1, part.lineno, part.col_offset + 1 + len(part.name))
            message = f"there is no {kind.replace('msg', 'message')} {package}/{part.name}"
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
            if act is None and name not in stored and (near := did_you_mean(name, methods)):
                message = f"`self.{name}` is not defined: the class has no such method"
                yield Diagnostic("DRIVE106", message, _span(call, file), Severity.WARNING, near)
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
