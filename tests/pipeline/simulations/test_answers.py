"""Set points beside what came of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest

from urmpipe_pipeline.presentation.palette import JOINT_COLOURS, REFERENCE_COLOUR
from urmpipe_pipeline.simulations.signal_groups import ANSWERS, answers_of
from urmpipe_pipeline.simulations.simulation import Signal, Simulation

MakeSimulation = Callable[..., Simulation]


@pytest.fixture
def controlled(make_simulation: MakeSimulation) -> Simulation:
    """Two controllers, each with its set point and its load."""
    signals: list[Signal] = []
    connections: dict[str, str] = {}
    for i in (1, 2):
        for name, unit in (("theta", "rad"), ("omega", "rad/s")):
            signals += [Signal(f"{block}{i}", name, np.arange(3.0), unit) for block in ("load", "set_point")]
            connections |= {f"controller{i}.set_{name}": f"set_point{i}.{name}"}
            connections |= {f"controller{i}.real_{name}": f"load{i}.{name}"}
    return replace(make_simulation(3), signals=tuple(signals), connections=connections, verdicts=(), arms=())


def test_set_points_stand_before_their_answers_a_plot_a_quantity(controlled: Simulation) -> None:
    theta, omega = answers_of(controlled)
    assert (theta.block, theta.variables, theta.unit, theta.wanted) == (ANSWERS, "theta", "rad", 2)
    assert [one.name for one in theta.signals] == [
        "set_point1.theta", "set_point2.theta", "load1.theta", "load2.theta",
    ]  # fmt: skip
    assert theta.names == tuple((one.name,) for one in theta.signals)
    assert theta.colours == (
        (REFERENCE_COLOUR,), (REFERENCE_COLOUR,), (JOINT_COLOURS[0],), (JOINT_COLOURS[1],),
    )  # fmt: skip
    assert (omega.variables, omega.unit) == ("omega", "rad/s")


def test_one_set_point_of_two_controllers_is_drawn_once(controlled: Simulation) -> None:
    shared = dict(controlled.connections) | {"controller2.set_theta": "set_point1.theta"}
    theta = answers_of(replace(controlled, connections=shared))[0]
    assert [one.name for one in theta.signals] == ["set_point1.theta", "load1.theta", "load2.theta"]


@pytest.mark.parametrize(
    "connections",
    [
        {},
        {"c.set_theta": "set_point1.theta"},
        {"c.real_theta": "load1.theta"},
        {"c.set_theta": "set_point1.theta", "c.real_omega": "load1.omega"},
        {"c.set_theta": "set_point1.theta", "other.real_theta": "load1.theta"},
        {"c.set_theta": "set_point1.theta", "c.real_theta": "load1.omega"},
        {"c.set_theta": "set_point1.theta", "c.real_theta": "not.recorded"},
        {"c.set_theta": "not.recorded", "c.real_theta": "load1.theta"},
    ],
)
def test_what_is_no_pair_is_no_answer(controlled: Simulation, connections: Mapping[str, str]) -> None:
    assert answers_of(replace(controlled, connections=connections)) == []


def test_elements_of_arrays_are_answers_a_plot_a_quantity(controlled: Simulation) -> None:
    q = np.arange(6.0).reshape(3, 2)
    arm = Signal("arm", "phi", q, "rad", "deg")
    connections = {f"c{i}.set_theta": f"set_point{i}.theta" for i in (1, 2)}
    connections |= {f"c{i}.real_theta": f"arm.phi[{i}]" for i in (1, 2)}
    signals = (*controlled.signals, arm)
    (theta,) = answers_of(replace(controlled, signals=signals, connections=connections))
    assert [one.name for one in theta.signals[2:]] == ["arm.phi[1]", "arm.phi[2]"]
    np.testing.assert_array_equal(theta.signals[3].values, q[:, 1])
    assert (theta.variables, theta.signals[3].display_unit) == ("theta, phi", "deg")


@pytest.mark.parametrize("connected", [True, False])
def test_without_a_measuring_input_the_answer_is_the_output_of_that_name(
    controlled: Simulation, connected: bool
) -> None:
    """A block that is controlled inside has it so; its set point may come from a log."""
    arm = Signal("arm", "phi", np.zeros((3, 2)), "rad")
    logged = Signal("arm", "set_phi", np.ones((3, 2)), "rad")
    connections = {f"arm.set_phi[{i}]": f"set_point{i}.theta" for i in (1, 2)} if connected else {}
    signals = (*controlled.signals, arm, *(() if connected else (logged,)))
    (phi,) = answers_of(replace(controlled, signals=signals, connections=connections))
    wanted = ["set_point1.theta", "set_point2.theta"] if connected else ["arm.set_phi"]
    real = ["arm.phi[1]", "arm.phi[2]"] if connected else ["arm.phi"]
    assert [one.name for one in phi.signals] == [*wanted, *real]
    assert phi.wanted == len(wanted)
