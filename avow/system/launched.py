"""Launch files of a plan: they give the run-time names of the contract's nodes and the remappings of their topics.

A started node is the contract's node to which the plan gives that name, otherwise the one called like its own last
name. The plan has to agree: a topic that the two resolve differently is an error that names both.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.base.files import inside, read_regular, read_text
from avow.base.malformed import yaml_fault
from avow.base.plain import count
from avow.base.suggestions import did_you_mean, nearby, nearest, suggest
from avow.base.workspace import find_workspace
from avow.language.contract import Contract, Node
from avow.ros.launch import Launched, Setting, Started, read_launch
from avow.ros.launch.elements import HINT
from avow.ros.names import Placed, Resolver
from avow.ros.parameters import EVERY, OF_EVERY_NODE, WrongParameters, entries, flat, is_sectioned, settled
from avow.ros.quality import BAG_FILE
from avow.system.node_plan import parameter_place, parameters
from avow.system.plan import Plan, System
from avow.system.strict_yaml import Piece


def read_launched(plan: Path, pieces: Iterable[Piece]) -> tuple[Launched | None, tuple[Diagnostic, ...]]:
    """What the plan's launch files start; None if it names none."""
    faults: list[Diagnostic] = []
    files: list[tuple[Path, dict[str, str]]] = []
    names: dict[str, Span] = {}
    for piece in pieces:
        if (path := in_workspace(plan, piece.at("file") or piece, faults)) is not None:
            given = piece.at("args")
            entries = (given.entries or {}) if given is not None else {}
            files.append((path, {name: _value(value) for name, value in entries.items()}))
            names |= {name: given.key_span(name) for name in entries} if given is not None else {}
    if not files and not faults:
        return None, ()
    found = read_launch(files, _root(plan))
    for name in () if found.unread else names:
        if name not in found.arguments:
            hint = suggest(name, found.arguments) or "leave it out: they declare no arguments"
            faults.append(Diagnostic("PLAN106", f"no launch file has the argument {name!r}", names[name], hint=hint))
    found = replace(found, unread=(*faults, *found.unread))
    return found, tuple(d for d in found.unread if d.is_error)


def in_workspace(plan: Path, piece: Piece, faults: list[Diagnostic]) -> Path | None:
    """A file or a bag's folder that the plan names: it is in the workspace, or in the system's folder if that is in no
    workspace. Otherwise None, and a fault."""
    return named_file(
        piece,
        plan.resolve().parent,
        (_root(plan), "the workspace"),
        faults,
        lambda path: path.is_file() or (path / BAG_FILE).is_file(),
    )


def named_file(
    piece: Piece,
    folder: Path,
    within: tuple[Path, str],
    faults: list[Diagnostic],
    is_there: Callable[[Path], bool] = Path.exists,
) -> Path | None:
    """A file that a plan in the folder names. None, and a fault, if it leads out of the place `within` (with its name
    for the message), or is not there."""
    (root, around), text = within, piece.text
    path = None if Path(text).is_absolute() else inside(root, f"{folder.relative_to(root).as_posix()}/{text}")
    if path is None:
        hint = f"copy what it names into {root.name}: a clone has all that a plan reads"
        faults.append(Diagnostic("PLAN108", f"the path {text[:200]!r} leads out of {around}", piece.span, hint=hint))
    elif not is_there(path):
        message = f"there is no file {text!r} in {folder}"
        faults.append(Diagnostic("PLAN107", message, piece.span, hint=nearby(path, text)))
        return None
    return path


def _root(plan: Path) -> Path:
    folder = plan.resolve().parent
    place = find_workspace(folder)
    return place.root if place is not None else folder


def _value(piece: Piece) -> str:
    return str(piece.value).lower() if isinstance(piece.value, bool) else piece.text


def started(plan: Plan, contract: Contract) -> tuple[Plan, tuple[Diagnostic, ...]]:
    """The plan with the names and remappings of its launch files, and the disagreements between them."""
    if plan.launched is None or plan.launched.is_broken:
        return plan, ()
    faults: list[Diagnostic] = []
    placed = dict(plan.ros.names.nodes)
    unstarted: list[str] = []
    for node in contract.nodes:
        mine = plan.ros.names.placed(node.name)
        launched = _launched(plan, node, mine, faults)
        if launched is None and _depends_on_launch(plan, node, mine):
            unstarted.append(node.name)
        if launched is not None and launched.unread and _depends_on_launch(plan, node, mine):
            faults.append(_unknown((node.name,), "; ".join(launched.unread), launched.span))
        if launched is not None:
            faults += (*_disagreements(node, mine, launched), *_parameters(plan, node, launched))
            remaps = (*launched.remaps, *(mine.remaps if launched.unread else ()))
            placed[node.name] = Placed(launched.name, remaps, launched.span, True, True)
    unread = [d for d in plan.launched.unread if not d.is_error]
    if unstarted and unread:
        why = f"a part of a launch file is not read: {unread[0].message}"
        faults.append(_unknown(unstarted, why, unread[0].span, unread[0].hint))
    return replace(plan, ros=replace(plan.ros, names=Resolver(tuple(placed.items())))), tuple(faults)


def _parameters(plan: Plan, node: Node, launched: Started) -> Iterator[Diagnostic]:
    """Diagnostics where a node is started with other parameters than the plan's, with which its class is examined."""
    source = next((entry.source for entry in plan.nodes if entry.node == node.name), None)
    if source is None or not source.python:
        return
    mine, wrong = parameters(plan.root, source, launched.name)
    if wrong:
        return  # reported where the class is examined
    of_contract = {port.name for port in node.parameters}  # avow.system.parameters compares what sets these
    here = {name: value for name, value in flat(mine) if name.replace(".", "_") not in of_contract}
    there, unread = started_with(launched)

    def place(name: str) -> Span:
        return parameter_place(plan.root, source, launched.name, name)

    known = [*there, *of_contract]
    there = {name: it for name, it in there.items() if name.replace(".", "_") not in of_contract}
    shared = [setting.name for setting in launched.parameters if setting.shared]
    text = read_regular(path) if shared and (path := plan.root / source.python).is_file() else b""
    ignored = {*OF_EVERY_NODE, *(name for name in shared if name.encode() not in text)}
    there = {name: it for name, it in there.items() if name in here or not {name, name.partition(".")[0]} & ignored}
    alone = sorted(here.keys() - there.keys()) if there and not unread else []
    for name, (value, span) in there.items():
        if here.get(name) != value or isinstance(here[name], bool) is not isinstance(value, bool):
            said = f"the plan says {here[name]!r}" if name in here else "the plan does not set it"
            message = f"{node.name} is started with {name} = {value!r}, and {said}"
            meant = nearest(name, alone) if name not in here else []
            alone = [other for other in alone if other not in meant]
            hint = "write what the robot is started with into the file that the plan names:  source: {parameters: …}"
            hint = f"the plan has `{meant[0]}`: correct the one that is wrong" if meant else hint
            hint = f"did you mean `{near[0]}`?" if (near := nearest(name, of_contract)) else hint
            yield Diagnostic("ROS127", message, span if near else place(name), hint=hint, notes=((where(span), span),))
    for name in alone:
        message = f"the plan sets {name} of {node.name}, and {where(launched.span)} starts it without"
        near = nearest(name, known)
        hint = f"did you mean `{near[0]}`?" if near else "leave it out, or launch with it"
        yield Diagnostic("ROS127", message, place(name), hint=hint)


def started_with(launched: Started) -> tuple[dict[str, tuple[Any, Span]], tuple[Diagnostic, ...]]:
    """The parameters that a launch file certainly sets for a node, and those that it sets but that are not read."""
    given: list[tuple[str, str, Any, Span]] = []
    unread: list[Diagnostic] = []
    for setting in launched.parameters:
        try:
            given += _set(setting, launched.name)
        except (OSError, ValueError, yaml.YAMLError, WrongParameters) as error:
            what = setting.name or os.path.normpath(setting.value or "a file")
            why, near = str(error), None
            if isinstance(error, yaml.YAMLError):
                text = setting.value if setting.name else read_text(Path(setting.value), errors="replace")
                wrong = yaml_fault(text, error)
                why, near = f"line {wrong.line}: {wrong}", wrong.hint
            elif isinstance(error, OSError):
                why, near = error.strerror or why, nearby(Path(setting.value))
            what = f"the parameter {what}, which is" if setting.name else f"the parameters of {what}, which are"
            message = f"{launched.name} is started with {what} not read: {why}"
            given = [one for one in given if setting.name and one[1] != setting.name]  # a file may set any of them
            hint = near or "see to it yourself that the plan's `source: {parameters: …}` has the same"
            unread.append(Diagnostic("ROS121", message, setting.span, Severity.WARNING, hint))
    there, doubts = settled(given)
    for name, why in doubts.items():
        message = f"{launched.name} is started with the parameter {name}, whose value is not clear: {why}"
        unread.append(Diagnostic("ROS121", message, there.pop(name)[1], Severity.WARNING))
    return there, tuple(unread)


def _set(setting: Setting, node: str) -> list[tuple[str, str, Any, Span]]:
    """The parameters that a launch file's parameter, or file of parameters, sets, each under an entry
    (`avow.ros.parameters.settled`). Raises OSError, ValueError, YAMLError and WrongParameters."""
    entry = EVERY if setting.unnamed else node
    if not setting.value:
        raise ValueError("its value is known only when it is launched")
    if setting.name:
        return [(entry, setting.name, yaml.safe_load(setting.value), setting.span)]
    if not Path(setting.value).is_absolute():
        raise ValueError("a relative path depends on the folder in which `ros2 launch` runs")
    data = yaml.safe_load(read_regular(Path(setting.value)))
    if data is None:
        return []
    if not isinstance(data, dict):
        raise ValueError("it is no mapping")
    if is_sectioned(data) and not setting.within:
        return [(at, name, value, setting.span) for at, name, value, _ in entries(data, node)]
    found = ((name, value) for name, value in flat(data))
    if setting.within:
        whole = ((f"{setting.within.rstrip('/')}/{name.replace('.', '/')}", value) for name, value in found)
        found = ((n[len(node) + 1 :].replace("/", "."), v) for n, v in whole if n.startswith(f"{node}/"))
    return [(entry, name, value, setting.span) for name, value in found]


def told(system: System) -> Iterator[Diagnostic]:
    """`avow check`'s findings about launch files: what cannot be read, how each node runs, what else is started."""
    launched = system.plan.launched
    if launched is None:
        return
    yield from launched.unread
    model = system.plan.model.data if isinstance(system.plan.model.data, dict) else {}
    named = [m for key in ("compound",) for members in model.get(key, {}).values() for m in _texts(members)]
    named += [*model.get("dropped", {})]
    spoken = {name.lstrip("/") for name in named}
    known: dict[str, str] = {}
    runs: list[tuple[str, Span | None]] = []
    for node in system.contract.nodes:
        placed = system.plan.ros.names.placed(node.name)
        one = next((s for s in launched.nodes if s.name == placed.name), None)
        if one is not None:
            known[one.name] = node.name
            said = _runs(node, placed)
            if one.unread:
                doubts = "; ".join(one.unread)
                yield Diagnostic("ROS121", f"{said}; but {doubts}", one.span, Severity.WARNING)
            else:
                runs.append((said, one.span))
            source = next((entry.source for entry in system.plan.nodes if entry.node == node.name), None)
            if source and source.python and not parameters(system.plan.root, source, one.name)[1]:
                yield from started_with(one)[1]  # else the same file may be reported for its own faults
        elif not node.relay and node.name not in (*model.get("compound", {}), *model.get("external", {})):
            message = f"no launch file starts {node.name}"
            names = list(dict.fromkeys(s.name for s in launched.nodes if s.name))
            hint = suggest(f"/{node.name}", names) or "name it under `ros: {nodes: …}`, or as `external` under `model`"
            yield Diagnostic("ROS124", message, node.span, Severity.WARNING, hint)
    for one in launched.nodes:
        last = one.name.rpartition("/")[2]
        if one.name and one.name not in known and not {last, one.name.lstrip("/")} & spoken:
            what = f" ({one.kind})" if one.kind else ""
            message = f"{one.name}{what} is started, and is neither a node of the contract nor named under `model`"
            yield Diagnostic("ROS124", message, one.span, Severity.WARNING, "model: {dropped: {NAME: why}}")
    if runs:
        message = f"the launch files start {count(len(runs), 'node')} of the contract"
        yield Diagnostic("ROS125", message, runs[0][1], Severity.NOTE, notes=tuple(runs))


def _runs(node: Node, placed: Placed) -> str:
    known = [placed.expanded(topic.name.partition("/_action/")[0]) for topic in node.topics]
    others = {old: " (not in the contract)" for old, _ in placed.remaps if placed.expanded(old) not in known}
    remaps = ", ".join(f"{old} → {new}{others.get(old, '')}" for old, new in placed.remaps)
    return f"{node.name} runs as {placed.name}" + (f", with {remaps}" if remaps else "")


def _texts(members: object) -> list[str]:
    return [str(m) for m in members] if isinstance(members, list) else [str(members)]


def _launched(plan: Plan, node: Node, mine: Placed, faults: list[Diagnostic]) -> Started | None:
    """The started node that is this node of the contract; None if no node is, or if it is ambiguous."""
    assert plan.launched is not None
    every = [s for s in plan.launched.nodes if s.name]
    if mine.named:
        found = [s for s in every if s.name == mine.name]
        if not found:
            names = list(dict.fromkeys(s.name for s in every))
            message = f"ros.nodes.{node.name}.name: no launch file starts {mine.name}"
            sure = not plan.launched.unread
            severity = Severity.ERROR if sure else Severity.WARNING
            near = nearest(mine.name, names) or names[:3]
            notes = tuple((f"{s.name} is started here", s.span) for s in every if s.name in near)
            faults.append(Diagnostic("ROS122", message, mine.span, severity, suggest(mine.name, names), notes))
    else:
        found = [s for s in every if s.name.rpartition("/")[2] == node.name]
    if len({(s.name, s.remaps) for s in found}) > 1:
        shown = "; ".join(f"{s.name} at {where(s.span)}" for s in found)
        message = f"which of the started nodes {node.name} is, is not said: {shown}"
        notes = tuple((f"{s.name} is started here", s.span) for s in found)
        faults.append(Diagnostic("ROS123", message, mine.span or node.span, hint=_NAME_IT, notes=notes))
        return None
    if not found:
        return None
    return replace(found[0], unread=tuple(dict.fromkeys(why for s in found for why in s.unread)))


_NAME_IT = "ros: {nodes: {NODE: {name: /…}}}"


def _depends_on_launch(plan: Plan, node: Node, mine: Placed) -> bool:
    """Whether only a launch file says how the node's topics are called."""
    modelled = plan.model.data if isinstance(plan.model.data, dict) else {}
    elsewhere = node.relay or node.name in {**modelled.get("compound", {}), **modelled.get("external", {})}
    return not (mine.named or mine.remaps or elsewhere) and any(topic.port for topic in node.topics)


def _unknown(nodes: Sequence[str], why: str, span: Span | None, remedy: str | None = None) -> Diagnostic:
    """An error for nodes whose topics depend on something that cannot be read: none of their links could be
    confirmed."""
    message = f"the topics of {', '.join(nodes)} have unknown names when the robot runs: {why}"
    hint = f"or say in the plan what is taken then:  ros: {{nodes: {{{nodes[0]}: {{name: /{nodes[0]}}}}}}}"
    hint = f"{remedy.rstrip('?')}, {hint}" if remedy is not None and remedy != HINT else hint.removeprefix("or ")
    return Diagnostic("ROS126", message, span, hint=hint)


def _disagreements(node: Node, mine: Placed, launched: Started) -> Iterator[Diagnostic]:
    """Topics that the plan's remappings resolve differently from the launch file's."""
    if launched.unread:
        return  # the part that was not read may agree with the plan
    there = Placed(launched.name, launched.remaps)
    here = Placed(launched.name, mine.remaps)
    for old, _ in mine.remaps:
        if here.resolved(old) != there.resolved(old):
            message = (
                f"ros.nodes.{node.name}.remap: {old} is {here.resolved(old)} by the plan, and {there.resolved(old)} "
                f"by {where(launched.span)}"
            )
            notes = ((f"{launched.name} is started here", launched.span),)
            near = did_you_mean(old, [topic.name for topic in node.topics])
            yield Diagnostic("ROS122", message, mine.span, hint=near or "make both the same", notes=notes)


def where(span: Span | None) -> str:
    return f"{Path(span.file).name}:{span.line}" if span is not None else "a launch file"
