"""Turn one log into a recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import urmpipe
from urmpipe.answers import Answer, Call, command, default_output
from urmpipe.command_line import operand
from urmpipe.parameters import kinds
from urmpipe.parameters.comparing import Ingest
from urmpipe.parameters.shared import ROBOT
from urmpipe_models.display import format_count
from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.files import log_stem

if TYPE_CHECKING:
    from urmpipe_pipeline.runs.run import Run


@command(Ingest, robot=ROBOT)
@operand("logs", kinds.ANY_FILE, metavar="LOG...", nargs=-1, required=True)
def ingest(call: Call, logs: tuple[Path, ...], output: Path | None, explain: bool, **options: Any) -> Answer:
    """Turn one log into a recording: check it, repolarize it, compute the arm's kinematics.

    Repolarizing is phase unwrapping that keeps real jumps. Several files are one log if the program writes
    a file per plot (SolidWorks); a folder stands for its files. For a recording, the command shows the run
    in it.

    \b
    Examples:
      urmpipe ingest log.csv --robot urm6
      urmpipe ingest phi1.csv phi2.csv phi3.csv -o run.rrd
      urmpipe ingest table.txt --robot ur5e --unit deg --period 8ms --json
      urmpipe ingest log.csv --explain
      urmpipe ingest log.csv --robot ur5e --write-map lab.toml
      urmpipe ingest next.csv --map lab.toml
    """
    from urmpipe_pipeline.operands import is_log

    if explain and output:
        allowed = "no output: --explain writes no recording"
        raise OptionError(Finding(parameter="output", found=str(output), allowed=allowed))
    options = call.without_log_options(logs, options)
    if not explain and output is None and any(map(is_log, logs)):  # a recording is one already
        first = logs[0].resolve()
        output = default_output(first.parent.name if len(logs) > 1 else log_stem(first))
    is_replaced = output is not None and output.exists()
    with call.progress(f"Writing {output}", shown=output is not None) as progress:
        run = urmpipe.ingest(logs, output=output, progress=progress, **options)
    return Answer(run, _iter_lines(run, is_replaced, options), all_columns=explain)


def _iter_lines(run: Run, is_replaced: bool, options: Mapping[str, Any]) -> Iterator[str]:
    from urmpipe.printing.terminal import recording_line
    from urmpipe_models.errors import shell_quote

    if run.recording:
        yield recording_line(run.recording, is_replaced)
    if audit := options["audit"]:
        yield f"Audit: {audit}  ({format_count(len(run.audit), 'line')})"
    if log_map := options["write_map"]:
        yield f"Map: {log_map}  (use it: urmpipe ingest LOG --map {shell_quote(log_map)})"
