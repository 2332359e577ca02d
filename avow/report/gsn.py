"""The argument for other tools: GSN in modules as gsn2x reads them, and the same tree as CAE."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from avow.assurance.answers import How
from avow.assurance.model import Case
from avow.assurance.modules import node_modules, requirement_modules
from avow.assurance.relied import stands
from avow.base.verdict import said
from avow.evidence.status import weigh
from avow.report.layout import yaml_text

_Elements = dict[str, dict[str, Any]]


def render_gsn(case: Case) -> str:
    """`gsn` as YAML, a document for each module."""
    return "---\n".join(map(yaml_text, gsn(case)))


def gsn(case: Case) -> tuple[_Elements, ...]:
    """The modules: the system with all suppositions, each requirement, each node. Elements have one name in all of
    them, so that a goal of another module (an away goal) is named by its own."""
    suppositions = {s.number: f"A{at}" for at, s in enumerate(case.suppositions, 1)}
    goal_of_node = {node.name: f"G{at}" for at, node in enumerate(case.nodes, 1 + len(case.requirements) + 1)}
    whole: _Elements = {
        "module": {"name": f"system-{case.system}", "brief": case.title},
        "G1": {"text": f"{case.title}\n{case.answers.told}"},
        "C1": {"text": f"Policy {case.policy.name}: {case.policy.title}"},
    }
    whole["G1"]["inContextOf"] = ["C1"]
    documents = []
    counter = _Counter(1 + len(case.requirements) + len(case.nodes))
    names = {}
    for at, module in enumerate(requirement_modules(case), 2):
        r = module.requirement
        goal, strategy = f"G{at}", counter.next("S")
        names[r.id] = goal
        elements: _Elements = {"module": {"name": f"requirement-{r.id}", "brief": r.words}}
        elements[goal] = {"text": f"{r.id} [{r.how}]\n{r.words}"}
        away = [goal_of_node[node] for node, _, _ in module.away]
        if away:
            elements[goal]["supportedBy"] = [strategy]
            elements[strategy] = {"text": module.strategy, "supportedBy": away}
        else:
            elements[goal]["undeveloped"] = True
        context = [suppositions[number] for number in module.supposes]
        if r.formal:
            formula = counter.next("C")
            elements[formula] = {"text": r.formal}
            context.append(formula)
        if module.conditions:
            reason = counter.next("J")
            elements[reason] = {"text": f"Composition: {module.conditions}"}
            context.append(reason)
        if context:
            elements[goal]["inContextOf"] = context
        documents.append(elements)
    for node in node_modules(case):
        goal = goal_of_node[node.node.name]
        elements = {"module": {"name": f"node-{node.node.name}", "brief": node.node.title}}
        elements[goal] = {"text": f"What {node.node.title} guarantees"}
        if not node.guarantees:
            elements[goal]["undeveloped"] = True
        below = []
        for view in node.guarantees:
            one = counter.next("G")
            below.append(one)
            elements[one] = {"text": f"{view.obligation.name} [{stands(view)}]\n{view.obligation.claim}"}
            solutions = []
            for record in view.records:
                solution = counter.next("Sn")
                solutions.append(solution)
                elements[solution] = {"text": f"{record.method} [{weigh(record).status.word}]\n{record.summary}"}
            elements[one] |= {"supportedBy": solutions} if solutions else {"undeveloped": True}
        if below:
            elements[goal]["supportedBy"] = below
        documents.append(elements)
    for s in case.suppositions:
        whole[suppositions[s.number]] = {"text": f"{s.number} ({s.sort})\n{s.words}"}
    whole["G1"] |= {"supportedBy": ["S1"]} if names else {"undeveloped": True}
    if names:
        whole["S1"] = {"text": "Argument over each requirement", "supportedBy": list(names.values())}
    return whole, *documents


def render_cae(case: Case) -> str:
    """`cae` as YAML."""
    return yaml_text(_quoted(cae(case)))


def cae_rows(case: Case) -> Iterator[tuple[int, str, str, str, str]]:
    """The elements of `cae` as they are read: depth, name, kind, text, and what else is said of it. What is under a
    claim follows it where the claim stands first; where it stands again its kind is ``see``."""
    elements = cae(case)
    seen: set[str] = set()
    todo = [(0, "claim-system")]
    while todo:
        depth, name = todo.pop()
        body = elements[name]
        kind = name.partition("-")[0]
        text = str(body.get("text") or body.get("kind", ""))
        if name in seen:
            yield depth, name, "see", text, ""
            continue
        seen.add(name)
        notes = [said(str(body["verdict"]))] if "verdict" in body else []
        notes += [f"side-warrant: {body['side_warrant']}"] if "side_warrant" in body else []
        notes += [f"supposes {', '.join(body['supposes'])}"] if "supposes" in body else []
        notes += ["open"] if "open" in body else []
        yield depth, name, kind, text, "; ".join(notes)
        below = body.get("argued_by", ()) if kind == "claim" else body.get("from", ())
        todo += [(depth + 1, one) for one in reversed(below)]


def cae(case: Case) -> _Elements:
    """Claims, arguments, evidence. What a tool derived is a decomposition, what a person says a substitution, a record
    is incorporated as evidence; conditions of the composition are the side-warrant. An element's name begins with its
    kind and with what it is of, so that no requirement and no node can be called as another element."""
    found: _Elements = {
        "claim-system": {"text": case.title, "verdict": case.answers.told, "argued_by": ["argument-system"]},
        "argument-system": {
            "kind": "decomposition",
            "supports": ["claim-system"],
            "from": [f"claim-requirement-{r.id}" for r in case.requirements],
        },
    }
    for module in requirement_modules(case):
        r = module.requirement
        found[f"claim-requirement-{r.id}"] = {
            "text": r.words,
            "verdict": r.how.value,
            "argued_by": [f"argument-requirement-{r.id}"],
        }
        found[f"argument-requirement-{r.id}"] = {
            "kind": "decomposition" if r.formal else "substitution",
            "supports": [f"claim-requirement-{r.id}"],
            "from": [f"claim-node-{node}" for node, _, _ in module.away],
            **({"side_warrant": module.conditions} if module.conditions else {}),
            **({"supposes": list(module.supposes)} if module.supposes else {}),
            **({"open": True} if r.how is How.OPEN else {}),
        }
    for node in node_modules(case):
        name = node.node.name
        clauses = [f"claim-guarantee-{name}.{view.obligation.name}" for view in node.guarantees]
        found[f"claim-node-{name}"] = {
            "text": f"What {node.node.title} guarantees",
            "argued_by": [f"argument-node-{name}"],
        }
        found[f"argument-node-{name}"] = {
            "kind": "decomposition",
            "supports": [f"claim-node-{name}"],
            "from": clauses,
        }
        for view, claim in zip(node.guarantees, clauses, strict=True):
            records = [f"evidence-{name}.{view.obligation.name}-{r.method}" for r in view.records]
            records = list(dict.fromkeys(records))
            argument = f"argument-guarantee-{name}.{view.obligation.name}"
            found[claim] = {
                "text": view.obligation.claim,
                "verdict": view.standing.value,
                "argued_by": [argument],
            }
            found[argument] = {
                "kind": "evidence incorporation",
                "supports": [claim],
                "from": records,
            }
            for record in view.records:
                found[f"evidence-{name}.{view.obligation.name}-{record.method}"] = {
                    "text": record.summary,
                    "verdict": weigh(record).status.value,
                }
    for s in case.suppositions:
        found[f"supposition-{s.number}"] = {"text": s.words, "sort": s.sort.value}
    return found


def _quoted(elements: _Elements) -> Mapping[str, Mapping[str, Any]]:
    """Names as JSON strings, which YAML takes for what they are, whatever they hold."""
    from avow.report.layout import quoted

    def every(value: Any) -> Any:
        return [quoted(item) for item in value] if isinstance(value, list) else value

    return {quoted(name): {key: every(value) for key, value in body.items()} for name, body in elements.items()}


class _Counter:
    """Fresh names: goals go on after those of requirements and nodes."""

    def __init__(self, goals: int) -> None:
        self.last = {"G": goals, "S": 1, "Sn": 0, "C": 1, "J": 0}

    def next(self, kind: str) -> str:
        self.last[kind] += 1
        return f"{kind}{self.last[kind]}"
