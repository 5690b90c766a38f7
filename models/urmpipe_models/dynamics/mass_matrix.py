"""The mass matrix of an arm."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_models.chains.chain import Chain
from urmpipe_models.dynamics.inverse import PosedLinks, posed_links
from urmpipe_models.dynamics.screws import Body, inertial_force, moving_links
from urmpipe_models.elementwise import Element, dot, plus, times


def mass_matrix(chain: Chain, q: Sequence[Element]) -> list[list[Element]]:
    """Return M of T = 1/2 q'^T M q': M_ij is what a unit of q_j'' alone needs of joint i.

    Of the joints j from the tip inwards: the body beyond j answers to the accelerations of a unit of q_j''
    (see `screws`), and each joint i up to j takes its part of the force. Joints of one coordinate add up.

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].

    Returns:
        The rows, one element per coordinate each, in [kg.m2] between joints that turn, [kg] between joints
        that slide, [kg.m] between both.

    Raises:
        RobotError: If the arm has no masses.

    Source: [Iso9283]_ eq. 13, D_1, by the composite bodies of [Walker1982]_.
    """
    return posed_matrix(posed_links(chain, q))


def posed_matrix(posed: PosedLinks) -> list[list[Element]]:
    """Return `mass_matrix` of an arm in a pose."""
    links, _ = moving_links(posed)
    count = len(posed.chain.coordinates)
    matrix: list[list[Element]] = [[0.0] * count for _ in range(count)]
    beyond = Body()
    for j in reversed(range(len(links))):
        beyond += links[j].body
        force = inertial_force(beyond, links[j].field(1.0))
        for i in range(j + 1):
            entry, row, column = links[i].torque(force), links[i].coordinate, links[j].coordinate
            matrix[row][column] = plus(matrix[row][column], entry)
            if i != j:
                matrix[column][row] = plus(matrix[column][row], entry)
    return matrix


def coordinate_sizes(chain: Chain, q: Sequence[Element]) -> list[Element]:
    """Return what the masses that each coordinate moves could make its entry of M, wherever its axes are.

    |z|^2 times the trace of their second moments about the common origin (see `screws`) of a joint that
    turns, |v|^2 times their mass of one that slides: what the rounding of M counts from.

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].

    Returns:
        One element per coordinate, in [kg.m2] or [kg].
    """
    links, _ = moving_links(posed_links(chain, q))
    sizes: list[Element] = [0.0] * len(chain.coordinates)
    beyond = Body()
    for link in reversed(links):
        beyond += link.body
        (xx, _, _), (_, yy, _), (_, _, zz) = beyond.second
        turning = times(dot(link.axis, link.axis), plus(plus(xx, yy), zz))
        size = turning if link.turns else times(dot(link.slide, link.slide), beyond.mass)
        sizes[link.coordinate] = plus(sizes[link.coordinate], size)
    return sizes
