"""What a log that is out of tolerance looks like: late, or with a joint's zero elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from urmpipe_models.arrays import FloatArray
from urmpipe_pipeline.comparison.causes import causes
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.trajectory import Trajectory

Compared = Callable[..., Comparison]

WANTED = Trajectory("wanted", np.zeros(1, dtype=np.int64), np.zeros((1, 3)))

T = 0.005 * np.arange(1000)


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


def test_a_log_on_the_path_but_not_in_time_is_late_or_early(paths: Compared) -> None:
    run = paths({"log": np.full((100, 3), 0.004)}).runs[0]
    late = with_maxima(run, norm=0.0812, path=5.3e-5)
    (found,) = causes(late, WANTED)
    assert "‖Δ‖ 81.2000 mm, path 0.0530 mm" in found.words
    assert [(hint.parameter, hint.value) for hint in found.hints] == [("sync", "auto")]
    (synced,) = causes(replace(late, sync=replace(late.sync, mode="auto")), WANTED)
    assert synced == replace(found, hints=())
    assert list(causes(with_maxima(run, norm=0.0812, path=0.0082), WANTED)) == []
    assert list(causes(replace(late, verdict="pass"), WANTED)) == []


def test_no_offset_is_looked_for_where_there_is_none(paths: Compared) -> None:
    late = with_maxima(paths({"log": np.full((100, 3), 0.004)}).runs[0], norm=0.0812, path=5.3e-5)
    for run, reference in (
        (late, replace(WANTED, files=late.run.log.files)),
        (replace(late, run=replace(late.run, log=replace(late.run.log, timed=False))), WANTED),
    ):
        (found,) = causes(run, reference)
        assert not found.hints


def test_only_a_log_that_is_out_of_a_tolerance_of_position_is_late(paths: Compared) -> None:
    run = paths({"log": np.full((100, 3), 0.004)}).runs[0]
    turned = with_maxima(run, x=0.0, y=0.0, z=0.0, norm=1e-16, path=0.0)
    assert list(causes(turned, WANTED)) == []
    late = with_maxima(run, norm=0.0812, path=5.3e-5)
    off = replace(late.statistics["path"], tolerance=5e-5, verdict="fail")
    assert list(causes(replace(late, statistics=late.statistics | {"path": off}), WANTED)) == []
