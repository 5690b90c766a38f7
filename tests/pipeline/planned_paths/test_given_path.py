"""A path is a file, a test cube in a text, or rows as arrays; what is wrong with it is said at once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from asserting import there
from urmpipe_models.errors import LogError, OptionError, PathError, UrmpipeError
from urmpipe_models.planning.path import PLANES, PathRows, cube_rows
from urmpipe_pipeline.logs import LogMap
from urmpipe_pipeline.planned_paths.given_path import PathLike, given_path

CUBE = "a=0.6,r=0.03,x=1.7,y=0,z=1"
CENTRE = np.array([1.7, 0.0, 1.0])
LINE = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]


def refused(given: PathLike, error: type[UrmpipeError] = OptionError) -> list[str]:
    with pytest.raises(error) as caught:
        given_path(given)
    return [str(finding) for finding in caught.value.findings]


# Files


@pytest.mark.parametrize("kind", [str, Path])
def test_a_file_is_a_path_of_its_name(tmp_path: Path, kind: type[str | Path]) -> None:
    (tmp_path / "contour.csv").write_text(
        "t;x;y;z;corner_r\n0;0;0;0;\n1;1;0;0;100\n2;1;1;0;\n", encoding="utf-8"
    )
    found = given_path(kind(tmp_path / "contour.csv"), LogMap(unit={"corner_r": "mm"}))
    assert (found.name, len(found.rows), there(found.file).name) == ("contour", 3, "contour.csv")
    assert (found.rows.position.tolist(), found.rows.radius.tolist()) == (LINE, [0.0, 0.1, 0.0])
    assert [warning.kind for warning in found.warnings] == ["time-not-used"]


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"none\.csv"):
        given_path(tmp_path / "none.csv")


# Cubes


@pytest.mark.parametrize(
    ("kind", "plane"), [(kind, plane) for kind, planes in PLANES.items() for plane in planes]
)
def test_a_text_tells_each_section_of_a_cube(kind: str, plane: str) -> None:
    found, wanted = given_path(f"cube:{kind},{CUBE},plane={plane}"), cube_rows(kind, 0.6, 0.03, CENTRE, plane)
    assert found.rows.position.tolist() == wanted.position.tolist()
    assert found.rows.radius.tolist() == wanted.radius.tolist()
    assert (found.name, found.file, len(found.rows)) == (f"cube {kind} {plane}", None, 6)
    assert (found.rows.rotation, found.warnings) == (None, ())


@pytest.mark.parametrize(
    "text", ["a=600mm,r=3cm,x=1700 mm,y=0mm,z=1e3mm", " z = 1 , x = 1.7 , y = -0 , r = 0.03 , a = 0.6 "]
)
def test_lengths_have_units_and_keys_any_order(text: str) -> None:
    wanted = cube_rows("wall", 0.6, 0.03, CENTRE).position
    assert given_path(f"cube:wall,{text}").rows.position.tolist() == wanted.tolist()


@pytest.mark.parametrize(
    "text", ["rz=90deg,ry=0,rx=180deg", "rx=3.141592653589793,rz=1.5707963267948966,ry=0"]
)
def test_the_tool_is_held_by_moving_angles(text: str) -> None:
    rotation = there(given_path(f"cube:wall,{CUBE},{text}").rows.rotation)
    turned = Rotation.from_euler("ZYX", [90, 0, 180], degrees=True).as_matrix()
    # Sines and cosines of quarter turns, rounded.
    np.testing.assert_allclose(rotation, [turned] * 6, rtol=0, atol=1e-15)


LENGTH, ANGLE = (
    "allowed: a length in m, such as 0.6 or 600mm",
    "allowed: an angle in rad, such as 1.57 or 90deg",
)
NEEDED = "allowed: all of a, r, x, y, z"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("cube:", ["found no a, r, x, y, z, " + NEEDED, "found '', allowed: wall, diagonal"]),
        (f"cube:wal,{CUBE}", ["found 'wal' (did you mean wall?), allowed: wall, diagonal"]),
        (f"cube:wall,{CUBE},plane=c1", ["plane of a wall section: found 'c1', allowed: xy, xz, yz"]),
        (f"cube:diagonal,{CUBE},plane=", ["plane of a diagonal section: found '', allowed: c1, c2, c3, c4"]),
        ("cube:wall,a=0.06,r=30mm,x=0,y=0,z=0", ["found a = 0.06 m, allowed: more than 2 r = 0.06 m"]),
        ("cube:wall,a=0,r=0,x=0,y=0,z=0", ["found a = 0 m, allowed: more than 0"]),
        ("cube:wall,a=1,r=-1mm,x=0,y=0,z=0", ["found r = -0.001 m, allowed: 0 or more"]),
        ("cube:wall,a=1,r=0.1,x=1e300,y=0,z=0", ["found x=1e300, allowed: up to 1e+09 m"]),
        (
            "cube:wall,a=1e999,r=nan,x=inf,y=1deg,z=",
            [f"found {found}, {LENGTH}" for found in ("a=1e999", "r=nan", "x=inf", "y=1deg", "z=")],
        ),
        (
            "cube:diagonal,a=-2,x=q,foo,side=1,a=3,plane=xy,rz=1mm",
            [
                "found 'foo', allowed: KEY=VALUE with a decimal point, such as a=0.6",
                "key: found 'side', allowed: a, r, x, y, z, plane, rz, ry, rx",
                "found a twice, allowed: each key once",
                f"found x=q, {LENGTH}",
                f"found rz=1mm, {ANGLE}",
                f"found no r, y, z, {NEEDED}",
                "found rz alone, allowed: all of rz, ry, rx, or none",
                "plane of a diagonal section: found 'xy', allowed: c1, c2, c3, c4",
                "found a = -2 m, allowed: more than 0",
            ],
        ),
    ],
)  # fmt: skip
def test_all_that_is_wrong_with_a_cube_is_said(text: str, said: list[str]) -> None:
    assert refused(text) == [f"path: {line}" for line in said]


# Rows as arrays


def test_rows_are_taken_as_they_are() -> None:
    """One radius, variant or rotation is that of all rows."""
    found = given_path(PathRows(LINE, 0.1, corner=True, variant=1, rotation=np.eye(3)))
    assert found.rows.position.tolist() == LINE
    assert (found.rows.radius.tolist(), found.rows.corner) == ([0.0, 0.1, 0.0], True)
    assert found.rows.variant.tolist() == [1, 1, 1]
    assert there(found.rows.rotation).tolist() == [np.eye(3).tolist()] * 3
    assert (found.name, len(found.rows), found.file) == ("path", 3, None)


def test_a_rotation_of_seven_digits_becomes_the_nearest() -> None:
    """As of targets."""
    turned = Rotation.from_euler("ZYX", [0.3, -0.2, 0.1]).as_matrix()
    rotation = there(given_path(PathRows(np.array(LINE), rotation=np.round(turned, 7))).rows.rotation)
    np.testing.assert_allclose(rotation @ rotation.transpose(0, 2, 1), [np.eye(3)] * 3, rtol=0, atol=1e-15)
    np.testing.assert_allclose(rotation, [turned] * 3, rtol=0, atol=1e-7)


def with_(**changed: Any) -> PathRows:
    """Return sound rows but for what is changed."""
    sound = {"position": np.array(LINE), "radius": np.zeros(3), "corner": False, "variant": np.full(3, 2)}
    return PathRows(**{**sound, **changed})


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (
            {"position": np.zeros((3, 2))},
            ["found position of shape (3, 2), allowed: numbers of shape (n, 3)"],
        ),
        (
            {"radius": None, "variant": [[1], [2, 3]], "rotation": np.eye(2)},
            [
                "found radius that is not an array of numbers, allowed: numbers of shape (n,)",
                "found variant that is not an array of numbers, allowed: numbers of shape (n,)",
                "found rotation of shape (2, 2), allowed: numbers of shape (n, 3, 3)",
            ],
        ),
        (
            {"position": None, "radius": [0], "variant": 1, "rotation": "z"},
            [
                "found position that is not an array of numbers, allowed: numbers of shape (n, 3)",
                "found rotation that is not an array of numbers, allowed: numbers of shape (n, 3, 3)",
            ],
        ),
        (
            {"radius": np.zeros(2)},
            ["found 3 of position, 2 of radius, 3 of variant, allowed: as many rows of each"],
        ),
    ],
)
def test_rows_of_other_shapes_are_refused(changed: dict[str, Any], said: list[str]) -> None:
    assert refused(with_(**changed)) == [f"path: {line}" for line in said]


def test_all_that_is_wrong_with_rows_is_said() -> None:
    position = np.array(LINE)
    position[1, 2] = np.nan
    rotation = np.stack([np.diag([1.0, 1.0, -1.0]), np.eye(3), 2.0 * np.eye(3)])
    rows = with_(
        position=position,
        radius=np.array([0.1, -1.0, np.inf]),
        variant=[1, 3, np.nan],
        rotation=rotation,
    )
    assert refused(rows) == [
        "row 2: path: the position is 1, 0, nan m, allowed: finite numbers",
        "row 1: path: the orientation is not a rotation: its determinant is -1, a mirror, allowed: 1",
        "row 3: path: the orientation is not a rotation: R^T R differs from 1 by 3, allowed: 1e-06",
        "row 2, column radius: path: found -1 m, allowed: finite, 0 or more",
        "row 3, column radius: path: found inf m, allowed: finite, 0 or more",
        "row 2, column variant: path: found 3, allowed: 1 or 2",
        "row 3, column variant: path: found nan, allowed: 1 or 2",
    ]


@pytest.mark.parametrize(("count", "said"), [(0, "0 rows"), (1, "1 row")])
def test_a_path_has_two_rows(count: int, said: str) -> None:
    none = with_(position=np.zeros((count, 3)), radius=np.zeros(count), variant=np.full(count, 2))
    assert refused(none, PathError) == [f"path: found {said}, allowed: 2 or more"]
