"""Launch files in XML and YAML as elements. Nothing is loaded or run."""

from __future__ import annotations

from xml.parsers import expat

import yaml

from avow.base.diagnostics import Malformed, Span
from avow.base.malformed import xml_fault, yaml_fault
from avow.base.tuning.sizes import LAUNCH_DEPTH, LAUNCH_ELEMENTS
from avow.ros.launch.elements import Element, Parsed, Text, place, unread


def from_xml(text: str, file: str) -> Parsed:
    """Raises Malformed."""
    parser = expat.ParserCreate()
    stack: list[tuple[str, dict[str, Text], list[Element], Span]] = []
    roots: list[Element] = []
    count = 0

    def begin(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if len(stack) > LAUNCH_DEPTH or count > LAUNCH_ELEMENTS:
            raise Malformed("it has too many elements, or too many within one another", parser.CurrentLineNumber)
        at = place(file, parser.CurrentLineNumber, parser.CurrentColumnNumber + 1)
        stack.append((tag.replace("-", "_"), dict(attributes), [], at))

    def end(tag: str) -> None:
        name, attributes, children, at = stack.pop()
        (stack[-1][2] if stack else roots).append(Element(name, attributes, tuple(children), at))

    def doctype(*_: object) -> None:
        raise Malformed("a document type has no place in a launch file", parser.CurrentLineNumber)

    parser.StartElementHandler = begin
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise xml_fault(text, error) from None
    if not roots or roots[0].tag != "launch":
        raise Malformed("the outermost element of a launch file is <launch>", 1)
    return Parsed(roots[0].children)


def from_yaml(text: str, file: str) -> Parsed:
    """Raises Malformed."""
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
    except (yaml.YAMLError, RecursionError) as error:
        raise yaml_fault(text, error) from None
    entries = root.value if isinstance(root, yaml.MappingNode) else []
    top = next((value for key, value in entries if key.value == "launch"), None)
    if top is None:
        raise Malformed("a launch file in YAML begins with `launch:`", 1)
    work = _Yaml(file)
    return Parsed(tuple(work.listed(top, 0)), work.parsed.unread)


class _Yaml:
    def __init__(self, file: str) -> None:
        self.file = file
        self.parsed = Parsed()
        self.count = 0

    def at(self, node: yaml.Node) -> Span:
        return place(self.file, node.start_mark.line + 1, node.start_mark.column + 1)

    def listed(self, node: yaml.Node, depth: int) -> list[Element]:
        """A list of ``- tag: {…}``, each with one key."""
        if not isinstance(node, yaml.SequenceNode):
            raise Malformed("a list of actions is wanted here", node.start_mark.line + 1)
        found: list[Element] = []
        for item in node.value:
            if isinstance(item, yaml.MappingNode) and len(item.value) == 1:
                key, value = item.value[0]
                found.append(self.element(str(key.value), value, self.at(key), depth))
            else:
                self.parsed.unread.append(unread(self.at(item), "an action with one name is wanted here"))
        return found

    def element(self, tag: str, node: yaml.Node, at: Span, depth: int) -> Element:
        self.count += 1
        if depth > LAUNCH_DEPTH or self.count > LAUNCH_ELEMENTS:
            raise Malformed("it has too many elements, or too many within one another", at.line)
        name = tag.replace("-", "_")
        if isinstance(node, yaml.SequenceNode):  # group: [...]
            return Element(name, {}, tuple(self.listed(node, depth + 1)), at)
        if isinstance(node, yaml.ScalarNode):  # let: …
            return Element(name, {"": node.value}, (), at)
        attributes: dict[str, Text] = {}
        children: list[Element] = []
        for key, value in node.value:
            if isinstance(value, yaml.ScalarNode):
                attributes[str(key.value)] = value.value
            elif key.value == "children":
                children += self.listed(value, depth + 1)
            elif isinstance(value, yaml.SequenceNode):
                for item in value.value:
                    children.append(self.element(str(key.value), item, self.at(item), depth + 1))
            else:
                children.append(self.element(str(key.value), value, self.at(key), depth + 1))
        return Element(name, attributes, tuple(children), at)
