"""A force and a moment on the tool of an arm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from urmpipe_models.chains.chain import Chain
from urmpipe_models.elementwise import ZERO, Element, Vector, plus, times
from urmpipe_models.kinematics.forward import jacobian


class Wrench(NamedTuple):
    """What acts on the tool centre point from outside, along the axes of the world.

    Eq. 13 of [Iso9283]_ counts the opposite: what the tool does to its surroundings.

    Attributes:
        force: In [N].
        moment: In [N.m].
    """

    force: Vector = ZERO
    moment: Vector = ZERO


def wrench_power(chain: Chain, q: Sequence[Element], qd: Sequence[Element], wrench: Wrench) -> Element:
    """Return (J^T F) . q', the power of what acts on the tool, in [W].

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].
        wrench: What acts on the tool centre point from outside.
    """
    power: Element = 0.0
    for column, rate in zip(jacobian(chain, q), qd, strict=True):
        for entry, given in zip(column, (*wrench.force, *wrench.moment), strict=True):
            power = plus(power, times(times(entry, rate), given))
    return power
