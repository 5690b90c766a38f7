"""How the joints turn what they carry: joints with parallel axes turn it by one angle, the sum of theirs.

The variables of an open form, and the polynomials in them.

Where the bodies of an arm are and how they turn, as polynomials.

The energies of an arm and the power of its tool, as polynomials.

Lagrange's equations of the second kind, term by term.

Shorter polynomials by the identities of sines and cosines.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias, get_args

from urmpipe_models.arm.chain import Chain, Inertial, Joint
from urmpipe_models.elementwise import ZERO, Vector, dot
from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.math3d import Transform, rotation_about

ROUNDING = 1e-15
"""Entries of constant rotations that differ by this from 0 or 1 are meant as 0 and 1."""

PARALLEL = 1e-12
"""Axes whose directions differ by this are parallel: of a torque it is less than its rounding."""

Angle = tuple[float, ...]
"""A sum of joint values: a factor for each coordinate."""


class AxisRotation(NamedTuple):
    """A rotation Rot(axis, angle) inner, with the same axis since its joints are parallel.

    Attributes:
        axis: Unit vector in the frame where the parallel joints begin [-].
        angle: The factors of the coordinates in the angle.
        inner: A constant rotation.
    """

    axis: Vector
    angle: Angle
    inner: Transform = Transform()

    def __matmul__(self, rotation: Transform) -> AxisRotation:
        """Return the turn that a constant rotation follows."""
        return self._replace(inner=rounded(self.inner @ Transform(rotation.rotation)))


class JointStep(NamedTuple):
    """A joint on the way from the base to the tip.

    Attributes:
        joint: The joint.
        before: The turn of the body before it.
        at: The same with the joint's frame at q = 0.
        begins: Whether its axis is not parallel to that of the turn: a new turn begins in its frame.
        after: The turn of the body that it moves.
        value: The factors of the coordinates in its value.
        offset: The constant in its value, in [rad] or [m].
    """

    joint: Joint
    before: AxisRotation
    at: AxisRotation
    begins: bool
    after: AxisRotation
    value: Angle
    offset: float


def iter_joint_steps(chain: Chain) -> Iterator[JointStep]:
    """Yield the joints of an arm from the base to the tip, with the turns before and after each."""
    turn = AxisRotation((0.0, 0.0, 1.0), (0.0,) * len(chain.coordinates))
    for joint in chain.joints:
        value, offset = _value(chain, joint)
        before, at = turn, turn @ joint.origin
        turn, begins = at, False
        if joint.kind == "revolute":
            sign = _sense(at, joint)
            begins = sign == 0
            if begins:
                turn = AxisRotation(joint.axis, value, rounded(rotation_about(joint.axis, offset)))
            else:
                angle = tuple(_snapped(a + sign * b) for a, b in zip(at.angle, value, strict=True))
                turn = at._replace(angle=angle) @ rotation_about(joint.axis, offset)
        yield JointStep(joint, before, at, begins, turn, value, offset)


def rounded(rotation: Transform) -> Transform:
    """Return a constant rotation whose entries are exactly 0 or 1 where they are nearly so."""
    x, y, z = (tuple(map(_snapped, row)) for row in rotation.rotation)
    return Transform((x, y, z))  # type: ignore[arg-type]


def _snapped(value: float) -> float:
    """Return the whole number next to a value where it is nearly that."""
    return float(round(value)) if abs(value - round(value)) < ROUNDING else value


def _sense(turn: AxisRotation, joint: Joint) -> int:
    """Return 1 or -1 for a joint that turns about the axis of a turn, one way or the other; else 0."""
    cosine = dot(turn.inner.rotate(joint.axis), turn.axis)
    across = max(abs(a - cosine * b) for a, b in zip(turn.inner.rotate(joint.axis), turn.axis, strict=True))
    return 0 if across > PARALLEL else round(cosine)


def _value(chain: Chain, joint: Joint) -> tuple[Angle, float]:
    """Return a joint's value: the factor of each coordinate, and a constant in [rad] or [m]."""
    name, factor, offset = joint.name, 1.0, 0.0
    if joint.mimic is not None:
        name, factor, offset = joint.mimic.joint, joint.mimic.multiplier, joint.mimic.offset
    if joint.kind == "fixed":
        factor = 0.0
    return tuple(factor if one == name else 0.0 for one in chain.coordinates), offset


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
        sign, known = normalise_sign(angle)
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
        return sum_polynomials(
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


def normalise_sign(angle: Angle) -> tuple[float, Angle]:
    """Return the sign of the first factor that is not 0, and the angle times it."""
    sign = 1.0 if next(filter(None, angle)) > 0.0 else -1.0
    return sign, tuple(sign * factor + 0.0 for factor in angle)  # + 0.0: no -0.0


def sum_polynomials(of: Iterable[Polynomial], variables: Variables, of_masses: bool = False) -> Polynomial:
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
    return sum_polynomials((y.mul_term(part) for x, y in pairs for part in x.terms()), variables)


def chain_to_variables(chain: Chain) -> Variables:
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
    found = [*iter_joint_steps(chain)]
    pairs = [*dict.fromkeys(_parallel(found))]
    turned = [one.after.angle for one in found] + [subtract_angles(*pair) for pair in pairs]
    angles = dict.fromkeys(normalise_sign(angle)[1] for angle in turned if any(angle))
    sliding = {k for one in found if one.joint.kind == "prismatic" for k, f in enumerate(one.value) if f}
    slides, count = tuple(sorted(sliding)), len(chain.coordinates)
    names = [f"{kind}{k}" for k in range(len(angles)) for kind in ("c", "s")]
    names += [f"q{k}" for k in slides] + [f"{kind}{k}" for kind in ("u", "a") for k in range(count)]
    return Variables(ring([*names, *WRENCH], RR)[0], tuple(angles), slides, count, tuple(pairs))


def subtract_angles(first: Angle, second: Angle) -> Angle:
    """Return the second angle less the first."""
    return tuple(b - a for a, b in zip(first, second, strict=True))


def _parallel(found: Sequence[JointStep]) -> Iterator[tuple[Angle, Angle]]:
    """Yield the pairs of different angles about the same axis; an angle of 0 is none."""
    group: list[Angle] = []
    for step in found:
        angle = step.after.angle
        if step.begins:
            group = []
        if any(angle) and angle not in group:
            yield from ((one, angle) for one in group)
            group.append(angle)


Triple: TypeAlias = list[Polynomial]
"""x, y, z."""

Matrix: TypeAlias = list[Triple]
"""The rows of a rotation."""


class MovingBody(NamedTuple):
    """What a joint moves.

    Attributes:
        step: The joint.
        rotation: From the joint's moving frame to the base.
        place: The origin of that frame, in the base [m].
        spin: The angular velocity in the axes of the moving frame, in [rad/s].
    """

    step: JointStep
    rotation: Matrix
    place: Triple
    spin: Triple


def iter_bodies(chain: Chain, variables: Variables) -> Iterator[MovingBody]:
    """Yield what each joint moves, from the base outwards.

    T_1i = A_1 A_2 ... A_i, and omega_i = B_i^T (omega_(i-1) + (0, 0, theta_i')^T), here about any axis.
    Joints with parallel axes are one A with the sum of their angles.

    Source: [Iso9283]_ eq. 8 and 12.
    """
    begin, origin = (
        constant_matrix(Transform().rotation, variables),
        constant_column(ZERO, variables),
    )  # where a turn begins
    spin = place = constant_column(ZERO, variables)  # in the axes of that frame
    for step in iter_joint_steps(chain):
        shift = constant_column(step.joint.origin.translation, variables)
        place = shift_origin(place, _rotation(step.before, variables), shift, variables)
        if step.begins:
            spin = _spin(step.at, spin, variables)
            origin = shift_origin(origin, begin, place, variables)
            begin, place = (
                _product(begin, _rotation(step.at, variables), variables),
                constant_column(ZERO, variables),
            )
        rotation = _rotation(step.after, variables)
        if step.joint.kind == "prismatic":
            value = variables.value(step.value, step.offset)
            slide = [variables.constant(x) * value for x in step.joint.axis]
            place = shift_origin(place, rotation, slide, variables)
        yield MovingBody(
            step,
            _product(begin, rotation, variables),
            shift_origin(origin, begin, place, variables),
            _spin(step.after, spin, variables),
        )


def constant_column(of: Vector, variables: Variables) -> Triple:
    """Return a constant vector."""
    return [variables.constant(x) for x in of]


def constant_matrix(of: Sequence[Vector], variables: Variables) -> Matrix:
    """Return a constant matrix."""
    return [constant_column(row, variables) for row in of]


def multiply_column(of: Matrix, vector: Sequence[Polynomial], variables: Variables) -> Triple:
    """Return a matrix times a column."""
    return [scalar_product(row, vector, variables) for row in of]


def shift_origin(place: Triple, rotation: Matrix, shift: Triple, variables: Variables) -> Triple:
    """Return a place and what follows it in turned axes."""
    return [
        sum_polynomials(one, variables)
        for one in zip(place, multiply_column(rotation, shift, variables), strict=True)
    ]


def velocity(place: Triple, variables: Variables) -> Triple:
    """Return dr/dt = sum_j (dr/dq_j) q_j', in [m/s]. Source: [Iso9283]_ eq. 9-11, by differentiation."""
    return [
        sum_polynomials(
            (part * rate for j, rate in enumerate(variables.rates) for part in variables.derivative(x, j)),
            variables,
        )
        for x in place
    ]


def _product(a: Matrix, b: Matrix, variables: Variables) -> Matrix:
    """Return the product of two matrices."""
    return [[scalar_product(row, one, variables) for one in zip(*b, strict=True)] for row in a]


def _spin(turn: AxisRotation, before: Triple, variables: Variables) -> Triple:
    """Return the angular velocity behind a turn, in the axes of what it turns."""
    rate = variables.rate(turn.angle)
    added = [
        sum_polynomials((x, variables.constant(a) * rate), variables)
        for x, a in zip(before, turn.axis, strict=True)
    ]
    return [scalar_product(one, added, variables) for one in zip(*_rotation(turn, variables), strict=True)]


def _rotation(turn: AxisRotation, variables: Variables) -> Matrix:
    """Return Rot(axis, angle) inner: c 1 + s [a]x + (1 - c) a a^T of a unit vector a, times a constant."""
    c, s = variables.cosine_sine(turn.angle)
    x, y, z = turn.axis
    across = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
    rows = [
        [
            c * variables.constant(float(i == k) - turn.axis[i] * turn.axis[k])
            + s * variables.constant(across[i][k])
            + variables.constant(turn.axis[i] * turn.axis[k])
            for k in range(3)
        ]
        for i in range(3)
    ]
    return _product(rows, constant_matrix(turn.inner.rotation, variables), variables)


class Energies(NamedTuple):
    """What Lagrange's equations are made of.

    Attributes:
        kinetic: T in [J].
        potential: U in [J].
        power: Of the wrench on the tool centre point, in [W].
    """

    kinetic: Polynomial
    potential: Polynomial
    power: Polynomial


def energies(chain: Chain, variables: Variables) -> Energies:
    """Return T = sum 1/2 m v^2 + 1/2 omega^T I omega, U = -sum m g^T r, and f^T v + m^T omega of the tool.

    All in the axes of the base, towards which gravity and wrench are turned.

    Args:
        chain: The arm, with masses.
        variables: Those of the arm.

    Source: [Iso9283]_ eq. 8-12.
    """
    world = rounded(Transform(chain.base.columns))  # from the world's axes to the base's
    found = {one.step.joint.name: one for one in iter_bodies(chain, variables)}
    carried = [(found[one.joint], one) for one in chain.inertials if one.joint is not None]
    gravity = world.rotate(chain.gravity)
    kinetic = sum_polynomials((_kinetic(*pair, variables) for pair in carried), variables, of_masses=True)
    potential = sum_polynomials(
        (_potential(*pair, gravity, variables) for pair in carried), variables, of_masses=True
    )
    tool = _point(found[chain.joints[-1].name], (chain.tip @ chain.tool).translation, variables)
    turn = constant_matrix(world.rotation, variables)
    force, moment = (
        multiply_column(turn, part, variables) for part in (variables.wrench[:3], variables.wrench[3:])
    )
    moved = [*velocity(tool, variables), *_turning([*found.values()], variables)]
    return Energies(kinetic, potential, scalar_product([*force, *moment], moved, variables))


def _kinetic(body: MovingBody, one: Inertial, variables: Variables) -> Polynomial:
    """Return 1/2 m v^2 + 1/2 omega^T I omega of a mass, in [J]."""
    speed = velocity(_point(body, one.centre, variables), variables)
    turned = multiply_column(constant_matrix(one.matrix, variables), body.spin, variables)
    momenta = [*(variables.constant(one.mass) * x for x in speed), *turned]
    return variables.constant(0.5) * scalar_product(momenta, [*speed, *body.spin], variables)


def _potential(body: MovingBody, one: Inertial, gravity: Vector, variables: Variables) -> Polynomial:
    """Return -m g^T r of a mass, in [J]."""
    weight = [variables.constant(-one.mass * x) for x in gravity]
    return scalar_product(weight, _point(body, one.centre, variables), variables)


def _point(body: MovingBody, place: Vector, variables: Variables) -> Triple:
    """Return where a point in [m] of a body is, in the base [m]."""
    return shift_origin(body.place, body.rotation, constant_column(place, variables), variables)


def _turning(found: Sequence[MovingBody], variables: Variables) -> Triple:
    """Return the angular velocity of the last body, along the base: each joint's rate on its axis."""
    turning = [(rotation, step) for step, rotation, *_ in found if step.joint.kind == "revolute"]
    axes = [
        multiply_column(rotation, constant_column(step.joint.axis, variables), variables)
        for rotation, step in turning
    ]
    rates = [variables.rate(step.value) for _, step in turning]
    return [scalar_product([axis[k] for axis in axes], rates, variables) for k in range(3)]


TermName = Literal["inertia", "centrifugal", "coriolis", "gravity", "tool"]
TERMS: tuple[TermName, ...] = get_args(TermName)
"""The terms of an equation, in the order of eq. 13."""

Equation = dict[TermName, Polynomial]
"""The terms of one coordinate, in [N.m], or in [N] where it slides."""


def equations(energies: Energies, variables: Variables) -> list[Equation]:
    """Return the terms of each coordinate's equation, whose sum is what its drive must give.

    tau_i = d/dt dT/dq_i' - dT/dq_i + dU/dq_i - dP/dq_i'. Of it, inertia: what has a q_j'';
    centrifugal: what has a q_j'^2; Coriolis: what has a q_j' q_k'; gravity: dU/dq_i; tool: -dP/dq_i', which
    is -(J^T F)_i, with the power P of a wrench F that acts on the tool from outside.

    Source: [Iso9283]_ eq. 13, whose F is the opposite: the force that the tool exerts.
    """
    return [_equation(energies, variables, i) for i in range(variables.coordinates)]


def _equation(energies: Energies, variables: Variables, i: int) -> Equation:
    """Return the terms of a coordinate's equation."""
    rates = variables.rates
    momentum = energies.kinetic.diff(rates[i])
    inertia = scalar_product(map(momentum.diff, rates), variables.accelerations, variables)
    moved = [one * rate for j, rate in enumerate(rates) for one in variables.derivative(momentum, j)]
    still = [-one for one in variables.derivative(energies.kinetic, i)]
    speeds = variables.by_motion(sum_polynomials([*moved, *still], variables))
    centrifugal, coriolis = (
        sum_polynomials((part for motion, part in speeds.items() if (max(motion) == 2) == square), variables)
        for square in (True, False)
    )
    return {
        "inertia": inertia,
        "centrifugal": centrifugal,
        "coriolis": coriolis,
        "gravity": sum_polynomials(variables.derivative(energies.potential, i), variables),
        "tool": -energies.power.diff(rates[i]),
    }


class Identity(NamedTuple):
    """A product of two variables, by their indices, and the polynomial that is equal to it."""

    first: int
    second: int
    equal: Polynomial


def simplify_polynomial(of: Polynomial, variables: Variables) -> Polynomial:
    """Return a polynomial with a shorter factor of each product of rates, accelerations and wrench.

    Of each angle s^2 = 1 - c^2 and c^2 = 1 - s^2, of angles a and b about the same axis
    cos b cos a + sin b sin a = cos(b - a) and sin b cos a - cos b sin a = sin(b - a): each is put in where it
    leaves fewer monomials.

    Args:
        of: The polynomial.
        variables: Its variables.
    """
    known = [*_differences(variables), *_squares(variables)]
    return sum_polynomials(
        (_shortest(part, known, variables) for part in variables.by_motion(of).values()), variables
    )


def _shortest(of: Polynomial, known: Sequence[Identity], variables: Variables) -> Polynomial:
    """Return the shortest polynomial that was found."""
    before = len(of) + 1
    while len(of) < before:
        before = len(of)
        for identity in known:
            of = min(of, sum_polynomials(_replaced(of, identity), variables), key=len)
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
        (ca, sa), (cb, sb), (c, s) = map(variables.cosine_sine, (a, b, subtract_angles(a, b)))
        (sign_a, own_a), (sign_b, own_b) = normalise_sign(a), normalise_sign(b)
        i, j = (2 * variables.angles.index(own) for own in (own_a, own_b))
        yield Identity(j + 1, i + 1, (c - cb * ca) * (sign_a * sign_b))
        yield Identity(j, i, c - sb * sa)
        yield Identity(j + 1, i, (s + cb * sa) * sign_b)
        yield Identity(j, i + 1, (sb * ca - s) * sign_a)
