"""The diagnosis of a log: which causes explain its deviation from a reference.

The steps and their chapters:

1. Problem (problem.py): one side becomes a model y(x) (models.py, motion.py), the other its data; the
   reference is interpolated by cubics, and rounding gives a noise floor.
2. Hypotheses (hypotheses.py): groups of parameters x, and discrete causes; onsets are searched for
   (candidates.py).
3. Fit (fit.py): normal equations J^T W^2 J x = J^T W^2 y of weighted residuals, Gauss-Newton, without
   outliers.
4. Selection (selection.py): the subset with the least EBIC, n ln(RSS / N) + k ln n + 2 ln C(K, s), n being
   the effective number of samples. Fit and selection are repeated until stable (explanations.py), from
   several starts (candidates.py, search.py); a gate refuses implausible causes.
5. Explanation (explain.py): the causes in order, each with a 95 % interval in correlated noise, equivalents,
   and what the log does not decide.
6. Result (result.py, of the causes in causes.py): `Diagnosis`, with its summary; texts in cause_texts.py,
   tables in presenter.py.

Two questions are answered here. Few poses determine no cause, but a tool or a base that makes both sides
agree (`_tool_hypotheses`). And the tool centre point that a side recorded shows which side has the causes:

1. Each side with joints, a robot and a recorded tool centre point is compared with itself, row by row.
2. A side has the causes if its record follows the other side, and its kinematics do not.
3. If both sides are compared by joints, a side that agrees with its record does not have the causes. Then the
   other one has them, if it recorded no tool centre point, or if a constant tool does not explain how far its
   kinematics are from it.

A controller computes its record from its joints. So a side that is late, lags, yields or sags agrees with its
record, too: such causes, and whole turns, do not show an origin. Nor does 3 with a path on one side: the arm
itself may have another zero than its controller assumes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from urmpipe_models import DEFAULT_TOLERANCE
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray, spread_rows
from urmpipe_pipeline.diagnosis.candidates import find_whole_turns, iter_onsets
from urmpipe_pipeline.diagnosis.causes import (
    STRUCTURE,
    Alternative,
    Cause,
    Kind,
    RecordedTcpCheck,
    Unexplained,
    UntestedCauses,
    rms,
)
from urmpipe_pipeline.diagnosis.explain import ExplanationBuilder
from urmpipe_pipeline.diagnosis.explanations import SearchResult
from urmpipe_pipeline.diagnosis.fit import WeightedRows, fit_parameters, residual
from urmpipe_pipeline.diagnosis.hypotheses import Model, State, null_state
from urmpipe_pipeline.diagnosis.models import JointModel
from urmpipe_pipeline.diagnosis.problem import AT_REST, Problem, build_problem
from urmpipe_pipeline.diagnosis.result import Diagnosis
from urmpipe_pipeline.diagnosis.search import Search
from urmpipe_pipeline.logs.proofs import MARGIN
from urmpipe_pipeline.runs.grid import interpolate
from urmpipe_pipeline.runs.reading_errors import Edits
from urmpipe_pipeline.runs.recorded_tcp import RecordedPoses, distances_from_recorded
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import Matched, Side

FLOOR = 0.01  # fraction of the tolerance below which nothing is named
ARM_LENGTH = 1.0  # [m], by which a floor in [m] becomes one in [rad]

# Usual differences of an arm from its data sheet, by kind and unit: if a device measured it, less is its own
# geometry. Those of a UR10, fitted to 300 measured poses, were within twice this; its joints yield by 1e-5 to
# 3e-5 rad/(N m).
USUAL = {
    ("link_length", "m"): 5e-4, ("link_shift", "m"): 5e-4, ("tilt", "rad"): 1e-3,
    ("joint_offset", "rad"): 1e-3, ("joint_offset", "m"): 1e-3, ("joint_scale", ""): 5e-4,
    ("sag", "rad/(N m)"): 3e-5, ("sag", "rad/kg"): 3e-4,
}  # fmt: skip

MAX_CAUSES = 5  # of structure and zeros; as many at once are an arm's own geometry
UNRELATED_RATIO = 0.5  # residual over the reference's motion, both rms, above which the motions are different
MAX_WORSENING = 1.01  # of the rms: a lag moves the ends of a log out of it, which then do not count
MIN_REMOVED = 0.03  # fraction of the rms that causes have to remove together, unless one breaks the tolerance
EQUAL = 1e-9  # [rad] and [m]: rms difference of joints due to rounding
LENGTHS = ("axis", "norm", "path")  # kinds of tolerances of a length
COUNTED_ROWS = 2_000  # evenly spaced, of which those with all values are counted
MIN_SAMPLES = 10  # a cause has up to three parameters of three per sample

UNRELATED = "more than half of the reference's motion (rms): probably different motions"
OWN_GEOMETRY = "the arm's geometry differs from its model: a calibration determines it"
SAME_TCP = "the joint values differ, but their tool centre points do not"
SAME = "both sides agree"
ELSEWHERE = "no change of joints or clock makes the tool centre points agree"

# causes that a side may have although its joints lead to its recorded tool centre point
NOT_SHOWN = (
    "time_lag", "clock_drift", "servo_lag", "joint_lag", "compliance", "backlash", "sag", "turns",
)  # fmt: skip


class Limit(NamedTuple):
    """One quantity of a comparison and its tolerance.

    Attributes:
        quantity: x, y, z, norm, path, angle, or a joint's name.
        kind: What it is measured of: axis, norm, path, angle or joint.
        tolerance: Largest absolute value allowed in [m] or [rad], or None.
    """

    quantity: str
    kind: str
    tolerance: float | None


class Compared(NamedTuple):
    """Result of the comparison that is diagnosed.

    Attributes:
        name: The log's name in the comparison.
        verdict: pass or fail; None if nothing was judged.
        limits: Of every quantity; the joints in the log's order.
        shares: Shares 0..1 on which the verdict rests, by their names coverage and judged.
    """

    name: str
    verdict: Literal["pass", "fail"] | None
    limits: tuple[Limit, ...]
    shares: Mapping[str, float]

    def tolerance(self, kinds: tuple[str, ...], default: float) -> float:
        """Return the least tolerance of some kinds in [m] or [rad]."""
        limits = (limit.tolerance for limit in self.limits if limit.kind in kinds and limit.tolerance)
        return min(limits, default=default)

    @property
    def length(self) -> float:
        """The least tolerance of a length in [m], or the default."""
        return self.tolerance(LENGTHS, DEFAULT_TOLERANCE)

    def is_exceeded(self, deviation: FloatArray, of_joints: bool, along: bool) -> bool:
        """Return whether a deviation is out of tolerance.

        Args:
            deviation: In [m] or [rad], shape (k, n).
            of_joints: Whether it is of joints; else of positions.
            along: Whether it is along the path, and no distance from it.
        """
        known = deviation[:, np.isfinite(deviation).all(axis=0)]
        if not known.size:
            return False
        largest = np.abs(known).max(axis=1).tolist()
        if of_joints:
            names = (limit.quantity for limit in self.limits if limit.kind == "joint")
            sizes = dict(zip(names, largest, strict=True))
        else:
            norm = float(np.sqrt((known**2).sum(axis=0).max()))
            sizes = {**dict(zip("xyz", largest, strict=True)), "norm": norm, "path": 0.0 if along else norm}
        return any(
            limit.tolerance and sizes.get(limit.quantity, 0.0) > limit.tolerance for limit in self.limits
        )


def diagnose(
    compared: Compared, matched: Matched, reference: Side, log: Side, lag: float | None = None
) -> Diagnosis:
    """Return why a log deviates from its reference.

    Args:
        compared: The result of their comparison.
        matched: Both sides at the same times, not moved in space.
        reference: The reference.
        log: The log.
        lag: An offset of the clocks in [s], added to their alignment, at which both motions are most similar.
    """
    with threadpool_limits(1, "blas"):  # blocks of rows run in parallel already
        problem = build_problem(matched, reference, log)
        if reason := _why_undiagnosed(problem):
            tolerance = compared.length if reference.run is log.run else 0.0
            diagnosis = _diagnose_nothing(compared, problem, reason, tolerance)
        else:
            diagnosis = _diagnose_problem(compared, problem, lag, timed=log.run.timed)
        return _find_origin(diagnosis, matched, reference, log, compared.length)


def _diagnose_problem(compared: Compared, problem: Problem, lag: float | None, *, timed: bool) -> Diagnosis:
    model = problem.model
    edits = (*problem.edits, *_iter_onsets(problem, timed=timed))
    starts, floor = tuple(_iter_lags(model, lag)), _noise_floor(compared, problem)
    search, result = _search(Search(model, edits, floor, problem.forced, starts, timed=timed))
    build = partial(
        ExplanationBuilder,
        search,
        log_joints=problem.log_joints,
        arm_joints=problem.arm_joints,
        exceeds_tolerance=compared.is_exceeded,
    )
    explanation = build(result)
    while insignificant := explanation.insignificant():
        result = search.without(result, insignificant)
        explanation = build(result)
    causes, undecided = explanation.causes()
    state, after = explanation.state, explanation.after()
    before, left = rms(explanation.before.T), rms(after.T)
    # a fit on some rows may leave more on all
    if left > MAX_WORSENING * before or not explanation.explains(MIN_REMOVED):
        causes, undecided, state, after, left = (), (), search.null, explanation.before, before
    has_turns = any(edit.kind == "turns" for edit in state.edits)  # positions do not show these
    are_joints_judged = any(limit.kind == "joint" and limit.tolerance for limit in compared.limits)
    by_arm = isinstance(model, JointModel) and model.chain is not None
    if by_arm and not has_turns and not are_joints_judged:
        least = FLOOR * compared.length
        joint_residual = residual(model, search.null, np.arange(model.rows))
        equal = rms(joint_residual.T) <= float(np.linalg.norm(problem.rounding)) + EQUAL
        if before <= least or left > before + least or (equal and not causes):
            reason = ELSEWHERE if before > least else SAME if equal else SAME_TCP
            return _diagnose_nothing(compared, problem, reason, tested=True)
    unnamed = search.usual and all(cause.kind != "own_geometry" for cause in causes)
    return Diagnosis(
        name=compared.name,
        verdict=compared.verdict,
        shares=dict(compared.shares),
        samples=model.rows,
        unit=model.unit,
        rms=before,
        causes=causes,
        undecided=undecided,
        unidentifiable=explanation.refused(),
        untested=problem.untested,
        unexplained=_residual_of(compared, model, left, OWN_GEOMETRY if unnamed else ""),
        sample=model.sample,
        residual=problem.sign * after.T,
    )


def _residual_of(compared: Compared, model: Model, left: float, words: str) -> Unexplained:
    """Return what remains of a deviation, rms in [m] or [rad].

    If it is out of tolerance, and more than half the reference's motion from its mean, no cause has made the
    two motions similar.
    """
    target = model.target(np.arange(model.rows))
    moves = rms((target - np.nanmean(target, axis=1, keepdims=True)).T)
    kinds = ("joint",) if model.of_joints else LENGTHS
    tolerance = compared.tolerance(kinds, DEFAULT_TOLERANCE)
    is_unrelated = left > max(tolerance, UNRELATED_RATIO * moves)
    return Unexplained(left, UNRELATED if is_unrelated else words, is_unrelated)


def _iter_onsets(problem: Problem, *, timed: bool) -> Iterator[Edits]:
    """Yield what may begin at some row: half turns, mirrored angles, whole turns of joints on both sides."""
    model, null = problem.model, null_state(problem.model.groups)
    has_joints = isinstance(model, JointModel)
    if timed:
        yield from iter_onsets(model, model.sample, problem.is_revolute, null, both_ways=has_joints)
    if has_joints:
        left = residual(model, null, np.arange(model.rows))
        if turns := find_whole_turns(left, model.sample, problem.is_revolute):
            yield turns


def _iter_lags(model: Model, lag: float | None) -> Iterator[State]:
    """Yield the explanations that the clocks have an offset in [s], and that half of it is a servo's lag."""
    for group in model.groups:
        if group.kind == "time_lag" and lag is not None:
            late = null_state(model.groups)
            late.values[list(group.columns)] = lag
            yield late
            for servo in (other for other in model.groups if other.kind == "servo_lag"):
                both = State(late.values / 2.0, late.edits)
                both.values[list(servo.columns)] = -lag / 2.0
                yield both


def _search(search: Search) -> tuple[Search, SearchResult]:
    """Return the search, or one beyond the usual sizes, and its result.

    Many lengths, tilts, zeros and scales at once are no list of causes, but the arm's own geometry relative
    to its data sheet: then only causes above the usual sizes are searched for, as if a device measured it.
    Zeros alone are a list of causes, however many.
    """
    groups = search.model.groups
    keys = {g: (group.kind, group.unit) for g, group in enumerate(groups)}
    usual = {g: USUAL[key] for g, key in keys.items() if key in USUAL}
    beyond_usual = replace(search, usual=usual)
    if search.forced:
        return beyond_usual, beyond_usual.find()
    result = search.find()
    subset = result.best.subset & set(usual)
    has_structure = any(groups[g].kind in STRUCTURE for g in subset)
    if len(subset) >= MAX_CAUSES and has_structure:
        return beyond_usual, beyond_usual.find()
    return search, result


def _noise_floor(compared: Compared, problem: Problem) -> FloatArray:
    """Return the negligible size of each component in [m] or [rad]: of the tolerance, or of rounding."""
    blocks = problem.model.blocks
    if isinstance(problem.model, JointModel):
        least = np.full(len(blocks), compared.tolerance(("joint",), compared.length / ARM_LENGTH))
    else:
        turn = compared.tolerance(("angle",), compared.length / ARM_LENGTH)
        least = np.where(blocks == 0, compared.length, turn)
    return np.maximum(FLOOR * least, problem.rounding)


def _why_undiagnosed(problem: Problem) -> str:
    """Return why no cause can be found, or an empty string."""
    model = problem.model
    some = spread_rows(model.rows, COUNTED_ROWS)
    known = int(np.isfinite(model.residual(null_state(model.groups), some)).all(axis=0).sum())
    if known < MIN_SAMPLES:
        samples = format_count(known, "sample")
        return f"{samples}{' with all values' * (known < model.rows)}: fewer than {MIN_SAMPLES}"
    moved = np.fmax.reduce(model.motion.value, axis=1) - np.fmin.reduce(model.motion.value, axis=1)
    side = "log" if problem.sign > 0.0 else "reference"
    return f"the {side} is at rest: one pose" if np.nanmax(moved, initial=0.0) < AT_REST else ""


def _diagnose_nothing(
    compared: Compared, problem: Problem, reason: str, tolerance: float = 0.0, *, tested: bool = False
) -> Diagnosis:
    """Return a diagnosis without a cause, and the reason.

    Args:
        compared: The result of the comparison.
        problem: The problem.
        reason: Why no cause is named.
        tolerance: Of the tool that a log recorded in [m]; if one agrees within it, it is a hypothesis.
        tested: Whether the causes were tested.
    """
    model = problem.model
    left = model.deviation(null_state(model.groups), np.arange(model.rows))
    before = rms(left.T)
    undecided, after = _tool_hypotheses(model, tolerance) if before > tolerance > 0.0 else ((), left)
    groups, edits = model.groups, (edit for edits in problem.edits for edit in edits)
    kinds = tuple(dict.fromkeys([*(group.kind for group in groups), *(edit.kind for edit in edits)]))
    untested = () if tested else (UntestedCauses(kinds, reason),)
    return Diagnosis(
        name=compared.name,
        verdict=compared.verdict,
        shares=dict(compared.shares),
        samples=model.rows,
        unit=model.unit,
        rms=before,
        causes=(),
        undecided=undecided,
        untested=(*untested, *problem.untested),
        unexplained=Unexplained(rms(after.T), reason),
        sample=model.sample,
        residual=problem.sign * after.T,
    )


def _tool_hypotheses(model: Model, tolerance: float) -> tuple[tuple[Alternative, ...], FloatArray]:
    """Return the tool with which both sides agree, its alternatives, and what the tool leaves.

    A deviation that is constant in the tool's frame is that of a missing tool. Alternatives are a base that
    agrees as well, and neither of both.

    Args:
        model: The model.
        tolerance: In [m]: an rms above it is no agreement.

    Returns:
        The explanations, empty if no tool agrees, and reference - log in [m], shape (3, n).
    """
    rows = np.arange(model.rows)
    agreeing = list(_iter_agreeing_frames(model, tolerance))
    if not agreeing or agreeing[0][0].kind != "tool_shift":
        return (), model.deviation(null_state(model.groups), rows)
    causes = [Alternative((cause,)) for cause, _ in agreeing]
    return (*causes, Alternative(())), model.deviation(agreeing[0][1], rows)


def _iter_agreeing_frames(model: Model, tolerance: float) -> Iterator[tuple[Cause, State]]:
    """Yield the shift of the tool, then that of the base, each with its explanation if both sides agree."""
    null, at = null_state(model.groups), np.arange(model.rows)
    rows = WeightedRows(at, np.ones(len(model.blocks)) * (model.blocks == 0))  # positions alone
    before = rms(model.deviation(null, at).T)
    kinds: tuple[Kind, ...] = ("tool_shift", "base_shift")
    shifts = {group.kind: group for group in model.groups if group.kind in kinds and group.axis is None}
    for kind in kinds:
        if kind in shifts:
            state = fit_parameters(model, null, [shifts[kind]], rows)
            after = rms(model.deviation(state, at).T)
            if after <= tolerance:
                value = tuple(state.of(shifts[kind]).tolist())
                yield (
                    Cause(kind, shifts[kind].name, value=value, unit="m", rms_before=before, rms_after=after,
                          rms_alone=after),
                    state,
                )  # fmt: skip


def _find_origin(
    diagnosis: Diagnosis, matched: Matched, reference: Side, log: Side, tolerance: float
) -> Diagnosis:
    """Return a diagnosis with what the recorded tool centre points of both sides show.

    A log that is compared with its record is left as it is.

    Args:
        diagnosis: The diagnosis.
        matched: Both sides at the same times, not moved in space.
        reference: The reference.
        log: The log.
        tolerance: Of a length in [m], within which a side agrees with its record.
    """
    if reference.run is log.run:
        return diagnosis
    sides = (reference, log)
    tcps = [_own_tcp(side, tolerance) for side in sides]
    size = _shown_size(diagnosis)
    distances = [_record_distance(matched, side.run, is_log=side is log) for side in sides]
    left = float(np.hypot(diagnosis.unexplained.rms, size / MARGIN))

    def agrees(k: int) -> bool:
        tcp = tcps[k]
        return tcp is not None and tcp.agrees and MARGIN * tcp.rms <= size

    def has_causes(k: int) -> bool:
        tcp, follows = tcps[k], distances[k] <= left
        if tcp is not None and MARGIN * tcp.rms > size and follows:
            return True
        consistent = tcp is not None and MARGIN * tcp.rms_with_tool <= size
        return reference.by_joints and log.by_joints and agrees(1 - k) and not consistent

    origin = [side.run.name for k, side in enumerate(sides) if size and has_causes(k)]
    return replace(
        diagnosis,
        recorded_tcp=tuple(tcp for tcp in tcps if tcp is not None),
        origin=origin[0] if len(origin) == 1 else "",
    )


def _own_tcp(side: Side, tolerance: float) -> RecordedTcpCheck | None:
    """Return how far a side is from its recorded tool centre point; None without one."""
    run, position = side.run, side.trajectory.position
    by_kinematics = side.by_joints and run.tcp is not None and np.isfinite(position).any()
    distance = distances_from_recorded(run, position if by_kinematics else None)
    poses = RecordedPoses.of(run.robot, run.log)
    if not len(distance) or run.robot is None or poses is None:
        return None
    largest, mean = float(distance.max()), rms(distance[:, np.newaxis])
    return RecordedTcpCheck(
        run.name, mean, largest, largest <= tolerance, min(mean, poses.fit(run.robot).with_tool)
    )


def _shown_size(diagnosis: Diagnosis) -> float:
    """Return the rms in [m] of the causes that a recorded tool centre point would show.

    Joints alone are judged in [rad], taken as [m]: they move a point at 1 m by that.
    """
    shown = (cause for cause in diagnosis.causes if cause.kind not in NOT_SHOWN)
    return float(np.sqrt(max(sum(cause.rms_before**2 - cause.rms_after**2 for cause in shown), 0.0)))


def _record_distance(matched: Matched, run: Run, *, is_log: bool) -> float:
    """Return the rms distance of a run's record from the other side in [m]; inf without a record."""
    recorded, other = run.log.tcp_position, matched.reference if is_log else matched.actual
    if recorded is None or run.log.externally_measured:
        return np.inf
    at_ns = matched.t_ns + round(matched.sync.offset * 1e9)
    positions = recorded[matched.sample] if is_log else interpolate(at_ns, run.on_rows.t_ns, recorded)
    between = positions - other
    return rms(between) if np.isfinite(between).all(axis=1).any() else np.inf
