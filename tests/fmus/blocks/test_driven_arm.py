"""An arm with drives: one function against other integrators, against its blocks, and at rest."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

from asserting import refusal
from fmu_run import FmuRun
from made_masses import DRIVE, driven, with_drives, with_masses
from shipped_units import URM6
from sliding_arm import one_joint, sprung_arm, wristed
from stepped_unit import SteppedUnit, make_unit, needs_native, run_system
from urmpipe_fmus.block import BlockModel, Output
from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.blocks.driven_arm import start_values
from urmpipe_fmus.build.fmu import cached_fmu
from urmpipe_fmus.cosim import Block, System, load_system, prepare, simulate
from urmpipe_models.arm.chain import Chain, Inertial
from urmpipe_models.drives import CounterbalanceSpring, Drive, DrivenJoint, Gains, PassiveJoint, trapezoid
from urmpipe_models.dynamics import driven_arm as dynamics
from urmpipe_models.dynamics.driven_arm import ArmState, Motor, Spring, find_equilibrium, spectral_radius
from urmpipe_models.dynamics.equations import inverse_dynamics
from urmpipe_models.dynamics.links import Wrench, chain_to_links, wrench_power
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import RobotError, UnitError
from urmpipe_models.kinematics.forward import forward, jacobian
from urmpipe_models.robots.catalogue import load_robot

PERIOD = 5e-3
STILL = [0.0] * 6


class OneSystem:
    """The model functions of an arm of two drives and a spring, with DOP853, a controller's period at a time.

    The state x is q and q', of the drives theta1, theta1' and the current, and integrals: of the power in and
    lost, and of what the wrench gives and the spring's damper takes of them.
    """

    def __init__(self, chain: Chain, drives: list[DrivenJoint], spring: PassiveJoint, wrench: Wrench) -> None:
        self.chain, self.drives, self.wrench, self.links = chain, drives, wrench, chain_to_links(chain)
        first, second, passive = find_equilibrium(chain)
        self.spring = Spring(spring.stiffness, spring.damping, passive.rest)
        self.voltages = [first.voltage, second.voltage]
        motors = [first.rest, second.rest, 0.0, 0.0, first.current, second.current]
        self.x = np.array([*chain.start, *STILL[:3], *motors, *STILL[:4]])

    def state(self, x: FloatArray) -> ArmState:
        rows = zip(self.drives, x[6:12].reshape(3, 2).T, self.voltages, strict=True)
        motors = [Motor(one.drive, row[0], row[1], row[2], voltage, one.spring) for one, row, voltage in rows]
        return ArmState(list(x[:3]), list(x[3:6]), [*motors, self.spring])

    def accelerations(self, state: ArmState) -> list[Any]:
        return dynamics.joint_accelerations(self.chain, state, self.wrench, self.links)

    def rates(self, _t: float, x: FloatArray) -> FloatArray:
        state = self.state(x)
        motors = np.array([*dynamics.motor_derivatives(state).values()]).T
        flows = dynamics.power_flow(self.chain, state, self.wrench)
        pushed = wrench_power(self.chain, state.q, state.qd, self.wrench)
        heat = [flows.supplied, flows.dissipated, pushed, self.spring.damping * x[5] ** 2]
        return np.concatenate((state.qd, self.accelerations(state), *motors, heat))

    def sample(self, wanted: FloatArray) -> None:
        """Take the sample of eq. 20: wanted are positions, velocities and accelerations, shape (3, 3)."""
        state = self.state(self.x)
        errors = wanted - np.array([state.q, state.qd, self.accelerations(state)])
        for k, one in enumerate(self.drives):
            added = float(np.dot(one.gains, errors[:, k]))
            self.voltages[k] = float(np.clip(self.voltages[k] + added, -48.0, 48.0))

    def go(self, duration: float) -> None:
        span = (0.0, duration)
        self.x = solve_ivp(self.rates, span, self.x, "DOP853", rtol=1e-10, atol=1e-12).y[:, -1]

    def stored(self) -> float:
        return float(dynamics.arm_energy(self.chain, self.state(self.x)))


@pytest.mark.slow
@needs_native
def test_an_arm_at_rest_stays_for_two_seconds() -> None:
    # the arms of test_three_ways.py, whose FMUs are in the session's cache
    for chain in (URM6, sprung_arm()):
        model = make_block("driven_arm", robot=chain)
        with FmuRun(cached_fmu(model, "native"), model, {}) as fmu:
            found = fmu.over(PERIOD * np.arange(401, dtype=np.float64), {})
        names = [name for one in model.variables if one.causality == "output" for name in one.names]
        columns = [k for k, name in enumerate(names) if name.startswith(("phi[", "s["))]
        starts = list(zip(chain.start, chain.moving, strict=True))
        expected = [q for kind in ("revolute", "prismatic") for q, joint in starts if joint.kind == kind]
        assert len(columns) == len(expected)
        assert np.abs(found[:, columns] - expected).max() <= 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("inertia", "stiffness", "damping", "rotor", "spring", "rate"),  # the largest rate in [1/s], and of what
    [
        (5e-5, 2500.0, 0.1, 0.5, 0.0, np.sqrt(2500.0 / 5e-5)),  # shaft against link
        (0.1, 2500.0, 5.0, 5e-4, 0.0, 5.0 / 5e-4),  # shaft against rotor
        (0.1, 2500.0, 0.1, 5e-5, 0.0, 5.0 / np.sqrt(1e-3 * 5e-5)),  # motor: C i_p over the root of L I1
        (1e-5, 2500.0, 0.0, None, 0.0, np.sqrt(2500.0 / 1e-5)),  # a passive joint without damping
        (0.1, 2500.0, 5.0, 0.5, 1e7, np.sqrt(1e7 / 0.1)),  # the spring of a driven joint against link
    ],
)
def test_the_internal_step_is_one_at_which_a_stiff_joint_is_stable(
    inertia: float, stiffness: float, damping: float, rotor: float | None, spring: float, rate: float
) -> None:
    drive = driven("q", DRIVE._replace(stiffness=stiffness, damping=damping, inertia=rotor or 1.0))
    sprung = replace(drive, spring=CounterbalanceSpring(spring, 0.0))
    body = Inertial("q", 1e-4, (0.0, 0.0, 0.0), (inertia, inertia, inertia, 0.0, 0.0, 0.0))
    chain = one_joint(sprung if rotor else PassiveJoint("q", stiffness, damping), body)
    model = make_block("driven_arm", robot=chain)
    # half of 2.8, and what couples with it: with 1e7 N.m/rad, the drive's 2500 are 2.5e-4 of it
    assert model.internal_step * rate / 1.4 == pytest.approx(1.0, abs=1e-2 if spring else 0.3)
    # no controller: its samples swing the link by themselves
    values = {"phi": 1e-3} | (dict.fromkeys(("Kphi", "Kw", "Keps"), 0.0) if rotor else {})
    arm = SteppedUnit(model, values)
    arm.do_step(0.0, 200.0 * model.internal_step)
    assert abs(arm.read("phi")[0]) < 1.1e-3
    coarse = SteppedUnit(model, values | {"internal_step": 4.0 * model.internal_step})
    with pytest.raises(UnitError, match="is not finite"):
        coarse.steps(200, PERIOD)


def test_a_force_on_the_tool_bends_the_springs_by_the_jacobian() -> None:
    chain = with_drives(with_masses(load_robot("urm6")), held=load_robot("urm6").coordinates)
    rest = np.array([one.rest for one in find_equilibrium(chain)])
    outside = np.array([5.0, -3.0, 8.0, 0.4, 0.0, -0.2])

    def missing(q: FloatArray) -> FloatArray:
        """What springs give less than weight and force need."""
        weight = np.array(inverse_dynamics(chain, list(q), STILL, STILL), dtype=np.float64)
        pushed = np.array(jacobian(chain, list(q)), dtype=np.float64) @ outside
        return np.asarray(weight - pushed - 2500.0 * (rest - q))

    q = root(missing, chain.start, tol=1e-14).x
    assert np.abs(q - chain.start).max() > 5e-4
    values = {"phi": q, "force": outside[:3], "moment": outside[3:]}
    model = SteppedUnit("driven_arm", values, robot=chain)
    # torques of some N.m are in balance to 1e-13, and M^-1 reaches 20
    np.testing.assert_allclose(model.read("phidd"), 0.0, rtol=0.0, atol=1e-10)


def test_robots_with_too_little_voltage_are_refused() -> None:
    weak = DRIVE._replace(resistance=1e3)
    robot = replace(URM6, drives=tuple(driven(name, weak) for name in URM6.coordinates))
    needed = [abs(one.current) * 1e3 for one in find_equilibrium(URM6)]
    assert max(needed) > 48.0 > min(needed)
    assert refusal(RobotError, make_block, "driven_arm", robot=robot).splitlines() == [
        f"robot urm6: drives.phi{k}: needs {volts:.4g} V to hold the arm at its start, allowed: u_max, 48 V"
        for k, volts in enumerate(needed, start=1)
        if volts > 48.0
    ]


SYSTEM = load_system("driven-arm")
SMALL = Drive(50.0, 0.1, 100.0, 0.01, 2.0, 2e-3, 5e-3)  # of a wrist, as the system has it


def ur3() -> Chain:
    """Return the arm of the system, with its start pose and its drives."""
    [arm] = [block for block in SYSTEM.blocks if block.name == "arm"]
    names = load_robot("ur3").coordinates
    wrist = [DrivenJoint(name, SMALL, 5e-3, Gains(1.5, 0.15, 2e-3), 48.0) for name in names[3:]]
    start: Any = arm.start["phi"]
    return replace(load_robot("ur3"), start=tuple(start), drives=(*map(driven, names[:3]), *wrist))


def test_the_system_starts_where_the_unit_does() -> None:
    model = make_block("driven_arm", robot=ur3())
    starts = {name: one.scalar_start(name) for name, one in model.scalars if not isinstance(one, Output)}
    defaults = {one.name: one.starts[0] for one in make_block("dc_drive").parameters}
    blocks = {block.name: block.start for block in SYSTEM.blocks}
    assert max(abs(starts[f"i_a[{k}]"]) for k in range(1, 7)) > 1.0
    for k in range(1, 7):
        drive, controller = blocks[f"drive{k}"], blocks[f"controller{k}"]
        for own, name in ((drive, "theta1"), (drive, "i_a"), (controller, "last")):
            assert own[name] == pytest.approx(starts[f"{name}[{k}]"], rel=0, abs=1e-12)
        for key in ("k", "l", "i_p", "C", "R", "L", "I1"):
            assert drive.get(key, defaults[key]) == starts[f"{key}[{k}]"]


TARGETS = np.array([0.5, 2.7, 0.6, 2.6, 0.4, 2.8])


def system_of_urm6(step: float, duration: float) -> System:
    """Return the system, its blocks at rest where the unit `driven_arm` of `URM6` is."""
    model = make_block("driven_arm", robot=URM6)
    at = {scalar: one.scalar_start(scalar) for scalar, one in model.scalars if not isinstance(one, Output)}
    no_wrench = {"force": STILL[:3], "moment": STILL[:3]}
    starts: dict[str, dict[str, Any]] = {"arm": {"phi": list(URM6.start), **no_wrench}}
    for k, (initial, target) in enumerate(zip(URM6.start, TARGETS.tolist(), strict=True), start=1):
        starts[f"set_point{k}"] = {"initial": initial, "target": target}
        starts[f"controller{k}"] = {"last": at[f"last[{k}]"]}
        starts[f"drive{k}"] = {name: at[f"{name}[{k}]"] for name in ("theta1", "i_a")}
    blocks = tuple(replace(one, start=starts.get(one.name, one.start)) for one in SYSTEM.blocks)
    return replace(SYSTEM, step=step, duration=duration, record_every=1, blocks=blocks)


def make_of_urm6(block: Block) -> BlockModel:
    return make_block("chain_dynamics", robot=URM6) if block.name == "arm" else make_unit(block)


def as_one_function(duration: float) -> FloatArray:
    """Return the joints at the controllers' samples, of the unit `driven_arm`."""
    model = make_block("driven_arm", robot=URM6)
    t = PERIOD * np.arange(round(duration / PERIOD) + 1, dtype=np.float64)
    columns = {name: np.empty((len(t), 6)) for name in ("set_phi", "set_phid", "set_phidd")}
    for k, (initial, target) in enumerate(zip(URM6.start, TARGETS, strict=True)):
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
    # inputs constant over a step are off by its length: the first order, in the limit of small steps
    assert -np.diff(np.log2(errors)) == pytest.approx(1.0, abs=0.1), errors
    assert errors[2] < 1e-3  # rad, with the system's own step


@pytest.mark.slow
@needs_native
def test_at_5_ms_the_blocks_are_unstable_and_at_2_5_ms_they_are_not() -> None:
    """What docs/dynamics.md names: at 5 ms it leaves its set points by more than a turn, or ends."""
    coarse = run_system(SYSTEM, step=PERIOD, duration=2.0)
    assert coarse.failed is not None or np.abs(coarse.column("arm", "phi[6]")).max() > 2.0 * np.pi
    fine = run_system(SYSTEM, step=PERIOD / 2, duration=2.0)
    assert fine.failed is None
    for k in range(1, 7):
        late = fine.column("arm", f"phi[{k}]")[-1] - fine.column(f"set_point{k}", "theta")[-1]
        assert abs(late) < 1e-3


def without_springs(chain: Chain) -> Chain:
    none = CounterbalanceSpring(0.0, 0.0)
    drives = (replace(one, spring=none) if isinstance(one, DrivenJoint) else one for one in chain.drives)
    return replace(chain, drives=tuple(drives))


@pytest.mark.slow
def test_a_spring_of_a_driven_joint_relieves_the_drive_of_its_torque_and_the_arm_stays_at_rest() -> None:
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
    model = SteppedUnit("driven_arm", robot=chain)
    model.steps(10, PERIOD)
    # rounding of torques over 2500 N.m/rad
    np.testing.assert_allclose(model.read("phi", "s")[[0, 2, 1]], chain.start, rtol=0.0, atol=1e-12)
    # of it by gains of 4 V/rad, and of accelerations
    voltages = [one.voltage for one in relieved[:2]]
    np.testing.assert_allclose(model.read("last", "last_s"), voltages, rtol=0.0, atol=1e-9)


def test_the_torque_of_a_spring_is_what_its_energy_changes_by() -> None:
    chain = sprung_arm()
    others: list[dynamics.Actuator] = [Motor(DRIVE, 0.1, 0.2, 0.3, 0.4), Spring(9.0, 1.0, 0.2)]
    without = Motor(DRIVE, 0.1, 0.2, 0.3, 0.4)
    sprung = without._replace(spring=CounterbalanceSpring(300.0, 0.7))

    def energy(q: float, first: Motor) -> float:
        return float(dynamics.arm_energy(chain, ArmState([q, 0.1, 0.3], STILL[:3], [first, *others])))

    for q in (-0.4, 0.7, 1.1):
        state = ArmState([q, 0.1, 0.3], STILL[:3], [sprung, *others])
        added = np.subtract(dynamics.joint_torques(state), dynamics.shaft_torques(state))
        # of a square the difference is exact to rounding: 1e2 J * 1e-15 / 1e-3
        above, below = (energy(x, sprung) - energy(x, without) for x in (q + 1e-3, q - 1e-3))
        np.testing.assert_allclose(added, [-(above - below) / 2e-3, 0.0, 0.0], rtol=0.0, atol=1e-9)
        assert added[0] == pytest.approx(300.0 * (0.7 - q), abs=1e-12)


@pytest.mark.slow
def test_the_unit_is_what_dop853_makes_of_the_equations_and_no_energy_is_lost() -> None:
    turn, slide, _ = sprung_arm().drives
    assert isinstance(turn, DrivenJoint)
    assert isinstance(slide, DrivenJoint)
    slide = replace(slide, period=PERIOD, spring=CounterbalanceSpring(2000.0, 0.22))
    wrist = PassiveJoint("wrist", 200.0, 5.0)
    chain = replace(sprung_arm(), drives=(turn, slide, wrist))
    push = Wrench((20.0, -15.0, 25.0), (1.0, -2.0, 1.5))
    whole = OneSystem(chain, [turn, slide], wrist, push)
    values = {"internal_step": 2.5e-4, "force": push.force, "moment": push.moment}
    model = SteppedUnit("driven_arm", values, robot=chain)
    before = whole.stored()
    for n in range(14):
        ways = zip(chain.start, (0.6, -0.3, 0.0), strict=True)
        wanted = np.array([trapezoid(n * PERIOD, 0.0, *way, 3.0, 100.0) for way in ways], dtype=float).T
        whole.sample(wanted)
        whole.go(PERIOD)
        for dots, points in zip(("", "d", "dd"), wanted, strict=True):
            model.put(**{f"set_phi{dots}": points[0], f"set_s{dots}": points[1]})
        model.do_step(n * PERIOD, PERIOD)
    np.testing.assert_allclose(model.read("last", "last_s"), whole.voltages, rtol=0.0, atol=1e-7)
    # RK4 in 0.25 ms: (h / 2 ms)^4 of the armature's time, of values that change by some 1
    found = model.read("phi", "s", "theta1", "theta1_s")[[0, 2, 1, 3, 4]]
    np.testing.assert_allclose(found, whole.x[[0, 1, 2, 6, 7]], rtol=0.0, atol=1e-7)
    assert np.abs(whole.x[:3] - chain.start).min() > 0.01  # each joint moves, the passive one in its spring
    work, lost, pushed, damped = whole.x[-4:]
    change = whole.stored() - before
    stretched = [
        0.5 * one.spring.stiffness * ((one.spring.rest - q) ** 2 - (one.spring.rest - start) ** 2)
        for one, q, start in zip(whole.drives, whole.x, chain.start, strict=False)
    ]
    # none of them is lost in the bound of the balance
    assert min(map(abs, (pushed, damped, *stretched))) > 1e-3 * abs(work) > 1e-4
    assert abs(work - change - lost) <= 1e-8 * abs(work)
    stored, given, heat = model.read("energy_stored", "energy_in", "energy_lost")
    assert abs(given - (stored - before) - heat) <= 1e-6 * abs(given)


@pytest.mark.slow
def test_a_passive_wrist_yields_to_a_force_by_the_square_of_its_length_and_no_drive_moves() -> None:
    chain, force = wristed(), 1e-2
    before, under = find_equilibrium(chain), find_equilibrium(chain, Wrench((0.0, 0.0, force)))
    assert before[1].q == 0.0
    tip = forward(chain, [one.q for one in under])[-1].translation
    # the shift is 3.6e-7 m: the second order is 1e-6 of it, and settling to 1e-12 rad as much
    assert tip[2] == pytest.approx(force * 0.3**2 / 2500.0, rel=5e-6)
    assert under[0].q == 0.0
    assert under[1].rest == before[1].rest  # the same spring
    lifted = force * (0.5 + 0.3)  # N.m that the shoulder need not give
    # of currents of some 2 A, rounded
    assert before[0].current - under[0].current == pytest.approx(lifted / 5.0, rel=1e-6)
    values = dict(start_values(chain, (0.0, 0.0, 30.0)))
    moving = SteppedUnit("driven_arm", values, robot=chain)
    start = moving.read("phi", "last")
    assert start[1] > 3e-3
    moving.steps(10, PERIOD)
    np.testing.assert_allclose(moving.read("phi", "last"), start, rtol=0.0, atol=1e-8)


def radius_of_the_unit(chain: Chain, round_: float) -> float:
    """Return the spectral radius of a round of samples by differences of the unit, to the shortest period."""
    instance = SteppedUnit("driven_arm", {"internal_step": 1e-4}, robot=chain)
    names = [one.name for one in (*instance.model.states, *instance.model.memories)]
    kept = [name for name in names if not name.startswith(("energy", "sample"))]  # states and voltages
    rest = instance.read(*kept)
    references = [instance.reference(name) for name in instance.scalars(*kept)]
    moved = 1e-6 * np.hstack((np.eye(len(rest)), -np.eye(len(rest))))
    instance.set(references, list(rest[:, np.newaxis] + moved))
    instance.steps(round(round_ / 2.5e-3), 2.5e-3)
    plus, minus = np.hsplit(instance.read(*kept), 2)
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
        return one_joint(own, Inertial("q", 2.0, (0.5, 0.0, 0.0)))

    gain = 0.75
    while spectral_radius(with_gain(gain), np.zeros(1)) < 1.05:
        gain *= 1.2
    gains = np.array([0.75, gain])
    radii = [spectral_radius(with_gain(one), np.zeros(1)) for one in gains.tolist()]
    assert radii[0] < 1.0 < radii[1]
    values = {"phi": 1e-7, "internal_step": 1e-3}  # twice the unit's own: a factor that differs by 1e-7
    sizes, instance = [], SteppedUnit("driven_arm", robot=with_gain(0.75))
    rest = instance.read("last")[0]  # of any gain
    instance.put(**values)
    instance.set([instance.reference("Kw[1]")], [gains])  # an element for each arm
    for n in range(120):
        instance.do_step(n * PERIOD, PERIOD)
        sizes.append(np.abs(instance.read("last")[0] - rest))
    early, late = (np.max(sizes[first : first + 20], axis=0) for first in (40, 100))
    # a slow swing shows its largest sample in a window to a factor of 2: 2^(1/60) - 1
    np.testing.assert_allclose((late / early) ** (1.0 / 60.0), radii, rtol=0.0, atol=1.2e-2)
