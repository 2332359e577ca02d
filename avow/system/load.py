"""From a folder (or bare .rcl files) to a checked `System`: where every later stage starts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.remembered import Shelf
from avow.base.suggestions import nearby
from avow.base.tuning.sizes import SYSTEMS_WITHIN
from avow.language.contract import Contract
from avow.system.faults import every_fault
from avow.system.formulas import check_formulas
from avow.system.graph import dataflow
from avow.system.include import Load, include, still_open
from avow.system.launched import started
from avow.system.links import completed
from avow.system.names import check_names
from avow.system.parameters import with_parameters
from avow.system.plan import Plan, System
from avow.system.plan_file import bare_plan, read_plan
from avow.system.strict_yaml import Piece
from avow.system.subsystems import check_subsystems, resolved
from avow.system.topics import heard

PLAN_FILE = "plan.yaml"


def load_system(folder: Path, shelf: Shelf | None = None) -> System:
    """The system whose plan.yaml is in `folder`. A folder without a plan but with .rcl files is a bare system. `shelf`:
    the cache of what the nodes declare.

    Raises Rejected with every fault found in the plan, in the contract, and in the systems that it includes.
    """
    known: dict[Path, System] = {}
    try:
        return _load(folder, (), known, shelf)
    except Rejected as rejected:
        load = _parts((folder.resolve(),), known, shelf)
        raise Rejected(*every_fault(folder, rejected.diagnostics, load)) from None


def _load(folder: Path, within: tuple[Path, ...], known: dict[Path, System], shelf: Shelf | None) -> System:
    """`within`: the folders of the systems that include this one; `known`: those already loaded."""
    path = folder / PLAN_FILE
    if not path.is_file():
        if path.is_symlink() and not path.exists():
            hint = "mend the link, or give the plan's text a file of its own"
            raise Rejected(Diagnostic("PLAN100", f"{path} is a link that leads nowhere", hint=hint))
        if path.exists() or not folder.is_dir():
            raise Rejected(
                Diagnostic("PLAN100", f"there is no folder {folder} with a {PLAN_FILE}", hint=nearby(folder))
            )
        files = sorted(folder.glob("*.rcl"))
        if not files:
            raise Rejected(Diagnostic("PLAN100", f"{folder} holds neither a {PLAN_FILE} nor an .rcl file"))
        return load_bare(files, folder.resolve().name, shelf)
    plan, root, faults = read_plan(path, shelf=shelf)
    contract, more = _contract(plan.contract_files, shelf)
    faults += more
    if contract is None:
        raise Rejected(*faults)
    return _linked(folder, plan, root, faults, contract, within, known, shelf)


def load_texts(path: Path, text: str, contract: Contract | None = None) -> System:
    """The system that a plan's file would describe if it had this `text` and its files declared `contract`; by default,
    what they declare now.

    Raises Rejected, with the faults that stop the loading.
    """
    plan, root, faults = read_plan(path, text)
    if contract is None:
        contract, more = _contract(plan.contract_files, None)
        if contract is None:
            raise Rejected(*faults, *more)
    return _linked(path.parent, plan, root, faults, contract, (), {}, None)


def _linked(
    folder: Path,
    plan: Plan,
    root: Piece,
    faults: tuple[Diagnostic, ...],
    contract: Contract,
    within: tuple[Path, ...],
    known: dict[Path, System],
    shelf: Shelf | None,
) -> System:
    """The system of a plan and its contract; `faults` are those of the plan's values."""
    plan, contract, more = include(plan, contract, _parts((*within, folder.resolve()), known, shelf))
    faults += more
    if any(fault.is_error for fault in more):
        raise Rejected(*faults)
    plan, more = started(plan, contract)
    faults += more
    plan, contract, more = with_parameters(plan, contract)
    faults += more
    if any(fault.is_error for fault in faults):
        raise Rejected(*faults)
    plan, contract, more = heard(plan, contract)
    faults += more
    wrong = check_subsystems(plan, contract)
    faults += (*wrong, *check_names(plan, root, contract))
    if not wrong:
        plan, more = resolved(plan, contract)
        faults += more
    if any(fault.is_error for fault in faults):
        raise Rejected(*faults)
    system = completed(plan, contract)
    graph = dataflow(system)
    system = still_open(system, graph)
    faults += tuple(fault for fault in graph.findings if fault.is_error) + check_formulas(system, graph)
    if any(fault.is_error for fault in faults):
        raise Rejected(*faults)
    return system


def _parts(chain: tuple[Path, ...], known: dict[Path, System], shelf: Shelf | None) -> Load:
    """How a system loads those that it includes; `chain`: the folders of those that include it, and its own."""

    def part(inner: Path) -> System:
        if inner in chain:
            shown = " → ".join(name.name for name in (*chain[chain.index(inner) :], inner))
            raise Rejected(Diagnostic("PLAN110", f"systems take in one another: {shown}"))
        if len(chain) > SYSTEMS_WITHIN:
            raise Rejected(Diagnostic("PLAN110", f"systems are taken in to more than {SYSTEMS_WITHIN} levels"))
        if inner not in known:
            known[inner] = _load(inner, chain, known, shelf)
        return known[inner]

    return part


def load_bare(files: Sequence[Path], name: str | None = None, shelf: Shelf | None = None) -> System:
    """The system of some .rcl files without a plan: names link. Raises Rejected."""
    contract, faults = _contract(tuple(files), shelf)
    if contract is None:
        raise Rejected(*faults)
    plan = bare_plan(name or (files[0].stem if files else "system"), tuple(files))
    plan, contract, _ = with_parameters(plan, contract)
    plan, contract, wrong = heard(plan, contract)
    if wrong:
        raise Rejected(*wrong)
    return System(plan, contract)


def load_path(path: Path) -> System:
    """A folder or an .rcl file, as commands take it. Raises Rejected."""
    return load_system(path) if path.is_dir() else load_bare((path,))


def _contract(files: tuple[Path, ...], shelf: Shelf | None) -> tuple[Contract | None, tuple[Diagnostic, ...]]:
    from avow.language.load import load_contract  # the grammar is slow to import

    if not files:
        return None, ()
    try:
        return load_contract(files, shelf), ()
    except Rejected as rejected:
        return None, rejected.diagnostics
