"""Builds the package for VS Code: `python build.py [FOLDER]` writes avow-rcl-VERSION.vsix there (by default into the
system's folder for temporary files), and checks it.

A .vsix is a zip with a manifest; nothing but Python is needed to make one. The library that talks with the language
server comes from npm, as package-lock.json pins it; no script of it is run. Where npm is not there, the package is made
without it, and colours contracts only: the last line says so.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree
from xml.sax.saxutils import escape

HERE = Path(__file__).parent
OWN = ("package.json", "extension.js", "language-configuration.json", "syntaxes/rcl.tmLanguage.json", "README.md")
LICENCE = HERE.parents[2] / "LICENSE"
MANIFEST = "extension.vsixmanifest"
TYPES = "[Content_Types].xml"
_VSIX = "{http://schemas.microsoft.com/developer/vsx-schema/2011}"
_SAME_TIME = (2020, 1, 1, 0, 0, 0)
"""Of every file in the zip: the same files make the same package."""


def build(folder: Path) -> Path:
    """Writes the package; its path."""
    package = json.loads((HERE / "package.json").read_text("utf-8"))
    files = {name: (HERE / name).read_bytes() for name in OWN}
    if LICENCE.is_file():
        files["LICENSE.txt"] = LICENCE.read_bytes()
    files.update(_library())
    folder.mkdir(parents=True, exist_ok=True)
    made = folder / f"{package['name']}-{package['version']}.vsix"
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in {
            TYPES: _types(files).encode(),
            MANIFEST: _manifest(package).encode(),
            **{f"extension/{name}": files[name] for name in sorted(files)},
        }.items():
            archive.writestr(zipfile.ZipInfo(name, _SAME_TIME), data, zipfile.ZIP_DEFLATED)
    return made


def _library() -> dict[str, bytes]:
    """The files of node_modules, by name; none without npm."""
    npm = shutil.which("npm")
    if npm is None:
        return {}
    with tempfile.TemporaryDirectory() as place:
        for name in ("package.json", "package-lock.json"):
            shutil.copy(HERE / name, place)
        command = [npm, "ci", "--omit=dev", "--ignore-scripts", "--no-audit", "--no-fund"]
        try:
            done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False, timeout=120)
        except subprocess.TimeoutExpired:
            print("note: npm did not get the library within two minutes")
            return {}
        if done.returncode:
            print(f"note: npm could not get the library: {done.stderr.strip()[-300:]}")
            return {}
        found = (p for p in (Path(place) / "node_modules").rglob("*") if p.is_file() and not p.is_symlink())
        wanted = (p for p in found if p.suffix in (".js", ".json") or p.name.upper().startswith("LICENSE"))
        return {p.relative_to(place).as_posix(): p.read_bytes() for p in wanted}


def _types(files: dict[str, bytes]) -> str:
    endings = sorted({PurePosixPath(name).suffix for name in (*files, MANIFEST)} - {""})
    lines = "".join(f'<Default Extension="{escape(e)}" ContentType="{_type(e)}"/>' for e in endings)
    parts = "".join(
        f'<Override PartName="/extension/{escape(name)}" ContentType="text/plain"/>'
        for name in sorted(files)
        if not PurePosixPath(name).suffix
    )
    head = '<?xml version="1.0" encoding="utf-8"?>\n'
    return f'{head}<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">{lines}{parts}</Types>\n'


def _type(ending: str) -> str:
    return {
        ".json": "application/json",
        ".js": "application/javascript",
        ".md": "text/markdown",
        ".vsixmanifest": "text/xml",
    }.get(ending, "text/plain")


def _manifest(package: dict[str, object]) -> str:
    name, version, publisher = (escape(str(package[key])) for key in ("name", "version", "publisher"))
    engines = package["engines"]
    assert isinstance(engines, dict)
    return f"""<?xml version="1.0" encoding="utf-8"?>
<PackageManifest Version="2.0.0" xmlns="{_VSIX[1:-1]}">
  <Metadata>
    <Identity Language="en-US" Id="{name}" Version="{version}" Publisher="{publisher}"/>
    <DisplayName>{escape(str(package["displayName"]))}</DisplayName>
    <Description xml:space="preserve">{escape(str(package["description"]))}</Description>
    <Categories>Programming Languages</Categories>
    <Properties>
      <Property Id="Microsoft.VisualStudio.Code.Engine" Value="{escape(str(engines["vscode"]))}"/>
    </Properties>
    <License>extension/LICENSE.txt</License>
  </Metadata>
  <Installation><InstallationTarget Id="Microsoft.VisualStudio.Code"/></Installation>
  <Dependencies/>
  <Assets>
    <Asset Type="Microsoft.VisualStudio.Code.Manifest" Path="extension/package.json" Addressable="true"/>
    <Asset Type="Microsoft.VisualStudio.Services.Content.Details" Path="extension/README.md" Addressable="true"/>
    <Asset Type="Microsoft.VisualStudio.Services.Content.License" Path="extension/LICENSE.txt" Addressable="true"/>
  </Assets>
</PackageManifest>
"""


def faults(made: Path) -> list[str]:
    """What is wrong with a package's structure."""
    found: list[str] = []
    with zipfile.ZipFile(made) as archive:
        if archive.testzip() is not None:
            return ["the zip is damaged"]
        names = archive.namelist()
        there = set(names)
        if len(there) != len(names):
            found.append("a file is there twice")
        found += [f"{n} leads out of the package" for n in names if n.startswith("/") or ".." in PurePosixPath(n).parts]
        if missing := [n for n in (TYPES, MANIFEST, "extension/package.json") if n not in there]:
            return [*found, *(f"{n} is missing" for n in missing)]
        package = json.loads(archive.read("extension/package.json"))
        manifest = ElementTree.fromstring(archive.read(MANIFEST))
        types = ElementTree.fromstring(archive.read(TYPES))
    identity = manifest.find(f"{_VSIX}Metadata/{_VSIX}Identity")
    said = {key: identity.get(key) for key in ("Id", "Version", "Publisher")} if identity is not None else {}
    if said != {"Id": package["name"], "Version": package["version"], "Publisher": package["publisher"]}:
        found.append(f"the manifest speaks of {said}")
    assets = [asset.get("Path", "") for asset in manifest.iter(f"{_VSIX}Asset")]
    contributed = package["contributes"]
    named = [package["main"], *(g["path"] for g in contributed["grammars"])]
    named += [language["configuration"] for language in contributed["languages"]]
    wanted = [*assets, *(str(PurePosixPath("extension", name)) for name in named)]
    found += [f"{name} is named and missing" for name in wanted if name not in there]
    endings = {each.get("Extension") for each in types} | {each.get("PartName", "").lstrip("/") for each in types}
    parts = there - {TYPES}
    found += [f"{n} has no content type" for n in parts if n not in endings and PurePosixPath(n).suffix not in endings]
    return found


def has_library(made: Path) -> bool:
    """Whether everything that the package depends on is in it."""
    with zipfile.ZipFile(made) as archive:
        package = json.loads(archive.read("extension/package.json"))
        there = set(archive.namelist())
    return all(f"extension/node_modules/{name}/package.json" in there for name in package["dependencies"])


def main() -> int:
    made = build(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.gettempdir()))
    wrong = faults(made)
    for each in wrong:
        print(f"error: {each}")
    talks = "with" if has_library(made) else "without npm's vscode-languageclient: it colours contracts only"
    print(f"{made} {talks}{' its library' if talks == 'with' else ''}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
