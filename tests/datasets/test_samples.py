"""The shipped sample data are what their README says: read here with the csv module alone."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from urmpipe_models.arm.denavit_hartenberg import urm_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import jacobian_over_log, positions_over_log

ROOT = Path(__file__).resolve().parents[2]
LOGS = ROOT / "datasets" / "urmpipe_datasets" / "logs"

URM6 = urm_chain("urm6", [0.243215, *[0.212430] * 5, 0.042215], [math.radians(52.0)] * 6)
CALIBRATION = np.array([0.0, np.pi, 0.0, np.pi, 0.0, np.pi])
TIMES: FloatArray = 0.005 * np.arange(7383, dtype=np.float64)
TOLERANCE = 0.0035

FOLLOWERS = ["coppeliasim", "matlab", "solidworks"]
ENVIRONMENTS = [*FOLLOWERS, "counter_rotating"]


def rows_of(file: str, delimiter: str = ",") -> list[list[str]]:
    with (LOGS / file).open(encoding="utf-8", newline="") as lines:
        return list(csv.reader(lines, delimiter=delimiter))


def numbers(rows: list[list[str]]) -> FloatArray:
    return np.array([[float(cell.replace(",", ".")) for cell in row] for row in rows])


def path_and_times() -> tuple[FloatArray, FloatArray]:
    values = numbers(rows_of("path.csv")[1:])
    return values[:, 1:], values[:, 0]


def joints_and_times(name: str) -> tuple[FloatArray, FloatArray]:
    """Return angles in rad as they stand in the file, shape (n, 6), and times in s."""
    if name == "coppeliasim":
        values = numbers(rows_of("coppeliasim.csv")[2:-1])
    elif name == "solidworks":
        plots = [numbers(rows_of(f"solidworks/phi{k}.csv", ";")[1:]) for k in range(1, 7)]
        assert all(np.array_equal(plot[:, 0], plots[0][:, 0]) for plot in plots)
        return np.deg2rad(np.column_stack([plot[:, 1] for plot in plots])), plots[0][:, 0]
    else:
        values = numbers(rows_of(f"{name}.csv")[1:])
    return values[:, 1:], values[:, 0]


def delta(name: str) -> FloatArray:
    """Return path - p7(phi) in m, shape (n, 3). Source: [UrmArm2021]_ eq. 19-21."""
    return path_and_times()[0] - positions_over_log(URM6, joints_and_times(name)[0])


def speed_of_path() -> FloatArray:
    return np.asarray(np.linalg.norm(np.gradient(path_and_times()[0], 0.005, axis=0), axis=1))


def breaks() -> NDArray[np.int64]:
    """Return the samples between the ends where the path rests: where its speed is least and next to zero."""
    speed = speed_of_path()
    inner = np.arange(200, len(speed) - 200)  # the first and the last second belong to the ends
    low = inner[speed[inner] < 1e-3]
    groups = np.split(low, np.flatnonzero(np.diff(low) > 1) + 1)
    return np.array([group[np.argmin(speed[group])] for group in groups if len(group)])


def test_path_header() -> None:
    assert rows_of("path.csv")[0] == ["t", "x", "y", "z"]


def test_path_has_7383_samples_at_5_ms() -> None:
    position, t = path_and_times()
    assert position.shape == (7383, 3)
    assert t[-1] == 36.910
    np.testing.assert_allclose(t, TIMES, rtol=0, atol=1e-12)  # decimal figures against products: 1 ulp of 37


def test_path_starts_in_the_calibration_pose() -> None:
    # 1e-9 m: the path is written to the nanometre
    np.testing.assert_allclose(
        path_and_times()[0][0], positions_over_log(URM6, CALIBRATION[None])[0], rtol=0, atol=1e-9
    )


def test_path_is_long_and_fast_enough() -> None:
    position, _ = path_and_times()
    assert np.linalg.norm(np.diff(position, axis=0), axis=1).sum() > 10.0
    assert 0.55 < speed_of_path().max() < 0.6


def test_path_rests_at_its_ends_and_its_acceleration_is_bounded() -> None:
    position, _ = path_and_times()
    speed = speed_of_path()
    acceleration = np.diff(position, 2, axis=0) / 0.005**2
    assert speed[0] < 1e-5  # m/s: a nanometre in 5 ms is 2e-7
    assert speed[-1] < 1e-5
    assert np.linalg.norm(acceleration, axis=1).max() < 4.0  # m/s2, measured 2.2 in the crown's waves


def test_path_has_three_corners() -> None:
    position, _ = path_and_times()
    corners = breaks()
    assert len(corners) == 3
    for corner in corners:
        # half a second before and after, where the path has left the corner by a few mm
        before, after = position[corner] - position[corner - 100], position[corner + 100] - position[corner]
        cosine = before @ after / (np.linalg.norm(before) * np.linalg.norm(after))
        assert math.degrees(math.acos(cosine)) > 60.0


@pytest.mark.slow
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_logs_have_the_times_of_the_path(name: str) -> None:
    q, t = joints_and_times(name)
    assert q.shape == (7383, 6)
    assert np.array_equal(t, path_and_times()[1])


@pytest.mark.slow
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_joints_are_limited_to_half_a_turn(name: str) -> None:
    # 3.142 is pi in four digits, 4.1e-4 above it
    assert np.abs(joints_and_times(name)[0]).max() < np.pi + 4.2e-4


@pytest.mark.slow
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_joints_move_smoothly_but_for_wraps(name: str) -> None:
    q, _ = joints_and_times(name)
    step = np.diff(q, axis=0)
    step -= 2.0 * np.pi * np.round(step / (2.0 * np.pi))
    # 3 rad/s, and one unit of the fourth digit where the file has four
    assert np.abs(step).max() < 3.0 * 0.005 + (1e-3 if name == "coppeliasim" else 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_joints_wrap_both_ways_and_turn_more_than_once(name: str) -> None:
    q, _ = joints_and_times(name)
    wraps = np.round(np.diff(q, axis=0) / (2.0 * np.pi))
    turns = (q[-1] - q[0]) / (2.0 * np.pi) - wraps.sum(axis=0)
    assert np.count_nonzero(wraps) >= 5
    assert (wraps < 0).any()
    assert (wraps > 0).any()
    assert np.abs(turns).max() > 1.0
    if name in ("coppeliasim", "matlab"):
        assert np.count_nonzero(wraps.any(axis=0)) >= 3


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_joints_keep_away_from_singular_poses(name: str) -> None:
    q, _ = joints_and_times(name)
    if name == "counter_rotating":
        q = q * [1, 1, -1, 1, 1, 1]  # as seen by the structure that it was solved in
    least = np.linalg.svd(jacobian_over_log(URM6, q)[:, :3], compute_uv=False)[:, 2]
    # the calibration pose is singular and left at once; from 3 s on the arm has bent out of its plane
    assert least[600:].min() > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("name", ["coppeliasim", "matlab", "counter_rotating"])
def test_logs_start_in_the_calibration_pose(name: str) -> None:
    # half a unit of the fourth digit of 3.142
    np.testing.assert_allclose(joints_and_times(name)[0][0], CALIBRATION, rtol=0, atol=5e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", FOLLOWERS)
def test_followers_are_within_tolerance(name: str) -> None:
    assert np.abs(delta(name)).max() < TOLERANCE


def test_coppeliasim_deviates_by_more_than_its_digits() -> None:
    # the digits alone: half a unit (0.5 mrad) of six joints at 0.2 m or so, some 0.3 mm
    assert np.abs(delta("coppeliasim")).max() > 0.001


def test_matlab_deviates_with_the_speed() -> None:
    norm, speed = np.linalg.norm(delta("matlab"), axis=1), speed_of_path()
    assert np.corrcoef(norm, speed)[0, 1] > 0.99
    # 4 ms late: within 1 %, as the path bends and speeds up over 4 ms
    moving = speed > 0.1
    np.testing.assert_allclose(norm[moving], 0.004 * speed[moving], rtol=0.01)


def test_matlab_deviation_has_its_minima_at_the_breaks() -> None:
    norm = np.linalg.norm(delta("matlab"), axis=1)
    for corner in breaks():
        around = slice(corner - 400, corner + 401)
        assert norm[corner] < 1e-5
        assert abs(int(np.argmin(norm[around])) - 400) < 40  # samples: the eased corner is flat for 0.2 s
        assert norm[around].max() > 1e-3


@pytest.mark.slow
def test_solidworks_deviates_by_a_constant_shift() -> None:
    difference = delta("solidworks")
    # 1e-4 deg in a file of four decimals moves the tip by up to 2e-6 m
    np.testing.assert_allclose(difference, np.tile([0.0015, -0.0012, 0.0016], (7383, 1)), rtol=0, atol=5e-6)
    np.testing.assert_allclose(np.linalg.norm(difference, axis=1), 0.0025, rtol=0, atol=5e-6)


def test_counter_rotating_is_far_out_of_tolerance() -> None:
    difference = np.abs(delta("counter_rotating"))
    assert difference[0].max() < 1e-9
    assert (difference.max(axis=1) > TOLERANCE).mean() > 0.9
    assert difference.max() > 0.5


def test_counter_rotating_follows_the_path_in_its_own_structure() -> None:
    own = urm_chain("own", [0.243215, *[0.212430] * 5, 0.042215], [math.radians(52.0)] * 6,
                    directions=[1, 1, -1, 1, 1, 1])  # fmt: skip
    deviation = path_and_times()[0] - positions_over_log(own, joints_and_times("counter_rotating")[0])
    # the solver stops at 1 nm, and the path is written to 1 nm; next to the singular start 2e-6 m are left
    assert np.abs(deviation).max() < 4e-6
    assert np.abs(deviation[200:]).max() < 3e-9


def test_coppeliasim_format() -> None:
    lines = (LOGS / "coppeliasim.csv").read_bytes().decode("ascii").split("\n")
    assert lines[0] == "/urm6/jointGraph"
    assert lines[1] == "Time (s),phi1 (rad),phi2 (rad),phi3 (rad),phi4 (rad),phi5 (rad),phi6 (rad)"
    assert lines[2] == "0.000,0.0,+3.142e+00,0.0,+3.142e+00,0.0,+3.142e+00"
    row = re.compile(r"\d+\.\d{3}(,(0\.0|[+-]\d\.\d{3}e[+-]\d\d)){6}")
    assert all(row.fullmatch(line) for line in lines[2:-2])
    assert lines[-2:] == ["", ""]  # one blank line ends the graph


@pytest.mark.parametrize("name", ["matlab", "counter_rotating"])
def test_matlab_format(name: str) -> None:
    lines = (LOGS / f"{name}.csv").read_bytes().decode("ascii").split("\n")
    assert lines[0] == "t,q1,q2,q3,q4,q5,q6"
    assert lines[1] == "0,0,3.14159265358979,0,3.14159265358979,0,3.14159265358979"
    assert lines[2].startswith("0.005,")
    cells = [cell for line in lines[1:-1] for cell in line.split(",")]
    assert all(f"{float(cell):.15g}" == cell for cell in cells)
    assert lines[-1] == ""


@pytest.mark.parametrize("plot", range(1, 7))
def test_solidworks_format(plot: int) -> None:
    lines = (LOGS / f"solidworks/phi{plot}.csv").read_bytes().decode("ascii").split("\n")
    assert lines[0] == f"Time (sec);Angular Displacement{plot} (deg)"
    row = re.compile(r"\d+,\d{3};-?\d{1,3},\d{4}")
    assert all(row.fullmatch(line) for line in lines[1:-1])
    assert len(lines) == 7385
    assert "-0,0000" not in "\n".join(lines)


def test_files_are_small() -> None:
    sizes = [file.stat().st_size for file in LOGS.rglob("*.csv")]
    assert len(sizes) == 10
    assert max(sizes) < 1_500_000
    assert sum(sizes) < 3_500_000


@pytest.mark.slow
def test_generator_makes_what_is_shipped(monkeypatch: pytest.MonkeyPatch) -> None:
    """The whole path and each environment's first 0.25 s; `make_samples.py --check` makes it all."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    from samples import environments
    from samples.path import SamplePath

    path = SamplePath()
    # 2e-9 m: two units of the ninth decimal
    assert np.abs(path.at(TIMES) - path_and_times()[0]).max() <= 2e-9
    # rad: one unit of the file's last digit
    digits = {"coppeliasim": 1.001e-3, "matlab": 1e-8, "solidworks": 2e-6, "counter_rotating": 1e-8}
    for name, environment in environments.ENVIRONMENTS.items():
        apart = environments.follow(environment, path, samples=50) - joints_and_times(name)[0][:50]
        apart -= 2.0 * np.pi * np.round(apart / (2.0 * np.pi))
        assert np.abs(apart).max() <= digits[name], name
