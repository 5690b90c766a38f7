"""A counter of samples: integers, booleans, memories."""

import numpy as np

from urmpipe_fmus.block import BlockModel, Input, Memory, Output, Parameter

unit = BlockModel(
    name="counter",
    description="Counts the samples at which it is on",
    variables=(
        Input(name="on", description="Whether it counts", type="Boolean", start=1),
        Input(name="by", description="Counts by", type="Integer", start=2, minimum=-10, maximum=10),
        Parameter(name="limit", description="Counts up to this", type="Integer", start=7, tunable=False),
        Memory(name="count", description="So far", type="Integer", start=1, output=True),
        Memory(name="held", description="Time of the last sample", unit="s"),
        Output(name="full", description="Whether it is at its limit", type="Boolean"),
        Output(name="doubled", description="Twice the count", type="Integer"),
        Output(name="age", description="Since the last sample", unit="s"),
    ),
    outputs=lambda v: {
        "full": np.where(v.count >= v.limit, 1.0, 0.0),
        "doubled": 2.0 * v.count,
        "age": v.time - v.held,
    },
    update=lambda v: {
        "count": np.minimum(v.limit, v.count + np.where(v.on > 0.5, v.by, 0.0)),
        "held": v.time,
    },
)
