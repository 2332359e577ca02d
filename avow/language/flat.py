"""A piece of surface syntax as text on one line."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import assert_never

from avow.language.syntax import (
    Application,
    Binder,
    BuiltinName,
    BuiltinType,
    Calculation,
    Comparison,
    Connective,
    ConstantDeclaration,
    Define,
    Element,
    FieldOf,
    FunctionType,
    IfThenElse,
    Lasting,
    Limited,
    LimitSyntax,
    Minus,
    Name,
    NamedType,
    Negation,
    NodePort,
    Number,
    PaceSyntax,
    Parentheses,
    PortDeclaration,
    PortList,
    PortName,
    ProductType,
    Quantification,
    Quantity,
    RangeDisplay,
    RecordType,
    RosType,
    SequenceDisplay,
    SequenceType,
    SetDisplay,
    SetType,
    Syntax,
    Text,
    TopicDeclaration,
    TopicList,
    Truth,
    TupleDisplay,
    TupleType,
    TypeDeclaration,
    UnspecifiedType,
)


def flat(tree: Syntax) -> str:
    """The tree on one line, in the canonical spacing; every parenthesis, number and name as it was written."""
    match tree:
        case Connective(sign=sign, items=items):
            return f" {sign} ".join(map(flat, items))
        case Negation(body=body):
            return f"not {flat(body)}"
        case Comparison(operands=operands, relations=signs):
            return _between(operands, ("!in" if sign.type == "NOT_IN" else sign.text for sign in signs))
        case Calculation(operands=operands, operators=signs):
            return _between(operands, (sign.text for sign in signs))
        case Minus(body=body):
            inner = flat(body)
            return f"- {inner}" if inner.startswith("-") else f"-{inner}"
        case Application(function=function, arguments=arguments):
            return f"{flat(function)}({_listed(arguments)})"
        case Name(text=text) | BuiltinName(text=text) | Text(text=text) | NamedType(text=text) | BuiltinType(text=text):
            return text
        case Number(digits=digits):
            return digits
        case Truth(value=value):
            return "TRUE" if value else "FALSE"
        case PortName(role=role, name=name):
            return f"{role}.{name}"
        case NodePort(node=node, role=said, name=name):
            return f"{node}.{name}" if said is None else f"{node}.{said}.{name}"
        case FieldOf(body=body, name=token):
            return f"{flat(body)}.{token.text}"
        case RecordType(fields=parts):
            return f"[{_listed(parts)}]"
        case Parentheses(body=body):
            return f"({flat(body)})"
        case TupleDisplay(items=parts) | TupleType(items=parts):
            return f"({_listed(parts)})"
        case SetDisplay(items=parts) | SetType(elements=parts):
            return f"{{{_listed(parts)}}}"
        case UnspecifiedType():
            return "{}"
        case SequenceDisplay(items=items):
            return f"<{_listed(items)}>"
        case RangeDisplay(low=low, high=high):
            return f"<{flat(low)} upto {flat(high)}>"
        case Quantification():
            return f"{quantifier_head(tree)} {flat(tree.body)})"
        case IfThenElse(condition=condition, then=then, otherwise=otherwise):
            return f"if {flat(condition)} then {flat(then)} else {flat(otherwise)}"
        case Quantity(digits=digits, unit=unit):
            return f"{digits} {unit.text}"
        case LimitSyntax(relation=relation, amount=amount, unit=named):
            inside = (relation, flat(amount), named.text if named is not None else "")
            return f"[{' '.join(part for part in inside if part)}]"
        case Limited(name=token, limit=limit, arguments=arguments):
            return f"{token.text}{flat(limit)}({_listed(arguments)})"
        case PaceSyntax(head=head, words=before, length=length):
            return f"{flat(head)}({' '.join(word.text for word in before)} {flat(length)})"
        case Lasting(word=word, left=one, limit=bound, right=other):
            return f"{flat(one)} {word}{'' if bound is None else flat(bound)} {flat(other)}"
        case Binder(names=names, domain=domain):
            return f"{', '.join(name.text for name in names)} in {flat(domain)}"
        case FunctionType(parameters=left, result=right):
            return f"{flat(left)} --> {flat(right)}"
        case ProductType(factors=factors, signs=signs):
            return _between(factors, (sign.text for sign in signs))
        case SequenceType(item=item):
            return f"<{flat(item)}>"
        case Element(name=token, parameters=sorts):
            return f"{token.text}({_listed(sorts)})" if sorts else token.text
        case TypeDeclaration() | PortDeclaration():
            return f"{tree.name.text} : {flat(tree.type)}"
        case ConstantDeclaration():
            return f"{tree.name.text} = {flat(tree.value)}"
        case Define():
            return f"{definition_head(tree)} {flat(tree.body)}"
        case PortList(items=parts) | TopicList(items=parts):
            return _listed(parts)
        case RosType(names=names):
            return "/".join(name.text for name in names)
        case TopicDeclaration(type=type_, name=token, role=said, port=port):
            whole = f"{flat(type_)} {token.text}"
            if port is None:
                return whole
            return f"{whole} matches({port.text if said is None else f'{said}.{port.text}'})"
        case _:
            assert_never(tree)


def definition_head(tree: Define) -> str:
    """``define hot(i : NATURAL) =``."""
    return f"define {tree.name.text}{f'({_listed(tree.parameters)})' if tree.parameters else ''} ="


def quantifier_head(tree: Quantification) -> str:
    """``forall(x in REAL |``."""
    return f"{tree.quantifier}({_listed(tree.binders)} |"


def _listed(trees: Iterable[Syntax]) -> str:
    return ", ".join(map(flat, trees))


def _between(trees: Sequence[Syntax], signs: Iterable[str]) -> str:
    text = flat(trees[0])
    for sign, tree in zip(signs, trees[1:], strict=True):
        text += f" {sign} {flat(tree)}"
    return text
