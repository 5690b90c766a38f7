"""Planned paths: the law of the joints' limits beside TOPP-RA, and whole commands.

python benchmarks/planning.py [--rounds N]

TOPP-RA is given the joint values that urmpipe found, at the same places: its time is that of its passes
alone, urmpipe's that of both passes with what makes the bounds. Both are run in turn in one process.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from pairs import Bound, machine, rounds, timed, write_results
from toppra.algorithm import TOPPRA
from toppra.constraint import DiscretizationType, JointAccelerationConstraint, JointVelocityConstraint

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.planning.from_rows import rows_to_path
from urmpipe_models.planning.joints import JointLimits, PathJoints, joints_along, time_optimal_law
from urmpipe_models.planning.path import cube_rows
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.toml import robot_toml

VELOCITY, ACCELERATION = 2.0, 5.0
"""The largest rates [rad/s] and accelerations [rad/s2] of every joint."""

DOWN = np.diag([1.0, -1.0, -1.0])
CUBE = "cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1"


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """Joint values at places as a path of TOPP-RA."""

    joints: PathJoints
    waypoints: None = None

    @property
    def path_interval(self) -> FloatArray:
        """Where the path begins and ends in [m], shape (2,)."""
        return self.joints.s[[0, -1]]

    @property
    def dof(self) -> int:
        """How many joints there are."""
        return len(self.joints.chain.coordinates)

    def __call__(self, places: FloatArray, order: int = 0) -> FloatArray:
        """Return values, slopes or curvatures at places of the grid, shape (n, joints)."""
        after, before = self.joints.after, self.joints.before
        ahead, ends = ((one.q, one.dq, one.ddq)[order] for one in (after, before))
        values = np.vstack((ahead, ends[-1:]))
        return np.asarray(values[np.searchsorted(self.joints.s, np.clip(places, 0.0, self.joints.s[-1]))])


def jobs() -> dict[str, PathJoints]:
    """Return the joints of two arms along a wall: poses by a closed form, positions by least motion."""
    small = cube_rows("wall", 0.3, 0.03, np.array([0.45, 0.0, 0.3]), rotation=DOWN)
    high = cube_rows("wall", 0.3, 0.03, np.array([0.45, 0.0, 0.9]))
    rows = {"ur5e": small, "urm6": high}
    return {name: joints_along(load_robot(name), rows_to_path(rows[name])) for name in rows}


def by_toppra(joints: PathJoints) -> float:
    """Return the duration in [s] that TOPP-RA finds, by collocation: it knows one curvature at a place."""
    path, both = Sampled(joints), np.ones((len(joints.chain.coordinates), 2)) * [-1.0, 1.0]
    scheme = DiscretizationType.Collocation
    limits = [
        JointVelocityConstraint(VELOCITY * both),
        JointAccelerationConstraint(ACCELERATION * both, discretization_scheme=scheme),
    ]
    instance = TOPPRA(limits, path, gridpoints=joints.s, parametrizer="ParametrizeConstAccel")
    _, speeds, _ = instance.compute_parameterization(0.0, 0.0)
    return float((2.0 * np.diff(joints.s) / (speeds[1:] + speeds[:-1])).sum())


def by_urmpipe(joints: PathJoints) -> float:
    """Return the duration in [s] that urmpipe finds."""
    count = len(joints.chain.coordinates)
    limits = JointLimits(np.full(count, VELOCITY), np.full(count, ACCELERATION))
    stop = np.isin(joints.s, joints.s[[0, -1]])
    return time_optimal_law(joints.s, joints.after, joints.before, stop, limits).duration


def median_of(taken: list[float]) -> str:
    """Return the median and the span of times in [s]."""
    return f"{statistics.median(taken):.3f} ({min(taken):.3f}-{max(taken):.3f})"


def laws(count: int) -> tuple[list[str], list[Bound]]:
    """Return the table of both laws, and what is held."""
    lines = [
        "| path | places | duration s, urmpipe | duration s, TOPP-RA | ratio | urmpipe s, median (min-max)"
        " | TOPP-RA s, median (min-max) |",
        "|---|---|---|---|---|---|---|",
    ]
    bounds = []
    for name, joints in jobs().items():
        ways = (partial(by_urmpipe, joints), partial(by_toppra, joints))
        own, theirs = (way() for way in ways)
        taken = [[timed(way) for way in ways] for _ in range(count)]
        mine, others = (list(times) for times in zip(*taken, strict=True))
        lines.append(
            f"| {name} | {len(joints.s)} | {own:.5f} | {theirs:.5f} | {own / theirs:.4f}"
            f" | {median_of(mine)} | {median_of(others)} |"
        )
        bounds.append(Bound(f"{name}: duration over that of TOPP-RA", own / theirs, least=0.999, most=1.01))
    return lines, bounds


def commands(count: int) -> tuple[list[str], list[Bound]]:
    """Return the table of whole commands, and what is held."""
    python, lines = [sys.executable, "-m", "urmpipe"], []
    with tempfile.TemporaryDirectory() as folder:
        ours, arm = Path(folder), load_robot("ur5e")
        limited = replace(arm, joints=tuple(replace(one, acceleration=ACCELERATION) for one in arm.joints))
        (ours / "arm.toml").write_text(robot_toml(limited), encoding="utf-8")
        near = "cube:wall,a=0.3,r=0.03,x=0.45,y=0,z=0.3,rz=0,ry=180deg,rx=0"
        told = {
            "contour for irb60, CSV": [CUBE, "--robot", "irb60", "-o", f"{ours}/plan.csv"],
            "contour for irb60, recording": [CUBE, "--robot", "irb60", "-o", f"{ours}/plan.rrd"],
            "contour without a robot": [CUBE, "-o", f"{ours}/path.csv"],
            "law of limits, ur5e": [near, "--robot", f"{ours}/arm.toml", "--law", "limits"],
            "law of jerk, ur5e": [near, "--robot", "ur5e", "--law", "jerk", "--jerk", "60"],
        }
        taken = rounds({name: [*python, "plan", *given] for name, given in told.items()}, count)
    lines = ["| command | wall s, median (min-max) | CPU s | MB |", "|---|---|---|---|"]
    for name, usages in taken.items():
        cpu, rss = (statistics.median(getattr(one, key) for one in usages) for key in ("cpu", "rss"))
        lines.append(f"| {name} | {median_of([one.wall for one in usages])} | {cpu:.2f} | {rss:.0f} |")
    wall = statistics.median(one.wall for one in taken["contour for irb60, CSV"])
    return lines, [Bound("contour for irb60, whole command: s", wall, under=2.0)]


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    of_laws, of_commands = laws(options.rounds), commands(options.rounds)
    lines = [
        f"# Planned paths: {options.rounds} rounds in turn",
        "",
        *machine("toppra", "ruckig"),
        "The wall of a cube of 0.3 m with arcs of 0.03 m; every joint up to"
        f" {VELOCITY:g} rad/s and {ACCELERATION:g} rad/s2. Both laws get the same joint values at the same"
        " places.",
        "",
        *of_laws[0],
        "",
        *of_commands[0],
    ]
    write_results("planning", lines, [*of_laws[1], *of_commands[1]])


main()
