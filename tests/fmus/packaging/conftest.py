"""Units of every kind, from files as users write them."""

from __future__ import annotations

import runpy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from urmpipe_fmus.block import BlockModel, Recipe, Table

UNIT_FILES = Path(__file__).parent / "unit_files"
TABLE = Table(
    np.array([0, 100_000_000, 250_000_000, 300_000_000]),
    np.array([[1.0, 0.5], [2.0, -0.5], [3.0, 0.25], [4.0, 1.5]]),
)
NAMES = ("arm", "counter", "playback", "spring")


def unit_of(name: str, **arguments: Any) -> BlockModel:
    """The unit of a file, with the recipe to make it again."""
    path = UNIT_FILES / f"{name}.py"
    held = runpy.run_path(str(path))
    function = "make" if "make" in held else ""
    made: BlockModel = held["make"](table=TABLE, **arguments) if function else held["unit"]
    return replace(made, recipe=Recipe(path.name, function, arguments, path.read_text(encoding="utf-8")))


@pytest.fixture
def make() -> Callable[..., BlockModel]:
    return unit_of


@pytest.fixture(params=NAMES)
def model(request: pytest.FixtureRequest) -> BlockModel:
    return unit_of(request.param)
