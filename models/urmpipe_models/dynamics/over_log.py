"""Torques, their terms, energies and mass centres over the rows of a log."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.dynamics.energy import kinetic_energy, potential_energy
from urmpipe_models.dynamics.inverse import inverse_dynamics
from urmpipe_models.dynamics.mass_centres import mass_centres
from urmpipe_models.dynamics.terms import TorqueTerms, torque_terms
from urmpipe_models.elementwise import Element
from urmpipe_models.row_blocks import THREADS, row_blocks, side_by_side


def torque_over_log(
    chain: Chain, q: FloatArray, qd: FloatArray, qdd: FloatArray, threads: int = THREADS
) -> FloatArray:
    """Return the torques of the joints over a log, in [N.m] or [N], shape (n, joints).

    Args:
        chain: The arm, with masses.
        q: Joint values in [rad] or [m], shape (n, joints).
        qd: Their rates in [rad/s] or [m/s], shape (n, joints).
        qdd: Their second derivatives in [rad/s2] or [m/s2], shape (n, joints).
        threads: Blocks of rows worked on at a time.

    Raises:
        RobotError: If the arm has no masses.
    """
    return _over(
        lambda *columns: inverse_dynamics(chain, *columns), q.shape[1], q, qd, qdd, threads=threads
    ).T


def terms_over_log(chain: Chain, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> dict[str, FloatArray]:
    """Return the terms of `torque_over_log` by name (see `TorqueTerms`), in [N.m] or [N].

    Args:
        chain: The arm, with masses.
        q: Joint values in [rad] or [m], shape (n, joints).
        qd: Their rates in [rad/s] or [m/s], shape (n, joints).
        qdd: Their second derivatives in [rad/s2] or [m/s2], shape (n, joints).

    Returns:
        inertia, centrifugal, coriolis, gravity and tool, in [N.m] or [N], shape (n, joints) each.
    """
    names, joints = TorqueTerms._fields, q.shape[1]
    flat = _over(
        lambda *columns: [one for term in torque_terms(chain, *columns) for one in term],
        len(names) * joints, q, qd, qdd,
    )  # fmt: skip
    return {name: flat[k * joints : (k + 1) * joints].T for k, name in enumerate(names)}


def energies_over_log(chain: Chain, q: FloatArray, qd: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the kinetic and the potential energy of an arm over a log, in [J], shape (n,) each.

    Args:
        chain: The arm, with masses.
        q: Joint values in [rad] or [m], shape (n, joints).
        qd: Their rates in [rad/s] or [m/s], shape (n, joints).
    """
    kinetic, potential = _over(
        lambda q, qd: [kinetic_energy(chain, q, qd), potential_energy(chain, q)], 2, q, qd
    )
    return kinetic, potential


def mass_centres_over_log(chain: Chain, q: FloatArray) -> FloatArray:
    """Return the mass centres of an arm in the world over a log, in [m], shape (n, inertials, 3).

    Args:
        chain: The arm, with masses.
        q: Joint values in [rad] or [m], shape (n, joints).
    """
    count = len(chain.inertials)
    flat = _over(lambda q: [one for centre in mass_centres(chain, q) for one in centre], 3 * count, q)
    return flat.T.reshape(len(q), count, 3)


def _over(
    work: Callable[..., Sequence[Element]], count: int, *rows: FloatArray, threads: int = THREADS
) -> FloatArray:
    """Return what work makes of the columns of some arrays of shape (n, joints), shape (count, n)."""
    found = np.empty((count, len(rows[0])))

    def fill(block: slice) -> None:
        """Fill the rows of a block."""
        columns = [list(np.ascontiguousarray(one[block].T, dtype=np.float64)) for one in rows]
        for k, element in enumerate(work(*columns)):
            found[k, block] = element

    side_by_side(fill, row_blocks(len(rows[0])), threads)
    return found
