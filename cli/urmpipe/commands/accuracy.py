"""Measure the path error of an arm with drives."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import urmpipe
from urmpipe.answers import Answer, Call, command
from urmpipe.parameters.motions import PATH, Accuracy
from urmpipe.parameters.shared import ROBOT


@command(Accuracy, path=PATH, robot=ROBOT)
def accuracy(call: Call, path: str, output: Path | None, **options: Any) -> Answer:
    """Run an arm with drives along a path at several velocities, and measure its path error.

    The path is planned at each velocity; its set points are the inputs of the arm's controllers. With
    --limit, the command gives a verdict and finds the running speed: the largest velocity within the limit,
    to 1 %. The robot needs masses, and a drive or a spring for every joint.

    \b
    Examples:
      urmpipe accuracy --robot irb60 --path cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1
      urmpipe accuracy --robot irb60 --path contour.csv --limit 0.4mm -o run.rrd
      urmpipe accuracy --robot my-arm.toml --path contour.csv --error path --json
      urmpipe accuracy --robot my-arm.toml --path contour.csv --force 0,0,-50N

    Exit codes: 0 done, and with --limit every velocity within it, 1 a velocity above the limit, 2 bad input
    or usage.
    """
    from urmpipe.printing.terminal import recording_line
    from urmpipe.systems.blocks import ON_PYTHON

    is_replaced = output is not None and output.exists()
    with call.progress(f"Running along {path}") as progress:
        result = urmpipe.accuracy(path, output=output, on_message=call.note, progress=progress, **options)
    lines = [] if result.recording is None else [recording_line(result.recording, is_replaced)]
    warnings = [warning for warning in result.warnings if warning.kind != ON_PYTHON]  # which is noted already
    return Answer(result, lines, warnings=warnings)
