"""Still poses as they are shown and exported, by their rows; `still_poses.cases` has their comparison."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urmpipe
from exported import export_result
from presented import every_section, figures, scene_of
from recorded import static
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


def write(path: Path, off: float = 0.0) -> Path:
    """Write poses and where the tool was recorded, one of them off along x in [m]."""
    position = POSITION.copy()
    position[WORST, 0] += off
    lines = [",".join([*(f"{name} [rad]" for name in HEADS), "x [m]", "y [m]", "z [m]"])]
    lines += [",".join(map(repr, row)) for row in np.column_stack((Q, position)).tolist()]
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


def test_arrows_know_their_rows(tmp_path: Path, log: Path) -> None:
    lines = log.read_text().splitlines()
    lines[4] = lines[4].rpartition(",")[0] + ","  # its fourth row has no z
    log.write_text("\n".join([*lines, ""]))
    arrows = scene_of(present(urmpipe.compare(log))).arrows
    assert arrows is not None
    assert arrows.sample.tolist() == [0, 1, 2, *range(4, ROWS)]


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
