"""``avow sign``: a person's name under a report."""

from __future__ import annotations

from datetime import date, datetime
from pathlib import Path

import click

from avow.assurance.codec import read_case
from avow.assurance.signed import sign_case
from avow.base.codec import document
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import write
from avow.base.persons import unreadable, wrong_day
from avow.base.workspace import find_workspace, report_folder, workspace
from avow.cli.options import PathArgument, json_option
from avow.evidence.envelope import seal_lines
from avow.evidence.ledger import Ledger
from avow.pipeline.report_check import check, stale
from avow.report.exchange import render_attestation


@click.command()
@click.option("--report", "name", required=True, help="A system, or the folder of its report.")
@click.option("--as", "who", required=True, help="Name and role.")
@click.option("--until", required=True, metavar="YYYY-MM-DD", help="The last day on which the signature stands.")
@click.option("--key", type=PathArgument(exists=True, dir_okay=False), help="A private key (`avow audit --new-key`).")
@json_option()
def command(name: str, who: str, until: str, key: object, as_json: bool) -> int:
    """Sign a report: an in-toto statement of its verdict, assumptions and deficits, in signed/SYSTEM/.

    The report has to say what the ledger says (as `avow report --check` does). Later reports tell what changed since.
    Without --key it is a name only. With one, the report's attestations stand beside the signature, each in a DSSE
    envelope on a line of its own (*.attestation.jsonl). Public keys in signed/keys/*.pub make only signatures by these
    keys count.
    """
    folder = report_folder(Path(name))
    place = find_workspace(folder.resolve()) or workspace()
    case = read_case(folder)
    today = datetime.now().astimezone().date()
    if wrong_until := wrong_day(until, past=False):
        raise Rejected(Diagnostic("SIGN005", f"--until: {wrong_until}"))
    last = date.fromisoformat(until)
    if last < today:
        raise Rejected(Diagnostic("SIGN005", f"--until: {until} is past"))
    if why := unreadable(" ".join(who.split())):
        raise Rejected(Diagnostic("SIGN005", f"--as: {who!r} is no person's name: {why}"))
    if bare := [s.number for s in case.assumptions if not s.says]:
        click.echo(f"warning: accepted without plain words: {', '.join(bare)}", err=True)
    if (first := min((s.until for s in case.assumptions if s.until), default=until)) < until:
        click.echo(f"warning: the signature ends on {until}, the first assumption on {first}", err=True)
    ledger = place.ledger(case.system)
    wrong = check(folder, Ledger(ledger) if ledger.exists() else None, place.root)
    wrong += tuple(f"{path} has changed since the evidence was made" for path in stale(case, place.root))
    if wrong:
        more = f" (and {len(wrong) - 1} more; see `avow report --check {folder}`)" if len(wrong) > 1 else ""
        raise Rejected(Diagnostic("SIGN006", f"not signed: {wrong[0]}{more}", hint="run `avow verify` first"))
    private = key if isinstance(key, Path) else None
    try:
        path = sign_case(
            case,
            folder / "report.json",
            place.signed,
            who=" ".join(who.split()),
            until=last,
            today=today,
            private=private,
        )
        if private is not None:
            write(path.with_suffix(".attestation.jsonl"), seal_lines(render_attestation(case), private))
    except OSError as error:
        raise Rejected(Diagnostic("SIGN001", f"the signature cannot be written: {error.strerror}")) from None
    if as_json:
        click.echo(document({"system": case.system, "signed": str(path), "verdict": case.answers.verdict}))
    else:
        click.echo(case.answers.statement)
        for s in case.assumptions:
            click.echo(f"  {s.number} {s.words}")
        click.echo(f"signed as {who}, until {until}: {place.relative(path)}")
        click.echo(f"next: avow report {case.system}   (keep signed/ with the sources)")
    return 0
