"""The recording of a simulation: what is written is read back."""

from __future__ import annotations

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

from asserting import refusal
from recorded import columns
from same_results import assert_comes_back, assert_same
from urmpipe_models.errors import LogError, OptionError
from urmpipe_pipeline.comparison.verdict import DeltaMeterResult
from urmpipe_pipeline.joint_log import LogWarning, SourceFile
from urmpipe_pipeline.operands import load_comparison, load_runs
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.recording.layout import SLICE
from urmpipe_pipeline.results import read_recording, write_recording
from urmpipe_pipeline.simulations.simulation import Setting, Signal, SimulatedBlock, Simulation

MakeSimulation = Callable[..., Simulation]


@pytest.mark.parametrize(
    ("samples", "failed"),
    [
        (600, None),
        (37, "chain: fmi2DoStep returned fmi2Error: q is NaN"),
        (0, "chain: crashed"),
        (1, None),
        # Three slices, the ends and the middle sent before the others.
        pytest.param(2 * SLICE + 5, None, marks=pytest.mark.slow),
    ],
)
def test_a_simulation_comes_back_as_it_was(
    samples: int, failed: str | None, make_simulation: MakeSimulation, tmp_path: Path
) -> None:
    assert_comes_back(make_simulation(samples, failed), tmp_path)


def test_one_without_signals_keeps_its_times(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    assert_comes_back(replace(make_simulation(20), signals=(), verdicts=(), arms=()), tmp_path)


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
    path = write_recording(simulation, tmp_path / "a.rrd")
    for one in simulation.signals[:4]:
        found = np.array(columns(path, f"/signals/{one.name}/values", "Scalars:scalars"))
        np.testing.assert_array_equal(found, one.columns)


@pytest.mark.slow
def test_rerun_finds_nothing_wrong(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    path = write_recording(make_simulation(), tmp_path / "a.rrd")
    done = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "verify", str(path)],
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert "1 file verified without error" in done.stdout + done.stderr


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
    assert refusal(LogError, load_runs, [path]) == (
        f"{path}: found 2 blocks with a motion, allowed: one; use --block chain or --block log"
    )
    for blocks in (["a", "b"], ["chain", "log", "chain"]):
        refused = refusal(OptionError, load_runs, [path], block=blocks)
        assert (
            refused.startswith("block (--block): found 'a'")
            or "with 1 simulation, allowed: a block" in refused
        )
    assert load_comparison(path) is None


ODD = (
    "a b", "a ", "a", " a", " ", "", "a/b", "a/", "/", "a%2Fb", "\\", "a\\", "a\\/b", "a\\ ", "..", "/**",
    "a.b", "x[1]", "<b>", "a\n", "a\tb", "a\0", "a\u00a0", "\u202e", "\ud800", "\ud801", "?", "A", "$",
)  # fmt: skip


@pytest.mark.slow
def test_odd_names_are_entities_of_their_own(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    """Also those that are one to Rerun, which drops a blank or a backslash at the end."""
    simulation = make_simulation(3)
    pairs = [pair for name in ODD for pair in ((name, "v"), ("b", name), (name, f"{name}2"))]
    signals = [Signal(*pair, np.arange(3.0) + i) for i, pair in enumerate(pairs)]
    arms = tuple(
        replace(simulation.arms[0], block=name, q=simulation.arms[0].q + i) for i, name in enumerate(ODD)
    )
    assert_comes_back(replace(simulation, signals=tuple(signals), arms=arms, verdicts=()), tmp_path)


def test_an_odd_unit_comes_back(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    signals = (Signal("b", "v", np.arange(3.0), "\ud800"),)
    assert_comes_back(replace(make_simulation(3), signals=signals, verdicts=()), tmp_path)


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
    verdict = DeltaMeterResult(
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


@pytest.mark.slow
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(simulation=simulations())
def test_any_simulation_comes_back_as_it_was(simulation: Simulation, tmp_path: Path) -> None:
    path = tmp_path / "any.rrd"
    assert_same(read_recording(write_recording(simulation, path)), simulation)
