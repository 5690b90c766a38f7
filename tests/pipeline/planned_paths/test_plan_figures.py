"""The plots of a plan: the values of the plan, the limits that hold for them, and what is marked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from asserting import there
from made_plans import FAILED, SMALL, limited, over_its_axis, planned
from presented import figures
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.planning.path import PathRows
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.planned_paths.figures import MARKED
from urmpipe_pipeline.planned_paths.planned_joints import FOLLOWED
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.presentation.figure import Figure, Panel
from urmpipe_pipeline.results import present

LAW, JOINTS, SINGULAR = "Motion along the path", "Joints over time", "Distance from singular poses"


def drawn(plan: PlannedPath) -> dict[str, Figure]:
    return {figure.title: figure for figure in figures(present(plan).body)}


def panels(figure: Figure) -> dict[str, Panel]:
    return {panel.title: panel for view in figure.views for panel in view.panels}


def values(panel: Panel) -> FloatArray:
    """The only line of a panel, shape (n,) or (n, k)."""
    (line,) = panel.lines
    return np.asarray(line.values[:])


def test_the_law_is_drawn_with_its_limits_as_they_were_reduced(slowed: PlannedPath) -> None:
    assert 0.1 < slowed.speed_factor < 0.9
    shown, k = panels(drawn(slowed)[LAW]), slowed.speed_factor
    limits: dict[str, float | None] = {"s": None, "s′": 0.5 * k, "s″": 6.0 * k**2, "s‴": 100.0 * k**3}
    found = {title: panel.limit for title, panel in shown.items()}
    assert found.pop("s") is limits.pop("s")
    assert found == pytest.approx(limits, rel=2e-9)  # room for rounding
    assert [panel.unit for panel in shown.values()] == ["m", "m/s", "m/s2", "m/s3"]
    assert [panel.signed for panel in shown.values()] == [False, False, True, True]
    motion = slowed.motion
    for panel, wanted in zip(shown.values(), (motion.s, motion.v, motion.a, motion.j), strict=True):
        np.testing.assert_array_equal(values(panel), wanted)
        np.testing.assert_array_equal(panel.t_ns, slowed.t_ns)
        if panel.limit is not None:
            assert 0.99 < np.abs(wanted).max() / panel.limit <= 1.0  # it is reached, and nothing is out of it


def test_a_law_that_runs_at_its_limit_is_not_out_of_it(contour: PlannedPath, alone: PlannedPath) -> None:
    for plan in (contour, alone):
        for panel in panels(drawn(plan)[LAW]).values():
            assert panel.limit is None or np.abs(values(panel)).max() <= panel.limit


@pytest.mark.slow
def test_without_limits_of_the_law_none_are_drawn() -> None:
    plan = planned(limited("ur5e", acceleration=20.0), SMALL, law="limits")
    figure = drawn(plan)[LAW]
    assert [panel.limit for panel in panels(figure).values()] == [None] * 4
    assert "Dashed" not in figure.caption


@pytest.mark.slow
def test_arcs_are_tinted(alone: PlannedPath) -> None:
    tinted = there(panels(drawn(alone)[LAW])["s′"].tinted)
    for k, kind in enumerate(alone.path.kinds):
        within = (alone.t > alone.segment_times[k]) & (alone.t < alone.segment_times[k + 1])
        assert (tinted[within] == (kind == "arc")).all()
    assert panels(drawn(over_its_axis())[LAW])["s"].tinted is None


def test_stops_on_the_way_are_lines_in_every_plot(alone: PlannedPath, contour: PlannedPath) -> None:
    (figure,) = drawn(alone).values()
    ((t_ns, words),) = figure.instants.items()
    assert words == "stop, row 4"
    at = np.abs(alone.t_ns - t_ns).argmin()
    assert alone.motion.v[at] < 6.0 * alone.tsp  # half a sample from rest at 6 m/s2
    assert alone.position[at] == pytest.approx([0.8, 0.4, 0.5], abs=1e-4)
    assert [dict(one.instants) for one in drawn(contour).values()] == [{}] * 3


def test_many_stops_have_no_lines_and_what_is_in_the_way_has() -> None:
    corners = np.array([[0.1 * k, 0.05 * (k % 2), 0.0] for k in range(MARKED + 3)])
    assert drawn(planned(None, PathRows(corners)))[LAW].instants == {}
    plan = FAILED["unreachable"]()
    (one,) = plan.infeasibilities
    assert drawn(plan)[JOINTS].instants == {round(1e9 * one.t): "unreachable, row 1"}


def test_joints_are_those_of_the_plan(slowed: PlannedPath) -> None:
    shown, joints = panels(drawn(slowed)[JOINTS]), there(slowed.joints)
    for title, unit, wanted in (
        ("q", "rad", joints.q), ("q′", "rad/s", joints.qd), ("q″", "rad/s2", joints.qdd),
    ):  # fmt: skip
        assert shown[title].unit == unit
        assert shown[title].lines[0].names == load_robot("ur5e").coordinates
        np.testing.assert_array_equal(values(shown[title]), wanted)


def test_shares_are_drawn_of_the_joints_whose_limits_are_known(slowed: PlannedPath) -> None:
    shown, joints = panels(drawn(slowed)[JOINTS]), there(slowed.joints)
    assert list(shown) == ["q", "q′", "|q′| / limit", "q″", "|q″| / limit"]
    names = load_robot("ur5e").coordinates
    for title, rates, limits in (
        ("|q′| / limit", joints.qd, {0: 0.5, 1: 3.0}),
        ("|q″| / limit", joints.qdd, {3: 50.0}),
    ):
        panel, own = shown[title], list(limits)
        assert panel.lines[0].names == tuple(names[j] for j in own)
        wanted = 100.0 * np.abs(rates[:, own]) / list(limits.values())
        np.testing.assert_allclose(values(panel), wanted, rtol=1e-15)
        assert (panel.unit, panel.limit, panel.signed) == ("%", 100.0 * FOLLOWED, False)
        (mark,) = panel.marks
        sample, column = np.unravel_index(wanted.argmax(), wanted.shape)
        assert (mark.t_ns, mark.name) == (slowed.t_ns[sample], names[own[column]])
        assert mark.value == values(panel).max()


def test_without_any_limit_no_shares_are_drawn(contour: PlannedPath) -> None:
    found = drawn(contour)
    assert list(found) == [LAW, JOINTS, SINGULAR]
    assert list(panels(found[JOINTS])) == ["q", "q′", "q″"]
    assert "limit" not in found[JOINTS].caption


def test_the_distance_from_singular_poses_is_that_of_the_plan(slowed: PlannedPath) -> None:
    near, shown = there(slowed.joints).singularity, panels(drawn(slowed)[SINGULAR])
    np.testing.assert_array_equal(values(shown["σ min"]), near.smallest)
    np.testing.assert_array_equal(values(shown["det J"]), there(near.determinant))
    nearest = near.smallest.argmin()
    for panel in shown.values():
        (mark,) = panel.marks
        assert (mark.t_ns, mark.value) == (slowed.t_ns[nearest], values(panel)[nearest])


@pytest.mark.slow
def test_the_determinant_passes_through_zero_where_the_pose_is_singular() -> None:
    plan = over_its_axis()
    signs = np.sign(values(panels(drawn(plan)[SINGULAR])["det J"]))
    before, after = (
        signs[side] for side in (plan.t < plan.infeasibilities[0].t, plan.t > plan.infeasibilities[0].t)
    )
    assert {*before} == {-after[0]}
    assert {*after} == {after[0]}


def test_of_a_jacobian_that_is_not_square_there_is_no_determinant() -> None:
    plan = planned(load_robot("ur5e"), replace(SMALL, rotation=None))
    assert list(panels(drawn(plan)[SINGULAR])) == ["σ min"]


@pytest.mark.slow
def test_the_unit_of_the_determinant_follows_its_joints() -> None:
    """Each row of a velocity has a length, but for the columns of joints that slide."""
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    slides = Chain("gantry", tuple(Joint(f"s{k}", "prismatic", axis=axis) for k, axis in enumerate(axes)))
    rows = PathRows(np.array([[0.0, 0.0, 0.0], [0.3, 0.2, 0.1]]))
    for arm, given, unit in ((slides, rows, ""), (load_robot("ur5e"), SMALL, "m³")):
        assert panels(drawn(planned(arm, given))[SINGULAR])["det J"].unit == unit
    assert panels(drawn(planned(slides, rows))[JOINTS])["q′"].unit == "m/s"
