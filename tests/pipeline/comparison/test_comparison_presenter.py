"""What a comparison shows: its numbers, its arrays, each fact once, and nothing computed too early."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from asserting import there
from made_runs import arms, off, paths
from presented import Untouched, cells, every_section, facts, figures, scene_of
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_pipeline.comparison.baseline import compare_with_baseline
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import AXES
from urmpipe_pipeline.comparison.figures import MIN_VISIBLE
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.figure import Figure, SpaceFigure
from urmpipe_pipeline.presentation.palette import run_colour
from urmpipe_pipeline.presentation.section import Check, Place, Ref, Section
from urmpipe_pipeline.results import present


def noisy(seed: int, size: float = 0.001, samples: int = 60) -> FloatArray:
    """Random deviations of six joints."""
    return size * np.random.default_rng(seed).normal(size=(samples, 6))


def log_section(result: Comparison, name: str) -> Section:
    return next(one for one in present(result).body.sections if one.title == name)


def test_a_quantity_with_a_tolerance_is_a_check() -> None:
    result = paths({"good": off(0.001), "bad": off(0.004)}, tolerance={"axis": 0.0035, "norm": 0.01})
    shown = present(result)
    assert [one.title for one in shown.body.sections] == ["good", "bad"]
    said = (
        "|Δx| = 4.000 mm of 3.5 mm allowed (1.14 times the tolerance) at t = 0.495 s (row 100); out of"
        " tolerance: 13 of 100 samples (13.0 %)"
    )
    assert shown.body.sections[1].checks == (
        Check("x", "fail", said, "bad"),
        *(Check(name, "pass", "", "bad") for name in ("y", "z", "norm", "coverage", "judged")),
    )
    assert (shown.name, shown.verdict, shown.created) == (result.name, "fail", result.provenance.created)


def test_the_properties_and_rows_are_the_statistics() -> None:
    result = arms({"a": noisy(1), "b": noisy(2)}, tolerance={"axis": 0.001, "joint": 0.002})
    for one in result.runs:
        properties = log_section(result, one.name).properties
        for held in one.quantities:
            prefix = f"joint {held.quantity}" if held.kind == "joint" else held.quantity
            for field, value in held.fields().items():
                assert properties[f"{prefix}.{field}"] is value or properties[f"{prefix}.{field}"] == value
        assert properties["out_fraction"] == one.out_fraction
        assert properties["speed_correlation"] == one.speed_correlation
    rows = there(present(result).rows)
    table = cells(rows())
    assert list(zip(*table.values(), strict=True)) == [tuple(row.values()) for row in result.rows()]
    assert list(table) == list(next(result.rows()))


def test_a_joint_that_is_called_x_is_not_the_axis() -> None:
    result = arms({"a": np.full((20, 6), 0.01)}, tolerance={"axis": 1.0, "joint": 0.002})
    run = result.runs[0]
    renamed = {"x": replace(run.joint_statistics["q1"], quantity="x")}
    deltas = np.asarray(run.joint_delta)[:, :1]
    one = replace(run, joint_statistics=renamed, joint_delta=deltas, joint_turns=(0,))
    checks = log_section(replace(result, runs=(one,)), "a").checks
    assert [check.name for check in checks] == ["x", "y", "z", "joint x", "coverage", "judged"]


def test_the_first_fact_is_what_decided() -> None:
    result = arms({"a": noisy(1), "b": noisy(2, 0.01)}, tolerance={"joint": 0.002})
    for one in result.runs:
        section = log_section(result, one.name)
        held, value = one.worst_statistics, cast("Any", section.facts[0].value)
        assert (value.number, value.unit, value.limit) == (held.max, held.unit, held.tolerance)
        assert (value.used, value.verdict) == (held.utilisation, held.verdict)
        found = facts(section)
        assert found["Time"] == held.t_max
        assert found["Position"] == Place(tuple(one.actual[one.worst_statistics_index].tolist()))
        assert found["r(‖Δ‖, speed)"] == one.speed_correlation
    shown = present(result)
    worst = result.worst
    assert shown.facts[0].value == Ref(worst.name, run_colour(result.runs.index(worst)))
    assert shown.opens_at_ns == worst.t_ns[worst.worst_statistics_index]


def test_the_tables_hold_the_statistics_of_each_unit() -> None:
    result = arms({"a": noisy(1)}, tolerance={"axis": 0.001, "joint": 0.002})
    one = result.runs[0]
    lengths, angles, shares = (cells(table) for table in log_section(result, "a").tables)
    for table, unit in ((lengths, "m"), (angles, "rad")):
        own = [held for held in one.all_statistics if held.unit == unit]
        for key in ("tolerance", "max", "t_max", "rms", "p95", "mean", "std", "out_fraction"):
            assert table[key] == [getattr(held, key) for held in own], key
    assert lengths["start"] == [*one.start, one.path[0]]
    joint_delta, angle = np.asarray(one.joint_delta), np.asarray(one.angle)
    assert angles["start"] == [angle[0], *joint_delta[0].tolist()]
    for key in ("quantity", "tolerance", "value", "samples", "total"):
        assert shares[key] == [getattr(held, key) for held in one.shares.values()], key


def test_assumptions_stand_in_the_verdict_s_line_alone_and_among_others() -> None:
    result = replace(paths({"a": off(0.001)}), assumptions=("the joints are in deg", "so (a)"))
    shown = present(result)
    assert shown.headline.endswith(", assuming the joints are in deg and so (a)")
    assert [line["Assuming"] for line in shown.lines] == ["the joints are in deg; so (a)"]


def test_many_logs_are_ranked_and_keep_their_colours() -> None:
    deltas = {f"log{k}": off(0.001 * (1 + (7 * k) % 12)) for k in range(12)}
    result = paths(deltas, tolerance={"axis": 0.006})
    shown = present(result)
    assert [one.title for one in shown.body.sections] == list(deltas)
    ranks = {one.title: one.rank for one in shown.body.sections}
    assert sorted(ranks, key=ranks.__getitem__) == [one.name for one in result.ranking]
    assert [one.title for one in shown.body.sections if one.opened] == [result.worst.name]
    far, conditions = (cells(table) for table in shown.body.tables)
    assert far["run"] == [Ref(o.name, run_colour(result.runs.index(o))) for o in result.ranking]
    assert far["max_x"] == [one.statistics["x"].max for one in result.ranking]
    assert far["out_fraction"] == [one.out_fraction for one in result.ranking]
    assert conditions["t"] == [one.worst_statistics.t_max for one in result.ranking]
    assert [line["Log"] for line in shown.lines] == far["run"]
    (overview,) = [one for one in shown.body.blocks() if isinstance(one, Figure)]
    for line, one in zip(overview.views[0].panels[0].lines, result.ranking, strict=True):
        np.testing.assert_array_equal(line.values, one.delta[:, 3])
        assert line.t_ns is one.t_ns
        assert line.colours == (run_colour(result.runs.index(one)),)


def test_a_single_log_is_not_ranked() -> None:
    body = present(paths({"a": off(0.001)})).body
    assert body.tables == ()
    assert not any(isinstance(one, Figure) for one in body.blocks())


def test_what_changed_since_the_baseline_is_a_section() -> None:
    before, now = paths({"a": off(0.001), "old": off(0.0)}), paths({"a": off(0.0015), "new": off(0.0)})
    found = compare_with_baseline(now, before)
    shown = present(replace(now, baseline=found))
    section = shown.body.sections[-1]
    assert (section.verdict, shown.verdict) == ("fail", "fail")
    changed = [one for one in found.changes if one.changed]
    table = cells(section.tables[0])
    assert table["max_before"] == [one.before.max for one in changed]
    assert table["max_now"] == [one.now.max for one in changed]
    assert table["largest_change"] == [one.largest_change for one in changed]
    (gone,) = section.sections
    assert gone.checks == (
        Check(
            "log is there", "fail", "old: a log of the baseline, not compared any more",
            "old against baseline", "worse-than-baseline",
        ),
    )  # fmt: skip
    (log, *_) = shown.body.sections
    against = [check for check in log.checks if check.about == "a against baseline"]
    assert [(check.name, check.verdict) for check in against] == [
        ("x", "fail"), ("y", "pass"), ("z", "pass"), ("norm", "fail"), ("path", "pass"),
    ]  # fmt: skip
    assert all(check.kind == "worse-than-baseline" for check in against)


def test_the_plots_are_the_deviation_with_what_is_allowed() -> None:
    result = arms({"a": noisy(1)}, tolerance={"axis": 0.001, "angle": 0.002, "joint": 0.002})
    one = result.runs[0]
    deviation, joints, *_ = figures(log_section(result, "a"))
    delta, path, angle = deviation.views
    for i, (axis, panel) in enumerate(zip(AXES, delta.panels, strict=True)):
        held = one.statistics[axis]
        np.testing.assert_array_equal(panel.lines[0].values, one.delta[:, i])
        assert (panel.limit, panel.unit, panel.signed) == (held.tolerance, "m", axis != "norm")
        assert abs(panel.lines[0].values[:][panel.peaks[0]]) == held.max
    assert path.panels[0].lines[0].values is one.path
    assert angle.panels[0].lines[0].values is one.angle
    np.testing.assert_array_equal(joints.views[0].panels[0].lines[0].values, np.asarray(one.joint_delta))
    assert list(deviation.instants) == [one.t_ns[one.worst_statistics_index]]


@pytest.mark.parametrize(("kind", "view"), [("axis", 0), ("path", 1), ("angle", 2)])
def test_the_viewer_opens_what_decided(kind: str, view: int) -> None:
    result = arms({"a": noisy(1)}, tolerance={kind: 1e-6})
    deviation, *_ = figures(log_section(result, "a"))
    assert deviation.opened == view


def test_paths_have_no_joints_and_no_arm() -> None:
    result = paths({"a": off(0.001)})
    shown = present(result)
    units = {p.unit for f in figures(shown.body.sections[0]) for view in f.views for p in view.panels}
    assert units == {"m", "m/s"}
    scene = scene_of(shown)
    assert scene.arms == ()
    np.testing.assert_array_equal(scene.paths[0].position, result.reference.position)


def test_the_scene_is_the_worst_arm_all_paths_and_what_decided() -> None:
    result = arms({"a": noisy(1, 0.01), "b": noisy(2, 0.001)})
    scene, worst = scene_of(present(result)), result.worst
    assert scene.arms[0].q is worst.run.q
    whole, moving, a, b, larger = scene.paths
    assert whole.position is result.reference.position
    assert (whole.t_ns, moving.line) == (None, False)
    assert moving.position is worst.reference
    assert [path.position for path in (a, b)] == [one.actual for one in result.runs]
    assert scene.spots[0].position == tuple(worst.actual[worst.worst_statistics_index].tolist())
    factor = int(larger.name.removeprefix("deviation x"))
    np.testing.assert_array_equal(
        larger.position, worst.reference + factor * (worst.actual - worst.reference)
    )


@pytest.mark.parametrize("align", ["none", "start", "rigid", "tool"])
def test_the_arm_stands_where_its_aligned_path_is(align: str) -> None:
    result = arms({"a": noisy(1, 0.01)}, align=align)
    one = result.runs[0]
    (arm,) = scene_of(present(result)).arms
    # Two ways of adding up one motion: rounding of lengths below 2 m.
    np.testing.assert_allclose(
        positions_over_log(arm.chain, one.run.q[one.sample]), one.actual, rtol=0, atol=1e-12
    )


@pytest.mark.parametrize(
    ("largest", "factor"),
    [
        (0.0, None),
        (0.9 * MIN_VISIBLE / 50, None),
        (1.1 * MIN_VISIBLE / 50, 50),
        (0.99 / 50, 50),
        (1.01 / 50, 20),
        (0.49, 2),
        (0.51, None),
    ],
)
def test_a_deviation_is_enlarged_as_far_as_it_stays_inside_the_scene(
    largest: float, factor: int | None
) -> None:
    """`largest` is a share of the radius of the scene, which is half of the path's metre."""
    scene = scene_of(present(paths({"a": off(0.5 * largest)})))
    assert [one.name for one in scene.paths[3:]] == ([f"deviation x{factor}"] if factor else [])


def test_a_page_shows_the_paths_coloured_by_the_deviation() -> None:
    result = paths({"a": off(0.004)})
    one = result.runs[0]
    space = next(b for b in log_section(result, "a").blocks() if isinstance(b, SpaceFigure))
    reference, actual = space.paths
    assert reference.position is one.reference
    assert actual.position is one.actual
    np.testing.assert_array_equal(np.asarray(actual.values), one.delta[:, 3])


def test_each_warning_stands_once() -> None:
    result = arms({"a": noisy(1), "b": noisy(2, samples=40)})
    a, b = result.runs
    a = replace(a, run=replace(a.run, warnings=(LogWarning("gap", "two rows lie far apart", 7),)))
    result = replace(result, runs=(a, b), warnings=(*result.warnings, LogWarning("general", "of all")))
    shown = [one for section in every_section(present(result).body) for one in section.warnings]
    every = [*a.run.warnings, *b.run.warnings, *result.warnings]
    assert sorted(one.kind for one in shown) == sorted(one.kind for one in every)
    assert [one.kind for one in present(result).body.warnings] == ["general"]


def test_events_tell_when_what_happened() -> None:
    result = paths({"a": off(0.004)}, tolerance={"axis": 0.0035})
    one = result.runs[0]
    longest = there(one.longest_out_interval)
    found = {event.t_ns: event.level for event in log_section(result, "a").events()}
    assert found[round(there(longest.t) * 1e9)] == "error"
    assert found[int(one.t_ns[one.worst_statistics_index])] == "error"


def test_no_array_of_a_motion_is_looked_into_before_it_is_shown() -> None:
    result = arms({"a": noisy(1), "b": noisy(2)})

    def hidden(run: Any) -> Any:
        untouched = {name: cast("Any", Untouched(len(run.q))) for name in ("q", "qd", "qdd")}
        tcp = replace(run.tcp, **dict.fromkeys(("position", "velocity", "acceleration"), untouched["q"]))
        return replace(run, tcp=tcp, **untouched)

    runs = tuple(replace(one, run=hidden(one.run)) for one in result.runs)
    shown = present(replace(result, runs=runs))
    assert shown.verdict == result.verdict


def test_a_log_of_one_row_is_shown() -> None:
    shown = present(paths({"a": np.zeros((1, 3))}))
    scene_of(shown)
    for section in every_section(shown.body):
        assert all(figure.views for figure in figures(section))
        list(section.blocks())
        list(section.events())
