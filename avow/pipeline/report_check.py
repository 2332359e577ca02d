"""Does a report on disk say what the ledger says?

It checks, each step on its own: every record that the report quotes is in the ledger, unchanged, and the ledger has no
other record that counts, no other refutation and no newer one; every conclusion (status, gate, exit code) follows from
those records; the kernel establishes its share from the certificates in the report; the contracts' texts have the
digests that the report names; every other format equals, byte for byte, what the case renders to; `avow.recount`, which
shares no code with the rest, recomputes each number of the first page. Contract and plan are compared by digest if the
files are here; changed files of the evidence are reported (`stale`) and are no difference from the ledger. It
cannot know whether the obligations are still those of today's contract: `avow verify` does.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from avow.assurance.case import conclude, conclude_again
from avow.assurance.codec import from_json, to_json
from avow.assurance.facts import facts_of_case
from avow.assurance.history import kept_records
from avow.assurance.model import Case
from avow.assurance.signed import KEYS, newest_signed, read_signed
from avow.base import codec
from avow.base.codec import Unreadable
from avow.base.diagnostics import Rejected
from avow.base.files import digest_file, read_regular, sha256
from avow.base.tuning.shown import DIFF_REASONS
from avow.base.workspace import WRITTEN_ON_DEMAND
from avow.calculus.certificates import Certificates
from avow.calculus.composition import compose
from avow.calculus.obligations import reestablished
from avow.evidence.currency import as_of_now, changed, changed_since, not_established
from avow.evidence.envelope import unseal_lines
from avow.evidence.ledger import Ledger
from avow.kernel.certificate import Certificate
from avow.pipeline.work import engine_works
from avow.recount import recount
from avow.report import ATTESTATION, formats, left_over
from avow.report.on_demand import rendered
from avow.solving.apart import Both
from avow.system.load import PLAN_FILE, load_system


def check(folder: Path, ledger: Ledger | None, root: Path | None = None) -> tuple[str, ...]:
    """Every way in which the report in `folder` differs from the ledger, in words; nothing where it agrees.

    Without a ledger it checks only the report's own consistency, and reports that.
    """
    try:
        case = from_json(codec.parsed(read_regular(folder / "report.json")))
    except (OSError, ValueError) as error:
        return (f"report.json cannot be read: {error}",)
    keys = sorted((root / "signed" / KEYS).glob("*.pub")) if root is not None else []
    found = [*_conclusions(case), *_texts(case), *_formats(case, folder, keys), *_recounted(folder)]
    found += [_NO_LEDGER] if ledger is None else _ledger(case, ledger, root)
    if root is not None:
        found += [*_sources(case, root), *_signature(case, root), *_kernel(case, root)]
    elif case.kernel.established:
        found.append("the contracts are not here: what the kernel established cannot be established again")
    return tuple(found)


def stale(case: Case, root: Path) -> tuple[str, ...]:
    """The changed files, under `root` or outside it, among the inputs of evidence that counts: the report agrees with
    the ledger, but shows an earlier state."""
    counting = [r for view in case.obligations for r in view.records]
    marks = {pair for record in counting for pair in record.inputs.items()}
    seen = {path for record in counting for path in changed(record, root)}
    return tuple(sorted(seen | {path for path, mark in marks if _digest(root / path) != mark}))


def outdated(case: Case, path: Path, root: Path) -> tuple[str, ...]:
    """Why a report is not current: its ledger at `path` differs, an input of the report or of its evidence has changed,
    or contract and plan, if they are here, have other claims. Raises OSError if the ledger cannot be read."""
    here = _folder(case, root).is_dir()
    files = {name for name, mark in case.digests if here and _digest(root / name) != mark}
    found = [f"{name} has changed since the report was made" for name in sorted(files | set(stale(case, root)))]
    return (*found, *differences(case, path, root), *(asked_otherwise(case, root) if here and not found else ()))


def asked_otherwise(case: Case, root: Path) -> tuple[str, ...]:
    """The claims about contract, plan and scenario that are others than those that the report answers, or are asked by
    another version of the engines; at most a few. No method is asked: nothing is executed."""
    try:
        works = engine_works(load_system(_folder(case, root)))
    except (OSError, Rejected) as error:
        return (f"contract or plan cannot be read: {error}",)
    planned = {(view.id, method): key for view in case.obligations for method, key in view.planned}
    keys = {(name, work.method): key for work in works for name, key in work.keys.items()}
    changed = sorted({name for (name, _), key in keys.items() - planned.items()})
    return tuple(
        f"{name} is another question now (contract, plan, scenario or engine)" for name in changed[:DIFF_REASONS]
    )


def _folder(case: Case, root: Path) -> Path:
    """Where the system's plan is, or would be."""
    made_of = sorted((Path(path).name != PLAN_FILE, path) for path, _ in case.digests)
    return (root / made_of[0][1]).parent if made_of else root


def differences(case: Case, path: Path, root: Path) -> tuple[str, ...]:
    """Every way in which a case differs from the ledger at `path`, in the words of `check`. Raises OSError if the
    ledger cannot be read."""
    if not path.exists():
        return (_NO_LEDGER,)
    ledger = Ledger(path)
    ledger.records()
    return tuple(_ledger(case, ledger, root))


_NO_LEDGER = "there is no ledger to compare with"


def _digest(path: Path) -> str:
    try:
        return digest_file(path)
    except (OSError, ValueError):
        return ""


def _conclusions(case: Case) -> Iterable[str]:
    try:
        again = to_json(conclude_again(case))
    except (ValueError, KeyError, OverflowError) as error:
        yield f"the case cannot be concluded again: {error}"
        return
    stated = to_json(case)
    for name, value in stated.items():
        if again[name] != value:
            yield f"report.json: '{name}' does not follow from the evidence in it{_where(value, again[name])}"


def _texts(case: Case) -> Iterable[str]:
    """Contracts and plan as the report shows them, against the digests that it names."""
    named = dict(case.digests)
    for source in case.sources:
        if source.path not in named:
            yield f"report.json: the text of {source.path} is shown, but no digest of it is named"
        elif named[source.path] != sha256(source.text.encode("utf-8", "surrogatepass")):
            yield f"report.json: the text of {source.path} is not the one whose digest is named"


def _where(stated: object, again: object) -> str:
    """The first item of two lists that differs, by its id."""
    if isinstance(stated, list) and isinstance(again, list):
        for one, other in zip(stated, again, strict=False):
            if one != other and isinstance(one, dict) and isinstance(other, dict):
                parts = [key for key in one if one[key] != other.get(key)]
                name = one.get("id") or one.get("obligation", {})
                shown = (
                    name if isinstance(name, str) else "/".join(str(name.get(k, "")) for k in ("node", "kind", "name"))
                )
                detail = ", ".join(f"{key} says {one[key]!r}, but is {other.get(key)!r}" for key in parts[:1])
                return f": {shown}: {detail}"[:400]
    if isinstance(stated, str | int | bool) and isinstance(again, str | int | bool):
        return f": it says {stated!r}, but is {again!r}"
    return ""


def _formats(case: Case, folder: Path, keys: Sequence[Path]) -> Iterable[str]:
    made = dict(formats(case))
    for name in left_over(folder, made):
        yield f"{name} is a page of no node in report.json"
    for name, content in made.items():
        path = folder / name
        data = content.encode()
        try:
            found = read_regular(path)
            same = found == data
            if not same and name == ATTESTATION:  # signed: compare the content of the envelopes
                same = unseal_lines(found.decode("utf-8", "replace"), keys).encode() == data
        except OSError as error:
            yield f"{name} cannot be read: {error.strerror}"
            continue
        if not same:
            yield f"{name} is not what the case in report.json renders to"
    for name in (name for name in WRITTEN_ON_DEMAND if (folder / name).exists()):
        try:
            if read_regular(folder / name) != rendered(case, name):
                yield f"{name} is not what the case in report.json renders to"
        except (OSError, Rejected) as error:
            yield f"{name} cannot be compared here: {error}"


def _recounted(folder: Path) -> Iterable[str]:
    """Numbers of the first page that its facts do not bear out, as a checker has it that shares no code with it."""
    try:
        return [f"index.html: {line}" for line in recount(folder)]
    except (OSError, ValueError, LookupError) as error:
        return [f"index.html cannot be recounted: {error}"]


def _ledger(case: Case, ledger: Ledger, root: Path | None) -> Iterable[str]:
    try:
        entries = ledger.records()
    except OSError as error:
        yield f"the ledger cannot be read: {error.strerror}"
        return
    for damage in ledger.damage:
        yield f"ledger line {damage.line} {damage.reason}"
    known = {entry.hash: entry for entry in entries}
    now = {entry.hash: entry for entry in (as_of_now(ledger, root) if root is not None else entries)}
    quoted = {item.entry.hash: item.entry for view in case.obligations for item in view.evidence}
    quoted |= {entry.hash: entry for entry in case.orphans}
    for mark, entry in quoted.items():
        where = f"record {entry.number + 1} ({entry.evidence.obligation}, {entry.evidence.method})"
        if mark not in known:
            yield f"the report quotes {where}, which the ledger does not hold"
        elif entry not in (known[mark], now[mark]) and not (
            # supporting records that no longer count cannot improve a verdict
            entry.evidence.verdict.supports and entry in (not_established(known[mark]), changed_since(known[mark]))
        ):
            again = entry == changed_since(known[mark])  # what it read is again as it was
            how = "as of an earlier state, and it counts now" if again else "otherwise than the ledger has it"
            yield f"the report quotes {where} {how}"
    planned = {(view.id, method): key for view in case.obligations for method, key in view.planned}
    needed = kept_records(entries, [view.obligation for view in case.obligations], planned)
    newer = [entry for mark, entry in known.items() if mark not in quoted and mark in needed]
    if newer:
        first = newer[0].evidence
        what = f"{first.obligation}, {first.method}"
        anew = f"`doit report:{case.system}` renders it again"
        yield f"the ledger has {len(newer)} record(s) that the report does not show ({anew}); first: {what}"
    if newer:
        return
    if case.ledger_head != ledger.head:
        yield "the report names another ledger head than the ledger's"
    left_out = sum(mark not in quoted for mark in known)
    if case.left_out != left_out:
        yield f"the report says that it leaves out {case.left_out} records of the ledger: it does {left_out}"


def _kernel(case: Case, root: Path) -> Iterable[str]:
    """Checks what the report credits to the kernel, from its certificates and the contracts here."""
    if not case.kernel.established:
        return
    try:
        composition = compose(load_system(_folder(case, root)))
        if composition.frame.system.name != case.system:
            yield f"report.json: it names the contract of another system than {case.system}"
            return
        kept = codec.from_json(dict[str, Certificate], case.kernel.certificates)
    except (OSError, Rejected, Unreadable) as error:
        yield f"what the kernel established cannot be established again: {error}"
        return
    with Both() as solvers:
        certificates = Certificates(composition, kept, solvers=solvers)
        for told in case.kernel.established:
            found = reestablished(certificates, told.obligation)
            if found is None or (found.key, found.scope) != (told.key, told.scope):
                yield f"report.json: the kernel does not establish {told.obligation} from the certificate in it"
            elif found.solvers < told.solvers and solvers.second is not None:
                yield f"report.json: {told.obligation}: {found.solvers} of {told.solvers} solvers answer"


def _signature(case: Case, root: Path) -> Iterable[str]:
    """The signature that the report is compared with, against the file."""
    if (said := case.baseline) is not None and read_signed(root / "signed" / case.system / said.name) != said:
        yield f"the report names a signature of {said.who} that is not, or not so, in signed/{case.system}/{said.name}"


def signed_now(case: Case, root: Path) -> str:
    """Whether the newest signature is of this case, in the words of the report's head."""
    newest = newest_signed(root / "signed", case.system)[0]
    return conclude(replace(facts_of_case(case), baseline=newest)).answers.signed


def _sources(case: Case, root: Path) -> Iterable[str]:
    for path, mark in case.digests:
        try:
            if digest_file(root / path) != mark:
                yield f"{path} has changed since the report was made"
        except (OSError, ValueError):
            yield f"{path}, of which the report was made, cannot be read"
