"""What changed since a baseline, and what of it is worse."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from asserting import refusal, there
from made_runs import arms, off, paths
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import OptionError
from urmpipe_models.math3d import translation
from urmpipe_pipeline.comparison.baseline import (
    DEFAULT_NOISE,
    compare_with_baseline,
    complete_noise,
    parse_noise,
)
from urmpipe_pipeline.comparison.baseline_section import worse_words
from urmpipe_pipeline.comparison.comparison import SettingDifference, UnmatchedQuantity
from urmpipe_pipeline.text import to_json_value
from urmpipe_pipeline.trajectories import Sync

ROUNDING = 1e-15
"""Positions of 1 m round at 2e-16 m, and are taken apart twice."""


def test_the_same_comparison_did_not_change() -> None:
    result = arms({"a": np.full((50, 6), 0.001)}, tolerance={"axis": 0.001, "angle": 0.001, "joint": 0.002})
    found = compare_with_baseline(result, result, 0.0)
    assert (found.verdict, found.worse, found.new, found.missing, found.differences) == (
        "pass",
        (),
        (),
        (),
        (),
    )
    assert [change.now.quantity for change in found.changes] == [
        "x", "y", "z", "norm", "path", "angle", "q1", "q2", "q3", "q4", "q5", "q6",
    ]  # fmt: skip
    assert not any(change.changed or change.better for change in found.changes)
    assert {
        (change.largest_change, change.t_largest_change, change.samples_shared) for change in found.changes
    } == {(0.0, 0.0, 50)}


def test_what_changed_is_said_by_digits_that_differ() -> None:
    grown = compare_with_baseline(paths({"a": off(0.00100002)}), paths({"a": off(0.001)}), 1e-9).changes[0]
    assert worse_words(grown) == "max 1.00000 → 1.00002 mm, rms 0.57881 → 0.57882 mm"


def test_a_sample_that_moved_alone_leaves_largest_and_rms() -> None:
    sizes = off(0.001, 1000)
    moved = sizes.copy()
    moved[10, 0] += 1e-5
    x = compare_with_baseline(paths({"a": moved}), paths({"a": sizes})).changes[0]
    assert (x.changed, x.worse, worse_words(x)) == (True, (), "")


@pytest.mark.slow
def test_shares_differ_by_a_digit_where_they_count_as_changed() -> None:
    out = off(0.0, 25_000)
    out[:24_750, 0] = 0.005
    more = out.copy()
    more[24_750, 0] = 0.005
    x = compare_with_baseline(paths({"a": more}), paths({"a": out})).changes[0]
    assert x.worse == ("out_fraction",)
    assert worse_words(x) == "out 99 % → 99.004 %"
    one = out.copy()
    one[24_750, 0] = 0.0035000005  # out by less than the noise
    assert compare_with_baseline(paths({"a": one}), paths({"a": out})).changes[0].worse == ()


def test_what_grew_by_more_than_the_noise_is_worse() -> None:
    before, now = (paths({"a": off(size)}) for size in (0.001, 0.0012))
    x = compare_with_baseline(now, before).changes[0]
    assert (x.worse, x.better, x.changed) == (("max", "rms"), (), True)
    assert (x.before, x.now) == (before.runs[0].statistics["x"], now.runs[0].statistics["x"])
    assert x.largest_change == pytest.approx(0.0002, abs=ROUNDING)
    assert x.t_largest_change == 0.495
    assert compare_with_baseline(now, before).verdict == "fail"
    back = compare_with_baseline(before, now)
    assert (back.changes[0].worse, back.changes[0].better, back.verdict) == ((), ("max", "rms"), "pass")


def test_what_grew_within_the_noise_is_not() -> None:
    before, now = (paths({"a": off(size)}) for size in (0.001, 0.0012))
    quiet = compare_with_baseline(now, before, 0.0002 + ROUNDING)
    assert quiet.verdict == "pass"
    assert not any(change.changed for change in quiet.changes)
    assert compare_with_baseline(now, before, 0.0002 - 1e-9).verdict == "fail"


def test_a_change_that_statistics_do_not_show_is_seen_at_its_sample() -> None:
    aside = [np.roll(off(size), 1, axis=1) for size in (0.001, -0.001)]
    before, now = (paths({"a": one}) for one in aside)
    y = compare_with_baseline(now, before).changes[1]
    assert (y.worse, y.better, y.changed) == ((), (), True)
    assert y.largest_change == pytest.approx(0.002, abs=ROUNDING)
    assert compare_with_baseline(now, before).verdict == "pass"


def test_more_samples_out_are_worse_unless_the_noise_put_them_there() -> None:
    steps = np.zeros((100, 3))
    steps[:10, 0] = 0.0040  # out of 3.5 mm in both
    steps[10:50, 0] = 0.003_499_8
    nudged, moved = steps.copy(), steps.copy()
    nudged[10:50, 0] += 0.000_000_5  # out by less than 1 um
    moved[10:13, 0] = 0.0038
    before = paths({"a": steps})
    x = compare_with_baseline(paths({"a": nudged}), before).changes[0]
    assert (x.before.out_fraction, x.now.out_fraction, x.worse) == (0.1, 0.5, ())
    x = compare_with_baseline(paths({"a": moved}), before, {"x": 0.000_29}).changes[0]
    assert (x.now.out_fraction, x.worse) == (0.13, ("out_fraction",))


def test_shares_of_different_tolerances_do_not_compare() -> None:
    before = paths({"a": off(0.003)})
    now = paths({"a": off(0.003)}, tolerance={"axis": 0.001})
    found = compare_with_baseline(now, before)
    assert (found.changes[0].out_fraction_noise, found.changes[0].worse, found.verdict) == (None, (), "pass")
    assert found.changes[0].changed  # the verdict did
    assert found.differences == (SettingDifference("tolerance", {"axis": 0.0035}, {"axis": 0.001}),)


def test_a_diagnosis_is_no_difference_since_it_changes_no_figure() -> None:
    plain, diagnosed = (paths({"a": off(0.003, 30)}, diagnose=diagnose) for diagnose in (False, True))
    assert compare_with_baseline(diagnosed, plain).differences == ()


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    hnp.arrays(float, (40, 3), elements=st.floats(-0.005, 0.005)),
    hnp.arrays(float, (40, 3), elements=st.floats(-1, 1)),
    st.floats(1e-7, 1e-3),
)
def test_no_change_within_the_noise_is_ever_worse(
    values: FloatArray, change: FloatArray, noise: float
) -> None:
    """Of no share, largest or rms. The norm may change by sqrt(3) as much as an axis."""
    before, now = paths({"a": values}), paths({"a": values + change * noise})
    level = noise * np.sqrt(3) + ROUNDING
    assert compare_with_baseline(now, before, level).worse == ()


def test_times_that_both_have_are_compared() -> None:
    before, now = (
        paths({"a": off(0.001, 100), "b": off(0.0, 100)}),
        paths({"a": off(0.001, 60), "b": off(0.0, 100)}),
    )
    found = compare_with_baseline(now, before)
    x = found.changes[0]
    assert x.samples_shared == 60
    assert x.t_largest_change == 0.295
    assert SettingDifference("samples of a", 100, 60) in found.differences


def test_logs_and_quantities_that_only_one_has_are_told() -> None:
    before, now = paths({"a": off(0.0), "old": off(0.0)}), paths({"new": off(0.0), "a": off(0.0)})
    found = compare_with_baseline(now, before)
    assert (found.new, found.missing) == ((UnmatchedQuantity("new"),), (UnmatchedQuantity("old"),))
    assert (found.verdict, found.worse) == ("fail", ())
    with_joints = arms({"a": np.zeros((100, 6))})
    assert [str(one) for one in compare_with_baseline(paths({"a": off(0.0)}), with_joints).missing] == [
        f"{name} of a" for name in ("angle", "q1", "q2", "q3", "q4", "q5", "q6")
    ]
    assert compare_with_baseline(with_joints, paths({"a": off(0.0)})).missing == ()


def test_the_only_logs_of_both_are_a_pair_whatever_they_are_called() -> None:
    found = compare_with_baseline(paths({"today": off(0.001)}), paths({"released": off(0.001)}))
    assert (found.verdict, found.new, found.missing) == ("pass", (), ())
    assert found.differences == (SettingDifference("log of today", "released", "today"),)
    several = compare_with_baseline(paths({"a": off(0.0), "b": off(0.0)}), paths({"c": off(0.0)}))
    assert (several.verdict, several.missing) == ("fail", (UnmatchedQuantity("c"),))


@pytest.mark.parametrize(("samples", "verdict"), [(90, "pass"), (89, "fail")])
def test_a_log_that_lost_a_tenth_of_its_samples_is_worse(samples: int, verdict: str) -> None:
    found = compare_with_baseline(paths({"a": off(0.0, samples)}), paths({"a": off(0.0)}))
    assert found.verdict == verdict
    assert {change.worse for change in found.changes} == {() if verdict == "pass" else ("samples",)}
    unknown = replace(found.changes[0], before=replace(found.changes[0].before, samples=None))
    assert unknown.worse == ()


@pytest.mark.parametrize(("samples", "verdict"), [(25, "pass"), (20, "fail")])
def test_samples_count_by_the_time_that_they_stand_for(samples: int, verdict: str) -> None:
    before, now = paths({"a": off(0.0)}), paths({"a": off(0.0, samples)})
    slower = replace(now, runs=(replace(now.runs[0], t_ns=now.runs[0].t_ns * 4),))  # 20 ms instead of 5 ms
    assert compare_with_baseline(slower, before).verdict == verdict
    found = compare_with_baseline(before, slower)  # and back: no more than as much time is no loss
    assert (found.verdict, {change.worse for change in found.changes}) == ("pass", {()})
    faster = replace(before, runs=(replace(before.runs[0], t_ns=before.runs[0].t_ns // 2),))
    assert {change.worse for change in compare_with_baseline(faster, before).changes} == {("samples",)}


def test_samples_left_out_between_others_are_lost_time() -> None:
    before = paths({"a": off(0.0)})
    run = before.runs[0]
    kept = {name: getattr(run, name)[::2] for name in ("sample", "t_ns", "delta", "path", "out_of_tolerance")}
    statistics = {name: replace(one, samples=50) for name, one in run.statistics.items()}
    now = replace(before, runs=(replace(run, **kept, statistics=statistics),))
    assert {change.worse for change in compare_with_baseline(now, before).changes} == {("samples",)}


def test_another_base_and_another_tool_are_told() -> None:
    before = arms({"a": np.zeros((20, 6))})
    run = before.runs[0]
    robot = there(run.run.robot).placed(base=translation(0.0, 0.0, 1.0), tool=translation(0.0, 0.0, 0.12))
    now = replace(before, runs=(replace(run, run=replace(run.run, robot=robot)),))
    assert compare_with_baseline(now, before).differences == (
        SettingDifference("base of a", [0.0] * 6, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
        SettingDifference("robot tool of a", [0.0] * 6, [0.0, 0.0, 0.12, 0.0, 0.0, 0.0]),
    )


def test_what_was_made_otherwise_is_told() -> None:
    before = paths({"a": off(0.0)})
    run = replace(before.runs[0], sync=Sync("given", 0.25))
    made = replace(
        before.provenance,
        options={**before.provenance.options, "align": "rigid"},
        versions={**before.provenance.versions, "numpy": "1.0"},
    )
    now = replace(before, runs=(run,), provenance=made, reference=replace(before.reference, name="other"))
    assert compare_with_baseline(now, before).differences == (
        SettingDifference("reference", "path", "other"),
        SettingDifference("align", "none", "rigid"),
        SettingDifference("version of numpy", before.provenance.versions["numpy"], "1.0"),
        SettingDifference("sync_offset of a", 0.0, 0.25),
    )


def test_the_result_is_json_in_the_comparison() -> None:
    before = replace(paths({"a": off(0.001), "old": off(0.0)}), recording=Path("old.rrd"))
    now = paths({"a": off(0.002)})
    held = replace(now, baseline=compare_with_baseline(now, before))
    assert (held.verdict, held.within_tolerance, now.verdict) == ("fail", True, "pass")
    assert (held.to_dict()["verdict"], now.to_dict()["baseline"]) == ("fail", None)
    told = json.loads(json.dumps(to_json_value(held.to_dict())))["baseline"]
    assert (told["name"], told["recording"], told["verdict"]) == ("against-path", "old.rrd", "fail")
    assert told["noise"] == DEFAULT_NOISE
    assert told["missing"] == [{"run": "old", "quantity": None}]
    x = told["changes"][0]
    assert (x["run"], x["quantity"], x["unit"], x["worse"]) == ("a", "x", "m", ["max", "rms"])
    assert x["max"] == {
        "before": before.runs[0].statistics["x"].max, "now": now.runs[0].statistics["x"].max,
    }  # fmt: skip
    assert x["verdict"] == {"before": "pass", "now": "pass"}


def test_a_noise_is_of_all_lengths_or_of_kinds() -> None:
    assert parse_noise("5um") == DEFAULT_NOISE | {"axis": 5e-6, "norm": 5e-6, "path": 5e-6}
    assert parse_noise("0,angle=1mrad") == {
        "axis": 0.0,
        "norm": 0.0,
        "path": 0.0,
        "angle": 0.001,
        "joint": 1e-6,
    }
    assert complete_noise(None) == DEFAULT_NOISE
    assert complete_noise(5e-6) == parse_noise("5um")
    assert complete_noise({"x": 0.0}) == DEFAULT_NOISE | {"x": 0.0}
    allowed = (
        "allowed: a length in m, or axis=, x=, y=, z=, norm=, path= (m, mm, um), angle=, joint= (rad, mrad,"
        " deg; m of a joint that slides)"
    )
    with pytest.raises(OptionError) as error:
        parse_noise("lots,angle=-1")
    assert str(error.value) == (
        f"noise (--noise): found 'lots', {allowed}\nnoise (--noise): found 'angle=-1', {allowed}"
    )
    assert refusal(OptionError, complete_noise, {"axis": -1.0}) == (
        "noise (--noise): found axis=-1.0, allowed: numbers of axis, x, y, z, norm, path in m, of angle,"
        " joint in rad"
        " (m of a joint that slides); 0 or positive"
    )
