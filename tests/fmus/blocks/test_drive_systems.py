"""Drives coupled at communication points: against one ODE for all of it, as units and as shipped systems."""

from __future__ import annotations

import runpy
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from drive_oracle import J, K, drive_matrix, integrate
from stepped_unit import needs_native, run_system
from urmpipe_fmus.cosim import CosimulationRecord, load_system
from urmpipe_models.drives import trapezoid
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import forward
from urmpipe_models.robots.catalogue import load_robot

PERIOD = 5e-3
SAMPLES = 120
MINUS = {"Kphi": -7.5, "Kw": -0.75, "Keps": -0.01}


@pytest.fixture(scope="module")
def figures() -> Mapping[str, Any]:
    """Return the names of docs/drive_figures.py, whose loop couples the units."""
    return runpy.run_path(str(Path(__file__).parents[3] / "docs" / "drive_figures.py"))


def monolithic() -> FloatArray:
    """Return theta2 at the controller's samples: one ODE between two of them, eq. 20 at each."""
    A, x, found = drive_matrix(), np.zeros(6), [0.0]
    for n in range(SAMPLES):
        wanted = np.array(trapezoid(n * PERIOD, 0.1, 0.0, 1.0, 2.0, 10.0))
        real = np.array([x[3], x[4], A[4] @ x])
        x[5] = np.clip(x[5] + np.dot((7.5, 0.75, 0.01), wanted - real), -48.0, 48.0)
        x = integrate(A, x, PERIOD)
        found.append(x[3])
    return np.array(found)


def finished(name: str | Path, step: float, **changes: Any) -> CosimulationRecord:
    """Run a system to its end."""
    recorded = run_system(name, step=step, **changes)
    assert recorded.failed is None
    return recorded


def changed_drive(step: float, duration: float, **starts: Mapping[str, float]) -> CosimulationRecord:
    """Run the system `one-drive` with other start values of its blocks."""
    blocks = load_system("one-drive").blocks
    changed = tuple(replace(one, start={**one.start, **starts.get(one.name, {})}) for one in blocks)
    return finished("one-drive", step, duration=duration, blocks=changed)


@pytest.mark.slow
@needs_native
def test_eq_20_as_printed_with_a_minus_runs_away(figures: Mapping[str, Any]) -> None:
    recorded = changed_drive(1e-3, 1.0, controller=MINUS)
    assert recorded.column("load", "theta")[-1] < -2.0  # the set point went to +1
    assert recorded.column("controller", "u")[-1] == -48.0
    printed = {f"controller__{name}": gain for name, gain in MINUS.items()}
    assert figures["spectral_radius"](1e-3, **printed) > 1.05


@pytest.mark.slow
@needs_native
def test_a_controller_without_acceleration_tracks_too() -> None:
    real = changed_drive(1e-3, 1.5, controller={"Keps": 0.0}).column("load", "theta")
    assert abs(real[-1] - 1.0) < 1e-4


@pytest.mark.slow
@needs_native
def test_the_twist_of_a_controlled_load_at_rest_is_its_torque_over_the_rigidity() -> None:
    recorded = changed_drive(1e-3, 1.5, load={"tau_ext": -50.0}, set_point={"target": 0.0})
    twist = recorded.column("drive", "theta1")[-1] - recorded.column("load", "theta")[-1]
    assert twist == pytest.approx(50.0 / K, rel=1e-6)  # at rest but for what e^-20 leaves


@pytest.mark.slow
@needs_native
@pytest.mark.parametrize(("load", "step"), [(0.2, 5e-3), (0.2, 2.5e-3), (1.0, 5e-3)])
def test_it_grows_by_the_radius_of_the_step_map(figures: Mapping[str, Any], load: float, step: float) -> None:
    starts = {"set_point": {"target": 0.0}, "load": {"theta": 1e-9, "J": load}, "controller": {"u_max": 1e9}}
    real = changed_drive(step, 2.0, **starts).column("load", "theta")
    second = round(1.0 / step)
    early, late = np.abs(real[second // 2 : second]).max(), np.abs(real[-second // 2 :]).max()
    grown = (late / early) ** PERIOD  # in a second, by periods of the controller
    assert grown == pytest.approx(figures["spectral_radius"](step, load__J=load), rel=0.01)


def test_the_step_map_of_small_steps_nears_that_of_the_monolithic_ode(figures: Mapping[str, Any]) -> None:
    A, sample = drive_matrix(), np.eye(6)
    sample[5] -= 7.5 * np.eye(6)[3] + 0.75 * np.eye(6)[4] + 0.01 * A[4]
    expected = expm(A * PERIOD) @ sample
    off = [np.abs(figures["step_map"](PERIOD / parts, load__J=J) - expected).max() for parts in (8, 16, 32)]
    assert -np.diff(np.log2(off)) == pytest.approx(1.0, abs=0.1), off


@pytest.mark.slow
@needs_native
def test_eq_20_with_a_plus_tracks_and_settles_as_the_loop_over_units_does(figures: Mapping[str, Any]) -> None:
    recorded = finished("one-drive", 1e-3, duration=2.0)
    wanted, real = recorded.column("set_point", "theta"), recorded.column("load", "theta")
    # The move ends at 0.8 s; the slowest mode decays with 15 / s (docs/drives.md): e^-18 of 0.04 rad is left.
    assert abs(real[-1] - 1.0) < 1e-8
    assert np.abs(real - wanted).max() < 0.04
    assert np.abs(real[950:] - 1.0).max() < 0.02
    names = ("load.theta", "drive.i_a", "drive.Mk", "controller.u")
    expected = figures["simulated"](figures["OneDrive"](), 1e-3, 0.5, *names)
    found = np.column_stack([recorded.column(*name.split("."))[: len(expected)] for name in names])
    # The same operations; a compiler may add up in another order, a rounding of up to 15 V or A or N.m.
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-10)


@pytest.mark.slow
@needs_native
def test_one_drive_nears_the_monolithic_solution_with_the_first_order_of_the_communication_step() -> None:
    expected, errors = monolithic(), []
    for parts in (4, 8, 16, 32):
        recorded = finished("one-drive", PERIOD / parts, duration=SAMPLES * PERIOD)
        errors.append(float(np.abs(recorded.column("load", "theta")[::parts] - expected).max()))
    assert -np.diff(np.log2(errors)) == pytest.approx(1.0, abs=0.05), errors
    assert errors[-1] < 2e-4  # rad of a move of 1 rad


@pytest.mark.slow
@needs_native
def test_six_drives_arrive_where_their_set_points_do_and_shake_at_the_wrist_with_5_ms_alone() -> None:
    fine, coarse = finished("six-drives", 1e-3), finished("six-drives", 5e-3)
    tip = np.column_stack([fine.column("chain", f"p7[{i}]") for i in (1, 2, 3)])
    np.testing.assert_allclose(tip[0], [0.167397124, 0.0, 1.102644902], rtol=0.0, atol=1e-9)  # as many digits
    targets = [float(fine.column(f"set_point{i}", "theta")[-1]) for i in range(1, 7)]
    assert targets == [0.5, 2.7416, 0.6, 2.6416, 0.4, 2.8416]
    # The slowest mode, of the heaviest load, decays with 0.972 a period of 5 ms: 1.3 s after the move.
    arrived = [fine.column(f"load{i}", "theta")[-1] for i in range(1, 7)]
    np.testing.assert_allclose(arrived, targets, rtol=0.0, atol=1e-4)
    expected = forward(load_robot("urm6"), targets)[-1].translation
    np.testing.assert_allclose(tip[-1], expected, rtol=0.0, atol=1e-4)

    def shaking(recorded: CosimulationRecord, i: int) -> float:
        """Return how far a joint is from its set point in the last half second."""
        late = recorded.t_ns > 1_500_000_000
        off = recorded.column(f"load{i}", "theta") - recorded.column(f"set_point{i}", "theta")
        return float(np.abs(off[late]).max())

    assert max(shaking(fine, i) for i in range(1, 7)) < 1e-3
    assert shaking(coarse, 6) > 0.01
    assert max(shaking(coarse, i) for i in range(1, 6)) < 0.01
