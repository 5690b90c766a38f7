"""Lagrange's equations of an arm, derived with polynomials in the cosines and sines of its angles.

1. `iter_joint_steps`: consecutive joints with parallel axes rotate their bodies by one angle, a sum.
2. `Variables`: cosine and sine of each angle, prismatic coordinates, q', q'' and the wrench on the tool.
3. `_iter_bodies`: pose and angular velocity of each joint's body ([Iso9283]_ eq. 8 and 12).
4. `energies`: T = sum 1/2 m v^2 + 1/2 omega^T I omega, U = -sum m g^T r, and P of the wrench (eq. 8-12).
5. `equations`: tau_i = d/dt dT/dq_i' - dT/dq_i + dU/dq_i - dP/dq_i', by terms (eq. 13).
6. `simplify_polynomial`: fewer monomials by c^2 + s^2 = 1 and the addition theorems.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias, get_args

from urmpipe_models.arm.chain import Chain, Inertial, Joint
from urmpipe_models.elementwise import ZERO, Vector, dot
from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.math3d import Transform, rotation_about

MAX_ROUNDING = 1e-15  # entries of constant rotations this close to a whole number are replaced by it
# Difference of the directions of parallel axes; less than the rounding of a torque.
PARALLEL_TOLERANCE = 1e-12
NEGLIGIBLE_SUM = 1e-14  # share of the largest summand; a smaller sum is rounding

Angle: TypeAlias = tuple[float, ...]  # a sum of joint values: the factor of each coordinate
Polynomial: TypeAlias = Any  # an element of a polynomial ring of SymPy over floats; SymPy has no types
Monomial: TypeAlias = tuple[int, ...]  # the exponent of each variable
Terms: TypeAlias = Mapping[Monomial, float]  # a polynomial as the coefficient of each monomial
Triple: TypeAlias = list[Polynomial]  # x, y, z
Matrix: TypeAlias = list[Triple]  # rows

WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")  # force [N] and moment [N.m] on the tool centre point

TermName = Literal["inertia", "centrifugal", "coriolis", "gravity", "tool"]
TERMS: tuple[TermName, ...] = get_args(TermName)  # in the order of eq. 13
Equation = dict[TermName, Polynomial]  # the terms of a coordinate, in [N.m], or in [N] if it is prismatic


class _AxisRotation(NamedTuple):
    """Rotation Rot(axis, angle) inner: by the sum of the angles of joints with parallel axes.

    The axis is a unit vector in the frame of the first of these joints [-], inner a constant rotation.
    """

    axis: Vector
    angle: Angle
    inner: Transform = Transform()

    def __matmul__(self, rotation: Transform) -> _AxisRotation:
        return self._replace(inner=_round_rotation(self.inner @ Transform(rotation.rotation)))


class JointStep(NamedTuple):
    """A joint on the way from the base to the tip.

    Attributes:
        joint: The joint.
        before: The rotation of the body before it.
        at: The same with the joint's frame at q = 0.
        begins: Whether its axis is not parallel to that of the rotation: a new one begins in its frame.
        after: The rotation of the body that it moves.
        value: The factors of the coordinates in its value.
        offset: The constant in its value, in [rad] or [m].
    """

    joint: Joint
    before: _AxisRotation
    at: _AxisRotation
    begins: bool
    after: _AxisRotation
    value: Angle
    offset: float


def iter_joint_steps(chain: Chain) -> Iterator[JointStep]:
    """Yield the joints of an arm from the base to the tip, with the rotations before and after each."""
    rotation = _AxisRotation((0.0, 0.0, 1.0), (0.0,) * len(chain.coordinates))
    for joint in chain.joints:
        name, factor, offset = joint.name, 1.0, 0.0
        if joint.mimic is not None:
            name, factor, offset = joint.mimic.joint, joint.mimic.multiplier, joint.mimic.offset
        if joint.kind == "fixed":
            factor = 0.0
        value = tuple(factor if coordinate == name else 0.0 for coordinate in chain.coordinates)
        before, at = rotation, rotation @ joint.origin
        rotation, begins = at, False
        if joint.kind == "revolute":
            sign = _parallel_sign(at, joint)
            begins = sign == 0
            if begins:
                rotation = _AxisRotation(
                    joint.axis, value, _round_rotation(rotation_about(joint.axis, offset))
                )
            else:
                angle = tuple(_snap(a + sign * b) for a, b in zip(at.angle, value, strict=True))
                rotation = at._replace(angle=angle) @ rotation_about(joint.axis, offset)
        yield JointStep(joint, before, at, begins, rotation, value, offset)


def _parallel_sign(rotation: _AxisRotation, joint: Joint) -> int:
    """Return 1 or -1 for a joint parallel or antiparallel to the axis of a rotation, else 0."""
    cosine = dot(rotation.inner.rotate(joint.axis), rotation.axis)
    pairs = zip(rotation.inner.rotate(joint.axis), rotation.axis, strict=True)
    across = max(abs(a - cosine * b) for a, b in pairs)
    return 0 if across > PARALLEL_TOLERANCE else round(cosine)


def _round_rotation(rotation: Transform) -> Transform:
    """Return a constant rotation with entries of exactly 0 or 1 where they are within rounding of these."""
    x, y, z = (tuple(map(_snap, row)) for row in rotation.rotation)
    return Transform((x, y, z))  # type: ignore[arg-type]


def _snap(value: float) -> float:
    return float(round(value)) if abs(value - round(value)) < MAX_ROUNDING else value


@dataclass(frozen=True, eq=False)
class Variables:
    """The variables of an open form; their order is that of the exponents in a monomial.

    Attributes:
        ring: The polynomials in them, with floats as coefficients.
        angles: The angles whose cosine and sine are variables, first in the order; signs so that the first
            factor is positive.
        slides: Coordinates that are variables themselves, in [m], by index; next in the order.
        coordinates: The number of coordinates; next q', then q'' of each, then the wrench.
        parallel: Pairs of angles about the same axis, whose difference is one of `angles`.
    """

    ring: Any
    angles: tuple[Angle, ...]
    slides: tuple[int, ...]
    coordinates: int
    parallel: tuple[tuple[Angle, Angle], ...] = ()

    @property
    def shape(self) -> int:
        """The number of variables of the pose; the variables of motion and wrench follow."""
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

    def vector(self, values: Vector) -> Triple:
        """Return a constant vector."""
        return [self.constant(x) for x in values]

    def matrix(self, rows: Sequence[Vector]) -> Matrix:
        """Return a constant matrix."""
        return [self.vector(row) for row in rows]

    def cosine_sine(self, angle: Angle) -> tuple[Polynomial, Polynomial]:
        """Return cos and sin of an angle; of an angle without coordinates the constants 1 and 0."""
        if not any(angle):
            return self.constant(1.0), self.constant(0.0)
        sign, known = _normalise_sign(angle)
        k = 2 * self.angles.index(known)
        return self.ring.gens[k], self.constant(sign) * self.ring.gens[k + 1]

    def slide(self, coordinate: int) -> Polynomial:
        """Return the variable of a prismatic coordinate, in [m]."""
        return self.ring.gens[2 * len(self.angles) + self.slides.index(coordinate)]

    def value(self, factors: Angle, offset: float) -> Polynomial:
        """Return the value of a prismatic joint, in [m]."""
        value = self.constant(offset)
        for k, factor in enumerate(factors):
            if factor:
                value += self.constant(factor) * self.slide(k)
        return value

    def rate(self, factors: Angle) -> Polynomial:
        """Return the rate of a joint, in [rad/s] or [m/s]."""
        return self.sum(self.constant(f) * rate for f, rate in zip(factors, self.rates, strict=True) if f)

    def sum(self, polynomials: Iterable[Polynomial], of_masses: bool = False) -> Polynomial:
        """Return the sum of polynomials, without coefficients that rounding leaves of sums that cancel.

        Args:
            polynomials: The summands.
            of_masses: Whether each is of another mass, however small: a coefficient is compared
                with its summands, else with all of the same rates, accelerations and wrench.
        """
        sums: dict[Monomial, Any] = {}
        largest: dict[Monomial, Any] = {}
        begin = 0 if of_masses else self.shape
        for polynomial in polynomials:  # in place: SymPy copies a sum for each part that it adds
            for key, coefficient in polynomial.items():
                sums[key] = sums[key] + coefficient if key in sums else coefficient
                largest[key[begin:]] = max(largest.get(key[begin:], 0.0), abs(coefficient))
        limits = ((key, value, NEGLIGIBLE_SUM * largest[key[begin:]]) for key, value in sums.items())
        return self.ring.from_dict({key: value for key, value, limit in limits if abs(value) > limit})

    def dot(self, a: Iterable[Polynomial], b: Iterable[Polynomial]) -> Polynomial:
        """Return the sum of the products of the elements of two vectors."""
        pairs = zip(a, b, strict=True)
        return self.sum(y.mul_term(part) for x, y in pairs for part in x.terms())

    def multiply(self, matrix: Matrix, vector: Sequence[Polynomial]) -> Triple:
        """Return a matrix times a vector."""
        return [self.dot(row, vector) for row in matrix]

    def derivative(self, polynomial: Polynomial, coordinate: int) -> Iterator[Polynomial]:
        """Yield the parts of a partial derivative: of cos(m q + ...) it is -m sin, of sin m cos."""
        for k, angle in enumerate(self.angles):
            if angle[coordinate]:
                c, s = self.ring.gens[2 * k : 2 * k + 2]
                factor = self.constant(angle[coordinate])
                yield factor * polynomial.diff(s) * c
                yield -factor * polynomial.diff(c) * s
        if coordinate in self.slides:
            yield polynomial.diff(self.slide(coordinate))

    def by_motion(self, polynomial: Polynomial) -> dict[Monomial, Polynomial]:
        """Return the parts with equal products of rates, accelerations and wrench, by their exponents."""
        parts: dict[Monomial, dict[Monomial, Any]] = {}
        for key, coefficient in polynomial.items():
            parts.setdefault(key[self.shape :], {})[key] = coefficient
        return {motion: self.ring.from_dict(part) for motion, part in parts.items()}


def _normalise_sign(angle: Angle) -> tuple[float, Angle]:
    """Return the sign of the first factor that is not 0, and the angle times it."""
    sign = 1.0 if next(filter(None, angle)) > 0.0 else -1.0
    return sign, tuple(sign * factor + 0.0 for factor in angle)  # + 0.0: no -0.0


def _subtract_angles(first: Angle, second: Angle) -> Angle:
    """Return the second angle minus the first."""
    return tuple(b - a for a, b in zip(first, second, strict=True))


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
    steps = [*iter_joint_steps(chain)]
    pairs = [*dict.fromkeys(_parallel_angles(steps))]
    rotations = [step.after.angle for step in steps] + [_subtract_angles(*pair) for pair in pairs]
    angles = dict.fromkeys(_normalise_sign(angle)[1] for angle in rotations if any(angle))
    sliding = {k for step in steps if step.joint.kind == "prismatic" for k, f in enumerate(step.value) if f}
    slides, count = tuple(sorted(sliding)), len(chain.coordinates)
    names = [f"{kind}{k}" for k in range(len(angles)) for kind in ("c", "s")]
    names += [f"q{k}" for k in slides] + [f"{kind}{k}" for kind in ("u", "a") for k in range(count)]
    return Variables(ring([*names, *WRENCH], RR)[0], tuple(angles), slides, count, tuple(pairs))


def _parallel_angles(steps: Sequence[JointStep]) -> Iterator[tuple[Angle, Angle]]:
    """Yield the pairs of different angles about the same axis, without angles that are always 0."""
    group: list[Angle] = []
    for step in steps:
        angle = step.after.angle
        if step.begins:
            group = []
        if any(angle) and angle not in group:
            yield from ((earlier, angle) for earlier in group)
            group.append(angle)


class _Body(NamedTuple):
    """Body that a joint moves: rotation and origin [m] in the base, omega [rad/s] in its axes."""

    step: JointStep
    rotation: Matrix
    origin: Triple
    omega: Triple


def _iter_bodies(chain: Chain, variables: Variables) -> Iterator[_Body]:
    """Yield the body that each joint moves, from the base outwards.

    T_1i = A_1 A_2 ... A_i, and omega_i = B_i^T (omega_(i-1) + (0, 0, theta_i')^T), here about any axis.
    Joints with parallel axes are one A with the sum of their angles.

    Source: [Iso9283]_ eq. 8 and 12.
    """
    base = variables.matrix(Transform().rotation)  # the frame in which the current A begins, and its origin
    base_origin = omega = origin = variables.vector(ZERO)  # omega and origin in the axes of that frame
    for step in iter_joint_steps(chain):
        shift = variables.vector(step.joint.origin.translation)
        origin = _shift(origin, _rotation(step.before, variables), shift, variables)
        if step.begins:
            omega = _propagate_omega(step.at, omega, variables)
            base_origin = _shift(base_origin, base, origin, variables)
            base = _matrix_product(base, _rotation(step.at, variables), variables)
            origin = variables.vector(ZERO)
        rotation = _rotation(step.after, variables)
        if step.joint.kind == "prismatic":
            value = variables.value(step.value, step.offset)
            slide = [variables.constant(x) * value for x in step.joint.axis]
            origin = _shift(origin, rotation, slide, variables)
        yield _Body(
            step,
            _matrix_product(base, rotation, variables),
            _shift(base_origin, base, origin, variables),
            _propagate_omega(step.after, omega, variables),
        )


def _rotation(rotation: _AxisRotation, variables: Variables) -> Matrix:
    """Return Rot(axis, angle) inner: c 1 + s [a]x + (1 - c) a a^T of a unit vector a, times a constant."""
    c, s = variables.cosine_sine(rotation.angle)
    axis = x, y, z = rotation.axis
    skew = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
    rows = [
        [
            c * variables.constant(float(i == k) - axis[i] * axis[k])
            + s * variables.constant(skew[i][k])
            + variables.constant(axis[i] * axis[k])
            for k in range(3)
        ]
        for i in range(3)
    ]
    return _matrix_product(rows, variables.matrix(rotation.inner.rotation), variables)


def _matrix_product(a: Matrix, b: Matrix, variables: Variables) -> Matrix:
    return [[variables.dot(row, column) for column in zip(*b, strict=True)] for row in a]


def _shift(origin: Triple, rotation: Matrix, shift: Triple, variables: Variables) -> Triple:
    """Return origin + rotation shift."""
    return [variables.sum(pair) for pair in zip(origin, variables.multiply(rotation, shift), strict=True)]


def _propagate_omega(rotation: _AxisRotation, omega: Triple, variables: Variables) -> Triple:
    """Return the angular velocity after a rotation, in the axes of the rotated body."""
    rate = variables.rate(rotation.angle)
    added = [
        variables.sum((x, variables.constant(a) * rate)) for x, a in zip(omega, rotation.axis, strict=True)
    ]
    return [variables.dot(column, added) for column in zip(*_rotation(rotation, variables), strict=True)]


class Energies(NamedTuple):
    """Energies and power of Lagrange's equations.

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

    All in the axes of the base, to which gravity and wrench are rotated.

    Args:
        chain: The arm, with masses.
        variables: Those of the arm.

    Source: [Iso9283]_ eq. 8-12.
    """
    world = _round_rotation(Transform(chain.base.columns))  # from the world's axes to the base's
    bodies = {body.step.joint.name: body for body in _iter_bodies(chain, variables)}
    masses = [
        (bodies[inertial.joint], inertial) for inertial in chain.inertials if inertial.joint is not None
    ]
    gravity = world.rotate(chain.gravity)
    kinetic = variables.sum((_kinetic(*pair, variables) for pair in masses), of_masses=True)
    potential = variables.sum((_potential(*pair, gravity, variables) for pair in masses), of_masses=True)
    tool = _point(bodies[chain.joints[-1].name], (chain.tip @ chain.tool).translation, variables)
    rotation = variables.matrix(world.rotation)
    force, moment = (
        variables.multiply(rotation, part) for part in (variables.wrench[:3], variables.wrench[3:])
    )
    motion = [*_velocity(tool, variables), *_tool_omega([*bodies.values()], variables)]
    return Energies(kinetic, potential, variables.dot([*force, *moment], motion))


def _kinetic(body: _Body, inertial: Inertial, variables: Variables) -> Polynomial:
    """Return 1/2 m v^2 + 1/2 omega^T I omega of a mass, in [J]."""
    velocity = _velocity(_point(body, inertial.centre, variables), variables)
    spin = variables.multiply(variables.matrix(inertial.matrix), body.omega)
    momenta = [*(variables.constant(inertial.mass) * x for x in velocity), *spin]
    return variables.constant(0.5) * variables.dot(momenta, [*velocity, *body.omega])


def _potential(body: _Body, inertial: Inertial, gravity: Vector, variables: Variables) -> Polynomial:
    """Return -m g^T r of a mass, in [J]."""
    weight = [variables.constant(-inertial.mass * x) for x in gravity]
    return variables.dot(weight, _point(body, inertial.centre, variables))


def _point(body: _Body, point: Vector, variables: Variables) -> Triple:
    """Return a point in [m] of a body, in the base [m]."""
    return _shift(body.origin, body.rotation, variables.vector(point), variables)


def _velocity(point: Triple, variables: Variables) -> Triple:
    """Return dr/dt = sum_j (dr/dq_j) q_j', in [m/s]. Source: [Iso9283]_ eq. 9-11, by differentiation."""
    return [
        variables.sum(
            part * rate for j, rate in enumerate(variables.rates) for part in variables.derivative(x, j)
        )
        for x in point
    ]


def _tool_omega(bodies: Sequence[_Body], variables: Variables) -> Triple:
    """Return the angular velocity of the last body, in the base: the sum of each joint's rate on its axis."""
    revolute = [body for body in bodies if body.step.joint.kind == "revolute"]
    axes = [variables.multiply(body.rotation, variables.vector(body.step.joint.axis)) for body in revolute]
    rates = [variables.rate(body.step.value) for body in revolute]
    return [variables.dot([axis[k] for axis in axes], rates) for k in range(3)]


def equations(energies: Energies, variables: Variables) -> list[Equation]:
    """Return the terms of each coordinate's equation, whose sum is the torque of its drive.

    tau_i = d/dt dT/dq_i' - dT/dq_i + dU/dq_i - dP/dq_i'. Its parts are inertia: with a q_j''; centrifugal:
    with a q_j'^2; Coriolis: with a q_j' q_k'; gravity: dU/dq_i; tool: -dP/dq_i', which is -(J^T F)_i, with
    the power P of a wrench F that acts on the tool from outside.

    Source: [Iso9283]_ eq. 13, whose F is the opposite: the force that the tool exerts.
    """
    return [_equation(energies, variables, i) for i in range(variables.coordinates)]


def _equation(energies: Energies, variables: Variables, i: int) -> Equation:
    rates = variables.rates
    momentum = energies.kinetic.diff(rates[i])
    inertia = variables.dot(map(momentum.diff, rates), variables.accelerations)
    changes = [part * rate for j, rate in enumerate(rates) for part in variables.derivative(momentum, j)]
    slopes = [-part for part in variables.derivative(energies.kinetic, i)]
    velocity_parts = variables.by_motion(variables.sum([*changes, *slopes]))
    centrifugal, coriolis = (
        variables.sum(part for motion, part in velocity_parts.items() if (max(motion) == 2) == is_square)
        for is_square in (True, False)
    )
    return {
        "inertia": inertia,
        "centrifugal": centrifugal,
        "coriolis": coriolis,
        "gravity": variables.sum(variables.derivative(energies.potential, i)),
        "tool": -energies.power.diff(rates[i]),
    }


class _Identity(NamedTuple):
    """A product of two variables, by their indices, and a polynomial equal to it."""

    first: int
    second: int
    equal: Polynomial


def simplify_polynomial(polynomial: Polynomial, variables: Variables) -> Polynomial:
    """Return a polynomial with a shorter factor of each product of rates, accelerations and wrench.

    For each angle s^2 = 1 - c^2 and c^2 = 1 - s^2, for angles a and b about the same axis
    cos b cos a + sin b sin a = cos(b - a) and sin b cos a - cos b sin a = sin(b - a): each is substituted
    where it leaves fewer monomials.

    Args:
        polynomial: The polynomial.
        variables: Its variables.
    """
    identities = [*_difference_identities(variables), *_square_identities(variables)]
    parts = variables.by_motion(polynomial).values()
    return variables.sum(_shorten(part, identities, variables) for part in parts)


def _shorten(polynomial: Polynomial, identities: Sequence[_Identity], variables: Variables) -> Polynomial:
    """Return a polynomial after substitutions until no identity leaves fewer monomials."""
    length = len(polynomial) + 1
    while len(polynomial) < length:
        length = len(polynomial)
        for identity in identities:
            polynomial = min(polynomial, variables.sum(_substitute(polynomial, identity)), key=len)
    return polynomial


def _substitute(polynomial: Polynomial, identity: _Identity) -> Iterator[Polynomial]:
    """Yield the parts of a polynomial with the product of an identity replaced."""
    i, j, equal = identity
    for key, coefficient in polynomial.items():
        times = key[i] // 2 if i == j else min(key[i], key[j])
        rest = [*key]
        rest[i] -= times
        rest[j] -= times
        yield (equal**times).mul_term((tuple(rest), coefficient))


def _square_identities(variables: Variables) -> Iterator[_Identity]:
    for k in range(0, 2 * len(variables.angles), 2):
        c, s = variables.ring.gens[k : k + 2]
        yield _Identity(k + 1, k + 1, 1 - c**2)
        yield _Identity(k, k, 1 - s**2)


def _difference_identities(variables: Variables) -> Iterator[_Identity]:
    for a, b in variables.parallel:
        (ca, sa), (cb, sb), (c, s) = map(variables.cosine_sine, (a, b, _subtract_angles(a, b)))
        (sign_a, known_a), (sign_b, known_b) = _normalise_sign(a), _normalise_sign(b)
        i, j = (2 * variables.angles.index(known) for known in (known_a, known_b))
        yield _Identity(j + 1, i + 1, (c - cb * ca) * (sign_a * sign_b))
        yield _Identity(j, i, c - sb * sa)
        yield _Identity(j + 1, i, (s + cb * sa) * sign_b)
        yield _Identity(j, i + 1, (sb * ca - s) * sign_a)
