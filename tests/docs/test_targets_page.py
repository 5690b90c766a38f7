"""docs/targets.md against the code: each table of the page reads as the page says."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from asserting import there
from urmpipe_pipeline.logs import read_log
from urmpipe_pipeline.outputs import TARGET_ROW
from urmpipe_pipeline.solved_targets.target_file import TargetFile, read_targets

PAGE = (Path(__file__).parents[2] / "docs" / "targets.md").read_text(encoding="utf-8")
POSES, GERMAN, PATH, WRONG, LOG = re.findall(r"```csv\n(.*?)```", PAGE, re.DOTALL)
REASONS = PAGE.split("```text\n")[1].split("```")[0].splitlines()
NAMES = re.findall(r"`([^`]+)`", "".join(re.findall(r"^\| .*", PAGE, re.MULTILINE)))


def targets_of(tmp_path: Path, text: str) -> TargetFile:
    (tmp_path / "targets.csv").write_text(text, encoding="utf-8")
    return read_targets(tmp_path / "targets.csv")


def assert_poses(targets: TargetFile, rz: float) -> None:
    """Hold two targets against the poses of the page's first table: turned about Y by pi, then by rz."""
    np.testing.assert_allclose(targets.position, [[0.4, 0.1, 0.5], [0.4, -0.1, 0.5]], rtol=1e-15, atol=0)
    turned = Rotation.from_euler("ZYX", [[0, np.pi, 0], [rz, np.pi, 0]]).as_matrix()
    # 17.18873385 deg has ten digits.
    np.testing.assert_allclose(targets.rotation, turned, rtol=0, atol=1e-9)  # type: ignore[arg-type]
    assert (targets.t_ns, targets.faults) == (None, {})


def test_the_first_table_holds_two_poses_and_nothing_to_warn_of(tmp_path: Path) -> None:
    targets = targets_of(tmp_path, POSES)
    assert_poses(targets, 0.3)
    assert targets.warnings == ()


def test_a_german_table_in_mm_and_degrees_holds_the_same(tmp_path: Path) -> None:
    assert_poses(targets_of(tmp_path, GERMAN), 0.3)


def test_a_table_with_times_is_a_path(tmp_path: Path) -> None:
    targets = targets_of(tmp_path, PATH)
    assert (there(targets.t_ns).tolist(), targets.rotation) == ([0, 5_000_000, 10_000_000], None)


def test_wrong_rows_have_the_reasons_of_the_page(tmp_path: Path) -> None:
    targets = targets_of(tmp_path, WRONG)
    assert [f"row {row}: {said}" for row, said in targets.faults.items()] == REASONS
    assert np.isfinite(targets.position).all(axis=1).tolist() == [True, False, False, False, False, True]


@pytest.mark.parametrize("names", ["X_act", "tcp_x", "pos_x", "/pose/position/x"])
def test_the_names_of_positions_are_known(tmp_path: Path, names: str) -> None:
    assert names in NAMES
    header = ",".join(f"{names[:-1]}{axis}" if names != "X_act" else f"{axis}_act" for axis in "xyz")
    assert targets_of(tmp_path, f"{header}\n1,2,3\n").position.tolist() == [[1, 2, 3]]


@pytest.mark.parametrize(
    ("names", "cells"),
    [
        (("rz", "ry", "rx"), "0.3,0,0"),
        (("yaw", "pitch", "roll"), "0.3,0,0"),
        (("A", "B", "C"), "0.3,0,0"),
        (("rotvec_x", "rotvec_y", "rotvec_z"), "0,0,0.3"),
        (("qx", "qy", "qz", "qw"), f"0,0,{math.sin(0.15)!r},{math.cos(0.15)!r}"),
    ],
)
def test_the_names_of_orientations_are_known(tmp_path: Path, names: tuple[str, ...], cells: str) -> None:
    assert set(names) <= set(NAMES)
    targets = targets_of(tmp_path, f"x,y,z,{','.join(names)}\n1,2,3,{cells}\n")
    turned = Rotation.from_rotvec([0, 0, 0.3]).as_matrix()
    np.testing.assert_allclose(there(targets.rotation)[0], turned, rtol=0, atol=1e-15)  # a rounding
    kuka = "no unit is given for A, B, C: they are taken as rad"
    assert [warning.message for warning in targets.warnings] == ([kuka] if "A" in names else [])


def test_the_joint_log_of_the_page_is_a_log(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(LOG, encoding="utf-8")
    log = read_log([tmp_path / "log.csv"])
    assert (log.joints, log.t_ns.tolist()) == (("phi1", "phi2"), [0, 5_000_000, 15_000_000])
    assert (log.units["phi1"], log.q[1].tolist()) == ("rad", [0.26, -1.4999999999999998])
    assert LOG.splitlines()[0].endswith(f",{TARGET_ROW}")
