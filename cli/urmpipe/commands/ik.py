"""`urmpipe ik`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

import urmpipe
from urmpipe.headings import HeadedCommand, Heading, option
from urmpipe.options.output import Terminal, output_option, output_options
from urmpipe.options.reading import table_options
from urmpipe.options.types import ANY_FILE, DEVIATION, DURATION, JOINT_VALUES, OneOf, WholeType, parsed

if TYPE_CHECKING:
    from urmpipe_pipeline.solved_targets.result import IkResult


def _on_axes(ctx: click.Context, param: click.Parameter, value: str | None) -> float | None:
    """Return a tolerance on each axis in [m]; of one of several kinds in urmpipe.toml that on an axis."""
    if value is None:
        return None
    if ctx.get_parameter_source("tolerance") != ParameterSource.DEFAULT_MAP:
        return float(parsed(DEVIATION.read, value.removeprefix("axis="), ctx, param))
    from urmpipe_pipeline.comparison.verdict import parse_tolerance

    kinds: dict[str, float] = parsed(parse_tolerance, value, ctx, param)
    return kinds.get("axis")


@click.command(cls=HeadedCommand, short_help="Find joint values for poses of the tool.")
@click.argument("targets", metavar="TARGETS|PATH", type=ANY_FILE)
@output_option("LOG.csv|RUN.rrd", "Write a joint log for ingest, or a recording.")
@option(
    Heading.SOLVING,
    "--every",
    "--all",
    is_flag=True,
    help="Find all solutions, and record each as a ghost arm; arms without a closed form use random starts.",
)
@option(
    Heading.SOLVING,
    "--start",
    type=JOINT_VALUES,
    help="Prefer solutions near these joint values, in rad and m or with units, such as 0,-90deg,500mm"
    " [default: the robot's start pose].",
)
@option(
    Heading.SOLVING,
    "--tolerance",
    metavar=DEVIATION.name,
    callback=_on_axes,
    help="Allow the nearest reachable point within this distance on each axis, such as 3.5mm.",
)
@option(
    Heading.SOLVING,
    "--tsp",
    type=DURATION,
    help="Sample period of a table without time column; its rows are then a path.",
)
@option(
    Heading.SOLVING,
    "--within-pi",
    is_flag=True,
    help="Wrap joints without limits to -pi..pi, as CoppeliaSim does.",
)
@option(
    Heading.SOLVING,
    "--method",
    type=OneOf(["auto", "closed", "iterative"]),
    default="auto",
    show_default=True,
    help="Solver; auto: the closed form if the arm has one, else iterative.",
)
@option(
    Heading.SOLVING,
    "--restarts",
    type=WholeType(),
    default=20,
    show_default=True,
    help="Random starts of the iterative solver if the first one fails.",
)
@option(
    Heading.SOLVING,
    "--seed",
    type=WholeType(),
    default=0,
    show_default=True,
    help="Seed of the random starts.",
)
@table_options
@output_options
def ik(
    targets: Path,
    output: Path | None,
    terminal: Terminal,
    **options: Any,
) -> int:
    """Find joint values that bring the tool centre point (TCP) of an arm to targets.

    TARGETS is a table of x, y, z (m) and, if the orientation matters, rz, ry, rx (rad) or a quaternion. Each
    row is solved on its own. A PATH also has a time column (or --tsp): its rows are solved in order, without
    jumps where the arm allows it.

    \b
    Examples:
      urmpipe ik targets.csv --robot arm6
      urmpipe ik targets.csv --robot ur5e --every --json
      urmpipe ik targets.csv --robot ur5e --start 0,-1.6,1.6,0,1.6,0 -o ik.rrd
      urmpipe ik path.csv --robot urm6 -o joints.csv
      urmpipe ik path.csv --robot ur5e --tolerance 3.5mm -o run.rrd

    Exit codes: 0 every target reached, 1 not every target reached (rows without a target count, and on a
    path also jumps and joints that are too fast), 2 bad input or usage.
    """
    replaces = output is not None and output.exists()
    with terminal.progress(f"Solving {targets}") as progress:
        result = urmpipe.ik(targets, output=output, progress=progress, **options)
    terminal.warn(result.warnings)
    terminal.answer(result.to_dict, lambda: _print(result, options["robot"], replaces))
    return 0 if result.verdict == "pass" else 1


def _print(result: IkResult, robot: str | None, replaces: bool) -> None:
    """Print what was found, and what was written: how to read it names the robot as the caller does."""
    from urmpipe.printing.results import print_presentation
    from urmpipe.printing.terminal import print_recording, say
    from urmpipe_models.errors import shell_quote
    from urmpipe_pipeline.results import present

    print_presentation(present(result))
    written = result.output
    if written is not None and written.suffix == ".rrd":
        print_recording(written, replaced=replaces)
    elif written is not None:
        earlier = "; it replaced an earlier one" if replaces else ""
        how = f"urmpipe ingest {shell_quote(written)} --robot {shell_quote(robot)}"
        say(f"Joints: {written}  (read it: {how}{earlier})")
