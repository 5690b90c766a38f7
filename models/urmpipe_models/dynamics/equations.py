"""Equations of motion of an arm: torques from motion, motion from torques, mass matrix, terms; over a log.

1. `inverse_dynamics`: torques of a motion, by the recursion of Newton and Euler in the frames of the links
   ([Iso9283]_ eq. 13, [Luh1980]_).
2. Spatial quantities about one common origin, that of the first link, in world axes. A joint's rate q' gives
   all that it carries the velocities v(r) = q' (z x r + v). For the accelerations a(r) = G r + b a body needs
   a force and a moment that follow from its mass m, moment h and second moments S = sum m r r^T:

       sum m a = G h + m b        sum m r x a = sum over k of e_k x (G S + b h^T) e_k

3. `mass_matrix`: M of T = 1/2 q'^T M q', by composite bodies ([Walker1982]_).
4. `forward_dynamics`: q'' = M^-1 (tau - tau_0), by M = L D L^T (eq. 19). `check_solvable`: D > 0.
5. `torque_terms`: inertia, centrifugal, Coriolis, gravity and tool terms (eq. 13).
6. `torques_over_log` and other quantities over the rows of a log, in parallel blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics.links import (
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

SOLVABILITY_POSES = 3  # a pivot of M that is 0 in this number of random poses is 0 in all poses
NEGLIGIBLE_PIVOT = 1e-12  # share of the scale of M (`mass_matrix_scales`); below it a pivot is rounding


def inverse_dynamics(
    chain: Chain,
    q: Sequence[Element],
    qd: Sequence[Element],
    qdd: Sequence[Element],
    wrench: Wrench | None = None,
) -> list[Element]:
    """Return the joint torques that a motion needs.

    Outward, in the frame of each link: omega, alpha and a as in `kinematics.forward`, a of the base being -g.
    Inward: f = m a + alpha x h + omega x (omega x h), n = I alpha + omega x I omega + h x a, plus those of
    the next link; a revolute joint needs z . n, a prismatic one z . f. The torque of a mimic joint counts,
    times its multiplier, for the joint that it follows.

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].
        qdd: Their second derivatives, in [rad/s2] or [m/s2].
        wrench: External wrench on the tool centre point.

    Returns:
        One element per coordinate, in [N.m] of a revolute joint, in [N] of a prismatic one.

    Raises:
        RobotError: If the arm has no masses.

    Source: [Iso9283]_ eq. 13, by the algorithm of [Luh1980]_.
    """
    return _inverse_dynamics_at(_link_poses(chain, q), qd, qdd, wrench)


class _LinkPoses(NamedTuple):
    """An arm in a pose: the moving frame of each link in that of the previous one, the first in the base."""

    chain: Chain
    arm: Links
    frames: Sequence[Transform]


def _link_poses(chain: Chain, q: Sequence[Element], arm: Links | None = None) -> _LinkPoses:
    arm = arm or chain_to_links(chain)
    values = dict(zip((joint.name for joint in chain.joints), joint_values(chain, q), strict=True))
    frames = [apply_joint(link.joint.origin, link.joint, values[link.joint.name]) for link in arm.links]
    return _LinkPoses(chain, arm, frames)


def _inverse_dynamics_at(
    poses: _LinkPoses, qd: Sequence[Element], qdd: Sequence[Element], wrench: Wrench | None
) -> list[Element]:
    chain, arm, frames = poses
    loads = _link_loads(poses, qd, qdd)
    if wrench is not None:
        loads[-1] = _subtract_wrench(poses, loads[-1], wrench)
    torques: list[Element] = [0.0] * len(chain.coordinates)
    force, moment = ZERO, ZERO
    for link, frame, (link_force, link_moment) in zip(
        reversed(arm.links), reversed(frames), reversed(loads), strict=True
    ):
        force, moment = add(force, link_force), add(moment, link_moment)
        along = dot(link.joint.axis, moment if link.joint.kind == "revolute" else force)
        torques[link.coordinate] = plus(torques[link.coordinate], times(link.multiplier, along))
        if link is not arm.links[0]:  # the load on the base is not needed
            force = frame.rotate(force)
            moment = add(frame.rotate(moment), cross(frame.translation, force))
    return torques


def _link_loads(
    poses: _LinkPoses, qd: Sequence[Element], qdd: Sequence[Element]
) -> list[tuple[Vector, Vector]]:
    """Return the force that each link's motion needs, and its moment about the origin of the link's frame."""
    chain, arm, frames = poses
    omega, alpha = ZERO, ZERO
    a = Transform(chain.base.columns).rotate(scale(-1.0, chain.gravity))
    loads = []
    for link, frame in zip(arm.links, frames, strict=True):
        back = Transform(frame.columns)
        a = add(a, _rigid_acceleration(omega, alpha, frame.translation))
        omega, alpha, a = back.rotate(omega), back.rotate(alpha), back.rotate(a)
        rate = scale(times(link.multiplier, qd[link.coordinate]), link.joint.axis)
        second = scale(times(link.multiplier, qdd[link.coordinate]), link.joint.axis)
        if link.joint.kind == "revolute":
            alpha = add(alpha, add(second, cross(omega, rate)))
            omega = add(omega, rate)
        else:
            a = add(a, add(second, scale(2.0, cross(omega, rate))))
        inertia = Transform(link.inertia)
        force = add(scale(link.mass, a), _rigid_acceleration(omega, alpha, link.moment))
        spin = add(inertia.rotate(alpha), cross(omega, inertia.rotate(omega)))
        loads.append((force, add(spin, cross(link.moment, a))))
    return loads


def _rigid_acceleration(omega: Vector, alpha: Vector, d: Vector) -> Vector:
    """Return alpha x d + omega x (omega x d)."""
    return add(cross(alpha, d), cross(omega, cross(omega, d)))


def _subtract_wrench(poses: _LinkPoses, load: tuple[Vector, Vector], wrench: Wrench) -> tuple[Vector, Vector]:
    """Return the load of the last link without the part that an external wrench on the tool provides."""
    chain, arm, frames = poses
    force, moment = wrench
    for frame in (chain.base, *frames):
        back = Transform(frame.columns)
        force, moment = back.rotate(force), back.rotate(moment)
    moment = add(moment, cross(arm.tool.translation, force))
    return subtract(load[0], force), subtract(load[1], moment)


@dataclass(frozen=True, slots=True)
class _Field:
    """Velocities [m/s] or accelerations [m/s2] of a rigid body at all points r: G r + b."""

    gradient: tuple[Vector, Vector, Vector] = (ZERO, ZERO, ZERO)
    offset: Vector = ZERO

    def __add__(self, other: _Field) -> _Field:
        rows = zip(self.gradient, other.gradient, strict=True)
        x, y, z = (add(*pair) for pair in rows)
        return _Field((x, y, z), add(self.offset, other.offset))

    def scaled(self, factor: Element) -> _Field:
        x, y, z = (scale(factor, row) for row in self.gradient)
        return _Field((x, y, z), scale(factor, self.offset))

    def after(self, other: _Field) -> _Field:
        """Return G (G' r + b'): the accelerations by which this motion changes the velocities of another."""
        gradient = Transform(self.gradient)
        return _Field((gradient @ Transform(other.gradient)).rotation, gradient.rotate(other.offset))


@dataclass(frozen=True, slots=True)
class _Inertia:
    """Masses about the common origin, world axes: m [kg], h = sum m r [kg.m], S = sum m r r^T [kg.m2]."""

    mass: Element = 0.0
    moment: Vector = ZERO
    second: Symmetric = (ZERO, ZERO, ZERO)

    def __add__(self, other: _Inertia) -> _Inertia:
        mass, moment = plus(self.mass, other.mass), add(self.moment, other.moment)
        return _Inertia(mass, moment, sum_symmetric(self.second, other.second))


@dataclass(frozen=True, slots=True)
class _Force:
    """A force in [N] and its moment about the common origin in [N.m], in world axes."""

    force: Vector = ZERO
    moment: Vector = ZERO

    def __add__(self, other: _Force) -> _Force:
        return _Force(add(self.force, other.force), add(self.moment, other.moment))


@dataclass(frozen=True, slots=True)
class _MovingLink:
    """A joint and the body that it carries, about the common origin.

    axis is z of a revolute joint times its multiplier [-], 0 of a prismatic one; slide is v, the velocity at
    the common origin per unit rate of the coordinate, in [m] or [-].
    """

    coordinate: int
    is_revolute: bool
    axis: Vector
    slide: Vector
    body: _Inertia

    def field(self, rate: Element) -> _Field:
        """Return the velocities of all that the joint carries, for a rate of the coordinate."""
        x, y, z = scale(rate, self.axis)
        skew = ((0.0, minus(0.0, z), y), (z, 0.0, minus(0.0, x)), (minus(0.0, y), x, 0.0))
        return _Field(skew, scale(rate, self.slide))

    def torque(self, force: _Force) -> Element:
        """Return the torque of the coordinate, in [N.m] or [N], for a force on all that the joint carries."""
        return plus(dot(self.axis, force.moment), dot(self.slide, force.force))


def _moving_links(poses: _LinkPoses) -> tuple[list[_MovingLink], Vector]:
    """Return joints and bodies of an arm from the base outwards, and its tool centre point [m]."""
    chain, arm, (first, *following) = poses
    links, pose = [], Transform(chain.base.rotation)
    for link, frame in zip(arm.links, (Transform(first.rotation), *following), strict=True):
        pose = pose @ frame
        along = scale(link.multiplier, pose.rotate(link.joint.axis))
        is_revolute = link.joint.kind == "revolute"
        axis, slide = (along, cross(pose.translation, along)) if is_revolute else (ZERO, along)
        body = _transform_inertia(pose, link.mass, link.moment, _second_moments(link.inertia))
        links.append(_MovingLink(link.coordinate, is_revolute, axis, slide, body))
    return links, pose.point(arm.tool.translation)


def _second_moments(inertia: Symmetric) -> Symmetric:
    """Return S = tr(I) / 2 1 - I of an inertia about the same point, in [kg.m2]."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia
    half = scale(0.5, (minus(plus(yy, zz), xx), minus(plus(xx, zz), yy), minus(plus(xx, yy), zz)))
    xy, xz, yz = minus(0.0, xy), minus(0.0, xz), minus(0.0, yz)
    return (half[0], xy, xz), (xy, half[1], yz), (xz, yz, half[2])


def _transform_inertia(pose: Transform, mass: Element, moment: Vector, second: Symmetric) -> _Inertia:
    """Return a body that is given in a frame: S' = R S R^T + R h p^T + p (R h)^T + m p p^T."""
    p, rotated = pose.translation, pose.rotate(moment)
    moment = add(rotated, scale(mass, p))  # R h + m p
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = rotate_inertia(pose, second)

    def shift(value: Element, i: int, k: int) -> Element:
        """Return an entry of S' from one of R S R^T: (R h)_i p_k + p_i (R h + m p)_k is added."""
        return plus(value, plus(times(rotated[i], p[k]), times(p[i], moment[k])))

    xy, xz, yz = shift(xy, 0, 1), shift(xz, 0, 2), shift(yz, 1, 2)
    rows = (shift(xx, 0, 0), xy, xz), (xy, shift(yy, 1, 1), yz), (xz, yz, shift(zz, 2, 2))
    return _Inertia(mass, moment, rows)


def _inertial_force(body: _Inertia, field: _Field) -> _Force:
    """Return the force and moment that a body needs for accelerations G r + b (module docstring, 2)."""
    b, (hx, hy, hz) = field.offset, body.moment
    gradient = Transform(field.gradient)
    rows = (gradient @ Transform(body.second)).rotation
    (_, xy, xz), (yx, _, yz), (zx, zy, _) = (
        add(row, (times(b[k], hx), times(b[k], hy), times(b[k], hz))) for k, row in enumerate(rows)
    )
    force = add(gradient.rotate(body.moment), scale(body.mass, b))
    return _Force(force, (minus(zy, yz), minus(xz, zx), minus(yx, xy)))


def mass_matrix(chain: Chain, q: Sequence[Element]) -> list[list[Element]]:
    """Return M of T = 1/2 q'^T M q': M_ij is the torque of joint i for q_j'' = 1 alone.

    For each joint j, from the tip inwards: the composite body beyond j needs a force for the accelerations
    of q_j'' = 1 (module docstring, 2), and each joint i up to j provides its part. Entries of joints with a
    common coordinate are added.

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].

    Returns:
        The rows, one element per coordinate each, in [kg.m2] between revolute joints, [kg] between prismatic
        joints, [kg.m] between both kinds.

    Raises:
        RobotError: If the arm has no masses.

    Source: [Iso9283]_ eq. 13, D_1, by the composite bodies of [Walker1982]_.
    """
    return _mass_matrix_at(_link_poses(chain, q))


def _mass_matrix_at(poses: _LinkPoses) -> list[list[Element]]:
    links, _ = _moving_links(poses)
    count = len(poses.chain.coordinates)
    matrix: list[list[Element]] = [[0.0] * count for _ in range(count)]
    beyond = _Inertia()
    for j in reversed(range(len(links))):
        beyond += links[j].body
        force = _inertial_force(beyond, links[j].field(1.0))
        for i in range(j + 1):
            entry, row, column = links[i].torque(force), links[i].coordinate, links[j].coordinate
            matrix[row][column] = plus(matrix[row][column], entry)
            if i != j:
                matrix[column][row] = plus(matrix[column][row], entry)
    return matrix


def mass_matrix_scales(chain: Chain, q: Sequence[Element]) -> list[Element]:
    """Return upper bounds of the diagonal of M for any positions of the axes: the scale of its rounding.

    |z|^2 times the trace of the second moments about the common origin for a revolute joint, |v|^2 times the
    mass for a prismatic one, of the composite body beyond the joint.

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].

    Returns:
        One element per coordinate, in [kg.m2] or [kg].
    """
    links, _ = _moving_links(_link_poses(chain, q))
    scales: list[Element] = [0.0] * len(chain.coordinates)
    beyond = _Inertia()
    for link in reversed(links):
        beyond += link.body
        (xx, _, _), (_, yy, _), (_, _, zz) = beyond.second
        rotational = times(dot(link.axis, link.axis), plus(plus(xx, yy), zz))
        size = rotational if link.is_revolute else times(dot(link.slide, link.slide), beyond.mass)
        scales[link.coordinate] = plus(scales[link.coordinate], size)
    return scales


def forward_dynamics(
    chain: Chain,
    q: Sequence[Element],
    qd: Sequence[Element],
    tau: Sequence[Element],
    wrench: Wrench | None = None,
    arm: Links | None = None,
) -> list[Element]:
    """Return q'' = M^-1 (tau - tau_0), where tau_0 are the torques of the motion with q'' = 0.

    Args:
        chain: The arm; each joint moves a mass (see `check_solvable`).
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].
        tau: Torques of revolute joints in [N.m], forces of prismatic ones in [N].
        wrench: External wrench on the tool centre point.
        arm: Its moving links, if they are known.

    Returns:
        One element per coordinate, in [rad/s2] or [m/s2].

    Raises:
        RobotError: If the arm has no masses.

    Source: [Iso9283]_ eq. 19, solved for the accelerations.
    """
    poses = _link_poses(chain, q, arm)
    bias = _inverse_dynamics_at(poses, qd, [0.0] * len(q), wrench)
    remaining = [minus(torque, other) for torque, other in zip(tau, bias, strict=True)]
    return solve_ldl(_mass_matrix_at(poses), remaining)


def solve_ldl(matrix: Sequence[Sequence[Element]], right: Sequence[Element]) -> list[Element]:
    """Return x of M x = b for a symmetric positive definite M, by M = L D L^T, elementwise.

    Args:
        matrix: The rows of M, in any units.
        right: b.
    """
    lower, pivots = _factor_ldl(matrix)
    x: list[Element] = list(right)
    for i in range(len(x)):
        for k in range(i):
            x[i] = minus(x[i], times(lower[i][k], x[k]))
    x = [value / pivot for value, pivot in zip(x, pivots, strict=True)]
    for i in reversed(range(len(x))):
        for k in range(i + 1, len(x)):
            x[i] = minus(x[i], times(lower[k][i], x[k]))
    return x


def _factor_ldl(matrix: Sequence[Sequence[Element]]) -> tuple[list[list[Element]], list[Element]]:
    """Return L below its diagonal of ones, and the pivots D, of a symmetric M = L D L^T."""
    lower: list[list[Element]] = []
    pivots: list[Element] = []
    for i, entries in enumerate(matrix):
        row: list[Element] = []  # of L D, then of L
        for j in range(i):
            value = entries[j]
            for k in range(j):
                value = minus(value, times(row[k], lower[j][k]))
            row.append(value)
        pivot = entries[i]
        for j in range(i):
            scaled, row[j] = row[j], row[j] / pivots[j]
            pivot = minus(pivot, times(scaled, row[j]))
        lower.append(row)
        pivots.append(pivot)
    return lower, pivots


def check_solvable(chain: Chain) -> None:
    """Raise an error for an arm with a joint whose motion no inertia resists.

    Raises:
        RobotError: If the arm has no masses, or with the name of every joint whose pivot of M is 0 in random
            poses, or else at the start pose.
    """
    shape = len(chain.coordinates), SOLVABILITY_POSES
    poses = np.random.default_rng(0).uniform(-1.0, 1.0, shape)
    start = np.array(chain.start, dtype=np.float64)[:, np.newaxis]
    for where, q in (("", poses), ("at its start pose ", start)):
        faults = [
            f"robot {chain.name}: joint {name}: {where}no inertia resists its own motion, so that it cannot"
            " be solved; allowed: an inertial that only this joint moves"
            for name in _joints_without_inertia(chain, list(q))
        ]
        if faults:
            raise RobotError(*faults)


def _joints_without_inertia(chain: Chain, q: Sequence[FloatArray]) -> Iterator[str]:
    """Yield the coordinates whose pivot of M is 0 in all given poses; later pivots are those without them.

    A pivot counts as 0 below `NEGLIGIBLE_PIVOT` of its `mass_matrix_scales`.

    Args:
        chain: The arm, with masses.
        q: Poses in [rad] or [m], one array of shape (n,) per coordinate.
    """
    count = len(q[0])
    matrix = [[np.broadcast_to(entry, count) for entry in row] for row in mass_matrix(chain, q)]
    scales = mass_matrix_scales(chain, q)
    kept: list[int] = []
    for i, name in enumerate(chain.coordinates):
        indices = [*kept, i]
        *_, pivot = _factor_ldl([[matrix[row][column] for column in indices] for row in indices])[1]
        if np.max(pivot - NEGLIGIBLE_PIVOT * scales[i]) <= 0.0:
            yield name
        else:
            kept.append(i)


class TorqueTerms(NamedTuple):
    """Terms of the joint torques, one element per coordinate each, in [N.m] or [N].

    Attributes:
        inertia: From the accelerations q''.
        centrifugal: From the squares of the rates q'.
        coriolis: From the products of two rates.
        gravity: From the weights.
        tool: From the external wrench on the tool.
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

    Each is a field of accelerations G r + b of the body of joint m (module docstring, 2): inertia
    sum_j q_j'' W_j; centrifugal sum_j q_j'^2 W_j W_j; Coriolis 2 sum_(j < k) q_j' q_k' W_j W_k, all over the
    joints up to m; gravity -g. Products of two joints with a common coordinate count as centrifugal: both
    have its q'^2.

    Args:
        chain: The arm, with masses.
        q: One element per coordinate, in [rad] or [m].
        qd: Their rates, in [rad/s] or [m/s].
        qdd: Their second derivatives, in [rad/s2] or [m/s2].
        wrench: External wrench on the tool centre point.

    Raises:
        RobotError: If the arm has no masses.

    Source: [Iso9283]_ eq. 13: D_1, D_2, D_(1+k), E and J^T F, the last with the sign of a force from outside.
    """
    links, tool_point = _moving_links(_link_poses(chain, q))
    inertia, centrifugal, coriolis = _Field(), _Field(), _Field()
    rates = [_Field() for _ in chain.coordinates]
    weight = _Field(offset=scale(-1.0, chain.gravity))
    forces: list[tuple[_Force, ...]] = []
    for link in links:
        velocity, c = link.field(qd[link.coordinate]), link.coordinate
        inertia += link.field(qdd[c])
        centrifugal += velocity.after(velocity) + rates[c].after(velocity).scaled(2.0)
        for k, other in enumerate(rates):
            if k != c:
                coriolis += other.after(velocity).scaled(2.0)
        rates[c] += velocity
        fields = (inertia, centrifugal, coriolis, weight)
        forces.append(tuple(_inertial_force(link.body, field) for field in fields))
    tool = [_Force()] * len(links)
    if wrench is not None:
        moment = add(wrench.moment, cross(tool_point, wrench.force))
        tool[-1] = _Force(scale(-1.0, wrench.force), scale(-1.0, moment))
    terms = [*zip(*forces, strict=True), tool]
    return TorqueTerms(*(_forces_to_torques(links, term, len(chain.coordinates)) for term in terms))


def _forces_to_torques(links: Sequence[_MovingLink], forces: Sequence[_Force], count: int) -> list[Element]:
    """Return the torque of each coordinate that provides the forces on the links."""
    torques: list[Element] = [0.0] * count
    beyond = _Force()
    for link, force in zip(reversed(links), reversed(forces), strict=True):
        beyond += force
        torques[link.coordinate] = plus(torques[link.coordinate], link.torque(beyond))
    return torques


def torques_over_log(
    chain: Chain, q: FloatArray, qd: FloatArray, qdd: FloatArray, threads: int = THREADS
) -> FloatArray:
    """Return the torques of the joints over a log, in [N.m] or [N], shape (n, joints).

    Args:
        chain: The arm, with masses.
        q: Joint values in [rad] or [m], shape (n, joints).
        qd: Their rates in [rad/s] or [m/s], shape (n, joints).
        qdd: Their second derivatives in [rad/s2] or [m/s2], shape (n, joints).
        threads: Maximum number of blocks computed in parallel.

    Raises:
        RobotError: If the arm has no masses.
    """
    return _evaluate_over_log(
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
    flat = _evaluate_over_log(
        lambda *columns: [torque for term in torque_terms(chain, *columns) for torque in term],
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
    kinetic, potential = _evaluate_over_log(
        lambda q, qd: [kinetic_energy(chain, q, qd), potential_energy(chain, q)], 2, q, qd
    )
    return kinetic, potential


def centres_of_mass_over_log(chain: Chain, q: FloatArray) -> FloatArray:
    """Return the centres of the masses of an arm in the world over a log, in [m], shape (n, inertials, 3).

    Args:
        chain: The arm, with masses.
        q: Joint values in [rad] or [m], shape (n, joints).
    """
    count = len(chain.inertials)
    flat = _evaluate_over_log(
        lambda q: [x for centre in centres_of_mass(chain, q) for x in centre], 3 * count, q
    )
    return flat.T.reshape(len(q), count, 3)


def _evaluate_over_log(
    function: Callable[..., Sequence[Element]], count: int, *arrays: FloatArray, threads: int = THREADS
) -> FloatArray:
    """Return a function of the columns of arrays of shape (n, joints), shape (count, n)."""
    values = np.empty((count, len(arrays[0])))

    def fill(block: slice) -> None:
        columns = [list(np.ascontiguousarray(array[block].T, dtype=np.float64)) for array in arrays]
        for k, element in enumerate(function(*columns)):
            values[k, block] = element

    map_blocks(fill, row_blocks(len(arrays[0])), threads)
    return values
