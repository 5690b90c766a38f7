"""The cycles of a test with noise and disturbances; whole answers are in cycles.cases."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asserting import there
from made_runs import path_run
from repeated import along, curve, eight, evaluated, judged, repeated, value, written
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.comparison.iso import IsoOptions, measure_iso
from urmpipe_pipeline.results import present

START = np.array([0.1, 0.1, 0.4])  # m
SQUARE = START + np.array([[0, 0, 0], [0.2, 0, 0], [0.2, 0.2, 0], [0, 0.2, 0], [0, 0, 0]])
TRIANGLE = START + np.array([[0, 0, 0], [0.1, 0.1, 0.2], [0, 0.15, 0.1], [0, 0, 0]])
REST = 100  # rows of a rest of 0.5 s


def moving(corners: FloatArray | Sequence[Sequence[float]], rests: Sequence[int] = ()) -> FloatArray:
    """A motion without the rests at its ends."""
    return along(corners, 0.25, rests=rests)[REST:-REST]


WAYS: dict[str, tuple[Callable[[], FloatArray], FloatArray | None, int]] = {
    "square from a corner": (lambda: moving(SQUARE), None, 29),
    "pose to pose": (lambda: moving(TRIANGLE, [1, 2]), None, 9),
    "figure eight from its crossing": (lambda: curve(eight(0.2), 0.25, rest=0.0), None, 9),
    "open, with a return": (lambda: moving(SQUARE[:3]), moving(SQUARE[[2, 0]]), 9),
}


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_all_are_found_with_noise_but_a_cut_one(way: str, tmp_path: Path) -> None:
    make, back, whole = WAYS[way]
    path = make()
    log, rests = repeated(path, whole + 1, [*WAYS].index(way), back=back)
    cut = REST + len(path) // 3
    resting = np.concatenate((np.repeat(path[:1], REST, axis=0), path, np.repeat(path[-1:], REST, axis=0)))
    reference = written(tmp_path / "command.csv", resting)
    result = evaluated(reference, written(tmp_path / "log.csv", log[cut:]))
    assert len(judged(result).cycles) == len(result.runs) == whole
    step = 1 if back is None else 2  # rests at both ends of each cycle
    begins, ends = rests[step::step], rests[step + 1 :: step]
    for cycle, begin, end in zip(judged(result).cycles, begins, ends, strict=False):
        assert begin[0] <= cycle.row - 1 + cut <= begin[1]
        assert end[0] <= cycle.last_row - 1 + cut <= end[1]
    of_noise = ("few-cycles", "noise-beyond-band", "noisy-speed")  # 0.1 mm from row to row
    kinds = [warning.kind for warning in result.warnings if warning.kind not in of_noise]
    assert kinds == ["cut-cycle"] + ([] if back is None else ["return-path"])
    # RP of means of 50 rows or more of noise of 0.1 mm: 3.616 . 0.1 mm/7; twice that is chance of 1e-9
    assert value(judged(result), "RP") < 2.0 * 3.616 * 1e-4 / np.sqrt(50.0)
    assert value(judged(result), "AP") < 1e-4 * 6.0 / np.sqrt(50.0 * whole)  # chi with 3 degrees: 1e-7
    # RT of crossings between two rows: 3.616 . 0.1 mm in space, less in a plane; the largest of 50
    assert 2e-4 < value(judged(result), "RT") < 5e-4


TICK = 0.02  # s, from row to row
AWAY = ((0.3, 0.0, 0.2), (-0.2, 0.1, 0.1), (0.0, 0.25, 0.25), (0.1, -0.2, 0.0))  # m, from the start
RESTS = round(1.0 / TICK)  # rows of the rests about a boundary between two cycles


def once(speed: float = 0.25) -> FloatArray:
    """Return one cycle: it rests for 0.5 s at both ends and in its middle."""
    return along(SQUARE, speed, rests=[2], tick=TICK)


def stopped(cycle: FloatArray) -> FloatArray:
    """Return a cycle that stops in the middle of the second leg until the next one begins."""
    row = int(np.argmin(np.linalg.norm(cycle - (SQUARE[1] + SQUARE[2]) / 2.0, axis=1)))
    return np.where(np.arange(len(cycle))[:, np.newaxis] < row, cycle, cycle[row])


DISTURBANCES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "offset in x": lambda cycle: cycle + np.array([0.06, 0.0, 0.0]),
    "offset to the other side": lambda cycle: cycle - (0.05, 0.05, 0.0),
    "mirrored": lambda cycle: 2.0 * START - cycle,
    "stopped": stopped,
    "another path": lambda cycle: along(TRIANGLE, 0.25, tick=TICK),
}


def way(first: FloatArray, last: FloatArray) -> FloatArray:
    count = max(round(float(np.linalg.norm(last - first)) / 0.4 / TICK), 1)
    return np.linspace(first, last, count, endpoint=False)


@pytest.mark.slow
@pytest.mark.hypothesis
@settings(max_examples=20, deadline=None)
@given(
    kinds=st.lists(st.sampled_from([None, None, *DISTURBANCES]), min_size=2, max_size=7).filter(
        lambda kinds: None in kinds
    ),
    around=st.tuples(*[st.one_of(st.none(), st.floats(0.2, 0.75), st.sampled_from(AWAY))] * 2),
    seed=st.integers(0, 999),
)
def test_no_disturbed_cycle_passes(
    kinds: list[str | None], around: tuple[float | tuple[float, ...] | None, ...], seed: int
) -> None:
    """A log begins and ends with nothing, with a part of a cycle, or far away, where it rests for long."""
    rng = np.random.default_rng(seed)
    parts: list[FloatArray] = []
    before, behind = around
    if isinstance(before, float):
        parts.append(once()[round(len(once()) * before) :])
    elif before is not None:
        parts += [np.repeat([START + before], 500, axis=0), way(START + before, START)]
    truth: list[tuple[int, int]] = []
    for kind in kinds:
        cycle = once(0.25 * rng.uniform(0.95, 1.05))
        parts.append(cycle if kind is None else DISTURBANCES[kind](cycle))
        rows = sum(map(len, parts))
        truth.append((rows - len(parts[-1]) + 1, rows))
    if isinstance(behind, float):
        parts.append(once()[: round(len(once()) * behind)])
    elif behind is not None:
        parts += [way(parts[-1][-1], START + behind), np.repeat([START + behind], 500, axis=0)]
    log = np.concatenate(parts)
    run = path_run(log + rng.normal(0.0, 2e-5, log.shape), name="log", tsp=TICK)
    result = measure_iso(path_run(once(), tsp=TICK), [run], IsoOptions({"AP": 4e-4, "AT": 1e-3}))  # m
    iso, failed = there(result.iso), len(kinds) - kinds.count(None)
    assert result.verdict == ("fail" if failed else "pass")
    count = f"{len(kinds) - failed} of {len(kinds)} cycles" if failed else f"{len(kinds)} cycles"
    assert present(result).headline.startswith(count)
    assert (len(iso.cycles), len(iso.failed_cycles)) == (len(kinds) - failed, failed)
    disturbed = [rows for kind, rows in zip(kinds, truth, strict=True) if kind is not None]
    for failed_cycle, (first, last) in zip(iso.failed_cycles, disturbed, strict=True):
        assert abs(failed_cycle.row - first) <= RESTS and abs(failed_cycle.last_row - last) <= RESTS
