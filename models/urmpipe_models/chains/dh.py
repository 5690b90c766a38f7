"""Arms from Denavit-Hartenberg parameters, in the standard and in Craig's modified form."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from urmpipe_models.chains.chain import Chain, Joint, JointKind
from urmpipe_models.elementwise import Element
from urmpipe_models.transform import Step, Transform, made_of


@dataclass(frozen=True, slots=True)
class DHRow:
    """One joint and one link, or a frame between two of them.

    The coordinate q adds to theta of a revolute and to d of a prismatic joint, so that theta or d is
    the joint's offset. A fixed row has no coordinate: an auxiliary frame, or a flange at the end.

    Attributes:
        theta: Angle about z in [rad], any element.
        d: Way along z in [m], any element.
        a: Link length along x in [m], any element; a_{i-1} in the modified form.
        alpha: Link twist about x in [rad], any element; alpha_{i-1} in the modified form.
        name: The joint's name; where it is empty q1, q2, ... by coordinate, and frame1, ... by row if fixed.
        kind: revolute, prismatic or fixed.
        lower: Least coordinate allowed, in [rad] or [m].
        upper: Largest coordinate allowed, in [rad] or [m].
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
        rows: One a joint or fixed frame, from the base outwards.
        base: Where DH frame 0 stands in the world.
        tool: The tool centre point in the last DH frame.
        start: Calibration pose q(0) in [rad] or [m].
        description: One line for people.
        source: Where the numbers come from.

    Raises:
        RobotError: If there is no row, names repeat, or start has another length.

    Source: [DenavitHartenberg1955]_.
    """
    links = (made_of(*_screw_z(row, k), *_screw_x(row, k)) for k, row in enumerate(rows, start=1))
    *origins, tip = made_of(), *links
    return Chain(
        name,
        _joints(rows, origins),
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
        rows: One a joint or fixed frame, from the base outwards: alpha_{i-1}, a_{i-1}, theta_i, d_i.
        base: Where frame 0 stands in the world.
        tool: The tool centre point in the last frame.
        start: Calibration pose q(0) in [rad] or [m].
        description: One line for people.
        source: Where the numbers come from.

    Raises:
        RobotError: If there is no row, names repeat, or start has another length.

    Source: [Craig2005]_ section 3.4.
    """
    origins = [made_of(*_screw_x(row, k), *_screw_z(row, k)) for k, row in enumerate(rows, start=1)]
    return Chain(
        name,
        _joints(rows, origins),
        tip=made_of(),
        base=base or Transform(),
        tool=tool or Transform(),
        start=tuple(float(value) for value in start),
        description=description,
        source=source,
    )


def _screw_z(row: DHRow, k: int) -> tuple[Step, Step]:
    """Return Rz(theta) Tz(d) of row k, which commutes with the joint's own motion about and along z."""
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


def _joints(rows: Sequence[DHRow], origins: Sequence[Transform]) -> tuple[Joint, ...]:
    """Return the joints of rows, each at its origin."""
    return tuple(
        Joint(
            name,
            row.kind,
            origin,
            lower=row.lower,
            upper=row.upper,
            velocity=row.velocity,
            acceleration=row.acceleration,
            effort=row.effort,
        )
        for name, row, origin in zip(_names(rows), rows, origins, strict=True)
    )


def _names(rows: Sequence[DHRow]) -> Iterator[str]:
    """Yield the name of every row, given or counted."""
    coordinate = 0
    for k, row in enumerate(rows, start=1):
        coordinate += row.kind != "fixed"
        yield row.name or (f"frame{k}" if row.kind == "fixed" else f"q{coordinate}")
