"""Which fields of a message a variable means: decided once, from the message's definition; never from its contents.

Exactly one way to fill the variable from the message's fields is taken. Where there are several, or none, the plan has
to say which is meant, and is told between what it may choose. Source of the rules for scalars, collections and
functions: the paper's Section on mapping messages to RCL.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from avow.base.plain import listed
from avow.language.sorts import EnumSort, IntegerSort, NaturalSort, RealSort, Sort
from avow.ros.definitions import INTEGERS, Array, Definitions, Message, Nested, Scalar, Wire

from .rules import FieldPath
from .tuning import CANDIDATES_SHOWN
from .wires import fits, parts_of


class Undecided(Exception):  # noqa: N818 - it is what was found wrong
    """Several ways, or none; the text says which, `hint` what the plan may write."""

    def __init__(self, message: str, hint: str | None = None) -> None:
        super().__init__(message)
        self.hint = hint


def decide(sort: Sort, message: Message, known: Definitions, values: Mapping[str, str]) -> tuple[FieldPath, ...]:
    """The fields of the message that a variable of the sort means. Raises Undecided."""
    missing = known.missing(message)
    if missing:
        raise Undecided(f"nothing defines {', '.join(missing)}, of which {message.name} is made", SOURCES)
    wanted = parts_of(sort)
    places = [(path, wire, holder) for path, wire, holder in _places(message, known)]
    fitting = [[suits(part, wire, holder, known, values) for _, wire, holder in places] for part in wanted]
    ways = _ways(fitting, len(places))
    if ways == 1:
        return tuple(places[at][0] for at in _only(fitting))
    hint = _hint(wanted, places, known, values)
    told = [
        f"{'.'.join(map(str, path)) or 'the whole message'} : {wire}"
        for at, (path, wire, _) in enumerate(places)
        if any(row[at] for row in fitting)
    ]
    if ways == 0:
        every = ", ".join(f"{'.'.join(map(str, p))} : {w}" for p, w, _ in places[:CANDIDATES_SHOWN] if p) or "none"
        raise Undecided(f"no field of {message.name} can be read as it; its fields are {every}", hint)
    what = "field" if len(wanted) == 1 else f"{len(wanted)} fields"
    which = f"which {what} of {message.name} it means is not said"
    raise Undecided(f"{which}: {listed(told, CANDIDATES_SHOWN)}", hint)


def _hint(
    wanted: Sequence[Sort],
    places: Sequence[tuple[FieldPath, Wire, Message]],
    known: Definitions,
    values: Mapping[str, str],
) -> str | None:
    """What the plan may write of arrays, whose items no variable means by itself, and of numbers that may be elements
    of an enumeration; None where there is nothing of the kind."""
    if len(wanted) != 1:
        return None
    sort = wanted[0]
    for path, wire, holder in places:
        name = ".".join(map(str, path))
        if isinstance(wire, Array) and isinstance(sort, RealSort | IntegerSort | NaturalSort):
            take = "min" if fits(sort, wire.item, known) else "count"
            item = f"an item of an array, `{name}[0]`, or " if take == "min" else ""
            return f"name the field; {item}of all items: `{{field: {name}, take: {take}}}`"
        if isinstance(sort, EnumSort) and isinstance(wire, Scalar) and wire.name in INTEGERS and not values:
            constants = [constant for constant, kind, _ in holder.constants if kind == wire.name] or ["0"]
            left = [m for m in sort.members if m not in words(sort, wire, holder, {}).values()]
            if left:
                said = f"`{{field: {name}, values: {{{constants[0]}: {left[0]}, …}}}}`"
                return f"say what its numbers mean ({', '.join(constants)}): {said}"
    return None


SOURCES = "name its file under `messages:`, or the distribution: `ros: {distro: noetic}`"


def suits(sort: Sort, wire: Wire, holder: Message, known: Definitions, values: Mapping[str, str]) -> bool:
    """`fits`, and a number stands for an element only where something says for which."""
    if not fits(sort, wire, known):
        return False
    if isinstance(sort, EnumSort) and isinstance(wire, Scalar) and wire.name in INTEGERS:
        return set(sort.members) <= set(words(sort, wire, holder, values).values())
    return True


def words(sort: EnumSort, wire: Scalar, holder: Message, values: Mapping[str, str]) -> dict[str, str]:
    """What a message's words or numbers mean: by the plan's `values` (which may name constants of the definition), else
    by the definition's constants whose names are the elements', in capitals or not."""
    constants = {name: text for name, kind, text in holder.constants if kind == wire.name}
    if values:
        return {constants.get(key, key): meant for key, meant in values.items()}
    if wire.name not in INTEGERS:
        return {}
    members = {member.lower(): member for member in sort.members}
    return {text: members[name.lower()] for name, text in constants.items() if name.lower() in members}


def _places(message: Message, known: Definitions) -> list[tuple[FieldPath, Wire, Message]]:
    """What may be meant: the leaves, and each message within the message (for tuples), the message itself first."""
    found: list[tuple[FieldPath, Wire, Message]] = [((), Nested(message.name), message)]
    seen: set[FieldPath] = set()
    for path, wire, holder in known.leaves(message):
        for depth in range(1, len(path)):
            if path[:depth] not in seen:
                seen.add(path[:depth])
                inner, where = known.at(message, path[:depth])
                found.append((path[:depth], inner, where))
        found.append((path, wire, holder))
    return found


def _ways(fitting: Sequence[Sequence[bool]], places: int) -> int:
    """In how many ways the parts can be filled by places in their order: 0, 1, or 2 for several."""
    counts = [1] + [0] * len(fitting)
    for at in range(places):
        for part in range(len(fitting), 0, -1):
            if fitting[part - 1][at]:
                counts[part] = min(2, counts[part] + counts[part - 1])
    return counts[-1]


def _only(fitting: Sequence[Sequence[bool]]) -> list[int]:
    """The one way: each part takes the first place after the last that fits."""
    found: list[int] = []
    at = 0
    for row in fitting:
        while not row[at]:
            at += 1
        found.append(at)
        at += 1
    return found
