"""Assumptions of a verdict, and warnings about it: weak evidence, or the answer to another question.

1. `verdict_assumptions`: assumed readings of what is compared; one that needs an answer is an error.
2. Operands: `swapped_operands`, `same_data`, `large_tolerances`, `large_noises`.
3. Evidence: `left_out_warnings`, `weak_evidence`, `undetermined_frames`.
4. Other verdicts: `clocks_differ` (an offset explains a failure), `recorded_tcp_mismatch`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.errors import Hint, LogError
from urmpipe_models.hand_eye import MIN_SENSITIVITY, UnobservableDirection
from urmpipe_models.measure_units import USUAL_UNITS
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.align import align
from urmpipe_pipeline.comparison.deviation import AXES, Deviation
from urmpipe_pipeline.comparison.sync import BY_HAND, BY_MOTION, synchronise
from urmpipe_pipeline.comparison.verdict import UNITS, format_unseen, tolerance_for
from urmpipe_pipeline.diagnosis.problem import AT_REST
from urmpipe_pipeline.joint_log import LogWarning, Role
from urmpipe_pipeline.provenance import list_assumptions
from urmpipe_pipeline.runs.grid import ROUNDING_NS
from urmpipe_pipeline.runs.recorded_tcp import distances_from_recorded
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import Side, Trajectory, extent, joint_order, match, run_label

SWAPPED = "path-as-log"  # about the order of the operands: no warning about a log
LARGE_NOISE = "large-noise"  # about the noise of a baseline: another baseline has its own
RECORDED_TCP_APART = "recorded-tcp-apart"
CLOCKS_DIFFER = "clocks-differ"

# A late log is on the path, except for noise and the part beyond its ends: with 30 % of the time beyond, the
# ratio is 3. A displaced log has about 1 on a curve.
LATE_RATIO = 3.0  # rms at the same time / rms from the path, from which a log is late
CERTAINLY_LATE_RATIO = 50.0  # without an offset by the motion: no displacement explains it
MAX_RMS_LEFT = 0.5  # share of the rms that an offset leaves if it is the cause
MAX_CALIBRATION = 5e-3  # m, by a controller's calibration: 1.6 mm and 3.7 mm in the logs of two UR5e
STRAIGHT = 0.9999  # component of a unit vector that is an axis of the frame: within a degree
LARGE = {"m": 0.1, "rad": float(np.radians(10.0))}  # above, mm or deg was meant: no arm may deviate by it


def verdict_assumptions(sides: Sequence[tuple[Run, Collection[Role]]]) -> tuple[str, ...]:
    """Return what the verdict on some runs assumes, each once, with the runs where it is not all of them.

    Args:
        sides: The runs that are compared, the reference among them, each with the roles of what is compared.

    Raises:
        LogError: With each reading that needs an answer before a verdict is based on it.
    """
    used = [(run, warning) for run, roles in sides for warning in run.warnings if warning.role in roles]
    if blocking := [(run, warning) for run, warning in used if warning.blocks_verdict]:
        raise LogError(*(replace(warning.as_finding(), file=run_label(run)) for run, warning in blocking))
    assumptions = [(warning.assumption, run.name) for run, warning in used if warning.assumption]
    return list_assumptions(assumptions, {run.name for run, _ in sides})


def swapped_operands(reference: Run, runs: Iterable[Run]) -> Iterator[LogWarning]:
    """Yield a warning for each path that is compared as a log with a reference that has joints."""
    for run in runs:
        if reference.log.joints and not run.log.joints:
            message = f"a path without joints, compared with {reference.name}, which has joints"
            yield LogWarning(SWAPPED, f"{message}: the reference comes first, then the logs", about=run.name)


def same_data(reference: Side, log: Side) -> Iterator[LogWarning]:
    """Yield a warning if a log and its reference have the same times and values, whatever their names.

    Two logs at rest may have these by chance, and have their own warning.
    """
    first, second = reference.trajectory, log.trajectory
    equal = reference.by_joints == log.by_joints and np.array_equal(first.t_ns, second.t_ns)
    equal = equal and np.array_equal(first.position, second.position, equal_nan=True)
    moves = extent(second.position) > 0.0
    order = joint_order(first.joints, second.joints)
    if equal and order is not None and first.q is not None and second.q is not None:
        equal = np.array_equal(first.q[:, order], second.q, equal_nan=True)
        moves = moves or extent(second.q) > 0.0
    if equal and moves:
        message = f"the same data as {first.name}: every time and every value is equal"
        yield LogWarning("same-data", message, about=second.name)


def large_tolerances(tolerance: Mapping[str, float]) -> Iterator[LogWarning]:
    """Yield a warning for each tolerance in [m] or [rad] that was probably meant in another unit."""
    for kind, value in tolerance.items():
        unit = UNITS[kind]
        if value > LARGE.get(unit, np.inf):
            bare, other = f"{value:g}", USUAL_UNITS[unit]
            message = f"a tolerance of {text.format_stated(value, unit)} ({kind}) accepts any deviation"
            hints = (
                Hint("tolerance", f"{kind}={bare}{other}", f"if {other} was meant"),
                Hint("tolerance", f"{kind}={bare}{unit}", "if not"),
            )
            yield LogWarning("large-tolerance", f"{message}: {bare} is in {unit}", hints=hints)


def large_noises(noise: Mapping[str, float], tolerance: Mapping[str, float]) -> Iterator[LogWarning]:
    """Yield a warning for each noise that reaches its tolerance: nothing within that can then be worse.

    The noise is in [m] or [rad], of every kind, perhaps of a coordinate; so is the tolerance.
    """
    for kind, allowed in tolerance.items():
        level = tolerance_for(kind, "axis" if kind in AXES else kind, noise)
        if level is not None and level >= allowed:
            unit = UNITS[kind]
            message = f"a noise of {text.format_stated(level, unit)} ({kind}) reaches the tolerance of"
            why = f"{text.format_stated(allowed, unit)}: nothing within it can be worse than the baseline"
            bare = "a fraction: 0.05 is 5 %" if unit == "1" else f"in {unit}"
            yield LogWarning(LARGE_NOISE, f"{message} {why}; a number without a unit is {bare}")


def left_out_warnings(deviation: Deviation, reference: Trajectory) -> Iterator[LogWarning]:
    """Yield warnings about samples of a log and of the reference that were not compared.

    Samples that an offset moves beyond the reference's time are what `sync` requests, and no warning: the
    shares count them.
    """
    beyond = 0
    if deviation.sync.offset:
        at_ns = deviation.run.on_rows.t_ns + round(deviation.sync.offset * 1e9)
        before, after = at_ns < reference.t_ns[0] - ROUNDING_NS, at_ns > reference.t_ns[-1] + ROUNDING_NS
        beyond = int(np.count_nonzero(before | after))
    if deviation.left_out > beyond:
        samples = deviation.left_out + len(deviation.sample)
        message = f"{deviation.left_out - beyond} of {samples} samples have no reference or no value"
        yield LogWarning("left-out", message, about=deviation.name)
    coverage = deviation.shares["coverage"]
    if coverage.verdict != "fail" and coverage in deviation.incomplete_shares:
        samples_of = f"{coverage.samples} of {format_count(coverage.total, 'sample')} of {reference.name}"
        message = f"it shows {samples_of} ({text.format_percent(coverage.value)}){format_unseen(coverage)}"
        yield LogWarning("not-covered", message, about=deviation.name)


def weak_evidence(deviation: Deviation) -> Iterator[LogWarning]:
    """Yield warnings about a verdict that is based on little: on missing values, or on one pose."""
    partly: dict[int, list[str]] = {}
    for statistics in deviation.all_statistics:
        if statistics.tolerance is not None and statistics.missing:
            partly.setdefault(statistics.samples or 0, []).append(statistics.quantity)
    for samples, quantities in partly.items():
        compared = f"{samples} of {len(deviation.sample)} compared samples"
        message = f"{text.join_list(quantities)}: judged at {compared}"
        yield LogWarning(
            "partly-judged", f"{message}; a sample without a value is out of tolerance", about=deviation.name
        )
    if deviation.run.timed and is_stationary(deviation):
        message = f"{format_count(len(deviation.sample), 'sample')} compared, all in one pose"
        yield LogWarning("one-pose", f"{message}: the verdict is on that pose alone", about=deviation.name)


def is_stationary(deviation: Deviation) -> bool:
    """Return whether tool centre point and joints stay within one pose over the compared samples."""
    if extent(deviation.actual) >= AT_REST:
        return False
    return extent(deviation.run.on_rows.q[deviation.sample]) < AT_REST


def undetermined_frames(deviation: Deviation) -> Iterator[LogWarning]:
    """Yield a warning about components of base and tool that the compared poses do not determine."""
    unobservable = deviation.alignment.unobservable
    undetermined = [direction for direction in unobservable if direction.sensitivity < MIN_SENSITIVITY]
    weak = [direction for direction in unobservable if direction.sensitivity >= MIN_SENSITIVITY]
    parts = []
    if undetermined:
        parts.append(
            f"do not determine {_format_directions(undetermined)}, so the smallest values that fit are used"
        )
    if weak:
        weakly = f"determine {_format_directions(weak)} only weakly"
        parts.append(f"{weakly}, so small errors of the log change the result much")
    if parts:
        message = f"the compared poses {', and '.join(parts)}; more varied poses would determine more"
        yield LogWarning("frames-open", message, about=deviation.name, parameter="align")


def _format_directions(directions: Sequence[UnobservableDirection]) -> str:
    """Return the parts of base and tool, each whole or along and about its axes."""
    texts = []
    for part in dict.fromkeys(direction.part for direction in directions):
        frame, quantity = part.split()
        axes = [direction.axis for direction in directions if direction.part == part]
        of_frame = f"the {quantity} of the {frame}"
        if len(axes) < 3:
            along = "along" if quantity == "offset" else "about"
            of_frame += f" {along} {' and '.join(map(_format_axis, axes))}"
        texts.append(of_frame)
    return " and ".join(texts)


def _format_axis(axis: tuple[float, float, float]) -> str:
    """Return an axis by its letter, or as a vector."""
    largest = max(range(3), key=lambda k: abs(axis[k]))
    if abs(axis[largest]) > STRAIGHT:
        return "xyz"[largest]
    return f"({', '.join(f'{part:.2f}' for part in axis)})"


def is_late(deviation: Deviation) -> bool:
    """Return whether a log fails though it follows the path: it deviates from it in time alone."""
    failed = any(value.verdict == "fail" and value.kind != "path" for value in deviation.all_statistics)
    if not (failed and deviation.statistics and deviation.run.timed) or deviation.diagnosis is not None:
        return False
    norm, path = deviation.statistics["norm"].rms, deviation.statistics["path"].rms
    return deviation.sync.mode != "auto" and norm > LATE_RATIO * path


def clocks_differ(reference: Trajectory, log: Trajectory, deviation: Deviation) -> Iterator[LogWarning]:
    """Yield a warning about a late log: the offset by its motion, or that the motion determines none.

    A log whose motion is in time has another cause, and no warning.
    """
    norm, path = deviation.statistics["norm"].rms, deviation.statistics["path"].rms
    message = f"the clocks differ: {text.format_quantity(norm, 'm')} rms at the same time"
    message += f", but {text.format_quantity(path, 'm')} rms from the path"
    mode = deviation.alignment.mode
    try:
        sync = synchronise(reference, log, "auto", mode)
    except LogError:
        if norm > CERTAINLY_LATE_RATIO * path:
            message += "; the motion determines no offset: one side may be slower"
            yield LogWarning(CLOCKS_DIFFER, message, about=deviation.name, hints=BY_HAND[1:])
        return
    matched = match(reference, log, sync)
    if not len(matched.sample) or abs(sync.offset - deviation.sync.offset) < deviation.run.log.period:
        return
    aligned = align(matched, mode, deviation.run)
    left = float(np.sqrt(np.mean(np.sum((aligned.reference - aligned.actual) ** 2, axis=1))))
    if left < MAX_RMS_LEFT * norm:
        message += f"; an offset of {sync.offset:.6g} s leaves {text.format_quantity(left, 'm')} rms"
        hints = (BY_MOTION, Hint("sync", float(f"{sync.offset:.6g}"), "sets it"))
        yield LogWarning(CLOCKS_DIFFER, message, about=deviation.name, hints=hints)


def recorded_tcp_mismatch(runs: Sequence[Run], allowed: float) -> Iterator[LogWarning]:
    """Yield warnings if logs that are compared by their joints recorded other tool centre points.

    There is one for those that a calibration explains, and one for the others. First rows that are outliers
    have their own, of their log.

    Args:
        runs: The logs.
        allowed: The distance that is allowed, in [m].
    """
    distances = ((run, float(distances_from_recorded(run).max(initial=0.0))) for run in runs)
    distant = [(run, distance) for run, distance in distances if distance > allowed]
    for calibrated in (True, False):
        group = [(run, distance) for run, distance in distant if (distance <= MAX_CALIBRATION) == calibrated]
        if not group:
            continue
        run, distance = group[0]
        limit = text.format_stated(MAX_CALIBRATION)
        cause = f"a calibration explains up to {limit}: check robot, tool and base"
        if calibrated:
            known = "a controller knows the calibration of its arm, this robot model does not"
            cause = f"up to {limit} is usual: {known}"
        basis = "the verdict is on the forward kinematics alone; to compare both, compare"
        if len(group) == 1:
            far = f"up to {text.format_quantity(distance, 'm')} from its recorded tool centre point"
            message = f"by forward kinematics it is {far} ({cause}); {basis} {run.name} alone"
            yield LogWarning(RECORDED_TCP_APART, message, about=run.name)
        else:
            far = text.join_list(
                [f"{run.name} is up to {text.format_quantity(most, 'm')}" for run, most in group]
            )
            message = f"by forward kinematics {far} from the recorded tool centre point ({cause})"
            yield LogWarning(RECORDED_TCP_APART, f"{message}; {basis} each log alone")
