"""`urmpipe diagnose`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import urmpipe
from urmpipe.headings import HeadedCommand, Heading, option
from urmpipe.options.comparing import comparing_options
from urmpipe.options.given import deciding_defaults, for_logs
from urmpipe.options.output import Terminal, output_option, output_options
from urmpipe.options.reading import log_options
from urmpipe.options.types import ANY_FILE, ParsedType

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


@click.command(cls=HeadedCommand, short_help="Find out why a log deviates from its reference.")
@click.argument("reference", type=ANY_FILE)
@click.argument("log", required=False, type=ANY_FILE)
@output_option("RUN.rrd", "Recording to write [default: LOG-diagnosed.rrd].")
@comparing_options
@option(
    Heading.ALIGNING,
    "--align",
    type=ParsedType("MODE", _not_aligned),
    hidden=True,
    expose_value=False,
    help="Not allowed: base and tool are possible causes.",
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
    """Find out why a log deviates from its reference, with confidence intervals.

    The command tests possible causes: joints with reversed sign, exchanged joints, joint offsets and
    scales, lengths and angles of the arm, base and tool, unit of the path, clock, a different arm. It also
    names the causes that this data cannot distinguish. REFERENCE, LOG, verdict and exit code are those of
    compare; with REFERENCE alone, the log is compared with the tool centre point (TCP) that it recorded.

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
        defaults = deciding_defaults(ctx, options)
        result = urmpipe.diagnose(
            reference, log, output=target, defaults=defaults, progress=progress, **options
        )
    terminal.warn(result.warnings)
    terminal.answer(result.to_dict, lambda: _print(result, replaces))
    terminal.tell_failure(result)
    return 0 if result.verdict == "pass" else 1


def _print(result: Diagnosis, replaces: bool) -> None:
    """Print the answer, what it rests on, and what was written."""
    from urmpipe.printing.results import print_presentation
    from urmpipe.printing.terminal import print_recording, say
    from urmpipe_pipeline.results import enclosing_result, present

    print_presentation(present(result))
    say(f"Verdict: {present(enclosing_result(result)).headline}")
    print_recording(result.recording, replaced=replaces)
