"""`urmpipe.build_fmu`: a unit by name, from a file or as it is, packaged as an FMU."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from urmpipe.arm_placing import Robot
from urmpipe.parameters import kinds
from urmpipe.parameters.systems import BuildFmu
from urmpipe.public_functions import PathLike, public_function
from urmpipe.systems.logs import LogTable
from urmpipe.systems.units import unit_of
from urmpipe_fmus.block import BlockModel
from urmpipe_models.errors import Finding, OutputError
from urmpipe_pipeline.operands import log_files
from urmpipe_pipeline.outputs import safe_output

if TYPE_CHECKING:
    from urmpipe_fmus.build.fmu import BuiltFmu


@public_function(BuildFmu, unit=kinds.UNIT_MODEL, robot=kinds.ROBOT)
def build_fmu(
    unit: BlockModel | PathLike, robot: Robot | None = None, **options: Unpack[BuildFmu]
) -> BuiltFmu:
    """Package a unit as an FMU (FMI 2.0 co-simulation).

    Args:
        unit: A name of `urmpipe_fmus.blocks`, a Python file with a unit in it, or a `BlockModel`.
        robot: Name, file (TOML, URDF) or chain of the arm, for a unit that has one.
        **options: A log for a unit that plays one (a file, a folder of plots, or what `read_table` returned),
            `options` of the unit by name, the backend, the output: the options of `urmpipe fmu build`, by
            their names. Without a compiler for `native` the backend is python, with a `note` why.

    Returns:
        The FMU: its `path`, `backend`, `platforms`, `guid` and `note`.

    Raises:
        UrmpipeError: With everything that is wrong with the unit, its options or the output.
    """
    from urmpipe_fmus.build.fmu import build_fmu as build

    values: Mapping[str, Any] = options  # as their kinds read them
    log = values["log"]
    model = unit_of(unit, robot=robot, log=log, options=values["options"], log_map=values["map"])
    path = values["output"]
    if not path.is_dir() and path.suffix.lower() != ".fmu":
        allowed = "a folder that exists, or a name that ends in .fmu"
        raise OutputError(Finding(f"found no folder, allowed: {allowed}", str(path)))
    target = path / f"{model.name}.fmu" if path.is_dir() else path
    inputs = [file for operand in (unit, robot, log) for file in _files(operand)]
    with safe_output(target, inputs, "fmu") as part:
        built = build(
            model, part, backend=values["backend"], platforms=values["platforms"],
            on_message=values["on_message"],
        )  # fmt: skip
        return replace(built, path=target)


def _files(operand: Any) -> Sequence[Path]:
    """Return the files that an operand stands for, if it stands for any."""
    if isinstance(operand, LogTable):
        return operand.files
    if not isinstance(operand, (str, Path)):
        return ()
    return log_files(Path(operand)) if Path(operand).is_dir() else [Path(operand)]
