"""Parts that are the same in every command: paths, names of systems, `--json`, `--seconds`, `--seed`."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from avow.base.tuning.sizes import LONGEST_TIMEOUT

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from avow.language.contract import Contract
    from avow.system.plan import System

Command = TypeVar("Command", bound="Callable[..., object]")


class PathArgument(click.Path):
    """As `click.Path`, giving `Path`; an empty path (an unset variable in a script), or one that no file can have, is a
    usage error, and never the current folder."""

    name = "path"

    def __init__(self, **more: Any) -> None:
        super().__init__(path_type=Path, **more)

    def convert(
        self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> str | bytes | os.PathLike[str]:
        text = os.fspath(value)
        if not text:
            self.fail("the path is empty; the current folder is written `.`", param, ctx)
        try:
            os.stat(text)  # noqa: PTH116 - a text that may be no path at all
        except ValueError as error:
            self.fail(f"{text[:60]!r}… is no path: {error}", param, ctx)
        except OSError as error:
            if error.errno == errno.ENAMETOOLONG:
                self.fail(f"{text[:60]!r}… is no path: {error.strerror}", param, ctx)
        return super().convert(value, param, ctx)


class ContractArgument(PathArgument):
    """An .rcl file, a system's folder or plan.yaml, or the name of a system in this workspace; gives its path.

    A text that is neither an existing path nor a system's name is kept as written, for the command to reject.
    """

    def convert(
        self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> str | bytes | os.PathLike[str]:
        from avow.base.workspace import named_folder

        path = super().convert(value, param, ctx)
        assert isinstance(path, Path)
        return named_folder(path) or path


def system_of(path: Path) -> System:
    """The system that a `ContractArgument` names. Raises Rejected."""
    from avow.base.workspace import system_folder
    from avow.system.load import load_path

    return load_path(path if path.suffix == ".rcl" or path.is_dir() else system_folder(str(path)))


def has_nodes(contract: Contract, wanted: Iterable[str]) -> None:
    """Raises Rejected for a node that the contract does not have."""
    from avow.base.diagnostics import Diagnostic, Rejected

    known = [node.name for node in contract.nodes]
    if unknown := [name for name in wanted if name not in known]:
        raise Rejected(Diagnostic("CLI003", f"there is no node '{unknown[0]}'", hint=f"known: {', '.join(known)}"))


class _Seconds(click.ParamType[float]):
    """A time above 0 and of at most a day; `nan` and `inf`, which Python accepts as numbers, are rejected."""

    name = "seconds"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            seconds = float(str(value))
        except ValueError:
            self.fail(f"{str(value)[:60]!r} is no number", param, ctx)
        if not 0 < seconds <= LONGEST_TIMEOUT:
            self.fail(f"{seconds}: a time above 0 is wanted, of at most a day", param, ctx)
        return seconds


def seconds_option(default: float | None = None) -> Callable[[Command], Command]:
    """``--seconds``: the effort for one solver query, as the time that it usually takes. Without a default, the plan's
    times apply unless the option is given."""
    text = "Effort for one question to the solver, as the time that it usually takes; what is counted is steps."
    if default is None:
        text = "Effort for one question to the solver, and time for one run of a tool, whatever the plan says."
    return click.option(
        "--seconds", type=_Seconds(), metavar="SECONDS", default=default, show_default=default is not None, help=text
    )


def seed_option() -> Callable[[Command], Command]:
    """``--seed``: the seed of random choices."""
    return click.option(
        "--seed",
        default=0,
        show_default=True,
        type=click.IntRange(0, 2**31 - 1),
        help="Where random choices start: the same seed, the same answer.",
    )


def json_option(what: str = "") -> Callable[[Command], Command]:
    """``--json``: the answer as data on standard output; all other messages go to standard error."""
    text = "For machines" + (f": {what}." if what else ".")
    return click.option("--json", "as_json", is_flag=True, help=text)


def node_option() -> Callable[[Command], Command]:
    """``--node``: only some nodes."""
    return click.option("--node", "nodes", multiple=True, metavar="NAME", help="Only this node (may be repeated).")
