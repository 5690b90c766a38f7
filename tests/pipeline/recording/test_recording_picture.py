"""What a user sees: recordings opened in the viewer itself, without a window, and looked at."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from asserting import there
from made_plans import FAILED, SMALL, limited, planned
from recordable import build_comparison, build_run, build_solved
from shapes_arm import arm_of_shapes
from toys import eye_of
from urmpipe_models.arm.solids import build_placeholder_solids
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import Targets
from urmpipe_models.kinematics.forward import frames_over_log
from urmpipe_models.robots.urdf import read_urdf
from urmpipe_pipeline.presentation.palette import (
    AXIS_COLOURS,
    DEVIATION_COLOUR,
    JOINT_COLOURS,
    REFERENCE_COLOUR,
    ghost_colour,
    rgb,
    run_colour,
)
from urmpipe_pipeline.recording.viewer import open_window, openings, run_viewer
from urmpipe_pipeline.recording.views.camera import FIELD_OF_VIEW
from urmpipe_pipeline.results import present, write_recording
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.simulations.simulation import Simulation

Picture = NDArray[np.uint8]
Eye = tuple[FloatArray, FloatArray]

DRIVERS = sorted(Path("/usr/share/vulkan/icd.d").glob("lvp_icd*.json"))
PATIENCE = 40.0
"""Time in [s] that the viewer has to load and draw: a software rasterizer on a busy machine is slow."""

ARM = "Arm and"
"""How the names of 3D views begin."""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not DRIVERS,
        reason="no software Vulkan to draw with: apt-get install mesa-vulkan-drivers libvulkan1",
    ),
]


@pytest.fixture
def viewer(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Return Rerun's viewer, headless, with nothing open; it draws in software, and may not complain."""
    monkeypatch.setenv("VK_ICD_FILENAMES", str(DRIVERS[0]))
    with run_viewer(headless=True) as (process, url):
        client = connected(process, url)
        yield client
        assert complaints(client) == []


def connected(process: subprocess.Popen[bytes], url: str) -> Any:
    """Return what controls a viewer, once it listens."""
    from rerun.experimental import ViewerClient

    end = time.monotonic() + PATIENCE
    while process.poll() is None and time.monotonic() < end:
        try:
            return ViewerClient.connect(url)
        except OSError:
            time.sleep(0.1)
    raise AssertionError("the viewer does not listen")


def counts(picture: Picture, colours: Sequence[str]) -> list[int]:
    """Return how many pixels have each colour, whatever its brightness: balls are shaded, lines smoothed."""
    red, green, blue = np.moveaxis(picture, 2, 0)
    bright = picture[np.maximum(np.maximum(red, green), blue) >= 60].astype(float)
    hues = bright / bright.max(axis=1, keepdims=True)
    wanted = (np.array(rgb(colour)) / max(rgb(colour)) for colour in colours)
    return [int((np.abs(hues - one).max(axis=1) <= 0.06).sum()) for one in wanted]


def complaints(viewer: Any) -> list[str]:
    """Return what the viewer has to say against what it shows."""
    said = [f"{view.name}: {report}" for view in viewer.get_state().views for report in view.reports]
    logged = [entry for entry in viewer.get_logs() if entry.level not in ("INFO", "DEBUG", "TRACE")]
    return said + [entry.message for entry in logged if "Software rasterizer" not in entry.message]


def picture_at(
    viewer: Any, at: float, recording: Path, drawn: Callable[[Picture], bool], view: str = ""
) -> Picture:
    """Return the picture at a time in [s], of a view or of all, once it is drawn as wanted or patience ends.

    Data load bit by bit: an early picture shows less and no error.
    """
    from PIL import Image

    end, target = time.monotonic() + PATIENCE, recording.with_suffix(".png")
    while not (views := [one for one in viewer.get_state().views if one.name.startswith(view)]):
        assert time.monotonic() < end, f"the viewer showed no view {view}"
        time.sleep(0.1)
    viewer.set_time(timeline="t", duration=at)
    while True:
        time.sleep(0.5)
        viewer.save_screenshot(str(target), **({"view_id": views[0].view_id} if view else {}))
        picture = np.asarray(Image.open(target).convert("RGB"))
        if drawn(picture) or time.monotonic() > end:
            return picture


def look(viewer: Any, recording: Path, at: float, right: Sequence[str]) -> Picture:
    """Open a recording, and return the picture at a time in [s] once its right half has all the colours."""
    viewer.open(str(recording))
    return picture_at(viewer, at, recording, lambda one: all(counts(one[:, one.shape[1] // 2 :], right)))


def projected(eye_and_target: Eye, points: FloatArray, picture: Picture) -> FloatArray:
    """Return where points in [m], shape (n, 3), stand in a picture of the 3D view, in pixels x, y."""
    eye, centre = eye_and_target
    forward = (centre - eye) / np.linalg.norm(centre - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    seen = (points - eye) @ np.column_stack((right, np.cross(forward, right), forward))
    height, width = picture.shape[:2]
    focal = height / 2 / np.tan(FIELD_OF_VIEW / 2)
    places: FloatArray = focal * seen[:, :2] / seen[:, 2:] + [width / 2, height / 2]
    return places


def around(picture: Picture, place: FloatArray, reach: int) -> Picture:
    """Return the pixels of a picture at most `reach` from a place."""
    x, y = np.rint(place).astype(int)
    return picture[max(0, y - reach) : y + reach + 1, max(0, x - reach) : x + reach + 1]


def view_names(viewer: Any) -> set[str]:
    return {view.name for view in viewer.get_state().views}


def assert_drawn(picture: Picture, left: Sequence[str], right: Sequence[str], least: int = 20) -> None:
    """Hold a picture against the colours that it must have in its halves."""
    middle = picture.shape[1] // 2
    for half, colours in ((picture[:, :middle], left), (picture[:, middle:], right)):
        found = dict(zip(colours, counts(half, colours), strict=True))
        assert min(found.values(), default=least) >= least, found


def test_a_run_in_the_viewer(viewer: Any, tmp_path: Path) -> None:
    path = write_recording(build_run(rows=4000), tmp_path / "run.rrd")
    picture = look(viewer, path, 12.0, JOINT_COLOURS[:6])
    # The arm's joints are balls in the colours of the series; the path is in the run's colour.
    assert_drawn(picture, left=[*JOINT_COLOURS[:5], run_colour(0)], right=JOINT_COLOURS[:6])
    wraps = len(build_run(rows=4000).repolarizations)
    wanted = {"Arm and paths [m]", "Joints in the file [rad]", f"Joints repolarized ({wraps} marked) [rad]"}
    assert wanted <= view_names(viewer)


def test_a_comparison_in_the_viewer(viewer: Any, tmp_path: Path) -> None:
    """The first run's name has everything that an entity's path must escape."""
    comparison = build_comparison(("a b/c.d [x] Ω", "reference"), rows=4000)
    path = write_recording(comparison, tmp_path / "comparison.rrd")
    right = [*JOINT_COLOURS[:6], *AXIS_COLOURS.values(), REFERENCE_COLOUR]
    picture = look(viewer, path, 12.0, right)
    assert_drawn(picture, left=[*JOINT_COLOURS[:5], REFERENCE_COLOUR], right=right)
    assert "delta = reference - log [mm]" in view_names(viewer)


def test_a_branch_in_the_viewer_is_there_only_where_there_is_a_solution_of_it(
    viewer: Any, tmp_path: Path
) -> None:
    """At 0.5 s neither the arm is there, whose joints have the same colours, nor a branch."""
    one = build_solved(rows=60, names=("up", "down"))
    one.solutions.q[20:30], one.solutions.reasons[20:30] = np.nan, "too far"
    one = replace(one, targets=Targets(one.targets.position), angle=None)
    path = write_recording(one, tmp_path / "solved.rrd")
    viewer.open(str(path))
    ghosts = [ghost_colour(0), ghost_colour(1)]

    def shows(wanted: bool, picture: Picture) -> bool:
        return [count >= 50 for count in counts(picture, ghosts)] == [wanted, wanted]

    for at, wanted in ((0.3, True), (0.5, False), (0.8, True)):
        picture = picture_at(viewer, at, path, partial(shows, wanted), ARM)
        assert shows(wanted, picture)
        assert counts(picture, [DEVIATION_COLOUR])[0] >= 20  # the targets missed stand at all times


def test_a_log_without_a_robot_in_the_viewer(viewer: Any, tmp_path: Path) -> None:
    run = replace(build_run(rows=1000), robot=None, tcp=None)
    picture = look(viewer, write_recording(run, tmp_path / "bare.rrd"), 2.0, JOINT_COLOURS[:6])
    assert_drawn(picture, left=[], right=JOINT_COLOURS[:6])
    assert "Arm and paths [m]" not in view_names(viewer)


def missed(eye: Eye, points: FloatArray, colours: Sequence[str], picture: Picture) -> list[str]:
    """Return the colours that do not stand where the points with them are projected.

    A joint's cylinder is wider than that, and the links that meet there hide up to half of it: of the 169
    pixels at most 6 from its middle, 20 are of its colour. That leaves room for rounding, for smoothed edges
    and for what hides it, not for a joint that stands beside the place.
    """
    places = projected(eye, points, picture)
    return [
        colour
        for colour, place in zip(colours, places, strict=True)
        if counts(around(picture, place, 6), [colour])[0] < 20
    ]


def assert_stands(
    viewer: Any, run: Run, folder: Path, colours: Sequence[str], middles: FloatArray, times: list[float]
) -> None:
    """Hold pictures at two times in [s] against middles of shapes in the frames of the first joints in [m].

    The times are such that nothing hides one.
    """
    eye, path = eye_of(present(run)), folder / "run.rrd"
    viewer.open(str(write_recording(run, path)))
    position, rotation = frames_over_log(
        there(run.robot), run.q[np.rint(np.array(times) / run.tsp).astype(int)]
    )
    frames = slice(1, 1 + len(middles))
    at_both = position[:, frames] + np.einsum("tkij,kj->tki", rotation[:, frames], middles)
    for at, standing in zip(times, at_both, strict=True):

        def drawn(picture: Picture, wanted: FloatArray = standing) -> bool:
            """Tell whether all points are where they should be."""
            return not missed(eye, wanted, colours, picture)

        picture = picture_at(viewer, at, path, drawn, ARM)
        assert missed(eye, standing, colours, picture) == [], f"at {at} s"
    # The last two move by more than twice the reach in which they are looked for.
    first, second = (projected(eye, standing, picture) for standing in at_both)
    assert (np.linalg.norm(second - first, axis=1)[-2:] > 2 * 6).all()


def test_the_arm_stands_where_its_kinematics_project_it(viewer: Any, tmp_path: Path) -> None:
    run = build_run(rows=4000)
    robot = there(run.robot)
    solids = build_placeholder_solids(robot, dict.fromkeys(robot.coordinates, (0.0, 0.0, 0.0, 1.0)))
    middles = np.array([one.origin.translation for one in solids if one.colour is not None], float)
    assert_stands(viewer, run, tmp_path, JOINT_COLOURS[:6], middles, [3.0, 8.5])


def test_a_robot_of_shapes_stands_where_its_kinematics_project_it(viewer: Any, tmp_path: Path) -> None:
    run = build_run(rows=4000, robot=read_urdf(arm_of_shapes(tmp_path)))
    middles, colours = np.tile([0.0, 0.0, 0.1], (4, 1)), ["#ff3333", "#33ff33", "#3366ff", "#ffff33"]
    assert_stands(viewer, run, tmp_path, colours, middles, [8.5, 13.0])


def test_a_long_log_is_seen_whole(viewer: Any, tmp_path: Path) -> None:
    """The viewer would open so long a log on one minute of it."""
    run = build_run(rows=120_000)
    path = write_recording(run, tmp_path / "long.rrd")
    # Both joints that turn on and on are seen up to the end of the log, left of the legend.
    picture = look(viewer, path, 12.0, JOINT_COLOURS[:6])
    width = picture.shape[1]
    late = picture[:, round(0.85 * width) : round(0.93 * width)]
    assert min(counts(late, [JOINT_COLOURS[0], JOINT_COLOURS[5]])) >= 20
    assert "Joints in the file [rad], every peak of 120,000 rows" in view_names(viewer)


def test_view_opens_where_the_verdict_was_decided_and_at_a_row_where_there_are_no_times(
    tmp_path: Path,
) -> None:
    comparison = build_comparison()
    decided = round(comparison.worst.worst_statistics.t_max * 1e9)
    for result, wanted in ((comparison, ("t", decided)), (build_solved(timed=False), ("row", 3))):
        path = write_recording(result, tmp_path / "opened.rrd")
        with open_window(path, openings([path])[path], headless=True) as (process, client):
            (shown,) = client.get_state().recordings
            assert (shown.current_timeline, shown.current_time) == wanted
            assert complaints(client) == []
        assert process.poll() is not None


def test_a_simulation_shows_its_arm_its_verdict_and_its_signals(
    viewer: Any, make_simulation: Callable[..., Simulation], tmp_path: Path
) -> None:
    path = write_recording(make_simulation(), tmp_path / "simulation.rrd")
    picture = look(viewer, path, 1.25, [AXIS_COLOURS["y"], AXIS_COLOURS["norm"], REFERENCE_COLOUR])
    assert view_names(viewer) >= {
        "Arm and paths [m]", "Summary", "log: q [rad]", "chain: p7 [m]", "meter: delta, norm [mm]",
        "meter: out_of_tolerance [-]",
    }  # fmt: skip
    # Lines of a pixel or two over some hundred pixels; the way of the tip, and its ball.
    lines = [AXIS_COLOURS["y"], AXIS_COLOURS["norm"], JOINT_COLOURS[0]]
    assert_drawn(picture, left=[run_colour(0)], right=lines, least=51)


def test_a_plan_in_the_viewer(viewer: Any, tmp_path: Path) -> None:
    """The path is in the colour of its speed, at the largest one the darkest that is seen."""
    plan = planned(limited("ur5e", velocity=1.0), SMALL)
    path = write_recording(plan, tmp_path / "plan.rrd")
    picture = look(viewer, path, 2.0, JOINT_COLOURS[:6])
    fast = "#d55e00"  # of VALUE_SCALE at 0.7
    frames = [AXIS_COLOURS[axis] for axis in "xyz"]
    assert_drawn(picture, left=[*JOINT_COLOURS[:5], fast, *frames], right=JOINT_COLOURS[:6])
    assert {"s′ [m/s]", "Joints [rad]", "Rates, of their limits [%]", "σ min [-]"} <= view_names(viewer)


def test_a_plan_that_fails_opens_where_it_does(viewer: Any, tmp_path: Path) -> None:
    """At the last sample before it: the arm is still there, and its wrist does not hide the place."""
    plan = FAILED["unreachable"]()
    path = write_recording(plan, tmp_path / "plan.rrd")
    opens = present(plan).opens_at_ns / 1e9
    picture = look(viewer, path, opens, JOINT_COLOURS[:6])
    assert_drawn(picture, left=[*JOINT_COLOURS[:4], DEVIATION_COLOUR], right=JOINT_COLOURS[:6])
