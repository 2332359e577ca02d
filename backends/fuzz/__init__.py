"""A node's C++ source, fuzzed with sanitizers; runs with new coverage are repeated, alone, and judged exactly."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from avow.backend_kit.given import NAN, schema, whole_number
from avow.backend_kit.protocol import Backend, Job, Limits, Opens, Report, Tool
from avow.base.codes import Catalogue
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.verdict import Link, Object, Verdict
from avow.evidence.obligation import ProgramClaim

_LISTED = {"type": "array", "items": {"type": "string", "minLength": 1}, "uniqueItems": True}


class FuzzBackend(Backend):
    """See `docs/backends/fuzz.md`."""

    name = "fuzz"
    title = "libFuzzer with sanitizers on the node's C++ source; kept runs judged against the contract"
    version = "5"
    strength = Verdict.TESTED
    link = Link.GENERATED
    of = Object.BINARY
    claims = (ProgramClaim.FAULTLESS, ProgramClaim.LINKED)
    uses_scenario = False
    uses_wiring = False
    uses_source = True
    needs_source = "cpp"
    options_schema = schema(
        {
            "runs": whole_number("how many runs libFuzzer makes", 100_000_000, 20_000),
            "steps": whole_number("how many steps a run has at most", 1_000, 8),
            "sources": {**_LISTED, "description": "further files to compile, relative to the system's folder"},
            "include": {**_LISTED, "description": "folders in which included files are looked for"},
            "nan": NAN,
        }
    )
    codes = Catalogue("avow.backends.fuzz")
    green_means = (
        "libFuzzer made so many runs of the compiled source without a report of a sanitizer; on those of them that are "
        "new, and on others at thresholds, a plain build gave outputs that meet the guarantee, judged exactly. It says "
        "nothing certain of other runs, of another compiler, or of another machine."
    )

    def tools(self) -> tuple[Tool, ...]:
        from .clang_tool import tools

        return tools()

    def opens(self, job: Job) -> Opens:
        return Opens.VALUES

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        from .reading import load

        try:
            load(job)
        except Rejected as rejected:
            return rejected.diagnostics
        return ()

    def files(self, job: Job) -> tuple[Path, ...]:
        from .reading import files

        return files(job)

    def export(self, job: Job) -> Mapping[str, str]:
        from .reading import load
        from .tables import TABLES, drawable, native, tables

        try:
            reading = load(job)
        except Rejected:
            return {}
        return {**native(), TABLES: tables(reading, drawable(reading))}

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        from .settle import settle

        return settle(job, limits)


BACKEND = FuzzBackend()
