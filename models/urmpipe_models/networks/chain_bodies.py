"""A robot as bodies and joints of a network: one body a joint of its chain, and one for the tool."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from urmpipe_models.chains.chain import Chain
from urmpipe_models.chains.chain import Joint as ChainJoint
from urmpipe_models.elementwise import ZERO, Vector, cross
from urmpipe_models.errors import OptionError, RobotError, shown
from urmpipe_models.files.tables import Table, are_numbers
from urmpipe_models.names import not_among
from urmpipe_models.networks.expressions import Expression
from urmpipe_models.networks.file_values import expression
from urmpipe_models.networks.parts import Body, Control, Joint, frame_of
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.robot_frames import Units
from urmpipe_models.transform import Transform

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


def chain_parts(
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
    return frame_of((x / length, y / length, z / length), axis, ZERO)


def _fixed(ends: tuple[str, str], frame: Transform) -> Joint:
    """Return a joint that holds its second body at a frame of the first."""
    m, n, _ = frame.columns
    motion = tuple(Expression(repr(float(one))) for one in (*m, *n, *frame.translation))
    return Joint(ends[1], "user", ends, motion=motion)


def read_chain(
    name: str, table: Table, units: Units, folder: Path, ground: str, places: dict[str, str]
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
    table.close()
    parts = chain_parts(name, chain, carrier, start, values)
    places |= {f"joints.{one.name}": place for one in parts.joints}
    places |= {f"bodies.{one.name}": place for one in parts.bodies}
    places |= {f"controls.{one.name}": place for one in parts.controls}
    for key in values:
        where = f"{place}.value.{key}"
        places |= {f"joints.{name}.{key}.value": where, f"controls.{control_name(name, key)}.value": where}
    places[f"joints.{parts.joints[0].name}.bodies"] = f"{place}.body"
    return parts


def _load(table: Table, folder: Path) -> Chain | None:
    """Return a robot of the catalogue or of a file; what is wrong with it is noted."""
    many = len(table.faults)
    robot = table.text("robot")
    if "\0" in robot:  # which no path has
        table.fault("robot", f"found {shown(robot)}, allowed: a robot or a file")
    if len(table.faults) > many:
        return None
    base, tip = (table.text(key, "") or None for key in ("base_link", "tip_link"))
    try:
        path = folder / robot if Path(robot).suffix.lower() in FILES else robot
        return load_robot(path, base_link=base, tip_link=tip)
    except (OptionError, RobotError) as error:
        for one in error.findings:
            table.fault("robot", str(one))
    return None


def _start(table: Table, chain: Chain, units: Units) -> tuple[float, ...]:
    """Return where the coordinates start in [rad] and [m], as the robot says where the network does not."""
    value = table.value("start")
    if value is None:
        return chain.start
    if not are_numbers(value, len(chain.moving)):
        allowed = f"{len(chain.moving)} finite numbers: {', '.join(chain.coordinates)}"
        table.fault("start", f"found {shown(value)}, allowed: {allowed}")
        return chain.start
    return tuple(
        units.of_joint(joint.kind, float(one)) for joint, one in zip(chain.moving, value, strict=True)
    )


def _values(table: Table, chain: Chain, units: Units) -> dict[str, Expression]:
    """Return what drives coordinates, in [rad] and [m]."""
    given, inner = table.value("value"), table.table("value")
    kinds = {one.name: one.kind for one in chain.moving}
    found = {}
    for key, value in given.items() if isinstance(given, Mapping) else ():
        if key in kinds:
            unit = "m" if kinds[key] == "prismatic" else "rad"
            found[key] = expression(inner, key, value, unit, units)
        else:
            inner.fault(key, f"coordinate {not_among(key, kinds)}")
    return found
