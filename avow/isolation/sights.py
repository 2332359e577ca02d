"""Tells what a subject compares, and with what: so that inputs can be sought at which it decides otherwise.

Loaded by `host` from beside it, so without imports from Avow. The subject's own modules are compiled with their
operands handed through `see`, which notes them and gives them back. A process that is looked at so answers nothing that
counts: its answers are thrown away, and only where to look next is learnt from it.

A sight is ``[place, what, left, right]``: of a comparison both sides; of anything else that a number or a text decides
(a slice, a lookup, a remainder, an argument) what it is, beside what it is held against, if anything. A number is
``[numerator, denominator]``, a text is itself.
"""

from __future__ import annotations

import ast
import builtins
from collections.abc import Callable, Iterable, Mapping
from decimal import Decimal
from fractions import Fraction
from types import CodeType, ModuleType
from typing import Any

most: dict[str, int] = {}
"""How much is told (`avow.base.tuning.running.SIGHTS`), which the host is given."""

Sight = list[Any]
Simple = list[int] | str


def simple(value: Any) -> Simple | None:
    """A number or a text as it is told; None of all else."""
    kind = type(value)
    if kind is bool or kind is int:
        return [int(value), 1] if value.bit_length() <= most["bits"] else None
    if isinstance(value, str):
        return str.__str__(value) if len(value) <= most["text"] else None
    try:
        if isinstance(value, int) or hasattr(kind, "__index__"):
            return simple(int(value))
        if isinstance(value, float | Fraction | Decimal):
            numerator, denominator = value.as_integer_ratio()
            if max(numerator.bit_length(), denominator.bit_length()) <= most["bits"]:
                return [int(numerator), int(denominator)]
    except Exception:  # a number of the subject's own making, or one that is none
        return None
    return None


class Eyes:
    """What the host asks: to compile the subject's modules, and what has been seen since it last asked."""

    def __init__(self, limits: Mapping[str, int]) -> None:
        most.update(limits)
        self.codes: list[CodeType] = []
        self.paths: set[str] = set()
        self.kinds: list[Any] = []
        self._pending: dict[int, Any] = {}
        self._seen: dict[int, list[Sight]] = {}
        self._count = 0
        self._busy = False
        setattr(builtins, _SEE, self.see)

    def loaded(self, modules: Callable[[], Iterable[ModuleType]]) -> list[Sight]:
        """The constants of what has been loaded."""
        self.told()
        return constants([m for m in modules() if getattr(m, "__file__", None) in self.paths], self.codes)

    def told(self) -> list[Sight]:
        found = [sight for sights in self._seen.values() for sight in sights]
        self._seen, self._pending, self._count = {}, {}, 0
        return found

    def compiled(self, data: bytes, path: str) -> CodeType:
        """A module whose operands are handed through `see`; as it is, where that is not possible."""
        plain = compile(data, path, "exec", dont_inherit=True)
        self.codes.append(plain)
        self.paths.add(path)
        tree, before = ast.parse(data, path), len(self.kinds)
        try:
            return compile(ast.fix_missing_locations(_Led(self.kinds).visit(tree)), path, "exec", dont_inherit=True)
        except (SyntaxError, ValueError, RecursionError, TypeError):
            del self.kinds[before:]
            return plain

    def see(self, place: int, part: int, value: Any) -> Any:
        """Notes an operand; it is what it was."""
        if not self._busy:  # what the subject's own classes do while they are looked at is not looked at
            self._busy = True
            try:
                self._note(place, part, value)
            except Exception:  # of a class of the subject's own
                pass
            finally:
                self._busy = False
        return value

    def _note(self, place: int, part: int, value: Any) -> None:
        kind = self.kinds[place]
        if part == 0 and kind[0] in ("compare", "of", "least"):
            self._pending[place] = value
            if kind[0] == "compare":
                return
        if kind[0] == "compare":
            left, self._pending[place] = self._pending.get(place), value
            self._pairs(place, kind[part], left, value)
        elif kind[0] == "truth":
            number = simple(value)
            if isinstance(number, list) and type(value) is not bool:
                self._put([place, "==", number, [0, 1]])
            elif isinstance(value, tuple | list | str | dict | set):
                self._put([place, "==", [len(value), 1], [0, 1]])
        elif kind[0] == "match":
            for item in value if isinstance(value, tuple | list) else (value,):
                for constant in kind[1]:
                    self._pair(place, "==", item, constant)
        elif kind[0] == "of":
            if part:
                self._held(place, self._pending.get(place), value)
        elif kind[0] == "least" and part:
            self._pair(place, "<", self._pending.get(place), value)
        else:
            self._use(place, value)

    def _held(self, place: int, owner: Any, value: Any) -> None:
        """An index of, or an argument to a method of, something."""
        if isinstance(owner, dict | set | frozenset):
            for key in _items(owner):
                self._pair(place, "==", value, key)
        elif isinstance(owner, str) and isinstance(value, str):
            self._pair(place, "in", value, owner)
        elif isinstance(owner, tuple | list | str | bytes) and isinstance(value, int):
            self._put([place, "<", [len(owner), 1], [int(value), 1]])
        else:
            self._use(place, value)

    def _use(self, place: int, value: Any) -> None:
        for item in _items(value) if isinstance(value, tuple | list | range) else (value,):
            known = simple(item)
            if known is not None:
                self._put([place, "use", known, None])
        if isinstance(value, tuple | list | str):
            self._put([place, "use", [len(value), 1], None])

    def _pairs(self, place: int, operator: str, left: Any, right: Any) -> None:
        if operator == "in" and not isinstance(right, str):
            if isinstance(right, range):
                for end in (right.start, right.stop):
                    self._pair(place, "<", left, end)
                return
            for item in _items(right):
                self._pair(place, "==", left, item)
        elif isinstance(left, tuple | list) and isinstance(right, tuple | list):
            self._put([place, "==", [len(left), 1], [len(right), 1]])
            for one, other in zip(_items(left), right, strict=False):
                self._pair(place, operator, one, other)
        elif isinstance(left, bytes) and isinstance(right, bytes):
            self._pair(place, operator, left.decode("latin-1"), right.decode("latin-1"))
        elif isinstance(left, set | frozenset | dict) and isinstance(right, set | frozenset | dict):
            self._put([place, "==", [len(left), 1], [len(right), 1]])
        else:
            self._pair(place, operator, left, right)

    def _pair(self, place: int, operator: str, left: Any, right: Any) -> None:
        one, other = simple(left), simple(right)
        if one is not None and type(one) is type(other):
            self._put([place, operator, one, other])

    def _put(self, sight: Sight) -> None:
        sights = self._seen.setdefault(sight[0], [])
        if len(sights) < most["times"]:
            self._count += 1
            if self._count < most["sights"]:
                sights.append(sight)
        else:
            sights[-2:] = [sights[-1], sight]


def constants(modules: Iterable[ModuleType], codes: Iterable[CodeType]) -> list[Sight]:
    """What the loaded modules hold: in their code, as it is compiled, and in their names, those of classes and the
    defaults of functions among them."""
    found: dict[str, Sight] = {}

    def put(value: Any) -> None:
        known = simple(value) if not isinstance(value, bool) else None
        if known is not None and len(found) < most["constants"]:
            found[repr(known)] = [-1, "use", known, None]

    def code(each: CodeType) -> None:
        for value in each.co_consts:
            if isinstance(value, CodeType):
                code(value)
            else:
                for item in _items(value) if isinstance(value, tuple | frozenset) else (value,):
                    put(item)

    def held(value: Any, depth: int) -> None:
        put(value)
        if depth > 3 or len(found) >= most["constants"]:
            return
        if isinstance(value, dict):
            for key, inner in list(value.items())[: most["items"]]:
                held(key, depth + 1)
                held(inner, depth + 1)
        elif isinstance(value, tuple | list | set | frozenset | range):
            put(len(value))
            for inner in _items(value):
                held(inner, depth + 1)
        elif isinstance(value, type) and depth < 2:
            for inner in list(vars(value).values()):
                held(inner, depth + 1)
        elif callable(value) and hasattr(value, "__code__"):
            for inner in (*(value.__defaults__ or ()), *(value.__kwdefaults__ or {}).values()):
                held(inner, depth + 1)

    for each in codes:
        code(each)
    for module in modules:
        for name, value in list(vars(module).items()):
            if not name.startswith("__"):
                held(value, 0)
    return list(found.values())


def _items(container: Any) -> list[Any]:
    found: list[Any] = []
    try:
        for item in container:
            found.append(item)
            if len(found) == most["items"]:
                break
    except Exception:  # of the subject's own
        return found
    return found


# -- where operands are handed through ---------------------------------------------------------------------------------

_SEE = "__avow_see__"
_COMPARED: dict[type[ast.cmpop], str] = {
    ast.Eq: "==",
    ast.NotEq: "==",
    ast.Lt: "<",
    ast.LtE: "<",
    ast.Gt: "<",
    ast.GtE: "<",
    ast.In: "in",
    ast.NotIn: "in",
    ast.Is: "==",
    ast.IsNot: "==",
}
_PLAIN_TRUTH = (ast.Compare, ast.BoolOp, ast.Constant)


class _Led(ast.NodeTransformer):
    """Hands operands through `see`, in the order in which they are evaluated; nothing else changes."""

    def __init__(self, kinds: list[Any]) -> None:
        self.kinds = kinds

    def _place(self, *kind: Any) -> int:
        self.kinds.append(kind)
        return len(self.kinds) - 1

    def _through(self, place: int, part: int, value: ast.expr) -> ast.expr:
        if isinstance(value, ast.Starred):
            return value
        arguments: list[ast.expr] = [ast.Constant(place), ast.Constant(part), value]
        return ast.copy_location(ast.Call(ast.Name(_SEE, ast.Load()), arguments, []), value)

    def visit_Compare(self, node: ast.Compare) -> Any:
        self.generic_visit(node)
        place = self._place("compare", *(_COMPARED[type(operator)] for operator in node.ops))
        node.left = self._through(place, 0, node.left)
        node.comparators = [self._through(place, k, each) for k, each in enumerate(node.comparators, 1)]
        return node

    def visit_BinOp(self, node: ast.BinOp) -> Any:
        self.generic_visit(node)
        if isinstance(node.right, ast.Constant) and isinstance(node.left, ast.Constant):
            return node
        node.right = self._through(self._place("use"), 0, node.right)
        return node

    def visit_Call(self, node: ast.Call) -> Any:
        self.generic_visit(node)
        if isinstance(node.func, ast.Attribute):
            place = self._place("of")
            node.func.value = self._through(place, 0, node.func.value)
        else:
            least = isinstance(node.func, ast.Name) and node.func.id in ("min", "max") and len(node.args) > 1
            place = self._place("least" if least else "use")
        node.args = [self._through(place, k, each) for k, each in enumerate(node.args, 1)]
        for k, keyword in enumerate(node.keywords, len(node.args) + 1):
            if keyword.arg is not None:
                keyword.value = self._through(place, k, keyword.value)
        if self.kinds[place][0] == "least" and node.args:
            first = node.args[0]
            if isinstance(first, ast.Call):
                first.args[1] = ast.Constant(0)
        return node

    def visit_Subscript(self, node: ast.Subscript) -> Any:
        self.generic_visit(node)
        if not isinstance(node.ctx, ast.Load):
            return node
        place = self._place("of")
        node.value = self._through(place, 0, node.value)
        if isinstance(node.slice, ast.Slice):
            for k, end in enumerate(("lower", "upper", "step"), 1):
                if getattr(node.slice, end) is not None:
                    setattr(node.slice, end, self._through(place, k, getattr(node.slice, end)))
        elif not isinstance(node.slice, ast.Tuple):
            node.slice = self._through(place, 1, node.slice)
        return node

    def visit_Match(self, node: ast.Match) -> Any:
        values: list[Any] = []
        for case in node.cases:
            for part in ast.walk(case.pattern):
                if isinstance(part, ast.MatchValue) and isinstance(part.value, ast.Constant):
                    values.append(part.value.value)
            if case.guard is not None:
                case.guard = self._truth(self.visit(case.guard))
            case.body = [self.visit(statement) for statement in case.body]
        node.subject = self._through(self._place("match", tuple(values)), 0, self.visit(node.subject))
        return node

    def _truth(self, test: ast.expr) -> ast.expr:
        plain = isinstance(test, _PLAIN_TRUTH) or (isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not))
        return test if plain else self._through(self._place("truth"), 0, test)

    def _tested(self, node: Any) -> Any:
        self.generic_visit(node)
        node.test = self._truth(node.test)
        return node

    visit_If = visit_While = visit_IfExp = visit_Assert = _tested  # noqa: N815

    def visit_BoolOp(self, node: ast.BoolOp) -> Any:
        self.generic_visit(node)
        node.values = [self._truth(each) for each in node.values]
        return node

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Any:
        self.generic_visit(node)
        if isinstance(node.op, ast.Not):
            node.operand = self._truth(node.operand)
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> Any:
        if node.value is not None:
            node.value = self.visit(node.value)
        return node

    def visit_arg(self, node: ast.arg) -> Any:
        return node

    def _function(self, node: Any) -> Any:
        returns, node.returns = node.returns, None
        self.generic_visit(node)
        node.returns = returns
        return node

    visit_FunctionDef = visit_AsyncFunctionDef = _function  # noqa: N815
