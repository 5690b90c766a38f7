"""Deviation, statistics and verdict, from plain arrays."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from asserting import there
from made_runs import TSP, URM6, path_run, run_of
from urmpipe_models.arm.chain import Mesh, Visual
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import points_over_log, positions_over_log
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs, compare_with_recorded_tcp
from urmpipe_pipeline.joint_log import LogColumn, LogWarning
from urmpipe_pipeline.presentation.meshes import mesh_warnings
from urmpipe_pipeline.repolarization.audit import audit_log

COLUMNS = tuple(LogColumn(f"q{i + 1}", f"q{i + 1}", "joint", i, "rad") for i in range(6))


@pytest.fixture
def q() -> FloatArray:
    t = TSP * np.arange(500)
    return np.column_stack([0.5 * np.sin(t * (1 + i)) + i for i in range(6)])


def test_a_path_made_by_the_arm_itself_has_no_deviation(q: FloatArray) -> None:
    result = compare_runs(path_run(points_over_log(URM6, q)[:, -1]), [run_of(q)])
    assert result.verdict == "pass"
    assert result.runs[0].delta.max() == 0.0
    assert result.runs[0].left_out == 0
    assert result.runs[0].sync.offset == 0.0
    assert result.name == "log-against-path"


def test_statistics_are_those_of_numpy_and_the_sign_is_reference_minus_actual(q: FloatArray) -> None:
    rng = np.random.default_rng(5)
    shift = rng.normal(0.001, 0.0005, (500, 3))
    wanted = positions_over_log(URM6, q) + shift
    deviation = compare_runs(path_run(wanted), [run_of(q)]).runs[0]
    np.testing.assert_allclose(deviation.delta[:, :3], shift, atol=1e-15)  # p of 1 m rounds at 2e-16
    one = deviation.statistics["y"]
    y = deviation.delta[:, 1]
    worst = int(np.argmax(np.abs(y)))
    assert (one.max, one.sample_max, one.t_max) == (np.abs(y).max(), worst, worst * 0.005)
    assert one.rms == pytest.approx(np.sqrt(np.mean(y**2)), rel=1e-14)
    assert (one.mean, one.std) == (float(np.mean(y)), float(np.std(y)))
    assert one.p95 == np.percentile(np.abs(y), 95)
    norm = deviation.statistics["norm"]
    assert norm.verdict is None
    assert norm.tolerance is None
    assert norm.max == pytest.approx(np.linalg.norm(shift, axis=1).max(), rel=1e-12)
    assert deviation.start == tuple(deviation.delta[0])


def test_the_tolerance_decides_axis_by_axis(q: FloatArray) -> None:
    wanted = positions_over_log(URM6, q)
    wanted[100:110, 2] += 0.0036
    result = compare_runs(path_run(wanted), [run_of(q)])
    deviation = result.runs[0]
    verdicts = {axis: one.verdict for axis, one in deviation.statistics.items()}
    assert verdicts == {"x": "pass", "y": "pass", "z": "fail", "norm": None, "path": None}
    assert (result.verdict, deviation.verdict) == ("fail", "fail")
    assert np.flatnonzero(deviation.out_of_tolerance).tolist() == list(range(100, 110))
    assert deviation.out_fraction == 10 / 500
    assert compare_runs(path_run(wanted), [run_of(q)], CompareOptions({"axis": 0.0037})).verdict == "pass"


def test_samples_without_a_reference_or_a_value_are_left_out_and_counted(q: FloatArray) -> None:
    broken = q.copy()
    broken[7, 3] = np.nan
    result = compare_runs(path_run(positions_over_log(URM6, q)[:400]), [run_of(broken)])
    deviation = result.runs[0]
    assert deviation.left_out == 101
    assert 7 not in deviation.sample
    assert deviation.sample[-1] == 399
    assert [w.message for w in result.warnings] == ["101 of 500 samples have no reference or no value"]


def test_an_offset_shifts_the_log_against_the_reference(q: FloatArray) -> None:
    wanted = path_run(points_over_log(URM6, q)[:, -1])
    late = compare_runs(wanted, [run_of(q[100:])], CompareOptions(sync=0.5)).runs[0]
    assert late.delta.max() == 0.0
    assert late.sync.offset == 0.5
    assert len(late.sample) == 400


def test_an_offset_is_estimated_and_what_it_leaves_out_on_both_sides_is_told(q: FloatArray) -> None:
    wanted = path_run(points_over_log(URM6, q)[:, -1][:450])
    broken = q[100:].copy()
    broken[30, 2] = np.nan
    result = compare_runs(wanted, [run_of(broken)], CompareOptions(sync="auto"))
    late = result.runs[0]
    assert (late.sync.mode, late.sync.offset, late.sync.by) == ("auto", 0.5, "position")
    assert late.statistics["norm"].max < 1e-12  # the same samples
    assert (late.left_out, late.reference_left_out) == (51, 100)
    coverage, judged = late.shares.values()
    assert (coverage.samples, coverage.total, coverage.verdict) == (
        349,
        450,
        "fail",
    )  # it moves elsewhere, too
    assert (judged.samples, judged.total, judged.verdict) == (349, 399, "pass")
    assert result.warnings == (
        LogWarning("left-out", "1 of 400 samples have no reference or no value", about="log"),
    )


def test_an_estimate_that_is_not_certain_is_told(q: FloatArray) -> None:
    rng = np.random.default_rng(3)
    wanted = path_run(positions_over_log(URM6, q) + rng.normal(scale=0.011, size=(500, 3)))
    result = compare_runs(wanted, [run_of(q)], CompareOptions(sync="auto"))
    precision = there(result.runs[0].sync.precision)
    assert precision > 0.1 * TSP
    said = [one.message for one in result.warnings if one.kind == "sync-uncertain"]
    assert len(said) == 1
    assert f"is known to +-{1e3 * precision:.2g} ms (standard error); the period is 5 ms" in said[0]


def test_logs_with_one_name_are_told_apart(q: FloatArray) -> None:
    wanted = path_run(points_over_log(URM6, q)[:, -1])
    assert [r.name for r in compare_runs(wanted, [run_of(q), run_of(q), run_of(q, name="b")]).runs] == [
        "log", "log-2", "b",
    ]  # fmt: skip


def test_one_log_is_held_against_what_it_recorded_itself(q: FloatArray) -> None:
    recorded = positions_over_log(URM6, q) + np.array([0.001, 0.0, 0.0])
    recorded[3] = np.nan
    result = compare_with_recorded_tcp(run_of(q, recorded=recorded))
    assert result.runs[0].statistics["x"].mean == pytest.approx(0.001, abs=1e-15)
    assert result.runs[0].left_out == 1


def test_the_result_is_a_table_and_json(q: FloatArray) -> None:
    result = compare_runs(path_run(positions_over_log(URM6, q) + 0.004), [run_of(q)])
    frame = result.to_frame()
    assert frame["quantity"].tolist() == ["x", "y", "z", "norm", "path", "coverage", "judged"]
    assert frame["verdict"].tolist()[:3] == ["fail"] * 3
    as_dict = result.to_dict()
    assert list(as_dict)[:4] == ["schema", "verdict", "assumptions", "tolerance"]
    assert as_dict["tolerance"] == {"axis": 0.0035, "coverage": 0.9, "judged": 0.5}
    one = as_dict["runs"][0]
    assert set(one) >= {"name", "samples", "left_out", "duration", "sync_offset", "delta", "worst",
                        "out_of_tolerance", "out_fraction", "verdict", "warnings"}  # fmt: skip
    assert [one[name] for name in ("coverage", "judged")] == [
        asdict(share) for share in result.runs[0].shares.values()
    ]
    assert set(one["delta"]["x"]) == {
        "unit", "max", "rms", "mean", "std", "p95", "t_max", "sample_max", "tolerance", "out_of_tolerance",
        "out_fraction", "verdict", "samples", "missing",
    }  # fmt: skip
    assert one["out_fraction"] == 1.0


def test_a_log_alone_is_compared_as_it_was_repaired() -> None:
    t = TSP * np.arange(200)
    true = np.column_stack([np.pi + 0.5 * (t - 0.5024), *(0.1 * np.sin(t + k) for k in range(5))])
    there = (true + np.pi) % (2 * np.pi) - np.pi
    wrap = int(np.argmax(np.abs(np.diff(there[:, 0])))) + 1
    there[wrap, 0] = (there[wrap - 1, 0] + there[wrap + 1, 0]) / 2
    log = replace(run_of(there, recorded=positions_over_log(URM6, true)).log, columns=COLUMNS)
    found = audit_log(log, URM6, repaired=True)
    assert [entry.kind for entry in found.entries] == ["repaired", "wrap"]
    run = replace(run_of(found.q), log=log, audit=found.entries)
    # A straight line between samples 5 ms apart misses a sine of 1 rad/s2 by 1e-5 rad at the most.
    assert compare_with_recorded_tcp(run).runs[0].delta.max() < 1e-5
    assert (
        compare_with_recorded_tcp(run_of(there, recorded=positions_over_log(URM6, true))).runs[0].delta.max()
        > 0.1
    )


def test_meshes_that_went_away_since_the_log_was_read_are_told_once(q: FloatArray, tmp_path: Path) -> None:
    mesh = tmp_path / "link.stl"
    mesh.write_bytes(b"solid")
    shown = replace(URM6, visuals=(Visual("phi1", Mesh(str(mesh))),))
    logs = [run_of(q, name=name, robot=shown) for name in ("one", "other")]
    path = path_run(points_over_log(URM6, q)[:, -1])
    assert compare_runs(path, logs).warnings == ()
    mesh.unlink()
    gone = mesh_warnings(shown)
    assert compare_runs(path, logs).warnings == tuple(gone)
    assert [warning.kind for warning in gone] == ["visual-missing"]
    told = [replace(log, warnings=tuple(gone)) for log in logs]  # read when they were gone already
    assert compare_runs(path, told).warnings == ()
