"""A simulation as other tools read it: every signal with its unit, the tips of its arms as trajectories."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from pyarrow.csv import read_csv
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

from asserting import refusal
from exported import export_result
from urmpipe_models.errors import OptionError, RecordingError
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_pipeline.simulations.simulation import Simulation
from urmpipe_pipeline.tables import ExportOptions, Format

MakeSimulation = Callable[..., Simulation]

NAMES = [
    *(f"log.q[{k}] [rad]" for k in range(1, 7)), *(f"chain.p7[{k}] [m]" for k in (1, 2, 3)),
    *(f"meter.delta[{k}] [m]" for k in (1, 2, 3)), "meter.norm [m]", "meter.out_of_tolerance",
]  # fmt: skip


def every_value(simulation: Simulation) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    return np.column_stack([one.columns for one in simulation.signals])


def test_a_csv_has_every_double_under_its_name_and_unit(
    make_simulation: MakeSimulation, tmp_path: Path
) -> None:
    simulation = make_simulation(50)
    exported = export_result(simulation, tmp_path / "a.csv", ExportOptions("csv"))
    frame = read_csv(tmp_path / "a.csv").to_pandas()
    assert list(frame.columns) == ["t [s]", *NAMES]
    np.testing.assert_array_equal(frame[NAMES].to_numpy(), every_value(simulation))
    np.testing.assert_array_equal(frame["t [s]"], simulation.t)
    assert (exported.rows, exported.files[0].rows, len(exported.columns)) == ("simulated", 50, 15)
    assert exported.columns[1] == ("log.q[1] [rad]", "rad")


def test_parquet_has_every_double_its_units_and_its_origin(
    make_simulation: MakeSimulation, tmp_path: Path
) -> None:
    simulation = make_simulation(50, failed="meter: gone")
    path = tmp_path / "a.parquet"
    export_result(simulation, path, ExportOptions("parquet"))
    frame = pd.read_parquet(path)
    np.testing.assert_array_equal(frame[NAMES].to_numpy(), every_value(simulation))
    assert frame["clock [ns]"].tolist() == simulation.t_ns.tolist()
    schema = pq.read_schema(path)
    assert schema.field("meter.norm [m]").metadata == {b"unit": b"m"}
    about = json.loads(schema.metadata[b"urmpipe"])
    assert (about["failed"], about["verdict"], about["step"]) == ("meter: gone", "fail", 0.005)
    assert about["system"] == simulation.system_text
    assert about["verdicts"] == [one.to_dict() for one in simulation.verdicts]


def test_mat_has_every_double_and_the_names_of_the_columns(
    make_simulation: MakeSimulation, tmp_path: Path
) -> None:
    simulation = make_simulation(50)
    export_result(simulation, tmp_path / "a.mat", ExportOptions("mat"))
    found = loadmat(tmp_path / "a.mat", simplify_cells=True)["simulation"]
    np.testing.assert_array_equal(found["values"], every_value(simulation))
    np.testing.assert_array_equal(found["t"], simulation.t)
    assert found["names"].tolist() == NAMES
    assert found["units"][:2].tolist() == ["rad", "rad"]
    assert found["name"] == "log-to-delta"
    about = json.loads(found["metadata"])
    assert (about["system"], about["failed"]) == (simulation.system_text, None)


def test_a_system_file_in_any_letters_leaves_too(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    simulation = replace(make_simulation(5), system_text="# \N{ROBOT FACE} \u0394\n", failed="\N{SKULL}")
    export_result(simulation, tmp_path / "a.mat", ExportOptions("mat"))
    about = json.loads(loadmat(tmp_path / "a.mat", simplify_cells=True)["simulation"]["metadata"])
    assert (about["system"], about["failed"]) == (simulation.system_text, simulation.failed)


@pytest.mark.parametrize("to", ["csv", "parquet", "mat"])
@pytest.mark.parametrize("signals", [True, False])
def test_one_without_samples_or_signals_leaves_too(
    make_simulation: MakeSimulation, tmp_path: Path, to: Format, signals: bool
) -> None:
    simulation = make_simulation(0 if signals else 4)
    if not signals:
        simulation = replace(simulation, signals=())
    exported = export_result(simulation, tmp_path / f"a.{to}", ExportOptions(to))
    assert exported.files[0].rows == (0 if signals else 4)


def test_an_arm_leaves_as_a_trajectory(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    simulation = make_simulation(50)
    q = simulation.arms[0].q.copy()
    q[7, 3] = np.nan
    arm = replace(simulation.arms[0], q=q)
    found = export_result(replace(simulation, arms=(arm,)), tmp_path / "a.tum", ExportOptions("tum"))
    rows = np.loadtxt(tmp_path / "a.tum")
    there = np.delete(np.arange(50), 7)
    position, rotation = poses_over_log(arm.chain, q[there])
    np.testing.assert_array_equal(rows[:, 1:4], position)
    np.testing.assert_allclose(
        Rotation.from_quat(rows[:, 4:]).as_matrix(), rotation, rtol=0.0, atol=1e-14
    )  # rounding
    assert (found.left_out, [one.kind for one in found.warnings]) == (1, ["left-out"])


def test_each_of_two_arms_leaves_in_its_own_file(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    simulation = make_simulation(5)
    arms = (*simulation.arms, replace(simulation.arms[0], block="second/arm"))
    found = export_result(replace(simulation, arms=arms), tmp_path / "a.tum", ExportOptions("tum"))
    assert [one.path.name for one in found.files] == ["a-chain.tum", "a-second_arm.tum"]


def test_without_an_arm_there_is_no_trajectory(make_simulation: MakeSimulation, tmp_path: Path) -> None:
    simulation = replace(make_simulation(5), arms=())
    assert refusal(RecordingError, export_result, simulation, tmp_path / "a.tum", ExportOptions("tum")) == (
        "log-to-delta: no block of kinematics, so no pose; --to csv writes its signals"
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (ExportOptions("csv", "file"), "rows (--rows): found file with a simulation, allowed: simulated"),
        (
            ExportOptions("tum", tcp="recorded"),
            "tcp (--tcp): found recorded with a simulation, allowed: none",
        ),
    ],
)
def test_what_only_a_run_has_is_refused(
    make_simulation: MakeSimulation, tmp_path: Path, options: ExportOptions, message: str
) -> None:
    assert refusal(OptionError, export_result, make_simulation(5), tmp_path / "a", options) == message
