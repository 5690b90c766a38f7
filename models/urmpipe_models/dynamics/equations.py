"""Inverse dynamics: the torques that a motion needs, by the recursion of Newton and Euler.

Joints and bodies of an arm in one frame: the origin of its first link, the axes of the world.

A joint's rate q' moves all that it carries by the field v(r) = q' (z x r + v); a body answers to any field
a(r) = G r + b with forces that its mass, its moment h and its second moments S = sum m r r^T give:

    sum m a = G h + m b        sum m r x a = sum over k of e_k x (G S + b h^T) e_k

The mass matrix of an arm.

Forward dynamics: the motion that torques make.

The torques of a motion, term by term.

Torques, their terms, energies and mass centres over the rows of a log.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics.links import (
    Link,
    Links,
    Symmetric,
    Wrench,
    centres_of_mass,
    chain_to_links,
    kinetic_energy,
    potential_energy,
    rotate_inertia,
    sum_symmetric,
)
from urmpipe_models.elementwise import (
    THREADS,
    ZERO,
    Element,
    FloatArray,
    Vector,
    add,
    cross,
    dot,
    map_blocks,
    minus,
    plus,
    row_blocks,
    scale,
    subtract,
    times,
)
from urmpipe_models.errors import RobotError
from urmpipe_models.kinematics.forward import apply_joint, joint_values
from urmpipe_models.math3d import Transform


class LinkPoses(NamedTuple):
    """The moving parts of an arm in a pose.

    Attributes:
        chain: The arm.
        arm: Its moving parts.
        frames: The moving frame of each link in that of the link before it, the first one's in the base.
    """

    chain: Chain
    arm: Links
    frames: Sequence[Transform]


def inverse_dynamics(
    chain: Chain,
    q: Sequence[Element],
    qd: Sequence[Element],
    qdd: Sequence[Element],
    wrench: Wrench | None = None,
) -> list[Element]:
    """Return the torques that the joints must give for a motion.

    Outward, in the frame of each link: omega, alpha and a as in `kinematics.motion`, a of the base being -g.
    Inward: f = m a + alpha x h + omega x (omega x h), n = I alpha + omega x I omega + h x a, with what the
    next link needs; a joint that turns gives z . n, one that slides z . f. A mimic's counts with its
    multiplier towards the joint that it follows.

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].
        qdd: Their second derivatives, in [rad/s2] or [m/s2].
        wrench: What acts on the tool centre point from outside.

    Returns:
        One element per coordinate, in [N.m] of a joint that turns, in [N] of one that slides.

    Raises:
        RobotError: If the arm has no masses.

    Source: [Iso9283]_ eq. 13, by the algorithm of [Luh1980]_.
    """
    return inverse_dynamics_at(compute_link_poses(chain, q), qd, qdd, wrench)


def inverse_dynamics_at(
    posed: LinkPoses, qd: Sequence[Element], qdd: Sequence[Element], wrench: Wrench | None = None
) -> list[Element]:
    """Return `inverse_dynamics` of an arm in a pose."""
    chain, arm, frames = posed
    forces = _link_forces(posed, qd, qdd)
    if wrench is not None:
        forces[-1] = _less_tool(posed, forces[-1], wrench)
    torques: list[Element] = [0.0] * len(chain.coordinates)
    force, moment = ZERO, ZERO
    for link, frame, (own_force, own_moment) in zip(
        reversed(arm.links), reversed(frames), reversed(forces), strict=True
    ):
        force, moment = add(force, own_force), add(moment, own_moment)
        along = dot(link.joint.axis, moment if link.joint.kind == "revolute" else force)
        torques[link.coordinate] = plus(torques[link.coordinate], times(link.multiplier, along))
        if link is not arm.links[0]:  # nothing is wanted of what the base holds
            force = frame.rotate(force)
            moment = add(frame.rotate(moment), cross(frame.translation, force))
    return torques


def compute_link_poses(chain: Chain, q: Sequence[Element], arm: Links | None = None) -> LinkPoses:
    """Return the moving parts of an arm in a pose.

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].
        arm: Its moving parts, where they are known.

    Raises:
        RobotError: If the arm has no masses.
    """
    arm = arm or chain_to_links(chain)
    values = dict(zip((joint.name for joint in chain.joints), joint_values(chain, q), strict=True))
    frames = [apply_joint(link.joint.origin, link.joint, values[link.joint.name]) for link in arm.links]
    return LinkPoses(chain, arm, frames)


def _link_forces(
    posed: LinkPoses, qd: Sequence[Element], qdd: Sequence[Element]
) -> list[tuple[Vector, Vector]]:
    """Return the force on each link and its moment about the origin of the link's frame."""
    chain, arm, frames = posed
    omega, alpha = ZERO, ZERO
    a = Transform(chain.base.columns).rotate(scale(-1.0, chain.gravity))
    found = []
    for link, frame in zip(arm.links, frames, strict=True):
        back = Transform(frame.columns)
        a = add(a, _carried(omega, alpha, frame.translation))
        omega, alpha, a = back.rotate(omega), back.rotate(alpha), back.rotate(a)
        rate = scale(times(link.multiplier, qd[link.coordinate]), link.joint.axis)
        second = scale(times(link.multiplier, qdd[link.coordinate]), link.joint.axis)
        if link.joint.kind == "revolute":
            alpha = add(alpha, add(second, cross(omega, rate)))
            omega = add(omega, rate)
        else:
            a = add(a, add(second, scale(2.0, cross(omega, rate))))
        found.append(_needed(link, omega, alpha, a))
    return found


def _carried(omega: Vector, alpha: Vector, d: Vector) -> Vector:
    """Return alpha x d + omega x (omega x d)."""
    return add(cross(alpha, d), cross(omega, cross(omega, d)))


def _needed(link: Link, omega: Vector, alpha: Vector, a: Vector) -> tuple[Vector, Vector]:
    """Return the force and the moment about its origin that a link's motion needs."""
    inertia = Transform(link.inertia)
    force = add(scale(link.mass, a), _carried(omega, alpha, link.moment))
    spin = add(inertia.rotate(alpha), cross(omega, inertia.rotate(omega)))
    return force, add(spin, cross(link.moment, a))


def _less_tool(posed: LinkPoses, needed: tuple[Vector, Vector], wrench: Wrench) -> tuple[Vector, Vector]:
    """Return what the last link still needs where a wrench acts on the tool."""
    chain, arm, frames = posed
    force, moment = wrench
    for frame in (chain.base, *frames):
        back = Transform(frame.columns)
        force, moment = back.rotate(force), back.rotate(moment)
    moment = add(moment, cross(arm.tool.translation, force))
    return subtract(needed[0], force), subtract(needed[1], moment)


@dataclass(frozen=True, slots=True)
class SpatialField:
    """A field of velocity or acceleration of a rigid body: G r + b.

    Attributes:
        gradient: The rows of G, in [1/s] or [1/s2].
        offset: b, in [m/s] or [m/s2].
    """

    gradient: tuple[Vector, Vector, Vector] = (ZERO, ZERO, ZERO)
    offset: Vector = ZERO

    def __add__(self, other: SpatialField) -> SpatialField:
        """Return the sum of two fields."""
        rows = zip(self.gradient, other.gradient, strict=True)
        x, y, z = (add(*pair) for pair in rows)
        return SpatialField((x, y, z), add(self.offset, other.offset))

    def scaled(self, factor: Element) -> SpatialField:
        """Return the field times a factor."""
        x, y, z = (scale(factor, row) for row in self.gradient)
        return SpatialField((x, y, z), scale(factor, self.offset))

    def after(self, other: SpatialField) -> SpatialField:
        """Return G (G' r + b'): how this motion turns the velocities of another."""
        turn = Transform(self.gradient)
        return SpatialField((turn @ Transform(other.gradient)).rotation, turn.rotate(other.offset))


@dataclass(frozen=True, slots=True)
class SpatialInertia:
    """Masses, about the common origin in the axes of the world.

    Attributes:
        mass: m in [kg].
        moment: h = sum m r in [kg.m].
        second: S = sum m r r^T in [kg.m2].
    """

    mass: Element = 0.0
    moment: Vector = ZERO
    second: Symmetric = (ZERO, ZERO, ZERO)

    def __add__(self, other: SpatialInertia) -> SpatialInertia:
        """Return both bodies as one."""
        return SpatialInertia(
            plus(self.mass, other.mass),
            add(self.moment, other.moment),
            sum_symmetric(self.second, other.second),
        )


@dataclass(frozen=True, slots=True)
class SpatialForce:
    """A force in [N] and its moment about the common origin in [N.m], along the axes of the world."""

    force: Vector = ZERO
    moment: Vector = ZERO

    def __add__(self, other: SpatialForce) -> SpatialForce:
        """Return the sum of two forces."""
        return SpatialForce(add(self.force, other.force), add(self.moment, other.moment))


@dataclass(frozen=True, slots=True)
class MovingLink:
    """A joint and what it carries.

    Attributes:
        coordinate: Index of the coordinate that the joint follows.
        turns: Whether it turns; else it slides.
        axis: z of a joint that turns, 0 of one that slides, times its multiplier [-].
        slide: v: what the velocity at the common origin is per unit of the coordinate, in [m] or [-].
        body: What it carries.
    """

    coordinate: int
    turns: bool
    axis: Vector
    slide: Vector
    body: SpatialInertia

    def field(self, rate: Element) -> SpatialField:
        """Return the velocities of all that the joint carries, of a rate of the coordinate."""
        x, y, z = scale(rate, self.axis)
        skew = ((0.0, minus(0.0, z), y), (z, 0.0, minus(0.0, x)), (minus(0.0, y), x, 0.0))
        return SpatialField(skew, scale(rate, self.slide))

    def torque(self, force: SpatialForce) -> Element:
        """Return what a force on all that the joint carries is for its coordinate, in [N.m] or [N]."""
        return plus(dot(self.axis, force.moment), dot(self.slide, force.force))


def moving_links(posed: LinkPoses) -> tuple[list[MovingLink], Vector]:
    """Return the moving joints and bodies of an arm from the base outwards, and where its tool is [m]."""
    chain, arm, (first, *others) = posed
    found, pose = [], Transform(chain.base.rotation)
    for link, frame in zip(arm.links, (Transform(first.rotation), *others), strict=True):
        pose = pose @ frame
        along = scale(link.multiplier, pose.rotate(link.joint.axis))
        turns = link.joint.kind == "revolute"
        axis, slide = (along, cross(pose.translation, along)) if turns else (ZERO, along)
        body = _placed(pose, link.mass, link.moment, _second_moments(link.inertia))
        found.append(MovingLink(link.coordinate, turns, axis, slide, body))
    return found, pose.point(arm.tool.translation)


def inertial_force(body: SpatialInertia, field: SpatialField) -> SpatialForce:
    """Return the force and moment that give a body accelerations G r + b in [m/s2].

    See the formulas of this module.

    Args:
        body: The body.
        field: G in [1/s2] and b in [m/s2].
    """
    b, (hx, hy, hz) = field.offset, body.moment
    turn = Transform(field.gradient)
    rows = (turn @ Transform(body.second)).rotation
    (_, xy, xz), (yx, _, yz), (zx, zy, _) = (
        add(row, (times(b[k], hx), times(b[k], hy), times(b[k], hz))) for k, row in enumerate(rows)
    )
    force = add(turn.rotate(body.moment), scale(body.mass, b))
    return SpatialForce(force, (minus(zy, yz), minus(xz, zx), minus(yx, xy)))


def _second_moments(inertia: Symmetric) -> Symmetric:
    """Return S = tr(I) / 2 1 - I of an inertia about the same point, in [kg.m2]."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia
    half = scale(0.5, (minus(plus(yy, zz), xx), minus(plus(xx, zz), yy), minus(plus(xx, yy), zz)))
    xy, xz, yz = minus(0.0, xy), minus(0.0, xz), minus(0.0, yz)
    return (half[0], xy, xz), (xy, half[1], yz), (xz, yz, half[2])


def _placed(pose: Transform, mass: Element, moment: Vector, second: Symmetric) -> SpatialInertia:
    """Return a body that is given in a frame: S' = R S R^T + R h p^T + p (R h)^T + m p p^T."""
    p, own = pose.translation, pose.rotate(moment)
    moment = add(own, scale(mass, p))  # R h + m p
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = rotate_inertia(pose, second)

    def shifted(value: Element, i: int, k: int) -> Element:
        """Return an entry of S': (R h)_i p_k + p_i (R h + m p)_k are added."""
        return plus(value, plus(times(own[i], p[k]), times(p[i], moment[k])))

    xy, xz, yz = shifted(xy, 0, 1), shifted(xz, 0, 2), shifted(yz, 1, 2)
    return SpatialInertia(
        mass, moment, ((shifted(xx, 0, 0), xy, xz), (xy, shifted(yy, 1, 1), yz), (xz, yz, shifted(zz, 2, 2)))
    )


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
    return mass_matrix_at(compute_link_poses(chain, q))


def mass_matrix_at(posed: LinkPoses) -> list[list[Element]]:
    """Return `mass_matrix` of an arm in a pose."""
    links, _ = moving_links(posed)
    count = len(posed.chain.coordinates)
    matrix: list[list[Element]] = [[0.0] * count for _ in range(count)]
    beyond = SpatialInertia()
    for j in reversed(range(len(links))):
        beyond += links[j].body
        force = inertial_force(beyond, links[j].field(1.0))
        for i in range(j + 1):
            entry, row, column = links[i].torque(force), links[i].coordinate, links[j].coordinate
            matrix[row][column] = plus(matrix[row][column], entry)
            if i != j:
                matrix[column][row] = plus(matrix[column][row], entry)
    return matrix


def mass_matrix_scales(chain: Chain, q: Sequence[Element]) -> list[Element]:
    """Return what the masses that each coordinate moves could make its entry of M, wherever its axes are.

    |z|^2 times the trace of their second moments about the common origin (see `screws`) of a joint that
    turns, |v|^2 times their mass of one that slides: what the rounding of M counts from.

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].

    Returns:
        One element per coordinate, in [kg.m2] or [kg].
    """
    links, _ = moving_links(compute_link_poses(chain, q))
    sizes: list[Element] = [0.0] * len(chain.coordinates)
    beyond = SpatialInertia()
    for link in reversed(links):
        beyond += link.body
        (xx, _, _), (_, yy, _), (_, _, zz) = beyond.second
        turning = times(dot(link.axis, link.axis), plus(plus(xx, yy), zz))
        size = turning if link.turns else times(dot(link.slide, link.slide), beyond.mass)
        sizes[link.coordinate] = plus(sizes[link.coordinate], size)
    return sizes


POSES = 3
"""A pivot of M that is 0 in so many poses at random is 0 in all."""

NO_MASS = 1e-12
"""A pivot of M below this share of what the masses beyond could make it is 0 but for rounding."""


def forward_dynamics(
    chain: Chain,
    q: Sequence[Element],
    qd: Sequence[Element],
    tau: Sequence[Element],
    wrench: Wrench | None = None,
    arm: Links | None = None,
) -> list[Element]:
    """Return q'' = M^-1 (tau - tau_0), tau_0 being what the motion needs without q''.

    Args:
        chain: The arm; each joint moves a mass (see `check_motion`).
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].
        tau: Torques of the joints in [N.m], forces of those that slide in [N].
        wrench: What acts on the tool centre point from outside.
        arm: Its moving parts, where they are known.

    Returns:
        One element per coordinate, in [rad/s2] or [m/s2].

    Raises:
        RobotError: If the arm has no masses.

    Source: [Iso9283]_ eq. 19, solved for the accelerations.
    """
    posed = compute_link_poses(chain, q, arm)
    needed = inverse_dynamics_at(posed, qd, [0.0] * len(q), wrench)
    left = [minus(given, other) for given, other in zip(tau, needed, strict=True)]
    return solve_ldl(mass_matrix_at(posed), left)


def solve_ldl(matrix: Sequence[Sequence[Element]], right: Sequence[Element]) -> list[Element]:
    """Return x of M x = b for a symmetric positive definite M, by M = L D L^T, elementwise.

    Args:
        matrix: The rows of M, in any units.
        right: b.
    """
    lower, pivots = factor_ldl(matrix)
    x: list[Element] = list(right)
    for i in range(len(x)):
        for k in range(i):
            x[i] = minus(x[i], times(lower[i][k], x[k]))
    x = [value / pivot for value, pivot in zip(x, pivots, strict=True)]
    for i in reversed(range(len(x))):
        for k in range(i + 1, len(x)):
            x[i] = minus(x[i], times(lower[k][i], x[k]))
    return x


def factor_ldl(matrix: Sequence[Sequence[Element]]) -> tuple[list[list[Element]], list[Element]]:
    """Return L below its diagonal of ones, and the pivots D, of a symmetric M = L D L^T."""
    lower: list[list[Element]] = []
    pivots: list[Element] = []
    for i, given in enumerate(matrix):
        row: list[Element] = []  # of L D, then of L
        for j in range(i):
            value = given[j]
            for k in range(j):
                value = minus(value, times(row[k], lower[j][k]))
            row.append(value)
        pivot = given[i]
        for j in range(i):
            scaled, row[j] = row[j], row[j] / pivots[j]
            pivot = minus(pivot, times(scaled, row[j]))
        lower.append(row)
        pivots.append(pivot)
    return lower, pivots


def check_solvable(chain: Chain) -> None:
    """Refuse an arm whose motion cannot be solved: no inertia resists a joint's own motion.

    Raises:
        RobotError: If the arm has no masses, or with the name of every joint whose pivot of M is 0 in poses
            at random, or else at the start pose.
    """
    poses = np.random.default_rng(0).uniform(-1.0, 1.0, (len(chain.coordinates), POSES))
    start = np.array(chain.start, dtype=np.float64)[:, np.newaxis]
    for where, some in (("", poses), ("at its start pose ", start)):
        faults = [
            f"robot {chain.name}: joint {name}: {where}no inertia resists its own motion, so that it cannot"
            " be solved; allowed: an inertial that only this joint moves"
            for name in _without_inertia(chain, list(some))
        ]
        if faults:
            raise RobotError(*faults)


def _without_inertia(chain: Chain, q: Sequence[FloatArray]) -> Iterator[str]:
    """Yield the coordinates whose motion needs nothing, whatever the joints before do; those are left out.

    A pivot counts as 0 below NO_MASS of what the masses would have about the common origin.

    Args:
        chain: The arm, with masses.
        q: Some poses in [rad] or [m], an array a coordinate.
    """
    count = len(q[0])
    matrix = [[np.broadcast_to(entry, count) for entry in row] for row in mass_matrix(chain, q)]
    sizes = mass_matrix_scales(chain, q)
    kept: list[int] = []
    for i, name in enumerate(chain.coordinates):
        own = [*kept, i]
        *_, pivot = factor_ldl([[matrix[row][column] for column in own] for row in own])[1]
        if np.max(pivot - NO_MASS * sizes[i]) <= 0.0:
            yield name
        else:
            kept.append(i)


class TorqueTerms(NamedTuple):
    """What makes the torques of the joints, one element per coordinate each, in [N.m] or [N].

    Attributes:
        inertia: Of the accelerations q''.
        centrifugal: Of the squares of the rates q'.
        coriolis: Of the products of two rates.
        gravity: Of the weights.
        tool: Of what acts on the tool.
    """

    inertia: list[Element]
    centrifugal: list[Element]
    coriolis: list[Element]
    gravity: list[Element]
    tool: list[Element]


def torque_terms(
    chain: Chain,
    q: Sequence[Element],
    qd: Sequence[Element],
    qdd: Sequence[Element],
    wrench: Wrench | None = None,
) -> TorqueTerms:
    """Return the terms of the equations of motion, whose sum is `inverse_dynamics`.

    Each is a field of accelerations G r + b of what a joint m carries (see `screws`): inertia
    sum_j q_j'' W_j; centrifugal sum_j q_j'^2 W_j W_j; Coriolis 2 sum_(j < k) q_j' q_k' W_j W_k, all over the
    joints up to m; gravity -g. Two joints of one coordinate count as centrifugal: it is q'^2 that both have.

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].
        qdd: Their second derivatives, in [rad/s2] or [m/s2].
        wrench: What acts on the tool centre point from outside.

    Raises:
        RobotError: If the arm has no masses.

    Source: [Iso9283]_ eq. 13: D_1, D_2, D_(1+k), E and J^T F, the last with the sign of a force from outside.
    """
    links, place = moving_links(compute_link_poses(chain, q))
    inertia, centrifugal, coriolis = SpatialField(), SpatialField(), SpatialField()
    rates = [SpatialField() for _ in chain.coordinates]
    weight = SpatialField(offset=scale(-1.0, chain.gravity))
    forces: list[tuple[SpatialForce, ...]] = []
    for link in links:
        own, c = link.field(qd[link.coordinate]), link.coordinate
        inertia += link.field(qdd[c])
        centrifugal += own.after(own) + rates[c].after(own).scaled(2.0)
        for k, other in enumerate(rates):
            if k != c:
                coriolis += other.after(own).scaled(2.0)
        rates[c] += own
        fields = (inertia, centrifugal, coriolis, weight)
        forces.append(tuple(inertial_force(link.body, field) for field in fields))
    tool = [SpatialForce()] * len(links)
    if wrench is not None:
        tool[-1] = _against(wrench, place)
    terms = [*zip(*forces, strict=True), tool]
    return TorqueTerms(*(_torques(links, each, len(chain.coordinates)) for each in terms))


def _torques(links: Sequence[MovingLink], forces: Sequence[SpatialForce], count: int) -> list[Element]:
    """Return what each coordinate gives where every link needs a force."""
    torques: list[Element] = [0.0] * count
    beyond = SpatialForce()
    for link, force in zip(reversed(links), reversed(forces), strict=True):
        beyond += force
        torques[link.coordinate] = plus(torques[link.coordinate], link.torque(beyond))
    return torques


def _against(wrench: Wrench, place: Vector) -> SpatialForce:
    """Return what the last link needs against what acts on the tool at its place."""
    moment = add(wrench.moment, cross(place, wrench.force))
    return SpatialForce(scale(-1.0, wrench.force), scale(-1.0, moment))


def torques_over_log(
    chain: Chain, q: FloatArray, qd: FloatArray, qdd: FloatArray, threads: int = THREADS
) -> FloatArray:
    """Return the torques of the joints over a log, in [N.m] or [N], shape (n, joints).

    Args:
        chain: The arm, with masses.
        q: Joint values in [rad] or [m], shape (n, joints).
        qd: Their rates in [rad/s] or [m/s], shape (n, joints).
        qdd: Their second derivatives in [rad/s2] or [m/s2], shape (n, joints).
        threads: Blocks of rows worked on at a time.

    Raises:
        RobotError: If the arm has no masses.
    """
    return _over(
        lambda *columns: inverse_dynamics(chain, *columns), q.shape[1], q, qd, qdd, threads=threads
    ).T


def torque_terms_over_log(
    chain: Chain, q: FloatArray, qd: FloatArray, qdd: FloatArray
) -> dict[str, FloatArray]:
    """Return the terms of `torques_over_log` by name (see `TorqueTerms`), in [N.m] or [N].

    Args:
        chain: The arm, with masses.
        q: Joint values in [rad] or [m], shape (n, joints).
        qd: Their rates in [rad/s] or [m/s], shape (n, joints).
        qdd: Their second derivatives in [rad/s2] or [m/s2], shape (n, joints).

    Returns:
        inertia, centrifugal, coriolis, gravity and tool, in [N.m] or [N], shape (n, joints) each.
    """
    names, joints = TorqueTerms._fields, q.shape[1]
    flat = _over(
        lambda *columns: [one for term in torque_terms(chain, *columns) for one in term],
        len(names) * joints, q, qd, qdd,
    )  # fmt: skip
    return {name: flat[k * joints : (k + 1) * joints].T for k, name in enumerate(names)}


def energies_over_log(chain: Chain, q: FloatArray, qd: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the kinetic and the potential energy of an arm over a log, in [J], shape (n,) each.

    Args:
        chain: The arm, with masses.
        q: Joint values in [rad] or [m], shape (n, joints).
        qd: Their rates in [rad/s] or [m/s], shape (n, joints).
    """
    kinetic, potential = _over(
        lambda q, qd: [kinetic_energy(chain, q, qd), potential_energy(chain, q)], 2, q, qd
    )
    return kinetic, potential


def centres_of_mass_over_log(chain: Chain, q: FloatArray) -> FloatArray:
    """Return the mass centres of an arm in the world over a log, in [m], shape (n, inertials, 3).

    Args:
        chain: The arm, with masses.
        q: Joint values in [rad] or [m], shape (n, joints).
    """
    count = len(chain.inertials)
    flat = _over(lambda q: [one for centre in centres_of_mass(chain, q) for one in centre], 3 * count, q)
    return flat.T.reshape(len(q), count, 3)


def _over(
    work: Callable[..., Sequence[Element]], count: int, *rows: FloatArray, threads: int = THREADS
) -> FloatArray:
    """Return what work makes of the columns of some arrays of shape (n, joints), shape (count, n)."""
    found = np.empty((count, len(rows[0])))

    def fill(block: slice) -> None:
        """Fill the rows of a block."""
        columns = [list(np.ascontiguousarray(one[block].T, dtype=np.float64)) for one in rows]
        for k, element in enumerate(work(*columns)):
            found[k, block] = element

    map_blocks(fill, row_blocks(len(rows[0])), threads)
    return found
