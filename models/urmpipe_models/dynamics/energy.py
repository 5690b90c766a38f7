"""The energies of an arm."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_models.chains.chain import Chain
from urmpipe_models.dynamics.links import check_masses
from urmpipe_models.dynamics.mass_centres import mass_centres, mass_motions
from urmpipe_models.elementwise import Element, dot, minus, plus, times
from urmpipe_models.transform import Transform


def kinetic_energy(chain: Chain, q: Sequence[Element], qd: Sequence[Element]) -> Element:
    """Return T = 1/2 sum (m v_s^2 + omega . I omega) in [J].

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].

    Raises:
        RobotError: If the arm has no masses.

    Source: [Iso9283]_ section 3, from eq. 9 and 12.
    """
    energy: Element = 0.0
    for one in mass_motions(chain, q, qd):
        spin = Transform(one.inertial.matrix).rotate(one.omega)
        twice = plus(times(one.inertial.mass, dot(one.velocity, one.velocity)), dot(one.omega, spin))
        energy = plus(energy, times(0.5, twice))
    return energy


def potential_energy(chain: Chain, q: Sequence[Element]) -> Element:
    """Return U = -sum m g . r_s in [J], 0 with all masses at the world's origin.

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].

    Raises:
        RobotError: If the arm has no masses.

    Source: [Iso9283]_ section 3, from eq. 8.
    """
    check_masses(chain)
    energy: Element = 0.0
    for one, centre in zip(chain.inertials, mass_centres(chain, q), strict=True):
        energy = minus(energy, times(one.mass, dot(chain.gravity, centre)))
    return energy
