"""The variables of an open form, and the polynomials in them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from urmpipe_models.chains.chain import Chain
from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.lagrange.angles import Angle, Step, steps

Polynomial: TypeAlias = Any
"""An element of a polynomial ring of SymPy over floats; SymPy has no types."""

Monomial: TypeAlias = tuple[int, ...]
"""The exponent of each variable."""

Terms: TypeAlias = Mapping[Monomial, float]
"""A polynomial as the coefficient of each monomial."""

NOTHING = 1e-14
"""A sum below this share of the largest that it adds up is what rounding left."""

WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
"""Force [N] and moment [N.m] on the tool centre point."""


@dataclass(frozen=True, eq=False)
class Variables:
    """The variables of an open form; their order is that of the exponents in a monomial.

    Attributes:
        ring: The polynomials in them, with floats as coefficients.
        angles: The angles whose cosine and sine are variables, first in the order; signs so that the first
            factor is positive.
        slides: Coordinates that are variables themselves, in [m], by index; next in the order.
        coordinates: How many coordinates there are; next q', then q'' of each, then the wrench.
        parallel: Pairs of angles about the same axis, whose difference is one of `angles`.
    """

    ring: Any
    angles: tuple[Angle, ...]
    slides: tuple[int, ...]
    coordinates: int
    parallel: tuple[tuple[Angle, Angle], ...] = ()

    @property
    def shape(self) -> int:
        """How many variables tell the pose; those after them tell motion and wrench."""
        return 2 * len(self.angles) + len(self.slides)

    @property
    def rates(self) -> list[Polynomial]:
        """The rates q', in [rad/s] or [m/s]."""
        return list(self.ring.gens[self.shape : self.shape + self.coordinates])

    @property
    def accelerations(self) -> list[Polynomial]:
        """The accelerations q'', in [rad/s2] or [m/s2]."""
        return list(self.ring.gens[self.shape + self.coordinates : self.shape + 2 * self.coordinates])

    @property
    def wrench(self) -> list[Polynomial]:
        """fx, fy, fz in [N] and mx, my, mz in [N.m]."""
        return list(self.ring.gens[self.shape + 2 * self.coordinates :])

    def constant(self, value: float) -> Polynomial:
        """Return a number as a polynomial."""
        return self.ring.ground_new(self.ring.domain(float(value)))

    def cosine_sine(self, angle: Angle) -> tuple[Polynomial, Polynomial]:
        """Return cos and sin of an angle: of none the constants 1 and 0."""
        if not any(angle):
            return self.constant(1.0), self.constant(0.0)
        sign, known = oriented(angle)
        k = 2 * self.angles.index(known)
        return self.ring.gens[k], self.constant(sign) * self.ring.gens[k + 1]

    def value(self, factors: Angle, offset: float) -> Polynomial:
        """Return the value of a joint that slides, in [m]."""
        found = self.constant(offset)
        for k, factor in enumerate(factors):
            if factor:
                slide = self.ring.gens[2 * len(self.angles) + self.slides.index(k)]
                found += self.constant(factor) * slide
        return found

    def rate(self, factors: Angle) -> Polynomial:
        """Return the rate of a joint, in [rad/s] or [m/s]."""
        return total(
            (self.constant(f) * rate for f, rate in zip(factors, self.rates, strict=True) if f), self
        )

    def derivative(self, of: Polynomial, coordinate: int) -> Iterator[Polynomial]:
        """Yield the parts of a partial derivative: of cos(m q + ...) it is -m sin, of sin m cos."""
        for k, angle in enumerate(self.angles):
            if angle[coordinate]:
                c, s = self.ring.gens[2 * k : 2 * k + 2]
                factor = self.constant(angle[coordinate])
                yield factor * of.diff(s) * c
                yield -factor * of.diff(c) * s
        if coordinate in self.slides:
            yield of.diff(self.ring.gens[2 * len(self.angles) + self.slides.index(coordinate)])

    def by_motion(self, of: Polynomial) -> dict[Monomial, Polynomial]:
        """Return what has the same product of rates, accelerations and wrench, by the exponents of these."""
        found: dict[Monomial, dict[Monomial, Any]] = {}
        for key, coefficient in of.items():
            found.setdefault(key[self.shape :], {})[key] = coefficient
        return {motion: self.ring.from_dict(part) for motion, part in found.items()}


def oriented(angle: Angle) -> tuple[float, Angle]:
    """Return the sign of the first factor that is not 0, and the angle times it."""
    sign = 1.0 if next(filter(None, angle)) > 0.0 else -1.0
    return sign, tuple(sign * factor + 0.0 for factor in angle)  # + 0.0: no -0.0


def total(of: Iterable[Polynomial], variables: Variables, of_masses: bool = False) -> Polynomial:
    """Return the sum of polynomials, without the coefficients that rounding leaves of sums that cancel.

    Args:
        of: Polynomials.
        variables: Their variables.
        of_masses: Whether each is of another mass, however small beside the others: a coefficient is compared
            with what is added up to it, else with all that has the same rates, accelerations and wrench.
    """
    found: dict[Monomial, Any] = {}
    added: dict[Monomial, Any] = {}  # the largest
    begin = 0 if of_masses else variables.shape
    for one in of:  # in place: SymPy copies a sum for each part that it adds
        for key, coefficient in one.items():
            found[key] = found[key] + coefficient if key in found else coefficient
            added[key[begin:]] = max(added.get(key[begin:], 0.0), abs(coefficient))
    kept = {key: one for key, one in found.items() if abs(one) > NOTHING * added[key[begin:]]}
    return variables.ring.from_dict(kept)


def scalar_product(a: Iterable[Polynomial], b: Iterable[Polynomial], variables: Variables) -> Polynomial:
    """Return the sum of the products of the elements of two vectors."""
    pairs = zip(a, b, strict=True)
    return total((y.mul_term(part) for x, y in pairs for part in x.terms()), variables)


def variables_of(chain: Chain) -> Variables:
    """Return the variables of an arm.

    Raises:
        OptionError: If SymPy is not installed.
    """
    try:
        from sympy import RR
        from sympy.polys.rings import ring
    except ImportError:
        needs = 'with sympy: pip install "urmpipe[planning]"'
        raise OptionError(Finding(found="equations without sympy", allowed=needs)) from None
    found = [*steps(chain)]
    pairs = [*dict.fromkeys(_parallel(found))]
    turned = [one.after.angle for one in found] + [difference(*pair) for pair in pairs]
    angles = dict.fromkeys(oriented(angle)[1] for angle in turned if any(angle))
    sliding = {k for one in found if one.joint.kind == "prismatic" for k, f in enumerate(one.value) if f}
    slides, count = tuple(sorted(sliding)), len(chain.coordinates)
    names = [f"{kind}{k}" for k in range(len(angles)) for kind in ("c", "s")]
    names += [f"q{k}" for k in slides] + [f"{kind}{k}" for kind in ("u", "a") for k in range(count)]
    return Variables(ring([*names, *WRENCH], RR)[0], tuple(angles), slides, count, tuple(pairs))


def difference(first: Angle, second: Angle) -> Angle:
    """Return the second angle less the first."""
    return tuple(b - a for a, b in zip(first, second, strict=True))


def _parallel(found: Sequence[Step]) -> Iterator[tuple[Angle, Angle]]:
    """Yield the pairs of different angles about the same axis; an angle of 0 is none."""
    group: list[Angle] = []
    for step in found:
        angle = step.after.angle
        if step.begins:
            group = []
        if any(angle) and angle not in group:
            yield from ((one, angle) for one in group)
            group.append(angle)
