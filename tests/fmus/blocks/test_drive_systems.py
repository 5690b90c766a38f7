"""Drives coupled at communication points: against one ODE for all of it, as units and as shipped systems."""

from __future__ import annotations

import runpy
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.cosim import Block, CosimulationRecord, load_system, prepare, simulate
from urmpipe_fmus.instance import Instance
from urmpipe_fmus.native import native_unavailable_reason
from urmpipe_models.drives import trapezoid
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import forward
from urmpipe_models.robots.catalogue import load_robot

PERIOD = 5e-3
SAMPLES = 120
MINUS = {"controller__Kphi": -7.5, "controller__Kw": -0.75, "controller__Keps": -0.01}
K, DAMPING, RATIO, C, R, L, I1, J = 2500.0, 5.0, 100.0, 0.05, 0.5, 1e-3, 0.5, 1.0
"""The parameters at their start values, written out for the oracle."""


@pytest.fixture(scope="module")
def figures() -> Mapping[str, Any]:
    """Return the names of docs/drive_figures.py, whose loop couples the units."""
    return runpy.run_path(str(Path(__file__).parents[3] / "docs" / "drive_figures.py"))


def monolithic() -> FloatArray:
    """Return theta2 at the controller's samples: one ODE between two of them, eq. 20 at each."""

    def rates(_: float, x: FloatArray, u: float) -> list[float]:
        theta1, omega1, current, theta2, omega2 = x
        torque = K * (theta1 - theta2) + DAMPING * (omega1 - omega2)
        motor = (RATIO * C * current - torque) / I1
        return [omega1, motor, (u - C * RATIO * omega1 - R * current) / L, omega2, torque / J]

    x, u, found = np.zeros(5), 0.0, [0.0]
    for n in range(SAMPLES):
        wanted = trapezoid(n * PERIOD, 0.1, 0.0, 1.0, 2.0, 10.0)
        alpha = rates(0.0, x, u)[4]
        u += (
            7.5 * (wanted.position - x[3])
            + 0.75 * (wanted.velocity - x[4])
            + 0.01 * (wanted.acceleration - alpha)
        )
        u = float(np.clip(u, -48.0, 48.0))
        span = (0.0, PERIOD)
        x = solve_ivp(rates, span, x, args=(u,), method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
        found.append(x[3])
    return np.array(found)


needs_compiler = pytest.mark.skipif(
    bool(native_unavailable_reason(())), reason=f"runs native FMUs: {native_unavailable_reason(())}"
)


def make(block: Block) -> BlockModel:
    options = dict(block.options)
    if "robot" in options:
        options["robot"] = load_robot(options["robot"])
    return make_block(block.unit, **options)


def run_system(name: str | Path, step: float | None = None, **changes: Any) -> CosimulationRecord:
    """Run a system with every communication point recorded, with another step if one is given."""
    system = load_system(name)
    recorded = simulate(prepare(replace(system, step=step or system.step, record_every=1, **changes), make))
    assert recorded.failed is None
    return recorded


def changed_drive(step: float, duration: float, **starts: float) -> CosimulationRecord:
    """Run the system `one-drive` with other start values, each by block__variable."""
    blocks = [
        replace(
            one,
            start={
                **one.start,
                **{
                    name.removeprefix(f"{one.name}__"): value
                    for name, value in starts.items()
                    if name.startswith(f"{one.name}__")
                },
            },
        )
        for one in load_system("one-drive").blocks
    ]
    return run_system("one-drive", step, duration=duration, blocks=tuple(blocks))


@pytest.mark.slow
@needs_compiler
def test_eq_20_as_printed_with_a_minus_runs_away(figures: Mapping[str, Any]) -> None:
    recorded = changed_drive(1e-3, 1.0, **MINUS)
    assert recorded.column("load", "theta")[-1] < -2.0  # the set point went to +1
    assert recorded.column("controller", "u")[-1] == -48.0
    assert figures["spectral_radius"](1e-3, **MINUS) > 1.05


@pytest.mark.slow
@needs_compiler
def test_a_controller_without_acceleration_tracks_too() -> None:
    real = changed_drive(1e-3, 1.5, controller__Keps=0.0).column("load", "theta")
    assert abs(real[-1] - 1.0) < 1e-4


@pytest.mark.slow
@needs_compiler
def test_a_held_load_is_turned_by_its_torque_over_the_rigidity() -> None:
    recorded = changed_drive(1e-3, 1.5, load__tau_ext=-50.0, set_point__target=0.0)
    twist = recorded.column("drive", "theta1")[-1] - recorded.column("load", "theta")[-1]
    assert twist == pytest.approx(50.0 / K, rel=1e-6)  # at rest but for what e^-20 leaves


def end_held(step: float, inertia: float = 1.0) -> float:
    """Return the spectral radius of a load on a shaft whose motor end is held, by one communication step."""
    drive, load = Instance(make_block("dc_drive")), Instance(make_block("inertia"))
    load.set([load.reference(n) for n in ("J", "theta", "omega")], [inertia, *np.eye(2)])
    state = load.get([load.reference("theta"), load.reference("omega")])
    drive.set([drive.reference("theta2"), drive.reference("omega2")], state)
    load.set([load.reference("tau")], drive.get([drive.reference("Mk")]))
    load.do_step(0.0, step)
    after = np.array(load.get([load.reference("theta"), load.reference("omega")]))
    return float(np.abs(np.linalg.eigvals(after)).max())


@pytest.mark.parametrize("inertia", [0.05, 1.0, 20.0])
def test_on_a_held_end_the_limit_of_the_step_is_2_l_over_k(inertia: float) -> None:
    limit = 2.0 * DAMPING / K
    assert limit == 4e-3
    assert end_held(0.999 * limit, inertia) < 1.0 < end_held(1.001 * limit, inertia)


def test_on_a_held_end_a_small_load_is_limited_by_2_inertia_over_l() -> None:
    limit = 2.0 * 0.002 / DAMPING
    assert limit < 4e-3
    assert end_held(0.999 * limit, 0.002) < 1.0 < end_held(1.001 * limit, 0.002)


@pytest.mark.slow
@needs_compiler
def test_the_radius_of_the_step_map_tells_what_a_simulation_does(figures: Mapping[str, Any]) -> None:
    for load, step in ((0.2, 5e-3), (0.2, 2.5e-3), (1.0, 5e-3)):
        starts = {"set_point__target": 0.0, "load__theta": 1e-9, "controller__u_max": 1e9, "load__J": load}
        real = changed_drive(step, 2.0, **starts).column("load", "theta")
        second = round(1.0 / step)
        early, late = np.abs(real[second // 2 : second]).max(), np.abs(real[-second // 2 :]).max()
        grown = (late / early) ** PERIOD  # in a second, by periods of the controller
        assert grown == pytest.approx(figures["spectral_radius"](step, load__J=load), rel=0.01)


def test_with_steps_of_5_ms_the_smallest_load_of_six_drives_is_unstable_and_with_1_ms_all_are_stable(
    figures: Mapping[str, Any],
) -> None:
    radius = figures["spectral_radius"]
    assert radius(5e-3, load__J=0.2) > 1.0
    assert max(radius(1e-3, load__J=load) for load in figures["INERTIAS"]) < 0.98


def test_the_step_map_of_small_steps_nears_that_of_the_monolithic_ode(figures: Mapping[str, Any]) -> None:
    from scipy.linalg import expm

    A = np.zeros((6, 6))
    A[0, 1] = A[3, 4] = 1.0
    twist = np.array([K, DAMPING, 0.0, -K, -DAMPING, 0.0])
    A[1] = (RATIO * C * np.eye(6)[2] - twist) / I1
    A[2] = (np.eye(6)[5] - C * RATIO * np.eye(6)[1] - R * np.eye(6)[2]) / L
    A[4] = twist / J
    sample = np.eye(6)
    sample[5] -= 7.5 * np.eye(6)[3] + 0.75 * np.eye(6)[4] + 0.01 * A[4]
    expected = expm(A * PERIOD) @ sample
    off = [np.abs(figures["step_map"](PERIOD / parts, load__J=J) - expected).max() for parts in (8, 16, 32)]
    assert -np.diff(np.log2(off)) == pytest.approx(1.0, abs=0.1), off


@pytest.fixture(scope="module")
def one_drive() -> CosimulationRecord:
    """Return 2 s of the system `one-drive` in steps of 1 ms."""
    return run_system("one-drive", 1e-3, duration=2.0)


@pytest.mark.slow
@needs_compiler
def test_eq_20_with_a_plus_tracks_and_settles(one_drive: CosimulationRecord) -> None:
    wanted, real = one_drive.column("set_point", "theta"), one_drive.column("load", "theta")
    # The move ends at 0.8 s; the slowest mode decays with 15 / s (docs/drives.md): e^-18 of 0.04 rad is left.
    assert abs(real[-1] - 1.0) < 1e-8
    assert np.abs(real - wanted).max() < 0.04
    settled = real[950:]
    assert np.abs(settled - 1.0).max() < 0.02


@pytest.mark.slow
@needs_compiler
def test_one_drive_of_native_fmus_is_the_loop_over_units(
    figures: Mapping[str, Any], one_drive: CosimulationRecord
) -> None:
    names = ("load.theta", "drive.i_a", "drive.Mk", "controller.u")
    expected = figures["simulated"](figures["OneDrive"](), 1e-3, 0.5, *names)
    for name, column in zip(names, expected.T, strict=True):
        found = one_drive.column(*name.split("."))[: len(column)]
        # The same operations; a compiler may add up in another order, a rounding of up to 15 V or A or N.m.
        np.testing.assert_allclose(found, column, rtol=0.0, atol=1e-10)


@pytest.mark.slow
@needs_compiler
def test_one_drive_nears_the_monolithic_solution_with_the_first_order_of_the_communication_step() -> None:
    expected = monolithic()
    errors = []
    for parts in (4, 8, 16, 32):
        recorded = run_system("one-drive", PERIOD / parts, duration=SAMPLES * PERIOD)
        errors.append(float(np.abs(recorded.column("load", "theta")[::parts] - expected).max()))
    assert -np.diff(np.log2(errors)) == pytest.approx(1.0, abs=0.05), errors
    assert errors[-1] < 2e-4  # rad of a move of 1 rad


@pytest.fixture(scope="module")
def six_drives() -> CosimulationRecord:
    """Return the system `six-drives` in steps of 1 ms."""
    return run_system("six-drives", 1e-3)


@pytest.mark.slow
@needs_compiler
def test_six_drives_start_at_the_calibration_pose_and_arrive_where_their_set_points_do(
    six_drives: CosimulationRecord,
) -> None:
    recorded, chain = six_drives, load_robot("urm6")
    tip = np.column_stack([recorded.column("chain", f"p7[{i}]") for i in (1, 2, 3)])
    np.testing.assert_allclose(tip[0], [0.167397124, 0.0, 1.102644902], rtol=0.0, atol=1e-9)  # as many digits
    targets = [float(recorded.column(f"set_point{i}", "theta")[-1]) for i in range(1, 7)]
    assert targets == [0.5, 2.7416, 0.6, 2.6416, 0.4, 2.8416]
    for i, target in enumerate(targets, start=1):
        # The slowest mode, of the heaviest load, decays with 0.972 a period of 5 ms: 1.3 s after the move.
        assert abs(recorded.column(f"load{i}", "theta")[-1] - target) < 1e-4
    np.testing.assert_allclose(tip[-1], forward(chain, targets)[-1].translation, rtol=0.0, atol=1e-4)


@pytest.mark.slow
@needs_compiler
def test_six_drives_with_5_ms_shake_at_the_wrist_and_with_1_ms_they_do_not(
    six_drives: CosimulationRecord,
) -> None:
    def shaking(recorded: CosimulationRecord, i: int) -> float:
        """Return how far a joint is from its set point in the last half second."""
        late = recorded.t_ns > 1_500_000_000
        off = recorded.column(f"load{i}", "theta") - recorded.column(f"set_point{i}", "theta")
        return float(np.abs(off[late]).max())

    fine, coarse = six_drives, run_system("six-drives", 5e-3)
    assert max(shaking(fine, i) for i in range(1, 7)) < 1e-3
    assert shaking(coarse, 6) > 0.01
    assert max(shaking(coarse, i) for i in range(1, 6)) < 0.01


@pytest.mark.slow
@needs_compiler
def test_the_native_drives_error_falls_with_the_fourth_power_of_the_internal_step(tmp_path: Path) -> None:
    steps, file = (2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4), tmp_path / "drives.toml"
    blocks = (
        f"[blocks.drive{k}]\nunit = 'dc_drive'\nstart = {{"
        f"internal_step = {internal_step}, u = 24.0, theta2 = 0.0, omega2 = 0.0, i_a = 3.0 }}\n"
        for k, internal_step in enumerate(steps)
    )
    file.write_text("[system]\nstep = 0.04\nduration = 0.04\n" + "".join(blocks), encoding="utf-8")
    recorded, expected = run_system(file), locked(24.0, 3.0, 0.04)
    errors = []
    for k in range(len(steps)):
        found = [recorded.column(f"drive{k}", name)[-1] for name in ("theta1", "omega1", "i_a")]
        errors.append(float(np.abs(found - expected).max()))
    assert -np.diff(np.log2(errors))[1:] == pytest.approx(4.0, abs=0.2), errors


def locked(u: float, current: float, duration: float) -> FloatArray:
    """Return theta1, omega1, i_a of a drive whose driven end is held in 0."""

    def rates(_: float, x: FloatArray) -> list[float]:
        torque = K * x[0] + DAMPING * x[1]
        return [x[1], (RATIO * C * x[2] - torque) / I1, (u - C * RATIO * x[1] - R * x[2]) / L]

    start = [0.0, 0.0, current]
    found = solve_ivp(rates, (0.0, duration), start, method="DOP853", rtol=1e-12, atol=1e-14)
    return np.asarray(found.y[:, -1])
