"""Time: the offset between the clocks of two logs of one motion."""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from urmpipe_models.errors import Finding, Hint, LogError, OptionError
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.sync_coarse import FLOOR, mean_rates, peaks
from urmpipe_pipeline.comparison.sync_fine import Estimate, refine
from urmpipe_pipeline.comparison.sync_views import View, views
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.trajectories import AlignMode, Sync, Trajectory, extent

SyncOption: TypeAlias = Literal["stamps", "start", "auto"] | float

LONGEST_OFFSET = 1e9
"""Offset in [s] that integers of 64 bits in [ns] hold beside any time of a log: 30 years."""

STILL = 1e-6
"""What stays within so many [rad] or [m] does not move: no arm repeats a pose as well."""

LIKE = 0.8
"""Two motions with less similarity are not one. Of pairs of random motions of 20 s (sums of sines, moves with
rests) the best similarity of any offset was 0.48 at most by six joints, 0.75 by positions."""

ALIKE = 0.9
"""Two motions with less similarity are told to be doubtful: noise alone leaves more, where the coarse stage
can hold it down."""

RIVAL = 2.0
"""An offset is clearly better than another if it leaves less than half as much unexplained. Of 720 pairs of
random motions of 5 to 60 s that had nothing to do with each other, six passed this and the likeness, all of
them positions over 5 s or less, of a few moves."""

CERTAIN = 0.1
"""An offset is certain if its standard error is below this share of the log's period."""

ENOUGH = 0.99
"""With more similarity, no other view can be clearly better: it is not looked at."""

ALLOWED = "one motion that does not repeat itself, half of it in both"

STAMPS = "Unix times or dates on both sides that overlap, a time for each row"

BY_MOTION = Hint("sync", "auto", "estimates the offset from the motion")

BY_HAND = (Hint("sync", "start", "aligns the first samples"), Hint("sync", None, "sets the offset"))

SHOWN = 5
"""Offsets that a message names, the best ones."""


class _Fault(NamedTuple):
    """Why a view of two motions tells no offset, and the best similarity of any."""

    message: str
    similarity: float = -1.0


def check_sync(option: SyncOption | None) -> None:
    """Raise an `OptionError` if there is no such way to put clocks together."""
    if isinstance(option, (int, float)):
        known = abs(option) < LONGEST_OFFSET
    else:
        known = option in (None, "stamps", "start", "auto")
    if not known:
        allowed = f"stamps, start, auto, or a time in s below {LONGEST_OFFSET:g}"
        raise OptionError(Finding(parameter="sync", found=str(option), allowed=allowed))


def synchronise(
    reference: Trajectory,
    log: Trajectory,
    option: SyncOption | None,
    align: AlignMode = "none",
    stamped: float | str = "no stamps",
) -> Sync:
    """Return how the clocks of a log and the reference are put together.

    auto correlates the rates of both sides over all offsets and refines the best one. It goes by the joints
    where both sides have the same number of them, unless the positions are clearly more alike (two arms may
    follow one path with other joints). Where the two stand apart in space does not matter.

    Args:
        reference: What was asked for.
        log: What was done.
        option: stamps, start, auto, or the offset in [s]: t_reference = t_log + offset. None: stamps where
            they give an offset, else start.
        align: How the log will be moved in space.
        stamped: The offset by absolute stamps in [s], or why they give none.

    Raises:
        LogError: If the motion does not tell the offset: there is none, it repeats itself, it is too even, or
            the two sides are not one motion. Of stamps: if they give none.
    """
    if option is None:
        one_clock = stamped == 0.0 and reference.files == log.files  # two sets of columns of one file
        option = "start" if one_clock or isinstance(stamped, str) else "stamps"
    if option == "start":
        return Sync()
    if option == "stamps":
        if isinstance(stamped, str):
            raise LogError(_unknown(log, "stamps", stamped, STAMPS, BY_MOTION, *BY_HAND))
        return Sync("stamps", stamped)
    return _by_motion(reference, log, align) if option == "auto" else Sync("given", float(option))


def _by_motion(reference: Trajectory, log: Trajectory, align: AlignMode) -> Sync:
    best: Estimate | None = None
    by = ""
    faults: list[_Fault] = []
    for view in views(reference, log, align):
        found = _look(view, reference.name)
        if isinstance(found, _Fault):
            faults.append(found)
        elif best is None or RIVAL * _unlike(found.similarity) < _unlike(best.similarity):
            best, by = found, view.by
        if best is not None and best.similarity > ENOUGH:
            break
    if best is None:
        fault = max(faults, key=lambda one: one.similarity).message
        raise LogError(_unknown(log, "auto", fault, ALLOWED, *BY_HAND))
    return Sync("auto", best.offset, by, best.precision, best.similarity)


def _unknown(log: Trajectory, option: str, found: str, allowed: str, *hints: Hint) -> Finding:
    """Return why an option determines no offset of a log."""
    file = log.files[0].name if log.files else log.name
    return Finding(option, file, parameter="sync", found=found, allowed=allowed, hints=hints)


def _look(view: View, reference: str) -> Estimate | _Fault:
    """Return the offset that one view tells, or why it tells none."""
    for side, values in ((reference, view.reference), ("this log", view.log)):
        if extent(values) <= STILL:
            return _Fault(f"no motion of the {view.by} in {side}")
    found = mean_rates(view)
    near = peaks(found, view.turned) if found else []
    if found is None or not near:
        return _Fault(f"no offset at which the {view.by} move as in {reference}")
    best, *others = sorted((refine(view, found, peak) for peak in near), key=lambda one: -one.similarity)
    at_best = f"{best.offset:.6g} s with a similarity of {best.similarity:.3f}"
    if best.similarity < LIKE:
        said = f"low similarity of the {view.by} to {reference}: {at_best} at best, {LIKE:g} is needed"
        return _Fault(said, best.similarity)
    if not np.isfinite(best.precision):
        said = f"no clear best offset to {reference} by the {view.by}: about {at_best}"
        return _Fault(said, best.similarity)
    rivals = [one for one in others if _rivals(one, best, 2e-9 * found.period_ns)]
    if rivals:
        alike = sorted([best, *rivals], key=lambda one: (-round(one.similarity, 3), abs(one.offset)))
        shown = ", ".join(f"{one.offset:.6g} s ({one.similarity:.3f})" for one in alike[:SHOWN])
        said = (
            f"a motion of the {view.by} that several offsets to {reference} explain equally well (similarity)"
        )
        return _Fault(f"{said}: {shown}", best.similarity)
    return best


def _unlike(similarity: float) -> float:
    """Return how much of a motion another leaves unexplained, 0 to 2, not less than what means nothing."""
    return 1.0 - similarity + FLOOR


def _rivals(one: Estimate, best: Estimate, apart: float) -> bool:
    """Tell whether an offset explains a motion nearly as well as the best, and is another by so many [s]."""
    near = _unlike(one.similarity) < RIVAL * _unlike(best.similarity)
    return near and abs(one.offset - best.offset) > apart


def sync_doubts(name: str, sync: Sync, period: float) -> list[LogWarning]:
    """Return what a person should know about an offset that was estimated.

    Args:
        name: The log's name.
        sync: The offset.
        period: The log's, in [s].
    """
    said = f"the offset of {sync.offset:.6g} s, estimated by the {sync.by},"
    doubts = []
    if sync.precision is not None and sync.precision > CERTAIN * period:
        error = f"is known to +-{text.standard_error(sync.precision)} (standard error)"
        said_period = f"{said} {error}; the period is {1e3 * period:.6g} ms"
        doubts.append(LogWarning("sync-uncertain", said_period, about=name))
    if sync.similarity is not None and sync.similarity < ALIKE:
        like = f"gives a similarity of {sync.similarity:.2f} only, of 1: do both logs show the same motion?"
        doubts.append(LogWarning("sync-unlike", f"{said} {like}", about=name))
    return doubts
