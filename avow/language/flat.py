"""A piece of surface syntax as text on one line."""

from __future__ import annotations

from avow.language.lexer import Token
from avow.language.syntax import Tree


def flat(tree: Tree) -> str:
    """The tree on one line, in the canonical spacing; every parenthesis, number and name as it was written."""
    p = tree.parts
    match tree.kind:
        case "and" | "or":
            return f" {tree.kind} ".join(map(flat, p))
        case "implies":
            return " -> ".join(map(flat, p))
        case "iff":
            return " <=> ".join(map(flat, p))
        case "not":
            return f"not {flat(p[0])}"
        case "comparison":
            return "".join(flat(x) if isinstance(x, Tree) else f" {_relation(x)} " for x in p)
        case "arithmetic":
            return "".join(flat(x) if isinstance(x, Tree) else f" {x.text} " for x in p)
        case "negative":
            inner = flat(p[0])
            return f"- {inner}" if inner.startswith("-") else f"-{inner}"
        case "application":
            return f"{flat(p[0])}({', '.join(map(flat, p[1:]))})"
        case "parenthesised":
            return f"({flat(p[0])})"
        case "tuple" | "tuple_type":
            return f"({', '.join(map(flat, p))})"
        case "set" | "set_type" | "unspecified_type":
            return f"{{{', '.join(map(flat, p))}}}"
        case "sequence":
            return f"<{', '.join(map(flat, p))}>"
        case "sequence_type":
            return f"<{flat(p[0])}>"
        case "range":
            return f"<{flat(p[0])} upto {flat(p[1])}>"
        case "quantified":
            return f"{p[0]}({flat(p[1])} | {flat(p[2])})"
        case "binders":
            return ", ".join(map(flat, p))
        case "binder":
            return f"{', '.join(n.text for n in p[:-1])} in {flat(p[-1])}"
        case "port_name":
            return f"{p[0]}.{p[1]}"
        case "node_port":
            return ".".join(x for x in p if x is not None)
        case "function_type":
            return f"{flat(p[0])} --> {flat(p[1])}"
        case "product_type":
            return " ".join(flat(x) if isinstance(x, Tree) else x.text for x in p)
        case "element":
            return str(p[0].text)
        case "constructor":
            return f"{p[0].text}({', '.join(map(flat, p[1:]))})"
        case "port":
            return f"{p[0].text} : {flat(p[1])}"
        case "topic":
            matched = ""
            if p[3] is not None:
                matched = f" matches({p[2]}.{p[3].text})" if p[2] is not None else f" matches({p[3].text})"
            return f"{'/'.join(t.text for t in p[0].parts)} {p[1].text}{matched}"
        case _:
            return str(p[0])


def _relation(token: Token) -> str:
    return "!in" if token.type == "NOT_IN" else token.text
