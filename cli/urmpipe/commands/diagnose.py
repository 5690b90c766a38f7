"""Find out why logs deviate from their reference."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import urmpipe
from urmpipe.answers import Answer, Call, command, default_output
from urmpipe.command_line import operand
from urmpipe.commands.compare import iter_lines, load_finished
from urmpipe.parameters import kinds
from urmpipe.parameters.comparing import Diagnose
from urmpipe.parameters.shared import ROBOT
from urmpipe_models.files import log_stem


@command(Diagnose, robot=ROBOT)
@operand("reference", kinds.ANY_FILE)
@operand("logs", kinds.ANY_FILE, metavar="[LOG...]", nargs=-1)
def diagnose(
    call: Call, reference: Path, logs: tuple[Path, ...], output: Path | None, **options: Any
) -> Answer:
    """Find out why a log deviates from its reference, with confidence intervals.

    The command tests possible causes: joints with reversed sign, exchanged joints, joint offsets and
    scales, lengths and angles of the arm, base and tool, unit of the path, clock, a different arm. It also
    names the causes that this data cannot distinguish. REFERENCE, LOGs, verdict and exit code are those
    of compare; with REFERENCE alone, the log is compared with the tool centre point (TCP) that it recorded.
    REFERENCE alone may be the recording of a comparison, whose logs are diagnosed as they were compared.

    \b
    Examples:
      urmpipe diagnose path.csv log.csv --robot urm6
      urmpipe diagnose robot_data.csv --robot ur5e
      urmpipe diagnose rtde.csv --sides target,actual --robot ur5e
      urmpipe diagnose path.csv a.csv b.csv --robot urm6 --junit v.xml
      urmpipe diagnose log-against-path.rrd
      urmpipe diagnose path.csv log.csv --robot urm6 --json

    Exit codes: 0 within tolerance and not worse than the baseline, 1 out of tolerance or worse, 2 bad input
    or usage.
    """
    options = call.without_log_options((reference, *logs), options)
    finished = None if logs else load_finished(call, reference, "output")
    if not options["baseline"] and not call.explicit_options("noise".__eq__):
        options["noise"] = None  # urmpipe.toml sets it for the calls with a baseline
    more = f"-and-{len(logs) - 1}-more" if len(logs) > 1 else ""
    output = output or default_output(f"{log_stem((logs or (reference,))[0].resolve())}{more}-diagnosed")
    is_replaced = output.exists()
    defaults = call.deciding_defaults(options)
    operands = logs[0] if len(logs) == 1 else list(logs)
    with call.progress(f"Writing {output}") as progress:
        result = urmpipe.diagnose(
            finished or reference, operands or None, output=output, defaults=defaults,
            progress=progress, **options,
        )  # fmt: skip
    comparison: Any = getattr(result, "comparison", None) or result
    return Answer(
        result,
        _iter_lines(result, is_replaced, options),
        errors=comparison.errors,
        is_incomplete=bool(comparison.failed_logs),
    )


def _iter_lines(result: Any, is_replaced: bool, options: Mapping[str, Any]) -> Iterator[str]:
    from urmpipe_pipeline.results import enclosing_result, present

    if enclosing_result(result) is not result:  # a diagnosis: its comparison has the verdict
        yield f"Verdict: {present(enclosing_result(result)).headline}"
    yield from iter_lines(result.recording, is_replaced, options)
