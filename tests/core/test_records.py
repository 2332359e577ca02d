"""`avow.base.records.dataclass` promises what the library's does."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from collections.abc import Callable
from typing import Any

import pytest

from avow.base import records


def _kinds(made: Callable[..., Any]) -> dict[str, Any]:
    @made(frozen=True, slots=True)
    class Plain:
        """With a docstring."""

        x: int
        y: str = "y"

    @made(frozen=True, slots=True)
    class Rich:
        many: list[int] = dataclasses.field(default_factory=list)
        quiet: int = dataclasses.field(default=1, compare=False, repr=False)
        late: int = dataclasses.field(init=False, default=5)
        unhashed: int = dataclasses.field(default=0, hash=False)
        key: int = dataclasses.field(default=3, kw_only=True)

        def __post_init__(self) -> None:
            object.__setattr__(self, "late", self.key + 1)

    @made(frozen=True, slots=True)
    class Child(Plain):
        z: float = 0.5

        def __str__(self) -> str:
            return "child"

    @made(frozen=True, slots=True)
    class Alike:
        x: int

        def __eq__(self, other: object) -> bool:
            return isinstance(other, Alike)

    @made(frozen=True, slots=True)
    class Hashed:
        x: int

        def __hash__(self) -> int:
            return 7

        def __repr__(self) -> str:
            return "hashed"

    @made(slots=True)
    class Loose:
        x: int
        seen: set[int] = dataclasses.field(default_factory=set, repr=False)

    return {kind.__name__: kind for kind in (Plain, Rich, Child, Alike, Hashed, Loose)}


LIBRARY, OURS = _kinds(dataclasses.dataclass), _kinds(records.dataclass)

MADE: list[tuple[str, tuple[Any, ...], dict[str, Any]]] = [
    ("Plain", (1,), {}),
    ("Plain", (1, "z"), {}),
    ("Plain", (), {"y": "a", "x": 2}),
    ("Plain", (), {}),
    ("Plain", (1, 2, 3), {}),
    ("Plain", (1,), {"w": 2}),
    ("Rich", (), {}),
    ("Rich", ([1],), {"key": 9, "quiet": 4}),
    ("Rich", ([1], 2, 3, 4), {}),
    ("Child", (1,), {"z": 2.5}),
    ("Alike", (1,), {}),
    ("Hashed", (1,), {}),
    ("Loose", (1,), {}),
    ("Loose", (1, {2}), {}),
]


def _told(ask: Callable[[], object]) -> object:
    try:
        return ask()
    except Exception as error:
        return type(error), str(error).replace("_kinds.<locals>.", "")


@pytest.mark.parametrize(("name", "given", "named"), MADE)
def test_an_instance_is_as_the_library_makes_it(name: str, given: Any, named: Any) -> None:
    theirs, ours = (_told(lambda kind=kinds[name]: kind(*given, **named)) for kinds in (LIBRARY, OURS))
    if isinstance(theirs, tuple):
        assert ours == theirs
        return
    assert repr(ours) == repr(theirs)
    assert str(ours) == str(theirs)
    assert _told(lambda: hash(ours)) == _told(lambda: hash(theirs))
    assert dataclasses.asdict(ours) == dataclasses.asdict(theirs)  # type: ignore[call-overload]
    field = "x" if name != "Rich" else "key"
    for one in (ours, theirs):
        assert one == copy.copy(one) == copy.deepcopy(one) == dataclasses.replace(one)  # type: ignore[type-var]
        assert not hasattr(one, "__dict__")
    changed = [_told(lambda one=one: dataclasses.replace(one, **{field: 40})) for one in (ours, theirs)]
    assert repr(changed[0]) == repr(changed[1])
    assert (changed[0] == ours) == (changed[1] == theirs)


def test_what_is_frozen_stays_and_what_is_not_does_not() -> None:
    for kinds in (LIBRARY, OURS):
        one = kinds["Plain"](1)
        for change in (lambda one=one: setattr(one, "x", 2), lambda one=one: delattr(one, "x")):
            with pytest.raises(dataclasses.FrozenInstanceError):
                change()
        assert one.x == 1
        loose = kinds["Loose"](1)
        loose.x = 3
        assert loose == kinds["Loose"](3)
        with pytest.raises(TypeError):
            hash(loose)


def test_classes_are_told_apart_and_matched_as_the_library_has_it() -> None:
    for kinds in (LIBRARY, OURS):
        plain, child = kinds["Plain"](1), kinds["Child"](1)
        assert plain != child
        assert kinds["Plain"].__match_args__ == ("x", "y")
        assert kinds["Child"].__match_args__ == ("x", "y", "z")
        assert [f.name for f in dataclasses.fields(kinds["Child"])] == ["x", "y", "z"]
        assert kinds["Plain"].__doc__ == "With a docstring."
        assert len({plain, kinds["Plain"](1), child}) == 2


@records.dataclass(frozen=True, slots=True)
class Whole:
    """At the top of a module, as pickle wants it."""

    x: int
    inner: tuple[Whole, ...] = ()


def test_it_travels() -> None:
    one = Whole(1, (Whole(2),))
    assert pickle.loads(pickle.dumps(one)) == one
    assert repr(one) == "Whole(x=1, inner=(Whole(x=2, inner=()),))"
