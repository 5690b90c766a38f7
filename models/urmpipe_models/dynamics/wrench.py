"""A force and a moment on the tool of an arm."""

from __future__ import annotations

from typing import NamedTuple

from urmpipe_models.elementwise import ZERO, Vector


class Wrench(NamedTuple):
    """What acts on the tool centre point from outside, along the axes of the world.

    Eq. 13 of [Iso9283]_ counts the opposite: what the tool does to its surroundings.

    Attributes:
        force: In [N].
        moment: In [N.m].
    """

    force: Vector = ZERO
    moment: Vector = ZERO
