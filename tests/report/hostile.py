"""A case in which every text tries to get out of where it is put."""

from __future__ import annotations

from dataclasses import replace

from assurance.sample import RUN, case, evidence, guarantee, node_plan, obligation, system

from avow.assurance.model import Case, Derivation, SideCondition
from avow.base.files import sha256
from avow.base.verdict import Counterexample, Verdict
from avow.evidence.obligation import SYSTEM_LEVEL, Kind
from avow.system.plan import EnvironmentInput, Finding, Requirement

NAME = (
    "</script><script>alert(1)</script><img src=x onerror=alert(2)>\"'`{{ 7*7 }}{% raw %}${x}#{x}]]>--><!-- */ "
    '\\input{/etc/passwd} \\end{document} $\\write18{ls}$ #eval("1") @import =1+1 | \x00\x01\x0b \u2028 \u202e ∀ 𝔹 é\n'
    "- item\n# head\n: yaml\t&amp;"
)
"""What a name, a sentence or a formula of contract and plan may hold."""
EVIL = NAME + "\ud800"
"""What a tool may say: half a character, too."""
SOURCE_PATH = "contracts/rover/system.rcl"
SOURCE = (
    f'// {NAME}\r\n/* {NAME} */ node n{{ guarantee("{NAME}" TRUE) }}\n'
    "// ``` fence ``````\n// \u202e code that looks like a comment \u2066\n" + "x" * 30_000 + "\n\n</pre></div>\ta\rb\n"
) * 3
"""A contract whose comments try the same."""


def hostile_case() -> Case:
    node, clause = "n\"'></script><b>'", "g' onload=alert(3) x='{{1}}"
    target = guarantee(node, clause, NAME, NAME)
    side = obligation(SYSTEM_LEVEL, Kind.COMPOSITION, NAME, NAME, NAME)
    example = Counterexample(((EVIL, EVIL),), EVIL, (((EVIL, EVIL),), ((EVIL, EVIL),)), 0)
    record = evidence(
        target,
        Verdict.REFUTED,
        counterexample=example,
        summary=EVIL,
        hypotheses=(EVIL,),
        bound={EVIL: EVIL},
        details={"outline": EVIL, "mutation": EVIL},
        command=(EVIL,),
        inputs={NAME: "0" * 64},
        tool=EVIL,
    )
    subject = system(
        {node: [clause]},
        title=NAME,
        plans=[node_plan(node, "high", "hoare")],
        requirements=[Requirement("R" + NAME, NAME, NAME, None, (NAME, node))],
        environment=[EnvironmentInput(NAME, NAME, NAME)],
        expected=[Finding("*", "refuted", NAME, method=NAME)],
        accepted=[Finding("*/guarantee/*", "refuted", NAME, NAME, "2026-11-01")],
    )
    derivation = Derivation(NAME, NAME, NAME, NAME, (node,), (SideCondition(NAME, side.id),), (NAME,))
    return case(
        subject,
        [target, side],
        [record, evidence(side, method="compose")],
        run=replace(RUN, command=NAME, limits={NAME: NAME}),
        derivations=[derivation],
        digests={NAME: "0" * 64, SOURCE_PATH: sha256(SOURCE)},
        sources={SOURCE_PATH: SOURCE, "plan\"'><b>.yaml": NAME},
        graph_svg="<svg xmlns='http://www.w3.org/2000/svg'><script>alert(4)</script></svg>",
    )
