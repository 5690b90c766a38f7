"""The palette holds what it promises: colours that differ for every sight, on white and in the viewer."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from urmpipe_pipeline.presentation.palette import (
    AXIS_COLOURS,
    DEVIATION_COLOUR,
    JOINT_COLOURS,
    REFERENCE_COLOUR,
    RUN_COLOURS,
    colour_name,
    joint_colour,
    rgb,
    run_colour,
)

Numbers = NDArray[np.float64]

# Machado, Oliveira, Fernandes: A physiologically-based model for simulation of color vision deficiency,
# IEEE TVCG 15 (2009), Table 1, severity 1.0; on linear RGB.
SIGHTS: dict[str, ArrayLike] = {
    "normal": np.eye(3),
    "protanope": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranope": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanope": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
SRGB_TO_XYZ = [
    [0.4124564, 0.3575761, 0.1804375],
    [0.2126729, 0.7151522, 0.0721750],
    [0.0193339, 0.1191920, 0.9503041],
]
WHITE, VIEWER_GROUND = "#ffffff", "#0d0d0d"


def linear(colour: str) -> Numbers:
    share = np.array(rgb(colour)) / 255
    curve: Numbers = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return curve


def lab(linear_rgb: Numbers) -> Numbers:
    xyz = np.array(SRGB_TO_XYZ) @ np.clip(linear_rgb, 0, 1) / [0.95047, 1.0, 1.08883]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def contrast(one: str, other: str) -> float:
    """Return the contrast ratio of WCAG 2."""
    low, high = sorted(float(np.array(SRGB_TO_XYZ[1]) @ linear(colour)) for colour in (one, other))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("sight", SIGHTS)
@pytest.mark.parametrize("colours", [JOINT_COLOURS, [*AXIS_COLOURS.values()], [*RUN_COLOURS.values()]])
def test_colours_differ_for_every_sight(sight: str, colours: Sequence[str]) -> None:
    seen = [lab(np.array(SIGHTS[sight]) @ linear(colour)) for colour in colours]
    nearest = min(float(np.linalg.norm(one - other)) for one, other in itertools.combinations(seen, 2))
    assert nearest >= 30.0  # CIE76; the palette of Okabe and Ito with a grey for its black keeps 8.5


@pytest.mark.parametrize("sight", SIGHTS)
def test_the_deviation_differs_from_joints_runs_and_reference_for_every_sight(sight: str) -> None:
    seen = lab(np.array(SIGHTS[sight]) @ linear(DEVIATION_COLOUR))
    others = {*JOINT_COLOURS, *RUN_COLOURS.values(), REFERENCE_COLOUR}
    nearest = min(float(np.linalg.norm(seen - lab(np.array(SIGHTS[sight]) @ linear(c)))) for c in others)
    assert nearest >= 20.0  # CIE76; beside all of these no colour was found that keeps 20.5


@pytest.mark.parametrize(
    "colour",
    sorted(
        {*JOINT_COLOURS, *AXIS_COLOURS.values(), *RUN_COLOURS.values(), REFERENCE_COLOUR, DEVIATION_COLOUR}
    ),
)
def test_colours_stand_out_on_white_and_in_the_viewer(colour: str) -> None:
    assert contrast(colour, WHITE) >= 1.95
    assert contrast(colour, VIEWER_GROUND) >= 3.9


def test_colours_start_again() -> None:
    assert joint_colour(0) == joint_colour(8) == JOINT_COLOURS[0]
    assert (run_colour(8), colour_name("#21c3ff")) == ("#21c3ff", "sky blue")
