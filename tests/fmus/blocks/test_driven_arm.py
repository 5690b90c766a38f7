"""An arm with drives: one function against other integrators, against its blocks, and at rest."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

from asserting import refusal
from fmu_run import FmuRun
from made_masses import DRIVE, driven, with_drives, with_masses
from sliding_arm import sprung_arm
from urmpipe_fmus.block import BlockModel, Output
from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.blocks.driven_arm import start_values
from urmpipe_fmus.build.fmu import cached_fmu
from urmpipe_fmus.cosim import Block, CosimulationRecord, System, load_system, prepare, simulate
from urmpipe_fmus.instance import Instance
from urmpipe_fmus.native import native_unavailable_reason
from urmpipe_models.arm.chain import Chain, Inertial, Joint
from urmpipe_models.drives import (
    NO_SPRING,
    CounterbalanceSpring,
    Drive,
    DrivenJoint,
    Gains,
    PassiveJoint,
    trapezoid,
)
from urmpipe_models.dynamics.driven_arm import (
    Actuator,
    ArmState,
    Motor,
    Spring,
    arm_energy,
    find_equilibrium,
    joint_accelerations,
    joint_torques,
    motor_derivatives,
    power_flow,
    shaft_torques,
    spectral_radius,
)
from urmpipe_models.dynamics.equations import inverse_dynamics
from urmpipe_models.dynamics.links import Wrench, chain_to_links, wrench_power
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import RobotError, UnitError, UrmpipeError
from urmpipe_models.kinematics.forward import forward, jacobian
from urmpipe_models.math3d import translation
from urmpipe_models.robots.catalogue import load_robot

PERIOD = 5e-3

needs_native = pytest.mark.skipif(
    bool(native_unavailable_reason(())), reason=f"runs native FMUs: {native_unavailable_reason(())}"
)


@cache
def urm6() -> Chain:
    """urm6 with masses that are made up, a drive on each joint."""
    return with_drives(with_masses(load_robot("urm6")))


def put(instance: Instance, **values: Any) -> None:
    """Set variables by name."""
    names = [one for one in instance.model.variables if one.name in values]
    for one in names:
        flat = np.ravel(np.broadcast_to(values[one.name], (one.width,))).tolist()
        instance.set([instance.reference(name) for name in one.names], flat)


def read(instance: Instance, *names: str) -> FloatArray:
    """Return variables by name, one after the other."""
    every = [
        scalar
        for name in names
        for one in instance.model.variables
        if one.name == name
        for scalar in one.names
    ]
    return np.array(instance.get([instance.reference(name) for name in every]), dtype=np.float64)


class OneSystem:
    """The model functions with DOP853, a controller's period at a time; springs hold joints without a drive.

    The state x is q and q', of the drives theta1, theta1' and the current, and integrals: of the power in and
    lost, and of what the wrench gives and the springs' dampers take of them.
    """

    def __init__(self, chain: Chain, wrench: Wrench) -> None:
        self.chain, self.wrench, self.n = chain, wrench, len(chain.coordinates)
        self.links = chain_to_links(chain)
        self.rests = find_equilibrium(chain)
        by_joint = {one.joint: one for one in chain.drives}
        self.joints = [by_joint[name] for name in chain.coordinates]
        self.driven = [k for k, one in enumerate(self.joints) if isinstance(one, DrivenJoint)]
        rest = [self.rests[k] for k in self.driven]
        motors = [[one.rest for one in rest], [0.0 for _ in rest], [one.current for one in rest]]
        self.voltages = [one.voltage for one in self.rests]
        self.x = np.concatenate((chain.start, np.zeros(self.n), *motors, np.zeros(4)))

    def state(self, x: FloatArray) -> ArmState:
        motors = dict(zip(self.driven, x[2 * self.n : -4].reshape(3, -1).T, strict=True))
        actuators: list[Actuator] = []
        for k, (one, rest) in enumerate(zip(self.joints, self.rests, strict=True)):
            if isinstance(one, DrivenJoint):
                theta1, omega1, current = motors[k]
                actuators.append(Motor(one.drive, theta1, omega1, current, self.voltages[k], one.spring))
            else:
                actuators.append(Spring(one.stiffness, one.damping, rest.rest))
        return ArmState(list(x[: self.n]), list(x[self.n : 2 * self.n]), actuators)

    def accelerations(self, state: ArmState) -> list[Any]:
        return joint_accelerations(self.chain, state, self.wrench, self.links)

    def rates(self, _t: float, x: FloatArray) -> FloatArray:
        state = self.state(x)
        motors = np.array([*motor_derivatives(state).values()]).T
        flows = power_flow(self.chain, state, self.wrench)
        pushed = wrench_power(self.chain, state.q, state.qd, self.wrench)
        damped = sum(
            one.damping * rate**2
            for one, rate in zip(state.actuators, state.qd, strict=True)
            if isinstance(one, Spring)
        )
        heat = [flows.supplied, flows.dissipated, pushed, damped]
        return np.concatenate((state.qd, self.accelerations(state), *motors, heat))

    def sample(self, wanted: FloatArray) -> None:
        """Take the sample of eq. 20: wanted are positions, velocities and accelerations, shape (3, n)."""
        state = self.state(self.x)
        real = np.array([state.q, state.qd, self.accelerations(state)])
        for k in self.driven:
            one = self.joints[k]
            assert isinstance(one, DrivenJoint)
            added = float(np.dot(one.gains, (wanted - real)[:, k]))
            self.voltages[k] = float(np.clip(self.voltages[k] + added, -48.0, 48.0))

    def go(self, duration: float) -> None:
        span = (0.0, duration)
        self.x = solve_ivp(self.rates, span, self.x, "DOP853", rtol=1e-10, atol=1e-12).y[:, -1]

    def stored(self) -> float:
        return float(arm_energy(self.chain, self.state(self.x)))


def moves(chain: Chain, targets: FloatArray) -> Callable[[float], FloatArray]:
    """Return set points over time: moves of all joints from the start on, shape (3, joints)."""

    def wanted(t: float) -> FloatArray:
        pairs = zip(chain.start, targets, strict=True)
        return np.array([trapezoid(t, 0.0, a, b, 3.0, 100.0) for a, b in pairs], dtype=float).T

    return wanted


def test_it_starts_in_equilibrium_with_shafts_twisted_and_currents_and_voltages_set() -> None:
    chain = urm6()
    model = Instance(make_block("driven_arm", robot=chain))
    still = [0.0] * 6
    torques = np.array(inverse_dynamics(chain, chain.start, still, still), dtype=float)
    assert np.abs(torques).max() > 2.0  # gravity pulls
    np.testing.assert_allclose(
        read(model, "theta1") - read(model, "phi"), torques / 2500.0, rtol=0.0, atol=1e-15
    )
    np.testing.assert_allclose(read(model, "i_a"), torques / 5.0, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(read(model, "u"), 0.5 * torques / 5.0, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(read(model, "Mk"), torques, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(read(model, "phidd"), 0.0, rtol=0.0, atol=1e-10)


@pytest.mark.slow
@needs_native
def test_an_arm_at_rest_stays_for_two_seconds() -> None:
    # the arms of test_three_ways.py, whose FMUs are in the session's cache
    for chain in (urm6(), sprung_arm()):
        model = make_block("driven_arm", robot=chain)
        with FmuRun(cached_fmu(model, "native"), model, {}) as fmu:
            found = fmu.over(PERIOD * np.arange(401, dtype=np.float64), {})
        names = [name for one in model.variables if one.causality == "output" for name in one.names]
        columns = [k for k, name in enumerate(names) if name.startswith(("phi[", "s["))]
        assert len(columns) == len(chain.start)
        turning = [
            start for start, one in zip(chain.start, chain.moving, strict=True) if one.kind == "revolute"
        ]
        sliding = [
            start for start, one in zip(chain.start, chain.moving, strict=True) if one.kind == "prismatic"
        ]
        assert np.abs(found[:, columns] - [*turning, *sliding]).max() <= 1e-9


@pytest.mark.slow
def test_a_held_pendulum_swings_with_the_root_of_k_over_j() -> None:
    m, r, k = 2.0, 0.5, 800.0
    chain = Chain(
        "pendulum",
        (Joint("q", axis=(0.0, -1.0, 0.0)),),
        tip=translation(r, 0.0, 0.0),
        inertials=(Inertial("q", m, (r, 0.0, 0.0)),),
        drives=(PassiveJoint("q", k, 0.0),),
        gravity=(0.0, 0.0, 0.0),
    )
    model = Instance(make_block("driven_arm", robot=chain))
    put(model, phi=1e-6)
    rate = np.sqrt(k / (m * r**2))
    for n in range(20):
        model.do_step(n * PERIOD, PERIOD)
    # RK4 in 0.5 ms at 40 rad/s: (0.02)^5 / 120 a step, 200 steps
    assert read(model, "phi")[0] == pytest.approx(1e-6 * np.cos(rate * 0.1), abs=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize(
    (
        "inertia",
        "stiffness",
        "damping",
        "rotor",
        "rate",
    ),  # the rate in [1/s] that is the largest: of what, on the right
    [
        (5e-5, 2500.0, 0.1, 0.5, np.sqrt(2500.0 / 5e-5)),  # shaft against link
        (0.1, 2500.0, 5.0, 5e-4, 5.0 / 5e-4),  # shaft against rotor
        (0.1, 2500.0, 0.1, 5e-5, 5.0 / np.sqrt(1e-3 * 5e-5)),  # motor: C i_p over the root of L I1
        (1e-5, 2500.0, 0.0, None, np.sqrt(2500.0 / 1e-5)),  # a held joint without damping
    ],
)
def test_the_internal_step_is_one_at_which_a_stiff_joint_is_stable(
    inertia: float, stiffness: float, damping: float, rotor: float | None, rate: float
) -> None:
    drive = DRIVE._replace(stiffness=stiffness, damping=damping, inertia=rotor or 1.0)
    chain = Chain(
        "stiff",
        (Joint("q"),),
        inertials=(Inertial("q", 1e-4, (0.0, 0.0, 0.0), (inertia, inertia, inertia, 0.0, 0.0, 0.0)),),
        drives=(driven("q", drive) if rotor else PassiveJoint("q", stiffness, damping),),
    )
    model = make_block("driven_arm", robot=chain)
    assert 0.7 < model.internal_step * rate / 1.4 < 1.3  # half of 2.8, and what couples with it
    arm, coarse = Instance(model), Instance(model)
    for one in (arm, coarse):  # no controller: its samples swing the link by themselves
        put(one, phi=1e-3, **(dict.fromkeys(("Kphi", "Kw", "Keps"), 0.0) if rotor else {}))
    put(coarse, internal_step=4.0 * model.internal_step)
    arm.do_step(0.0, 200.0 * model.internal_step)
    assert abs(read(arm, "phi")[0]) < 1.1e-3
    with pytest.raises(UnitError, match="is not finite"):
        for n in range(200):
            coarse.do_step(n * PERIOD, PERIOD)


def test_a_force_on_the_tool_bends_the_springs_by_the_jacobian() -> None:
    chain = with_drives(with_masses(load_robot("urm6")), held=load_robot("urm6").coordinates)
    rest, still = np.array([one.rest for one in find_equilibrium(chain)]), [0.0] * 6
    outside = np.array([5.0, -3.0, 8.0, 0.4, 0.0, -0.2])

    def missing(q: FloatArray) -> FloatArray:
        """What springs give less than weight and force need."""
        weight = np.array(inverse_dynamics(chain, list(q), still, still), dtype=np.float64)
        pushed = np.array(jacobian(chain, list(q)), dtype=np.float64) @ outside
        return np.asarray(weight - pushed - 2500.0 * (rest - q))

    q = root(missing, chain.start, tol=1e-14).x
    assert np.abs(q - chain.start).max() > 5e-4
    model = Instance(make_block("driven_arm", robot=chain))
    put(model, phi=q, force=outside[:3], moment=outside[3:])
    # torques of some N.m are in balance to 1e-13, and M^-1 reaches 20
    np.testing.assert_allclose(read(model, "phidd"), 0.0, rtol=0.0, atol=1e-10)


def test_robots_without_drives_or_with_too_little_voltage_are_refused() -> None:
    bare = with_masses(load_robot("urm4"))
    some = replace(bare, drives=(driven("phi1"), PassiveJoint("phi3", 9.0, 0.0)))
    assert refused("driven_arm", some) == [
        f"robot urm4: key drives.{name}: not found, allowed: the drive of the joint,"
        " or { k, l } of a spring that holds it"
        for name in ("phi2", "phi4")
    ]
    weak = tuple(
        DrivenJoint(one, DRIVE._replace(resistance=1e3), 5e-3, Gains(7.5, 0.75, 0.01), 48.0)
        for one in load_robot("urm6").coordinates
    )
    needed = [abs(one.current) * 1e3 for one in find_equilibrium(urm6())]
    assert max(needed) > 48.0 > min(needed)
    assert refused("driven_arm", replace(urm6(), drives=weak)) == [
        f"robot urm6: drives.phi{k}: needs {volts:.4g} V to hold the arm at its start, allowed: u_max, 48 V"
        for k, volts in enumerate(needed, start=1)
        if volts > 48.0
    ]
    for model in ("chain_dynamics", "driven_arm"):
        assert refused(model, replace(urm6(), inertials=())) == [
            "robot urm6: key inertials: found none, allowed: the masses of the arm (in a URDF <inertial>)"
        ]
        assert refused(model, "urm6") == [
            f"unit {model}: option robot: found 'urm6', allowed: a robot (Chain)"
        ]


def refused(model: str, robot: Any) -> list[str]:
    return refusal(UrmpipeError, make_block, model, robot=robot).splitlines()


# The system driven-arm


SMALL = Drive(50.0, 0.1, 100.0, 0.01, 2.0, 2e-3, 5e-3)
"""The drive of a wrist, as the system has it."""


def ur3() -> Chain:
    """The arm of the system: its start pose and its drives in the robot."""
    arm = next(block for block in load_system("driven-arm").blocks if block.name == "arm")
    names = load_robot("ur3").coordinates
    wrist = [DrivenJoint(name, SMALL, 5e-3, Gains(1.5, 0.15, 2e-3), 48.0) for name in names[3:]]
    drives = (*map(driven, names[:3]), *wrist)
    start = arm.start["phi"]
    assert isinstance(start, (list, tuple))
    return replace(load_robot("ur3"), start=tuple(map(float, start)), drives=drives)


def system() -> System:
    return load_system("driven-arm")


def test_the_system_starts_where_the_unit_does() -> None:
    model = make_block("driven_arm", robot=ur3())
    starts = {
        name: one
        for variable in model.variables
        for name, one in zip(variable.names, variable.starts, strict=True)
    }
    blocks = {block.name: block.start for block in system().blocks}
    assert max(abs(starts[f"i_a[{k}]"]) for k in range(1, 7)) > 1.0
    for k in range(1, 7):
        drive, controller = blocks[f"drive{k}"], blocks[f"controller{k}"]
        assert drive["theta1"] == pytest.approx(starts[f"theta1[{k}]"], rel=0, abs=1e-12)
        assert drive["i_a"] == pytest.approx(starts[f"i_a[{k}]"], rel=0, abs=1e-12)
        assert controller["last"] == pytest.approx(starts[f"last[{k}]"], rel=0, abs=1e-12)
        for key in ("k", "l", "i_p", "C", "R", "L", "I1"):
            expected = starts[f"{key}[{k}]"]
            assert drive.get(key, dc_drive_starts()[key]) == expected


def dc_drive_starts() -> dict[str, float]:
    return {one.name: one.starts[0] for one in make_block("dc_drive").parameters}


def make(block: Block) -> BlockModel:
    options = dict(block.options)
    if "robot" in options:
        options["robot"] = load_robot(options["robot"])
    return make_block(block.unit, **options)


def run_system(step: float, duration: float) -> CosimulationRecord:
    return simulate(prepare(replace(system(), step=step, duration=duration, record_every=1), make))


TARGETS = np.array([0.5, 2.7, 0.6, 2.6, 0.4, 2.8])


def system_of_urm6(step: float, duration: float) -> System:
    """Return the system, its blocks at rest where the unit `driven_arm` of `urm6()` is."""
    model = make_block("driven_arm", robot=urm6())
    at = {scalar: one.scalar_start(scalar) for scalar, one in model.scalars if not isinstance(one, Output)}
    still = [0.0, 0.0, 0.0]
    starts: dict[str, dict[str, Any]] = {"arm": {"phi": list(urm6().start), "force": still, "moment": still}}
    for k, (initial, target) in enumerate(zip(urm6().start, TARGETS.tolist(), strict=True), start=1):
        starts[f"set_point{k}"] = {"initial": initial, "target": target}
        starts[f"controller{k}"] = {"last": at[f"last[{k}]"]}
        starts[f"drive{k}"] = {name: at[f"{name}[{k}]"] for name in ("theta1", "i_a")}
    blocks = tuple(replace(one, start=starts.get(one.name, one.start)) for one in system().blocks)
    return replace(system(), step=step, duration=duration, record_every=1, blocks=blocks)


def make_of_urm6(block: Block) -> BlockModel:
    return make_block("chain_dynamics", robot=urm6()) if block.name == "arm" else make(block)


def as_one_function(duration: float) -> FloatArray:
    """Return the joints at the controllers' samples, of the unit `driven_arm`."""
    model = make_block("driven_arm", robot=urm6())
    t = PERIOD * np.arange(round(duration / PERIOD) + 1, dtype=np.float64)
    columns = {name: np.empty((len(t), 6)) for name in ("set_phi", "set_phid", "set_phidd")}
    for k, (initial, target) in enumerate(zip(urm6().start, TARGETS, strict=True)):
        wanted = trapezoid(t, 0.1, initial, target, 2.0, 10.0)
        for name, values in zip(columns, wanted, strict=True):
            columns[name][:, k] = values
    names = [name for one in model.variables if one.causality == "output" for name in one.names]
    with FmuRun(cached_fmu(model, "native"), model, {"internal_step": 1e-4}) as fmu:
        found = fmu.over(t, columns)
    return found[:, [names.index(f"phi[{k}]") for k in range(1, 7)]]


@pytest.mark.slow
@needs_native
def test_the_blocks_near_the_unit_with_the_first_order_of_the_communication_step() -> None:
    """Of urm6, both of whose FMUs are in the session's cache."""
    duration = 0.4
    expected = as_one_function(duration)
    errors = []
    for parts in (5, 10, 20):
        recorded = simulate(prepare(system_of_urm6(PERIOD / parts, duration), make_of_urm6))
        assert recorded.failed is None
        found = np.column_stack([recorded.column("arm", f"phi[{k}]") for k in range(1, 7)])
        errors.append(float(np.abs(found[::parts] - expected).max()))
    assert np.abs(expected - expected[0]).max() > 0.3  # rad: it moves
    # values held over a step are off by its length: the first order, in the limit of small steps
    assert -np.diff(np.log2(errors)) == pytest.approx(1.0, abs=0.1), errors
    assert errors[2] < 1e-3  # rad, with the system's own step


@pytest.mark.slow
@needs_native
def test_at_5_ms_the_blocks_are_unstable_and_at_2_5_ms_they_are_not() -> None:
    """What docs/dynamics.md names: at 5 ms it leaves its set points by more than a turn, or ends."""
    coarse = run_system(PERIOD, 2.0)
    assert coarse.failed is not None or np.abs(coarse.column("arm", "phi[6]")).max() > 2.0 * np.pi
    fine = run_system(PERIOD / 2, 2.0)
    assert fine.failed is None
    for k in range(1, 7):
        late = fine.column("arm", f"phi[{k}]")[-1] - fine.column(f"set_point{k}", "theta")[-1]
        assert abs(late) < 1e-3


# Springs beside drives


def without_springs(chain: Chain) -> Chain:
    drives = (replace(one, spring=NO_SPRING) if isinstance(one, DrivenJoint) else one for one in chain.drives)
    return replace(chain, drives=tuple(drives))


PUSH = Wrench((20.0, -15.0, 25.0), (1.0, -2.0, 1.5))


@pytest.mark.slow
def test_a_spring_beside_a_drive_takes_its_torque_from_the_drive_and_the_arm_stays_at_rest() -> None:
    chain = sprung_arm()
    relieved, plain = find_equilibrium(chain), find_equilibrium(without_springs(chain))
    for one, own, other, q in zip(chain.drives, relieved, plain, chain.start, strict=True):
        if isinstance(one, DrivenJoint):
            torque = one.spring.stiffness * (one.spring.rest - q)
            assert abs(torque) > 5.0
            # differences of some 10 V, of rounded torques
            assert other.voltage - own.voltage == pytest.approx(torque * 0.5 / (100.0 * 0.05), abs=1e-13)
            assert abs(own.voltage) < abs(other.voltage)
            assert own.rest == pytest.approx(other.rest - torque / 2500.0, abs=1e-15)
        else:
            assert own == other
    model = Instance(make_block("driven_arm", robot=chain))
    for n in range(10):
        model.do_step(n * PERIOD, PERIOD)
    stayed = read(model, "phi", "s")[[0, 2, 1]]
    np.testing.assert_allclose(
        stayed, chain.start, rtol=0.0, atol=1e-12
    )  # rounding of torques over 2500 N.m/rad
    np.testing.assert_allclose(
        read(model, "last", "last_s"), [one.voltage for one in relieved[:2]], rtol=0.0, atol=1e-9
    )  # of it by gains of 4 V/rad, and of accelerations


def test_the_torque_of_a_spring_is_what_its_energy_changes_by() -> None:
    chain = sprung_arm()
    spring = CounterbalanceSpring(300.0, 0.7)
    actuators: list[Actuator] = [
        Motor(DRIVE, 0.1, 0.2, 0.3, 0.4, spring),
        Motor(DRIVE, 0.1, 0.2, 0.3, 0.4),
        Spring(9.0, 1.0, 0.2),
    ]
    still = [0.0, 0.0, 0.0]

    def own_energy(q: float) -> float:
        """What the spring adds to the energy of the arm."""
        bare = [actuators[1], *actuators[1:]]
        with_it, without = (
            arm_energy(chain, ArmState([q, 0.1, 0.3], still, each)) for each in (actuators, bare)
        )
        return float(with_it - without)

    for q in (-0.4, 0.7, 1.1):
        state = ArmState([q, 0.1, 0.3], still, actuators)
        added = np.subtract(joint_torques(state), shaft_torques(state))
        # of a square the difference is exact to rounding: 1e2 J * 1e-15 / 1e-3
        slope = (own_energy(q + 1e-3) - own_energy(q - 1e-3)) / 2e-3
        np.testing.assert_allclose(added, [-slope, 0.0, 0.0], rtol=0.0, atol=1e-9)
        assert added[0] == pytest.approx(300.0 * (0.7 - q), abs=1e-12)


@pytest.mark.slow
def test_the_unit_is_what_dop853_makes_of_the_equations_and_no_energy_is_lost() -> None:
    turn, slide, _ = sprung_arm().drives
    assert isinstance(slide, DrivenJoint)
    slide = replace(slide, period=PERIOD, spring=CounterbalanceSpring(2000.0, 0.22))
    drives = (turn, slide, PassiveJoint("wrist", 200.0, 5.0))
    chain = replace(sprung_arm(), drives=drives)
    wanted = moves(chain, np.array([0.6, -0.3, 0.0]))
    whole, model = OneSystem(chain, PUSH), Instance(make_block("driven_arm", robot=chain))
    put(model, internal_step=2.5e-4, force=PUSH.force, moment=PUSH.moment)
    before = whole.stored()
    for n in range(14):
        whole.sample(wanted(n * PERIOD))
        whole.go(PERIOD)
        (turning, sliding, _), names = wanted(n * PERIOD).T, ("set_{}", "set_{}d", "set_{}dd")
        for kind, points in (("phi", turning), ("s", sliding)):
            put(model, **{name.format(kind): value for name, value in zip(names, points, strict=True)})
        model.do_step(n * PERIOD, PERIOD)
    np.testing.assert_allclose(read(model, "last", "last_s"), whole.voltages[:2], rtol=0.0, atol=1e-7)
    # RK4 in 0.25 ms: (h / 2 ms)^4 of the armature's time, of values that change by some 1
    found = read(model, "phi", "s", "theta1", "theta1_s")[[0, 2, 1, 3, 4]]
    np.testing.assert_allclose(found, whole.x[[0, 1, 2, 6, 7]], rtol=0.0, atol=1e-7)
    assert np.abs(whole.x[:3] - chain.start).min() > 0.01  # each joint moves, the held one in its spring
    work, lost, pushed, damped = whole.x[-4:]
    change = whole.stored() - before
    stretched = [
        0.5 * one.spring.stiffness * ((one.spring.rest - q) ** 2 - (one.spring.rest - start) ** 2)
        for one, q, start in zip(chain.drives, whole.x, chain.start, strict=False)
        if isinstance(one, DrivenJoint)
    ]
    # none of them is lost in the bound of the balance
    assert min(map(abs, (pushed, damped, *stretched))) > 1e-3 * abs(work) > 1e-4
    assert abs(work - change - lost) <= 1e-8 * abs(work)
    stored, given, heat = read(model, "energy_stored", "energy_in", "energy_lost")
    assert abs(given - (stored - before) - heat) <= 1e-6 * abs(given)


@pytest.mark.slow
def test_a_stiff_spring_beside_a_drive_shortens_the_internal_step() -> None:
    stiff = replace(driven("q"), spring=CounterbalanceSpring(1e7, 0.0))
    inertia = (0.1, 0.1, 0.1, 0.0, 0.0, 0.0)
    chain = Chain(
        "stiff", (Joint("q"),), inertials=(Inertial("q", 1e-4, (0.0, 0.0, 0.0), inertia),), drives=(stiff,)
    )
    model = make_block("driven_arm", robot=chain)
    # 1.4 over the root of k_spring / J; the drive's own 2500 N.m/rad are 1e-4 of it
    assert model.internal_step == pytest.approx(1.4 / np.sqrt(1e7 / 0.1), rel=1e-2)
    arm = Instance(model)
    put(arm, phi=1e-3, Kphi=0.0, Kw=0.0, Keps=0.0)
    arm.do_step(0.0, 200.0 * model.internal_step)
    assert abs(read(arm, "phi")[0]) < 1.1e-3


# At rest under a force


LENGTH = 0.3
UPPER = 0.5


def wristed() -> Chain:
    """Two level links: the shoulder with a drive, the wrist held by 2500 N.m/rad."""
    lifting = (0.0, -1.0, 0.0)
    return Chain(
        "wristed",
        (Joint("shoulder", axis=lifting), Joint("wrist", origin=translation(UPPER, 0.0, 0.0), axis=lifting)),
        tip=translation(LENGTH, 0.0, 0.0),
        inertials=(Inertial("shoulder", 3.0, (0.2, 0.0, 0.0)), Inertial("wrist", 1.0, (0.1, 0.0, 0.0))),
        drives=(driven("shoulder"), PassiveJoint("wrist", 2500.0, 5.0)),
    )


@pytest.mark.slow
def test_a_held_wrist_yields_to_a_force_by_its_square_of_the_length_and_no_drive_moves() -> None:
    chain, force = wristed(), 1e-2
    before, under = find_equilibrium(chain), find_equilibrium(chain, Wrench((0.0, 0.0, force)))
    assert before[1].q == 0.0
    tip = forward(chain, [one.q for one in under])[-1].translation
    # the shift is 3.6e-7 m: the second order is 1e-6 of it, and settling to 1e-12 rad as much
    assert tip[2] == pytest.approx(force * LENGTH**2 / 2500.0, rel=5e-6)
    assert under[0].q == 0.0
    assert under[1].rest == before[1].rest  # the same spring
    lifted = force * (UPPER + LENGTH)  # N.m that the shoulder need not give
    # of currents of some 2 A, rounded
    assert before[0].current - under[0].current == pytest.approx(lifted / 5.0, rel=1e-6)
    moving = Instance(make_block("driven_arm", robot=chain))
    put(moving, **start_values(chain, (0.0, 0.0, 30.0)))
    start = read(moving, "phi", "last")
    assert start[1] > 3e-3
    for n in range(10):
        moving.do_step(n * PERIOD, PERIOD)
    np.testing.assert_allclose(read(moving, "phi", "last"), start, rtol=0.0, atol=1e-8)


def test_a_spring_weaker_than_the_weight_it_hangs_by_bears_a_small_force() -> None:
    """3 kg hang 0.5 m below: 14.7 N.m/rad by the weight beside 9 of the spring."""
    mass = Inertial("hanging", 3.0, (0.5, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    chain = Chain(
        "pendulum", (Joint("hanging", axis=(0.0, 1.0, 0.0)),), tip=translation(0.5, 0.0, 0.0),
        start=(math.pi / 2,), inertials=(mass,), drives=(PassiveJoint("hanging", 9.0, 1.0),),
    )  # fmt: skip
    (under,) = find_equilibrium(chain, Wrench((0.1, 0.0, 0.0)))
    # along x, which raises the tip: F l over both rigidities; the next order is that angle squared
    assert math.pi / 2 - under.q == pytest.approx(0.05 / (9.0 + 3.0 * 9.81 * 0.5), rel=1e-5)


def test_a_force_that_is_too_large_for_the_springs_is_refused() -> None:
    weak = replace(wristed(), drives=(driven("shoulder"), PassiveJoint("wrist", 50.0, 1.0)))
    assert find_equilibrium(weak, Wrench((0.0, 0.0, 10.0)))[1].q == pytest.approx(0.06, abs=1e-3)
    said = "robot wristed: force: found more than the springs of its held joints bear, allowed: less"
    assert refusal(RobotError, find_equilibrium, weak, Wrench((0.0, 0.0, 1e3))) == said
    volts = refusal(RobotError, find_equilibrium, wristed(), Wrench((0.0, 0.0, -1e3)))
    needed = 0.5 / 5.0 * (1e3 * UPPER)  # V of the force at the wrist alone
    match = re.fullmatch(
        r"robot wristed: drives.shoulder: needs ([\d.]+) V to hold the arm at its start,"
        r" allowed: u_max, 48 V",
        volts,
    )
    assert match
    assert needed < float(match[1]) < 2.0 * needed


# The stability of the samples


def states_of(chain: Chain) -> list[str]:
    """Return the scalars of the unit that go from sample to sample: states and held voltages."""
    model = make_block("driven_arm", robot=chain)
    kept = (*model.states, *(one for one in model.memories if one.name.startswith("last")))
    return [name for one in kept if not one.name.startswith("energy") for name in one.names]


def radius_of_the_unit(chain: Chain, round_: float) -> float:
    """Return the spectral radius of a round of samples by differences of the unit, to the shortest period."""
    model, names = make_block("driven_arm", robot=chain), states_of(chain)
    instance = Instance(model)
    rest = np.array(instance.get([instance.reference(name) for name in names]), dtype=np.float64)
    moved = 1e-6 * np.hstack((np.eye(len(names)), -np.eye(len(names))))
    put(instance, internal_step=1e-4)
    instance.set([instance.reference(name) for name in names], list(rest[:, np.newaxis] + moved))
    steps = round(round_ / 2.5e-3)
    for n in range(steps):
        instance.do_step(n * 2.5e-3, 2.5e-3)
    found = np.array(instance.get([instance.reference(name) for name in names]), dtype=np.float64)
    plus, minus = np.hsplit(found, 2)
    size = np.abs(np.linalg.eigvals((plus - minus) / 2e-6)).max()
    shortest = min(one.period for one in chain.drives if isinstance(one, DrivenJoint))
    return float(size ** (shortest / round_))


@pytest.mark.slow
def test_the_spectral_radius_is_that_of_the_unit_from_sample_to_sample() -> None:
    chain = sprung_arm()  # with two periods
    found = spectral_radius(chain, np.array(chain.start))
    # RK4 in 0.1 ms: (h / 2 ms)^4 of a step's change; differences of 1e-6: rounding, 1e-16 / 1e-6, of 1e3 A/s
    assert found == pytest.approx(radius_of_the_unit(chain, 1.5e-2), abs=1e-5)
    assert abs(found - spectral_radius(without_springs(chain), np.array(chain.start))) > 1e-4


@pytest.mark.slow
def test_above_a_spectral_radius_of_1_the_simulation_grows_by_it_and_below_it_dies_away() -> None:
    def with_gain(velocity: float) -> Chain:
        own = replace(driven("q"), gains=Gains(7.5, velocity, 0.01), spring=CounterbalanceSpring(200.0, 0.1))
        return Chain("one", (Joint("q", axis=(0.0, -1.0, 0.0)),),
                     inertials=(Inertial("q", 2.0, (0.5, 0.0, 0.0)),), drives=(own,))  # fmt: skip

    gain = 0.75
    while spectral_radius(with_gain(gain), np.zeros(1)) < 1.05:
        gain *= 1.2
    gains = np.array([0.75, gain])
    radii = [spectral_radius(with_gain(one), np.zeros(1)) for one in gains.tolist()]
    assert radii[0] < 1.0 < radii[1]
    instance, sizes = Instance(make_block("driven_arm", robot=with_gain(0.75))), []
    rest = read(instance, "last")[0]  # of any gain
    put(instance, phi=1e-7, internal_step=1e-3)  # twice the unit's own: a factor that differs by 1e-7
    instance.set([instance.reference("Kw[1]")], [gains])  # an element for each arm
    for n in range(120):
        instance.do_step(n * PERIOD, PERIOD)
        sizes.append(np.abs(read(instance, "last")[0] - rest))
    early, late = (np.max(sizes[first : first + 20], axis=0) for first in (40, 100))
    # a slow swing shows its largest sample in a window to a factor of 2: 2^(1/60) - 1
    np.testing.assert_allclose((late / early) ** (1.0 / 60.0), radii, rtol=0.0, atol=1.2e-2)
