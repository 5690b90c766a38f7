"""Networks elementwise: poses and Newton steps of numbers, columns and symbols; values with derivatives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any

import casadi
import numpy as np
import pytest

from random_networks import DOOR, FIRST, SECOND, difference, one_by_one
from test_higher_pairs import CAM, UNEVEN, spline_of
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.networks import rates
from urmpipe_models.networks.assembly import assemble
from urmpipe_models.networks.elements import element_frame
from urmpipe_models.networks.file import Network, load_network, network_names
from urmpipe_models.networks.joint_motion import constraint_twists, transmission
from urmpipe_models.networks.mechanism import Mechanism, build_mechanism
from urmpipe_models.networks.rates import Taylor

SHIPPED = [*map(load_network, network_names())]
KINDS: dict[str, Any] = {  # each kind of joint, each operator and function
    "bodies": {name: {} for name in "abcdef"},
    "joints": {
        "A": {"kind": "revolute", "bodies": ["ground", "a"], "value": "sin(s) / 2 + atan2(s, 2) ** 2"},
        "B": {"kind": "prismatic", "bodies": ["b", "a"], "a": [0.1, 0.2, 0.3]},
        "C": {"kind": "cylindrical", "bodies": ["b", "c"], "value": ["", "sqrt(u) - 0.1"]},
        "D": {"kind": "helical", "bodies": ["c", "d"], "pitch": 0.01},
        "E": {"kind": "global", "bodies": ["e", "d"], "a": [[0.2, 0.0, 0.0], [0.0, 0.1, 0.0]]},
        "F": {
            "kind": "user", "bodies": ["e", "f"],
            "m": ["cos(s)", "sin(s)", 0], "n": ["-sin(s)", "cos(s)", 0], "a": ["s * s", "exp(-u)", "tan(s)"],
        },
    },
    "controls": {"s": {"start": 0.3, "lower": 0.0, "upper": 1.0}, "u": {"value": "2 * s + 1"}},
}  # fmt: skip


def traced(function: Callable[[Any], Sequence[Any]], size: int) -> Callable[[Any], FloatArray]:
    """Return a function of numbers that is computed by CasADi from symbols."""
    casadi.GlobalOptions.setNumpyMode(-1)
    symbols = [casadi.SX.sym(f"x{k}") for k in range(size)]
    call = casadi.Function("traced", symbols, [casadi.vertcat(*map(casadi.SX, function(symbols)))])
    return lambda x: np.array(call(*x)).ravel()


# --- poses


@pytest.mark.parametrize("network", [*SHIPPED, load_network(KINDS)], ids=lambda network: network.name)
def test_poses_of_symbols_numbers_and_columns_are_the_same(network: Network) -> None:
    mechanism = build_mechanism(network)

    def entries(x: Any) -> list[Any]:
        frames = mechanism.poses(x).values()
        return [one for frame in frames for row in (*frame.rotation, frame.translation) for one in row]

    x = np.random.default_rng(1).uniform(0.1, 0.9, (len(mechanism.variables), 5))
    if mechanism.rotations:
        x[mechanism.rotations[0], 0] = 0.0  # where series stand for quotients
    columns, symbols = np.array([np.broadcast_to(one, 5) for one in entries(x)]), traced(entries, len(x))
    for k in range(5):
        numbers = np.array([float(one) for one in entries(x[:, k].tolist())])
        # sums of products of numbers near 1: rounding
        np.testing.assert_allclose(columns[:, k], numbers, atol=1e-14)
        np.testing.assert_allclose(symbols(x[:, k]), numbers, atol=1e-14)


def test_frames_of_elements_and_what_joints_forbid_of_symbols_are_those_of_numbers() -> None:
    joints = [one for one in load_network(KINDS).joints if one.kind != "user"]

    def entries(x: Sequence[Any]) -> list[Any]:
        frame = element_frame(x[0], x[1], x[2], x[3])
        forbidden = [two for one in joints for two in constraint_twists(one, x[: len(one.units)], frame)]
        twists = [entry for _, _, (w, v) in forbidden for entry in (*w, *v)]
        return [*frame.rotation[0], *frame.translation, *twists]

    row = (0.3, -0.7, 0.2, 2.5)  # rounding of numbers near 1
    np.testing.assert_allclose(traced(entries, 4)(row), entries(row), atol=1e-15)


def test_a_cam_lifts_by_its_periodic_spline_of_columns_numbers_and_symbols() -> None:
    (cam,) = load_network(CAM).elements
    angles, spline = np.linspace(-20.0, 20.0, 4001), spline_of(UNEVEN)
    columns = np.array(transmission(cam, angles))
    for order, column in enumerate(columns):  # lifts of 1e-2 m and their slopes: rounding
        np.testing.assert_allclose(column, spline(angles, order), atol=(1e-15, 1e-14)[order])
    symbols = traced(lambda x: transmission(cam, x[0]), 1)
    for k in range(0, 4001, 100):
        np.testing.assert_array_equal(columns[:, k], transmission(cam, float(angles[k])))
        # sums in another order
        np.testing.assert_allclose(symbols(angles[k : k + 1]), columns[:, k], atol=1e-15)


# --- Newton steps

NETWORKS = [*SHIPPED, load_network(DOOR)]


def residual(mechanism: Mechanism, x: FloatArray) -> FloatArray:
    return np.array(rates.closure_residual(mechanism, x.tolist()), dtype=np.float64)


@pytest.mark.parametrize("network", NETWORKS, ids=lambda network: network.name)
def test_the_jacobian_is_that_of_finite_differences_where_the_network_is_closed(network: Any) -> None:
    mechanism = build_mechanism(network)
    x = assemble(mechanism, restarts=0).x[:, 0]
    assert np.abs(residual(mechanism, x)).max() < 1e-13  # rounding
    found = np.array(rates.closure_jacobian(mechanism, x.tolist()), dtype=np.float64).T
    # error of the quotient: step^6 and 1e-16 / step
    by_difference = difference(one_by_one(lambda at: residual(mechanism, at)), x, 1e-5)[:, mechanism.free]
    expected = by_difference * mechanism.column_scales[mechanism.free]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("network", NETWORKS, ids=lambda network: network.name)
def test_steps_converge_quadratically_and_columns_give_what_floats_give(network: Any) -> None:
    mechanism, rng = build_mechanism(network), np.random.default_rng(3)
    x = np.repeat(assemble(mechanism, restarts=0).x, 4, axis=1)
    scales = mechanism.column_scales[mechanism.free, np.newaxis]
    x[mechanism.free] += 1e-3 * scales * rng.uniform(-1.0, 1.0, (len(mechanism.free), 4))

    def left_over(steps: int) -> float:
        rows = rates.closure_residual(mechanism, rates.close_network(mechanism, [*x], steps))
        return max(float(np.abs(row).max()) for row in rows)

    # from 1e-3 a step leads below 1e-6 times the curvature, two below its square times the curvature
    assert left_over(1) < 3e-5
    assert left_over(2) < 1e-8
    assert left_over(3) < 1e-13
    columns = rates.close_network(mechanism, [*x], 2)
    floats = np.array([rates.close_network(mechanism, one.tolist(), 2) for one in x.T], dtype=np.float64).T
    for column, row in zip(columns, floats, strict=True):
        np.testing.assert_allclose(np.broadcast_to(column, 4), row, atol=1e-11)  # rounding over mu


def test_a_damped_step_is_that_of_least_squares_also_with_redundant_rows_and_idle_columns() -> None:
    rng = np.random.default_rng(4)
    J = rng.normal(size=(8, 5))
    J[:, 4] = J[:, 0] - 2.0 * J[:, 1]  # which no row determines
    J[5:] = J[:3] + J[2:5]
    e = J @ rng.normal(size=5)
    step = np.array(rates.damped_normal_step([[*map(float, column)] for column in J.T], [*map(float, e)]))
    np.testing.assert_allclose(J @ step, -e, atol=1e-10)
    least = np.linalg.lstsq(J, -e, rcond=1e-9)[0]
    # along the idle direction rounding of some 1e-15 of e over mu = 1e-13: some percent
    assert float(np.linalg.norm(step - least)) < 0.2 * float(np.linalg.norm(least))


@pytest.mark.parametrize("name", ["four-bar", "cam-follower", "stewart-gough-driven"])
def test_steps_that_close_a_network_are_the_same_of_symbols_and_numbers(name: str) -> None:
    mechanism = build_mechanism(load_network(name))
    before = assemble(mechanism).x[:, 0]
    x = before + np.random.default_rng(2).normal(scale=1e-3, size=len(before))

    def step(x: Any) -> list[Any]:
        ahead = [x[k] + 0.01 for k in mechanism.controls]
        changes = rates.variable_changes(mechanism, before.tolist(), x)
        predicted = rates.predict_variables(mechanism, x, changes, ahead)
        columns, closed = (
            rates.closure_jacobian(mechanism, predicted),
            rates.close_network(mechanism, predicted, 3),
        )
        return [rates.largest_residual(mechanism, predicted), *chain.from_iterable(columns), *closed]

    numbers = np.array([float(one) for one in step(x.tolist())])
    # of sums of products of numbers near 1 rounding remains, which three Newton steps take along
    np.testing.assert_allclose(traced(step, len(x))(x), numbers, atol=1e-11)
    left = rates.largest_residual(mechanism, numbers[-len(x) :].tolist())
    assert abs(left) < 1e-9  # as far as steps of h^2 lead


# --- values with two derivatives: each rule against differences of the function itself, through NumPy

STEP = 0.01

RULES = """
    3.0 + u + v;  1.5 - u - v;  -u;  u * v * 2.0;  u / v;  2.0 / u;  np.square(u);  u**3 - v**-2 + u**0.5
    (-u) ** 3;  u**v + 2.0**v;  np.sin(u);  np.cos(u * v);  np.tan(0.5 * u);  np.exp(u - v);  np.log(u)
    np.sqrt(u + v);  np.arctan2(u - 1.0, -v);  u * np.floor(v + 7.5);  np.remainder(u + 10.0, 6.0)
    np.maximum(u * u, v - 9.0) + np.maximum(u, 0.1);  np.minimum(u - 9.0, v * v) + np.minimum(0.1, v)
    np.where(u > v, u * v, v / u) + np.where(u < 0.0, 1.0, v);  np.abs(u - 5.0) + np.abs(v)
"""


def u_at(t: Any) -> Any:
    return 1.2 + 0.4 * t + 0.3 * t**2


def v_at(t: Any) -> Any:
    return 2.0 + 0.2 * t - 0.5 * t**2


@pytest.mark.parametrize("formula", RULES.strip().replace("\n", ";").split(";"))
def test_rules_are_derivatives(formula: str) -> None:
    """Of the columns u(t) and v(t) at three times, and of floats."""
    rule = eval(f"lambda u, v: {formula}", {"np": np})
    t, steps = np.array([0.0, 0.3, -0.2]), STEP * np.arange(-4, 5)
    u = Taylor(u_at(t), 0.4 + 0.6 * t, np.full(3, 0.6))
    v = Taylor(v_at(t), 0.2 - t, np.full(3, -1.0))
    found = rule(u, v)
    values = np.array([rule(u_at(t + step), v_at(t + step)) for step in steps])
    # eighth order: h^8 = 1e-16; rounding of 1e-15 / h and 1e-14 / h^2
    np.testing.assert_allclose(found.value, rule(u_at(t), v_at(t)), rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.first, FIRST @ values / STEP, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.second, SECOND @ values / STEP**2, rtol=0, atol=1e-9)
    scalar = rule(Taylor(u_at(0.3), 0.58, 0.6), Taylor(v_at(0.3), -0.1, -1.0))
    for part in ("value", "first", "second"):
        assert float(getattr(scalar, part)) == pytest.approx(getattr(found, part)[1], rel=1e-14, abs=0.0)
