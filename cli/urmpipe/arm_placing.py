"""The arm that keywords name, place and cut."""

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
Frame = Transform | Sequence[float] | FloatArray
"""A frame: x, y, z in [m] and, if it turns, rx, ry, rz in [rad]; or a 4 by 4 matrix; or a `Transform`."""

FRAME_ALLOWED = "x, y, z in m and rx, ry, rz in rad (3 or 6 numbers), a 4 x 4 matrix, or a Transform"

GIANT = 10
"""A tool that is more times as long as its arm was written in mm: 13 of them would be 13 m on a UR5e."""

NO_ROBOT = (Hint("robot", None, "sets one"),)


def place_robot(
    robot: Robot | None,
    base: Frame | None = None,
    tool: Frame | None = None,
    *,
    base_link: str | None = None,
    tip_link: str | None = None,
) -> Chain | None:
    """Return the arm on its base and with its tool; None without a robot.

    Args:
        robot: Name, file (TOML, URDF) or chain of the arm.
        base: Where the arm stands in the world, in [m] and [rad]; as a matrix of shape (4, 4).
        tool: The tool centre point in the frame of the arm's tip, likewise.
        base_link: Link of a URDF where the arm begins.
        tip_link: Link of a URDF where it ends.

    Raises:
        RobotError: If the robot is unknown, or with everything that is wrong with its file.
        OptionError: If the arm is placed or cut, but there is none; if the tool dwarfs it.
    """
    given = {"base": base, "tool": tool, "base_link": base_link, "tip_link": tip_link}
    frames = (frame_of("base", base), frame_of("tool", tool))
    if robot is None:
        unused = [name for name, value in given.items() if value is not None]
        if unused:
            raise OptionError(
                *(Finding("found without a robot", parameter=name, hints=NO_ROBOT) for name in unused)
            )
        return None
    links = {"base_link": base_link, "tip_link": tip_link}
    if isinstance(robot, Chain):
        cut = [name for name, link in links.items() if link is not None]
        if cut:
            allowed = "with a URDF file; the links of a Chain are fixed"
            raise OptionError(*(Finding(parameter=name, found="a Chain", allowed=allowed) for name in cut))
    chain = robot if isinstance(robot, Chain) else load_robot(robot, **links)
    _refuse_giant_tool(chain, frames[1])
    return chain.placed(*frames)


def _refuse_giant_tool(chain: Chain, tool: Transform | None) -> None:
    """Raise an `OptionError` for a tool many times as long as its arm: it was written in mm."""
    if tool is None:
        return
    from urmpipe_models.kinematics.singularity import characteristic_length

    reach, length = characteristic_length(chain), math.hypot(*tool.translation)
    if length > GIANT * reach:
        found = f"{length:g} m from the tip, {length / reach:.0f} times the length of {chain.name}"
        allowed = f"up to {GIANT} times it; a number without a unit is in m"
        raise OptionError(Finding(parameter="tool", found=found, allowed=allowed))


def frame_of(name: str, given: Frame | None) -> Transform | None:
    """Return the frame that was given; None for none.

    Args:
        name: The keyword, for messages.
        given: x, y, z in [m] and, if it turns, rx, ry, rz in [rad]; a homogeneous matrix, shape (4, 4); or a
            transform.

    Raises:
        OptionError: If it is anything else, or its matrix does not turn.
    """
    if given is None or isinstance(given, Transform):
        return given
    try:
        values = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        raise OptionError(Finding(parameter=name, found=format_value(given), allowed=FRAME_ALLOWED)) from None
    if values.shape not in ((3,), (6,), (4, 4)) or not np.isfinite(values).all():
        found = f"{format_value(given)} of shape {values.shape}"
        raise OptionError(Finding(parameter=name, found=found, allowed=f"{FRAME_ALLOWED}, all finite"))
    if values.ndim == 1:
        return from_offset(values.tolist())
    turn = values[:3, :3]
    proper = np.abs(turn @ turn.T - np.eye(3)).max() < ROTATION_TOLERANCE and np.linalg.det(turn) > 0.0
    if not proper or np.abs(values[3] - (0.0, 0.0, 0.0, 1.0)).max() > ROTATION_TOLERANCE:
        found, allowed = "a matrix that is not a rigid motion", "a rotation and a translation"
        raise OptionError(Finding(parameter=name, found=found, allowed=allowed))
    rows, place = tuple(map(tuple, turn.tolist())), tuple(values[:3, 3].tolist())
    return Transform(cast("Any", rows), cast("Any", place))


def offset_of(frame: Transform) -> tuple[float, ...]:
    """Return a frame as X, Y, Z in [m], with RX, RY, RZ in [rad] if it turns; nothing for none at all."""
    if frame == Transform():
        return ()
    turn = () if frame.rotation == Transform().rotation else matrix_to_rpy(frame.rotation)
    return tuple(float(value) + 0.0 for value in (*frame.translation, *turn))  # + 0.0: no -0.0 in the file
