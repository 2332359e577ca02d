"""Caches of answers about frozen data: an answer about the same object is not computed twice.

An answer about a *text* can also be kept from run to run, on a `Shelf`: its key is the digest of everything it was
computed from, and it is in the user's cache under the user's seal (`avow.base.notes`).
"""

from __future__ import annotations

import contextlib
import dataclasses
import enum
import io
import pickle
import shutil
import sys
from collections.abc import Callable, Mapping
from functools import update_wrapper
from pathlib import Path
from typing import Any, Generic, ParamSpec, TypeVar, cast

from avow.base.diagnostics import Span
from avow.base.files import PART, sha256, write
from avow.base.notes import cache_folder, sealed, unsealed
from avow.base.records import dataclass
from avow.base.tuning.sizes import NOTED, SHELVES

P = ParamSpec("P")
T = TypeVar("T")


class Remembered(Generic[P, T]):
    """A pure function of frozen arguments that caches its answers."""

    def __init__(self, function: Callable[P, T], most: int) -> None:
        self.name = function.__qualname__
        self._function = function
        self._most = most
        self._known: dict[tuple[int, ...], tuple[object, T]] = {}
        """The arguments are kept with the answer: while they are alive, no other object gets their id."""
        update_wrapper(self, function)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> T:
        assert not kwargs
        found = self._known.get(tuple(map(id, args)))
        return self._learn(self._function(*args, **kwargs), args) if found is None else found[1]

    def learn(self, answer: T, *args: P.args, **kwargs: P.kwargs) -> None:
        """The answer of an earlier run."""
        assert not kwargs
        self._learn(answer, args)

    def _learn(self, answer: T, args: tuple[object, ...]) -> T:
        if len(self._known) >= self._most:
            self._known.clear()
        self._known[tuple(map(id, args))] = (args, answer)
        return answer


def by_identity(most: int) -> Callable[[Callable[P, T]], Remembered[P, T]]:
    """Decorates a pure function of frozen arguments. Arguments are compared by identity: comparing a deep formula costs
    as much as the answer. With more than `most` answers the cache is emptied."""
    return lambda function: Remembered(function, most)


@dataclass(frozen=True, slots=True)
class Stretch:
    """Whole lines of a file, from `first` on and before `end`. What follows from their text is the same at any
    position, apart from the places in it."""

    file: str
    first: int
    end: int
    heads: Mapping[str, int] = dataclasses.field(default_factory=dict)
    """File → the line before which the answer may also name places; the answer's digest covers that part."""

    def has(self, span: Span) -> bool:
        return span.file == self.file and self.first <= span.line and span.end_line <= self.end


class Kept:
    """Values about one place, kept from run to run: a file each, in the user's cache under the user's seal
    (`avow.base.notes`). An edited, half-written or missing one is none."""

    def __init__(self, kind: str, place: Path) -> None:
        self.folder = cache_folder() / kind / sha256(str(place.absolute()))
        self._used: set[Path] = set()

    def get(self, name: str, mark: str) -> Any:
        """The value that was kept with that mark, which covers everything that it was made from; else None."""
        data, head = unsealed(self._file(name)), mark.encode()
        if data is None or not data.startswith(head):
            return None
        return _Placing(io.BytesIO(data[len(head) :]), _NOWHERE).load()

    def put(self, name: str, mark: str, value: object) -> None:
        path = self._file(name)
        with contextlib.suppress(OSError):  # with a read-only home it is made again each time
            write(path, sealed(path, mark.encode() + _written(value, _NOWHERE)))

    def tidy(self) -> None:
        """Remove the values that were not used, and the places not used for longest."""
        with contextlib.suppress(OSError):
            for path in self.folder.iterdir():
                if path not in self._used and path.suffix != PART:
                    path.unlink()
            places = sorted(self.folder.parent.iterdir(), key=lambda path: path.stat().st_mtime)
            for place in places[: -SHELVES or None]:
                shutil.rmtree(place, ignore_errors=True)

    def _file(self, name: str) -> Path:
        self._used.add(path := self.folder / sha256(name))
        return path


_NOWHERE = Stretch("", 0, 0)

_TRUE = ""
"""In place of a digest: known facts."""


class Shelf:
    """Answers about the texts of one folder, kept from run to run.

    An answer that other code made is ignored: `given` (what every answer depends on) is part of every digest.
    """

    def __init__(self, folder: Path, *given: str) -> None:
        self._place = Kept("texts", folder)
        self._given = (sys.version, *given)
        self._kept: dict[str, dict[str, bytes]] = self._place.get("all", "") or {}
        self._asked: dict[str, dict[str, bytes]] = {_TRUE: self._kept.get(_TRUE, {})}
        self._texts: dict[int, tuple[object, str, Stretch]] = {}
        self._said: dict[tuple[str, str, str, int], object] = {}
        """The answers of this run: contract and plan are checked after they are read, with the same answers."""
        self._new = False

    def digest(self, *texts: str) -> str:
        """Digest of everything that an answer is computed from."""
        return sha256("".join(f"{len(text)}:{text}" for text in (*self._given, *texts)))

    def answer(self, digest: str, stretch: Stretch, make: Callable[[], T], what: str = "") -> T:
        """The answer of `make` for the texts with that digest, at the stretch; `what` distinguishes several answers
        with one digest. `make` uses nothing else."""
        answers = self._asked.setdefault(digest, self._kept.get(digest, {}))
        asked = digest, what, stretch.file, stretch.first
        if asked in self._said:
            return cast(T, self._said[asked])
        if what in answers:
            made = cast(T, _Placing(io.BytesIO(answers[what]), stretch).load())
        else:
            made = make()
            with contextlib.suppress(pickle.PicklingError, RecursionError):  # too deep, or of other places, too
                answers[what] = _written(made, stretch)
                self._new = True
        self._said[asked] = made
        return made

    def knows(self, digest: str) -> bool:
        """Whether the fact is known for the texts with that digest."""
        return digest in self._asked[_TRUE]

    def note(self, digest: str) -> None:
        """Record the fact. It stays known when the texts change; if there are very many, all are dropped."""
        if len(self._asked[_TRUE]) >= NOTED:
            self._asked[_TRUE].clear()
        self._asked[_TRUE][digest] = b""
        self._new = True

    def is_of(self, value: object, digest: str, stretch: Stretch) -> None:
        """Note that the value, and what follows from it alone, was computed from the texts with that digest."""
        self._texts[id(value)] = (value, digest, stretch)

    def recall(self, function: Remembered[[T], Any], value: T) -> bool:
        """Give the function its answers about that value from an earlier run, or keep them for a later one. Returns
        whether the value was computed from a text here."""
        if id(value) not in self._texts:
            return False
        _, digest, stretch = self._texts[id(value)]
        function.learn(self.answer(digest, stretch, lambda: function(value), function.name), value)
        return True

    def keep(self) -> None:
        """Write the requested answers if any is new. Answers that were not requested belong to earlier texts."""
        if self._new:
            self._new = False
            self._place.put("all", "", self._asked)
            self._place.tidy()


def _here(line: int, column: int, end_line: int, end_column: int) -> Span:
    """A place in the stretch, by its distance from the first line."""
    raise NotImplementedError


class _Written(pickle.Pickler):
    def __init__(self, into: io.BytesIO, stretch: Stretch) -> None:
        super().__init__(into, protocol=5)
        self.stretch = stretch
        self.fields: dict[type, tuple[str, ...] | None] = {}

    def reducer_override(self, value: Any) -> Any:
        kind = type(value)
        if kind is Span:
            first = self.stretch.first
            if self.stretch.has(value):
                return _here, (value.line - first, value.column, value.end_line - first, value.end_column)
            if value.end_line >= self.stretch.heads.get(value.file, 0):
                raise pickle.PicklingError("a place in another text")
        if isinstance(value, enum.Enum):
            return kind, (value.value,)
        if kind not in self.fields:
            every = dataclasses.fields(kind) if dataclasses.is_dataclass(kind) else None
            self.fields[kind] = None if every is None else tuple(field.name for field in every)
        names = self.fields[kind]
        return NotImplemented if names is None else (kind, tuple(getattr(value, name) for name in names))


class _Placing(pickle.Unpickler):
    def __init__(self, data: io.BytesIO, stretch: Stretch) -> None:
        super().__init__(data)
        self.stretch = stretch

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == (__name__, _here.__name__):
            file, first = self.stretch.file, self.stretch.first
            return lambda line, column, end, last: Span(file, first + line, column, first + end, last)
        if module.partition(".")[0] != "avow" and (module, name) != ("fractions", "Fraction"):
            raise pickle.UnpicklingError(f"{module}.{name} is no data of Avow's")
        return super().find_class(module, name)


def _written(value: object, stretch: Stretch) -> bytes:
    into = io.BytesIO()
    _Written(into, stretch).dump(value)
    return into.getvalue()
