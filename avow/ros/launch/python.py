"""Launch files in Python as elements: read by their syntax, never imported, never run.

The literal content of ``generate_launch_description`` is read: actions in lists, names that are bound once, texts
composed of constants and substitutions. The content of a loop, a conditional or another function is reported.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path

from avow.base.diagnostics import Diagnostic, Malformed, Span
from avow.base.python_names import unbound
from avow.base.records import dataclass
from avow.base.suggestions import nearest
from avow.base.tuning.sizes import LAUNCH_ELEMENTS
from avow.ros.launch.elements import (
    HINT,
    VARIABLE,
    Element,
    Parsed,
    Text,
    Unread,
    joined,
    literal,
    unread,
)

_NODES = {
    "Node": "node",
    "LifecycleNode": "node",
    "ComposableNodeContainer": "node_container",
    "ComposableNode": "composable_node",
}
_RENAMED = {
    "package": "pkg",
    "executable": "exec",
    "node_executable": "exec",
    "name": "name",
    "node_name": "name",
    "namespace": "namespace",
    "node_namespace": "namespace",
    "plugin": "plugin",
}
"""Keywords of nodes, and their names in XML."""
_READ = ("remappings", "parameters", "arguments", "ros_arguments", "composable_node_descriptions")
_OTHERS = (*_READ, "exec_name", "extra_arguments", "condition", "output", "prefix")
"""Keywords with a name like one of those that are read."""
_SILENT = frozenset(
    [
        "LogInfo",
        "SetUseSimTime",
        "SetEnvironmentVariable",
        "UnsetEnvironmentVariable",
        "AppendEnvironmentVariable",
        "SetROSLogDir",
    ]
)
"""Actions that start nothing and rename nothing."""
_ACTIONS = frozenset(
    (*_NODES, *["IncludeLaunchDescription", "GroupAction", "PushRosNamespace", "SetRemap", "LoadComposableNodes"])
)
"""Actions that must not be skipped without a report."""


_MADE: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "GroupAction": ("group", {"actions": "*", "scoped": "scoped"}),
    "TimerAction": ("timer", {"period": "", "actions": "*"}),
    "LoadComposableNodes": ("load_composable_node", {"composable_node_descriptions": "*"}),
    "PushRosNamespace": ("push_ros_namespace", {"namespace": "namespace"}),
    "PushROSNamespace": ("push_ros_namespace", {"namespace": "namespace"}),
    "SetRemap": ("set_remap", {"src": "from", "dst": "to"}),
    "SetParameter": ("set_parameter", {"name": "name", "value": "value"}),
    "SetParametersFromFile": ("set_parameter", {"filename": "from"}),
    "DeclareLaunchArgument": ("arg", {"name": "name", "default_value": "default"}),
    "SetLaunchConfiguration": ("let", {"name": "name", "value": "value"}),
}
"""Action → the tag of its element, and its arguments in their order, with the XML name of each; ``*``: it holds
actions; empty: it is not read."""


_MODULES = {
    "launch": ("LaunchDescription",),
    "launch.actions": ("DeclareLaunchArgument", "GroupAction", "IncludeLaunchDescription", "LogInfo", "TimerAction"),
    "launch.conditions": ("IfCondition", "UnlessCondition"),
    "launch.launch_description_sources": ("PythonLaunchDescriptionSource",),
    "launch.substitutions": ("LaunchConfiguration", "PathJoinSubstitution", "TextSubstitution", "Command"),
    "launch_ros.actions": (*sorted(_ACTIONS - {"ComposableNode", "IncludeLaunchDescription", "GroupAction"}),),
    "launch_ros.descriptions": ("ComposableNode", "ParameterValue"),
    "launch_ros.substitutions": ("FindPackageShare",),
    "ament_index_python.packages": ("get_package_share_directory",),
}
"""Module → the names that launch files often import from it."""


def from_python(text: str, file: str) -> Parsed:
    """Raises Malformed."""
    try:
        return _Python(file, ast.parse(text)).parsed()
    except SyntaxError as error:
        raise Malformed(f"this is not Python: {error.msg}", error.lineno or 1, error.offset or 1) from None
    except (RecursionError, ValueError, MemoryError):
        raise Malformed("this is not Python that can be read", 1) from None


@dataclass(slots=True)
class _Python:
    file: str
    module: ast.Module
    found: Parsed = field(default_factory=Parsed)
    bound: dict[str, ast.expr] = field(default_factory=dict)
    added: dict[str, list[ast.expr]] = field(default_factory=dict)
    """The values appended to a list or a launch description of that name."""
    seen: set[int] = field(default_factory=set)
    steps: int = 0

    def parsed(self) -> Parsed:
        top = [
            s for s in self.module.body if isinstance(s, ast.FunctionDef) and s.name == "generate_launch_description"
        ]
        if len(top) != 1:
            raise Malformed("a launch file in Python defines generate_launch_description() once", 1)
        counts = _bindings(self.module)
        result: ast.expr | None = None
        for statement in (*self.module.body, *top[0].body):
            if isinstance(statement, ast.Return):
                result = result or statement.value
            elif result is None:
                self.statement(statement, counts)
        if result is None:
            self.tell(top[0], "generate_launch_description() returns nothing at its end")
        self.found.elements = tuple(self.actions(result)) if result is not None else ()
        for node in ast.walk(self.module):
            if id(node) in self.seen:
                continue
            if isinstance(node, ast.Return) and node not in top[0].body and node in set(ast.walk(top[0])):
                self.tell(node, "what is returned under a condition is not read")
            elif isinstance(node, ast.Call) and _called(node) in _ACTIONS:
                self.tell(node, f"this {_called(node)}(…) is not read: it is not written out in the list of actions")
        for name, hint in unbound(self.module):
            known = (
                f"write `from {module} import {name.id}`" for module, names in _MODULES.items() if name.id in names
            )
            hint = next(known, hint)
            text = f"{Path(self.file).name}: `{name.id}` is not defined: the file neither imports nor assigns it"
            self.found.unread.append(Diagnostic("ROS120", text, self.at(name), hint=hint))
        return self.found

    def statement(self, statement: ast.stmt, counts: Mapping[str, int]) -> None:
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)], value=value) if counts[name] == 1:
                self.bound[name] = value
            case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value) if counts[name] == 1:
                self.bound[name] = value
            case ast.Expr(value=ast.Call(func=ast.Attribute(value=ast.Name(id=name), attr=method), args=[item])):
                if method in ("add_action", "append", "add_entity"):
                    self.added.setdefault(name, []).append(item)
                elif method == "extend":
                    self.added.setdefault(name, []).append(ast.Starred(item, ast.Load()))
            case _:  # actions in it are searched for at the end
                pass

    # -- actions -------------------------------------------------------------------------------------------------------

    def actions(self, node: ast.expr) -> list[Element]:
        self.step(node)
        self.seen.add(id(node))
        match node:
            case ast.List(elts=items) | ast.Tuple(elts=items):
                return [element for item in items for element in self.actions(item)]
            case ast.Starred(value=value):
                return self.actions(value)
            case ast.BinOp(left=left, op=ast.Add(), right=right):
                return self.actions(left) + self.actions(right)
            case ast.Name(id=name) if name in self.bound:
                added = self.added.get(name, [])
                return [e for part in (self.bound[name], *added) for e in self.actions(part)]
            case ast.Call():
                return self.action(node)
            case _:  # reported: its value is known only at run time
                self.tell(node, f"`{_shown(node)}` is not evaluated")
                return []

    def action(self, call: ast.Call) -> list[Element]:
        name = _called(call)
        if name in _NODES:
            return [self.node(call, _NODES[name])]
        if name in _SILENT:
            return []
        if name == "LaunchDescription":
            parts = self.given(call, ("initial_entities",))
            return self.actions(parts["initial_entities"]) if "initial_entities" in parts else []
        if name == "IncludeLaunchDescription":
            return [self.include(call)]
        if name in _MADE:
            tag, named = _MADE[name]
            parts = self.given(call, tuple(named))
            children = [e for key, to in named.items() if to == "*" and key in parts for e in self.actions(parts[key])]
            said = {to: self.text(parts[key]) for key, to in named.items() if to not in ("", "*") and key in parts}
            return [Element(tag, {**said, **self.condition(call)}, tuple(children), self.at(call))]
        self.tell(call, f"{name}(…) is not read")
        self.seen |= {id(inner) for inner in ast.walk(call)}
        return []

    def given(self, call: ast.Call, names: Sequence[str]) -> dict[str, ast.expr]:
        """The arguments by name; those in `names` may be positional."""
        return dict(zip(names, call.args, strict=False)) | {k.arg: k.value for k in call.keywords if k.arg is not None}

    def node(self, call: ast.Call, tag: str) -> Element:
        texts: dict[str, Text] = {}
        children: list[Element] = []
        for keyword in call.keywords:
            if keyword.arg in _RENAMED:
                texts[_RENAMED[keyword.arg]] = self.text(keyword.value)
            elif keyword.arg == "remappings":
                children += self.remaps(keyword.value)
            elif keyword.arg == "parameters":
                children += self.parameters(keyword.value)
            elif keyword.arg in ("arguments", "ros_arguments"):
                parts = self.items(keyword.value)
                texts["args"] = (
                    joined([p for part in parts for p in (" ", self.text(part))])
                    if parts is not None
                    else self.unknown(keyword.value)
                )
            elif keyword.arg == "composable_node_descriptions":
                children += self.actions(keyword.value)
            elif keyword.arg is None:
                texts["args"] = Unread("its keywords are not written out")
            elif keyword.arg not in _OTHERS and (near := nearest(keyword.arg, (*_RENAMED, *_READ), alike=0.75)):
                message = f"{_called(call)} has no keyword `{keyword.arg}`"
                self.tell(keyword.value, message, f"did you mean `{near[0]}`?")
        return Element(tag, {**texts, **self.condition(call)}, tuple(children), self.at(call))

    def remaps(self, node: ast.expr) -> list[Element]:
        found: list[Element] = []
        pairs = self.items(node)
        for pair in pairs if pairs is not None else [node]:
            parts = self.items(pair) if pairs is not None else None
            texts = [self.text(part) for part in parts] if parts is not None else []
            if len(texts) != 2:
                texts = [self.unknown(pair)] * 2
            found.append(Element("remap", {"from": texts[0], "to": texts[1]}, (), self.at(pair)))
        return found

    def parameters(self, node: ast.expr) -> list[Element]:
        """Files and mappings; those that cannot be read are left out."""
        found: list[Element] = []
        if isinstance(self.value(node), ast.Dict):
            self.tell(node, "`parameters` is no list, which launch_ros refuses", "write `parameters=[{…}]`")
        for item in self.items(node) or [node]:
            value = self.value(item)
            if isinstance(value, ast.Dict):
                pairs = [(k or v, v) for k, v in zip(value.keys, value.values, strict=True)]
                texts = [{"name": self.text(k), "value": self.text(v)} for k, v in pairs]
            else:
                texts = [{"from": self.text(value)}]
            found += [Element("param", one, (), self.at(item)) for one in texts]
        return found

    def include(self, call: ast.Call) -> Element:
        parts = self.given(call, ("launch_description_source",))
        source = self.value(parts["launch_description_source"]) if "launch_description_source" in parts else None
        if isinstance(source, ast.Call) and _called(source).endswith("LaunchDescriptionSource"):
            inner = self.given(source, ("launch_file_path",))
            path = inner.get("launch_file_path", inner.get("location"))
            file = self.text(path) if path is not None else self.unknown(call)
        else:
            file = self.text(source) if source is not None else self.unknown(call)
        children: list[Element] = []
        for keyword in call.keywords:
            if keyword.arg == "launch_arguments":
                children += self.arguments(keyword.value)
        return Element("include", {"file": file, **self.condition(call)}, tuple(children), self.at(call))

    def arguments(self, node: ast.expr) -> list[Element]:
        value = self.value(node)
        if isinstance(value, ast.Call) and _called(value) == "items" and isinstance(value.func, ast.Attribute):
            value = self.value(value.func.value)
        pairs: list[tuple[ast.expr | None, ast.expr]] = []
        if isinstance(value, ast.Dict):
            pairs = list(zip(value.keys, value.values, strict=True))
        else:
            for item in self.items(value) or ():
                parts = self.items(item)
                if parts is not None and len(parts) == 2:
                    pairs.append((parts[0], parts[1]))
        if not pairs:
            self.tell(node, f"the arguments `{_shown(node)}` are not evaluated")
        named = [(key, v) for key, v in pairs if key is not None]
        return [Element("arg", {"name": self.text(key), "value": self.text(v)}, (), self.at(v)) for key, v in named]

    def condition(self, call: ast.Call) -> dict[str, Text]:
        given = next((k.value for k in call.keywords if k.arg == "condition"), None)
        if given is None or (isinstance(given, ast.Constant) and given.value is None):
            return {}
        value = self.value(given)
        if isinstance(value, ast.Call) and len(value.args) == 1 and not value.keywords:
            match _called(value):
                case "IfCondition":
                    return {"if": self.text(value.args[0])}
                case "UnlessCondition":
                    return {"unless": self.text(value.args[0])}
                case _:  # any other condition is not evaluated
                    pass
        return {"if": Unread(f"the condition `{_shown(given)}` is not evaluated")}

    # -- values --------------------------------------------------------------------------------------------------------

    def value(self, node: ast.expr) -> ast.expr:
        """The value of a name."""
        self.step(node)
        self.seen.add(id(node))
        if isinstance(node, ast.Name) and node.id in self.bound and node.id not in self.added:
            return self.value(self.bound[node.id])
        return node

    def items(self, node: ast.expr) -> list[ast.expr] | None:
        """The items of a literal list; None for anything else."""
        self.step(node)
        match node:
            case ast.List(elts=items) | ast.Tuple(elts=items):
                found: list[ast.expr] = []
                for item in items:
                    inner = self.items(item.value) if isinstance(item, ast.Starred) else [item]
                    if inner is None:
                        return None
                    found += inner
                return found
            case ast.BinOp(left=left, op=ast.Add(), right=right):
                one, other = self.items(left), self.items(right)
                return None if one is None or other is None else one + other
            case ast.Name(id=name) if name in self.bound:
                known = self.items(self.bound[name])
                if known is None or any(isinstance(a, ast.Starred) for a in self.added.get(name, ())):
                    return None
                return known + self.added.get(name, [])
            case _:  # not a literal list
                return None

    def text(self, node: ast.expr) -> Text:
        node = self.value(node)
        match node:
            case ast.Constant(value=bool() | int() | float() as value):
                return str(value)
            case ast.Constant(value=str() as value):
                return literal(value)
            case ast.JoinedStr(values=values):
                return joined([self.text(v) for v in values])
            case ast.FormattedValue(value=value, conversion=-1, format_spec=None):
                return self.text(value)
            case ast.BinOp(left=left, op=ast.Add(), right=right):
                return joined([self.text(left), self.text(right)])
            case ast.List() | ast.Tuple():
                parts = self.items(node)
                return joined([self.text(part) for part in parts]) if parts is not None else self.unknown(node)
            case ast.Call():
                return self.called(node)
            case _:  # reported where it matters
                return self.unknown(node)

    def called(self, call: ast.Call) -> Text:
        """A substitution, or a function whose result is known."""
        one = self.text(call.args[0]) if len(call.args) == 1 and not call.keywords else None
        match _called(call):
            case "LaunchConfiguration" if (name := self.word(call, "variable_name")) is not None:
                return f"$(var {name})"
            case "FindPackageShare" | "get_package_share_directory" | "get_package_share_path":
                name = self.word(call, "package", "package_name")
                return self.unknown(call) if name is None else f"$(find-pkg-share {name})"
            case "EnvironmentVariable" if (name := self.word(call, "name")) is not None:
                return f"$(env {name})"
            case "ThisLaunchFileDir":
                return "$(dirname)"
            case "TextSubstitution":
                texts = self.given(call, ("text",))
                return self.text(texts["text"]) if "text" in texts else self.unknown(call)
            case "str" if one is not None:
                return one
            case "dirname" if ast.unparse(call.args[0]) in _THIS_FILE:
                return "$(dirname)"
            case "PathJoinSubstitution" if call.args:
                return self.path(self.items(call.args[0]), call)
            case "join" if isinstance(call.func, ast.Attribute) and ast.unparse(call.func.value).endswith("path"):
                return self.path(call.args, call)
            case _:  # reported where it matters
                return self.unknown(call)

    def word(self, call: ast.Call, *keywords: str) -> str | None:
        """The only constant that is given."""
        given = [*call.args, *(k.value for k in call.keywords if k.arg in keywords)]
        text = self.text(given[0]) if given else None
        return text if isinstance(text, str) and VARIABLE.match(text) else None

    def path(self, parts: Sequence[ast.expr] | None, call: ast.Call) -> Text:
        if parts is None or any(isinstance(part, ast.Starred) for part in parts):
            return self.unknown(call)
        texts = [self.text(part) for part in parts]
        return joined([t for k, text in enumerate(texts) for t in ((text,) if k == 0 else ("/", text))])

    def unknown(self, node: ast.expr) -> Unread:
        return Unread(f"`{_shown(node)}` is not evaluated")

    def step(self, node: ast.expr) -> None:
        self.steps += 1
        if self.steps > LAUNCH_ELEMENTS:
            raise Malformed("it says more than can be read", getattr(node, "lineno", 1))

    def at(self, node: ast.expr | ast.stmt) -> Span:
        return Span(self.file, node.lineno, node.col_offset + 1, node.end_lineno or 0, (node.end_col_offset or 0) + 1)

    def tell(self, node: ast.expr | ast.stmt, message: str, hint: str = HINT) -> None:
        self.seen.add(id(node))
        self.found.unread.append(unread(self.at(node), message, hint))


_THIS_FILE = ("__file__", "os.path.abspath(__file__)", "os.path.realpath(__file__)")


def _called(call: ast.Call) -> str:
    match call.func:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name
        case _:  # the function called has no name
            return "a call"


def _shown(node: ast.expr) -> str:
    text = " ".join(ast.unparse(node).split())
    return text if len(text) <= 60 else f"{text[:59]}…"


def _bindings(module: ast.Module) -> Counter[str]:
    """How often each name is bound, anywhere in the file: for one that is bound again, the value is ambiguous."""
    found: Counter[str] = Counter()
    for node in ast.walk(module):
        match node:
            case ast.Name(id=name, ctx=ast.Store() | ast.Del()) | ast.arg(arg=name):
                found[name] += 1
            case ast.Import(names=names) | ast.ImportFrom(names=names):
                found.update(alias.asname or alias.name for alias in names)
            case _:  # binds no name
                pass
    return found
