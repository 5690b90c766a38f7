"""Repeated motions: made of corners at whole ticks of 5 ms, written as logs of where the tool was."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import urmpipe
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.iso9283.criteria import Criterion
from urmpipe_pipeline.iso9283.result import IsoTest

TICK = 0.005
"""In [s]: a row."""

PLACE = ("x [m]", "y [m]", "z [m]")
TURNS = ("rz [rad]", "ry [rad]", "rx [rad]")


class Drawn:
    """A motion from node to node, straight in between.

    Args:
        *start: Where it begins, all columns.
    """

    def __init__(self, *start: float) -> None:
        self.ticks, self.nodes = [0], [tuple(start)]

    def to(self, ticks: int, *place: float) -> Drawn:
        """Go to a place within so many ticks."""
        self.ticks.append(self.ticks[-1] + ticks)
        self.nodes.append(place)
        return self

    def stay(self, ticks: int) -> Drawn:
        """Rest for so many ticks."""
        return self.to(ticks, *self.nodes[-1])

    @property
    def values(self) -> FloatArray:
        """A row a tick, shape (n, columns)."""
        tick = np.arange(self.ticks[-1] + 1)
        nodes = np.array(self.nodes)
        return np.column_stack([np.interp(tick, self.ticks, column) for column in nodes.T])


def _cell(number: float) -> str:
    """Return a number with all digits; nothing of NaN."""
    return "" if math.isnan(number) else f"{number:.17g}"


def written(
    path: Path, values: FloatArray, t: NDArray[np.floating] | None = None, names: Sequence[str] = PLACE
) -> Path:
    """Write a log (CSV) with all digits; a row a tick, or at times in [s]; nothing where a value is NaN."""
    path.write_text(log_text(values, t, names), encoding="utf-8")
    return path


def log_text(values: FloatArray, t: NDArray[np.floating] | None = None, names: Sequence[str] = PLACE) -> str:
    """Return the log that `written` writes."""
    times = TICK * np.arange(len(values)) if t is None else t
    cells = ((f"{at:.9f}", *map(_cell, row)) for at, row in zip(times.tolist(), values.tolist(), strict=True))
    return "".join(",".join(row) + "\n" for row in (("t [s]", *names), *cells))


def still(path: Path, values: FloatArray, names: Sequence[str] = PLACE) -> Path:
    """Write static poses (CSV): rows without a time."""
    path.write_text(still_text(values, names), encoding="utf-8")
    return path


def still_text(values: FloatArray, names: Sequence[str] = PLACE) -> str:
    """Return the static poses that `still` writes."""
    return "".join(",".join(row) + "\n" for row in (names, *(map(_cell, row) for row in values.tolist())))


def logs(folder: Path, cycles: Iterable[FloatArray], names: Sequence[str] = PLACE) -> list[Path]:
    """Write a log each cycle."""
    return [written(folder / f"cycle{k}.csv", one, None, names) for k, one in enumerate(cycles, 1)]


def judged(result: Comparison) -> IsoTest:
    """Return the test after ISO 9283 that a comparison holds."""
    assert result.iso is not None
    return result.iso


def evaluated(reference: Path, done: Path | Sequence[Path], **options: object) -> Comparison:
    """Return the comparison of a test."""
    return urmpipe.iso(reference, done, **options)  # type: ignore[arg-type]


def told(reference: Path, done: Path | Sequence[Path], **options: object) -> IsoTest:
    """Return what the cycles of a test tell."""
    return judged(evaluated(reference, done if isinstance(done, Path) else list(done), **options))


def values_of(test: IsoTest) -> dict[tuple[str, str | None], float | None]:
    """Return every value by criterion and place."""
    return {(one.name, one.at): one.value for one in test.criteria}


def overall(test: IsoTest) -> dict[str, float | None]:
    """Return every value over all, by criterion."""
    return {one.name: one.value for one in test.overall}


def value(test: IsoTest, name: str, at: str | None = None) -> float:
    """Return the value of a criterion that must be there."""
    found: list[Criterion] = [one for one in test.criteria if (one.name, one.at) == (name, at)]
    assert len(found) == 1 and found[0].value is not None, (name, at)
    return found[0].value


def along(
    corners: Sequence[Sequence[float]] | FloatArray,
    speed: float,
    *,
    rest: float = 0.5,
    tick: float = TICK,
    rests: Sequence[int] = (),
) -> FloatArray:
    """Return a motion along straight legs at a constant speed in [m/s], a row a tick, shape (n, 3).

    It rests at both ends, for `rest` in [s], and at the corners that `rests` names from 0.
    """  # fmt: skip
    points = np.array(corners, dtype=np.float64)
    t, nodes = [0.0, rest], [points[0], points[0]]
    for k, (a, b) in enumerate(pairwise(points), 1):
        t.append(t[-1] + round(float(np.linalg.norm(b - a)) / speed / tick) * tick)
        nodes.append(b)
        if k in rests or k == len(points) - 1:
            t.append(t[-1] + rest)
            nodes.append(b)
    row = np.rint(np.array(t) / tick)
    every = np.arange(row[-1] + 1)
    return np.column_stack([np.interp(every, row, column) for column in np.array(nodes).T])


def late(path: FloatArray, rows: int) -> FloatArray:
    """Return a motion that follows another with a lag, which rounds corners, and swings beyond them."""
    position, speed, positions = path[0].copy(), np.zeros(3), []
    rate = 1.0 / (TICK * rows)
    for commanded in path:
        for _ in range(10):
            speed = speed + 0.1 * TICK * ((commanded - position) * rate**2 - speed * rate)
            position = position + 0.1 * TICK * speed
        positions.append(position.copy())
    return np.array(positions)


def curve(points: FloatArray, speed: float, *, rest: float = 0.5, tick: float = TICK) -> FloatArray:
    """Return a motion along a finely drawn curve, shape (k, 3), at a constant speed, at rest at both ends."""
    s = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))))
    rows, still_rows = round(float(s[-1]) / speed / tick), round(rest / tick)
    at = np.concatenate((np.zeros(still_rows), np.linspace(0.0, s[-1], rows + 1), np.full(still_rows, s[-1])))
    return np.column_stack([np.interp(at, s, column) for column in points.T])


def repeated(
    path: FloatArray,
    count: int,
    seed: int,
    *,
    back: FloatArray | None = None,
    rest: float = 0.5,
    spread: float = 0.05,
    noise: float = 1e-4,
) -> tuple[FloatArray, list[tuple[int, int]]]:
    """Return a motion done many times in one log, and the rows, from 0, of the rests about the cycles.

    Each time its speed differs by `spread`, as the end of a uniform distribution; it rests before, between
    and behind.

    Args:
        path: Once, without rests at its ends, a row a tick, shape (n, 3).
        count: How many times.
        seed: Of speeds and noise.
        back: The way from its end back to its start, if that is another place, likewise.
        rest: How long it rests in [s].
        spread: How much speeds differ.
        noise: Standard deviation a coordinate in [m].
    """  # fmt: skip
    rng = np.random.default_rng(seed)
    still_rows = round(rest / TICK)
    parts, rests = [np.repeat(path[:1], still_rows, axis=0)], [(0, still_rows - 1)]

    def add(way: FloatArray) -> None:
        rows = round(len(way) / (1.0 + rng.uniform(-spread, spread)))
        at = np.linspace(0, len(way) - 1, rows)
        moving = np.column_stack([np.interp(at, np.arange(len(way)), column) for column in way.T])
        parts.extend((moving, np.repeat(way[-1:], still_rows, axis=0)))
        begins = sum(map(len, parts)) - still_rows
        rests.append((begins, begins + still_rows - 1))

    for k in range(count):
        add(path)
        if back is not None and k < count - 1:
            add(back)
    rows = np.concatenate(parts)
    return rows + rng.normal(0.0, noise, rows.shape), rests


def eight(size: float) -> FloatArray:
    """Return a figure eight that begins and ends at its crossing, shape (2001, 3)."""
    turn = np.linspace(0.0, 2.0 * np.pi, 2001)
    return size * np.column_stack((np.sin(turn), np.sin(turn) * np.cos(turn), np.full_like(turn, 2.0)))
