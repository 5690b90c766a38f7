"""A plane arm of three joints: arrays of scalars, outputs at once from inputs."""

from typing import Any

import numpy as np

from urmpipe_fmus.block import BlockModel, Input, Output, Parameter, Values


def tip(v: Values) -> dict[str, Any]:
    """Add the links, each turned by the sum of the angles before it."""
    angle = x = y = 0.0
    for phi, length in zip(v.phi, v.length, strict=True):
        angle = angle + phi
        x = x + length * np.cos(angle)
        y = y + length * np.sin(angle)
    return {"p": (x, y), "reach": np.hypot(x, y), "first": v.length[0] * np.cos(v.phi[0])}


unit = BlockModel(
    name="arm",
    description="A plane arm of three joints",
    variables=(
        Input(
            name="phi", description="Angles", unit="rad", display_unit="deg", size=3, start=(0.1, 0.2, 0.3)
        ),
        Parameter(name="length", description="Lengths", unit="m", display_unit="mm", size=3, start=0.5),
        Output(name="p", description="Tip", unit="m", display_unit="mm", size=2),
        Output(name="reach", description="Distance of the tip", unit="m"),
        Output(name="first", description="x of the first joint's end", unit="m"),
    ),
    outputs=tip,
)
