"""The sampled controller of a drive: it adds to the voltage what the errors at a sample ask for.

    u_n = u_n-1 + Kphi e_phi + Kw e_w + Keps e_eps        (e: set - real, of position, velocity, acceleration)

Summed up over samples of period T this is a PID on the position: the errors' integral with Kphi / T, the
error itself with Kw / T, its rate with Keps / T. The voltage is held between samples, and limited; as the
limited one is remembered, the sum does not wind up while the limit holds.

Source: [Iso9283]_ eq. 20, which prints a minus where a plus must stand: with set - real, the minus drives
the joint away from its set point.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from urmpipe_models.drives.set_point import JointMotion
from urmpipe_models.elementwise import Element

SAMPLE_SLACK = 1e-6
"""A sample counts as reached this share of a period early: computed, 0.3 / 0.1 is not quite 3."""


class Gains(NamedTuple):
    """What a sample adds to the voltage for each error.

    Attributes:
        position: Kphi in [V/rad].
        velocity: Kw in [V.s/rad].
        acceleration: Keps in [V.s2/rad].
    """

    position: Element
    velocity: Element
    acceleration: Element


def next_voltage(
    last: Element, gains: Gains, wanted: JointMotion, real: JointMotion, limit: Element
) -> Element:
    """Return the voltage u_n of a sample in [V], within -limit .. limit.

    Args:
        last: u_n-1, the voltage of the sample before, in [V].
        gains: Kphi, Kw, Keps.
        wanted: The set values.
        real: The real values.
        limit: Largest voltage in [V].

    Source: [Iso9283]_ eq. 20 with the corrected sign.
    """
    voltage = (
        last
        + gains.position * (wanted.position - real.position)
        + gains.velocity * (wanted.velocity - real.velocity)
        + gains.acceleration * (wanted.acceleration - real.acceleration)
    )
    return np.minimum(np.maximum(voltage, -limit), limit)


def sample_number(time: Element, period: Element) -> Element:
    """Return the number of the last sample instant, n T, that is not after a time in [s]."""
    return np.floor(time / period + SAMPLE_SLACK)


def voltage_at(time: Element, period: Element, sample: Element, fresh: Element, last: Element) -> Element:
    """Return the voltage from a time on in [V]: a new one where a sample is due, else the held one.

    Args:
        time: In [s].
        period: Between two samples, in [s].
        sample: Number of the last sample that was taken.
        fresh: What `next_voltage` gives now, in [V].
        last: The voltage of the last sample in [V].
    """
    return np.where(sample_number(time, period) > sample, fresh, last)
