"""What an ingested log shows: its numbers, its arrays, its marks, and nothing computed too early."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from asserting import there
from presented import Untouched, cells, facts, figures, scene_of
from urmpipe_datasets import LOGS
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.figure import Figure, SpaceFigure
from urmpipe_pipeline.presentation.section import Presentation
from urmpipe_pipeline.results import present
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.playback import replay_raw
from urmpipe_pipeline.runs.run import Run


@pytest.fixture(scope="module")
def run() -> Run:
    """The demo's log, in which thirteen jumps are undone."""
    return ingest_log([LOGS / "coppeliasim.csv"], robot=load_robot("urm6"))


@pytest.fixture(scope="module")
def shown(run: Run) -> Presentation:
    return present(run)


def figure(shown: Presentation, title: str) -> Figure:
    return next(one for one in figures(shown.body) if one.title == title)


def test_a_log_is_not_judged(run: Run, shown: Presentation) -> None:
    assert (shown.verdict, shown.body.verdict, shown.word) == (None, None, "ingested")
    assert (shown.name, shown.created, shown.opens_at_ns) == (run.name, run.provenance.created, 0)
    assert shown.body.checks == ()
    assert facts(shown.body)["Duration"] == run.duration


def test_the_audit_is_a_table_and_what_audit_writes(run: Run, shown: Presentation) -> None:
    table = cells(shown.body.tables[1])
    written = cells(there(shown.rows)())
    for key in ("kind", "joint", "row", "t", "step", "turns_before", "turns_after"):
        assert table[key] == [one.to_dict()[key] for one in run.audit]
        assert written[key] == table[key]
    assert table["time_uncertainty"] == [one.time_uncertainty for one in run.audit]


def test_what_was_inferred_is_a_table(run: Run, shown: Presentation) -> None:
    table = cells(shown.body.tables[0])
    found = [(one.what, one.value, one.evidence) for one in run.log.inferences]
    found.append(("robot", "urm6", there(run.robot).description))
    assert list(zip(table["what"], table["found"], table["evidence"], strict=True)) == found
    columns = cells(next(one for one in shown.body.blocks() if one.title.startswith("Columns")))  # type: ignore[arg-type]
    assert columns["unit"] == [one.unit for one in run.log.columns]


def test_the_joints_are_plotted_before_and_after(run: Run, shown: Presentation) -> None:
    joints = figure(shown, "Joints before and after repolarization")
    assert joints.opened is None  # both are seen
    before, after = (view.panels[0] for view in joints.views)
    assert before.lines[0].values is run.log.q
    assert before.t_ns is run.log.t_ns
    assert after.lines[0].values is run.q
    assert before.lines[0].names == after.lines[0].names == run.log.joints


def test_each_finding_is_marked_on_the_line_of_its_joint(run: Run, shown: Presentation) -> None:
    before, after = (v.panels[0] for v in figure(shown, "Joints before and after repolarization").views)
    assert len(before.marks) == len(after.marks) == len(run.audit) == 13
    marks = {(mark.name, mark.t_ns): mark for mark in after.marks}
    for one, raw in zip(run.audit, before.marks, strict=True):
        mark, j = marks[one.joint, round(one.t * 1e9)], run.log.joints.index(one.joint)
        row = int(np.searchsorted(run.t_ns, mark.t_ns))
        low, high = sorted(run.q[row - 1 : row + 1, j])
        assert low <= mark.value <= high
        assert raw.value == run.log.q[one.sample, j] - one.step / 2
        assert mark.shape == raw.shape == ("up" if one.turns_after > one.turns_before else "down")


def test_what_is_doubtful_is_a_cross(run: Run) -> None:
    audit = (replace(run.audit[0], kind="unexplained"), *run.audit[1:])
    joints = figure(present(replace(run, audit=audit)), "Joints before and after repolarization")
    assert [mark.shape for mark in joints.views[1].panels[0].marks].count("cross") == 1


def test_the_motion_is_that_of_the_kinematics(run: Run, shown: Presentation) -> None:
    assert run.tcp is not None
    (speed,) = (
        view.panels[0].lines[0].values[:] for view in figure(shown, "Speed of the tool centre point").views
    )
    # Summed in another order than the norm: one rounding of each square.
    np.testing.assert_allclose(speed, np.linalg.norm(run.tcp.velocity, axis=1), rtol=1e-15, atol=0)
    panels = {view.name: view.panels[0] for view in figure(shown, "Motion").views}
    for name, values in (
        ("Joint rates", run.qd), ("Joint accelerations", run.qdd), ("TCP", run.tcp.position),
        ("TCP velocity", run.tcp.velocity), ("TCP acceleration", run.tcp.acceleration),
    ):  # fmt: skip
        assert panels[name].lines[0].values is values
    angles = panels["TCP rz, ry, rx"].lines[0].values[:]
    assert np.abs(np.diff(angles, axis=0)).max() < np.pi  # none jumps


def test_a_page_shows_the_playback(run: Run, shown: Presentation) -> None:
    played = there(replay_raw(run))
    blocks = {one.title: one for one in shown.body.blocks()}
    before = cast("Figure", blocks["Tool centre point before and after repolarization"]).views[0].panels
    np.testing.assert_array_equal(before[0].lines[0].values, played.position)
    np.testing.assert_array_equal(before[2].lines[0].values, np.linalg.norm(played.velocity, axis=1))
    space = cast("SpaceFigure", blocks["Path in space before and after repolarization"])
    np.testing.assert_array_equal(space.paths[0].position, played.position)
    assert space.spots[-1].position == tuple(played.position[there(played.worst)].tolist())
    assert {"Path in space", "Input files", "How the log was read"} < set(blocks)


def test_the_scene_is_the_arm_and_its_path(run: Run, shown: Presentation) -> None:
    scene = scene_of(shown)
    (arm,), (path,) = scene.arms, scene.paths
    assert (arm.chain, arm.q, arm.t_ns) == (run.robot, run.q, run.t_ns)
    assert (path.position, path.t_ns, path.asked) == (there(run.tcp).position, run.t_ns, False)


def test_events_stand_at_the_instants_of_the_audit_and_the_rows_of_warnings(run: Run) -> None:
    warned = replace(run, warnings=(LogWarning("gap", "two rows lie far apart", 7),))
    events = list(present(warned).body.events())
    assert [event.t_ns for event in events[:-1]] == [round(one.t * 1e9) for one in run.audit]
    assert events[-1].t_ns == run.log.t_ns[6]
    assert (events[-1].words, events[-1].level) == (warned.warnings[0], "warning")


def test_a_path_has_no_joints_and_no_arm(tmp_path: Path) -> None:
    path = ingest_log([LOGS / "path.csv"])
    shown = present(path)
    assert path.tcp_recorded is not None
    (motion,) = figures(shown.body)
    assert motion.views[0].panels[0].lines[0].values is path.tcp_recorded
    assert len(shown.body.tables) == 1
    scene = scene_of(shown)
    assert (scene.arms, scene.paths[0].position) == ((), path.tcp_recorded)


def test_a_log_without_a_robot_has_joints_alone() -> None:
    run = ingest_log([LOGS / "coppeliasim.csv"])
    assert run.robot is None
    shown = present(run)
    assert [one.title for one in figures(shown.body)] == ["Joints before and after repolarization", "Motion"]
    assert not any(isinstance(one, (Figure, SpaceFigure)) for one in shown.body.blocks())
    assert there(shown.scene)() is None


def test_a_log_of_one_row_is_shown(tmp_path: Path) -> None:
    file = tmp_path / "one.csv"
    file.write_text("t [s],q1 [rad],q2 [rad],q3 [rad],q4 [rad],q5 [rad],q6 [rad]\n0,0,0,0,0,0,0\n")
    shown = present(ingest_log([file], robot=load_robot("urm6")))
    assert [len(figure.views) for figure in figures(shown.body)] == [1, 1, 4]
    list(shown.body.blocks())
    assert facts(shown.body)["Duration"] == 0.0


def test_no_array_is_looked_into_before_it_is_shown(run: Run) -> None:
    untouched = cast("Any", Untouched(len(run.q)))
    names = ("position", "velocity", "acceleration", "euler_zyx", "singular")
    tcp = replace(there(run.tcp), **dict.fromkeys(names, untouched))
    hidden = replace(run, q=untouched, qd=untouched, qdd=untouched, tcp=tcp)
    assert present(hidden).headline == present(run).headline
