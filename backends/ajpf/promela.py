"""Agents' programs for Spin: tables of their plans, rules and percepts for `agent.c`, which runs the reasoning cycle
and the scheduler by itself. Of our own interpreter Spin sees nothing, so that its opinion is a second one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from .environment import Environment
from .explore import System
from .interpreter import PRINT, Semantics
from .psl import Atom, Modality
from .syntax import (
    CONS,
    RECEIVED,
    SENT,
    Condition,
    DeedKind,
    GoalKind,
    Program,
    Struct,
    Term,
    Var,
    is_ground,
    named_apart,
    variables,
)
from .tuning import PLAN_VARIABLES, RULE_DEPTH

RUNNER = tuple(
    Path(__file__).with_name(name)
    for name in ("agent.c", "agent_terms.c", "agent_reason.c", "agent_mind.c", "agent_deeds.c")
)
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
    DeedKind.SEND: "SENDS",
}
_ATOMS = {
    Modality.BELIEVES: "B",
    Modality.DID: "D",
    Modality.WANTS: "G",
    Modality.PERCEPT: "P",
    Modality.INTENDS: "I",
    Modality.INTENDS_TO_DO: "T",
}
_NAMES = {
    "PRINT": PRINT,
    "CONS": CONS,
    "SENT": SENT,
    "RECEIVED": RECEIVED,
    "SEND": "send",
    "SUM": "sum",
    "MINUS": "minus",
    "TIMES": "times",
    "DIVIDE": "div",
    "APPEND": "append",
    "TOSTRING": "toString",
}
_QUIESCENCE = {"never": 0, "once": 1, "repeatedly": 2}


class NotTranslated(Exception):  # noqa: N818 - it names a state, not a fault
    """Something in the program has no translation; the text names it."""


@dataclass(slots=True)
class _Tables:
    """Patterns by their numbers; a variable is known by its number in its plan. `parts` are tables that others name."""

    names: dict[str, int] = field(default_factory=dict)
    patterns: dict[tuple[int, int, bool, tuple[int, ...]], int] = field(default_factory=dict)
    parts: list[str] = field(default_factory=list)
    variables: int = 1
    arguments: int = 4

    def name(self, functor: str) -> int:
        return self.names.setdefault(functor, len(self.names))

    def pattern(self, term: Term, scope: dict[str, int]) -> int:
        key: tuple[int, int, bool, tuple[int, ...]]
        if isinstance(term, Var):
            number = scope.setdefault(term.name, len(scope))
            self.variables = max(self.variables, len(scope))
            if number >= PLAN_VARIABLES:
                raise NotTranslated(f"more than {PLAN_VARIABLES} variables in one plan")
            key = (-1, 0, False, (number,))
        else:
            args = tuple(self.pattern(arg, scope) for arg in term.args)
            self.arguments = max(self.arguments, len(args))
            key = (self.name(term.functor), len(args), is_ground(term), args)
        return self.patterns.setdefault(key, len(self.patterns))

    def part(self, kind: str, rows: Sequence[str], empty: str) -> str:
        """The name of a table of its own."""
        name = f"part_{len(self.parts)}"
        self.parts.append(f"static const {kind} {name}[] = {_table(rows, empty)};")
        return name

    def conditions(self, conditions: Sequence[Condition], scope: dict[str, int]) -> tuple[int, str]:
        """How many there are, and their table."""
        rows = [self.condition(c, scope) for c in conditions if c.term is not None or c.group or c.is_cut]
        return len(rows), self.part("Cond", rows, "{0}")

    def condition(self, c: Condition, scope: dict[str, int]) -> str:
        if c.is_cut:
            return "{CUT, 0, 1, -1, 0, 0}"
        if c.group:
            number, name = self.conditions(c.group, scope)
            return f"{{GROUP, 0, 0, -1, {number}, {name}}}"
        assert c.term is not None
        what = "BELIEF"
        if c.is_goal:
            what = "GOAL"
        elif c.test is not None:
            what = "LESS" if c.test == "<" else "SAME"
        elif isinstance(c.term, Struct) and c.term.functor == SENT:
            what = "TOLD"
        return f"{{{what}, {self.pattern(c.term, scope)}, {int(c.positive)}, {_kind(c.goal)}, 0, 0}}"


def header(system: System, wanted: Sequence[Atom]) -> str:
    """The tables of `agent.c`: of the agents, their environment and what properties ask. Raises NotTranslated."""
    tables, environment = _Tables(), system.environment
    macros = {name: tables.name(text) for name, text in _NAMES.items()}
    plans: list[str] = []
    agents = [_agent(tables, agent.program, plans) for agent in system.agents]
    percepts, rows = _environment(tables, environment)
    places = {agent.program.name: at for at, agent in enumerate(system.agents)}
    said = [
        f"{{'{_ATOMS[a.modality]}', {places.get(a.agent, 0)}, {tables.pattern(named_apart(a.term), {})}}}"
        for a in wanted
    ]
    for fair in environment.fair:
        percept = tables.pattern(fair.percept, {})
        said += [f"{{'W', 0, {percept}}}", f"{{'F', 0, {percept}}}"]
    after = [0, *(tables.name(action) for action in sorted(environment.after))]
    quiet = [tables.name(action) for action in sorted(environment.quiet)]
    sizes = macros | {
        "NAGENTS": len(agents),
        "NGROUPS": max(1, len(environment.groups)),
        "NAFTER": len(environment.after),
        "NQUIET": len(quiet),
        "NNAMES": len(tables.names),
        "NPATS": max(1, len(tables.patterns)),
        "NATOMS": max(1, len(said)),
        "AT_START": int(environment.at_start),
        "QUIESCENCE": _QUIESCENCE[environment.at_quiescence],
        "PROBED": int(system.probed),
        "EDGE": int(system.semantics is Semantics.EDGE),
        "FAIR": int(bool(environment.fair)),
        "MAXVARS": tables.variables + 1,
        "MAXARGS": tables.arguments + 1,
        "MAXDEPTH": RULE_DEPTH,
        "MAXFREE": 64,
        "MAXFRAMES": 64,
        "MAXQUEUE": 128,
        "MAXGOALS": 64,
        "MAXBEL": 256 + 2 * max(len(agent.program.beliefs) for agent in system.agents),
    }
    patterns = [f"{{{f}, {n}, {int(g)}, {_braced(args or (0,))}}}" for f, n, g, args in tables.patterns]
    names = ", ".join(f'"{_escaped(name)}"' for name in tables.names)
    return "\n".join(
        [
            "#ifndef AGENT_H",
            "#define AGENT_H",
            *(f"#define {name} {value}" for name, value in sizes.items()),
            "enum { ACT, ADDBEL, DROPBEL, ADDGOAL, DROPGOAL, WAITS, WAITSNOT, LOCKS, UNLOCKS, SENDS };",
            "enum { BELIEF, GOAL, TOLD, LESS, SAME, GROUP, CUT };",
            "typedef struct { int functor, n, ground, args[MAXARGS]; } Pat;",
            "typedef struct Cond { int what, pat, positive, kind, n; const struct Cond *group; } Cond;",
            "typedef struct { int what, pat, kind; unsigned long long live; } Deed;",
            "typedef struct { int head, n; const Cond *body; } Rule;",
            "typedef struct { int drop, isgoal, kind, loose, trigger, nguard, n;",
            "  const Cond *guard; const Deed *deeds; } Plan;",
            "typedef struct { int name, first, last, nbeliefs, ngoals, nrules;",
            "  const int *beliefs, (*goals)[2]; const Rule *rules; } Agent;",
            "typedef struct { int what, agent, pat; } Said;",
            "typedef struct { int mind[NAGENTS], mail[NAGENTS], last; short now[NGROUPS];",
            "  unsigned char awake[NAGENTS], turn, whose, changed, begun, waited, over, drawn, up; } S;",
            "int says(const S *, int), ways(const S *);",
            "void go(S *, int);",
            "#define HERE (&now.s)",  # Spin takes no calls in conditions, and does not look into macros
            *(f"#define SAYS_{at} says(HERE, {at})" for at in range(len(said))),
            *(f"#define MORE_{way} (ways(HERE) > {way})" for way in range(most_ways(system))),
            f"static const char *const names[] = {{{names}}};",
            f"static const Pat pats[] = {_table(patterns, '{0}')};",
            *tables.parts,
            f"static const Plan plans[] = {_table(plans, '{0}')};",
            f"static const Agent agents[] = {_table(agents, '{0}')};",
            f"static const int after[] = {_table(map(str, after), '0')};",
            f"static const int quiet[] = {_table(map(str, quiet), '0')};",
            f"static const Said atoms[] = {_table(said, '{0}')};",
            percepts,
            rows,
            "#endif",
            "",
        ]
    )


def _agent(tables: _Tables, program: Program, plans: list[str]) -> str:
    """An agent's row; its plans are added to those of all."""
    first = len(plans)
    known = tables.part("int", [str(tables.pattern(belief, {})) for belief in program.beliefs], "0")
    goals = [f"{{{tables.pattern(goal.term, {})}, {_kind(goal.kind)}}}" for goal in program.goals]
    wanted = f"part_{len(tables.parts)}"
    tables.parts.append(f"static const int {wanted}[][2] = {_table(goals, '{0, 0}')};")
    rules = []
    for rule in program.rules:
        scope: dict[str, int] = {}
        head = tables.pattern(rule.head, scope)
        number, body = tables.conditions(rule.body, scope)
        rules.append(f"{{{head}, {number}, {body}}}")
    ruled = tables.part("Rule", rules, "{0}")
    for plan in program.plans:
        scope = {}
        trigger = tables.pattern(plan.event.term, scope)
        number, guard = tables.conditions(plan.guard, scope)
        deeds: list[str] = []
        live = 0
        bare = (DeedKind.LOCK, DeedKind.UNLOCK)
        terms = [-1 if d.kind in bare else tables.pattern(d.term, scope) for d in plan.deeds]
        for deed, term in zip(reversed(plan.deeds), reversed(terms), strict=True):
            live |= sum(1 << scope[name] for name in set(variables(deed.term)) if name in scope)
            deeds.insert(0, f"{{{_DEEDS[deed.kind]}, {term}, {_kind(deed.goal)}, {live}ULL}}")
        listed = tables.part("Deed", deeds, "{0}")
        event = f"{int(plan.event.sign == '-')}, {int(plan.event.is_goal)}, {_kind(plan.event.goal)}"
        loose = int(not is_ground(plan.event.term))
        plans.append(f"{{{event}, {loose}, {trigger}, {number}, {len(deeds)}, {guard}, {listed}}}")
    sizes = f"{first}, {len(plans)}, {len(program.beliefs)}, {len(goals)}, {len(rules)}"
    return f"{{{tables.name(program.name)}, {sizes}, {known}, {wanted}, {ruled}}}"


def most_ways(system: System) -> int:
    """The most successors that a state has."""
    most, environment = 1, system.environment
    for narrowed in ({}, environment.start, *environment.after.values()):
        ways = 1
        for name, group in environment.groups:
            ways *= len(narrowed.get(name, group))
        most = max(most, ways)
    return most * len(system.agents)


def _environment(tables: _Tables, environment: Environment) -> tuple[str, str]:
    groups = [[-1 if p is None else tables.pattern(p, {}) for p in words] for _, words in environment.groups] or [[-1]]
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


def _kind(kind: GoalKind | None) -> int:
    return -1 if kind is None else int(kind is GoalKind.ACHIEVE)


def _table(rows: Iterable[str], empty: str) -> str:
    return f"{{{', '.join(rows) or empty}}}"


def _braced(items: Iterable[object]) -> str:
    return f"{{{', '.join(map(str, items))}}}"


def _escaped(name: str) -> str:
    """For a C string. Octal escapes have three digits, whatever follows."""
    return "".join(chr(b) if chr(b).isalnum() and b < 128 else f"\\{b:03o}" for b in name.encode())
