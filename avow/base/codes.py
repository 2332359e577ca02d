"""Every diagnostic code of the language, declared once: its meaning, and a text that triggers it.

Numbers: 0xx the file, 1xx the syntax, 2xx names, 3xx sorts, 4xx lints (warnings that can be switched off).
The tests check every example, and docs/language.md lists every code. Other codes are in `avow.base.codes_plan`,
`codes_ros`, `codes_workspace` and in the backends; docs/diagnostics.md has one table of all.
"""

from __future__ import annotations

from avow.base.diagnostics import Severity
from avow.base.records import dataclass

FRAME = """\
context {{
  Status  : {{low, high}};
  Command : {{ go(REAL, REAL), stop }};
  Marked  : NATURAL --> BOOL;
}}
node monitor {{
  inputs( level : REAL, count : NATURAL, marked : Marked )
  outputs( status : Status, command : Command )
  topics( float64 level matches(in.level), int32 count matches(in.count), string marked matches(in.marked),
          string status matches(out.status), string command matches(out.command) )
  {clause}
}}
"""
"""The file around an example that is only a clause."""


@dataclass(frozen=True, slots=True)
class Code:
    """A kind of fault. `example` is a file, or the clauses of `FRAME`'s node; empty if no text can show it (an
    unreadable file)."""

    code: str
    title: str
    explanation: str
    example: str = ""
    severity: Severity = Severity.ERROR
    remedy: str = ""
    """The remedy; empty if the example or the message gives it."""

    @property
    def text(self) -> str:
        """The example as a whole file."""
        if self.example.lstrip().startswith(("assume", "guarantee", "A(", "G(", "// avow")):
            return FRAME.format(clause=self.example)
        return self.example

    @property
    def is_lint(self) -> bool:
        """Whether a plan's `lints_off` or a comment ``// avow: allow CODE`` can switch it off."""
        return self.severity is Severity.WARNING


def declare(code: str, title: str, explanation: str, remedy: str, *, warning: bool = False) -> Code:
    """A code whose example is no text of RCL."""
    return Code(code, title, explanation, "", Severity.WARNING if warning else Severity.ERROR, remedy)


def register(*codes: Code) -> dict[str, Code]:
    """Codes by name, in order. Raises ValueError if one is declared twice."""
    found: dict[str, Code] = {}
    for code in codes:
        if code.code in found:
            raise ValueError(f"{code.code} is declared twice")
        found[code.code] = code
    return found


_NODE = "node n {{ inputs({}) outputs({}) topics({}) {} }}"


def _node(inputs: str = "", outputs: str = "b : BOOL", topics: str = "", clauses: str = "guarantee(out.b)") -> str:
    return _NODE.format(inputs, outputs, topics, clauses)


_FILE = (
    Code("RCL001", "no contract", "The file holds neither a context nor a node.", "// nothing yet"),
    Code("RCL002", "unreadable file", "The file does not exist or is not readable."),
    Code("RCL003", "file too large", "Contracts have at most 4 MB and a million tokens."),
    Code("RCL004", "not UTF-8", "The place is the first byte that is not UTF-8."),
    Code("RCL005", "not a text", "The file holds a NUL character.", "node n\0"),
    Code(
        "RCL006",
        "too many errors",
        "Avow shows at most 200 diagnostics of a file.",
        "".join(f"`{n}`" for n in range(210)),
    ),
    Code(
        "RCL007",
        "layout would change the contract",
        "`avow fmt` would change the meaning of this part, which stays as it is. Please report this defect.",
    ),
)

_SYNTAX = (
    Code(
        "RCL101",
        "a sign of another notation",
        "The hint has the RCL form.",
        "guarantee(in.level > 0 && out.status == low)",
    ),
    Code(
        "RCL102",
        "`--` for a comment",
        "Comments are `// …` to the end of the line, or `/* … */`.",
        "guarantee(out.status == low) -- always",
    ),
    Code("RCL103", "comment not closed", "A `/*` has no `*/`.", "node n { /* to be done"),
    Code(
        "RCL104",
        "string not closed",
        "A string ends on the line on which it begins.",
        'guarantee low "It is low ( out.status == low )',
    ),
    Code(
        "RCL105",
        "no number",
        "Numbers are `12` or `0.25`, without exponent; names begin with a letter.",
        "guarantee(in.level < 1e6)",
    ),
    Code(
        "RCL106",
        "no escape",
        'In a string, a backslash is followed by `\\`, `"`, `n` or `t`.',
        'guarantee low "C:\\data" (out.status == low)',
    ),
    Code("RCL107", "stray characters", "RCL has no such characters.", "guarantee(out.status == low §)"),
    Code(
        "RCL110",
        "nested too deeply",
        "Formulas and types nest at most 150 levels deep, except chains (`a and b and …`); a constant or type "
        "has at most 20,000 parts, a clause 200,000.",
        "guarantee(" + "(" * 200 + "TRUE" + ")" * 200 + ")",
    ),
    Code(
        "RCL111",
        "not a clause",
        "A file is one `context { … }` and any number of `node NAME { … }`.",
        "types { A : {a}; }",
    ),
    Code("RCL112", "second context", "A file has at most one context.", "context { A : {a}; } context { B : {b}; }"),
    Code("RCL113", "something else expected", "The message says what is expected.", "node { }"),
    Code("RCL114", "empty context", "A context declares at least one type or constant.", "context { }"),
    Code("RCL115", "bracket not closed", "A `(` or `{` has no partner.", "guarantee( (out.status == low )"),
    Code(
        "RCL116",
        "parts out of order",
        "The order is: inputs, outputs, topics, assumptions, guarantees.",
        "guarantee(out.status == low) assume(in.level > 0)",
    ),
    Code(
        "RCL117",
        "part given twice",
        "A node has one list each of inputs, outputs and topics.",
        _node() + _node(clauses="guarantee(out.b) inputs()").replace("node n", "node m"),
    ),
    Code(
        "RCL118",
        "part missing",
        "A node has inputs, outputs and topics (possibly empty), and a guarantee.",
        "node n { outputs(b : BOOL) topics() guarantee(out.b) }",
    ),
    Code(
        "RCL119",
        "empty clause",
        "`assume()` and `guarantee()` need a formula.",
        "assume() guarantee(out.status == low)",
    ),
    Code(
        "RCL120",
        "unexpected sign",
        "The formula, type or list cannot continue like this.",
        "guarantee(out.status = low)",
    ),
    Code(
        "RCL121",
        "no chain",
        "Comparisons chain one way (`0 <= r < 120`), without `!=` and `in`.",
        "guarantee(0 <= in.level > 3)",
    ),
)

_NAMES = (
    Code("RCL201", "undeclared name", "Nothing of that name is declared.", "guarantee(out.status == lou)"),
    Code(
        "RCL202",
        "input or output?",
        "A bare name is ambiguous here: write `in.v` or `out.v`.",
        _node("b : BOOL", clauses="guarantee(b)"),
    ),
    Code(
        "RCL203",
        "no such input or output",
        "The node has no input or output of that name.",
        "guarantee(in.status == low)",
    ),
    Code("RCL204", "not a value", "The name is a type or a node.", "guarantee(out.status == Status)"),
    Code(
        "RCL205",
        "another node's variable",
        "A contract refers only to its own inputs and outputs.",
        "guarantee(other.status == low)",
    ),
    Code("RCL206", "no such node", "A plan's formula names a node that does not exist."),
    Code(
        "RCL207",
        "name in use",
        "The name of a quantified variable must be new.",
        "guarantee(forall(level in REAL | level < 3))",
    ),
    Code("RCL208", "undeclared type", "The type is not declared.", _node("a : Colour")),
    Code("RCL209", "built-in name", "`length` is the length of sequences.", "context { length = 3; }"),
    Code("RCL210", "declared twice", "A type or constant is declared once.", "context { A : {a}; A : {b}; }"),
    Code("RCL211", "name and element", "A name cannot be both declared and an element.", "context { A : {b}; b = 3; }"),
    Code(
        "RCL212", "refers to itself", "A type or constant cannot be part of itself.", "context { A : {nil, cons(A)}; }"
    ),
    Code(
        "RCL213",
        "shared element",
        "Two types must not share an element or constructor.",
        "context { A : {red, green}; B : {red, blue}; }",
    ),
    Code(
        "RCL214",
        "port declared twice",
        "A node's inputs have different names, and so have its outputs.",
        _node("a : BOOL, a : REAL"),
    ),
    Code(
        "RCL215",
        "clause name used twice",
        "Clauses of a node have different names (unnamed ones: A1, A2, … and G1, G2, …).",
        _node(clauses="guarantee g (out.b) guarantee g (not out.b)"),
    ),
    Code(
        "RCL216",
        "topic listed twice",
        "A node lists a topic once, or once for each of its variables, with the same type.",
        _node(topics="bool t, bool t"),
    ),
    Code(
        "RCL217",
        "no ROS type or name",
        "A topic needs a built-in or package type of ROS, and a valid ROS name.",
        _node(topics="Bool t"),
    ),
    Code(
        "RCL218",
        "matches nothing",
        "A topic matches an input or output of its own node.",
        _node(topics="bool t matches(out.c)"),
    ),
    Code("RCL219", "node declared twice", "Nodes have different names.", _node() + _node()),
    Code(
        "RCL220",
        "quantified constant",
        "A constant is a value; quantified formulas belong in clauses.",
        "context { C = (exists(x in REAL | x > 0)); }",
    ),
)

_SORTS = (
    Code("RCL301", "not a formula", "A truth value is needed here.", "guarantee(in.count)"),
    Code(
        "RCL302",
        "different types",
        "Only values of one type can be compared or collected.",
        "guarantee(out.status == in.level)",
    ),
    Code("RCL303", "wrong type", "Another type is needed here.", "guarantee(in.marked(in.level))"),
    Code(
        "RCL304",
        "not a function",
        "Only functions, constructors and sequences can be applied.",
        "guarantee(out.status(3) == low)",
    ),
    Code(
        "RCL305",
        "wrong number of arguments",
        "The function or constructor takes another number of arguments.",
        "guarantee(out.command == go(1))",
    ),
    Code("RCL306", "type cannot be told", "Nothing determines the type.", "guarantee(<> == <>)"),
    Code("RCL307", "no set", "`in` needs a set or a sequence.", "guarantee(in.level in REAL)"),
    Code("RCL308", "no number", "Arithmetic and order need numbers.", "guarantee(out.status < high)"),
    Code("RCL309", "division by zero", "The divisor is zero.", "guarantee(in.level / 0 > 1)"),
    Code(
        "RCL310",
        "quantified function",
        "Variables range over values, not functions.",
        "guarantee(exists(f in Marked | f(1)))",
    ),
    Code(
        "RCL311",
        "divisor not written down",
        "The divisor of `mod` and `div` is a positive whole number literal.",
        "guarantee(mod(in.count, in.count) == 0)",
    ),
    Code(
        "RCL312",
        "no such field",
        "Only records (`[x : REAL, y : REAL]`) have fields.",
        "guarantee(in.level.x > 1)",
    ),
    Code(
        "RCL320",
        "length of time without a unit",
        "Write `[5 steps]`, `[200 ms]` (ns, us, ms, s, min, h), or a REAL expression in seconds.",
        "guarantee(held[5](in.level > 3) -> out.status == high)",
    ),
    Code(
        "RCL321",
        "response in another place",
        "A response is the whole right side of a clause's outermost `->`, or the whole clause.",
        "guarantee(next(out.status == high) and in.level > 3)",
    ),
    Code(
        "RCL322",
        "one step only",
        "This formula is about one step, so operators on other steps are not allowed.",
        "context { C = (once(1 > 0)); }",
    ),
    Code(
        "RCL323",
        "wrong limit",
        "`held`, `within` and `for` need a limit; `once`, `historically` and `since` may have one. It is a number or a "
        "declared constant.",
        "guarantee(held(in.level > 3) -> out.status == high)",
    ),
    Code(
        "RCL324",
        "events and the time between steps",
        "`arrived` takes an input; `rose`, `fell` and `changed` take no formula with a limit in seconds; "
        "`steps( … )` is a clause.",
        "guarantee(rose(once[2 s](in.level > 3)) -> out.status == high)",
    ),
)


def _lint(code: str, title: str, explanation: str, example: str) -> Code:
    return Code(code, title, explanation, example, Severity.WARNING)


_LINTS = (
    _lint(
        "RCL401",
        "precedence without parentheses",
        "Another bracketing would mean something else. Add the parentheses of the hint.",
        "guarantee(in.level > 0 and in.count > 0 -> out.status == low)",
    ),
    _lint("RCL402", "unused input", "No assumption or guarantee refers to the input.", "guarantee(out.status == low)"),
    _lint(
        "RCL403",
        "unconstrained output",
        "The node may output any value.",
        "guarantee(out.status == low)",
    ),
    _lint(
        "RCL404",
        "topic without variable",
        "The topic matches no variable, so no monitor can use it.",
        _node(topics="bool t"),
    ),
    _lint("RCL405", "variable without topic", "No topic carries the variable, so no monitor sees it.", _node()),
    _lint(
        "RCL406",
        "two spellings",
        "Two names differ by a letter or two and may mean the same.",
        _node(topics="nav_plugin/At b matches(out.b)")
        + _node(topics="nav_plugins/At b matches(out.b)").replace("node n", "node m"),
    ),
    _lint(
        "RCL407",
        "unused variable",
        "The formula does not use the quantified variable.",
        "guarantee(forall(i in NATURAL | out.status == low))",
    ),
    _lint(
        "RCL408",
        "assumption without content",
        "The types of the inputs make the assumption true.",
        "assume(in.count >= 0) guarantee(out.status == low)",
    ),
    _lint(
        "RCL409",
        "bare name in `matches`",
        "Write `matches(in.v)` or `matches(out.v)`.",
        _node(topics="bool b matches(b)"),
    ),
    _lint(
        "RCL410",
        "nothing to allow",
        "The name after `avow: allow` is no code of a lint.",
        "// avow: allow RCL999\n  guarantee(out.status == low)",
    ),
    _lint(
        "RCL411",
        "variable on two topics",
        "A monitor reads the variable from one of two topics.",
        _node(topics="bool t matches(out.b), bool u matches(out.b)"),
    ),
    _lint(
        "RCL412",
        "total function looked up by value",
        "A total function has a value for all arguments. A relation (`… --> BOOL`) can say that some have "
        "none, or that a value is unique.",
        _node(
            "number : REAL x REAL --> NATURAL, i : NATURAL",
            clauses="guarantee(out.b <=> exists(x, y in REAL | in.number(x, y) == in.i))",
        ),
    ),
    _lint(
        "RCL413",
        "sentence and formula compare otherwise",
        "Formula and sentence compare with a number in opposite ways, or have different numbers.",
        'assume reading "The level is less than or equal to 0" (0 <= in.level) guarantee(out.status == low)',
    ),
    _lint(
        "RCL414",
        "one way or both ways",
        "The sentence says `if …`, the formula `<=>`; or the sentence says `exactly when`, the formula `->`.",
        'guarantee alarm "If the level is above 3, the status is high" (in.level > 3 <=> out.status == high)',
    ),
    _lint(
        "RCL415",
        "sentence names what the formula does not",
        "The formula lacks an element that the sentence names.",
        'guarantee halt "At a high level it stops" (in.level > 3 -> out.status == high)',
    ),
    _lint(
        "RCL416",
        "assumption about an output",
        "No provider of inputs can establish what a node outputs. Write a guarantee.",
        "assume(out.status == low) guarantee(out.status != high)",
    ),
    _lint(
        "RCL417",
        "calculated position",
        "Solvers rarely decide claims about `s(i + 1)`. Use two positions, `s(i)` and `s(j)`, if only the "
        "order matters.",
        "node n { inputs(s : <REAL>) outputs(b : BOOL) topics() guarantee(b <=> forall(i in <1 upto length(s) - 1> | "
        "s(i - 1) <= s(i))) }",
    ),
    _lint(
        "RCL418",
        "unused definition",
        "Nothing uses the definition, or it does not use its parameter.",
        "node n { inputs(b : BOOL) outputs(c : BOOL) topics() define d = not in.b; guarantee(out.c <=> in.b) }",
    ),
)

CODES: dict[str, Code] = {c.code: c for c in (*_FILE, *_SYNTAX, *_NAMES, *_SORTS, *_LINTS)}
"""Every code, in order."""
