"""The inverse of arms that all but have a closed form: rounded in their files, or measured as built.

The nearest arm that has one (`idealised`) is solved by it, and each of its solutions is the start of a few
steps of Levenberg and Marquardt on the arm itself. What is returned is good to what any solution is, as the
arm itself is asked; only what lies at the edge of its reach, or beside a singular pose, may be lost, as the
branches of both arms end in different places there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, IndexArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.inverse.closed.idealised import with_parallel_axes, with_spherical_wrist
from urmpipe_models.inverse.closed.parallel_axes import ParallelAxes, parallel_axes
from urmpipe_models.inverse.closed.spherical_wrist import SphericalWrist, spherical_wrist
from urmpipe_models.inverse.closed.trigonometric import wrapped
from urmpipe_models.inverse.iterative.refine import refine
from urmpipe_models.inverse.solutions import Solutions
from urmpipe_models.inverse.targets import Targets, misses, targets_of
from urmpipe_models.kinematics.screws import Screws, chain_of
from urmpipe_models.transform import rotation_about

MET = 1e-11
"""Steps end here, in [m] and [rad]: a tenth of what a closed form keeps."""

STEPS = 24
"""Two or three are enough where the pose is not nearly singular."""

NUDGE = 2.0
"""Targets on the edge of the idealised arm's reach are moved by so many times what the two arms are apart."""

BLOCK = 4096
"""Targets that are worked on at once."""

FEW = 8
"""Steps that joint values wished for may take: what is farther away is not near."""

SAME = 1e-6
"""Solutions that differ by less than this in every joint, in [rad] or [m], are one."""

LOST = (
    "this branch of the arm with its axes made exact leads to no solution of the arm itself,"
    " as on the edge of its reach or beside a singular pose, allowed: one nearest to it"
)
"""Why a branch is lost that the idealised arm has."""


@dataclass(frozen=True, slots=True, eq=False)
class NearlyClosedForm:
    """A closed form, see `ClosedForm`, of an arm that has it but for small deviations.

    Branches and singular families are those of the idealised arm, and so are the reasons why a branch does
    not reach a target.

    Attributes:
        chain: The arm, without limits of its joints.
        form: Of the idealised arm.
        deviation: How far the two arms are apart at most, in [m] and in [rad].
    """

    chain: Chain
    form: SphericalWrist | ParallelAxes
    deviation: tuple[float, float]

    @property
    def name(self) -> str:
        """What makes it possible, "spherical wrist, nearly" or "three parallel axes, nearly"."""
        return f"{self.form.name}, nearly"

    @property
    def branches(self) -> tuple[str, ...]:
        """What its solutions are called, in their order: as those of the idealised arm."""
        return self.form.branches

    def solve(self, targets: Targets, near: FloatArray | None = None) -> Solutions:
        """Return the solutions of every target that those of the idealised arm lead to.

        A solution belongs to a branch if it is nearer to what the idealised arm has there than to what that
        has in any other, and if no other branch has it. Where the idealised arm does not reach a target it
        is asked for poses beside it. A branch that leads to no solution of its own is NaN, with a reason.

        Args:
            targets: Poses.
            near: Joint values in [rad] or [m], shape (joints,) or (n, joints), taken where the idealised
                arm leaves a joint free, and where the arm has a solution nearer to them than all others.
        """
        count = len(targets)
        wish = None if near is None else np.broadcast_to(near, (count, len(self.chain.coordinates)))
        ideal = self.form.solve(targets, wish)
        q = np.full_like(ideal.q, np.nan)
        for i in range(0, count, BLOCK):
            rows = np.arange(i, min(i + BLOCK, count))
            self._find(q, rows, targets.rows(rows), [ideal.q[rows]])
            rows = rows[np.isnan(q[rows, :, 0]).any(axis=1)]
            beside = list(self._nudged(targets.rows(rows)))
            starts = [self.form.solve(one, None if wish is None else wish[rows]).q for one in beside]
            self._find(q, rows, targets.rows(rows), starts)
            if wish is not None:
                begun = ideal.q[i : i + BLOCK].copy()
                for one in starts:
                    begun[rows - i] = np.where(np.isnan(begun[rows - i]), one, begun[rows - i])
                near_any = np.flatnonzero(np.isfinite(begun).any(axis=(1, 2)))
                rows = i + near_any
                self._find_near(q, rows, targets.rows(rows), begun[near_any], wish[rows])
        own = np.isfinite(q[:, :, 0])
        reasons = np.where(own, "", np.where(ideal.reached, LOST, ideal.reasons))
        singular = (replace(one, where=one.where & own) for one in ideal.singular)
        kept = tuple(one for one in singular if one.where.any())
        return replace(ideal, q=q + 0.0, reasons=reasons, singular=kept)  # no -0.0

    def _nudged(self, targets: Targets) -> Iterator[Targets]:
        """Yield targets moved and turned by what the two arms are apart: one of them is in reach of both."""
        assert targets.rotation is not None
        metres, radians = NUDGE * self.deviation[0], NUDGE * self.deviation[1]
        for axis in (*np.eye(3), *-np.eye(3)):
            yield Targets(targets.position + metres * axis, targets.rotation)
            turn = np.array(rotation_about(axis.tolist(), radians).rotation, dtype=float)
            yield Targets(targets.position, turn @ targets.rotation)

    def _find(self, q: FloatArray, rows: IndexArray, targets: Targets, starts: list[FloatArray]) -> None:
        """Write the solutions that starts lead to where there is none yet.

        Args:
            q: Of all targets, shape (n, k, joints); written.
            rows: Of the targets that are asked, m of them.
            targets: Their poses.
            starts: Each of shape (m, k, joints); of two that lead to a solution the first one counts.
        """
        start = np.concatenate(starts)
        stacked = np.tile(rows, len(starts))
        begun = np.isnan(q[stacked, :, 0]) & np.isfinite(start[:, :, 0])
        found = self._refined(targets, start, *np.nonzero(begun))
        for one in found.reshape(len(starts), len(rows), *q.shape[1:]):
            for k in range(q.shape[1]):
                new = np.flatnonzero(np.isfinite(one[:, k, 0]) & np.isnan(q[rows, k, 0]))
                same = np.abs(self._apart(one[new][:, [k]], q[rows[new]])).max(axis=2) < SAME
                new = new[~same.any(axis=1)]
                q[rows[new], k] = one[new, k]

    def _find_near(
        self, q: FloatArray, rows: IndexArray, targets: Targets, start: FloatArray, wish: FloatArray
    ) -> None:
        """Write the solution that wished joint values lead to, if it is nearer to them than any known one.

        It takes the place of the branch that it is nearest to: beside a singular pose an arm
        can have more solutions than the idealised one, and is to stay where it is.

        Args:
            q: Of all targets, shape (n, k, joints); written.
            rows: Of the targets that are asked, m of them.
            targets: Their poses.
            start: Of each branch, shape (m, k, joints); NaN where there is none.
            wish: Joint values in [rad] or [m], shape (m, joints).
        """
        found, converged = self._stepped(targets, wish, FEW)
        known = q[rows]
        lost = np.isnan(known[:, :, 0])
        far = np.square(self._apart(known, wish[:, None])).sum(axis=2)
        nearer = np.square(self._apart(found, wish)).sum(axis=1) < np.where(lost, np.inf, far).min(axis=1)
        same = np.abs(self._apart(found[:, None], known)).max(axis=2) < SAME
        away = np.square(self._apart(found[:, None], np.where(lost[..., None], start, known))).sum(axis=2)
        branch = np.argmin(np.where(np.isnan(away), np.inf, away), axis=1)
        new = converged & nearer & ~same.any(axis=1)
        q[rows[new], branch[new]] = found[new]

    def _refined(self, targets: Targets, start: FloatArray, row: IndexArray, slot: IndexArray) -> FloatArray:
        """Return what starts lead to, shape (m, k, joints).

        NaN where that is nothing, or nearer to the start of another branch.
        """
        found = np.full_like(start, np.nan)
        if len(row):
            asked = targets.rows(row % len(targets))
            q, converged = self._stepped(asked, start[row, slot], STEPS)
            away = np.square(self._apart(q[:, None], start[row])).sum(axis=2)
            own = converged & (np.nanargmin(away, axis=1) == slot)
            found[row[own], slot[own]] = q[own]
        return found

    def _stepped(self, targets: Targets, q: FloatArray, steps: int) -> tuple[FloatArray, BoolArray]:
        """Return where so many steps lead from q, shape (n, joints), and whether a target is met there."""
        came = refine(self.chain, targets, q, metres=MET, radians=MET, iterations=steps)
        return self._within_turn(came.q), came.converged

    def _apart(self, q: FloatArray, other: FloatArray) -> FloatArray:
        """Return the difference of joint values by the shorter way."""
        return self._within_turn(q - other)

    def _within_turn(self, q: FloatArray) -> FloatArray:
        """Return joint values with the angles in (-pi, pi]."""
        turning = np.array([joint.kind == "revolute" for joint in self.chain.moving])
        return np.where(turning, wrapped(q), q)


def nearly_closed_form(chain: Chain, screws: Screws) -> NearlyClosedForm | None:
    """Return the inverse of an arm that all but has a closed form; None of any other.

    Args:
        chain: The arm.
        screws: Of its joints.
    """
    names = chain.coordinates
    wrists = ((ideal, spherical_wrist(ideal, names)) for ideal in with_spherical_wrist(screws))
    planes = ((ideal, parallel_axes(ideal, names)) for ideal in with_parallel_axes(screws))
    for ideal, form in (*wrists, *planes):
        if form is not None:
            return NearlyClosedForm(_unlimited(chain), form, _deviation(chain, ideal))
    return None


def _unlimited(chain: Chain) -> Chain:
    """Return a chain without limits of its joints: those are not asked of a closed form."""
    joints = tuple(replace(joint, lower=-np.inf, upper=np.inf) for joint in chain.joints)
    return replace(chain, joints=joints)


def _deviation(chain: Chain, ideal: Screws) -> tuple[float, float]:
    """Return the largest distance in [m] and angle in [rad] between two arms, of some random joint values."""
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (64, len(ideal.revolute)))
    q *= np.where(ideal.revolute, 1.0, ideal.size / np.pi)
    apart = misses(chain, q, targets_of(chain_of(ideal, chain.coordinates), q))
    metres, radians = (float(np.linalg.norm(one, axis=1).max()) for one in apart)
    return metres, radians
