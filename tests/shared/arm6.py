"""The arm of the 2019 paper, by closed forms of its own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import Element


class Arm6Lengths(NamedTuple):
    """What the determinant of the 2019 paper's arm depends on, in [m]: Table 3.1."""

    a1: Element = 0.03
    a2: Element = 0.12
    a4: Element = 0.02
    d5: Element = 0.13


def arm6_determinant(q: Sequence[Element], lengths: Arm6Lengths | None = None) -> Element:
    """Return det J of the arm of the 2019 paper (robot arm6) in [m^3], elementwise.

    det J = a2 (a4 sin tA + d5 cos tA) X sin t5, with tA = pi/2 + t3 and the signed distance of the wrist
    centre from axis 1, X = -a1 + a2 cos t2 + a4 cos(t2 + tA) - d5 sin(t2 + tA). Its factors are the families
    of singular poses: the arm stretched or withdrawn, the wrist on axis 1, the wrist aligned. It is the same
    for any tool: another point of the hand adds multiples of the lower rows of J to the upper ones.

    Args:
        q: theta1..theta6 in [rad], any elements.
        lengths: Those of Table 3.1 by default.

    Source: [Serial6dof2019]_ Table 3.1 and section 5; the closed form is ours (errata).
    """
    a1, a2, a4, d5 = lengths or Arm6Lengths()
    _, t2, t3, _, t5, _ = q
    elbow = a4 * np.cos(t3) - d5 * np.sin(t3)  # sin tA = cos t3, cos tA = -sin t3
    reach = a2 * np.cos(t2) - a4 * np.sin(t2 + t3) - d5 * np.cos(t2 + t3) - a1
    return a2 * elbow * reach * np.sin(t5)
