"""The plots of a log of an arm with masses: torques and their limits, their terms, the energies."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import cache, partial

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics.equations import energies_over_log, torque_terms_over_log
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline import text
from urmpipe_pipeline.presentation.figure import Computed, Figure, Line, Panel, View
from urmpipe_pipeline.presentation.palette import AXIS_COLOURS, JOINT_COLOURS, joint_colour
from urmpipe_pipeline.runs.derivatives import acceleration_words
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.runs.torques import PERIOD_ASSUMED

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
    made = acceleration_words(run.derivative, len(run.t_ns))
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
