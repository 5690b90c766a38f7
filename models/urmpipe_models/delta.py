"""The deviation between a commanded and an attained point, and whether it is tolerated, elementwise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import Element, Vector, subtract


class Delta(NamedTuple):
    """A deviation in [m].

    Attributes:
        x: Along x.
        y: Along y.
        z: Along z.
        norm: Length of the vector.
    """

    x: Element
    y: Element
    z: Element
    norm: Element


def delta(reference: Vector, actual: Vector) -> Delta:
    """Return delta = A_s - p(phi) and its norm.

    Args:
        reference: x, y, z of the commanded point in [m].
        actual: x, y, z of the attained point in [m].

    Source: [UrmArm2021]_ eq. 19-21, 23.
    """
    x, y, z = subtract(reference, actual)
    return Delta(x, y, z, np.sqrt(x * x + y * y + z * z))


def exceeds_tolerance(deviation: Delta, tolerance: Element) -> Element:
    """Return where |x|, |y| or |z| exceeds the tolerance in [m] or is NaN (1 in a trace).

    Each coordinate is compared: C's fmax ignores NaN.
    """
    x, y, z = (np.abs(component) <= tolerance for component in (deviation.x, deviation.y, deviation.z))
    return np.logical_not(np.logical_and(np.logical_and(x, y), z))
