"""What is written is read back: every array bit for bit, and all metadata."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import made_runs
from asserting import refusal, there
from recordable import build_comparison, build_run
from same_results import assert_comes_back, assert_same
from urmpipe_models.errors import OutputError
from urmpipe_pipeline.comparison.baseline import compare_with_baseline
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs, compare_with_recorded_tcp
from urmpipe_pipeline.joint_log import Inference, LogColumn, LogWarning, SourceFile
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.results import read_recording, write_recording
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import AlignMode


def full(run: Run) -> Run:
    """Return a run with every array that a log can have, with missing and odd values in them."""
    rng = np.random.default_rng(7)
    count = run.log.rows
    q = run.log.q.copy()
    q[3, 2], q[4, 0] = np.nan, -0.0
    assert run.tcp is not None
    recorded = run.tcp.position + rng.normal(0.0, 1e-3, (count, 3))
    recorded[count // 2] = np.nan
    singular = np.zeros(count, dtype=np.bool_)
    singular[[0, count // 3, count - 1]] = True
    log = replace(
        run.log, q=q, qd=run.qd * 1.001, qdd=run.qdd * 0.999, tcp_position=recorded,
        tcp_rotation=rng.normal(size=(count, 3)),
        rotation_form="vector",
    )  # fmt: skip
    return replace(run, log=log, tcp_recorded=recorded, tcp=replace(run.tcp, singular=singular))


def without_robot(run: Run) -> Run:
    return replace(run, robot=None, tcp=None)


def on_another_grid(run: Run) -> Run:
    rows = np.r_[0:400, 401:1000:3]
    log = replace(run.log, t_ns=run.log.t_ns[rows] + np.arange(len(rows)) % 7, q=run.log.q[rows])
    return replace(run, log=log)


def path_run(run: Run) -> Run:
    """Return a path: the positions of a run, without joints."""
    empty, position = np.empty((run.log.rows, 0)), there(run.tcp).position
    log = replace(run.log, joints=(), q=empty, columns=(), tcp_position=position)
    return replace(
        run, log=log, robot=None, q=empty, qd=empty, qdd=empty, tcp=None, tcp_recorded=position, audit=()
    )


def times_alone(run: Run) -> Run:
    run = path_run(run)
    return replace(run, log=replace(run.log, tcp_position=None), tcp_recorded=None)


def without_any_value(run: Run) -> Run:
    tcp = there(run.tcp)
    none: dict[str, Any] = {
        field.name: np.full_like(run.q[:, :3], np.nan) for field in fields(tcp) if field.name != "singular"
    }
    return replace(run, q=np.full_like(run.q, np.nan), tcp=replace(tcp, **none))


@pytest.mark.parametrize(
    ("rows", "change"),
    [
        (1500, lambda run: run), (1, lambda run: run), (1500, full), (1000, without_robot),
        (1000, on_another_grid), (1500, path_run), (20, times_alone), (30, without_any_value),
        # Three slices: the first and the last are sent before the other.
        pytest.param(140_000, full, marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_a_run_comes_back_as_it_was(rows: int, change: Callable[[Run], Run], tmp_path: Path) -> None:
    run = build_run(rows=rows)
    assert rows < 1500 or len(run.repolarizations) >= 2
    run = change(run)
    assert_comes_back(run, tmp_path)


def test_a_comparison_of_paths_is_recorded(tmp_path: Path) -> None:
    run = path_run(build_run(rows=20))
    comparison = compare_runs(run, [run, build_run(rows=20)])
    assert [one.run.log.joints for one in comparison.runs] == [(), build_run(rows=20).log.joints]
    assert_comes_back(comparison, tmp_path)


@pytest.mark.slow
def test_a_comparison_comes_back_as_it_was(tmp_path: Path) -> None:
    comparison = build_comparison(("coppeliasim", "matlab", "solidworks"))
    assert [one.verdict for one in comparison.runs] == ["pass", "pass", "fail"]
    assert comparison.runs[2].out_of_tolerance.any()
    assert_comes_back(comparison, tmp_path)
    earlier = replace(
        build_comparison(("matlab", "old")), tolerance={"axis": 0.002}, recording=Path("before.rrd")
    )
    baseline = compare_with_baseline(comparison, earlier, {"axis": 1e-5})
    assert baseline.changes and baseline.new and baseline.missing and baseline.differences
    comparison = replace(comparison, baseline=baseline)
    assert_comes_back(comparison, tmp_path)


def test_a_comparison_with_samples_left_out_comes_back_as_it_was(tmp_path: Path) -> None:
    run = build_run()
    position = there(run.tcp).position.copy()
    position[[0, 5, 6, 700]] = np.nan
    run = replace(run, tcp=replace(there(run.tcp), position=position))
    comparison = compare_runs(path_run(build_run(rows=1400)), [run], CompareOptions(sync=-0.1))
    assert comparison.runs[0].left_out == 101  # 20 before and 80 after the path, one NaN
    assert_comes_back(comparison, tmp_path)


def test_comparisons_with_recorded_poses_come_back_as_they_were(tmp_path: Path) -> None:
    reference, log = full(build_run("asked for")), full(build_run("log"))
    own = compare_with_recorded_tcp(log)
    assert_comes_back(own, tmp_path)
    comparison = compare_runs(reference, [log], CompareOptions(tcp="recorded"))
    assert (comparison.runs[0].angle is None, comparison.runs[0].left_out) == (False, 1)
    assert_comes_back(comparison, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("align", get_args(AlignMode))
def test_a_comparison_of_poses_and_joints_comes_back_as_it_was(align: AlignMode, tmp_path: Path) -> None:
    reference, log = build_run("asked for"), build_run("log", offset=0.002)
    turned = replace(log, q=log.q + 2 * np.pi * np.array([0, 0, 1, 0, 0, -2]))
    comparison = compare_runs(reference, [turned, full(log)], CompareOptions({"angle": 0.001}, align=align))
    first = comparison.runs[0]
    assert comparison.reference.quat_xyzw is not None
    assert first.joint_turns == (0, 0, -1, 0, 0, 2)
    assert set(first.statistics) == {"x", "y", "z", "norm", "path", "angle"}
    assert list(first.joint_statistics) == list(log.log.joints)
    assert first.alignment.mode == align
    assert_comes_back(comparison, tmp_path)


def test_unobservable_frames_come_back_as_they_were(tmp_path: Path) -> None:
    still = np.tile([0.0, 0.0, 0.0, 1.0], (40, 1))
    position = np.random.default_rng(0).normal(size=(40, 3))
    reference, log = made_runs.path_run(position), made_runs.path_run(position, still, name="log")
    comparison = compare_runs(reference, [log], CompareOptions(align="base+tool"))
    assert [one.part for one in comparison.runs[0].alignment.unobservable] == ["tool offset"] * 3
    assert_comes_back(comparison, tmp_path)


NAMES = (
    "a b/c.d", "reference", "tolerance", "recorded", "", "", "Straße 7 Ω", "x\udc80y", "x?y", "+ /**", "..",
    "a\n\\b",
)  # fmt: skip


@pytest.mark.slow
def test_runs_may_have_any_names(tmp_path: Path) -> None:
    comparison = compare_runs(
        build_run("reference", 40), [build_run(f"run {i}", 40) for i in range(len(NAMES))]
    )
    named = tuple(
        replace(one, name=name, run=replace(one.run, name=name))
        for one, name in zip(comparison.runs, NAMES, strict=True)
    )
    comparison = replace(comparison, name="x\udc80y", runs=named)
    assert_comes_back(comparison, tmp_path)


ODD = st.text(st.characters(exclude_categories=[]), max_size=12)
NUMBERS = st.floats(allow_nan=False)
OPTIONS = st.recursive(
    st.none() | st.booleans() | st.integers() | NUMBERS | ODD,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(ODD, inner, max_size=3),
    max_leaves=5,
)


@pytest.mark.slow
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    texts=st.lists(ODD, min_size=10, max_size=10),
    joints=st.lists(ODD, min_size=6, max_size=6, unique=True),
    options=st.dictionaries(ODD, OPTIONS, max_size=3),
    number=NUMBERS,
    row=st.none() | st.integers(-3, 10**12),
)
def test_metadata_of_any_text_come_back(
    tmp_path: Path,
    texts: list[str],
    joints: list[str],
    options: dict[str, Any],
    number: float,
    row: int | None,
) -> None:
    name, source, kind, message, file, what, value, unit, command, created = texts
    run = build_run(rows=3)
    log = replace(
        run.log, name=name, source=source, files=(SourceFile(file, what, 2**40),), joints=tuple(joints),
        clock_start_ns=row or 0, first_line=9, digits=None,
        columns=tuple(LogColumn(n, n, "joint", j, unit, number) for j, n in enumerate(joints)),
        inferences=(Inference(what, value, message),), warnings=(LogWarning(kind, message, row),),
    )  # fmt: skip
    run = replace(
        run, name=name, log=log, tsp=abs(number), warnings=log.warnings,
        audit=tuple(replace(entry, joint=joints[0]) for entry in run.audit),
        provenance=Provenance(command, options, log.files, {unit: value}, created),
    )  # fmt: skip
    path = tmp_path / "odd.rrd"
    assert_same(read_recording(write_recording(run, path)), run)


def test_options_come_back_as_json_has_them(tmp_path: Path) -> None:
    run = build_run(rows=3)
    options = {"file": Path("a/b.toml"), "range": (1, 2.5), "n": np.int64(3), "tool": np.array([0.0, 0.1])}
    run = replace(run, provenance=replace(run.provenance, options=options))
    stored = {"file": str(Path("a/b.toml")), "range": [1, 2.5], "n": 3, "tool": [0.0, 0.1]}
    back = read_recording(write_recording(run, tmp_path / "run.rrd"))
    assert isinstance(back, Run)
    assert back.provenance.options == stored


@pytest.mark.slow
def test_a_mended_recording_is_the_same(tmp_path: Path) -> None:
    """Rerun's own tool cuts and orders the chunks anew."""
    comparison = build_comparison(("coppeliasim",), rows=70_000)
    path = write_recording(comparison, tmp_path / "whole.rrd")
    rerun_tool("rrd", "optimize", str(path), "-o", str(tmp_path / "mended.rrd"))
    assert_same(read_recording(tmp_path / "mended.rrd"), comparison)


@pytest.mark.slow
def test_rerun_finds_nothing_wrong(tmp_path: Path) -> None:
    path = write_recording(build_comparison(NAMES[:3]), tmp_path / "odd.rrd")
    assert "1 file verified without error" in rerun_tool("rrd", "verify", str(path))


def rerun_tool(*arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "rerun", *arguments], capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


@pytest.mark.slow
def test_progress_is_told_up_to_one(tmp_path: Path) -> None:
    shares: list[float] = []
    write_recording(build_run(rows=70_000), tmp_path / "run.rrd", progress=shares.append)
    assert shares == sorted(shares)
    assert len(shares) > 8
    assert (shares[0] > 0.0, shares[-1]) == (True, 1.0)


def test_an_input_is_never_replaced(tmp_path: Path) -> None:
    path = write_recording(build_run(rows=5), tmp_path / "one.rrd")
    before = path.read_bytes()
    inputs = [tmp_path / "log.csv", path]
    assert refusal(OutputError, write_recording, build_run(rows=6), path, inputs=inputs) == (
        f"{path}: found an input of this command, allowed: any other name for the recording"
    )
    assert path.read_bytes() == before


def test_a_stopped_writer_leaves_the_old_output(tmp_path: Path) -> None:
    path = write_recording(build_run(rows=5), tmp_path / "one.rrd")
    before = path.read_bytes()

    def stop(share: float) -> None:
        if share > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_recording(build_run(), path, progress=stop)
    assert [(one, one.read_bytes()) for one in tmp_path.iterdir()] == [(path, before)]
