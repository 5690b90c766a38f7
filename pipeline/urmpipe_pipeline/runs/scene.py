"""A run in space: its arm, and the path of its tool centre point."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from urmpipe_models.kinematics.forward import points_over_log
from urmpipe_pipeline.presentation.figure import Drawing, SpaceFigure
from urmpipe_pipeline.presentation.palette import AXIS_COLOURS, REFERENCE_COLOUR, run_colour
from urmpipe_pipeline.presentation.parts import ends, within_words
from urmpipe_pipeline.presentation.projections import (
    FRONT,
    SIDEWAYS,
    Sketch,
    chain_masses,
    draw_projections,
    label_skeleton,
)
from urmpipe_pipeline.presentation.scene import Arm, Path, Scene
from urmpipe_pipeline.runs.figures import times_of
from urmpipe_pipeline.runs.run import Run


def run_scene(run: Run) -> Scene | None:
    """Return the scene of a run: its arm, its path and the recorded path; None without a position."""
    arms: tuple[Arm, ...] = ()
    if run.robot is not None and run.tcp is not None:
        masses = bool(run.robot.inertials)
        arms = (Arm(run.robot, run.q, times_of(run), run_colour(0), masses=masses),)
    paths = tuple(_paths(run))
    title = "Arm, its mass centres (yellow) and paths [m]" if arms and arms[0].masses else "Arm and paths [m]"
    return Scene(title, arms, paths) if arms or paths else None


def path_figure(run: Run) -> Iterator[SpaceFigure]:
    """Yield the path of the tool centre point in space, by kinematics and as recorded."""
    paths, timed, t_ns = [], run.timed, times_of(run)
    if run.tcp_recorded is not None and not (run.tcp is not None and run.log.externally_measured):
        recorded = Path(
            "recorded by the log", run.tcp_recorded, t_ns, REFERENCE_COLOUR, asked=True, line=timed
        )
        paths.append(recorded)
    if run.tcp is not None:
        paths.append(Path("forward kinematics", run.tcp.position, t_ns, AXIS_COLOURS["norm"], line=timed))
    if not paths or not np.isfinite(position := np.asarray(paths[-1].position)).any():
        return
    what = "Path" if timed else "Poses"
    yield SpaceFigure(
        f"{what} in space",
        "The tool centre point, equal scale on all axes.",
        f"{what} of {run.name} in three dimensions, {within_words(position)}.",
        tuple(paths),
        ends(position) if timed else (),
    )


def mass_drawing(run: Run) -> Iterator[Drawing]:
    """Yield the arm at its first pose in two projections with its mass centres, if it has masses."""
    if run.robot is None or not run.robot.inertials or run.tcp is None:
        return
    rows = np.flatnonzero(np.isfinite(run.q).all(axis=1))
    if not len(rows):
        return
    q, name = np.asarray(run.q)[rows[0]], run.robot.name
    (skeleton,) = points_over_log(run.robot, q[np.newaxis])
    masses = chain_masses(run.robot, q)
    sketch = Sketch([skeleton], spots=label_skeleton(skeleton), masses=masses)
    alt = f"{name} from the side and from the front, with the centres of"
    alt += f" its {len(masses)} masses, {sum(centre.mass for centre in masses):.4g} kg in all."
    svg = draw_projections(sketch, (SIDEWAYS, FRONT), f"{name} at the start of {run.name}")
    yield Drawing("Mass centres", alt, svg)


def _paths(run: Run) -> Iterator[Path]:
    by_joints, timed, t_ns = run.tcp is not None, run.timed, times_of(run)
    if run.tcp_recorded is not None and not (
        by_joints and run.log.externally_measured
    ):  # no frame joins both
        colour = REFERENCE_COLOUR if by_joints else run_colour(0)
        yield Path("recorded by the log", run.tcp_recorded, t_ns, colour, asked=by_joints, line=timed)
    if run.tcp is not None:
        yield Path(run.name, run.tcp.position, t_ns, run_colour(0), line=timed)
