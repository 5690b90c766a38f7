"""`urmpipe.simulate`: a system of blocks, run and recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from urmpipe.output_files import guarded_outputs, write_drawing
from urmpipe.parameters import kinds
from urmpipe.parameters.param import params_of
from urmpipe.parameters.shared import LogReading
from urmpipe.parameters.systems import Simulate
from urmpipe.public_functions import PathLike, public_function, raise_warnings
from urmpipe.reading import map_files
from urmpipe.systems.blocks import ON_PYTHON, Blocks
from urmpipe.systems.result import check_meters, simulation_of
from urmpipe_datasets import LOGS
from urmpipe_fmus.cosim import load_system, prepare, read_system, system_name, system_names, system_svg
from urmpipe_fmus.cosim import simulate as run_plan
from urmpipe_fmus.cosim.simulation import start_worker
from urmpipe_models.errors import Finding, Hint, OptionError
from urmpipe_pipeline.outputs import OutputKind
from urmpipe_pipeline.simulations.simulation import Simulation

if TYPE_CHECKING:
    from urmpipe_fmus.cosim.system import System

MAX_TIME = 1e9  # s; longer ones have no time in [ns] as an integer of 64 bits


@public_function(Simulate, system=kinds.SYSTEM)
def simulate(system: PathLike, **options: Unpack[Simulate]) -> Simulation:
    """Run a system of blocks, and write its recording and its drawing if they are named.

    Args:
        system: Name of a shipped system, or a system file (TOML).
        **options: Arguments for the `$name`s of the system, its step and duration, how its logs are read
            (before the map that a block names), what is written: the options of `urmpipe simulate`, by their
            names. With `strict`, all warnings are errors, except that the blocks run on Python.

    Returns:
        The simulation: `signals`, `verdicts`, `to_frame()`, `to_dict()`. Where an FMU failed, `failed` tells
        why, and what was recorded until then is there.

    Raises:
        UrmpipeError: With everything that is wrong with the system, before the first step, or with an output.
    """
    values: Mapping[str, Any] = options  # as their kinds read them
    texts = {name: str(value) for name, value in (values["arguments"] or {}).items()}
    _check_times(**{name: values[name] for name in ("step", "duration", "timeout")})
    loaded = read_system(system, texts)
    loaded = replace(
        loaded, step=values["step"] or loaded.step, duration=values["duration"] or loaded.duration
    )
    bundled = _bundled(system, texts)
    kept = [loaded.path, *_files(loaded), *map_files(values)]
    outputs: dict[OutputKind, PathLike | None] = {"recording": values["output"], "drawing": values["draw"]}
    progress = values["progress"] or (lambda share: None)
    with (
        guarded_outputs(outputs, kept) as written,
        start_worker() as worker,
    ):  # it loads what it needs meanwhile
        blocks = Blocks(
            loaded, bundled=bundled, backend=values["backend"], on_message=values["on_message"],
            reading={name: values[name] for name in params_of(LogReading)},
        )  # fmt: skip
        plan = prepare(loaded, blocks.make, column=blocks.column, duration=blocks.end, period=blocks.period)
        check_meters(plan, blocks)
        svg = system_svg(plan)
        written.write("drawing", lambda part, path: write_drawing(part, svg))
        record = run_plan(
            plan, timeout=values["timeout"], progress=lambda share: progress(0.8 * share), worker=worker
        )
        result = simulation_of(plan, record, blocks, svg)
        if result.failed is None:  # else the samples until then are recorded
            raise_warnings(
                values["strict"], [warning for warning in result.warnings if warning.kind != ON_PYTHON]
            )
        return written.recorded(result, lambda share: progress(0.8 + 0.2 * share))


def _bundled(system: PathLike, arguments: Mapping[str, str]) -> set[str]:
    """Return the logs of a shipped system that came with it: all where none is given, else none.

    Raises:
        OptionError: If some of its logs are given and others are not: they would be of two motions.
    """
    if system_name(str(system)) not in system_names():
        return set()
    shipped = shipped_logs(str(system))
    replaced = {name: value for name, value in arguments.items() if name in shipped}
    if not replaced:
        return set(shipped.values())
    settings = " and ".join(f"{name} is {value}" for name, value in replaced.items())
    missing = [
        Finding(
            f"argument {name}: not set, but {settings}; allowed: a file of the same motion"
            f" ({system}'s own {value} has another motion)",
            hints=(Hint("arguments", {name: None}, "sets it"),),
        )
        for name, value in shipped.items()
        if name not in replaced
    ]
    if missing:
        raise OptionError(*missing)
    is_named = replaced == shipped and not any(Path(value).exists() for value in shipped.values())
    return set(shipped.values()) if is_named else set()


def shipped_logs(system: str) -> dict[str, str]:
    """Return the arguments of a shipped system that are logs which came with it, and their names."""
    return {
        name: value
        for name, value in load_system(system).arguments.items()
        if isinstance(value, str) and value and (LOGS / value).is_file()
    }


def _check_times(**times: float | None) -> None:
    """Raise an `OptionError` with all times in [s] that integers of 64 bits do not hold in [ns]."""
    faults = [
        Finding(parameter=name, found=f"{time:g} s", allowed=f"below {MAX_TIME:g} s")
        for name, time in times.items()
        if time is not None and time >= MAX_TIME
    ]
    if faults:
        raise OptionError(*faults)


def _files(system: System) -> list[Path]:
    """Return the files that a system names: none of them is replaced."""
    texts = [value for block in system.blocks for value in block.options.values() if isinstance(value, str)]
    names = [*texts, *(source.log for source in system.inputs), *map(str, system.arguments.values())]
    files = [path for block in system.blocks for path in (block.file, block.fmu) if path]
    return [*files, *(Path(name) for name in names if "\0" not in name)]
