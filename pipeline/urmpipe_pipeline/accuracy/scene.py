"""The scene of an accuracy: the arm, planned and real path, the deviation enlarged."""

from __future__ import annotations

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import points_over_log
from urmpipe_pipeline import text
from urmpipe_pipeline.accuracy.driven_motion import DrivenMotion
from urmpipe_pipeline.accuracy.parts import format_velocity, select_shown_motion
from urmpipe_pipeline.accuracy.result import AccuracyResult
from urmpipe_pipeline.comparison.figures import display_factor
from urmpipe_pipeline.presentation.figure import Drawing, SpaceFigure
from urmpipe_pipeline.presentation.palette import AXIS_COLOURS, DEVIATION_COLOUR, REFERENCE_COLOUR, run_colour
from urmpipe_pipeline.presentation.parts import ends, spot_at
from urmpipe_pipeline.presentation.projections import ABOVE, FRONT, SIDEWAYS, Sketch, draw_projections
from urmpipe_pipeline.presentation.scene import Arm, Path, Scene, Spot
from urmpipe_pipeline.trajectories import extent

MAX_ARMS = 8  # poses of the arm in a drawing


def accuracy_scene(result: AccuracyResult) -> Scene:
    """Return the arm along the contour, the planned path, and the real path coloured by its deviation."""
    motion = select_shown_motion(result)
    at = motion.worst
    arm = Arm(result.robot, motion.q, motion.t_ns, run_colour(0), kept=(at,))
    now = Path("planned", motion.planned, motion.t_ns, REFERENCE_COLOUR, asked=True, kept=(at,), line=False)
    larger = _larger(motion)
    by = "‖Δ‖" if result.limited_error == "time" else "its distance from the planned one"
    legend = f"real path coloured by {by}{f', in crimson the {larger.name}' if larger else ''}"
    title = f"Arm and paths at {format_velocity(motion.velocity)} [m], {legend}"
    return Scene(title, (arm,), (*_paths(result, motion), now), (_worst(motion),))


def path_figure(result: AccuracyResult) -> SpaceFigure:
    """Return the planned and the real path of the shown motion, and its deviation enlarged."""
    motion = select_shown_motion(result)
    larger = _larger(motion)
    nearest = "set point" if result.limited_error == "time" else "planned path"
    drawn = f" Crimson: {larger.name}." if larger else ""
    return SpaceFigure(
        f"Path in space at {format_velocity(motion.velocity)}",
        f"Equal scale on all axes. Grey: planned; the colour is the distance from the {nearest}.{drawn}",
        f"Planned and real path at {format_velocity(motion.velocity)} in space. {_worst(motion).words}.",
        _paths(result, motion),
        (*ends(motion.position), _worst(motion)),
    )


def arm_drawing(result: AccuracyResult) -> Drawing:
    """Return the arm along the contour in three projections, with the deviation enlarged.

    Source: [Iso9283]_ Fig. 4.
    """
    motion = select_shown_motion(result)
    larger, corners = _larger(motion), np.clip(motion.corner_times_ns, 0, motion.t_ns[-1])
    at = np.unique(np.searchsorted(motion.t_ns, [motion.t_ns[0], *corners, motion.t_ns[-1]]))
    at = at[np.unique(np.linspace(0, len(at) - 1, MAX_ARMS).astype(np.intp))]
    run = motion.position if larger is None else larger.position
    spot = Spot(spot_at(run[motion.worst]), "largest error", DEVIATION_COLOUR)
    arms = points_over_log(result.robot, motion.q[at])
    words = "real path" if larger is None else larger.name
    title = f"{result.robot.name} at {format_velocity(motion.velocity)}: planned path grey, {words} orange"
    svg = draw_projections(
        Sketch(list(arms), run, (spot,), commanded=motion.planned), (SIDEWAYS, FRONT, ABOVE), title
    )
    alt = (
        f"The arm at {len(at)} poses from the side, from the front and from above, planned path and {words}."
    )
    return Drawing(f"Arm on the path at {format_velocity(motion.velocity)}", alt, svg)


def _paths(result: AccuracyResult, motion: DrivenMotion) -> tuple[Path, ...]:
    """Return the planned path, the real one coloured by the error that decides, the deviation enlarged."""
    by_time = result.limited_error == "time"
    real = Path(
        "real: ‖Δ‖" if by_time else "real: distance from the path", motion.position, motion.t_ns,
        AXIS_COLOURS["norm"], values=motion.delta[:, 3] if by_time else motion.from_path, limit=result.limit,
        kept=(motion.worst,),
    )  # fmt: skip
    larger = _larger(motion)
    planned = Path("planned", motion.planned, None, REFERENCE_COLOUR, asked=True)
    return (planned, real) if larger is None else (planned, real, larger)


def _larger(motion: DrivenMotion) -> Path | None:
    """Return planned + factor (position - planned); None if no factor makes it visible."""
    factor = display_factor(float(motion.delta[:, 3].max()), extent(motion.planned) / 2.0)
    if factor is None:
        return None
    position: FloatArray = motion.planned + factor * (motion.position - motion.planned)
    return Path(f"deviation x{factor}", position, motion.t_ns, DEVIATION_COLOUR, kept=(motion.worst,))


def _worst(motion: DrivenMotion) -> Spot:
    """Return the point of a motion with the largest distance from its set point."""
    distance = text.format_quantity(float(motion.delta[motion.worst, 3]), "m")
    when = text.format_seconds(float(motion.t[motion.worst]))
    return Spot(spot_at(motion.position[motion.worst]), f"‖Δ‖ {distance} at {when} s", DEVIATION_COLOUR)
