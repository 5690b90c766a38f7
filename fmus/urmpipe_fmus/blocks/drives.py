"""The flexible DC drive of a joint as a unit.

The sampled controller of a drive as a unit.

A constant inertia as a unit: the load of a drive.

Set points of a joint as a unit.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from urmpipe_fmus.block import BlockModel, Input, Memory, Output, Parameter, Recipe, State, Values
from urmpipe_models.drives import (
    MIN_CONSTANT,
    MIN_PERIOD,
    TRAPEZOID,
    Drive,
    Gains,
    JointMotion,
    control_voltage,
    current_rate,
    dissipated_power,
    load_acceleration,
    sample_index,
    sampled_voltage,
    shaft_acceleration,
    shaft_torque,
    stored_energy,
)
from urmpipe_models.drives import evaluate_setpoint as set_point_at
from urmpipe_models.elementwise import Element


def dc_drive() -> BlockModel:
    """Return the unit: voltage, driven angle and its rate in; shaft torque, angle, rate and current out.

    All parameters but k are an assumption: a plausible set for a joint of an arm of that rigidity.

    Source: [Iso9283]_ eq. 14-18.
    """
    return BlockModel(
        name="dc_drive",
        description="DC motor with gear and a damped elastic shaft, counted at the gear's output shaft",
        variables=(*_drive_parameters(), *_drive_inputs(), *_drive_outputs(), *_drive_states()),
        outputs=_computed,
        derivatives=_derivatives,
        internal_step=5e-4,
        equations=(
            "Mk = k (theta1 - theta2) + l (omega1 - omega2)    (eq. 14)",
            "I1 alpha1 + Mk = Mn, alpha1 = omega1'    (eq. 15, missing in print)",
            "Mn = i_p Ms    (eq. 16)",
            "Ms = C i_a    (eq. 17)",
            "u = C i_p omega1 + R i_a + L i_a', omega1 = theta1'    (eq. 18)",
            "theta1: angle of the gear's output shaft; I1: reduced to that shaft (rotor inertia times i_p^2)",
            "k = 2500 N.m/rad is the paper's; all other values are a labelled assumption.",
        ),
        source="Simulative investigation of robot's accuracy and running speed (2005), eq. 14-18",
        recipe=Recipe(__name__, "dc_drive"),
    )


def _drive(v: Values) -> Drive:
    """Return the constants of a drive from the unit's values."""
    return Drive(v.k, v.l, v.i_p, v.C, v.R, v.L, v.I1)


def _drive_parameters() -> tuple[Parameter, ...]:
    def assumed(name: str, description: str, unit: str, start: float) -> Parameter:
        """Return a parameter above 0 whose value is an assumption."""
        return Parameter(
            name=name, description=f"{description} (assumed)", unit=unit, start=start, minimum=MIN_CONSTANT
        )

    return (
        Parameter(
            name="k",
            description="Torsional rigidity of the shaft (2500: the paper's wrist drive)",
            unit="N.m/rad",
            start=2500.0,
            minimum=MIN_CONSTANT,
        ),
        assumed("l", "Damping of the shaft's torsion", "N.m.s/rad", 5.0),
        assumed("i_p", "Gear ratio: turns of the motor for one of the output shaft", "", 100.0),
        assumed("C", "Motor constant: torque for a current, voltage for a speed", "N.m/A", 0.05),
        assumed("R", "Resistance of the armature", "Ohm", 0.5),
        assumed("L", "Inductance of the armature", "H", 1e-3),
        assumed("I1", "Inertia of rotor and gear, reduced to the output shaft", "kg.m2", 0.5),
    )


def _drive_inputs() -> tuple[Input, ...]:
    return (
        Input(name="u", description="Voltage of the armature", unit="V"),
        Input(name="theta2", description="Angle of the driven element", unit="rad", display_unit="deg"),
        Input(name="omega2", description="Rate of the driven element", unit="rad/s", display_unit="deg/s"),
    )


def _drive_outputs() -> tuple[Output, ...]:
    return (
        Output(name="Mk", description="Torque of the shaft on the driven element", unit="N.m"),
        Output(name="alpha1", description="Acceleration of the gear's output shaft", unit="rad/s2"),
        Output(name="energy_stored", description="Energy of rotor, winding and shaft", unit="J"),
    )


def _drive_states() -> tuple[State, ...]:
    angle = "Angle of the gear's output shaft"
    return (
        State(name="theta1", description=angle, unit="rad", display_unit="deg", output=True),
        State(
            name="omega1", description="Rate of that shaft", unit="rad/s", display_unit="deg/s", output=True
        ),
        State(name="i_a", description="Current of the armature", unit="A", output=True),
        State(name="energy_in", description="Work of the voltage", unit="J", output=True),
        State(name="energy_lost", description="Heat of armature and shaft", unit="J", output=True),
    )


def _torque(v: Values) -> Element:
    """Return Mk."""
    return shaft_torque(_drive(v), v.theta1, v.omega1, v.theta2, v.omega2)


def _computed(v: Values) -> Mapping[str, Element]:
    torque = _torque(v)
    return {
        "Mk": torque,
        "alpha1": shaft_acceleration(_drive(v), v.i_a, torque),
        "energy_stored": stored_energy(_drive(v), v.theta1, v.omega1, v.i_a, v.theta2),
    }


def _derivatives(v: Values) -> Mapping[str, Element]:
    return {
        "theta1": v.omega1,
        "omega1": shaft_acceleration(_drive(v), v.i_a, _torque(v)),
        "i_a": current_rate(_drive(v), v.u, v.omega1, v.i_a),
        "energy_in": v.u * v.i_a,
        "energy_lost": dissipated_power(_drive(v), v.omega1, v.i_a, v.omega2),
    }


NO_SAMPLE = -(2.0**53)
"""Below the number of every sample: a run may begin before 0 s."""


def drive_controller() -> BlockModel:
    """Return the unit: set and real position, velocity and acceleration in; voltage out.

    It samples at the multiples of its own period, whatever the communication step; where no communication
    point meets one, at the next communication point. At a sample the voltage follows its inputs at once;
    between two it is held. The gains may be negative, for a drive that turns the other way; with all three
    negated the unit computes eq. 20 as it is printed, which runs away.

    Source: [Iso9283]_ eq. 20 with the corrected sign.
    """
    return BlockModel(
        name="drive_controller",
        description="Sampled control of a drive's voltage by errors of position, velocity, acceleration",
        variables=(
            *_controller_parameters(),
            *_controller_inputs("set", "Set"),
            *_controller_inputs("real", "Real"),
            _VOLTAGE,
            *_memories(),
        ),
        outputs=lambda v: {"u": _voltage(v)},
        update=lambda v: {
            "last": _voltage(v),
            "sample": np.maximum(v.sample, sample_index(v.time, v.period)),
        },
        equations=(
            "u_n = u_n-1 + Kphi (set_theta - real_theta) + Kw (set_omega - real_omega)",
            "      + Keps (set_alpha - real_alpha), within -u_max .. u_max    (eq. 20, which prints a minus)",
            "at t = n period, and held until n + 1. Summed up: a PID on the position with",
            "Ki = Kphi / period, Kp = Kw / period, Kd = Keps / period.",
        ),
        source="Simulative investigation of robot's accuracy and running speed (2005), eq. 20",
        recipe=Recipe(__name__, "drive_controller"),
    )


_VOLTAGE = Output(name="u", description="Voltage for the drive's armature", unit="V")


def _controller_parameters() -> tuple[Parameter, ...]:
    period, gain = "Time between two samples", "Voltage that a sample adds for an error of"
    return (
        Parameter(name="period", description=period, unit="s", start=5e-3, minimum=MIN_PERIOD, tunable=False),
        Parameter(name="Kphi", description=f"{gain} position (assumed)", unit="V/rad", start=7.5),
        Parameter(name="Kw", description=f"{gain} velocity (assumed)", unit="V.s/rad", start=0.75),
        Parameter(name="Keps", description=f"{gain} acceleration (assumed)", unit="V.s2/rad", start=0.01),
        Parameter(name="u_max", description="Largest voltage (assumed)", unit="V", start=48.0, minimum=0.0),
    )


def _controller_inputs(prefix: str, word: str) -> tuple[Input, ...]:
    return (
        Input(name=f"{prefix}_theta", description=f"{word} position", unit="rad", display_unit="deg"),
        Input(name=f"{prefix}_omega", description=f"{word} velocity", unit="rad/s", display_unit="deg/s"),
        Input(name=f"{prefix}_alpha", description=f"{word} acceleration", unit="rad/s2"),
    )


def _memories() -> tuple[Memory, ...]:
    return (
        Memory(name="last", description="Voltage of the sample before", unit="V"),
        Memory(
            name="sample", description="Number of the last sample; before the first -2^53", start=NO_SAMPLE
        ),
    )


def _voltage(v: Values) -> Element:
    """Return the voltage from the communication point on: a new one at a sample, else the held one."""
    fresh = control_voltage(
        v.last,
        Gains(v.Kphi, v.Kw, v.Keps),
        JointMotion(v.set_theta, v.set_omega, v.set_alpha),
        JointMotion(v.real_theta, v.real_omega, v.real_alpha),
        v.u_max,
    )
    return sampled_voltage(v.time, v.period, v.sample, fresh, v.last)


def inertia() -> BlockModel:
    """Return the unit: torques in; angle, rate and acceleration out.

    Source: [Iso9283]_ eq. 19, of one joint with a constant inertia.
    """
    return BlockModel(
        name="inertia",
        description="Inertia that turns about a fixed axis in a bearing with viscous friction",
        variables=(*_inertia_parameters(), *_inertia_inputs(), *_inertia_outputs(), *_inertia_states()),
        outputs=lambda v: {"alpha": _acceleration(v), "energy_stored": 0.5 * v.J * v.omega * v.omega},
        derivatives=lambda v: {
            "theta": v.omega,
            "omega": _acceleration(v),
            "energy_in": v.tau_ext * v.omega,
            "energy_lost": v.d * v.omega * v.omega,
        },
        internal_step=5e-4,
        equations=("J alpha = tau + tau_ext - d omega, alpha = omega', omega = theta'",),
        source="Simulative investigation of robot's accuracy and running speed (2005), eq. 19",
        recipe=Recipe(__name__, "inertia"),
    )


def _inertia_parameters() -> tuple[Parameter, ...]:
    return (
        Parameter(name="J", description="Moment of inertia (assumed)", unit="kg.m2", start=1.0, minimum=1e-9),
        Parameter(name="d", description="Viscous friction of the bearing", unit="N.m.s/rad", minimum=0.0),
    )


def _inertia_inputs() -> tuple[Input, ...]:
    return (
        Input(name="tau", description="Torque of the shaft", unit="N.m"),
        Input(name="tau_ext", description="Torque from outside", unit="N.m"),
    )


def _inertia_outputs() -> tuple[Output, ...]:
    return (
        Output(name="alpha", description="Acceleration", unit="rad/s2"),
        Output(name="energy_stored", description="Kinetic energy", unit="J"),
    )


def _inertia_states() -> tuple[State, ...]:
    return (
        State(name="theta", description="Angle", unit="rad", display_unit="deg", output=True),
        State(name="omega", description="Rate", unit="rad/s", display_unit="deg/s", output=True),
        State(name="energy_in", description="Work of the torque from outside", unit="J", output=True),
        State(name="energy_lost", description="Heat of the bearing", unit="J", output=True),
    )


def _acceleration(v: Values) -> Element:
    """Return omega'."""
    return load_acceleration(v.J, v.d, v.omega, v.tau, v.tau_ext)


def set_point() -> BlockModel:
    """Return the unit: a function of time alone, with position, velocity and acceleration out."""
    return BlockModel(
        name="set_point",
        description="Set point of a joint over time: a step, a ramp, or a trapezoid of velocity",
        variables=(*_set_point_parameters(), *_set_point_outputs()),
        outputs=_outputs_at,
        equations=(
            "from t = begin on, from initial to target, way = |target - initial|:",
            "kind 0, step: theta = target; omega = alpha = 0",
            "kind 1, ramp: omega = +-speed for way / speed; alpha = 0",
            "kind 2, trapezoid: alpha = +-a for t_a = min(v / a, sqrt(way / a)), 0 for",
            "      max(way / v - v / a, 0), -+a for t_a; v: speed, a: acceleration",
        ),
        recipe=Recipe(__name__, "set_point"),
    )


def _set_point_parameters() -> tuple[Parameter, ...]:
    return (
        Parameter(
            name="kind",
            description="0 step, 1 ramp, 2 trapezoid of velocity",
            start=float(TRAPEZOID),
            minimum=0.0,
            maximum=2.0,
            type="Integer",
        ),
        Parameter(name="begin", description="When the move begins", unit="s", start=0.1),
        Parameter(name="initial", description="Where from", unit="rad", display_unit="deg"),
        Parameter(name="target", description="Where to", unit="rad", display_unit="deg", start=1.0),
        Parameter(
            name="speed",
            description="Largest velocity",
            unit="rad/s",
            display_unit="deg/s",
            start=2.0,
            minimum=1e-9,
        ),
        Parameter(
            name="acceleration", description="Largest acceleration", unit="rad/s2", start=10.0, minimum=1e-9
        ),
    )


def _set_point_outputs() -> tuple[Output, ...]:
    return (
        Output(name="theta", description="Set position", unit="rad", display_unit="deg"),
        Output(name="omega", description="Set velocity", unit="rad/s", display_unit="deg/s"),
        Output(name="alpha", description="Set acceleration", unit="rad/s2"),
    )


def _outputs_at(v: Values) -> Mapping[str, Element]:
    motion = set_point_at(v.kind, v.time, v.begin, v.initial, v.target, v.speed, v.acceleration)
    return {
        "theta": motion.position,
        "omega": motion.velocity,
        "alpha": motion.acceleration,
    }
