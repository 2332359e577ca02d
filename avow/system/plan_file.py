"""Reads plan.yaml: from text to `Plan`, with every fault located and all of them reported at once.

It needs no contract, whose files the plan names: `avow.system.names` then checks the plan's names against that, and
`avow.system.links` adds what a plan leaves to it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.files import inside, read_regular, sha256
from avow.base.remembered import Shelf
from avow.base.suggestions import nearby
from avow.ros.names import Placed, Resolver
from avow.ros.quality import BAG_FILE, quality, seconds
from avow.system.hazards import read_hazards
from avow.system.launched import in_workspace, named_file, read_launched
from avow.system.node_plan import files_of, read_methods, read_source
from avow.system.pieces import Located, Piece
from avow.system.plan import (
    NOWHERE,
    ComposeGoal,
    Edge,
    Endpoint,
    EnvironmentInput,
    Finding,
    NodeEnds,
    NodePlan,
    Plan,
    Requirement,
    Ros,
    Scenario,
    Source,
    Subsystem,
    Table,
    Validation,
    is_wild,
)
from avow.system.probability import Probability
from avow.system.schema import check_shape, without_faults
from avow.system.statements import read_statements, wrong_words
from avow.system.strict_yaml import read_yaml
from avow.system.tables import domain, interpretation, plain, read_csv, read_rows

T = TypeVar("T")

RESERVED = ("interpret", "domains", "steps")
"""Keys of `scenario` that are not tables."""


def read_plan(
    path: Path, text: str | None = None, shelf: Shelf | None = None
) -> tuple[Plan, Piece, tuple[Diagnostic, ...]]:
    """The plan in a file (or in a `text` that the file is to have), its names not yet checked against a contract; the
    document; the faults in its values. `shelf`: the cache of documents that have the right shape.

    Raises Rejected if the file cannot be read or its shape is wrong; then no other fault is reported.
    """
    root, faults = _document(path) if text is None else read_yaml(text.encode("utf-8", "replace"), str(path))
    faults += check_shape(root, shelf)
    if faults:
        raise Rejected(*faults)
    reader = _PlanReader(path, root)
    return reader.plan(), root, tuple(reader.faults)


def read_rest(
    path: Path,
) -> tuple[Plan, Piece, tuple[Diagnostic, ...], frozenset[str], frozenset[tuple[str | int, ...]]]:
    """As `read_plan`, without the pieces whose shape is wrong, with the words in those, and with the paths of all
    faulty values: for finding further faults, never for verifying. Raises Rejected if the file is no document, or
    nothing of it is left."""
    root, faults = _document(path)
    faults += check_shape(root)
    rest, dropped = without_faults(root)
    if rest is None:
        raise Rejected(*faults)
    reader = _PlanReader(path, rest)
    plan = reader.plan()
    faults += tuple(reader.faults)
    places = {fault.span for fault in faults}
    wrong = frozenset(at for at, piece in root.parts() if at and piece.span in places)
    return plan, rest, faults, dropped, wrong


def _document(path: Path) -> tuple[Piece, tuple[Diagnostic, ...]]:
    try:
        data = read_regular(path)
    except OSError as error:
        raise Rejected(Diagnostic("PLAN100", f"{path} cannot be read: {error.strerror}")) from None
    return read_yaml(data, str(path))


def bare_plan(name: str, files: tuple[Path, ...]) -> Plan:
    """The plan of a system that has no plan file: names link, nothing else is decided."""
    root = files[0].parent if files else Path()
    nowhere = Located({}, Span(str(files[0]) if files else "", 1, 1, 1, 1))
    return Plan(name, name, root / "plan.yaml", files, model=nowhere, policy=nowhere)


class _PlanReader:
    """Turns a well-shaped document into a `Plan`, noting what the schema cannot see."""

    def __init__(self, path: Path, root: Piece) -> None:
        self.path = path
        self.root = root
        self.faults: list[Diagnostic] = []
        self.unread: list[str] = []
        """The scenario's tables that have a fault."""

    def fault(self, code: str, message: str, span: Span, hint: str | None = None) -> None:
        self.faults.append(Diagnostic(code, message, span, hint=hint))

    def plan(self) -> Plan:
        folder = self.path.resolve().parent.name
        name = self.root.said("system") or re.sub(r"[^A-Za-z0-9_-]", "_", folder) or "system"
        located = {
            key: (self.root.at(key) or Piece(self.root.span, value=None)).located() for key in ("model", "policy")
        }
        self.files(self.root.each("model", "graph"))
        scenario = self.scenario()
        launched = self.noted(read_launched(self.path, self.root.each("ros", "launch")))
        ends = tuple(self.ends())
        records = self.elsewhere(self.root.each("ros", "qos"))
        looked_at = [
            path / BAG_FILE if path.is_dir() else path for path in (*records, *(f for e in ends for f in e.files))
        ]
        hazard_files = self.files(self.root.each("hazards"))
        return Plan(
            system=name,
            title=self.root.said("title") or name,
            path=self.path,
            contract_files=self.contract_files(),
            model=located["model"],
            messages=self.files(self.root.each("messages")),
            connections=tuple(self.connections()),
            environment=tuple(self.environment()),
            scenario=scenario,
            requirements=tuple(self.requirements()),
            hazards=self.noted(read_hazards(hazard_files)),
            compose=tuple(self.goals()),
            nodes=tuple(self.nodes()),
            policy=located["policy"],
            expected=tuple(self.findings("expected")) if self.root.at("expected") else None,
            accepted=tuple(self.findings("accepted")),
            plugins=self.root.texts("plugins"),
            lints_off=self.root.texts("lints_off"),
            subsystems=tuple(self.subsystems()),
            statements=self.noted(read_statements(self.root)),
            ros=_ros(self.root),
            launched=launched,
            included=(*hazard_files, *(launched.files if launched is not None else ()), *looked_at),
            ends=ends,
            records=records,
        )

    def elsewhere(self, pieces: list[Piece]) -> tuple[Path, ...]:
        """Files of the workspace."""
        found = (in_workspace(self.path, piece, self.faults) for piece in pieces)
        return tuple(path for path in found if path is not None)

    def ends(self) -> Iterator[NodeEnds]:
        for node, _, piece in self.root.keyed("ros", "nodes"):
            said = [(topic, given, entry.data) for topic, given, entry in piece.keyed("qos")]
            times = ("deadline", "lease")
            made = ((t, {k: seconds(v) if k in times else v for k, v in data.items()}, at) for t, at, data in said)
            qualities = tuple((topic, quality(data), at) for topic, data, at in made)
            files = self.elsewhere(piece.each("code"))
            if files or qualities:
                yield NodeEnds(node, files, qualities)

    def noted(self, read: tuple[T, Sequence[Diagnostic]]) -> T:
        """The plan as read; its faults are noted."""
        found, faults = read
        self.faults += faults
        return found

    def file(self, piece: Piece) -> Path | None:
        """A file of the system's folder, if it is there."""
        folder = self.path.parent
        return named_file(piece, folder, (folder, "the system's folder"), self.faults)

    def files(self, pieces: Iterable[Piece]) -> tuple[Path, ...]:
        return tuple(path for path in map(self.file, pieces) if path is not None)

    def contract_files(self) -> tuple[Path, ...]:
        if self.root.at("contract") is not None:
            return self.files(self.root.each("contract"))
        found = tuple(sorted(self.path.resolve().parent.glob("*.rcl")))
        for path in found:
            if inside(self.path.parent, path.name) is None:
                self.fault(
                    "PLAN108", f"{path.name} is a symbolic link that leads out of the system's folder", self.root.span
                )
        if not found:
            hint = nearby(self.path.parent / "system.rcl", "system.rcl") or "write one, or name it under `contract:`"
            message = f"no contract: there is no .rcl file in {self.path.parent}"
            self.fault("PLAN107", message, self.root.span, hint)
        return found

    def connections(self) -> Iterator[Edge]:
        for piece in self.root.each("connections"):
            entries = piece.entries or {}
            delayed, initial = entries.get("delayed"), entries.get("initial")
            for target in entries["to"].each():
                yield Edge(
                    _endpoint(entries["from"].text),
                    _endpoint(target.text),
                    bool(delayed and delayed.value),
                    _value(initial) if initial is not None else None,
                    span=target.span,
                    initial_span=initial.inner if initial is not None else None,
                )

    def environment(self) -> Iterator[EnvironmentInput]:
        for port, span, piece in self.root.keyed("environment"):
            assume, constant = piece.at("assume"), piece.at("constant")
            if assume is None and constant is not None and constant.entries is not None:
                message = f"environment.{port}: constant has words of its own only beside an assume"
                self.fault("PLAN110", message, constant.span, "write  constant: true ; the entry's words are about it")
            yield EnvironmentInput(
                port,
                assume.text if assume else None,
                piece.said("because"),
                span,
                constant is not None and constant.value is not False,
                piece.said(*(("because",) if assume is None else ("constant", "because"))) or "",
                assume.inner if assume else None,
            )

    def scenario(self) -> Scenario | None:
        if self.root.at("scenario") is None:
            return None
        tables: dict[str, Table] = {}
        for name, _, piece in self.root.keyed("scenario"):
            if name not in RESERVED:
                table = self.table(name, piece)
                if table is not None:
                    tables[name] = table
                else:
                    self.unread.append(name)
        interpret = self.given("interpret", lambda piece: interpretation(piece.text, tables))
        domains = self.given("domains", lambda piece: domain(piece, tables))
        steps = self.root.at("scenario", "steps")
        parts = [
            *(f"table {t.name!r} {t.columns!r} {t.rows!r}" for t in sorted(tables.values(), key=lambda t: t.name)),
            *(f"interpret {port!r} {value!r}" for port, value in sorted(interpret.items())),
            *(f"domain {name!r} {values!r}" for name, values in sorted(domains.items())),
        ]
        deepest = steps.value if steps else None
        return Scenario(
            tuple(tables.values()),
            interpret,
            domains,
            deepest,
            sha256("\n".join([*parts, f"steps {deepest!r}"])),
            sha256("\n".join(parts)),
        )

    def given(self, key: str, read: Callable[[Piece], T]) -> dict[str, T]:
        """What the scenario gives to each name under a key."""
        found: dict[str, T] = {}
        for name, _, piece in self.root.keyed("scenario", key):
            used = " ".join(item.text for item in piece.items or [piece])
            if any(re.search(rf"\b{re.escape(table)}[.(]", used) for table in self.unread):
                continue  # the table's own fault is reported
            try:
                found[name] = read(piece)
            except ValueError as wrong:
                self.fault("PLAN109", f"scenario.{key}.{name}: {wrong}", piece.span)
        return found

    def table(self, name: str, piece: Piece) -> Table | None:
        if piece.items is not None:
            return self.noted(read_rows(name, piece))
        source = piece.at("file") or piece
        path = self.file(source)
        return None if path is None else self.noted(read_csv(name, path, source.span))

    def requirements(self) -> Iterator[Requirement]:
        for name, _, piece in self.root.keyed("requirements"):
            formula, temporal = piece.at("formula"), piece.at("temporal")
            if formula is not None and temporal is not None:
                self.fault("PLAN110", f"{name}: either formula or temporal, not both", temporal.span)
            yield Requirement(
                name,
                piece.said("text") or "",
                piece.said("formula"),
                piece.said("temporal"),
                piece.texts("supported_by"),
                piece.span,
                (formula or temporal or piece).inner,
                self.validation(piece.at("validation")),
                source=piece.said("source") or "",
                probability=self.probability(piece.at("probability")),
            )

    def probability(self, piece: Piece | None) -> Probability | None:
        if piece is None or piece.entries is None:
            return Probability(piece.text) if piece is not None else None
        words, given = piece.words(), piece.at("given")
        return Probability(
            words["at_least"],
            words.get("given", ""),
            int(words.get("steps", 1)),
            "per_run" in words,
            words.get("independent", ""),
            given.inner if given else None,
        )

    def validation(self, piece: Piece | None) -> Validation | None:
        if piece is None:
            return None
        words = piece.words()
        return Validation(**{key: words[key] for key in ("who", "date", "sentence", "formula") if key in words})

    def goals(self) -> Iterator[ComposeGoal]:
        for name, _, piece in self.root.keyed("compose"):
            yield ComposeGoal(name, piece.texts("select"), piece.said("rule"), piece.located(), piece.span)

    def subsystems(self) -> Iterator[Subsystem]:
        for name, span, piece in self.root.keyed("subsystems"):
            folder = piece.at("system")
            path = self.beside(folder) if folder is not None else None
            yield Subsystem(name, piece.texts("nodes"), piece.said("rule"), piece.located(), path, span)

    def beside(self, piece: Piece) -> Path | None:
        """A folder beside the system's, or below it."""
        root = self.path.resolve().parent
        path = inside(root.parent, f"{root.name}/{piece.text}") if not Path(piece.text).is_absolute() else None
        if path is None:
            message = f"the path {piece.text!r} leads out of the folder that holds the system's"
            self.fault("PLAN108", message, piece.span, hint="../other: a system's folder beside this one")
        elif not path.is_dir():
            self.fault("PLAN107", f"there is no folder {piece.text!r} in {self.path.parent}", piece.span)
            return None
        return path

    def nodes(self) -> Iterator[NodePlan]:
        for name, _, piece in self.root.keyed("nodes"):
            methods = self.noted(read_methods(name, piece))
            level = piece.said("criticality") or "medium"
            words = " ".join((piece.said("title") or "").split())
            values = piece.at("parameters")
            given = NOWHERE if values is None else values.located()
            yield NodePlan(name, level, methods, piece.span, words, self.source(name, piece), given)

    def source(self, name: str, piece: Piece) -> Source | None:
        found = self.noted(read_source(name, piece))
        self.files(files_of(piece))
        return found

    def findings(self, key: str) -> Iterator[Finding]:
        for piece in self.root.each(key):
            texts = piece.words()
            self.faults += wrong_words(key, piece)
            matched = piece.at("matched")
            if matched is not None and not is_wild(texts["obligation"]):
                message = f"{key}: {texts['obligation']!r} has no * or ? in it: it matches only what it names"
                self.fault("PLAN110", message, matched.span, hint="leave  matched  out")
            found = piece.at("found")
            if found is not None and is_wild(texts["obligation"]):
                message = f"{key}: {texts['obligation']!r} may stand for several, and  found  marks one finding"
                self.fault("PLAN110", message, found.span, hint="name each obligation by itself")
            said: dict[str, Any] = {"verdict": texts.pop("verdict"), "matched": piece.texts("matched")}
            yield Finding(**{**texts, **said}, span=piece.span)


def _endpoint(text: str) -> Endpoint:
    node, _, port = text.partition(".")
    return Endpoint(node, port)


def _value(piece: Piece) -> str:
    return plain(piece.value) if isinstance(piece.value, bool) else piece.text


def _ros(root: Piece) -> Ros:
    placed = tuple((node, _placed(node, entry)) for node, _, entry in root.keyed("ros", "nodes"))
    return Ros(root.said("ros", "distro"), Resolver(placed))


def _placed(node: str, entry: Piece) -> Placed:
    name = entry.said("name")
    remaps = tuple((old, new.text) for old, _, new in entry.keyed("remap"))
    return Placed(f"/{(name or node).lstrip('/')}", remaps, entry.span, name is not None)
