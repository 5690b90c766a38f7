"""Newton steps of a closure element by element, and networks as tables."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.networks.assembly import assemble
from urmpipe_models.networks.file import load_network, network_names
from urmpipe_models.networks.joint_motion import exp3, wrap_rotation_vector
from urmpipe_models.networks.mechanism import Mechanism, build_mechanism
from urmpipe_models.networks.rates import (
    close_network,
    closure_jacobian,
    closure_residual,
    damped_normal_step,
)
from urmpipe_models.networks.tables import network_tables, with_start

DOOR: dict[str, Any] = {
    "angle_unit": "deg",
    "controls": {"opening": {"start": 20, "lower": -10, "upper": 90}},
    "chains": {"arm": {"robot": "ur5e", "start": [0, -90, 100, -10, 90, 0]}},
    "bodies": {"door": {}},
    "joints": {
        "hinge": {
            "kind": "revolute", "bodies": ["ground", "door"], "n": [0, 0, 1],
            "a": [[0.6, -0.5, 0], [0, 0, 0]], "driven": "opening",
        },
        "grip": {
            "kind": "user", "bodies": ["door", "arm.tool"],
            "m": [0, 0, 1], "n": [0, 1, 0], "a": [0, 0.5, 0.4],
        },
    },
}  # fmt: skip
"""An arm of the catalogue that holds the handle of a door."""

NETWORKS = [*map(load_network, network_names()), load_network(DOOR)]


def residual(mechanism: Mechanism, x: FloatArray) -> FloatArray:
    """Return the residual of a configuration."""
    return np.array(closure_residual(mechanism, x.tolist()), dtype=np.float64)


@pytest.mark.parametrize("network", NETWORKS, ids=lambda network: network.name)
def test_the_jacobian_is_that_of_finite_differences_where_the_network_is_closed(network: Any) -> None:
    mechanism = build_mechanism(network)
    x = assemble(mechanism, restarts=0).x[:, 0]
    assert (
        np.abs(np.array(closure_residual(mechanism, x.tolist()), dtype=np.float64)).max() < 1e-13
    )  # rounding
    step = 1e-6  # error of the quotient: step^2 and 1e-16 / step
    for k, column in zip(mechanism.free, closure_jacobian(mechanism, x.tolist()), strict=True):
        ahead, behind = x.copy(), x.copy()
        ahead[k] += step * mechanism.column_scales[k]
        behind[k] -= step * mechanism.column_scales[k]
        rows = [
            np.array(closure_residual(mechanism, one.tolist()), dtype=np.float64) for one in (ahead, behind)
        ]
        np.testing.assert_allclose(
            np.array(column, dtype=np.float64), (rows[0] - rows[1]) / (2.0 * step), atol=1e-8
        )


@pytest.mark.parametrize("network", NETWORKS, ids=lambda network: network.name)
def test_steps_converge_quadratically_and_columns_give_what_floats_give(network: Any) -> None:
    mechanism, rng = build_mechanism(network), np.random.default_rng(3)
    x = np.repeat(assemble(mechanism, restarts=0).x, 4, axis=1)
    scales = mechanism.column_scales[mechanism.free, np.newaxis]
    x[mechanism.free] += 1e-3 * scales * rng.uniform(-1.0, 1.0, (len(mechanism.free), 4))

    def left_over(steps: int) -> float:
        rows = closure_residual(mechanism, close_network(mechanism, [*x], steps))
        return max(float(np.abs(row).max()) for row in rows)

    # from 1e-3 a step leads below 1e-6 times the curvature, two below its square times the curvature
    assert left_over(1) < 3e-5
    assert left_over(2) < 1e-8
    assert left_over(3) < 1e-13
    columns = close_network(mechanism, [*x], 2)
    floats = np.array([close_network(mechanism, one.tolist(), 2) for one in x.T], dtype=np.float64).T
    for column, row in zip(columns, floats, strict=True):
        np.testing.assert_allclose(np.broadcast_to(column, 4), row, atol=1e-11)  # rounding over mu


def test_a_damped_step_is_that_of_least_squares_also_with_redundant_rows_and_idle_columns() -> None:
    rng = np.random.default_rng(4)
    J = rng.normal(size=(8, 5))
    J[:, 4] = J[:, 0] - 2.0 * J[:, 1]  # which no row determines
    J[5:] = J[:3] + J[2:5]
    e = J @ rng.normal(size=5)
    step = np.array(damped_normal_step([[*map(float, column)] for column in J.T], [*map(float, e)]))
    np.testing.assert_allclose(J @ step, -e, atol=1e-10)
    least = np.linalg.lstsq(J, -e, rcond=1e-9)[0]
    # along the idle direction rounding of some 1e-15 of e over mu = 1e-13: some percent
    assert float(np.linalg.norm(step - least)) < 0.2 * float(np.linalg.norm(least))


def test_a_wrapped_rotation_vector_turns_the_same_and_by_half_a_turn_at_most() -> None:
    for vector in np.random.default_rng(5).normal(size=(50, 3)) * 4.0:
        wrapped = wrap_rotation_vector(tuple(vector))
        assert float(np.linalg.norm(wrapped)) <= np.pi + 1e-12
        np.testing.assert_allclose(exp3(wrapped).rotation, exp3(tuple(vector)).rotation, atol=1e-12)


@pytest.mark.parametrize("network", NETWORKS, ids=lambda network: network.name)
def test_a_network_comes_back_from_its_tables_as_json_and_so_does_one_with_another_start(
    network: Any,
) -> None:
    tables = network_tables(network)
    again = load_network(json.loads(json.dumps(tables, allow_nan=False)))
    assert again == network
    mechanism = build_mechanism(network)
    x = mechanism.start + 0.01
    moved = build_mechanism(load_network(network_tables(with_start(network, x.tolist()))))
    assert moved.start.tolist() == x.tolist()
    assert (moved.graph.roots, moved.graph.cuts) == (mechanism.graph.roots, mechanism.graph.cuts)


def test_an_arm_beyond_its_limits_comes_back_from_its_tables() -> None:
    network = load_network({"chains": {"arm": {"robot": "panda", "start": [0, 0, 0, 1.0, 0, 2, 0]}}})
    again = load_network(network_tables(network))
    assert [joint.start for joint in again.joints] == [joint.start for joint in network.joints]


def test_tables_keep_every_kind_of_part_in_m_and_rad() -> None:
    parts = {
        "name": "kinds", "length_unit": "mm", "angle_unit": "deg", "ground": "base",
        "controls": {"s": {"start": 90, "upper": 200}, "t": {"value": "2 * s"}},
        "bodies": {"a": {}, "b": {}, "c": {}, "d": {"start": [1, 2, 3, 90, 0, 0]}},
        "joints": {
            "C": {"kind": "cylindrical", "bodies": ["base", "a"], "value": ["", "t / 2"], "start": [30, 0],
                  "lower": [-90, -500]},
            "H": {"kind": "helical", "bodies": ["a", "b"], "pitch": 5, "driven": "s", "upper": 360},
            "U": {"kind": "user", "bodies": ["b", "c"], "m": [1, 0, 0], "n": [0, "cos(0)", 0],
                  "a": ["s", 12.5, 0]},
            "G": {"kind": "global", "bodies": ["c", "base"], "a": [[1, 2, 3], [4, 5, 6]]},
        },
        "elements": {
            "gg": {"kind": "gg", "bodies": ["b", "d"], "a": [[1, 2, 3], [4, 5, 6]], "d": "t"},
            "eg": {"kind": "eg", "bodies": ["b", "d"], "n": [0, 0, 1], "a": [4, 5, 6], "h": "-s"},
            "crc": {"kind": "crc", "bodies": ["b", "d"], "n": [[1, 0, 0], [0, 1, 0]], "d": 3},
            "gc": {"kind": "gc", "bodies": ["b", "d"], "n": [0, 0, 1], "a": [[1, 2, 3], [4, 5, 6]], "d": 1},
            "gear": {"kind": "gear", "joints": ["C", "H"], "teeth": [20, -40], "offset": "t"},
            "rack": {"kind": "rack", "joints": ["H", "C"], "radius": -3},
        },
    }  # fmt: skip
    network = load_network(parts)
    assert load_network(network_tables(network)) == network
    assert network_tables(network)["joints"]["H"]["value"] == "(s) * pi / 180"
