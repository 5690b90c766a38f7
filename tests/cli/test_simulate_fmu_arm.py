"""An FMU of `kinematic_chain` brings its arm along: a system draws it like that of the unit."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from urmpipe.api.build_fmu import build_fmu
from urmpipe.api.simulate import simulate
from urmpipe_fmus.build.fmu import ROBOT_FILE, read_robot_entry
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.toml import robot_toml

SYSTEM = """
[system]
step = 0.01
duration = 0.02

[blocks.elbow]
fmu = "elbow.fmu"
start = { phi = [0.1, -1.2, 1.4, -1.8, -1.5, 0.2] }

[blocks.meter]
fmu = "meter.fmu"
start = { reference = 0.0, actual = 0.0 }
"""


@pytest.mark.slow
def test_the_arm_of_an_fmu_is_that_of_its_unit_and_without_joints_as_inputs_there_is_none(
    tmp_path: Path,
) -> None:
    arm = replace(load_robot("ur5e"), visuals=())  # its looks are files that stay where they are
    build_fmu("kinematic_chain", arm, backend="python", output=tmp_path / "elbow.fmu")
    build_fmu("delta_meter", backend="python", output=tmp_path / "meter.fmu")
    with zipfile.ZipFile(tmp_path / "meter.fmu", "a") as archive:
        archive.writestr(ROBOT_FILE, robot_toml(arm))
    (tmp_path / "system.toml").write_text(SYSTEM, encoding="utf-8")
    (found,) = simulate(tmp_path / "system.toml").arms
    assert (found.block, found.chain) == ("elbow", arm)
    np.testing.assert_array_equal(found.q, np.tile([0.1, -1.2, 1.4, -1.8, -1.5, 0.2], (3, 1)))


@pytest.mark.parametrize("content", [None, b"\xff", b"name = ", b"kind = 'other'"])
def test_a_file_of_that_name_that_is_no_arm_is_none(tmp_path: Path, content: bytes | None) -> None:
    with zipfile.ZipFile(tmp_path / "other.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", "")
        if content is not None:
            archive.writestr(ROBOT_FILE, content)
    assert read_robot_entry(tmp_path / "other.fmu") is None
