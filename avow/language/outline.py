"""A file's clauses, found by their keywords and brackets, each then parsed on its own.

This is the recovery of the parser: whatever is wrong inside a clause ends with it, so that all errors of a file are
reported in one run and a broken node does not hide the next. Section keywords are reserved, so they can be trusted to
begin a section even where a bracket before them was never closed.
"""

from __future__ import annotations

from collections.abc import Sequence

from avow.language.contract import ClauseKind
from avow.language.expectations import NEAR_SECTIONS, SECTION_FORMS, about_keyword
from avow.language.lexer import Token
from avow.language.parser import parse
from avow.language.source import Reports
from avow.language.syntax import ClauseSyntax, Declaration, Define, FileSyntax, NodeSyntax, PortList, TopicList

_OPEN = {"LPAR": "RPAR", "LBRACE": "RBRACE"}
_NESTED = {**_OPEN, "LSQUARE": "RSQUARE"}
_CLOSE = frozenset(_OPEN.values())
_TOP = frozenset(("CONTEXT", "NODE"))
_SECTIONS = frozenset(("INPUTS", "OUTPUTS", "TOPICS", "DEFINE", "ASSUME", "GUARANTEE"))
_SIGN = {"LPAR": "(", "RPAR": ")", "LBRACE": "{", "RBRACE": "}"}
_ORDER = {"INPUTS": 0, "OUTPUTS": 1, "TOPICS": 2, "STEPS": 3, "DEFINE": 4, "ASSUME": 5, "GUARANTEE": 6}


def read(tokens: Sequence[Token], reports: Reports) -> FileSyntax:
    """The clauses of a file, with every syntax error in them reported."""
    return _OutlineReader(tokens, reports).file()


class _OutlineReader:
    def __init__(self, tokens: Sequence[Token], reports: Reports) -> None:
        self.tokens = tokens
        self.reports = reports
        self.at = 0
        self.complained = -1
        self.innermost: Token | None = None
        """The bracket that the last search of `balanced` found closed by one of another kind."""
        self.out = FileSyntax()

    # --- looking at tokens -------------------------------------------------------------------------------------------

    def kind(self, ahead: int = 0) -> str:
        at = self.at + ahead
        return self.tokens[at].type if at < len(self.tokens) else "$END"

    def found(self, at: int) -> tuple[str, int, int]:
        """The token at a position in words, and its place."""
        if at >= len(self.tokens):
            end = self.tokens[-1].end if self.tokens else 0
            return "the end of the file", end, end
        token = self.tokens[at]
        return f"`{token.text[:40]}`", token.start, token.end

    def complain(self, code: str, message: str, at: int, hint: str | None = None) -> None:
        words, start, end = self.found(at)
        near = self.tokens[at - 1].start if 0 < at <= len(self.tokens) else start
        if self.reports.is_torn(near, end) or start in self.reports.odd or start == self.complained:
            return  # something stands here that could not be read, which has been said
        self.complained = start
        self.reports.error(code, message.replace("%", words, 1), start, end, hint=hint)

    def no_clause(self, hint: str) -> None:
        self.complain("RCL111", f"`{self.tokens[self.at].text}` is not a clause of RCL", self.at, hint)

    # --- the file ----------------------------------------------------------------------------------------------------

    def file(self) -> FileSyntax:
        contexts = 0
        if not self.tokens and not self.reports.failed:
            self.reports.error("RCL001", "there is no contract here: neither a context nor a node", 0, 0)
        while self.at < len(self.tokens) and not self.reports.full:
            if self.kind() == "CONTEXT":
                contexts += 1
                if contexts > 1:
                    self.complain("RCL112", "a second `context` in one file", self.at, "put all into one `context`")
                self.at += 1
                self.context()
            elif self.kind() == "NODE":
                self.node()
            elif self.kind() == "NAME" and self.tokens[self.at].text.lower() in ("context", "contexts"):
                self.no_clause("write `context`")
                self.at += 1
                self.context()
            elif self.kind() == "NAME" and (
                self.tokens[self.at].text.lower() == "node" or (self.kind(1) == "NAME" and self.kind(2) == "LBRACE")
            ):
                self.no_clause("write `node`")
                self.node()
            elif self.kind() == "NAME" and self.kind(1) == "LBRACE":
                word = self.tokens[self.at].text
                if word in ("types", "constants", "type", "constant"):
                    hint = "types (`Name : type;`) and constants (`Name = value;`) both belong in one `context { … }`"
                    self.no_clause(hint)
                    self.at += 1
                    self.context()
                else:
                    self.complain(
                        "RCL111", "expected `context` or `node` and not %", self.at, f"write `node {word} {{`"
                    )
                    self.at += 1
                    self.skip_block()
            else:
                hint = "a file is one `context { … }` and any number of `node NAME { … }`"
                if self.kind() in _SECTIONS:
                    hint = "this belongs inside a `node NAME { … }`"
                message = "expected `context` or `node` and not %"
                if self.kind() in _CLOSE:
                    message, hint = "% closes nothing", "remove it, or find where a bracket was closed too early"
                self.complain("RCL111", message, self.at, hint)
                self.at += 1
                self.skip_to_top()
        return self.out

    def skip_to_top(self) -> None:
        while self.at < len(self.tokens) and self.kind() not in _TOP:
            if self.kind() == "NAME" and self.kind(1) == "LBRACE":
                return
            self.at += 1

    def skip_block(self) -> None:
        depth = 0
        while self.at < len(self.tokens) and self.kind() not in _TOP:
            depth += (self.kind() == "LBRACE") - (self.kind() == "RBRACE")
            self.at += 1
            if depth <= 0:
                return

    def open_brace(self, what: str) -> Token | None:
        if self.kind() == "LBRACE":
            self.at += 1
            return self.tokens[self.at - 1]
        words, _, _ = self.found(self.at)
        no_name = words in ("`-`", "`.`", "`/`")
        hint = "names are made of letters, digits and `_`" if no_name else f"write `{{` after {what}"
        self.complain("RCL113", f"expected `{{` after {what} and not %", self.at, hint)
        for ahead in range(1, 5):  # what is left of a name that is none
            if self.kind(ahead) in _SECTIONS or (self.kind(ahead) in _TOP and self.kind(ahead - 1) != "MINUS"):
                break
            if self.kind(ahead) == "LBRACE":
                self.at += ahead + 1
                return self.tokens[self.at - 1]
        return None

    # --- context -----------------------------------------------------------------------------------------------------

    def context(self) -> None:
        brace = self.open_brace("`context`")
        count = 0
        while self.at < len(self.tokens) and self.kind() not in _TOP and not self.reports.full:
            if self.kind() == "RBRACE":
                if count == 0 and brace is not None:
                    self.reports.error("RCL114", "this context declares nothing", brace.start, brace.end)
                self.at += 1
                return
            if self.kind() == "SEMICOLON":
                self.complain("RCL113", "% ends nothing here", self.at, "remove it")
                self.at += 1
                continue
            count += 1
            tree = self.declaration(self.out.broken)
            if tree is not None:
                self.out.declarations.append(tree)
        if brace is not None:
            self.reports.error("RCL115", "this `{` is never closed", brace.start, brace.end, hint="close it with `}`")

    def declaration(self, broken: set[str]) -> Declaration | None:
        """The declaration here, to its `;`; of one in error, the names go to `broken`."""
        first, relation = self.at, False
        stack: list[str] = []
        while self.at < len(self.tokens):
            kind = self.kind()
            if kind in _TOP or (kind in _SECTIONS and not (kind == "DEFINE" and self.at == first)):
                break
            if kind == "SEMICOLON" and "RPAR" not in stack:  # also within `{`: that brace lacks its partner
                break
            if kind == "RBRACE" and not stack:
                break
            if kind in ("COLON", "EQUALS", "EQ") and not stack and self.tokens[first].type != "DEFINE":
                if relation and self.kind(-1) == "NAME":
                    self.at -= 1  # the name before belongs to the next declaration
                    break
                relation = True
            if kind in _NESTED:
                stack.append(_NESTED[kind])
            elif kind in _NESTED.values() and stack:
                stack.pop()
            self.at += 1
        if self.at == first:  # a keyword where a declaration should begin
            self.complain(
                "RCL113", "expected a declaration and not %", self.at, "write `Name : type;` or `Name = value;`"
            )
            self.at += 1
            self.skip_to_top()
            return None
        text = self.reports.source.text
        part = [
            t._replace(type="EQUALS") if t.type == "EQ" and text.startswith(":=", t.start) else t
            for t in self.tokens[first : self.at]
        ]
        begin = self.tokens[first - 1].end if first else 0
        tree = parse("declaration", part, self.reports, part[-1].end, begin)
        self.out.parts.append((part[0].start, part[-1].end))
        if tree is None:
            broken.update(t.text for t in part if t.type == "NAME")
        if self.kind() == "SEMICOLON":
            self.at += 1
        elif tree is not None:
            end = part[-1].end
            message = f"`;` is missing after the declaration of `{tree.name.text}`"
            self.reports.error("RCL113", message, end - 1, end, hint="end every declaration with `;`")
        return tree

    def no_name(self, hint: str) -> str:
        """The hint, after what is to be said of a keyword that stands where a name may stand."""
        said = about_keyword(self.tokens[self.at]) if self.at < len(self.tokens) else None
        return f"{said}; {hint}" if said else hint

    # --- node --------------------------------------------------------------------------------------------------------

    def node(self) -> None:
        start = self.tokens[self.at].start
        self.at += 1
        if self.kind() == "NAME":
            node = NodeSyntax(self.tokens[self.at], start)
            self.at += 1
        else:
            hint = "write `node NAME {`, with a name of letters, digits and `_`"
            if self.kind() == "STRING":
                hint = "a name stands without quotation marks"
            hint = self.no_name(hint)
            self.complain("RCL113", "expected the node's name and not %", self.at, hint)
            node = NodeSyntax(Token("NAME", "", start, start), start)
            ahead = next((i for i in range(4) if self.kind(i) in ("LBRACE", "$END") or self.kind(i) in _SECTIONS), 0)
            if not any(self.kind(i) in _TOP for i in range(1, ahead)):
                self.at += ahead
        brace = self.open_brace("the node's name")
        self.out.nodes.append(node)
        before, seen, closed = "", dict[str, Token](), False
        while self.at < len(self.tokens) and self.kind() not in _TOP and not self.reports.full:
            if self.kind() == "RBRACE":
                self.at += 1
                closed = True
                break
            section = self.section() or self.meant_section()
            if section is None:
                self.not_a_section()
                continue
            keyword = self.tokens[self.at]
            if section in ("INPUTS", "OUTPUTS", "TOPICS") and section in seen:
                earlier = self.reports.source.span(seen[section].start, seen[section].end)
                message = f"a second `{keyword.text}` in node `{node.name.text}`"
                notes = ((f"the first `{keyword.text}` is here", earlier),)
                self.reports.error("RCL117", message, keyword.start, keyword.end, notes=notes)
            elif before and _ORDER[section] < _ORDER[before]:
                words = {"DEFINE": "a definition", "ASSUME": "an assumption", "GUARANTEE": "a guarantee"}
                message = f"`{keyword.text}` stands after {words.get(before, f'`{before.lower()}`')}"
                hint = "the order is: inputs, outputs, topics, steps, definitions, assumptions, guarantees"
                self.reports.error("RCL116", message, keyword.start, keyword.end, hint=hint)
            else:
                before = section
            seen.setdefault(section, keyword)
            self.read_section(section, node)
            self.out.parts.append((keyword.start, self.tokens[self.at - 1].end))
        else:
            if brace is not None:
                message = f"the `{{` of node `{node.name.text}` is never closed"
                self.reports.error("RCL115", message, brace.start, brace.end, hint="close it with `}`")
        node.end = self.tokens[min(self.at, len(self.tokens)) - 1].end
        self.out.parts.append((node.start, node.end))
        self.missing(node, seen, closed)

    def missing(self, node: NodeSyntax, seen: dict[str, Token], closed: bool) -> None:
        """Reports the sections that a node must have and does not. In one that is not `closed`, which has been
        reported, those at the end may be still to come."""
        if not node.name.text:
            return
        where = (node.name.start, node.name.end)
        last = max((_ORDER[s] for s in seen), default=-1)
        for section in ("INPUTS", "OUTPUTS", "TOPICS"):
            if section in seen:
                continue
            node.broken.add("*")
            if closed or _ORDER[section] < last:
                message = f"node `{node.name.text}` has no `{section.lower()}( … )`"
                self.reports.error("RCL118", message, *where, hint=SECTION_FORMS[section])
        if "GUARANTEE" not in seen and closed:
            message = f"node `{node.name.text}` guarantees nothing"
            self.reports.error("RCL118", message, *where, hint="a node has at least one `guarantee( … )`")

    def section(self) -> str | None:
        kind = self.kind()
        if kind in _SECTIONS:
            return kind
        if kind == "NAME" and self.tokens[self.at].text in ("A", "G") and self.kind(1) in ("LPAR", "NAME", "STRING"):
            return "ASSUME" if self.tokens[self.at].text == "A" else "GUARANTEE"
        if kind == "NAME" and self.tokens[self.at].text == "steps" and self.kind(1) == "LPAR":
            return "STEPS"
        return None

    def meant_section(self) -> str | None:
        """The section that a word not quite right begins: said once, and read as that, so that nothing else is said."""
        if self.kind() in ("IN", "OUT") and self.kind(1) == "LPAR":
            meant = "inputs" if self.kind() == "IN" else "outputs"
            self.complain("RCL113", "% begins no part of a node", self.at, f"write `{meant}`")
            return meant.upper()
        if self.kind() != "NAME" or self.kind(1) not in ("LPAR", "NAME", "STRING"):
            return None
        word = self.tokens[self.at].text
        numbered = word[0] in "AG" and word[1:].isdigit() and self.kind(1) == "LPAR"
        near = NEAR_SECTIONS.get(word.lower(), word.lower())
        meant = ("assume" if word[0] == "A" else "guarantee") if numbered else near
        if meant.upper() not in _SECTIONS:
            return None
        hint = f"a clause with a name is written `{meant} {word}( … )`" if numbered else f"write `{meant}`"
        self.complain("RCL113", "% begins no part of a node", self.at, hint)
        return meant.upper()

    def not_a_section(self) -> None:
        token = self.tokens[self.at]
        hint: str | None = "a node has inputs, outputs, topics, assumptions and guarantees, each with parentheses"
        message = "expected `inputs`, `outputs`, `topics`, `assume`, `guarantee` or `}` and not %"
        if token.type == "RPAR":
            message, hint = "this `)` closes nothing", "remove it, or find where a `(` is missing"
            if self.out.parts and self.reports.is_torn(self.out.parts[-1][0], token.end):
                self.complained = token.start  # `[0, 1)`: what could not be read may have been its partner
        elif token.type in ("SEMICOLON", "COMMA", "DOT"):
            message, hint = (
                "% stands between the parts of a node",
                "no sign stands between the parts of a node: remove it",
            )
        self.complain("RCL113", message, self.at, hint)
        self.at += 1
        while self.at < len(self.tokens) and self.kind() not in _TOP and self.section() is None:
            if self.kind() == "RBRACE":
                return
            if self.kind() in _OPEN:
                self.balanced()
            else:
                self.at += 1

    def balanced(self) -> int | None:
        """Past the bracket here and its partner; the partner's position, or None where it has none (then: where the
        search ended, at a section keyword or the end)."""
        stack, opened = [_OPEN[self.kind()]], [self.tokens[self.at]]
        self.innermost = None
        self.at += 1
        while self.at < len(self.tokens):
            kind = self.kind()
            if kind in _TOP or kind in _SECTIONS:
                return None
            if kind in _OPEN:
                stack.append(_OPEN[kind])
                opened.append(self.tokens[self.at])
            elif kind in _CLOSE:
                if kind != stack[-1]:
                    self.innermost = opened[-1]
                    return None
                stack.pop()
                opened.pop()
                if not stack:
                    self.at += 1
                    return self.at - 1
            self.at += 1
        return None

    def read_section(self, section: str, node: NodeSyntax) -> None:
        keyword = self.tokens[self.at]
        if section == "DEFINE":
            tree = self.declaration(node.broken)
            node.definitions += [tree] if isinstance(tree, Define) else []
            return
        self.at += 1
        name = sentence = None
        if section in ("ASSUME", "GUARANTEE"):
            if self.kind() == "NAME":
                name = self.tokens[self.at]
                self.at += 1
            if self.kind() == "STRING":
                sentence = self.tokens[self.at]
                self.at += 1
        if self.kind() != "LPAR":
            hint = f"write `{keyword.text}( … )`"
            if section in ("ASSUME", "GUARANTEE") and self.kind() not in ("LBRACE", "RBRACE", "$END"):
                hint = f'write `{keyword.text} NAME "sentence" ( … )`; the name and the sentence may be left out'
                hint = self.no_name(hint)
            self.complain("RCL113", f"expected `(` after `{(name or keyword).text}` and not %", self.at, hint)
            if self.kind() == "LBRACE":
                self.balanced()
            if section not in ("ASSUME", "GUARANTEE"):
                node.broken.add("*")
            while self.at < len(self.tokens) and self.kind() not in _TOP and self.kind() != "RBRACE":
                if self.section() is not None:
                    return
                self.at += 1
            return
        opening = self.tokens[self.at]
        first = self.at + 1
        close = self.balanced()
        if close is None:
            self.unclosed(self.innermost or opening, first, section, node)
            return
        part = self.tokens[first:close]
        end = self.tokens[close].start
        if section == "STEPS":
            whole = (keyword.start, self.tokens[close].end)
            formula = parse("formula", self.tokens[first - 2 : close + 1], self.reports, whole[1], keyword.start)
            node.clauses.append(ClauseSyntax(ClauseKind.GUARANTEE, keyword, None, formula, whole, *whole))
            return
        if section in ("ASSUME", "GUARANTEE"):
            kind = ClauseKind.ASSUMPTION if section == "ASSUME" else ClauseKind.GUARANTEE
            formula = None
            if part or self.reports.is_torn(opening.end, end):
                formula = parse("formula", part, self.reports, end, opening.end)
            else:
                message = f"this {kind.value} says nothing"
                hint = "leave it out: no assumption means that every input is accepted"
                if section == "GUARANTEE":
                    hint = "write `TRUE` where the node promises nothing"
                self.reports.error("RCL119", message, opening.start, self.tokens[close].end, hint=hint)
            inside = (opening.end, end)
            node.clauses.append(
                ClauseSyntax(kind, name, sentence, formula, inside, keyword.start, self.tokens[close].end)
            )
            return
        listing: PortList | TopicList | None
        if section == "TOPICS":
            listing = topics = parse("topics", part, self.reports, end, opening.end)
            node.topics = node.topics or topics
        else:
            listing = ports = parse("ports", part, self.reports, end, opening.end)
            if section == "INPUTS":
                node.inputs = node.inputs or ports
            else:
                node.outputs = node.outputs or ports
        if listing is None:
            node.broken.update(t.text for t in part if t.type == "NAME")
        else:
            self.out.parts.extend((t.start, t.end) for t in listing.items)

    def unclosed(self, opening: Token, first: int, section: str, node: NodeSyntax) -> None:
        """Reports a parenthesis without partner and goes to where reading can begin again."""
        words, start, end = self.found(self.at)
        where = self.reports.source.span(start, end)
        if not self.reports.is_torn(opening.end, end):  # what could not be read may hold the partner
            self.reports.error(
                "RCL115",
                f"this `{_SIGN[opening.type]}` is never closed",
                opening.start,
                opening.end,
                hint=f"close it with `{_SIGN[_OPEN[opening.type]]}`",
                notes=((f"it should be closed before {words} here", where),),
            )
        if section not in ("ASSUME", "GUARANTEE"):
            node.broken.update(t.text for t in self.tokens[first : self.at] if t.type == "NAME")
            node.broken.add("*")
        while self.at < len(self.tokens) and self.kind() not in _TOP and self.section() is None:
            if self.kind() == "RBRACE" and self.kind(1) in (*_TOP, "$END", "RBRACE"):
                return
            self.at += 1
