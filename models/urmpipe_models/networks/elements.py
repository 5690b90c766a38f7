"""Denavit-Hartenberg chains, robots and higher pairs of a network file as bodies, joints and elements.

1. `read_dh`: open and closed chains of joint-body elements, each a frame by Denavit-Hartenberg parameters,
   e(i+1) in e(i) = Ty(a) Ry(alpha) Tx(s) Rx(theta), and a joint R, P, C or H.
2. `read_chain`: a robot of the catalogue or of a file, with one body per joint of its chain, and one for the
   tool.
3. `read_pair`: gears, racks and cams between the variables of two joints, with the profile of a cam from a
   CSV file.

Errors go to the table that is read. `units` are those of the file, `folder` is that of the network: files of
robots and profiles are relative to it. The place in the file of each part is added to `places`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from urmpipe_models.arm.chain import Chain
from urmpipe_models.arm.chain import Joint as ChainJoint
from urmpipe_models.elementwise import ZERO, Element, Vector, cross
from urmpipe_models.errors import OptionError, RobotError, format_unknown_name, format_value
from urmpipe_models.math3d import Transform, rotation_x, rotation_y, translation
from urmpipe_models.networks.file_values import (
    IDENTITY_MOTION,
    parse_expression,
    read_drives,
    read_expression,
    to_si,
)
from urmpipe_models.networks.joint_motion import AXES
from urmpipe_models.networks.parts import (
    JOINT_UNITS,
    MAX_POINTS,
    Body,
    ConstraintElement,
    Control,
    ElementKind,
    Expression,
    Joint,
    JointKind,
    Parts,
    Profile,
    frame_from_axes,
    pair_bodies,
)
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.toml import Units
from urmpipe_models.toml_tables import CheckedTable, is_number, is_number_list

DH_KINDS: dict[str, JointKind] = {"R": "revolute", "P": "prismatic", "C": "cylindrical", "H": "helical"}

# m, n and m x n of a joint in its body: e2, e1 and -e3, as the axis of a joint is n and of an element e1
FROM_AXES = Transform(((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)))

ROBOT_SUFFIXES = {".toml", ".urdf", ".xacro"}  # of robots in files, relative to the network's folder
MAX_LISTED = 10  # faulty lines of a CSV file in messages; the others are counted


# --- Denavit-Hartenberg parameters


@dataclass(frozen=True, slots=True)
class DHElement:
    """A joint and the body that it carries.

    Attributes:
        name: The joint's name.
        kind: R, P, C or H.
        a: Length of the common normal, along e2, in [m].
        alpha: Angle between the axes, about e2, in [rad].
        s: Distance along the axis in [m]: a constant of R, the start of P and C; of H it is pitch theta.
        theta: Angle about the axis in [rad]: a constant of P, the start of R, C and H.
        pitch: Of H in [m/rad].
        values: The functions that drive the variables, theta before s; empty: they are free.

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


def element_to_joint(element: DHElement, ends: tuple[str, str]) -> Joint:
    """Return the joint of an element: A_1 T A_2^-1 is the frame of eq. 3-5 to 3-7.

    With P = (e2, e1, -e3) as columns, P Ry(theta) P^-1 = Rx(theta) and P Ty(s) P^-1 = Tx(s), so that
    A_1 = Ty(a) Ry(alpha) P and A_2 = P; constants s and theta go to A_1 and A_2. The ends are the bodies
    before and after it.

    Source: [KinematicSystems]_ section 3.2.5, with its errata.
    """
    s = element.s if element.kind == "R" else 0.0
    theta = element.theta if element.kind == "P" else 0.0
    starts = {"P": (element.s,), "C": (element.theta, element.s)}
    return Joint(
        element.name,
        DH_KINDS[element.kind],
        ends,
        (element_frame(element.a, element.alpha, s, 0.0) @ FROM_AXES, rotation_x(-theta) @ FROM_AXES),
        start=starts.get(element.kind, (element.theta,)),
        values=element.values,
        pitch=element.pitch,
    )


def read_dh(
    table: CheckedTable, units: Units, ground: str, places: dict[str, str]
) -> Iterator[tuple[Joint, Body | None]]:
    """Yield the joint of each element of `[dh]` and the body that it carries; None if it closes the chain."""
    is_closed = table.flag("closed")
    rows = table.named_tables("elements")
    table.report_unknown_keys()
    before = ground
    for name, row in rows.items():
        place = f"dh.elements.{name}"
        is_last = is_closed and name == [*rows][-1]
        after = ground if is_last else row.text("body", f"{name}.body")
        driven = f"{place}.{'driven' if row.has('driven') else 'value'}"
        places |= {f"joints.{name}": place, f"joints.{name}.value": driven}
        joint = _read_dh_joint(name, row, units, (before, after))
        if not is_last:
            places.setdefault(f"bodies.{after}", f"{place}.body")
        yield joint, None if is_last else Body(after)
        before = after


def _read_dh_joint(name: str, row: CheckedTable, units: Units, ends: tuple[str, str]) -> Joint:
    """Return the joint of an element; one that cannot move if its kind is unknown."""
    faults = len(row.faults)
    kind = row.choice("kind", tuple(DH_KINDS))
    if len(row.faults) > faults:  # its keys are unknown, too
        return Joint(name, "user", ends, motion=IDENTITY_MOTION)
    keys = ("a", "alpha", "theta") if kind == "H" else ("a", "alpha", "s", "theta")
    numbers = {key: row.number(key, 0.0) for key in keys}
    element = DHElement(
        name,
        kind,
        **{key: to_si(number, "m" if key in {"a", "s"} else "rad", units) for key, number in numbers.items()},
        pitch=units.length(row.number("pitch")) if kind == "H" else 0.0,
        values=read_drives(row, JOINT_UNITS[DH_KINDS[kind]], units),
    )
    row.report_unknown_keys()
    return element_to_joint(element, ends)


# --- robots


def read_chain(
    name: str, table: CheckedTable, units: Units, folder: Path, ground: str, places: dict[str, str]
) -> Parts | None:
    """Return the parts of a robot; None if it cannot be read. The ground carries it without a `body`."""
    place = f"chains.{name}"
    chain, carrier = _load_chain(table, folder), table.text("body", ground)
    if chain is None:  # then its start and its drives cannot be checked
        return None
    start, values = _read_chain_start(table, chain, units), _read_chain_values(table, chain, units)
    table.report_unknown_keys()
    parts = chain_to_parts(name, chain, carrier, start, values)
    places |= {f"joints.{joint.name}": place for joint in parts.joints}
    places |= {f"bodies.{body.name}": place for body in parts.bodies}
    places |= {f"controls.{control.name}": place for control in parts.controls}
    for key in values:
        where = f"{place}.value.{key}"
        places |= {f"joints.{name}.{key}.value": where, f"controls.{control_name(name, key)}.value": where}
    places[f"joints.{parts.joints[0].name}.bodies"] = f"{place}.body"
    return parts


def _load_chain(table: CheckedTable, folder: Path) -> Chain | None:
    faults = len(table.faults)
    robot = table.text("robot")
    if "\0" in robot:  # which no path has
        table.add_error("robot", f"found {format_value(robot)}, allowed: a robot or a file")
    if len(table.faults) > faults:
        return None
    base, tip = (table.text(key, "") or None for key in ("base_link", "tip_link"))
    try:
        path = folder / robot if Path(robot).suffix.lower() in ROBOT_SUFFIXES else robot
        return load_robot(path, base_link=base, tip_link=tip)
    except (OptionError, RobotError) as error:
        for finding in error.findings:
            table.add_error("robot", str(finding))
    return None


def _read_chain_start(table: CheckedTable, chain: Chain, units: Units) -> tuple[float, ...]:
    """Return the start of the coordinates in [rad] and [m]; that of the robot without `start`."""
    value = table.value("start")
    if value is None:
        return chain.start
    if not is_number_list(value, len(chain.moving)):
        allowed = f"{len(chain.moving)} finite numbers: {', '.join(chain.coordinates)}"
        table.add_error("start", f"found {format_value(value)}, allowed: {allowed}")
        return chain.start
    return tuple(
        units.of_joint(joint.kind, float(start)) for joint, start in zip(chain.moving, value, strict=True)
    )


def _read_chain_values(table: CheckedTable, chain: Chain, units: Units) -> dict[str, Expression]:
    """Return the functions that drive coordinates, in [rad] and [m]."""
    rows, values_table = table.value("value"), table.table("value")
    kinds = {joint.name: joint.kind for joint in chain.moving}
    values = {}
    for key, value in rows.items() if isinstance(rows, Mapping) else ():
        if key in kinds:
            unit = "m" if kinds[key] == "prismatic" else "rad"
            values[key] = parse_expression(values_table, key, value, unit, units)
        else:
            values_table.add_error(key, f"coordinate {format_unknown_name(key, kinds)}")
    return values


def chain_to_parts(
    name: str, chain: Chain, carrier: str, start: Sequence[float], values: Mapping[str, Expression]
) -> Parts:
    """Return a chain as parts of a network.

    The bodies NAME.JOINT are the moving frames of `kinematics.forward.iter_frames`, NAME.tool is the tool.
    Joints have the names of the bodies that they carry. A control NAME_JOINT drives a joint with followers.

    Args:
        name: Its name in the network.
        chain: The chain.
        carrier: The body to which its base is fixed.
        start: The start of its coordinates, in [rad] and [m].
        values: The functions that drive coordinates, in [rad] and [m]; the others are free.
    """
    starts = dict(zip(chain.coordinates, start, strict=True))
    drives, controls, joints = dict(values), [], []
    for coordinate in dict.fromkeys(joint.mimic.joint for joint in chain.joints if joint.mimic):
        control = control_name(name, coordinate)
        controls.append(Control(control, starts[coordinate], value=values.get(coordinate)))
        drives[coordinate] = Expression(control)
    body, at = carrier, chain.base
    for joint in chain.joints:
        ends = (body, f"{name}.{joint.name}")
        joints.append(_chain_joint_to_joint(joint, ends, at @ joint.origin, starts, drives))
        body, at = ends[1], Transform()
    joints.append(_fixed_joint((body, f"{name}.tool"), at @ chain.tip @ chain.tool))
    return Parts(name, tuple(Body(joint.name) for joint in joints), tuple(joints), (), tuple(controls))


def control_name(name: str, coordinate: str) -> str:
    """Return the name of the control that drives a coordinate which other joints follow."""
    return re.sub(r"\W|^(?=\d)", "_", f"{name}_{coordinate}")


def _chain_joint_to_joint(
    joint: ChainJoint,
    ends: tuple[str, str],
    origin: Transform,
    starts: Mapping[str, float],
    drives: Mapping[str, Expression],
) -> Joint:
    """Return a joint whose A_1 T A_2^-1 is the origin and the motion of a joint of a chain."""
    if joint.kind == "fixed":
        return _fixed_joint(ends, origin)
    drive, start = drives.get(joint.name), starts.get(joint.name, 0.0)
    if joint.mimic is not None:
        leader = drives[joint.mimic.joint].text
        drive = Expression(f"{leader} * {float(joint.mimic.multiplier)!r} + {float(joint.mimic.offset)!r}")
        start = joint.mimic.multiplier * starts[joint.mimic.joint] + joint.mimic.offset
    is_limited = math.isfinite(joint.lower) or math.isfinite(joint.upper)
    axis_frame = _frame_of_axis(joint.axis)
    return Joint(
        ends[1],
        joint.kind,
        ends,
        (origin @ axis_frame, axis_frame),
        start=(float(start),),
        values=() if drive is None else (drive,),
        limits=((joint.lower, joint.upper),) if is_limited else (),
    )


def _frame_of_axis(axis: Vector) -> Transform:
    """Return a frame at the origin whose n is an axis; the identity of y."""
    if axis == (0.0, 1.0, 0.0):
        return Transform()
    least = min(range(3), key=lambda k: abs(axis[k]))
    x, y, z = cross(AXES[least], axis)
    length = (x * x + y * y + z * z) ** 0.5
    return frame_from_axes((x / length, y / length, z / length), axis, ZERO)


def _fixed_joint(ends: tuple[str, str], frame: Transform) -> Joint:
    m, n, _ = frame.columns
    motion = tuple(Expression(repr(float(entry))) for entry in (*m, *n, *frame.translation))
    return Joint(ends[1], "user", ends, motion=motion)


# --- higher pairs


def read_pair(
    name: str, kind: ElementKind, table: CheckedTable, joints: Mapping[str, Joint], units: Units, folder: Path
) -> ConstraintElement:
    """Return a gear, rack or cam from its table."""
    names = table.texts("joints")
    first, second = (joints.get(joint) for joint in (*names, "", "")[:2])
    unit = "rad" if kind == "gear" or (kind == "cam" and second and second.kind == "revolute") else "m"
    offset = read_expression(table, "offset", unit, units) if table.has("offset") else Expression("0.0")
    pair = ConstraintElement(
        name,
        kind,
        pair_bodies(first, second) if first and second else ("", ""),
        offset,
        joints=names,
        teeth=table.numbers("teeth", 2) if kind == "gear" else (),
        radius=units.length(table.number("radius")) if kind == "rack" else 0.0,
        profile=_read_profile(table, unit, units, folder) if kind == "cam" else (),
    )
    table.report_unknown_keys()
    return pair


def _read_profile(table: CheckedTable, unit: str, units: Units, folder: Path) -> Profile:
    """Return the points of `profile`, a list or a CSV file, in [rad] and the unit of the follower."""
    value = table.value("profile")
    rows: Sequence[Any]
    if isinstance(value, str):
        rows = _read_csv(table, value, folder)
    else:
        rows = value if isinstance(value, (list, tuple)) else []
        unreadable = [k for k, row in enumerate(rows) if not is_number_list(row, 2)]
        for k in unreadable:
            allowed = "[angle, lift], two finite numbers"
            table.add_error(f"profile[{k}]", f"found {format_value(rows[k])}, allowed: {allowed}")
        if rows is not value:
            text = "nothing" if value is None else format_value(value)
            table.add_error("profile", f"found {text}, allowed: a list of [angle, lift], or a .csv file")
        rows = [] if unreadable else rows
    return tuple((to_si(float(a), "rad", units), to_si(float(b), unit, units)) for a, b in rows)


def _read_csv(table: CheckedTable, file: str, folder: Path) -> list[tuple[float, float]]:
    """Return the rows of a file of two columns; its first line may name these."""
    try:
        with (folder / file).open(encoding="utf-8-sig") as lines:
            rows = [line.strip().split(",") for line in islice(lines, MAX_POINTS + 2)]
    except (OSError, ValueError) as error:  # a ValueError: no text, or no path
        reason = error.strerror if isinstance(error, OSError) else "it is no text"
        table.add_error(
            "profile", f"{format_value(file)} cannot be read: {reason}; allowed: a .csv file of two columns"
        )
        return []
    points, faults = [], []
    for number, row in enumerate(rows, 1):
        pair = [_parse_number(cell) for cell in row]
        if len(pair) == 2 and all(map(is_number, pair)):
            points.append((pair[0], pair[1]))
        elif row != [""] and not (number == 1 and all(map(math.isnan, pair))):
            faults.append(f"{file}, line {number}: found {format_value(','.join(row))}")
    for message in faults[:MAX_LISTED]:
        table.add_error("profile", f"{message}, allowed: angle,lift, two finite numbers")
    if len(faults) > MAX_LISTED:
        table.add_error("profile", f"{file}: {len(faults) - MAX_LISTED} more such lines")
    return [] if faults else points


def _parse_number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan
