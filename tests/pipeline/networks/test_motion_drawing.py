"""Planar networks in their plane, and networks in motion: drawing, recording and camera."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asserting import there
from made_networks import X, Y, Z, at, found
from network_motions import DrivenNetwork, drive
from presented import scene_of
from recorded import entities, rows_of, static, times_of, views
from toys import eye_of, recorded, shown
from urmpipe_models.elementwise import ZERO, FloatArray, Vector
from urmpipe_models.math3d import to_matrices
from urmpipe_models.networks.file import Network, load_network
from urmpipe_models.networks.parts import Body, ConstraintElement, Control, Expression, Joint, frame_from_axes
from urmpipe_pipeline.networks.finding import Search, find_network
from urmpipe_pipeline.networks.motion_drawing import (
    MovingNetwork,
    motion_space_figure,
    motion_svg,
    moving_scene,
)
from urmpipe_pipeline.networks.scene import motion_plane
from urmpipe_pipeline.networks.sketch import mechanism_svg
from urmpipe_pipeline.presentation.scene import PlaneView, Scene
from urmpipe_pipeline.recording.views.camera import FIELD_OF_VIEW
from urmpipe_pipeline.report.space import drawn_space
from urmpipe_pipeline.results import present

SVG = "{http://www.w3.org/2000/svg}"
SINGLE = 1e-6
"""The viewer's positions are in single precision: 1e-7 of 1 m, and quaternions likewise."""

PIXEL = 0.2e-3
"""A place in [m] in a drawing of 560 px per m: pixels have one decimal, those of an axis, too."""


def planes(network: Network) -> PlaneView | None:
    return motion_plane(find_network(network, "check", Search({})))


def metres(svg: ET.Element) -> tuple[FloatArray, FloatArray]:
    """Return the scale of a drawing with one view in [m] per pixel, and its origin in pixels, (2,) each."""
    axes: dict[str, list[tuple[float, float]]] = {"middle": [], "end": []}
    for one in svg.iter(f"{SVG}text"):
        if one.get("font-size") == "11" and "[m]" not in there(one.text):
            name, shift = ("x", 0.0) if one.get("text-anchor") == "middle" else ("y", 4.0)
            place = float(there(one.get(name))) - shift
            axes[there(one.get("text-anchor"))].append((float(there(one.text)), place))
    ticks = [np.array(axes[name]).T for name in ("middle", "end")]
    fits = [np.polyfit(values, places, 1) for values, places in ticks]
    return np.array([1.0 / fit[0] for fit in fits]), np.array([fit[1] for fit in fits])


def pins(svg: ET.Element, colours: tuple[str, ...] = ("#303a42", "#c25000")) -> FloatArray:
    """Return the middles of round symbols of joints in [m], shape (n, 2), in no order."""
    scale, origin = metres(svg)
    polygons = [
        np.array([pair.split(",") for pair in there(one.get("points")).split()], float)
        for one in svg.iter(f"{SVG}polygon")
        if one.get("stroke") in colours
    ]
    middles = [(one.min(axis=0) + one.max(axis=0)) / 2.0 for one in polygons if len(one) == 20]
    return np.asarray((np.array(middles) - origin) * scale)


def names(svg: ET.Element) -> list[str]:
    return [there(one.text) for one in svg.iter(f"{SVG}text") if one.get("class") == "name"]


# --- planar networks -------------------------------------------------------------------------------


def test_a_four_bar_is_drawn_at_its_closed_form() -> None:
    crank, rocker = 0.9, 1.481134361  # as the file of the network has them
    svg = ET.fromstring(mechanism_svg(found("four-bar")))
    wanted = [[0.0, 0.0], [0.4 * np.cos(crank), 0.4 * np.sin(crank)], [1.0, 0.0]]
    wanted.append([1.0 + 0.7 * np.cos(rocker), 0.7 * np.sin(rocker)])
    drawn = pins(svg)
    for place in wanted:
        assert np.abs(drawn - place).max(axis=1).min() < PIXEL
    assert len(drawn) == 4
    assert "along z" in [one.text for one in svg.iter(f"{SVG}text")]


def test_a_network_in_the_xz_plane_is_seen_along_y() -> None:
    result = found("bars")
    assert motion_plane(result) == PlaneView(X, Z)
    svg = ET.fromstring(mechanism_svg(result))
    texts = [one.text for one in svg.iter(f"{SVG}text")]
    assert {"along y", "x [m]", "z [m]"} <= set(texts)
    poses = dict(zip(result.network.body_names, result.assemblies[0].poses, strict=True))
    for place in (poses["crank"], poses["coupler"], poses["rocker"]):  # their origins are joints
        assert np.abs(pins(svg) - place[[0, 2], 3]).max(axis=1).min() < PIXEL
    eye, target = eye_of(present(result))
    way = (eye - target) / np.linalg.norm(eye - target)
    assert way[1] < -0.9  # from the front: z is up, and x to the right
    assert abs(way[0]) < 1e-6
    camera = drawn_space(motion_space_figure(still(result))).spec["layout"]["scene"]["camera"]
    assert camera["up"] == {"x": 0.0, "y": 0.0, "z": 1.0}
    assert camera["eye"]["y"] < -5.0 * abs(camera["eye"]["x"])


def still(result: Any) -> MovingNetwork:
    """Return an assembly as a motion of one instant."""
    return MovingNetwork(
        result.network, result.assemblies[0].poses[np.newaxis], np.empty((1, 0)), np.zeros(1, np.int64)
    )


@pytest.mark.parametrize("name", ["rssr", "sarrus", "screw-jack", "stewart-gough", "zoo", "bennett"])
def test_a_spatial_network_has_three_projections(name: str) -> None:
    assert motion_plane(found(name)) is None
    titles = [one.text for one in ET.fromstring(mechanism_svg(found(name))).iter(f"{SVG}text")]
    assert {"from the side", "from the front", "from above"} <= set(titles)


def slanted(n: Vector) -> Network:
    """Two links with joints about an axis."""
    m = tuple(np.cross(n, (0.0, 0.6, -0.8) if n != X else Y).tolist())
    m = tuple((np.array(m) / np.linalg.norm(m)).tolist())
    frames = frame_from_axes(m, n, ZERO), frame_from_axes(m, n, tuple((0.4 * np.array(m)).tolist()))
    joints = (
        Joint("A", "revolute", ("ground", "a"), (frames[0], frames[0]), (0.5,)),
        Joint("B", "revolute", ("a", "b"), (frames[1], frames[0]), (0.7,)),
    )
    return Network("slanted", (Body("a"), Body("b")), joints)


@pytest.mark.parametrize("n", [X, (0.0, 0.8, 0.6), (0.6, 0.0, -0.8)])
def test_an_oblique_plane_is_seen_along_its_normal(n: Vector) -> None:
    axes = there(planes(slanted(n))).axes
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)  # rounding
    assert abs(axes[:, 2] @ np.array(n)) == pytest.approx(1.0, abs=1e-12)
    assert axes[np.argmax(np.abs(axes[:, 0])), 0] > 0.0


@pytest.mark.parametrize(("height", "planar"), [(0.0, True), (0.1, False)])
def test_rods_are_planar_if_they_lie_in_the_plane(height: float, planar: bool) -> None:
    rod = ConstraintElement(
        "rod", "gg", ("ground", "boom"), Expression("0.9"), ((0.6, -0.3, height), (0.8, 0.0, 0.0))
    )
    pivot = Joint("pivot", "revolute", ("ground", "boom"), (at(ZERO, Z), at(ZERO, Z)), (0.7,))
    assert (planes(Network("boom", (Body("boom"),), (pivot,), (rod,))) is not None) == planar


# --- motion ----------------------------------------------------------------------------------------


def legs() -> Network:
    """The hexapod of the catalogue with a control that changes two of its legs."""
    network = load_network("stewart-gough")
    lengths = [float(one.length.value({})) for one in network.elements]
    drives = (f"{lengths[0]!r} + 0.1 * t", f"{lengths[1]!r} - 0.05 * t")
    moved = tuple(
        replace(one, length=Expression(drive)) for one, drive in zip(network.elements, drives, strict=False)
    )
    return replace(network, elements=(*moved, *network.elements[2:]), controls=(Control("t"),))


@cache
def motion(name: str) -> DrivenNetwork:
    match name:
        case "four-bar":
            return drive(load_network(name), np.linspace(0.9, 0.9 + 2.0 * np.pi, 73))
        case "legs":
            return drive(legs(), np.linspace(0.0, 0.5, 26))
    start = load_network(name).controls[0].start
    return drive(load_network(name), start + np.linspace(0.0, 1.0, 21))


def scene_at(name: str, body: str, point: Vector) -> tuple[DrivenNetwork, FloatArray, Scene]:
    """Return a motion, the path of a point, and their scene."""
    moved = motion(name)
    path = moved.trace(body, point)
    return moved, path, moving_scene(MovingNetwork(*moved, [("P", path)], name))


@pytest.mark.parametrize(
    ("name", "body"), [("four-bar", "coupler"), ("slider-crank", "slider"), ("rssr", "output")]
)
def test_the_viewer_moves_bodies_by_their_poses(name: str, body: str, tmp_path: Path) -> None:
    moved, path, scene = scene_at(name, body, (0.1, 0.2, 0.0))
    file = recorded(shown(scene=scene), tmp_path)
    poses = moved.poses[:, moved.network.body_names.index(body)]
    entity = f"/shown/scene/bodies/{body}"
    assert times_of(file, entity) == moved.t_ns.tolist()
    moves = [
        np.array([row[0] for row in rows_of(file, entity, f"Transform3D:{part}").values()])
        for part in ("translation", "quaternion")
    ]
    np.testing.assert_allclose(moves[0], poses[:, :3, 3], atol=SINGLE)
    np.testing.assert_allclose(to_matrices(moves[1]), poses[:, :3, :3], atol=SINGLE)
    first = np.array(static(file, f"{entity}/surface", "Mesh3D:vertex_positions"))
    at_rest = {one.name: one for one in scene_of(present(found(name))).solids}
    placed = first @ poses[0, :3, :3].T + poses[0, :3, 3]
    np.testing.assert_allclose(placed, at_rest[body].triangles.reshape(-1, 3), atol=2.0 * SINGLE)
    points = rows_of(file, "/shown/scene/point/P", "Points3D:positions")
    np.testing.assert_allclose([row[0] for row in points.values()], path, atol=SINGLE)
    assert not {one for one in entities(file, "/shown/scene/bodies/ground") if times_of(file, one)}


def test_a_joint_moves_with_its_bodies(tmp_path: Path) -> None:
    """The block slides with the slider, the pin turns with the rod, the rail of the ground rests."""
    moved, _, scene = scene_at("slider-crank", "rod", ZERO)
    file = recorded(shown(scene=scene), tmp_path)
    for joint, body in (("s", "slider"), ("B", "rod"), ("A", "arm")):
        rows = rows_of(file, f"/shown/scene/joints/{joint}", "Transform3D:translation")
        poses = moved.poses[:, moved.network.body_names.index(body)]
        np.testing.assert_allclose([row[0] for row in rows.values()], poses[:, :3, 3], atol=SINGLE)
    (rail,) = static(file, "/shown/scene/joints/s\\ rail/lines", "LineStrips3D:strips")
    slides = moved.poses[:, moved.network.body_names.index("slider"), 0, 3]
    assert min(np.array(rail)[:, 0]) < slides.min()
    assert max(np.array(rail)[:, 0]) > slides.max()


def test_rods_keep_their_lengths_over_time(tmp_path: Path) -> None:
    moved, _, scene = scene_at("legs", "platform", ZERO)
    file = recorded(shown(scene=scene), tmp_path)
    for k, element in enumerate(moved.network.elements):
        rows = rows_of(file, f"/shown/scene/elements/{element.name}", "LineStrips3D:strips")
        assert list(rows) == moved.t_ns.tolist()
        ends = np.array([strips[0] for strips in rows.values()])
        spans = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        np.testing.assert_allclose(spans, moved.lengths[:, k], atol=2.0 * SINGLE)
        np.testing.assert_allclose(ends[:, 0], np.tile(element.points[0], (len(ends), 1)), atol=SINGLE)


def test_what_moves_is_sent_at_50_hz_at_most(tmp_path: Path) -> None:
    moved = motion("rssr")
    fast = moved._replace(t_ns=np.arange(len(moved.t_ns)) * 5_000_000)
    file = recorded(shown(scene=moving_scene(MovingNetwork(*fast))), tmp_path)
    times = np.array(times_of(file, "/shown/scene/bodies/coupler"))
    assert np.diff(times).min() >= 20_000_000
    assert (times[0], times[-1]) == (fast.t_ns[0], fast.t_ns[-1])


@pytest.mark.parametrize("name", ["four-bar", "rssr", "legs"])
def test_the_view_holds_all_instants(name: str) -> None:
    moved, path, scene = scene_at(name, {"legs": "platform"}.get(name, "coupler"), (0.3, 0.4, 0.0))
    eye, target = eye_of(shown(scene=scene))
    origins = moved.poses[:, :, :3, 3].reshape(-1, 3)
    ends = [line.reshape(-1, 3) for one in scene.moving_lines for line in one.lines]
    ways = np.concatenate([origins, path, *ends]) - eye
    ahead = (target - eye) / np.linalg.norm(target - eye)
    up = np.array((0.0, 0.0, 1.0) if scene.plane is None else scene.plane.up)
    up = up - (up @ ahead) * ahead
    up /= np.linalg.norm(up)
    assert np.abs(np.arctan2(ways @ up, ways @ ahead)).max() < FIELD_OF_VIEW / 2.0


def test_a_planar_motion_is_seen_with_its_y_upwards(tmp_path: Path) -> None:
    _, _, scene = scene_at("four-bar", "coupler", ZERO)
    assert scene.plane == PlaneView(X, Y)
    file = recorded(shown(scene=scene), tmp_path)
    assert views(file)["EyeControls3D:eye_up"] == [[0.0, 1.0, 0.0]]


def test_labels_at_one_place_are_moved_apart(tmp_path: Path) -> None:
    """The slider, its pin and its block stand at one point."""
    _, _, scene = scene_at("slider-crank", "rod", ZERO)
    file = recorded(shown(scene=scene), tmp_path)
    labels = ("bodies/slider", "joints/B", "joints/s")
    first = [
        next(iter(rows_of(file, f"/shown/scene/labels/{one}", "Points3D:positions").values()))[0]
        for one in labels
    ]
    apart = [np.linalg.norm(np.subtract(first[k], first[k - 1])) for k in range(3)]
    assert min(apart) > 0.02  # a line of text in a scene of 1 m


def test_the_drawing_of_a_motion_has_curves_and_further_instants() -> None:
    moved, path, _ = scene_at("four-bar", "coupler", (0.5, 0.25, 0.0))
    svg = ET.fromstring(motion_svg(MovingNetwork(*moved, [("P", path)], "moving")))
    scale, origin = metres(svg)
    (curve,) = [
        one for one in svg.iter(f"{SVG}polyline") if len(there(one.get("points")).split()) == len(path)
    ]
    points = np.array([pair.split(",") for pair in there(curve.get("points")).split()], float)
    np.testing.assert_allclose((points - origin) * scale, path[:, :2], atol=2.0 * PIXEL)
    assert "P start and end" in names(svg)  # one turn of the crank
    (mark,) = svg.iter(f"{SVG}circle")
    place = np.array([float(there(mark.get(name))) for name in ("cx", "cy")])
    np.testing.assert_allclose((place - origin) * scale, path[0, :2], atol=2.0 * PIXEL)
    faint = [one for one in svg.iter(f"{SVG}polygon") if one.get("stroke-opacity")]
    assert len(faint) == 6 * 3  # six further instants of three moving bodies
    half = motion_svg(
        MovingNetwork(
            moved.network, moved.poses[:40], moved.lengths[:40], moved.t_ns[:40], [("P", path[:40])], "half"
        )
    )
    assert {"P start", "P end"} <= set(names(ET.fromstring(half)))


def test_a_spatial_motion_is_drawn_in_three_projections() -> None:
    moved, path, _ = scene_at("legs", "platform", ZERO)
    svg = ET.fromstring(motion_svg(MovingNetwork(*moved, [("P", path)], "legs")))
    assert len([one for one in svg.iter(f"{SVG}polyline") if one.get("stroke") == "#21c3ff"]) == 3


def test_the_page_has_curves_and_bodies_at_the_first_instant() -> None:
    moved, path, _ = scene_at("rssr", "coupler", ZERO)
    figure = motion_space_figure(MovingNetwork(*moved, [("P", path)]))
    data = drawn_space(figure).spec["data"]
    assert next(one["name"] for one in data if one["type"] == "scatter3d") == "P"
    assert {one["legendgroup"] for one in data if one["type"] == "mesh3d"} >= {"ground", "coupler", "driven"}
