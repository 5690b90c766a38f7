"""Blocks of one drive: DC motor with elastic shaft, its sampled controller, its load, and set points.

    set_point -> drive_controller -> dc_drive -> inertia

The equations are those of [Iso9283]_ eq. 14-20, computed by `urmpipe_models.drives`; each block states them
in `equations`. Values that the paper does not give are assumptions, and labelled so.
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
    evaluate_setpoint,
    load_acceleration,
    sample_index,
    sampled_voltage,
    shaft_acceleration,
    shaft_torque,
    stored_energy,
)
from urmpipe_models.elementwise import Element

NO_SAMPLE = -(2.0**53)  # below the index of every sample: a run may begin before 0 s

PAPER = "Simulative investigation of robot's accuracy and running speed (2005)"


def dc_drive() -> BlockModel:
    """Return the DC drive: voltage, driven angle and its rate in; shaft torque, angle, rate and current out.

    All parameters but k are an assumption: a plausible set for a joint of an arm of that rigidity.

    Source: [Iso9283]_ eq. 14-18.
    """

    def assumed(name: str, description: str, unit: str, start: float) -> Parameter:
        return Parameter(
            name=name, description=f"{description} (assumed)", unit=unit, start=start, minimum=MIN_CONSTANT
        )

    return BlockModel(
        name="dc_drive",
        description="DC motor with gear and a damped elastic shaft, counted at the gear's output shaft",
        variables=(
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
            Input(name="u", description="Voltage of the armature", unit="V"),
            Input(name="theta2", description="Angle of the driven element", unit="rad", display_unit="deg"),
            Input(
                name="omega2", description="Rate of the driven element", unit="rad/s", display_unit="deg/s"
            ),
            Output(name="Mk", description="Torque of the shaft on the driven element", unit="N.m"),
            Output(name="alpha1", description="Acceleration of the gear's output shaft", unit="rad/s2"),
            Output(name="energy_stored", description="Energy of rotor, winding and shaft", unit="J"),
            State(
                name="theta1",
                description="Angle of the gear's output shaft",
                unit="rad",
                display_unit="deg",
                output=True,
            ),
            State(
                name="omega1",
                description="Rate of that shaft",
                unit="rad/s",
                display_unit="deg/s",
                output=True,
            ),
            State(name="i_a", description="Current of the armature", unit="A", output=True),
            State(name="energy_in", description="Work of the voltage", unit="J", output=True),
            State(name="energy_lost", description="Heat of armature and shaft", unit="J", output=True),
        ),
        outputs=_drive_outputs,
        derivatives=_drive_derivatives,
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
        source=f"{PAPER}, eq. 14-18",
        recipe=Recipe(__name__, "dc_drive"),
    )


def _drive_and_torque(v: Values) -> tuple[Drive, Element]:
    drive = Drive(v.k, v.l, v.i_p, v.C, v.R, v.L, v.I1)
    return drive, shaft_torque(drive, v.theta1, v.omega1, v.theta2, v.omega2)


def _drive_outputs(v: Values) -> Mapping[str, Element]:
    drive, torque = _drive_and_torque(v)
    return {
        "Mk": torque,
        "alpha1": shaft_acceleration(drive, v.i_a, torque),
        "energy_stored": stored_energy(drive, v.theta1, v.omega1, v.i_a, v.theta2),
    }


def _drive_derivatives(v: Values) -> Mapping[str, Element]:
    drive, torque = _drive_and_torque(v)
    return {
        "theta1": v.omega1,
        "omega1": shaft_acceleration(drive, v.i_a, torque),
        "i_a": current_rate(drive, v.u, v.omega1, v.i_a),
        "energy_in": v.u * v.i_a,
        "energy_lost": dissipated_power(drive, v.omega1, v.i_a, v.omega2),
    }


def drive_controller() -> BlockModel:
    """Return the controller: set and real position, velocity and acceleration in; voltage out.

    It samples at the multiples of its period, whatever the communication step; if no communication point is
    at one, then at the next communication point. At a sample the voltage follows its inputs without delay;
    between two it is held. The gains may be negative, for a drive that turns the other way; with all three
    negated the block computes eq. 20 as it is printed, which is unstable.

    Source: [Iso9283]_ eq. 20 with the corrected sign.
    """
    inputs = (
        Input(name=f"{prefix}_{name}", description=f"{word} {quantity}", unit=unit, display_unit=display)
        for prefix, word in (("set", "Set"), ("real", "Real"))
        for name, quantity, unit, display in (
            ("theta", "position", "rad", "deg"),
            ("omega", "velocity", "rad/s", "deg/s"),
            ("alpha", "acceleration", "rad/s2", ""),
        )
    )
    gain = "Voltage that a sample adds for an error of"
    return BlockModel(
        name="drive_controller",
        description="Sampled control of a drive's voltage by errors of position, velocity, acceleration",
        variables=(
            Parameter(
                name="period",
                description="Time between two samples",
                unit="s",
                start=5e-3,
                minimum=MIN_PERIOD,
                tunable=False,
            ),
            Parameter(name="Kphi", description=f"{gain} position (assumed)", unit="V/rad", start=7.5),
            Parameter(name="Kw", description=f"{gain} velocity (assumed)", unit="V.s/rad", start=0.75),
            Parameter(name="Keps", description=f"{gain} acceleration (assumed)", unit="V.s2/rad", start=0.01),
            Parameter(
                name="u_max", description="Largest voltage (assumed)", unit="V", start=48.0, minimum=0.0
            ),
            *inputs,
            Output(name="u", description="Voltage for the drive's armature", unit="V"),
            Memory(name="last", description="Voltage of the sample before", unit="V"),
            Memory(
                name="sample",
                description="Number of the last sample; before the first -2^53",
                start=NO_SAMPLE,
            ),
        ),
        outputs=lambda v: {"u": _controller_voltage(v)},
        update=lambda v: {
            "last": _controller_voltage(v),
            "sample": np.maximum(v.sample, sample_index(v.time, v.period)),
        },
        equations=(
            "u_n = u_n-1 + Kphi (set_theta - real_theta) + Kw (set_omega - real_omega)",
            "      + Keps (set_alpha - real_alpha), within -u_max .. u_max    (eq. 20, which prints a minus)",
            "at t = n period, and held until n + 1. Summed up: a PID on the position with",
            "Ki = Kphi / period, Kp = Kw / period, Kd = Keps / period.",
        ),
        source=f"{PAPER}, eq. 20",
        recipe=Recipe(__name__, "drive_controller"),
    )


def _controller_voltage(v: Values) -> Element:
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
    """Return the load: torques in; angle, rate and acceleration out.

    Source: [Iso9283]_ eq. 19, of one joint with a constant inertia.
    """

    def acceleration(v: Values) -> Element:
        return load_acceleration(v.J, v.d, v.omega, v.tau, v.tau_ext)

    return BlockModel(
        name="inertia",
        description="Inertia that turns about a fixed axis in a bearing with viscous friction",
        variables=(
            Parameter(
                name="J", description="Moment of inertia (assumed)", unit="kg.m2", start=1.0, minimum=1e-9
            ),
            Parameter(name="d", description="Viscous friction of the bearing", unit="N.m.s/rad", minimum=0.0),
            Input(name="tau", description="Torque of the shaft", unit="N.m"),
            Input(name="tau_ext", description="Torque from outside", unit="N.m"),
            Output(name="alpha", description="Acceleration", unit="rad/s2"),
            Output(name="energy_stored", description="Kinetic energy", unit="J"),
            State(name="theta", description="Angle", unit="rad", display_unit="deg", output=True),
            State(name="omega", description="Rate", unit="rad/s", display_unit="deg/s", output=True),
            State(name="energy_in", description="Work of the torque from outside", unit="J", output=True),
            State(name="energy_lost", description="Heat of the bearing", unit="J", output=True),
        ),
        outputs=lambda v: {"alpha": acceleration(v), "energy_stored": 0.5 * v.J * v.omega * v.omega},
        derivatives=lambda v: {
            "theta": v.omega,
            "omega": acceleration(v),
            "energy_in": v.tau_ext * v.omega,
            "energy_lost": v.d * v.omega * v.omega,
        },
        internal_step=5e-4,
        equations=("J alpha = tau + tau_ext - d omega, alpha = omega', omega = theta'",),
        source=f"{PAPER}, eq. 19",
        recipe=Recipe(__name__, "inertia"),
    )


def set_point() -> BlockModel:
    """Return the set point: a function of time alone, with position, velocity and acceleration out."""

    def outputs(v: Values) -> Mapping[str, Element]:
        motion = evaluate_setpoint(v.kind, v.time, v.begin, v.initial, v.target, v.speed, v.acceleration)
        return {"theta": motion.position, "omega": motion.velocity, "alpha": motion.acceleration}

    return BlockModel(
        name="set_point",
        description="Set point of a joint over time: a step, a ramp, or a trapezoid of velocity",
        variables=(
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
                name="acceleration",
                description="Largest acceleration",
                unit="rad/s2",
                start=10.0,
                minimum=1e-9,
            ),
            Output(name="theta", description="Set position", unit="rad", display_unit="deg"),
            Output(name="omega", description="Set velocity", unit="rad/s", display_unit="deg/s"),
            Output(name="alpha", description="Set acceleration", unit="rad/s2"),
        ),
        outputs=outputs,
        equations=(
            "from t = begin on, from initial to target, way = |target - initial|:",
            "kind 0, step: theta = target; omega = alpha = 0",
            "kind 1, ramp: omega = +-speed for way / speed; alpha = 0",
            "kind 2, trapezoid: alpha = +-a for t_a = min(v / a, sqrt(way / a)), 0 for",
            "      max(way / v - v / a, 0), -+a for t_a; v: speed, a: acceleration",
        ),
        recipe=Recipe(__name__, "set_point"),
    )
