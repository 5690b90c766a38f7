"""The cycles of a log in which a motion repeats: found by its returns to the start, or said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.errors import Finding, OptionError
from urmpipe_pipeline.iso9283.likeness import ALIKE, apart, outline
from urmpipe_pipeline.iso9283.motion import Motion

AT_START = 0.1
"""A motion is at the start of a command within this share of its extent ..."""

AWAY = 2.0
"""... and has left it where it is this many times as far away."""

LOOKED_AT = 8
"""Returns that are tried as the end of a cycle: a path may come by its start on the way."""

ALLOWED = "rows from 1 as FIRST:LAST, both ends included, separated by commas, such as 1:1477,1478:2955"


@dataclass(frozen=True, slots=True)
class FoundCycles:
    """The rows of the cycles in a motion.

    Attributes:
        rows: The first and the last row of each, from 0.
        cut: The rows before the first and behind the last one that are no whole cycle: first and last row.
        other: The rows in between in which the motion is another one.
    """

    rows: tuple[tuple[int, int], ...]
    cut: tuple[tuple[int, int], ...] = ()
    other: tuple[tuple[int, int], ...] = ()


def find_cycles(command: Motion, motion: Motion) -> FoundCycles:
    """Return the cycles of a motion that repeats, by its returns to where the command starts.

    A cycle goes from a visit of the command's start to a visit of its end, and its path is like the
    command's; of several such ends the one that is most alike. It is cut in the middle of the visits: inside
    the rest, if it rests there. A motion that is one cycle as a whole is that, and any beside a command that
    rests all the time.

    Args:
        command: The motion that was asked for, once.
        motion: What was done, perhaps many times.
    """
    if not motion.timed:
        return _of_still_poses(command, motion)
    if command.slow.all():
        return FoundCycles(((0, len(motion) - 1),))
    extent, wanted = command.extent, outline(command, command.extent)
    starts = _visits(motion, command.position[0], extent)
    closed = float(np.linalg.norm(command.position[-1] - command.position[0])) <= AT_START * extent
    ends = starts if closed else _visits(motion, command.position[-1], extent)
    found: list[tuple[int, int]] = []
    for start in starts:
        if found and start < found[-1][1]:
            continue
        end = _end(motion, start, [one for one in ends if one > start], wanted, extent)
        if end is not None:
            found.append((start, end))
    if not found:
        whole = apart(wanted, outline(motion, extent)) <= ALIKE * extent
        return FoundCycles(((0, len(motion) - 1),) if whole else ())
    return _told(motion, found, extent)


def _end(motion: Motion, start: int, ends: Sequence[int], wanted: FloatArray, extent: float) -> int | None:
    """Return the row at which a cycle from a row on is most like a command; None if none is.

    Args:
        motion: The motion.
        start: The row at which the cycle begins.
        ends: The rows at which it may end.
        wanted: The outline of the command in [m], shape (k, 3).
        extent: That of the command in [m].
    """
    best, least = None, ALIKE * extent
    for end in ends[:LOOKED_AT]:
        far = apart(wanted, outline(motion.part(start, end, ""), extent))
        if far <= least:
            best, least = end, far
        elif best is not None:
            break
    return best


def first_cycle(motion: Motion) -> tuple[int, int] | None:
    """Return the first and the last row, from 0, of the first cycle of a command that repeats; else None.

    It repeats if it comes back to its start, and goes the same path from there to the start once more.
    """
    if not motion.timed or not motion.extent:
        return None
    starts = _visits(motion, motion.position[0], motion.extent)
    for k in range(1, min((len(starts) + 1) // 2, LOOKED_AT + 1)):
        ends = (starts[0], starts[k]), (starts[k], starts[2 * k])
        first, second = (outline(motion.part(*one, ""), motion.extent) for one in ends)
        if apart(first, second) <= ALIKE * motion.extent:
            return 0, starts[k]
    return None


def _told(motion: Motion, found: Sequence[tuple[int, int]], extent: float) -> FoundCycles:
    """Return cycles so that no two share a row, and the rows that are in none though the arm moves there."""
    rows = [
        (first, last - 1 if k + 1 < len(found) and found[k + 1][0] == last else last)
        for k, (first, last) in enumerate(found)
    ]
    between = [(a[1] + 1, b[0] - 1) for a, b in pairwise(rows)]
    first, last = (0, rows[0][0] - 1), (rows[-1][1] + 1, len(motion) - 1)
    moved = AWAY * AT_START * extent
    whole = [_stretched(motion, one, moved) for one in (first, last)]
    if not whole[0]:
        rows[0] = (0, rows[0][1])
    if not whole[1]:
        rows[-1] = (rows[-1][0], len(motion) - 1)
    cut = tuple(one for one, left in zip((first, last), whole, strict=True) if left)
    return FoundCycles(tuple(rows), cut, tuple(one for one in between if one[1] >= one[0]))


def _stretched(motion: Motion, rows: tuple[int, int], moved: float) -> bool:
    """Tell whether a motion goes further than a distance in [m] in some rows."""
    if rows[1] < rows[0]:
        return False
    return float(np.ptp(motion.position[rows[0] : rows[1] + 1], axis=0).max()) > moved


def _visits(motion: Motion, place: FloatArray, extent: float) -> list[int]:
    """Return a row of each visit of a motion to a place in [m], shape (3,): amid its rest, or the nearest."""
    far = np.linalg.norm(motion.position - place, axis=1)
    near, away = far <= AT_START * extent, far > AWAY * AT_START * extent
    state = np.where(near, 1, np.where(away, -1, 0))
    known = np.flatnonzero(state)
    if not len(known):
        return []
    state = state[known[np.maximum(np.searchsorted(known, np.arange(len(state)), side="right") - 1, 0)]]
    edges = np.flatnonzero(np.diff(np.concatenate(([-1], state, [-1])))).reshape(-1, 2)
    return [_amid(motion, first, last, far) for first, last in edges.tolist()]


def _amid(motion: Motion, first: int, last: int, far: FloatArray) -> int:
    """Return the row amid the longest rest of a visit, else the row that is nearest.

    Args:
        motion: The motion.
        first: The first row of the visit.
        last: The row behind its last one.
        far: Distance of each row of the motion from the place in [m], shape (n,).
    """
    spans = [(max(one.first, first), min(one.last, last - 1)) for one in motion.rests]
    longest = max(spans, key=lambda one: one[1] - one[0], default=(0, 0))
    if longest[1] > longest[0]:
        return (longest[0] + longest[1]) // 2
    return first + int(np.argmin(far[first:last]))


def _of_still_poses(command: Motion, motion: Motion) -> FoundCycles:
    """Return so many rows a cycle as the command has poses; the last ones are cut if some are missing."""
    count = len(command)
    whole = len(motion) // count
    rows = tuple((k * count, (k + 1) * count - 1) for k in range(whole))
    left = (whole * count, len(motion) - 1)
    return FoundCycles(rows, (left,) if left[0] <= left[1] else ())


def parse_cycles(text: str, parameter: str = "cycles") -> tuple[tuple[int, int], ...]:
    """Return the rows of cycles, from 1, of a text such as "1:1477,1478:2955".

    Raises:
        OptionError: With everything that is wrong.
    """
    found, faults = [], []
    for part in text.split(","):
        first, colon, last = (one.strip() for one in part.partition(":"))
        if colon and first.isascii() and last.isascii() and first.isdigit() and last.isdigit():
            found.append((int(first), int(last)))
        else:
            faults.append(Finding(parameter=parameter, found=repr(part.strip()), allowed=ALLOWED))
    if faults:
        raise OptionError(*faults)
    return tuple(found)


def check_cycles(rows: Sequence[tuple[int, int]], count: int, parameter: str = "cycles") -> None:
    """Raise an `OptionError` with everything that is wrong with the rows of cycles, from 1.

    Args:
        rows: The first and the last row of each.
        count: How many rows the log has.
        parameter: The keyword that gave them.
    """
    faults = [
        Finding(
            parameter=parameter,
            found=f"{first}:{last}",
            allowed=f"1 to {count}, the first row before the last",
        )
        for first, last in rows
        if not 1 <= first < last <= count
    ]
    ordered = sorted(rows)
    faults += [
        Finding(parameter=parameter, found=f"{a[0]}:{a[1]} and {b[0]}:{b[1]}", allowed="no row in two cycles")
        for a, b in pairwise(ordered)
        if b[0] <= a[1]
    ]
    if not rows:
        faults = [Finding(parameter=parameter, found="nothing", allowed=ALLOWED)]
    if faults:
        raise OptionError(*faults)
