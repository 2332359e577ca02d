"""An agent's program for Spin: tables of its plans, rules and percepts for `agent.c`, which runs the reasoning cycle by
itself. Of our own interpreter Spin sees nothing, so that its opinion is a second one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from .builtin import COMPUTING
from .environment import Environment
from .psl import Atom, Modality
from .syntax import Condition, DeedKind, GoalKind, Program, Struct, Term, Var, is_ground

RUNNER = tuple(Path(__file__).with_name(name) for name in ("agent.c", "agent_mind.c", "agent_deeds.c"))
_DEEDS = {
    DeedKind.ACTION: "ACT",
    DeedKind.ADD_BELIEF: "ADDBEL",
    DeedKind.DROP_BELIEF: "DROPBEL",
    DeedKind.ADD_GOAL: "ADDGOAL",
    DeedKind.DROP_GOAL: "DROPGOAL",
    DeedKind.WAIT: "WAITS",
    DeedKind.WAIT_NOT: "WAITSNOT",
    DeedKind.LOCK: "LOCKS",
    DeedKind.UNLOCK: "UNLOCKS",
}
_ATOMS = {Modality.BELIEVES: "B", Modality.DID: "D", Modality.WANTS: "G", Modality.PERCEPT: "P"}
_QUIESCENCE = {"never": 0, "once": 1, "repeatedly": 2}


class NotTranslated(Exception):  # noqa: N818 - it names a state, not a fault
    """Something in the program has no translation; the text names it."""


@dataclass(slots=True)
class _Tables:
    """Patterns by their numbers; a variable is known by its number in its plan."""

    names: dict[str, int] = field(default_factory=dict)
    patterns: dict[tuple[int, int, tuple[int, ...]], int] = field(default_factory=dict)
    variables: int = 1
    arguments: int = 1

    def name(self, functor: str) -> int:
        return self.names.setdefault(functor, len(self.names))

    def pattern(self, term: Term, scope: dict[str, int]) -> int:
        key: tuple[int, int, tuple[int, ...]]
        if isinstance(term, Var):
            number = scope.setdefault(term.name, len(scope))
            self.variables = max(self.variables, len(scope))
            key = (-1, 0, (number,))
        else:
            args = tuple(self.pattern(arg, scope) for arg in term.args)
            self.arguments = max(self.arguments, len(args))
            key = (self.name(term.functor), len(args), args)
        return self.patterns.setdefault(key, len(self.patterns))

    def conditions(self, conditions: Sequence[Condition], scope: dict[str, int]) -> str:
        rows = []
        for c in conditions:
            if c.term is None or c.test is not None or c.group or c.is_cut:
                raise NotTranslated("a comparison, a cut or a denied group")
            if isinstance(c.term, Struct) and c.term.functor.startswith("."):
                raise NotTranslated("messages")
            rows.append(f"{{{self.pattern(c.term, scope)}, {int(c.positive)}, {int(c.is_goal)}, {_kind(c.goal)}}}")
        return _table(rows, "{0, 1, 0, -1}")


def header(program: Program, environment: Environment, wanted: Sequence[Atom], *, probed: bool) -> str:
    """The tables of `agent.c`. Raises NotTranslated."""
    tables = _Tables()
    known = [_fact(tables, belief) for belief in program.beliefs]
    goals = [f"{{{_fact(tables, goal.term)}, {_kind(goal.kind)}}}" for goal in program.goals]
    rules, plans, parts = [], [], []
    for at, rule in enumerate(program.rules):
        if not is_ground(rule.head):
            raise NotTranslated("a reasoning rule with variables in its head")
        parts.append(f"static const Cond body_{at}[] = {tables.conditions(rule.body, {})};")
        rules.append(f"{{{_fact(tables, rule.head)}, {len(rule.body)}, body_{at}}}")
    for at, plan in enumerate(program.plans):
        scope: dict[str, int] = {}
        trigger = tables.pattern(plan.event.term, scope)
        if isinstance(plan.event.term, Struct) and plan.event.term.functor.startswith("."):
            raise NotTranslated("messages")
        parts.append(f"static const Cond guard_{at}[] = {tables.conditions(plan.guard, scope)};")
        deeds = []
        for deed in plan.deeds:
            if deed.kind not in _DEEDS or (isinstance(deed.term, Struct) and deed.term.functor in COMPUTING):
                raise NotTranslated("messages, or actions that compute")
            bare = deed.kind in (DeedKind.LOCK, DeedKind.UNLOCK)
            term = -1 if bare else tables.pattern(deed.term, scope)
            deeds.append(f"{{{_DEEDS[deed.kind]}, {term}, {_kind(deed.goal)}}}")
        parts.append(f"static const Deed deeds_{at}[] = {_table(deeds, '{0, 0, 0}')};")
        loose = int(not is_ground(plan.event.term))
        kind = f"{_kind(plan.event.goal)}, {loose}"
        event = f"{int(plan.event.sign == '-')}, {int(plan.event.is_goal)}, {kind}, {trigger}"
        plans.append(f"{{{event}, {len(plan.guard)}, {len(deeds)}, guard_{at}, deeds_{at}}}")
    percepts, rows = _environment(tables, environment)
    said = []
    for atom in wanted:
        if atom.modality not in _ATOMS:
            raise NotTranslated("intentions")
        said.append(f"{{'{_ATOMS[atom.modality]}', {tables.pattern(_apart(atom.term), {})}}}")
    after = [0, *(tables.name(action) for action in sorted(environment.after))]
    quiet = [tables.name(action) for action in sorted(environment.quiet)]
    sizes = {
        "PRINT": tables.name("print"),
        "NGROUPS": max(1, len(environment.groups)),
        "NBELIEFS": len(known),
        "NGOALS": len(goals),
        "NRULES": len(rules),
        "NPLANS": len(plans),
        "NAFTER": len(environment.after),
        "NQUIET": len(quiet),
        "AT_START": int(environment.at_start),
        "QUIESCENCE": _QUIESCENCE[environment.at_quiescence],
        "PROBED": int(probed),
        "MAXVARS": tables.variables + 1,
        "MAXARGS": tables.arguments + 1,
        "MAXTERMS": 15_000,
        "MAXFRAMES": 16,
        "MAXQUEUE": 48,
        "MAXGOALS": 24,
        "MAXBEL": 64 + 2 * len(known),
    }
    patterns = [f"{{{f}, {n}, {{{', '.join(map(str, args)) or '0'}}}}}" for f, n, args in tables.patterns]
    names = ", ".join(f'"{_escaped(name)}"' for name in tables.names)
    return "\n".join(
        [
            "#ifndef AGENT_H",
            "#define AGENT_H",
            *(f"#define {name} {value}" for name, value in sizes.items()),
            "enum { ACT, ADDBEL, DROPBEL, ADDGOAL, DROPGOAL, WAITS, WAITSNOT, LOCKS, UNLOCKS };",
            "typedef struct { int functor, n, args[MAXARGS]; } Pat;",
            "typedef struct { int pat, positive, isgoal, kind; } Cond;",
            "typedef struct { int what, pat, kind; } Deed;",
            "typedef struct { int head, n; const Cond *body; } Rule;",
            "typedef struct { int drop, isgoal, kind, loose, trigger, nguard, n;",
            "  const Cond *guard; const Deed *deeds; } Plan;",
            "typedef struct { int what, pat; } Said;",
            "typedef struct { short nb, bel[MAXBEL], ng, goal[MAXGOALS], nq, q[MAXQUEUE], cur, last, now[NGROUPS];",
            "  unsigned char seen[MAXBEL], planned, fresh, begun, asleep, waited, over, up; } S;",
            "int says(const S *, int), ways(const S *);",
            "void go(S *, int);",
            "#define HERE (&now.s)",  # Spin takes no calls in conditions, and does not look into macros
            *(f"#define SAYS_{at} says(HERE, {at})" for at in range(len(said))),
            *(f"#define MORE_{way} (ways(HERE) > {way})" for way in range(most_ways(environment))),
            f"static const char *const names[] = {{{names}}};",
            f"static const Pat pats[] = {_table(patterns, '{0}')};",
            *parts,
            f"static const Rule rules[] = {_table(rules, '{0}')};",
            f"static const Plan plans[] = {_table(plans, '{0}')};",
            f"static const int beliefs[] = {_table(map(str, known), '0')};",
            f"static const int goals[][2] = {_table(goals, '{0}')};",
            f"static const int after[] = {_table(map(str, after), '0')};",
            f"static const int quiet[] = {_table(map(str, quiet), '0')};",
            f"static const Said atoms[] = {_table(said, '{0}')};",
            percepts,
            rows,
            "#endif",
            "",
        ]
    )


def most_ways(environment: Environment) -> int:
    """The most successors that a state has."""
    most = 1
    for narrowed in ({}, environment.start, *environment.after.values()):
        ways = 1
        for name, group in environment.groups:
            ways *= len(narrowed.get(name, group))
        most = max(most, ways)
    return most


def _environment(tables: _Tables, environment: Environment) -> tuple[str, str]:
    groups = [[-1 if p is None else _fact(tables, p) for p in words] for _, words in environment.groups] or [[-1]]
    width = max(map(len, groups))
    percepts = _braced(map(_braced, groups))
    everything = {name: tuple(range(len(words))) for name, words in environment.groups}
    rows = [everything, *(environment.after[a] for a in sorted(environment.after)), everything, environment.start]
    options = [[{**everything, **row}[name] for name, _ in environment.groups] or [(-1,)] for row in rows]
    longest = 1 + max(len(places) for row in options for places in row)
    cells = _braced(_braced(_braced((len(places), *places)) for places in row) for row in options)
    return (
        f"static const int percepts[NGROUPS][{width}] = {percepts};",
        f"static const int options[][NGROUPS][{longest}] = {cells};",
    )


def _fact(tables: _Tables, term: Term) -> int:
    if not is_ground(term):
        raise NotTranslated("a belief or a goal with a variable")
    return tables.pattern(term, {})


def _apart(term: Term, names: list[int] | None = None) -> Term:
    """Each ``_`` a variable of its own."""
    names = [] if names is None else names
    if isinstance(term, Var):
        names.append(0)
        return Var(f"?{len(names)}")
    return Struct(term.functor, tuple(_apart(arg, names) for arg in term.args))


def _kind(kind: GoalKind | None) -> int:
    return -1 if kind is None else int(kind is GoalKind.ACHIEVE)


def _table(rows: Iterable[str], empty: str) -> str:
    return f"{{{', '.join(rows) or empty}}}"


def _braced(items: Iterable[object]) -> str:
    return f"{{{', '.join(map(str, items))}}}"


def _escaped(name: str) -> str:
    """For a C string. Octal escapes have three digits, whatever follows."""
    return "".join(chr(b) if chr(b).isalnum() and b < 128 else f"\\{b:03o}" for b in name.encode())
