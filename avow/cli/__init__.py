"""The command line: one module per command, imported when it is called.

Exit codes, the same for all: 0 success; 1 a gate or a check fails; 2 bad input or usage; 3 a needed tool failed.
"""

from __future__ import annotations

import gc
import importlib
import io
import os
import sys
from typing import Any

from avow.base.module_path import leave_here
from avow.base.suggestions import did_you_mean
from avow.base.tuning.running import COLLECTED_IN_WORKS

leave_here()  # before any import that a module in another's folder could replace

import click  # noqa: E402

from avow import __version__  # noqa: E402

gc.set_threshold(COLLECTED_IN_WORKS)  # most objects of a command stay alive, so collections find little

COMMANDS = {
    "audit": "recompute every digest that the ledger records",
    "campaign": "make the runs of a simulator as evidence, or search for a failing scenario",
    "check": "report errors and warnings of .rcl files and plans, in milliseconds",
    "compose": "show the derivation and its side conditions",
    "diff": "list what changed between two ledgers or two revisions",
    "doctor": "list the tools that are installed, and the command that installs a missing one",
    "drive": "run a node's callback class without ROS, record it, or replay a recording",
    "explain": "show an obligation: formula, status, evidence, counterexample, how to re-run it",
    "fmt": "format .rcl files",
    "fretish": "turn FRETish requirements into nodes of a contract",
    "graph": "show how a system is wired: nodes, topics, types, environment",
    "init": "make a new workspace with a contract that verifies, or draft one from a bag or a graph",
    "lsp": "start the language server",
    "monitor": "judge a recorded trace against assumptions and guarantees",
    "mutate": "test the evidence: does a method notice when a guarantee says something else?",
    "obligations": "list the proof obligations of systems or of one node, and the methods that discharge them",
    "recheck": "run the kernel alone over the certificates of earlier runs",
    "refines": "check whether one node refines another: weaker assumptions, stronger guarantees",
    "report": "render the reports, or check one against the ledger",
    "requirements": "import requirements from CSV or ReqIF as a plan's section",
    "review": "fill in the digests of a review record",
    "sanity": "check whether a contract is worth verifying: consistent, realizable, not vacuous",
    "sign": "sign a report; later reports list the changes since the signature",
    "simulate": "run the composed contracts over the plan's scenario",
    "translate": "translate a contract to mathematics, JSON, SMT-LIB, …",
    "validate": "record that a person read requirements' sentences against their formulas",
    "verify": "verify every system: check, compose, discharge, report",
    "worker": "start a worker that executes jobs of `avow verify --on` on another machine",
}
"""Name → one line of help. The module of that name in this package has the click command `command`."""

_OF_BACKENDS = {
    "campaign": "avow.backends.experiment.command",
    "drive": "avow.backends.rosmonitoring.driving",
    "monitor": "avow.backends.rosmonitoring.command",
    "review": "avow.backends.review.command",
}
"""Commands that belong to a backend → the module that holds them."""


def command(name: str) -> click.Command:
    """The command of that name in `COMMANDS`, imported now."""
    found = importlib.import_module(_OF_BACKENDS.get(name, f"avow.cli.{name}")).command
    assert isinstance(found, click.Command)
    return found


class _Lazy(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        return command(cmd_name) if cmd_name in COMMANDS else None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        # from the table, so that `avow --help` imports no command
        with formatter.section("Commands"):
            formatter.write_dl(sorted(COMMANDS.items()))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            ctx.fail("; ".join(filter(None, (f"no such command '{args[0]}'", did_you_mean(args[0], COMMANDS)))))
        return super().resolve_command(ctx, args)


@click.group(cls=_Lazy, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(__version__, prog_name="avow")
def _avow() -> None:
    """Contracts in, evidence out: robot contracts turned into verification evidence and an assurance report."""


def main(arguments: list[str] | None = None) -> None:
    """The entry point. Bad input ends with located messages and code 2, never with a traceback."""
    from avow.base.diagnostics import Rejected

    for stream in (sys.stdout, sys.stderr):  # characters that the terminal lacks, or a file name that is not text
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        result: Any = _avow.main(arguments, standalone_mode=False)
        code = result if isinstance(result, int) else 0
    except Rejected as rejected:
        from avow.base.rendering import render

        print(render(rejected.diagnostics), file=sys.stderr)
        code = 2
    except click.exceptions.Exit as leave:
        code = leave.exit_code
    except click.ClickException as wrong:
        wrong.show()
        code = 2
    except (KeyboardInterrupt, click.Abort):
        from avow.base.process import kill_all

        kill_all()
        print("interrupted", file=sys.stderr)
        code = 130
    except BrokenPipeError:  # the reader of our output has ended: `avow … | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    except OSError as error:  # a full disk, an unwritable folder: if no command handles it
        print(f"error: {error}", file=sys.stderr)
        code = 2
    sys.exit(code)
