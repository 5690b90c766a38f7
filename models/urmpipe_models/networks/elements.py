"""Joints and bodies by Denavit-Hartenberg parameters: open and closed chains of joint-body elements.

A robot as bodies and joints of a network: one body a joint of its chain, and one for the tool.

Higher pairs: gears, racks and cams, as equations between the variables of two joints.

With the angle q_1 of the first joint, the variable q_2 of the second joint, and an offset,

    q_2 = offset + f(q_1)

    gear    f = -(z_1 / z_2) q_1            z: teeth, negative of an internal wheel
    rack    f = r q_1                       r: radius of the pinion, with a sign
    cam     f = S(q_1)                      S: periodic cubic spline through the points of the profile

The variables are not reduced by full turns: a gear keeps the count of its turns.

1. `transmission`: f and its derivative, elementwise.
2. `read_pair`: a pair from its table of a file, with the profile of a cam from a CSV file.
3. `pair_faults`: the errors of a pair.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.arm.chain import Joint as ChainJoint
from urmpipe_models.elementwise import ZERO, Element, FloatArray, Vector, cross
from urmpipe_models.errors import Finding, OptionError, RobotError, format_unknown_name, format_value
from urmpipe_models.math3d import Transform, rotation_x, rotation_y, translation
from urmpipe_models.networks.file_values import (
    IDENTITY_MOTION,
    parse_expression,
    read_drives,
    read_expression,
    to_si,
)
from urmpipe_models.networks.parts import (
    JOINT_UNITS,
    PAIR_JOINTS,
    Body,
    ConstraintElement,
    Control,
    ElementKind,
    Expression,
    Joint,
    JointKind,
    Parts,
    frame_from_axes,
    pair_bodies,
)
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.toml import Units
from urmpipe_models.toml_tables import CheckedTable, is_number, is_number_list

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


def element_to_joint(element: DHElement, ends: tuple[str, str]) -> Joint:
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
    table: CheckedTable, units: Units, ground: str, places: dict[str, str]
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
    table.report_unknown_keys()
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


def _read_joint(name: str, row: CheckedTable, units: Units, ends: tuple[str, str]) -> Joint:
    """Return the joint of an element; one that cannot move where its kind is none."""
    many = len(row.faults)
    kind = row.choice("kind", tuple(DH_KINDS))
    if len(row.faults) > many:  # its keys are those of no kind
        return Joint(name, "user", ends, motion=IDENTITY_MOTION)
    keys = ("a", "alpha", "theta") if kind == "H" else ("a", "alpha", "s", "theta")
    numbers = {key: row.number(key, 0.0) for key in keys}
    element = DHElement(
        name,
        kind,
        **{key: (units.length if key in {"a", "s"} else units.angle)(one) for key, one in numbers.items()},
        pitch=units.length(row.number("pitch")) if kind == "H" else 0.0,
        values=read_drives(row, JOINT_UNITS[DH_KINDS[kind]], units),
    )
    row.report_unknown_keys()
    return element_to_joint(element, ends)


FILES = {".toml", ".urdf", ".xacro"}
"""Suffixes of robots that are files, beside that of the network."""


@dataclass(slots=True)
class ChainParts:
    """What a chain adds to a network.

    Attributes:
        bodies: NAME.JOINT with the moving frame of each joint, and NAME.tool.
        joints: NAME.JOINT of each joint, and NAME.tool, which cannot move.
        controls: NAME_JOINT of each joint that others follow.
    """

    bodies: list[Body] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)
    controls: list[Control] = field(default_factory=list)


def chain_to_parts(
    name: str, chain: Chain, carrier: str, start: Sequence[float], values: Mapping[str, Expression]
) -> ChainParts:
    """Return a chain as parts of a network: its bodies are the moving frames of `kinematics.frames.frames`.

    Args:
        name: Its name in the network.
        chain: The chain.
        carrier: The body that its base stands on.
        start: Where its coordinates start, in [rad] and [m].
        values: What drives coordinates, in [rad] and [m]; the others are free.
    """
    parts = ChainParts()
    starts = dict(zip(chain.coordinates, start, strict=True))
    drives: dict[str, Expression] = dict(values)
    for coordinate in dict.fromkeys(one.mimic.joint for one in chain.joints if one.mimic):
        control = control_name(name, coordinate)
        parts.controls.append(Control(control, starts[coordinate], value=values.get(coordinate)))
        drives[coordinate] = Expression(control)
    body, at = carrier, chain.base
    for one in chain.joints:
        ends = (body, f"{name}.{one.name}")
        parts.joints.append(_joint(one, ends, at @ one.origin, starts, drives))
        parts.bodies.append(Body(ends[1]))
        body, at = ends[1], Transform()
    tool = (body, f"{name}.tool")
    parts.joints.append(_fixed(tool, at @ chain.tip @ chain.tool))
    parts.bodies.append(Body(tool[1]))
    return parts


def control_name(name: str, coordinate: str) -> str:
    """Return the name of the control that drives a coordinate which other joints follow."""
    return re.sub(r"\W|^(?=\d)", "_", f"{name}_{coordinate}")


def _joint(
    one: ChainJoint,
    ends: tuple[str, str],
    origin: Transform,
    starts: Mapping[str, float],
    drives: Mapping[str, Expression],
) -> Joint:
    """Return a joint of a chain: A_1 T A_2^-1 is its frame and what it moves."""
    if one.kind == "fixed":
        return _fixed(ends, origin)
    turned = _along(one.axis)
    drive = drives.get(one.name)
    start = starts.get(one.name, 0.0)
    if one.mimic is not None:
        leader = drives[one.mimic.joint].text
        drive = Expression(f"{leader} * {float(one.mimic.multiplier)!r} + {float(one.mimic.offset)!r}")
        start = one.mimic.multiplier * starts[one.mimic.joint] + one.mimic.offset
    return Joint(
        ends[1],
        one.kind,
        ends,
        (origin @ turned, turned),
        start=(float(start),),
        values=() if drive is None else (drive,),
        limits=((one.lower, one.upper),) if math.isfinite(one.lower) or math.isfinite(one.upper) else (),
    )


_AXES: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _along(axis: Vector) -> Transform:
    """Return a frame at the origin whose n is an axis; the identity of y."""
    if axis == (0.0, 1.0, 0.0):
        return Transform()
    least = min(range(3), key=lambda k: abs(axis[k]))
    x, y, z = cross(_AXES[least], axis)
    length = (x * x + y * y + z * z) ** 0.5
    return frame_from_axes((x / length, y / length, z / length), axis, ZERO)


def _fixed(ends: tuple[str, str], frame: Transform) -> Joint:
    """Return a joint that holds its second body at a frame of the first."""
    m, n, _ = frame.columns
    motion = tuple(Expression(repr(float(one))) for one in (*m, *n, *frame.translation))
    return Joint(ends[1], "user", ends, motion=motion)


def read_chain(
    name: str, table: CheckedTable, units: Units, folder: Path, ground: str, places: dict[str, str]
) -> ChainParts | None:
    """Return the parts of a robot; None where that cannot be read.

    Args:
        name: Its name in the network.
        table: Its table, with `robot`, `base_link`, `tip_link`, `body`, `start` and `value`.
        units: The units of the file.
        folder: Where files of robots are relative to.
        ground: The body that carries it where its table has none.
        places: Of each joint, body and control here the place in the file is added.
    """
    place = f"chains.{name}"
    chain, carrier = _load(table, folder), table.text("body", ground)
    if chain is None:  # then its start and what drives it cannot be checked
        return None
    start, values = _start(table, chain, units), _values(table, chain, units)
    table.report_unknown_keys()
    parts = chain_to_parts(name, chain, carrier, start, values)
    places |= {f"joints.{one.name}": place for one in parts.joints}
    places |= {f"bodies.{one.name}": place for one in parts.bodies}
    places |= {f"controls.{one.name}": place for one in parts.controls}
    for key in values:
        where = f"{place}.value.{key}"
        places |= {f"joints.{name}.{key}.value": where, f"controls.{control_name(name, key)}.value": where}
    places[f"joints.{parts.joints[0].name}.bodies"] = f"{place}.body"
    return parts


def _load(table: CheckedTable, folder: Path) -> Chain | None:
    """Return a robot of the catalogue or of a file; what is wrong with it is noted."""
    many = len(table.faults)
    robot = table.text("robot")
    if "\0" in robot:  # which no path has
        table.add_error("robot", f"found {format_value(robot)}, allowed: a robot or a file")
    if len(table.faults) > many:
        return None
    base, tip = (table.text(key, "") or None for key in ("base_link", "tip_link"))
    try:
        path = folder / robot if Path(robot).suffix.lower() in FILES else robot
        return load_robot(path, base_link=base, tip_link=tip)
    except (OptionError, RobotError) as error:
        for one in error.findings:
            table.add_error("robot", str(one))
    return None


def _start(table: CheckedTable, chain: Chain, units: Units) -> tuple[float, ...]:
    """Return where the coordinates start in [rad] and [m], as the robot says where the network does not."""
    value = table.value("start")
    if value is None:
        return chain.start
    if not is_number_list(value, len(chain.moving)):
        allowed = f"{len(chain.moving)} finite numbers: {', '.join(chain.coordinates)}"
        table.add_error("start", f"found {format_value(value)}, allowed: {allowed}")
        return chain.start
    return tuple(
        units.of_joint(joint.kind, float(one)) for joint, one in zip(chain.moving, value, strict=True)
    )


def _values(table: CheckedTable, chain: Chain, units: Units) -> dict[str, Expression]:
    """Return what drives coordinates, in [rad] and [m]."""
    given, inner = table.value("value"), table.table("value")
    kinds = {one.name: one.kind for one in chain.moving}
    found = {}
    for key, value in given.items() if isinstance(given, Mapping) else ():
        if key in kinds:
            unit = "m" if kinds[key] == "prismatic" else "rad"
            found[key] = parse_expression(inner, key, value, unit, units)
        else:
            inner.add_error(key, f"coordinate {format_unknown_name(key, kinds)}")
    return found


TURN = 2.0 * math.pi
MIN_POINTS, MAX_POINTS = 4, 1000  # of a profile: a third of a degree apart; each costs a comparison
MAX_LISTED = 10  # faulty lines of a CSV file that are named; the others are counted
MAX_VALUE = 1e9  # no radius or lift of a mechanism is larger, in [m] or [rad]

Profile = tuple[tuple[float, float], ...]


def transmission(element: ConstraintElement, angle: Element) -> tuple[Element, Element]:
    """Return f of the angle of the first joint, and its derivative.

    Args:
        element: A gear, a rack or a cam.
        angle: In [rad], any element.

    Returns:
        In [rad] or [m], and in that unit per [rad].
    """
    if element.kind == "cam":
        return _spline_value(element.profile, angle)
    slope = element.radius if element.kind == "rack" else -element.teeth[0] / element.teeth[1]
    return slope * angle, slope


def _spline_value(profile: Profile, angle: Element) -> tuple[Element, Element]:
    """Return the periodic cubic spline through the points of a profile, and its derivative.

    Every segment is evaluated, then the right value selected: so symbols pass, too.
    """
    coefficients, first = _segments(profile), profile[0][0]
    turned = angle - first
    turned = turned - TURN * np.floor(turned / TURN)
    value: Element = 0.0
    slope: Element = 0.0
    for k, (start, a, b, c, d) in enumerate(coefficients.tolist()):
        u = turned - start
        cubic, rate = a + u * (b + u * (c + u * d)), b + u * (2.0 * c + u * (3.0 * d))
        value = np.where(turned >= start, cubic, value) if k else cubic
        slope = np.where(turned >= start, rate, slope) if k else rate
    return value, slope


@lru_cache(maxsize=64)
def _segments(profile: Profile) -> FloatArray:
    """Return where each segment starts after the first point in [rad], and its a, b, c, d, shape (n, 5).

    a + b u + c u^2 + d u^3. The second derivatives M solve
    h_(i-1) M_(i-1) + 2 (h_(i-1) + h_i) M_i + h_i M_(i+1) = 6 (s_i - s_(i-1)), s the slopes of the chords, all
    indices modulo n.

    Source: de Boor 1978, A Practical Guide to Splines, chapter IV, with periodic ends.
    """
    x, y = np.array(profile).T
    h = np.diff(x, append=x[0] + TURN)
    chords = (np.roll(y, -1) - y) / h
    before = np.roll(h, 1)
    eye = np.eye(len(x))
    matrix = 2.0 * np.diag(before + h)
    matrix += before[:, np.newaxis] * np.roll(eye, -1, axis=1) + h[:, np.newaxis] * np.roll(eye, 1, axis=1)
    M = np.linalg.solve(matrix, 6.0 * (chords - np.roll(chords, 1)))
    after = np.roll(M, -1)
    return np.stack(
        (x - x[0], y, chords - h * (2.0 * M + after) / 6.0, 0.5 * M, (after - M) / (6.0 * h)), axis=1
    )


# --- reading


def read_pair(
    name: str, kind: ElementKind, table: CheckedTable, joints: Mapping[str, Joint], units: Units, folder: Path
) -> ConstraintElement:
    """Return a gear, rack or cam from its table; errors are noted there.

    Args:
        name: Its name.
        kind: gear, rack or cam.
        table: Its table, with `joints`, `offset`, and `teeth`, `radius` or `profile`.
        joints: The joints of the network by name.
        units: The units of the file.
        folder: Where a file of a profile is relative to.
    """
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
            table.add_error(
                f"profile[{k}]", f"found {format_value(rows[k])}, allowed: [angle, lift], two finite numbers"
            )
        if rows is not value:
            text = "nothing" if value is None else format_value(value)
            table.add_error("profile", f"found {text}, allowed: a list of [angle, lift], or a .csv file")
        rows = [] if unreadable else rows
    return tuple((to_si(float(a), "rad", units), to_si(float(b), unit, units)) for a, b in rows)


def _read_csv(table: CheckedTable, file: str, folder: Path) -> list[tuple[float, float]]:
    """Return the rows of a file of two columns; its first line may name these."""
    try:
        with (folder / file).open(encoding="utf-8-sig") as lines:
            cells = [line.strip().split(",") for line in islice(lines, MAX_POINTS + 2)]
    except (OSError, ValueError) as error:  # a ValueError: no text, or no path
        reason = error.strerror if isinstance(error, OSError) else "it is no text"
        table.add_error(
            "profile", f"{format_value(file)} cannot be read: {reason}; allowed: a .csv file of two columns"
        )
        return []
    points, faults = [], []
    for number, row in enumerate(cells, 1):
        pair = [_number(cell) for cell in row]
        if len(pair) == 2 and all(map(is_number, pair)):
            points.append((pair[0], pair[1]))
        elif row != [""] and not (number == 1 and all(map(math.isnan, pair))):
            faults.append(f"{file}, line {number}: found {format_value(','.join(row))}")
    for message in faults[:MAX_LISTED]:
        table.add_error("profile", f"{message}, allowed: angle,lift, two finite numbers")
    if len(faults) > MAX_LISTED:
        table.add_error("profile", f"{file}: {len(faults) - MAX_LISTED} more such lines")
    return [] if faults else points


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


# --- faults


def pair_faults(where: str, element: ConstraintElement, parts: Parts) -> Iterator[Finding]:
    """Yield the errors of a pair; those that may follow from an unreadable joint have the kind "coupled".

    Args:
        where: Its place in a file, such as elements.mesh.
        element: The pair.
        parts: The parts of its network.
    """
    yield from _joints_faults(where, element, parts)
    if element.kind == "gear":
        yield from _teeth_faults(f"{where}.teeth", element.teeth)
    elif element.kind == "rack" and not 0.0 < abs(element.radius) <= MAX_VALUE:
        allowed = f"a radius other than 0, {MAX_VALUE:g} m at most; its sign is that of the motion"
        yield Finding(f"found {element.radius:g} m, allowed: {allowed}", about=f"{where}.radius")
    elif element.kind == "cam":
        yield from _profile_faults(f"{where}.profile", element.profile)


def _joints_faults(where: str, element: ConstraintElement, parts: Parts) -> Iterator[Finding]:
    """Yield unknown joints, joints of the wrong kind, and a joint that is named twice."""
    place, joints = f"{where}.joints", {joint.name: joint for joint in parts.joints}
    if len(element.joints) != 2:
        yield Finding(f"found {len(element.joints)}, allowed: the names of two joints", about=place)
        return
    if element.joints[0] == element.joints[1]:
        yield Finding(f"found {element.joints[0]} twice, allowed: two joints", about=place)
    kinds = PAIR_JOINTS[element.kind]
    for name, allowed, order in zip(element.joints, kinds, ("first", "second"), strict=True):
        if name not in joints:
            yield Finding(f"joint {format_unknown_name(name, joints)}", about=place, kind="coupled")
        elif joints[name].kind not in allowed:
            message = f"found {name}, a {joints[name].kind} joint, allowed as the {order} of a {element.kind}"
            yield Finding(f"{message}: {', '.join(allowed)}", about=place, kind="coupled")
    known = [joints[name] for name in element.joints if name in joints]
    if len(known) == 2 and element.bodies != (ends := pair_bodies(*known)):
        message = f"found {', '.join(element.bodies)}, allowed: those of its joints, {', '.join(ends)}"
        yield Finding(message, about=f"{where}.bodies")


def _teeth_faults(where: str, teeth: tuple[float, ...]) -> Iterator[Finding]:
    """Yield teeth that are 0, and two internal wheels."""
    allowed = "two numbers other than 0, at most one of them negative: that of an internal wheel"
    if len(teeth) != 2 or not all(0.0 < abs(count) <= MAX_VALUE for count in teeth) or max(teeth) < 0.0:
        yield Finding(f"found {', '.join(f'{count:g}' for count in teeth)}, allowed: {allowed}", about=where)


def _profile_faults(where: str, profile: Profile) -> Iterator[Finding]:
    """Yield a number of points, numbers and angles that make no periodic spline."""
    if not MIN_POINTS <= len(profile) <= MAX_POINTS:
        yield Finding(f"found {len(profile)} points, allowed: {MIN_POINTS} to {MAX_POINTS}", about=where)
    for k, row in enumerate(profile):
        if not all(abs(number) <= MAX_VALUE for number in row):  # NaN is not, either
            text = ", ".join(f"{number:g}" for number in row)
            yield Finding(f"found {text}, allowed: finite numbers of a mechanism", about=f"{where}[{k}]")
    for k, ((before, _), (angle, _)) in enumerate(pairwise(profile), 1):
        if angle <= before:
            message = f"found the angle {angle:g} rad after {before:g} rad"
            yield Finding(f"{message}, allowed: angles that increase", about=f"{where}[{k}]")
    if profile and profile[-1][0] - profile[0][0] >= TURN - 1e-9:
        span = f"found angles over {profile[-1][0] - profile[0][0]:.6g} rad"
        reason = "the first point repeats after it"
        yield Finding(f"{span}, allowed: less than a full turn: {reason}", about=where)
