"""Logs that Python holds: arrays and tables as what `ingest`, `compare` and `diagnose` take."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from scipy.spatial.transform import Rotation

import urmpipe
from asserting import refusal, there
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.robots.catalogue import load_robot

T = np.arange(80) * 0.01
Q = 0.4 * np.sin(T[:, np.newaxis] + np.arange(6))
NAMES = ["t [s]", *(f"q{k} [rad]" for k in range(1, 7))]
FRAME = pd.DataFrame(np.column_stack([T, Q]), columns=NAMES)
POSITION, ROTATION = poses_over_log(load_robot("ur5e"), Q)


def poses() -> np.ndarray[Any, Any]:
    """The poses of the arm as matrices, shape (n, 4, 4)."""
    matrices = np.tile(np.eye(4), (len(Q), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = ROTATION, POSITION
    return matrices


def test_arrays_give_what_their_file_gives(tmp_path: Path) -> None:
    FRAME.to_csv(tmp_path / "log.csv", index=False)
    wanted = urmpipe.ingest(tmp_path / "log.csv", "ur5e")
    for run in (urmpipe.ingest(t=T, q=Q, robot="ur5e"), urmpipe.ingest(FRAME, "ur5e")):
        assert (run.name, run.warnings, run.audit) == ("log", wanted.warnings, wanted.audit)
        for name in ("q", "qd", "qdd", "t_ns"):
            assert (getattr(run, name) == getattr(wanted, name)).all()


def test_units_names_and_period_of_arrays() -> None:
    run = urmpipe.ingest(
        q=np.degrees(Q),
        names=list("abcdef"),
        unit="deg",
        period=0.01,
        interval={"a": (-180, 180)},
        name="cell",
    )
    np.testing.assert_allclose(run.q, Q, rtol=1e-14, atol=0)  # to deg and back: two roundings
    assert (run.name, run.log.joints, run.log.period) == ("cell", tuple("abcdef"), 0.01)
    one = urmpipe.ingest(t=T, q=np.column_stack([np.degrees(Q[:, 0]), Q[:, 1]]), unit={"q1": "deg"})
    assert one.log.units == {"t": "s", "q1": "deg", "q2": "rad"}


def test_what_was_not_said_in_degrees_is_asked_about() -> None:
    said = refusal(urmpipe.LogError, urmpipe.ingest, t=T, q=np.degrees(5 * Q), robot="ur5e")
    assert "--unit q1=deg" in said


def test_joints_that_slide_are_in_m() -> None:
    arm = Chain("arm", (Joint("lift", kind="prismatic"), Joint("turn")))
    run = urmpipe.ingest(t=T, q=Q[:, :2], robot=arm)
    assert run.log.units == {"t": "s", "q1": "m", "q2": "rad"}
    np.testing.assert_array_equal(run.log.q, Q[:, :2])


@pytest.mark.parametrize("shape", [(3,), (7,), (4, 4)])
def test_a_recorded_tool_centre_point(shape: tuple[int, ...]) -> None:
    quat = Rotation.from_matrix(ROTATION).as_quat()
    given = {(3,): POSITION, (7,): np.column_stack([POSITION, quat]), (4, 4): poses()}[shape]
    run = urmpipe.ingest(t=T, q=Q, recorded_tcp=given, robot="ur5e")
    np.testing.assert_array_equal(there(run.log.tcp_position), POSITION)
    assert run.warnings == ()
    if shape != (3,):
        turned = run.log.tcp_quat_xyzw
        assert turned is not None
        # A matrix and its quaternion are one rotation but for rounding.
        np.testing.assert_allclose(Rotation.from_quat(turned).as_matrix(), ROTATION, atol=1e-14)
    alone = urmpipe.ingest(t=T, recorded_tcp=given)
    assert (alone.log.joints, alone.log.rows) == ((), 80)


def test_four_joints_of_length_one_are_no_orientation() -> None:
    q = np.tile([0.5, 0.5, 0.5, 0.5], (80, 1))
    run = urmpipe.ingest(t=T, q=q, recorded_tcp=POSITION)
    assert run.log.joints == ("q1", "q2", "q3", "q4")
    assert run.log.tcp_rotation is None


WRONG: list[tuple[dict[str, Any], str]] = [
    ({}, "log: found none"),
    ({"t": T}, "q: found none"),
    ({"t": T[:5], "q": Q}, "found 5 rows of t, 80 rows of q, allowed: as many of each"),
    ({"t": T, "q": [[1.0, 2.0], [3.0]]}, "q: found [[1.0, 2.0], [3.0]]"),
    ({"t": T, "q": Q[:, 0]}, "q: found an array of shape (80,)"),
    ({"q": np.empty((0, 6))}, "q: found an array of shape (0, 6)"),
    ({"t": T[:, np.newaxis], "q": Q}, "t: found an array of shape (80, 1)"),
    ({"t": ["now"] * 80, "q": Q}, "t: found "),
    ({"t": T, "q": Q.astype(complex)}, "q: found "),
    ({"q": Q, "recorded_tcp": Q}, "recorded_tcp: found an array of shape (80, 6)"),
    ({"q": Q, "names": ["a"]}, "names: found a, allowed: a name for each of the 6 joints, each once"),
    ({"q": Q, "names": ["a"] * 6}, "names: found a, a, a, a, a, a"),
    ({"q": FRAME}, "q: found a DataFrame"),
    ({"log": "log.csv", "q": Q}, "log: found a log and q, allowed: one of them"),
]


@pytest.mark.parametrize(("given", "said"), WRONG)
def test_arrays_that_are_none_are_one_line(given: dict[str, Any], said: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", np.exceptions.ComplexWarning)
        found = refusal(urmpipe.OptionError, urmpipe.ingest, **given)
    assert found.startswith(said)
    assert "\n" not in found


def test_names_are_those_of_the_joints_of_a_file_as_well(tmp_path: Path) -> None:
    FRAME.to_csv(tmp_path / "log.csv", index=False)
    run = urmpipe.ingest(tmp_path / "log.csv", names=list("abcdef"), name="cell")
    assert (run.name, run.log.joints) == ("cell", tuple("abcdef"))


@pytest.mark.slow
def test_tables_are_operands() -> None:
    moved = FRAME.assign(**{"q1 [rad]": FRAME["q1 [rad]"] + 0.001})
    arrow = pa.Table.from_pandas(moved, preserve_index=False)
    compared = urmpipe.compare(FRAME, [moved, arrow, urmpipe.ingest(t=T, q=Q, name="arrays")], robot="ur5e")
    assert [one.name for one in compared.runs] == ["log 1", "log 2", "arrays"]
    assert compared.runs[0].statistics == compared.runs[1].statistics
    assert compared.runs[2].statistics["norm"].max == 0.0
    assert urmpipe.compare(FRAME, moved, robot="ur5e").name == "log-against-reference"
    assert urmpipe.compare(FRAME, arrow, robot="ur5e", time="t").runs[0].name == "log"
    diagnosis = urmpipe.diagnose(FRAME, moved, robot="ur5e")
    judged = there(diagnosis.comparison)
    assert isinstance(judged, urmpipe.Comparison)
    assert judged.runs[0].statistics == compared.runs[0].statistics


def test_both_sides_of_a_table() -> None:
    names = [f"{side}_q{k} [rad]" for side in ("target", "actual") for k in range(1, 7)]
    frame = pd.DataFrame(np.column_stack([T, Q, Q + 0.001]), columns=["t [s]", *names])
    compared = urmpipe.compare(frame, robot="ur5e", sides=("target", "actual"))
    assert [one.name for one in compared.runs] == ["reference (actual)"]


def test_a_column_may_be_called_as_a_field_of_a_result() -> None:
    frame = FRAME.assign(warnings=1.0, recording=2.0)
    assert urmpipe.compare(frame, frame, robot="ur5e").verdict == "pass"


def test_the_map_and_the_recording_of_a_table(tmp_path: Path) -> None:
    frame = FRAME.rename(columns={name: f"axis {k}" for k, name in enumerate(NAMES[1:])})
    joints = [f"axis {k}" for k in range(6)]
    run = urmpipe.ingest(
        frame, "ur5e", joints=joints, unit="rad", write_map=tmp_path / "lab.toml", output=tmp_path / "log.rrd"
    )
    again = urmpipe.ingest(frame, map=tmp_path / "lab.toml")
    assert (again.q == run.q).all()
    stored = urmpipe.read_recording(tmp_path / "log.rrd")
    assert isinstance(stored, urmpipe.Run)
    np.testing.assert_array_equal(stored.q, run.q)
    assert run.log.files[0].name == "log"
    assert (
        run.log.files[0].sha256
        != urmpipe.ingest(frame.iloc[:40], map=tmp_path / "lab.toml").log.files[0].sha256
    )


def test_the_map_of_arrays_reads_their_table(tmp_path: Path) -> None:
    urmpipe.ingest(t=T, q=Q, names=list("abcdef"), robot="ur5e", write_map=tmp_path / "lab.toml")
    frame = pd.DataFrame(np.column_stack([T, Q]), columns=["t", *"abcdef"])
    assert (urmpipe.ingest(frame, map=tmp_path / "lab.toml").q == Q).all()
