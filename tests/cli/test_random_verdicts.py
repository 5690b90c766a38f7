"""Random logs, some of which lie about themselves: no verdict on a guess.

A log is made from arrays that are known, so is the verdict on them. What is written may lie: a unit in a
header is the other one, or there is none, or no header at all; clocks are uneven; joints wrap; rows are still
poses in random order. The verdict that comes out is the one on the true arrays, or the reading was asked for,
or the line of the verdict says what it assumes. A log that is written well is never asked about.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import urmpipe
from orientation_columns import orientation_columns
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import FORMS
from urmpipe_models.robots.catalogue import load_robot

TOLERANCE, ANGLE = 3.5e-3, np.radians(1.0)

ROBOTS = ("ur5e", "ur10", "panda", "urm6", "iiwa14")

NAMES = {
    "vector": ("rotvec_x", "rotvec_y", "rotvec_z"),
    "any": ("rx", "ry", "rz"),
    "rpy": ("roll", "pitch", "yaw"),
    "zyx": ("A", "B", "C"),
    "quat_xyzw": ("qx", "qy", "qz", "qw"),
    "quat_wxyz": ("quat_0", "quat_1", "quat_2", "quat_3"),
    "matrix": tuple(f"r{i}{j}" for i in "123" for j in "123"),
}
"""Names of the columns of an orientation; those of any are used for several forms."""


@dataclass
class Case:
    """Files, what is asked of them, and the truth.

    Attributes:
        rng: Where all that is random comes from.
        well: Whether everything is written as it is, with its unit.
        told: What was written, to be read where a case fails.
    """

    rng: np.random.Generator
    well: bool = True
    told: list[str] = field(default_factory=list)

    def one_of(self, *choices: Any) -> Any:
        """Return one of some values."""
        return choices[int(self.rng.integers(len(choices)))]

    def columns(
        self, names: Iterable[str], values: FloatArray, *units: str, factor: float = 180.0 / np.pi
    ) -> tuple[list[str], FloatArray]:
        """Return columns in either of two units; the header has it, none, or the other one."""
        k = int(self.rng.integers(2))
        true, other = units[k], units[1 - k]
        written = true if self.rng.random() < 0.6 else self.one_of("", other)
        self.well &= written == true
        self.told.append(f"{true} called {written or 'nothing'}")
        return [f"{name} [{written}]" if written else name for name in names], values * (1.0, factor)[k]


def motion(case: Case, arm: Chain, rows: int) -> tuple[FloatArray, FloatArray]:
    """Return times in [s] and joint values in [rad] of an arm that moves."""
    step, joints = case.rng.uniform(0.004, 0.02), len(arm.moving)
    even = np.full(rows - 1, step)
    t = np.cumsum([0.0, *case.one_of(even, even * case.rng.uniform(0.6, 1.4, rows - 1))])
    low, high = reach(arm)
    middle = case.rng.uniform(0.6 * low + 0.4 * high, 0.4 * low + 0.6 * high)
    size, speed = case.rng.uniform(0.3, 0.9, joints), case.rng.uniform(0.5, 1.2, joints)
    q = middle + np.minimum(size, 0.4 * (high - low)) * np.sin(
        speed * t[:, None] + case.rng.uniform(0, 6, joints)
    )
    return t, q


def reach(arm: Chain) -> tuple[FloatArray, FloatArray]:
    """Return between which values in [rad] the joints are kept."""
    low = np.array([max(joint.lower, -2.6) for joint in arm.moving])
    return low, np.array([min(joint.upper, 2.6) for joint in arm.moving])


def deviating(case: Case, values: FloatArray, small: float, large: float) -> FloatArray:
    """Return values that differ from others: by a little, in one row by much, or in all rows by much."""
    done = values + case.rng.normal(0.0, small, values.shape)
    kind = case.one_of("little", "spike", "offset")
    if kind == "spike":
        done[case.rng.integers(1, len(done) - 1), case.rng.integers(min(2, done.shape[1]))] += large
    if kind == "offset":
        done[:, 1] += large
    return done


def fails(wanted: FloatArray, done: FloatArray) -> bool:
    return bool(np.abs(wanted - done).max() > TOLERANCE)


def placed(arm: Chain, q: FloatArray) -> tuple[FloatArray, Rotation]:
    """Return positions in [m] and orientations."""
    position, rotation = poses_over_log(arm, q)
    return position, Rotation.from_matrix(rotation)


def joint_columns(case: Case, q: FloatArray, name: str = "q{}") -> tuple[list[str], FloatArray]:
    """Return the columns of joints in rad or deg, perhaps wrapped into half a turn."""
    if case.rng.random() < 0.2:
        q = (q + np.pi) % (2 * np.pi) - np.pi
    return case.columns([name.format(j + 1) for j in range(q.shape[1])], q, "rad", "deg")


def position_columns(case: Case, position: FloatArray) -> tuple[list[str], FloatArray]:
    """Return the columns of positions in m or mm."""
    return case.columns("xyz", position, "m", "mm", factor=1e3)


def rotation_columns(case: Case, turned: Rotation) -> tuple[list[str], FloatArray]:
    """Return the columns of an orientation in any form and unit."""
    form = case.one_of(*FORMS)
    case.told.append(form)
    values = orientation_columns(turned, form)
    if form == "matrix" or form.startswith("quat"):
        return list(NAMES[form]), values
    called = form if form in NAMES and case.rng.random() < 0.5 else "any"
    return case.columns(NAMES[called], values, "rad", "deg")


def write(path: Path, *groups: tuple[list[str], FloatArray], header: bool = True) -> Path:
    """Write groups of columns as one table."""
    names = [name for group, _ in groups for name in group]
    table = np.column_stack([values for _, values in groups])
    np.savetxt(path, table, "%.10g", ",", header=",".join(names) if header else "", comments="")
    return path


def clock(case: Case, t: FloatArray) -> tuple[list[str], FloatArray]:
    return [case.one_of("t [s]", "time [s]", "timestamp [s]")], np.round(t, 6)


def alone(case: Case, folder: Path, arm: Chain, *, still: bool) -> tuple[dict[str, Any], bool]:
    """A log against its own recorded tool centre point, positions and orientations."""
    if still:
        low, high = reach(arm)
        q = case.rng.uniform(low, high, (int(case.rng.integers(12, 60)), len(low)))
        times = [] if case.rng.random() < 0.5 else [clock(case, np.cumsum(case.rng.uniform(4, 30, len(q))))]
    else:
        t, q = motion(case, arm, int(case.rng.integers(80, 200)))
        times = [clock(case, t)]
    position, turned = placed(arm, q)
    recorded = deviating(case, position, 2e-4, 0.012)
    turn = case.rng.normal(0.0, 1e-4, (len(q), 3))
    if case.rng.random() < 0.3:
        turn[int(case.rng.integers(len(q)))] += 0.05
    wanted = Rotation.from_rotvec(turn) * turned
    tcp = position_columns(case, recorded), rotation_columns(case, wanted)
    log = write(folder / "log.csv", *times, joint_columns(case, q), *tcp)
    angle = float((wanted * turned.inv()).magnitude().max())
    tolerance = {"axis": TOLERANCE, "angle": ANGLE}
    return {"reference": log, "tolerance": tolerance}, fails(recorded, position) or angle > ANGLE


def against_path(case: Case, folder: Path, arm: Chain) -> tuple[dict[str, Any], bool]:
    """A log against a path."""
    t, q = motion(case, arm, int(case.rng.integers(80, 200)))
    done = deviating(case, q, 5e-5, 0.06)
    wanted = placed(arm, q)[0]
    path = write(folder / "path.csv", clock(case, t), position_columns(case, wanted))
    header = bool(case.rng.random() < 0.8)
    case.well &= header
    log = write(folder / "log.csv", clock(case, t), joint_columns(case, done), header=header)
    return {"reference": path, "logs": log}, fails(wanted, placed(arm, done)[0])


def against_log(case: Case, folder: Path, arm: Chain, *, still: bool) -> tuple[dict[str, Any], bool]:
    """A log against a log with a clock of its own."""
    low, high = reach(arm)
    if still:
        q = case.rng.uniform(low, high, (int(case.rng.integers(12, 60)), len(low)))
        done = deviating(case, q, 5e-5, 0.06)
        reference, log = (
            write(folder / name, joint_columns(case, one)) for name, one in (("a.csv", q), ("b.csv", done))
        )
        return {"reference": reference, "logs": log}, fails(placed(arm, q)[0], placed(arm, done)[0])
    t, q = motion(case, arm, int(case.rng.integers(80, 200)))
    done = deviating(case, q, 5e-5, 0.06)
    at = np.round(t + 0.3 * case.rng.random() * np.diff(t, append=t[-1]) * (np.arange(len(t)) > 0), 6)
    reference, log = (
        write(folder / name, clock(case, when), joint_columns(case, one))
        for name, when, one in (("a.csv", t, q), ("b.csv", at, done))
    )
    wanted, points = placed(arm, q)[0], placed(arm, done)[0]
    within = at <= np.round(t[-1], 6)
    between = np.column_stack([np.interp(at[within], np.round(t, 6), column) for column in wanted.T])
    return {"reference": reference, "logs": log}, fails(between, points[within])


def two_sides(case: Case, folder: Path, arm: Chain) -> tuple[dict[str, Any], bool]:
    """What was asked for against what was done, in one file."""
    t, q = motion(case, arm, int(case.rng.integers(80, 200)))
    done = deviating(case, q, 5e-5, 0.06)
    sides = case.one_of(("target", "actual"), ("desired", "actual"), ("commanded", "measured"))
    columns = [
        joint_columns(case, *one) for one in zip((q, done), (f"{w}_q_{{}}" for w in sides), strict=True)
    ]
    log = write(folder / "log.csv", clock(case, t), *columns)
    return {"reference": log, "sides": sides}, fails(placed(arm, q)[0], placed(arm, done)[0])


def made(seed: int, folder: Path) -> tuple[Case, dict[str, Any], bool]:
    """Return a random case, the call, and whether it should fail."""
    case = Case(np.random.default_rng(seed))
    arm = load_robot(case.one_of(*ROBOTS))
    kind = case.one_of("alone", "alone", "path", "log", "sides", "poses alone", "poses")
    case.told += [arm.name, kind]
    if kind.endswith("alone"):
        call, wrong = alone(case, folder, arm, still=kind != "alone")
    elif kind == "path":
        call, wrong = against_path(case, folder, arm)
    elif kind == "sides":
        call, wrong = two_sides(case, folder, arm)
    else:
        call, wrong = against_log(case, folder, arm, still=kind == "poses")
    return case, call | {"robot": arm.name}, wrong


@pytest.mark.slow
@settings(max_examples=45, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_no_verdict_on_a_guess(tmp_path_factory: pytest.TempPathFactory, seed: int) -> None:
    folder = tmp_path_factory.mktemp("case")
    case, call, wrong = made(seed, folder)
    try:
        result = urmpipe.compare(**call)
    except LogError as error:
        assert not case.well, f"asked about a log that is written well: {error}"
        return
    right = result.verdict == ("fail" if wrong else "pass")
    assert right or result.assumptions, (case.told, result.verdict, [str(one) for one in result.warnings])
