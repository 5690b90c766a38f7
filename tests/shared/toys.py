"""Presentations that a test makes up, and recordings of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.presentation.figure import Figure, Line, Panel, View
from urmpipe_pipeline.presentation.palette import AXIS_COLOURS
from urmpipe_pipeline.presentation.section import Presentation, Section
from urmpipe_pipeline.recording.views.blueprint import send_views
from urmpipe_pipeline.recording.writer import write_result

COLOURS = tuple(AXIS_COLOURS.values())
STEP_NS = 5_000_000
PLOT = "/shown/plots/toy/0/0"
"""Where stands what is drawn of the first view of a toy, below the number of its panel."""


@dataclass(frozen=True, slots=True, eq=False)
class Toy:
    """A result of one array.

    Attributes:
        t_ns: Times in [ns], shape (n,).
        values: In [rad], shape (n, k).
    """

    t_ns: IntArray
    values: FloatArray


def toy(rows: int = 50, columns: int = 2) -> Toy:
    """Return waves that differ in each column."""
    t_ns = np.arange(rows) * STEP_NS
    return Toy(t_ns, np.sin(np.outer(t_ns / 1e9, np.arange(1, columns + 1))) + 0.25)


def line(values: FloatArray, **more: Any) -> Line:
    """Return the columns of an array as lines a, b, ..."""
    names = tuple("abcd"[: 1 if values.ndim == 1 else values.shape[1]])
    return Line(values, names, COLOURS[: len(names)], **more)


def panel(one: Toy, *lines: Line, unit: str = "rad", **more: Any) -> Panel:
    """Return a panel of lines, by default of the toy's array."""
    return Panel("values", unit, lines or (line(one.values),), one.t_ns, **more)


def figure(*panels: Panel, name: str = "Values", **more: Any) -> Figure:
    """Return a figure whose panels stand in one view."""
    return Figure(name, "caption", "alt", (View(name, panels),), **more)


def shown(*figures: Figure, scene: Any = None, opens_at_row: int | None = None, **more: Any) -> Presentation:
    """Return a presentation of one section."""
    body = Section("toy", figures=lambda: figures, **more)
    return Presentation(
        "toy", "a headline", more.get("verdict"), (), body, scene=None if scene is None else lambda: scene,
        opens_at_row=opens_at_row,
    )  # fmt: skip


def recorded(one: Presentation, folder: Path, result: Toy | None = None) -> Path:
    """Return the recording of a presentation."""
    path = folder / "toy.rrd"
    path.unlink(missing_ok=True)
    write_result(result or toy(), "toy", one, path)
    return path


def eye_of(one: Presentation) -> tuple[FloatArray, FloatArray]:
    """Return where the eye of a presentation's 3D view is and what it looks at in [m], shape (3,) each."""
    import rerun as rr

    root: Any = send_views(rr.RecordingStream("toy"), one, lambda values, t_ns: None)[0].root_container
    left = root.contents if hasattr(root.contents[0], "properties") else root.contents[0].contents
    (controls,) = (
        view.properties["EyeControls3D"]
        for view in left
        if "EyeControls3D" in getattr(view, "properties", {})
    )
    eye, target = (
        np.array(at.as_arrow_array().to_pylist()[0]) for at in (controls.position, controls.look_target)
    )
    return eye, target
