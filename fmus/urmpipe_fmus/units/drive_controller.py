"""The sampled controller of a drive as a unit."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from urmpipe_fmus.unit import Recipe, Unit
from urmpipe_fmus.values import Values
from urmpipe_fmus.variable import Input, Memory, Output, Parameter
from urmpipe_models.drives import SHORTEST_PERIOD, Gains, JointMotion, next_voltage, sample_number, voltage_at
from urmpipe_models.elementwise import Element

OPTIONS: Mapping[str, str] = {}

NO_SAMPLE = -(2.0**53)
"""Below the number of every sample: a run may begin before 0 s."""


def drive_controller() -> Unit:
    """Return the unit: set and real position, velocity and acceleration in; voltage out.

    It samples at the multiples of its own period, whatever the communication step; where no communication
    point meets one, at the next communication point. At a sample the voltage follows its inputs at once;
    between two it is held. The gains may be negative, for a drive that turns the other way; with all three
    negated the unit computes eq. 20 as it is printed, which runs away.

    Source: [Iso9283]_ eq. 20 with the corrected sign.
    """
    return Unit(
        name="drive_controller",
        description="Sampled control of a drive's voltage by errors of position, velocity, acceleration",
        variables=(*_parameters(), *_inputs("set", "Set"), *_inputs("real", "Real"), _VOLTAGE, *_memories()),
        outputs=lambda v: {"u": _voltage(v)},
        update=lambda v: {
            "last": _voltage(v),
            "sample": np.maximum(v.sample, sample_number(v.time, v.period)),
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


def _parameters() -> tuple[Parameter, ...]:
    period, gain = "Time between two samples", "Voltage that a sample adds for an error of"
    return (
        Parameter(
            name="period", description=period, unit="s", start=5e-3, minimum=SHORTEST_PERIOD, tunable=False
        ),
        Parameter(name="Kphi", description=f"{gain} position (assumed)", unit="V/rad", start=7.5),
        Parameter(name="Kw", description=f"{gain} velocity (assumed)", unit="V.s/rad", start=0.75),
        Parameter(name="Keps", description=f"{gain} acceleration (assumed)", unit="V.s2/rad", start=0.01),
        Parameter(name="u_max", description="Largest voltage (assumed)", unit="V", start=48.0, minimum=0.0),
    )


def _inputs(prefix: str, word: str) -> tuple[Input, ...]:
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
    fresh = next_voltage(
        v.last,
        Gains(v.Kphi, v.Kw, v.Keps),
        JointMotion(v.set_theta, v.set_omega, v.set_alpha),
        JointMotion(v.real_theta, v.real_omega, v.real_alpha),
        v.u_max,
    )
    return voltage_at(v.time, v.period, v.sample, fresh, v.last)
