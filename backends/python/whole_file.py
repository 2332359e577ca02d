"""Whether a Python file means what its text says: nothing in it rebinds, decorates or patches what the step uses.

The whole file is looked at before any of it is translated. What is refused is not wrong; it is not understood, and
says so with its line.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

BUILTINS = frozenset({"min", "max", "abs", "len", "range", "enumerate", "float", "int", "bool", "dict", "object"})
"""What a step may call; bound anywhere in the file, it means something else."""

MODULES: Mapping[str, frozenset[str]] = {
    "__future__": frozenset({"annotations"}),
    "math": frozenset(name for name in dir(math) if not name.startswith("_")),
    "typing": frozenset({
        "Any", "ClassVar", "Dict", "Final", "Iterable", "List", "Literal", "Mapping", "Optional", "Sequence", "Tuple",
        "Union",
    }),
    "collections.abc": frozenset({"Collection", "Iterable", "Iterator", "Mapping", "Sequence", "Sized"}),
    "enum": frozenset({"Enum", "auto"}),
}  # fmt: skip
"""What may be imported, and what of it may be used: none of it changes what other code does, or leads to what does."""

_LIBRARIES = frozenset({".py", ".pyc", ".pyd", ".pyw", ".so"})

_NAMED = frozenset({"__author__", "__version__"})
"""Names that Python itself takes no notice of."""

_SHOWN = frozenset({"__repr__", "__str__"})
"""Methods by which another class than the node's may say what it is."""

_FRAMES = frozenset({"gi_frame", "cr_frame", "ag_frame", "tb_frame", "f_back", "f_builtins", "f_globals", "f_locals"})
"""Attributes that lead from a value to the names of other code."""

_TREACHEROUS = frozenset(
    {"setattr", "delattr", "exec", "eval", "globals", "locals", "vars", "compile", "__import__", "__builtins__"}
    | {"breakpoint", "memoryview", "super", "type", "getattr", "open", "input"}
)


_MUTATING = frozenset(
    {"update", "pop", "popitem", "clear", "setdefault", "append", "extend", "insert", "remove", "sort"}
)


def binders(*roots: ast.AST) -> Iterator[tuple[str, int]]:
    """Every name that a part of these binds, and the line. Whatever syntax does it: a text in a node of the syntax
    tree is one, unless it is known to be a use, so that what Python may yet come to bind names by is among them."""
    for part in (inner for root in roots for inner in ast.walk(root)):
        line = getattr(part, "lineno", 1)
        match part:
            case ast.Name(ctx=ast.Load()) | ast.Attribute() | ast.keyword() | ast.Constant() | ast.ImportFrom():
                pass  # a use
            case ast.alias(name=name, asname=other):
                yield (other or name).partition(".")[0], line
            case _:  # a definition, an argument, a target, a pattern, a handler, a parameter of a type, …
                for _, value in ast.iter_fields(part):
                    for name in value if isinstance(value, list) else [value]:
                        if isinstance(name, str):
                            yield name, line


class Refusal(Exception):  # noqa: N818 - it says what happened
    """Something that this method does not understand; `line` is the file's, `part` what it is about, if that is known
    more closely."""

    def __init__(self, line: int, why: str, instead: str = "") -> None:
        super().__init__(line, why)
        self.line, self.why, self.instead = line, why, instead
        self.part: ast.expr | ast.stmt | None = None

    def within(self, part: ast.expr | ast.stmt) -> None:
        """The refused thing is in this part of its line: the first call, for the innermost part, counts."""
        if self.part is None and part.lineno == self.line:
            self.part = part

    def __str__(self) -> str:
        return f"line {self.line}: {self.why}"


@dataclass(frozen=True, slots=True)
class Parts:
    """What of a file the step may use."""

    node: ast.ClassDef
    methods: dict[str, ast.FunctionDef]
    functions: dict[str, ast.FunctionDef]
    constants: dict[str, ast.expr]
    """Names of the module."""
    of_class: dict[str, ast.expr]
    """Names of the class."""
    modules: frozenset[str] = frozenset()
    """Modules that it imports by their own name."""


def read(tree: ast.Module, class_name: str, file: Path) -> tuple[Parts | None, tuple[Refusal, ...]]:
    """The file's parts, and everything in it that is refused; no parts where there is no one such class."""
    refused = [*_statements(tree, class_name), *_imports(tree, file), *_everywhere(tree)]
    classes = [s for s in tree.body if isinstance(s, ast.ClassDef) and s.name == class_name]
    if len(classes) != 1:
        where = classes[-1].lineno if classes else 1
        refused.append(Refusal(where, f"there {'are several classes' if classes else 'is no class'} {class_name} here"))
        return None, tuple(_sorted(refused))
    node = classes[0]
    refused += _class(node)
    functions = {s.name: s for s in tree.body if isinstance(s, ast.FunctionDef)}
    methods = {s.name: s for s in node.body if isinstance(s, ast.FunctionDef)}
    modules = frozenset(a.name for s in tree.body if isinstance(s, ast.Import) for a in s.names)
    parts = Parts(node, methods, functions, dict(_constants(tree.body)), dict(_constants(node.body)), modules)
    refused += _bound_when_run(tree)
    refused += _twice(tree.body, "this file")
    refused += _twice(node.body, class_name)
    refused += _written_elsewhere(tree, parts)
    return parts, tuple(_sorted(refused))


def _sorted(refused: list[Refusal]) -> list[Refusal]:
    return [found for _, found in sorted({(r.line, r.why): r for r in refused}.items())]


def _statements(tree: ast.Module, class_name: str) -> Iterator[Refusal]:
    """The top level of a file, and of a class in it, has no statement with an effect."""
    for statement in tree.body:
        match statement:
            case ast.Import() | ast.ImportFrom() | ast.FunctionDef() | ast.Pass():
                pass
            case ast.Expr(value=ast.Constant()):
                pass
            case ast.ClassDef(name=name):
                if name != class_name:
                    yield from _other_class(statement)
            case ast.If() if _is_main(statement.test):
                pass  # `_everywhere` looks at what is in it
            case _:  # a constant's definition does nothing else
                if next(_constants([statement]), None) is None:
                    what = type(statement).__name__
                    yield Refusal(statement.lineno, f"a statement that runs when the file is loaded ({what})")


def _is_main(test: ast.expr) -> bool:
    return ast.unparse(test) in ("__name__ == '__main__'", "'__main__' == __name__")


def _bound_when_run(tree: ast.Module) -> Iterator[Refusal]:
    """What a main block binds that the file has already, or the block binds where the file is only imported."""
    known = {name for statement in tree.body for name in _names(statement)}
    for statement in tree.body:
        if isinstance(statement, ast.If):
            if statement.orelse:
                yield Refusal(statement.orelse[0].lineno, "a statement that runs when the file is loaded")
            for name, line in binders(*statement.body):
                if name in known:
                    yield Refusal(line, f"{name} is bound again when the file is run")


def _names(statement: ast.stmt) -> list[str]:
    """What a statement defines, imports or names as a constant."""
    match statement:
        case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
            return [name]
        case ast.Import(names=names) | ast.ImportFrom(names=names):
            return [(alias.asname or alias.name).partition(".")[0] for alias in names]
        case _:  # nothing else defines at the top of a file
            return [name for name, _ in _constants([statement])]


def _other_class(node: ast.ClassDef) -> Iterator[Refusal]:
    plain = all(isinstance(b, ast.Name) and b.id in {"object", "Enum"} for b in node.bases)
    if node.decorator_list or node.keywords or not plain:
        yield Refusal(node.lineno, f"the class {node.name} has a decorator, a base or a metaclass")
    elements = any(isinstance(b, ast.Name) and b.id == "Enum" for b in node.bases)
    allowed, hidden = (_SHOWN, "_") if elements else (_SHOWN | {"__init__"}, "__")
    for inner in node.body:
        if isinstance(inner, ast.FunctionDef) and inner.name not in allowed and inner.name.startswith(hidden):
            yield Refusal(inner.lineno, f"the method {inner.name} may run when the file is loaded")
        simple = isinstance(inner, ast.FunctionDef | ast.Pass) or next(_constants([inner]), None) is not None
        if not simple and not (isinstance(inner, ast.Expr) and isinstance(inner.value, ast.Constant)):
            yield Refusal(inner.lineno, f"a statement that runs when the class {node.name} is made")


def _class(node: ast.ClassDef) -> Iterator[Refusal]:
    if node.decorator_list:
        yield Refusal(node.lineno, f"the class {node.name} is decorated")
    if node.keywords:
        yield Refusal(node.lineno, f"the class {node.name} has a metaclass or other keywords")
    if any(not (isinstance(base, ast.Name) and base.id == "object") for base in node.bases):
        yield Refusal(node.lineno, f"the class {node.name} has a base class, whose methods may do anything")
    for inner in node.body:
        match inner:
            case ast.FunctionDef(name=name):
                if name.startswith("__") and name != "__init__":
                    yield Refusal(inner.lineno, f"the method {name} changes what the class' own text means")
            case ast.Pass() | ast.Expr(value=ast.Constant()):
                pass
            case _:  # likewise
                if next(_constants([inner]), None) is None:
                    yield Refusal(inner.lineno, f"a statement that runs when the class {node.name} is made")


def _constants(body: list[ast.stmt]) -> Iterator[tuple[str, ast.expr]]:
    """``NAME = number or text``."""
    for statement in body:
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)], value=value) if _is_constant(value):
                yield name, value
            case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value) if _is_constant(value):
                yield name, value


def _is_constant(value: ast.expr) -> bool:
    match value:
        case ast.Constant(value=bool() | int() | float() | str()):
            return True
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int() | float())):
            return True
    return False


def _twice(body: list[ast.stmt], where: str) -> Iterator[Refusal]:
    seen: set[str] = set()
    for statement in body:
        for name in _names(statement):
            if name in seen:
                yield Refusal(statement.lineno, f"{name} is defined twice in {where}")
            seen.add(name)


def _imports(tree: ast.Module, file: Path) -> Iterator[Refusal]:
    beside = tuple(file.parent.iterdir())
    for part in ast.walk(tree):
        if isinstance(part, ast.Import):
            names = [alias.name for alias in part.names]
            renamed = [alias for alias in part.names if alias.asname not in (None, alias.name)]
        elif isinstance(part, ast.ImportFrom):
            names = [part.module or "."] if not part.level else ["."]
            renamed = [alias for alias in part.names if alias.name == "*" or alias.asname not in (None, alias.name)]
        else:
            continue
        if renamed:
            yield Refusal(part.lineno, "an import of everything, or under another name")
        for name in names:
            if name not in MODULES:
                hint = f"only {', '.join(MODULES)} may be imported"
                yield Refusal(part.lineno, f"the import of {name}: what it runs is not looked at", hint)
            head = name.partition(".")[0]
            if any(p.name.partition(".")[0] == head for p in beside if p.is_dir() or p.suffix in _LIBRARIES):
                yield Refusal(part.lineno, f"a file beside this one is called {head}, as the module is")
            if isinstance(part, ast.ImportFrom):
                known = MODULES.get(name, {alias.name for alias in part.names})
                for taken in sorted({alias.name for alias in part.names} - known):
                    yield Refusal(part.lineno, f"{taken} of {name} is not known to leave other code as it is")
    yield from _used(tree)


def _used(tree: ast.Module) -> Iterator[Refusal]:
    """A module's name is used only with one of its supported parts."""
    heads = {a.name.partition(".")[0] for part in ast.walk(tree) if isinstance(part, ast.Import) for a in part.names}
    plain: set[int] = set()
    for part in ast.walk(tree):
        if isinstance(part, ast.Attribute) and isinstance(part.ctx, ast.Load):
            whole = part.value.value if isinstance(part.value, ast.Attribute) else part.value
            if isinstance(whole, ast.Name) and part.attr in MODULES.get(ast.unparse(part.value), ()):
                plain.add(id(whole))
    for part in ast.walk(tree):
        if isinstance(part, ast.Name) and part.id in heads and id(part) not in plain:
            yield Refusal(part.lineno, f"{part.id} stands here for more than a known part of the module")


def _everywhere(tree: ast.Module) -> Iterator[Refusal]:
    """What no part of the file may have, whether a step comes there or not."""
    for name, line in binders(tree):
        if name in BUILTINS:
            yield Refusal(line, f"{name} is bound anew")
    for part in ast.walk(tree):
        line = getattr(part, "lineno", 1)
        match part:
            case ast.Name(id=name) if name in _TREACHEROUS:
                yield Refusal(line, f"{name} can change or read what the text does not show")
            case ast.Name(id=name, ctx=ctx) if _dunder(name) and name not in _NAMED:
                if name != "__name__" or not isinstance(ctx, ast.Load):
                    yield Refusal(line, f"{name} changes or reads what the text does not show")
            case ast.Attribute(attr=name) if _dunder(name) or name in _FRAMES:
                yield Refusal(line, f"the attribute {name} reaches behind the text")
            case ast.NamedExpr():
                yield Refusal(line, "a name is bound within an expression")
            case ast.AugAssign(op=ast.BitOr()):
                yield Refusal(line, "|= changes a mapping")
            case ast.AnnAssign(annotation=annotation) if _calls(annotation):
                yield Refusal(line, "a call in an annotation or default runs when the file is loaded")
            case ast.ClassDef() if any(_private(name) for name in _written(part)):
                yield Refusal(line, f"{part.name} has names that begin with __, which Python changes within a class")
            case ast.Attribute(attr=name) if name in _MUTATING:
                yield Refusal(line, f".{name} changes a mapping or list")
            case ast.Subscript(ctx=ast.Store()):
                yield Refusal(line, "an element of a mapping or list is changed")
            case ast.Global() | ast.Nonlocal():
                yield Refusal(line, "a name of another scope is bound")
            case ast.Delete():
                yield Refusal(line, "del")
            case ast.FunctionDef() | ast.ClassDef() if getattr(part, "type_params", None):
                yield Refusal(line, f"{part.name} has parameters of types")
            case ast.FunctionDef(decorator_list=[_, *_]) | ast.AsyncFunctionDef(decorator_list=[_, *_]):
                yield Refusal(line, f"the function {part.name} is decorated")
            case ast.FunctionDef(args=arguments, returns=returns) if _calls(arguments, returns):
                yield Refusal(line, "a call in an annotation or default runs when the file is loaded")
            case ast.AsyncFunctionDef() | ast.Await() | ast.Yield() | ast.YieldFrom():
                yield Refusal(line, "a generator or coroutine")
            case ast.Constant(value=str(text)) if "__setattr__" in text or "__getattribute__" in text:
                yield Refusal(line, "a text that names what reaches behind the text")


def _calls(*roots: ast.AST | None) -> bool:
    return any(isinstance(part, ast.Call) for root in roots if root for part in ast.walk(root))


def _dunder(name: str) -> bool:
    return name.startswith("__") and name.endswith("__")


def _private(name: str) -> bool:
    return name.startswith("__") and not name.endswith("__")


def _written(node: ast.AST) -> Iterator[str]:
    """The names in a part, whether they are used or bound."""
    yield from (name for name, _ in binders(node))
    for part in ast.walk(node):
        match part:
            case ast.Name(id=name) | ast.Attribute(attr=name):
                yield name
            case _:  # no use of a name; a keyword is none either
                pass


def _written_elsewhere(tree: ast.Module, parts: Parts) -> Iterator[Refusal]:
    """What the class holds or is called by, written where it does not stand: outside its methods, or in one that is
    neither `__init__` nor reached by `step`; and an attribute of anything else than a method's own object."""
    reached = reachable(parts, "step") | reachable(parts, "__init__")
    allowed: dict[int, str] = {}
    for name in reached:
        method = parts.methods[name]
        first = method.args.args[0].arg if method.args.args else ""
        allowed |= {id(inner): first for inner in ast.walk(method)}
    used = {n.attr for name in reached for n in ast.walk(parts.methods[name]) if isinstance(n, ast.Attribute)}
    used |= {*parts.methods, *parts.of_class}
    objects = {
        id(inner): method.args.args[0].arg
        for node in tree.body
        if isinstance(node, ast.ClassDef)
        for method in node.body
        if isinstance(method, ast.FunctionDef) and method.args.args
        for inner in ast.walk(method)
    }
    for part in ast.walk(tree):
        if not isinstance(part, ast.Attribute) or isinstance(part.ctx, ast.Load):
            continue
        own = isinstance(part.value, ast.Name) and part.value.id == allowed.get(id(part))
        if not own and not (isinstance(part.value, ast.Name) and part.value.id == objects.get(id(part))):
            yield Refusal(part.lineno, f"{part.attr} of what is no method's own object is written")
        elif not own and part.attr in used:
            yield Refusal(part.lineno, f"{part.attr} is written here too, outside what a step does")
        elif own and (part.attr in parts.methods or part.attr in parts.of_class):
            yield Refusal(part.lineno, f"{part.attr} of the class is hidden by an attribute")


_CONSTRUCTS: Mapping[str, tuple[str, str]] = {
    "ListComp": ("a list comprehension", "write a `for` loop"),
    "SetComp": ("a set comprehension", "write a `for` loop"),
    "DictComp": ("a dict comprehension", "write a `for` loop"),
    "GeneratorExp": ("a generator expression", "write a `for` loop"),
    "Lambda": ("a lambda", "write a function of the module"),
    "List": ("a list as a value", "give each item a name of its own"),
    "Tuple": ("a tuple as a value", "give each item a name of its own"),
    "Set": ("a set as a value", "give each item a name of its own"),
    "Dict": ("a dict as a value", "give each item a name of its own"),
    "JoinedStr": ("an f-string", "write each text as a constant"),
    "Constant": ("this constant", "write a number, a truth value or a text"),
    "Pow": ("the operator **", "multiply"),
    "While": ("while", "write `for … in range(…)`"),
    "Try": ("try", "ask with `if` before the exception could be raised"),
    "Raise": ("raise", "return outputs that the contract allows"),
    "Assert": ("assert", "write an `if`: Python with -O does not check it"),
    "With": ("with", ""),
    "Match": ("match", "write `if` and `elif`"),
    "For": ("for … else", "write the `else` part after the loop"),
    "Expr": ("a statement without effect on the outputs", "remove it"),
    "Subscript": ("an index or a part of what is no input sequence", ""),
    "FunctionDef": ("a function within a function", "write a function of the module"),
    "ClassDef": ("a class within a function", "write it at the top of the file"),
    "Import": ("an import within a function", "write it at the top of the file"),
    "ImportFrom": ("an import within a function", "write it at the top of the file"),
    "NamedExpr": ("the operator :=", "assign in a line before"),
    "AnnAssign": ("an annotation without a value", "remove it"),
    "Is": ("the comparison `is`", "write `==`"),
    "IsNot": ("the comparison `is not`", "write `!=`"),
}
"""A class of syntax → its name for people, and what to write instead."""
_SCOPES = (
    *(ast.FunctionDef, ast.Lambda, ast.ClassDef, ast.NamedExpr, ast.Import, ast.ImportFrom),
    *(ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp),
)
"""What binds names within a function otherwise than its statements do."""


def outside(part: ast.AST, line: int) -> Refusal:
    """The refusal of syntax that is not in the subset."""
    kind = type(part).__name__
    words, instead = _CONSTRUCTS.get(kind, (kind, ""))
    refusal = Refusal(line, f"{words} is not in the subset", instead)
    if isinstance(part, ast.expr | ast.stmt):
        refusal.within(part)
    return refusal


def reachable(parts: Parts, start: str) -> set[str]:
    """The methods that a method comes to, itself among them."""
    found: set[str] = set()
    stack = [start]
    while stack:
        name = stack.pop()
        if name in found or name not in parts.methods:
            continue
        found.add(name)
        stack += [n.attr for n in ast.walk(parts.methods[name]) if isinstance(n, ast.Attribute)]
    return found


def plain_arguments(function: ast.FunctionDef) -> list[str]:
    """The names of its arguments. Raises Refusal where there are others than plain ones."""
    a = function.args
    if a.posonlyargs or a.kwonlyargs or a.vararg or a.kwarg or a.defaults:
        raise Refusal(function.lineno, f"{function.name} has arguments other than plain ones without default")
    return [argument.arg for argument in a.args]


def bound_names(function: ast.FunctionDef) -> frozenset[str]:
    """The names that its body binds: local everywhere in it. Arguments that it leaves alone are not among them."""
    for part in ast.walk(function):
        if isinstance(part, _SCOPES) and part is not function:
            raise outside(part, part.lineno)
    return frozenset(name for name, _ in binders(*function.body))
