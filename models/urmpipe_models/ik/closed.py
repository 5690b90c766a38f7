"""The nearest arm that has a closed form: axes that all but meet or are parallel made to.

The inverse of arms that all but have a closed form: rounded in their files, or measured as built.

The nearest arm that has one (`idealised`) is solved by it, and each of its solutions is the start of a few
steps of Levenberg and Marquardt on the arm itself. What is returned is good to what any solution is, as the
arm itself is asked; only what lies at the edge of its reach, or beside a singular pose, may be lost, as the
branches of both arms end in different places there.

Arms whose inverse can be written down: what they have in common, and how one is recognised.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Protocol

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import BoolArray, FloatArray, IndexArray
from urmpipe_models.ik.loop_equations import nearest_point
from urmpipe_models.ik.parallel import ParallelAxes, parallel_axes
from urmpipe_models.ik.restarts import refine
from urmpipe_models.ik.solutions import Solutions, Targets, forward_targets, pose_errors
from urmpipe_models.ik.spherical import MIN_TILT_SINE, SphericalWrist, meeting_point, spherical_wrist
from urmpipe_models.ik.trigonometric import wrap_angle
from urmpipe_models.kinematics.forward import Screws, chain_to_screws, screws_to_chain
from urmpipe_models.math3d import rotation_about

NEARLY = 1e-2
"""Axes all but meet if they pass each other by less than this, in units of the arm's size, and are all but
parallel if they stand at less than this to each other, in [rad].

Angles written as 1.5708 are off by 4e-6, lengths written to the micrometre by 1e-6 m; the calibration of an
arm as built moves its axes by some 1e-3 rad and a millimetre. Of arm6 and the UR arms moved like that one
random pose in a hundred loses the branch that it was made of, all beside singular poses.
"""


def iter_spherical_wrists(screws: Screws) -> Iterator[Screws]:
    """Yield six joints whose last three axes are made to meet in one point, if they all but do.

    First with joints 1 to 3 ordered as well: axes 2 and 3, or else 1 and 2, made parallel or made to meet
    if they all but do, so that the branches have the names of the arm that was meant; then without.
    """
    arm = compact_axis_points(screws)
    if len(arm.revolute) != 6 or not arm.revolute[3:].all():
        return
    if np.linalg.norm(np.cross(arm.direction[3:5], arm.direction[4:]), axis=1).min() <= MIN_TILT_SINE:
        return  # parallel axes meet nowhere, and no such wrist has a closed form
    centre = meeting_point(arm.direction[3:], arm.point[3:])
    passing = np.linalg.norm(np.cross(centre - arm.point[3:], arm.direction[3:]), axis=1)
    if passing.max() > NEARLY * arm.size:
        return
    point = arm.point.copy()
    point[3:] = centre
    met = replace(arm, point=point)
    for pair in ([1, 2], [0, 1]):
        if arm.revolute[pair].all():
            yield from _paired(met, pair)
    yield met


def iter_parallel_axes(screws: Screws) -> Iterator[Screws]:
    """Yield six revolute joints with axes 2, 3, 4 made parallel, if they all but are.

    First with axes 5 and 6 as they are, then made to meet if they all but do.
    """
    arm = compact_axis_points(screws)
    if len(arm.revolute) != 6 or not arm.revolute.all():
        return
    parallel = _made_parallel(arm, [1, 2, 3])
    if parallel is None:
        return
    yield parallel
    met = _made_to_meet(parallel, [4, 5])
    if met is not None:
        yield met


def compact_axis_points(screws: Screws) -> Screws:
    """Return the same screws, each by the point of its axis that is nearest to the one before it.

    So an axis that is tilted is tilted where the arm is, and the arm's size is that of the arm: frames may
    lie anywhere along their axes.
    """
    k, point = screws.direction, screws.point.copy()
    if len(point) > 1:
        point[0] = nearest_point(point[0], k[0], point[1], k[1])
    for i in range(1, len(point)):
        point[i] += k[i] * (k[i] @ (point[i - 1] - point[i]))
    return replace(screws, point=point)


def _paired(arm: Screws, pair: list[int]) -> Iterator[Screws]:
    """Yield an arm with two axes made parallel, or made to meet, if they all but are or do."""
    for made in (_made_parallel(arm, pair), _made_to_meet(arm, pair)):
        if made is not None:
            yield made


def _made_parallel(arm: Screws, axes: list[int]) -> Screws | None:
    """Return an arm with axes along their mean direction, senses kept; None if they are not nearly so."""
    k = arm.direction[axes]
    senses = np.where(k @ k[0] < 0.0, -1.0, 1.0)[:, None]
    mean = (senses * k).sum(axis=0)
    mean /= np.linalg.norm(mean)
    if np.linalg.norm(np.cross(k, mean), axis=1).max() > NEARLY:
        return None
    direction = arm.direction.copy()
    direction[axes] = senses * mean
    return replace(arm, direction=direction)


def _made_to_meet(arm: Screws, axes: list[int]) -> Screws | None:
    """Return an arm with two axes moved to the middle of their common normal; None if they pass far."""
    k, point = arm.direction[axes], arm.point[axes]
    if np.linalg.norm(np.cross(*k)) <= NEARLY:
        return None
    feet = [_foot(point, k, 0), _foot(point, k, 1)]
    if np.linalg.norm(feet[1] - feet[0]) > NEARLY * arm.size:
        return None
    points = arm.point.copy()
    points[axes] = (feet[0] + feet[1]) / 2
    return replace(arm, point=points)


def _foot(point: FloatArray, k: FloatArray, i: int) -> FloatArray:
    """Return the point of one of two lines that is nearest to the other."""
    return nearest_point(point[i], k[i], point[1 - i], k[1 - i])


MET = 1e-11
"""Steps end here, in [m] and [rad]: a tenth of what a closed form keeps."""

STEPS = 24
"""Two or three are enough where the pose is not nearly singular."""

EDGE_SHIFT = 2.0
"""Targets on the edge of the idealised arm's reach are moved by so many times what the two arms are apart."""

BATCH_SIZE = 4096
"""Targets that are worked on at once."""

FEW = 8
"""Steps that joint values wished for may take: what is farther away is not near."""

SAME = 1e-6
"""Solutions that differ by less than this in every joint, in [rad] or [m], are one."""

LOST_BRANCH_REASON = (
    "this branch of the arm with its axes made exact leads to no solution of the arm itself,"
    " as on the edge of its reach or beside a singular pose, allowed: one nearest to it"
)
"""Why a branch is lost that the idealised arm has."""


@dataclass(frozen=True, slots=True, eq=False)
class NearClosedForm:
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
        for i in range(0, count, BATCH_SIZE):
            rows = np.arange(i, min(i + BATCH_SIZE, count))
            self._find(q, rows, targets.rows(rows), [ideal.q[rows]])
            rows = rows[np.isnan(q[rows, :, 0]).any(axis=1)]
            beside = list(self._nudged(targets.rows(rows)))
            starts = [self.form.solve(one, None if wish is None else wish[rows]).q for one in beside]
            self._find(q, rows, targets.rows(rows), starts)
            if wish is not None:
                begun = ideal.q[i : i + BATCH_SIZE].copy()
                for one in starts:
                    begun[rows - i] = np.where(np.isnan(begun[rows - i]), one, begun[rows - i])
                near_any = np.flatnonzero(np.isfinite(begun).any(axis=(1, 2)))
                rows = i + near_any
                self._find_near(q, rows, targets.rows(rows), begun[near_any], wish[rows])
        own = np.isfinite(q[:, :, 0])
        reasons = np.where(own, "", np.where(ideal.reached, LOST_BRANCH_REASON, ideal.reasons))
        singular = (replace(one, where=one.where & own) for one in ideal.singular)
        kept = tuple(one for one in singular if one.where.any())
        return replace(ideal, q=q + 0.0, reasons=reasons, singular=kept)  # no -0.0

    def _nudged(self, targets: Targets) -> Iterator[Targets]:
        """Yield targets moved and turned by what the two arms are apart: one of them is in reach of both."""
        assert targets.rotation is not None
        metres, radians = EDGE_SHIFT * self.deviation[0], EDGE_SHIFT * self.deviation[1]
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
        return np.where(turning, wrap_angle(q), q)


def near_closed_form(chain: Chain, screws: Screws) -> NearClosedForm | None:
    """Return the inverse of an arm that all but has a closed form; None of any other.

    Args:
        chain: The arm.
        screws: Of its joints.
    """
    names = chain.coordinates
    wrists = ((ideal, spherical_wrist(ideal, names)) for ideal in iter_spherical_wrists(screws))
    planes = ((ideal, parallel_axes(ideal, names)) for ideal in iter_parallel_axes(screws))
    for ideal, form in (*wrists, *planes):
        if form is not None:
            return NearClosedForm(_unlimited(chain), form, _deviation(chain, ideal))
    return None


def _unlimited(chain: Chain) -> Chain:
    """Return a chain without limits of its joints: those are not asked of a closed form."""
    joints = tuple(replace(joint, lower=-np.inf, upper=np.inf) for joint in chain.joints)
    return replace(chain, joints=joints)


def _deviation(chain: Chain, ideal: Screws) -> tuple[float, float]:
    """Return the largest distance in [m] and angle in [rad] between two arms, of some random joint values."""
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (64, len(ideal.revolute)))
    q *= np.where(ideal.revolute, 1.0, ideal.size / np.pi)
    apart = pose_errors(chain, q, forward_targets(screws_to_chain(ideal, chain.coordinates), q))
    metres, radians = (float(np.linalg.norm(one, axis=1).max()) for one in apart)
    return metres, radians


class ClosedForm(Protocol):
    """The inverse of one arm, written down.

    Attributes:
        name: What makes it possible: "spherical wrist" or "three parallel axes"; of an arm that
            deviates a little from that with ", nearly" behind it.
        branches: What its solutions are called, in their order.
    """

    @property
    def name(self) -> str:
        """What makes it possible, such as "spherical wrist"."""
        ...

    @property
    def branches(self) -> tuple[str, ...]:
        """What its solutions are called, in their order."""
        ...

    def solve(self, targets: Targets, near: FloatArray | None = None) -> Solutions:
        """Return every solution of every target, joints in (-pi, pi], limits of the joints not asked.

        Args:
            targets: Poses; positions alone have no closed form.
            near: Joint values in [rad] or [m], shape (joints,) or (n, joints): where a singular pose leaves
                a joint free, it is taken from here; without it by the convention of `Singular.chosen`.
        """
        ...


@lru_cache(maxsize=32)
def closed_form(chain: Chain) -> ClosedForm | None:
    """Return the closed form of an arm, recognised from its geometry alone; None if it has none.

    Six joints, whatever they are described by, on any base and with any tool, of which the axes of the last
    three meet in a point, or those of joints 2, 3 and 4 are parallel: exactly (`exact_form`) or nearly
    (`nearly.NearlyClosedForm`).
    """
    exact = exact_closed_form(chain)
    of_chain = chain_to_screws(chain)
    if exact is not None or of_chain is None:
        return exact
    return near_closed_form(chain, of_chain)


@lru_cache(maxsize=32)
def exact_closed_form(chain: Chain) -> ClosedForm | None:
    """Return the closed form of an arm that has it to the rounding; None if it has none.

    Paths are followed by these alone: beside singular poses the branches of an arm that only nearly has one
    are not those of the idealised arm.
    """
    of_chain = chain_to_screws(chain)
    if of_chain is None:
        return None
    names = chain.coordinates
    return spherical_wrist(of_chain, names) or parallel_axes(of_chain, names)


def format_method(method: str) -> str:
    """Return what solves targets: "closed form: spherical wrist", or "iterative"."""
    return method if method == "iterative" else f"closed form: {method}"
