"""Joints that a singular pose leaves free: another choice where limits refuse the one that was made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, IndexArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.inverse.closed.trigonometric import wrapped
from urmpipe_models.inverse.iterative.refine import refine
from urmpipe_models.inverse.limits import nearest_to_limits, within_limits
from urmpipe_models.inverse.solutions import Singular, Solutions
from urmpipe_models.inverse.targets import Targets

ELSEWHERE = ", or what the limits of the joints allow"
"""What is added to the choice that `Singular.chosen` tells."""

SAME = 1e-4
"""What is found within this of another branch, in [rad] or [m] of every joint, is that branch."""


def within_limits_by_choice(
    chain: Chain, targets: Targets, solutions: Solutions, near: FloatArray
) -> Solutions:
    """Return solutions within limits, see `within_limits`, free joints chosen so that limits allow them.

    Where a pose leaves joints free, a branch is a whole family of solutions, and a closed form returns one
    of it. If limits refuse that one, another is searched for from the limits that it is beyond.

    Args:
        chain: The arm.
        targets: n of them.
        solutions: Of a closed form, limits not asked.
        near: Joint values in [rad] or [m], shape (n, joints).
    """
    found = within_limits(chain, solutions, near)
    free = np.any([one.where for one in solutions.singular if one.free], axis=0)
    refused = solutions.reached & ~found.reached & free
    if not refused.any():
        return found
    row, column = np.nonzero(refused)
    refined = refine(chain, targets.rows(row), nearest_to_limits(chain, solutions.q[row, column]))
    new = refined.converged & ~_another(refined.q, found, row)
    row, column = row[new], column[new]
    q = solutions.q.copy()
    q[row, column] = refined.q[new]
    singular = tuple(_told(one, row, column) for one in solutions.singular)
    return within_limits(chain, replace(solutions, q=q, singular=singular), near)


def _another(q: FloatArray, found: Solutions, row: IndexArray) -> BoolArray:
    """Return which joint values, shape (m, joints), are those of another branch of their targets."""
    away = np.abs(wrapped(q[:, None] - found.q[row])).max(axis=2)
    return np.asarray((away < SAME).any(axis=1))


def _told(family: Singular, row: IndexArray, column: IndexArray) -> Singular:
    """Return a family whose text says, if some of its solutions were chosen by limits, that they were."""
    if not (family.free and family.where[row, column].any()):
        return family
    return replace(family, chosen=family.chosen + ELSEWHERE)
