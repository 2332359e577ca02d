"""A piece of surface syntax as text on one line."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import assert_never

from avow.language import syntax


def flat(tree: syntax.Syntax) -> str:
    """The tree on one line, in the canonical spacing; every parenthesis, number and name as it was written."""
    match tree:
        case syntax.Connective(sign=sign, items=items):
            return f" {sign} ".join(map(flat, items))
        case syntax.Negation(body=body):
            return f"not {flat(body)}"
        case syntax.Comparison(operands=operands, relations=signs):
            return _between(operands, ("!in" if sign.type == "NOT_IN" else sign.text for sign in signs))
        case syntax.Calculation(operands=operands, operators=signs):
            return _between(operands, (sign.text for sign in signs))
        case syntax.Minus(body=body):
            inner = flat(body)
            return f"- {inner}" if inner.startswith("-") else f"-{inner}"
        case syntax.Application(function=function, arguments=arguments):
            return f"{flat(function)}({_listed(arguments)})"
        case (
            syntax.Name(text=text)
            | syntax.BuiltinName(text=text)
            | syntax.Text(text=text)
            | syntax.NamedType(text=text)
            | syntax.BuiltinType(text=text)
        ):
            return text
        case syntax.Number(digits=digits):
            return digits
        case syntax.Truth(value=value):
            return "TRUE" if value else "FALSE"
        case syntax.PortName(role=role, name=name):
            return f"{role}.{name}"
        case syntax.NodePort(node=node, role=said, name=name):
            return f"{node}.{name}" if said is None else f"{node}.{said}.{name}"
        case syntax.FieldOf(body=body, name=token):
            return f"{flat(body)}.{token.text}"
        case syntax.RecordType(fields=parts):
            return f"[{_listed(parts)}]"
        case syntax.Parentheses(body=body):
            return f"({flat(body)})"
        case syntax.TupleDisplay(items=parts) | syntax.TupleType(items=parts):
            return f"({_listed(parts)})"
        case syntax.SetDisplay(items=parts) | syntax.SetType(elements=parts):
            return f"{{{_listed(parts)}}}"
        case syntax.UnspecifiedType():
            return "{}"
        case syntax.SequenceDisplay(items=items):
            return f"<{_listed(items)}>"
        case syntax.RangeDisplay(low=low, high=high):
            return f"<{flat(low)} upto {flat(high)}>"
        case syntax.Quantification():
            return f"{quantifier_head(tree)} {flat(tree.body)})"
        case syntax.IfThenElse(condition=condition, then=then, otherwise=otherwise):
            return f"if {flat(condition)} then {flat(then)} else {flat(otherwise)}"
        case syntax.Quantity(digits=digits, unit=unit):
            return f"{digits} {unit.text}"
        case syntax.LimitSyntax(relation=relation, amount=amount, unit=named):
            inside = (relation, flat(amount), named.text if named is not None else "")
            return f"[{' '.join(part for part in inside if part)}]"
        case syntax.Limited(name=token, limit=limit, arguments=arguments):
            return f"{token.text}{flat(limit)}({_listed(arguments)})"
        case syntax.PaceSyntax(head=head, words=before, length=length):
            return f"{flat(head)}({' '.join(word.text for word in before)} {flat(length)})"
        case syntax.Lasting(word=word, left=one, limit=bound, right=other):
            return f"{flat(one)} {word}{'' if bound is None else flat(bound)} {flat(other)}"
        case syntax.Binder(names=names, domain=domain):
            return f"{', '.join(name.text for name in names)} in {flat(domain)}"
        case syntax.FunctionType(parameters=left, result=right):
            return f"{flat(left)} --> {flat(right)}"
        case syntax.ProductType(factors=factors, signs=signs):
            return _between(factors, (sign.text for sign in signs))
        case syntax.SequenceType(item=item):
            return f"<{flat(item)}>"
        case syntax.Element(name=token, parameters=sorts):
            return f"{token.text}({_listed(sorts)})" if sorts else token.text
        case syntax.TypeDeclaration() | syntax.PortDeclaration():
            return f"{tree.name.text} : {flat(tree.type)}"
        case syntax.ConstantDeclaration():
            return f"{tree.name.text} = {flat(tree.value)}"
        case syntax.Define():
            return f"{definition_head(tree)} {flat(tree.body)}"
        case syntax.PortList(items=parts) | syntax.TopicList(items=parts):
            return _listed(parts)
        case syntax.RosType(names=names):
            return "/".join(name.text for name in names)
        case syntax.TopicDeclaration(type=type_, name=token, role=said, port=port):
            whole = f"{flat(type_)} {token.text}"
            if port is None:
                return whole
            return f"{whole} matches({port.text if said is None else f'{said}.{port.text}'})"
        case _:
            assert_never(tree)


def definition_head(tree: syntax.Define) -> str:
    """``define hot(i : NATURAL) =``."""
    return f"define {tree.name.text}{f'({_listed(tree.parameters)})' if tree.parameters else ''} ="


def quantifier_head(tree: syntax.Quantification) -> str:
    """``forall(x in REAL |``."""
    return f"{tree.quantifier}({_listed(tree.binders)} |"


def _listed(trees: Iterable[syntax.Syntax]) -> str:
    return ", ".join(map(flat, trees))


def _between(trees: Sequence[syntax.Syntax], signs: Iterable[str]) -> str:
    text = flat(trees[0])
    for sign, tree in zip(signs, trees[1:], strict=True):
        text += f" {sign} {flat(tree)}"
    return text
