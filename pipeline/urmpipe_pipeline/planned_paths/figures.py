"""The plots of a plan over time: its law, the joints and their limits, how far singular poses are."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline import text
from urmpipe_pipeline.planned_paths.parts import passes_ns
from urmpipe_pipeline.planned_paths.planned_joints import FOLLOWED, PlannedJoints
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.presentation.figure import Figure, Line, Mark, Panel, View
from urmpipe_pipeline.presentation.palette import AXIS_COLOURS, joint_colour
from urmpipe_pipeline.runs.figures import joint_panels

COLOUR = AXIS_COLOURS["norm"]
"""Of a single line."""

POWERS = ("m³", "m²", "m", "")
"""Units of the determinant of a square Jacobian, by how many of its joints slide."""

MARKED = 6
"""Lines through the plots at stops, and at obstacles, at most: the words of more would overlap."""


def plan_figures(plan: PlannedPath) -> Iterator[Figure]:
    """Yield the time law, and of a plan with an arm the joints and how far it is from singular poses."""
    yield law_figure(plan)
    if plan.joints is not None and plan.reached.any():
        yield joints_figure(plan, plan.joints)
        yield singular_figure(plan, plan.joints)


def law_figure(plan: PlannedPath) -> Figure:
    """Return arc length, speed, acceleration and jerk along the path, arcs tinted, with the law's limits."""
    factor, motion = plan.speed_factor, plan.motion
    limits = (None, plan.velocity, plan.acceleration, plan.jerk)
    held = [None if limit is None else limit * factor**order for order, limit in enumerate(limits)]
    on_arc = np.isfinite(plan.path.radius[plan.path.segment_at(motion.s)])
    tinted = on_arc if on_arc.any() else None
    views = []
    for name, unit, values, limit in zip(
        ("s", "s′", "s″", "s‴"),
        ("m", "m/s", "m/s2", "m/s3"),
        (motion.s, motion.v, motion.a, motion.j),
        held,
        strict=True,
    ):
        panel = Panel(
            name, unit, (Line(values, (name,), (COLOUR,)),), plan.t_ns, _within(limit),
            signed=name in ("s″", "s‴"), tinted=tinted, limit_name="limit",
        )  # fmt: skip
        views.append(View(name, (panel,)))
    caption = "Arc length, and speed, acceleration and jerk along the path."
    caption += " Where s″ steps, s‴ has no value." if plan.jerk is None else ""
    caption += " Tinted: arcs." if tinted is not None else ""
    reduced = f" once its speeds are reduced to {text.format_percent(factor)}" if factor < 1.0 else ""
    caption += f" Dashed: the largest values that the law allows{reduced}." if any(held) else ""
    return Figure(
        "Motion along the path",
        caption,
        f"Arc length, speed, acceleration and jerk along {plan.name} over time."
        f" The speed reaches {motion.v.max():.4g} m/s, the acceleration {np.abs(motion.a).max():.4g} m/s².",
        tuple(views),
        instants(plan),
        opened=1,
        share=1.6,
    )


def joints_figure(plan: PlannedPath, joints: PlannedJoints) -> Figure:
    """Return joint values, rates and accelerations, each of these with its shares of the limits."""
    moving, names = joints.chain.moving, joints.chain.coordinates
    panels = partial(joint_panels, names, plan.joint_units)
    rates = joints.velocity_share, [one.velocity for one in moving]
    rises = joints.acceleration_share, [one.acceleration for one in moving]
    views = (
        View("Joints", panels("q", joints.q, plan.t_ns)),
        View("Rates", panels("q′", joints.qd, plan.t_ns, per="/s")),
        *_shares(plan, "|q′| / limit", "Rates, of their limits", *rates),
        View("Accelerations", panels("q″", joints.qdd, plan.t_ns, per="/s2")),
        *_shares(plan, "|q″| / limit", "Accelerations, of their limits", *rises),
    )
    caption = "Values, rates and accelerations of the joints."
    if joints.limited:
        caption += " In % of the largest rate and acceleration of each joint, where they are known:"
        caption += " 100 % is the limit, a diamond marks the largest share."
    return Figure(
        "Joints over time",
        caption,
        f"Values, rates and accelerations of {', '.join(names)} of {joints.chain.name} over time.",
        views,
        instants(plan),
        share=3.2,
    )


def singular_figure(plan: PlannedPath, joints: PlannedJoints) -> Figure:
    """Return the smallest singular value and, of a square Jacobian, the determinant."""
    near, nearest = joints.singularity, joints.nearest_singularity
    views = [_singular_view(plan, nearest, "σ min", "", near.smallest)]
    caption = "σ min is the smallest singular value of the Jacobian, lengths divided by that of the arm."
    if near.determinant is not None:
        slides = sum(one.kind == "prismatic" and one.lower < one.upper for one in joints.chain.moving)
        views.append(_singular_view(plan, nearest, "det J", POWERS[min(slides, 3)], near.determinant))
        caption += " det J is its determinant. Both are"
    else:
        caption += " It is"
    return Figure(
        "Distance from singular poses",
        f"{caption} 0 in a singular pose; a diamond marks the nearest.",
        f"Distance of {joints.chain.name} from singular poses along {plan.name} over time: the smallest"
        f" singular value is {np.nanmin(near.smallest):.4g} at least.",
        tuple(views),
        instants(plan),
        share=1.2,
    )


def _singular_view(plan: PlannedPath, nearest: int | None, name: str, unit: str, values: FloatArray) -> View:
    """Return a quantity, shape (n,), that is 0 in a singular pose: so its axis begins at 0."""
    marks: tuple[Mark, ...] = ()
    if nearest is not None:
        at, value = int(plan.t_ns[nearest]), float(values[nearest])
        marks = (Mark(at, value, "diamond", COLOUR, f"nearest to a singular pose: {value:.4g}", name),)
    line = Line(values, (name,), (COLOUR,))
    return View(name, (Panel(name, unit, (line,), plan.t_ns, signed=False, marks=marks),))


def instants(plan: PlannedPath) -> dict[int, str]:
    """Return when it stops on the way, unless often, and what is first in the way, by times in [ns]."""
    at, inner = passes_ns(plan), plan.path.stop_row[1:-1].tolist()
    stops = {at[row]: f"stop, row {row + 1}" for row in inner} if len(inner) <= MARKED else {}
    obstacles = {round(one.t * 1e9): f"{one.kind}, row {one.row}" for one in plan.infeasibilities[:MARKED]}
    return stops | obstacles


def _within(limit: float | None) -> float | None:
    """Return a limit with room for rounding: what runs at it is not out of it."""
    return None if limit is None else limit * FOLLOWED


def _shares(
    plan: PlannedPath, title: str, view: str, shares: FloatArray, limits: list[float]
) -> Iterator[View]:
    """Yield the shares of their limits, shape (n, joints) [-], of the joints that have one, in [%]."""
    own = np.flatnonzero(np.isfinite(limits))
    if not len(own) or plan.joints is None:
        return
    names, known = plan.joints.chain.coordinates, 100.0 * shares[:, own]
    sample, column = np.unravel_index(int(np.nanargmax(known)), known.shape)
    joint, largest = int(own[column]), float(known[sample, column])
    words = f"{names[joint]}: {text.format_percent(largest / 100.0)} of its limit"
    mark = Mark(int(plan.t_ns[sample]), largest, "diamond", joint_colour(joint), words, names[joint])
    line = Line(known, tuple(names[j] for j in own), tuple(joint_colour(int(j)) for j in own))
    panel = Panel(
        title, "%", (line,), plan.t_ns, _within(100.0), signed=False, marks=(mark,), limit_name="limit"
    )
    yield View(view, (panel,))
