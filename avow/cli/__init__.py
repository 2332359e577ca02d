"""The command line: a module a command, imported when it is called.

Exit codes, the same for all: 0 all is well; 1 a gate or a check fails; 2 bad input or usage; 3 a needed tool failed.
"""

from __future__ import annotations

import importlib
import io
import os
import sys
from typing import Any

from avow.base.module_path import leave_here
from avow.base.suggestions import did_you_mean

leave_here()  # before anything is imported that a folder of somebody else's could have a module for

import click  # noqa: E402

from avow import __version__  # noqa: E402

COMMANDS = {
    "agent": "run an agent program, told step by step",
    "audit": "re-digest everything that the ledger refers to",
    "check": "diagnostics for .rcl files, in milliseconds",
    "compose": "the derivation and its side conditions",
    "diff": "what changed between two ledgers or two revisions",
    "doctor": "which tools are here, and the command that installs a missing one",
    "drive": "run a node's callback class without ROS, record it, replay a recording",
    "explain": "one obligation: formula, status, evidence, counterexample, how to re-run it",
    "fmt": "the canonical layout of .rcl files",
    "fretish": "FRETish requirements as nodes of a contract",
    "graph": "how a system is wired: nodes, topics, types, environment",
    "init": "a new workspace with a contract that verifies",
    "lsp": "the language server",
    "monitor": "judge a recorded trace against assumptions and guarantees",
    "mutate": "would the evidence notice if the contract said something else?",
    "recheck": "the kernel alone, over the certificates that runs left",
    "refines": "weaker assumptions, stronger guarantees?",
    "report": "render the reports, or check one against the ledger",
    "requirements": "requirements from CSV or ReqIF, as a plan's section",
    "review": "fill in the digests of a review record",
    "sanity": "is the contract worth verifying?",
    "sign": "a person's name under a report; what changes later is told against it",
    "simulate": "run the composed contracts over the plan's scenario",
    "translate": "a contract as LaTeX, text, JSON, SMT-LIB, …",
    "verify": "everything for every system: the main job",
    "worker": "do works for `avow verify --on` of other machines",
}
"""Name → one line of help. The module of that name in this package holds the click command `command`."""

_OF_BACKENDS = {
    "agent": "avow.backends.ajpf.command",
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

    for stream in (sys.stdout, sys.stderr):  # a sign that the terminal has not, or a file's name that is no text
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
    except BrokenPipeError:  # the reader of our output has left: `avow … | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    except OSError as error:  # a full disk, a folder that cannot be written: where no command knows better
        print(f"error: {error}", file=sys.stderr)
        code = 2
    sys.exit(code)
