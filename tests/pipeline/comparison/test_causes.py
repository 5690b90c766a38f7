"""What a log that is out of tolerance looks like: late, or with a joint's zero elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from made_runs import path_run
from urmpipe_models.arrays import FloatArray
from urmpipe_pipeline.comparison.causes import causes
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.trajectory import Trajectory

Compared = Callable[..., Comparison]

WANTED = Trajectory("wanted", np.zeros(1, dtype=np.int64), np.zeros((1, 3)))

T: FloatArray = 0.005 * np.arange(1000.0)


def with_maxima(run: Deviation, **maxima: float) -> Deviation:
    """The log with these largest values, in m."""
    kept = {name: replace(one, max=maxima.get(name, one.max)) for name, one in run.statistics.items()}
    return replace(run, statistics=kept, verdict="fail")


@pytest.fixture
def off_by_zero(arms: Compared) -> Deviation:
    """A log whose second joint counts from 0.01 rad elsewhere, with some noise, the others a tenth of it."""
    noise = np.random.default_rng(3).normal(0.0, 1e-4, (1000, 6))
    return arms({"log": noise + np.array([0.001, 0.01, 0.0, -0.001, 0.0, 0.0])}).runs[0]


def test_a_joint_that_is_off_by_the_same_throughout_is_named(off_by_zero: Deviation) -> None:
    assert off_by_zero.verdict == "fail"
    one = list(off_by_zero.joint_statistics.values())[1]
    (found,) = causes(off_by_zero, WANTED)
    assert one.quantity in found.words
    assert f"{np.degrees(one.mean):.4f} deg, std {np.degrees(one.std):.4f} deg" in found.words
    assert abs(abs(one.mean) - 0.01) < 1e-5


def test_a_joint_that_comes_and_goes_has_no_other_zero(arms: Compared) -> None:
    q: FloatArray = np.zeros((1000, 6))
    q[:, 1] = 0.01 + 0.005 * np.sin(T)
    assert list(causes(arms({"log": q}).runs[0], WANTED)) == []


def test_what_rounding_left_of_a_joint_that_stands_still_is_no_zero(arms: Compared) -> None:
    q: FloatArray = np.zeros((1000, 6))
    q[:, 3] = 2.7e-6  # pi as 3.14159
    (run,) = arms({"log": q}).runs
    assert list(causes(with_maxima(run, x=0.02), WANTED)) == []
    q[:, 3] = 0.0027
    (run,) = arms({"log": q}).runs
    (found,) = causes(with_maxima(run, x=0.02), WANTED)
    assert "q4" in found.words


def back_and_forth(t: FloatArray) -> FloatArray:
    """A motion along a bow, with a rest in the middle half."""
    moving = np.clip(t, 0.0, 1.25) + np.clip(t - 3.75, 0.0, 1.25)
    return np.column_stack((np.sin(2.5 * moving), 0.3 * np.cos(2.5 * moving), np.ones_like(t)))


def late(by: float | FloatArray) -> Deviation:
    """The log that is late by so much in [s]."""
    return compared(back_and_forth(T - by))


def compared(log: FloatArray, **options: Any) -> Deviation:
    return compare_runs(path_run(back_and_forth(T)), [path_run(log)], CompareOptions(**options)).runs[0]


def said(run: Deviation, reference: Trajectory = WANTED) -> list[str]:
    return [one.words.partition(" (")[0] for one in causes(run, reference)]


LATE = ["on the path but not in time"]


def test_a_log_on_the_path_but_not_in_time_is_late_or_early() -> None:
    run = late(0.021)
    off, path = (1e3 * np.median(values[run.outside]) for values in (run.delta[:, 3], run.path))
    (found,) = causes(run, WANTED)
    medians = f"medians out of tolerance: ‖Δ‖ {off:.4f} mm, path {path:.4f} mm"
    assert found.words == f"on the path but not in time ({medians}): late or early"
    assert [(hint.parameter, hint.value) for hint in found.hints] == [("sync", "auto")]
    (synced,) = causes(replace(run, sync=replace(run.sync, mode="auto")), WANTED)
    assert synced == replace(found, hints=())
    assert list(causes(replace(run, verdict="pass"), WANTED)) == []


@pytest.mark.parametrize("by", [-0.03, 0.005, 0.04 * T / T[-1], np.where(T > 3.75, 0.03, 0.0)])
def test_early_drifting_or_late_after_a_rest_is_not_in_time(by: float | FloatArray) -> None:
    assert said(late(by)) == LATE


@pytest.mark.parametrize("behind", [0.0, 0.001])
@pytest.mark.parametrize("rows", [1, 4, 40])
def test_some_rows_that_are_off_along_the_path_make_no_log_late(rows: int, behind: float) -> None:
    """Though their rms and the largest lie on the path: 4 of 1000 are 0.4 %."""
    log = back_and_forth(T - behind)
    spiked = np.random.default_rng(rows).choice(np.r_[40:200, 800:960], rows, replace=False)
    log[spiked] = back_and_forth(T - 0.1)[spiked]
    run = compared(log)
    norm, path = run.statistics["norm"], run.statistics["path"]
    assert path.max < 0.1 * norm.max
    assert path.rms < 0.1 * norm.rms
    assert said(run) == []


def test_a_row_off_the_path_hides_no_lateness() -> None:
    log = back_and_forth(T - 0.02)
    log[100, 2] += 0.5
    assert said(compared(log)) == LATE


def test_no_offset_is_looked_for_where_there_is_none() -> None:
    run = late(0.02)
    for one, reference in (
        (run, replace(WANTED, files=run.run.log.files)),
        (replace(run, run=replace(run.run, log=replace(run.run.log, timed=False))), WANTED),
    ):
        (found,) = causes(one, reference)
        assert not found.hints


def test_only_a_log_that_is_out_of_a_tolerance_of_position_is_late(paths: Compared) -> None:
    run = paths({"log": np.full((100, 3), 0.004)}).runs[0]
    assert said(run) == []  # beside the path
    turned = with_maxima(paths({"log": np.zeros((100, 3))}).runs[0], x=0.0)
    assert list(causes(turned, WANTED)) == []
    off_path = compared(back_and_forth(T - 0.021), tolerance={"axis": 0.0035, "path": 1e-9})
    assert said(off_path) == []
