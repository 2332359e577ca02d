"""The nodes that launch files start, by their whole names, with their remappings.

Scopes, arguments and remappings follow roslaunch (ROS 1) and launch_ros (ROS 2): in ROS 1 an included file sees only
the arguments that it is given, and a node's own remapping takes precedence over its group's; in ROS 2 arguments and
pushed namespaces hold until their group ends, and a group's remapping takes precedence.
"""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field, replace
from pathlib import Path

from avow.base.diagnostics import Diagnostic, Malformed
from avow.base.files import read_regular, read_text
from avow.base.records import dataclass
from avow.base.suggestions import suggest
from avow.base.tuning.sizes import LAUNCH_BYTES, LAUNCH_DEPTH, LAUNCH_ELEMENTS, PACKAGES_SEARCHED
from avow.ros.launch.elements import HINT, NODES, SILENT, Element, Parsed, Text, Unread, place, unread
from avow.ros.launch.overrides import overrides
from avow.ros.launch.python import from_python
from avow.ros.launch.started import Launched, Setting, Started, with_server
from avow.ros.names import is_name


def read_launch(files: Iterable[tuple[Path, Mapping[str, str]]], root: Path) -> Launched:
    """The nodes that launch files start, each file with the values of its arguments; included files are read if they
    are below `root`. The parts that cannot be read are in `unread`; an error there is a file that is no launch file."""
    work = _Reading(root.resolve())
    for path, given in files:
        work.file(path.resolve(), dict(given), None)
    nodes = tuple(with_server(node, k, work.server) for k, node in enumerate(work.nodes))
    return Launched(nodes, tuple(dict.fromkeys(work.unread)), tuple(work.files), tuple(work.arguments))


class _Unknown(Exception):  # noqa: N818 - it says what was found
    """A text that cannot be determined."""


@dataclass(slots=True)
class _Scope:
    path: Path
    ros1: bool
    depth: int
    namespace: str = ""
    args: dict[str, Text] = field(default_factory=dict)
    given: dict[str, Text] = field(default_factory=dict)
    """ROS 1: the arguments that the includer gave the file."""
    remaps: list[tuple[str, str]] = field(default_factory=list)
    doubt: tuple[str, ...] = ()
    """Why nodes here may not be started, or may have other names."""
    lost: bool = False
    """Whether its namespace is unknown."""
    settings: tuple[Setting, ...] = ()
    """ROS 2: the parameters of all nodes here."""

    def inner(self) -> _Scope:
        return replace(self, args=dict(self.args), remaps=list(self.remaps))

    def take(self, inner: _Scope, doubt: tuple[str, ...]) -> None:
        """The content of a scope that does not end holds from here on: its namespace, arguments and remappings.
        `doubt`: that of the scope when it began; it exceeds this one's if the scope may not be executed at all."""
        sure = doubt == self.doubt
        changed = {name: value for name, value in inner.args.items() if self.args.get(name) != value}
        self.args.update(changed if sure else dict.fromkeys(changed, Unread("; ".join(doubt))))
        if sure or inner.doubt != doubt or inner.remaps != self.remaps:
            self.doubt = inner.doubt
        self.lost = inner.lost or (not sure and inner.namespace != self.namespace)
        more = inner.settings[len(self.settings) :]
        self.settings += more if sure else tuple(replace(setting, value="") for setting in more)
        self.namespace, self.remaps = inner.namespace, inner.remaps


_SUBSTITUTION = re.compile(r"\$\(([^$()]*)\)")


@dataclass(slots=True)
class _Reading:
    root: Path
    nodes: list[Started] = field(default_factory=list)
    unread: list[Diagnostic] = field(default_factory=list)
    files: dict[Path, None] = field(default_factory=dict)
    arguments: dict[str, None] = field(default_factory=dict)
    server: list[tuple[int, Setting]] = field(default_factory=list)
    """ROS 1: parameters outside of nodes, by their whole names, and how many nodes come before each."""
    count: int = 0
    packages: dict[str, Path] | None = None

    def file(self, path: Path, given: dict[str, Text], outer: _Scope | None) -> bool:
        """Whether it shares its includer's scope."""
        self.files[path] = None
        try:
            parsed = _parsed(path)
        except Malformed as wrong:
            at = place(str(path), wrong.line, wrong.column)
            self.unread.append(Diagnostic("ROS120", f"{path.name}: {wrong}", at, hint=wrong.hint))
            return False
        self.unread += parsed.unread
        self.arguments |= dict.fromkeys(parsed.arguments)
        ros1 = path.suffix not in (".py", ".yaml", ".yml") and not parsed.is_ros2
        ros1 = ros1 and (outer is None or outer.ros1)
        if outer is None:
            scope = _Scope(path, ros1, 0, args={} if ros1 else dict(given), given=given)
        elif ros1:
            scope = replace(outer.inner(), path=path, ros1=True, depth=outer.depth + 1, args={}, given=given)
        else:  # an included file shares its includer's scope
            scope = replace(outer, path=path, ros1=False, depth=outer.depth + 1)
            scope.args.update(given)
        self.each(parsed.elements, scope)
        if outer is not None and not ros1:
            outer.namespace, outer.lost, outer.remaps = scope.namespace, scope.lost, scope.remaps
            outer.doubt, outer.settings = scope.doubt, scope.settings
        return not ros1

    def each(self, elements: Iterable[Element], scope: _Scope) -> None:
        for element in elements:
            self.count += 1
            if self.count > LAUNCH_ELEMENTS:
                self.tell(element, "more elements than can be read")
                return
            self.one(element, scope)

    def one(self, element: Element, scope: _Scope) -> None:
        started = self.condition(element, scope)
        if started is False:
            return
        doubt = scope.doubt if started is True else (*scope.doubt, started)
        match element.tag:
            case tag if tag in NODES:
                self.node(element, replace(scope, doubt=doubt))
            case "group":
                inner = replace(scope.inner(), doubt=doubt)
                self.push(element, inner, element.get("ns"))
                self.each(element.children, inner)
                ends = self.shown(element.get("scoped") or "true", scope).strip().lower()
                if ends not in ("true", "1"):
                    unsure = () if ends in ("false", "0") else ("whether a group's scope ends is not known",)
                    scope.take(replace(inner, doubt=(*inner.doubt, *unsure)), (*doubt, *unsure))
            case "timer":
                self.each(element.children, replace(scope.inner(), doubt=doubt))
            case "load_composable_node":
                inner = replace(scope, doubt=doubt)
                self.each((e for e in element.children if e.tag == "composable_node"), inner)
            case "push_ros_namespace":
                self.push(element, scope, element.get("namespace", "ns"), started)
            case "remap" | "set_remap":
                self.remap(element, scope, started)
            case "include":
                self.include(element, scope, doubt)
            case "arg" | "let":
                self.arg(element, scope, started)
            case "set_parameter":
                scope.settings += (replace(self.setting(element, scope, started), shared=True, unnamed=True),)
            case "param" if scope.ros1 and str(element.get("name")).startswith("~"):  # of all nodes that follow here
                set_ = self.setting(element, scope, started)
                scope.settings += (replace(set_, name=set_.name[1:], shared=True),)
            case "param" if scope.ros1 and not scope.lost:
                set_ = self.setting(element, scope, started)
                self.server.append((len(self.nodes), replace(set_, name=_within(scope.namespace, set_.name))))
            case "rosparam" if scope.ros1 and self.shown(element.get("command"), scope) != "dump":
                at = scope.namespace
                for key in ("ns", "param"):
                    at = _within(at, self.shown(element.get(key), scope))
                rest = {key: text for key, text in element.attributes.items() if key not in ("ns", "param")}
                set_ = self.setting(replace(element, attributes=rest), scope, started)
                set_ = replace(set_, value="", within="/") if scope.lost else replace(set_, within=at or "/")
                self.server.append((len(self.nodes), set_))
            case tag if tag in SILENT:
                pass
            case tag:
                self.tell(element, f"<{tag}> is not read", element.hint())

    def condition(self, element: Element, scope: _Scope) -> bool | str:
        """Whether the element applies; a text (the reason) if that depends on an unknown value."""
        for name, wanted in (("if", True), ("unless", False)):
            text = element.get(name)
            if text is None:
                continue
            try:
                value = self.expanded(text, scope).strip().lower()
            except _Unknown as why:
                self.tell(element, f"whether it counts is not known: {why}")
                return f"it is started under a condition ({why})"
            if value not in ("true", "1", "false", "0"):
                self.tell(element, f"whether it counts is not known: {value[:40]!r} is neither true nor false")
                return "it is started under a condition"
            if (value in ("true", "1")) != wanted:
                return False
        return True

    def push(self, element: Element, scope: _Scope, text: Text | None, started: bool | str = True) -> None:
        if text is None:
            return
        try:
            if isinstance(started, str):
                raise _Unknown(started)
            scope.namespace = _within(scope.namespace, self.name(text, scope))
        except _Unknown as why:
            self.tell(element, f"the namespace is not known: {why}")
            scope.lost = True

    def remap(self, element: Element, scope: _Scope, started: bool | str) -> None:
        if element.children:
            self.each(element.children, scope)  # in ROS 1 the elements that it remaps for are nested in it
        try:
            if isinstance(started, str):
                raise _Unknown(started)
            old, new = (self.name(_wanted(element, key), scope, "a remapping") for key in ("from", "to"))
        except _Unknown as why:
            self.tell(element, f"the remapping is not known: {why}", element.hint("from", "to"))
            scope.doubt = (*scope.doubt, f"a remapping is not known ({why})")
            return
        if scope.ros1:  # the later one takes precedence
            scope.remaps = [pair for pair in scope.remaps if pair[0] != old]
        scope.remaps = [*scope.remaps, (old, new)]

    def arg(self, element: Element, scope: _Scope, started: bool | str) -> None:
        name = element.get("name")
        if not isinstance(name, str):
            self.tell(element, "the argument's name is not known")
            return
        value, default = element.get("value", "var"), element.get("default")
        if isinstance(started, str):
            scope.args[name] = Unread(started)
        elif element.tag == "let" or (value is not None and scope.ros1):
            scope.args[name] = self.fixed(value, scope)
        elif scope.ros1 and name in scope.given:
            scope.args[name] = scope.given[name]
        elif name not in scope.args or scope.ros1:
            scope.args[name] = (
                Unread(f"the argument {name} is not given, and has no default")
                if default is None
                else self.fixed(default, scope)
            )

    def include(self, element: Element, scope: _Scope, doubt: tuple[str, ...]) -> None:
        inner = replace(scope.inner(), doubt=doubt)
        given: dict[str, Text] = dict(scope.args) if element.get("pass_all_args") in ("true", "1") else {}
        for part in element.children:
            name, value = part.get("name"), part.get("value")
            if part.tag in ("arg", "let") and isinstance(name, str) and self.condition(part, scope) is True:
                given[name] = self.fixed(value, scope)
        self.push(element, inner, element.get("ns"))
        path, why = self.included(element, scope)
        if path is None:
            self.tell(element, why)
            if not scope.ros1:  # its names and remappings hold from here on
                scope.doubt += (f"it comes after what is not read: {why}",)
        elif self.file(path, given, inner):
            scope.take(inner, doubt)

    def included(self, element: Element, scope: _Scope) -> tuple[Path | None, str]:
        """The included file; otherwise the reason why it is not read."""
        try:
            text = self.expanded(_wanted(element, "file"), scope)
        except _Unknown as why:
            return None, f"the file that is included is not known: {why}"
        if not Path(text).is_absolute():
            return None, f"{text[:80]!r} is relative to wherever the robot is started: it is not read"
        path = Path(os.path.realpath(text))
        if self.root not in path.parents:
            return None, f"{path} lies outside {self.root}: it is not read"
        if not path.is_file():
            return None, f"there is no file {path}"
        if scope.depth >= LAUNCH_DEPTH:
            return None, "files are included within one another too deeply"
        return path, ""

    def node(self, element: Element, outer: _Scope) -> None:
        scope = outer.inner()
        doubt = list(outer.doubt)
        self.push(element, scope, element.get("ns", "namespace"))
        own = replace(scope, remaps=[], doubt=())
        for child in element.children:
            if child.tag == "remap":
                self.one(child, own)
        doubt += own.doubt
        given: list[tuple[str, str]] = []
        name, rest = self.command_line(element, scope, doubt, given)
        remaps = [*scope.remaps, *rest, *own.remaps]
        others = [*scope.remaps, *own.remaps]
        doubt += [
            f"its arguments remap {old} too" for old, new in rest if any(o == old and n != new for o, n in others)
        ]
        if scope.ros1:
            remaps = list(dict(remaps).items())
        whole = ""
        text = name if name is not None else element.get("name")
        if text is None:
            message = "the node has no name here, and the name that its program gives is not known"
            self.tell(element, message, element.hint("name"))
        elif not scope.lost:
            try:
                whole = _within(scope.namespace, self.name(text, scope).lstrip("/"))
            except _Unknown as why:
                self.tell(element, f"the node's name is not known: {why}")
        parts = [self.shown(element.get(key), scope) for key in ("pkg", "exec", "type", "plugin")]
        kind = "/".join(part for part in parts if part)
        own_settings = self.settings(element, scope)
        if not scope.ros1 and element.get("name") is None:
            own_settings = (replace(each, unnamed=True) for each in own_settings)
        words = (Setting(*one, element.span, unnamed=not scope.ros1) for one in given)
        settings = (*words, *scope.settings, *own_settings)
        self.nodes.append(Started(whole, kind, tuple(remaps), tuple(dict.fromkeys(doubt)), element.span, settings))
        if element.tag.endswith("container"):
            self.each((e for e in element.children if e.tag == "composable_node"), outer)

    def settings(self, element: Element, scope: _Scope) -> Iterator[Setting]:
        """The parameters that a node is started with, as far as they are known."""
        for child in element.children:
            if child.tag in ("param", "rosparam") and (holds := self.condition(child, scope)) is not False:
                yield self.setting(child, scope, holds)

    def setting(self, element: Element, scope: _Scope, holds: bool | str) -> Setting:
        name = self.shown(element.get("name"), scope)
        value = self.shown(element.get("from", "file", "value"), scope)
        file = "from" in element.attributes or self.is_loaded(element, scope)
        return Setting(name, value if holds is True and (name or file) else "", element.span)

    def is_loaded(self, element: Element, scope: _Scope) -> bool:
        """ROS 1: whether parameters come from a file as it stands, not from the element's text or a substitution."""
        loads = self.shown(element.get("command"), scope) in ("", "load")
        return loads and "file" in element.attributes and not {"subst_value", "ns", "param"} & element.attributes.keys()

    def command_line(
        self, element: Element, scope: _Scope, doubt: list[str], given: list[tuple[str, str]]
    ) -> tuple[str | None, list[tuple[str, str]]]:
        """The name and the remappings among a node's arguments: ``scan:=front __name:=x``."""
        name: str | None = None
        found: list[tuple[str, str]] = []
        for key in ("args", "ros_args"):
            text = element.get(key)
            if text is None:
                continue
            try:
                words = shlex.split(self.expanded(text, scope))
            except (_Unknown, ValueError) as why:
                self.tell(element, f"the arguments are not known, which may remap: {why}")
                doubt.append(f"its arguments are not known ({why})")
                continue
            given += overrides(words)
            for before, word in zip(["", *words], words, strict=False):
                old, sign, new = word.partition(":=")
                if not sign or before in ("-p", "--param") or old.startswith("_") != old.startswith("__"):
                    continue
                if old in ("__name", "__node"):
                    name = new
                elif old == "__ns":
                    scope.namespace = _within(scope.namespace, new)
                elif is_name(old) and is_name(new):
                    found.append((old, new))
                elif not old.startswith("__"):
                    self.tell(element, f"the remapping {word[:60]!r} is not read")
                    doubt.append(f"a remapping is not read ({word[:60]})")
        return name, found

    # -- texts ---------------------------------------------------------------------------------------------------------

    def name(self, text: Text, scope: _Scope, what: str = "a name") -> str:
        found = self.expanded(text, scope).strip()
        if not is_name(found) and found not in ("", "/"):
            raise _Unknown(f"{found[:60]!r} is no name for {what}")
        return found

    def shown(self, text: Text | None, scope: _Scope) -> str:
        try:
            return self.expanded(text, scope) if text is not None else ""
        except _Unknown:
            return ""

    def fixed(self, text: Text | None, scope: _Scope) -> Text:
        """An argument's value."""
        try:
            return self.expanded(text if text is not None else Unread("it has no value"), scope)
        except _Unknown as why:
            return Unread(str(why))

    def expanded(self, text: Text, scope: _Scope) -> str:
        """The text with every substitution expanded. Raises _Unknown."""
        if isinstance(text, Unread):
            raise _Unknown(text.why)
        whole = text
        for _ in range(LAUNCH_DEPTH):
            found = _SUBSTITUTION.search(whole)
            if found is None:
                if "$(" in whole:
                    raise _Unknown(f"{whole[:60]!r} is not read")
                return whole
            value = self.substituted(found[1], scope)
            whole = f"{whole[: found.start()]}{value}{whole[found.end() :]}"
            if len(whole) > LAUNCH_BYTES:
                raise _Unknown("its text is too long")
        raise _Unknown("it has too many substitutions")

    def substituted(self, inside: str, scope: _Scope) -> str:
        word, *rest = inside.split() or [""]
        argument = rest[0].strip("'\"") if rest else ""
        match word:
            case "arg" | "var":
                self.arguments[argument] = None
                value = scope.args.get(argument)
                if value is None:
                    near = suggest(argument, scope.args)
                    raise _Unknown(f"no argument {argument!r} is declared here" + (f" ({near})" if near else ""))
                if isinstance(value, Unread):
                    raise _Unknown(value.why)
                if "$(" in value:
                    raise _Unknown(f"the argument {argument} holds a substitution")
                return value
            case "find" | "find-pkg-share" | "find-pkg-prefix":
                folder = self.package(argument)
                if folder is None:
                    raise _Unknown(f"the package {argument} is not below {self.root}")
                return str(folder)
            case "dirname":
                return str(scope.path.parent)
            case "env" | "optenv":
                raise _Unknown(f"it depends on the environment variable {argument}")
            case "eval" | "command" | "anon" | "exec-in-pkg" | "exec-in-package" | "find-exec":
                raise _Unknown(f"$({inside[:60]}) is known only when it runs")
            case _:
                raise _Unknown(f"$({inside[:60]}) is not read")

    def package(self, name: str) -> Path | None:
        if self.packages is None:
            self.packages = dict(_packages(self.root))
        return self.packages.get(name)

    def tell(self, element: Element, message: str, hint: str = HINT) -> None:
        self.unread.append(unread(element.span, message, hint))


def _wanted(element: Element, key: str) -> Text:
    text = element.get(key)
    return text if text is not None else Unread(f"{key} is missing")


def _within(namespace: str, name: str) -> str:
    """A name in a namespace; an absolute one unchanged. Neither ends in a slash."""
    if name.startswith("/"):
        return name.rstrip("/")
    return f"{namespace}/{name}".rstrip("/")


def _parsed(path: Path) -> Parsed:
    try:
        if path.stat().st_size > LAUNCH_BYTES:
            raise Malformed(f"it has more than {LAUNCH_BYTES} bytes", 1)
        text = read_text(path, "utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise Malformed(f"it cannot be read: {error}", 1) from None
    from avow.ros.launch.markup import from_xml, from_yaml  # PyYAML is slow to import

    match path.suffix:
        case ".py":
            return from_python(text, str(path))
        case ".yaml" | ".yml":
            return from_yaml(text, str(path))
        case _:  # XML: .launch, .xml, or no suffix at all
            return from_xml(text, str(path))


def _packages(root: Path) -> Iterator[tuple[str, Path]]:
    """The packages below a folder, by name."""
    for count, (folder, inside, files) in enumerate(os.walk(root)):
        if count > PACKAGES_SEARCHED:
            return
        inside[:] = sorted(n for n in inside if not n.startswith(".") and n not in ("build", "install", "node_modules"))
        if "package.xml" in files:
            text = read_regular(Path(folder, "package.xml"))[:LAUNCH_BYTES].decode("utf-8", "replace")
            found = re.search(r"<name>\s*([\w.-]+)\s*</name>", text)
            if found:
                yield found[1], Path(folder)
