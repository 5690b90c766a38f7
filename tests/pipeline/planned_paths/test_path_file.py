"""The rows of a path from files: read as targets are, with what a radius means, and refused as a whole."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from asserting import there
from urmpipe_pipeline.logs import read_map
from urmpipe_pipeline.planned_paths.path_file import GivenPath, read_path

Read = Callable[..., GivenPath]
Wrong = Callable[..., list[str]]

PAPER = """x,y,z,r
1.70,0.30,1.00,0
1.97,0.30,1.00,0.03
2.00,-0.27,1.00,0.03
1.43,-0.30,1.00,0.03
1.40,0.27,1.00,0.03
1.70,0.30,1.00,0
"""
"""Source: [Iso9283]_ section 5."""


def said(found: GivenPath) -> list[tuple[str, str]]:
    return [(warning.kind, str(warning)) for warning in found.warnings]


def test_the_contour_of_the_paper_is_read(read: Read) -> None:
    found = read(PAPER)
    assert found.rows.position[:3].tolist() == [[1.7, 0.3, 1.0], [1.97, 0.3, 1.0], [2.0, -0.27, 1.0]]
    assert found.rows.radius.tolist() == [0.0, 0.03, 0.03, 0.03, 0.03, 0.0]
    assert found.rows.variant.tolist() == [2] * 6
    assert (found.rows.corner, found.rows.rotation, said(found)) == (False, None, [])
    assert (len(found.rows), found.name, there(found.file).name) == (6, "path", "path.csv")


def test_the_header_says_that_a_row_is_a_corner(read: Read) -> None:
    found = read("x,y,z,corner_r\n0,0,0,\n1,0,0,0.1\n1,1,0,\n")
    assert (found.rows.corner, found.rows.radius.tolist()) == (True, [0.0, 0.1, 0.0])


@pytest.mark.parametrize("text", ["x,y,z\n0,0,0\n1,0,0\n", "0,0,0\n1,0,0\n", "x,y,z\n0,0,0\n1,0,0\n,,\n"])
def test_without_a_radius_every_row_is_a_stop(read: Read, text: str) -> None:
    found = read(text)
    assert (found.rows.radius.tolist(), found.rows.position.tolist()) == ([0.0, 0.0], [[0, 0, 0], [1, 0, 0]])
    assert said(found) == []


def test_empty_cells_are_no_radius_and_the_proper_variant(read: Read) -> None:
    found = read("x,y,z,r,variant\n0,0,0,,\n1,0,0,0.1,1\n1,1,0,0.2,\n2,1,0,-,NaN\n")
    assert found.rows.radius.tolist() == [0.0, 0.1, 0.2, 0.0]
    assert found.rows.variant.tolist() == [2, 1, 2, 2]


@pytest.mark.parametrize(
    ("name", "factor"), [("radius", 1.0), ("Radius [mm]", 1e-3), ("radius_cm", 1e-2), ("RADIUS (m)", 1.0)]
)
def test_a_radius_may_be_spelled_out(read: Read, name: str, factor: float) -> None:
    for prefix, corner in (("", False), ("corner ", True)):
        radius = 0.1 / factor
        found = read(f"x,y,z,{prefix}{name}\n0,0,0,0\n1,0,0,{radius!r}\n1,1,0,0\n")
        assert (found.rows.corner, said(found)) == (corner, [])
        assert found.rows.radius.tolist() == pytest.approx([0.0, 0.1, 0.0], rel=1e-15)  # one product


# Units: the radius has its own, else that of x, y, z.


@pytest.mark.parametrize(
    ("header", "row", "unit"),
    [
        ("x [mm],y [mm],z [mm],r", "300,100,500,30", {}),
        ("x_mm,y_mm,z_mm,r_mm", "300,100,500,30", {}),
        ("x,y,z,r [mm]", "0.3,0.1,0.5,30", {}),
        ("x [mm],y [mm],z [mm],R (cm)", "300,100,500,3", {}),
        ("x,y,z,r", "300,100,500,30", {"": "mm"}),
        ("x,y,z,r", "0.3,0.1,0.5,30", {"r": "mm"}),
        ("x [cm],y [cm],z [cm],r", "30,10,50,0.03", {"r": "m"}),
    ],
)
def test_units_of_the_radius(read: Read, header: str, row: str, unit: dict[str, str]) -> None:
    x, y, z, _ = row.split(",")
    found = read(f"{header}\n0,{y},{z},\n{row}\n{x},{y},0,0\n", unit=unit)
    # 30 mm and 3 cm are 0.03 m but for the rounding of the product.
    np.testing.assert_allclose(found.rows.radius, [0.0, 0.03, 0.0], rtol=1e-15, atol=0)
    np.testing.assert_allclose(found.rows.position[1], [0.3, 0.1, 0.5], rtol=1e-15, atol=0)
    assert said(found) == []


def test_a_unit_that_is_no_length_is_refused(wrong: Wrong) -> None:
    assert wrong("x,y,z,r [deg]\n0,0,0,0\n1,0,0,0\n") == [
        "path.csv, column r [deg]: found the unit deg (its name), allowed: m, mm, cm"
    ]


def test_a_table_as_excel_writes_it_in_german(read: Read) -> None:
    text = "Nr;X [mm];Y [mm];Z [mm];corner_r [mm];A [°];B [°];C [°]\n"
    found = read(f"{text}1;400,5;0;0;;0;180;0\n2;500;0;0;12,5;0;180;0\n3;500;100;0;;90;180;0\n")
    assert (found.rows.radius.tolist(), found.rows.position[0, 0]) == ([0.0, 0.0125, 0.0], 0.4005)
    turned = Rotation.from_euler("ZYX", [[0, 180, 0], [0, 180, 0], [90, 180, 0]], degrees=True)
    # Sines and cosines of half turns, rounded.
    np.testing.assert_allclose(there(found.rows.rotation), turned.as_matrix(), rtol=0, atol=1e-15)
    assert said(found) == []


# Orientation beside a column r


@pytest.mark.parametrize("header", ["x,y,z,r,rz,ry,rx", "r,rz,ry,rx,x,y,z", "rz,ry,rx,r,x,y,z"])
def test_r_is_no_part_of_an_orientation(read: Read, header: str) -> None:
    cells = dict(
        zip(
            ("x", "y", "z", "r", "rz", "ry", "rx"),
            ["0.3", "0.1", "0.5", "0", "0.3", "-0.2", "0.1"],
            strict=True,
        )
    )
    rows = [",".join((cells | {"x": x})[name] for name in header.split(",")) for x in ("0.3", "0.4")]
    found = read("\n".join((header, *rows)))
    turned = Rotation.from_euler("ZYX", [0.3, -0.2, 0.1]).as_matrix()
    np.testing.assert_allclose(there(found.rows.rotation)[0], turned, rtol=0, atol=1e-15)
    assert (found.rows.position[0].tolist(), said(found)) == ([0.3, 0.1, 0.5], [])


def test_a_quaternion_and_a_matrix_stand_beside_a_radius(read: Read) -> None:
    found = read("x,y,z,qx,qy,qz,qw,r\n0,0,0,0,1,0,0,0\n1,0,0,0,1,0,0,0\n")
    assert there(found.rows.rotation)[0].diagonal().tolist() == [-1.0, 1.0, -1.0]
    names = ",".join(f"r{i}{j}" for i in "123" for j in "123")
    found = read(f"x,y,z,{names},corner_r\n" + "0,0,0,1,0,0,0,1,0,0,0,1,0\n1,0,0,1,0,0,0,1,0,0,0,1,0\n")
    assert there(found.rows.rotation).tolist() == [np.eye(3).tolist()] * 2


def test_half_an_orientation_is_refused_as_of_targets(wrong: Wrong) -> None:
    (line,) = wrong("x,y,z,r,rx,ry\n0,0,0,0,0,0\n1,0,0,0,0,0\n")
    assert line.startswith("path.csv: found rx, ry as a part of an orientation, allowed: all of rz, ry, rx")


def test_a_map_names_the_columns_of_the_pose(read: Read, tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text('position = ["a", "b", "c"]\n[unit]\na = "mm"\nr = "cm"\n')
    asked = read_map(tmp_path / "lab.toml")
    found = read("c,a,b,r\n0,400,0,0\n0,500,0,1\n0,500,100,0\n", position=asked.position, unit=asked.unit)
    assert (found.rows.position[1].tolist(), found.rows.radius.tolist()) == (
        [0.5, 0.0, 0.0],
        [0.0, 0.01, 0.0],
    )


# What a path does not use


@pytest.mark.parametrize(
    "time", ["0.0,0.1,0.2", "2021-04-11 22:27:21,2021-04-11 22:27:22,2021-04-11 22:27:23", "3,2,1"]
)
def test_a_time_is_not_used_whatever_it_holds(read: Read, time: str) -> None:
    times = time.split(",")
    rows = [f"{t},{row}\n" for t, row in zip(times, ("0,0,0,0", "1,0,0,0.1", "2,1,0,0"), strict=True)]
    found = read("time,x,y,z,corner_r\n" + "".join(rows))
    assert said(found) == [("time-not-used", "time is not used: a plan makes its own time")]
    assert found.rows.position[:, 0].tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize(
    ("names", "told"),
    [
        ("W,P,R", "W, P are"),
        ("diameter,r", "diameter is"),
        ("nr,name,r", None),
        ("speed,acc,r", "speed, acc are"),
    ],
)
def test_other_columns_of_numbers_are_told_of(read: Read, names: str, told: str | None) -> None:
    cells = ",".join("home" if name == "name" else "0" for name in names.split(","))
    found = read(f"x,y,z,{names}\n0,0,0,{cells}\n1,0,0,{cells}\n")
    hint = "; a path uses columns named x, y, z, an orientation, r or corner_r, variant"
    assert said(found) == ([] if told is None else [("columns-not-used", f"{told} not used{hint}")])


# What is refused


@pytest.mark.parametrize("columns", [4, 5])
def test_columns_without_names_need_a_header(wrong: Wrong, columns: int) -> None:
    """Even where the first runs in even steps, which would be the time of targets."""
    rows = "".join(",".join([f"0.{k}", *["0.5"] * (columns - 1)]) + "\n" for k in (1, 2, 3))
    allowed = "x, y, z alone or with an orientation"
    named = "name the columns in a header: x,y,z,r or x,y,z,corner_r"
    assert wrong(rows) == [f"path.csv: found {columns} columns without names, allowed: {allowed}; {named}"]


def test_all_that_is_wrong_is_told_at_once_with_its_line(wrong: Wrong) -> None:
    text = (
        "# taught by hand\nx,y,z,qx,qy,qz,qw,r [mm],variant\n0,0,0,0,0,0,1,10,\n0,here,0,0,0,0,1,-2,3\n"
        "0,,inf,0,0,0,1,wide,1.5\n\n0,0,0,0,0,0,2,inf,0\n0,0\n0,0,0,0,0,0,1,0,two\n"
    )
    radius, variant = "allowed: 0 or more, or an empty cell", "allowed: 1, 2 or an empty cell"
    assert wrong(text) == [
        "path.csv:3, column r [mm]: found 0.01 m, allowed: 0, since a path starts and ends at rest",
        "path.csv:4, column y: found 'here', allowed: a finite number",
        f"path.csv:4, column r [mm]: found -2, {radius}",
        f"path.csv:4, column variant: found 3, {variant}",
        f"path.csv:5, column r [mm]: found 'wide', {radius}",
        "path.csv:5, column y: found no number, allowed: a finite number",
        "path.csv:5, column z: found inf, allowed: a finite number",
        f"path.csv:5, column variant: found 1.5, {variant}",
        f"path.csv:7, column r [mm]: found inf, {radius}",
        f"path.csv:7, column variant: found 0, {variant}",
        "path.csv:7, column qx, qy, qz, qw: found a quaternion of norm 2, allowed: 1 within 0.001",
        "path.csv:8: found 2 cells, allowed: 9",
        f"path.csv:9, column variant: found 'two', {variant}",
    ]


def test_both_meanings_in_one_file_are_refused_with_its_rows(wrong: Wrong) -> None:
    assert wrong("x,y,z,r,corner_r\n0,0,0,0,0\n1,0,0,-1,0\n1,1,0,0,0\n") == [
        "path.csv:1: found r, corner_r, allowed: one of them: r where a row is the first tangent point of the"
        " arc of radius r, or corner_r where a row is the corner that an arc of radius corner_r rounds",
        "path.csv:3, column r: found -1, allowed: 0 or more, or an empty cell",
    ]


def test_a_column_twice_is_refused(wrong: Wrong) -> None:
    for other in ("r [mm]", "radius"):
        assert wrong(f"x,y,z,r,{other}\n0,0,0,0,0\n1,0,0,0,0\n") == [
            f"path.csv: found r, {other}, allowed: one of them"
        ]


def test_a_path_has_two_rows_and_rests_at_its_ends(wrong: Wrong) -> None:
    rest = "found 0.1 m, allowed: 0, since a path starts and ends at rest"
    assert wrong("x,y,z,r\n0,0,0,0.1\n") == [
        "path.csv: found 1 row, allowed: 2 or more",
        f"path.csv:2, column r: {rest}",
    ]
    assert wrong("x,y,z,corner_r\n0,0,0,0.1\n1,0,0,0.1\n1,1,0,0.1\n") == [
        f"path.csv:2, column corner_r: {rest}",
        f"path.csv:4, column corner_r: {rest}",
    ]


def test_of_many_faults_the_first_are_told_and_the_others_counted(wrong: Wrong) -> None:
    lines = wrong("x,y,z,r\n" + "".join(f"{k},0,0,-1\n" for k in range(30)))
    assert (len(lines), lines[-1]) == (21, "path.csv: 10 more findings")


# Round trips

about = st.floats(-5.0, 5.0, allow_subnormal=False)
zigzags = st.lists(
    st.tuples(about, about, about, st.just(0.0) | st.floats(0.1, 5.0), st.sampled_from([1, 2])),
    min_size=2,
    max_size=9,
).map(lambda rows: [(x + 40.0 * k, y + 30.0 * (k % 2), *others) for k, (x, y, *others) in enumerate(rows)])
NAMES = ("x", "y", "z", "r", "variant")


@pytest.mark.slow
@given(
    rows=zigzags,
    order=st.permutations(range(5)),
    german=st.booleans(),
    corner=st.booleans(),
    unit=st.sampled_from(["m", "mm", "cm"]),
)
def test_what_is_written_is_read(
    rows: list[tuple[float, float, float, float, int]],
    order: list[int],
    german: bool,
    corner: bool,
    unit: str,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    table = [list(row) for row in rows]
    table[0][3] = table[-1][3] = 0.0
    names = [f"{name} [{unit}]" if name != "variant" else name for name in NAMES]
    names[3] = f"corner_{names[3]}" if corner else names[3]
    lines = [[names[k] for k in order], *([repr(row[k]) for k in order] for row in table)]
    sign = ";" if german else ","
    text = "\n".join(sign.join(line) for line in lines) + "\n"
    path = tmp_path_factory.mktemp("rows") / "path.csv"
    path.write_text(text.replace(".", ",") if german else text, encoding="utf-8")
    found = read_path(path).rows
    factor = {"m": 1.0, "mm": 1e-3, "cm": 1e-2}[unit]
    values = np.array(table)
    assert found.position.tolist() == (values[:, :3] * factor).tolist()
    assert found.radius.tolist() == (values[:, 3] * factor).tolist()
    assert found.variant.tolist() == values[:, 4].tolist()
    assert found.corner == corner


def test_what_follows_from_a_wrong_radius_is_not_reported(wrong: Wrong) -> None:
    """With a right one the path might not go straight on in row 3, nor would row 4 be inside its circle."""
    assert wrong("x,y,z,r\n0,0,0,0\n1,0,0,-0.05\n1.1,0,0,0.2\n1.2,0.1,0,0\n") == [
        "path.csv:3, column r: found -0.05, allowed: 0 or more, or an empty cell"
    ]


def test_a_row_far_beyond_any_arm_is_refused(wrong: Wrong) -> None:
    assert wrong("x,y,z,r\n0,0,0,0\n1e300,0,0,x\n1,0,0,0.1\n") == [
        "path.csv:3, column r: found 'x', allowed: 0 or more, or an empty cell",
        "path.csv:3: found a coordinate of 1e+300 m, allowed: up to 1e+09 m",
        "path.csv:4, column r: found 0.1 m, allowed: 0, since a path starts and ends at rest",
    ]
