"""`urmpipe simulate`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import urmpipe
from urmpipe.headings import HeadedCommand, Heading, option
from urmpipe.options.named import NamedType, argument_names, named_values
from urmpipe.options.output import Terminal, output_option, output_options
from urmpipe.options.reading import STRICT_OPTION, row_options
from urmpipe.options.types import DRAWING, DURATION, SYSTEM, FileType, OneOf
from urmpipe_models.errors import Finding, OptionError

if TYPE_CHECKING:
    from urmpipe_pipeline.simulations.simulation import Simulation


@click.command(cls=HeadedCommand, short_help="Run a system of blocks.")
@click.argument("system", metavar="[SYSTEM|FILE.toml]", type=SYSTEM, required=False)
@option(Heading.OUTPUT, "--list", "listed", is_flag=True, help="List the built-in systems.")
@output_option("RUN.rrd", "Recording to write [default: SYSTEM.rrd or FILE.rrd].")
@option(
    Heading.RUNNING,
    "--arguments",
    "--set",
    type=NamedType(argument_names),
    multiple=True,
    callback=named_values,
    metavar="NAME=VALUE",
    help="Argument of the system, such as log=log.csv or robot=urm6.",
)
@option(Heading.RUNNING, "--step", type=DURATION, help="Communication step [default: the system's own].")
@option(
    Heading.RUNNING,
    "--duration",
    type=DURATION,
    help="Simulated time [default: the system's own, else the length of its longest log].",
)
@option(
    Heading.OUTPUT,
    "--write-system",
    metavar="FILE.toml",
    type=FileType(".toml"),
    help="Write the file of a built-in system for you to change, and do not run it.",
)
@option(
    Heading.OUTPUT,
    "--draw",
    metavar="FILE.svg",
    type=DRAWING,
    help="Also draw the system.",
)
@option(
    Heading.RUNNING,
    "--backend",
    type=OneOf(["native", "python"]),
    help="Run the units as compiled C or in Python [default: native if a compiler is found].",
)
@option(
    Heading.RUNNING,
    "--timeout",
    type=DURATION,
    help="Longest time that a call of an FMU may take [default: 60 s].",
)
@row_options
@STRICT_OPTION
@output_options
def simulate(
    system: str | None,
    listed: bool,
    output: Path | None,
    arguments: dict[str, str],
    step: float | None,
    duration: float | None,
    write_system: Path | None,
    draw: Path | None,
    terminal: Terminal,
    **options: Any,
) -> int:
    """Run a system of connected blocks: urmpipe's units, your own, and FMUs of any tool.

    SYSTEM is a name of --list, or a system file (TOML) with blocks, connections, start values and inputs
    from logs. All errors in it are reported before the first step.

    \b
    Examples:
      urmpipe simulate --list
      urmpipe simulate log-to-delta
      urmpipe simulate log-to-delta --set log=log.csv --set reference=path.csv
      urmpipe simulate one-drive --step 0.05ms --draw one-drive.svg
      urmpipe simulate one-drive --write-system my-drive.toml
      urmpipe simulate my-system.toml -o run.rrd --json

    Exit codes: 0 done and within tolerance, 1 a delta meter out of tolerance or undecided, 2 bad input or a
    failed FMU.
    """
    if listed == (system is not None):
        found = f"{system} and --list" if listed else "neither a system nor --list"
        raise click.UsageError(f"found {found}, allowed: one of the two")
    if listed or system is None:
        return _list(terminal)
    given = {"arguments": arguments, "step": step, "duration": duration, **options}
    asked = {name: value for name, value in given.items() if value is not None}
    if write_system is not None:
        _refuse_run_options({"output": output, "draw": draw, **asked})
        return _write(system, write_system, terminal)
    target = output or Path(default_name(system))
    return _run(system, target, draw, terminal, asked)


def _run(system: str, target: Path, draw: Path | None, terminal: Terminal, asked: dict[str, Any]) -> int:
    """Run a system as it is asked, print what it came to, and return the exit code."""
    from urmpipe.printing.terminal import prints_apart, say
    from urmpipe.systems.blocks import ON_PYTHON

    replaces = target.exists()
    with prints_apart(), terminal.progress(f"Simulating {system}") as progress:
        result = urmpipe.simulate(
            system, output=target, draw=draw, told=terminal.note, progress=progress, **asked
        )
    terminal.warn([one for one in result.warnings if one.kind != ON_PYTHON])  # that is told already
    terminal.answer(result.to_dict, lambda: _print(result, replaces, draw))
    if result.failed is not None:
        say(f"error: {result.failed}; the samples until then are in {result.recording}", err=True)
    return 2 if result.failed is not None else 1 if result.verdict == "fail" else 0


def _print(result: Simulation, replaces: bool, draw: Path | None) -> None:
    """Print what a simulation came to."""
    from urmpipe.printing.results import print_presentation
    from urmpipe.printing.terminal import print_recording, say
    from urmpipe_pipeline.results import present

    print_presentation(present(result))
    if result.loop_seconds:
        factor = result.duration / result.loop_seconds
        say(f"Simulated in {result.loop_seconds:.2g} s, {factor:.3g} times as fast as real time")
    if draw:
        say(f"Drawing: {draw}")
    print_recording(result.recording, replaced=replaces)


def _list(terminal: Terminal) -> int:
    """List the shipped systems."""
    from urmpipe.printing.units import print_systems
    from urmpipe_fmus.cosim import load_system, system_names

    systems = [load_system(name, {}) for name in system_names()]
    rows = [
        {"name": one.name, "description": one.description, "arguments": dict(one.arguments)}
        for one in systems
    ]
    terminal.answer(lambda: {"schema": 1, "systems": rows}, lambda: print_systems(systems))
    return 0


def _refuse_run_options(given: dict[str, Any]) -> None:
    """Raise a usage error if a file is to be written with options that only a run follows."""
    allowed = "when the system runs; edit the file instead"
    found = [name for name, value in given.items() if value]
    if found:
        with_file = "found for a system that is only written"
        raise OptionError(*(Finding(with_file, parameter=name, allowed=allowed) for name in found))


def _write(system: str, path: Path, terminal: Terminal) -> int:
    """Write the file of a shipped system, under a name that is new; the logs that came along stay there."""
    from urmpipe.api.simulate import own_logs
    from urmpipe.printing.terminal import say
    from urmpipe_fmus.cosim import system_text
    from urmpipe_models.errors import shell_quote
    from urmpipe_pipeline.outputs import safe_output

    text = system_text(system)
    with safe_output(path, [], "system") as part:
        part.write_text(text, encoding="utf-8")
    logs = "".join(f" --set {name}=FILE.csv" for name in own_logs(system))
    said = f"System: {path}  (change it, then: urmpipe simulate {shell_quote(path)}{logs})"
    terminal.answer(lambda: {"schema": 1, "system": str(path)}, lambda: say(said))
    return 0


def default_name(system: str) -> str:
    """Return SYSTEM.rrd. Bytes of no text are replaced: Rerun opens no file whose name holds such."""
    return click.format_filename(f"{Path(system).stem}.rrd")
