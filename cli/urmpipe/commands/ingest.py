"""Turn one log into a recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import urmpipe
from urmpipe.answers import Answer, Call, command, default_output
from urmpipe.command_line import operand
from urmpipe.parameters import kinds
from urmpipe.parameters.comparing import Ingest
from urmpipe.parameters.shared import ROBOT
from urmpipe_models.display import format_count
from urmpipe_models.errors import Finding, LogError, OptionError
from urmpipe_models.files import log_stem

if TYPE_CHECKING:
    from urmpipe_pipeline.logs import LogMap
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
        try:
            run = urmpipe.ingest(logs, output=output, progress=progress, **options)
        except LogError as error:
            open_map = _open_map(logs, options, error) if explain and not call.json else None
            if open_map is None or not open_map.questions:
                raise
            return Answer(print_text=partial(_print_map, open_map), errors=error.findings)
    text = partial(_print_run_map, run, options["robot"]) if explain else None
    return Answer(run, _iter_lines(run, is_replaced, options), print_text=text)


def _print_run_map(run: Run, robot: str | None) -> None:
    from urmpipe.api.write_map import map_of_run
    from urmpipe_pipeline.results import present

    _print_map(map_of_run(run, Path("map.toml"), robot), present(run).headline)


def _print_map(log_map: LogMap, headline: str = "") -> None:
    from urmpipe.printing.terminal import print_line
    from urmpipe_pipeline.logs import format_map

    for line in (*([f"# {headline}"] if headline else ()), *format_map(log_map).splitlines()):
        print_line(line)


def _open_map(logs: tuple[Path, ...], options: Mapping[str, Any], error: LogError) -> LogMap:
    """Return the map of logs that cannot be read yet, with its questions."""
    from urmpipe.reading import to_log_map
    from urmpipe_pipeline.logs.read import open_map
    from urmpipe_pipeline.operands import log_files

    files = [file for log in logs for file in log_files(log)]
    return open_map(files, replace(to_log_map(options), robot=options["robot"]), error)


def _iter_lines(run: Run, is_replaced: bool, options: Mapping[str, Any]) -> Iterator[str]:
    from urmpipe.printing.terminal import recording_line
    from urmpipe_models.errors import shell_quote

    if run.recording:
        yield recording_line(run.recording, is_replaced)
    if audit := options["audit"]:
        yield f"Audit: {audit}  ({format_count(len(run.audit), 'line')})"
    if log_map := options["write_map"]:
        yield f"Map: {log_map}  (use it: urmpipe ingest LOG --map {shell_quote(log_map)})"
