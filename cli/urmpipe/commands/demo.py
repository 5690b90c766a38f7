"""`urmpipe demo`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

import urmpipe
from urmpipe.options.output import Terminal, output_options

if TYPE_CHECKING:
    from urmpipe.api.report import Report
    from urmpipe_pipeline.comparison.comparison import Comparison

EXPECTED = {"coppeliasim": "pass", "matlab": "pass", "solidworks": "pass", "counter_rotating": "fail"}
"""The bundled logs and the verdict each should get: the last comes from an arm with one module the wrong
way round."""

EXPLAINED = """Four logs of one motion: three should pass; the fourth, of an arm with one module the wrong way
round, should fail, and so does all of it. Which module that is, is to be found."""

AS_EXPECTED = """The verdicts are as they should be: the three environments agree with the path, the arm with
the counter-rotating module does not. Why each deviates:"""


@click.command(short_help="Run the whole way on bundled logs.")
@click.option(
    "-o",
    "--output",
    metavar="DIR",
    type=click.Path(path_type=Path),
    default=Path("urmpipe-demo"),
    show_default=True,
    help="Folder for recordings and report.",
)
@output_options
def demo(output: Path, terminal: Terminal) -> int:
    """Run the whole way on bundled logs: ingest, compare and diagnose, report.

    One motion of the six-module URM arm, as three environments logged it and as an arm with a
    counter-rotating module did. Exit code 0 if the verdicts are as they should be.

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
        lambda: result.to_dict("command line") | {"as_expected": as_expected, "report": str(report.path)},
        lambda: _print(result, report, as_expected),
    )
    return 0 if as_expected else 1


def _print(result: Comparison, report: Report, as_expected: bool) -> None:
    """Print the verdicts, and how to go on from there."""
    from urmpipe.printing.presentation import print_presentation
    from urmpipe.printing.terminal import print_recording, say
    from urmpipe_datasets import LOGS
    from urmpipe_pipeline.results import present

    click.echo(f"{EXPLAINED}\n")
    print_presentation(present(result))
    click.echo(AS_EXPECTED if as_expected else f"These are not the verdicts expected: {EXPECTED}")
    for one in result.runs:
        if one.diagnosis is not None:
            say(f"  {one.name}: {one.diagnosis.sentence}")
    say(f"Logs:      {LOGS}  (to look at, or to try the commands with)")
    say(f"Report:    {report.path}  (open it in any browser)")
    print_recording(result.recording)
