"""The formula checker, part five: local definitions, checked where they stand and written out where they are used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from avow.base.tuning.sizes import DECLARED_PARTS, NESTING, REFERENCES_AHEAD
from avow.language.check_history import Histories
from avow.language.contract import Definition
from avow.language.definitions import expand
from avow.language.limits import term_extent
from avow.language.scope import Defined
from avow.language.subterms import subterms
from avow.language.syntax import Syntax, TermSyntax
from avow.language.terms import History, Term


class Definitions(Histories):
    """Definitions of the scope."""

    def defined(self, tree: Syntax, name: str, arguments: Sequence[TermSyntax]) -> Term | None:
        entry, scope = self.scope.defined[name], self.scope
        if scope.bare and (name in scope.inputs or name in scope.outputs):
            role = "in" if name in scope.inputs else "out"
            message = f"`{name}` is a definition, and an {role}put of node `{scope.node}`"
            hint = f"write `{role}.{name}` for that; to speak of the other, rename one of them"
            self.error("RCL202", message, tree, hint=hint)
            return None
        definition = self.definition(entry, tree)
        given = self.arguments(tree, arguments, [p.sort for p in entry.parameters], name)
        if definition is None or given is None:
            return None
        if not self.scope.remembers and any(isinstance(part, History) for part in subterms(definition.body)):
            self.error("RCL322", f"`{name}` speaks of other steps than this one, and there is one here only", tree)
            return None
        return expand(definition, given, self.span(tree), lambda other: self.scope.taken(other) is not None)

    def definition(self, entry: Defined, use: Syntax | None = None) -> Definition | None:
        """What is defined, checked once in this node; None where that is in error, which is reported."""
        tree, reports = entry.tree, entry.reports
        if tree is None or reports is None or entry.state == "done":
            return entry.found
        name = tree.name
        if entry.state == "open":
            reports.error("RCL212", f"the definition of `{name.text}` refers to itself", name.start, name.end)
            return None
        if sum(other.state == "open" for other in self.scope.defined.values()) > REFERENCES_AHEAD:
            message = f"`{name.text}` stands at the end of a row of {REFERENCES_AHEAD} definitions that refer to others"
            reports.error("RCL110", message, name.start, name.end, hint="define a name by fewer others")
            entry.state = "done"
            return None
        entry.state, before = "open", len(reports.found)
        scope = replace(
            self.scope,
            bound={p.name: p for p in entry.parameters},
            broken=set(self.scope.broken),
            remembers=True,
            bare=entry.bare,
        )
        body = type(self)(scope, reports).term(tree.body)
        entry.state = "done"
        if use is not None and not entry.bare and len(reports.found) > before:
            note = (f"it is used in node `{self.scope.node}` here", self.span(use))
            reports.found[before:] = [replace(d, notes=(*d.notes, note)) for d in reports.found[before:]]
        if body is None:
            return None
        size, depth = term_extent(body)
        if size > DECLARED_PARTS or depth > NESTING:
            most = f"{size:,} parts" if size > DECLARED_PARTS else f"{depth} levels"
            message = f"`{name.text}` has {most} once all the names in it are written out"
            hint = f"{DECLARED_PARTS:,} parts and {NESTING} levels are the most"
            reports.error("RCL110", message, name.start, name.end, hint=hint)
            return None
        text = reports.source.text[tree.start : tree.end]
        entry.found = Definition(name.text, entry.parameters, body, text, reports.source.span(name.start, name.end))
        return entry.found
