"""What stands in space of a plan: the arm along it, the path by its speed, its rows and its planes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray, IndexArray
from urmpipe_models.kinematics.forward import points_over_log, poses_over_log
from urmpipe_models.math3d import to_quaternions
from urmpipe_pipeline import text
from urmpipe_pipeline.planned_paths.planes import outlines
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.presentation.figure import Drawing, SpaceFigure
from urmpipe_pipeline.presentation.palette import DEVIATION_COLOUR, INK_COLOUR, REFERENCE_COLOUR, run_colour
from urmpipe_pipeline.presentation.parts import spot_at, within_words
from urmpipe_pipeline.presentation.projections import ABOVE, FRONT, SIDEWAYS, Sketch, draw_projections
from urmpipe_pipeline.presentation.scene import Arm, Path, Scene, Sheets, Spot, Targets

NAMED = 12
"""Rows, and obstacles, up to which each is named in space, and at which the arm is drawn: of more, some."""

ARCS = 40
"""Arcs up to which their planes, corners and tangent points are drawn: more would hide the path."""


def scene(plan: PlannedPath) -> Scene:
    """Return the arm along the path, the path coloured by its speed, and frames at its rows."""
    at = samples_of_rows(plan)
    arms: tuple[Arm, ...] = ()
    if plan.joints is not None:
        chain, q = plan.joints.chain, plan.joints.q
        arms = (Arm(chain, q, plan.t_ns, run_colour(0), vanishes=True, kept=tuple(at.tolist())),)
    targets = Targets(plan.path.points(plan.path.at).position, _quaternions(plan, at), plan.reached[at], None)
    speed = f"coloured by speed: blue 0, red {plan.motion.v.max():.4g} m/s"
    title = f"{'Arm and path' if arms else 'Path'} [m], {speed}"
    return Scene(title, arms, (_speed(plan),), (*_row_spots(plan), *_obstacle_spots(plan)), targets)


def opening_ns(plan: PlannedPath) -> int:
    """Return when the viewer opens in [ns]: at the last sample before what is first in the way, else at 0."""
    first = min((one.t for one in plan.infeasibilities), default=0.0)
    return int(plan.t_ns[max(int(np.searchsorted(plan.t, first)) - 1, 0)])


def samples_of_rows(plan: PlannedPath) -> IndexArray:
    """Return the sample nearest to each row's place on the path, shape (rows,)."""
    s, at = plan.motion.s, plan.path.at
    after = np.clip(np.searchsorted(s, at), 1, len(s) - 1)
    return np.asarray(after - (at - s[after - 1] < s[after] - at))


def path_figure(plan: PlannedPath) -> SpaceFigure:
    """Return the path in space by its speed, with its stops, and of few arcs their planes and ends."""
    path, few = plan.path, 0 < len(plan.path.arcs) <= ARCS
    caption = "Coloured by the speed along the path, equal scale on all axes."
    caption += " Grey: the planes that the arcs span with the lines beside them." if few else ""
    return SpaceFigure(
        "Path in space",
        caption,
        f"Path of {plan.name} in three dimensions, {within_words(plan.position)}, with"
        f" {format_count(len(path.arcs), 'arc')} and {format_count(len(plan.stops), 'stop')}.",
        (_speed(plan), *(_arc_places(plan) if few else ()), _places("stops", plan.stops, INK_COLOUR)),
        _obstacle_spots(plan),
        sheets=Sheets("planes", outlines(path), REFERENCE_COLOUR) if few else None,
    )


def arm_drawing(plan: PlannedPath) -> Iterator[Drawing]:
    """Yield the arm at the rows in three projections, with the path; nothing where it reaches no row.

    Source: [Iso9283]_ Fig. 4.
    """
    if plan.joints is None:
        return
    rows = np.flatnonzero(plan.reached[samples_of_rows(plan)])
    if len(rows) > NAMED:
        rows = rows[np.linspace(0, len(rows) - 1, NAMED).astype(np.intp)]
    if not len(rows):
        return
    at, chain = samples_of_rows(plan)[rows], plan.joints.chain
    arms = points_over_log(chain, plan.joints.q[at])
    spots = [
        Spot(spot_at(place), str(row + 1), INK_COLOUR)
        for place, row in zip(plan.position[at], rows.tolist(), strict=True)
    ]
    title = f"{chain.name} at the rows of {plan.name}"
    svg = draw_projections(Sketch(list(arms), plan.position, spots), (SIDEWAYS, FRONT, ABOVE), title)
    alt = f"The arm at {len(rows)} rows from the side, from the front and from above, with the path."
    yield Drawing("Arm at the rows", alt, svg)


def _speed(plan: PlannedPath) -> Path:
    """Return the path by its speed."""
    kept = tuple(samples_of_rows(plan).tolist())
    return Path("speed", plan.position, plan.t_ns, run_colour(0), values=plan.motion.v, unit="m/s", kept=kept)


def _arc_places(plan: PlannedPath) -> Iterator[Path]:
    """Yield where arcs begin and end, and the corners that they round where these are the rows."""
    path, rows = plan.path, plan.rows
    ends = np.union1d(path.bounds[path.arcs], path.bounds[path.arcs + 1])
    yield _places("tangent points", path.points(ends).position, run_colour(1))
    if rows.corner:
        yield _places("corners", rows.position[rows.radius > 0.0], REFERENCE_COLOUR)


def _places(name: str, position: FloatArray, colour: str) -> Path:
    """Return places in [m], shape (n, 3), that nothing joins."""
    return Path(name, position, None, colour, line=False)


def _row_spots(plan: PlannedPath) -> Iterator[Spot]:
    """Yield the rows, or if they are many the stops, with their numbers; rows at one place together."""
    shown = np.arange(len(plan.rows)) if len(plan.rows) <= NAMED else plan.path.stop_row
    if len(shown) > NAMED:
        return
    places: dict[tuple[float, float, float], list[int]] = {}
    for row in shown.tolist():
        places.setdefault(spot_at(np.round(plan.rows.position[row], 6)), []).append(row)
    for place, rows in places.items():
        stop = ": stop" if (plan.rows.radius[rows] == 0.0).all() else ""
        yield Spot(place, f"{text.format_rows(np.array(rows) + 1)}{stop}", REFERENCE_COLOUR)


def _obstacle_spots(plan: PlannedPath) -> tuple[Spot, ...]:
    """Return where the arm cannot move as planned."""
    shown = plan.infeasibilities[:NAMED]
    places = plan.path.points(np.array([one.s for one in shown])).position
    return tuple(
        Spot(spot_at(place), f"{one.kind}, row {one.row}", DEVIATION_COLOUR)
        for one, place in zip(shown, places, strict=True)
    )


def _quaternions(plan: PlannedPath, at: IndexArray) -> FloatArray | None:
    """Return how the tool is turned at rows, x, y, z, w [-], shape (n, 4): as planned, else by kinematics."""
    if plan.path.orientation is not None:
        return plan.path.orientation.quaternions(plan.path.at)
    if plan.joints is None or not plan.reached[at].all():
        return None
    rotation = poses_over_log(plan.joints.chain, plan.joints.q[at])[1]
    return to_quaternions(rotation.reshape(-1, 9), "matrix")
