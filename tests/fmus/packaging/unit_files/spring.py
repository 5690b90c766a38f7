"""A mass on a damped spring: continuous states, one of them an output."""

from urmpipe_fmus.block import BlockModel, Input, Output, Parameter, State

unit = BlockModel(
    name="spring",
    description="A mass on a damped spring",
    variables=(
        Parameter(name="m", description="Mass", unit="kg", start=2.0, minimum=1e-6),
        Parameter(name="c", description="Stiffness", unit="N/m", start=50.0, minimum=0.0),
        Parameter(name="d", description="Damping", unit="N.s/m", start=0.5, minimum=0.0, tunable=False),
        Input(name="F", description="Force on the mass", unit="N", minimum=-1e3, maximum=1e3),
        State(name="x", description="Way", unit="m", display_unit="mm", start=0.01, output=True),
        State(name="v", description="Speed", unit="m/s"),
        Output(name="a", description="Acceleration", unit="m/s2"),
        Output(name="E", description="Energy", unit="J"),
    ),
    outputs=lambda v: {
        "a": (v.F - v.c * v.x - v.d * v.v) / v.m,
        "E": 0.5 * (v.c * v.x * v.x + v.m * v.v * v.v),
    },
    derivatives=lambda v: {"x": v.v, "v": (v.F - v.c * v.x - v.d * v.v) / v.m},
    internal_step=5e-4,
    equations=("m dv/dt = F - c x - d v", "dx/dt = v", "E = (c x^2 + m v^2) / 2"),
    source="Newton 1687",
)
