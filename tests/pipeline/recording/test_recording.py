"""What is written is read back: every array bit for bit, and all metadata, of runs and results over them."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import made_runs
from asserting import refusal, there
from diagnoses import diagnosis_of
from recordable import build_comparison, build_run, build_solved
from recorded import columns
from same_results import assert_comes_back, assert_same
from urmpipe_models.errors import OptionError, RecordingError
from urmpipe_models.ik.solutions import Targets
from urmpipe_pipeline.comparison.baseline import compare_with_baseline
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs, compare_with_recorded_tcp
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.verdict import DeltaMeterResult
from urmpipe_pipeline.joint_log import Inference, LogColumn, LogWarning, SourceFile
from urmpipe_pipeline.operands import load_comparison, load_runs
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.recording.layout import SLICE
from urmpipe_pipeline.results import enclosing_result, read_recording, write_recording
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.simulations.simulation import Setting, Signal, SimulatedBlock, Simulation
from urmpipe_pipeline.trajectories import AlignMode

MakeSimulation = Callable[..., Simulation]


# --- runs ------------------------------------------------------------------------------------------


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


# --- comparisons, diagnoses, solved targets --------------------------------------------------------


def compared_paths() -> Comparison:
    run = path_run(build_run(rows=20))
    comparison = compare_runs(run, [run, build_run(rows=20)])
    assert [one.run.log.joints for one in comparison.runs] == [(), build_run(rows=20).log.joints]
    return comparison


def compared_with_a_baseline() -> Comparison:
    comparison = build_comparison(("coppeliasim", "matlab", "solidworks"))
    assert [one.verdict for one in comparison.runs] == ["pass", "pass", "fail"]
    assert comparison.runs[2].out_of_tolerance.any()
    earlier = replace(
        build_comparison(("matlab", "old")), tolerance={"axis": 0.002}, recording=Path("before.rrd")
    )
    baseline = compare_with_baseline(comparison, earlier, {"axis": 1e-5})
    assert baseline.changes and baseline.new and baseline.missing and baseline.differences
    return replace(comparison, baseline=baseline)


def compared_with_samples_left_out() -> Comparison:
    run = build_run()
    position = there(run.tcp).position.copy()
    position[[0, 5, 6, 700]] = np.nan
    run = replace(run, tcp=replace(there(run.tcp), position=position))
    comparison = compare_runs(path_run(build_run(rows=1400)), [run], CompareOptions(sync=-0.1))
    assert comparison.runs[0].left_out == 101  # 20 before and 80 after the path, one NaN
    return comparison


def compared_with_recorded_poses() -> Comparison:
    reference, log = full(build_run("asked for")), full(build_run("log"))
    comparison = compare_runs(reference, [log], CompareOptions(tcp="recorded"))
    assert (comparison.runs[0].angle is None, comparison.runs[0].left_out) == (False, 1)
    return comparison


def aligned(align: AlignMode) -> Comparison:
    reference, log = build_run("asked for"), build_run("log", offset=0.002)
    turned = replace(log, q=log.q + 2 * np.pi * np.array([0, 0, 1, 0, 0, -2]))
    comparison = compare_runs(reference, [turned, full(log)], CompareOptions({"angle": 0.001}, align=align))
    first = comparison.runs[0]
    assert comparison.reference.quat_xyzw is not None
    assert first.joint_turns == (0, 0, -1, 0, 0, 2)
    assert set(first.statistics) == {"x", "y", "z", "norm", "path", "angle"}
    assert list(first.joint_statistics) == list(log.log.joints)
    assert first.alignment.mode == align
    return comparison


def compared_where_frames_are_unobservable() -> Comparison:
    still = np.tile([0.0, 0.0, 0.0, 1.0], (40, 1))
    position = np.random.default_rng(0).normal(size=(40, 3))
    reference, log = made_runs.path_run(position), made_runs.path_run(position, still, name="log")
    comparison = compare_runs(reference, [log], CompareOptions(align="base+tool"))
    assert [one.part for one in comparison.runs[0].alignment.unobservable] == ["tool offset"] * 3
    return comparison


NAMES = (
    "a b/c.d", "reference", "tolerance", "recorded", "", "", "Straße 7 Ω", "x\udc80y", "x?y", "+ /**", "..",
    "a\n\\b",
)  # fmt: skip


def compared_with_odd_names() -> Comparison:
    comparison = compare_runs(build_run("reference", 40), [build_run(f"run {name}", 40) for name in NAMES])
    named = tuple(
        replace(one, name=name, run=replace(one.run, name=name))
        for one, name in zip(comparison.runs, NAMES, strict=True)
    )
    return replace(comparison, name="x\udc80y", runs=named)


def diagnosed() -> Comparison:
    result = build_comparison(("log",))
    return replace(result, runs=(replace(result.runs[0], diagnosis=diagnosis_of(result.runs[0])),))


def positions_alone() -> Result:
    one = build_solved(timed=False)
    position = one.targets.position.copy()
    position[5] = np.nan
    return replace(one, targets=Targets(position), angle=None, all_solutions=False)


BRANCHES = "1", "q", "a/b", "a\\", "a", "a ", "", "unnamed", "elbow (2)", "ü, 肘", "**", "a\ud800b"
QUICK: list[Callable[[], Result]] = [
    compared_paths,
    compared_with_samples_left_out,
    compared_with_recorded_poses,
    lambda: compare_with_recorded_tcp(full(build_run("log"))),
    compared_where_frames_are_unobservable,
    diagnosed,
    lambda: there(diagnosed().runs[0].diagnosis),
    lambda: replace(build_solved(), motion=build_solved().as_run()),
    lambda: build_solved(timed=False),
    lambda: build_solved(names=BRANCHES, rows=20),
    positions_alone,
]
SLOW = [
    compared_with_a_baseline,
    compared_with_odd_names,
    *(partial(aligned, one) for one in get_args(AlignMode)),
]


@pytest.mark.parametrize("make", [*QUICK, *(pytest.param(one, marks=pytest.mark.slow) for one in SLOW)])
def test_a_result_comes_back_as_it_was(make: Callable[[], Result], tmp_path: Path) -> None:
    assert_comes_back(make(), tmp_path)


def test_a_diagnosis_is_no_log_and_recorded_with_its_comparison(tmp_path: Path) -> None:
    comparison, path = diagnosed(), tmp_path / "result.rrd"
    alone = there(comparison.runs[0].diagnosis)
    write_recording(alone, path)
    message = f"{path}: found the recording of a diagnosis, allowed: one with a motion, such as "
    assert refusal(RecordingError, load_runs, [path]).startswith(message)
    found = replace(alone, comparison=comparison)
    assert enclosing_result(found) is comparison
    assert_same(read_recording(write_recording(found, path)), comparison)


# --- simulations -----------------------------------------------------------------------------------


def wide(simulation: Simulation) -> Simulation:
    """Return a simulation whose signals are views into one array, as those of a co-simulation are."""
    recorded = np.random.default_rng(5).normal(size=(40, 9))
    signals = (
        Signal("b", "x", recorded[:, 4]), Signal("b", "y", recorded[:, 1:4]),
        Signal("b", "z", np.asfortranarray(recorded[:, 5:])), Signal("b", "w", recorded[::-1, 0]),
    )  # fmt: skip
    return replace(simulation, signals=signals, verdicts=())


ODD = (
    "a b", "a ", "a", " a", " ", "", "a/b", "a/", "/", "a%2Fb", "\\", "a\\", "a\\/b", "a\\ ", "..", "/**",
    "a.b", "x[1]", "<b>", "a\n", "a\tb", "a\0", "a\u00a0", "\u202e", "\ud800", "\ud801", "?", "A", "$",
)  # fmt: skip


def odd(simulation: Simulation) -> Simulation:
    """Return one with names that Rerun, which drops a blank or a backslash at the end, takes for others."""
    pairs = [pair for name in ODD for pair in ((name, "v"), ("b", name), (name, f"{name}2"))]
    signals = tuple(Signal(*pair, np.arange(3.0) + i) for i, pair in enumerate(pairs))
    (arm,) = simulation.arms
    arms = tuple(replace(arm, block=name, q=arm.q + i) for i, name in enumerate(ODD))
    return replace(simulation, signals=signals, arms=arms, verdicts=())


@pytest.mark.parametrize(
    "change",
    [
        lambda make: make(600),
        lambda make: make(37, "chain: fmi2DoStep returned fmi2Error: q is NaN"),
        lambda make: make(0, "chain: crashed"),
        lambda make: make(1),
        lambda make: replace(make(20), signals=(), verdicts=(), arms=()),
        lambda make: wide(make(40)),
        lambda make: replace(make(3), signals=(Signal("b", "v", np.arange(3.0), "\ud800"),), verdicts=()),
        pytest.param(lambda make: odd(make(3)), marks=pytest.mark.slow),
        # Three slices, the ends and the middle sent before the others.
        pytest.param(lambda make: make(2 * SLICE + 5), marks=pytest.mark.slow),
    ],
)
def test_a_simulation_comes_back_as_it_was(
    change: Callable[[MakeSimulation], Simulation], make_simulation: MakeSimulation, tmp_path: Path
) -> None:
    assert_comes_back(change(make_simulation), tmp_path)


def test_a_variable_is_an_entity_with_a_column_a_scalar(
    make_simulation: MakeSimulation, tmp_path: Path
) -> None:
    simulation = make_simulation(50)
    path = write_recording(simulation, tmp_path / "a.rrd")
    for one in simulation.signals[:4]:
        found = np.array(columns(path, f"/signals/{one.name}/values", "Scalars:scalars"))
        np.testing.assert_array_equal(found, one.columns)


def test_the_recording_of_a_simulation_is_compared_as_it_is(
    make_simulation: MakeSimulation, tmp_path: Path
) -> None:
    simulation = make_simulation(5)
    path = write_recording(simulation, tmp_path / "a.rrd")
    for run in load_runs([path, simulation], block="chain"):
        np.testing.assert_array_equal(run.q, simulation.arms[0].q)
    assert [one.log.name for one in load_runs([path, simulation], block=["log", "chain"])] == [
        "log-to-delta (log)", "log-to-delta (chain)",
    ]  # fmt: skip
    refused = refusal(OptionError, load_runs, [path], block=["a", "b"])
    assert refused.startswith("block (--block): found 'a'")
    refused = refusal(OptionError, load_runs, [path], block=["chain", "log", "chain"])
    assert "with 1 simulation, allowed: one block" in refused
    assert load_comparison(path) is None


# --- any text and number ---------------------------------------------------------------------------


TEXT = st.text(st.characters(exclude_categories=[]), max_size=12)
NUMBERS = st.floats(allow_nan=False)
OPTIONS = st.recursive(
    st.none() | st.booleans() | st.integers() | NUMBERS | TEXT,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, inner, max_size=3),
    max_leaves=5,
)


@st.composite
def runs(draw: st.DrawFn) -> Run:
    """Draw a run with any texts in its metadata."""
    run, number, row = build_run(rows=3), draw(NUMBERS), draw(st.none() | st.integers(-3, 10**12))
    name, source, kind, message, file, what, value, unit, command, created = (draw(TEXT) for _ in range(10))
    joints = draw(st.lists(TEXT, min_size=6, max_size=6, unique=True))
    log = replace(
        run.log, name=name, source=source, files=(SourceFile(file, what, 2**40),), joints=tuple(joints),
        clock_start_ns=row or 0, first_line=9, digits=None,
        columns=tuple(LogColumn(n, n, "joint", j, unit, number) for j, n in enumerate(joints)),
        inferences=(Inference(what, value, message),), warnings=(LogWarning(kind, message, row),),
    )  # fmt: skip
    options = draw(st.dictionaries(TEXT, OPTIONS, max_size=3))
    return replace(
        run, name=name, log=log, tsp=abs(number), warnings=log.warnings,
        audit=tuple(replace(entry, joint=joints[0]) for entry in run.audit),
        provenance=Provenance(command, options, log.files, {unit: value}, created),
    )  # fmt: skip


@st.composite
def simulations(draw: st.DrawFn) -> Simulation:
    """Draw a simulation with any names, any values, and any number of samples."""
    samples = draw(st.integers(0, 4))
    names = draw(st.lists(st.tuples(TEXT, TEXT), max_size=4, unique_by=".".join))
    signals = [
        Signal(
            block, variable,
            draw(arrays(np.float64, draw(st.sampled_from([(samples,), (samples, 1), (samples, 3)])))),
            draw(TEXT), draw(TEXT), draw(st.sampled_from(["Real", "Integer", "Boolean"])), draw(TEXT),
        )
        for block, variable in names
    ]  # fmt: skip
    every = [name for one in signals for name in {one.name, *one.names}]
    verdict = DeltaMeterResult(
        draw(TEXT), tuple(draw(st.lists(TEXT, max_size=2))), {"axis": draw(st.floats(0.0, 1e300))}, "x",
        draw(st.floats()), 0.0, 0, 3, 1, "fail",
    )  # fmt: skip
    block = SimulatedBlock(draw(TEXT), "fmu", draw(TEXT), draw(TEXT), (Setting(draw(TEXT), draw(NUMBERS)),))
    times = draw(st.sets(st.integers(0, 10**15), min_size=samples, max_size=samples))
    return Simulation(
        name=draw(TEXT), description=draw(TEXT),
        t_ns=np.array(sorted(times), np.int64),
        step=draw(NUMBERS), signals=tuple(signals) if len(set(every)) == len(every) else (),
        system_svg=draw(TEXT), system_text=draw(TEXT), blocks=(block,),
        failed=draw(st.none() | TEXT), warnings=(LogWarning(draw(TEXT), draw(TEXT), None),),
        provenance=Provenance("simulate", {}, (SourceFile(draw(TEXT), draw(TEXT), 1),), {}, draw(TEXT)),
        connections=draw(st.dictionaries(TEXT, TEXT, max_size=3)),
        verdicts=(verdict,) if samples else (),
    )  # fmt: skip


@pytest.mark.slow
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(result=runs() | simulations())
def test_any_run_and_any_simulation_comes_back_as_it_was(result: Result, tmp_path: Path) -> None:
    assert_same(read_recording(write_recording(result, tmp_path / "any.rrd")), result)


def test_options_come_back_as_json_has_them(tmp_path: Path) -> None:
    run = build_run(rows=3)
    options = {"file": Path("a/b.toml"), "range": (1, 2.5), "n": np.int64(3), "tool": np.array([0.0, 0.1])}
    run = replace(run, provenance=replace(run.provenance, options=options))
    stored = {"file": str(Path("a/b.toml")), "range": [1, 2.5], "n": 3, "tool": [0.0, 0.1]}
    back = read_recording(write_recording(run, tmp_path / "run.rrd"))
    assert isinstance(back, Run)
    assert back.provenance.options == stored


# --- the file --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_mended_recording_is_the_same(tmp_path: Path) -> None:
    """Rerun's own tool cuts and orders the chunks anew."""
    comparison = build_comparison(("coppeliasim",), rows=70_000)
    path = write_recording(comparison, tmp_path / "whole.rrd")
    rerun_tool("rrd", "optimize", str(path), "-o", str(tmp_path / "mended.rrd"))
    assert_same(read_recording(tmp_path / "mended.rrd"), comparison)


@pytest.mark.slow
def test_rerun_finds_nothing_wrong(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    results = {"odd": build_comparison(NAMES[:3]), "simulation": make_simulation()}
    paths = [str(write_recording(one, tmp_path / f"{name}.rrd")) for name, one in results.items()]
    assert "2 files verified without error" in rerun_tool("rrd", "verify", *paths)


def rerun_tool(*arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "rerun", *arguments], capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


@pytest.mark.slow
def test_progress_rises_up_to_1(tmp_path: Path) -> None:
    shares: list[float] = []
    write_recording(build_run(rows=70_000), tmp_path / "run.rrd", progress=shares.append)
    assert shares == sorted(shares)
    assert len(shares) > 8
    assert (shares[0] > 0.0, shares[-1]) == (True, 1.0)


def test_a_stopped_writer_leaves_the_old_output(tmp_path: Path) -> None:
    path = write_recording(build_run(rows=5), tmp_path / "one.rrd")
    before = path.read_bytes()

    def stop(share: float) -> None:
        if share > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_recording(build_run(), path, progress=stop)
    assert [(one, one.read_bytes()) for one in tmp_path.iterdir()] == [(path, before)]
