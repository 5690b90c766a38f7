"""The motion of a block of a simulation as a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from asserting import refusal
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError, OptionError
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.simulations.motion import moving_blocks, run_of_block
from urmpipe_pipeline.simulations.simulation import Signal, SimulatedArm, Simulation

MakeSimulation = Callable[..., Simulation]

SLIDES = Chain("slides", (Joint("turn"), Joint("way", kind="prismatic"), Joint("twist")))


def with_signals(simulation: Simulation, *signals: Signal, arms: tuple[SimulatedArm, ...] = ()) -> Simulation:
    return replace(simulation, signals=signals, arms=arms, verdicts=())


def smooth(simulation: Simulation, columns: int, order: int = 0) -> FloatArray:
    """Return slow sines, and their derivatives of an order."""
    phase = np.outer(simulation.t, np.ones(columns)) + np.arange(columns) + order * np.pi / 2
    return 0.1 * np.sin(phase)


def test_a_block_that_is_an_arm_moves_as_its_joints_do(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(50)
    run = run_of_block(simulation, "chain")
    assert (run.name, run.robot) == ("log-to-delta (chain)", simulation.arms[0].chain)
    assert run.log.joints == simulation.arms[0].chain.coordinates
    np.testing.assert_array_equal(run.q, simulation.arms[0].q)
    np.testing.assert_array_equal(run.t_ns, simulation.t_ns)
    assert [one.kind for one in run.log.warnings] == ["gap"]  # what the simulation said of its log
    assert run.provenance == simulation.provenance


def test_a_block_with_joints_takes_the_only_arm_that_has_as_many(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(50)
    run = run_of_block(simulation, "log")
    np.testing.assert_array_equal(run.q, simulation.signal("log.q").values)
    assert run.robot is simulation.arms[0].chain
    assert [one.evidence for one in run.log.inferences if one.what == "robot"] == [
        "block chain is the only arm of the simulation with as many joints"
    ]
    twice = replace(simulation, arms=(*simulation.arms, replace(simulation.arms[0], block="second")))
    assert run_of_block(twice, "log").robot is None


def test_a_block_is_named_where_several_move(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(5)
    assert moving_blocks(simulation) == ("chain", "log")
    assert refusal(LogError, run_of_block, simulation) == (
        "log-to-delta: found 2 blocks with a motion, allowed: one; use --block chain or --block log"
    )
    for other in ("nosuch", "meter"):
        assert refusal(OptionError, run_of_block, simulation, other) == (
            f"block (--block): found '{other}', allowed: chain, log, which have a motion in log-to-delta"
        )
    alone = run_of_block(replace(simulation, signals=simulation.signals[1:]))
    assert alone.name == "log-to-delta (chain)"
    assert [(one.what, one.value) for one in alone.log.inferences][:1] == [("block", "chain")]
    meter = with_signals(simulation, *simulation.signals[2:])
    assert "found no block with joints" in refusal(LogError, run_of_block, meter)
    assert "without a sample" in refusal(LogError, run_of_block, make_simulation(0), "chain")


def test_joints_that_slide_stand_in_the_order_of_the_arm(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(50)
    turns, ways = smooth(simulation, 2), smooth(simulation, 1)
    both = with_signals(simulation, Signal("a", "phi", turns, "rad"), Signal("a", "s", ways, "m"))
    run = run_of_block(both, "a", SLIDES)
    np.testing.assert_array_equal(run.q, np.column_stack((turns[:, 0], ways[:, 0], turns[:, 1])))
    assert run.log.joint_units == ("rad", "m", "rad")
    assert "tells their order" in refusal(LogError, run_of_block, both, "a")
    assert refusal(LogError, run_of_block, make_simulation(50), "log", SLIDES) == (
        "log-to-delta: found 6 revolute and 0 prismatic joints, allowed: 2 revolute and 1 prismatic joints,"
        " as robot slides has"
    )


def test_the_rates_of_a_block_are_those_that_it_recorded(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(200)
    named = zip(("phi", "phid", "phidd"), ("rad", "rad/s", "rad/s2"), range(3), strict=True)
    signals = [Signal("a", name, smooth(simulation, 2, order), unit) for name, unit, order in named]
    run = run_of_block(with_signals(simulation, *signals))
    np.testing.assert_array_equal(run.qd, signals[1].values)
    np.testing.assert_array_equal(run.qdd, signals[2].values)
    assert (run.log.joints, run.robot, run.derivative) == (("q1", "q2"), None, "recorded")


@pytest.mark.parametrize(("point", "turned"), [("p", False), ("p3", True)])
def test_a_block_with_a_point_is_a_path(make_simulation: MakeSimulation, point: str, turned: bool) -> None:
    simulation = make_simulation(20)
    place, angles = smooth(simulation, 3), smooth(simulation, 3)
    signals = [Signal("a", "p1", 2.0 * place, "m"), Signal("a", point, place, "m")]
    if turned:
        names = zip(("rz3", "ry3", "rx3"), angles.T, strict=True)
        signals += [Signal("a", name, values, "rad") for name, values in names]
    run = run_of_block(with_signals(simulation, *signals))
    assert (run.log.joints, run.log.rotation_form) == ((), "zyx" if turned else None)
    assert run.tcp_recorded is not None
    np.testing.assert_array_equal(run.tcp_recorded, place)
    if turned:
        assert run.log.tcp_rotation is not None
        np.testing.assert_array_equal(run.log.tcp_rotation, angles)


def test_arrays_of_other_units_are_no_motion(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(20)
    two, three = smooth(simulation, 2), smooth(simulation, 3)
    signals = (
        Signal("a", "q", two, "deg"), Signal("b", "p", three, "mm"), Signal("c", "p", two, "m"),
        Signal("d", "q", two[:, 0], "rad"), Signal("e", "q", two, "rad"), Signal("e", "phi", two, "rad"),
    )  # fmt: skip
    assert moving_blocks(with_signals(simulation, *signals)) == ()


def test_no_verdict_rests_on_the_motion_of_a_simulation_that_failed(make_simulation: MakeSimulation) -> None:
    failed = make_simulation(20, failed="meter: gone")
    assert refusal(LogError, run_of_block, failed, "chain") == (
        "log-to-delta: found a simulation that ended early, allowed: a whole one; meter: gone"
    )


def test_nor_on_one_to_which_leads_what_is_not_finite(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(20)
    assert "chain" in {to.split(".")[0] for to in simulation.connections}
    odd = LogWarning(
        "not-finite", "found nan at t = 0.4 s; values that are not finite: 2", about="log", column="q"
    )
    other = replace(odd, about="meter")
    assert refusal(LogError, run_of_block, replace(simulation, warnings=(odd, other)), "chain") == (
        "log-to-delta: log.q: found nan at t = 0.4 s; values that are not finite: 2; allowed: none where"
        " block chain is judged"
    )
    assert other in run_of_block(replace(simulation, warnings=(other,)), "chain").log.warnings
