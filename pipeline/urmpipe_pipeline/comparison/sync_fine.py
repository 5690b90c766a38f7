"""The offset between two clocks to a small part of a period: Gauss-Newton about a coarse one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import fit_rotation
from urmpipe_pipeline.comparison.sync_coarse import Peak, Rates, rates, similarity
from urmpipe_pipeline.comparison.sync_views import View
from urmpipe_pipeline.runs.grid import interpolate

MOST = 1 << 15
"""Samples of the log that are looked at, evenly taken: more tell little more."""

STEPS = 30
"""Steps of the iteration at most; it takes about five."""

BLOCKS = 20
"""Blocks in time that the standard error is taken from."""

LEAST = 8
"""Samples that both sides must have for an estimate: fewer do not tell its error."""

TELLS = 1e-6
"""Share of the energy of the rates that no constant, turn or tool explains: with less, the offset is one of
these too."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """An offset between two clocks.

    Attributes:
        offset: t_reference - t_log in [s].
        precision: Its standard error in [s]; infinite where the motion does not tell it.
        similarity: How alike the two motions are there, -1 to 1.
    """

    offset: float
    precision: float
    similarity: float


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """reference(t + offset) - log(t) = nuisance + rate * step, with the nuisance taken out.

    Attributes:
        residual: The left side in [rad] or [m], shape (n, k).
        rate: Rate of the reference in [rad/s] or [m/s], shape (n, k): what the residual grows by with the
            offset.
        energy: Sum of the squares of the rate before anything was taken out.
    """

    residual: FloatArray
    rate: FloatArray
    energy: float

    @property
    def known(self) -> float:
        """Sum of the squares of what is left of the rate."""
        return float((self.rate**2).sum())


def refine(view: View, found: Rates, peak: Peak) -> Estimate:
    """Return the offset near a coarse one that explains one motion by the other best.

    In each step reference(t_log + offset) = log(t_log) + constant + rate * step is solved for the step by
    least squares, with one constant a channel, a turn where frames may be turned, and a tool where one is
    not known. The rates are those of the coarse stage, whose noise has little to do with that of a sample.
    """
    offset_ns = float(peak.offset_ns)
    for _ in range(STEPS):
        line = line_at(view, found, round(offset_ns))
        if line.known <= TELLS * line.energy:
            return _lost(peak)
        step_ns = -1e9 * float((line.rate * line.residual).sum()) / line.known
        offset_ns += step_ns
        if abs(offset_ns - peak.offset_ns) > 2 * found.period_ns:
            return _lost(peak)
        if abs(step_ns) < 1.0:
            break
    precision = _precision(line)
    if precision > found.period_ns / 1e9 or abs(step_ns) > max(1.0, 1e9 * precision):
        return _lost(peak)
    return Estimate(round(offset_ns) / 1e9, precision, _similarity_at(view, found, round(offset_ns)))


def _lost(peak: Peak) -> Estimate:
    """Return what is known of a peak that the motion does not tell closer."""
    return Estimate(peak.offset_ns / 1e9, np.inf, peak.similarity)


def line_at(view: View, found: Rates, offset_ns: int) -> Line:
    """Return the equation for a step from an offset, at the samples of the log that both sides have.

    The rates are in [rad/s] or [m/s], the offset is t_reference - t_log in integer [ns].
    """
    thinned = slice(None, None, -(-len(view.log_ns) // MOST))
    at_ns = view.log_ns[thinned] + offset_ns
    middles = found.reference_ns[:-1] + found.period_ns // 2
    reference = interpolate(at_ns, view.reference_ns, view.reference)
    parts = [reference, view.log[thinned], interpolate(at_ns, middles, found.reference)]
    if view.tool_axes is not None:
        parts += list(np.moveaxis(view.tool_axes[thinned], 2, 0))
    both = np.all([np.isfinite(part).all(axis=1) for part in parts], axis=0)
    if np.count_nonzero(both) < LEAST:
        return Line(np.empty((0, 1)), np.empty((0, 1)), 0.0)
    energy = float((parts[2][both] ** 2).sum())
    reference, log, rate, *nuisance = (part[both] - part[both].mean(axis=0) for part in parts)
    if view.turned:
        turn = fit_rotation(reference.T @ log)[0].T
        log = log @ turn
        nuisance = [*(np.cross(axis, log) for axis in np.eye(3)), *(part @ turn for part in nuisance)]
    residual, rate = (_without(part, nuisance) for part in (reference - log, rate))
    return Line(residual, rate, energy)


def _without(values: FloatArray, nuisance: Sequence[FloatArray]) -> FloatArray:
    """Return what no combination of some columns explains of values, all of shape (n, k)."""
    if not nuisance:
        return values
    columns = np.column_stack([part.ravel() for part in nuisance])
    weights = np.linalg.pinv(columns.T @ columns) @ (columns.T @ values.ravel())
    return np.asarray(values - (columns @ weights).reshape(values.shape))


def _precision(line: Line) -> float:
    """Return the standard error of the offset in [s], from blocks in time.

    What is left over deviates in whole stretches, not from sample to sample: the blocks are taken to be
    independent of each other, the samples in a block are not.
    """
    scores = (line.rate * line.residual).sum(axis=1)
    blocks = min(BLOCKS, len(scores))
    sums = np.array([block.sum() for block in np.array_split(scores, blocks)])
    return float(np.sqrt((sums**2).sum() * blocks / (blocks - 1))) / line.known


def _similarity_at(view: View, found: Rates, offset_ns: int) -> float:
    """Return how alike the motions are at an offset."""
    reference = interpolate(found.log_ns + offset_ns, view.reference_ns, view.reference)
    return similarity(rates(reference, found.period_ns), found.log, view.turned)
