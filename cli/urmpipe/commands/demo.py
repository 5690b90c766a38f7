"""Run the whole workflow on example logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

import urmpipe
from urmpipe.answers import Answer, Call, command
from urmpipe.parameters.outputs import Demo

if TYPE_CHECKING:
    from urmpipe.api.report import Report
    from urmpipe_pipeline.comparison.comparison import Comparison

EXPECTED = {"coppeliasim": "pass", "matlab": "pass", "solidworks": "pass", "counter_rotating": "fail"}
"""The example logs and their expected verdicts: the last comes from an arm with a counter-rotating module."""

EXPLAINED = """Four logs of one motion. Three should pass. The fourth comes from an arm with one module that
counter-rotates: it should fail, and so should the overall verdict. The diagnosis should name the module."""

EXPECTED_LINE = """All verdicts are as expected: three logs agree with the path, the log of the arm with the
counter-rotating module does not. Why each log deviates:"""


@command(Demo)
def demo(call: Call, output: Path) -> Answer:
    """Run the whole workflow on example logs: ingest, compare, diagnose, report.

    Three programs and an arm with a counter-rotating module logged one motion of the six-module URM arm.
    Exit code 0 if the verdicts are as expected.

    \b
    Examples:
      urmpipe demo
      urmpipe demo -o somewhere --json
    """
    from urmpipe_datasets import LOGS

    output.mkdir(parents=True, exist_ok=True)
    runs = []
    with call.progress("Demo") as progress:
        report_share = progress or (lambda share: None)
        for number, name in enumerate(EXPECTED, start=1):
            source = LOGS / name if (LOGS / name).is_dir() else LOGS / f"{name}.csv"
            runs.append(urmpipe.ingest(source, robot="urm6", output=output / f"{name}.rrd"))
            report_share(number / (len(EXPECTED) + 2))
        result = urmpipe.diagnose(LOGS / "path.csv", runs, output=output / "demo.rrd")
        report_share((len(EXPECTED) + 1) / (len(EXPECTED) + 2))
        report = urmpipe.report([result], output / "report.html")
    verdicts = {run.name: run.verdict for run in result.runs}
    as_expected = list(verdicts.values()) == list(EXPECTED.values())
    return Answer(
        result,
        warnings=(),
        to_dict=lambda: result.to_dict() | {"as_expected": as_expected, "report": str(report.path)},
        print_text=lambda: _print(result, report, as_expected),
        verdict="pass" if as_expected else "fail",
    )


def _print(result: Comparison, report: Report, as_expected: bool) -> None:
    """Print the verdicts, and what to try next."""
    from urmpipe.printing.results import print_presentation
    from urmpipe.printing.terminal import print_line, recording_line
    from urmpipe_datasets import LOGS
    from urmpipe_pipeline.results import present

    click.echo(f"{EXPLAINED}\n")
    print_presentation(present(result))
    click.echo(EXPECTED_LINE if as_expected else f"These verdicts differ from the expected ones: {EXPECTED}")
    for run in result.runs:
        if run.diagnosis is not None:
            print_line(f"  {run.name}: {run.diagnosis.summary}")
    print_line(f"Logs:      {LOGS}  (try the commands with them)")
    print_line(f"Report:    {report.path}  (open it in any browser)")
    print_line(recording_line(result.recording))
