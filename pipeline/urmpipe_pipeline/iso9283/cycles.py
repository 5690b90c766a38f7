"""The cycles of a log in which a motion repeats, whether they follow the command or not.

`find_cycles`: cycles like the command, by visits to its start and its end; around them whole cycles that are
unlike it, by the length of the path (`_UnlikeCycles`); what is left before the first and behind the last.
`parse_cycles`, `check_cycles`: cycles that a person chose.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Finding, OptionError
from urmpipe_pipeline.iso9283.motion import Motion, apart_rows
from urmpipe_pipeline.joint_log import GAP

AT_START = 0.1
"""A motion is at the start of a command within this share of its extent ..."""

AWAY = 2.0
"""... and has left it where it is this many times as far away."""

LOOKED_AT = 8
"""Returns that are tried as the end of a cycle: a path may come by its start on the way."""

WHOLE = 0.8
"""What goes on for this share of a cycle's path and time is no run-in but a cycle, displaced or on another
path. Equal cycles differ by a few percent; a fast way to the start is none, however long."""

RETURNED = 0.55
"""A motion that is back at the start after this share of a cycle's time ends a cycle there. A figure eight
crosses its start earlier."""

SNAP = 0.3
"""A cycle ends in the rest that is no further than this share of its path from where its length ends."""

STOPPED = 0.1
"""A cycle that rests on its way for longer than the command ever does, by this share of its time, stopped."""

COMPLETE = 0.995
"""A part of a cycle has a path no longer than this share of it: rows nearer to its end are at its end."""

ALLOWED = "rows from 1 as FIRST:LAST, both ends included, separated by commas, such as 1:1477,1478:2955"


@dataclass(frozen=True, slots=True)
class FoundCycles:
    """The rows of the cycles in a motion.

    Attributes:
        rows: The first and the last row of each whole cycle, from 0, like the command or not.
        cut: The rows before the first and behind the last one that are no whole cycle: first and last row.
        returns: The rows between two cycles that lead from the command's end to its start.
    """

    rows: tuple[tuple[int, int], ...]
    cut: tuple[tuple[int, int], ...] = ()
    returns: tuple[tuple[int, int], ...] = ()


def find_cycles(command: Motion, motion: Motion) -> FoundCycles:
    """Return the cycles of a motion that repeats, if one of them is like the command; else none.

    A cycle like the command goes from a visit of its start to a visit of its end along its path; of several
    such ends the one that is most alike. It is cut in the middle of the visits: inside the rest, if it rests
    there. What is as long as a cycle around these, on whatever path, is a cycle too. A motion that is one
    cycle as a whole is that, and any beside a command that rests all the time.

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
    outside = (0, found[0][0]), (found[-1][1], len(motion) - 1)
    moves = any(_stretched(motion, rows, AWAY * AT_START * extent) for rows in outside)
    if moves or any(before[1] < after[0] for before, after in pairwise(found)):
        unlike = _UnlikeCycles(command, motion, wanted, starts, found, closed=closed)
        found = sorted([*found, *unlike.rows()])
    return _without_shared_rows(motion, found, extent)


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


class _UnlikeCycles:
    """The whole cycles of a motion that are unlike the command, found from those that are like it.

    They begin and end at visits of the command's start, else after the path of a cycle, in a rest if one is
    near: the length of a path stays the same if it is displaced or mirrored, at any speed.
    """

    def __init__(
        self,
        command: Motion,
        motion: Motion,
        wanted: FloatArray,
        starts: Sequence[int],
        like: Sequence[tuple[int, int]],
        *,
        closed: bool,
    ) -> None:
        self.motion, self.extent, self.wanted = motion, command.extent, wanted
        self.starts, self.like, self.closed = starts, like, closed
        self.rests = [(rest.first + rest.last) // 2 for rest in motion.rests]
        self.longest_rest = max(
            (command.t[rest.last] - command.t[rest.first] for rest in command.rests), default=0.0
        )
        first, last = np.array(like).T
        self.path = path_length(motion, self.extent, int(np.median(last - first)))
        self.length = float(np.median(self.path[last] - self.path[first]))
        self.duration = float(np.median([self._lasts(*rows) for rows in like]))
        direct = float(np.linalg.norm(command.position[-1] - command.position[0]))
        way_back = float(np.min(self.path[first[1:]] - self.path[last[:-1]], initial=np.inf))
        if way_back > self.length + direct:  # no two neighbours are like the command
            way_back = direct
        self.way_back = 0.0 if closed else way_back

    def rows(self) -> list[tuple[int, int]]:
        """Return the first and the last row of each."""
        found = [*self._before(self.like[0][0]), *self._behind(self.like[-1][1])]
        for (_, first), (last, _) in pairwise(self.like):
            found += self._between(first, last)
        return [(first, self._cycle_end(first, last)) for first, last in found if first < last]

    def _before(self, here: int) -> list[tuple[int, int]]:
        bounds = self._returns(here, 0)
        found = [rows for pair in pairwise(bounds) for rows in self._cut_up(*pair)]
        if not self._is_cut(bounds[-1], 0):
            found += self._step(bounds[-1], 0, 0.0)
        return found

    def _between(self, first: int, here: int) -> list[tuple[int, int]]:
        bounds = self._returns(here, first)
        if not self.closed:
            found = self._step(bounds[-1], first, -self.way_back)
        else:
            found = []
            if len(bounds) > 1 and self._lasts(first, bounds[-1]) < RETURNED * self.duration:
                bounds.pop()
            if bounds[-1] > first:
                bounds.append(first)
        return found + [rows for pair in pairwise(bounds) for rows in self._cut_up(*pair)]

    def _behind(self, here: int) -> list[tuple[int, int]]:
        end = len(self.motion) - 1
        found: list[tuple[int, int]] = []
        if not self.closed:
            back = next((row for row in self.starts if row > here), None)
            if back is not None:
                found += self._step(back, here, -self.way_back)
            here = self._row_at(self.path[here] + self.way_back) if back is None else back
        bounds = self._returns(here, end)
        found += [rows for pair in pairwise(bounds) for rows in self._cut_up(*pair)]
        here = bounds[-1]
        if stop := self._stop_behind(here, end):
            found.append((here, stop))
            here = stop
        return found if self._is_cut(here, end) else found + self._step(here, end, self.way_back)

    def _returns(self, here: int, limit: int) -> list[int]:
        """Return a row and those towards another at which the motion is back at the start, in this order."""
        bounds = [here]
        for row in sorted(_rows_ahead(self.starts, here, limit), key=lambda row: abs(row - here)):
            if self._is_cut(bounds[-1], limit):
                break
            if self._lasts(bounds[-1], row) >= RETURNED * self.duration:
                bounds.append(row)
        return bounds

    def _cut_up(self, here: int, limit: int) -> list[tuple[int, int]]:
        """Return the cycles from one return to the start to another: at least one."""
        first, last = sorted((here, limit))
        found = []
        if (stop := self._stop_behind(first, last)) and self._count(self._length(stop, last), np.inf):
            found, first = [(first, stop)], stop
        length = self._length(first, last)
        count = max(self._count(length, self._lasts(first, last)), 1)
        bounds = [*self._bounds(last, first, count - 1, length / count), first]
        return [*found, *((start, end) for end, start in pairwise(bounds))]

    def _step(self, here: int, limit: int, more: float) -> list[tuple[int, int]]:
        """Return the whole cycles from a return to the start on, towards a row where none needs to end.

        Args:
            here: The return to the start.
            limit: The last row that may be in a cycle.
            more: What the path there has less in [m] than that of cycles with their ways back.
        """
        count = self._count(self._length(here, limit) + more, self._lasts(here, limit))
        bounds = self._bounds(here, limit, count, self.length + self.way_back)
        return [(min(pair), max(pair)) for pair in pairwise(bounds)]

    def _count(self, length: float, lasts: float) -> int:
        """Return how many cycles a path in [m] has room for that lasts so long in [s]."""
        by_path = (length + (1.0 - WHOLE) * self.length) / (self.length + self.way_back)
        return max(int(min(by_path, lasts / (WHOLE * self.duration))), 0)

    def _bounds(self, here: int, limit: int, count: int, length: float) -> list[int]:
        """Return a row and so many towards another, each a path in [m] further, or in a rest near there."""
        bounds = [here]
        for _ in range(count):
            target = self.path[bounds[-1]] + (length if limit > here else -length)
            rest = self._rest_near(target, bounds[-1], limit)
            row = self._row_at(target) if rest is None else rest
            bounds.append(min(row, limit) if limit > here else max(row, limit))
        return bounds

    def _cycle_end(self, first: int, limit: int) -> int:
        """Return the last row of a cycle, without the way back to the next one's start."""
        target = self.path[first] + self.length
        if self.closed or target >= self.path[limit]:
            return limit
        rest = self._rest_near(target, first, limit)
        return self._row_at(target) if rest is None else rest

    def _rest_near(self, target: float, here: int, limit: int) -> int | None:
        """Return a row amid the rest at which the length of the path is nearest to one in [m]."""
        rests = _rows_ahead(self.rests, here, limit)
        near = min(rests, key=lambda row: abs(self.path[row] - target), default=None)
        return near if near is not None and abs(self.path[near] - target) <= SNAP * self.length else None

    def _row_at(self, length: float) -> int:
        return int(np.clip(np.searchsorted(self.path, length), 0, len(self.path) - 1))

    def _length(self, first: int, last: int) -> float:
        return abs(float(self.path[last] - self.path[first]))

    def _lasts(self, here: int, limit: int) -> float:
        """Return the time from the rest about one row to the rest about another in [s]."""
        first, last = sorted((here, limit))
        leaves, arrives = self._leaves(first), self._row_at(self.path[last])
        return max(float(self.motion.t[arrives] - self.motion.t[leaves]), 0.0)

    def _leaves(self, row: int) -> int:
        return int(np.searchsorted(self.path, self.path[row], side="right")) - 1

    def _stop_behind(self, first: int, last: int) -> int | None:
        """Return the last row of a rest in which a cycle stopped on its way, for as long as a cycle takes."""
        t = self.motion.t
        for rest in self.motion.rests:
            long = t[rest.last] - t[rest.first] > self.longest_rest + STOPPED * self.duration
            late = t[rest.last] - t[self._leaves(first)] > (1.0 - STOPPED) * self.duration
            if first < rest.first < rest.last <= last and long and late:
                return rest.last if self._follows(first, rest.first, of_end=False) else None
        return None

    def _is_cut(self, here: int, limit: int) -> bool:
        """Return whether the rows from one to an end of the log are a cycle that the log cuts there."""
        if limit == 0:
            first, last = 0, self._row_at(self.path[here] - self.way_back)
        elif limit == len(self.motion) - 1:
            first, last = here, limit
        else:
            return False
        return self._follows(first, last, of_end=limit == 0)

    def _follows(self, first: int, last: int, *, of_end: bool) -> bool:
        """Return whether rows follow a part of the command: its end or its start."""
        length = self.path[last] - self.path[first]
        if not AWAY * AT_START * self.extent < length < COMPLETE * self.length:
            return False
        count = max(round(len(self.wanted) * length / self.length), 2)
        part = self.wanted[-count:] if of_end else self.wanted[:count]
        return apart(part, outline(self.motion.part(first, last, ""), self.extent)) <= AT_START * self.extent


def _rows_ahead(rows: Iterable[int], here: int, limit: int) -> list[int]:
    """Return the rows between one, without it, and another, with it, that stands on either side."""
    return [row for row in rows if here < row <= limit or limit <= row < here]


def _without_shared_rows(motion: Motion, found: Sequence[tuple[int, int]], extent: float) -> FoundCycles:
    """Return cycles so that no two share a row, and the rows that are in none though the arm moves there."""
    rows = [
        (first, last - 1 if k + 1 < len(found) and found[k + 1][0] == last else last)
        for k, (first, last) in enumerate(found)
    ]
    returns = tuple((a[1] + 1, b[0] - 1) for a, b in pairwise(rows) if a[1] + 1 < b[0])
    ends = (0, rows[0][0] - 1), (rows[-1][1] + 1, len(motion) - 1)
    moving = [_stretched(motion, one, AT_START * extent) for one in ends]
    if not moving[0]:
        rows[0] = (0, rows[0][1])
    if not moving[1]:
        rows[-1] = (rows[-1][0], len(motion) - 1)
    cut = tuple(one for one, left in zip(ends, moving, strict=True) if left)
    return FoundCycles(tuple(rows), cut, returns)


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
    rows = [_amid(motion, first, last, far, AT_START * extent) for first, last in edges.tolist()]
    return [row for row in rows if 0 < row < len(motion) - 1 or _reaches(motion, row, far[row])]


def _reaches(motion: Motion, row: int, far: float) -> bool:
    """Return whether a motion reaches a place that is so far away in [m] at an end of the log, or is cut."""
    step = np.linalg.norm(np.diff(motion.position[:2] if row == 0 else motion.position[-2:], axis=0))
    return bool(motion.slow[0 if row == 0 else -1] or far <= 1.5 * step)


def _amid(motion: Motion, first: int, last: int, far: FloatArray, near: float) -> int:
    """Return the row amid the longest rest at the place of a visit, else the row that is nearest.

    Args:
        motion: The motion.
        first: The first row of the visit.
        last: The row behind its last one.
        far: Distance of each row of the motion from the place in [m], shape (n,).
        near: What is no further away in [m] is at the place.
    """
    spans = [(max(one.first, first), min(one.last, last - 1)) for one in motion.rests]
    spans = [one for one in spans if one[0] < one[1] and far[(one[0] + one[1]) // 2] <= near]
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


POINTS = 150
"""Points, even in arc length, by which a path is told."""

BLOCKS = 1500
"""A motion is averaged to no more rows than twice this first: that holds its noise down."""

STEP = 0.01
"""A path goes on in steps of this share of the command's extent: what trembles, or rests, is no way."""

STEP_NOISE = 8.0
"""Steps are no shorter than so many standard deviations of the noise."""

JUMP = 10.0
"""No arm goes so many times as far from one row to the next as it mostly does while it moves."""

ALIKE = 0.2
"""Paths are alike if no point is further away than this share of the command's extent. Half of a square, its
other way round and the next of its corners are half an extent away or more."""


def outline(motion: Motion, extent: float) -> FloatArray:
    """Return points of a motion's path that are even in its arc length, in [m], shape (150, 3).

    Args:
        motion: The motion.
        extent: That of the command in [m].
    """
    _, path = _vertices(motion, extent, len(motion))
    along = _arc_length(path)
    at = np.linspace(0.0, along[-1], POINTS)
    return np.column_stack([np.interp(at, along, values) for values in path.T])


def path_length(motion: Motion, extent: float, rows: int) -> FloatArray:
    """Return the length of the path up to each row in [m], shape (n,); noise and rests add nothing.

    A jump adds as much as a step of the path, so that it begins and ends a rest as any way does.

    Args:
        motion: The motion, perhaps of many cycles.
        extent: That of the command in [m].
        rows: Rows of one cycle, by which noise is averaged.
    """
    steps = np.diff(motion.position, axis=0)
    longest = np.where(jumps(motion), 2.0 * STEP * extent, np.inf)
    length = np.linalg.norm(steps, axis=1)
    steps *= np.minimum(longest / np.where(length > 0.0, length, 1.0), 1.0)[:, np.newaxis]
    joined = motion.position[0] + np.vstack((np.zeros((1, 3)), steps.cumsum(axis=0)))
    first, path = _vertices(replace(motion, position=joined), extent, rows)
    return _arc_length(path)[np.searchsorted(first, np.arange(len(motion)), side="right") - 1]


def _vertices(motion: Motion, extent: float, rows: int) -> tuple[IntArray, FloatArray]:
    """Return the rows, shape (k,), and the places in [m], shape (k, 3), at which a path has gone one step."""
    block = max(rows // BLOCKS, 1)
    first = np.arange(0, len(motion), block)
    sizes = np.diff(np.append(first, len(motion)))[:, np.newaxis]
    place = np.add.reduceat(motion.position, first, axis=0) / sizes
    kept = apart_rows(place, max(STEP * extent, STEP_NOISE * motion.noise / np.sqrt(block)))
    return first[kept], place[kept]


def _arc_length(path: FloatArray) -> FloatArray:
    return np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))))


def jumps(motion: Motion) -> BoolArray:
    """Return whether a motion goes as far as no arm does from one row to the next, shape (n - 1,).

    A step over a gap, where rows are missing, is no jump.
    """
    if motion.slow.all():
        return np.zeros(len(motion.slow), np.bool_)
    dt, step = np.diff(motion.t), np.linalg.norm(np.diff(motion.position, axis=0), axis=1)
    return np.asarray((dt <= GAP * np.median(dt)) & (step > JUMP * np.median(step[~motion.slow])))


def apart(first: FloatArray, second: FloatArray) -> float:
    """Return the discrete Frechet distance of two paths in [m]: the shortest leash of two that go forward.

    d_ij = max(|a_i - b_j|, min(d_i-1,j-1, d_i-1,j, d_i,j-1)), along the diagonals.

    Args:
        first: Points a in [m], shape (n, 3).
        second: Points b in [m], shape (m, 3).

    Source: Eiter and Mannila 1994, Computing discrete Frechet distance.
    """
    n, m = len(first), len(second)
    square = (first**2).sum(axis=1)[:, np.newaxis] + (second**2).sum(axis=1) - 2.0 * first @ second.T
    distance = np.sqrt(np.maximum(square, 0.0))
    backwards = distance[:, ::-1]
    before = np.full(n + 1, np.inf)  # of the diagonal i + j - 2, by i + 1
    last = np.full(n + 1, np.inf)
    last[1] = distance[0, 0]
    for diagonal in range(1, n + m - 1):
        low, end = max(0, diagonal - m + 1), min(n, diagonal + 1)
        reach = np.minimum(np.minimum(before[low:end], last[low:end]), last[low + 1 : end + 1])
        now = np.full(n + 1, np.inf)
        now[low + 1 : end + 1] = np.maximum(backwards.diagonal(m - 1 - diagonal), reach)
        before, last = last, now
    return float(last[n])


def alike(command: Motion, motion: Motion) -> bool:
    """Tell whether a motion goes along the path of a command."""
    extent = command.extent
    return apart(outline(command, extent), outline(motion, extent)) <= ALIKE * extent
