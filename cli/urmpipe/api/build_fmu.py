"""`urmpipe.build_fmu`: a unit by name, from a file or as it is, packaged as an FMU."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from urmpipe.arm_placing import Robot
from urmpipe.keyword_checks import PathLike, one_or_many, public
from urmpipe.systems.logs import LogTable
from urmpipe.systems.units import Backend, unit_of
from urmpipe_fmus.block import BlockModel
from urmpipe_models.errors import Finding, OutputError
from urmpipe_pipeline.operands import log_files
from urmpipe_pipeline.outputs import safe_output

if TYPE_CHECKING:
    from urmpipe_fmus.build.fmu import BuiltFmu
    from urmpipe_pipeline.sources import LogMap


@public
def build_fmu(
    unit: BlockModel | PathLike,
    robot: Robot | None = None,
    *,
    log: PathLike | LogTable | None = None,
    options: Mapping[str, Any] | None = None,
    log_map: PathLike | LogMap | None = None,
    backend: Backend | None = None,
    platforms: str | Sequence[str] = (),
    output: PathLike = ".",
    told: Callable[[str], None] | None = None,
) -> BuiltFmu:
    """Package a unit as an FMU (FMI 2.0 co-simulation).

    Args:
        unit: A name of `urmpipe_fmus.blocks`, a Python file with a unit in it, or a `BlockModel`.
        robot: Name, file (TOML, URDF) or chain of the arm, for a unit that has one.
        log: A log for a unit that plays one: CSV, a folder of plots, or what `read_table` made of them.
        options: Further options of the unit by name; see `urmpipe fmu list`.
        log_map: A map (TOML), or what `read_map` returned: how to read the log.
        backend: native (C) or python (needs Python with NumPy on the target); default: native if this
            machine can build it or `platforms` are named, else python, with a `note` why.
        platforms: linux64, win64; default: this one. Others than this one need the extra `cross`.
        output: The folder for UNIT.fmu, or a name that ends in .fmu; only an FMU of urmpipe's is replaced.
        told: Told what takes minutes: compiling for another platform.

    Returns:
        The FMU: its `path`, `backend`, `platforms`, `guid` and `note`.

    Raises:
        UrmpipeError: With everything that is wrong with the unit, its options or the output.
    """
    from urmpipe_fmus.build.fmu import build_fmu as build

    made = unit_of(unit, robot=robot, log=log, options=options, log_map=log_map)
    path = Path(output)
    if not path.is_dir() and path.suffix.lower() != ".fmu":
        allowed = "a folder that exists, or a name that ends in .fmu"
        raise OutputError(Finding(f"found no folder, allowed: {allowed}", str(path)))
    target = path / f"{made.name}.fmu" if path.is_dir() else path
    inputs = [file for one in (unit, robot, log) for file in _files(one)]
    with safe_output(target, inputs, "fmu") as part:
        built = build(made, part, backend=backend, platforms=tuple(one_or_many(platforms)), on_message=told)
        return replace(built, path=target)


def _files(operand: Any) -> Sequence[Path]:
    """Return the files that an operand stands for, if it stands for any."""
    if isinstance(operand, LogTable):
        return operand.files
    if not isinstance(operand, (str, Path)):
        return ()
    return log_files(Path(operand)) if Path(operand).is_dir() else [Path(operand)]
