"""Arms for tests: with joints of all kinds, with one joint, and with a passive wrist."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from made_masses import driven, with_masses
from urmpipe_models.arm.chain import Chain, Inertial, Joint, Mimic
from urmpipe_models.drives import CounterbalanceSpring, DrivenJoint, Gains, PassiveJoint
from urmpipe_models.math3d import from_offset, translation


def sliding_arm() -> Chain:
    """Joints that turn, slide, follow and stand still, none of them on an axis of its frame."""
    tilted = (0.6, 0.0, 0.8)
    return Chain(
        "slider",
        (
            Joint("turn", "revolute", from_offset((0.1, 0.2, 0.3, 0.4, 0.5, 0.6)), tilted),
            Joint("slide", "prismatic", from_offset((0.0, 0.1, 0.0, -0.3, 0.2, 0.1)), (0.0, 0.8, -0.6)),
            Joint("camera", "fixed", from_offset((0.1, 0.0, 0.0, 1.0, 0.0, 0.0))),
            Joint("finger", "prismatic", from_offset((0.0, 0.0, 0.2)), mimic=Mimic("slide", -0.5, 0.1)),
            Joint("wrist", "revolute", from_offset((0.3, 0.0, 0.0, 0.0, 1.2, 0.0)), (0.0, -1.0, 0.0)),
        ),
        tip=from_offset((0.0, 0.1, 0.2, 0.3, 0.0, 0.0)),
        base=from_offset((1.0, 0.0, 0.5, 0.0, 0.0, 0.7)),
        tool=from_offset((0.0, 0.0, 0.15, 0.1, 0.0, 0.0)),
        start=(0.3, 0.2, -0.4),
    )


def sprung_arm() -> Chain:
    """Return it with masses and drives: springs on driven joints, two periods, and a passive wrist."""
    calm = Gains(3.75, 0.375, 0.005)
    turn = replace(driven("turn"), gains=calm, spring=CounterbalanceSpring(1000.0, 0.315))
    slide = replace(driven("slide"), gains=calm, spring=CounterbalanceSpring(2000.0, 0.195), period=7.5e-3)
    return replace(with_masses(sliding_arm()), drives=(turn, slide, PassiveJoint("wrist", 2500.0, 5.0)))


def one_joint(drive: DrivenJoint | PassiveJoint, body: Inertial, **fields: Any) -> Chain:
    """Return an arm of one joint q about a level axis, which lifts."""
    joint = Joint("q", axis=(0.0, -1.0, 0.0))
    return Chain("one", (joint,), tip=translation(*body.centre), inertials=(body,), drives=(drive,), **fields)


def wristed(stiffness: float = 2500.0) -> Chain:
    """Return two level links of 0.5 m and 0.3 m: the shoulder with a drive, the wrist on a spring."""
    lifting = (0.0, -1.0, 0.0)
    return Chain(
        "wristed",
        (Joint("shoulder", axis=lifting), Joint("wrist", origin=translation(0.5, 0.0, 0.0), axis=lifting)),
        tip=translation(0.3, 0.0, 0.0),
        inertials=(Inertial("shoulder", 3.0, (0.2, 0.0, 0.0)), Inertial("wrist", 1.0, (0.1, 0.0, 0.0))),
        drives=(driven("shoulder"), PassiveJoint("wrist", stiffness, stiffness / 500.0)),
    )
