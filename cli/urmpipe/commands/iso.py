"""Evaluate a repeated motion after ISO 9283."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import urmpipe
from urmpipe.answers import Answer, Call, command
from urmpipe.command_line import operand
from urmpipe.commands.compare import answer_comparison
from urmpipe.parameters import kinds
from urmpipe.parameters.comparing import Iso
from urmpipe.parameters.shared import ROBOT


@command(Iso, robot=ROBOT)
@operand("reference", kinds.ANY_FILE)
@operand("logs", kinds.ANY_FILE, metavar="[LOG...]", nargs=-1)
def iso(call: Call, reference: Path, logs: tuple[Path, ...], output: Path | None, **options: Any) -> Answer:
    """Evaluate accuracy and repeatability of poses, paths and speed after ISO 9283.

    REFERENCE is the commanded motion, as for compare. Each LOG is a cycle of the test, or one LOG repeats the
    motion. --tolerance names the criteria that are judged; docs/iso.md lists them. With --baseline,
    REFERENCE alone may be the recording of a test, which is used unchanged.

    \b
    Examples:
      urmpipe iso path.csv test.csv --robot urm6 --tolerance AP=1mm
      urmpipe iso path.csv run1.csv run2.csv run3.csv --robot urm6
      urmpipe iso plan.rrd test.csv --robot ur5e --csv criteria.csv
      urmpipe iso path.csv test.csv --robot urm6 --baseline accepted.rrd

    Exit codes: 0 within tolerance and not worse than the baseline, or no criterion judged, 1 out of tolerance
    or worse, 2 bad input or usage, or too few cycles for a criterion.
    """
    return answer_comparison(call, urmpipe.iso, reference, logs, output, options)
