"""Still poses are told from motions by steps that no joint makes, in no direction; their clock is a label."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from asserting import INCREASE
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import OptionError
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import RotationForm, to_quaternions
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.joint_log import ROW_NS, JointLog
from urmpipe_pipeline.logs import LogMap, format_map, map_of, read_log, read_map

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]
Write = Callable[..., Path]

JOINTS = tuple(f"q{k}" for k in range(1, 7))
LEAST = 12
"""Rows of random configurations that are told for sure."""


def table(q: FloatArray, clock: object = None, names: tuple[str, ...] = JOINTS, **more: FloatArray) -> str:
    """Return a CSV of joints, with a clock before them and other columns behind."""
    heads = [*(["time"] if clock is not None else []), *names[: q.shape[1]], *more]
    columns = [*([list(clock)] if clock is not None else []), *q.T.tolist(), *more.values()]  # type: ignore[call-overload]
    rows = [",".join(map(str, row)) for row in zip(*columns, strict=True)]
    return "\n".join([",".join(heads), *rows, ""])


def random_poses(rows: int, seed: int = 1, reach: float = 3.0) -> FloatArray:
    return np.random.default_rng(seed).uniform(-reach, reach, (rows, 6))


def grid() -> FloatArray:
    """A calibration grid: a wrist turns by 10 degrees from pose to pose, then the arm goes elsewhere."""
    places = np.random.default_rng(2).uniform(-1.5, 1.5, (12, 6))
    q = np.repeat(places, 6, axis=0)
    q[:, 5] += np.tile(np.radians(10.0) * np.arange(6), 12)
    return q


def smooth(rows: int, shortest: float, seed: int = 3, size: float = 1.5) -> FloatArray:
    """Joints that swing with so many samples in their shortest period."""
    rng = np.random.default_rng(seed)
    rates = 2 * np.pi / (shortest * rng.uniform(1.0, 6.0, (3, 6)))
    phases, sizes = rng.uniform(0, 2 * np.pi, (3, 6)), rng.uniform(0.2, size, (3, 6))
    at = np.arange(rows)[:, None, None]
    return np.asarray((sizes * np.sin(rates * at + phases)).sum(axis=1))


def dates(steps: list[float]) -> list[str]:
    """A clock of dates in whole seconds, digits alone."""
    first = datetime(2020, 7, 14, 16, 39, 4)
    return [f"{first + timedelta(seconds=float(at)):%Y%m%d%H%M%S}" for at in np.cumsum([0.0, *steps])]


def rows_said(log: JointLog) -> str:
    return next((one.evidence for one in log.inferences if one.what == "rows"), "")


SECONDS_APART = 20 * [7.0, 9.0, 6.0]
STEPS = {
    "dates that run backwards now and then": dates([*SECONDS_APART, -200.0, *SECONDS_APART[:10]]),
    "seconds apart": np.cumsum([0.0, *SECONDS_APART, *SECONDS_APART[:11]]).tolist(),
    "whole seconds that repeat": (np.arange(72) // 3).tolist()[::-1],
    "numbers in no order": np.random.default_rng(4).permutation(72).tolist(),
}


@pytest.mark.parametrize("clock", [None, *STEPS.values()], ids=["no clock", *STEPS])
@pytest.mark.parametrize("q", [grid(), random_poses(72)], ids=["grid", "random"])
def test_poses_with_a_label_for_a_clock_are_poses(read: Read, q: FloatArray, clock: list[float]) -> None:
    log = read(table(q, clock), unit="rad")
    assert not log.timed and not log.warnings
    assert log.t_ns.tolist() == [k * ROW_NS for k in range(72)]
    np.testing.assert_array_equal(log.q, q)
    assert {column.role for column in log.columns} == {"joint"}
    assert (log.period, log.clock_start_ns) == (0.0, 0)


def test_the_evidence_and_what_reads_the_rows_as_a_motion_are_told(read: Read) -> None:
    q = random_poses(18)
    q[:2, 0] = (-1.5, 1.5)
    for clock, why, otherwise in (
        (None, "no clock, and {}", "--period SECONDS reads them as a motion"),
        (
            STEPS["seconds apart"][:18],
            "{}, and time says that 7 s pass",
            "--time time reads them as a motion",
        ),
    ):
        log = read(table(q, clock), unit="rad")
        (found,) = (one for one in log.inferences if one.what == "rows")
        steps = np.abs(np.remainder(np.diff(q[:-1], axis=0) + np.pi, 2 * np.pi) - np.pi).max()
        said = f"the joints step by up to {steps:.2g} rad from row to row, in no direction"
        assert (found.value, found.evidence) == ("static poses", why.format(said))
        assert found.alternatives() == otherwise
    assert read(table(q), unit="rad", period=0.01).timed
    assert read(table(q, STEPS["seconds apart"][:18]), unit="rad", time="time").timed


@pytest.mark.filterwarnings("error")
def test_a_pose_that_was_written_twice_at_once_changes_nothing(read: Read) -> None:
    rows = [*range(40), *range(39, 72)]
    assert not read(table(random_poses(72)[rows], [7.5 * row for row in rows])).timed


def test_waypoints_in_degrees_are_poses(read: Read) -> None:
    q: FloatArray = np.degrees(random_poses(20)).round(2)
    log = read(table(q), unit="deg")
    assert not log.timed
    np.testing.assert_allclose(log.q, np.radians(q), rtol=0, atol=1e-12)


def with_spikes(q: FloatArray) -> FloatArray:
    q = q.copy()
    q[7::40] += 2.0
    return q


MOTIONS = {
    "coarse, half a second apart": (smooth(60, 12.0), (0.5 * np.arange(60)).tolist()),
    "coarse, without a clock": (smooth(60, 12.0), None),
    "a clock in minutes of a slow motion": (smooth(60, 12.0), (60.0 * np.arange(60)).tolist()),
    "spikes": (with_spikes(smooth(400, 200.0)), None),
    "wraps, no clock": (
        np.remainder(np.arange(200.0)[:, None] * 0.12 + np.arange(6), 2 * np.pi) - np.pi,
        None,
    ),
    "two rows": (random_poses(2), None),
    "noise at rest": (0.02 * np.random.default_rng(5).normal(size=(300, 6)), None),
    "ten rows at 125 Hz": (smooth(10, 500.0), (0.008 * np.arange(10)).tolist()),
    "a path of waypoints": (smooth(20, 14.0), None),
    "random, every 0.1 s": (random_poses(40), (0.1 * np.arange(40)).tolist()),
}


@pytest.mark.parametrize(("q", "clock"), MOTIONS.values(), ids=MOTIONS)
def test_motions_stay_motions(read: Read, q: FloatArray, clock: list[float] | None) -> None:
    log = read(table(q, clock), unit={"": "rad"} if clock is None else {"": "rad", "time": "s"})
    assert log.timed and not rows_said(log)


def test_a_damaged_clock_of_a_motion_is_still_an_error(wrong: Wrong) -> None:
    times = [f"{0.01 * k:.2f}" for k in range(300)]
    times[100] = "0.5"
    (said,) = wrong(table(smooth(300, 150.0), times), unit={"": "rad", "time": "s"})
    assert said == f"log.csv:102, column time: found 0.5 s after 0.99 s, {INCREASE}"


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32), rows=st.integers(3, 300), shortest=st.floats(10.0, 400.0))
@example(seed=0, rows=300, shortest=10.0)
def test_smooth_motions_are_never_poses(
    tmp_path_factory: pytest.TempPathFactory, seed: int, rows: int, shortest: float
) -> None:
    path = tmp_path_factory.mktemp("motion") / "log.csv"
    wrapped = np.remainder(smooth(rows, shortest, seed, 3.0) + np.pi, 2 * np.pi) - np.pi
    path.write_text(table(wrapped))
    assert read_log([path], LogMap(unit={"": "rad"})).timed


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32), rows=st.integers(LEAST, 300), reach=st.floats(0.5, 6.2))
def test_random_configurations_always_are(
    tmp_path_factory: pytest.TempPathFactory, seed: int, rows: int, reach: float
) -> None:
    path = tmp_path_factory.mktemp("poses") / "log.csv"
    path.write_text(table(random_poses(rows, seed, reach)))
    assert not read_log([path], LogMap(unit={"": "rad"})).timed


def test_who_says_poses_gets_them(read: Read) -> None:
    q = smooth(30, 200.0)
    log = read(table(q, [f"P{k}" for k in range(30)]), unit="rad", poses=True, time="time")
    assert not log.timed
    assert rows_said(log) == "given as an option"
    assert not [one for one in log.inferences if one.what == "period"]


def test_a_raster_that_begins_anew_has_no_wraps(read: Read) -> None:
    q = np.degrees(random_poses(100))
    q[:, 5] = np.tile(np.arange(-3.0, 3.1, 0.25), 4)
    in_deg = tuple(f"{name} [deg]" for name in JOINTS)
    assert set(read(table(q, names=in_deg), poses=True).units.values()) == {"deg"}


def test_a_date_of_digits_alone_is_read_as_one(read: Read) -> None:
    log = read(table(smooth(40, 30.0), [f"{one}.5" for one in dates(39 * [1.0])]), unit="rad")
    assert log.timed
    assert log.t_ns[:3].tolist() == [0, 10**9, 2 * 10**9]
    assert log.units["time"] == "date"
    assert log.clock_start_ns == 1594744744_500_000_000


def test_a_map_reads_poses_as_they_were_read(write: Write, tmp_path: Path) -> None:
    for clock in (None, STEPS["seconds apart"][:18]):
        path, lab = write(table(random_poses(18), clock)), tmp_path / "lab.toml"
        log = read_log([path], LogMap(unit={"": "rad"}))
        lab.write_text(format_map(map_of(log)))
        again = read_log([path], read_map(lab))
        assert not again.timed
        np.testing.assert_array_equal(again.q, log.q)


# Measured from outside


def measured(
    form: RotationForm = "xyz", unit: float = 1.0, turn: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """Joints of a UR10, and the pose of a probe on it that a device measured in a frame of its own."""
    from scipy.spatial.transform import Rotation

    q = random_poses(40, 6, 1.5)
    position, rotation = poses_over_log(load_robot("ur10"), q)
    base, tool = Rotation.from_rotvec([0.4, -0.9, 2.2]), Rotation.from_rotvec([1.2, 0.3, -0.5])
    where = base.apply(position + rotation @ np.array([0.02, -0.05, 0.12])) + np.array([2.3, -1.4, 0.1])
    turned = base * Rotation.from_matrix(rotation) * tool
    numbers = {"xyz": turned.as_euler("XYZ"), "rpy": turned.as_euler("xyz"), "vector": turned.as_rotvec()}
    return q, np.column_stack((where / unit, numbers[form] / turn))


DEG = np.pi / 180.0


@pytest.mark.slow
@pytest.mark.parametrize("form", ["xyz", "rpy", "vector"])
@pytest.mark.parametrize(("unit", "turn"), [(1e-3, DEG), (1.0, 1.0), (1e-2, DEG)], ids=["mm deg", "m", "cm"])
def test_units_and_form_of_a_measured_tool_are_told_by_the_joints(
    read: Read, form: RotationForm, unit: float, turn: float
) -> None:
    q, pose = measured(form, unit, turn)
    heads = [f"measurement_{name}" for name in ("x", "y", "z", "rx", "ry", "rz")]
    in_rad = tuple(f"{name} [rad]" for name in JOINTS)
    text = table(q, names=in_rad, **dict(zip(heads, pose.T, strict=True)))
    log = read(text, load_robot("ur10"))
    assert log.externally_measured and not log.timed and not log.warnings
    assert log.tcp_position is not None and log.tcp_rotation is not None
    np.testing.assert_allclose(log.tcp_position, pose[:, :3] * unit, rtol=1e-12)
    assert log.rotation_form == form
    np.testing.assert_allclose(log.tcp_rotation, pose[:, 3:] * turn, rtol=1e-12)
    assert to_quaternions(log.tcp_rotation, form).shape == (40, 4)


@pytest.mark.parametrize(
    "names",
    [
        ("x1", "y1", "z1"),
        ("tracker_x", "tracker_y", "tracker_z"),
        ("vicon_pos_x", "vicon_pos_y", "vicon_pos_z"),
    ],
)
def test_names_of_a_tool_measured_from_outside(read: Read, names: tuple[str, ...]) -> None:
    q, pose = measured()
    log = read(table(q, **dict(zip(names, pose.T, strict=False))), load_robot("ur10"), unit="rad")
    assert log.externally_measured
    assert [column.name for column in log.columns if column.role == "position"] == list(names)


@pytest.mark.parametrize("place", ["", "pos_", "pose_position_"])
def test_an_orientation_stands_beside_the_position_of_its_device(read: Read, place: str) -> None:
    q, pose = measured("vector")
    names = [f"tracker_{place}{axis}" for axis in "xyz"] + [f"tracker_r{axis}" for axis in "xyz"]
    log = read(table(q, **dict(zip(names, pose.T, strict=True))), load_robot("ur10"), unit="rad")
    assert log.externally_measured and log.rotation_form == "vector"


def test_the_arms_own_tcp_comes_first_and_others_are_named_by_who_knows(read: Read, write: Write) -> None:
    q, pose = measured()
    own = dict(zip(("x", "y", "z"), poses_over_log(load_robot("ur10"), q)[0].T, strict=True))
    other = dict(zip(("A", "B", "C", "measurement_x", "measurement_y", "measurement_z"), pose.T, strict=True))
    text = table(q, **own, **other)
    assert not read(text, load_robot("ur10"), unit="rad").externally_measured
    given_by_name = read(text, load_robot("ur10"), unit="rad", measured=("A", "B", "C"))
    assert given_by_name.externally_measured and given_by_name.tcp_position is not None
    np.testing.assert_allclose(given_by_name.tcp_position, pose[:, :3])
    lab = write(format_map(map_of(given_by_name)), name="lab.toml")
    assert read_map(lab).measured == ("A", "B", "C")
    with pytest.raises(OptionError) as error:
        read(text, measured=("A", "B"))
    allowed = "x, y, z, and 3, 4 or 9 of the orientation behind them, or none"
    assert str(error.value) == f"measured (--measured): found 2 columns, allowed: {allowed}"
