"""Chains from the parameters of a geometric model: Denavit-Hartenberg, R and T joints, 6R arm, URM modules.

    dh_chain            A_i = Rz(theta_i + q_i) Tz(d_i) Tx(a_i) Rx(alpha_i)        [DenavitHartenberg1955]_
    modified_dh_chain   A_i = Rx(alpha_{i-1}) Tx(a_{i-1}) Rz(theta_i + q_i) Tz(d_i)  [Craig2005]_
    geometric_chain     joint k at r_k, about or along x, y or z                     [Geometric6R]_
    articulated_6r      the geometric model of the 6R arm: joints about z, x, x, and z, x, z in one point
    urm_chain           universal rotational modules, each tilted relative to the one before   [UrmArm2021]_

Each length and angle is a step with a name, so that it becomes a `Parameter` of the chain.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from urmpipe_models.arm.chain import Chain, Joint, JointKind
from urmpipe_models.elementwise import ZERO, Element, Vector
from urmpipe_models.errors import RobotError
from urmpipe_models.math3d import Step, Transform, compose_steps


@dataclass(frozen=True, slots=True)
class DHRow:
    """One joint and one link, or a frame between two of them.

    The coordinate q adds to theta of a revolute and to d of a prismatic joint, so that theta or d is
    the joint's offset. A fixed row has no coordinate: an auxiliary frame, or a flange at the end.

    Attributes:
        theta: Angle about z in [rad], any element.
        d: Translation along z in [m], any element.
        a: Link length along x in [m], any element; a_{i-1} in the modified form.
        alpha: Link twist about x in [rad], any element; alpha_{i-1} in the modified form.
        name: The joint's name; if empty q1, q2, ... by coordinate, and frame1, ... by row if fixed.
        kind: revolute, prismatic or fixed.
        lower: Lower limit of the coordinate, in [rad] or [m].
        upper: Upper limit of the coordinate, in [rad] or [m].
        velocity: Largest speed, in [rad/s] or [m/s].
        acceleration: Largest acceleration either way, in [rad/s2] or [m/s2].
        effort: Largest torque or force either way, in [N.m] or [N].
    """

    theta: Element = 0.0
    d: Element = 0.0
    a: Element = 0.0
    alpha: Element = 0.0
    name: str = ""
    kind: JointKind = "revolute"
    lower: float = -math.inf
    upper: float = math.inf
    velocity: float = math.inf
    acceleration: float = math.inf
    effort: float = math.inf


def dh_chain(
    name: str,
    rows: Sequence[DHRow],
    *,
    base: Transform | None = None,
    tool: Transform | None = None,
    start: Sequence[float] = (),
    description: str = "",
    source: str = "",
) -> Chain:
    """Return the arm of standard parameters: A_i = Rz(theta_i + q_i) Tz(d_i) Tx(a_i) Rx(alpha_i).

    A joint moves first and its link follows, so that point p_i is the origin of DH frame i.

    Args:
        name: The robot's name.
        rows: One per joint or fixed frame, from the base outwards.
        base: DH frame 0 in the world.
        tool: The tool centre point in the last DH frame.
        start: Calibration pose q(0) in [rad] or [m].
        description: One line of text.
        source: Origin of the numbers.

    Raises:
        RobotError: If there is no row, names repeat, or start has another length.

    Source: [DenavitHartenberg1955]_.
    """
    links = (compose_steps(*_screw_z(row, k), *_screw_x(row, k)) for k, row in enumerate(rows, start=1))
    *origins, tip = compose_steps(), *links
    return Chain(
        name,
        tuple(_joints(rows, origins)),
        tip=tip,
        base=base or Transform(),
        tool=tool or Transform(),
        start=tuple(float(value) for value in start),
        description=description,
        source=source,
    )


def modified_dh_chain(
    name: str,
    rows: Sequence[DHRow],
    *,
    base: Transform | None = None,
    tool: Transform | None = None,
    start: Sequence[float] = (),
    description: str = "",
    source: str = "",
) -> Chain:
    """Return the arm of modified parameters: A_i = Rx(alpha_{i-1}) Tx(a_{i-1}) Rz(theta_i + q_i) Tz(d_i).

    A link comes first and its joint moves at its end: frame i sits on joint i, and point p_i is the
    origin of frame i + 1, the last one the tool centre point.

    Args:
        name: The robot's name.
        rows: One per joint or fixed frame, from the base outwards: alpha_{i-1}, a_{i-1}, theta_i, d_i.
        base: Frame 0 in the world.
        tool: The tool centre point in the last frame.
        start: Calibration pose q(0) in [rad] or [m].
        description: One line of text.
        source: Origin of the numbers.

    Raises:
        RobotError: If there is no row, names repeat, or start has another length.

    Source: [Craig2005]_ section 3.4.
    """
    origins = [compose_steps(*_screw_x(row, k), *_screw_z(row, k)) for k, row in enumerate(rows, start=1)]
    return Chain(
        name,
        tuple(_joints(rows, origins)),
        tip=compose_steps(),
        base=base or Transform(),
        tool=tool or Transform(),
        start=tuple(float(value) for value in start),
        description=description,
        source=source,
    )


def _screw_z(row: DHRow, k: int) -> tuple[Step, Step]:
    """Return Rz(theta) Tz(d) of row k, which commutes with the joint's motion about and along z."""
    return (
        Step("about", "z", row.theta, f"theta_{k}", f"DH row {k}"),
        Step("along", "z", row.d, f"d_{k}", f"DH row {k}"),
    )


def _screw_x(row: DHRow, k: int) -> tuple[Step, Step]:
    """Return Tx(a) Rx(alpha) of row k."""
    return (
        Step("along", "x", row.a, f"a_{k}", f"DH row {k}"),
        Step("about", "x", row.alpha, f"alpha_{k}", f"DH row {k}"),
    )


def _joints(rows: Sequence[DHRow], origins: Sequence[Transform]) -> Iterator[Joint]:
    coordinate = 0
    for k, (row, origin) in enumerate(zip(rows, origins, strict=True), start=1):
        coordinate += row.kind != "fixed"
        yield Joint(
            row.name or (f"frame{k}" if row.kind == "fixed" else f"q{coordinate}"),
            row.kind,
            origin,
            lower=row.lower,
            upper=row.upper,
            velocity=row.velocity,
            acceleration=row.acceleration,
            effort=row.effort,
        )


AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True, slots=True)
class GeometricModelRow:
    """One joint of the model.

    Attributes:
        kind: R rotates system T_k about its axis by q_k in [rad]; T translates it along its axis by q_k in
            [m], parallel to T_{k-1}.
        axis: x, y or z of T_k.
        r: r_k^{k-1}, the origin O_k in system T_{k-1} at q_k = 0, in [m], any elements.
        name: The joint's name; q1, q2, ... if empty.
    """

    kind: Literal["R", "T"]
    axis: Literal["x", "y", "z"]
    r: Vector = ZERO
    name: str = ""


def geometric_chain(
    name: str,
    rows: Sequence[GeometricModelRow],
    *,
    tip: Vector = ZERO,
    start: Sequence[float] = (),
    description: str = "",
    source: str = "",
) -> Chain:
    """Return the arm of a geometric model: joint k is at r_k^{k-1} and parallel to the one before.

    Args:
        name: The robot's name.
        rows: One per joint, from the base outwards.
        tip: r_{n+1}^n, the characteristic point of the gripper in the last system [m], any elements.
        start: Calibration pose q(0) in [rad] or [m].
        description: One line of text.
        source: Origin of the numbers.

    Raises:
        RobotError: If there is no row, names repeat, or start has another length.

    Source: [Geometric6R]_ eq. 1, 2.
    """
    return Chain(
        name,
        tuple(
            Joint(
                row.name or f"q{k}",
                "revolute" if row.kind == "R" else "prismatic",
                _shift(row.r, k),
                AXES[row.axis],
            )
            for k, row in enumerate(rows, start=1)
        ),
        tip=_shift(tip, len(rows) + 1),
        start=tuple(float(value) for value in start),
        description=description,
        source=source,
    )


def _shift(r: Vector, k: int) -> Transform:
    x, y, z = r
    source = f"geometric row {k}"
    return compose_steps(
        Step("along", "x", x, f"r{k}.x", source),
        Step("along", "y", y, f"r{k}.y", source),
        Step("along", "z", z, f"r{k}.z", source),
    )


def articulated_6r_rows(l0: Element, l1: Element, l2: Element, l3: Element) -> tuple[GeometricModelRow, ...]:
    """Return the joints of the arm: about z, x, x, z, x, z, the last three through one point.

    Args:
        l0: r_1^0, height of joint 1 in [m], any element.
        l1: r_2^1, from joint 1 to joint 2 in [m].
        l2: r_3^2, the upper arm in [m].
        l3: r_4^3, the forearm in [m], to the wrist centre.

    Source: [Geometric6R]_ eq. 21-26, 39.
    """
    return (
        GeometricModelRow("R", "z", (0.0, 0.0, l0)),
        GeometricModelRow("R", "x", (0.0, 0.0, l1)),
        GeometricModelRow("R", "x", (0.0, 0.0, l2)),
        GeometricModelRow("R", "z", (0.0, 0.0, l3)),
        GeometricModelRow("R", "x"),
        GeometricModelRow("R", "z"),
    )


def articulated_6r(
    l0: Element,
    l1: Element,
    l2: Element,
    l3: Element,
    l4: Element,
    *,
    name: str = "articulated6r",
    start: Sequence[float] = (),
    description: str = "",
    source: str = "",
) -> Chain:
    """Return the articulated 6R arm; at q = 0 it is straight up, l0 + l1 + l2 + l3 + l4 high.

    Args:
        l0: Height of joint 1 in [m], any element.
        l1: From joint 1 to joint 2 in [m].
        l2: The upper arm in [m].
        l3: The forearm in [m], to the wrist centre.
        l4: From the wrist centre to the characteristic point of the gripper in [m].
        name: The robot's name.
        start: Calibration pose q(0) in [rad].
        description: One line of text.
        source: Origin of the numbers.

    Source: [Geometric6R]_ Figure 2, eq. 21-26, 39.
    """
    rows = articulated_6r_rows(l0, l1, l2, l3)
    chain = geometric_chain(name, rows, start=start, description=description, source=source)
    lengths = enumerate((l0, l1, l2, l3, l4))
    *links, tip = (compose_steps(Step("along", "z", length, f"l{k}", "6R length")) for k, length in lengths)
    origins = (*links, compose_steps(), compose_steps())  # the wrist's axes meet
    joints = (replace(joint, origin=at) for joint, at in zip(chain.joints, origins, strict=True))
    return replace(chain, joints=tuple(joints), tip=tip)


SEGMENT_SOURCE, TILT_SOURCE = "URM segment", "URM tilt"  # `Parameter.source` of lengths and tilts


def urm_chain(
    name: str,
    lengths: Sequence[Element],
    tilts: Sequence[Element],
    *,
    directions: Sequence[float] = (),
    start: Sequence[float] = (),
    description: str = "",
    source: str = "",
) -> Chain:
    """Return the chain of n modules: n + 1 segments r_i, n tilts theta_2..theta_{n+1}, n joints about z.

    p_{i+1} = Rz1 [r_1 + sum_k prod_j (Ry_{j+1}(theta_{j+1}) Rz_{j+1}(phi_{j+1})) r_{k+1}]; the last segment
    is the effector, tilted but without a joint (there is no Rz_{n+1}).

    Args:
        name: The robot's name.
        lengths: r_1..r_{n+1} in [m], any elements.
        tilts: theta_2..theta_{n+1} in [rad], any elements.
        directions: +1 or -1 per module; -1 for one that counter-rotates.
        start: Calibration pose phi(0) in [rad].
        description: One line of text.
        source: Origin of the numbers.

    Raises:
        RobotError: If the counts do not fit each other.

    Source: [UrmArm2021]_ eq. 1-8, Figure 1.
    """
    modules = len(tilts)
    if len(lengths) != modules + 1 or modules < 1:
        raise RobotError(
            f"robot {name}: {len(lengths)} lengths and {modules} tilts; n modules need"
            " n + 1 lengths and n tilts"
        )
    signs = tuple(directions) or (1,) * modules
    if len(signs) != modules or any(sign not in (1, -1) for sign in signs):
        raise RobotError(f"robot {name}: directions {list(signs)}; allowed: {modules} values, each 1 or -1")
    *segments, end = (Step("along", "z", r, f"r{k}", SEGMENT_SOURCE) for k, r in enumerate(lengths, start=1))
    rotations = (Step("about", "y", tilt, f"theta{k}", TILT_SOURCE) for k, tilt in enumerate(tilts, start=2))
    origins = [compose_steps(), *map(compose_steps, segments, rotations)]
    joints = [
        Joint(f"phi{k}", "revolute", origin, (0.0, 0.0, float(sign)))
        for k, (origin, sign) in enumerate(zip(origins, signs, strict=False), start=1)
    ]
    effector = Joint("effector", "fixed", origins[-1])
    return Chain(
        name,
        (*joints, effector),
        tip=compose_steps(end),
        start=tuple(float(value) for value in start),
        description=description,
        source=source,
    )
