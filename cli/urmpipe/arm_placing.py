"""The robot of a command: loaded by name or file, cut at links, placed on its base, with its tool."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, Hint, OptionError, format_value
from urmpipe_models.ik.solutions import ROTATION_TOLERANCE
from urmpipe_models.math3d import Transform, from_offset, matrix_to_rpy
from urmpipe_models.robots.catalogue import load_robot

Robot = Chain | str | Path
Frame = Transform | Sequence[float] | FloatArray  # x, y, z[, rx, ry, rz] in [m], [rad]; matrix; transform
FRAME_ALLOWED = "x, y, z in m and rx, ry, rz in rad (3 or 6 numbers), a 4 x 4 matrix, or a Transform"
MAX_TOOL_RATIO = 10  # lengths of the robot; a longer tool is in mm: ten are 13 m on a UR5e
NO_ROBOT = (Hint("robot", None, "sets one"),)


def place_robot(
    robot: Robot | None,
    base: Frame | None = None,
    tool: Frame | None = None,
    *,
    base_link: str | None = None,
    tip_link: str | None = None,
) -> Chain | None:
    """Return the robot on its base and with its tool; None without a robot.

    Args:
        robot: Name, file (TOML, URDF) or chain of the robot.
        base: Pose of the robot's base in the world, in [m] and [rad]; as a matrix of shape (4, 4).
        tool: Pose of the tool centre point in the frame of the robot's tip, likewise.
        base_link: Link of a URDF where the robot begins.
        tip_link: Link of a URDF where it ends.

    Raises:
        RobotError: If the robot is unknown, or with all faults of its file.
        OptionError: If the robot is placed or cut, but there is none; if the tool dwarfs it.
    """
    placing = {"base": base, "tool": tool, "base_link": base_link, "tip_link": tip_link}
    base_frame, tool_frame = parse_frame("base", base), parse_frame("tool", tool)
    if robot is None:
        unused = [name for name, value in placing.items() if value is not None]
        if unused:
            message = "found without a robot"
            raise OptionError(*(Finding(message, parameter=name, hints=NO_ROBOT) for name in unused))
        return None
    links = {"base_link": base_link, "tip_link": tip_link}
    if isinstance(robot, Chain):
        cut = [name for name, link in links.items() if link is not None]
        if cut:
            allowed = "with a URDF file; the links of a Chain are fixed"
            raise OptionError(*(Finding(parameter=name, found="a Chain", allowed=allowed) for name in cut))
    chain = robot if isinstance(robot, Chain) else load_robot(robot, **links)
    if tool_frame is not None:
        from urmpipe_models.kinematics.singularity import characteristic_length

        reach, length = characteristic_length(chain), math.hypot(*tool_frame.translation)
        if length > MAX_TOOL_RATIO * reach:
            value = f"{length:g} m from the tip, {length / reach:.0f} times the length of {chain.name}"
            allowed = f"up to {MAX_TOOL_RATIO} times it; a number without a unit is in m"
            raise OptionError(Finding(parameter="tool", found=value, allowed=allowed))
    return chain.placed(base_frame, tool_frame)


def parse_frame(name: str, frame: Frame | None) -> Transform | None:
    """Return a frame as a transform; None for None.

    Args:
        name: The keyword, for messages.
        frame: x, y, z in [m] and, if it turns, rx, ry, rz in [rad]; a homogeneous matrix, shape (4, 4); or a
            transform.

    Raises:
        OptionError: If it is anything else, or its matrix is not a rigid motion.
    """
    if frame is None or isinstance(frame, Transform):
        return frame
    try:
        values = np.asarray(frame, dtype=float)
    except (TypeError, ValueError):
        raise OptionError(Finding(parameter=name, found=format_value(frame), allowed=FRAME_ALLOWED)) from None
    if values.shape not in ((3,), (6,), (4, 4)) or not np.isfinite(values).all():
        value = f"{format_value(frame)} of shape {values.shape}"
        raise OptionError(Finding(parameter=name, found=value, allowed=f"{FRAME_ALLOWED}, all finite"))
    if values.ndim == 1:
        return from_offset(values.tolist())
    rotation = values[:3, :3]
    error = np.abs(rotation @ rotation.T - np.eye(3)).max()
    is_rotation = error < ROTATION_TOLERANCE and np.linalg.det(rotation) > 0.0
    if not is_rotation or np.abs(values[3] - (0.0, 0.0, 0.0, 1.0)).max() > ROTATION_TOLERANCE:
        value, allowed = "a matrix that is not a rigid motion", "a rotation and a translation"
        raise OptionError(Finding(parameter=name, found=value, allowed=allowed))
    rows, translation = tuple(map(tuple, rotation.tolist())), tuple(values[:3, 3].tolist())
    return Transform(cast("Any", rows), cast("Any", translation))


def offset_of(frame: Transform) -> tuple[float, ...]:
    """Return a frame as X, Y, Z in [m], with RX, RY, RZ in [rad] if it turns; empty for the identity."""
    if frame == Transform():
        return ()
    angles = () if frame.rotation == Transform().rotation else matrix_to_rpy(frame.rotation)
    return tuple(float(value) + 0.0 for value in (*frame.translation, *angles))  # + 0.0: no -0.0 in the file
