"""A plan that is recorded comes back as it was, is compared as a log is, and leaves as one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import urmpipe
from asserting import there
from exported import export_result
from made_plans import CONTOUR, FAILED, SMALL, limited, planned
from recorded import rows_of, times_of
from same_results import assert_same
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.results import read_recording, write_recording
from urmpipe_pipeline.tables import ExportOptions

PLANS: Mapping[str, Callable[[], PlannedPath]] = {
    "contour": lambda: planned(load_robot("irb60"), CONTOUR),
    "total": lambda: planned(None, CONTOUR, arcs="total", tsp=0.02),
    "turned, slowed down": lambda: planned(limited("ur5e", velocity=0.3), SMALL, tsp=0.02),
    "jerk": lambda: planned(load_robot("ur5e"), SMALL, law="jerk", jerk=60.0, tsp=0.02),
    "limits": lambda: planned(limited("ur5e", acceleration=8.0), SMALL, law="limits", tsp=0.02),
    **{str(kind): make for kind, make in FAILED.items()},
}
"""Plans by their law, with and without an arm, and those that fail."""


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANS)
def test_it_comes_back_as_it_was(name: str, tmp_path: Path) -> None:
    """Every array bit for bit, and all that is derived from them."""
    plan = PLANS[name]()
    back = read_recording(write_recording(plan, tmp_path / "plan.rrd"), lazy=False)
    assert isinstance(back, PlannedPath)
    assert_same(back, plan)
    for derived in ("path", "position", "quat_xyzw", "row", "corners", "stops", "speed", "verdict"):
        assert_same(getattr(back, derived), getattr(plan, derived), derived)
    assert_same(back.as_run(), plan.as_run())
    assert back.to_dict() | {"output": None} == plan.to_dict()
    pd.testing.assert_frame_equal(back.to_frame(), plan.to_frame(), check_exact=True)


def test_its_samples_stand_at_their_times(tmp_path: Path) -> None:
    plan = PLANS["contour"]()
    path = write_recording(plan, tmp_path / "plan.rrd")
    assert sorted(times_of(path, "/motion/v")) == plan.t_ns.tolist()
    seen = rows_of(path, "/shown/scene/point/speed", "Points3D:positions")
    at = np.searchsorted(plan.t_ns, list(seen))
    # the point that moves in the viewer is where the tool shall be, in single precision over 2 m
    np.testing.assert_allclose(np.array([*seen.values()])[:, 0], plan.position[at], rtol=0, atol=2.5e-7)
    assert {0, len(plan) - 1} <= {*at.tolist()}


@pytest.mark.slow
def test_it_is_an_operand_of_compare(tmp_path: Path) -> None:
    """Against itself, and the path alone on either side."""
    plan, alone = PLANS["contour"](), planned(None, CONTOUR)
    plan_file = write_recording(plan, tmp_path / "plan.rrd")
    path_file = write_recording(alone, tmp_path / "path.rrd")
    for reference, log in ((plan_file, plan_file), (path_file, plan_file), (plan_file, path_file)):
        found = urmpipe.compare(reference, [log])
        assert found.verdict == "pass"
        (run,) = found.to_dict()["runs"]
        assert run["delta"]["norm"]["max"] < 1e-9  # the joints are polished onto the path
        assert run["samples"] == len(plan)


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANS)
def test_its_run_has_the_rates_that_were_planned(name: str) -> None:
    plan = PLANS[name]()
    run = plan.as_run()
    np.testing.assert_array_equal(run.t_ns, plan.t_ns)
    if plan.joints is not None:
        for values in ("q", "qd", "qdd"):
            np.testing.assert_array_equal(getattr(run, values), getattr(plan.joints, values))
        rates = there(run.tcp).velocity[plan.reached]
        speed = np.linalg.norm(rates, axis=1)
        np.testing.assert_allclose(speed, plan.motion.v[plan.reached], atol=1e-7)  # singular to 1e-9


@pytest.mark.slow
def test_it_leaves_as_its_run_does(tmp_path: Path) -> None:
    plan = PLANS["turned, slowed down"]()
    options = ExportOptions("csv", "file")
    export_result(plan, tmp_path / "plan.csv", options)
    export_result(plan.as_run(), tmp_path / "run.csv", options)
    assert (tmp_path / "plan.csv").read_bytes() == (tmp_path / "run.csv").read_bytes()
    frame = pd.read_csv(tmp_path / "plan.csv")
    names = [f"{name} [rad]" for name in load_robot("ur5e").coordinates]
    # written with all digits that tell numbers apart
    np.testing.assert_array_equal(frame[names].to_numpy(), there(plan.joints).q)
    np.testing.assert_array_equal(frame[["x [m]", "y [m]", "z [m]"]].to_numpy(), plan.position)
    np.testing.assert_array_equal(frame["t [s]"].to_numpy(), plan.t)
