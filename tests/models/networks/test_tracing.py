"""Poses of bodies are elementwise: symbols of CasADi pass through the same lines as numbers and columns."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

from urmpipe_models.networks.elements import element_frame
from urmpipe_models.networks.file import Network, load_network, network_names
from urmpipe_models.networks.mechanism import Mechanism, build_mechanism

KINDS: dict[str, Any] = {
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
"""Each kind of joint, each operator and function."""


def entries(mechanism: Mechanism, x: Any) -> list[Any]:
    """Return all entries of the poses of all bodies."""
    frames = mechanism.poses(x).values()
    return [one for frame in frames for row in (*frame.rotation, frame.translation) for one in row]


@pytest.mark.parametrize("network", [*map(load_network, network_names()), load_network(KINDS)])
def test_poses_of_symbols_numbers_and_columns_are_the_same(network: Network) -> None:
    import casadi as ca

    mechanism = build_mechanism(network)
    x = np.random.default_rng(1).uniform(0.1, 0.9, (len(mechanism.variables), 5))
    x[mechanism.rotations[0] if mechanism.rotations else slice(0), 0] = (
        0.0  # where series stand for quotients
    )
    columns = np.array([np.broadcast_to(one, 5) for one in entries(mechanism, x)])
    symbols = [ca.SX.sym(f"x{k}") for k in range(len(x))]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # CasADi's notice of how it takes NumPy's functions
        traced = ca.Function("poses", symbols, [ca.vertcat(*map(ca.SX, entries(mechanism, symbols)))])
    for k in range(5):
        numbers = np.array([float(one) for one in entries(mechanism, [float(value) for value in x[:, k]])])
        # sums of products of numbers near 1: rounding
        np.testing.assert_allclose(columns[:, k], numbers, atol=1e-14)
        np.testing.assert_allclose(np.array(traced(*x[:, k])).ravel(), numbers, atol=1e-14)


def test_the_frame_of_an_element_of_symbols_is_that_of_numbers() -> None:
    import casadi as ca

    row = (0.3, -0.7, 0.2, 2.5)
    symbols = [ca.SX.sym(f"x{k}") for k in range(4)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        frame = element_frame(*symbols)
        traced = ca.Function("frame", symbols, [ca.vertcat(*frame.rotation[0], *frame.translation)])
    frame = element_frame(*row)
    expected = [*frame.rotation[0], *frame.translation]
    np.testing.assert_allclose(
        np.array(traced(*row)).ravel(), expected, atol=1e-15
    )  # rounding of numbers near 1
