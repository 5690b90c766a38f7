"""Compare logs with a reference and give a verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import click

import urmpipe
from urmpipe.answers import Answer, Call, command, default_output
from urmpipe.command_line import operand
from urmpipe.parameters import kinds
from urmpipe.parameters.comparing import Baseline, Compare
from urmpipe.parameters.param import params_of
from urmpipe.parameters.shared import ROBOT, Debugging, Printing, Strict
from urmpipe_models.files import log_stem

OF_RESULTS = {*params_of(Baseline, Strict, Printing, Debugging), "junit", "csv"}  # of finished comparisons


@command(Compare, robot=ROBOT)
@operand("reference", kinds.ANY_FILE)
@operand("logs", kinds.ANY_FILE, metavar="[LOG...]", nargs=-1)
def compare(
    call: Call, reference: Path, logs: tuple[Path, ...], output: Path | None, **options: Any
) -> Answer:
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
      urmpipe compare path.csv simulation.rrd --block arm
      urmpipe compare today.rrd --baseline released.rrd --noise 5um

    Exit codes: 0 within tolerance and not worse than the baseline, 1 out of tolerance or worse, 2 bad input
    or usage.
    """
    return answer_comparison(call, urmpipe.compare, reference, logs, output, options)


def answer_comparison(
    call: Call,
    judge: Callable[..., Any],
    reference: Path,
    logs: tuple[Path, ...],
    output: Path | None,
    options: Mapping[str, Any],
) -> Answer:
    """Answer `compare` or `iso`.

    Args:
        call: The call.
        judge: The public function.
        reference: The reference.
        logs: The logs.
        output: The recording to write; None for the default.
        options: The other options.
    """
    options = call.without_log_options((reference, *logs), options)
    earlier = None if logs or not options["baseline"] else load_finished(call, reference)
    if not options["baseline"] and not call.explicit_options("noise".__eq__):
        options["noise"] = None  # urmpipe.toml sets it for the calls with a baseline
    if earlier is None:
        output = output or default_output(_output_name(reference, logs))
    is_replaced = output is not None and output.exists()
    defaults = call.deciding_defaults(options)
    with call.progress(f"Writing {output}", shown=output is not None) as progress:
        result = judge(
            earlier or reference, logs, output=output, defaults=defaults,
            progress=progress, **options,
        )  # fmt: skip
    lines = iter_lines(result.recording, is_replaced, options)
    return Answer(result, lines, errors=result.errors, is_incomplete=bool(result.failed_logs))


def iter_lines(recording: Path | None, is_replaced: bool, options: Mapping[str, Any]) -> Iterator[str]:
    """Yield a line for each file that a comparison wrote."""
    from urmpipe.printing.terminal import recording_line

    for title, name in (("JUnit", "junit"), ("Statistics", "csv")):
        if options[name]:
            yield f"{title}: {options[name]}"
    yield recording_line(recording, is_replaced)


def load_finished(call: Call, reference: Path, *also: str) -> Any:
    """Return the comparison that the reference is the recording of; None if it is anything else.

    Args:
        call: The call.
        reference: The reference.
        also: Options that apply to a finished comparison, in addition to those of each command.

    Raises:
        UsageError: If options were given that say how a comparison is made.
    """
    from urmpipe_pipeline.operands import load_comparison

    comparison = load_comparison(reference)
    options = call.explicit_options(lambda name: name not in OF_RESULTS and name not in also)
    if comparison is not None and options:
        raise click.UsageError(
            f"{', '.join(options)}: found with the recording of a comparison ({reference}), whose"
            " options are fixed, allowed: with the logs, to compare them again"
        )
    return comparison


def _output_name(reference: Path, logs: tuple[Path, ...]) -> str:
    """Return LOG-against-REFERENCE; of several logs the name of the first."""
    stem = log_stem(reference.resolve())
    if not logs:
        return f"{stem}-against-itself"
    more = f"-and-{len(logs) - 1}-more" if len(logs) > 1 else ""
    return f"{log_stem(logs[0].resolve())}{more}-against-{stem}"
