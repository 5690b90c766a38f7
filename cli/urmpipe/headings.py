"""Options under headings, which `--help` of a command with many options shows in one order."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from typing import Any, TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., Any])

FLAT = 12
"""Options that one list holds and a reader still finds; more of them go under headings."""


class Heading(StrEnum):
    """The headings, in the order of every help page."""

    ROBOT = "Robot"
    PLANNING = "Planning"
    SOLVING = "Solving"
    RUNNING = "Running"
    JUDGING = "Judging"
    ALIGNING = "Aligning"
    COMPARED = "Compared motions"
    ISO = "Test after ISO 9283"
    BASELINE = "Baseline"
    READING = "Reading files"
    PROCESSING = "Processing"
    OUTPUT = "Output"
    GENERAL = "General"


class HeadedOption(click.Option):
    """An option with its heading.

    Args:
        heading: The heading.
        declarations: The names of the option.
        settings: Further arguments of `click.Option`.
    """

    def __init__(self, *declarations: Any, heading: Heading, **settings: Any) -> None:
        super().__init__(*declarations, **settings)
        self.heading = heading


def option(heading: Heading, *names: str, **settings: Any) -> Callable[[Command], Command]:
    """Return a decorator that adds an option under a heading."""
    return click.option(*names, cls=HeadedOption, heading=heading, **settings)


class HeadedCommand(click.Command):
    """A command whose help shows many options under their headings, and few in one list."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; with --strict a warning about the files of its defaults is an error, too."""
        if ctx.obj and ctx.obj.warnings and ctx.params.get("strict"):
            from urmpipe.keyword_checks import refuse_warnings

            refuse_warnings(True, ctx.obj.warnings)
        return super().invoke(ctx)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, each heading with its own in the order of the command."""
        records: dict[Heading, list[tuple[str, str]]] = {heading: [] for heading in Heading}
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx) if isinstance(param, click.Option) else None
            if record is not None:
                records[getattr(param, "heading", Heading.GENERAL)].append(record)
        if sum(map(len, records.values())) <= FLAT:
            super().format_options(ctx, formatter)
            return
        for heading, rows in records.items():
            if rows:
                with formatter.section(heading):
                    formatter.write_dl(rows)
