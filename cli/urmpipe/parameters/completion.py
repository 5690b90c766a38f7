"""What the shell completes: words, files of a kind, kinds of a tolerance, columns of the log on the line."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:  # the functions of Python use the kinds of values, too, without click
    import click
    from click.shell_completion import CompletionItem

Complete: TypeAlias = "Callable[[click.Context, click.Parameter, str], list[CompletionItem]]"
# Returns the completions of an unfinished value, as `click.option(shell_complete=...)` takes it.

# Kinds of a tolerance with their SI units; those of the pipeline are slow to import (a test compares them).
DEVIATIONS = {**dict.fromkeys(("axis", "x", "y", "z", "norm", "path"), "m"), "angle": "rad", "joint": "rad"}
SHARES = {"coverage": "1", "judged": "1"}
CRITERIA = {
    **dict.fromkeys(("AP", "RP", "AD", "RD", "vAP", "OV", "dAP", "dRP", "AT", "RT", "CR", "CO"), "m"),
    **{f"{name}_{angle}": "rad" for name in ("AP", "RP", "AT", "RT") for angle in ("rz", "ry", "rx")},
    **{"PSt": "s", "AV": "1", "RV": "1", "FV": "m/s"},
}

HEAD = 2**16  # characters of a log in which its columns are looked for
UNFINISHED_NUMBER = re.compile(r"(?P<number>.*=[0-9.]+)(?P<unit>[a-z/%]*)")  # its unit is next


def words(*names: str) -> Complete:
    """Return the completion of one word of a vocabulary; a list is separated by commas."""
    return lambda ctx, param, incomplete: items(names, incomplete)


def comma_separated(*names: str) -> Complete:
    """Return the completion of words that are separated by commas, each once."""
    return lambda ctx, param, incomplete: _complete_next(names, incomplete)


def files(*suffixes: str, names: Callable[[], Iterable[str]] = tuple) -> Complete:
    """Return the completion of a file with one of the suffixes, or of some names.

    Args:
        suffixes: What the file's name ends in; folders are offered, too, to look inside.
        names: What is allowed instead of a file; called when it is to be completed.
    """
    return lambda ctx, param, incomplete: [*_files(suffixes, incomplete), *items(names(), incomplete)]


def folders(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the completion of a folder."""
    return [_item(incomplete, "dir")]


def columns(*fixed: str, sign: str = "", several: bool = False) -> Complete:
    """Return the completion of a column of the logs on the line.

    Args:
        fixed: Words that are allowed, too.
        sign: What follows the name of a column.
        several: Whether columns are separated by commas.
    """

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        logs = [*operands(ctx), *(text.partition("=")[2] for text in ctx.params.get("arguments") or ())]
        names = [name for log in logs for name in columns_of(Path(log))]
        offered = dict.fromkeys([*fixed, *(f"{name}{sign}" for name in names)])
        return _complete_next(offered, incomplete) if several else items(offered, incomplete)

    return complete


def units(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the completions of [COLUMN=]UNIT."""
    from urmpipe_models.measure_units import MEASURES

    column, sign, begun = incomplete.rpartition("=")
    if sign:
        return items([*MEASURES["rad"], *MEASURES["m"]], begun, f"{column}=")
    return columns("rad", "deg", sign="=")(ctx, param, incomplete)


def tolerances(*, iso: bool = False, shares: bool = True) -> Complete:
    """Return the completion of KIND=VALUE,...: kinds, and after a number its units.

    Args:
        iso: Whether the kinds are criteria after ISO 9283.
        shares: Whether the shares that must be seen are kinds, too.
    """

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        from urmpipe_models.measure_units import WRITTEN

        before, comma, last = incomplete.rpartition(",")
        if number := UNFINISHED_NUMBER.fullmatch(last):
            allowed = filter(
                None, WRITTEN.get((DEVIATIONS | SHARES | CRITERIA).get(last.partition("=")[0], ""), {})
            )
            return items(allowed, number["unit"], f"{before}{comma}{number['number']}")
        kinds = CRITERIA if iso else DEVIATIONS | SHARES if shares else DEVIATIONS
        return _complete_next([f"{kind}=" for kind in kinds], incomplete)

    return complete


def items(names: Iterable[str], begun: str, before: str = "") -> list[CompletionItem]:
    """Return the names that begin with a text, each after the part of the word before it."""
    return [_item(f"{before}{name}") for name in names if name.startswith(begun)]


def _item(value: str, type: str = "plain") -> CompletionItem:
    from click.shell_completion import CompletionItem

    return CompletionItem(value, type)


def operands(ctx: click.Context) -> list[str]:
    """Return the arguments of a line that is not finished: click leaves them unnamed then."""
    values = [ctx.params.get(param.name or "") for param in ctx.command.params if not hasattr(param, "help")]
    listed = [value if isinstance(value, tuple) else (value,) for value in values]
    return [*(str(word) for words in listed for word in words if word), *ctx.args]


def columns_of(log: Path) -> Sequence[str]:
    """Return the columns that the first row of a text names; empty if the file is not a table."""
    import csv

    try:
        if not log.is_file():  # a named pipe would be waited for
            return ()
        with log.open(encoding="utf-8", newline="") as file:
            lines = file.read(HEAD).splitlines()[:10]
        dialect = csv.Sniffer().sniff("\n".join(lines), ",;\t|")
        first = next(islice(csv.reader(lines, dialect), 1), [])
    except (OSError, UnicodeDecodeError, csv.Error):
        return ()
    names = [name.strip() for name in first]
    return () if any(re.fullmatch(r"[-+]?[0-9.,]*([eE][-+]?[0-9]+)?", name) for name in names) else names


def _complete_next(names: Iterable[str], incomplete: str) -> list[CompletionItem]:
    """Return the names that may follow the last comma: those that are not before it."""
    before, comma, begun = incomplete.rpartition(",")
    used = {part.partition("=")[0] for part in before.split(",")}
    return items([name for name in names if name.rstrip("=") not in used], begun, f"{before}{comma}")


def _files(suffixes: Sequence[str], incomplete: str) -> list[CompletionItem]:
    """Return the files of a kind, with the folders that the shell lists itself.

    The shell lists all files where none is of the kind, and where it must write a name with quotes. What it
    lists comes first: bash drops the items before it.
    """
    folder, begun = re.fullmatch(r"(.*/)?([^/]*)", incomplete).groups("")  # type: ignore[union-attr]  # always
    try:
        paths = sorted(Path(folder or ".").expanduser().iterdir())
    except (OSError, RuntimeError):  # there is no such folder, or no such user
        paths = []
    visible = [path for path in paths if path.name.startswith(begun) and (begun or path.name[0] != ".")]
    names = [path.name for path in visible if path.suffix.lower() in suffixes and path.is_file()]
    if not names or any(shlex.quote(name) != name for name in names):
        return [_item(incomplete, "file")]
    return [_item(incomplete, "dir"), *(_item(f"{folder}{name}") for name in names)]


def list_names(place: str) -> Callable[[], Iterable[str]]:
    """Return a function that calls `module:function`, and imports it only then."""
    module, _, function = place.partition(":")

    def names() -> Iterable[str]:
        listed: Iterable[str] = getattr(import_module(module), function)()
        return listed

    return names


robots = list_names("urmpipe_models.robots.catalogue:robot_names")
networks = list_names("urmpipe_models.networks.file:network_names")


def values_by_name(names: Callable[[click.Context], Iterable[str]]) -> Complete:
    """Return the completion of NAME=VALUE: the names with their sign, and robots and networks as values.

    Args:
        names: Returns the names, from the finished words of the line.
    """

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        from urmpipe_models.errors import UrmpipeError

        name, _, begun = incomplete.partition("=")
        catalogue = {"robot": robots, "network": networks}.get(name)
        if catalogue is not None:
            return items(catalogue(), begun, f"{name}=")
        try:
            return items([f"{name}=" for name in names(ctx)], incomplete)
        except UrmpipeError:  # another part of the line is wrong
            return []

    return complete


def argument_names(ctx: click.Context) -> Iterable[str]:
    """Return the arguments of the system on the line."""
    from urmpipe_fmus.cosim import load_system

    return [name for system in operands(ctx) for name in load_system(system, {}).arguments]


def option_names(ctx: click.Context) -> Iterable[str]:
    """Return the options of the unit on the line, without its robot and its log, which have their own."""
    from urmpipe_fmus.blocks import block_option_help

    names = [name for unit in operands(ctx) for name in block_option_help(unit)]
    return [name for name in names if name not in ("robot", "table")]


def control_names(ctx: click.Context) -> Iterable[str]:
    """Return the controls of the network on the line that can be set."""
    from urmpipe_models.networks.file import load_network

    networks = [load_network(network) for network in operands(ctx)]
    return [control.name for network in networks for control in network.controls if control.value is None]
