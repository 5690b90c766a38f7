"""The pictures of the README and the pages: of the right size, with something on them, and of this tree."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

DOCS = Path(__file__).resolve().parents[2] / "docs"
DRIVERS = sorted(Path("/usr/share/vulkan/icd.d").glob("lvp_icd*.json"))

SIZES = {
    "driven-arm.png": (1920, 1080),
    "ik.png": (1920, 1080),
    "recording.png": (1920, 1080),
    "report.png": (1280, 1000),
    "tutorial-failed.png": (1920, 1080),
    "tutorial-report.png": (1280, 1000),
}
"""Width and height in [px]."""

LOST = 0.02
"""Share of the pixels that may differ: a label that slipped is less, a view or a plot that moved is more."""


def pixels(path: Path) -> NDArray[np.int16]:
    """Return the grey values of a picture, shape (height, width)."""
    return np.asarray(Image.open(path).convert("L")).astype(np.int16)


@pytest.fixture(scope="module")
def script() -> ModuleType:
    """The script that takes the pictures."""
    spec = importlib.util.spec_from_file_location("take_pictures", DOCS / "take_pictures.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_each_picture_has_its_size_and_is_not_blank() -> None:
    assert {path.name for path in (DOCS / "pictures").glob("*.png")} == set(SIZES)
    for name, (width, height) in SIZES.items():
        found = pixels(DOCS / "pictures" / name)
        assert found.shape == (height, width), name
        # Text, lines and frames on one ground: hundreds of rows and columns in which something stands.
        assert (np.ptp(found, axis=1) > 60).sum() > height / 2, name
        assert (np.ptp(found, axis=0) > 60).sum() > width / 2, name


@pytest.mark.slow
@pytest.mark.skipif(not DRIVERS, reason="no software Vulkan: apt-get install mesa-vulkan-drivers libvulkan1")
def test_the_picture_of_branches_is_of_this_tree(script: ModuleType, tmp_path: Path) -> None:
    """If not, a change of what a recording shows left the pictures behind: python docs/take_pictures.py."""
    taken, wanted = tmp_path / "ik.png", pixels(DOCS / "pictures" / "ik.png")

    def same() -> bool:
        found = pixels(taken)
        return found.shape == wanted.shape and float((np.abs(found - wanted) > 40).mean()) <= LOST

    assert script.of_branches(tmp_path, taken, same) == []
    assert same()
