"""What a person should know about a verdict: that it rests on little, or answers another question."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from urmpipe_models.errors import Hint
from urmpipe_models.hand_eye import MIN_SENSITIVITY, Part, UnobservableDirection
from urmpipe_models.measure_units import USUAL_UNITS
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import AXES, Deviation, Share
from urmpipe_pipeline.comparison.tolerance import UNITS, allowed_for
from urmpipe_pipeline.comparison.wording import unseen_words
from urmpipe_pipeline.diagnosis.sides import AT_REST
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.runs.grid import ROUNDING_NS
from urmpipe_pipeline.runs.recorded_tcp import distances_from_recorded
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import Side, Trajectory, extent, joint_order

EXCHANGED = "path-as-log"
"""The kind of a doubt about the order of what was given: it says nothing against a log."""

LARGE_NOISE = "large-noise"
"""The kind of a doubt about the noise of a baseline: another baseline has its own."""

TCP_APART = "recorded-tcp-apart"

CALIBRATION = 5e-3
"""A controller's own calibration moves the tool by up to this in [m] from where those of the data sheet have
it: 1.6 mm and 3.7 mm in the logs of two UR5e."""

DIMENSIONS = 3

STRAIGHT = 0.9999
"""A larger component of a unit vector makes it an axis of the frame: it is off by less than a degree."""

LARGE = {"m": 0.1, "rad": float(np.radians(10.0))}
"""A larger tolerance in [m] or [rad] was meant in mm or deg: no arm misses by so much and is accepted."""


def left_out_warnings(one: Deviation, reference: Trajectory) -> Iterator[LogWarning]:
    """Yield what was not compared of a log and of the reference.

    Samples that an offset moves beyond the reference's time are what `sync` requests, and no doubt about the
    log: the shares count them.
    """
    samples = one.left_out + len(one.sample)
    beyond = _beyond(one, reference) if one.sync.offset else 0
    if one.left_out > beyond:
        said = f"{one.left_out - beyond} of {samples} samples have no reference or no value"
        yield LogWarning("left-out", said, about=one.name)
    coverage = one.shares["coverage"]
    if coverage.verdict != "fail" and coverage in one.partly:
        yield LogWarning("not-covered", _covered(coverage, reference), about=one.name)


def _covered(coverage: Share, reference: Trajectory) -> str:
    """Say how many samples of the reference a log shows, and where most are unseen."""
    said = f"it shows {coverage.samples} of {text.counted(coverage.of, 'sample')} of {reference.name}"
    return f"{said} ({text.percent(coverage.value)}){unseen_words(coverage)}"


def _beyond(one: Deviation, reference: Trajectory) -> int:
    """Return how many samples of a log lie outside the time of the reference."""
    at_ns = one.run.on_rows.t_ns + round(one.sync.offset * 1e9)
    before, after = at_ns < reference.t_ns[0] - ROUNDING_NS, at_ns > reference.t_ns[-1] + ROUNDING_NS
    return int(np.count_nonzero(before | after))


def open_frames(one: Deviation) -> Iterator[LogWarning]:
    """Yield what the compared poses of a log do not tell of the base and the tool that were fitted."""
    unobservable = one.alignment.unobservable
    nothing, little = (
        [it for it in unobservable if (it.seen < MIN_SENSITIVITY) is told] for told in (True, False)
    )
    said = []
    if nothing:
        said.append(f"do not determine {_parts(nothing)}, so the smallest values are used")
    if little:
        said.append(f"hardly determine {_parts(little)}, so a small error of the log causes a large one")
    if said:
        told = f"the compared poses {', and '.join(said)}"
        yield LogWarning("frames-open", told, about=one.name, parameter="align")


def _parts(unobservable: Sequence[UnobservableDirection]) -> str:
    """Return what is not told: the whole of a part, or its directions."""
    parts = dict.fromkeys(one.part for one in unobservable)
    return " and ".join(_part(part, [one for one in unobservable if one.part == part]) for part in parts)


def _part(part: Part, unobservable: Sequence[UnobservableDirection]) -> str:
    what, turn = part.split()
    said = f"the {turn} of the {what}"
    if len(unobservable) == DIMENSIONS:
        return said
    axes = " and ".join(_axis(one.axis) for one in unobservable)
    return f"{said} {'along' if turn == 'offset' else 'about'} {axes}"


def _axis(axis: tuple[float, float, float]) -> str:
    """Return an axis by its letter, or as a vector."""
    most = max(range(DIMENSIONS), key=lambda k: abs(axis[k]))
    return "xyz"[most] if abs(axis[most]) > STRAIGHT else f"({', '.join(f'{part:.2f}' for part in axis)})"


def thin_evidence(one: Deviation) -> Iterator[LogWarning]:
    """Yield what a verdict on a log rests on, where that is little: missing values, or one pose."""
    partly: dict[int, list[str]] = {}
    for found in one.all_statistics:
        if found.tolerance is not None and found.missing:
            partly.setdefault(found.samples or 0, []).append(found.quantity)
    for samples, quantities in partly.items():
        said = f"{text.enumerated(quantities)}: judged at {samples} of {len(one.sample)} compared samples"
        yield LogWarning(
            "partly-judged", f"{said}; a sample without a value is out of tolerance", about=one.name
        )
    if one.run.timed and rests(one):
        said = f"{text.counted(len(one.sample), 'sample')} compared, all in one pose"
        yield LogWarning("one-pose", f"{said}: the verdict is on that pose alone", about=one.name)


def rests(one: Deviation) -> bool:
    """Tell whether a log stays where it is while it is compared: its tool centre point, and its joints."""
    return extent(one.actual) < AT_REST and extent(one.run.on_rows.q[one.sample]) < AT_REST


def large_tolerances(tolerance: Mapping[str, float]) -> Iterator[LogWarning]:
    """Yield a warning for each number in [m] or [rad] as a tolerance that hardly anybody means."""
    for kind, value in tolerance.items():
        unit = UNITS[kind]
        if value > LARGE.get(unit, np.inf):
            bare, other = f"{value:g}", USUAL_UNITS[unit]
            said = f"a tolerance of {text.allowed(value, unit)} ({kind}) accepts any deviation"
            hints = (
                Hint("tolerance", f"{kind}={bare}{other}", f"if {other} was meant"),
                Hint("tolerance", f"{kind}={bare}{unit}", "if not"),
            )
            yield LogWarning("large-tolerance", f"{said}: {bare} is in {unit}", hints=hints)


def large_noises(noise: Mapping[str, float], tolerance: Mapping[str, float]) -> Iterator[LogWarning]:
    """Yield a warning for each noise that reaches its tolerance: nothing within that can then be worse.

    The noise is in [m] or [rad], of every kind, perhaps of a coordinate; so is the tolerance.
    """
    for kind, allowed in tolerance.items():
        level = allowed_for(kind, "axis" if kind in AXES else kind, noise)
        if level is not None and level >= allowed:
            unit = UNITS[kind]
            said = f"a noise of {text.allowed(level, unit)} ({kind}) reaches the tolerance of"
            why = f"{text.allowed(allowed, unit)}: nothing within it can be worse than the baseline"
            yield LogWarning(LARGE_NOISE, f"{said} {why}; a number without a unit is in {unit}")


def exchanged(reference: Run, runs: Iterable[Run]) -> Iterator[LogWarning]:
    """Yield a warning for each path that is held as a log against one with joints: perhaps the wrong way."""
    for run in runs:
        if reference.log.joints and not run.log.joints:
            said = f"a path without joints, compared with {reference.name}, which has joints"
            yield LogWarning(EXCHANGED, f"{said}: the reference comes first, then the logs", about=run.name)


def same_data(reference: Side, log: Side) -> Iterator[LogWarning]:
    """Yield a warning if a log and its reference have the same times and values, whatever they are called.

    Two logs at rest may have these by chance, and have their own warning.
    """
    one, other = reference.trajectory, log.trajectory
    alike = reference.by_joints == log.by_joints and np.array_equal(one.t_ns, other.t_ns)
    alike = alike and np.array_equal(one.position, other.position, equal_nan=True)
    moves = extent(other.position) > 0.0
    order = joint_order(one.joints, other.joints)
    if alike and order is not None and one.q is not None and other.q is not None:
        alike = np.array_equal(one.q[:, order], other.q, equal_nan=True)
        moves = moves or extent(other.q) > 0.0
    if alike and moves:
        said = f"the same data as {one.name}: every time and every value is equal"
        yield LogWarning("same-data", said, about=other.name)


def recorded_apart(runs: Sequence[Run], allowed: float) -> Iterator[LogWarning]:
    """Yield a warning if logs that are compared by their joints recorded tool centre points elsewhere.

    There is one for those that a calibration explains, and one for the others. First rows that are outliers
    have their own, of their log.

    Args:
        runs: The logs.
        allowed: The distance that is allowed, in [m].
    """
    furthest = ((run, float(distances_from_recorded(run).max(initial=0.0))) for run in runs)
    found = [(run, most) for run, most in furthest if most > allowed]
    for usual in (True, False):
        alike = [(run, most) for run, most in found if (most <= CALIBRATION) == usual]
        if len(alike) == 1:
            ((run, most),) = alike
            far = f"its kinematics are up to {text.quantity(most, 'm')} from its recorded tool centre point"
            remedy = f"this verdict does not include that; a comparison of {run.name} alone does"
            yield LogWarning("recorded-tcp-apart", f"{far}, {_cause(most)}; {remedy}", about=run.name)
        elif alike:
            far = text.enumerated([f"{run.name} is up to {text.quantity(most, 'm')}" for run, most in alike])
            said = f"by forward kinematics {far} from the recorded tool centre points"
            remedy = "this verdict does not include that; a comparison of each alone does"
            yield LogWarning(TCP_APART, f"{said}, {_cause(alike[0][1])}; {remedy}")


def _cause(apart: float) -> str:
    """Return what usually lies behind a distance in [m] between kinematics and recorded tool centre point."""
    usual = text.allowed(CALIBRATION)
    if apart > CALIBRATION:
        return f"more than a calibration explains ({usual}): another robot, tool or base?"
    known = "a controller uses the calibration of its arm, which this robot model lacks"
    return f"usual up to {usual} where {known}"
