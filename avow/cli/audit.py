"""``avow audit``: is the ledger unchanged, and does everything that it refers to still exist?"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Sequence
from pathlib import Path

import click

from avow.base.codec import document
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.persons import unreadable
from avow.base.plain import invisible, is_blank
from avow.base.suggestions import did_you_mean, suggest
from avow.base.workspace import Workspace, name_of, workspace
from avow.cli.options import PathArgument, json_option
from avow.evidence.audit import Discrepancy, Fault
from avow.evidence.heads import Anchor, Index, index_path, read_index, stated_heads
from avow.evidence.ledger import Ledger, readable
from avow.evidence.signing import Signed, new_key_pair, sign, signature_path, verify_signature
from avow.pipeline.assess import edited_pages
from avow.pipeline.export import edited
from avow.pipeline.integrity import confirm, discrepancies, reported_heads, settle_losses
from avow.pipeline.workload import Survey, survey


@click.command()
@click.argument("systems", metavar="[SYSTEM]...", nargs=-1)
@json_option()
@click.option(
    "--sign",
    "private",
    type=PathArgument(exists=True, dir_okay=False),
    help="Sign each ledger's head with this private key.",
)
@click.option("--key", type=PathArgument(exists=True, dir_okay=False), help="Check signatures against this public key.")
@click.option(
    "--against",
    type=PathArgument(exists=True),
    help="A report, an attestation or a folder of reports, kept elsewhere: the ledgers must hold what it names.",
)
@click.option("--new-key", type=PathArgument(dir_okay=False), help="Make a key pair: FILE, and FILE.pub.")
@click.option(
    "--acknowledge", metavar="REASON", help="You have seen what is lost or damaged of these ledgers: no longer open."
)
@click.option("--as", "who", metavar="NAME", help="Who acknowledges.")
def command(
    systems: tuple[str, ...],
    as_json: bool,
    private: Path | None,
    key: Path | None,
    against: Path | None,
    new_key: Path | None,
    acknowledge: str | None,
    who: str | None,
) -> int:
    """Re-digest everything that the ledger of each SYSTEM (its name or folder; all, if none is named) refers to, and
    compare generated files with what is generated today.

    Exit code 1 if the ledger, a file behind today's evidence or a generated file was edited, or a ledger is not the
    one that the index of ledgers, the reports here or --against know; changed inputs are listed, but only make evidence
    stale.
    A ledger that was cut, rolled back, rewritten or begun anew fails the gate *integrity* until a person, by name,
    says with --acknowledge that it was seen and why it happened.
    """
    if new_key:
        public = new_key_pair(new_key)
        click.echo(f"private key {new_key} (keep it), public key {public}")
        return 0
    place = workspace()
    if acknowledge is not None or who is not None:
        if is_blank(acknowledge or "") or invisible(acknowledge or "") or unreadable((who or "").strip()):
            raise click.UsageError(
                'to acknowledge takes a reason and a name: --acknowledge "disk was lost" --as "A. Name"'
            )
        assert acknowledge is not None
        assert who is not None
        for name in _ledger_names(place, systems, reported_heads(place)):
            for item in settle_losses(place, name, who.strip(), acknowledge.strip()):
                click.echo(f"{name}: acknowledged: {item.text}")
    anchors = (*reported_heads(place), *(_outside_heads(against) if against else ()))
    found = {name: _audit_system(place, name, key, anchors) for name in _ledger_names(place, systems, anchors)}
    index = _audit_index(place, key)
    bad = any(d.serious for ds in (index, *(ds for ds, _ in found.values())) for d in ds)
    if private and not bad:
        for path in _sign_all(place, tuple(found), private):
            click.echo(f"signed: {path}", err=True)
    if as_json:
        listed = {
            name: {"records": count, "discrepancies": discrepancies} for name, (discrepancies, count) in found.items()
        }
        click.echo(document({"systems": listed, "index": index}))
    else:
        for name, (discrepancies, count) in found.items():
            serious = sum(d.serious for d in discrepancies)
            click.echo(f"{name}: {count} records, {serious} discrepanc{'y' if serious == 1 else 'ies'}")
            for d in discrepancies:
                click.echo(f"  {'✘' if d.serious else '·'} {d.fault}: {d.text}")
        for d in index:
            click.echo(f"index of ledgers: {d.fault}: {d.text}")
        if not found and not bad:
            click.echo("no ledger yet: run `avow verify`")
        if private and bad:
            click.echo("not signed: there are discrepancies", err=True)
    return 1 if bad else 0


def _ledger_names(place: Workspace, wanted: Sequence[str], anchors: Sequence[Anchor] = ()) -> tuple[str, ...]:
    """The systems named, or all that have a ledger, or had one according to the index of ledgers and `anchors`. Raises
    Rejected for one that never had any."""
    there = [path.stem for path in place.ledgers.glob("*.jsonl")] if place.ledgers.is_dir() else []
    known = sorted({*there, *_index(place).systems, *(anchor.system for anchor in anchors)})
    wanted = [name_of(place, name) for name in wanted]
    for name in wanted:
        if name not in known:
            hint = did_you_mean(name, known, 3) or suggest(name, known)
            raise Rejected(Diagnostic("LEDGER002", f"there is no ledger of a system '{name}'", hint=hint))
    return tuple(wanted) or tuple(known)


def _outside_heads(path: Path) -> tuple[Anchor, ...]:
    """The ledgers' heads named in a report or attestation that is kept elsewhere. Raises Rejected if it names none."""
    try:
        found = stated_heads(path, "")
    except OSError as error:
        raise Rejected(Diagnostic("REPORT001", f"{path} cannot be read: {error.strerror}")) from None
    if not found:
        raise Rejected(Diagnostic("REPORT002", f"{path} names no ledger: it is no report, and no attestation"))
    return found


def _audit_system(
    place: Workspace, name: str, public_key: Path | None = None, anchors: Sequence[Anchor] = ()
) -> tuple[tuple[Discrepancy, ...], int]:
    """The discrepancies of one system's ledger, and its number of records. Raises Rejected if it cannot be read."""
    ledger, surveyed = Ledger(place.ledger(name)), _surveyed(place, name)
    with readable(ledger.path):
        found = discrepancies(place, ledger, surveyed, anchors, strict=True)
        count = len(ledger.records())
    signature = _signature(place.ledger(name), _head_of(ledger), public_key)
    return (*found, *(_edited(place, surveyed) if surveyed else ()), *signature), count


def _edited(place: Workspace, surveyed: Survey) -> Iterable[Discrepancy]:
    """The edited generated files: people read them instead of the contract and the ledger."""
    paths = [*edited_pages(place, surveyed)]
    for work in surveyed.catalogue.works:
        if not work.is_engine:
            with contextlib.suppress(Rejected):  # a rejection by a backend is an error of the plan: see `avow check`
                paths += edited(place, work)
    for path in paths:
        name = place.relative(path)
        text = f"{name} was edited since it was generated: `avow verify` writes it again"
        yield Discrepancy(Fault.CHANGED, str(name), text)


def _surveyed(place: Workspace, name: str) -> Survey | None:
    for folder in sorted(place.systems(), key=lambda folder: folder.name != name):
        found = survey(folder)
        if isinstance(found, Survey) and found.system.name == name:
            return found
    return None


def _audit_index(place: Workspace, public_key: Path | None = None) -> tuple[Discrepancy, ...]:
    """The discrepancies of the index of ledgers as a whole. Raises Rejected if it cannot be read."""
    path, index = index_path(place.ledgers), _index(place)
    damage = tuple(Discrepancy(Fault.LEDGER, "index", text) for text in index.damage)
    if not index.exists and not public_key:
        return ()
    return (*damage, *_signature(path, Signed("index of ledgers", index.marks), public_key, grows=True))


def _index(place: Workspace) -> Index:
    path = index_path(place.ledgers)
    with readable(path):
        return read_index(path)


def _head_of(ledger: Ledger) -> Signed:
    return Signed(ledger.path.stem, tuple(entry.hash for entry in ledger.records()))


def _signature(file: Path, signed: Signed, public_key: Path | None, grows: bool = False) -> Iterable[Discrepancy]:
    """With a key of the auditor's own, a signature by it must cover everything."""
    path = signature_path(file)
    if not path.exists():
        if public_key:
            yield Discrepancy(Fault.SIGNATURE, path.name, f"{path.name}: it is not signed")
        return
    problem, covered = verify_signature(path, signed, public_key)
    if problem:
        yield Discrepancy(Fault.SIGNATURE, path.name, problem)
    elif covered < len(signed.marks) and not grows:
        text = f"{len(signed.marks) - covered} of {len(signed.marks)} records are newer than the signature"
        yield Discrepancy(Fault.SIGNATURE, path.name, text, serious=bool(public_key))


def _sign_all(place: Workspace, systems: Sequence[str], private_key: Path) -> Iterable[Path]:
    """Sign each system's ledger, and the index of ledgers. Raises Rejected."""
    for name in systems:
        ledger = Ledger(place.ledger(name))
        if ledger.damage:
            raise Rejected(Diagnostic("SIGN002", f"{ledger.path.name} is damaged: it is not signed"))
        yield sign(signature_path(ledger.path), _head_of(ledger), private_key)
        confirm(place, ledger)
    path = index_path(place.ledgers)
    yield sign(signature_path(path), Signed("index of ledgers", _index(place).marks), private_key)
