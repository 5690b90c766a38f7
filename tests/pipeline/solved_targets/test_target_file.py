"""Targets from files: whoever wrote them, the poses come out, and a wrong row stops no other."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from make_specimens import paths
from specimen import SPECIMENS, Truth
from urmpipe_pipeline.logs import LogMap, read_log, read_map
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.solved_targets.target_file import TargetFile, read_targets

DATASETS = Path(__file__).parents[3] / "datasets" / "urmpipe_datasets" / "logs"
LOGS = Path(__file__).resolve().parents[3].parent / "shared" / "logs"

Read = Callable[..., TargetFile]
Wrong = Callable[..., list[str]]


def assert_turned(targets: TargetFile, rotation: list[Any], atol: float = 1e-14) -> None:
    """Hold the targets' orientations against matrices, within a few roundings."""
    assert targets.rotation is not None
    np.testing.assert_allclose(targets.rotation, np.array(rotation), rtol=0, atol=atol)


def said(targets: TargetFile) -> list[tuple[str, str]]:
    return [(warning.kind, warning.message) for warning in targets.warnings]


# What a file cannot tell by itself, by specimen.
OPTIONS: dict[str, Mapping[str, Any]] = {
    "cad_path_no_header": {"unit": {"1": "mm"}},
    "tcp_xyz_mm": {"unit": {"TCP_X": "mm"}},
    "tcp_rotation_vector": {"rotation": "vector"},
    "tcp_quaternion_numbered": {"rotation": "quat_wxyz", "unit": {"x": "mm"}},
    "tcp_matrix_16_mm": {"unit": {"T_3": "mm"}},
    "tcp_matrix_no_header": {"unit": {"10": "mm"}},
}
TRUTHS: dict[str, Truth] = {
    name: truth
    for name, one in SPECIMENS.items()
    if (truth := one.make().truth) is not None and truth.position is not None
}


def test_all_specimens_with_a_tool_are_tried() -> None:
    with_tool = {name for name in SPECIMENS if name.startswith("tcp_") and SPECIMENS[name].folder != "wrong"}
    assert len(TRUTHS) == 28
    assert with_tool <= TRUTHS.keys()
    assert OPTIONS.keys() <= TRUTHS.keys()


@pytest.mark.slow
@pytest.mark.parametrize("name", TRUTHS)
def test_a_specimen_with_a_tool_gives_its_poses_as_targets(name: str) -> None:
    truth, targets = (
        TRUTHS[name],
        read_targets(paths(SPECIMENS[name])[0], LogMap(**OPTIONS.get(name, {}))),
    )
    assert targets.row.tolist() == list(range(1, len(truth.t) + 1))
    assert targets.faults == {}
    assert truth.position is not None
    np.testing.assert_allclose(targets.position, truth.position, rtol=0, atol=truth.position_within)
    assert (targets.rotation is None) == (truth.rotation is None)
    if truth.rotation is not None and targets.rotation is not None:
        between = Rotation.from_matrix(targets.rotation).inv() * truth.rotation
        assert between.magnitude().max() <= truth.rotation_within
    if targets.t_ns is not None:
        np.testing.assert_allclose(targets.t_ns / 1e9, truth.t, rtol=0, atol=truth.t_within)
        assert targets.clock_start_ns / 1e9 == pytest.approx(truth.start, abs=truth.t_within, rel=0)


@pytest.mark.slow
@pytest.mark.parametrize("folder", ["ur5e-rtde-static", "ur-rtde-10rows"])
@pytest.mark.skipif(not LOGS.is_dir(), reason="the real logs in ../shared/logs are not here")
def test_the_recorded_tool_of_a_real_log_is_a_path(folder: str) -> None:
    path = LOGS / folder / "robot_data.csv"
    targets, log = read_targets(path), read_log([path])
    assert log.tcp_position is not None
    assert log.tcp_quat_xyzw is not None
    assert targets.position.tolist() == log.tcp_position.tolist()
    assert_turned(targets, list(Rotation.from_quat(log.tcp_quat_xyzw).as_matrix()))
    assert targets.t_ns is not None
    assert (targets.t_ns.tolist(), targets.file) == (log.t_ns.tolist(), log.files[0])


def test_a_matrix_of_a_real_log_without_a_header_is_a_pose() -> None:
    path = LOGS / "pybotics-ur10-fk" / "ur10-joints-poses.csv"
    if not path.is_file():
        pytest.skip(f"{path} is not here")
    table = np.loadtxt(path, delimiter=",")[:, -16:].reshape(-1, 4, 4)
    targets = read_targets(path, LogMap(unit={"10": "mm"}))
    np.testing.assert_allclose(targets.position, table[:, :3, 3] / 1e3, rtol=1e-15, atol=0)
    assert_turned(targets, list(table[:, :3, :3]), atol=1e-8)


def test_the_path_of_the_demo_is_read_as_ingest_reads_it() -> None:
    targets, run = read_targets(DATASETS / "path.csv"), ingest_log([DATASETS / "path.csv"])
    assert run.log.tcp_position is not None
    assert targets.position.tolist() == run.log.tcp_position.tolist()
    assert targets.t_ns is not None
    assert targets.t_ns.tolist() == run.log.t_ns.tolist()
    assert (targets.rotation, targets.faults, targets.file) == (None, {}, run.log.files[0])


# Rows


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("x,y,z", "0.3,-0.1,0.5"),
        ("X [mm],Y [mm],Z [mm]", "300,-100,500"),
        ("pos_x (cm),pos_y (cm),pos_z (cm)", "30,-10,50"),
        ("tcp_z,tcp_y,tcp_x", "0.5,-0.1,0.3"),
        ("name,X_act,Y_act,Z_act,note", "A,0.3,-0.1,0.5,taught"),
        ("x_mm,y_mm,z_mm", "300,-100,500"),
        ("tcp_x_cm,tcp_y_cm,tcp_z_cm", "30,-10,50"),
    ],
)
def test_positions_by_names_and_units(read: Read, header: str, row: str) -> None:
    targets = read(f"{header}\n{row}\n{row}\n")
    np.testing.assert_allclose(targets.position, [[0.3, -0.1, 0.5]] * 2, rtol=1e-15, atol=0)
    assert (targets.rotation, targets.t_ns, said(targets)) == (None, None, [])


EULER = (0.3, -0.2, 0.1)
"""rz, ry, rx in rad."""

R = Rotation.from_euler("ZYX", EULER).as_matrix()
QUATERNION = dict(zip("xyzw", Rotation.from_matrix(R).as_quat().tolist(), strict=True))
DEGREES = ",".join(map(repr, np.degrees(EULER).tolist()))


@pytest.mark.parametrize(
    ("header", "cells"),
    [
        ("rz,ry,rx", "0.3,-0.2,0.1"),
        ("rz (rad),ry (rad),rx (rad)", "0.3,-0.2,0.1"),
        ("rz [deg],ry [deg],rx [deg]", DEGREES),
        ("rz_deg,ry_deg,rx_deg", DEGREES),
        ("yaw,pitch,roll", "0.3,-0.2,0.1"),
        ("A [°],B [°],C [°]", DEGREES),
        *((",".join(f"q{a}" for a in order), ",".join(repr(QUATERNION[a]) for a in order))
          for order in ("xyzw", "wxyz", "zwyx")),
        ("r11,r12,r13,r21,r22,r23,r31,r32,r33", ",".join(map(repr, R.ravel().tolist()))),
    ],
)  # fmt: skip
def test_orientations_by_names_and_units(read: Read, header: str, cells: str) -> None:
    targets = read(f"x,y,z,{header}\n0.3,0.1,0.5,{cells}\n")
    assert_turned(targets, [R])
    assert said(targets) == []


def test_options_say_what_a_header_does_not(read: Read) -> None:
    text = f"x,y,z,rz,ry,rx\n300,100,500,{DEGREES}\n"
    targets = read(text, unit={"x": "mm", "": "deg"})
    np.testing.assert_allclose(targets.position, [[0.3, 0.1, 0.5]], rtol=1e-15, atol=0)
    assert_turned(targets, [R])
    assert said(targets) == []
    assert said(read(text)) == [
        (
            "assumed-unit",
            "no unit is given for x, y, z: they are taken as m, though every row is beyond any arm",
        ),
        (
            "assumed-unit",
            "no unit is given for rx, ry, rz: they are taken as rad, though most are beyond a turn",
        ),
    ]


def test_one_target_out_of_reach_does_not_change_the_unit(read: Read) -> None:
    targets = read("x,y,z\n0.3,0.1,0.5\n300,100,500\n400,100,500\n")
    assert targets.position.tolist() == [[0.3, 0.1, 0.5], [300.0, 100.0, 500.0], [400.0, 100.0, 500.0]]
    assert said(targets) == []


def test_rx_ry_rz_may_be_a_rotation_vector_and_the_option_is_named(read: Read) -> None:
    text = "x,y,z,rx,ry,rz\n0.3,0.1,0.5,0.1,-0.2,0.3\n"
    targets = read(text)
    assert_turned(targets, [R])
    assert said(targets) == [
        ("assumed-rotation", "rx, ry, rz are taken as angles about the moving axes Z, Y, X (rz, ry, rx)")
    ]
    vector = read(text, rotation="vector")
    turned = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix()
    assert_turned(vector, [turned])
    assert said(vector) == []


NAMED = "--orientation A,B,C with --position and --rotation names them"


def _forms(*forms: str) -> str:
    return " or ".join(f"--rotation {form}" for form in forms) + " specifies it"


@pytest.mark.parametrize("names", ["alpha,beta,gamma", "r11,r12,r13,r21", "j1,j2,j3,j4,j5,j6"])
def test_columns_that_may_be_an_orientation_are_not_left_out_in_silence(read: Read, names: str) -> None:
    cells = ",".join("1" for _ in names.split(","))
    targets = read(f"nr,note,t,x,y,z,{names}\n1,home,0,0.3,0.1,0.5,{cells}\n")
    listed = names.replace(",", ", ")
    told = f"x, y, z are targets without an orientation: {listed} are not used"
    assert said(targets) == [("columns-not-used", told)]
    named = read(f"x,y,z,{names}\n0.3,0.1,0.5,{cells}\n", position=("x", "y", "z"))
    assert (named.rotation, said(named)) == (None, [])


def test_a_form_without_an_orientation_is_refused(wrong: Wrong) -> None:
    assert wrong("x,y,z,u,v,w\n1,2,3,0,0,0\n", rotation="rpy") == [
        "targets.csv: rotation (--rotation): found rpy given for x, y, z and no orientation, allowed: its"
        " columns next to"
        f" them; {NAMED}"
    ]
    assert wrong("x,y,z,u,v,w\n1,2,3,0,0,0\n", orientation=("u", "v", "w")) == [
        "orientation (--orientation): found without a position, allowed: next to x, y, z; --position X,Y,Z"
        " names x, y, z"
    ]


def test_a_map_names_the_columns(read: Read, tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text(
        'joints = ["J1"]\nposition = ["a", "b", "c"]\norientation = ["u", "v", "w"]\nrotation = "zyx"\n'
        '[unit]\na = "mm"\nu = "deg"\n'
    )
    said = read_map(tmp_path / "lab.toml")
    targets = read(f"c;a;b;u;v;w\n500;300;100;{DEGREES.replace(',', ';')}\n", **{
        name: getattr(said, name) for name in ("position", "orientation", "rotation", "unit", "joints")
    })  # fmt: skip
    np.testing.assert_allclose(targets.position, [[0.3, 0.1, 0.5]], rtol=1e-15, atol=0)
    assert_turned(targets, [R])


# Files without a header


def test_three_columns_without_names_are_positions_though_the_first_runs_evenly(read: Read) -> None:
    targets = read("0.1 0.3 0.5\n0.2 0.3 0.4\n0.3 0.3 0.5\n")
    assert targets.position[:, 0].tolist() == [0.1, 0.2, 0.3]
    assert targets.t_ns is None


def test_more_columns_without_names_need_an_even_time_or_the_form_of_the_orientation(
    read: Read, wrong: Wrong
) -> None:
    timed = read("0.0 0.3 0.1 0.5\n0.1 0.3 0.2 0.5\n0.2 0.3 0.1 0.5\n")
    assert timed.t_ns is not None
    assert (timed.t_ns.tolist(), timed.position[1].tolist()) == ([0, 10**8, 2 * 10**8], [0.3, 0.2, 0.5])
    six = "0.3 0.1 0.5 0.3 -0.2 0.1\n0.4 0.1 0.5 0.3 -0.2 0.1\n"
    without = (
        "columns without names, allowed: x, y, z alone or with an orientation; name the columns in a header"
    )
    first = "--time 1 if the first is the time"
    assert wrong(six) == [
        f"targets.csv: found 6 {without}; {_forms('vector', 'rpy', 'zyx', 'xyz', 'zyz', 'zxz')}"
    ]
    assert wrong("0.3 0.1 0.5 2 0 0 0\n") == [
        f"targets.csv: found 7 {without}; {_forms('quat_xyzw', 'quat_wxyz')}; {first}"
    ]
    assert wrong("0.3 0.1 0.5 2\n") == [f"targets.csv: found 4 {without}; {first}"]
    assert wrong("0.3 0.1 0.5 0 1\n") == [f"targets.csv: found 5 {without}"]
    assert_turned(read(six, rotation="zyx"), [R, R])
    seven = "".join(
        f"{x} 0.1 0.5 " + " ".join(repr(QUATERNION[a]) for a in "wxyz") + "\n" for x in (0.3, 0.9, 0.4)
    )
    assert wrong(seven) == [
        "targets.csv: found 4, 5, 6, 7, which may be quat_xyzw or quat_wxyz, allowed: one form;"
        f" {_forms('quat_xyzw', 'quat_wxyz')}"
    ]
    assert_turned(read(seven, rotation="quat_wxyz"), [R] * 3)
    assert wrong(seven.split("\n")[0]) == wrong(seven)


def test_of_columns_without_names_the_form_tells_the_time_by_their_number(read: Read, wrong: Wrong) -> None:
    rows = [f"{t} 0.3 0.1 0.5 0 0 0 1\n" for t in (0.0, 0.1, 0.4)]
    targets = read("".join(rows), rotation="quat_xyzw")
    assert targets.t_ns is not None
    assert targets.t_ns.tolist() == [0, 10**8, 4 * 10**8]
    assert_turned(targets, [np.eye(3)] * 3)
    assert wrong("".join(row[:15] + "\n" for row in rows)) == [
        "targets.csv:1: found column 1, which increases from row to row and may be the time or"
        " a counter; --time 1 or --time none specifies it"
    ]
