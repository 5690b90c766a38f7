"""Forward dynamics: the motion that torques make."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.dynamics.inverse import needed_torques, posed_links
from urmpipe_models.dynamics.links import Links
from urmpipe_models.dynamics.mass_matrix import coordinate_sizes, mass_matrix, posed_matrix
from urmpipe_models.dynamics.wrench import Wrench
from urmpipe_models.elementwise import Element, minus, times
from urmpipe_models.errors import RobotError

POSES = 3
"""A pivot of M that is 0 in so many poses at random is 0 in all."""

NO_MASS = 1e-12
"""A pivot of M below this share of what the masses beyond could make it is 0 but for rounding."""


def forward_dynamics(
    chain: Chain,
    q: Sequence[Element],
    qd: Sequence[Element],
    tau: Sequence[Element],
    wrench: Wrench | None = None,
    arm: Links | None = None,
) -> list[Element]:
    """Return q'' = M^-1 (tau - tau_0), tau_0 being what the motion needs without q''.

    Args:
        chain: The arm; each joint moves a mass (see `check_motion`).
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].
        tau: Torques of the joints in [N.m], forces of those that slide in [N].
        wrench: What acts on the tool centre point from outside.
        arm: Its moving parts, where they are known.

    Returns:
        One element per coordinate, in [rad/s2] or [m/s2].

    Raises:
        RobotError: If the arm has no masses.

    Source: [Iso9283]_ eq. 19, solved for the accelerations.
    """
    posed = posed_links(chain, q, arm)
    needed = needed_torques(posed, qd, [0.0] * len(q), wrench)
    left = [minus(given, other) for given, other in zip(tau, needed, strict=True)]
    return solved(posed_matrix(posed), left)


def solved(matrix: Sequence[Sequence[Element]], right: Sequence[Element]) -> list[Element]:
    """Return x of M x = b for a symmetric positive definite M, by M = L D L^T, elementwise.

    Args:
        matrix: The rows of M, in any units.
        right: b.
    """
    lower, pivots = factors(matrix)
    x: list[Element] = list(right)
    for i in range(len(x)):
        for k in range(i):
            x[i] = minus(x[i], times(lower[i][k], x[k]))
    x = [value / pivot for value, pivot in zip(x, pivots, strict=True)]
    for i in reversed(range(len(x))):
        for k in range(i + 1, len(x)):
            x[i] = minus(x[i], times(lower[k][i], x[k]))
    return x


def factors(matrix: Sequence[Sequence[Element]]) -> tuple[list[list[Element]], list[Element]]:
    """Return L below its diagonal of ones, and the pivots D, of a symmetric M = L D L^T."""
    lower: list[list[Element]] = []
    pivots: list[Element] = []
    for i, given in enumerate(matrix):
        row: list[Element] = []  # of L D, then of L
        for j in range(i):
            value = given[j]
            for k in range(j):
                value = minus(value, times(row[k], lower[j][k]))
            row.append(value)
        pivot = given[i]
        for j in range(i):
            scaled, row[j] = row[j], row[j] / pivots[j]
            pivot = minus(pivot, times(scaled, row[j]))
        lower.append(row)
        pivots.append(pivot)
    return lower, pivots


def check_motion(chain: Chain) -> None:
    """Refuse an arm whose motion cannot be solved: no inertia resists a joint's own motion.

    Raises:
        RobotError: If the arm has no masses, or with the name of every joint whose pivot of M is 0 in poses
            at random, or else at the start pose.
    """
    poses = np.random.default_rng(0).uniform(-1.0, 1.0, (len(chain.coordinates), POSES))
    start = np.array(chain.start, dtype=np.float64)[:, np.newaxis]
    for where, some in (("", poses), ("at its start pose ", start)):
        faults = [
            f"robot {chain.name}: joint {name}: {where}no inertia resists its own motion, so that it cannot"
            " be solved; allowed: an inertial that only this joint moves"
            for name in _without_inertia(chain, list(some))
        ]
        if faults:
            raise RobotError(*faults)


def _without_inertia(chain: Chain, q: Sequence[FloatArray]) -> Iterator[str]:
    """Yield the coordinates whose motion needs nothing, whatever the joints before do; those are left out.

    A pivot counts as 0 below NO_MASS of what the masses would have about the common origin.

    Args:
        chain: The arm, with masses.
        q: Some poses in [rad] or [m], an array a coordinate.
    """
    count = len(q[0])
    matrix = [[np.broadcast_to(entry, count) for entry in row] for row in mass_matrix(chain, q)]
    sizes = coordinate_sizes(chain, q)
    kept: list[int] = []
    for i, name in enumerate(chain.coordinates):
        own = [*kept, i]
        *_, pivot = factors([[matrix[row][column] for column in own] for row in own])[1]
        if np.max(pivot - NO_MASS * sizes[i]) <= 0.0:
            yield name
        else:
            kept.append(i)
