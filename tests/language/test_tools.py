"""The grammar as a whole, the command line, the Pygments lexer, the language server."""

from __future__ import annotations

import functools
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from drawn.contracts import CONTRACT
from helpers import avow
from lark import Lark

from avow.language.lexer import Token, tokens
from avow.language.load import check_text
from avow.language.source import Reports, Source

# --- the grammar -----------------------------------------------------------------------------------------------------


@functools.cache
def grammar() -> Lark:
    text = (Path(__file__).parents[2] / "avow" / "language" / "grammar.lark").read_text("utf-8")
    return Lark(text, parser="lalr", lexer="basic", start="start")


def test_the_grammar_is_unambiguous_and_covers_whole_files(root: Path) -> None:
    """LALR(1) tables exist without conflict for `start`, the file as a whole, and accept what the parts accept."""
    for path in sorted(root.glob("contracts/*/*.rcl")):
        machine = grammar().parse_interactive("")
        for token in tokens(Reports(Source("f", path.read_text("utf-8")))):
            machine.feed_token(token)
        machine.feed_token(Token("$END", "", 0, 0))


def test_the_grammars_terminals_are_the_lexers() -> None:
    """Lark's own lexer, on the terminals as the grammar writes them, finds the same tokens as ours."""
    text = CONTRACT.replace(
        "TRUE", 'forall(x\', y in REAL | <1 upto k> == ns -> x\' !in {0.5} <=> "a\\"b" != s or <> == sq)'
    )
    theirs = [(t.type, str(t)) for t in grammar().lex(text)]
    ours = [(t.type, t.text) for t in tokens(Reports(Source("f", text)))]
    assert ours == theirs


# --- the command line ------------------------------------------------------------------------------------------------


@pytest.fixture
def files(tmp_path: Path) -> dict[str, str]:
    (tmp_path / "good.rcl").write_text(CONTRACT)
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "bad.rcl").write_text("node n { inputs() outputs(b : BOOL) topics() guarantee(c) }")
    return {"good": str(tmp_path / "good.rcl"), "bad": str(tmp_path / "sub" / "bad.rcl")}


def test_check(files: dict[str, str], tmp_path: Path) -> None:
    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return avow(*arguments, cwd=tmp_path)

    command = [sys.executable, "-m", "avow", "check", files["good"]]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert "1 file: " in done.stdout
    done = run("check", files["good"], files["bad"])
    assert done.returncode == 2
    assert "error[RCL201]" in done.stdout
    done = run("check", "--json", files["bad"])
    assert done.returncode == 2
    codes = [d["code"] for d in json.loads(done.stdout)["diagnostics"]]
    assert codes == ["RCL201"]
    assert json.loads(run("check", "--sarif", files["bad"]).stdout)["version"] == "2.1.0"
    assert run("check", "/no/such/file.rcl").returncode == 2


def invoke(name: str, *arguments: str, stdin: str | None = None) -> tuple[int, str]:
    import importlib

    command = importlib.import_module(f"avow.cli.{name}").command
    result = CliRunner().invoke(command, list(arguments), input=stdin, standalone_mode=False)
    assert result.exception is None, result.exception
    return result.return_value or 0, result.output


def test_check_off_and_folders(files: dict[str, str], tmp_path: Path) -> None:
    assert "RCL405" in invoke("check", files["good"])[1]
    assert "RCL405" not in invoke("check", "--off", "RCL405", files["good"])[1]
    assert "no code RCL9999" in avow("check", "--off", "RCL9999", files["good"], cwd=tmp_path).stderr
    code, output = invoke("check", str(tmp_path / "sub"))
    assert code == 2
    assert "RCL201" in output
    assert invoke("check", str(tmp_path / "empty"))[0] == 2
    assert "Nothing of that name" in invoke("check", "--explain", files["bad"])[1]


def test_check_of_a_system_reads_its_plan(tmp_path: Path) -> None:
    """What the plan says, and what the method's tool says of its options; warnings as the plan has them."""
    (tmp_path / "system.rcl").write_text(
        "node n { inputs( r : REAL ) outputs( b : BOOL ) topics() guarantee( b <=> r > 0 ) }\n"
    )
    plan = "system: s\ncontract: system.rcl\nnodes:\n  n: {methods: [{hoare: {program: p.imp}}]}\n"
    (tmp_path / "plan.yaml").write_text(plan)
    code, output = invoke("check", str(tmp_path))
    assert code == 2
    assert "p.imp" in output
    assert output.count("warning[RCL405]") == 1
    assert invoke("check", str(tmp_path / "plan.yaml")) == (code, output)
    (tmp_path / "p.imp").write_text("IF (r > 0) THEN b := TRUE ELSE b := FALSE ENDIF")
    code, output = invoke("check", str(tmp_path))
    assert code == 0, output
    (tmp_path / "plan.yaml").write_text(plan.replace("n: {", "m: {"))
    code, output = invoke("check", str(tmp_path))
    assert code == 2
    assert "plan.yaml:4:" in output
    (tmp_path / "plan.yaml").write_text(plan + "lints_off: [RCL405]\n")
    assert "RCL405" not in invoke("check", str(tmp_path))[1]
    text = (tmp_path / "system.rcl").read_text()
    (tmp_path / "system.rcl").write_text("context { define low(x : BOOL) = not x; }\n" + text)
    for formula, warned in (("not n.b", True), ("low(n.b)", False)):
        needed = f"requirements: {{R1: {{text: The robot is low., formula: {formula}}}}}\n"
        (tmp_path / "plan.yaml").write_text(plan + needed)
        assert ("RCL418" in invoke("check", str(tmp_path))[1]) is warned
    (tmp_path / "system.rcl").write_text(text)
    for wrong, said in (
        ("policy: sil9\n", "POLICY001"),
        ("requirements:\n  R: {text: t, temporal: alway (n.b)}\n", "`alway` is not declared"),
    ):
        (tmp_path / "plan.yaml").write_text(plan + wrong)
        code, output = invoke("check", str(tmp_path))
        assert code == 2
        assert said in output
    requirement = "requirements:\n  R: {text: It is on below 3, formula: n.r > 3 -> n.b}\n"
    (tmp_path / "plan.yaml").write_text(plan + requirement)
    code, output = invoke("check", str(tmp_path))
    assert code == 0
    assert invoke("check", "--sarif", str(tmp_path))[1].count(str(tmp_path / "system.rcl")) == 1
    (tmp_path / "p.imp").write_text("IF (r > 7) THEN b := TRUE ELSE b := FALSE ENDIF")
    text = (tmp_path / "system.rcl").read_text()
    (tmp_path / "system.rcl").write_text(text.replace("r > 0", "r > 5"))
    told = json.loads(invoke("check", "--sarif", str(tmp_path))[1])["runs"][0]
    (rule,) = [r for r in told["tool"]["driver"]["rules"] if r["id"] == "HOARE410"]
    assert rule["shortDescription"] == {"text": "other numbers"}
    assert "HOARE410 (other numbers): " in invoke("check", "--explain", str(tmp_path))[1]
    assert "the sentence says “below 3”, the formula `n.in.r > 3`" in output
    (tmp_path / "plan.yaml").write_text(plan + requirement + "lints_off: [RCL413]\n")
    assert "the sentence says" not in invoke("check", str(tmp_path))[1]


def test_fmt(tmp_path: Path) -> None:
    path = tmp_path / "f.rcl"
    path.write_text("node n{inputs()outputs(b:BOOL)topics()G(b)}")
    assert invoke("fmt", "--check", str(path))[0] == 1
    assert path.read_text() == "node n{inputs()outputs(b:BOOL)topics()G(b)}"
    assert invoke("fmt", str(path))[0] == 0
    assert invoke("fmt", "--check", str(tmp_path))[0] == 0
    code, output = invoke("fmt", "-", stdin="node n{inputs()outputs(b:BOOL)topics()G(b)}")
    assert (code, output) == (0, path.read_text())
    path.write_text("node n{")
    assert invoke("fmt", str(path))[0] == 2
    assert path.read_text() == "node n{"


def test_fmt_keeps_what_a_file_is(tmp_path: Path) -> None:
    path, link = tmp_path / "f.rcl", tmp_path / "link.rcl"
    text = "node n{inputs()outputs(b:BOOL)topics()G(b)}"
    path.write_text(text)
    path.chmod(0o640)
    link.symlink_to(path)
    assert invoke("fmt", str(link))[0] == 0
    assert link.is_symlink()
    assert path.stat().st_mode & 0o777 == 0o640
    path.write_text(text)
    path.chmod(0o440)
    code, said = invoke("fmt", str(path))
    assert code == 2
    assert "read-only" in said
    assert path.read_text() == text


def test_fmt_reports_in_order_and_nothing_after_an_open_comment(tmp_path: Path) -> None:
    path = tmp_path / "f.rcl"
    path.write_text("node n { inputs( /* to be done")
    said = invoke("fmt", str(path))[1]
    assert [line[:14] for line in said.splitlines() if line.startswith("error")] == ["error[RCL103]:"]
    path.write_text("node n { inputs(")
    assert [line.strip()[-3:] for line in invoke("fmt", str(path))[1].splitlines() if "-->" in line] == ["1:8", ":16"]


@pytest.mark.parametrize("notation", ["rcl", "unicode", "json"])
def test_translate(files: dict[str, str], tmp_path: Path, notation: str) -> None:
    code, output = invoke("translate", files["good"], "--to", notation)
    assert code == 0
    assert "halt" in output
    assert invoke("translate", files["good"], "--to", notation, "-o", str(tmp_path / "o"))[0] == 0
    assert (tmp_path / "o").read_text("utf-8") == output


# --- Pygments --------------------------------------------------------------------------------------------------------


def test_pygments(root: Path) -> None:
    from pygments.token import Comment, Error, Keyword, Name, Operator

    from avow.language.pygments_lexer import RclLexer

    for path in sorted(root.glob("contracts/*/*.rcl")):
        text = path.read_text("utf-8")
        found = list(RclLexer(stripnl=False, ensurenl=False).get_tokens(text))
        assert "".join(value for _, value in found) == text
        assert not any(kind is Error for kind, _ in found)
        kinds = {value: kind for kind, value in found}
        assert kinds["guarantee"] is Keyword.Declaration
        assert kinds["REAL"] is Keyword.Type
        assert kinds[re.findall(r"^node (\w+)", text, re.MULTILINE)[0]] is Name.Class
        assert kinds["->"] is Operator
        assert any(kind in Comment for kind, _ in found)


# --- the language server ---------------------------------------------------------------------------------------------

TEXT = """\
context { Stat : {red, green}; Limit = 3; }
node n {
  inputs( r : REAL )
  outputs( stat : Stat )
  topics( string s matches(out.stat) )
  guarantee fine "It is *fine*" ( forall(x in REAL | x < in.r -> stat == red and r < Limit) )
}
"""


def at(text: str, needle: str, plus: int = 0) -> int:
    return text.index(needle) + plus


def test_answers() -> None:
    from avow.lsp.features import analyse, definition, hover

    document = analyse(TEXT, "f")
    said = hover(document, at(TEXT, "stat == red"))
    assert said is not None
    assert "`out.stat` : `Stat` = `{red, green}`" in said
    assert "topic `s`" in said
    assert hover(document, at(TEXT, "x < in.r")) == "`x` : `REAL` (quantified)"
    assert "constant `Limit` = `3`" in (hover(document, at(TEXT, "Limit)")) or "")
    assert "an element of `Stat`" in (hover(document, at(TEXT, "red and")) or "")
    clause = hover(document, at(TEXT, "fine"), lambda node, clause: f"{node}/{clause}: proved by *x*")
    assert clause is not None
    assert "∀ x ∈ ℝ" in clause
    assert r"proved by \*x\*" in clause
    for needle, plus, place in (
        ("in.r ->", 3, (3, 11)),
        ("Stat )", 0, (1, 11)),
        ("red and", 0, (1, 19)),
        ("x < in.r", 0, (6, 42)),
        ("Limit)", 0, (1, 32)),
    ):
        (found,) = definition(document, at(TEXT, needle, plus))
        assert Source("f", TEXT).place(found.start) == place


def test_standing_of_a_guarantee(workspace: Path) -> None:
    """Hovering shows each method's latest verdict from the ledger, and nothing where there is none."""
    from avow.base.verdict import Link, Verdict
    from avow.base.workspace import Workspace
    from avow.cli.lsp import standing
    from avow.evidence.ledger import Ledger
    from avow.evidence.record import Evidence

    folder = workspace / "contracts" / "s"
    folder.mkdir(parents=True)
    assert standing(str(folder / "f.rcl"))("n", "fine") is None
    ledger = Ledger(Workspace(workspace).ledger("s"))
    for verdict in (Verdict.REFUTED, Verdict.PROVED):
        ledger.append(
            Evidence(
                *("s/n/guarantee/fine", "d", "k", "dafny", "dafny", "dafny", "2", (), verdict, Verdict.PROVED),
                *(Link.GENERATED, "", "2026-11-21T10:00:00Z", 1.0),
            )
        )
    assert standing(str(folder / "f.rcl"))("n", "fine") == "last time: proved by dafny (2026-11-21 10:00)"
    assert standing(str(folder / "f.rcl"))("n", "other") is None
    assert standing(str(workspace / "f.rcl"))("n", "fine") is None


def test_checking_does_not_import_the_solver(root: Path) -> None:
    """Editors and pre-commit check in milliseconds: no Z3, and Lark only when there is something to read."""
    code = (
        "import sys; from avow.language.load import check_text; assert 'lark' not in sys.modules; "
        "check_text('context { A : {a}; }', 'f'); "
        "assert not {'z3', 'doit', 'jinja2', 'hypothesis'} & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr


def test_texts_with_surrogates_do_not_break_the_tables() -> None:
    assert check_text("node \udc80", "f")[0] is None
