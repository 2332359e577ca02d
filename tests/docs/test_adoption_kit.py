"""The files for other tools, as far as a machine without those services can try them: shapes, and every shell line."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from helpers import avow, warehouse_bag

from avow.language import textmate
from avow.language.lexer import KEYWORDS
from avow.language.terms import Builtin, Past
from avow.lsp.vocabulary import FORMS

ROOT = Path(__file__).parents[2]
KIT = ROOT / "docs/adoption"
MARK = "<!-- avow rover -->"

GH = """\
#!/usr/bin/env bash
printf '%s\\n' "$*" >> "$CALLS"
case "$*" in *--paginate*) echo "$KNOWN";; esac
"""
"""Stands in for GitHub's client: it notes how it is called, and knows the comment `KNOWN`."""


def steps() -> list[dict[str, Any]]:
    text = (KIT / "github.yaml").read_text()
    workflow = yaml.safe_load(text)
    assert set(workflow) >= {"name", "jobs", "permissions", "env", True}  # YAML 1.1 reads `on` as true
    (job,) = workflow["jobs"].values()
    assert job["runs-on"]
    found: list[dict[str, Any]] = job["steps"]
    return found


def named(name: str) -> str:
    (script,) = (step["run"] for step in steps() if step.get("name") == name)
    assert isinstance(script, str)
    return script


def run(script: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    path = f"{folder}{os.pathsep}{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    command = ["bash", "-eo", "pipefail", "-c", script]  # as GitHub's runner starts it
    env = {**os.environ, "PATH": path, **environment}
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, timeout=120, check=False)


def test_each_step_uses_an_action_of_a_version_or_runs_a_shell_line() -> None:
    for step in steps():
        assert ("uses" in step) is not ("run" in step)
        if "uses" in step:
            assert step["uses"].rpartition("@")[2].startswith("v"), step
        else:
            assert subprocess.run(["bash", "-n", "-c", step["run"]], check=False).returncode == 0, step
            assert "${{" not in step["run"], "what others write comes in through the environment, never as shell"
    lines = [step["run"] for step in steps() if "run" in step]
    assert 'pip install "$AVOW"' in lines
    assert "avow verify" in lines


@pytest.mark.parametrize("known", ["", "4711"])
def test_the_comment_is_made_once_and_then_changed(known: str, tmp_path: Path) -> None:
    (tmp_path / "reports/rover").mkdir(parents=True)
    (tmp_path / "reports/rover/comment.md").write_text(f"{MARK}\n**fine** $(touch pwned) `x`\n")
    (tmp_path / "gh").write_text(GH)
    (tmp_path / "gh").chmod(0o755)
    calls = tmp_path / "calls"
    done = run(named("comment"), tmp_path, CALLS=str(calls), KNOWN=known, PR="3", GITHUB_REPOSITORY="o/r", GH_TOKEN="t")
    assert done.returncode == 0, done.stderr
    asked, told = calls.read_text().splitlines()
    assert MARK in asked
    wanted = "api -X PATCH repos/o/r/issues/comments/4711" if known else "api repos/o/r/issues/3/comments"
    assert told == f"{wanted} -F body=@reports/rover/comment.md"
    assert not (tmp_path / "pwned").exists()


def test_findings_are_collected_one_file_for_a_system(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / "reports" / name).mkdir(parents=True)
        (tmp_path / "reports" / name / "findings.sarif").write_text(name)
        (tmp_path / "reports" / name / "report.sarif").write_text("all of it")
    assert run(named("findings"), tmp_path).returncode == 0
    assert {path.name: path.read_text() for path in (tmp_path / "findings").iterdir()} == {
        "a.sarif": "a",
        "b.sarif": "b",
    }
    empty = tmp_path / "empty"
    empty.mkdir()
    assert run(named("findings"), empty).returncode == 0


def test_gitlab_runs_the_same() -> None:
    (job,) = yaml.safe_load((KIT / "gitlab.yaml").read_text()).values()
    assert job["script"] == ['pip install "$AVOW"', "avow verify"]
    assert job["artifacts"]["when"] == "always"
    assert job["artifacts"]["reports"]["junit"] == "reports/*/junit.xml"


@pytest.mark.slow
def test_the_hooks_take_the_files_that_they_are_given(tmp_path: Path) -> None:
    assert run("avow init robot", tmp_path).returncode == 0
    place = tmp_path / "robot"
    files = "contracts/thermostat/system.rcl contracts/thermostat/plan.yaml"
    for hook in yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text()):
        assert {"id", "name", "entry", "language", "files"} <= set(hook)
        given = files if "plan" in hook["files"] else files.split()[0]
        done = run(f"{hook['entry']} {given}", place)
        assert done.returncode == 0, done.stdout + done.stderr
    (place / "contracts/thermostat/system.rcl").write_text("node {")
    assert run(f"avow check {files}", place).returncode == 2


def commands() -> list[tuple[str, int]]:
    """What the templates and hooks run on a workspace, in order, and the code of each for a draft: it is well formed,
    and what is still to be written fails a gate."""
    (gitlab,) = yaml.safe_load((KIT / "gitlab.yaml").read_text()).values()
    scripts = [step["run"] for step in steps() if "run" in step and step.get("name") != "comment"]
    hooks = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())
    files = {"avow-check": "contracts/*/system.rcl contracts/*/plan.yaml", "avow-fmt": "contracts/*/system.rcl"}
    every = [*scripts, *gitlab["script"], *(f"{hook['entry']} {files[hook['id']]}" for hook in hooks)]
    return [(script, int(script == "avow verify")) for script in every]


@pytest.mark.slow
def test_templates_and_hooks_run_on_a_draft_in_a_clean_environment(tmp_path: Path) -> None:
    """On a clone of a drafted workspace, without its bag, with Avow's wheel and a PATH of Python and git alone."""
    warehouse_bag(tmp_path / "run")
    assert avow("init", "warehouse", "--from-bag", str(tmp_path / "run"), cwd=tmp_path).returncode == 0
    git = "git -c user.name=n -c user.email=e -c init.defaultBranch=main"
    publish = f"{git} init -q && git add -A && {git} commit -qm draft && git clone -q . ../clone"
    assert run(publish, tmp_path / "warehouse").returncode == 0
    assert not (tmp_path / "clone/contracts/warehouse/traces/run").exists()
    source = tmp_path / "source"  # a build in the repository would change what other tests see of the package
    for name in ("avow", "backends"):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for path in filter(Path.is_file, ROOT.iterdir()):
        shutil.copy(path, source)
    build = [sys.executable, "-m", "build", "--wheel", "--outdir", str(tmp_path), str(source)]
    subprocess.run(build, check=True, capture_output=True, timeout=300)
    (wheel,) = tmp_path.glob("*.whl")
    subprocess.run([sys.executable, "-m", "venv", str(tmp_path / "env")], check=True, timeout=120)
    (tmp_path / "bin").mkdir()
    for tool in ("bash", "basename", "cp", "dirname", "git", "mkdir"):
        found = shutil.which(tool)
        assert found is not None
        (tmp_path / "bin" / tool).symlink_to(found)
    env = {"PATH": f"{tmp_path / 'env/bin'}:{tmp_path / 'bin'}", "HOME": str(tmp_path), "AVOW": str(wheel)}
    env |= {name: value for name, value in os.environ.items() if name.startswith("PIP_")}
    told = ""
    for script, code in commands():
        done = subprocess.run(
            ["bash", "-eo", "pipefail", "-c", script],
            cwd=tmp_path / "clone",
            env=env,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert done.returncode == code, f"{script}\n{done.stdout}\n{done.stderr}"
        told += done.stdout + done.stderr
    assert "next: replace `to_write` by what the node promises" in told
    assert "Traceback" not in told
    assert (tmp_path / "clone/findings/warehouse.sarif").is_file()
    assert run("git status --porcelain contracts", tmp_path / "clone").stdout == ""


def test_the_editors_package_names_files_that_are_there() -> None:
    place = KIT / "vscode"
    package = json.loads((place / "package.json").read_text())
    assert {"name", "version", "publisher", "engines", "main", "contributes"} <= set(package)
    (language,), (grammar,) = package["contributes"]["languages"], package["contributes"]["grammars"]
    for path in (package["main"], language["configuration"], grammar["path"]):
        assert (place / path).is_file(), path
    assert json.loads((place / grammar["path"]).read_text())["scopeName"] == grammar["scopeName"]
    assert language["id"] == grammar["language"]
    assert "avow.command" in package["contributes"]["configuration"]["properties"]
    main = (place / package["main"]).read_text()
    assert "avow.command" in main or 'get("command"' in main


def builder() -> Any:
    spec = importlib.util.spec_from_file_location("vsix_builder", KIT / "vscode/build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_editors_package_is_built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without npm, whose library comes from its registry: CI builds the package as a whole, where it can."""
    build = builder()
    monkeypatch.setattr(build.shutil, "which", lambda name: None)
    made = build.build(tmp_path)
    assert build.faults(made) == []
    assert not build.has_library(made)
    assert made.read_bytes() == build.build(tmp_path / "again").read_bytes(), "the same files, the same package"
    lock = json.loads((KIT / "vscode/package-lock.json").read_text())["packages"]
    package = json.loads((KIT / "vscode/package.json").read_text())
    assert lock[""]["dependencies"] == package["dependencies"]
    assert all(each.get("integrity") for name, each in lock.items() if name), "every file of the library is pinned"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("extension/extension.js", None),
        ("extension/syntaxes/rcl.tmLanguage.json", None),
        ("extension/README.md", None),
        ("[Content_Types].xml", None),
        ("[Content_Types].xml", "<Types/>"),
        ("extension.vsixmanifest", "<PackageManifest/>"),
        ("extension/../out.js", "x"),
    ],
)
def test_a_package_that_is_not_whole_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: str | None
) -> None:
    build = builder()
    monkeypatch.setattr(build.shutil, "which", lambda name: None)
    with zipfile.ZipFile(build.build(tmp_path)) as whole:
        files = {each: whole.read(each) for each in whole.namelist() if each != name}
    if text is not None:
        files[name] = text.encode()
    with zipfile.ZipFile(tmp_path / "broken.vsix", "w") as broken:
        for each, data in files.items():
            broken.writestr(each, data)
    assert build.faults(tmp_path / "broken.vsix")


def test_the_editors_colours_are_made_from_the_language() -> None:
    path = KIT / "vscode/syntaxes/rcl.tmLanguage.json"
    if os.environ.get("AVOW_REFRESH"):
        path.write_text(textmate.text(), "utf-8")
    assert path.read_text("utf-8") == textmate.text(), "AVOW_REFRESH=1 .venv/bin/pytest tests/docs/test_adoption_kit.py"
    patterns = [p for p in textmate.grammar()["patterns"] if "match" in p]

    def kind(text: str) -> str:
        """By the first pattern that begins earliest, as an editor does."""
        found = [(m.start(), k) for k, p in enumerate(patterns) if (m := re.search(p["match"], text))]
        pattern = patterns[min(found)[1]] if found else {}
        return str(pattern.get("name") or pattern.get("captures", {}).get("2", {}).get("name", ""))

    for word in KEYWORDS:
        assert kind(word), word
    assert FORMS.keys() >= {*Builtin, *Past}
    for form in FORMS.values():
        assert kind(f"{form.name}(x)"), form
    for sign in ("->", "<=>", "==", "!=", "<=", "-->", "+"):
        assert kind(sign) == "keyword.operator.rcl"
    assert kind("node agent {") == "entity.name.type.rcl"
    assert kind("guarantee low (") == "entity.name.function.rcl"
    assert kind("held") == "", "a name where it is not applied"
    assert kind("200 ms") == "constant.numeric.rcl"


def test_the_ros_package_is_of_format_3() -> None:
    root = ElementTree.parse(KIT / "ros/package.xml").getroot()
    assert (root.tag, root.get("format")) == ("package", "3")
    assert [child.tag for child in root][:5] == ["name", "version", "description", "maintainer", "license"]
    maintainer = root.find("maintainer")
    assert maintainer is not None
    assert maintainer.get("email")
    lists = (KIT / "ros/CMakeLists.txt").read_text()
    assert f"project({root.findtext('name')} NONE)" in lists
    assert lists.count("avow verify") == 3  # in the comment, for ROS 1 and for ROS 2
    assert lists.count("(") == lists.count(")")


STUBS = {
    "catkin": "macro(catkin_package)\nendmacro()\nset(CATKIN_ENABLE_TESTING ON)\nenable_testing()\n",
    "ament_cmake": "macro(ament_package)\nendmacro()\nset(BUILD_TESTING ON)\nenable_testing()\n",
    "ament_cmake_test": "function(ament_add_test name)\n"
    '  cmake_parse_arguments(A "GENERATE_RESULT_FOR_RETURN_CODE_ZERO" "WORKING_DIRECTORY;TIMEOUT" "COMMAND" ${ARGN})\n'
    "  add_test(NAME ${name} COMMAND ${A_COMMAND} WORKING_DIRECTORY ${A_WORKING_DIRECTORY})\nendfunction()\n",
}
"""What stands in for ROS's own packages: that a test is declared, and how it is run."""


@pytest.mark.skipif(shutil.which("cmake") is None, reason="cmake is not on this machine")
@pytest.mark.parametrize("version", ["1", "2"])
def test_the_ros_package_builds_and_its_test_runs_avow(version: str, tmp_path: Path) -> None:
    place = tmp_path / "robot"
    assert run(f"avow init robot --template ros{version}", tmp_path).returncode == 0
    for name, text in STUBS.items():
        (tmp_path / "stubs" / name).mkdir(parents=True)
        (tmp_path / "stubs" / name / f"{name}Config.cmake").write_text(text)
    (tmp_path / "avow").write_text('#!/usr/bin/env bash\necho "$PWD: $*" > "$CALLS"\n')
    (tmp_path / "avow").chmod(0o755)
    calls = tmp_path / "calls"
    script = f"cmake -S {place} -B build -DCMAKE_PREFIX_PATH={tmp_path / 'stubs'} && ctest --test-dir build"
    done = run(script, tmp_path, ROS_VERSION=version, CALLS=str(calls))
    assert done.returncode == 0, done.stdout + done.stderr
    assert calls.read_text() == f"{place}: verify\n"
