"""The library's `dataclass`, with lazily generated methods.

Generating `__init__`, `__eq__`, `__hash__` and `__repr__` of some four hundred classes took two fifths of a short run,
and a run makes instances of few of them. The behaviour is the library's: fields, defaults, slots, patterns of `match`,
`replace`, `FrozenInstanceError`.
"""

from __future__ import annotations

import dataclasses
import reprlib
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(*, slots: bool, frozen: bool = False) -> Callable[[type], type]:
        """As `dataclasses.dataclass(slots=True)` and `dataclasses.dataclass(frozen=True, slots=True)`."""
        assert slots, "without slots: the library's own"
        return _frozen if frozen else _made


def _frozen(kind: type) -> type:
    own: Any = kind
    own.__setattr__, own.__delattr__ = _fixed, _fixed
    if "__getstate__" not in vars(kind):
        own.__getstate__, own.__setstate__ = _state, _restore
    return _made(kind, ("__init__", "__repr__", "__eq__", "__hash__"))


def _made(kind: Any, generated: tuple[str, ...] = ("__init__", "__repr__", "__eq__")) -> type:
    owner: list[type] = []
    inherited = "__eq__" in vars(kind) and vars(kind)["__hash__"] is None  # added by Python, not written in the class
    for name in generated:
        if name not in vars(kind) or (name == "__hash__" and inherited):
            setattr(kind, name, _first(owner, name))
    if "__hash__" not in vars(kind):
        kind.__hash__ = None
    kind.__doc__ = kind.__doc__ or kind.__name__  # otherwise the library computes a signature
    made: type = dataclasses.dataclass(init=False, repr=False, eq=False, slots=True)(kind)
    owner.append(made)
    return made


def _first(owner: list[type], name: str) -> Callable[..., Any]:
    """Stands for a method until it is called."""

    def first(self: object, *given: Any, **named: Any) -> Any:
        method = _METHODS[name](owner[0])
        method.__qualname__ = f"{owner[0].__qualname__}.{name}"
        setattr(owner[0], name, method)
        return method(self, *given, **named)

    return first


def _init(kind: Any) -> Any:
    scope: dict[str, Any] = {"_unset": dataclasses.MISSING}
    listed, named, body = ["self"], list[str](), list[str]()
    for at, field in enumerate(dataclasses.fields(kind)):
        name, makes = field.name, field.default_factory is not dataclasses.MISSING
        has = makes or field.default is not dataclasses.MISSING
        scope[f"_d{at}"] = field.default_factory if makes else field.default
        value = f"_d{at}()" if makes else f"_d{at}"
        if field.init:
            default = "" if not has else "=_unset" if makes else f"={value}"
            (named if field.kw_only else listed).append(name + default)
            value = f"{value} if {name} is _unset else {name}" if makes else name
        elif not has:
            continue
        if vars(kind).get("__setattr__") is _fixed:
            scope[f"_s{at}"] = getattr(kind, name).__set__  # the slot itself: quicker than to look it up each time
            body.append(f"_s{at}(self, {value})")
        else:
            body.append(f"self.{name} = {value}")
    if hasattr(kind, "__post_init__"):
        body.append("self.__post_init__()")
    parameters = ", ".join([*listed, *(["*", *named] if named else [])])
    return _compiled(f"def __init__({parameters}):\n " + "\n ".join(body or ["pass"]), scope)


def _eq(kind: Any) -> Any:
    mine, other = (_values(f"{who}.{f.name}" for f in _compared(kind)) for who in ("self", "other"))
    same = f"{mine} == {other} if other.__class__ is self.__class__ else NotImplemented"
    return _compiled(f"def __eq__(self, other):\n return {same}", {})


def _hash(kind: Any) -> Any:
    values = _values(f"self.{f.name}" for f in _compared(kind) if f.hash is not False)
    return _compiled(f"def __hash__(self):\n return hash({values})", {})


def _repr(kind: Any) -> Any:
    names = [field.name for field in dataclasses.fields(kind) if field.repr]

    def shown(self: object) -> str:
        return f"{type(self).__qualname__}({', '.join(f'{name}={getattr(self, name)!r}' for name in names)})"

    return reprlib.recursive_repr()(shown)


_METHODS: Mapping[str, Callable[[Any], Any]] = {"__init__": _init, "__eq__": _eq, "__hash__": _hash, "__repr__": _repr}


def _compared(kind: Any) -> list[dataclasses.Field[Any]]:
    return [field for field in dataclasses.fields(kind) if field.compare]


def _values(parts: Iterable[str]) -> str:
    return f"({''.join(f'{part}, ' for part in parts)})"


def _compiled(text: str, scope: dict[str, Any]) -> Any:
    exec(text, scope)
    return scope[text[4 : text.index("(")]]


def _fixed(self: object, name: str, *value: object) -> NoReturn:
    raise dataclasses.FrozenInstanceError(f"cannot assign to or delete field {name!r}")


def _state(self: Any) -> list[Any]:
    return [getattr(self, field.name) for field in dataclasses.fields(self)]


def _restore(self: Any, state: list[Any]) -> None:
    for field, value in zip(dataclasses.fields(self), state, strict=True):
        object.__setattr__(self, field.name, value)
