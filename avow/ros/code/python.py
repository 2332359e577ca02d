"""Nodes in Python, for rclpy and rospy: read by their syntax, never imported, never run."""

from __future__ import annotations

import ast
import contextlib
import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import field
from typing import Any

from avow.base.diagnostics import Span
from avow.base.records import dataclass
from avow.ros.code.created import Code, Created, is_harmless
from avow.ros.quality import LEVELS, PROFILES, SYSTEM, Quality, quality

_METHODS = {
    "create_publisher": ("publishes", ("kind", "name", "quality")),
    "create_lifecycle_publisher": ("publishes", ("kind", "name", "quality")),
    "create_subscription": ("subscribes", ("kind", "name", "", "quality")),
    "create_service": ("serves", ("kind", "name")),
    "create_client": ("calls", ("kind", "name")),
    "declare_parameter": ("declares", ("name", "value")),
    "declare_parameters": ("declares", ("namespace", "every")),
}
"""Methods of rclpy's Node: what they create, and the meaning of their first arguments."""
_CALLS = {
    "rospy.Publisher": ("publishes", ("name", "kind")),
    "rospy.Subscriber": ("subscribes", ("name", "kind")),
    "rospy.Service": ("serves", ("name", "kind")),
    "rospy.ServiceProxy": ("calls", ("name", "kind")),
    "actionlib.SimpleActionServer": ("does", ("name", "kind")),
    "actionlib.SimpleActionClient": ("orders", ("name", "kind")),
    "rclpy.action.ActionServer": ("does", ("", "kind", "name")),
    "rclpy.action.ActionClient": ("orders", ("", "kind", "name")),
    "message_filters.Subscriber": ("subscribes", ("", "kind", "name", "quality")),
}
"""Likewise functions, by their whole names."""
_WORDS = {"topic": "name", "srv_name": "name", "action_name": "name", "topic_name": "name", "ns": "name"}
_WORDS |= {"msg_type": "kind", "srv_type": "kind", "data_class": "kind", "service_class": "kind", "action_type": "kind"}
_WORDS |= {"qos_profile": "quality", "ActionSpec": "kind", "parameters": "every", "qos": "quality"}
"""Keywords, and their meanings."""
_TRANSFORMS = {
    "TransformListener": ("subscribes", ("/tf", "/tf_static")),
    "TransformBroadcaster": ("publishes", ("/tf",)),
    "StaticTransformBroadcaster": ("publishes", ("/tf_static",)),
}
_BLIND = ("exec", "eval", "getattr", "setattr", "__import__")
"""Functions by which a program may create what its text does not name."""


def from_python(text: str, file: str, class_name: str = "", beside: Collection[str] = ()) -> Code:
    """`beside`: names of files that are read too. Raises SyntaxError, ValueError, RecursionError and MemoryError."""
    module = ast.parse(text)
    return _Reader(file, module, beside).read(class_name)


@dataclass(slots=True)
class _Reader:
    file: str
    module: ast.Module
    beside: Collection[str] = ()
    names: dict[str, str] = field(default_factory=dict)
    """Imported names → their whole names."""
    bound: dict[str, ast.expr] = field(default_factory=dict)
    """Names and attributes of objects (with a dot before) that are bound once, in the whole file."""
    loops: dict[str, list[ast.expr]] = field(default_factory=dict)
    """Names that loops bind, each to one of some values after another."""
    changed: dict[str, list[tuple[str, ast.expr, ast.stmt]]] = field(default_factory=dict)
    """Name → the assignments to attributes of its value."""
    skipped: set[int] = field(default_factory=set)
    created: list[Created] = field(default_factory=list)
    unread: list[tuple[str, Span]] = field(default_factory=list)

    def read(self, class_name: str) -> Code:
        every = list(ast.walk(self.module))
        self.imports(every)
        self.bindings(every)
        classes = {c.name: c for c in every if isinstance(c, ast.ClassDef)}
        mine, stack = set[str](), [class_name]
        while stack:
            if (name := stack.pop()) in classes and name not in mine:
                mine.add(name)
                stack += [base.id for base in classes[name].bases if isinstance(base, ast.Name)]
        nodes = [c for c in classes.values() if class_name in mine and c.name not in mine and self.is_node(c)]
        self.skipped = {id(inner) for c in nodes for inner in ast.walk(c)}
        self.visit(self.module, True)
        return Code(tuple(self.created), tuple(self.unread))

    def is_node(self, made: ast.ClassDef) -> bool:
        return any(ast.unparse(base).endswith("Node") for base in made.bases)

    def imports(self, every: Sequence[ast.AST]) -> None:
        for node in every:
            if isinstance(node, ast.Import):
                whole = [(alias.name, alias.asname or alias.name, alias.name) for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                base = "." * node.level + (node.module or "")
                whole = [(base, alias.asname or alias.name, f"{base}.{alias.name}") for alias in node.names]
            else:
                continue
            for package, name, meaning in whole:
                self.names[name] = meaning
                own = f"{package.rpartition('.')[2]}.py" in self.beside
                if not own and not is_harmless(package):
                    self.tell(node, f"the module {package} is not read")

    def bindings(self, every: Sequence[ast.AST]) -> None:
        counts = Counter[str]()
        for node in every:
            match node:
                case ast.Name(id=name, ctx=ast.Store() | ast.Del()) | ast.arg(arg=name):
                    counts[name] += 1
                case ast.Attribute(attr=name, ctx=ast.Store() | ast.Del()):
                    counts[f".{name}"] += 1
                case _:  # binds nothing
                    pass
        for node in every:
            match node:
                case (
                    ast.Assign(targets=[target], value=value) | ast.AnnAssign(target=target, value=ast.expr() as value)
                ):
                    self.bind(node, target, value, counts)
                case (
                    ast.For(target=ast.Name(id=name), iter=ast.List(elts=items) | ast.Tuple(elts=items))
                    | ast.comprehension(target=ast.Name(id=name), iter=ast.List(elts=items) | ast.Tuple(elts=items))
                ) if counts[name] == 1:
                    self.loops[name] = items
                case _:  # binds nothing
                    pass

    def bind(self, statement: ast.stmt, target: ast.expr, value: ast.expr, counts: Mapping[str, int]) -> None:
        match target:
            case ast.Name(id=name) if counts[name] == 1 and not counts[f".{name}"]:
                self.bound[name] = value
            case ast.Attribute(value=owner, attr=name):
                if counts[f".{name}"] == 1 and isinstance(owner, ast.Name):
                    self.bound[f".{name}"] = value
                self.changed.setdefault(ast.unparse(owner), []).append((name, value, statement))
            case _:  # an item, a tuple: its parts are not known
                pass

    # -- what is created -----------------------------------------------------------------------------------------------

    def visit(self, node: ast.AST, sure: bool) -> None:
        """Every call, in the order of the text; `sure`: under no condition."""
        if id(node) in self.skipped:
            return
        if isinstance(node, ast.Call):
            self.call(node, sure)
        elif isinstance(node, ast.Attribute) and node.attr in _METHODS:
            self.tell(node, f"{node.attr} is handed on")
        literal = isinstance(node, ast.For) and isinstance(node.iter, ast.List | ast.Tuple)
        branches = ast.If | ast.IfExp | ast.For | ast.While | ast.Try | ast.Match | ast.BoolOp
        inside = sure and (literal or not isinstance(node, branches))
        for child in ast.iter_child_nodes(node):
            if not (isinstance(node, ast.Call) and child is node.func and isinstance(child, ast.Attribute)):
                self.visit(child, inside)
            elif not isinstance(child.value, ast.Name):
                self.visit(child.value, inside)

    def call(self, call: ast.Call, sure: bool) -> None:
        whole = self.whole(call.func)
        last = whole.rpartition(".")[2]
        found = _CALLS.get(whole)
        if found is None and isinstance(call.func, ast.Attribute):
            found = _METHODS.get(last)
        if found is not None:
            side, meanings = found
            if whole == "message_filters.Subscriber" and self.ros1():
                meanings = ("name", "kind")
            self.make(call, side, self.given(call, meanings), sure)
        elif whole.startswith("tf2_ros.") and last in _TRANSFORMS:
            side, topics = _TRANSFORMS[last]
            self.created += [Created(side, topic, "tf2_msgs/TFMessage", self.at(call), sure=sure) for topic in topics]
        elif last in _BLIND and isinstance(call.func, ast.Name):
            self.tell(call, f"what {last}() does is not read")

    def ros1(self) -> bool:
        return any(name.partition(".")[0] == "rospy" for name in self.names.values())

    def given(self, call: ast.Call, meanings: Sequence[str]) -> dict[str, ast.expr]:
        found = dict(zip(meanings, call.args, strict=False))
        for keyword in call.keywords:
            word = keyword.arg or ""
            meaning = word if word in meanings else _WORDS.get(word, word)
            found[meaning] = keyword.value
        return found

    def make(self, call: ast.Call, side: str, given: Mapping[str, ast.expr], sure: bool) -> None:
        used = (n.id for value in given.values() for n in ast.walk(value) if isinstance(n, ast.Name))
        if (loop := next((name for name in used if name in self.loops and name not in self.bound), None)) is not None:
            for item in self.loops[loop]:
                self.bound[loop] = item
                self.make(call, side, given, sure)
            del self.bound[loop]
            return
        if "every" in given:
            items = self.value(given["every"])
            pairs = items.elts if isinstance(items, ast.List | ast.Tuple) else [call]
            parts = [pair.elts if isinstance(pair, ast.Tuple) and pair.elts else [call] for pair in pairs]
        else:
            parts = [[given.get("name", call), *([given["value"]] if "value" in given else [])]]
        for each, *more in parts:
            name = self.word(each)
            if (prefix := given.get("namespace")) is not None and name is not None and self.word(prefix) != "":
                name = f"{space}.{name}" if (space := self.word(prefix)) else None
            if name is None or any(isinstance(arg, ast.Starred) for arg in call.args):
                shown = ast.unparse(each) if each is not call else "this call"
                self.tell(call, f"the name `{shown[:60]}` is computed")
                continue
            kind = self.kind(given["kind"]) if "kind" in given else ""
            made = Quality()
            if "quality" in given and "qos_overriding_options" not in given:
                made = self.quality(given["quality"], call)
            elif side == "publishes" and (latch := given.get("latch")) is not None:
                latched = isinstance(latch, ast.Constant) and latch.value is True
                made = Quality(durability="transient_local" if latched else None)
            default = None
            with contextlib.suppress(ValueError, TypeError, IndexError):
                default = ast.literal_eval(self.value(more[0]))
            self.created.append(Created(side, name, kind, self.at(call), made, sure, default))

    # -- values --------------------------------------------------------------------------------------------------------

    def whole(self, node: ast.expr) -> str:
        """``rospy.Publisher``, for whatever name the file gives to it."""
        match node:
            case ast.Name(id=name):
                return self.names.get(name, name)
            case ast.Attribute(value=value, attr=name):
                return f"{self.whole(value)}.{name}"
            case _:  # a call, an item: has no name
                return "?"

    def kind(self, node: ast.expr) -> str:
        """``std_msgs/Float64``; empty if it is not known."""
        parts = self.whole(self.value(node)).split(".")
        if len(parts) != 3 or parts[1] not in ("msg", "srv", "action"):
            return ""
        action = parts[1] == "msg" and self.ros1() and parts[2].endswith("Action")
        return f"{parts[0]}/{parts[2].removesuffix('Action') if action else parts[2]}"

    def value(self, node: ast.expr) -> ast.expr:
        """What a name or an attribute stands for that is bound once."""
        for _ in range(20):
            match node:
                case ast.Name(id=name) if name in self.bound:
                    node = self.bound[name]
                case ast.Attribute(value=ast.Name(), attr=name) if f".{name}" in self.bound:
                    node = self.bound[f".{name}"]
                case ast.Attribute(value=ast.Name(id="self" | "cls"), attr=name) if name in self.bound:
                    node = self.bound[name]  # of the class
                case _:  # bound several times, or a value
                    break
        return node

    def word(self, node: ast.expr) -> str | None:
        match self.value(node):
            case ast.Constant(value=str() as text):
                return text
            case ast.BinOp(left=left, op=ast.Add(), right=right):
                one, other = self.word(left), self.word(right)
                return None if one is None or other is None else one + other
            case ast.JoinedStr(values=values):
                parts = [self.word(v.value if isinstance(v, ast.FormattedValue) else v) for v in values]
                return None if None in parts else "".join(part for part in parts if part is not None)
            case _:  # it is computed
                return None

    def quality(self, node: ast.expr, user: ast.Call) -> Quality:
        made = self.value(node)
        given = self.profile(made)
        for name, value, statement in self.changed.get(ast.unparse(node), ()):
            once = [n for n, _, _ in self.changed[ast.unparse(node)]].count(name) == 1
            before = made.lineno < statement.lineno < user.lineno and self.follows(statement, made)
            given[name] = self.policy(name, value) if once and before else None
        return quality({name: value for name, value in given.items() if value is not None})

    def follows(self, statement: ast.stmt, value: ast.expr) -> bool:
        """Whether a statement is in one block with the one that binds a value: it is executed whenever that is."""
        blocks = (getattr(part, "body", ()) for part in ast.walk(self.module))
        mine = (block for block in blocks if isinstance(block, list) and statement in block)
        return any(getattr(other, "value", None) is value for block in mine for other in block)

    def profile(self, node: ast.expr) -> dict[str, Any]:
        """The policies that are known."""
        match node:
            case ast.Constant(value=int() as depth):
                return {**PROFILES["default"], "depth": depth}
            case ast.Call(func=func, args=[], keywords=keywords) if self.whole(func) == "rclpy.qos.QoSProfile":
                found: dict[str, Any] = dict(PROFILES["default"])
                for keyword in keywords:
                    found[keyword.arg or ""] = self.policy(keyword.arg or "", keyword.value)
                return {} if "" in found else found
            case ast.Call(args=[ast.Constant(value=str() as short)]) if self.whole(node.func).endswith("short_key"):
                return dict(PROFILES.get(short.lower(), {}))
            case ast.Name() | ast.Attribute() | ast.Subscript():
                words = self.whole(node.value if isinstance(node, ast.Subscript) else node).removesuffix(".value")
                if words.startswith("rclpy.qos.") or words == "rclpy.qos":
                    last = words.rpartition(".")[2].lower().removeprefix("qos_profile_")
                    return dict(PROFILES.get(last, {}))
                return {}
            case _:  # it is computed
                return {}

    def policy(self, name: str, node: ast.expr) -> Any:
        """A policy's kind, depth, or time in seconds; None if it is not known."""
        node = self.value(node)
        if name in LEVELS:
            word = self.whole(node).rpartition(".")[2].lower().removeprefix(f"rmw_qos_policy_{name}_")
            return word if word in (*LEVELS[name], *SYSTEM) else None
        match node:
            case ast.Constant(value=int() as number) if name == "depth":
                return number
            case ast.Call(args=[], keywords=keywords) if self.whole(node.func).endswith("Duration"):
                units = {"seconds": 1.0, "nanoseconds": 1e-9}
                return _total([(units.get(k.arg or ""), self.value(k.value)) for k in keywords])
            case _:  # it is computed
                return None

    def at(self, node: ast.AST) -> Span:
        line, column = getattr(node, "lineno", 1), getattr(node, "col_offset", 0) + 1
        return Span(self.file, line, column, line, column + 1)

    def tell(self, node: ast.AST, message: str) -> None:
        self.unread.append((message, self.at(node)))


def _total(parts: Sequence[tuple[float | None, ast.expr]]) -> float | None:
    """The seconds of a duration; infinite for none."""
    whole = 0.0
    for unit, node in parts:
        if unit is None or not (isinstance(node, ast.Constant) and isinstance(node.value, int | float)):
            return None
        whole += unit * node.value
    return whole or math.inf
