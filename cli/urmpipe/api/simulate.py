"""`urmpipe.simulate`: a system of blocks, run and recorded."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from urmpipe.keyword_checks import PathLike, public_reading, refuse_warnings
from urmpipe.output_files import guarded_outputs, write_drawing
from urmpipe.reading import LogReading, map_files
from urmpipe.systems.blocks import ON_PYTHON, Blocks
from urmpipe.systems.result import check_meters, simulation_of
from urmpipe.systems.units import Backend
from urmpipe_datasets import LOGS
from urmpipe_fmus.cosim import load_system, prepare, read_system, system_name, system_names, system_svg
from urmpipe_fmus.cosim import simulate as run_plan
from urmpipe_fmus.cosim.simulation import start_worker
from urmpipe_fmus.process import DEFAULT_TIMEOUT
from urmpipe_models.errors import Finding, OptionError
from urmpipe_pipeline.outputs import OutputKind
from urmpipe_pipeline.simulations.simulation import Simulation

if TYPE_CHECKING:
    from urmpipe_fmus.cosim.system import System

LONGEST = 1e9
"""Times in [s] from this one on are none that integers of 64 bits hold in [ns]."""


@public_reading(LogReading)
def simulate(
    system: PathLike,
    *,
    arguments: Mapping[str, str | Path | float] | None = None,
    step: float | None = None,
    duration: float | None = None,
    backend: Backend | None = None,
    timeout: float = DEFAULT_TIMEOUT,
    strict: bool = False,
    output: PathLike | None = None,
    draw: PathLike | None = None,
    told: Callable[[str], None] | None = None,
    progress: Callable[[float], None] | None = None,
    **reading: Unpack[LogReading],
) -> Simulation:
    """Run a system of blocks, and write its recording and its drawing if they are named.

    Args:
        system: Name of a shipped system, or a system file (TOML).
        arguments: Values for the `$name`s of the system, such as {"log": "log.csv"}.
        step: Communication step in [s]; default: that of the system, else of the joint log that it plays.
        duration: In [s]; default: that of the system, else of the longest log that it reads.
        backend: native or python, for the FMUs of units; default: native if it can be built here.
        timeout: How long a call of an FMU may take, in [s]: one that does not return ends the run.
        strict: Whether a warning is an error, but for the one that the blocks run on Python.
        output: The recording (.rrd) to write.
        draw: An SVG file to draw the system to.
        told: Told what takes its time before the first step, a line each.
        progress: Told the share that is done, 0..1.
        **reading: How to read the logs where they cannot tell by themselves: unit, time, joints, log_map and
            the others of `urmpipe.LogReading`; it comes before the map that a block names.

    Returns:
        The simulation: `signals`, `verdicts`, `to_frame()`, `to_dict()`. Where an FMU failed, `failed` tells
        why, and what was recorded until then is there.

    Raises:
        UrmpipeError: With everything that is wrong with the system, before the first step, or with an output.
    """
    texts = {name: str(value) for name, value in (arguments or {}).items()}
    _check_times(step=step, duration=duration, timeout=timeout)
    read = read_system(system, texts)
    loaded = replace(read, step=step or read.step, duration=duration or read.duration)
    bundled = _bundled(system, texts)
    kept = [loaded.path, *_files(loaded), *map_files(reading)]
    named: dict[OutputKind, PathLike | None] = {"recording": output, "drawing": draw}
    running, writing = _halves(progress)
    with (
        guarded_outputs(named, kept) as written,
        start_worker() as worker,
    ):  # it loads what it needs meanwhile
        blocks = Blocks(loaded, bundled=bundled, backend=backend, reading=reading, told=told)
        plan = prepare(loaded, blocks.make, column=blocks.column, duration=blocks.end, period=blocks.period)
        check_meters(plan, blocks)
        svg = system_svg(plan)
        written.write("drawing", lambda part, path: write_drawing(part, svg))
        ran = run_plan(plan, timeout=timeout, progress=running, worker=worker)
        made = simulation_of(plan, ran, blocks, svg)
        if made.failed is None:  # else that is told, and what was recorded stays
            refuse_warnings(strict, [one for one in made.warnings if one.kind != ON_PYTHON])
        return written.recorded(made, writing)


def _bundled(system: PathLike, arguments: Mapping[str, str]) -> set[str]:
    """Return the logs of a shipped system that came with it: all where none is given, else none.

    Raises:
        OptionError: If some of its logs are given and others are not: they would be of two motions.
    """
    if system_name(str(system)) not in system_names():
        return set()
    own = own_logs(str(system))
    given = {name: value for name, value in arguments.items() if name in own}
    if not given:
        return set(own.values())
    others = " and ".join(f"{name} is {value}" for name, value in given.items())
    missing = [
        f"argument {name}: not set, but {others}; allowed: a file of the same motion"
        f" ({system}'s own {value} has another motion)"
        for name, value in own.items()
        if name not in given
    ]
    if missing:
        raise OptionError(*missing)
    named = given == own and not any(Path(value).exists() for value in own.values())
    return set(own.values()) if named else set()


def own_logs(system: str) -> dict[str, str]:
    """Return the arguments of a shipped system that are logs which came with it, and their names."""
    return {
        name: value
        for name, value in load_system(system).arguments.items()
        if isinstance(value, str) and value and (LOGS / value).is_file()
    }


def _check_times(**given: float | None) -> None:
    """Refuse times in [s] that are given and not positive, or that integers of 64 bits do not hold in [ns].

    Raises:
        OptionError: With each of them.
    """
    wrong = {name: value for name, value in given.items() if value is not None and not 0.0 < value < LONGEST}
    if wrong:
        faults = (
            Finding(
                parameter=name,
                found=f"{value:g} s",
                allowed=f"below {LONGEST:g} s" if value > 0 else "above 0",
            )
            for name, value in wrong.items()
        )
        raise OptionError(*faults)


def _files(system: System) -> list[Path]:
    """Return the files that a system names: none of them is replaced."""
    texts = [value for block in system.blocks for value in block.options.values() if isinstance(value, str)]
    named = [*texts, *(one.log for one in system.inputs), *map(str, system.arguments.values())]
    return [path for block in system.blocks for path in (block.file, block.fmu) if path] + [
        Path(one) for one in named if "\0" not in one
    ]


def _halves(progress: Callable[[float], None] | None) -> tuple[Callable[[float], None], ...]:
    """Return what to tell the progress of the run, and of its recording."""
    tell = progress or (lambda share: None)
    return lambda share: tell(0.8 * share), lambda share: tell(0.8 + 0.2 * share)
