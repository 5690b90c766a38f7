"""Options of how a log is held against a reference, which compare and diagnose share."""

from __future__ import annotations

import math
from functools import partial

import click

from urmpipe.options.grouped import Command, with_options
from urmpipe.options.types import OneOf, ParsedType, parsed
from urmpipe_models.measure_units import TIMES, quantity
from urmpipe_models.tolerance import DEFAULT_TOLERANCE


def _sync(text: str) -> str | float:
    """Return how the clocks are put together: start, auto, or an offset in [s].

    Raises:
        OptionError: If it is none of them.
    """
    from urmpipe_models.errors import OptionError, shown

    offset = quantity(text, TIMES)
    if text not in ("start", "auto") and not math.isfinite(offset):
        allowed = "start, auto, or a time in s, such as -0.2 or 200ms"
        raise OptionError(f"found {shown(text)}, allowed: {allowed}")
    return text if text in ("start", "auto") else offset


def _tolerance(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> str:
    """Return the text of all tolerances, joined by commas, after a check that it can be read."""
    from urmpipe_pipeline.comparison.tolerance import parse_tolerance

    text = ",".join(values)
    parsed(partial(parse_tolerance, iso=bool(ctx.params.get("iso"))), text, ctx, param)
    return text


def _sides(text: str) -> tuple[str, ...]:
    """Return the two words.

    Raises:
        OptionError: If there are not two.
    """
    from urmpipe_models.errors import OptionError, shown

    words = tuple(word.strip() for word in text.split(","))
    if len(words) != 2 or not all(words):
        raise OptionError(f"found {shown(text)}, allowed: two words, such as target,actual")
    return words


SIDES = ParsedType("REFERENCE,LOG", _sides)
SYNC = ParsedType("sync", _sync)

TOLERANCE_OPTION = click.option(
    "--tolerance",
    default=[str(DEFAULT_TOLERANCE)],
    show_default=True,
    multiple=True,
    callback=_tolerance,
    metavar="M|KIND=VALUE,...",
    help="Largest deviation allowed: on an axis in m, or of kinds: axis, x, y, z, norm, path (m, mm, um),"
    " angle, joint (rad, mrad, deg; m of joints that slide), as axis=3.5mm,norm=5mm,angle=0.5deg. It replaces"
    " the default whole: what is not named is not judged.",
)
TCP_OPTION = click.option(
    "--tcp",
    type=OneOf(["fk", "recorded"]),
    default="fk",
    show_default=True,
    help="Where a log was: by its joints, or as it recorded itself.",
)
SYNC_OPTION = click.option(
    "--sync",
    default="start",
    show_default=True,
    type=SYNC,
    metavar="start|auto|SECONDS",
    help="Start both together, find the offset by the motion, or t_reference = t_log + SECONDS (below 0 for a"
    " late log).",
)
SIDES_OPTION = click.option(
    "--sides",
    type=SIDES,
    help="Both sides of one log, by words in the names of its columns: target,actual; desired,actual;"
    " commanded,measured. rest: the columns without the other word.",
)
BLOCK_OPTION = click.option(
    "--block",
    metavar="NAME",
    multiple=True,
    callback=lambda ctx, param, names: names or None,
    help="Of a simulation: the block whose motion is meant; of several once for all, or once for each in"
    " their order [default: the only block that has a motion].",
)


def comparing_options(command: Command) -> Command:
    """Add what is allowed, where a log was, how clocks are put together, sides of a log and blocks."""
    return with_options(command, TOLERANCE_OPTION, TCP_OPTION, SYNC_OPTION, SIDES_OPTION, BLOCK_OPTION)
