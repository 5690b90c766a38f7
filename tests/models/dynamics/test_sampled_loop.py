"""Driven arms at rest: equilibrium, and the stability of sampled controllers against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from made_masses import driven, with_drives, with_masses
from urmpipe_models.arm.chain import Chain, Inertial, Joint
from urmpipe_models.drives import CounterbalanceSpring, DrivenJoint, Gains, PassiveJoint
from urmpipe_models.dynamics import driven_arm
from urmpipe_models.dynamics.driven_arm import spectral_radius
from urmpipe_models.dynamics.links import Wrench
from urmpipe_models.robots.catalogue import load_robot

PERIOD, MASS, RADIUS, GRAVITY = 5e-3, 2.0, 0.5, 9.81
EXACT = 1e-7  # of values of about 1: eigenvalues of rates up to 1e3 / s; differences of gravity, 1e-16 / 1e-5


@pytest.mark.parametrize("wrench", [None, Wrench((3.0, 2.0, -1.0), (0.1, 0.2, 0.3))])
def test_nothing_accelerates_in_equilibrium(wrench: Wrench | None) -> None:
    chain = with_drives(with_masses(load_robot("urm6")), held=("phi5",))
    joints = driven_arm.find_equilibrium(chain, wrench)
    actuators = [
        driven_arm.Spring(drive.stiffness, drive.damping, joint.rest)
        if isinstance(drive, PassiveJoint)
        else driven_arm.Motor(drive.drive, joint.rest, 0.0, joint.current, joint.voltage)
        for drive, joint in zip(chain.drives, joints, strict=True)
    ]
    state = driven_arm.ArmState([joint.q for joint in joints], [0.0] * 6, actuators)
    rates = np.ravel([*driven_arm.motor_derivatives(state).values()])
    # equilibrium to 1e-12 rad by 2500 N.m/rad over M
    np.testing.assert_allclose(rates, 0.0, atol=1e-8)
    np.testing.assert_allclose(driven_arm.joint_accelerations(chain, state, wrench), 0.0, atol=1e-8)


def three_slides(x: PassiveJoint, *periods: float) -> Chain:
    """Return slides along x, y and z, a drive on the last two: none moves the others."""
    joints = tuple(Joint(name, "prismatic", axis=tuple(u)) for name, u in zip("xyz", np.eye(3), strict=True))
    drives = (replace(driven(joint), period=period) for joint, period in zip("yz", periods, strict=True))
    return Chain("slides", joints, inertials=(Inertial("z", MASS),), drives=(x, *drives))


@pytest.mark.parametrize("periods", [(5e-3, 5e-3), (7.5e-3, 5e-3), (5e-3, 1e-2)])
def test_a_damped_slide_dies_away_with_half_its_damping_over_the_mass(periods: tuple[float, float]) -> None:
    """A sample is one of the shortest period, whatever the others are."""
    chain = three_slides(PassiveJoint("x", 800.0, 0.5), *periods)
    expected = np.exp(-0.5 / (2.0 * MASS) * PERIOD)
    assert spectral_radius(chain, np.zeros(3)) == pytest.approx(expected, abs=EXACT)
    calmer = three_slides(PassiveJoint("x", 800.0, 1e3), *periods)  # now a drive is the slowest
    assert spectral_radius(calmer, np.zeros(3)) < expected - 1e-4


def upright(*drives: DrivenJoint | PassiveJoint) -> Chain:
    """Return a pendulum that stands up at q = 0; with two drives a slide along its axis carries it."""
    joints = Joint("s", "prismatic", axis=(0.0, 1.0, 0.0)), Joint("q", axis=(0.0, 1.0, 0.0))
    inertials, gravity = (Inertial("q", MASS, (0.0, 0.0, RADIUS)),), (0.0, 0.0, -GRAVITY)
    return Chain("pendulum", joints[-len(drives) :], inertials=inertials, drives=drives, gravity=gravity)


@pytest.mark.parametrize("stiffness", [1.0, 9.0])
def test_a_pendulum_that_stands_up_falls_as_its_weight_and_spring_let_it(stiffness: float) -> None:
    rate = np.sqrt(GRAVITY / RADIUS - stiffness / (MASS * RADIUS**2))
    radius = spectral_radius(upright(driven("s"), PassiveJoint("q", stiffness, 0.0)), np.zeros(2))
    assert radius == pytest.approx(np.exp(rate * PERIOD), abs=EXACT)
    assert radius > 1.005
    hanging = spectral_radius(upright(driven("s"), PassiveJoint("q", stiffness, 0.1)), np.array([0.0, np.pi]))
    assert hanging == pytest.approx(np.exp(-0.1 / (2.0 * MASS * RADIUS**2) * PERIOD), abs=EXACT)


def test_a_counterbalance_spring_takes_the_weight_from_a_drive() -> None:
    """k_spring = m g r leaves what the drive has without gravity; without it the radius is another."""
    drive, spring = driven("q"), CounterbalanceSpring(MASS * GRAVITY * RADIUS, 0.0)
    relieved, without = upright(replace(drive, spring=spring)), upright(drive)
    arms = (relieved, replace(without, gravity=(0.0, 0.0, 0.0)), without)
    radii = [spectral_radius(arm, np.zeros(1)) for arm in arms]
    assert radii[0] == pytest.approx(radii[1], abs=EXACT)
    assert abs(radii[2] - radii[1]) > 1e2 * EXACT


def test_a_voltage_that_no_sample_changes_stays() -> None:
    idle = replace(driven("q"), gains=Gains(0.0, 0.0, 0.0))
    chain = Chain("idle", (Joint("q"),), inertials=(Inertial("q", MASS, (RADIUS, 0.0, 0.0)),), drives=(idle,))
    assert spectral_radius(chain, np.zeros(1)) == pytest.approx(1.0, abs=EXACT)
