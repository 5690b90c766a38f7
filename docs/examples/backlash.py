"""Play in the gears of six joints: the arm stands still until its motor has taken up the slack."""

import math

import numpy as np

from urmpipe_fmus.block import BlockModel, Input, Memory, Output, Parameter, Values
from urmpipe_models.elementwise import Element


def joint_angles(v: Values) -> tuple[Element, ...]:
    """The joint stays where it was, unless the motor has reached one of the gear's flanks."""
    return tuple(
        np.clip(held, motor - 0.5 * v.play, motor + 0.5 * v.play)
        for held, motor in zip(v.held, v.motor, strict=True)
    )


unit = BlockModel(
    name="backlash",
    description="Play in the gears of six joints",
    variables=(
        Parameter(
            name="play",
            description="Angle from one flank to the other",
            unit="rad",
            display_unit="deg",
            start=math.radians(0.05),
            minimum=0.0,
        ),
        Input(
            name="motor", description="Angles of the motors, on the gears' output side", unit="rad", size=6
        ),
        Memory(name="held", description="Angles of the joints before", unit="rad", size=6),
        Output(name="joint", description="Angles of the joints", unit="rad", size=6),
    ),
    outputs=lambda v: {"joint": joint_angles(v)},
    update=lambda v: {"held": joint_angles(v)},
    equations=("joint = min(max(joint before, motor - play/2), motor + play/2)",),
    source="the play operator (Krasnoselskii and Pokrovskii 1989)",
)
