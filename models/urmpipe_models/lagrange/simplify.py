"""Shorter polynomials by the identities of sines and cosines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from urmpipe_models.lagrange.variables import Polynomial, Variables, difference, oriented, total


class Identity(NamedTuple):
    """A product of two variables, by their indices, and the polynomial that is equal to it."""

    first: int
    second: int
    equal: Polynomial


def simplified(of: Polynomial, variables: Variables) -> Polynomial:
    """Return a polynomial with a shorter factor of each product of rates, accelerations and wrench.

    Of each angle s^2 = 1 - c^2 and c^2 = 1 - s^2, of angles a and b about the same axis
    cos b cos a + sin b sin a = cos(b - a) and sin b cos a - cos b sin a = sin(b - a): each is put in where it
    leaves fewer monomials.

    Args:
        of: The polynomial.
        variables: Its variables.
    """
    known = [*_differences(variables), *_squares(variables)]
    return total((_shortest(part, known, variables) for part in variables.by_motion(of).values()), variables)


def _shortest(of: Polynomial, known: Sequence[Identity], variables: Variables) -> Polynomial:
    """Return the shortest polynomial that was found."""
    before = len(of) + 1
    while len(of) < before:
        before = len(of)
        for identity in known:
            of = min(of, total(_replaced(of, identity), variables), key=len)
    return of


def _replaced(of: Polynomial, identity: Identity) -> Iterator[Polynomial]:
    """Yield the parts of a polynomial with what is equal in place of a product."""
    i, j, equal = identity
    for key, coefficient in of.items():
        times = key[i] // 2 if i == j else min(key[i], key[j])
        rest = [*key]
        rest[i] -= times
        rest[j] -= times
        yield (equal**times).mul_term((tuple(rest), coefficient))


def _squares(variables: Variables) -> Iterator[Identity]:
    """Yield what the squares of each cosine and sine are equal to."""
    for k in range(0, 2 * len(variables.angles), 2):
        c, s = variables.ring.gens[k : k + 2]
        yield Identity(k + 1, k + 1, 1 - c**2)
        yield Identity(k, k, 1 - s**2)


def _differences(variables: Variables) -> Iterator[Identity]:
    """Yield what products of the cosines and sines of two angles about the same axis are equal to."""
    for a, b in variables.parallel:
        (ca, sa), (cb, sb), (c, s) = map(variables.cosine_sine, (a, b, difference(a, b)))
        (sign_a, own_a), (sign_b, own_b) = oriented(a), oriented(b)
        i, j = (2 * variables.angles.index(own) for own in (own_a, own_b))
        yield Identity(j + 1, i + 1, (c - cb * ca) * (sign_a * sign_b))
        yield Identity(j, i, c - sb * sa)
        yield Identity(j + 1, i, (s + cb * sa) * sign_b)
        yield Identity(j, i + 1, (sb * ca - s) * sign_a)
