"""Mobility: how many ways a network moves, which constraints are redundant, and whether only here."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from urmpipe_models.arrays import FloatArray, IndexArray
from urmpipe_models.networks.closure import released, scaled_closure
from urmpipe_models.networks.descent import descend
from urmpipe_models.networks.findings import Mobility, Redundant
from urmpipe_models.networks.idle_spins import spinning_parts
from urmpipe_models.networks.mechanism import Mechanism

RANK = 1e-7
"""Singular values below this part of the largest count as 0: a configuration closes to about 1e-13, one at
which the rank falls to the root of that."""

NEARBY = 1e-2
"""How far configurations nearby are, in lengths of the mechanism and [rad]."""

PROBES = 8
"""How many of them are looked at."""

MOVED = 0.3
"""Share of `NEARBY` that a configuration nearby must be away: of a structure that only seems to move each
comes back."""

ALIKE = 0.999
"""Redundant constraints that raise the rank this much as clearly as the clearest are equal."""


def mobility_at(mechanism: Mechanism, x: FloatArray, columns: IndexArray) -> int:
    """Return how many of some variables are left over by the rank of the Jacobian.

    Args:
        mechanism: The network.
        x: The variables, shape (variables,), in [m], [rad] and as controls are given.
        columns: The numbers of those that may change, shape (k,) [-].
    """
    return len(columns) - _rank(scaled_closure(mechanism, x[:, np.newaxis]).jacobian[:, columns, 0])


def mobility_of(mechanism: Mechanism, x: FloatArray) -> Mobility:
    """Return how an assembled network moves; controls are variables.

    Args:
        mechanism: The network.
        x: The variables of an assembly, shape (variables,), in [m], [rad] and as controls are given.
    """
    variables = len(mechanism.variables)
    jacobian = scaled_closure(mechanism, x[:, np.newaxis]).jacobian[:, :, 0]
    rank = _rank(jacobian)
    return Mobility(
        variables,
        rank,
        variables - mechanism.rows,
        tuple(_redundant(mechanism, x, jacobian, mechanism.rows - rank)),
        spinning_parts(mechanism, x),
        mobility_nearby(mechanism, x, np.arange(variables)),
    )


def stuck_controls(mechanism: Mechanism, x: FloatArray) -> tuple[str, ...]:
    """Return the controls that cannot be moved at an assembly, each with those before it held.

    Args:
        mechanism: The network.
        x: The variables of an assembly, shape (variables,), in [m], [rad] and as controls are given.
    """
    ways = _null_space(scaled_closure(mechanism, x[:, np.newaxis]).jacobian[:, :, 0])[mechanism.controls]
    stuck = []
    for k, row in enumerate(mechanism.controls):
        if _rank(ways[: k + 1], least=RANK) == _rank(ways[:k], least=RANK):
            stuck.append(mechanism.variables[row].owner)
    return tuple(stuck)


def _rank(jacobian: FloatArray, least: float = 0.0) -> int:
    """Return the rank of a scaled Jacobian; singular values of `least` or less count as 0, too."""
    if not (jacobian.size and np.isfinite(jacobian).all()):
        return 0
    values = np.linalg.svd(jacobian, compute_uv=False)
    return int((values > max(RANK * values[0], least)).sum()) if values[0] > 0.0 else 0


def _null_space(jacobian: FloatArray) -> FloatArray:
    """Return an orthonormal basis of what a scaled Jacobian [-] maps to 0, shape (variables, mobility)."""
    if not len(jacobian):
        return np.eye(jacobian.shape[1])
    return np.asarray(np.linalg.svd(jacobian)[2][_rank(jacobian) :].T)


def mobility_nearby(mechanism: Mechanism, x: FloatArray, columns: IndexArray) -> int:
    """Return the mobility at assembled configurations near one; 0 if there are none.

    They are looked for along ways in which the Jacobian lets it move: without one it only seems to move.

    Args:
        mechanism: The network.
        x: The variables of an assembly, shape (variables,), in [m], [rad] and as controls are given.
        columns: The numbers of those that may change, shape (k,) [-].
    """
    ways = _null_space(scaled_closure(mechanism, x[:, np.newaxis]).jacobian[:, columns, 0])
    if not ways.size:
        return 0
    steps = np.random.default_rng(0).normal(size=(ways.shape[1], PROBES))
    scales = mechanism.column_scales[columns, np.newaxis]
    starts = np.repeat(x[:, np.newaxis], PROBES, axis=1)
    starts[columns] += scales * NEARBY * (ways @ (steps / np.linalg.norm(steps, axis=0)))
    near = descend(mechanism, starts, columns)
    away = np.linalg.norm((near.x[columns] - x[columns, np.newaxis]) / scales, axis=0)
    there = np.flatnonzero((away > MOVED * NEARBY) & (near.gap < RANK))
    ranks = [
        _rank(one)
        for one in scaled_closure(mechanism, near.x[:, there]).jacobian[:, columns].transpose(2, 0, 1)
    ]
    return min((len(columns) - rank for rank in ranks), default=0)


def _redundant(mechanism: Mechanism, x: FloatArray, jacobian: FloatArray, count: int) -> Iterator[Redundant]:
    """Yield redundant constraints, `count` of them: set free one after the other, each raises the rank.

    The one is taken that does so most clearly; of equal ones the last in the file.
    """
    if count <= 0:
        return
    unreached = np.linalg.svd(jacobian)[0][:, mechanism.rows - count :]
    constraints = list(released(mechanism, x))
    reach = np.array([column @ unreached for _, _, column in constraints])
    for _ in range(count):
        size = np.linalg.norm(reach, axis=1)
        best = int(np.flatnonzero(size >= ALIKE * size.max())[-1])
        yield Redundant(*constraints[best][:2])
        along = reach[best] / size[best]
        reach = reach - np.outer(reach @ along, along)
