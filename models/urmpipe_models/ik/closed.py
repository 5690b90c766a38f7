"""Closed forms: which arm has one, and arms that have one except for small deviations.

1. `closed_form` recognises an arm by its screws: the last three axes meet in a point (`spherical`), or axes
   2, 3 and 4 are parallel (`parallel_axes`): exactly (`exact_closed_form`), or nearly.
2. Nearly: its file is rounded, or it is measured as built. `iter_spherical_wrists` and `iter_parallel_axes`
   give ideal arms, whose axes do meet or are parallel.
3. `NearClosedForm` solves the ideal arm; each of its solutions is the start of a few steps of Levenberg and
   Marquardt on the arm itself. So solutions are as accurate as any; only at the edge of the reach, or near a
   singular pose, some may be lost, as the branches of both arms end in different places there.
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
from urmpipe_models.ik.numeric import refine
from urmpipe_models.ik.parallel_axes import ParallelAxes, parallel_axes
from urmpipe_models.ik.solutions import Solutions, Targets, forward_targets, pose_errors
from urmpipe_models.ik.spherical import MIN_TILT_SINE, SphericalWrist, meeting_point, spherical_wrist
from urmpipe_models.ik.trigonometric import wrap_angle
from urmpipe_models.kinematics.forward import Screws, chain_to_screws, screws_to_chain
from urmpipe_models.math3d import rotation_about

# Axes almost meet if they pass each other by less than this, in units of the arm's size, and are almost
# parallel at a smaller angle, in [rad]. Angles written as 1.5708 are off by 4e-6, lengths written to the
# micrometre by 1e-6 m; the calibration of an arm as built moves its axes by some 1e-3 rad and a millimetre.
# Of arm6 and the UR arms moved like that one random pose in a hundred loses the branch that it was made of,
# all near singular poses.
NEARLY = 1e-2
MET = 1e-11  # [m] and [rad]; a tenth of the error of a closed form ends the steps
MAX_STEPS = 24  # two or three are enough where the pose is not nearly singular
MAX_NEAR_STEPS = 8  # from given joint values; what is farther away is not near
EDGE_SHIFT = 2.0  # of the difference of both arms: shift of targets on the edge of the ideal arm's reach
BATCH_SIZE = 4096  # targets at a time
DUPLICATE_TOLERANCE = 1e-6  # [rad] or [m]; solutions that differ by less in every joint are one
LOST_BRANCH_REASON = (
    "this branch of the arm with its axes made exact leads to no solution of the arm itself,"  # plain: ok
    " as on the edge of its reach or beside a singular pose, allowed: one nearest to it"
)


class ClosedForm(Protocol):
    """The closed-form inverse of one arm.

    Attributes:
        name: "spherical wrist" or "three parallel axes"; with ", nearly" after it for an arm that deviates a
            little.
        branches: Names of the solutions, in their order.
    """

    @property
    def name(self) -> str:
        """Name of the closed form, such as "spherical wrist"."""
        ...

    @property
    def branches(self) -> tuple[str, ...]:
        """Names of the solutions, in their order."""
        ...

    def solve(self, targets: Targets, near: FloatArray | None = None) -> Solutions:
        """Return all solutions of all targets, joints in (-pi, pi], limits of the joints not considered.

        Args:
            targets: Poses; positions alone have no closed form.
            near: Joint values in [rad] or [m], shape (joints,) or (n, joints): a joint that a singular pose
                leaves free takes its value from here; by default that of `SingularPoses.chosen`.
        """
        ...


@lru_cache(maxsize=32)
def closed_form(chain: Chain) -> ClosedForm | None:
    """Return the closed form of an arm, recognised by its geometry alone; None if it has none.

    Six joints in any description, on any base and with any tool, of which the axes of the last
    three meet in a point, or those of joints 2, 3 and 4 are parallel: exactly (`exact_closed_form`) or nearly
    (`NearClosedForm`).
    """
    exact = exact_closed_form(chain)
    screws = chain_to_screws(chain)
    if exact is not None or screws is None:
        return exact
    names = chain.coordinates
    wrists = ((ideal, spherical_wrist(ideal, names)) for ideal in iter_spherical_wrists(screws))
    planes = ((ideal, parallel_axes(ideal, names)) for ideal in iter_parallel_axes(screws))
    for ideal, form in (*wrists, *planes):
        if form is not None:
            joints = tuple(replace(joint, lower=-np.inf, upper=np.inf) for joint in chain.joints)
            unlimited = replace(chain, joints=joints)  # limits are not considered in closed forms
            return NearClosedForm(unlimited, form, _deviation(chain, ideal))
    return None


@lru_cache(maxsize=32)
def exact_closed_form(chain: Chain) -> ClosedForm | None:
    """Return the closed form of an arm that has it exactly, except for rounding; None if it has none.

    Paths use these alone: near singular poses the branches of an arm that only nearly has one
    are not those of the ideal arm.
    """
    screws = chain_to_screws(chain)
    if screws is None:
        return None
    names = chain.coordinates
    return spherical_wrist(screws, names) or parallel_axes(screws, names)


def _deviation(chain: Chain, ideal: Screws) -> tuple[float, float]:
    """Return the largest distance in [m] and angle in [rad] between two arms at random joint values."""
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (64, len(ideal.revolute)))
    q *= np.where(ideal.revolute, 1.0, ideal.size / np.pi)
    errors = pose_errors(chain, q, forward_targets(screws_to_chain(ideal, chain.coordinates), q))
    metres, radians = (float(np.linalg.norm(error, axis=1).max()) for error in errors)
    return metres, radians


def format_method(method: str) -> str:
    """Return the name of the method: "closed form: spherical wrist", or "iterative"."""
    return method if method == "iterative" else f"closed form: {method}"


def iter_spherical_wrists(screws: Screws) -> Iterator[Screws]:
    """Yield ideal arms of six joints whose last three axes meet in one point, if they almost do.

    First with joints 1 to 3 ordered as well: axes 2 and 3, or else 1 and 2, parallel or meeting if they
    almost are or do, so that the branches have the names of the intended arm; then without.
    """
    arm = compact_axis_points(screws)
    if len(arm.revolute) != 6 or not arm.revolute[3:].all():
        return
    if np.linalg.norm(np.cross(arm.direction[3:5], arm.direction[4:]), axis=1).min() <= MIN_TILT_SINE:
        return  # parallel axes meet nowhere, and no such wrist has a closed form
    centre = meeting_point(arm.direction[3:], arm.point[3:])
    distance = np.linalg.norm(np.cross(centre - arm.point[3:], arm.direction[3:]), axis=1)
    if distance.max() > NEARLY * arm.size:
        return
    point = arm.point.copy()
    point[3:] = centre
    met = replace(arm, point=point)
    for pair in ([1, 2], [0, 1]):
        if arm.revolute[pair].all():
            for ideal in (_make_parallel(met, pair), _make_meet(met, pair)):
                if ideal is not None:
                    yield ideal
    yield met


def iter_parallel_axes(screws: Screws) -> Iterator[Screws]:
    """Yield ideal arms of six revolute joints with axes 2, 3, 4 parallel, if they almost are.

    First with axes 5 and 6 as they are, then meeting if they almost do.
    """
    arm = compact_axis_points(screws)
    if len(arm.revolute) != 6 or not arm.revolute.all():
        return
    parallel = _make_parallel(arm, [1, 2, 3])
    if parallel is None:
        return
    yield parallel
    met = _make_meet(parallel, [4, 5])
    if met is not None:
        yield met


def compact_axis_points(screws: Screws) -> Screws:
    """Return the same screws, each by the point of its axis that is nearest to the one before it.

    Frames may lie anywhere along their axes. With these points an axis is tilted where the arm is, and the
    size of the arm does not depend on the frames.
    """
    k, point = screws.direction, screws.point.copy()
    if len(point) > 1:
        point[0] = nearest_point(point[0], k[0], point[1], k[1])
    for i in range(1, len(point)):
        point[i] += k[i] * (k[i] @ (point[i - 1] - point[i]))
    return replace(screws, point=point)


def _make_parallel(arm: Screws, axes: list[int]) -> Screws | None:
    """Return an arm with axes along their mean direction, senses kept; None if these differ too much."""
    k = arm.direction[axes]
    senses = np.where(k @ k[0] < 0.0, -1.0, 1.0)[:, None]
    mean = (senses * k).sum(axis=0)
    mean /= np.linalg.norm(mean)
    if np.linalg.norm(np.cross(k, mean), axis=1).max() > NEARLY:
        return None
    direction = arm.direction.copy()
    direction[axes] = senses * mean
    return replace(arm, direction=direction)


def _make_meet(arm: Screws, axes: list[int]) -> Screws | None:
    """Return an arm with two axes moved to the middle of their common normal; None if it is long."""
    k, point = arm.direction[axes], arm.point[axes]
    if np.linalg.norm(np.cross(*k)) <= NEARLY:
        return None
    feet = [nearest_point(point[i], k[i], point[1 - i], k[1 - i]) for i in (0, 1)]
    if np.linalg.norm(feet[1] - feet[0]) > NEARLY * arm.size:
        return None
    points = arm.point.copy()
    points[axes] = (feet[0] + feet[1]) / 2
    return replace(arm, point=points)


@dataclass(frozen=True, slots=True, eq=False)
class NearClosedForm:
    """A `ClosedForm` of an arm that has it except for small deviations.

    Branches and singular families are those of the ideal arm, and so are the reasons why a branch does
    not reach a target.

    Attributes:
        chain: The arm, without limits of its joints.
        form: Of the ideal arm.
        deviation: Largest difference of the two arms, in [m] and in [rad].
    """

    chain: Chain
    form: SphericalWrist | ParallelAxes
    deviation: tuple[float, float]

    @property
    def name(self) -> str:
        """Name of the closed form, "spherical wrist, nearly" or "three parallel axes, nearly"."""
        return f"{self.form.name}, nearly"

    @property
    def branches(self) -> tuple[str, ...]:
        """Names of the solutions, in their order: those of the ideal arm."""
        return self.form.branches

    def solve(self, targets: Targets, near: FloatArray | None = None) -> Solutions:
        """Return the solutions of every target that those of the ideal arm lead to.

        A solution belongs to a branch if it is nearer to that solution of the ideal arm than to any other
        of its solutions, and if no other branch has it. Where the ideal arm does not reach a target, poses
        next to the target are used. A branch that leads to no separate solution is NaN, with a reason.

        Args:
            targets: Poses.
            near: Joint values in [rad] or [m], shape (joints,) or (n, joints), taken where the ideal
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
            shifted = list(self._shifted_targets(targets.rows(rows)))
            starts = [self.form.solve(poses, None if wish is None else wish[rows]).q for poses in shifted]
            self._find(q, rows, targets.rows(rows), starts)
            if wish is not None:
                begun = ideal.q[i : i + BATCH_SIZE].copy()
                for start in starts:
                    begun[rows - i] = np.where(np.isnan(begun[rows - i]), start, begun[rows - i])
                near_any = np.flatnonzero(np.isfinite(begun).any(axis=(1, 2)))
                rows = i + near_any
                self._find_near(q, rows, targets.rows(rows), begun[near_any], wish[rows])
        solved = np.isfinite(q[:, :, 0])
        reasons = np.where(solved, "", np.where(ideal.reached, LOST_BRANCH_REASON, ideal.reasons))
        singular = (replace(poses, where=poses.where & solved) for poses in ideal.singular)
        kept = tuple(poses for poses in singular if poses.where.any())
        return replace(ideal, q=q + 0.0, reasons=reasons, singular=kept)  # no -0.0

    def _shifted_targets(self, targets: Targets) -> Iterator[Targets]:
        """Yield targets shifted by the difference of the arms: one of them is in reach of both."""
        assert targets.rotation is not None
        metres, radians = EDGE_SHIFT * self.deviation[0], EDGE_SHIFT * self.deviation[1]
        for axis in (*np.eye(3), *-np.eye(3)):
            yield Targets(targets.position + metres * axis, targets.rotation)
            turn = np.array(rotation_about(axis.tolist(), radians).rotation, dtype=float)
            yield Targets(targets.position, turn @ targets.rotation)

    def _find(self, q: FloatArray, rows: IndexArray, targets: Targets, starts: list[FloatArray]) -> None:
        """Write the solutions that starts lead to where there is none yet.

        `q` of all targets, shape (n, k, joints), is written at the m `rows` of `targets`; `starts` are of
        shape (m, k, joints), and of two that lead to a solution the first one counts.
        """
        start = np.concatenate(starts)
        stacked = np.tile(rows, len(starts))
        begun = np.isnan(q[stacked, :, 0]) & np.isfinite(start[:, :, 0])
        refined = self._refine(targets, start, *np.nonzero(begun))
        for solved in refined.reshape(len(starts), len(rows), *q.shape[1:]):
            for k in range(q.shape[1]):
                new = np.flatnonzero(np.isfinite(solved[:, k, 0]) & np.isnan(q[rows, k, 0]))
                same = (
                    np.abs(self._difference(solved[new][:, [k]], q[rows[new]])).max(axis=2)
                    < DUPLICATE_TOLERANCE
                )
                new = new[~same.any(axis=1)]
                q[rows[new], k] = solved[new, k]

    def _find_near(
        self, q: FloatArray, rows: IndexArray, targets: Targets, start: FloatArray, wish: FloatArray
    ) -> None:
        """Write the solution that wished joint values lead to, if it is nearer to them than any known one.

        It replaces the branch that it is nearest to: near a singular pose an arm can have more solutions
        than the ideal one, and has to stay where it is. `q`, `rows` and `start` as in `_find`; `wish` of
        shape (m, joints).
        """
        solved, converged = self._step(targets, wish, MAX_NEAR_STEPS)
        known = q[rows]
        lost = np.isnan(known[:, :, 0])
        far = np.square(self._difference(known, wish[:, None])).sum(axis=2)
        nearer = np.square(self._difference(solved, wish)).sum(axis=1) < np.where(lost, np.inf, far).min(
            axis=1
        )
        same = np.abs(self._difference(solved[:, None], known)).max(axis=2) < DUPLICATE_TOLERANCE
        away = np.square(self._difference(solved[:, None], np.where(lost[..., None], start, known))).sum(
            axis=2
        )
        branch = np.argmin(np.where(np.isnan(away), np.inf, away), axis=1)
        new = converged & nearer & ~same.any(axis=1)
        q[rows[new], branch[new]] = solved[new]

    def _refine(self, targets: Targets, start: FloatArray, row: IndexArray, slot: IndexArray) -> FloatArray:
        """Return the solutions that starts lead to, shape (m, k, joints); NaN without one of this branch."""
        refined = np.full_like(start, np.nan)
        if len(row):
            selected = targets.rows(row % len(targets))
            q, converged = self._step(selected, start[row, slot], MAX_STEPS)
            away = np.square(self._difference(q[:, None], start[row])).sum(axis=2)
            same_branch = converged & (np.nanargmin(away, axis=1) == slot)
            refined[row[same_branch], slot[same_branch]] = q[same_branch]
        return refined

    def _step(self, targets: Targets, q: FloatArray, steps: int) -> tuple[FloatArray, BoolArray]:
        result = refine(self.chain, targets, q, metres=MET, radians=MET, iterations=steps)
        return self._wrap(result.q), result.converged

    def _difference(self, q: FloatArray, other: FloatArray) -> FloatArray:
        return self._wrap(q - other)

    def _wrap(self, q: FloatArray) -> FloatArray:
        revolute = np.array([joint.kind == "revolute" for joint in self.chain.moving])
        return np.where(revolute, wrap_angle(q), q)
