"""The plots of a log over time: joints before and after repolarization, speed, motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics.equations import energies_over_log, torque_terms_over_log
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray, row_norms
from urmpipe_models.kinematics.forward import PointLog
from urmpipe_models.wraps import unwrap_euler
from urmpipe_pipeline import text
from urmpipe_pipeline.presentation.figure import Computed, Figure, Line, Mark, Panel, Shape, View
from urmpipe_pipeline.presentation.palette import AXIS_COLOURS, JOINT_COLOURS, joint_colour
from urmpipe_pipeline.presentation.parts import within_words
from urmpipe_pipeline.repolarization.audit import AuditEntry
from urmpipe_pipeline.runs.derivatives import format_acceleration_source
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.runs.torques import PERIOD_ASSUMED

EULER = {"rz": AXIS_COLOURS["z"], "ry": AXIS_COLOURS["y"], "rx": AXIS_COLOURS["x"]}
"""The Euler angles in the colours of their axes."""

NORM = (AXIS_COLOURS["norm"],)
"""The colour of what is never negative."""

JOINTS_SHARE = 3.4
"""Height of a plot of joints relative to others: its legend names all of an arm's."""


def run_figures(run: Run) -> Iterator[Figure]:
    """Yield the plots of a log that stands alone: joints, speed, motion, torques where they are known."""
    yield from joints_figure(run)
    if run.timed and run.tcp is not None:
        yield speed_figure(run.name, run.t_ns, _lengths(run.tcp.velocity))
    yield from motion_figure(run)
    yield from torque_figures(run)


def times_of(run: Run) -> IntArray | None:
    """Return the times of a run's samples in [ns], shape (g,); None if the number of a row is its axis."""
    return run.t_ns if run.timed else None


def joints_figure(run: Run, opened: int | None = None) -> Iterator[Figure]:
    """Yield the joints as the file has them and repolarized, with every finding marked; nothing of a path.

    Args:
        run: The log.
        opened: Number of the view that the viewer opens: 0 before, 1 after; None for both.
    """
    if not run.log.joints:
        return
    axis = "time" if run.timed else "the rows"
    joints = f"Joint values of {run.name} over {axis}: {', '.join(run.log.joints)}."
    panels = partial(joint_panels, run.log.joints, run.joint_units)
    after = panels("after" if run.audit else "joints", run.q, times_of(run), _marks(run))
    if not run.timed:
        said = "A pose a row: no motion joins them."
        yield Figure("Joints", said, joints, (View("Joints", after),), share=JOINTS_SHARE)
        return
    if not run.audit:
        said = "No joint had to be repolarized: the values are those of the file."
        views = (View("Joints, no repolarization needed", after),)
        yield Figure("Joints", said, f"{joints} {said}", views, share=JOINTS_SHARE)
        return
    wraps, doubts = len(run.repolarizations), len(run.audit) - len(run.repolarizations)
    marked = f"{wraps} marked{f', {doubts} doubtful' if doubts else ''}"
    before = panels("before", run.log.q, run.log.t_ns, _raw_marks(run))
    both = View("Joints in the file", before), View(f"Joints repolarized ({marked})", after)
    count = text.counted(wraps, "repolarization")
    caption = f"First as in the file, then repolarized. {count}: a triangle marks each, up where a turn was"
    caption += " added, down where one was taken away."
    caption += f" A cross marks each of {text.counted(doubts, 'other finding')}." if doubts else ""
    title = "Joints before and after repolarization"
    alt = f"{joints} First as in the file, then after {count}."
    yield Figure(title, caption, alt, both, opened=opened, share=JOINTS_SHARE)


def joint_panels(
    names: Sequence[str],
    units: Sequence[str],
    title: str,
    values: FloatArray,
    t_ns: IntArray | None,
    marks: Sequence[Mark] = (),
    per: str = "",
) -> tuple[Panel, ...]:
    """Return joints over time, a panel for those that turn and one for those that slide.

    Args:
        names: Of the joints.
        units: Of each, rad or m.
        title: What is plotted of them.
        values: In rad and m, divided by `per`, shape (n, joints).
        t_ns: Times in [ns], shape (n,); None: the rows are points.
        marks: Marks on them, by the names of the joints.
        per: "", "/s" or "/s2".
    """
    panels = []
    for unit in dict.fromkeys(units):
        own = [j for j, other in enumerate(units) if other == unit]
        line = Line(
            values if len(own) == len(names) else np.asarray(values)[:, own],
            tuple(names[j] for j in own),
            tuple(map(joint_colour, own)),
            points=t_ns is None,
        )
        marked = tuple(mark for mark in marks if mark.name in line.names)
        panels.append(Panel(title, unit + per, (line,), t_ns, marks=marked, share=1.5))
    return tuple(panels)


def speed_figure(name: str, t_ns: IntArray, speed: FloatArray | Computed) -> Figure:
    """Return the speed of a tool centre point in [m/s], shape (n,), over times in [ns], shape (n,)."""
    title = "Speed of the tool centre point"
    panel = Panel("‖v‖", "m/s", (Line(speed, ("speed",), NORM),), t_ns, signed=False)
    alt = f"{title} of {name} over time: the norm of its velocity."
    return Figure(title, "The norm of its velocity.", alt, (View(title, (panel,)),), share=2.0)


def motion_figure(run: Run) -> Iterator[Figure]:
    """Yield rates and accelerations of the joints, and how the tool centre point moves.

    By kinematics; of a log without them the position and the orientation that it recorded, if any.
    """
    views = (*_derivatives(run), *(_recorded(run) if run.tcp is None else _point(run, run.tcp)))
    if not views:
        return
    title, point = "Motion", point_name(run)
    alt: str | Callable[[], str]
    angles = "Euler angles (moving Z-Y-X, in the colours of their axes), by forward kinematics."
    if run.tcp is None:
        caption = "As the log recorded it: without a robot there are no kinematics."
        alt = f"Motion over time, as the log {run.name} recorded it."
        if not run.timed:
            title, alt = "Poses of the tool centre point", f"Poses as the log {run.name} recorded them."
    elif not run.timed:
        title, caption = "Poses of the tool centre point", f"{point} and its {angles}"
        alt = f"Poses of {point} of {run.name} by forward kinematics."
    else:
        caption = f"Rates and accelerations of the joints; {point}, its velocity v and acceleration a,"
        caption += f" and its {angles} The angles go on past ±π, so that none jumps."
        caption += _singular_words(run.tcp)
        alt = partial(_extent_words, f"Motion of {point} of {run.name}", run.tcp)
    yield Figure(title, caption, alt, views, share=2.2)


def point_name(run: Run) -> str:
    """Return what the paper calls the tool centre point: p7 of an arm with seven segments."""
    return f"p{len(run.robot.joints)}" if run.robot is not None else "p"


def coordinates(values: FloatArray) -> Line:
    """Return x, y and z in any unit, shape (n, 3), in their colours, by these names in all panels."""
    return Line(values, tuple("xyz"), tuple(AXIS_COLOURS[axis] for axis in "xyz"))


def _derivatives(run: Run) -> Iterator[View]:
    if run.timed and run.log.joints and len(run.t_ns) > 1:
        panels = partial(joint_panels, run.log.joints, run.joint_units)
        yield View("Joint rates", panels("rates", run.qd, run.t_ns, per="/s"))
        yield View("Joint accelerations", panels("accelerations", run.qdd, run.t_ns, per="/s2"))


def _point(run: Run, tcp: PointLog) -> Iterator[View]:
    """Yield the views of the tool centre point by kinematics."""
    t_ns, points = times_of(run), not run.timed
    position = replace(coordinates(tcp.position), points=points)
    yield View("TCP", (Panel(point_name(run), "m", (position,), t_ns),))
    if run.timed:
        yield View("TCP velocity", (Panel("v", "m/s", (coordinates(tcp.velocity),), t_ns),))
        size = Line(_lengths(tcp.acceleration), ("‖a‖",), NORM)
        yield View("TCP acceleration", (Panel("a", "m/s2", (coordinates(tcp.acceleration), size), t_ns),))
    tinted = np.asarray(tcp.singular) if np.any(tcp.singular) else None
    angles = Computed(len(tcp.euler_zyx), partial(_angles, tcp, tinted, follows=run.timed))
    euler = Line(angles, tuple(EULER), tuple(EULER.values()), points=points)
    yield View("TCP rz, ry, rx", (Panel("rz, ry, rx", "rad", (euler,), t_ns, tinted=tinted),))


def _lengths(vectors: FloatArray) -> Computed:
    return Computed(len(vectors), lambda: row_norms(vectors))


def _angles(tcp: PointLog, singular: BoolArray | None, *, follows: bool) -> FloatArray:
    """Return the Euler angles in [rad] without those of singular samples, continuous in time."""
    known = np.asarray(tcp.euler_zyx)
    if singular is not None:
        known = np.where(singular[:, np.newaxis], np.nan, known)
    return unwrap_euler(known) if follows else known


def _recorded(run: Run) -> Iterator[View]:
    """Yield position and orientation as a log without kinematics recorded them itself."""
    t_ns, points = times_of(run), not run.timed
    if run.tcp_recorded is not None:
        position = replace(coordinates(run.tcp_recorded), points=points)
        yield View("Recorded TCP", (Panel("p", "m", (position,), t_ns),))
    if (values := run.rotation_recorded) is not None:
        names = run.rotation_names  # a quaternion has no unit
        line = Line(values, names, tuple(map(joint_colour, range(len(names)))), points=points)
        unit = "" if len(names) == 4 else "rad"
        yield View("Recorded orientation", (Panel("orientation", unit, (line,), t_ns),))


def _singular_words(tcp: PointLog) -> str:
    count = text.counted(int(np.count_nonzero(tcp.singular)), "sample")
    said = f" Tinted: {count} with ry at ±π/2, where rz and rx are not separately defined."
    return said if np.any(tcp.singular) else ""


def _extent_words(motion: str, tcp: PointLog) -> str:
    """Say between which places a point moves and how fast."""
    if not np.isfinite(tcp.position).any():
        return f"{motion} over time by forward kinematics. It has no value."
    said = f"{motion} over time by forward kinematics. It stays {within_words(tcp.position)}"
    for values, word, unit in ((tcp.velocity, "speed", "m/s"), (tcp.acceleration, "acceleration", "m/s²")):
        norm = row_norms(values)
        if np.isfinite(norm).any():
            said += f"; its {word} reaches {np.nanmax(norm):.4f} {unit}"
    return f"{said}."


def _raw_marks(run: Run) -> list[Mark]:
    """Return a mark half way down each jump of the file, and on each other finding."""
    q = np.asarray(run.log.q)
    return [
        _mark(run, one, float(q[one.sample, j] - (one.step / 2 if one.kind == "wrap" else 0.0)))
        for one in run.audit
        for j in (run.log.joints.index(one.joint),)
    ]


def _marks(run: Run) -> list[Mark]:
    """Return a mark on the repolarized line at the instant of each finding."""
    found = []
    for name in dict.fromkeys(one.joint for one in run.audit):
        own = [one for one in run.audit if one.joint == name]
        t_ns = np.array([round(one.t * 1e9) for one in own], dtype=np.int64)
        column = np.asarray(run.q)[:, run.log.joints.index(name)]
        rows = _beside(run.t_ns, column, t_ns)
        if len(rows):
            values = np.interp(t_ns, run.t_ns[rows], column[rows])
            found += [_mark(run, *pair) for pair in zip(own, values.tolist(), strict=True)]
    return found


def _beside(times_ns: IntArray, column: FloatArray, t_ns: IntArray) -> IntArray:
    """Return the samples before and after each time; where a value is missing, all that there are."""
    after = np.searchsorted(times_ns, t_ns)
    rows: IntArray = np.unique(np.clip(np.concatenate((after - 1, after)), 0, len(times_ns) - 1))
    return rows if np.isfinite(column[rows]).all() else np.flatnonzero(np.isfinite(column))


def _mark(run: Run, one: AuditEntry, value: float) -> Mark:
    shape: Shape = "cross" if one.kind != "wrap" else "up" if one.after > one.before else "down"
    kind = "repolarization" if one.kind == "wrap" else one.kind
    words = f"{kind} of {one.joint}, row {one.row}: step {one.step:+.4f} rad, k {one.before} → {one.after}"
    colour = joint_colour(run.log.joints.index(one.joint))
    return Mark(round(one.t * 1e9), value, shape, colour, words, one.joint)


TERMS = {
    "gravity": AXIS_COLOURS["y"],
    "inertia": AXIS_COLOURS["z"],
    "centrifugal": AXIS_COLOURS["norm"],
    "Coriolis": AXIS_COLOURS["x"],
}
"""The terms that a log tells, the largest of a slow motion next to 0, and their colours."""

SUM_COLOUR = JOINT_COLOURS[0]
"""Of what terms or energies add up to: violet."""


def torque_figures(run: Run) -> Iterator[Figure]:
    """Yield torques, their terms and the energies; nothing of an arm without masses, or without rates."""
    if run.robot is None or run.tau is None or len(run.t_ns) < 2:
        return
    yield joint_torques_figure(run, run.robot, run.tau)
    yield terms_figure(run, run.robot, run.tau)
    yield energy_figure(run, run.robot)


def joint_torques_figure(run: Run, robot: Chain, tau: FloatArray) -> Figure:
    """Return the torques over time, together and joint by joint with their limits.

    They are in [N.m] or [N], shape (g, joints).
    """
    names, units, limited = run.log.joints, run.torque_units, not run.log.period_assumed
    views = [View("Torques", tuple(_together(run, tau)))]
    for j, (name, unit, joint) in enumerate(zip(names, units, robot.moving, strict=True)):
        line = Line(_column(tau, j), (name,), (joint_colour(j),))
        limit = joint.effort if limited and math.isfinite(joint.effort) else None
        title = _symbol(unit, str(j + 1))
        panel = Panel(title, unit, (line,), run.t_ns, limit, limit_name="effort limit")
        views.append(View(f"Torque of {name}", (panel,)))
    caption = "What the joints must exert for this motion, by the masses of the robot (inverse dynamics);"
    caption += " friction and a load at the tool are not in it."
    made = format_acceleration_source(run.derivative, len(run.t_ns))
    caption += f"{f' {made}' if made else ''} First all joints, then each, numbered from the base."
    if not limited:
        caption += f" {PERIOD_ASSUMED}"
    elif any(math.isfinite(joint.effort) for joint in robot.moving):
        caption += " Dashed: its effort limit; blue: within it; red: beyond it."
    return Figure("Joint torques", caption, partial(_largest_words, run), tuple(views), share=2.2)


def terms_figure(run: Run, robot: Chain, tau: FloatArray) -> Figure:
    """Return the terms of each joint's torque, in [N.m] or [N], shape (g, joints), stacked."""
    terms = cache(partial(torque_terms_over_log, robot, run.q, run.qd, run.qdd))
    views = []
    for j, (name, unit) in enumerate(zip(run.log.joints, run.torque_units, strict=True)):
        parts = Computed(len(run.t_ns), partial(_terms_of, terms, j))
        lines = (
            Line(parts, tuple(TERMS), tuple(TERMS.values()), stacked=True),
            Line(_column(tau, j), ("sum",), (SUM_COLOUR,)),
        )
        panel = Panel(_symbol(unit, str(j + 1)), unit, lines, run.t_ns, share=1.2)
        views.append(View(f"Torque terms of {name}", (panel,)))
    return Figure(
        "Terms of the torques",
        "What the torque of each joint is made of: the weights of the links (gravity), the accelerations q″"
        " (inertia), the squares q′² (centrifugal) and the products q′ᵢ q′ⱼ (Coriolis) of the rates. Areas"
        " stack from 0, up where a term is positive and down where it is negative; the line is their sum, the"
        " torque. A fifth term is that of a load at the tool: a log tells no load, so it is 0 and not drawn.",
        f"Gravity, inertia, centrifugal and Coriolis terms of the torque of each joint of {run.name} over"
        " time, and their sum.",
        tuple(views),
        share=2.2,
    )


def energy_figure(run: Run, robot: Chain) -> Figure:
    """Return the kinetic, the potential and the total energy of the arm in [J]."""
    energies = Computed(len(run.t_ns), partial(_energies, run, robot))
    names = ("kinetic", "potential", "total")
    colours = (AXIS_COLOURS["norm"], AXIS_COLOURS["z"], SUM_COLOUR)
    panel = Panel("energy", "J", (Line(energies, names, colours),), run.t_ns)
    return Figure(
        "Energy",
        "Kinetic energy of the arm's masses, their potential energy (0 with all of them at the height of the"
        " world's origin), and the sum.",
        f"Kinetic, potential and total energy of {robot.name} over time.",
        (View("Energy", (panel,)),),
        share=2.0,
        beside=True,
    )


def _together(run: Run, tau: FloatArray) -> Iterator[Panel]:
    """Yield the torques of all joints that turn, and the forces of those that slide, a panel each."""
    units = run.torque_units
    for unit in dict.fromkeys(units):
        own = [j for j, other in enumerate(units) if other == unit]
        values = tau if len(own) == len(units) else np.asarray(tau)[:, own]
        names, colours = [run.log.joints[j] for j in own], [joint_colour(j) for j in own]
        line = Line(values, tuple(names), tuple(colours))
        yield Panel(_symbol(unit), unit, (line,), run.t_ns, share=2.0)


def _symbol(unit: str, number: str = "") -> str:
    """Return what a torque in [N.m] or a force in [N] of a joint is called: τ2, F3."""
    return f"{'τ' if unit == 'N.m' else 'F'}{number}"


def _column(tau: FloatArray, joint: int) -> Computed:
    """Return the torque of one joint, shape (g,), of those of all, shape (g, joints)."""
    return Computed(len(tau), lambda: np.asarray(tau)[:, joint])


def _terms_of(terms: Callable[[], dict[str, FloatArray]], joint: int) -> FloatArray:
    """Return the terms of the torque of one joint, shape (g, terms)."""
    return np.column_stack([terms()[name.lower()][:, joint] for name in TERMS])


def _energies(run: Run, robot: Chain) -> FloatArray:
    """Return the kinetic, the potential and the total energy in [J], shape (g, 3)."""
    kinetic, potential = energies_over_log(robot, np.asarray(run.q), np.asarray(run.qd))
    return np.column_stack((kinetic, potential, kinetic + potential))


def _largest_words(run: Run) -> str:
    """Say how large the torque of each joint becomes, and how much of its limit that is."""
    largest = []
    for one in run.torque_summaries():
        share = "" if one.effort_share is None else f" ({text.percent(one.effort_share)} of its limit)"
        largest.append(f"{one.joint} {one.max:.4g} {one.unit}{share}")
    return f"Torques of the joints of {run.name} over time. The largest: {', '.join(largest)}."
