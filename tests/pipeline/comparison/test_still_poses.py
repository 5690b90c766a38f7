"""A run of still poses: no times, turns and rates; compared row by row; shown and exported by its rows."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urmpipe
from asserting import there
from exported import export_result
from presented import every_section, figures, scene_of
from recorded import static
from urmpipe_models.errors import LogError, OptionError
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.presentation.digits import written
from urmpipe_pipeline.presentation.figure import Figure, SpaceFigure
from urmpipe_pipeline.presentation.palette import VALUE_SCALE, rgb, value_colours
from urmpipe_pipeline.presentation.section import Presentation
from urmpipe_pipeline.report.space import drawn_space
from urmpipe_pipeline.results import present, read_recording, write_recording
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.tables import ExportOptions

UR5E = load_robot("ur5e")
ROWS = 24
WORST = 7
OFF = 0.002
RNG = np.random.default_rng(8)
Q = np.round(RNG.uniform(-5.5, 5.5, (ROWS, 6)), 6)
Q[:, 2] = np.round(RNG.uniform(-2.5, 2.5, ROWS), 6)
POSITION = poses_over_log(UR5E, Q)[0]
HEADS = ["Base", "Shoulder", "Elbow", "Wrist 1", "Wrist 2", "Wrist 3"]


def write(
    path: Path, *, off: float = 0.0, rows: int = ROWS, names: tuple[str, ...] = ("x", "y", "z")
) -> Path:
    """Write poses and where the tool was recorded, one of them off along x in [m]."""
    position = POSITION.copy()
    position[WORST, 0] += off
    lines = [",".join([*(f"{name} [rad]" for name in HEADS), *(f"{name} [m]" for name in names)])]
    lines += [",".join(map(repr, row)) for row in np.column_stack((Q, position)).tolist()[:rows]]
    path.write_text("\n".join([*lines, ""]))
    return path


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return write(tmp_path / "poses.csv", off=OFF)


@pytest.fixture
def run(log: Path) -> Run:
    return urmpipe.ingest(log)


@pytest.fixture
def found(log: Path) -> Comparison:
    return urmpipe.compare(log, tolerance=0.001)


def test_a_run_of_poses_has_no_times_no_turns_and_no_rates(run: Run) -> None:
    assert run.robot is not None and run.robot.name == "ur5e"
    assert not run.timed and not run.audit and not run.warnings
    np.testing.assert_array_equal(run.q, Q)
    assert np.isnan(run.qd).all() and np.isnan(run.qdd).all()
    told = json.loads(json.dumps(run.to_dict()))
    assert {told[key] for key in ("duration", "period", "tsp", "clock_start")} == {None}
    frame = run.to_frame()
    assert frame.columns[:2].tolist() == ["row", "Base"] and "vx" not in frame and "d_Base" not in frame
    assert frame["row"].tolist() == [*range(1, ROWS + 1)]


def test_limits_of_the_joints_are_checked_and_values_stay(tmp_path: Path) -> None:
    path = write(tmp_path / "poses.csv")
    text = path.read_text().splitlines()
    turned = Q[2, 0] + 4 * np.pi  # the same pose
    text[3] = ",".join([repr(float(turned)), *text[3].split(",")[1:]])
    path.write_text("\n".join([*text, ""]))
    run = urmpipe.ingest(path, "ur5e")
    assert run.q[2, 0] == turned
    assert [(one.kind, one.row) for one in run.warnings] == [("joint-limit", 3)]


def test_what_is_about_motions_has_no_effect(log: Path) -> None:
    asked: dict[str, Any] = {"tsp": 0.01, "derivative": "savgol", "interval": (-6.3, 6.3), "repair": True}
    run = urmpipe.ingest(log, poses=True, period=0.1, **asked)
    said = "no effect: the rows are still poses, which have no time"
    assert {str(one) for one in run.warnings} == {f"{name} (--{name}): {said}" for name in ("period", *asked)}
    np.testing.assert_array_equal(run.q, Q)


def test_one_log_is_held_against_its_record_row_by_row(found: Comparison) -> None:
    (one,) = found.runs
    assert found.verdict == "fail" and not found.assumptions
    assert one.statistics["x"].max == pytest.approx(OFF, abs=1e-9)
    assert one.statistics["path"].max == pytest.approx(OFF, abs=1e-9)  # no way between two poses is nearer
    told = json.loads(json.dumps(found.to_dict()))["runs"][0]
    assert {key: told[key] for key in ("duration", "sync", "sync_offset", "speed_correlation")} == {
        "duration": None, "sync": None, "sync_offset": None, "speed_correlation": None,
    }  # fmt: skip
    assert (told["delta"]["x"]["t_max"], told["delta"]["x"]["sample_max"]) == (None, WORST)
    assert told["worst"] == {"t": None, "sample": WORST, "norm": pytest.approx(OFF, abs=1e-9)}
    assert told["longest_out_interval"] == {"samples": 1, "sample": WORST, "t": None, "duration": None}
    assert one.to_frame()["row"].tolist() == [*range(1, ROWS + 1)]
    assert {row["t_max"] for row in found.rows()} == {None}


def test_arrows_know_their_rows(tmp_path: Path, log: Path) -> None:
    lines = log.read_text().splitlines()
    lines[4] = lines[4].rpartition(",")[0] + ","  # its fourth row has no z
    log.write_text("\n".join([*lines, ""]))
    arrows = scene_of(present(urmpipe.compare(log))).arrows
    assert arrows is not None
    assert arrows.sample.tolist() == [0, 1, 2, *range(4, ROWS)]


def test_poses_are_held_against_as_many_poses(tmp_path: Path, log: Path) -> None:
    other = write(tmp_path / "other.csv", off=-OFF)
    result = urmpipe.compare(log, other, tcp="recorded")
    assert result.runs[0].statistics["x"].max == pytest.approx(2 * OFF, abs=1e-9)
    assert len(result.runs[0].sample) == ROWS
    fewer = write(tmp_path / "fewer.csv", rows=ROWS - 1)
    with pytest.raises(LogError) as error:
        urmpipe.compare(log, fewer)
    allowed = f"{ROWS}, as poses has: still poses are compared row by row"
    assert str(error.value) == f"fewer.csv: found {ROWS - 1} rows, allowed: {allowed}"
    with pytest.raises(OptionError) as wrong:
        urmpipe.compare(log, other, sync=1.0)
    assert str(wrong.value) == "sync (--sync): found 1.0 of still poses, allowed: start, row by row"


def test_a_change_since_a_baseline_of_poses_has_no_time(tmp_path: Path, log: Path) -> None:
    asked = write(tmp_path / "asked.csv")
    before, now = (urmpipe.compare(asked, one, tcp="recorded") for one in (asked, log))
    found = urmpipe.compare(now, baseline=before).baseline
    assert found is not None and [one.largest_change for one in found.worse] == [pytest.approx(OFF)] * 3
    assert {one.to_dict()["t_largest_change"] for one in found.changes} == {None}


def test_poses_are_not_held_against_a_motion(tmp_path: Path, log: Path) -> None:
    path = tmp_path / "path.csv"
    rows = "\n".join(",".join(map(repr, [0.01 * k, *row])) for k, row in enumerate(POSITION.tolist()))
    path.write_text(f"t,x,y,z\n{rows}\n")
    with pytest.raises(LogError) as error:
        urmpipe.compare(path, log)
    said = "poses.csv: found still poses beside a motion, allowed: still poses on both sides, or motions"
    assert str(error.value) == f"{said}; --poses takes the rows of every log as still poses"
    result = urmpipe.compare(path, log, poses=True)
    assert result.runs[0].statistics["norm"].max < 1e-9


def words(shown: Presentation) -> Iterator[str]:
    """Everything that is said of a result."""
    yield shown.headline
    for section in every_section(shown.body):
        yield from (
            f"{fact.name}: {written(fact.value, unit=True)}" for fact in (*shown.facts, *section.facts)
        )
        for table in section.tables:
            yield from (column.title for column in table.columns)
            yield table.note
        for figure in section.figures():
            yield figure.title
            if isinstance(figure, Figure):
                yield figure.alt if isinstance(figure.alt, str) else figure.alt()
                yield from (figure.caption, *figure.instants.values())
        for event in section.events():
            assert event.t_ns is None
            yield str(event.words)


def test_nothing_that_is_shown_speaks_of_times(run: Run, found: Comparison) -> None:
    for result in (run, found):
        shown = present(result)
        said = [*words(shown)]
        of_times = re.compile(r"\d s\b|at t( =|$)|over time|speed")
        assert not [one for one in said if of_times.search(one)]
        for figure in (one for section in every_section(shown.body) for one in figures(section)):
            panels = [panel for view in figure.views for panel in view.panels]
            assert all(panel.t_ns is None and all(line.points for line in panel.lines) for panel in panels)
        scene = scene_of(shown)
        assert all(path.t_ns is None and not path.line for path in scene.paths)
        assert all(arm.t_ns is None for arm in scene.arms)
    assert present(found).facts[1].value == (
        "|Δx| = 2.000 mm of 1 mm allowed (2 times the tolerance) in row 8"
    )
    assert present(found).opens_at_row == WORST


@pytest.mark.slow
@pytest.mark.parametrize("to", ["csv", "parquet", "mat"])
def test_exports_count_rows(run: Run, found: Comparison, tmp_path: Path, to: Any) -> None:
    for name, result in (("run", run), ("found", found)):
        written_to = tmp_path / f"{name}.{to}"
        names = [column for column, _ in export_result(result, written_to, ExportOptions(to)).columns]
        assert not {"t", "t [s]", "clock_ns"} & {*names} or to == "mat"


def test_a_trajectory_of_poses_counts_rows(run: Run, tmp_path: Path) -> None:
    export_result(run, tmp_path / "out.tum", ExportOptions("tum"))
    lines = (tmp_path / "out.tum").read_text().splitlines()
    stamps = [float(line.split()[0]) for line in lines if not line.startswith("#")]
    assert stamps == [float(row) for row in range(1, ROWS + 1)]


@pytest.mark.slow
def test_a_recording_and_a_report_of_poses(run: Run, found: Comparison, tmp_path: Path) -> None:
    for name, result in (("run", run), ("found", found)):
        path = write_recording(result, tmp_path / f"{name}.rrd")
        again: Any = read_recording(path)
        assert json.dumps(again.to_dict()) == json.dumps({**result.to_dict(), "recording": str(path)})
        urmpipe.report(path, tmp_path / f"{name}.html")
        assert "Poses in space" in (tmp_path / f"{name}.html").read_text()


# Measured from outside


def test_a_tool_measured_from_outside_says_nothing_of_the_base(tmp_path: Path) -> None:
    log = write(tmp_path / "poses.csv", names=("tracker_x", "tracker_y", "tracker_z"))
    run = urmpipe.ingest(log)
    assert run.log.externally_measured and run.robot is None and not run.warnings
    run = urmpipe.ingest(log, "ur10")  # of another arm: no kinematics contradict it
    assert not run.warnings
    assert [path.name for path in scene_of(present(run)).paths] == ["poses"]
    with pytest.raises(LogError) as error:
        urmpipe.compare(log, robot="ur5e")
    found = "a tool that was measured in a frame of its own (tracker_x, tracker_y, tracker_z)"
    assert str(error.value) == (
        f"poses.csv: align (--align): found {found}, allowed: base+tool, rigid, start;"
        " --align base+tool finds the frames of base and tool"
    )
    assert urmpipe.compare(log, robot="ur5e", align="rigid").verdict == "pass"


def test_two_logs_that_one_device_measured_share_its_frame(tmp_path: Path) -> None:
    names = ("camera_x", "camera_y", "camera_z")
    one, two = (write(tmp_path / f"{k}.csv", off=k * OFF, names=names) for k in (1, 2))
    result = urmpipe.compare(one, two, tcp="recorded")
    assert result.runs[0].statistics["x"].max == pytest.approx(OFF, abs=1e-9)


def test_each_pose_names_its_turns_for_itself(tmp_path: Path) -> None:
    done = Q + 2 * np.pi * np.random.default_rng(3).integers(-1, 2, Q.shape) * (np.arange(6) > 2) + 1e-3
    files = []
    for name, q in (("asked", Q), ("done", done)):
        lines = [",".join(f"{head} [rad]" for head in HEADS)]
        lines += [",".join(map(repr, row)) for row in q.tolist()]
        files.append(tmp_path / f"{name}.csv")
        files[-1].write_text("\n".join([*lines, ""]))
    one = urmpipe.compare(files[0], files[1], UR5E, tolerance={"joint": 2e-3}).runs[0]
    np.testing.assert_allclose(there(one.joint_delta), np.full(Q.shape, -1e-3), atol=1e-12)  # of some turns
    assert (one.verdict, set(one.joint_turns)) == ("pass", {0})


def test_the_deviation_of_each_pose_is_an_arrow_in_the_colour_of_its_size(found: Comparison) -> None:
    one, arrows = found.runs[0], scene_of(present(found)).arrows
    assert arrows is not None
    factor = int(arrows.name.removeprefix("deviation drawn x"))
    np.testing.assert_array_equal(arrows.start, one.reference)
    np.testing.assert_allclose(arrows.end - arrows.start, factor * (one.actual - one.reference), atol=1e-15)
    np.testing.assert_array_equal(arrows.values, one.delta[:, 3])
    assert int(np.argmax(arrows.values)) == WORST
    dark, light = value_colours(arrows.values)[[WORST, WORST - 1]]
    assert tuple(dark) == rgb(VALUE_SCALE[-1][1])
    assert int(light.astype(int).sum()) > int(dark.astype(int).sum())


def test_the_arrows_stand_in_recording_and_report(found: Comparison, tmp_path: Path) -> None:
    path = write_recording(found, tmp_path / "found.rrd")
    arrows = scene_of(present(found)).arrows
    assert arrows is not None
    vectors = static(path, "/shown/scene/arrows", "Arrows3D:vectors")
    np.testing.assert_allclose(vectors, arrows.end - arrows.start, atol=1e-6)  # single precision
    blocks = (one for section in every_section(present(found).body) for one in section.blocks())
    figure = next(one for one in blocks if isinstance(one, SpaceFigure))
    assert figure.title == "Poses in space" and not figure.paths
    drawn = drawn_space(figure).spec["data"]
    assert [one["mode"] for one in drawn] == ["lines", "markers", "markers"]
    assert drawn[1]["marker"]["showscale"]
