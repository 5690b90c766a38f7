"""Find joint values for poses of the tool."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import urmpipe
from urmpipe.answers import Answer, Call, command
from urmpipe.command_line import operand
from urmpipe.parameters import kinds
from urmpipe.parameters.motions import Ik
from urmpipe.parameters.shared import ROBOT

if TYPE_CHECKING:
    from urmpipe_pipeline.solved_targets.result import IkResult


@command(Ik, robot=ROBOT)
@operand("targets", kinds.ANY_FILE, metavar="TARGETS|PATH")
def ik(call: Call, targets: Path, output: Path | None, **options: Any) -> Answer:
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
    is_replaced = output is not None and output.exists()
    with call.progress(f"Solving {targets}") as progress:
        result = urmpipe.ik(targets, output=output, progress=progress, **options)
    return Answer(result, _iter_lines(result, options["robot"], is_replaced))


def _iter_lines(result: IkResult, robot: str | None, is_replaced: bool) -> Iterator[str]:
    """Yield the line about the output; it names the robot as the user did."""
    from urmpipe.printing.terminal import recording_line
    from urmpipe_models.errors import shell_quote

    if result.output is not None and result.output.suffix == ".rrd":
        yield recording_line(result.output, is_replaced)
    elif result.output is not None:
        replaced = "; it replaced an earlier one" if is_replaced else ""
        reader = f"urmpipe ingest {shell_quote(result.output)} --robot {shell_quote(robot)}"
        yield f"Joints: {result.output}  (read it: {reader}{replaced})"
