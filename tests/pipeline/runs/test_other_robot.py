"""A run on another arm: what rests on the arm is made anew, as if the log were read with it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from asserting import there
from urmpipe_models.arm.chain import Chain
from urmpipe_models.arm.denavit_hartenberg import urm_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError
from urmpipe_models.math3d import Transform
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.results import read_recording, write_recording
from urmpipe_pipeline.runs.ingest import ingest_log, with_robot
from urmpipe_pipeline.runs.run import Run

ARM = replace(load_robot("ur5e"), tool=Transform(translation=(0.3, 0.0, 0.15)))
OTHER = load_robot("urm6")
JOINTS = ARM.moving
SLOW = replace(
    ARM,
    joints=tuple(
        replace(joint, lower=-0.5, upper=0.5, velocity=0.4) if joint == JOINTS[1] else joint
        for joint in ARM.joints
    ),
)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of an arm that recorded its tool centre point."""
    t = np.arange(200) / 50
    q = 0.8 * np.sin(2.0 * t[:, None] + np.arange(6))
    header = ["t [s]", *(f"q{i} [rad]" for i in range(1, 7))]
    file = tmp_path_factory.mktemp("logs") / "log.csv"
    write(file, header, np.column_stack((t, q)))
    tcp = there(ingest_log([file], robot=ARM).tcp)
    write(file, [*header, "x [m]", "y [m]", "z [m]"], np.column_stack((t, q, tcp.position)))
    return file


def write(file: Path, header: list[str], rows: FloatArray) -> None:
    """Write a table, all digits of its numbers."""
    lines = [",".join(header), *(",".join(map(str, row)) for row in rows.tolist()), ""]
    file.write_text("\n".join(lines), encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("first", "second", "kinds"),
    [
        (OTHER, ARM, []),
        (ARM, OTHER, ["recorded-tcp-far"]),
        (ARM, SLOW, ["joint-limit", "speed-limit"]),
        (SLOW, ARM, []),
        (OTHER, SLOW, ["joint-limit", "speed-limit"]),
    ],
)
def test_warnings_and_kinematics_are_those_of_a_log_read_with_the_arm(
    first: Chain, second: Chain, kinds: list[str], log: Path
) -> None:
    held, read = with_robot(ingest_log([log], robot=first), second), ingest_log([log], robot=second)
    assert [warning.kind for warning in held.warnings] == kinds
    assert held.warnings == read.warnings
    assert held.robot == second
    assert held.provenance.options == read.provenance.options
    np.testing.assert_array_equal(there(held.tcp).position, there(read.tcp).position)
    np.testing.assert_array_equal(held.tcp_recorded, read.tcp_recorded)


def test_a_recording_is_held_as_its_log_is(log: Path, tmp_path: Path) -> None:
    file = write_recording(ingest_log([log], robot=OTHER), tmp_path / "run.rrd")
    kept = read_recording(file)
    assert isinstance(kept, Run)
    assert with_robot(kept, SLOW).warnings == ingest_log([log], robot=SLOW).warnings


def test_joints_that_turn_are_none_that_slide(log: Path) -> None:
    sliding = tuple(
        replace(joint, kind="prismatic") if joint == OTHER.moving[2] else joint for joint in OTHER.joints
    )
    with pytest.raises(LogError) as caught:
        with_robot(ingest_log([log], robot=OTHER), replace(OTHER, joints=sliding))
    assert str(caught.value) == "log, joint q3: found rad, allowed: m, as robot urm6 has"


def test_a_path_has_no_joints_to_refuse(tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    file.write_text("t [s],x [m],y [m],z [m]\n0,0,0,0\n0.1,0,0,0.1\n0.2,0,0,0.2\n", encoding="utf-8")
    run = with_robot(ingest_log([file]), urm_chain("urm2", (0.2, 0.2, 0.2), [0.5, 0.5]))
    assert (run.tcp, run.warnings) == (None, ())
