"""A joint log that urmpipe writes is one that urmpipe, and anybody else, reads as it was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import LogError, OutputError
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.outputs import safe_output
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.tables.csv_files import write_joint_log

STEP = 5_000_000


def chain_of(*joints: tuple[str, str]) -> Chain:
    """Return an arm of joints by name and kind."""
    return Chain("arm", tuple(Joint(name, kind=kind) for name, kind in joints))  # type: ignore[arg-type]


def motion(rows: int, joints: int) -> FloatArray:
    """Return a slow motion with all 17 digits, below 1 rad/s."""
    t = np.arange(rows)[:, None] * 5e-3
    return np.asarray(0.3 * np.sin(t * (1.0 + 0.1 * np.arange(joints)) + np.arange(joints)) / 1.1)


def write(path: Path, robot: Chain, q: FloatArray, t_ns: IntArray | None) -> int:
    """Write a joint log of a robot, its targets being the rows from 1."""
    units = ["m" if joint.kind == "prismatic" else "rad" for joint in robot.moving]
    rows = np.arange(1, len(q) + 1)
    with safe_output(path, (), "joints") as part:
        return write_joint_log(part, path, joints=robot.coordinates, units=units, q=q, row=rows, t_ns=t_ns)


def times(rows: int) -> IntArray:
    return np.arange(rows, dtype=np.int64) * STEP


def written(path: Path, robot: Chain, q: FloatArray) -> Run:
    """Write a joint log with 5 ms between its rows and ingest it with its robot."""
    write(path, robot, q, times(len(q)))
    return ingest_log([path], robot=robot)


GANTRY = chain_of(("rail", "prismatic"), ("lift [z]", "prismatic"), ("turn", "revolute"))
ODD = chain_of(('the "big", one', "revolute"), ("schräg; °", "revolute"), ("a/b(left)", "revolute"))

CARTESIAN = chain_of(("x", "prismatic"), ("y", "prismatic"), ("z", "prismatic"), ("t", "revolute"))


@pytest.mark.parametrize(
    "robot",
    [load_robot("urm6"), load_robot("ur5e"), GANTRY, ODD, CARTESIAN],
    ids=["urm6", "ur5e", "gantry", "odd", "xyz"],
)
def test_ingest_gives_the_same_joints_bit_by_bit_without_a_warning(robot: Chain, tmp_path: Path) -> None:
    q = motion(60, len(robot.coordinates))
    run = written(tmp_path / "solved.csv", robot, q)
    assert run.q.tolist() == q.tolist()
    assert run.log.q.tolist() == q.tolist()
    assert run.t_ns.tolist() == times(60).tolist()
    units = ["m" if joint.kind == "prismatic" else "rad" for joint in robot.moving]
    assert [run.log.units[name] for name in run.log.joints] == units
    assert [warning.message for warning in run.warnings] == []


def test_without_a_robot_the_names_and_units_of_the_header_are_enough(tmp_path: Path) -> None:
    robot = load_robot("urm6")
    q = motion(60, 6)
    write(tmp_path / "solved.csv", robot, q, times(60))
    log = read_log([tmp_path / "solved.csv"])
    assert log.joints == robot.coordinates
    assert log.q.tolist() == q.tolist()
    assert list(log.warnings) == []


def test_the_file_is_a_plain_table_for_pandas(tmp_path: Path) -> None:
    robot = chain_of(("q1", "revolute"), ("q2", "prismatic"))
    q = np.array(
        [[-9.5, -1 / 3], [np.nan, np.nan], [np.pi, 1e-17]]
    )  # joints are neither wrapped nor unwrapped
    assert write(tmp_path / "solved.csv", robot, q, times(3)) == 2
    text = (tmp_path / "solved.csv").read_text(encoding="utf-8")
    assert text.splitlines() == [
        "t (s),q1 (rad),q2 (m),urmpipe_target_row",
        "0.00,-9.5,-0.3333333333333333,1",
        "0.01,3.141592653589793,1e-17,3",
    ]
    frame = pd.read_csv(tmp_path / "solved.csv")
    assert frame["q2 (m)"].tolist() == [-1 / 3, 1e-17]
    assert frame["urmpipe_target_row"].tolist() == [1, 3]


def test_without_times_there_is_no_time(tmp_path: Path) -> None:
    robot = load_robot("urm6")
    q = motion(20, 6)
    write(tmp_path / "solved.csv", robot, q, None)
    run = ingest_log([tmp_path / "solved.csv"], robot=robot, read=LogMap(period=0.005))
    assert run.log.q.tolist() == q.tolist()
    assert list(run.warnings) == []


def test_the_clock_of_the_file_stays_exact(tmp_path: Path) -> None:
    robot = load_robot("urm6")
    start = 1_618_179_441_573_641_234
    write(tmp_path / "solved.csv", robot, motion(20, 6), start + times(20))
    log = read_log([tmp_path / "solved.csv"])
    assert (log.clock_start_ns, log.t_ns.tolist()) == (start, times(20).tolist())


def test_ingest_bridges_a_row_that_is_left_out_and_leaves_a_longer_gap_open(tmp_path: Path) -> None:
    """As of any log: up to three periods are interpolated, with the warning that the grid does so."""
    robot = load_robot("urm6")
    q = motion(60, 6)
    short, long = q.copy(), q.copy()
    short[20] = np.nan
    long[20:30] = np.nan
    bridged = written(tmp_path / "short.csv", robot, short)
    assert [warning.kind for warning in bridged.warnings] == ["resampled"]
    kept = np.delete(np.arange(60), 20)
    assert bridged.q[kept].tolist() == q[kept].tolist()
    # By a straight line over 10 ms: off by q'' dt^2 / 2 <= 0.3 / 1.1 1.5^2 (5 ms)^2 / 2.
    np.testing.assert_allclose(bridged.q[20], q[20], rtol=0, atol=8e-6)
    open_ = written(tmp_path / "long.csv", robot, long)
    assert [(warning.kind, warning.row) for warning in open_.warnings if warning.kind == "gap"] == [
        ("gap", 21)
    ]
    assert np.isnan(open_.q[20:30]).all()
    assert open_.q[30:].tolist() == q[30:].tolist()


def test_a_log_without_any_row_is_refused(tmp_path: Path) -> None:
    with pytest.raises(OutputError) as caught:
        write(tmp_path / "none.csv", load_robot("urm6"), np.full((3, 6), np.nan), times(3))
    said = "found no joint values for any of 3 targets, allowed: at least one for a log"
    assert [finding.message for finding in caught.value.findings] == [said]
    assert list(tmp_path.iterdir()) == []


finite = st.floats(-1e3, 1e3, allow_subnormal=True)


@pytest.mark.slow
@given(values=st.lists(st.tuples(finite, finite), min_size=1, max_size=8))
def test_every_double_comes_back(
    values: list[tuple[float, float]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("joints") / "solved.csv"
    robot = chain_of(("q1", "prismatic"), ("q2", "prismatic"))
    q = np.array(values)
    write(path, robot, q, times(len(q)))
    log = read_log([path], robot=robot)
    assert log.q.tobytes() == q.tobytes()
    assert log.t_ns.tolist() == times(len(q)).tolist()


def test_the_rows_of_the_targets_are_never_taken_for_a_joint(tmp_path: Path) -> None:
    """As many columns as the robot has joints are taken where names tell nothing."""
    path = tmp_path / "solved.csv"
    write(path, chain_of(("pan", "revolute"), ("lift", "revolute")), motion(20, 2), times(20))
    log = read_log([path], robot=chain_of(("base", "revolute"), ("arm", "revolute")))
    assert log.q.tolist() == motion(20, 2).tolist()
    with pytest.raises(LogError, match="allowed: 3"):
        read_log([path], robot=chain_of(("base", "revolute"), ("arm", "revolute"), ("hand", "revolute")))
