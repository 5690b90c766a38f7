"""A mass on a spring, with something of every kind and type."""

import numpy as np

from urmpipe_fmus.block import BlockModel, Input, Memory, Output, Parameter, State

unit = BlockModel(
    name="oscillator",
    description="a mass on a spring",
    variables=(
        Parameter(name="k", description="stiffness", start=2.0, minimum=0.0, maximum=100.0),
        Parameter(name="damping", description="damping", start=0.5, tunable=False),
        Input(name="goal", description="goal", start=1.0),
        Input(name="on", description="on", type="Boolean", start=1.0),
        Input(name="gear", description="gear", type="Integer", start=1.0, minimum=-1.0, maximum=5.0),
        State(name="x", description="place and speed", size=2, start=(0.1, 0.0), output=True),
        Memory(name="count", description="steps", type="Integer"),
        Memory(name="last", description="the goal before"),
        Output(name="force", description="force"),
        Output(name="turns", description="turns", type="Integer"),
        Output(name="far", description="far", type="Boolean"),
        Output(name="inverse", description="inverse"),
    ),
    outputs=lambda v: {
        "force": v.k * (v.goal - v.x[0]) + np.sin(v.time),
        "turns": v.x[0] / 0.25,
        "far": np.abs(v.x[0]) > 1.0,
        "inverse": 1.0 / v.k,
    },
    derivatives=lambda v: {
        "x": (
            v.x[1],
            np.where(v.on > 0.5, v.k, 0.0) * (v.goal - v.x[0]) - v.damping * v.x[1] + 0.1 * np.cos(v.time),
        )
    },
    update=lambda v: {"count": np.remainder(v.count + 1.0, 1000.0), "last": v.goal},
    internal_step=3e-3,
)
