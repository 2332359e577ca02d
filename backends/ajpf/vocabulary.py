"""Words that the plan uses of an agent and that neither its program nor its environment ever has: mostly slips of the
pen. They matter most where something is forbidden: what no agent of this program could do is forbidden for nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Severity, Span

from . import psl
from .options import Setup
from .psl import Modality
from .syntax import DeedKind, Struct, Term

_Word = tuple[str, int]
_KINDS = {
    Modality.BELIEVES: "belief",
    Modality.WANTS: "goal",
    Modality.INTENDS: "goal",
    Modality.INTENDS_TO_DO: "action",
    Modality.DID: "action",
    Modality.PERCEPT: "percept",
}


def unknown_words(job: Job, setup: Setup) -> Iterator[Diagnostic]:
    """A warning (AJPF134) for each row, property and entry of the environment file that speaks of such a word."""
    known = _vocabulary(setup)
    places = [(f"the row “{row.text}”", row.formula, row.span) for row in setup.rows]
    places += [(f"the property '{extra.name}'", extra.formula, extra.span) for extra in setup.extras]
    for what, formula, span in places:
        for atom in dict.fromkeys(psl.atoms(formula)):
            kind = _KINDS[atom.modality]
            if _word(atom.term) not in known[kind]:
                yield _warning(what, _word(atom.term), kind, known[kind], span)
    actions = {name for name, _ in known["action"]}
    span = job.method.options.at("environment")
    for action in (*setup.environment.after, *sorted(setup.environment.quiet - {"print"})):
        if action not in actions:
            yield _warning(setup.environment_path.name, (action, 0), "action", known["action"], span)


def _vocabulary(setup: Setup) -> dict[str, set[_Word]]:
    programs = setup.programs
    deeds = [deed for program in programs for plan in program.plans for deed in plan.deeds]

    def done(*kinds: DeedKind) -> Iterable[Term]:
        return (deed.term for deed in deeds if deed.kind in kinds)

    percepts = _words(fact for _, group in setup.environment.groups for fact in group if fact is not None)
    told = _words(deed.term.args[2] for deed in deeds if deed.kind is DeedKind.SEND and isinstance(deed.term, Struct))
    told = told if len(programs) > 1 else set()  # what it is told, an agent may come to believe or want
    sent = {("send", 2)} if any(deed.kind is DeedKind.SEND for deed in deeds) else set()
    heads = (rule.head for program in programs for rule in program.rules)
    beliefs = _words((*(b for program in programs for b in program.beliefs), *heads, *done(DeedKind.ADD_BELIEF)))
    goals = _words((*(goal.term for program in programs for goal in program.goals), *done(DeedKind.ADD_GOAL)))
    actions = _words(done(DeedKind.ACTION)) | sent
    return {"belief": beliefs | percepts | told, "goal": goals | told, "action": actions, "percept": percepts}


def _words(terms: Iterable[Term]) -> set[_Word]:
    return {_word(term) for term in terms if isinstance(term, Struct)}


def _word(term: Struct) -> _Word:
    return term.functor, len(term.args)


def _shown(word: _Word) -> str:
    name, arity = word
    return f"{name}({', '.join('_' * arity)})" if arity else name


def _warning(what: str, word: _Word, kind: str, known: set[_Word], span: Span | None) -> Diagnostic:
    message = f"{what} speaks of the {kind} {_shown(word)}, which neither the program nor the environment ever has"
    hint = f"{kind}s that there are: {', '.join(sorted(map(_shown, known))[:12])}" if known else None
    return Diagnostic("AJPF134", message, span, Severity.WARNING, hint=hint)
