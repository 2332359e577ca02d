"""The plan's `ros`: which distribution, how the nodes are called when they run, and what remaps their topics."""

from __future__ import annotations

from avow.base.diagnostics import Diagnostic
from avow.ros.names import Placed, Resolver, is_name
from avow.system.plan import Ros
from avow.system.strict_yaml import Piece


def read_ros(root: Piece) -> tuple[Ros, list[Diagnostic]]:
    """What a well-shaped plan says of ROS, and what is wrong with the names in it."""
    faults: list[Diagnostic] = []
    piece = root.at("ros")
    if piece is None:
        return Ros(), faults
    placed = tuple((node, _placed(node, entry, faults)) for node, _, entry in piece.keyed("nodes"))
    return Ros(piece.said("distro"), Resolver(placed)), faults


def _placed(node: str, entry: Piece, faults: list[Diagnostic]) -> Placed:
    name = entry.at("name")
    whole = f"/{name.text.lstrip('/')}" if name is not None else f"/{node}"
    if name is not None and not is_name(name.text):
        faults.append(_no_name(f"ros.nodes.{node}.name", name))
    remaps: list[tuple[str, str]] = []
    for old, span, new in entry.keyed("remap"):
        if not is_name(old):
            faults.append(_no_name(f"ros.nodes.{node}.remap", Piece(span, text=old)))
        elif not is_name(new.text):
            faults.append(_no_name(f"ros.nodes.{node}.remap.{old}", new))
        else:
            remaps.append((old, new.text))
    return Placed(whole, tuple(remaps), entry.span, name is not None)


def _no_name(where: str, piece: Piece) -> Diagnostic:
    hint = "letters, digits and _, set apart by /, with / or ~ before it"
    return Diagnostic("PLAN105", f"{where}: {piece.text!r} is no name that ROS takes", piece.span, hint=hint)
