"""Joints and bodies by Denavit-Hartenberg parameters: open and closed chains of joint-body elements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from urmpipe_models.elementwise import Element
from urmpipe_models.files.tables import Table
from urmpipe_models.networks.expressions import Expression
from urmpipe_models.networks.file_values import STILL, read_drives
from urmpipe_models.networks.parts import FREEDOMS, Body, Joint, JointKind
from urmpipe_models.robots.robot_frames import Units
from urmpipe_models.transform import Transform, rotation_x, rotation_y, translation

DH_KINDS: dict[str, JointKind] = {
    "R": "revolute",
    "P": "prismatic",
    "C": "cylindrical",
    "H": "helical",
}
"""The joint of an element of a kind."""

FROM_AXES = Transform(((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)))
"""m, n and m x n of a joint in its body: e2, e1 and -e3, as the axis of a joint is n and of an element e1."""


@dataclass(frozen=True, slots=True)
class DHElement:
    """A joint and the body that it carries.

    Attributes:
        name: The joint's name.
        kind: R, P, C or H.
        a: Length of the common normal, along e2, in [m].
        alpha: Angle between the axes, about e2, in [rad].
        s: Way along the axis in [m]: a constant of R, where P and C start; of H it is pitch theta.
        theta: Angle about the axis in [rad]: a constant of P, where R, C and H start.
        pitch: Of H in [m/rad].
        values: What drives the variables, theta before s; empty: they are free.

    Source: [KinematicSystems]_ section 3.2.5.
    """

    name: str
    kind: str
    a: float = 0.0
    alpha: float = 0.0
    s: float = 0.0
    theta: float = 0.0
    pitch: float = 0.0
    values: tuple[Expression | None, ...] = ()


def element_frame(a: Element, alpha: Element, s: Element, theta: Element) -> Transform:
    """Return e(i+1) in e(i): Ty(a) Ry(alpha) Tx(s) Rx(theta).

    Args:
        a: In [m], any element.
        alpha: In [rad].
        s: In [m].
        theta: In [rad].

    Source: [KinematicSystems]_ eq. 3-5 to 3-7.
    """
    normal = Transform(rotation_y(alpha).rotation, (0.0, a, 0.0))
    return normal @ translation(s, 0.0, 0.0) @ rotation_x(theta)


def joint_of(element: DHElement, ends: tuple[str, str]) -> Joint:
    """Return the joint of an element: A_1 T A_2^-1 is the frame of eq. 3-5 to 3-7.

    With P = (e2, e1, -e3) as columns, P Ry(theta) P^-1 = Rx(theta) and P Ty(s) P^-1 = Tx(s), so that
    A_1 = Ty(a) Ry(alpha) P and A_2 = P; constants s and theta go to A_1 and A_2.

    Args:
        element: The element.
        ends: The bodies before and after it.

    Source: [KinematicSystems]_ section 3.2.5, with its errata.
    """
    slid = element.s if element.kind == "R" else 0.0
    turned = element.theta if element.kind == "P" else 0.0
    starts = {"P": (element.s,), "C": (element.theta, element.s)}
    return Joint(
        element.name,
        DH_KINDS[element.kind],
        ends,
        (
            element_frame(element.a, element.alpha, slid, 0.0) @ FROM_AXES,
            rotation_x(-turned) @ FROM_AXES,
        ),
        start=starts.get(element.kind, (element.theta,)),
        values=element.values,
        pitch=element.pitch,
    )


def read_dh(
    table: Table, units: Units, ground: str, places: dict[str, str]
) -> Iterator[tuple[Joint, Body | None]]:
    """Yield the joint of each element and the body that it carries; None of one that closes the chain.

    Args:
        table: `[dh]` with `closed` and `elements`.
        units: The units of the file.
        ground: The body before the first element, and after the last of a closed chain.
        places: Of each joint and body here the place in the file is added.
    """
    closed = table.flag("closed")
    rows = table.named_tables("elements")
    table.close()
    before = ground
    for name, row in rows.items():
        place = f"dh.elements.{name}"
        last = closed and name == [*rows][-1]
        after = ground if last else row.text("body", f"{name}.body")
        driven = f"{place}.{'driven' if row.has('driven') else 'value'}"
        places |= {f"joints.{name}": place, f"joints.{name}.value": driven}
        joint = _read_joint(name, row, units, (before, after))
        if not last:
            places.setdefault(f"bodies.{after}", f"{place}.body")
        yield joint, None if last else Body(after)
        before = after


def _read_joint(name: str, row: Table, units: Units, ends: tuple[str, str]) -> Joint:
    """Return the joint of an element; one that cannot move where its kind is none."""
    many = len(row.faults)
    kind = row.choice("kind", tuple(DH_KINDS))
    if len(row.faults) > many:  # its keys are those of no kind
        return Joint(name, "user", ends, motion=STILL)
    keys = ("a", "alpha", "theta") if kind == "H" else ("a", "alpha", "s", "theta")
    numbers = {key: row.number(key, 0.0) for key in keys}
    element = DHElement(
        name,
        kind,
        **{key: (units.length if key in {"a", "s"} else units.angle)(one) for key, one in numbers.items()},
        pitch=units.length(row.number("pitch")) if kind == "H" else 0.0,
        values=read_drives(row, FREEDOMS[DH_KINDS[kind]], units),
    )
    row.close()
    return joint_of(element, ends)
