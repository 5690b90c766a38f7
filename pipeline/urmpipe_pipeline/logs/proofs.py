"""What numbers prove about units: four proofs, of which each may stay without a result.

1. Kinematics against a recorded tool centre point (`prove_by_kinematics`). With the right units of joints and
   lengths the forward kinematics p_fk, R_fk [m, -] follow the recorded points p_rec [m] in each row:

       p_fk + R_fk t = M p_rec + c

   with the tool offset t and the base M, c. Four fits free more and more of it (`fit_recorded`): nothing
   (t = c = 0, M = 1), the tool, the base's origin, the base's rotation (M, 9 numbers whose singular values
   must be near 1). Each fit is robust: rows that stay far out are left out, and the median of the residuals
   counts as a share of the size of the recorded motion: in too small a unit all points are near each other.
2. Kinematics against a recorded orientation (`rotation_distances`): as it is, with a constant turn of the
   tool, and in any base: relative rotations have the same angles, and axes that the tool's turn relates.
3. Steps of a whole turn from one row to the next (`count_wraps`, `wraps_as_degrees`, `wraps_as_radians`).
4. Speed (`too_fast_as_radians`) and size (`usual_peak`). Speeds rest on a clock, which may be wrong as well:
   they are a reason to assume deg, and contradict rad only together with the size.

Elimination is no proof: values that are not in rad may be ticks.
"""

from __future__ import annotations

import math
from collections.abc import Container, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, FloatArray, IndexArray, IntArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import (
    conjugate,
    fit_rotation,
    quaternion_product,
    rotation_angle,
    to_rotation_vectors,
)
from urmpipe_pipeline.logs.columns import OTHER_UNIT
from urmpipe_pipeline.logs.vocabulary import Quantity, Unit, vocabulary

Key = TypeVar("Key", bound=Hashable)

Units: TypeAlias = tuple[Unit, ...]  # of each column of a group
UnitReading: TypeAlias = tuple[Units, Units]  # of the joints, and of the recorded x, y, z

SAMPLES = 400  # rows that decide, spread evenly over a log
MAX_SHARE = 0.03  # of the motion, within which kinematics agree: calibration and a late clock explain less
MARGIN = 5.0  # the best of several explanations over the next one, by their residuals ...
MIN_SHARE_APART = 0.01  # ... and smaller ones by this share of the motion
MAX_TOOL = 2.0  # [m], length of a tool; a longer one turns a small rotation into any motion
MAX_STRETCH = 1.1  # singular values of M are within this factor of 1
MIN_SPREAD = 0.02  # of a motion along an axis, as a share of its longest one, that determines M there
DECOY_SCALES = (
    0.5,
    2.0,
)  # scales of all joints or lengths that a proof excludes as well: else a tool explains any
FREE_BASE = 3  # index of the last of the four fits
MIN_ROWS = (1, 5, 8, 12)  # of each fit: at least twice as many numbers as unknowns
MAX_COORDINATE = 1e15  # in any unit; a larger one is an error of its file, and its square is infinite
CELLS_PER_MOTION = 50  # of the motion of the joint that moves most: rows at rest count as one
MAX_RESIDUAL_RATIO = 3.0  # times the median residual, from which a row is left out of a fit
MIN_TURN = 0.1  # standard deviation as rad, below which another base or tool does as much
MAX_ROTATION_ROWS = 60  # whose pairs decide on an orientation

TURN = {"rad": math.tau, "deg": 360.0}
ONE_TURN = math.tau * 1.01  # [rad], of joints that turn once either way, as UR's do: +-363 deg
TWO_TURNS = 2 * math.tau  # [rad]; joints of arms turn no further either way
MAX_WRAP_DEVIATION = 20.0 / 360.0  # share of a turn by which a step may differ from it
MAX_JOINT_SPEED = 30.0  # [rad/s]; no joint of an arm is faster for a tenth of the time
MAX_DEGREES = 720.0  # [deg], two turns; larger values are ticks or per cent
MAX_SIZE_ROWS = 10_000  # that show the usual size of values
SPEED_WINDOW = 20  # rows over which a clock may hurry, as a recorder that stores late rows at once

_FREED = ("", " with a tool of {}", " with another tool and base", " with a base that is turned")


class Fit(NamedTuple):
    """Residuals of the fits of forward kinematics to recorded points, by how much they free.

    Attributes:
        distances: Median residual in [m] with no free offset, a free tool, a free origin of the base as well,
            and its free rotation as well, shape (4,); inf where a fit has too few rows or too large a result.
        shares: The same divided by the size of the recorded motion, that of the first one by the distance of
            the points from the base [-], shape (4,).
        tool: Tool offset t of the second fit in [m].
        base: Rotation M of the last fit [-], shape (3, 3); the identity where there is none.
    """

    distances: FloatArray
    shares: FloatArray
    tool: tuple[float, float, float]
    base: FloatArray


def spread(rows: int) -> slice:
    """Return some rows, spread evenly over a log."""
    return slice(None, None, max(1, rows // SAMPLES))


def has_both(q: FloatArray, position: FloatArray) -> BoolArray:
    """Return which rows have joint values and a recorded point, in any unit, shape (n, joints) and (n, 3).

    A point of three zeros was not recorded: a controller writes it before it knows one.
    """
    known = np.isfinite(q).all(axis=1) & np.isfinite(position).all(axis=1)
    return np.asarray(known & position.any(axis=1))


def moving_rows(q: FloatArray, position: FloatArray) -> IndexArray:
    """Return the rows [-], shape (k,), that decide: with both, each pose once, and no gross outliers.

    Args:
        q: Joint values in the file's own units, shape (n, joints).
        position: Recorded points in the file's own units, shape (n, 3).
    """
    rows = np.arange(0, len(q), max(1, len(q) // (5 * SAMPLES)))
    rows = rows[has_both(q[rows], position[rows]) & (np.abs(position[rows]) < MAX_COORDINATE).all(axis=1)]
    if not len(rows):
        return rows
    turned, sparse = np.abs(q[rows] - np.median(q[rows], axis=0)), rows
    for share in (0.99, 0.9):  # of the rows, which show the size of the motion unless they are bad
        cell = max(_quantile(joint, share) for joint in turned.T) / CELLS_PER_MOTION or 1.0
        sparse = rows[np.sort(np.unique(np.rint(q[rows] / cell), axis=0, return_index=True)[1])]
        if len(sparse) >= MIN_ROWS[-1]:
            break
    far = _distances(position[sparse])
    sparse = sparse[far <= 10 * _quantile(far, 0.5)]
    return sparse[spread(len(sparse))]


def _distances(points: FloatArray) -> FloatArray:
    """Return how far points are from their median, shape (n,)."""
    return np.asarray(np.linalg.norm(points - np.median(points, axis=0), axis=1))


def fit_recorded(
    position: FloatArray, rotation: FloatArray, recorded: FloatArray, *, max_freedom: int = FREE_BASE
) -> Fit:
    """Return how far poses stay from recorded points: p_fk + R_fk t = M p_rec + c.

    Args:
        position: p_fk, computed positions in [m], shape (n, 3).
        rotation: R_fk, computed orientations [-], shape (n, 3, 3).
        recorded: p_rec, recorded positions in [m], shape (n, 3).
        max_freedom: The last of the four fits to try.
    """
    count = len(recorded)
    motion, distances = _quantile(_distances(recorded), 0.5), np.full(4, np.inf)
    base: FloatArray = np.eye(3)
    distances[0] = _median_norm(recorded - position)
    tool = np.median(np.einsum("nji,nj->ni", rotation, recorded - position), axis=0)
    freedom = max_freedom if motion > 0 else 0
    if freedom >= 1 and count >= MIN_ROWS[1] and np.linalg.norm(tool) <= MAX_TOOL:
        distances[1] = _median_norm(recorded - position - rotation @ tool)
    eye = np.broadcast_to(np.eye(3), rotation.shape)
    if freedom >= 2 and count >= MIN_ROWS[2]:
        solution, residual = _solve_robustly(np.concatenate([rotation, eye], axis=2), recorded - position)
        distances[2] = residual if np.linalg.norm(solution[:3]) <= MAX_TOOL else np.inf
    if freedom >= FREE_BASE and count >= MIN_ROWS[3]:
        turned = np.einsum("ij,nk->nijk", np.eye(3), recorded).reshape(count, 3, 9)
        solution, residual = _solve_robustly(np.concatenate([-rotation, eye, turned], axis=2), position)
        _, sizes, axes = np.linalg.svd(recorded - recorded.mean(axis=0), full_matrices=False)
        axes = axes[sizes > MIN_SPREAD * sizes[0]]  # M is known along these
        along = solution[6:].reshape(3, 3) @ axes.T
        stretch = np.linalg.svd(along, compute_uv=False)
        is_rotation = len(axes) > 1 and 1 / MAX_STRETCH < stretch[-1] <= stretch[0] < MAX_STRETCH
        if is_rotation and np.linalg.norm(solution[:3]) <= MAX_TOOL:
            distances[3], base = residual, fit_rotation(along @ axes)[0]
    x, y, z = tool.tolist()
    scales = np.array([_median_norm(recorded), motion, motion, motion]) + 1e-12
    return Fit(distances, distances / scales, (x, y, z), base)


def _median_norm(vectors: FloatArray) -> float:
    return float(np.median(np.linalg.norm(vectors, axis=1))) if len(vectors) else np.inf


def _are_near(residual: FloatArray) -> BoolArray:
    """Return which rows stay in a robust fit, by their residuals, shape (n,)."""
    return np.asarray(residual <= max(MAX_RESIDUAL_RATIO * float(np.median(residual)), 1e-9))


def _solve_robustly(a: FloatArray, b: FloatArray) -> tuple[FloatArray, float]:
    """Return x of a x = b, shapes (n, 3, k) and (n, 3), without rows far from it; the median residual."""
    kept = np.ones(len(a), dtype=np.bool_)
    for _ in range(6):
        x = np.linalg.lstsq(a[kept].reshape(-1, a.shape[2]), b[kept].ravel(), rcond=1e-9)[0]
        residual = np.linalg.norm(a @ x - b, axis=1)
        before, kept = kept, _are_near(residual)
        if (kept == before).all():
            break
    return np.asarray(x), float(np.median(residual))


def find_best_fit(
    fits: Mapping[Key, Fit], stated: Container[Key] = (), *, max_freedom: int = FREE_BASE
) -> tuple[Key, int] | None:
    """Return the only explanation that agrees with the recorded points, and by which fit, 0 to 3.

    Of several that the points do not distinguish it is the only stated one.

    Args:
        fits: The explanations.
        stated: Those that names, source or user state.
        max_freedom: The last of the four fits that is used.
    """
    for freedom in range(max_freedom + 1):
        shares = {key: float(fit.shares[freedom]) for key, fit in fits.items()}
        best = min(shares.values())
        if best > MAX_SHARE:
            continue
        rivals = [key for key, share in shares.items() if not is_clearly_worse(share, best)]
        chosen = [key for key in rivals if key in stated] or rivals
        if len(chosen) == 1:
            return chosen[0], freedom
    return None


def is_clearly_worse(share: float, best: float) -> bool:
    """Return whether an explanation is excluded by the best one, both as shares of the motion."""
    return share >= MARGIN * best and share >= best + MIN_SHARE_APART


@dataclass(frozen=True, eq=False)
class Recorded:
    """The joints of a log and the tool centre point that it recorded, before their units are known.

    Attributes:
        names: Names of the joints.
        q: Joint values in the file's own units, with signs and offsets, shape (n, joints).
        position: Recorded x, y, z in the file's own units, shape (n, 3), or without columns.
        joints: The stated unit of each joint, None where nothing states it.
        lengths: The same of x, y, z.
    """

    names: tuple[str, ...]
    q: FloatArray
    position: FloatArray
    joints: tuple[Unit | None, ...]
    lengths: tuple[Unit | None, ...]

    @cached_property
    def stated(self) -> frozenset[UnitReading]:
        """The readings that contradict no stated unit."""
        return frozenset(product(_complete(self.joints, "angle"), _complete(self.lengths, "length")))

    @cached_property
    def usual(self) -> tuple[UnitReading, ...]:
        """Those, and the readings in which all joints, or all of x, y, z, have one unit."""
        joints = [*_complete(self.joints, "angle"), *_complete((None,) * len(self.joints), "angle")]
        lengths = [*_complete(self.lengths, "length"), *_complete((None,) * len(self.lengths), "length")]
        return tuple(dict.fromkeys(product(joints, lengths)))

    @cached_property
    def rows(self) -> tuple[FloatArray, FloatArray]:
        """Joints and positions of the rows that decide, in the file's units, (k, joints) and (k, 3)."""
        rows = moving_rows(self.q, self.position)
        return self.q[rows], self.position[rows]

    def judges(self, robot: Chain) -> bool:
        """Return whether the kinematics of a robot can be compared with the recorded points."""
        fits = self.q.shape[1] == len(robot.moving) and self.position.shape[1] == 3
        return fits and len(self.rows[0]) > 0


def fit_readings(
    robot: Chain, recorded: Recorded, readings: Sequence[UnitReading], *, max_freedom: int = FREE_BASE
) -> dict[UnitReading, Fit]:
    """Return how near a robot comes to the recorded points with each of some readings."""
    q, position = recorded.rows
    factors = {units: np.array([unit.factor for unit in units]) for reading in readings for units in reading}
    poses = {units: poses_over_log(robot, q * factors[units]) for units in {joints for joints, _ in readings}}
    return {
        (joints, lengths): fit_recorded(*poses[joints], position * factors[lengths], max_freedom=max_freedom)
        for joints, lengths in readings
    }


@dataclass(frozen=True, slots=True, eq=False)
class KinematicUnits:
    """The units with which the kinematics follow the recorded tool centre point.

    Attributes:
        joints: Unit of each joint.
        lengths: Unit of x, y, z.
        freedom: The fit that shows it: 0 as they are, to 3 with a free tool and base.
        proved: Of each joint, whether in its other unit they would not follow.
        fits: Of these and of other units.
    """

    joints: Units
    lengths: Units
    freedom: int
    proved: tuple[bool, ...]
    fits: Mapping[UnitReading, Fit]

    @property
    def base(self) -> FloatArray:
        """Rotation M of the base [-], shape (3, 3); the identity without one."""
        return self.fits[self.joints, self.lengths].base if self.freedom == FREE_BASE else np.eye(3)

    def of(self, quantity: Quantity) -> Units:
        """Return the units of the joints (angle) or of x, y, z (length)."""
        return self.joints if quantity == "angle" else self.lengths

    def format_evidence(self, quantity: Quantity, stated: Units = ()) -> str:
        """Return by how much these units of joints (angle) or x, y, z (length) beat stated or other ones."""
        k, best = int(quantity == "length"), (self.joints, self.lengths)
        best_share = float(self.fits[best].shares[self.freedom])
        share = {
            units[k]: float(fit.shares[self.freedom])
            for units, fit in self.fits.items()
            if units[k] != best[k] and units[1 - k] == best[1 - k]
        }
        worse = [units for units in share if is_clearly_worse(share[units], best_share)] or [*share]
        second = stated if stated in share else min(worse, key=share.__getitem__)
        name = next(other.name for other, unit in zip(second, best[k], strict=True) if other != unit)
        fit, size = self.fits[best], "distance" if self.freedom == 0 else "motion"
        tool = ",".join(f"{x:.3f}" for x in fit.tool) + " m"
        off = f"{100 * share[second]:.3g} %" if np.isfinite(share[second]) else "no base"
        return (
            f"with it the kinematics{_FREED[self.freedom].format(tool)} follow the recorded TCP within"
            f" {1e3 * fit.distances[self.freedom]:.2f} mm (median), {100 * best_share:.2f} % of"
            f" its {size}, as {name} within {off}"
        )


def prove_by_kinematics(robot: Chain | None, recorded: Recorded) -> KinematicUnits | None:
    """Return the units that the kinematics prove; None if they do not, or nothing was recorded.

    They are those that are stated, or one for all joints and one for x, y, z; else one joint, which must
    turn, has the other unit. An arm with a prismatic joint is not judged.
    """
    if robot is None or any(joint.kind != "revolute" for joint in robot.moving) or not recorded.judges(robot):
        return None
    fits = fit_readings(robot, recorded, recorded.usual)
    best = find_best_fit(fits, recorded.stated)
    if best is None:  # a free base would explain another robot, or order of the joints
        turns = np.flatnonzero(recorded.rows[0].std(axis=0) >= MIN_TURN).tolist()
        flipped = [(_flip(joints, j), lengths) for joints, lengths in recorded.usual for j in turns]
        fits |= fit_readings(robot, recorded, flipped, max_freedom=1)
        best = find_best_fit(fits, recorded.stated, max_freedom=1)
    if best is None:
        return None
    (joints, lengths), freedom = best
    decoys = [(_scale(joints, scale), lengths) for scale in DECOY_SCALES]
    decoys += [(joints, _scale(lengths, scale)) for scale in DECOY_SCALES]
    flipped = [(_flip(joints, j), lengths) for j in range(len(joints))]
    rivals = fit_readings(robot, recorded, [*decoys, *flipped], max_freedom=freedom)
    share = float(fits[joints, lengths].shares[freedom])
    is_excluded = {key: is_clearly_worse(float(fit.shares[freedom]), share) for key, fit in rivals.items()}
    if not all(is_excluded[decoy] for decoy in decoys):
        return None
    return KinematicUnits(joints, lengths, freedom, tuple(is_excluded[key] for key in flipped), fits)


def _flip(units: Units, j: int) -> Units:
    """Return units with that of one column exchanged for the other angle."""
    return (*units[:j], vocabulary().units[OTHER_UNIT.get(units[j].name, "rad")], *units[j + 1 :])


def _scale(units: Units, scale: float) -> Units:
    return tuple(replace(unit, factor=scale * unit.factor) for unit in units)


def _complete(stated: Sequence[Unit | None], quantity: Quantity) -> list[Units]:
    """Return the stated units of columns, those without one in each unit of a quantity."""
    units = dict.fromkeys(unit for unit in vocabulary().units.values() if unit.quantity == quantity)
    return list(dict.fromkeys(tuple(column or unit for column in stated) for unit in units))


def mean_turn(computed: FloatArray, recorded: FloatArray) -> FloatArray:
    """Return the constant turn from computed to recorded orientations that fits best, shape (4,) [-].

    It is the mean of the relative quaternions: the eigenvector of sum(q q^T) with the largest eigenvalue
    (Markley et al. 2007, "Averaging quaternions", eq. 12). Computed and recorded orientations are unit
    quaternions x, y, z, w [-], shape (n, 4).
    """
    relative = quaternion_product(conjugate(computed), recorded)
    return np.asarray(np.linalg.eigh(relative.T @ relative)[1][:, -1])


def rotation_distances(computed: FloatArray, recorded: FloatArray) -> tuple[float, float, float]:
    """Return the median angle in [rad] between orientations: as they are, with any tool, also in any base.

    With S_k = B R_k T the relative rotations are S_i^T S_j = T^T (R_i^T R_j) T: the vector of one is that of
    the other turned by T^T, which is fitted to all pairs of some rows.

    Args:
        computed: R_k, unit quaternions x, y, z, w [-], shape (n, 4).
        recorded: S_k, likewise.
    """
    angles, kept = rotation_angle(computed, recorded), np.ones(len(computed), dtype=np.bool_)
    direct = float(np.median(angles))
    for _ in range(3):
        turn = np.broadcast_to(mean_turn(computed[kept], recorded[kept]), computed.shape)
        angles = rotation_angle(quaternion_product(computed, turn), recorded)
        kept = _are_near(angles)
    return direct, float(np.median(angles)), _relative_distance(computed, recorded)


def _relative_distance(computed: FloatArray, recorded: FloatArray) -> float:
    """Return the median difference of relative rotation vectors in [rad]; inf where too few rows turn."""
    some = np.unique(np.linspace(0, len(computed) - 1, MAX_ROTATION_ROWS).astype(np.int64))
    i, j = np.triu_indices(len(some), 1)
    arm, measured = (
        to_rotation_vectors(quaternion_product(conjugate(q[some[i]]), q[some[j]]))
        for q in (computed, recorded)
    )
    size, other = np.linalg.norm(arm, axis=1), np.linalg.norm(measured, axis=1)
    usable = (size < 3.0) & ((size > 1e-3) | (other > 1e-3))  # near pi the sign of a vector is arbitrary
    arm, measured, kept = arm[usable], measured[usable], np.ones(np.count_nonzero(usable), dtype=np.bool_)
    if len(arm) < 3:
        return np.inf
    for _ in range(4):
        turn, _ = fit_rotation(measured[kept].T @ arm[kept])
        residual = np.linalg.norm(measured - arm @ turn.T, axis=1)
        kept = _are_near(residual)
    return float(np.median(residual))


def wraps_as_degrees(values: FloatArray) -> str | None:
    """Return why values are in deg, wraps by 360; None if there are none.

    Values within one turn may be in rad. They are in the file's own units, shape (n, columns).
    """
    return format_wraps(values, "deg") if peak(values) > math.tau else None


def wraps_as_radians(values: FloatArray) -> str | None:
    """Return why values are in rad: a column within a turn wraps by 2 pi; None if none does.

    In deg all these jumps would be of the same six degrees. Values are in the file's own units, shape
    (n, columns).
    """
    if peak(values) > ONE_TURN:
        values = values[:, [j for j, column in enumerate(values.T) if peak(column) <= ONE_TURN]]
    return format_wraps(values, "rad")


def format_wraps(values: FloatArray, unit: str) -> str | None:
    """Return how often values, shape (n, columns), step by a turn in rad or deg; None if they do not."""
    count = int(count_wraps(values, unit).sum())
    step = f"{format_count(count, 'step')} of about {TURN[unit]:.3g}"
    return f"{step} from one row to the next" if count else None


@np.errstate(over="ignore", invalid="ignore")  # huge numbers: their steps are infinite
def count_wraps(values: FloatArray, unit: str) -> IntArray:
    """Return how often each column steps by a turn or two and continues from there, shape (columns,).

    A spike is no wrap: it steps back at once. Nor is a step of values that jump about: those of other rows
    are usually small, and a wrap is no further off whole turns than twice the largest of them.

    Args:
        values: In the file's own units, shape (n, columns).
        unit: Unit of the turns: rad or deg.
    """
    columns = (c[~np.isnan(c)] if np.isnan(c.sum()) else c for c in values.T)
    return np.array([_count_wraps(column, TURN[unit]) for column in columns], dtype=np.int64)


def _count_wraps(values: FloatArray, turn: float) -> int:
    steps, slack = np.abs(np.diff(values)), MAX_WRAP_DEVIATION * turn
    rows = np.flatnonzero(steps >= turn - slack)  # few: what is done with all steps costs most
    off = np.abs(steps[rows] - turn * np.clip(np.rint(steps[rows] / turn), 1, 2))
    rows, off = rows[off <= slack], off[off <= slack]
    steps[rows] = 0.0
    rest = len(steps) - len(rows)
    small = np.count_nonzero(steps <= slack) - len(rows)
    if not len(rows) or not rest or small <= int(0.9 * (rest - 1)):
        return 0
    rows = rows[off <= 2 * steps.max()]
    gaps = np.diff(rows, prepend=-2, append=len(values) + 1)
    return int(np.count_nonzero((gaps[:-1] > 1) & (gaps[1:] > 1)))


@np.errstate(over="ignore", invalid="ignore")
def too_fast_as_radians(values: FloatArray, t_ns: IntArray | None) -> str | None:
    """Return why values are unlikely in rad: only in deg are they as slow as a joint; None if they may be.

    They are in the file's own units, shape (n, columns), at times in [ns], shape (n,), or None.
    """
    if t_ns is None or peak(values) <= math.tau:
        return None
    speed = max(_usual_speed(column, t_ns) for column in values.T)
    if np.radians(speed) <= MAX_JOINT_SPEED < speed:
        return f"as rad it would turn at {speed:.3g} rad/s for a tenth of the time"
    return None


def too_far_as_radians(values: FloatArray) -> str | None:
    """Return why values are unlikely in rad and likely in deg: two joints go beyond two turns; or None.

    Whole numbers beyond a turn in deg are counts. In the file's own units, shape (n, columns).
    """
    sizes = sorted(usual_peak(column[:, np.newaxis]) for column in values.T)
    known = values[np.isfinite(values)]
    are_counts = sizes[-1] > 360 and bool((known % 1 == 0).all())
    if len(sizes) < 2 or sizes[-2] <= TWO_TURNS or sizes[-1] > np.degrees(ONE_TURN) or are_counts:
        return None
    return f"as rad values of {sizes[-1]:.6g} and {sizes[-2]:.6g} are more than two turns"


def peak(values: FloatArray) -> float:
    """Return the largest absolute value in any unit, of any shape but empty; NaN if there is none."""
    largest = max(values.max(), -values.min())
    if np.isnan(largest):  # slower, but deaf to NaN
        largest = max(np.fmax.reduce(values, axis=None), -np.fmin.reduce(values, axis=None))
    return float(largest)


def usual_peak(values: FloatArray) -> float:
    """Return the absolute value that a column exceeds in one row of a hundred, the largest of all columns.

    A spike is not among them. In any unit, shape (n, columns).
    """
    some = np.abs(values[:: max(1, len(values) // MAX_SIZE_ROWS)])
    return max((_quantile(column[~np.isnan(column)], 0.99) for column in some.T), default=0.0)


def _quantile(values: FloatArray, share: float) -> float:
    """Return the value below which a share of some values is; 0 without values."""
    at = int(share * (len(values) - 1)) if len(values) else 0
    return float(np.partition(values, at)[at]) if len(values) else 0.0  # np.quantile imports numpy.ma


def _usual_speed(column: FloatArray, t_ns: IntArray) -> float:
    """Return the speed that is exceeded in a tenth of the steps, per second.

    Rows that are closer in time than the rows around them are taken to be as far apart as these.
    """
    dt = np.diff(t_ns) * 1e-9
    if not len(dt):
        return 0.0
    starts = np.arange(0, len(dt), SPEED_WINDOW)
    counts = np.diff(np.append(starts, len(dt)))
    around = np.repeat(np.add.reduceat(dt, starts) / counts, counts)
    rates = np.abs(np.diff(column)) / np.maximum(dt, around)
    return _quantile(rates[np.isfinite(rates)], 0.9)
