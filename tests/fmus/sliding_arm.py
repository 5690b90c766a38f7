"""An arm with joints of all kinds."""

from __future__ import annotations

from urmpipe_models.chains.chain import Chain, Joint, Mimic
from urmpipe_models.transform import from_offset


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
