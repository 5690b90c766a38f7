"""The cycles of a log in which a motion repeats, whether they follow the command or not.

1. `is_same_path`: two paths are the same if their discrete Frechet distance is 20 % of the command's extent
   or less. The time along them does not count.
2. `find_cycles`: matching cycles lead from a visit of the command's start to a visit of its end along its
   path. Around them, whole cycles that do not match it are found by the length of the path (`_OtherCycles`).
   What is left before the first and after the last cycle is incomplete.
3. `find_first_cycle`: the first cycle of a command that itself repeats.
4. `parse_cycles`, `check_cycles`: cycles that the user chose.

Source: Eiter and Mannila 1994, Computing discrete Frechet distance. The thresholds are of this project.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Finding, OptionError
from urmpipe_pipeline.iso9283.motion import Motion, thin_by_distance
from urmpipe_pipeline.joint_log import GAP

PATH_POINTS = 150  # even in arc length, by which two paths are compared
AVERAGED_ROWS = 1500  # a path is averaged to 1 to 2 times these rows first, against noise
PATH_STEP = 0.01  # of the command's extent: rests and noise are shorter and add no length
STEP_NOISE = 8.0  # standard deviations of the noise: the least step of a path
JUMP_RATIO = 10.0  # to the median step of the moving arm: what is longer from one row to the next is a jump
SAME_PATH = 0.2  # of the extent; half of a square, its reverse or its next corner is 0.5 or more away

AT_START = 0.1  # of the extent: distance from the start of the command within which it is visited
LEFT_START = 0.2  # of the extent: distance at which a visit has ended
MAX_VISITS = 8  # returns that are tried as the end of a cycle: a path may pass its start on the way
WHOLE_CYCLE = 0.8  # of a cycle's path and time; equal cycles differ by a few percent, a run-in is faster
EARLIEST_RETURN = 0.55  # of a cycle's time; a figure eight passes its start earlier
REST_SNAP = 0.3  # of a cycle's path: a cycle ends in a rest that is so near to the end of its length
STOPPED = 0.1  # of a cycle's time: a rest that is longer by this than any of the command is a stop
INCOMPLETE = 0.995  # of a cycle's path: rows nearer to its end are at its end

ALLOWED = "rows from 1 as FIRST:LAST, both ends included, separated by commas, such as 1:1477,1478:2955"

Rows: TypeAlias = tuple[int, int]
"""The first and the last row of a part of a motion, from 0."""


class FoundCycles(NamedTuple):
    """The rows of the cycles in a motion, from 0.

    Attributes:
        rows: Each whole cycle, whether it follows the command or not.
        incomplete: What is before the first and after the last of them, if the arm moves there.
        returns: What leads from the command's end to its start, between two cycles.
    """

    rows: tuple[Rows, ...]
    incomplete: tuple[Rows, ...] = ()
    returns: tuple[Rows, ...] = ()


def resample_path(motion: Motion, extent: float) -> FloatArray:
    """Return points of a motion's path that are even in its arc length, in [m], shape (150, 3).

    Args:
        motion: The motion.
        extent: Extent of the command in [m].
    """
    _, path = _vertices(motion, extent, len(motion))
    s = _arc_length(path)
    even = np.linspace(0.0, s[-1], PATH_POINTS)
    return np.column_stack([np.interp(even, s, values) for values in path.T])


def path_length(motion: Motion, extent: float, rows: int) -> FloatArray:
    """Return the length of the path up to each row in [m], shape (n,); noise and rests add nothing.

    A jump adds two steps of the path, so that a rest ends and begins at it as at any motion.

    Args:
        motion: The motion, perhaps of many cycles.
        extent: Extent of the command in [m].
        rows: Rows of one cycle, by which noise is averaged.
    """
    steps = np.diff(motion.position, axis=0)
    longest = np.where(find_jumps(motion), 2.0 * PATH_STEP * extent, np.inf)
    length = np.linalg.norm(steps, axis=1)
    steps *= np.minimum(longest / np.where(length > 0.0, length, 1.0), 1.0)[:, np.newaxis]
    joined = motion.position[0] + np.vstack((np.zeros((1, 3)), steps.cumsum(axis=0)))
    first, path = _vertices(replace(motion, position=joined), extent, rows)
    return _arc_length(path)[np.searchsorted(first, np.arange(len(motion)), side="right") - 1]


def _vertices(motion: Motion, extent: float, rows: int) -> tuple[IntArray, FloatArray]:
    """Return the rows, shape (k,), and the points in [m], shape (k, 3), after each step of a path."""
    block = max(rows // AVERAGED_ROWS, 1)
    first = np.arange(0, len(motion), block)
    sizes = np.diff(np.append(first, len(motion)))[:, np.newaxis]
    mean = np.add.reduceat(motion.position, first, axis=0) / sizes
    kept = thin_by_distance(mean, max(PATH_STEP * extent, STEP_NOISE * motion.noise / np.sqrt(block)))
    return first[kept], mean[kept]


def _arc_length(path: FloatArray) -> FloatArray:
    return np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))))


def find_jumps(motion: Motion) -> BoolArray:
    """Return whether a motion goes further from one row to the next than any arm, shape (n - 1,).

    A step over a gap, where rows are missing, is no jump.
    """
    if motion.is_resting.all():
        return np.zeros(len(motion.is_resting), np.bool_)
    dt, step = np.diff(motion.t), np.linalg.norm(np.diff(motion.position, axis=0), axis=1)
    is_long = step > JUMP_RATIO * np.median(step[~motion.is_resting])
    return np.asarray((dt <= GAP * np.median(dt)) & is_long)


def frechet_distance(first: FloatArray, second: FloatArray) -> float:
    """Return the discrete Frechet distance of two paths in [m].

    The least over all ways forwards along both paths of the largest distance between their points:
    d_ij = max(|a_i - b_j|, min(d_i-1,j-1, d_i-1,j, d_i,j-1)), computed along the diagonals.

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


def is_same_path(command: Motion, motion: Motion) -> bool:
    """Return whether a motion follows the path of a command, at any speed."""
    extent = command.extent
    distance = frechet_distance(resample_path(command, extent), resample_path(motion, extent))
    return distance <= SAME_PATH * extent


def find_cycles(command: Motion, motion: Motion) -> FoundCycles:
    """Return the cycles of a motion that repeats; none if no cycle matches the command.

    A matching cycle ends at that visit of the command's end at which it is most similar to the command. It
    is cut in the middle of the visits: within the rest, if it rests there. Around them, what is as long as a
    cycle is a cycle too, on whatever path. A motion that is one cycle as a whole is that cycle, and so is
    any motion if the command only rests.

    Args:
        command: The commanded motion, once.
        motion: The motion of the log.
    """
    if not motion.timed:
        return _split_static_poses(command, motion)
    if command.is_resting.all():
        return FoundCycles(((0, len(motion) - 1),))
    extent = command.extent
    path = resample_path(command, extent)
    starts = _find_visits(motion, command.position[0], extent)
    closed = float(np.linalg.norm(command.position[-1] - command.position[0])) <= AT_START * extent
    ends = starts if closed else _find_visits(motion, command.position[-1], extent)
    cycles: list[Rows] = []
    for start in starts:
        if cycles and start < cycles[-1][1]:
            continue
        end = _find_end(motion, start, [row for row in ends if row > start], path, extent)
        if end is not None:
            cycles.append((start, end))
    if not cycles:
        matches = frechet_distance(path, resample_path(motion, extent)) <= SAME_PATH * extent
        return FoundCycles(((0, len(motion) - 1),) if matches else ())
    outside = (0, cycles[0][0]), (cycles[-1][1], len(motion) - 1)
    moves_outside = any(_moves(motion, rows, LEFT_START * extent) for rows in outside)
    if moves_outside or any(before[1] < after[0] for before, after in pairwise(cycles)):
        other_cycles = _OtherCycles(command, motion, path, starts, cycles, closed=closed)
        cycles = sorted([*cycles, *other_cycles.rows()])
    return _separate(motion, cycles, extent)


def _find_end(motion: Motion, start: int, ends: Sequence[int], path: FloatArray, extent: float) -> int | None:
    """Return the row at which a cycle is most similar to a command; None if it never is.

    Args:
        motion: The motion.
        start: The row at which the cycle begins.
        ends: The rows at which it may end.
        path: The resampled path of the command in [m], shape (k, 3).
        extent: Extent of the command in [m].
    """
    best, least = None, SAME_PATH * extent
    for end in ends[:MAX_VISITS]:
        distance = frechet_distance(path, resample_path(motion.slice(start, end), extent))
        if distance <= least:
            best, least = end, distance
        elif best is not None:
            break
    return best


def find_first_cycle(motion: Motion) -> Rows | None:
    """Return the rows of the first cycle of a command that repeats; None if it does not.

    It repeats if it comes back to its start, and follows the same path from there to the start once more.
    """
    if not motion.timed or not motion.extent:
        return None
    starts = _find_visits(motion, motion.position[0], motion.extent)
    for k in range(1, min((len(starts) + 1) // 2, MAX_VISITS + 1)):
        parts = motion.slice(starts[0], starts[k]), motion.slice(starts[k], starts[2 * k])
        first, second = (resample_path(part, motion.extent) for part in parts)
        if frechet_distance(first, second) <= SAME_PATH * motion.extent:
            return 0, starts[k]
    return None


class _OtherCycles:
    """The whole cycles of a motion that do not match the command, found from those that do.

    They begin and end at visits of the command's start, else after the path length of a cycle, in a rest if
    one is near: the length stays the same if a path is displaced or mirrored, at any speed.
    """

    def __init__(
        self,
        command: Motion,
        motion: Motion,
        path: FloatArray,
        starts: Sequence[int],
        matching: Sequence[Rows],
        *,
        closed: bool,
    ) -> None:
        self.motion, self.extent, self.command_path = motion, command.extent, path
        self.starts, self.matching, self.closed = starts, matching, closed
        self.rests = [(rest.first + rest.last) // 2 for rest in motion.rests]
        self.longest_rest = max(
            (command.t[rest.last] - command.t[rest.first] for rest in command.rests), default=0.0
        )
        first, last = np.array(matching).T
        self.path = path_length(motion, self.extent, int(np.median(last - first)))
        self.length = float(np.median(self.path[last] - self.path[first]))
        self.duration = float(np.median([self._duration(*rows) for rows in matching]))
        direct = float(np.linalg.norm(command.position[-1] - command.position[0]))
        way_back = float(np.min(self.path[first[1:]] - self.path[last[:-1]], initial=np.inf))
        if way_back > self.length + direct:  # no two neighbours match the command
            way_back = direct
        self.way_back = 0.0 if closed else way_back

    def rows(self) -> list[Rows]:
        """Return the rows of each."""
        cycles = [*self._before(self.matching[0][0]), *self._after(self.matching[-1][1])]
        for (_, first), (last, _) in pairwise(self.matching):
            cycles += self._between(first, last)
        return [(first, self._cycle_end(first, last)) for first, last in cycles if first < last]

    def _before(self, here: int) -> list[Rows]:
        bounds = self._returns(here, 0)
        cycles = [rows for pair in pairwise(bounds) for rows in self._split(*pair)]
        if not self._is_cut_off(bounds[-1], 0):
            cycles += self._step(bounds[-1], 0, 0.0)
        return cycles

    def _between(self, first: int, here: int) -> list[Rows]:
        bounds = self._returns(here, first)
        cycles: list[Rows] = []
        if not self.closed:
            cycles = self._step(bounds[-1], first, -self.way_back)
        else:
            if len(bounds) > 1 and self._duration(first, bounds[-1]) < EARLIEST_RETURN * self.duration:
                bounds.pop()
            if bounds[-1] > first:
                bounds.append(first)
        return cycles + [rows for pair in pairwise(bounds) for rows in self._split(*pair)]

    def _after(self, here: int) -> list[Rows]:
        end = len(self.motion) - 1
        cycles: list[Rows] = []
        if not self.closed:
            back = next((row for row in self.starts if row > here), None)
            if back is not None:
                cycles += self._step(back, here, -self.way_back)
            here = self._row_at(self.path[here] + self.way_back) if back is None else back
        bounds = self._returns(here, end)
        cycles += [rows for pair in pairwise(bounds) for rows in self._split(*pair)]
        here = bounds[-1]
        if stop := self._find_stop(here, end):
            cycles.append((here, stop))
            here = stop
        return cycles if self._is_cut_off(here, end) else cycles + self._step(here, end, self.way_back)

    def _returns(self, here: int, limit: int) -> list[int]:
        """Return a row, and those towards another at which the motion is back at the start, in this order."""
        bounds = [here]
        for row in sorted(_rows_ahead(self.starts, here, limit), key=lambda row: abs(row - here)):
            if self._is_cut_off(bounds[-1], limit):
                break
            if self._duration(bounds[-1], row) >= EARLIEST_RETURN * self.duration:
                bounds.append(row)
        return bounds

    def _split(self, here: int, limit: int) -> list[Rows]:
        """Return the cycles from one return to the start to another: at least one."""
        first, last = sorted((here, limit))
        cycles: list[Rows] = []
        if (stop := self._find_stop(first, last)) and self._count(self._length(stop, last), np.inf):
            cycles, first = [(first, stop)], stop
        length = self._length(first, last)
        count = max(self._count(length, self._duration(first, last)), 1)
        bounds = [*self._bounds(last, first, count - 1, length / count), first]
        return [*cycles, *((start, end) for end, start in pairwise(bounds))]

    def _step(self, here: int, limit: int, missing: float) -> list[Rows]:
        """Return the whole cycles from a return to the start towards a row where none needs to end.

        Args:
            here: The return to the start.
            limit: The last row that may be in a cycle.
            missing: Path length in [m] that whole cycles with their ways back have in addition.
        """
        count = self._count(self._length(here, limit) + missing, self._duration(here, limit))
        bounds = self._bounds(here, limit, count, self.length + self.way_back)
        return [(min(pair), max(pair)) for pair in pairwise(bounds)]

    def _count(self, length: float, duration: float) -> int:
        """Return the number of cycles in a path of a length in [m] and a duration in [s]."""
        by_path = (length + (1.0 - WHOLE_CYCLE) * self.length) / (self.length + self.way_back)
        return max(int(min(by_path, duration / (WHOLE_CYCLE * self.duration))), 0)

    def _bounds(self, here: int, limit: int, count: int, length: float) -> list[int]:
        """Return a row and `count` more towards another, each a length in [m] further or in a rest there."""
        bounds = [here]
        for _ in range(count):
            target = self.path[bounds[-1]] + (length if limit > here else -length)
            rest = self._find_rest(target, bounds[-1], limit)
            row = self._row_at(target) if rest is None else rest
            bounds.append(min(row, limit) if limit > here else max(row, limit))
        return bounds

    def _cycle_end(self, first: int, limit: int) -> int:
        """Return the last row of a cycle, without the way back to the next one's start."""
        target = self.path[first] + self.length
        if self.closed or target >= self.path[limit]:
            return limit
        rest = self._find_rest(target, first, limit)
        return self._row_at(target) if rest is None else rest

    def _find_rest(self, target: float, here: int, limit: int) -> int | None:
        """Return the middle row of the rest that is nearest to a path length in [m]; None if none is near."""
        rests = _rows_ahead(self.rests, here, limit)
        rest = min(rests, key=lambda row: abs(self.path[row] - target), default=None)
        return rest if rest is not None and abs(self.path[rest] - target) <= REST_SNAP * self.length else None

    def _row_at(self, length: float) -> int:
        return int(np.clip(np.searchsorted(self.path, length), 0, len(self.path) - 1))

    def _length(self, first: int, last: int) -> float:
        return abs(float(self.path[last] - self.path[first]))

    def _duration(self, here: int, limit: int) -> float:
        """Return the time from the end of the rest at one row to the begin of the rest at another in [s]."""
        first, last = sorted((here, limit))
        leaves, arrives = self._departure_row(first), self._row_at(self.path[last])
        return max(float(self.motion.t[arrives] - self.motion.t[leaves]), 0.0)

    def _departure_row(self, row: int) -> int:
        return int(np.searchsorted(self.path, self.path[row], side="right")) - 1

    def _find_stop(self, first: int, last: int) -> int | None:
        """Return the last row of a rest in which a cycle stopped on its way, for as long as a cycle takes."""
        t = self.motion.t
        for rest in self.motion.rests:
            is_long = t[rest.last] - t[rest.first] > self.longest_rest + STOPPED * self.duration
            is_late = t[rest.last] - t[self._departure_row(first)] > (1.0 - STOPPED) * self.duration
            if first < rest.first < rest.last <= last and is_long and is_late:
                return rest.last if self._follows_part(first, rest.first, of_end=False) else None
        return None

    def _is_cut_off(self, here: int, limit: int) -> bool:
        """Return whether the rows from one to an end of the log are a cycle that the log cuts there."""
        if limit == 0:
            first, last = 0, self._row_at(self.path[here] - self.way_back)
        elif limit == len(self.motion) - 1:
            first, last = here, limit
        else:
            return False
        return self._follows_part(first, last, of_end=limit == 0)

    def _follows_part(self, first: int, last: int, *, of_end: bool) -> bool:
        """Return whether rows follow a part of the command: its end or its start."""
        length = self.path[last] - self.path[first]
        if not LEFT_START * self.extent < length < INCOMPLETE * self.length:
            return False
        count = max(round(len(self.command_path) * length / self.length), 2)
        part = self.command_path[-count:] if of_end else self.command_path[:count]
        path = resample_path(self.motion.slice(first, last), self.extent)
        return frechet_distance(part, path) <= AT_START * self.extent


def _rows_ahead(rows: Iterable[int], here: int, limit: int) -> list[int]:
    """Return the rows after `here` up to `limit`, on whichever side that is."""
    return [row for row in rows if here < row <= limit or limit <= row < here]


def _separate(motion: Motion, cycles: Sequence[Rows], extent: float) -> FoundCycles:
    """Return cycles of which no two share a row, and the rows in no cycle in which the arm moves."""
    rows = [
        (first, last - 1 if k + 1 < len(cycles) and cycles[k + 1][0] == last else last)
        for k, (first, last) in enumerate(cycles)
    ]
    returns = tuple((a[1] + 1, b[0] - 1) for a, b in pairwise(rows) if a[1] + 1 < b[0])
    ends = (0, rows[0][0] - 1), (rows[-1][1] + 1, len(motion) - 1)
    moves = [_moves(motion, end, AT_START * extent) for end in ends]
    if not moves[0]:
        rows[0] = (0, rows[0][1])
    if not moves[1]:
        rows[-1] = (rows[-1][0], len(motion) - 1)
    return FoundCycles(
        tuple(rows), tuple(end for end, is_moving in zip(ends, moves, strict=True) if is_moving), returns
    )


def _moves(motion: Motion, rows: Rows, distance: float) -> bool:
    """Return whether a coordinate of a motion changes by more than a distance in [m] in some rows."""
    if rows[1] < rows[0]:
        return False
    return float(np.ptp(motion.position[rows[0] : rows[1] + 1], axis=0).max()) > distance


def _find_visits(motion: Motion, point: FloatArray, extent: float) -> list[int]:
    """Return one row per visit of a point in [m], shape (3,): the middle of its rest, or the nearest row.

    A visit that an end of the log cuts before the point is reached is left out.
    """
    distance = np.linalg.norm(motion.position - point, axis=1)
    near = AT_START * extent
    state = np.where(distance <= near, 1, np.where(distance > LEFT_START * extent, -1, 0))
    known = np.flatnonzero(state)
    if not len(known):
        return []
    state = state[known[np.maximum(np.searchsorted(known, np.arange(len(state)), side="right") - 1, 0)]]
    visits = np.flatnonzero(np.diff(np.concatenate(([-1], state, [-1])))).reshape(-1, 2)
    rows = [_visit_row(motion, first, end, distance, near) for first, end in visits.tolist()]
    return [row for row in rows if 0 < row < len(motion) - 1 or _is_reached(motion, row, distance[row])]


def _is_reached(motion: Motion, row: int, distance: float) -> bool:
    """Return whether a motion is at a point at an end of the log: at rest, or 1.5 steps away or less."""
    step = np.linalg.norm(np.diff(motion.position[:2] if row == 0 else motion.position[-2:], axis=0))
    return bool(motion.is_resting[0 if row == 0 else -1] or distance <= 1.5 * step)


def _visit_row(motion: Motion, first: int, end: int, distance: FloatArray, near: float) -> int:
    """Return the middle row of the longest rest at the point of a visit, else the nearest row.

    Args:
        motion: The motion.
        first: The first row of the visit.
        end: The row after its last one.
        distance: Distance of each row of the motion from the point in [m], shape (n,).
        near: Distance in [m] within which a rest is at the point.
    """
    rests = [(max(rest.first, first), min(rest.last, end - 1)) for rest in motion.rests]
    rests = [rest for rest in rests if rest[0] < rest[1] and distance[(rest[0] + rest[1]) // 2] <= near]
    longest = max(rests, key=lambda rest: rest[1] - rest[0], default=None)
    return first + int(np.argmin(distance[first:end])) if longest is None else (longest[0] + longest[1]) // 2


def _split_static_poses(command: Motion, motion: Motion) -> FoundCycles:
    """Return one cycle per visit of all commanded poses; the last is incomplete if poses are missing."""
    count = len(command)
    cycles = len(motion) // count
    rows = tuple((k * count, (k + 1) * count - 1) for k in range(cycles))
    rest = (cycles * count, len(motion) - 1)
    return FoundCycles(rows, (rest,) if rest[0] <= rest[1] else ())


def parse_cycles(text: str, parameter: str = "cycles") -> tuple[Rows, ...]:
    """Return the first and the last row of each cycle, from 1, of a text such as "1:1477,1478:2955".

    Raises:
        OptionError: With all errors in the text.
    """
    rows, findings = [], []
    for part in text.split(","):
        first, colon, last = (word.strip() for word in part.partition(":"))
        if colon and first.isascii() and last.isascii() and first.isdigit() and last.isdigit():
            rows.append((int(first), int(last)))
        else:
            findings.append(Finding(parameter=parameter, found=repr(part.strip()), allowed=ALLOWED))
    if findings:
        raise OptionError(*findings)
    return tuple(rows)


def check_cycles(rows: Sequence[Rows], count: int, parameter: str = "cycles") -> None:
    """Raise an `OptionError` with all errors in the rows of cycles.

    Args:
        rows: The first and the last row of each, from 1.
        count: Number of rows of the log.
        parameter: The parameter that gave them.
    """
    findings = [
        Finding(
            parameter=parameter,
            found=f"{first}:{last}",
            allowed=f"1 to {count}, the first row before the last",
        )
        for first, last in rows
        if not 1 <= first < last <= count
    ]
    findings += [
        Finding(parameter=parameter, found=f"{a[0]}:{a[1]} and {b[0]}:{b[1]}", allowed="no row in two cycles")
        for a, b in pairwise(sorted(rows))
        if b[0] <= a[1]
    ]
    if not rows:
        findings = [Finding(parameter=parameter, found="nothing", allowed=ALLOWED)]
    if findings:
        raise OptionError(*findings)
