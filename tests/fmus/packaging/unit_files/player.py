"""A table that begins before 0 s, read held and interpolated."""

import numpy as np

from urmpipe_fmus.block import BlockModel, Output, Table

unit = BlockModel(
    name="player",
    description="a table",
    variables=(Output(name="held", description=""), Output(name="between", description="", size=2)),
    outputs=lambda v: {
        "held": v.table.before[0],
        "between": tuple(
            a + v.table.fraction * (b - a) for a, b in zip(v.table.before, v.table.after, strict=True)
        ),
    },
    table=Table(np.array([-5, 0, 10_000_000, 25_000_000]), np.array([[1.0, 5], [2, 6], [4, 7], [-1, 8]])),
)
