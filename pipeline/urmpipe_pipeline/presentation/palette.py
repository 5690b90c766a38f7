"""The colours of joints, axes and runs: the same in every view of a recording and in the report.

Chosen by search so that any two joints keep a CIE76 distance of 30 or more, also as protanopes,
deuteranopes and tritanopes see them (Machado, Oliveira, Fernandes, 2009), on white and on the viewer's
dark background; the tests check this.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import FloatArray

_COLOURS = {
    "violet": "#8652ed",
    "orange": "#fda201",
    "green": "#03835c",
    "sky blue": "#21c3ff",
    "vermilion": "#c25000",
    "purple": "#a457a0",
    "sand": "#ccb671",
    "silver": "#a2bcbc",
}

JOINT_COLOURS = tuple(_COLOURS.values())  # of joints from the base outwards, then again from the first

_AXES = {"x": "vermilion", "y": "green", "z": "sky blue", "norm": "orange"}
AXIS_COLOURS = {axis: _COLOURS[name] for axis, name in _AXES.items()}  # of coordinates and the Euclidean norm

_RUNS = ("orange", "sky blue", "violet", "vermilion", "green", "purple", "sand")
RUN_COLOURS = {name: _COLOURS[name] for name in _RUNS}  # of the runs of a comparison; none like the reference

# Of further branches of solved joint values: eight, as an arm with a spherical wrist has. The colour of the
# first run, in which the chosen solution has its tip and its path, is the last.
GHOST_COLOURS = {name: _COLOURS[name] for name in (*_RUNS[1:], "silver", "orange")}

REFERENCE_COLOUR = "#8f9ba0"  # the reference, and the lines of a tolerance; grey
NEUTRAL_COLOUR = "#c8d0d4"  # links, shapes without a colour, lines through all plots: weaker than data
DEVIATION_COLOUR = "#fe046c"  # the deviation in the 3D view: the enlarged path and the worst sample; crimson
CORRECTED_COLOUR = _COLOURS["green"]  # a log as it would be without the causes of its deviation
MASS_COLOUR = "#ffe14d"  # centres of masses in space; yellow
INK_COLOUR = "#1b2329"  # marks that are no data, such as the start of a path

# Small to large values: darker all the way, blue to red, legible on white and to the colour-blind.
VALUE_SCALE = ((0.0, "#8fc1e3"), (0.35, "#e69f00"), (0.7, "#d55e00"), (1.0, "#6b0f00"))

# Small to large values within a limit (blue) and beyond it (orange to crimson). Protanopes and deuteranopes
# distinguish the two; both are legible on a light and on a dark background.
WITHIN_SCALE, BEYOND_SCALE = ("#4a98c9", "#2a73b5"), ("#cf7a00", "#c2183b")


def joint_colour(index: int) -> str:
    """Return the colour of a joint as #rrggbb, counted from 0 at the base."""
    return JOINT_COLOURS[index % len(JOINT_COLOURS)]


def run_colour(index: int) -> str:
    """Return the colour of a run as #rrggbb, counted from 0."""
    return list(RUN_COLOURS.values())[index % len(RUN_COLOURS)]


def rgb(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue of #rrggbb, each 0..255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def value_colours(values: FloatArray) -> NDArray[np.uint8]:
    """Return red, green and blue of values from 0 to the largest on `VALUE_SCALE`, shape (n, 3).

    Values are in any unit, shape (n,); NaN has the colour of the smallest.
    """
    share = np.nan_to_num(values / (np.nanmax(values, initial=0.0) or 1.0))
    stops = [stop for stop, _ in VALUE_SCALE]
    channels = np.array([rgb(colour) for _, colour in VALUE_SCALE], np.float64).T
    return np.stack([np.interp(share, stops, channel) for channel in channels], axis=1).astype(np.uint8)


def colour_name(colour: str) -> str:
    """Return the name of a colour of lines in space; empty if it has no name."""
    names = {REFERENCE_COLOUR: "grey", DEVIATION_COLOUR: "crimson"}
    return (names | {ghost: name for name, ghost in GHOST_COLOURS.items()}).get(colour, "")


def ghost_colour(index: int) -> str:
    """Return the colour of a further branch of solved joint values as #rrggbb, counted from 0."""
    return list(GHOST_COLOURS.values())[index % len(GHOST_COLOURS)]
