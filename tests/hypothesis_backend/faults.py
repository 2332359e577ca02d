"""Functions with one fault each, of as many kinds as we know, and beside each its honest twin, without the fault.

`CONTRACT` is the node of all; `y` is what a function returns. A body that is one expression is that of `return`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

CONTRACT = """
context {{ Mode : {{idle, go, stop}}; Rows : <NATURAL>; Loads : <REAL>; Marked : NATURAL --> BOOL;
          Order : {{ move(REAL, NATURAL), rest }}; }}
node made {{
  inputs( a : REAL, b : REAL, k : INTEGER, n : NATURAL, loads : Loads, rows : Rows, word : STRING, mode : Mode,
          p : BOOL, at : Marked, order : Order )
  outputs( y : BOOL )
  topics()
  {assume}
  guarantee g ( {formula} )
}}
"""

PORTS = "a, b, k, n, loads, rows, word, mode, p, at, order"


@dataclass(frozen=True, slots=True)
class Fault:
    """What is wrong is the difference between the two bodies."""

    name: str
    faulty: str
    honest: str = "True"
    formula: str = "y"
    before: str = ""
    """What stands in the file before the function."""
    files: Mapping[str, str] = field(default_factory=dict)
    assume: str = ""
    numbers: str = "exact"

    def program(self, *, faulty: bool) -> str:
        body = self.faulty if faulty else self.honest
        if "return" not in body:
            body = f"return {body}"
        lines = "".join(f"    {line}\n" for line in body.splitlines())
        return f"{self.before}\n\ndef y({PORTS}):\n{lines}"

    def contract(self) -> str:
        return CONTRACT.format(formula=self.formula, assume=f"assume( {self.assume} )" if self.assume else "")


_COUNT = "calls = 0\n"
_EVERY = ("all(x > 0 for x in loads)", "y <=> (forall(i in indices(loads) | loads(i) > 0))")

FAULTS = (
    # numbers that a program holds, but does not write down
    Fault("a length that is calculated", "len(loads) <= LIM * 3", before="LIM = 7"),
    Fault("a length far off", "len(rows) != LIM ** 2 + 1", before="LIM = 31"),
    Fault("a length of a class", "len(rows) < C.most * C.times", before="class C:\n    most, times = 19, 13"),
    Fault("a default", "less(len(loads))", before="def less(x, most=37 * 9):\n    return x <= most"),
    Fault(
        "a module beside it", "len(loads) <= limits.MOST", before="import limits", files={"limits.py": "MOST = 10 * 77"}
    ),
    Fault(
        "a file of parameters",
        "a != P['odd']",
        before="import json, pathlib\nP = json.loads(pathlib.Path(__file__).with_name('p.json').read_text())",
        files={"p.json": '{"odd": 8123.25}'},
    ),
    Fault(
        "a file of lines",
        "n != P['high']['odd']",
        before="import pathlib\nP = {'high': dict([(w[0], int(w[1])) for w in map(str.split, "
        "pathlib.Path(__file__).with_name('p.txt').read_text().splitlines())])}",
        files={"p.txt": "even 4\nodd 918273\n"},
    ),
    Fault("a sum of constants", "n != BASE + 17 * STEP", before="BASE, STEP = 4000, 271"),
    Fault("a product far off", "k != -(STEP ** 3) - 1", before="STEP = 271"),
    Fault("a value of the library", "a < math.pi * 1000 or a > math.pi * 1000 + 1", before="import math"),
    Fault("a text made of digits", "str(n) != '7' * 5"),
    Fault("digits of a number", "str(n)[-3:] != '777'"),
    Fault("bits", "n & MASK != MASK", before="MASK = 0b101000100010"),
    Fault("turned bits", "n ^ 0x5A5A != 0x1234"),
    Fault("a number in a text", "not (word.isdigit() and int(word) == 4711)"),
    Fault(
        "a text of two parts",
        "parsed(word)",
        before="def parsed(text):\n    left, _, right = text.partition('=')\n"
        "    return not (left == 'mode' and right == 'off')",
    ),
    Fault("a long text that ends so", "not (word.endswith('.tmp') and len(word) > 12)"),
    Fault("a remainder", "n % 1021 != 1020"),
    Fault("a quotient", "n // 97 != 41"),
    Fault("wrapped", "n == n % 2 ** 20"),
    Fault("wrapped as a machine does", "(k + 2 ** 31) % 2 ** 32 - 2 ** 31 == k"),
    Fault("packed", "struct.pack('>q', k)[0] in (0, 255)", before="import struct"),
    Fault("shifted", "n >> 13 != 5"),
    # the shape of sequences
    Fault(
        "only the first",
        "all(x > 0 for x in loads[:LIM])",
        *_EVERY,
        "LIM = 3 * 7",
    ),
    Fault(
        "a loop with an end",
        "for i in range(min(len(loads), LIM)):\n    if loads[i] <= 0:\n        return False\nreturn True",
        *_EVERY,
        "LIM = sum((3, 4, 11))",
    ),
    Fault(
        "only seven",
        "for i in range(7):\n    if i < len(loads) and loads[i] <= 0:\n        return False\nreturn True",
        *_EVERY,
    ),
    Fault(
        "a window",
        "all(x > 0 for x in collections.deque(loads, maxlen=WIDE))",
        *_EVERY,
        "import collections\nWIDE = 2 ** 5 + 1",
    ),
    Fault(
        "zipped",
        "all(x > 0 for x, _ in zip(loads, NAMES))",
        *_EVERY,
        "NAMES = 'abcd' * 6",
    ),
    Fault(
        "every other",
        "all(x > 0 for x in loads[::2])",
        *_EVERY,
    ),
    Fault(
        "not the last",
        "all(x > 0 for x in loads[:-1])",
        *_EVERY,
    ),
    Fault("two that are equal", "len(set(loads)) == len(loads) or len(loads) < 3"),
    Fault("falling", "not (len(loads) > 3 and list(loads) == sorted(loads, reverse=True) and loads[0] > loads[-1])"),
    Fault("a sum", "sum(loads) != TOTAL", before="TOTAL = 12.5 * 41"),
    Fault("a mean", "not loads or sum(loads) / len(loads) < LIM / 3", before="LIM = 20000"),
    Fault("a sorted one", "sorted(rows)[-1:] != [4711 * 3]"),
    Fault("as long as a number", "len(rows) != n or n < 3"),
    Fault("a place in it", "n >= len(loads) or loads[n] != a or a == 0"),
    Fault("first and last", "len(loads) < 3 or loads[0] != loads[-1] + 11"),
    Fault("many points", "len(at.points()) < 9"),
    Fault("a point far off", "not at(5 * 131)", before=""),
    Fault("an argument", "not (order[0] == 'move' and order[1] > order[2] * 1000 + 1)"),
    Fault("an argument at a sum", "not (order[0] == 'move' and order[1] + a == LIM)", before="LIM = 33.3"),
    # relations between inputs
    Fault("a strip of two", "a + b != 1000"),
    Fault("a thin strip", "not 1000 < a + b < 1000.01"),
    Fault("equal", "a != b or a < 5"),
    Fault("one apart", "k != n + 1 or n < 100"),
    Fault("a multiple", "a != 7 * b or b < 9"),
    Fault("a product", "a * b != 1001 or b < 2"),
    Fault("a square", "n * n != 5329 * 4"),
    Fault("near a parabola", "abs(a * a - 3 * a - 700) > 0.01"),
    Fault("a circle", "not 99 < a * a + b * b < 100"),
    Fault("three together", "a + b - n != LIM", before="LIM = 77.5"),
    Fault(
        "one behind another",
        "if a > 1234:\n    if b > a + 17:\n        if n == k + 300:\n            return False\nreturn True",
    ),
    Fault("five deep", "not (a > 777 and b > a + 1 and n > 55 * 7 and k < -n and mode == 'stop')"),
    Fault("of one mode", "not (mode == 'stop' and p and n == LIM)", before="LIM = 29 * 31"),
    Fault(
        "by a helper",
        "clip(a, -LIM, LIM) == a",
        before="LIM = 17 * 1000\ndef clip(x, low, high):\n    return max(low, min(x, high))",
    ),
    Fault(
        "by a table",
        "TABLE.get(n, True)",
        before="TABLE = {j * j + 1: True for j in range(40)}\nTABLE[31 * 31 + 1] = False",
    ),
    Fault("by a set", "n not in BAD", before="BAD = frozenset(range(40000, 40004))"),
    Fault("by a search", "bisect.bisect(STEPS, a) != 4", before="import bisect\nSTEPS = [j ** 5 for j in range(9)]"),
    Fault("by a match", "match n:\n    case 4711 | 815:\n        return False\nreturn True"),
    Fault(
        "by an exception",
        "try:\n    return TABLE[n % 100000] == 1\nexcept IndexError:\n    return False",
        before="TABLE = [1] * 3000",
    ),
    # texts
    Fault("a padded text", "word.strip() == 'go'", "word == 'go'", 'y <=> word == "go"'),
    Fault("a text in capitals", "word.lower() == 'go'", "word == 'go'", 'y <=> word == "go"'),
    Fault("a text that begins so", "word.startswith('go')", "word == 'go'", 'y <=> word == "go"'),
    Fault("a text that ends so", "word.endswith('go')", "word == 'go'", 'y <=> word == "go"'),
    Fault("a part of a text", "word in 'go stop'", "word in ('go', 'stop')", 'y <=> word == "go" or word == "stop"'),
    Fault(
        "a look-alike",
        "unicodedata.normalize('NFKC', word) == 'go'",
        "word == 'go'",
        'y <=> word == "go"',
        "import unicodedata",
    ),
    Fault("a text without marks", "word.replace('\\u200b', '') == 'go'", "word == 'go'", 'y <=> word == "go"'),
    Fault("a text that is put together", "word != '-'.join(PARTS)", before="PARTS = ['left', 'arm', 'off']"),
    Fault("a text turned round", "word[::-1] != 'pots'"),
    Fault("a number as text", "word != str(LIM * 3)", before="LIM = 77"),
    Fault("a long text", "len(word) < 200"),
    Fault("a coded text", "word.encode() != bytes([115, 116, 97, 114])"),
    Fault("an expression", "re.fullmatch(r'v\\d', word) is None", before="import re"),
    # what a program keeps
    Fault("after many calls", "global calls\ncalls += 1\nreturn calls < 20000", before=_COUNT),
    Fault("at one call", "global calls\ncalls += 1\nreturn calls != LIM * 7", before=_COUNT + "LIM = 1301"),
    Fault("a list that grows", "seen.append(n)\nreturn len(seen) <= 5000", before="seen = []"),
    Fault("a sum that grows", "global calls\ncalls += 0.01\nreturn calls < 150", before=_COUNT),
    Fault("the same again", "global calls\nsame, calls = calls == a, a\nreturn not (same and a > 3)", before=_COUNT),
    Fault("after many, at a number", "global calls\ncalls += 1\nreturn calls < 9000 or a != 5", before=_COUNT),
    # machine numbers
    Fault(
        "one unit aside",
        "a >= LIM",
        "a >= 24.25",
        "y <=> a >= 24.25",
        "import math\nLIM = math.nextafter(48.5 / 2, 99)",
        numbers="float64",
    ),
    Fault("absorbed", "not (a > 1 and a + b == a and b != 0)", numbers="float64"),
    Fault("a rounded sum", "a + b - a == b", "True", "y", numbers="float64"),
    Fault("too large to square", "a * a < math.inf", "True", "y", "import math", numbers="float64"),
    Fault("too small to square", "a == 0 or a * a > 0", numbers="float64"),
    Fault("divided", "a == 93.5 or abs(1 / (2 * a - 11 * 17)) < 100", "a == 93.5 or abs(1 / (2 * a - 11 * 17)) >= 0"),
    Fault("rounded", "round(a) == a or a < 0 or int(a) + 1 > a + 0.000001"),
)
