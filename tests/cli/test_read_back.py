"""What urmpipe writes comes back without options: recordings, trajectories, joint logs and signals."""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urmpipe
from asserting import there
from same_results import assert_same
from urmpipe_datasets import LOGS
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import to_quaternions
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.simulations.simulation import Simulation

ROWS = 120
CUBE = "cube:wall,a=0.2,r=0.02,x=1.7,y=0,z=1"

ROBOTS = [None, "ur5e", "iiwa14"]  # of 6 and 7 joints: a path has none, whatever is given


def write_log(path: Path, t: FloatArray) -> Path:
    """Write a log of urm6 with a recorded TCP, at times in [s], shape (n,)."""
    q = 0.8 * np.sin(3.0 * t)[:, np.newaxis] * np.linspace(0.3, 1.0, 6)
    tcp = np.column_stack((0.3 + q[:, :3], to_quaternions(q[:, 3:], "zyx")))
    names = ["t [s]", *(f"phi{k} [rad]" for k in range(1, 7)), *(f"tcp_{axis} [m]" for axis in "xyz")]
    names += ["qx", "qy", "qz", "qw"]
    rows = np.column_stack((t, q, tcp))
    np.savetxt(path, rows, "%.17g", ",", header=",".join(names), comments="")
    return path


@pytest.fixture(scope="module", params=["even", "irregular"])
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The run of a log, and its recording."""
    folder = tmp_path_factory.mktemp("run")
    t: FloatArray = np.arange(ROWS, dtype=np.float64) * 0.01
    if request.param == "irregular":
        t = np.cumsum(np.random.default_rng(1).integers(2000, 20000, ROWS)) / 1e6
    return urmpipe.ingest(write_log(folder / "log.csv", t), "urm6", output=folder / "log.rrd")


def assert_path(file: Path, t_ns: FloatArray, position: FloatArray, quat: FloatArray) -> None:
    for robot in ROBOTS:
        log = urmpipe.ingest(file, robot).log
        assert (log.joints, log.source, log.rotation_form) == ((), "path", "quat_xyzw")
        np.testing.assert_array_equal(log.t_ns, t_ns - t_ns[0])
        np.testing.assert_array_equal(log.tcp_position, position)
        np.testing.assert_array_equal(log.tcp_rotation, quat)
        assert [one for one in log.warnings if one.assumption] == []


def written(file: Path) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times in [ns], positions and quaternions of a trajectory as others read it."""
    rows = np.loadtxt(file, ndmin=2)
    return np.rint(rows[:, 0] * 1e9), rows[:, 1:4], rows[:, 4:]


@pytest.mark.slow
@pytest.mark.parametrize(("tcp", "rows"), [("fk", "grid"), ("fk", "file"), ("recorded", None)])
def test_a_trajectory_comes_back(run: Run, tcp: Any, rows: Any, tmp_path: Path) -> None:
    urmpipe.export(run, output=tmp_path / "a.tum", tcp=tcp, rows=rows)
    assert_path(tmp_path / "a.tum", *written(tmp_path / "a.tum"))
    if tcp == "recorded":
        log = urmpipe.ingest(tmp_path / "a.tum").log
        np.testing.assert_array_equal(log.t_ns, run.log.t_ns)
        np.testing.assert_array_equal(log.tcp_position, there(run.log.tcp_position))
        np.testing.assert_array_equal(log.tcp_rotation, there(run.log.tcp_quat_xyzw))


@pytest.mark.parametrize("rows", [1, 2, 40])
def test_still_poses_leave_and_come_back_with_a_row_a_second(rows: int, tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.csv", np.random.default_rng(2).uniform(0.0, 2.0, rows))
    run = urmpipe.ingest(log, "urm6", poses=True)
    urmpipe.export(run, output=tmp_path / "a.tum")
    times, position, quat = written(tmp_path / "a.tum")
    np.testing.assert_array_equal(times, 1e9 * np.arange(1, rows + 1))
    assert_path(tmp_path / "a.tum", times, position, quat)


@pytest.mark.slow
def test_a_recording_gives_the_run_that_it_holds(run: Run, tmp_path: Path) -> None:
    path = there(run.recording)
    for found in (urmpipe.ingest(path), urmpipe.ingest(str(path)), urmpipe.ingest([path])):
        assert_same(found, run)
    again = urmpipe.ingest(there(run.recording), output=tmp_path / "again.rrd")
    assert_same(replace(urmpipe.ingest(tmp_path / "again.rrd"), recording=None), replace(run, recording=None))
    assert again.recording == tmp_path / "again.rrd"
    other = urmpipe.ingest(there(run.recording), "ur5e")
    assert there(other.robot).name == "ur5e"
    np.testing.assert_array_equal(other.q, run.q)


@pytest.mark.slow
@pytest.mark.parametrize("timed", [True, False])
def test_solved_targets_come_back(timed: bool, tmp_path: Path) -> None:
    run = urmpipe.ingest(LOGS / "coppeliasim.csv", "urm6")
    rows = slice(0, 400, 4)
    pose = np.tile(np.eye(4), (100, 1, 1))
    pose[:, :3, 3], pose[:, :3, :3] = poses_over_log(there(run.robot), run.q[rows])
    t = run.t[rows] if timed else None
    solved = urmpipe.ik(pose, "urm6", t=t, output=tmp_path / "a.rrd")
    assert_same(replace(urmpipe.ingest(tmp_path / "a.rrd"), recording=None), solved.as_run())
    urmpipe.ik(pose, "urm6", t=t, output=tmp_path / "a.csv")
    log, own = urmpipe.ingest(tmp_path / "a.csv").log, solved.as_run().log
    assert (log.joints, log.timed) == (own.joints, timed)
    np.testing.assert_array_equal(log.q, own.q)
    np.testing.assert_array_equal(log.t_ns, own.t_ns)
    urmpipe.export(solved, output=tmp_path / "a.tum")
    assert_path(tmp_path / "a.tum", *written(tmp_path / "a.tum"))


@pytest.mark.slow
@pytest.mark.parametrize("robot", [None, "irb60"])
def test_a_plan_comes_back(robot: str | None, tmp_path: Path) -> None:
    made = {"velocity": 0.2, "acceleration": 1.0}
    plan = urmpipe.plan(CUBE, robot, output=tmp_path / "a.rrd", **made)  # type: ignore[arg-type]
    assert_same(replace(urmpipe.ingest(tmp_path / "a.rrd"), recording=None), plan.as_run())
    urmpipe.plan(CUBE, robot, output=tmp_path / "a.csv", **made)  # type: ignore[arg-type]
    log, own = urmpipe.ingest(tmp_path / "a.csv").log, plan.as_run().log
    assert log.joints == own.joints
    for name in ("t_ns", "q", "tcp_position"):
        np.testing.assert_array_equal(getattr(log, name), getattr(own, name))
    if robot:
        urmpipe.export(plan, output=tmp_path / "a.tum")
        assert_path(tmp_path / "a.tum", *written(tmp_path / "a.tum"))


SYSTEMS = {
    "log-to-delta": [[f"{block}.q[{k}]" for k in range(1, 7)] for block in ("log", "repolarizer")],
    "six-drives": [
        [f"{block}{k}.{name}" for k in range(1, 7)]
        for block, name in (("set_point", "theta"), ("drive", "theta1"), ("load", "theta"))
    ],
    "driven-arm": [],
}  # the signals of each system that may be the joints of an arm; none where it has only one such array


@pytest.fixture(scope="module", params=SYSTEMS)
def simulated(request: pytest.FixtureRequest) -> tuple[str, Simulation]:
    """A shipped system, and what a short simulation of it gave."""
    return request.param, urmpipe.simulate(request.param, duration=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("to", ["csv", "parquet", "mat"])
def test_the_signals_of_a_simulation_come_back_or_are_asked_for(
    simulated: tuple[str, Simulation], to: str, tmp_path: Path
) -> None:
    (system, simulation), file = simulated, tmp_path / f"a.{to}"
    urmpipe.export(simulation, output=file)
    frame, options = simulation.to_frame(), list[dict[str, Any]]()
    if SYSTEMS[system]:
        with pytest.raises(LogError) as asked:
            urmpipe.ingest(file)
        answers = [one.value for one in asked.value.findings[0].hints if one.value]
        assert answers == SYSTEMS[system]
        read = answers[-1:] if to == "mat" else answers  # a .mat file is read in a process of its own
        options += [{"joints": answer} for answer in read]
    for given in options or [{}]:
        log = urmpipe.ingest(file, **given).log
        assert list(log.joints) == (given.get("joints") or [f"arm.phi[{k}]" for k in range(1, 7)])
        np.testing.assert_array_equal(log.q, frame[list(log.joints)])
        np.testing.assert_array_equal(log.t_ns, simulation.t_ns)
    if not SYSTEMS[system]:
        for signal, rates in (("arm.phid", log.qd), ("arm.phidd", log.qdd)):
            np.testing.assert_array_equal(there(rates), simulation.signal(signal).values)


@pytest.mark.slow
@pytest.mark.parametrize("simulated", ["driven-arm"], indirect=True)
def test_the_tip_of_a_simulated_arm_comes_back(simulated: tuple[str, Simulation], tmp_path: Path) -> None:
    urmpipe.export(simulated[1], output=tmp_path / "a.tum")
    assert_path(tmp_path / "a.tum", *written(tmp_path / "a.tum"))


@pytest.mark.slow
def test_names_that_a_spreadsheet_would_run_leave_behind_an_apostrophe_and_come_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names = ["=q1", "-q2", "@q3", "+q4", "q5", '=HYPERLINK("http://x")']
    lines = (LOGS / "matlab.csv").read_text(encoding="utf-8").splitlines()[1:ROWS]
    with Path("=log.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerow(["t", *names])
        file.write("\n".join(lines) + "\n")
    options: Any = {"robot": "urm6", "unit": "rad"}
    log = urmpipe.ingest("=log.csv", joints=names, output="log.rrd", audit="audit.csv", **options)
    assert log.q.min() < 0.0  # whose signs are none of a text
    urmpipe.compare("=log.csv", log, joints=names, csv="statistics.csv", **options)
    urmpipe.export("log.rrd", "file.csv", rows="file")
    urmpipe.export("log.rrd", "grid.csv")
    for path in Path().glob("[!=]*.csv"):
        for cell in (cell for row in csv.reader(path.open(encoding="utf-8", newline="")) for cell in row):
            assert cell[:1] not in tuple("=+-@") or re.fullmatch(r"-[0-9.e-]+", cell), (path, cell)
    again = urmpipe.ingest("file.csv", joints=names, **options)
    np.testing.assert_array_equal(again.q, log.q)
    assert again.log.joints == log.log.joints == urmpipe.ingest("grid.csv", "urm6").log.joints
