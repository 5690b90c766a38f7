"""Options of how a log is compared with a reference, which compare and diagnose share."""

from __future__ import annotations

import math
from functools import partial

import click

from urmpipe.headings import Heading, option
from urmpipe.options.completion import tolerances, words
from urmpipe.options.grouped import Command, with_options
from urmpipe.options.types import OneOf, ParsedType, parsed
from urmpipe_models import DEFAULT_TOLERANCE
from urmpipe_models.measure_units import WRITTEN, quantity_to_si

SYNC_WORDS = ("stamps", "start", "auto")


def _sync(text: str) -> str | float:
    """Return how the clocks are aligned: stamps, start, auto, or an offset in [s].

    Raises:
        OptionError: If it is none of them.
    """
    from urmpipe_models.errors import OptionError, format_value

    offset = quantity_to_si(text, WRITTEN["s"])
    if text not in SYNC_WORDS and not math.isfinite(offset):
        allowed = f"{', '.join(SYNC_WORDS)}, or a time in s, such as -0.2 or 200ms"
        raise OptionError(f"found {format_value(text)}, allowed: {allowed}")
    return text if text in SYNC_WORDS else offset


def _tolerance(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> str:
    """Return the text of all tolerances, joined by commas, after a check that it can be read."""
    from urmpipe_pipeline.comparison.verdict import parse_tolerance

    text = ",".join(values)
    parsed(partial(parse_tolerance, iso=bool(ctx.params.get("iso"))), text, ctx, param)
    return text


def _sides(text: str) -> tuple[str, ...]:
    """Return the two words.

    Raises:
        OptionError: If there are not two.
    """
    from urmpipe_models.errors import OptionError, format_value

    words = tuple(word.strip() for word in text.split(","))
    if len(words) != 2 or not all(words):
        raise OptionError(f"found {format_value(text)}, allowed: two words, such as target,actual")
    return words


SIDES = ParsedType("REFERENCE,LOG", _sides)
SYNC = ParsedType("sync", _sync)

TOLERANCE_OPTION = option(
    Heading.JUDGING,
    "--tolerance",
    default=[f"{1e3 * DEFAULT_TOLERANCE:g}mm"],
    show_default=True,
    multiple=True,
    callback=_tolerance,
    shell_complete=tolerances,
    metavar="LENGTH|KIND=VALUE,...",
    help="Largest allowed deviation on each axis, such as 3.5mm, or per kind, such as"
    " axis=3.5mm,norm=5mm,angle=0.5deg. Kinds: axis, x, y, z, norm, path (m, mm, um), angle, joint (rad,"
    " mrad, deg; m for sliding joints). A number alone is in m or rad; lengths from 0.02 and angles above 0.2"
    " need their unit. They replace the default completely: kinds that are not named are not judged. Least"
    " shares to be seen: coverage of the reference (90% if not named), judged of the log's motion (50%).",
)
TCP_OPTION = option(
    Heading.COMPARED,
    "--tcp",
    type=OneOf(["fk", "recorded"]),
    default="fk",
    show_default=True,
    help="Source of the tool position: fk, from the joint values; recorded, from the log.",
)
SYNC_OPTION = option(
    Heading.ALIGNING,
    "--sync",
    type=SYNC,
    shell_complete=words(*SYNC_WORDS),
    metavar="stamps|start|auto|TIME",
    help="Align the clocks: by Unix times or dates on both sides (stamps), at the first samples (start), by"
    " the motion (auto), or by an offset such as 200ms: t_reference = t_log + TIME, negative if the log is"
    " late [default: stamps if both sides have them and overlap, else start].",
)
SIDES_OPTION = option(
    Heading.COMPARED,
    "--sides",
    type=SIDES,
    shell_complete=words("target,actual", "desired,actual", "commanded,measured"),
    help="Compare two sets of columns of one log, selected by words in their names: target,actual;"
    " desired,actual; commanded,measured. rest: all columns without the other word.",
)
BLOCK_OPTION = option(
    Heading.COMPARED,
    "--block",
    metavar="NAME",
    multiple=True,
    callback=lambda ctx, param, names: names or None,
    help="Block of a simulation whose motion is compared; for several simulations once for all, or once for"
    " each in their order [default: the only block with a motion].",
)


def comparing_options(command: Command) -> Command:
    """Add tolerance, source of the tool position, alignment of clocks, sides of a log, and blocks."""
    return with_options(command, TOLERANCE_OPTION, TCP_OPTION, SYNC_OPTION, SIDES_OPTION, BLOCK_OPTION)
