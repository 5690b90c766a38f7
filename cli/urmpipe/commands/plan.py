"""Plan a path of lines and arcs, and its timing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import urmpipe
from urmpipe.answers import Answer, Call, command
from urmpipe.command_line import operand
from urmpipe.parameters import kinds
from urmpipe.parameters.motions import Plan
from urmpipe.parameters.param import params_of
from urmpipe.parameters.shared import ROBOT, Placing

if TYPE_CHECKING:
    from urmpipe_pipeline.planned_paths.result import PlannedPath


@command(Plan, robot=ROBOT)
@operand("path", kinds.PLANNED, metavar=kinds.PLANNED.metavar)
def plan(call: Call, path: str, output: Path | None, **options: Any) -> Answer:
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
    is_replaced = output is not None and output.exists()
    with call.progress(f"Planning {path}") as progress:
        result = urmpipe.plan(path, output=output, progress=progress, **options)
    return Answer(result, _iter_lines(result, options, is_replaced))


def _iter_lines(result: PlannedPath, options: Mapping[str, Any], is_replaced: bool) -> Iterator[str]:
    from urmpipe.printing.terminal import recording_line

    if result.recording is not None:
        yield recording_line(result.recording, is_replaced)
    elif result.log is not None:
        replaced = "; it replaced an earlier one" if is_replaced else ""
        yield f"Plan: {result.log}  (read it: {_format_reader(result.log, options)}{replaced})"


def _format_reader(log: Path, options: Mapping[str, Any]) -> str:
    """Return the command that reads a plan: an arm of the catalogue is found by its joints and its path."""
    from urmpipe_models.errors import shell_quote, to_option
    from urmpipe_models.robots.catalogue import kinematically_distinct_names

    placing = [to_option(name) for name in params_of(Placing) if options[name] is not None]
    reader = f"urmpipe ingest {shell_quote(log)}"
    robot = options["robot"]
    if robot is not None and (placing or robot not in kinematically_distinct_names()):
        reader += f" --robot {shell_quote(robot)}"
    return f"{reader} with the same {', '.join(placing)}" if placing else reader
