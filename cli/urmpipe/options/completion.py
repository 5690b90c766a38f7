"""What the shell completes: words, files of a kind, kinds of a tolerance, columns of the log on the line."""

from __future__ import annotations

import csv
import re
import shlex
from collections.abc import Callable, Iterable, Sequence
from itertools import islice
from pathlib import Path

import click
from click.shell_completion import CompletionItem

Complete = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]
"""Returns the completions of a value that is not finished, as `click.option(shell_complete=...)` takes it."""

HEAD = 2**16
"""Characters of a log in which its columns are looked for."""

BEGUN = re.compile(r"(?P<number>.*=[0-9.]+)(?P<unit>[a-z/%]*)")
"""The last part of a tolerance, where its unit comes next."""


def words(*names: str) -> Complete:
    """Return the completion of one word of a vocabulary; a list is separated by commas."""
    return lambda ctx, param, incomplete: items(names, incomplete)


def one_of_each(*names: str) -> Complete:
    """Return the completion of words that are separated by commas, each once."""
    return lambda ctx, param, incomplete: _one_more(names, incomplete)


def files(*suffixes: str, names: Callable[[], Iterable[str]] = tuple) -> Complete:
    """Return the completion of a file with one of the suffixes, behind some names.

    Args:
        suffixes: What the file's name ends in; folders are offered, too, to look inside.
        names: What is allowed instead of a file; called when it is to be completed.
    """
    return lambda ctx, param, incomplete: [*_files(suffixes, incomplete), *items(names(), incomplete)]


def folders(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the completion of a folder."""
    return [CompletionItem(incomplete, type="dir")]


def columns(*others: str, sign: str = "", several: bool = False) -> Complete:
    """Return the completion of a column of the logs on the line.

    Args:
        others: Words that are allowed, too.
        sign: What follows the name of a column.
        several: Whether columns are separated by commas.
    """

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        logs = [*operands(ctx), *(ctx.params.get("arguments") or {}).values()]  # those are of simulate
        named = [one for log in logs for one in columns_of(Path(log))]
        offered = dict.fromkeys([*others, *(f"{name}{sign}" for name in named)])
        return _one_more(offered, incomplete) if several else items(offered, incomplete)

    return complete


def units(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the completions of [COLUMN=]UNIT."""
    from urmpipe_models.measure_units import MEASURES

    column, sign, begun = incomplete.rpartition("=")
    if sign:
        return items([*MEASURES["rad"], *MEASURES["m"]], begun, f"{column}=")
    return columns("rad", "deg", sign="=")(ctx, param, incomplete)


def tolerances(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the completions of KIND=VALUE,...: kinds, those of ISO 9283 behind --iso, and units."""
    from urmpipe_models.measure_units import WRITTEN
    from urmpipe_pipeline.comparison.verdict import DEVIATIONS, LEAST_SHARES, UNITS

    before, comma, last = incomplete.rpartition(",")
    if number := BEGUN.fullmatch(last):
        allowed = filter(None, WRITTEN.get(UNITS.get(last.partition("=")[0], ""), {}))
        return items(allowed, number["unit"], f"{before}{comma}{number['number']}")
    deviations = DEVIATIONS if param.name == "noise" else (*DEVIATIONS, *LEAST_SHARES)
    criteria = [kind for kind in UNITS if kind not in (*DEVIATIONS, *LEAST_SHARES)]
    kinds = criteria if ctx.params.get("iso") else deviations
    return _one_more([f"{kind}=" for kind in kinds], incomplete)


def items(names: Iterable[str], begun: str, before: str = "") -> list[CompletionItem]:
    """Return the names that begin with a text, behind what stands before it."""
    return [CompletionItem(f"{before}{name}") for name in names if name.startswith(begun)]


def operands(ctx: click.Context) -> list[str]:
    """Return the arguments of a line that is not finished: click leaves them unnamed then."""
    values = [ctx.params.get(param.name or "") for param in ctx.command.params if not hasattr(param, "help")]
    named = [one for value in values for one in (value if isinstance(value, tuple) else (value,)) if one]
    return [*map(str, named), *ctx.args]


def columns_of(log: Path) -> Sequence[str]:
    """Return the columns that the first row of a text names; none of a file that is no such table."""
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


def _one_more(names: Iterable[str], incomplete: str) -> list[CompletionItem]:
    """Return the names that may follow the last comma: those that do not stand before it."""
    before, comma, begun = incomplete.rpartition(",")
    used = {part.partition("=")[0] for part in before.split(",")}
    return items([one for one in names if one.rstrip("=") not in used], begun, f"{before}{comma}")


def _files(suffixes: Sequence[str], incomplete: str) -> list[CompletionItem]:
    """Return the files of a kind, with the folders that the shell lists itself.

    The shell lists all files where none is of the kind, and where it must write a name with quotes. What it
    lists comes first: bash drops what stands before.
    """
    folder, begun = re.fullmatch(r"(.*/)?([^/]*)", incomplete).groups("")  # type: ignore[union-attr]  # always
    try:
        paths = sorted(Path(folder or ".").expanduser().iterdir())
    except (OSError, RuntimeError):  # there is no such folder, or no such user
        paths = []
    seen = [path for path in paths if path.name.startswith(begun) and (begun or path.name[0] != ".")]
    found = [path.name for path in seen if path.suffix.lower() in suffixes and path.is_file()]
    if not found or any(shlex.quote(name) != name for name in found):
        return [CompletionItem(incomplete, type="file")]
    return [CompletionItem(incomplete, type="dir"), *(CompletionItem(f"{folder}{name}") for name in found)]
