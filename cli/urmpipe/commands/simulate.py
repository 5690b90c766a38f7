"""Run a system of blocks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import urmpipe
from urmpipe.answers import Answer, Call, command, default_output
from urmpipe.command_line import operand
from urmpipe.parameters import kinds
from urmpipe.parameters.systems import Simulate
from urmpipe_models.errors import Finding, OptionError

if TYPE_CHECKING:
    from urmpipe_pipeline.simulations.simulation import Simulation


@command(Simulate)
@operand("system", kinds.SYSTEM, metavar="[SYSTEM|FILE.toml]", required=False)
def simulate(
    call: Call,
    system: str | None,
    list: bool,
    output: Path | None,
    write_system: Path | None,
    **options: Any,
) -> Answer:
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
    if list == (system is not None):
        operands = f"{system} and --list" if list else "neither a system nor --list"
        raise click.UsageError(f"found {operands}, allowed: one of the two")
    if system is None:
        return _list_systems()
    if write_system is not None:
        return _write_system(call, system, write_system)
    return _run(call, system, output or default_output(Path(system).stem), options)


def _run(call: Call, system: str, output: Path, options: Mapping[str, Any]) -> Answer:
    """Run a system."""
    from urmpipe.printing.terminal import redirect_prints
    from urmpipe.systems.blocks import ON_PYTHON

    is_replaced = output.exists()
    with redirect_prints(), call.progress(f"Simulating {system}") as progress:
        result = urmpipe.simulate(system, output=output, on_message=call.note, progress=progress, **options)
    failure = f"{result.failed}; the samples until then are in {result.recording}"
    warnings = [warning for warning in result.warnings if warning.kind != ON_PYTHON]  # which is noted already
    return Answer(
        result,
        _iter_lines(result, is_replaced, options["draw"]),
        warnings=warnings,
        errors=[] if result.failed is None else [Finding(failure)],
        is_incomplete=result.failed is not None,
    )


def _iter_lines(result: Simulation, is_replaced: bool, drawing: Path | None) -> Iterator[str]:
    from urmpipe.printing.terminal import recording_line

    if result.loop_seconds:
        factor = result.duration / result.loop_seconds
        yield f"Simulated in {result.loop_seconds:.2g} s, {factor:.3g} times as fast as real time"
    if drawing:
        yield f"Drawing: {drawing}"
    yield recording_line(result.recording, is_replaced)


def _list_systems() -> Answer:
    """List the shipped systems."""
    from urmpipe.printing.units import print_systems
    from urmpipe_fmus.cosim import load_system, system_names

    systems = [load_system(name, {}) for name in system_names()]
    rows = [
        {"name": system.name, "description": system.description, "arguments": dict(system.arguments)}
        for system in systems
    ]
    return Answer(to_dict=lambda: {"schema": 1, "systems": rows}, print_text=lambda: print_systems(systems))


def _write_system(call: Call, system: str, path: Path) -> Answer:
    """Write the file of a shipped system, under a new name; its logs are not copied."""
    from urmpipe.api.simulate import shipped_logs
    from urmpipe_fmus.cosim import system_text
    from urmpipe_models.errors import shell_quote
    from urmpipe_pipeline.outputs import safe_output

    allowed = "when the system runs; change the written file instead"
    of_runs = [
        param.name
        for param in call.ctx.command.params
        if param.name not in ("write_system", "system", "json", "quiet", "debug")
        and call.explicit_options(str(param.name).__eq__)
    ]
    if of_runs:
        message = "found together with --write-system, which runs nothing"
        raise OptionError(*(Finding(message, parameter=name, allowed=allowed) for name in of_runs))
    text = system_text(system)
    with safe_output(path, [], "system") as part:
        part.write_text(text, encoding="utf-8")
    logs = "".join(f" --set {name}=FILE.csv" for name in shipped_logs(system))
    line = f"System: {path}  (change it, then: urmpipe simulate {shell_quote(path)}{logs})"
    return Answer(lines=[line], to_dict=lambda: {"schema": 1, "system": str(path)})
