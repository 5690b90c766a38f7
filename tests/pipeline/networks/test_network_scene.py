"""A network in space, in a recording and on a page: shapes where its parts are, others as ghosts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from asserting import there
from made_networks import NAMES, found
from presented import scene_of
from recorded import entities, static, views
from same_results import assert_same
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.networks.parts_in_space import Part, Placed, parts, placed
from urmpipe_pipeline.networks.result import NetworkResult
from urmpipe_pipeline.networks.scene import FEW, MANY, shown_assembly
from urmpipe_pipeline.networks.shapes import ball, bar, box, helix, hull, sheet
from urmpipe_pipeline.presentation.figure import SpaceFigure
from urmpipe_pipeline.presentation.scene import Solid
from urmpipe_pipeline.recording.views.solids import normals
from urmpipe_pipeline.report.space import drawn_space
from urmpipe_pipeline.results import present, read_recording, write_recording

ROUNDING = 1e-12
"""In [m], of places within a few metres."""


def at_rest(result: NetworkResult) -> Placed:
    return placed(result.network, there(shown_assembly(result)))


def by_name(at: Placed, kind: str) -> dict[str, Part]:
    return {one.name: one for one in parts(at) if one.kind == kind}


# --- shapes ----------------------------------------------------------------------------------------


def volume(triangles: FloatArray) -> float:
    """The volume that triangles enclose in [m3], positive where they face outwards (Gauss)."""
    a, b, c = triangles.transpose(1, 0, 2)
    return float(np.einsum("ni,ni->", a, np.cross(b, c)) / 6.0)


CORNERS = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (0.0, 3.0)])
SLOPE = np.array([2.0, -1.0, 2.0]) / 3.0


@pytest.mark.parametrize(
    ("triangles", "wanted", "within"),
    [
        (bar(np.zeros(3), 2.0 * SLOPE, 0.5, 200), 2.0 * np.pi * 0.25, 1e-3),
        (box(np.ones(3), np.eye(3), (1.0, 2.0, 3.0)), 6.0, ROUNDING),
        (ball(np.ones(3), 1.0, 200), 4.0 / 3.0 * np.pi, 1e-2),
        (hull(CORNERS, 0.1)[0], 6.0, ROUNDING),
        (hull(CORNERS[:4], 0.1)[0], 0.6, ROUNDING),
    ],
)
def test_shapes_enclose_their_volumes_and_face_outwards(
    triangles: FloatArray, wanted: float, within: float
) -> None:
    """Polygons of 200 sides fall short of circles by 2e-4 of their area, of a ball by some 3e-4 twice."""
    assert volume(triangles) == pytest.approx(wanted, rel=within)


def test_a_hull_has_the_edges_of_its_shape() -> None:
    assert len(hull(CORNERS, 0.1)[1]) == 2 * 12  # of a box, each from both sides; no diagonal
    assert len(hull(CORNERS[:4], 0.1)[1]) == 4


def test_a_sheet_is_flat_and_a_helix_winds() -> None:
    found_sheet = sheet(np.ones(3), SLOPE, 0.4).reshape(-1, 3)
    np.testing.assert_allclose((found_sheet - 1.0) @ SLOPE, 0.0, atol=ROUNDING)
    line = helix(np.zeros(3), SLOPE, 0.1, 2.0, 3)
    np.testing.assert_allclose(
        np.linalg.norm(line - np.outer(line @ SLOPE, SLOPE), axis=1), 0.1, atol=ROUNDING
    )
    np.testing.assert_allclose([line[0] @ SLOPE, line[-1] @ SLOPE], [-1.0, 1.0], atol=ROUNDING)


def test_normals_are_of_length_1_also_of_no_area() -> None:
    flat = np.zeros((1, 3, 3))
    found_normals = normals(np.concatenate((bar(np.zeros(3), SLOPE, 0.1), flat)))
    np.testing.assert_allclose(np.linalg.norm(found_normals, axis=1), 1.0, atol=ROUNDING)


# --- parts -----------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_symbols_stand_on_the_axes_of_their_joints(name: str) -> None:
    result = found(name)
    at = at_rest(result)
    for joint in result.network.joints:
        (piece,) = by_name(at, "joint")[joint.name].pieces
        middle = np.unique(np.round(piece.reshape(-1, 3), 13), axis=0).mean(axis=0)
        first = at.point(joint.bodies[0], joint.frames[0].translation)
        second = at.point(joint.bodies[1], joint.frames[1].translation)
        n = at.axes(joint.bodies[0], joint.frames[0])[:, 1]
        stands = second if joint.kind in ("prismatic", "cylindrical", "helical", "user") else first
        np.testing.assert_allclose(middle, stands, rtol=0, atol=ROUNDING)
        if joint.kind not in ("user", "global") and joint.name not in [
            one.name for one in result.closure_errors
        ]:
            away = middle - first
            np.testing.assert_allclose(away - (away @ n) * n, 0.0, rtol=0, atol=1e-9)  # as far as it closes


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_bodies_reach_their_joints_and_elements(name: str) -> None:
    result = found(name)
    at = at_rest(result)
    shapes = {one: np.concatenate(part.pieces).reshape(-1, 3) for one, part in by_name(at, "body").items()}
    for joint in result.network.joints:
        for body, frame in zip(joint.bodies, joint.frames, strict=True):
            away = np.linalg.norm(shapes[body] - at.point(body, frame.translation), axis=1)
            low, high = shapes[body].min(axis=0), shapes[body].max(axis=0)
            point = at.point(body, frame.translation)
            assert away.min() < 0.02 * at.extent or ((point >= low) & (point <= high)).all()


def test_elements_show_what_they_hold() -> None:
    """The zoo does not close: so lengths are measured of what is drawn, as given."""
    result = found("zoo")
    at = at_rest(result)
    drawn = by_name(at, "element")
    rod, table, tube, skew = (drawn[name] for name in ("rod", "table", "tube", "skew"))
    ends = [at.point("ground", (0.0, 0.3, 0.0)), at.point("b2", (0.1, 0.0, 0.0))]
    np.testing.assert_allclose(rod.lines[0], ends, atol=ROUNDING)
    np.testing.assert_allclose(table.pieces[0][..., 2], 0.2, atol=ROUNDING)  # the plane z = h of the ground
    from_axis = np.linalg.norm(tube.pieces[0].reshape(-1, 3)[:, :2] - [0.9, 0.3], axis=1)
    np.testing.assert_allclose(from_axis, 0.1, atol=ROUNDING)
    first, second, between = skew.lines
    across = between[1] - between[0]
    for line in (first, second):
        assert abs(float(across @ (line[1] - line[0]))) < ROUNDING


# --- the scene -------------------------------------------------------------------------------------


def solids_of(result: NetworkResult) -> dict[str, Solid]:
    return {f"{one.group}/{one.name}": one for one in scene_of(present(result)).solids}


def test_further_assemblies_are_ghosts_with_names() -> None:
    result = found("stewart-gough", every=True)
    ghosts = [one for one in scene_of(present(result)).solids if one.group == "ghosts"]
    assert [one.name for one in ghosts] == [f"assembly {k}" for k in range(2, len(result.assemblies) + 1)]
    assert all(one.opacity < 0.3 for one in ghosts)
    hidden = [one.hidden for one in ghosts]
    assert hidden == [len(ghosts) > MANY and k >= FEW for k in range(len(ghosts))]


def test_what_does_not_close_is_shown_where_it_comes_nearest() -> None:
    result = found("too long")
    shown = scene_of(present(result))
    assert "nearest to closing" in shown.title
    gap = {one.name: one for one in shown.solids}["C"].lines[0]
    assert np.linalg.norm(gap[1] - gap[0]) == pytest.approx(result.closure_errors[0].metres, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["zoo", "stewart-gough"])
def test_a_recording_has_an_entity_a_part(name: str, tmp_path: Path) -> None:
    result = found(name, every=True)
    path = write_recording(result, tmp_path / "n.rrd")
    there_are = entities(path, "/shown/scene")
    for key, solid in solids_of(result).items():
        group, part = key.split("/")
        entity = f"/shown/scene/{group}/{part.replace(' ', chr(92) + ' ')}"
        assert {f"{entity}/surface", f"{entity}/label"} <= there_are
        corners = np.array(static(path, f"{entity}/surface", "Mesh3D:vertex_positions"))
        np.testing.assert_allclose(
            corners, solid.triangles.reshape(-1, 3), rtol=0, atol=1e-6
        )  # single precision
        assert static(path, f"{entity}/label", "Points3D:labels") == [solid.label]


def test_of_many_ghosts_only_some_are_seen_at_first(tmp_path: Path) -> None:
    """The others are there to be switched on."""
    two = found("bars", every=True)
    result = replace(two, assemblies=8 * two.assemblies)
    path = write_recording(result, tmp_path / "n.rrd")
    ghosts = 8 * len(two.assemblies) - 1
    assert views(path)["EntityBehavior:visible"] == [False] * (ghosts - FEW)
    names = {one.split("/")[4] for one in entities(path, "/shown/scene/ghosts") if one.count("/") > 4}
    assert len(names) == ghosts


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_it_comes_back_as_it_was(name: str, tmp_path: Path) -> None:
    """Of the recording, too: with controls without an end, and in all configurations."""
    result = found(name, every=True)
    back = read_recording(write_recording(result, tmp_path / "n.rrd"))
    assert_same(back, result)
    assert back.to_dict() | {"output": None} == result.to_dict()


# --- the page --------------------------------------------------------------------------------------


def test_a_page_draws_solids_with_their_lines_and_words() -> None:
    triangles = box(np.zeros(3), np.eye(3), (1.0, 1.0, 1.0))
    line = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    solids = (
        Solid("bodies", "a", "#112233", triangles, (line,), 0.5, "A", (0.0, 0.0, 1.0), "bodies"),
        Solid("bodies", "b", "#445566", triangles + 3.0, legend="bodies", hidden=True),
    )
    data = drawn_space(SpaceFigure("S", "C.", "A.", solids=solids)).spec["data"]
    assert [one["type"] for one in data] == ["mesh3d", "scatter3d", "scatter3d", "mesh3d"]
    assert [one["showlegend"] for one in data] == [True, False, False, False]
    assert {one["legendgroup"] for one in data} == {"bodies"}
    assert data[3]["visible"] == "legendonly"
    assert (data[0]["color"], data[0]["opacity"], data[2]["text"]) == ("#112233", 0.5, ["A"])
    assert max(max(data[0][k]) for k in "ijk") == 7  # eight corners, each once
    assert len(data[0]["i"]) == 12
