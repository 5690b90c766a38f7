"""The Jacobian of what does not close, against differences: all kinds, driven or free, closed or open."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import random_networks as rn
from known_mechanisms import MECHANISMS
from test_higher_pairs import shaft
from test_joint_motion import user_motion
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.networks.closure import evaluate_closure
from urmpipe_models.networks.file import Network, load_network
from urmpipe_models.networks.mechanism import Mechanism, build_mechanism
from urmpipe_models.networks.parts import Body, Control, Expression, Joint

# of the largest entry: differences of 1e-3 round to 1e-12 and neglect 1e-18 times the seventh derivative,
# which is large near a half turn and where lines are nearly parallel
RELATIVE = 1e-8
HALF_TURN = 3.0  # rad: gaps beyond are left out, as at pi the rotation vector jumps
# of what drives joints: u is a function of s and t
FORMULAS = ("0.7 * s - t", "sin(u) + 0.2 * s ** 2", "atan2(t, 2 + s * s)", "0.4", "sqrt(2 + s * t / 4) - u")
CONTROLS = (
    Control("u", value=Expression("v * s + cos(t)")),  # stands before what it is a function of
    Control("s", 0.3),
    Control("v", value=Expression("0.5 + t")),
    Control("t", -0.4),
)


def driven_at_random(network: Network, rng: np.random.Generator) -> Network:
    """Return a network with about half of its variables and lengths driven, and a user joint."""
    joints = []
    for one in network.joints:
        drives = tuple(
            Expression(FORMULAS[int(rng.integers(len(FORMULAS)))]) if rng.random() < 0.5 else None
            for _ in one.units
        )
        start = rn.random_values(one.kind, rng)
        joints.append(replace(one, start=start, values=drives if any(drives) else ()))
    user = Joint("user", "user", rn.random_pair(network.body_names, rng), motion=user_motion())
    joints.insert(int(rng.integers(len(joints))), user)
    elements = tuple(
        replace(one, length=Expression(f"{one.length.text} + 0.1 * s * u")) if rng.random() < 0.7 else one
        for one in network.elements
    )
    return Network(network.name, network.bodies, tuple(joints), elements, CONTROLS)


def residual_of(mechanism: Mechanism, x: FloatArray) -> FloatArray:
    return evaluate_closure(mechanism, x[:, np.newaxis]).residual[:, 0]


def assert_right(mechanism: Mechanism, x: FloatArray) -> int:
    """Compare the Jacobian with differences but for loops half a turn open; return the number of rows."""
    residual = residual_of(mechanism, x)
    compared = np.ones(len(residual), dtype=bool)
    for k in range(len(mechanism.graph.cuts)):
        compared[6 * k : 6 * k + 6] = np.linalg.norm(residual[6 * k + 3 : 6 * k + 6]) < HALF_TURN
    found = evaluate_closure(mechanism, x[:, np.newaxis]).jacobian[compared, :, 0]
    expected = rn.difference(lambda at: evaluate_closure(mechanism, at).residual[compared], x)
    rn.assert_close(found, expected, RELATIVE * max(1.0, np.abs(expected).max(initial=0.0)))
    return int(compared.sum())


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_random_networks_where_they_close_and_driven_ones_far_from_closing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    network = rn.random_network(rng, bodies=4, extra=2, elements=3)
    closed, mechanism = build_mechanism(network), build_mechanism(driven_at_random(network, rng))
    assert np.abs(residual_of(closed, closed.start)).max() < 1e-13
    assert assert_right(closed, closed.start) == closed.rows
    x = mechanism.start
    rows = [assert_right(mechanism, x + rng.normal(size=len(x)) * step) for step in (0.0, 0.3, 1.0, 1.0)]
    assert sum(rows) > len(residual_of(mechanism, x))  # of four times as many


@pytest.mark.parametrize("seed", range(20))
def test_clusters_of_bodies_of_their_own(seed: int) -> None:
    """Parts that only elements tie: the freedoms of their first bodies are variables, near 0 turns, too."""
    rng = np.random.default_rng(seed)
    poses = {"ground": np.eye(4)} | {name: rn.random_pose(rng) for name in ("a1", "a2", "b1", "b2")}
    joints = [
        rn.joint_between("a", rn.KINDS[seed % 5], ("a2", "a1"), poses, rng),
        rn.joint_between("b", rn.KINDS[(seed + 2) % 5], ("b1", "b2"), poses, rng),
    ]
    pairs = [*(rn.random_pair([*poses], rng) for _ in range(6)), ("ground", "a2"), ("ground", "b1")]
    elements = [
        rn.element_between(f"e{k}", rn.ELEMENTS[int(rng.integers(4))], pair, poses, rng)
        for k, pair in enumerate(pairs)
    ]
    vector = 1e-5 if seed % 3 == 0 else 1.0
    bodies = (Body("a1", (0.1, 0.2, 0.3, vector, 0.0, -vector)), Body("a2"), Body("b1"), Body("b2"))
    mechanism = build_mechanism(Network("clusters", bodies, tuple(joints), tuple(elements)))
    assert len(mechanism.graph.roots) == 3
    for step in (0.0, 0.3, 1.0):
        assert_right(mechanism, mechanism.start + step * rng.normal(size=len(mechanism.variables)))


# gears, a rack and a cam of joints that are driven, in a loop or on a tree
PAIRS: dict[str, Any] = {
    "bodies": {name: {} for name in ("a", "b", "c", "d")},
    "controls": {"t": {"start": 0.3}, "u": {"value": "t ** 2"}},
    "joints": {
        "A": shaft(("ground", "a"), value="sin(t) + u"),
        "B": {"kind": "cylindrical", "bodies": ["a", "b"], "value": ["", "0.1 * t"]},
        "C": {"kind": "helical", "bodies": ["b", "c"], "pitch": 0.05},
        "D": {"kind": "cylindrical", "bodies": ["ground", "c"], "a": [0.1, 0.2, 0]},  # closes a loop
        "E": {"kind": "prismatic", "bodies": ["c", "d"], "n": [0.6, 0, 0.8]},
    },
    "elements": {
        "AB": {"kind": "gear", "joints": ["A", "B"], "teeth": [3, -7], "offset": "u"},
        "BC": {"kind": "gear", "joints": ["C", "B"], "teeth": [2, 1]},
        "BD": {"kind": "rack", "joints": ["B", "D"], "radius": -0.2, "offset": "0.1 + t"},
        "AE": {"kind": "cam", "joints": ["A", "E"], "profile": [[0, 0], [1, 0.3], [2, -0.1], [4, 0.2]]},
        "rod": {"kind": "gg", "bodies": ["ground", "d"], "a": [0.1, 0, 0], "d": 0.3},
    },
}  # fmt: skip


@pytest.mark.parametrize("name", [*MECHANISMS, "pairs"])
def test_known_mechanisms_and_many_configurations_at_once(name: str) -> None:
    """A block of configurations gives what each gives alone."""
    mechanism = build_mechanism(load_network(PAIRS) if name == "pairs" else MECHANISMS[name](drive="s"))
    rng = np.random.default_rng(0)
    x = mechanism.start[:, np.newaxis] + 0.3 * rng.normal(size=(len(mechanism.variables), 7))
    together = evaluate_closure(mechanism, x)
    for k in range(7):
        alone = evaluate_closure(mechanism, x[:, k : k + 1])
        # sums in another order
        rn.assert_close(together.residual[:, k], alone.residual[:, 0], 1e-14)
        rn.assert_close(together.jacobian[:, :, k], alone.jacobian[:, :, 0], 1e-14)
        assert_right(mechanism, x[:, k])
