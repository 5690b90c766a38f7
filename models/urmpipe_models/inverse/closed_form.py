"""Arms whose inverse can be written down: what they have in common, and how one is recognised."""

from __future__ import annotations

from functools import lru_cache
from typing import Protocol

from urmpipe_models.chain import Chain
from urmpipe_models.inverse.parallel_axes import parallel_axes
from urmpipe_models.inverse.solutions import FloatArray, Solutions
from urmpipe_models.inverse.spherical_wrist import spherical_wrist
from urmpipe_models.inverse.targets import Targets
from urmpipe_models.screws import screws


class ClosedForm(Protocol):
    """The inverse of one arm, written down.

    Attributes:
        name: What makes it possible: "spherical wrist" or "three parallel axes".
        branches: What its solutions are called, in their order.
    """

    @property
    def name(self) -> str:
        """What makes it possible."""
        ...

    @property
    def branches(self) -> tuple[str, ...]:
        """What its solutions are called, in their order."""
        ...

    def solve(self, targets: Targets, near: FloatArray | None = None) -> Solutions:
        """Return every solution of every target, joints in (-pi, pi], limits of the joints not asked.

        Args:
            targets: Poses; positions alone have no closed form.
            near: Joint values in [rad] or [m], shape (joints,) or (n, joints): where a singular pose leaves
                a joint free, it is taken from here; without it by the convention of `Singular.chosen`.
        """
        ...


@lru_cache(maxsize=32)
def closed_form(chain: Chain) -> ClosedForm | None:
    """Return the closed form of an arm, recognised from its geometry alone; None if it has none.

    Six revolute joints, whatever they are described by, on any base and with any tool, of which the axes of
    the last three meet in a point, or those of joints 2, 3 and 4 are parallel.
    """
    of_chain = screws(chain)
    if of_chain is None:
        return None
    names = chain.coordinates
    return spherical_wrist(of_chain, names) or parallel_axes(of_chain, names)
