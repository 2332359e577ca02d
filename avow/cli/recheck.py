"""``avow recheck``: only the kernel, over the certificates of the last runs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import click

from avow.assurance.naming import short
from avow.assurance.rates import RateView, misstated
from avow.base.codec import Foreign, Unreadable, document, from_json, parsed
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import read_regular
from avow.base.plain import listed
from avow.base.records import dataclass
from avow.base.workspace import system_folder
from avow.calculus.certificates import scope_of
from avow.calculus.induction import with_lemmas
from avow.calculus.variables import frame
from avow.calculus.wiring import wiring
from avow.cli.options import ContractArgument, PathArgument, json_option
from avow.evidence.claims import Reestablished
from avow.kernel.certificate import Certificate, How
from avow.kernel.check import Kernel, Refused
from avow.kernel.statements import Claimed, statements
from avow.solving.apart import Both, versions
from avow.system.load import load_path


@dataclass(frozen=True, slots=True)
class _Kernel(Foreign):
    certificates: Mapping[str, Certificate]
    established: tuple[Reestablished, ...] = ()


@dataclass(frozen=True, slots=True)
class _Requirement(Foreign):
    id: str
    rate: RateView | None = None


@dataclass(frozen=True, slots=True)
class _Report(Foreign):
    """The parts of a report that are used here."""

    kernel: _Kernel
    requirements: tuple[_Requirement, ...] = ()


@dataclass(frozen=True, slots=True)
class Unfounded:
    scope: str
    claim: str
    established: bool
    why: str


@dataclass(frozen=True, slots=True)
class Founded:
    """An established claim, with the number of solvers and of hypotheses."""

    scope: str
    claim: str
    established: bool
    solvers: int
    hypotheses: int
    vacuous: bool
    key: str


@click.command()
@click.argument("path", metavar="SYSTEM", type=ContractArgument())
@click.argument("certificates", type=PathArgument(exists=True, dir_okay=False))
@json_option()
def command(path: Path, certificates: Path, as_json: bool) -> int:
    """Establish again what certificates say of a system, with nothing but the kernel, Z3, and cvc5 where it is here.

    SYSTEM is a system's name or folder; CERTIFICATES a file certificates.json of its artifacts, or report.json.
    Code 1 where a claim is not established from contract and plan as they are, where a label is not that of
    the claims under it, and where a failure rate does not follow from its samples; code 2 where there is nothing to
    establish.
    """
    claims = (How.SHOWN, How.POSSIBLE)
    system = load_path(path if path.is_dir() else system_folder(str(path)))
    wired = wiring(frame(system))
    known = statements(wired)
    names = {(s.node, s.digest): s.name for s in known.every}
    assumed = {(s.node, s.digest) for s in known.every if s.kind is Claimed.ASSUMPTION}
    try:
        kept = parsed(read_regular(certificates))
        whole = isinstance(kept, dict) and "kernel" in kept
        report = from_json(_Report, kept) if whole else None
        proofs = {(p.scope, p.key): p.obligation for p in (report.kernel.established if report else ())}
        found = report.kernel.certificates if report else from_json(dict[str, Certificate], kept)
    except (OSError, Unreadable) as error:
        raise Rejected(Diagnostic("CLI005", f"{certificates} holds no certificates: {error}")) from error
    if not any(entry.how in claims for certificate in found.values() for entry in certificate.entries):
        raise Rejected(Diagnostic("CLI005", f"{certificates} holds no certificates: no claim is shown in it"))
    scopes: dict[str, set[str]] = {}
    for claim in known.every:
        if (label := scope_of(claim)) is not None:
            scopes.setdefault(claim.digest, set()).add(label)
    told: list[Unfounded | Founded] = []

    def refuse(scope: str, claim: str, why: str) -> None:
        told.append(Unfounded(scope, claim, False, why))
        if not as_json:
            click.echo(f"refused      {scope}: {claim and claim + ': '}{why}")

    with Both() as solvers:
        for scope, certificate in found.items():
            every = known
            if certificate.lemmas:
                every = statements(with_lemmas(wired, system.contract, certificate.lemmas))
            lemmas = {s.digest for s in every.every} - {s.digest for s in known.every}
            shown = [e for e in certificate.entries if e.how in claims and not e.node and e.digest not in lemmas]
            unlike = certificate.scope != scope or any(scope not in scopes.get(e.digest, ()) for e in shown)
            if unlike or (certificate.entries and not shown and " " in scope):
                refuse(scope, "", "its label is not that of the claims in it")
            kernel = Kernel(every, certificate, solvers)
            for i, entry in enumerate(certificate.entries):
                if entry.how not in claims or entry.digest in lemmas:
                    continue
                called = ".".join(part for part in (entry.node, names.get((entry.node, entry.digest), "?")) if part)
                try:
                    # as in a report: what an assumption's questions name is a claim of its own here
                    true = kernel.establish(i, alone=(entry.node, entry.digest) in assumed)
                except Refused as why:
                    refuse(scope, called, str(why))
                    continue
                rests_on = len(true.hypotheses)
                told.append(Founded(scope, called, True, true.solvers, rests_on, true.vacuous, true.key))
                if as_json:
                    continue
                rests = f"on {rests_on} hypotheses" + (", vacuous" if true.vacuous else "")
                of = proofs.pop((scope, true.key), "")
                of = f", in the report {short(of)}" if of else ""
                click.echo(f"certified-{true.solvers}  {scope}: {called}, {rests}, key {true.key[:12]}{of}")
    for requirement in report.requirements if report else ():
        if requirement.rate and (wrong := misstated(requirement.rate)):
            refuse(f"requirement {requirement.id}", "failure rate", wrong)
    if as_json:
        click.echo(document({"claims": told, "solvers": dict(versions())}))
    else:
        if proofs:  # a loop's key is of several claims
            names_of = listed([short(name) for name in proofs.values()])
            click.echo(f"proofs of the report without a line (they are of several claims together): {names_of}")
        click.echo(", ".join(f"{name} {version}" for name, version in versions().items()))
    return 0 if all(claim.established for claim in told) else 1
