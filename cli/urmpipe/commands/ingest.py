"""`urmpipe ingest`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import urmpipe
from urmpipe.headings import HeadedCommand, Heading, option
from urmpipe.options.given import for_logs
from urmpipe.options.output import Terminal, output_option, output_options
from urmpipe.options.reading import log_options
from urmpipe.options.types import ANY_FILE, FileType
from urmpipe_models.errors import Finding, OptionError

if TYPE_CHECKING:
    from urmpipe_pipeline.runs.run import Run


@click.command(cls=HeadedCommand, short_help="Turn one log into a recording.")
@click.argument("logs", metavar="LOG...", nargs=-1, required=True, type=ANY_FILE)
@output_option("RUN.rrd", "Recording to write [default: LOG.rrd].")
@option(
    Heading.OUTPUT,
    "--explain",
    is_flag=True,
    help="Print each decision with its evidence and the option that changes it; write no recording.",
)
@option(
    Heading.OUTPUT,
    "--write-map",
    metavar="FILE.toml",
    type=FileType(".toml"),
    help="Save the inferred columns and units as a map for --map.",
)
@option(
    Heading.OUTPUT,
    "--audit",
    metavar="FILE.csv",
    type=FileType(".csv"),
    help="Write every wrap, repair and open question, one per row.",
)
@log_options
@output_options
@click.pass_context
def ingest(
    ctx: click.Context,
    /,
    logs: tuple[Path, ...],
    output: Path | None,
    explain: bool,
    terminal: Terminal,
    **options: Any,
) -> int:
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
    options, _ = for_logs(ctx, logs, options)
    alone = explain or (output is None and not any(map(is_log, logs)))  # a recording is one already
    target = None if alone else output or Path(default_name(logs))
    replaces = target is not None and target.exists()
    with terminal.progress(f"Writing {target}", shown=target is not None) as progress:
        run = urmpipe.ingest(logs, output=target, progress=progress, **options)
    terminal.warn(run.warnings)
    terminal.answer(run.to_dict, lambda: _print(run, explain, replaces, options))
    return 0


def _print(run: Run, explain: bool, replaces: bool, options: Mapping[str, Any]) -> None:
    """Print what was found in a log, and what was written."""
    from urmpipe.printing.results import print_presentation
    from urmpipe.printing.terminal import print_recording, say
    from urmpipe_models.errors import shell_quote
    from urmpipe_pipeline.results import present
    from urmpipe_pipeline.text import counted

    print_presentation(present(run), every=explain)
    if run.recording:
        print_recording(run.recording, replaced=replaces)
    if audit := options["audit"]:
        say(f"Audit: {audit}  ({counted(len(run.audit), 'line')})")
    if written := options["write_map"]:
        say(f"Map: {written}  (use it: urmpipe ingest LOG --map {shell_quote(written)})")


def default_name(logs: tuple[Path, ...]) -> str:
    """Return LOG.rrd; several files that are one log go by the name of their folder.

    Bytes of no text are replaced: Rerun opens no file whose name holds such.
    """
    first = logs[0].resolve()
    return click.format_filename(f"{first.parent.name if len(logs) > 1 else first.stem}.rrd")
