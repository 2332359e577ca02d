"""ROS 2's messages as DDS carries them: how types are made, and what a sample holds."""

from __future__ import annotations

import keyword
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.graphs import reached
from avow.ros.bags import plainer
from avow.ros.dds import dds_type
from avow.ros.definitions import Array, Definitions, Field, Message, Nested, Scalar, Wire, parse_message

NO_DDS = Diagnostic("MON305", "DDS needs the packages cyclonedds and rosbags", hint="pip install 'avow[dds]'")

_TIME = {
    kind: parse_message("int32 sec\nuint32 nanosec", f"builtin_interfaces/{kind.capitalize()}")
    for kind in ("time", "duration")
}
_EMPTY = Message("", (Field("structure_needs_at_least_one_member", Scalar("uint8")),))
"""What ROS 2 makes of a message without fields."""


class Types:
    """The types of some definitions, for cyclonedds (what it tells others of them) and for rosbags, which reads."""

    def __init__(self, known: Definitions) -> None:
        """Raises Rejected without the packages cyclonedds and rosbags."""
        try:
            from cyclonedds.idl import make_idl_struct, types
            from rosbags.interfaces import Nodetype
            from rosbags.typesys import Stores, get_typestore
        except ImportError:
            raise Rejected(NO_DDS) from None
        self._make, self._types, self._kind = make_idl_struct, types, Nodetype
        self._store = get_typestore(Stores.EMPTY)
        self._known = known
        self._made: dict[str, Any] = {}

    def missing(self, kind: str) -> str:
        """Why a type cannot be heard; empty where it can."""
        message = self._known.get(kind)
        if message is None:
            return f"nothing defines {kind}"
        if lacking := self._known.missing(message):
            return f"nothing defines {lacking[0]}, of which {kind} is made"
        wide = [name for name in self._names(message) for f in self.message(name).fields if _has_wide(f.wire)]
        return f"{wide[0]} has a wstring, which cannot be read here" if wide else ""

    def struct(self, kind: str) -> Any:
        """A class of cyclonedds. It must not be `missing`."""
        if kind not in self._made:
            self._made[kind] = self._new(kind)
        return self._made[kind]

    def raw(self, kind: str) -> Any:
        """As `struct`, for readers: its samples are `Raw`."""
        made = self._new(kind)
        made.deserialize = classmethod(lambda cls, data, *more: Raw(data))
        made.deserialize_key = classmethod(lambda cls, data, *more: Raw(b""))
        return made

    def _new(self, kind: str) -> Any:
        fields = {_attribute(f.name): self._idl(f.wire) for f in self.message(kind).fields}
        return self._make(f"{kind.rpartition('/')[2]}_", dds_type(kind), fields)

    def reader(self, kind: str) -> Callable[[bytes], dict[str, Any]]:
        """What a sample holds, as a bag's message would be read; it raises ValueError for what is none."""
        from rosbags.serde import SerdeError

        base, store = self._kind, self._store

        def desc(wire: Wire) -> Any:
            match wire:
                case Scalar(name="time" | "duration" as name):
                    return base.NAME, _full(_TIME[name].name)
                case Scalar(name=name):
                    return base.BASE, (name, 0)
                case Nested(name=name):
                    return base.NAME, _full(name)
                case Array(item=item, length=None):
                    return base.SEQUENCE, (desc(item), 0)
                case Array(item=item, length=length):
                    return base.ARRAY, (desc(item), length)

        names = self._names(self.message(kind))
        made: dict[str, Any] = {_full(n): ([], [(f.name, desc(f.wire)) for f in self.message(n).fields]) for n in names}
        store.register({name: parts for name, parts in made.items() if name not in store.fielddefs})
        plain, full = plainer(store.fielddefs), _full(kind)

        def read(raw: bytes) -> dict[str, Any]:
            try:
                found: dict[str, Any] = plain(store.deserialize_cdr(raw, full))
            except (SerdeError, AssertionError, IndexError) as error:
                raise ValueError(f"a sample is no {kind}: {error}") from None
            return found

        return read

    def message(self, kind: str) -> Message:
        for time in _TIME.values():
            if time.name == kind:
                return time
        message = self._known.get(kind)
        assert message is not None, kind
        return message if message.fields else Message(kind, _EMPTY.fields)

    def _names(self, message: Message) -> list[str]:
        """The types that a message is made of, and its own."""

        def inner(name: str) -> Iterator[str]:
            for each in self.message(name).fields:
                wire = each.wire.item if isinstance(each.wire, Array) else each.wire
                if isinstance(wire, Nested):
                    yield wire.name
                elif wire.name in _TIME:
                    yield _TIME[wire.name].name

        return list(reached([message.name], inner))

    def _idl(self, wire: Wire) -> Any:
        match wire:
            case Scalar(name="time" | "duration" as name):
                return self.struct(_TIME[name].name)
            case Scalar(name="string"):
                return str
            case Scalar(name="bool"):
                return bool
            case Scalar(name=name):
                return getattr(self._types, name)
            case Nested(name=name):
                return self.struct(name)
            case Array(item=item, length=None):
                return self._types.sequence[self._idl(item)]
            case Array(item=item, length=length):
                return self._types.array[self._idl(item), length]


class Raw:
    """A sample as it came; cyclonedds sets `sample_info`."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.sample_info: Any = None


def filled(types: Types, kind: str, values: Mapping[str, Any]) -> Any:
    """A message to be said, of plain values."""

    def made(wire: Wire, value: Any) -> Any:
        match wire:
            case Scalar(name="time" | "duration" as name):
                return types.struct(_TIME[name].name)(*value)
            case Scalar():
                return value
            case Nested(name=name):
                return filled(types, name, value)
            case Array(item=item):
                return [made(item, one) for one in value]

    return types.struct(kind)(**{_attribute(f.name): made(f.wire, values[f.name]) for f in types.message(kind).fields})


def _attribute(name: str) -> str:
    """A field's name as one of Python's."""
    return f"{name}_" if keyword.iskeyword(name) else name


def _has_wide(wire: Wire) -> bool:
    return (wire.item if isinstance(wire, Array) else wire) == Scalar("wstring")


def _full(kind: str) -> str:
    package, _, name = kind.partition("/")
    return f"{package}/msg/{name}"
