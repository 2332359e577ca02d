"""Everything that is wrong with a system that cannot be loaded, in one round.

`avow.system.load` stops where later checks would rest on faulty input. Here the rest is examined all the same: a plan
without the pieces whose shape is wrong, a contract as far as it can be read. The faults found are reported; the result
is never verified. Faults that may merely follow from a reported one are left out.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from avow.base.diagnostics import Diagnostic, Rejected, Severity
from avow.base.files import read_regular
from avow.base.records import dataclass
from avow.language.contract import Contract
from avow.language.lexer import KEYWORDS
from avow.system.formulas import check_formulas
from avow.system.graph import dataflow
from avow.system.include import Load, include
from avow.system.launched import started
from avow.system.links import completed
from avow.system.names import check_names
from avow.system.plan import Plan, System
from avow.system.plan_file import read_rest
from avow.system.strict_yaml import Piece
from avow.system.subsystems import check_subsystems, resolved
from avow.system.topics import heard

_WORD = re.compile(r"\w+'*")
_STRING = re.compile(r'"[^"\n]*"|//[^\n]*')
_OF_NAMES = re.compile("RCL[23]")
_QUOTED = re.compile(r"'([^']*)'")
_NODE = re.compile(r"\s*node\b")
_NAMELESS = ("RCL00", "RCL215", "RCL219")
_PATHS = ("PLAN107", "PLAN108")
_CAUSES = ("PLAN105", "ROS101", "ROS111", "ROS104", "DRIVE101")
_PACKAGE = re.compile(r"the package (\w+)")
_TYPE = re.compile(r"\b(\w+)/(?:(?:msg|srv|action)/)?([A-Z]\w*?)(?:_(?:Request|Response|Goal|Result|Feedback))?\b")
_KEY = re.compile(r"\b(\w+)[:`]")


@dataclass(frozen=True, slots=True)
class Rest:
    """The rest of a system: never to be verified."""

    system: System
    is_sound: bool
    """Whether the contract is free of faults; otherwise it is only as much of it as can be read."""
    root: Piece
    told: frozenset[str]
    """Words in faults that are already reported, so that other faults may follow from them."""
    found: tuple[Diagnostic, ...]
    """The faults in the plan's own values, and in the contract."""
    doubtful: frozenset[str] = frozenset()
    """Names of the contract that may be missing only because of a fault in it."""
    wrong: frozenset[tuple[str | int, ...]] = frozenset()
    """The paths of the plan's faulty values."""
    lost: bool = False
    """Whether a declaration has no name of its own: its node cannot be read, or its name is given twice."""
    absent: frozenset[str] = frozenset()
    """The subsystems that could not be included."""

    def may_follow(self, found: Diagnostic, node: str = "") -> bool:
        """Whether a finding (about a node's method) may follow from a reported fault: of the contract, or of a value of
        the plan whose key is its remedy."""
        meant = _KEY.findall(found.hint or "")
        near = (path for path in self.wrong if path[0] != "nodes" or path[1:2] == (node,))
        keys = {[step for step in path if isinstance(step, str)][-1] for path in near}
        return self.lost or not keys.isdisjoint(meant) or not self.doubtful.isdisjoint(_WORD.findall(found.message))


def rest_of(folder: Path) -> Rest | None:
    """None if no plan could be read, even in part, or if it has no contract."""
    from avow.language.load import check_paths, read_in_part

    try:
        plan, root, faults, dropped, wrong = read_rest(folder / "plan.yaml")
    except Rejected:
        return None
    if not plan.contract_files:
        return None
    contract, found = check_paths(plan.contract_files)
    faults += tuple(d for d in found if d.is_error)
    if contract is not None:
        return Rest(System(plan, contract), True, root, dropped, faults, wrong=wrong)
    words = frozenset(word for path in plan.contract_files for word in _WORD.findall(_text(path)))
    part = read_in_part(plan.contract_files)
    lost = any(d.code.startswith(_NAMELESS) or _begins_node(d) for d in found if d.is_error)
    return Rest(System(plan, part), False, root, dropped | words, faults, _doubtful(plan, part, found), wrong, lost)


def every_fault(folder: Path, found: Iterable[Diagnostic], load: Load) -> tuple[Diagnostic, ...]:
    """`found` are the diagnostics of loading the system, `load` the way to the systems that it includes."""
    from avow.language.load import check_paths

    told = list(found)
    rest = rest_of(folder)
    if rest is None:
        if (folder / "plan.yaml").is_file():
            told += [d for d in check_paths(sorted(folder.resolve().glob("*.rcl")))[1] if d.is_error]
        return in_order(told)
    plan, contract, inner = include(rest.system.plan, rest.system.contract, load)
    taken = {subsystem.name for subsystem in plan.subsystems}
    absent = frozenset(subsystem.name for subsystem in rest.system.plan.subsystems) - taken
    rest = replace(rest, system=System(plan, contract), absent=absent)
    return in_order([*told, *rest.found, *inner, *(d for d in _of_names(rest) if not _follows(d, rest))])


def in_order(found: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Each fault once, file by file from top to bottom; a file that is not there once."""
    told = list(without_followers(found))
    absent = {name for d in told if d.code in _PATHS for name in _QUOTED.findall(d.message)[:1]}
    told = [d for d in told if d.code in _PATHS or absent.isdisjoint(re.findall("['`]([^'`]+)['`]", d.message))]
    once = {(d.code, d.span.line if d.span else 0, d.message): d for d in told}
    return tuple(
        sorted(once.values(), key=lambda d: (d.span.file, d.span.line, d.span.column) if d.span else ("", 0, 0))
    )


def without_followers(found: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Leaves out each finding about an undefined type of messages if another finding says why: a faulty definition, two
    names for the type of one topic, or a package that is not there; and what would follow for a port that does not
    exist. A warning that explains an error becomes one."""
    told = list(found)
    causes: dict[str, Diagnostic] = {}
    for code in _CAUSES:
        for d in told:
            if d.code == code and (code != "PLAN105" or d.message.startswith("ros.distro")):
                names = [""] if code == "PLAN105" else _types(d.message)
                causes |= {name: d for name in names if not _explained(name, causes)}
    unknown = {name: d for d in told if d.code == "PLAN106" for name in _QUOTED.findall(d.message)}
    kept: list[Diagnostic] = []
    blamed: set[Diagnostic] = set()
    for d in told:
        why = None
        if d.code == "DRIVE107" or "nothing defines" in d.message or "neither `messages`" in d.message:
            why = next((it for name in _types(d.message) if (it := _explained(name, causes)) is not None), None)
        elif d.code == "ROS133":  # what the code does with the topic cannot be compared
            why = next((it for it in causes.values() if it.code == "ROS104" and it.span == d.span), None)
        elif d.code in ("ROS112", "PLAN113"):
            why = next((it for name, it in unknown.items() if f" {name} " in f" {d.message} "), None)
        if why is None or why.code == d.code:
            kept.append(d)
        elif d.is_error:
            blamed.add(why)
    return tuple(replace(d, severity=Severity.ERROR) if d in blamed else d for d in kept)


def _types(message: str) -> list[str]:
    """The types that a finding names, without the parts of calls; a package alone ends with ``/``."""
    return ["/".join(it) for it in _TYPE.findall(message)] + [f"{package}/" for package in _PACKAGE.findall(message)]


def _explained(name: str, causes: Mapping[str, Diagnostic]) -> Diagnostic | None:
    return next((causes[key] for key in (name, f"{name.partition('/')[0]}/", "") if key in causes), None)


def _doubtful(plan: Plan, part: Contract, found: Iterable[Diagnostic]) -> frozenset[str]:
    """The names in the lines that have a fault; after a syntax error, all names, since its extent is unknown."""
    nodes = {node.name for node in part.nodes}
    errors = [d for d in found if d.is_error]
    names: set[str] = set()
    for path in plan.contract_files:
        lines = _STRING.sub("", _text(path)).splitlines()
        here = [d.span for d in errors if d.span is not None and d.span.file == str(path)]
        if all(_OF_NAMES.match(d.code) for d in errors):
            lines = [line for at, line in enumerate(lines, 1) if any(s.line <= at <= s.end_line for s in here)]
        names |= {word for line in lines for word in _WORD.findall(line)}
    return frozenset(names - nodes - set(KEYWORDS))


def _begins_node(found: Diagnostic) -> bool:
    """Whether the fault lies in the line in which a node begins."""
    if found.span is None:
        return False
    lines = _text(Path(found.span.file)).splitlines()[found.span.line - 1 :]
    return bool(lines) and _NODE.match(lines[0]) is not None


def _of_names(rest: Rest) -> Iterator[Diagnostic]:
    plan, contract = rest.system.plan, rest.system.contract
    yield from check_names(plan, rest.root, contract)
    if not rest.is_sound:
        yield from _syntax(plan)
        return
    plan, unlike = started(plan, contract)
    yield from unlike
    plan, contract, unclear = heard(plan, contract)
    yield from unclear if _linked(plan) else ()
    wrong = check_subsystems(plan, contract)
    yield from wrong
    if wrong or plan.subsystems:
        return  # parts of other systems: their own load says what is wrong with them
    yield from _tried(lambda: resolved(plan, contract)[1])
    yield from _tried(lambda: _of_formulas(plan, contract))


def _of_formulas(plan: Plan, contract: Contract) -> tuple[Diagnostic, ...]:
    system = completed(plan, contract)
    graph = dataflow(system)
    unclear = tuple(d for d in graph.findings if d.is_error) if _linked(plan) else ()
    return unclear + check_formulas(system, graph)


def _linked(plan: Plan) -> bool:
    """Whether the topics' names are known: a broken launch file may remap them."""
    return plan.launched is None or not plan.launched.is_broken


def _syntax(plan: Plan) -> Iterator[Diagnostic]:
    """Formulas of the plan that have syntax errors, whatever the names in them mean."""
    from avow.language.load import syntax_faults

    texts = [(r.formula, r.formula_span) for r in plan.requirements if r.formula]
    texts += [(e.assume, e.assume_span) for e in plan.environment if e.assume]
    for text, span in texts:
        yield from syntax_faults(text, span)


def _tried(look: Callable[[], Iterable[Diagnostic]]) -> Iterable[Diagnostic]:
    try:
        return tuple(look())
    except Rejected as rejected:
        return rejected.diagnostics


def _follows(found: Diagnostic, rest: Rest) -> bool:
    """Whether it misses names that a faulty contract or subsystem may have lost, or that a reported fault concerns."""
    names = _QUOTED.findall(found.message)
    last = [_WORD.findall(name)[-1] for name in names if _WORD.search(name)]
    inner = any(name == sub or name.startswith((f"{sub}.", f"{sub}_")) for name in names for sub in rest.absent)
    return found.code == "PLAN106" and (rest.lost or inner or (bool(last) and set(last) <= rest.told))


def _text(path: Path) -> str:
    try:
        return read_regular(path).decode("utf-8", "replace")
    except OSError:
        return ""
