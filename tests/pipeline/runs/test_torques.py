"""The torques of a log: Pinocchio's, in every table, with a warning beyond the effort of a joint."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest

from arm_motion import clock
from asserting import there
from exported import export_result
from made_plans import DOWN, SMALL, limited, planned
from panda_log import URDF, motion, panda, panda_csv
from presented import cells, figures
from recorded import rows_of
from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics.equations import energies_over_log, torques_over_log
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.planning.path import PathRows
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.presentation.figure import Drawing, Figure
from urmpipe_pipeline.results import present, read_recording, write_recording
from urmpipe_pipeline.runs.ingest import ingest_log, with_robot
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.tables import ExportOptions
from urmpipe_pipeline.text import to_json_value

SAME = 1e-10
"""Of the largest torque: two ways to compute the same; found are 1e-13."""


Rnea = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""Torques of q, q' and q'', a row a sample."""


@pytest.fixture(scope="module")
def rnea(shared: Path) -> Rnea:
    """Pinocchio's torques of the Panda without its fingers."""
    model = pinocchio.buildModelFromUrdf(str(shared / URDF))
    fingers = [k for k, name in enumerate(model.names) if "finger" in name]
    for one in fingers:
        model.inertias[one] = pinocchio.Inertia.Zero()
    model = pinocchio.buildReducedModel(model, fingers, pinocchio.neutral(model))
    data = model.createData()

    def torques(q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
        """Return them."""
        return np.array([pinocchio.rnea(model, data, *row).copy() for row in zip(q, qd, qdd, strict=True)])

    return torques


@pytest.fixture(scope="module")
def arm(shared: Path) -> Chain:
    """The Panda."""
    return panda(shared)


@pytest.fixture(scope="module")
def run(arm: Chain, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A log of the Panda whose second joint needs more than its effort."""
    return ingest_log([panda_csv(tmp_path_factory.mktemp("log"), arm.coordinates, 2.2)], robot=arm)


def test_the_torques_of_a_log_are_those_of_pinocchio(run: Run, rnea: Rnea) -> None:
    expected = rnea(run.q, run.qd, run.qdd)
    np.testing.assert_allclose(there(run.tau), expected, rtol=0, atol=SAME * np.abs(expected).max())


def test_the_torques_of_the_log_are_near_those_of_the_motion_it_samples(run: Run, rnea: Rnea) -> None:
    """Central differences are off by T^2 omega^2 / 12 of the acceleration: below 0.1 % at these paces."""
    expected = rnea(*motion(run.t, 2.2))
    inner = slice(1, -1)  # the ends are one-sided
    error = np.abs(there(run.tau)[inner] - expected[inner]).max()
    assert error < 2e-3 * np.abs(expected).max()


def test_a_coarse_log_is_smoothed_before(arm: Chain, rnea: Rnea, tmp_path: Path) -> None:
    path = panda_csv(tmp_path, arm.coordinates, 0.3, form="%+.3e")
    expected = rnea(*motion(clock(801, 0.005), 0.3))
    smooth, rough = (ingest_log([path], robot=arm, derivative=way) for way in (None, "central"))
    worst = [float(np.abs(there(one.tau) - expected)[50:-50].max()) for one in (smooth, rough)]
    assert worst[0] < 0.3  # of 43 N.m; four digits of the angles
    assert worst[1] > 30.0


def test_recorded_rates_and_accelerations_are_taken(arm: Chain, rnea: Rnea, tmp_path: Path) -> None:
    t = clock(401, 0.005)
    names = [f"{prefix}{name}" for prefix in ("", "d_", "dd_") for name in arm.coordinates]
    units = [unit for unit in ("rad", "rad/s", "rad/s2") for _ in arm.coordinates]
    header = ",".join(["t [s]", *(f"{name} [{unit}]" for name, unit in zip(names, units, strict=True))])
    table = np.column_stack((t, *motion(t)))
    path = tmp_path / "recorded.csv"
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.15g")
    run = ingest_log([path], robot=arm)
    expected = rnea(*motion(t))
    # 15 digits are written of each value.
    np.testing.assert_allclose(there(run.tau), expected, rtol=0, atol=1e-9)


def test_a_csv_has_every_double_and_the_unit(run: Run, tmp_path: Path) -> None:
    import pandas as pd

    export_result(run, tmp_path / "a.csv", ExportOptions("csv", None))
    frame = pd.read_csv(tmp_path / "a.csv")
    names = [f"tau_{name} [N.m]" for name in there(run.robot).coordinates]
    np.testing.assert_array_equal(frame[names].to_numpy(), run.tau)


def test_a_mat_has_the_torques_with_their_units(run: Run, tmp_path: Path) -> None:
    from scipy.io import loadmat

    export_result(run, tmp_path / "a.mat", ExportOptions("mat", None))
    fields = loadmat(tmp_path / "a.mat", simplify_cells=True)["run"]
    np.testing.assert_array_equal(fields["tau"], run.tau)
    assert fields["units"]["tau"].tolist() == ["N.m"] * 7


def test_an_exported_log_is_read_with_the_same_joints(run: Run, tmp_path: Path) -> None:
    export_result(run, tmp_path / "a.csv", ExportOptions("csv", None))
    robot = replace(there(run.robot), name="q")
    again = ingest_log([tmp_path / "a.csv"], robot=robot)
    np.testing.assert_array_equal(again.q, run.q)
    np.testing.assert_array_equal(again.tau, run.tau)


def test_a_recording_has_the_torques_row_by_row(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "a.rrd"
    write_recording(run, path)
    rows = rows_of(path, "/joints/torque", "Scalars:scalars")
    assert list(rows) == run.t_ns.tolist()
    np.testing.assert_array_equal(list(rows.values()), run.tau)
    back = read_recording(path)
    assert isinstance(back, Run)
    np.testing.assert_array_equal(back.tau, run.tau)


def test_json_has_the_largest_torque_of_each_joint(run: Run) -> None:
    torques, tau = run.to_dict()["torques"], there(run.tau)
    assert [one["joint"] for one in torques] == list(there(run.robot).coordinates)
    for one, column, joint in zip(torques, tau.T, there(run.robot).moving, strict=True):
        size = np.abs(column)
        assert (one["max"], one["t_max"]) == (size.max(), run.t[np.argmax(size)])
        assert one["rms"] == np.sqrt(np.mean(size**2))
        assert (one["effort"], one["unit"]) == (joint.effort, "N.m")
        assert one["effort_share"] == size.max() / joint.effort
        assert one["out_fraction"] == np.mean(size > joint.effort)
    json.dumps(to_json_value(torques), allow_nan=False)


def test_a_plan_has_the_torques_of_its_exact_rates() -> None:
    plan = planned(load_robot("ur10"), SMALL)
    joints, run = there(plan.joints), plan.as_run()
    expected = torques_over_log(joints.chain, joints.q, joints.qd, joints.qdd)
    np.testing.assert_array_equal(run.tau, expected)
    assert np.isfinite(expected).all()


def test_a_plan_beyond_an_effort_has_one_warning_of_its_own() -> None:
    plan = planned(limited("ur10", effort=60.0), SMALL)
    size, t = np.abs(there(there(plan.joints).tau)), plan.t
    counts = np.count_nonzero(size > 60.0, axis=0)
    worst = int(np.argmax(size.max(axis=0)))
    at = int(np.argmax(size[:, worst]))
    (warning,) = (one for one in plan.warnings if one.kind == "effort-limit")
    joint = there(plan.robot).coordinates[worst]
    begin = f"{joint} needs more than its effort of 60 N.m in {counts[worst]} of {len(t)} samples ("
    assert warning.message.startswith(begin)
    assert f"at worst {size[at, worst]:.4g} N.m at t = {t[at]:.3f} s" in warning.message
    assert warning.message.endswith(": move slower, or check the masses")
    assert (warning.row, warning.hints) == (None, ())  # its samples are no rows of the path
    assert warning.message in [one["message"] for one in plan.to_dict()["warnings"]]
    assert [one for one in plan.as_run().warnings if one.kind == "effort-limit"] == [warning]


@pytest.mark.slow
def test_a_plan_within_its_efforts_or_in_the_way_of_something_has_no_such_warning() -> None:
    weak = limited("ur10", effort=1.0)
    points = np.array([[0.5, 0.5, 0.3], [-0.5, -0.5, 0.3]])
    failed = planned(weak, PathRows(points, rotation=DOWN))
    assert failed.infeasibilities != ()
    for plan in (planned(load_robot("ur10"), SMALL), failed):
        for warnings in (plan.warnings, plan.as_run().warnings):
            assert [one for one in warnings if one.kind == "effort-limit"] == []


@pytest.mark.slow
def test_a_plan_on_another_arm_is_told_to_move_slower() -> None:
    run = with_robot(planned(load_robot("ur10"), SMALL).as_run(), limited("ur10", effort=60.0))
    (warning,) = (one for one in run.warnings if one.kind == "effort-limit")
    assert "move slower" in warning.message and warning.hints == ()


# --- what is shown ---------------------------------------------------------------------------------


def figure(run: Run, title: str) -> Figure:
    return next(one for one in figures(present(run).body) if one.title == title)


def test_torques_are_plotted_together_and_joint_by_joint_with_their_limits(run: Run) -> None:
    shown = figure(run, "Joint torques")
    together, *each = (view.panels[0] for view in shown.views)
    assert together.lines[0].values is run.tau
    assert (together.title, together.unit, together.limit) == ("τ", "N.m", None)
    for j, (panel, joint) in enumerate(zip(each, there(run.robot).moving, strict=True)):
        np.testing.assert_array_equal(panel.lines[0].values[:], there(run.tau)[:, j])
        assert (panel.title, panel.limit) == (f"τ{j + 1}", joint.effort)
    assert "panda_joint2" in shown.views[2].name
    alt = shown.alt if isinstance(shown.alt, str) else shown.alt()
    assert "panda_joint7 0.8" in alt and "of its limit)" in alt


def test_the_terms_add_up_to_the_torque(run: Run) -> None:
    views = figure(run, "Terms of the torques").views
    assert len(views) == 7
    for j, view in enumerate(views):
        parts, total = view.panels[0].lines
        assert (parts.stacked, total.stacked) == (True, False)
        assert parts.names == ("gravity", "inertia", "centrifugal", "Coriolis")
        np.testing.assert_array_equal(total.values[:], there(run.tau)[:, j])
        # The terms are summed in another order.
        np.testing.assert_allclose(parts.values[:].sum(axis=1), there(run.tau)[:, j], rtol=0, atol=1e-11)


def test_the_gravity_term_is_what_an_arm_at_rest_holds(run: Run, rnea: Rnea) -> None:
    still = np.zeros_like(run.q)
    held = rnea(run.q, still, still)
    for j, view in enumerate(figure(run, "Terms of the torques").views):
        np.testing.assert_allclose(view.panels[0].lines[0].values[:][:, 0], held[:, j], rtol=0, atol=1e-10)


def test_the_energies_are_plotted(run: Run) -> None:
    (view,) = figure(run, "Energy").views
    kinetic, potential, total = view.panels[0].lines[0].values[:].T
    expected = energies_over_log(there(run.robot), run.q, run.qd)
    np.testing.assert_array_equal((kinetic, potential), expected)
    np.testing.assert_array_equal(total, kinetic + potential)
    # Power: what the joints give is what the energy gains; rates are by differences, as the gain is.
    power = np.sum(there(run.tau) * run.qd, axis=1)
    gain = np.gradient(total, run.tsp)
    assert np.abs(power - gain)[2:-2].max() < 0.01 * np.abs(gain).max()


def test_no_term_is_computed_before_it_is_shown(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> Any:
        raise AssertionError("computed")

    for name in ("torque_terms_over_log", "energies_over_log"):
        monkeypatch.setattr(f"urmpipe_pipeline.runs.figures.{name}", refused)
    assert len(figures(present(run).body)) == 6


def test_the_table_has_each_joint_with_its_limit(run: Run) -> None:
    table = next(one for one in present(run).body.tables if one.title == "Joint torques")
    found, told = cells(table), run.to_dict()["torques"]
    assert found["joint"] == list(run.log.joints)
    for key in ("t_max", "effort", "effort_share", "out_fraction"):
        assert found[key] == [one[key] for one in told]
    assert found["max"] == [float(f"{one['max']:.4g}") for one in told]


def test_a_page_draws_the_arm_with_its_mass_centres(run: Run) -> None:
    (drawing,) = (one for one in present(run).body.blocks() if isinstance(one, Drawing))
    heavy = [one for one in there(run.robot).inertials if float(one.mass) > 0.0]
    total = sum(float(one.mass) for one in heavy)
    assert drawing.alt == (
        "panda from the side and from the front, with the centres of"
        f" its {len(heavy)} masses, {total:.4g} kg in all."
    )
    assert drawing.svg.count("<circle") == 2 * (len(heavy) + 11) + 1  # base, p1..p10; one in the legend
