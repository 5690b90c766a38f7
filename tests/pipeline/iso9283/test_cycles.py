"""The cycles of a test: found in one log by its returns to the start, said by rows, or a file each."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import urmpipe
from asserting import refusal
from repeated import along, curve, eight, judged, logs, repeated, still, told, value, written
from urmpipe.main import run as command_line
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError, OptionError
from urmpipe_pipeline.comparison.comparison import Comparison

HEIGHT = 0.4
SPEED = 0.25
SQUARE = ((0, 0, HEIGHT), (0.2, 0, HEIGHT), (0.2, 0.2, HEIGHT), (0, 0.2, HEIGHT), (0, 0, HEIGHT))
TRIANGLE = ((0, 0, HEIGHT), (0.2, 0, HEIGHT), (0.1, 0.15, HEIGHT + 0.1), (0, 0, HEIGHT))
REST = 100
"""Rows of a rest of 0.5 s."""


def resting(path: FloatArray) -> FloatArray:
    """Return a motion with a rest at either end."""
    ends = np.repeat(path[:1], REST, axis=0), np.repeat(path[-1:], REST, axis=0)
    return np.concatenate((ends[0], path, ends[1]))


SQUARE_PATH = along(SQUARE, SPEED, rest=0.0)
OTHER = along(((0, 0, HEIGHT), (0.1, 0.1, HEIGHT + 0.2), (0, 0, HEIGHT)), SPEED, rest=0.0)
OPEN = along(SQUARE[:3], SPEED, rest=0.0)
BACK = along((SQUARE[2], SQUARE[0]), SPEED, rest=0.0)
ROWS = len(resting(SQUARE_PATH))

Way = Callable[[], tuple[FloatArray, FloatArray | None]]
WAYS: dict[str, Way] = {
    "square from a corner": lambda: (SQUARE_PATH, None),
    "pose to pose": lambda: (along(TRIANGLE, SPEED, rests=[1, 2])[REST:-REST], None),
    "figure eight, by its start amid": lambda: (curve(eight(0.2), SPEED, rest=0.0), None),
    "open, with a return": lambda: (OPEN, BACK),
}


@pytest.fixture
def square(tmp_path: Path) -> Path:
    return written(tmp_path / "square.csv", resting(SQUARE_PATH))


@pytest.fixture
def thrice(tmp_path: Path) -> Path:
    return written(tmp_path / "thrice.csv", np.concatenate([resting(SQUARE_PATH)] * 3))


def run(reference: Path, done: Path | list[Path]) -> Comparison:
    return urmpipe.iso(reference, done)


def kinds(result: Comparison) -> list[tuple[str, int | None]]:
    """What is said of cycles, and of which row; that they are few, and that noise settles nothing, aside."""
    said = [(one.kind, one.row) for one in result.warnings]
    return [one for one in said if one[0] not in ("few-cycles", "noise-beyond-band")]


def rows(result: Comparison) -> list[tuple[int, int]]:
    return [(one.row, one.last_row) for one in judged(result).cycles]


@pytest.mark.slow
@pytest.mark.parametrize(("way", "whole"), [*zip(WAYS, (29, 9, 9, 9), strict=True)])
def test_all_are_found_with_noise_but_a_cut_one(way: str, whole: int, tmp_path: Path) -> None:
    path, back = WAYS[way]()
    every, rests = repeated(path, whole + 1, [*WAYS].index(way), back=back)
    cut = REST + len(path) // 3
    reference = written(tmp_path / "command.csv", resting(path))
    result = run(reference, written(tmp_path / "log.csv", every[cut:]))
    found = rows(result)
    assert len(found) == len(result.runs) == whole
    step = 1 if back is None else 2  # rests at both ends of each cycle
    begins = [rests[1 if back is None else 2 :][step * k] for k in range(whole)]
    ends = [rests[2 if back is None else 3 :][step * k] for k in range(whole)]
    for (first, last), begin, end in zip(found, begins, ends, strict=True):
        assert begin[0] <= first - 1 + cut <= begin[1]
        assert end[0] <= last - 1 + cut <= end[1]
    assert kinds(result)[0] == ("cut-cycle", 1)
    others = [kind for kind, _ in kinds(result)[1:] if kind != "noisy-speed"]  # 0.1 mm from row to row
    assert others == ([] if back is None else ["return-path"])  # told once
    # RP of means of 50 rows or more of noise of 0.1 mm: 3.616 . 0.1 mm/7; twice that is chance of 1e-9
    assert value(judged(result), "RP") < 2.0 * 3.616 * 1e-4 / np.sqrt(50.0)
    assert value(judged(result), "AP") < 1e-4 * 6.0 / np.sqrt(50.0 * whole)  # chi with 3 degrees: 1e-7
    # RT of crossings between two rows: 3.616 . 0.1 mm in space, less in a plane; the largest of 50
    assert 2e-4 < value(judged(result), "RT") < 5e-4


def test_each_cycle_begins_by_its_own_clock(tmp_path: Path, square: Path) -> None:
    early = resting(SQUARE_PATH)
    done = logs(tmp_path, [early, np.concatenate((np.repeat(early[:1], 80, axis=0), early))])
    cycles = judged(run(square, done)).cycles
    # The second begins 80 rows of 5 ms earlier: t_reference - t_cycle = -0.4 s; times are summed to 1e-14.
    assert [one.sync_offset for one in cycles] == pytest.approx([0.0, -0.4], abs=1e-12)
    assert [one.row for one in cycles] == [1, 1]


@pytest.mark.slow
def test_a_motion_without_return_is_refused(
    tmp_path: Path, square: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, way in (("half", SQUARE_PATH[:320]), ("another", np.concatenate((OTHER, OTHER)))):
        log = written(tmp_path / f"{name}.csv", resting(way))
        said = refusal(LogError, run, square, log)
        assert f"{name}.csv" in said and "returns to its start" in said
        assert command_line(["iso", str(square), str(log)]) == 2
        assert "returns to its start" in capsys.readouterr().err


def test_once_along_an_open_path_is_one_cycle(tmp_path: Path) -> None:
    reference = written(tmp_path / "open.csv", resting(OPEN))
    result = run(reference, written(tmp_path / "log.csv", resting(OPEN)))
    assert rows(result) == [(1, len(OPEN) + 2 * REST)]
    assert kinds(result) == [("same-data", None)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("other", "far"),  # its middle is 0.1 m inside of the square and 0.2 m above
    [(OTHER, np.hypot(0.1, 0.2)), (SQUARE_PATH[::-1], 0.0)],
    ids=["another path", "the other way round"],
)
def test_another_motion_between_cycles_is_a_failed_cycle(
    other: FloatArray, far: float, tmp_path: Path, square: Path
) -> None:
    parts = [resting(one) for one in (SQUARE_PATH, SQUARE_PATH, other, SQUARE_PATH)]
    result = run(square, written(tmp_path / "log.csv", np.concatenate(parts)))
    assert len(rows(result)) == 3
    (failed,) = judged(result).failed_cycles
    assert failed.name == "cycle 3" and 2 * ROWS - REST < failed.row <= 2 * ROWS + REST
    assert kinds(result) == [("failed-cycle", failed.row)]
    assert failed.distance == pytest.approx(far, abs=1e-12) and "differs from that of square" in failed.reason
    # Each cycle is the command itself: what is left out moves no clock. Of coordinates below 1 m.
    assert max(float(np.abs(one.delta).max()) for one in result.runs) < 1e-12


def test_cut_ends_are_told(tmp_path: Path, square: Path) -> None:
    parts = (SQUARE_PATH[300:], resting(SQUARE_PATH), resting(SQUARE_PATH), resting(SQUARE_PATH)[:500])
    every = np.concatenate(parts)
    result = run(square, written(tmp_path / "log.csv", every))
    (first, last), found = kinds(result), rows(result)
    assert first == ("cut-cycle", 1) and last == ("cut-cycle", found[-1][1] + 1)
    cut = len(SQUARE_PATH) - 300
    assert cut < found[0][0] <= cut + REST and found[0][1] + 1 == found[1][0]
    assert cut + 2 * ROWS - REST < found[1][1] <= cut + 2 * ROWS + REST


def test_rows_that_are_said_are_taken(square: Path, thrice: Path) -> None:
    text = f"1:{ROWS},{2 * ROWS + 1}:{3 * ROWS}"
    pairs = [(1, ROWS), (2 * ROWS + 1, 3 * ROWS)]
    for said in (text, pairs):
        result = urmpipe.iso(square, thrice, cycles=said)
        assert rows(result) == pairs and not kinds(result)
        assert [len(one.run.t_ns) for one in result.runs] == [ROWS, ROWS]


def test_rows_and_offsets_are_in_the_json(
    square: Path, thrice: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["iso", str(square), str(thrice), "--json", "--cycles", f"6:{ROWS}"]
    assert command_line(asked) == 0
    (cycle,) = json.loads(capsys.readouterr().out)["iso"]["cycles"]
    assert (cycle["row"], cycle["last_row"]) == (6, ROWS)
    assert cycle["sync_offset"] == pytest.approx(0.025, abs=1e-12)  # 5 rows are left out before it


BAD = {
    "1:900,900:1600": ["1:900 and 900:1600"],
    f"1:{3 * ROWS + 1}": [f"1:{3 * ROWS + 1}", f"1 to {3 * ROWS}"],
    "900:1": ["900:1"],
    "7:7": ["7:7"],
    "0:700": ["0:700"],
    "x": ["'x'", "FIRST:LAST"],
    "1:841,1-2,:3": ["'1-2'", "':3'"],
    "1:841,5:6,3000:2000,1682:99999": ["1:841 and 5:6", "3000:2000", "1682:99999"],
}


@pytest.mark.slow
@pytest.mark.parametrize("said", list(BAD))
def test_bad_rows_are_refused_with_all_that_is_wrong(
    said: str, square: Path, thrice: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    refused = refusal(OptionError, urmpipe.iso, square, thrice, cycles=said)
    assert all(part in refused for part in BAD[said])
    asked = ["iso", str(square), str(thrice), "--cycles", said]
    assert command_line(asked) == 2
    printed = capsys.readouterr().err
    assert all(part in printed for part in BAD[said])


def test_rows_of_several_logs_are_refused(square: Path, thrice: Path) -> None:
    said = refusal(OptionError, urmpipe.iso, square, [thrice, thrice], cycles="1:841")
    assert "cycles" in said and "one log" in said


def test_a_table_of_criteria_replaces_an_earlier_one(square: Path, thrice: Path, tmp_path: Path) -> None:
    for planes in (1, 2):
        criteria = told(square, thrice, csv=tmp_path / "criteria.csv", planes=planes).criteria
        lines = (tmp_path / "criteria.csv").read_text(encoding="utf-8").splitlines()
        assert [line.split(",")[0] for line in lines[1:]] == [criterion.name for criterion in criteria]


def test_a_log_of_another_motion_is_a_failed_cycle(tmp_path: Path, square: Path) -> None:
    done = logs(tmp_path, [resting(one) for one in (SQUARE_PATH, OTHER, SQUARE_PATH, SQUARE_PATH[:320])])
    result = run(square, done)
    assert [one.name for one in judged(result).cycles] == ["cycle1", "cycle3"]
    failed = judged(result).failed_cycles
    assert [(one.name, one.row, one.last_row) for one in failed] == [
        ("cycle2", 1, len(resting(OTHER))), ("cycle4", 1, 320 + 2 * REST)
    ]  # fmt: skip
    unlike = [one for one in result.warnings if one.kind == "failed-cycle"]
    assert [one.about for one in unlike] == ["cycle2", "cycle4"]
    assert [one.name for one in result.runs] == ["cycle1", "cycle3"]


def test_logs_of_another_motion_alone_are_refused_each_by_its_name(tmp_path: Path, square: Path) -> None:
    done = logs(tmp_path, [resting(OTHER), resting(SQUARE_PATH[:320])])
    said = refusal(LogError, run, square, done)
    assert "cycle1" in said and "cycle2" in said


POSES = np.array([[0.1 * k, 0.05 * k * k, 0.3] for k in range(5)])


@pytest.mark.slow
def test_30_visits_of_5_still_poses(tmp_path: Path) -> None:
    visits = np.tile(POSES, (30, 1)) + np.random.default_rng(1).normal(0.0, 1e-4, (150, 3))
    reference = still(tmp_path / "poses.csv", POSES)
    result = urmpipe.iso(reference, still(tmp_path / "visits.csv", visits), poses=True)
    assert rows(result) == [(5 * k + 1, 5 * k + 5) for k in range(30)] and not kinds(result)
    assert {one.sync_offset for one in judged(result).cycles} == {None}
    assert {one.at for one in judged(result).criteria if one.name == "AP"} == {
        None, *(f"pose {k}" for k in range(1, 6))
    }  # fmt: skip
    assert not any(one.name in ("AT", "PSt", "AV") and one.value for one in judged(result).criteria)
    # barycentres of 30: chi with 3 degrees beyond 6 is 1e-7
    assert 0.0 < value(judged(result), "AP") < 6e-4 / np.sqrt(30.0)
    files = [still(tmp_path / f"visit{k}.csv", visits[5 * k : 5 * k + 5]) for k in range(30)]
    same = told(reference, files, poses=True)
    assert [(one.name, one.at, one.value) for one in same.criteria] == [
        (one.name, one.at, one.value) for one in judged(result).criteria
    ]


def test_a_cut_visit_of_still_poses_is_told(tmp_path: Path) -> None:
    reference = still(tmp_path / "poses.csv", POSES)
    visits = still(tmp_path / "visits.csv", np.tile(POSES, (3, 1))[:-2])
    result = urmpipe.iso(reference, visits, poses=True)
    assert rows(result) == [(1, 5), (6, 10)] and kinds(result) == [("cut-cycle", 11)]


def test_a_still_pose_without_a_value_moves_no_other(tmp_path: Path) -> None:
    # The second visit of pose 3 was not measured: that visit is left out, or pose 3 of it.
    visits = np.tile(POSES, (6, 1))
    visits[7] = np.nan
    reference = still(tmp_path / "poses.csv", POSES)
    iso = told(reference, still(tmp_path / "visits.csv", visits), poses=True)
    assert value(iso, "AP") == pytest.approx(0.0, abs=1e-12)
    assert value(iso, "RP") == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("tick", "speed", "noise"), [(0.001, 0.1, 1e-4), (0.005, 0.02, 1e-4)])
def test_noise_beyond_a_step_hides_no_motion(tick: float, speed: float, noise: float, tmp_path: Path) -> None:
    # From row to row it moves as far as it trembles; within 50 ms, by which a rest is told, 1 mm or more.
    size = 0.1 if speed == 0.1 else 0.01
    corners = ((0, 0, HEIGHT), (size, 0, HEIGHT), (size, size, HEIGHT))
    wanted = along(corners, speed, tick=tick)
    t = tick * np.arange(len(wanted))
    rng = np.random.default_rng(1)
    reference = written(tmp_path / "command.csv", wanted, t)
    done = [
        written(tmp_path / f"{k}.csv", wanted + rng.normal(0.0, noise, wanted.shape), t) for k in range(3)
    ]
    assert len(told(reference, done).cycles) == 3


def test_a_log_of_a_rest_is_one_cycle(tmp_path: Path) -> None:
    # A reference that only rests has one pose; a log of that rest, with noise, is one cycle of it.
    wanted = np.repeat([[0.1, 0.1, HEIGHT]], 400, axis=0)
    reference = written(tmp_path / "command.csv", wanted)
    noise = np.random.default_rng(2).normal(0.0, 1e-4, wanted.shape)
    assert len(told(reference, written(tmp_path / "log.csv", wanted + noise)).cycles) == 1


def test_logs_that_each_repeat_what_the_reference_repeats_are_followed(tmp_path: Path) -> None:
    twice = np.concatenate([resting(SQUARE_PATH)] * 2)
    reference = written(tmp_path / "command.csv", twice)
    assert len(told(reference, logs(tmp_path, [twice] * 3)).cycles) == 3


def test_a_still_pose_without_a_command_has_no_value(tmp_path: Path) -> None:
    wanted = POSES.copy()
    wanted[2] = np.nan
    reference = still(tmp_path / "poses.csv", wanted)
    iso = told(reference, still(tmp_path / "visits.csv", np.tile(POSES, (4, 1))), poses=True)
    assert not [(one.name, one.at) for one in iso.criteria if one.value is not None and np.isnan(one.value)]
