"""Random systems over truth values, and all of their runs: a finite graph, found by trying everything.

A system has delays, circles, constants and other inputs from the environment with and without assumptions about them,
topics with several publishers, clauses that speak of other steps, subsystems and derivations with named rules. A node
keeps its guarantees as long as its assumptions have held; else it may put out anything. What follows here is a reading
of its own of what all that means: nothing of Avow is used but its parser.

Drawn without an aim, formulas contradict one another nearly always, and then nothing is said of the system. So there is
a run that most clauses of a rich system allow: each output and each input from outside has a usual value, and what is
assumed, promised and required says that it has it, mostly under some condition. The others are drawn without an aim.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from random import Random

from drawn.formulas import BOOL, PLAIN, Formulas
from oracle.stepping import Memory, Watch

from avow.language.load import parse_formula
from avow.language.sorts import BOOL as BOOL_SORT

Values = dict[str, bool]
MOST_STATES = 4000
ENVIRONMENT = ("e0", "e1", "c0")
CONSTANT = "c0"
TOPIC = "bus"


class Formula(Watch):
    """A clause as text, and what it says, by its own memory."""

    def __init__(self, text: str) -> None:
        said = re.sub(r"(\w+)\.(\w+)", r"\1_\2", text)
        self.text, self.names = text, frozenset(re.findall(r"\w+\.\w+", text))
        extra = {_word(name): BOOL_SORT for name in self.names}
        super().__init__(parse_formula(said, extra=extra, remembers=True, clause=True))

    def at(self, values: Mapping[str, bool], memory: Iterator[Memory], after: list[Memory]) -> bool:
        """Whether it holds at a step; what it remembers then goes to `after`."""
        held, left = self.step({_word(name): values[name] for name in self.names}, next(memory))
        after.append(left)
        return held

    def __call__(self, values: Mapping[str, bool]) -> bool:
        """Of one that speaks of this step alone."""
        return self.at(values, iter((self.begins,)), [])


def _word(name: str) -> str:
    return name.replace(".", "_")


def formula(random: Random, names: Sequence[str], depth: int = 2, *, remembers: float = 0.0) -> Formula:
    """A formula over some names; with that chance, a part of it speaks of other steps."""
    return Formula(Formulas(random, replace(PLAIN, past=remembers)).formula(depth, dict.fromkeys(names, BOOL)))


def response(random: Random, names: Sequence[str], wanted: str = "") -> Formula:
    """A clause that demands something of later steps."""
    return Formula(Formulas(random, PLAIN).response(1, dict.fromkeys(names, BOOL), wanted))


def says(random: Random, name: str, usual: bool | None) -> Formula:
    """That a value is so, or not; mostly the usual one, if there is one."""
    value = random.random() < 0.5 if usual is None else usual == (random.random() < 0.95)
    return Formula(f"({name} == {str(value).upper()})")


@dataclass(frozen=True)
class Wire:
    """Where an input's value comes from: a node's output (`delayed`: of the step before), the environment, a topic."""

    node: str = ""
    delayed: bool = False
    outside: str = ""
    topic: bool = False


AIMLESS = 0.05
"""How often a clause of a rich system is drawn without an aim."""


class System:
    """Nodes n0, n1, …, each with an output and some inputs. `rich`: with all that a system may have."""

    def __init__(self, seed: int, *, rich: bool = False) -> None:
        random = Random(seed)
        self.rich = rich
        self.nodes = [f"n{k}" for k in range(random.randint(2, 4 if rich else 3))]
        self.initial: dict[str, bool | str | None] = {n: random.choice([True, False, None]) for n in self.nodes}
        self.usual = {name: random.random() < 0.5 for name in (*self.nodes, *ENVIRONMENT) if rich}
        for name in self.nodes:
            if rich and random.random() < 0.8:
                self.initial[name] = self.usual[name]
        self.remembers = random.choice([0.0, 0.3]) if rich else 0.0
        several = rich and len(self.nodes) > 2 and random.random() < 0.3
        self.publishers = random.sample(self.nodes, 2) if several else []
        self.wires: dict[tuple[str, str], Wire] = {}
        self.assumed: dict[str, list[Formula]] = {}
        self.promised: dict[str, list[Formula]] = {}
        for name in self.nodes:
            ports = [self.port(random, name, k) for k in range(random.randint(1, 2))]
            for port, wire in dict(ports).items():
                self.wires[name, port] = wire
            self.assumed[name] = [self.assumption(random, name) for _ in range(random.randint(0, 2))]
            self.promised[name] = [self.promise(random, name) for _ in range(random.randint(1, 2))]
            if rich and random.random() < 0.7:
                self.promised[name][0] = says(random, f"out.o{name}", self.usual[name])
        for name in self.nodes:
            if (name, CONSTANT) in self.wires and random.random() < 0.4:
                self.initial[name] = CONSTANT
        self.outside: dict[str, tuple[Formula | None, bool]] = {}
        for name in sorted({wire.outside for wire in self.wires.values() if rich} & set(ENVIRONMENT)):
            assume = says(random, f"in.{name}", self.usual[name]) if random.random() < 0.6 else None
            if self.remembers and name != CONSTANT and random.random() < 0.4:
                assume = self.demand(random, [f"in.{name}"], f"in.{name}", self.usual[name])
            if assume is not None or name == CONSTANT:
                self.outside[name] = assume, name == CONSTANT
        self.required = [self.requirement(random) for _ in range(2)]
        self.names = ["g0", "g1"]
        self.text, self.plan = self.written(), self.planned(random)

    def port(self, random: Random, name: str, k: int) -> tuple[str, Wire]:
        """An input's name, and where its value comes from."""
        if self.publishers and name not in self.publishers and random.random() < 0.5:
            return "heard", Wire(topic=True)
        source = random.choice([*(n for n in self.nodes if n not in self.publishers), None])
        if source is not None:
            return f"i{k}{name}", Wire(source, source == name or random.random() < 0.4)
        port = random.choice(ENVIRONMENT) if self.rich else f"i{k}{name}"
        return port, Wire(outside=port)

    def inputs_of(self, name: str) -> list[str]:
        return [f"in.{port}" for node, port in self.wires if node == name]

    def assumption(self, random: Random, name: str) -> Formula:
        """About a node's inputs; with an aim, about one whose usual value is known."""
        ins = self.inputs_of(name)
        usual = {f"in.{port}": w.node or w.outside for (n, port), w in self.wires.items() if n == name and not w.topic}
        if not self.usual or not usual or random.random() < AIMLESS:
            return formula(random, ins, 1, remembers=self.remembers)
        port = random.choice(list(usual))
        return self.aimed(random, ins, port, self.usual[usual[port]])

    def promise(self, random: Random, name: str) -> Formula:
        ins, mine = self.inputs_of(name), f"out.o{name}"
        return self.demand(random, [*ins, mine], mine, self.usual.get(name))

    def requirement(self, random: Random) -> Formula:
        ports = [f"{n}.o{n}" for n in self.nodes]
        if not self.rich:
            return formula(random, ports)
        name = random.choice(self.nodes)
        return self.demand(random, ports, f"{name}.o{name}", self.usual[name])

    def demand(self, random: Random, names: Sequence[str], aim: str, usual: bool | None) -> Formula:
        """A clause over some names; with an aim, that one of them has its usual value, now or at later steps."""
        aimed = usual is not None and random.random() >= AIMLESS
        if random.random() < self.remembers / 2:
            return response(random, names, says(random, aim, usual).text if aimed else "")
        return self.aimed(random, names, aim, usual) if aimed else formula(random, names, remembers=self.remembers)

    def aimed(self, random: Random, names: Sequence[str], aim: str, usual: bool | None) -> Formula:
        """That a value is the usual one, mostly under some condition."""
        said = says(random, aim, usual)
        if random.random() < 0.6:
            return said
        return Formula(f"({formula(random, names, 1, remembers=self.remembers).text}) -> {said.text}")

    def written(self) -> str:
        text = ""
        for name in self.nodes:
            clauses = [f"  assume a{k} ( {each.text} )\n" for k, each in enumerate(self.assumed[name])]
            clauses += [
                f"  guarantee {called} ( {each.text} )\n"
                for called, each in zip(self.names, self.promised[name], strict=False)
            ]
            mine = [port for node, port in self.wires if node == name]
            ports = ", ".join(f"{port} : BOOL" for port in mine)
            topics = [f"bool {TOPIC} matches(out.o{name})"] if name in self.publishers else []
            topics += [f"bool {TOPIC} matches(in.{port})" for port in mine if self.wires[name, port].topic]
            outputs = f"outputs( o{name} : BOOL ) topics( {', '.join(topics)} )"
            text += f"node {name} {{ inputs( {ports} ) {outputs}\n{''.join(clauses)}}}\n"
        return text

    def edited(self, random: Random) -> None:
        """Another system, which has much of this one."""
        for _ in range(random.randint(1, 2)):
            name = random.choice(self.nodes)
            match random.randrange(7):
                case 0:
                    self.promised[name][0] = self.promise(random, name)
                case 1:
                    self.assumed[name] = [self.assumption(random, name)]
                case 2:
                    self.initial[name] = random.choice([True, False, None])
                case 3:
                    inner = [at for at, wire in self.wires.items() if wire.node]
                    if inner:
                        node = random.choice([n for n in self.nodes if n not in self.publishers])
                        at = random.choice(inner)
                        self.wires[at] = Wire(node, node == at[0] or random.random() < 0.5)
                case 4:
                    self.names.reverse()
                case 5:
                    self.required.reverse()
                case 6:
                    for port in list(self.outside):
                        if port != CONSTANT and random.random() < 0.7:
                            del self.outside[port]
        self.text, self.plan = self.written(), self.planned(random)

    def first(self, name: str) -> str | None:
        """What the plan says of an output's first value."""
        match self.initial[name]:
            case None:
                return None
            case str() as port:
                return f"out.o{name} <=> in.{port}"
            case value:
                return str(value).upper()

    def planned(self, random: Random) -> str:
        plan = "connections:\n"
        for (name, port), wire in self.wires.items():
            if wire.node:
                first = self.first(wire.node)
                more = f", delayed: true{'' if first is None else f', initial: {first!r}'}" if wire.delayed else ""
                plan += f"  - {{from: {wire.node}.o{wire.node}, to: {name}.{port}{more}}}\n"
        plan = plan if plan.count("\n") > 1 else ""
        if self.outside:
            plan += "environment:\n"
        for port, (assume, constant) in self.outside.items():
            said = [f"assume: {assume.text!r}"] if assume is not None else []
            said += ["constant: true"] if constant else []
            plan += f"  in.{port}: {{{', '.join([*said, 'because: it is'])}}}\n"
        if random.random() < 0.5:
            rule = random.choice(["R1", "R2", "R3", "R4"])
            plan += f"compose: {{D: {{select: [{', '.join(random.sample(self.nodes, 2))}], rule: {rule}}}}}\n"
        if len(self.nodes) > 2 and random.random() < 0.4:
            rule = f", rule: {random.choice(['R1', 'R2', 'R3', 'R4'])}" if self.rich and random.random() < 0.3 else ""
            plan += f"subsystems: {{s: {{nodes: [{', '.join(random.sample(self.nodes, 2))}]{rule}}}}}\n"
        plan += "requirements:\n"
        return plan + "".join(
            f"  R{k}: {{text: t, formula: '{each.text}', supported_by: [{', '.join(self.nodes)}]}}\n"
            for k, each in enumerate(self.required)
        )

    def inputs(self, name: str, before: Values, now: Values, outside: Values, heard: bool) -> Values:
        found = {}
        for (node, port), wire in self.wires.items():
            if node != name:
                continue
            if wire.topic:
                found[f"in.{port}"] = heard
            elif wire.outside:
                found[f"in.{port}"] = outside[wire.outside]
            else:
                found[f"in.{port}"] = (before if wire.delayed else now)[wire.node]
        return found

    def kept_of(self, name: str) -> list[Formula]:
        """A node's clauses, assumptions first."""
        return [*self.assumed[name], *self.promised[name]]

    def begins(self, free: Sequence[str]) -> Iterator[tuple[Values, Values]]:
        """Constants, and what the outputs are before the first step."""
        constants = [port for port in free if self.outside.get(port, (None, False))[1]]
        for chosen in product([False, True], repeat=len(constants)):
            fixed = dict(zip(constants, chosen, strict=True))
            choices = [
                [True, False] if value is None else [fixed[value] if isinstance(value, str) else value]
                for value in (self.initial[n] for n in self.nodes)
            ]
            for last in product(*choices):
                yield fixed, dict(zip(self.nodes, last, strict=True))

    def steps(self, *, granted: bool = False, argued: bool = False) -> Iterator[tuple[Values, Values, Values]]:
        """Every step that some run takes: the outputs at it, whether each assumption (``n0.a0``) and requirement
        (``R0``) holds, and what the environment gives. What the plan assumes of the environment holds. `granted`: and
        what nodes assume of the environment alone, up to that step; `argued`: of inputs that the plan has a reason for.
        Raises OverflowError where there are too many."""
        free = sorted({wire.outside for wire in self.wires.values() if wire.outside})
        clauses = [(n, each) for n in self.nodes for each in self.kept_of(n)]
        given = [(port, each) for port, (each, _) in self.outside.items() if each is not None]
        every = [*(each for _, each in given), *(each for _, each in clauses), *self.required]
        memory = tuple(each.begins for each in every)
        first = [
            (tuple(fixed.items()), tuple(last[n] for n in self.nodes), memory, (True,) * len(self.nodes))
            for fixed, last in self.begins(free)
        ]
        seen, todo = set(first), list(first)
        while todo:
            constants, last, kept_bits, kept = todo.pop()
            fixed, before = dict(constants), dict(zip(self.nodes, last, strict=True))
            changing = [port for port in free if port not in fixed]
            hears = [False, True] if self.publishers else [False]
            for chosen in product([True, False], repeat=len(self.nodes)):
                now = dict(zip(self.nodes, chosen, strict=True))
                for values, heard in product(product([True, False], repeat=len(changing)), hears):
                    if self.publishers and heard not in {now[n] for n in self.publishers}:
                        continue
                    outside = {**fixed, **dict(zip(changing, values, strict=True))}
                    bits, after = iter(kept_bits), list[Memory]()
                    if not min([each.at({f"in.{port}": outside[port]}, bits, after) for port, each in given] or [True]):
                        continue
                    read = {n: self.inputs(n, before, now, outside, heard) for n in self.nodes}
                    held = {
                        n: [each.at({**read[n], f"out.o{n}": now[n]}, bits, after) for each in self.kept_of(n)]
                        for n in self.nodes
                    }
                    met = {n: held[n][: len(self.assumed[n])] for n in self.nodes}
                    if (granted or argued) and any(
                        self.outer(n, each, argued=argued) and not good
                        for n in self.nodes
                        for each, good in zip(self.assumed[n], met[n], strict=True)
                    ):
                        continue
                    still = tuple(was and all(met[n]) for n, was in zip(self.nodes, kept, strict=True))
                    if all(
                        not good or all(held[n][len(self.assumed[n]) :])
                        for n, good in zip(self.nodes, still, strict=True)
                    ):
                        truths = {f"{n}.a{k}": good for n in self.nodes for k, good in enumerate(met[n])}
                        shown = {f"{n}.o{n}": value for n, value in now.items()}
                        truths |= {f"R{k}": each.at(shown, bits, after) for k, each in enumerate(self.required)}
                        yield now, truths, outside
                        state = (constants, chosen, tuple(after), still)
                        if state not in seen:
                            seen.add(state)
                            todo.append(state)
                            if len(seen) > MOST_STATES:
                                raise OverflowError

    def outer(self, name: str, clause: Formula, *, argued: bool = False) -> bool:
        """Whether a clause speaks of the environment alone; `argued`: and the plan says why that may be believed."""
        wires = [self.wires[name, each.removeprefix("in.")] for each in clause.names]
        return all(wire.outside and (wire.outside in self.outside or not argued) for wire in wires)
