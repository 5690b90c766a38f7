"""The motion of a log as the checks look at it: values, times, and what is told of them cheaply."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import FloatArray, IntArray, row_blocks
from urmpipe_pipeline.joint_log import JointLog

COARSEST = 0.02
"""No number format is taken to be coarser than this in [rad] or [m]: whole degrees are finer."""

_SIDE_BY_SIDE = 64


@dataclass(frozen=True, slots=True, eq=False)
class JointMotion:
    """What the checks look at.

    Attributes:
        names: The joints.
        units: rad or m for each.
        q: Joint values, repolarized, in [rad] or [m], shape (n, joints), n > 1; NaN where one is missing.
        t_ns: Times in [ns], shape (n,), strictly increasing.
        period: Median time between rows in [s].
        inner: Largest step of each joint between rows other than the first and the last, in [rad] or [m],
            shape (joints,); NaN where a value is missing.
        fineness: How far apart the file's number format lets two values of each joint be, in [rad] or [m],
            shape (joints,).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    q: FloatArray
    t_ns: IntArray
    period: float
    inner: FloatArray
    fineness: FloatArray

    @classmethod
    def of(cls, log: JointLog, q: FloatArray, turning: NDArray[np.bool_]) -> JointMotion:
        """Return the motion of a log.

        Its joints, repolarized, are in [rad] or [m], shape (n, joints); which turn, shape (joints,).
        """
        inner = largest_steps(q[1:-1]) if len(q) > 3 else np.zeros(q.shape[1])
        units = tuple("rad" if turns else "m" for turns in turning)
        return cls(log.joints, units, q, log.t_ns, log.period, inner, format_steps(log))

    @property
    def ends(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """The first and the last row, each with the row beside it."""
        last = len(self.q) - 1
        return (0, 1), (last, last - 1)


def largest_steps(q: FloatArray) -> FloatArray:
    """Return the largest step of each column from row to row, shape (joints,); NaN if a value is missing.

    Steps and q, shape (n, joints), n > 1, are in [rad] or [m].
    """
    blocks = row_blocks(len(q) - 1)
    steps = [over_rows(np.maximum, np.abs(q[1:][block] - q[:-1][block])) for block in blocks]
    return np.asarray(np.max(steps, axis=0))


def format_steps(log: JointLog) -> FloatArray:
    """Return how far apart the file's number format lets two values of a joint be, in SI, shape (joints,).

    Seen in samples of the values: the decimals that they all get by with, or the significant digits where
    the file was seen to be quantised; 0 for a format that is finer than matters.
    """
    columns = {column.name: column for column in log.columns if column.role == "joint"}
    rows = np.linspace(0, len(log.q) - 1, 256).astype(np.int64)
    steps = np.zeros(len(log.joints))
    for j, name in enumerate(log.joints):
        if name in columns:
            factor, offset = columns[name].factor, columns[name].offset
            written = log.q[rows, j] / factor - offset  # but for the sign
            steps[j] = min(_format_step(written[~np.isnan(written)], log.digits) * factor, COARSEST)
    return steps


def _format_step(written: FloatArray, digits: int | None) -> float:
    """Return the step of the format of some values in the file's own unit."""
    if digits is not None:
        largest = np.abs(written).max(initial=0.0)
        return float(10.0 ** (np.floor(np.log10(largest)) + 1 - digits)) if largest > 0.0 else 0.0
    for decimals in range(5):
        scaled = written * 10.0**decimals
        if np.allclose(scaled, np.rint(scaled), rtol=0.0, atol=1e-6):
            return float(10.0**-decimals)
    return 0.0


def over_rows(fold: np.ufunc, values: FloatArray) -> FloatArray:
    """Fold the rows into one, many side by side: NumPy is slow over rows as short as a log's.

    Values are in any unit, shape (n, columns), the row is of shape (columns,).
    """
    count, joints = values.shape
    whole = count - count % _SIDE_BY_SIDE
    if whole == 0:
        return np.asarray(fold.reduce(values, axis=0))
    wide = fold.reduce(values[:whole].reshape(-1, _SIDE_BY_SIDE * joints), axis=0)
    return np.asarray(fold.reduce(np.vstack((wide.reshape(-1, joints), values[whole:])), axis=0))
