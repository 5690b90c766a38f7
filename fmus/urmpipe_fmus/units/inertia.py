"""A constant inertia as a unit: the load of a drive."""

from __future__ import annotations

from collections.abc import Mapping

from urmpipe_fmus.unit import Recipe, Unit
from urmpipe_fmus.values import Values
from urmpipe_fmus.variable import Input, Output, Parameter, State
from urmpipe_models.drives import load_acceleration
from urmpipe_models.elementwise import Element

OPTIONS: Mapping[str, str] = {}


def inertia() -> Unit:
    """Return the unit: torques in; angle, rate and acceleration out.

    Source: [Iso9283]_ eq. 19, of one joint with a constant inertia.
    """
    return Unit(
        name="inertia",
        description="Inertia that turns about a fixed axis in a bearing with viscous friction",
        variables=(*_parameters(), *_inputs(), *_outputs(), *_states()),
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


def _parameters() -> tuple[Parameter, ...]:
    return (
        Parameter(name="J", description="Moment of inertia (assumed)", unit="kg.m2", start=1.0, minimum=1e-9),
        Parameter(name="d", description="Viscous friction of the bearing", unit="N.m.s/rad", minimum=0.0),
    )


def _inputs() -> tuple[Input, ...]:
    return (
        Input(name="tau", description="Torque of the shaft", unit="N.m"),
        Input(name="tau_ext", description="Torque from outside", unit="N.m"),
    )


def _outputs() -> tuple[Output, ...]:
    return (
        Output(name="alpha", description="Acceleration", unit="rad/s2"),
        Output(name="energy_stored", description="Kinetic energy", unit="J"),
    )


def _states() -> tuple[State, ...]:
    return (
        State(name="theta", description="Angle", unit="rad", display_unit="deg", output=True),
        State(name="omega", description="Rate", unit="rad/s", display_unit="deg/s", output=True),
        State(name="energy_in", description="Work of the torque from outside", unit="J", output=True),
        State(name="energy_lost", description="Heat of the bearing", unit="J", output=True),
    )


def _acceleration(v: Values) -> Element:
    """Return omega'."""
    return load_acceleration(v.J, v.d, v.omega, v.tau, v.tau_ext)
