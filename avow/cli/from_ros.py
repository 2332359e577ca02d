"""``avow init --from-bag`` and ``--from-graph``: a system drafted from a recording, or from a running graph."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import write
from avow.base.suggestions import nearest
from avow.base.tuning.running import DRAFT_MESSAGES
from avow.base.tuning.sizes import ROS_GRAPH_BYTES
from avow.language.format import format_text
from avow.language.lexer import KEYWORDS
from avow.ros.bags import Carried, Event, NoBag, Origin, carried, digest_trace, messages
from avow.ros.calls import is_part, parts_of, with_calls
from avow.ros.dds import LOOPBACK, ask_domain, domain_of
from avow.ros.definitions import Definitions, definition_file
from avow.ros.drafting import Given, by_names, draft, is_plumbing, watch
from avow.ros.listing import EVERY_SIDE, Listed, Listing, NoListing, parse_listing
from avow.ros.master import ask_master
from avow.ros.names import is_name
from avow.ros.quality import printed, recorded
from avow.ros.sources import DISTRIBUTIONS, definitions, require

_MASTER = re.compile(r"https?://[^/\s]+/?\Z|ros1\Z")
_DOMAIN = re.compile(r"((?:dds|ros2)(?::\d+)?)(?:@([\w.:-]+))?\Z")


def draft_system(
    bag: Path | None, graph: str | None, distro: str | None, own: tuple[Path, ...], folder: Path
) -> tuple[str, ...]:
    """Write the system's folder; returns how bag and graph disagree, and which topics got no ports. `own`: files or
    folders of message definitions. Raises Rejected if something cannot be read; nothing is written then."""
    differences: tuple[str, ...] = ()
    base = require(definitions((), distro))
    known = require(definitions(own, distro))
    origin = Origin(distro, own)
    listing = _listing(graph) if graph is not None else None
    qos = listing.qos if listing is not None else ""
    origins: list[str] = []
    given = Given(folder.name, "", listing or Listing(()), known, frozenset(KEYWORDS), distro=distro)
    if bag is not None:
        try:
            found = carried(bag, origin)
            known = Definitions({**known.messages, **found.known})
            seen, note = watch(known, found.types)
            whole = {topic for topic, kind in found.types.items() if not parts_of(topic, kind)}
            heard: set[str] = set()
            for event, _ in islice(messages(bag, origin, whole.__contains__), DRAFT_MESSAGES):
                note(event)
                heard |= _names_in(event)
        except NoBag as no:
            raise Rejected(Diagnostic("CLI011", str(no), hint=no.hint and no.hint.replace(*_OPTION))) from None
        differences = tuple(_differences(listing, found)) if listing is not None else ()
        if seen and not any(one.count for one in seen.values()):
            differences += (f"{bag.name} has no message of these topics: the draft has no recorded values",)
        listing, unsaid = _together(listing, found, heard)
        traces, ends = {f"traces/{bag.name}": digest_trace(bag)}, recorded(bag) if found.ros2 else ()
        given = replace(given, known=known, seen=seen, ros2=found.ros2, unsaid=unsaid, traces=traces, ends=ends)
        origins.append(bag.name)
    assert listing is not None
    if graph is not None:
        origins.append("the running graph" if _MASTER.match(graph) or _DOMAIN.match(graph) else Path(graph).name)
        newer = distro is not None and DISTRIBUTIONS[distro].startswith("ros2")
        given = replace(given, ros2=given.ros2 or newer or _DOMAIN.match(graph) is not None)
    listing = with_calls(_sound(listing))
    if not any(node.publishes or node.subscribes for node in listing.nodes):
        hint = "give the output of `ros2 node info NODE` (or `rosnode info`) of each node, with its indented sections"
        raise Rejected(Diagnostic("CLI011", f"{' and '.join(origins)}: no node has a topic", hint=hint))
    given = replace(given, messages=_own_types(listing, known, base))
    graph_file = "models/rosgraph.txt" if graph is not None else None
    given = replace(given, ends=(*given.ends, *(printed(qos) if qos else ())))
    given = replace(given, listing=replace(listing, qos=qos), origin=" and ".join(origins), graph=graph_file)
    made = draft(given)
    if made.unknown:
        text = f"not known: {', '.join(made.unknown)}; the topics of these types have no ports: draft again with"
        differences += (f"{text} `--messages FOLDER`, the folder of your own, and with `--distro` for those of ROS",)
    write(folder / "system.rcl", format_text(made.contract, str(folder / "system.rcl")))
    write(folder / "plan.yaml", made.plan)
    for path, text in given.messages.items():
        write(folder / "msg" / path, text)
    if graph is not None:
        write(folder / "models/rosgraph.txt", listing.text())
    if qos:
        write(folder / "models/qos.txt", qos)
    if bag is not None:
        write(folder / "traces/.gitignore", f"# large, and named in plan.yaml with its digest\n/{bag.name}\n")
        (shutil.copytree if bag.is_dir() else shutil.copyfile)(bag, folder / "traces" / bag.name)
    return differences


def _differences(listing: Listing, found: Carried) -> Iterator[str]:
    """The topics that only the bag has, and those with another type in the graph."""
    known = {topic for node in listing.nodes for side in EVERY_SIDE for topic in getattr(node, side)}
    own = {topic: kind for topic, kind in sorted(found.types.items()) if not is_plumbing(topic) and not is_part(topic)}
    for topic, kind in own.items():
        if topic not in known:
            near = (f": did you mean `{other}`?" for other in nearest(topic, known - found.types.keys(), alike=0.75))
            yield f"{topic} is in the bag, and no node of the graph has it{''.join(near)}"
        elif listing.types.get(topic, kind) != kind:
            yield f"{topic} has the type {kind} in the bag, and {listing.types[topic]} in the graph"
    if not known & own.keys():
        yield "the graph has none of the bag's topics: is it of the same robot?"


_OPTION = (
    "name the distribution, `ros: {distro: humble}`, and `messages:`",
    "name the distribution: `--distro humble`",
)


def _listing(graph: str) -> Listing:
    try:
        if _MASTER.match(graph):
            return ask_master(os.environ.get("ROS_MASTER_URI", "http://localhost:11311") if graph == "ros1" else graph)
        if domain := _DOMAIN.match(graph):
            return ask_domain(domain_of(domain[1]), domain[2] or LOOPBACK[0])
        data = Path(graph).read_bytes()
        if len(data) > ROS_GRAPH_BYTES:
            raise NoListing(f"it has more than {ROS_GRAPH_BYTES} bytes")
        return parse_listing(data.decode("utf-8"))
    except (NoListing, ValueError) as no:  # also for text that is not UTF-8
        raise Rejected(Diagnostic("CLI011", f"{graph}: {no}")) from None
    except OSError as error:
        raise Rejected(Diagnostic("CLI011", f"{graph} cannot be read: {error.strerror or error}")) from None


def _names_in(event: Event) -> set[str]:
    """The node that a message of ROS's own log or parameter events names."""
    match event:
        case {"topic": "/rosout", "name": str(name)} if name:
            return {f"/{name.strip('/').replace('.', '/')}"}
        case {"topic": "/parameter_events", "node": str(name)}:
            return {name}
    return set()


def _together(listing: Listing | None, found: Carried, heard: set[str]) -> tuple[Listing, frozenset[str]]:
    """The publishers in a bag and in a graph together, and the nodes for which neither has publishers: these are
    derived from the topics' names."""
    nodes = listing.nodes if listing is not None else ()
    known = {topic for node in nodes for topic in node.publishes}
    callers: dict[str, list[str]] = {}
    for topic, names in found.publishers.items():
        for name in names if topic not in known else ():
            callers.setdefault(name, []).append(topic)
    unsaid = frozenset[str]()
    if listing is None and not callers:
        callers = by_names((topic for topic in found.types if not is_plumbing(topic)), heard)
        unsaid = frozenset(callers)
    nodes = tuple(replace(n, publishes=(*n.publishes, *callers.pop(n.name, ()))) for n in nodes)
    for name, topics in callers.items():
        asked = tuple(filter(_asks, topics))
        nodes += (Listed(name, tuple(t for t in topics if t not in asked), asked),)
    return Listing(nodes, {**(listing.types if listing is not None else {}), **found.types}), unsaid


def _own_types(listing: Listing, known: Definitions, base: Definitions) -> dict[str, str]:
    """The files that define those of the topics' types that no distribution has: they are needed where the bag is
    missing."""
    kinds = (known.get(kind) for topic, kind in listing.types.items() if not is_plumbing(topic))
    wanted = {name for kind in kinds if kind is not None for name in (kind.name, *known.within(kind))}
    files = dict(map(definition_file, sorted(wanted - base.messages.keys())))
    found = {path: [known.get(part) for part in parts] for path, parts in files.items()}
    return {path: "---\n".join(part.text() for part in parts if part) for path, parts in found.items() if all(parts)}


def _asks(topic: str) -> bool:
    """Whether a topic is the part of a call that the server receives."""
    return is_part(topic) and topic.endswith(("/_request", "/_goal"))


def _sound(listing: Listing) -> Listing:
    """The listing without names and types that ROS would reject: they come from a file."""

    def kept(names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(name for name in dict.fromkeys(names) if name.startswith("/") and is_name(name))

    nodes = tuple(
        Listed(n.name, **{side: kept(getattr(n, side)) for side in EVERY_SIDE})
        for n in listing.nodes
        if kept((n.name,))
    )
    types = {t: kind for t, kind in listing.types.items() if re.fullmatch(r"[A-Za-z]\w*/[A-Za-z]\w*", kind, re.ASCII)}
    return Listing(nodes, types)
