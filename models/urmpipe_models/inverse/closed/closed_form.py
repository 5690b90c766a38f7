"""Arms whose inverse can be written down: what they have in common, and how one is recognised."""

from __future__ import annotations

from functools import lru_cache
from typing import Protocol

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.inverse.closed.nearly import nearly_closed_form
from urmpipe_models.inverse.closed.parallel_axes import parallel_axes
from urmpipe_models.inverse.closed.spherical_wrist import spherical_wrist
from urmpipe_models.inverse.solutions import Solutions
from urmpipe_models.inverse.targets import Targets
from urmpipe_models.kinematics.screws import screws


class ClosedForm(Protocol):
    """The inverse of one arm, written down.

    Attributes:
        name: What makes it possible: "spherical wrist" or "three parallel axes"; of an arm that
            deviates a little from that with ", nearly" behind it.
        branches: What its solutions are called, in their order.
    """

    @property
    def name(self) -> str:
        """What makes it possible, such as "spherical wrist"."""
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

    Six joints, whatever they are described by, on any base and with any tool, of which the axes of the last
    three meet in a point, or those of joints 2, 3 and 4 are parallel: exactly (`exact_form`) or nearly
    (`nearly.NearlyClosedForm`).
    """
    exact = exact_form(chain)
    of_chain = screws(chain)
    if exact is not None or of_chain is None:
        return exact
    return nearly_closed_form(chain, of_chain)


@lru_cache(maxsize=32)
def exact_form(chain: Chain) -> ClosedForm | None:
    """Return the closed form of an arm that has it to the rounding; None if it has none.

    Paths are followed by these alone: beside singular poses the branches of an arm that only nearly has one
    are not those of the idealised arm.
    """
    of_chain = screws(chain)
    if of_chain is None:
        return None
    names = chain.coordinates
    return spherical_wrist(of_chain, names) or parallel_axes(of_chain, names)


def method_words(method: str) -> str:
    """Return what solves targets: "closed form: spherical wrist", or "iterative"."""
    return method if method == "iterative" else f"closed form: {method}"
