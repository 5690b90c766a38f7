"""`urmpipe diagnose`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import urmpipe
from urmpipe.options.comparing import comparing_options
from urmpipe.options.given import for_logs
from urmpipe.options.output import Terminal, output_option, output_options
from urmpipe.options.reading import log_options
from urmpipe.options.types import ParsedType

if TYPE_CHECKING:
    from urmpipe_pipeline.diagnosis.result import Diagnosis


def _not_aligned(text: str) -> str:
    """Refuse an option that compare has: whoever gives it hears why.

    Raises:
        OptionError: If the log is to be moved.
    """
    from urmpipe_models.errors import OptionError
    from urmpipe_pipeline.comparison.compare import NO_ALIGNMENT

    if text != "none":
        raise OptionError(f"found {text}, allowed: {NO_ALIGNMENT}")
    return text


@click.command(short_help="Say why a log deviates from its reference.")
@click.argument("reference", type=click.Path(path_type=Path))
@click.argument("log", required=False, type=click.Path(path_type=Path))
@output_option("RUN.rrd", "The recording [default: LOG-diagnosed.rrd here].")
@comparing_options
@click.option(
    "--align",
    type=ParsedType("MODE", _not_aligned),
    hidden=True,
    expose_value=False,
    help="Refused: base and tool are causes.",
)
@log_options
@output_options
@click.pass_context
def diagnose(
    ctx: click.Context,
    /,
    reference: Path,
    log: Path | None,
    output: Path | None,
    terminal: Terminal,
    **options: Any,
) -> int:
    """Say why a log deviates from its reference, and how sure that is.

    Looks for the causes that make both agree: joints that count the other way, are exchanged, have
    another zero or scale; lengths and angles of the arm; base and tool; the unit of the path; the clock;
    another arm. REFERENCE and LOG are those of compare, and so are verdict and exit code; with REFERENCE
    alone, that log is held against the tool centre point that it recorded itself. What these two sides
    cannot tell is said.

    \b
    Examples:
      urmpipe diagnose path.csv log.csv --robot urm6
      urmpipe diagnose robot_data.csv --robot ur5e
      urmpipe diagnose rtde.csv --sides target,actual --robot ur5e
      urmpipe diagnose path.csv log.csv --robot urm6 --json

    Exit codes: 0 within tolerance, 1 out of tolerance, 2 bad input or usage.
    """
    operands = (reference,) if log is None else (reference, log)
    options, note = for_logs(ctx, operands, options)
    if note:
        terminal.note(note)
    target = output or Path(click.format_filename(f"{operands[-1].resolve().stem}-diagnosed.rrd"))
    replaces = target.exists()
    with terminal.progress(f"Writing {target}") as progress:
        result = urmpipe.diagnose(reference, log, output=target, progress=progress, **options)
    terminal.warn(result.warnings)
    terminal.answer(lambda: result.to_dict("command line"), lambda: _print(result, replaces))
    terminal.tell_failure(result)
    return 0 if result.verdict == "pass" else 1


def _print(result: Diagnosis, replaces: bool) -> None:
    """Print the answer, what it rests on, and what was written."""
    from urmpipe.printing.presentation import print_presentation
    from urmpipe.printing.terminal import print_recording, say
    from urmpipe_pipeline.results import present, whole

    print_presentation(present(result))
    say(f"Verdict: {present(whole(result)).headline}")
    print_recording(result.recording, replaced=replaces)
