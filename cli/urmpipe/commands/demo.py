"""`urmpipe demo`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

import urmpipe
from urmpipe.options.completion import folders
from urmpipe.options.output import Terminal, output_options

if TYPE_CHECKING:
    from urmpipe.api.report import Report
    from urmpipe_pipeline.comparison.comparison import Comparison

EXPECTED = {"coppeliasim": "pass", "matlab": "pass", "solidworks": "pass", "counter_rotating": "fail"}
"""The example logs and their expected verdicts: the last comes from an arm with a counter-rotating module."""

EXPLAINED = """Four logs of one motion. Three should pass. The fourth comes from an arm with one module that
counter-rotates: it should fail, and so should the overall verdict. The diagnosis should name the module."""

AS_EXPECTED = """All verdicts are as expected: three logs agree with the path, the log of the arm with the
counter-rotating module does not. Why each log deviates:"""


@click.command(short_help="Run the whole workflow on example logs.")
@click.option(
    "-o",
    "--output",
    metavar="DIR",
    type=click.Path(path_type=Path),
    shell_complete=folders,
    default=Path("urmpipe-demo"),
    show_default=True,
    help="Folder for recordings and report.",
)
@output_options
def demo(output: Path, terminal: Terminal) -> int:
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
    steps = len(EXPECTED) + 2
    with terminal.progress("Demo") as progress:
        for number, name in enumerate(EXPECTED, start=1):
            source = LOGS / name if (LOGS / name).is_dir() else LOGS / f"{name}.csv"
            runs.append(urmpipe.ingest(source, robot="urm6", output=output / f"{name}.rrd"))
            if progress:
                progress(number / steps)
        result = urmpipe.compare(LOGS / "path.csv", runs, diagnose=True, output=output / "demo.rrd")
        if progress:
            progress((steps - 1) / steps)
        report = urmpipe.report([result], output / "report.html")
    got = {one.name: one.verdict for one in result.runs}
    as_expected = list(got.values()) == list(EXPECTED.values())
    terminal.answer(
        lambda: result.to_dict() | {"as_expected": as_expected, "report": str(report.path)},
        lambda: _print(result, report, as_expected),
    )
    return 0 if as_expected else 1


def _print(result: Comparison, report: Report, as_expected: bool) -> None:
    """Print the verdicts, and how to go on from there."""
    from urmpipe.printing.results import print_presentation
    from urmpipe.printing.terminal import print_recording, say
    from urmpipe_datasets import LOGS
    from urmpipe_pipeline.results import present

    click.echo(f"{EXPLAINED}\n")
    print_presentation(present(result))
    click.echo(AS_EXPECTED if as_expected else f"These verdicts differ from the expected ones: {EXPECTED}")
    for one in result.runs:
        if one.diagnosis is not None:
            say(f"  {one.name}: {one.diagnosis.summary}")
    say(f"Logs:      {LOGS}  (try the commands with them)")
    say(f"Report:    {report.path}  (open it in any browser)")
    print_recording(result.recording)
