"""Inverse kinematics of any chain, iteratively: many targets at once, each from a start of its own.

With e the miss (target minus tool; the rotation vector times a length l, `turn_length`) and J its
Jacobian, both in the world, a step is

    Levenberg-Marquardt      dq = J^T (J J^T + mu I)^-1 e, mu = g |e|^2, g by the gain ratio of each row
    damped least squares     the same with mu constant
    pseudoinverse            dq = J^+ e                                   (Moore-Penrose)

The first converges quadratically where the target can be met off singular poses, and to the nearest
point, in the sense of least |e|, where it cannot. The other two are CoppeliaSim's, which the paper's joint
values come from. Where a target leaves freedoms, what is met is brought to the point of least motion (see
`least_motion`).

Sources: [UrmArm2021]_ section 1; [Wampler1986]_; [NakamuraHanafusa1986]_; [FanYuan2005]_ (mu = g |e|^2);
[KanzowYamashitaFukushima2004]_ (projected steps).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, IndexArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.errors import Finding, OptionError, shown
from urmpipe_models.inverse.iterative.descent import (
    METHODS,
    STATIONARY,
    Method,
    Progress,
    Settings,
    descend,
)
from urmpipe_models.inverse.iterative.least_motion import settle
from urmpipe_models.inverse.iterative.small_systems import rows_of
from urmpipe_models.inverse.iterative.task import redundancy, task_of, turn_length
from urmpipe_models.inverse.limits import limits_of, periods
from urmpipe_models.inverse.targets import Targets
from urmpipe_models.row_blocks import THREADS, row_blocks, side_by_side

BLOCK = 4096
"""Rows of a block: its hundred or so arrays stay in a core's cache."""

ROUND = 6
"""Steps after which the rows of all blocks that are still on their way are gathered into new blocks."""


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
    """Where the rows of a batch came to.

    Attributes:
        q: Joint values in [rad] or [m], within their limits, shape (n, joints).
        converged: True where the tool meets its target, shape (n,).
        iterations: Steps taken, shape (n,).
        distance: |target - tool| in [m], shape (n,).
        angle: Between tool and target in [rad], 0 where any orientation will do, shape (n,).
        residual: |e| = sqrt(distance^2 + (l angle)^2) in [m], shape (n,); NaN of a target that is no number.
        slack: Of an arm with more freedoms than the target takes: the largest entry of t, the way to a point
            of less motion, in [rad] or [m], shape (n,); see `least_motion`.
    """

    q: FloatArray
    converged: BoolArray
    iterations: IndexArray
    distance: FloatArray
    angle: FloatArray
    residual: FloatArray
    slack: FloatArray


def refine(
    chain: Chain,
    targets: Targets,
    q: FloatArray,
    *,
    home: FloatArray | None = None,
    method: Method = "lm",
    metres: float = 1e-10,
    radians: float = 1e-10,
    iterations: int = 100,
    damping: float = 0.05,
    stationary: float = STATIONARY,
    threads: int = THREADS,
) -> Refined:
    """Return joint values that bring the tool to its targets, or as near as can be come from the starts.

    Args:
        chain: The arm.
        targets: n of them.
        q: Where each starts, in [rad] or [m], shape (joints,) or (n, joints); clipped to the limits.
        home: Where least motion counts from, in [rad] or [m], shaped as q; q by default.
        method: lm (Levenberg-Marquardt), dls (damped least squares) or pinv (pseudoinverse).
        metres: The distance from the target that counts as none in [m].
        radians: The angle from the target that counts as none in [rad].
        iterations: The most steps a row takes.
        damping: Of damped least squares: mu = (damping l)^2.
        stationary: A row ends where the cosine between e and what any free joint can change of it is less:
            the smaller, the nearer to the nearest point.
        threads: Blocks worked on side by side.

    Raises:
        OptionError: If the method or the shape of q is none of the above.
    """
    lower, upper = limits_of(chain)
    begin = np.clip(_starts(chain, targets, q, method), lower, upper)
    settings = Settings(lower, upper, method, metres, radians, damping, stationary)
    progress = Progress.at(begin)
    _run(progress, chain, targets, settings, iterations, threads)
    slack = np.zeros(len(targets))
    if redundancy(chain, targets):
        goal = begin if home is None else np.clip(_starts(chain, targets, home, method), lower, upper)
        slack = _settled(progress, chain, targets, goal, settings, threads)
    residual = np.hypot(progress.distance, turn_length(chain) * progress.angle)
    return Refined(
        progress.q.T, progress.arrived, progress.steps, progress.distance, progress.angle, residual, slack
    )


def _starts(chain: Chain, targets: Targets, q: FloatArray, method: str) -> FloatArray:
    """Return one start a target, or say what is wrong with what was given."""
    shape = (len(targets), len(chain.coordinates))
    faults = []
    if method not in METHODS:
        faults.append(Finding(parameter="method", found=shown(method), allowed=", ".join(METHODS)))
    if np.shape(q) not in {shape, shape[1:]}:
        found, allowed = f"an array of shape {np.shape(q)}", f"{shape[1:]} or {shape}"
        faults.append(Finding(parameter="starts", found=found, allowed=allowed))
    if faults:
        raise OptionError(*faults)
    return np.broadcast_to(np.asarray(q, dtype=float), shape)


def _run(
    progress: Progress, chain: Chain, targets: Targets, settings: Settings, iterations: int, threads: int
) -> None:
    """Take every row to its end, or as many steps as are allowed."""
    pending = np.flatnonzero(_finite(targets) & np.isfinite(progress.q).all(axis=0))

    task = task_of(chain, targets)

    def work(index: IndexArray) -> None:
        """Take the rows of a block some steps further."""
        descend(progress, task.kept(index), index, settings, steps)

    for done in range(0, iterations, ROUND):
        steps = min(ROUND, iterations - done)
        side_by_side(work, [pending[rows] for rows in row_blocks(len(pending), BLOCK)], threads)
        pending = pending[~progress.ended[pending]]
        if not len(pending):
            return


def _finite(targets: Targets) -> BoolArray:
    """Return where a target is made of numbers."""
    finite = np.isfinite(targets.position).all(axis=1)
    if targets.rotation is not None:
        finite &= np.isfinite(targets.rotation).all(axis=(1, 2))
    return np.asarray(finite)


def _settled(
    progress: Progress,
    chain: Chain,
    targets: Targets,
    home: FloatArray,
    settings: Settings,
    threads: int,
) -> FloatArray:
    """Bring the rows that have arrived to the points of least motion; return what is left of t."""
    slack = np.zeros(len(targets))
    arrived = np.flatnonzero(progress.arrived)
    progress.q[:, arrived] -= _turns(chain, progress.q[:, arrived], home.T[:, arrived])

    def work(index: IndexArray) -> None:
        """Settle the rows of a block."""
        task = task_of(chain, targets.rows(index))
        q, to = rows_of(progress.q, index), np.ascontiguousarray(home[index].T)
        progress.q[:, index], slack[index] = settle(task, q, to, settings)

    side_by_side(work, [arrived[rows] for rows in row_blocks(len(arrived), BLOCK)], threads)
    return slack


def _turns(chain: Chain, q: FloatArray, home: FloatArray) -> FloatArray:
    """Return the whole turns in [rad] that joints that turn without end are away from home."""
    period = periods(chain)[:, None]
    endless = np.isfinite(period)
    period = np.where(endless, period, 1.0)
    return np.where(endless, period * np.round((q - home) / period), 0.0)
