"""A drive that follows its set point with a delay: a low-pass of the first order."""

from urmpipe_fmus.block import BlockModel, Input, Parameter, State

unit = BlockModel(
    name="low_pass",
    description="Low-pass of the first order",
    variables=(
        Parameter(name="T", description="Time constant", unit="s", start=0.05, minimum=1e-6),
        Input(name="u", description="Angle asked for", unit="rad"),
        State(name="y", description="Angle reached", unit="rad", output=True),
    ),
    derivatives=lambda v: {"y": (v.u - v.y) / v.T},
    internal_step=1e-3,
    equations=("y' = (u - y) / T",),
)
