"""Time: the offset between the clocks of two logs of one motion, t_reference = t_log + offset.

1. `stamp_offset`: Unix times or dates on both sides give it exactly where they overlap.
2. `synchronise` takes it from there, from the user, or from the motion (auto), in these steps:
3. `iter_channels`: joints, then positions as they are, then positions in any frame.
4. `mean_rates`: rates over the shortest period that shows the motion and not the noise.
5. `find_peaks`: similarity s = 2 sum(a b) / (sum(a a) + sum(b b)) of the rates a, b at every offset, by FFT.
6. `refine`: Gauss-Newton about each peak, with the standard error from blocks in time.
7. The best peak is the offset if it is similar enough and no other explains the motion nearly as well.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError
from urmpipe_models.math3d import fit_rotation, to_matrices
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import JointLog, LogWarning
from urmpipe_pipeline.logs.clock_columns import EPOCH
from urmpipe_pipeline.logs.formats.clock_forms import DATE
from urmpipe_pipeline.logs.timestamps import REBUILT, SPREAD, ZONED
from urmpipe_pipeline.runs.grid import interpolate
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import AlignMode, Sync, Trajectory, extent, joint_order, run_finding

SyncOption: TypeAlias = Literal["stamps", "start", "auto"] | float

MAX_OFFSET = 1e9  # s, that integers of 64 bits in [ns] can add to any time of a log: 30 years
STILL = 1e-6  # rad or m, the extent below which nothing moves: no arm repeats a pose as well

# Of pairs of random motions of 20 s (sums of sines, moves with rests) the best similarity of any offset was
# 0.48 at most by six joints, 0.75 by positions. Of 720 pairs of random motions of 5 to 60 s six passed
# MIN_SIMILARITY and MIN_ADVANTAGE, all of them positions over 5 s or less, of a few moves.
MIN_SIMILARITY = 0.8  # below, two motions are not the same
CERTAIN_SIMILARITY = 0.9  # below, a warning: where the coarse stage suppresses noise, noise alone leaves more
MIN_ADVANTAGE = 2.0  # an offset is better than another if it leaves less than 1 / this unexplained
FLOOR = 1e-3  # 1 - similarity that lines between samples, rounding and noise may make of one motion
ENOUGH = 0.99  # similarity above which no other channels can be clearly better: they are not searched
CERTAIN = 0.1  # share of the log's period below which the standard error is no warning
MAX_LISTED = 5  # offsets in a message, the best ones

MAX_COARSE_SAMPLES = 1 << 17  # of the longer side, so that a million stay quick: 40 ms apart in 1.5 hours
MIN_COARSE_SAMPLES = 32  # that the shorter side keeps when the period is doubled
# Doubling the period takes more than the rest of the energy of the rates from a motion with fewer than 22
# samples per cycle, and from noise with 3 % of the energy (of white noise it leaves a quarter).
MIN_ENERGY_KEPT = 0.98
# Share of the energy of one motion that both sides must have: with less, a part of a motion looks like many
# others, and two intervals of rest look the same.
MIN_OVERLAP = 0.5
SEPARATE = 1.25  # factor by which 1 - similarity grows between two peaks that count as two
# A peak is refined if 1 - similarity exceeds twice that of the best by no more than this: between two lags of
# the coarse stage a peak loses a few hundredths.
NEAR = 0.1
MAX_PEAKS = 6  # refined, the highest ones

MAX_FINE_SAMPLES = 1 << 15  # of the log in the fit, evenly spaced
MAX_STEPS = 30  # of Gauss-Newton, which takes about five
BLOCKS = 20  # in time, from which the standard error is taken
MIN_FINE_SAMPLES = 8  # that both sides must have: fewer do not determine the standard error
# Share of the energy of the rates that no constant, rotation or tool explains: below, the offset is not
# distinguishable from these.
MIN_RATE_LEFT = 1e-6

ALLOWED = "one motion that does not repeat itself, at least half of it on both sides"
STAMPS = "Unix times or dates on both sides that overlap, a time for each row"
BY_MOTION = Hint("sync", "auto", "estimates the offset from the motion")
BY_HAND = (Hint("sync", "start", "aligns the first samples"), Hint("sync", None, "sets the offset"))


class Channels(NamedTuple):
    """The same channels of two motions.

    Attributes:
        by: What the channels are.
        turned: Whether the frames of the two sides may be rotated against each other; of positions.
        reference_ns: Times of the reference in integer [ns], shape (n,).
        reference: Its channels in [rad] or [m], shape (n, k).
        log_ns: Times of the log in integer [ns], shape (m,).
        log: Its channels in [rad] or [m], shape (m, k).
        tool_axes: Axes of the log's tool as the columns of rotation matrices [-], shape (m, 3, 3), where the
            tool between the two sides is unknown; else None.
    """

    by: Literal["joints", "position"]
    turned: bool
    reference_ns: IntArray
    reference: FloatArray
    log_ns: IntArray
    log: FloatArray
    tool_axes: FloatArray | None = None


class Rates(NamedTuple):
    """Mean rates of both sides over periods of the same length, which suppresses noise.

    Attributes:
        period_ns: The period in integer [ns].
        reference_ns: The ends of the reference's periods in integer [ns], shape (n + 1,).
        reference: Rates in [rad/s] or [m/s], shape (n, k); NaN where a sample is missing.
        log_ns: The ends of the log's periods in integer [ns], shape (m + 1,).
        log: Rates in [rad/s] or [m/s], shape (m, k); NaN where a sample is missing.
    """

    period_ns: int
    reference_ns: IntArray
    reference: FloatArray
    log_ns: IntArray
    log: FloatArray


class OffsetEstimate(NamedTuple):
    """An offset t_reference - t_log in [s], its standard error (inf if unknown), and the similarity there."""

    offset: float
    precision: float
    similarity: float


class LinearisedOffset(NamedTuple):
    """reference(t + offset) - log(t) = nuisance + rate * step, with the nuisance projected out.

    Attributes:
        residual: The left side in [rad] or [m], shape (n, k).
        rate: Derivative of the residual by the offset in [rad/s] or [m/s], shape (n, k).
        energy: Sum of the squares of the rate before the projection.
    """

    residual: FloatArray
    rate: FloatArray
    energy: float


class _Failure(NamedTuple):
    """Why some channels determine no offset, and the best similarity of any."""

    message: str
    similarity: float = -1.0


def check_sync(option: SyncOption | None) -> None:
    """Raise an `OptionError` if there is no such way to align clocks."""
    if isinstance(option, (int, float)):
        known = abs(option) < MAX_OFFSET
    else:
        known = option in (None, "stamps", "start", "auto")
    if not known:
        allowed = f"stamps, start, auto, or a time in s below {MAX_OFFSET:g}"
        raise OptionError(Finding(parameter="sync", found=str(option), allowed=allowed))


def stamp_offset(reference: Run, log: Run) -> float | str:
    """Return t_reference - t_log in [s], from their first rows, by absolute stamps; or why there is none.

    Stamps are Unix times and dates, of 2000 to 2100. Dates without a time zone are comparable with each other
    alone. Sets of columns of one file share its clock, whatever it counts from.
    """
    offset_ns = log.log.clock_start_ns - reference.log.clock_start_ns
    if reference.log.files and reference.log.files == log.log.files:
        return offset_ns / 1e9
    zones = [(run.name, _time_zone(run.log)) for run in (reference, log)]
    if unknown := [name for name, zone in zones if zone is None]:
        return f"neither Unix times nor dates in {text.join_list(unknown)}"
    if zones[0][1] != zones[1][1]:
        return " and ".join(f"times {zone} in {name}" for name, zone in zones)
    for run in (reference, log):
        if any(warning.kind in (REBUILT, SPREAD) for warning in run.log.warnings):
            return f"times that several rows share in {run.name}"
    t_ns = log.log.t_ns + offset_ns
    inside = np.count_nonzero((t_ns >= 0) & (t_ns <= reference.log.t_ns[-1]))
    # Two: the last stamp of a file may be the first of the next.
    if inside < min(2, log.log.rows, reference.log.rows):
        return f"no time in both: {log.name} begins {offset_ns / 1e9:.6g} s after {reference.name}"
    return offset_ns / 1e9


def _time_zone(log: JointLog) -> str | None:
    """Return how the stamps of a log count; None if its clock has no fixed start."""
    if any(column.role == "time" and column.unit == DATE for column in log.columns):
        zoned = any(inference.kind == ZONED for inference in log.inferences)
        return "in UTC" if zoned else "without a time zone"
    return "in UTC" if log.timed and EPOCH[0] <= log.clock_start <= EPOCH[1] else None


def synchronise(
    reference: Trajectory,
    log: Trajectory,
    option: SyncOption | None,
    align: AlignMode = "none",
    stamped: float | str = "no stamps",
) -> Sync:
    """Return the alignment of the clocks of a log and the reference.

    auto correlates the rates of both sides over all offsets and refines the best one. It uses the joints
    where both sides have the same number of them, unless the positions are clearly more similar (two arms may
    follow one path with other joints). Where the two are in space does not matter.

    Args:
        reference: The reference.
        log: The log.
        option: stamps, start, auto, or the offset in [s]: t_reference = t_log + offset. None: stamps where
            they give an offset, else start.
        align: How the log will be moved in space.
        stamped: The offset by absolute stamps in [s], or why they give none.

    Raises:
        LogError: If the motion does not determine the offset: there is none, it repeats itself, it is too
            even, or the two sides are not one motion. Of stamps: if they give none.
    """
    if option is None:
        one_clock = stamped == 0.0 and reference.files == log.files  # two sets of columns of one file
        option = "start" if one_clock or isinstance(stamped, str) else "stamps"
    if option == "start":
        return Sync()
    if option == "stamps":
        if isinstance(stamped, str):
            raise LogError(_undetermined(log, "stamps", stamped, STAMPS, BY_MOTION, *BY_HAND))
        return Sync("stamps", stamped)
    if option != "auto":
        return Sync("given", float(option))
    best: OffsetEstimate | None = None
    by = ""
    failures: list[_Failure] = []
    for channels in iter_channels(reference, log, align):
        estimate = _estimate_offset(channels, reference.name)
        if isinstance(estimate, _Failure):
            failures.append(estimate)
        elif best is None or MIN_ADVANTAGE * _unexplained(estimate) < _unexplained(best):
            best, by = estimate, channels.by
        if best is not None and best.similarity > ENOUGH:
            break
    if best is None:
        message = max(failures, key=lambda failure: failure.similarity).message
        raise LogError(_undetermined(log, "auto", message, ALLOWED, *BY_HAND))
    return Sync("auto", best.offset, by, best.precision, best.similarity)


def _undetermined(log: Trajectory, option: str, motion: str, allowed: str, *hints: Hint) -> Finding:
    file = log.files[0].name if log.files else log.name
    return Finding(option, file, parameter="sync", found=motion, allowed=allowed, hints=hints)


def iter_channels(reference: Trajectory, log: Trajectory, align: AlignMode) -> Iterator[Channels]:
    """Yield the channels of two trajectories, those that assume least about frames and tools first.

    Joints do not depend on frames, structure or tools. Positions do: they are taken as they are, unless the
    alignment that follows would rotate the log anyway (start, rigid, base+tool), and last as if the frames
    were rotated; with the alignments `tool` and `base+tool` the tool is unknown.
    """
    order = joint_order(reference.joints, log.joints)
    if order is not None and reference.q is not None and log.q is not None:
        yield Channels("joints", False, reference.t_ns, reference.q[:, order], log.t_ns, log.q)
    positions = reference.t_ns, reference.position, log.t_ns, log.position
    axes = None if "tool" not in align or log.quat_xyzw is None else to_matrices(log.quat_xyzw)
    if align in ("none", "tool"):
        yield Channels("position", False, *positions, axes)
    yield Channels("position", True, *positions, axes if align == "base+tool" else None)


def _estimate_offset(channels: Channels, reference: str) -> OffsetEstimate | _Failure:
    """Return the offset that some channels determine, or why they determine none."""
    by = channels.by
    for side, values in ((reference, channels.reference), ("this log", channels.log)):
        if extent(values) <= STILL:
            return _Failure(f"no motion of the {by} in {side}")
    rates = mean_rates(channels)
    peaks = find_peaks(rates, channels.turned) if rates else []
    if rates is None or not peaks:
        return _Failure(f"no offset at which the motion of the {by} agrees with {reference}")
    estimates = sorted((refine(channels, rates, *peak) for peak in peaks), key=lambda at: -at.similarity)
    best = estimates[0]
    at_best = f"{best.offset:.6g} s with a similarity of {best.similarity:.3f}"
    if best.similarity < MIN_SIMILARITY:
        message = f"too low a similarity of the {by} to {reference}: {at_best} at best"
        return _Failure(f"{message}, where {MIN_SIMILARITY:g} is needed", best.similarity)
    if not np.isfinite(best.precision):
        return _Failure(f"no clear best offset to {reference} by the {by}: about {at_best}", best.similarity)
    limit, distance = MIN_ADVANTAGE * _unexplained(best), 2e-9 * rates.period_ns
    rivals = [
        estimate
        for estimate in estimates[1:]
        if _unexplained(estimate) < limit and abs(estimate.offset - best.offset) > distance
    ]
    if not rivals:
        return best
    equal = sorted([best, *rivals], key=lambda at: (-round(at.similarity, 3), abs(at.offset)))
    listed = ", ".join(f"{at.offset:.6g} s ({at.similarity:.3f})" for at in equal[:MAX_LISTED])
    message = f"a motion of the {by} that several offsets to {reference} explain equally well (similarity)"
    return _Failure(f"{message}: {listed}", best.similarity)


def _unexplained(estimate: OffsetEstimate) -> float:
    """Return how much of a motion another leaves unexplained, FLOOR to 2."""
    return 1.0 - estimate.similarity + FLOOR


def mean_rates(channels: Channels) -> Rates | None:
    """Return the rates of both sides, over the shortest period that shows the motion and not the noise.

    Revolute and prismatic joints count the same at 1 rad/s and 1 m/s: an arm is about 1 m long. None if a
    side has fewer than three samples, or is too short for a period of the other.
    """
    sides = ((channels.reference_ns, channels.reference), (channels.log_ns, channels.log))
    if min(len(t_ns) for t_ns, _ in sides) < 3:
        return None
    spans = [int(t_ns[-1] - t_ns[0]) for t_ns, _ in sides]
    period = max(*(float(np.median(np.diff(t_ns))) for t_ns, _ in sides), max(spans) / MAX_COARSE_SAMPLES)
    if min(spans) < 2.0 * period:
        return None
    base = min(int(np.ceil(period)), min(spans) // 2)
    levels = max(int(np.log2(max(min(spans) / base / MIN_COARSE_SAMPLES, 1.0))), 0)
    times = [np.arange(t_ns[0], t_ns[-1] + 1, base, dtype=np.int64) for t_ns, _ in sides]
    values = [interpolate(at, *side) for at, side in zip(times, sides, strict=True)]

    def energy_kept(side: FloatArray, stride: int) -> float:
        """Return the share of the energy of the rates that is left when the period is doubled."""
        single, double = (np.diff(side[::step], axis=0) / step for step in (stride, 2 * stride))
        energies = [np.nanmean(part**2) if np.isfinite(part).any() else 0.0 for part in (single, double)]
        return float(energies[1] / energies[0]) if energies[0] else 1.0

    kept = [min(energy_kept(side, 1 << level) for side in values) for level in range(levels + 1)]
    enough = (level for level, share in enumerate(kept) if share >= MIN_ENERGY_KEPT)
    stride = 1 << next(enough, int(np.argmax(kept)))
    reference_ns, log_ns = (side[::stride] for side in times)
    reference, log = (_rates(side[::stride], base * stride) for side in values)
    return Rates(base * stride, reference_ns, reference, log_ns, log)


def _rates(values: FloatArray, period_ns: int) -> FloatArray:
    return np.diff(values, axis=0) / (period_ns / 1e9)


def similarity(reference: FloatArray, log: FloatArray, turned: bool) -> float:
    """Return the similarity of rates at the same times: 2 sum(a b) / (sum(a a) + sum(b b)), -1 to 1.

    1 means the same rates; it is 0 for unrelated rates, and less than 1 also for the same motion with another
    amplitude.

    Args:
        reference: Rates a in [rad/s] or [m/s], shape (n, k).
        log: Rates b in the same unit, shape (n, k).
        turned: Whether b is rotated first, as is best for the similarity.

    Returns:
        The similarity; -1 where no sample has both, or nothing moves.
    """
    both = np.isfinite(reference).all(axis=1) & np.isfinite(log).all(axis=1)
    a, b = reference[both], log[both]
    energy = float((a * a).sum() + (b * b).sum())
    if not energy:
        return -1.0
    products = float(_turned_products((a.T @ b)[np.newaxis])[0]) if turned else float((a * b).sum())
    return min(2.0 * products / energy, 1.0)  # rounding may exceed 1


def find_peaks(rates: Rates, turned: bool) -> list[tuple[int, float]]:
    """Return offsets t_reference - t_log in integer [ns] of the highest similarity, with it, the best first.

    The similarity of every offset is computed from correlations by FFT; missing values, and those beyond an
    end, are masked. An offset counts where both sides together hold a good share of the motion of one.
    """
    similarities = _similarity_by_lag(rates.reference, rates.log, turned)
    # Of peaks without a valley between, the highest is kept.
    distances = 1.0 - np.concatenate(([-1.0], similarities, [-1.0])) + FLOOR
    least = max(1.0 - 2.0 * (1.0 - similarities.max()) - NEAR, 0.0)
    rising = (distances[1:-1] < distances[:-2]) & (distances[1:-1] <= distances[2:])
    tops = np.flatnonzero(rising & (similarities >= least))
    valleys = np.maximum.reduceat(distances[1:-1], tops) if len(tops) else distances[:0]
    peaks: list[int] = []
    valley = np.inf
    for top, after in zip(tops.tolist(), valleys.tolist(), strict=True):
        if not peaks or valley > SEPARATE * max(distances[1 + top], distances[1 + peaks[-1]]):
            peaks.append(top)
        elif distances[1 + top] < distances[1 + peaks[-1]]:
            peaks[-1] = top
        else:
            valley = max(valley, after)
            continue
        valley = after
    best = sorted(peaks, key=lambda index: -similarities[index])[:MAX_PEAKS]
    zero = int(rates.reference_ns[0] - rates.log_ns[0]) - (len(rates.log) - 1) * rates.period_ns
    return [(zero + index * rates.period_ns, float(similarities[index])) for index in best]


def _similarity_by_lag(a: FloatArray, b: FloatArray, turned: bool) -> FloatArray:
    """Return the similarity of a[i + lag] and b[i] for every lag from -(m - 1) to n - 1; -1 without overlap.

    a and b are rates of shape (n, k) and (m, k); b may be rotated first.
    """
    size = 1 << (len(a) + len(b) - 1).bit_length()
    known = [np.asarray(np.isfinite(side).all(axis=1)) for side in (a, b)]
    filled = [np.where(mask[:, np.newaxis], side, 0.0) for side, mask in zip((a, b), known, strict=True)]
    power = [(side**2).sum(axis=1) for side in filled]
    if not all(side.any() for side in power):
        return np.full(len(a) + len(b) - 1, -1.0)
    of_a, of_b = (np.fft.rfft(side, size, axis=0) for side in filled)
    masks = [np.fft.rfft(mask.astype(np.float64), size) for mask in known]
    powers = [np.fft.rfft(side, size) for side in power]

    def by_lag(spectrum: NDArray[np.complex128]) -> FloatArray:
        correlation = np.fft.irfft(spectrum, size)
        return np.asarray(np.concatenate((correlation[size - len(b) + 1 :], correlation[: len(a)])))

    energy_a, energy_b = by_lag(powers[0] * masks[1].conj()), by_lag(masks[0] * powers[1].conj())
    enough = (energy_a >= MIN_OVERLAP * power[0].sum()) | (energy_b >= MIN_OVERLAP * power[1].sum())
    if turned:
        crossed = [[by_lag(of_a[:, i] * of_b[:, j].conj())[enough] for j in range(3)] for i in range(3)]
        products = _turned_products(np.moveaxis(np.array(crossed), 2, 0))
    else:
        products = by_lag((of_a * of_b.conj()).sum(axis=1))[enough]
    result = np.full(len(enough), -1.0)
    result[enough] = 2.0 * products / (energy_a[enough] + energy_b[enough])
    return result


def _turned_products(crossed: FloatArray) -> FloatArray:
    """Return the largest sum of products a . R b over all rotations R: s1 + s2 + sign(det H) s3.

    H is sum(a b^T), shape (n, 3, 3), and s its singular values.

    Source: Kabsch, W.: A solution for the best rotation to relate two sets of vectors, 1976.
    """
    sizes = np.linalg.svd(crossed, compute_uv=False)
    return np.asarray(sizes[:, 0] + sizes[:, 1] + np.sign(np.linalg.det(crossed)) * sizes[:, 2])


def refine(channels: Channels, rates: Rates, start_ns: int, coarse: float) -> OffsetEstimate:
    """Return the offset near a coarse one, in integer [ns], at which one motion explains the other best.

    In each step reference(t_log + offset) = log(t_log) + constant + rate * step is solved for the step by
    least squares, with one constant per channel, a rotation where frames may be rotated, and a tool where it
    is unknown. The rates are those of the coarse stage, whose noise has little to do with that of a sample.

    The standard error is that of blocks in time: the residual deviates over whole intervals, not from sample
    to sample, so blocks are taken as independent of each other, samples in a block are not.
    """
    undetermined = OffsetEstimate(start_ns / 1e9, np.inf, coarse)
    offset_ns = float(start_ns)
    for _ in range(MAX_STEPS):
        line = linearise(channels, rates, round(offset_ns))
        rate_left = float((line.rate**2).sum())
        if rate_left <= MIN_RATE_LEFT * line.energy:
            return undetermined
        step_ns = -1e9 * float((line.rate * line.residual).sum()) / rate_left
        offset_ns += step_ns
        if abs(offset_ns - start_ns) > 2 * rates.period_ns:
            return undetermined
        if abs(step_ns) < 1.0:
            break
    scores = (line.rate * line.residual).sum(axis=1)
    blocks = min(BLOCKS, len(scores))
    sums = np.array([block.sum() for block in np.array_split(scores, blocks)])
    precision = float(np.sqrt((sums**2).sum() * blocks / (blocks - 1))) / rate_left
    if precision > rates.period_ns / 1e9 or abs(step_ns) > max(1.0, 1e9 * precision):
        return undetermined
    at_ns = rates.log_ns + round(offset_ns)
    reference = _rates(interpolate(at_ns, channels.reference_ns, channels.reference), rates.period_ns)
    return OffsetEstimate(
        round(offset_ns) / 1e9, precision, similarity(reference, rates.log, channels.turned)
    )


def linearise(channels: Channels, rates: Rates, offset_ns: int) -> LinearisedOffset:
    """Return the equation for a step from an offset, at the samples of the log that both sides have.

    The rates are in [rad/s] or [m/s], the offset is t_reference - t_log in integer [ns].
    """
    thinned = slice(None, None, -(-len(channels.log_ns) // MAX_FINE_SAMPLES))
    at_ns = channels.log_ns[thinned] + offset_ns
    middles = rates.reference_ns[:-1] + rates.period_ns // 2
    reference = interpolate(at_ns, channels.reference_ns, channels.reference)
    parts = [reference, channels.log[thinned], interpolate(at_ns, middles, rates.reference)]
    if channels.tool_axes is not None:
        parts += list(np.moveaxis(channels.tool_axes[thinned], 2, 0))
    both = np.all([np.isfinite(part).all(axis=1) for part in parts], axis=0)
    if np.count_nonzero(both) < MIN_FINE_SAMPLES:
        return LinearisedOffset(np.empty((0, 1)), np.empty((0, 1)), 0.0)
    energy = float((parts[2][both] ** 2).sum())
    reference, log, rate, *nuisance = (part[both] - part[both].mean(axis=0) for part in parts)
    if channels.turned:
        turn = fit_rotation(reference.T @ log)[0].T
        log = log @ turn
        nuisance = [*(np.cross(axis, log) for axis in np.eye(3)), *(part @ turn for part in nuisance)]
    residual = reference - log
    if nuisance:
        columns = np.column_stack([part.ravel() for part in nuisance])
        inverse = np.linalg.pinv(columns.T @ columns)
        residual, rate = (
            values - (columns @ (inverse @ (columns.T @ values.ravel()))).reshape(values.shape)
            for values in (residual, rate)
        )
    return LinearisedOffset(residual, rate, energy)


def no_common_sample(run: Run, reference: str, sync: Sync) -> Finding:
    """Return the error of a log without a sample at a time of the reference."""
    message = f"found no sample in common with {reference} at a time offset of {sync.offset:.6g} s"
    hints = (BY_MOTION, BY_HAND[0]) if sync.mode in ("given", "stamps") else ()
    return run_finding(run, f"{message}, allowed: samples at common times", *hints)


def sync_warnings(name: str, sync: Sync, period: float) -> list[LogWarning]:
    """Return the warnings about an estimated offset.

    Args:
        name: The log's name.
        sync: The offset.
        period: The log's, in [s].
    """
    offset = f"the offset of {sync.offset:.6g} s, estimated by the {sync.by},"
    warnings = []
    if sync.precision is not None and sync.precision > CERTAIN * period:
        error = f"is known to +-{text.format_standard_error(sync.precision)} (standard error)"
        message = f"{offset} {error}; the period is {1e3 * period:.6g} ms"
        warnings.append(LogWarning("sync-uncertain", message, about=name))
    if sync.similarity is not None and sync.similarity < CERTAIN_SIMILARITY:
        message = f"{offset} gives a similarity of {sync.similarity:.2f} only, of 1"
        message += ": the logs may show different motions"
        warnings.append(LogWarning("sync-unlike", message, about=name))
    return warnings
