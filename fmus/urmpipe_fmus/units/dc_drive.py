"""The flexible DC drive of a joint as a unit."""

from __future__ import annotations

from collections.abc import Mapping

from urmpipe_fmus.unit import Recipe, Unit
from urmpipe_fmus.values import Values
from urmpipe_fmus.variable import Input, Output, Parameter, State
from urmpipe_models.drives import (
    SMALLEST,
    Drive,
    current_rate,
    lost_power,
    shaft_acceleration,
    shaft_torque,
    stored_energy,
)
from urmpipe_models.elementwise import Element

OPTIONS: Mapping[str, str] = {}


def dc_drive() -> Unit:
    """Return the unit: voltage, driven angle and its rate in; shaft torque, angle, rate and current out.

    All parameters but k are an assumption: a plausible set for a joint of an arm of that rigidity.

    Source: [Iso9283]_ eq. 14-18.
    """
    return Unit(
        name="dc_drive",
        description="DC motor with gear and a damped elastic shaft, counted at the gear's output shaft",
        variables=(*_parameters(), *_inputs(), *_outputs(), *_states()),
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


def _parameters() -> tuple[Parameter, ...]:
    def assumed(name: str, description: str, unit: str, start: float) -> Parameter:
        """Return a parameter above 0 whose value is an assumption."""
        return Parameter(
            name=name, description=f"{description} (assumed)", unit=unit, start=start, minimum=SMALLEST
        )

    return (
        Parameter(
            name="k",
            description="Torsional rigidity of the shaft (2500: the paper's wrist drive)",
            unit="N.m/rad",
            start=2500.0,
            minimum=SMALLEST,
        ),
        assumed("l", "Damping of the shaft's torsion", "N.m.s/rad", 5.0),
        assumed("i_p", "Gear ratio: turns of the motor for one of the output shaft", "", 100.0),
        assumed("C", "Motor constant: torque for a current, voltage for a speed", "N.m/A", 0.05),
        assumed("R", "Resistance of the armature", "Ohm", 0.5),
        assumed("L", "Inductance of the armature", "H", 1e-3),
        assumed("I1", "Inertia of rotor and gear, reduced to the output shaft", "kg.m2", 0.5),
    )


def _inputs() -> tuple[Input, ...]:
    return (
        Input(name="u", description="Voltage of the armature", unit="V"),
        Input(name="theta2", description="Angle of the driven element", unit="rad", display_unit="deg"),
        Input(name="omega2", description="Rate of the driven element", unit="rad/s", display_unit="deg/s"),
    )


def _outputs() -> tuple[Output, ...]:
    return (
        Output(name="Mk", description="Torque of the shaft on the driven element", unit="N.m"),
        Output(name="alpha1", description="Acceleration of the gear's output shaft", unit="rad/s2"),
        Output(name="energy_stored", description="Energy of rotor, winding and shaft", unit="J"),
    )


def _states() -> tuple[State, ...]:
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
        "energy_lost": lost_power(_drive(v), v.omega1, v.i_a, v.omega2),
    }
