"""`urmpipe plan`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import urmpipe
from urmpipe.headings import HeadedCommand, Heading, option
from urmpipe.options.output import Terminal, output_option, output_options
from urmpipe.options.planning import law_options, path_completion, start_option
from urmpipe.options.reading import path_options
from urmpipe.options.types import DURATION, quantity_type

if TYPE_CHECKING:
    from urmpipe_pipeline.planned_paths.result import PlannedPath

PLACED = ("base", "tool", "base_link", "tip_link")
"""Options that place the arm: what reads the plan needs them again."""


@click.command(cls=HeadedCommand, short_help="Plan a path of lines and arcs, and its timing.")
@click.argument("path", metavar="PATH.csv|cube:...", shell_complete=path_completion)
@output_option("PLAN.csv|PLAN.rrd", "Write a log for the other commands, or a recording.")
@option(
    Heading.PLANNING,
    "--velocity",
    type=quantity_type("m/s", positive=False),
    help="Largest speed along the path, such as 250mm/s [default: 0.5m/s; none with --law limits].",
)
@law_options
@option(
    Heading.PLANNING,
    "--tsp",
    type=DURATION,
    default="5ms",
    show_default=True,
    help="Sample period, such as 8ms.",
)
@start_option
@path_options
@output_options
def plan(path: str, output: Path | None, terminal: Terminal, **options: Any) -> int:
    """Plan a path of lines and arcs, its timing, and the joint values of an arm that follows it.

    PATH.csv is a table of x, y, z (m) and r, the radius of an arc that begins at the row; corner_r instead
    is the radius that rounds the corner at the row. The path stops where the radius is 0. rz, ry, rx (rad)
    or a quaternion give the orientation of the tool. cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1 is a test path
    after ISO 9283, cube:diagonal the other; plane= selects its plane (xy, xz, yz; c1 to c4). Without
    --robot, only path and timing are planned.

    \b
    Examples:
      urmpipe plan contour.csv -o planned.csv
      urmpipe plan cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1 --robot irb60 -o plan.rrd
      urmpipe plan contour.csv --robot ur5e --velocity 250mm/s -o plan.csv
      urmpipe plan contour.csv --robot ur5e --law jerk --jerk 60m/s3
      urmpipe plan contour.csv --robot my-arm.toml --law limits --json

    Exit codes: 0 the arm can follow the plan (at reduced speed where joint limits require it), 1 it cannot
    (a jump, a singular pose, samples out of reach, less than 1 % of the speed left), 2 bad input or usage.
    """
    replaces = output is not None and output.exists()
    with terminal.progress(f"Planning {path}") as progress:
        result = urmpipe.plan(path, output=output, progress=progress, **options)
    terminal.warn(result.warnings)
    terminal.answer(result.to_dict, lambda: _print(result, options, replaces))
    return 1 if result.verdict == "fail" else 0


def _print(result: PlannedPath, options: Mapping[str, Any], replaces: bool) -> None:
    """Print the plan, and what was written."""
    from urmpipe.printing.results import print_presentation
    from urmpipe.printing.terminal import print_recording, say
    from urmpipe_pipeline.results import present

    print_presentation(present(result))
    if result.recording is not None:
        print_recording(result.recording, replaced=replaces)
    elif result.log is not None:
        earlier = "; it replaced an earlier one" if replaces else ""
        say(f"Plan: {result.log}  (read it: {_reading(result.log, options)}{earlier})")


def _reading(log: Path, options: Mapping[str, Any]) -> str:
    """Return the command that reads a plan: an arm of the catalogue is found by its joints and its path."""
    from urmpipe_models.errors import shell_quote, to_option
    from urmpipe_models.robots.catalogue import kinematically_distinct_names

    placed = [to_option(name) for name in PLACED if options[name] is not None]
    command = f"urmpipe ingest {shell_quote(log)}"
    if options["robot"] is not None and (placed or options["robot"] not in kinematically_distinct_names()):
        command += f" --robot {shell_quote(options['robot'])}"
    return f"{command} with the same {', '.join(placed)}" if placed else command
