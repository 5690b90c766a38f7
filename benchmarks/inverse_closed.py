"""Closed-form inverse kinematics of arm6: many poses at once, pose by pose, a plain script, and EAIK.

python benchmarks/inverse_closed.py [--poses N] [--rounds N]
"""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Callable
from typing import Any

import numpy as np
from eaik.IK_HP import HPRobot
from numpy.typing import NDArray
from pairs import Bound, machine, timed, write_results

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.closed import ClosedForm, closed_form
from urmpipe_models.ik.solutions import Targets, forward_targets
from urmpipe_models.ik.solve import solve
from urmpipe_models.kinematics.forward import chain_to_screws
from urmpipe_models.robots.catalogue import load_robot

ALONE = 500
"""Poses that the slow jobs solve in a round; their time is scaled to all."""

TRIES = 3

D1, A1, D2, A2, A4, D5, D6 = 0.047, 0.030, 0.045, 0.120, 0.020, 0.130, 0.029
"""Lengths of arm6 in [m]. Source: [Serial6dof2019]_ Table 3.1."""


def link(alpha: float, a: float, d: float, theta: float) -> FloatArray:
    """Return a link's matrix. Source: [Serial6dof2019]_ eq. 3.1."""
    ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
    return np.array(
        [
            [ct, -st, 0.0, a],
            [st * ca, ct * ca, -sa, -sa * d],
            [st * sa, ct * sa, ca, ca * d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def plain(position: FloatArray, rotation: FloatArray) -> FloatArray:
    """Return the eight solutions of one pose, shape (8, 6), by the steps of the paper, as a script has them.

    Source: [Serial6dof2019]_ section 4.
    """
    solutions = np.full((8, 6), np.nan)
    wrist = position - rotation @ np.array([0.0, 0.0, D6])
    first = np.arctan2(wrist[1], wrist[0])
    fore, phi = np.hypot(A4, D5), np.arctan2(D5, A4)
    row = 0
    for theta1 in (first, first + np.pi):
        x = np.cos(theta1) * wrist[0] + np.sin(theta1) * wrist[1] + A1
        z = wrist[2] - D1 - D2
        cosine = (x**2 + z**2 - A2**2 - fore**2) / (2.0 * A2 * fore)
        for bend in (np.arccos(cosine), -np.arccos(cosine)) if abs(cosine) <= 1.0 else ():
            theta3 = bend - phi - np.pi / 2
            theta2 = np.arctan2(z, x) - np.arctan2(fore * np.sin(bend), A2 + fore * np.cos(bend))
            upper = (
                link(0.0, 0.0, D1, theta1)
                @ link(0.0, -A1, D2, 0.0)
                @ link(np.pi / 2, 0.0, 0.0, theta2)
                @ link(0.0, A2, 0.0, np.pi / 2 + theta3)
            )
            rest = upper[:3, :3].T @ rotation
            five = np.arccos(np.clip(rest[1, 2], -1.0, 1.0))
            for theta5 in (five, -five):
                sign = np.sign(theta5)
                theta4 = np.arctan2(sign * rest[2, 2], -sign * rest[0, 2])
                theta6 = np.arctan2(-sign * rest[1, 1], sign * rest[1, 0])
                solutions[row] = theta1, theta2, theta3, theta4, theta5, theta6
                row += 1
    return solutions


def peer(chain: Chain, targets: Targets) -> tuple[HPRobot, FloatArray]:
    """Return EAIK's model of a chain, and the poses that it is asked for, shape (n, 4, 4)."""
    of_chain = chain_to_screws(chain)
    assert of_chain is not None and targets.rotation is not None
    offsets = np.diff(np.vstack((np.zeros(3), of_chain.point, of_chain.position)), axis=0)
    poses = np.tile(np.eye(4), (len(targets), 1, 1))
    poses[:, :3, :3] = targets.rotation @ of_chain.rotation.T
    poses[:, :3, 3] = targets.position
    return HPRobot(of_chain.direction, offsets), poses


def sorted_by_value(solutions: FloatArray) -> FloatArray:
    """Return solutions, shape (k, 6), within a turn, in an order that does not depend on who found them."""
    within: FloatArray = np.remainder(solutions[np.isfinite(solutions).all(axis=1)] + 1e-7, 2.0 * np.pi)
    found = within.round(6)
    return found[np.lexsort(found.T[::-1])]


def disagreements(targets: Targets, form: ClosedForm, robot: HPRobot, poses: FloatArray) -> dict[str, int]:
    """Return on how many poses each peer finds other solutions than urmpipe, in number or by 1e-5 rad."""
    mine = form.solve(targets).q
    assert targets.rotation is not None
    rotation = targets.rotation
    others: dict[str, Callable[[int], FloatArray]] = {
        "the plain script": lambda i: plain(targets.position[i], rotation[i]),
        "EAIK": lambda i: exact(robot.IK(poses[i])),
    }
    return {
        name: sum(not same(sorted_by_value(mine[i]), sorted_by_value(other(i))) for i in range(len(mine)))
        for name, other in others.items()
    }


def exact(found: Any) -> FloatArray:
    """Return EAIK's solutions without its least-squares ones, shape (k, 6)."""
    q: FloatArray = np.array(found.Q, dtype=np.float64).reshape(-1, 6)
    least_squares: NDArray[np.bool_] = np.array(found.is_LS, dtype=np.bool_)
    return q[~least_squares]


def same(one: FloatArray, other: FloatArray) -> bool:
    """Tell whether two sets of solutions are one."""
    return one.shape == other.shape and bool(np.abs(one - other).max(initial=0.0) < 1e-5)


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=10_000)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    chain = load_robot("arm6")
    form = closed_form(chain)
    assert form is not None
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (options.poses, 6))
    targets = forward_targets(chain, q)
    rotation = targets.rotation
    assert rotation is not None
    robot, poses = peer(chain, targets)
    few = range(min(ALONE, options.poses))
    single = [targets.rows(slice(i, i + 1)) for i in few]

    jobs: dict[str, tuple[int, Callable[[], object]]] = {
        "urmpipe, all poses at once": (options.poses, lambda: form.solve(targets)),
        "urmpipe `solve`: checks, limits, the nearest of all": (options.poses, lambda: solve(chain, targets)),
        "urmpipe, pose by pose": (len(few), lambda: [form.solve(one) for one in single]),
        "plain NumPy script, pose by pose": (
            len(few),
            lambda: [plain(targets.position[i], rotation[i]) for i in few],
        ),
        "EAIK (C++), pose by pose": (options.poses, lambda: [robot.IK(one) for one in poses]),
        "EAIK (C++), batched, 2 threads": (options.poses, lambda: robot.IK_batched(poses, 2)),
    }
    taken: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(options.rounds):
        for name, (count, job) in jobs.items():
            taken[name].append(min(timed(job) for _ in range(TRIES)) / count)
    base = taken["urmpipe, all poses at once"]
    differ = disagreements(targets.rows(slice(0, len(few))), form, robot, poses)
    lines = [
        f"# Closed-form inverse kinematics of {options.poses} arm6 poses: {options.rounds} rounds in turn",
        "",
        *machine("eaik"),
        f"All eight solutions of each pose. Of each job the shortest of {TRIES} runs in a row counts in a",
        f"round; jobs pose by pose in Python solve {len(few)} of the poses. The plain script takes the steps",
        "of the 2019 paper with 4 x 4 matrices, and leaves out singular poses, reasons and labels. EAIK",
        "hands out a Python object a pose.",
        "",
        *(f"Of {len(few)} poses {name} has other solutions on {count}." for name, count in differ.items()),
        "",
        "| job | us a pose, median (min-max) | thousand poses a second | times at once, median of pairs |",
        "|---|---|---|---|",
    ]
    ratios: dict[str, float] = {}
    for name, seconds in taken.items():
        ratios[name] = statistics.median(a / b for a, b in zip(seconds, base, strict=True))
        middle, least, most = (1e6 * one for one in (statistics.median(seconds), min(seconds), max(seconds)))
        lines.append(
            f"| {name} | {middle:.2f} ({least:.2f}-{most:.2f}) | {1e3 / middle:.1f} | {ratios[name]:.2f} |"
        )
    held = ("urmpipe, pose by pose", "plain NumPy script, pose by pose")
    write_results(
        "inverse_closed", lines, [Bound(f"{one} / at once", ratios[one], least=20.0) for one in held]
    )


main()
