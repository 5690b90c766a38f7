"""The links of the arm as they look: their shapes, and the frames that these move with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.chains.visual import Visual
from urmpipe_models.kinematics.forward import frames_over_log
from urmpipe_models.orientation import quaternions
from urmpipe_pipeline.meshes import drawable


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """What moves as one: a frame of the arm and the shapes on it.

    Attributes:
        joint: Name of the joint whose frame it is; None for the base.
        position: Of the frame in the world in [m], shape (m, 3).
        quat_xyzw: Its rotation as unit quaternions [-], shape (m, 4).
        visuals: The shapes that can be drawn, at least one.
    """

    joint: str | None
    position: FloatArray
    quat_xyzw: FloatArray
    visuals: tuple[Visual, ...]


def bodies_over_log(robot: Chain, q: FloatArray) -> tuple[Body, ...]:
    """Return the links of an arm that have shapes which can be drawn.

    Args:
        robot: The arm.
        q: Joint values in [rad] or [m], shape (m, joints).
    """
    shown = [visual for visual in robot.visuals if drawable(visual)]
    if not shown:
        return ()
    position, rotation = frames_over_log(robot, q)
    carriers = [None, *(joint.name for joint in robot.joints)]
    return tuple(
        Body(
            carrier,
            position[:, k],
            quaternions(rotation[:, k].reshape(-1, 9), "matrix"),
            tuple(visual for visual in shown if visual.joint == carrier),
        )
        for k, carrier in enumerate(carriers)
        if any(visual.joint == carrier for visual in shown)
    )


def lacks_shapes(robot: Chain, bodies: Sequence[Body]) -> bool:
    """Tell whether a moving link shows nothing; frames fixed to it count as the link."""
    moving = np.cumsum([joint.kind != "fixed" for joint in robot.joints])
    link = dict(zip((joint.name for joint in robot.joints), moving.tolist(), strict=True))
    shown = {link[body.joint] for body in bodies if body.joint is not None}
    return not set(range(1, int(moving[-1]) + 1)) <= shown
