"""Why a log deviates from its reference: the causes that make the sides agree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from urmpipe_models import DEFAULT_TOLERANCE
from urmpipe_models.elementwise import FloatArray, spread_rows
from urmpipe_pipeline import text
from urmpipe_pipeline.diagnosis.candidates import later_edits, turn_edits
from urmpipe_pipeline.diagnosis.causes import STRUCTURE, NotLookedFor, Remainder, rms
from urmpipe_pipeline.diagnosis.explain import ExplanationBuilder
from urmpipe_pipeline.diagnosis.explanations import SearchResult
from urmpipe_pipeline.diagnosis.fit import Model, residual
from urmpipe_pipeline.diagnosis.hypotheses import State, zero
from urmpipe_pipeline.diagnosis.models import JointsModel
from urmpipe_pipeline.diagnosis.one_pose import tool_hypotheses
from urmpipe_pipeline.diagnosis.own_tcp import ask_both_sides
from urmpipe_pipeline.diagnosis.result import Diagnosis
from urmpipe_pipeline.diagnosis.search import Search
from urmpipe_pipeline.diagnosis.sides import AT_REST, Question, build_question
from urmpipe_pipeline.runs.reading_errors import Edits
from urmpipe_pipeline.trajectories import Matched, Side

FLOOR = 0.01
"""Share of the tolerance below which nothing is named."""

ARM = 1.0
"""What a length in [m] of an arm is taken for where a floor in [m] is wanted in [rad]."""

USUAL = {
    ("link_length", "m"): 5e-4, ("link_shift", "m"): 5e-4, ("tilt", "rad"): 1e-3,
    ("joint_offset", "rad"): 1e-3, ("joint_offset", "m"): 1e-3, ("joint_scale", ""): 5e-4,
    ("sag", "rad/(N m)"): 3e-5, ("sag", "rad/kg"): 3e-4,
}  # fmt: skip
"""How far an arm is usually from its data sheet, by kind and unit: where a device measured it, what is no
more is its own geometry. Those of a UR10, fitted to 300 measured poses, were within twice this; its joints
give way by 1e-5 to 3e-5 rad/(N m)."""

UNLIKE = 0.5
"""A remainder of more than this share of the reference's motion leaves no likeness of the two motions."""

UNRELATED = "more than half of how far the reference moves: probably different motions"

OWN = "the arm's own geometry, as a calibration finds it"

MANY = 5
"""So many of these at once are an arm's own geometry."""

ALIKE = "the joint values differ, but their tool centre points do not"

SAME = "both sides agree"

WORSE = 1.01
"""Times the deviation that an explanation may leave: the ends of a log that a lag moves out of it count."""

WORTH = 0.03
"""Share of the rms that causes have to take away together, unless one of them breaks the tolerance."""

EQUAL = 1e-9
"""Root mean square difference of joints in [rad] and [m] that rounding leaves."""

ELSEWHERE = "no change of joints or clock makes the tool centre points agree"

LENGTHS = ("axis", "norm", "path")
"""What a tolerance of a length may be of."""

SOME = 2_000  # rows, spread evenly, of which it is counted how many have all values

LEAST_SAMPLES = 10
"""Of fewer samples nothing is named: a cause takes up to three numbers of three a sample."""


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
    with threadpool_limits(1, "blas"):  # blocks of rows run side by side already
        question = build_question(matched, reference, log)
        length = compared.tolerance(LENGTHS, DEFAULT_TOLERANCE)
        if reason := _tells_nothing(question):
            diagnosis = _nothing(compared, question, reason, length if reference.run is log.run else 0.0)
        else:
            diagnosis = _diagnosed(compared, question, lag, timed=log.run.timed)
        return ask_both_sides(diagnosis, matched, reference, log, length)


def _diagnosed(compared: Compared, question: Question, lag: float | None, *, timed: bool) -> Diagnosis:
    model = question.model
    edits = (*question.edits, *_later(question, timed=timed))
    starts = tuple(_late(model, lag))
    search, result = _found(
        Search(model, edits, _floor(compared, question), question.forced, starts, timed=timed)
    )
    given = question.names, question.own_names, partial(_breaks, compared)
    built = ExplanationBuilder(search, result, *given)
    while weak := built.insignificant():
        result = search.without(result, weak)
        built = ExplanationBuilder(search, result, *given)
    causes, undecided = built.causes()
    state, after = built.state, built.after()
    before, left = rms(built.before.T), rms(after.T)
    if left > WORSE * before or not built.explains(WORTH):  # what was fitted on some rows may leave more
        causes, undecided, state, after, left = (), (), search.zero, built.before, before
    turns = any(edit.kind == "turns" for edit in state.edits)  # these the joints alone tell
    if isinstance(model, JointsModel) and model.chain is not None and not turns and not _judged(compared):
        least = FLOOR * compared.tolerance(LENGTHS, DEFAULT_TOLERANCE)
        apart = residual(model, search.zero, np.arange(model.rows))
        equal = rms(apart.T) <= float(np.linalg.norm(question.rounding)) + EQUAL
        if before <= least or left > before + least or (equal and not causes):
            words = ELSEWHERE if before > least else SAME if equal else ALIKE
            return _nothing(compared, question, words, tested=True)
    unnamed = search.usual and all(cause.kind != "own_geometry" for cause in causes)
    return Diagnosis(
        name=compared.name,
        verdict=compared.verdict,
        seen=dict(compared.shares),
        samples=model.rows,
        unit=model.unit,
        rms=before,
        causes=causes,
        undecided=undecided,
        refused=built.refused(),
        not_looked_for=question.not_looked_for,
        remainder=_remainder(compared, model, left, OWN if unnamed else ""),
        sample=model.sample,
        mended=question.sign * after.T,
    )


def _remainder(compared: Compared, model: Model, left: float, words: str) -> Remainder:
    """Return what stays of a whole deviation, root mean squares in [m] or [rad].

    Where it is out of tolerance, and more than half of how far the reference moves about its mean, no cause
    has made the two move alike.
    """
    wanted = model.wanted(np.arange(model.rows))
    moves = rms((wanted - np.nanmean(wanted, axis=1, keepdims=True)).T)
    kinds = ("joint",) if model.of_joints else LENGTHS
    tolerance = compared.tolerance(kinds, DEFAULT_TOLERANCE)
    different = left > max(tolerance, UNLIKE * moves)
    return Remainder(left, UNRELATED if different else words, different)


def _later(question: Question, *, timed: bool) -> Iterator[Edits]:
    """Yield what may begin at some row: half turns, mirrored angles, whole turns of joints on both sides."""
    model, nothing = question.model, zero(question.model.groups)
    joints_alone = isinstance(model, JointsModel)
    if timed:
        yield from later_edits(model, model.sample, question.turning, nothing, both_ways=joints_alone)
    if joints_alone:
        left = residual(model, nothing, np.arange(model.rows))
        if turns := turn_edits(left, model.sample, question.turning):
            yield turns


def _late(model: Model, lag: float | None) -> Iterator[State]:
    """Yield the explanations that the clocks are an offset in [s] apart, and that half of it is a servo's."""
    for group in model.groups:
        if group.kind == "time_lag" and lag is not None:
            late = zero(model.groups)
            late.values[list(group.columns)] = lag
            yield late
            for servo in (one for one in model.groups if one.kind == "servo_lag"):
                both = replace(late, values=late.values / 2.0)
                both.values[list(servo.columns)] = -lag / 2.0
                yield both


def _found(search: Search) -> tuple[Search, SearchResult]:
    """Return what was looked for, and what was found.

    Many lengths, tilts, zeros and scales at once are no list of causes, but what an arm's own geometry is
    beside its data sheet: only what is more than usual is then looked for, as where a device measured it.
    Zeros alone are a list of causes, however many.
    """
    groups = search.model.groups
    keys = {g: (group.kind, group.unit) for g, group in enumerate(groups)}
    usual = {g: USUAL[key] for g, key in keys.items() if key in USUAL}
    own = replace(search, usual=usual)
    if search.forced:
        return own, own.find()
    result = search.find()
    taken = result.best.subset & set(usual)
    structure = any(groups[g].kind in STRUCTURE for g in taken)
    return (own, own.find()) if len(taken) >= MANY and structure else (search, result)


def _judged(compared: Compared) -> bool:
    """Return whether the joints have a tolerance."""
    return any(limit.kind == "joint" and limit.tolerance for limit in compared.limits)


def _floor(compared: Compared, question: Question) -> FloatArray:
    """Return what means nothing, of each component in [m] or [rad]: a share of the tolerance, or rounding."""
    length = compared.tolerance(LENGTHS, DEFAULT_TOLERANCE)
    turn = compared.tolerance(("angle",), length / ARM)
    if isinstance(question.model, JointsModel):
        joint = compared.tolerance(("joint",), length / ARM)
        least = np.full(len(question.model.blocks), joint)
    else:
        least = np.where(question.model.blocks == 0, length, turn)
    return np.maximum(FLOOR * least, question.rounding)


def _breaks(compared: Compared, made: FloatArray, joints: bool, along: bool) -> bool:
    """Tell whether a deviation in [m] or [rad], shape (k, n), is out of tolerance.

    Args:
        compared: The result of the comparison.
        made: What a cause makes.
        joints: Whether it is of joints; else of positions.
        along: Whether it is along the path, and no distance from it.
    """
    known = made[:, np.isfinite(made).all(axis=0)]
    if not known.size:
        return False
    largest = np.abs(known).max(axis=1).tolist()
    if joints:
        names = (limit.quantity for limit in compared.limits if limit.kind == "joint")
        sizes = dict(zip(names, largest, strict=True))
    else:
        norm = float(np.sqrt((known**2).sum(axis=0).max()))
        sizes = {**dict(zip("xyz", largest, strict=True)), "norm": norm, "path": 0.0 if along else norm}
    return any(
        limit.tolerance and sizes.get(limit.quantity, 0.0) > limit.tolerance for limit in compared.limits
    )


def _tells_nothing(question: Question) -> str:
    """Return why nothing can be told; empty where something can."""
    model = question.model
    some = spread_rows(model.rows, SOME)
    known = int(np.isfinite(model.residual(zero(model.groups), some)).all(axis=0).sum())
    if known < LEAST_SAMPLES:
        samples = text.counted(known, "sample")
        return f"{samples}{' with all values' * (known < model.rows)}: fewer than {LEAST_SAMPLES}"
    moved = np.fmax.reduce(model.motion.value, axis=1) - np.fmin.reduce(model.motion.value, axis=1)
    side = "log" if question.sign > 0.0 else "reference"
    return f"the {side} is at rest: one pose" if np.nanmax(moved, initial=0.0) < AT_REST else ""


def _nothing(
    compared: Compared, question: Question, reason: str, tolerance: float = 0.0, *, tested: bool = False
) -> Diagnosis:
    """Return a diagnosis that names nothing, and says why.

    Args:
        compared: The result of the comparison.
        question: What was compared with what.
        reason: Why nothing can be told.
        tolerance: By how much the tool that a log recorded may be off in [m]; one that agrees is then a
            hypothesis.
        tested: Whether the causes were looked for all the same.
    """
    model = question.model
    left = model.deviation(zero(model.groups), np.arange(model.rows))
    before = rms(left.T)
    undecided, mended = tool_hypotheses(model, tolerance) if before > tolerance > 0.0 else ((), left)
    kinds = tuple(
        dict.fromkeys([*(g.kind for g in model.groups), *(e.kind for edits in question.edits for e in edits)])
    )
    return Diagnosis(
        name=compared.name,
        verdict=compared.verdict,
        seen=dict(compared.shares),
        samples=model.rows,
        unit=model.unit,
        rms=before,
        causes=(),
        undecided=undecided,
        not_looked_for=(*(() if tested else (NotLookedFor(kinds, reason),)), *question.not_looked_for),
        remainder=Remainder(rms(mended.T), reason),
        sample=model.sample,
        mended=question.sign * mended.T,
    )
