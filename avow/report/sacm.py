"""The argument as a structured assurance case: OMG SACM 2.3, as XMI.

A goal is a claim, a strategy the reasoning of an inference, a solution an artifact reference that supports its claim by
evidence, a context or an assumption a claim in context. An assurance claim point is a meta-claim of the evidence's
relationship; a defeater is a counter-inference to it, and is itself defeated if it has an answer.
"""

from __future__ import annotations

from avow.assurance.model import Case
from avow.report.goals import Element, Sort, argument, by_name
from avow.report.page import fill

XMI, SACM = "http://www.omg.org/spec/XMI/20131001", "http://www.omg.org/spec/SACM/2.3"


def render_sacm(case: Case) -> str:
    """One assurance case package: an argument package for each module, an artifact package with the evidence."""
    modules = argument(case)
    elements = by_name(modules)
    return fill("sacm.xml.j2", case=case, xmi=XMI, sacm=SACM, modules=modules, elements=elements, declared=_declared)


def _declared(element: Element) -> str:
    """A claim's declaration in SACM's terms."""
    if element.sort is Sort.ASSUMPTION:
        return "assumed"
    if element.defeated:
        return "defeated"
    return "needsSupport" if element.undeveloped or element.unsupported else "asserted"
