"""The plots of a log over time.

- `joints_figure`: joints before and after repolarization, with each entry of the audit marked.
- `speed_figure`, `motion_figure`: the tool centre point, velocities and accelerations.
- `torque_figures`: torques with their limits, their terms, and the energies, of an arm with masses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
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
NORM = (AXIS_COLOURS["norm"],)  # of what is never negative
JOINTS_SHARE = 3.4  # height of a plot of joints relative to other plots: its legend names all joints
TERMS = {  # of a torque; the largest of a slow motion is next to 0
    "gravity": AXIS_COLOURS["y"],
    "inertia": AXIS_COLOURS["z"],
    "centrifugal": AXIS_COLOURS["norm"],
    "Coriolis": AXIS_COLOURS["x"],
}
SUM_COLOUR = JOINT_COLOURS[0]  # of terms or energies: violet


def run_figures(run: Run) -> Iterator[Figure]:
    """Yield the plots of a log: joints, speed, motion, and torques if they are known."""
    yield from joints_figure(run)
    if run.timed and run.tcp is not None:
        yield speed_figure(run.name, run.t_ns, _lengths(run.tcp.velocity))
    yield from motion_figure(run)
    yield from torque_figures(run)


def times_of(run: Run) -> IntArray | None:
    """Return the times of the samples in [ns], shape (g,); None for static poses, plotted by row."""
    return run.t_ns if run.timed else None


def joints_figure(run: Run, opened: int | None = None) -> Iterator[Figure]:
    """Yield the joints as in the file and repolarized, with the audit marked; no figure for a path.

    Args:
        run: The log.
        opened: View that the viewer opens: 0 before, 1 after; None for both.
    """
    if not run.log.joints:
        return
    axis = "time" if run.timed else "the rows"
    joints = f"Joint values of {run.name} over {axis}: {', '.join(run.log.joints)}."
    panels = partial(joint_panels, run.log.joints, run.joint_units)
    after = panels("after" if run.audit else "joints", run.q, times_of(run), _marks(run))
    if not run.timed:
        caption = "A pose a row: no motion joins them."
        yield Figure("Joints", caption, joints, (View("Joints", after),), share=JOINTS_SHARE)
        return
    if not run.audit:
        caption = "No joint had to be repolarized: the values are those of the file."
        views = (View("Joints, no repolarization needed", after),)
        yield Figure("Joints", caption, f"{joints} {caption}", views, share=JOINTS_SHARE)
        return
    wraps = len(run.repolarizations)
    rest = len(run.audit) - wraps
    marked = f"{wraps} marked{f', {rest} doubtful' if rest else ''}"
    before = panels("before", run.log.q, run.log.t_ns, _raw_marks(run))
    both = View("Joints in the file", before), View(f"Joints repolarized ({marked})", after)
    count = format_count(wraps, "repolarization")
    caption = f"First as in the file, then repolarized. {count}: a triangle marks each, up where a turn was"
    caption += " added, down where one was taken away."
    caption += f" A cross marks each of {format_count(rest, 'other finding')}." if rest else ""
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
    """Return joints over time, one panel for the revolute and one for the prismatic joints.

    Args:
        names: Names of the joints.
        units: Unit of each joint, rad or m.
        title: The quantity.
        values: Values in [rad] and [m], per `per`, shape (n, joints).
        t_ns: Times in [ns], shape (n,); None: the rows are plotted as points.
        marks: Marks on the lines, with the names of the joints.
        per: "", "/s" or "/s2".
    """
    panels = []
    for unit in dict.fromkeys(units):
        indices = [j for j in range(len(units)) if units[j] == unit]
        line = Line(
            values if len(indices) == len(names) else np.asarray(values)[:, indices],
            tuple(names[j] for j in indices),
            tuple(map(joint_colour, indices)),
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
    """Yield velocities and accelerations of the joints, and the motion of the tool centre point.

    The latter is by kinematics; without a robot it is the recorded position and orientation, if any.
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
        caption += f" and its {angles} The angles continue beyond ±π, so that none jumps."
        caption += _format_singular(run.tcp)
        alt = partial(_format_extent, f"Motion of {point} of {run.name}", run.tcp)
    yield Figure(title, caption, alt, views, share=2.2)


def point_name(run: Run) -> str:
    """Return the symbol of the tool centre point in the paper: p7 of an arm with seven segments."""
    return f"p{len(run.robot.joints)}" if run.robot is not None else "p"


def coordinates(values: FloatArray) -> Line:
    """Return x, y and z in any unit, shape (n, 3), with their names and colours in all panels."""
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
    angles = Computed(len(tcp.euler_zyx), partial(_angles, tcp, tinted, continuous=run.timed))
    euler = Line(angles, tuple(EULER), tuple(EULER.values()), points=points)
    yield View("TCP rz, ry, rx", (Panel("rz, ry, rx", "rad", (euler,), t_ns, tinted=tinted),))


def _lengths(vectors: FloatArray) -> Computed:
    return Computed(len(vectors), lambda: row_norms(vectors))


def _angles(tcp: PointLog, singular: BoolArray | None, *, continuous: bool) -> FloatArray:
    """Return the Euler angles in [rad] without those of singular samples, continuous in time."""
    angles = np.asarray(tcp.euler_zyx)
    if singular is not None:
        angles = np.where(singular[:, np.newaxis], np.nan, angles)
    return unwrap_euler(angles) if continuous else angles


def _recorded(run: Run) -> Iterator[View]:
    """Yield the recorded position and orientation."""
    t_ns, points = times_of(run), not run.timed
    if run.tcp_recorded is not None:
        position = replace(coordinates(run.tcp_recorded), points=points)
        yield View("Recorded TCP", (Panel("p", "m", (position,), t_ns),))
    if (values := run.rotation_recorded) is not None:
        names = run.rotation_names  # a quaternion has no unit
        line = Line(values, names, tuple(map(joint_colour, range(len(names)))), points=points)
        unit = "" if len(names) == 4 else "rad"
        yield View("Recorded orientation", (Panel("orientation", unit, (line,), t_ns),))


def _format_singular(tcp: PointLog) -> str:
    count = format_count(int(np.count_nonzero(tcp.singular)), "sample")
    sentence = f" Tinted: {count} with ry at ±π/2, where rz and rx are not separately defined."
    return sentence if np.any(tcp.singular) else ""


def _format_extent(motion: str, tcp: PointLog) -> str:
    """Return the sentence on the extent, the speed and the acceleration of a motion."""
    if not np.isfinite(tcp.position).any():
        return f"{motion} over time by forward kinematics. It has no value."
    sentence = f"{motion} over time by forward kinematics. It stays {within_words(tcp.position)}"
    for values, word, unit in ((tcp.velocity, "speed", "m/s"), (tcp.acceleration, "acceleration", "m/s²")):
        norm = row_norms(values)
        if np.isfinite(norm).any():
            sentence += f"; its {word} reaches {np.nanmax(norm):.4f} {unit}"
    return f"{sentence}."


def _raw_marks(run: Run) -> list[Mark]:
    """Return a mark half way down each jump of the file, and on each other entry of the audit."""
    q = np.asarray(run.log.q)
    return [
        _mark(run, entry, float(q[entry.sample, j] - (entry.step / 2 if entry.kind == "wrap" else 0.0)))
        for entry in run.audit
        for j in (run.log.joints.index(entry.joint),)
    ]


def _marks(run: Run) -> list[Mark]:
    """Return a mark on the repolarized line at the time of each entry of the audit."""
    marks = []
    for name in dict.fromkeys(entry.joint for entry in run.audit):
        entries = [entry for entry in run.audit if entry.joint == name]
        t_ns = np.array([round(entry.t * 1e9) for entry in entries], dtype=np.int64)
        column = np.asarray(run.q)[:, run.log.joints.index(name)]
        rows = _neighbours(run.t_ns, column, t_ns)
        if len(rows):
            values = np.interp(t_ns, run.t_ns[rows], column[rows])
            marks += [_mark(run, *pair) for pair in zip(entries, values.tolist(), strict=True)]
    return marks


def _neighbours(times_ns: IntArray, column: FloatArray, t_ns: IntArray) -> IntArray:
    """Return the samples before and after each time; if a value is missing, all samples with a value."""
    after = np.searchsorted(times_ns, t_ns)
    rows: IntArray = np.unique(np.clip(np.concatenate((after - 1, after)), 0, len(times_ns) - 1))
    return rows if np.isfinite(column[rows]).all() else np.flatnonzero(np.isfinite(column))


def _mark(run: Run, entry: AuditEntry, value: float) -> Mark:
    is_wrap = entry.kind == "wrap"
    shape: Shape = "cross" if not is_wrap else "up" if entry.turns_after > entry.turns_before else "down"
    label = f"{'repolarization' if is_wrap else entry.kind} of {entry.joint}, row {entry.row}"
    label += f": step {entry.step:+.4f} rad, k {entry.turns_before} → {entry.turns_after}"
    colour = joint_colour(run.log.joints.index(entry.joint))
    return Mark(round(entry.t * 1e9), value, shape, colour, label, entry.joint)


def torque_figures(run: Run) -> Iterator[Figure]:
    """Yield torques, their terms and the energies; none without masses or accelerations."""
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
    source = format_acceleration_source(run.derivative, len(run.t_ns))
    caption += f"{f' {source}' if source else ''} First all joints, then each, numbered from the base."
    if not limited:
        caption += f" {PERIOD_ASSUMED}"
    elif any(math.isfinite(joint.effort) for joint in robot.moving):
        caption += " Dashed: its effort limit; blue: within it; red: beyond it."
    return Figure("Joint torques", caption, partial(_format_largest, run), tuple(views), share=2.2)


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
        " torque. A fifth term is that of a load at the tool: no load is in a log, so it is 0 and not drawn.",
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
    """Yield the torques of the revolute joints, and the forces of the prismatic joints, one panel each."""
    units = run.torque_units
    for unit in dict.fromkeys(units):
        indices = [j for j in range(len(units)) if units[j] == unit]
        values = tau if len(indices) == len(units) else np.asarray(tau)[:, indices]
        names, colours = [run.log.joints[j] for j in indices], [joint_colour(j) for j in indices]
        line = Line(values, tuple(names), tuple(colours))
        yield Panel(_symbol(unit), unit, (line,), run.t_ns, share=2.0)


def _symbol(unit: str, number: str = "") -> str:
    """Return the symbol of a torque in [N.m] or a force in [N] of a joint: τ2, F3."""
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


def _format_largest(run: Run) -> str:
    """Return the sentences on the largest torque of each joint, and its share of the limit."""
    largest = []
    for summary in run.torque_summaries():
        share = summary.effort_share
        limit = "" if share is None else f" ({text.format_percent(share)} of its limit)"
        largest.append(f"{summary.joint} {summary.max:.4g} {summary.unit}{limit}")
    return f"Torques of the joints of {run.name} over time. The largest: {', '.join(largest)}."
