"""The recording of a simulation: what is written is read back, and the viewer finds what it is to show."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rerun import blueprint as rrb

from same_results import assert_same
from urmpipe_models.arrays import FloatArray
from urmpipe_models.errors import RecordingError
from urmpipe_pipeline.comparison.delta_verdict import DeltaVerdict
from urmpipe_pipeline.joint_log import LogWarning, SourceFile
from urmpipe_pipeline.operands import SIMULATION, load_comparison, load_runs
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.recording.layout import opening_time, viewer_layout
from urmpipe_pipeline.recording.overview import LONG
from urmpipe_pipeline.recording.plots import Plots
from urmpipe_pipeline.recording.scene import scene_of
from urmpipe_pipeline.recording.simulation_layout import simulation_plots
from urmpipe_pipeline.recording.simulation_summary import simulation_summary
from urmpipe_pipeline.recording.store import Store
from urmpipe_pipeline.recording.viewer import opening_times
from urmpipe_pipeline.recording.writer import SLICE
from urmpipe_pipeline.results import read_recording, write_recording
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.signal_groups import Group
from urmpipe_pipeline.simulations.simulation import Setting, Signal, SimulatedBlock, Simulation

MakeSimulation = Callable[..., Simulation]
MakeRun = Callable[..., Run]


def assert_comes_back(simulation: Simulation, folder: Path) -> None:
    path = write_recording(simulation, folder / "simulation.rrd")
    back = read_recording(path)
    assert_same(back, simulation)
    assert back.recording == path
    assert [one.name for one in folder.iterdir()] == ["simulation.rrd"]


def values_at(store: Store, entity: str) -> FloatArray:
    return np.concatenate([chunk.values for chunk in store.chunks(entity)])


def test_a_simulation_comes_back_as_it_was(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    assert_comes_back(make_simulation(), tmp_path)


def test_one_that_failed_keeps_what_was_recorded(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    assert_comes_back(make_simulation(37, failed="chain: fmi2DoStep returned fmi2Error: q is NaN"), tmp_path)


def test_one_that_failed_before_the_first_sample_is_recorded(
    make_simulation: MakeSimulation, tmp_path: Path
) -> None:
    assert_comes_back(make_simulation(0, failed="chain: crashed"), tmp_path)


def test_one_of_one_sample_is_recorded(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    assert_comes_back(make_simulation(1), tmp_path)


def test_one_without_signals_keeps_its_times(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    assert_comes_back(replace(make_simulation(20), signals=(), verdicts=(), arms=()), tmp_path)


def test_a_long_one_comes_back_in_the_order_of_time(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    """Three slices, the ends and the worst sample sent before the other; and each plot has an overview."""
    simulation = make_simulation(2 * SLICE + 5)
    assert_comes_back(simulation, tmp_path)
    rows = Store(tmp_path / "simulation.rrd").rows
    assert rows["/signals/log/q"] == 2 * SLICE + 5
    assert 0 < rows["/overview/signals/log/q"] < SLICE
    assert "/overview/signals" not in rows


def test_columns_of_a_wider_array_come_back_as_they_were(
    make_simulation: MakeSimulation, tmp_path: Path
) -> None:
    """A co-simulation records all scalars in one array; its signals are views into it."""
    recorded = np.random.default_rng(5).normal(size=(40, 9))
    signals = (
        Signal("b", "x", recorded[:, 4]), Signal("b", "y", recorded[:, 1:4]),
        Signal("b", "z", np.asfortranarray(recorded[:, 5:])), Signal("b", "w", recorded[::-1, 0]),
    )  # fmt: skip
    simulation = replace(make_simulation(40), signals=signals, verdicts=())
    assert_comes_back(simulation, tmp_path)


def test_a_variable_is_an_entity_with_a_column_a_scalar(
    make_simulation: MakeSimulation, tmp_path: Path
) -> None:
    simulation = make_simulation(50)
    store = Store(write_recording(simulation, tmp_path / "a.rrd"))
    for one in simulation.signals:
        np.testing.assert_array_equal(values_at(store, f"/signals/{one.block}/{one.variable}"), one.columns)
    np.testing.assert_array_equal(values_at(store, "/arms/chain/joints"), simulation.arms[0].q)
    np.testing.assert_array_equal(values_at(store, "/tolerance/meter/axis"), [[0.0035, -0.0035]] * 2)
    worst = values_at(store, "/marks/worst/meter")
    judged = np.column_stack([simulation.signals[2].values, simulation.signals[3].values])
    np.testing.assert_array_equal(worst, [[judged.min()], [judged.max()]])


def test_each_kind_says_its_own_layout(
    make_simulation: MakeSimulation, make_run: MakeRun, tmp_path: Path
) -> None:
    """An older urmpipe, which knows layouts up to 4, refuses a simulation by number and still reads a run."""
    paths = (
        write_recording(make_run(rows=5), tmp_path / "run.rrd"),
        write_recording(make_simulation(5), tmp_path / "simulation.rrd"),
    )
    assert [json.loads(Store(path).metadata)["layout_version"] for path in paths] == [4, 5]


def test_rerun_finds_nothing_wrong(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    path = write_recording(make_simulation(), tmp_path / "a.rrd")
    done = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "verify", str(path)],
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert "1 file verified without error" in done.stdout + done.stderr


def test_the_viewer_opens_at_the_worst_sample(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    simulation = make_simulation()
    path = write_recording(simulation, tmp_path / "a.rrd")
    assert opening_times([path]) == {path: 1_250_000_000}
    assert opening_time(replace(simulation, verdicts=())) == 0
    assert opening_time(make_simulation(0)) == 0
    assert opening_time(make_simulation(0, failed="gone")) == 0
    assert opening_time(make_simulation(37, failed="gone")) == 36 * 5_000_000  # where it failed


def test_what_decides_is_open_else_what_stands_last(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(5)
    others = tuple(Signal(f"b{i}", f"v{i}", np.arange(5.0)) for i in range(8))
    judged = simulation_plots(replace(simulation, signals=(*simulation.signals, *others)))
    plain = simulation_plots(replace(simulation, signals=(*simulation.signals, *others), verdicts=()))
    assert isinstance(judged, rrb.Tabs) and isinstance(plain, rrb.Tabs)
    assert [list(tabs.contents)[int(str(tabs.active_tab))].name for tabs in (judged, plain)] == [
        "meter",
        "b7",
    ]


def test_set_points_and_answers_come_first_and_are_open_where_nothing_is_judged(
    make_simulation: MakeSimulation,
) -> None:
    simulation = make_simulation(5)
    pair = [Signal(block, "theta", np.arange(5.0), "rad") for block in ("set_point", "load")]
    others = [Signal(f"b{i}", f"v{i}", np.arange(5.0)) for i in range(8)]
    simulation = replace(
        simulation,
        signals=(*simulation.signals, *pair, *others),
        connections={"c.set_theta": "set_point.theta", "c.real_theta": "load.theta"},
    )
    judged, plain = simulation_plots(simulation), simulation_plots(replace(simulation, verdicts=()))
    assert isinstance(judged, rrb.Tabs) and isinstance(plain, rrb.Tabs)
    assert [list(tabs.contents)[int(str(tabs.active_tab))].name for tabs in (judged, plain)] == [
        "meter",
        "Set point and answer",
    ]
    first = next(iter(plain.contents))
    assert isinstance(first, rrb.Grid)
    (view,) = first.contents
    assert isinstance(view, rrb.TimeSeriesView)
    assert view.name == "Set point and answer: theta [rad]"
    assert list(view.visualizer_overrides) == ["/signals/set_point/theta", "/signals/load/theta"]


def test_set_points_of_a_long_simulation_look_alike_in_overview_and_in_full(
    make_simulation: MakeSimulation,
) -> None:
    pair = tuple(Signal(block, "theta", np.zeros(LONG + 1), "rad") for block in ("set_point", "load"))
    group = Group("Set point and answer", "rad", pair, family=True, wanted=1)
    views = Plots(make_simulation(5)).signals(group, {one.name: f"/{one.block}" for one in pair}, LONG + 1)
    assert [list(view.visualizer_overrides) for view in views] == [
        ["/overview/set_point", "/overview/load"],
        ["/set_point", "/load"],
    ]


def test_words_stand_above_the_arm_and_else_beside_the_plots(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(5)
    for one, left in ((simulation, rrb.Vertical), (replace(simulation, arms=()), rrb.Tabs)):
        root = viewer_layout(one, scene_of(one)).root_container
        assert isinstance(root, rrb.Horizontal)
        assert isinstance(next(iter(root.contents)), left)


def test_the_first_arm_moves_and_the_tip_of_each_has_a_path(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation()
    arms = (*simulation.arms, replace(simulation.arms[0], block="second"))
    scene = scene_of(replace(simulation, arms=arms))
    assert scene.arm is not None
    np.testing.assert_allclose(
        scene.arm.skeleton[:, -1],
        simulation.signal("chain.p7").values[scene.arm.sample],
        rtol=0.0,
        atol=1e-12,  # two orders of summing the same seven segments
    )
    assert [way.path for way in scene.ways] == ["/path/chain", "/path/second"]
    assert [way.label for way in scene.ways] == ["chain", "second"]
    assert scene_of(replace(simulation, arms=())).empty


def test_the_summary_says_how_it_ended_and_what_is_joined(make_simulation: MakeSimulation) -> None:
    found = simulation_summary(make_simulation(tolerance=0.005)).splitlines()
    assert found[0] == "### PASS: meter of log\\-to\\-delta within tolerance"
    assert (
        "- **PASS** meter: \\|Δy\\| = 4.0000 mm of 5 mm allowed (80.0 % of the tolerance) at t = 1.250 s;"
        " out of tolerance: 0 of 600 samples (0 %)" in found
    )
    assert "600 samples, 2.995 s, communication step 5 ms." in found
    assert "| chain | unit kinematic\\_chain |" in found
    assert "| chain.phi | log.q |" in found
    failed = simulation_summary(make_simulation(10, failed="meter: <b>gone</b>")).splitlines()
    assert failed[0] == "### FAILED: log\\-to\\-delta did not reach its end"
    assert "**meter: \\<b\\>gone\\</b\\>** What was recorded until then is here." in failed


def test_a_simulation_is_nothing_to_compare(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    path = write_recording(make_simulation(5), tmp_path / "a.rrd")
    with pytest.raises(RecordingError) as caught:
        load_runs([path])
    assert str(caught.value) == f"{path}: {SIMULATION}"
    assert load_comparison(path) is None


ODD = (
    "a b", "a ", "a", " a", " ", "", "a/b", "a/", "/", "a%2Fb", "\\", "a\\", "a\\/b", "a\\ ", "..", "/**",
    "a.b", "x[1]", "<b>", "a\n", "a\tb", "a\0", "a\u00a0", "\u202e", "\ud800", "\ud801", "?", "A", "$",
)  # fmt: skip


def test_odd_names_are_entities_of_their_own(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    """Also those that are one to Rerun, which drops a blank or a backslash at the end."""
    simulation = make_simulation(3)
    pairs = [pair for name in ODD for pair in ((name, "v"), ("b", name), (name, f"{name}2"))]
    signals = [Signal(*pair, np.arange(3.0) + i) for i, pair in enumerate(pairs)]
    arms = tuple(
        replace(simulation.arms[0], block=name, q=simulation.arms[0].q + i) for i, name in enumerate(ODD)
    )
    assert_comes_back(replace(simulation, signals=tuple(signals), arms=arms, verdicts=()), tmp_path)


NAMES = st.text(st.characters(exclude_categories=[]), max_size=8)
NUMBERS = st.floats(allow_nan=False)


@st.composite
def simulations(draw: st.DrawFn) -> Simulation:
    """Draw a simulation with any names, any values, and any number of samples."""
    samples = draw(st.integers(0, 4))
    names = draw(st.lists(st.tuples(NAMES, NAMES), max_size=4, unique_by=".".join))
    signals = [
        Signal(
            block, variable,
            draw(arrays(np.float64, draw(st.sampled_from([(samples,), (samples, 1), (samples, 3)])))),
            draw(NAMES), draw(NAMES), draw(st.sampled_from(["Real", "Integer", "Boolean"])), draw(NAMES),
        )
        for block, variable in names
    ]  # fmt: skip
    every = [name for one in signals for name in {one.name, *one.names}]
    verdict = DeltaVerdict(
        draw(NAMES), tuple(draw(st.lists(NAMES, max_size=2))), {"axis": draw(st.floats(0.0, 1e300))}, "x",
        draw(st.floats()), 0.0, 0, 3, 1, "fail",
    )  # fmt: skip
    block = SimulatedBlock(
        draw(NAMES), "fmu", draw(NAMES), draw(NAMES), (Setting(draw(NAMES), draw(NUMBERS)),)
    )
    times = draw(st.sets(st.integers(0, 10**15), min_size=samples, max_size=samples))
    return Simulation(
        name=draw(NAMES), description=draw(NAMES),
        t_ns=np.array(sorted(times), np.int64),
        step=draw(NUMBERS), signals=tuple(signals) if len(set(every)) == len(every) else (),
        system_svg=draw(NAMES), system_text=draw(NAMES), blocks=(block,),
        failed=draw(st.none() | NAMES), warnings=(LogWarning(draw(NAMES), draw(NAMES), None),),
        provenance=Provenance("simulate", {}, (SourceFile(draw(NAMES), draw(NAMES), 1),), {}, draw(NAMES)),
        connections=draw(st.dictionaries(NAMES, NAMES, max_size=3)),
        verdicts=(verdict,) if samples else (),
    )  # fmt: skip


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(simulation=simulations())
def test_any_simulation_comes_back_as_it_was(simulation: Simulation, tmp_path: Path) -> None:
    path = tmp_path / "any.rrd"
    assert_same(read_recording(write_recording(simulation, path)), simulation)
