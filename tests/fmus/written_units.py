"""Units from files as users write them, and instances of their FMUs."""

from __future__ import annotations

import runpy
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from loaded_fmu import Loaded
from urmpipe_fmus.block import BlockModel, Recipe, Table
from urmpipe_fmus.build.description import Backend
from urmpipe_fmus.build.fmu import build_fmu
from urmpipe_fmus.native import native_unavailable_reason, this_platform

FILES = Path(__file__).parent / "packaging" / "unit_files"
NAMES = ("arm", "counter", "playback", "spring")
TABLE = Table(
    np.array([0, 100_000_000, 250_000_000, 300_000_000]),
    np.array([[1.0, 0.5], [2.0, -0.5], [3.0, 0.25], [4.0, 1.5]]),
)
FOLDER = TemporaryDirectory(prefix="written-units-")


@cache
def unit_of(name: str, **arguments: Any) -> BlockModel:
    """Return the unit of a file, with the recipe to make it again."""
    path = FILES / f"{name}.py"
    names = runpy.run_path(str(path))
    made: BlockModel = names["make"](table=TABLE, **arguments) if "make" in names else names["unit"]
    function = "make" if "make" in names else ""
    return replace(made, recipe=Recipe(path.name, function, arguments, path.read_text(encoding="utf-8")))


@cache
def fmu_of(name: str, backend: Backend) -> Path:
    """Return the FMU of a unit for this platform, built once in a process."""
    if backend == "native" and (missing := native_unavailable_reason()):
        pytest.skip(f"no native FMU can be built here: {missing}")
    path = Path(FOLDER.name, f"{name}-{backend}.fmu")
    return build_fmu(unit_of(name), path, backend=backend, platforms=[this_platform()]).path


def loaded(name: str, backend: Backend = "native", start: float | None = 0.0, **options: Any) -> Loaded:
    """Return an instance of the FMU of a unit, ready to step."""
    return Loaded(fmu_of(name, backend), start, **options)
