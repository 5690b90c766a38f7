"""`urmpipe compare`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import urmpipe
from urmpipe.error_boundary import print_findings
from urmpipe.headings import HeadedCommand, Heading, option
from urmpipe.options.comparing import comparing_options
from urmpipe.options.completion import tolerances
from urmpipe.options.given import deciding_defaults, for_logs, options_given
from urmpipe.options.output import Terminal, output_option, output_options
from urmpipe.options.reading import log_options
from urmpipe.options.types import ANY_FILE, DEVIATION, RECORDING, FileType, OneOf, ParsedType

if TYPE_CHECKING:
    from urmpipe_pipeline.comparison.comparison import Comparison

OF_RESULTS = {"baseline", "noise", "junit", "csv", "strict", "as_json", "quiet", "debug"}
"""Parameters that a comparison takes that was made before; the others say how one is made."""


def _noise(text: str) -> dict[str, float]:
    """Return what of a change means nothing, by kind."""
    from urmpipe_pipeline.comparison.baseline import parse_noise

    return parse_noise(text)


def _cycles(text: str) -> tuple[tuple[int, int], ...]:
    """Return the rows of cycles, from 1."""
    from urmpipe_pipeline.iso9283.cycles import parse_cycles

    return parse_cycles(text)


@click.command(cls=HeadedCommand, short_help="Compare logs with a reference and give a verdict.")
@click.argument("reference", type=ANY_FILE)
@click.argument("logs", metavar="[LOG...]", nargs=-1, type=ANY_FILE)
@output_option("RUN.rrd", "Recording to write [default: LOG-against-REFERENCE.rrd].")
@comparing_options
@option(
    Heading.ALIGNING,
    "--align",
    type=OneOf(["none", "start", "rigid", "tool", "base+tool"]),
    default="none",
    show_default=True,
    help="Align the log first: start pose, best rigid motion, best tool offset, or best base and tool"
    " together (for an external measuring device).",
)
@option(
    Heading.JUDGING,
    "--diagnose",
    is_flag=True,
    help="Also diagnose why each log deviates (docs/diagnose.md). Not with --align: base and tool are"
    " possible causes.",
)
@option(
    Heading.ISO,
    "--iso",
    is_flag=True,
    is_eager=True,  # what a tolerance is of depends on it
    help="Evaluate accuracy and repeatability of poses, paths and speed after ISO 9283 (docs/iso.md). Each"
    " log is a cycle of the test, or one log repeats the motion. --tolerance then takes criteria, such as"
    " AP=0.4mm,RP=0.1mm,AT=1mm,AV=5%, and has no default.",
)
@option(
    Heading.ISO,
    "--cycles",
    metavar="FIRST:LAST,...",
    type=ParsedType("FIRST:LAST,...", _cycles),
    help="With --iso: rows of each cycle of one log, from 1 [default: from each return to the start].",
)
@option(
    Heading.ISO,
    "--planes",
    type=int,
    metavar="N",
    help="With --iso: number of planes that cut the command path [default: 50].",
)
@option(
    Heading.ISO,
    "--band",
    type=DEVIATION,
    help="With --iso: half width of the band around a final pose [default: 0.1mm].",
)
@option(
    Heading.ISO,
    "--targets",
    metavar="FILE.csv",
    type=ANY_FILE,
    help="With --iso: poses to judge, one per row: x, y, z and optionally an orientation [default: the poses"
    " at which REFERENCE rests].",
)
@option(
    Heading.JUDGING,
    "--keep-going",
    is_flag=True,
    help="If a log cannot be judged, judge the others, write the outputs, and exit with code 2.",
)
@option(
    Heading.OUTPUT,
    "--junit",
    metavar="FILE.xml",
    type=FileType(".xml"),
    help="Write the verdicts as JUnit XML for GitLab, Jenkins and GitHub.",
)
@option(
    Heading.OUTPUT,
    "--csv",
    metavar="FILE.csv",
    type=FileType(".csv"),
    help="Write the statistics as a table, one row per log and quantity.",
)
@option(
    Heading.BASELINE,
    "--baseline",
    metavar="RUN.rrd",
    type=RECORDING,
    help="Report changes since an earlier comparison (.rrd); exit code 1 if worse.",
)
@option(
    Heading.BASELINE,
    "--noise",
    type=ParsedType("LENGTH|KIND=VALUE,...", _noise),
    shell_complete=tolerances,
    help="Ignore smaller changes since the baseline; written like --tolerance [default: 1um, 1e-6 rad].",
)
@log_options
@output_options
@click.pass_context
def compare(
    ctx: click.Context,
    /,
    reference: Path,
    logs: tuple[Path, ...],
    output: Path | None,
    terminal: Terminal,
    **options: Any,
) -> int:
    """Compare logs with a reference: deviation, statistics, verdict.

    REFERENCE is a path (t, x, y, z), a log, or a recording; so is each LOG. A folder stands for the files
    of one log. With REFERENCE alone, its forward kinematics are compared with the tool centre point (TCP)
    that it recorded. With --sides, REFERENCE holds commanded and measured motion. For the recording of a
    simulation, --block selects the block. With --baseline, REFERENCE alone may be the recording of a
    comparison, which is used unchanged.

    \b
    Examples:
      urmpipe compare path.csv log.csv --robot urm6
      urmpipe compare path.csv coppelia.csv matlab.csv plots/ --robot urm6 --json
      urmpipe compare log.csv --robot ur5e --tolerance axis=2mm,angle=0.5deg
      urmpipe compare rtde.csv --sides target,actual --robot ur5e
      urmpipe compare path.csv log.csv --robot urm6 --junit v.xml --csv v.csv
      urmpipe compare path.csv a.csv b.csv --robot urm6 --diagnose
      urmpipe compare path.csv test.csv --robot urm6 --iso --tolerance AP=1mm
      urmpipe compare path.csv simulation.rrd --block arm
      urmpipe compare today.rrd --baseline released.rrd --noise 5um

    Exit codes: 0 within tolerance and not worse than the baseline, 1 out of tolerance or worse, 2 bad input
    or usage.
    """
    options, note = for_logs(ctx, (reference, *logs), options)
    if note:
        terminal.note(note)
    made = None if logs or not options["baseline"] else _made_before(ctx, reference)
    if not options["baseline"] and not options_given(ctx, "noise".__eq__):
        options["noise"] = None  # what a lab says for the calls that have a baseline
    for name in ("tolerance", "sync") if options["iso"] else ():
        if not options_given(ctx, name.__eq__):
            options[name] = None  # the defaults, and what a lab says, are for logs that are judged one by one
    if not options_given(ctx, "keep_going".__eq__):
        options["keep_going"] &= not options["iso"]
    target = None if made else output or Path(default_name(reference, logs))
    replaces = target is not None and target.exists()
    with terminal.progress(f"Writing {target}", shown=target is not None) as progress:
        result = urmpipe.compare(
            made or reference,
            logs,
            output=target,
            defaults=deciding_defaults(ctx, options),
            progress=progress,
            **options,
        )
    for one in result.runs:
        terminal.warn(one.run.warnings, one.name)
    terminal.warn(result.warnings)
    written = {"JUnit": options["junit"], "Statistics": options["csv"]}
    terminal.answer(result.to_dict, lambda: _print(result, replaces, written))
    terminal.tell_failure(result)
    if result.errors:
        print_findings(result.errors, as_json=False)
    if result.verdict == "fail" and not result.failed_logs:
        return 1
    return 2 if result.errors else 0


def _print(result: Comparison, replaces: bool, written: dict[str, Path | None]) -> None:
    """Print a comparison, and what was written."""
    from urmpipe.printing.results import print_presentation
    from urmpipe.printing.terminal import print_recording, say
    from urmpipe_pipeline.results import present

    print_presentation(present(result))
    for title, path in written.items():
        if path:
            say(f"{title}: {path}")
    print_recording(result.recording, replaced=replaces)


def _made_before(ctx: click.Context, reference: Path) -> Comparison | None:
    """Return the comparison that the reference is the recording of; None if it is anything else.

    Raises:
        UsageError: If options were given that say how a comparison is made.
    """
    from urmpipe_pipeline.operands import load_comparison

    made = load_comparison(reference)
    given = options_given(ctx, lambda name: name not in OF_RESULTS)
    if made is not None and given:
        raise click.UsageError(
            f"{', '.join(given)}: found with the recording of a comparison ({reference}), which stands as it"
            " was made, allowed: with the logs themselves"
        )
    return made


def default_name(reference: Path, logs: tuple[Path, ...]) -> str:
    """Return LOG-against-REFERENCE.rrd; of several logs the first names it. Bytes of no text are replaced."""
    against = reference.resolve().stem
    if not logs:
        return click.format_filename(f"{against}-against-itself.rrd")
    more = f"-and-{len(logs) - 1}-more" if len(logs) > 1 else ""
    return click.format_filename(f"{logs[0].resolve().stem}{more}-against-{against}.rrd")
