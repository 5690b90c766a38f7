"""Arms as models of Pinocchio."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from urmpipe_models.arm.chain import Chain
from urmpipe_models.math3d import Transform

pinocchio: Any = pytest.importorskip("pinocchio")


def se3(frame: Transform) -> Any:
    return pinocchio.SE3(np.array(frame.rotation, dtype=float), np.array(frame.translation, dtype=float))


def pinocchio_model(chain: Chain) -> Any:
    """Build a chain without mimics, with its masses; its points are the frames p1, p2, ..., tool."""
    model, parent, frame = pinocchio.Model(), 0, se3(chain.base)
    for k, joint in enumerate(chain.joints):
        at_joint = frame * se3(joint.origin)
        add_frame(model, f"p{k}", parent, pinocchio.SE3(frame.rotation, at_joint.translation))
        frame = at_joint
        if joint.kind != "fixed":
            turns = joint.kind == "revolute"
            kind = pinocchio.JointModelRevoluteUnaligned if turns else pinocchio.JointModelPrismaticUnaligned
            parent = model.addJoint(parent, kind(np.array(joint.axis)), frame, joint.name)
            frame = pinocchio.SE3.Identity()
        for body in chain.inertials:
            if body.joint == joint.name and parent:
                ixx, iyy, izz, ixy, ixz, iyz = body.inertia
                inertia = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
                solid = pinocchio.Inertia(body.mass, np.array(body.centre), inertia)
                model.appendBodyToJoint(parent, solid, frame)
    add_frame(model, "tool", parent, frame * se3(chain.tip) * se3(chain.tool))
    model.gravity.linear = np.array(chain.gravity)
    return model


def add_frame(model: Any, name: str, parent: int, placement: Any) -> None:
    model.addFrame(pinocchio.Frame(name, parent, placement, pinocchio.FrameType.OP_FRAME))
