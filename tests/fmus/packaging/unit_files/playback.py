"""A table over time, read held and interpolated."""

from urmpipe_fmus.block import BlockModel, Output, Parameter, Table


def make(table: Table, gain: float = 1.0) -> BlockModel:
    """Make a unit that plays the table's two columns, scaled."""
    return BlockModel(
        name="playback",
        description="Plays a table",
        variables=(
            Parameter(name="gain", description="Scale", start=gain),
            Output(name="held", description="The last row's first value"),
            Output(name="between", description="The second column, interpolated", unit="m"),
        ),
        outputs=lambda v: {
            "held": v.gain * v.table.before[0],
            "between": v.gain
            * (v.table.before[1] + v.table.fraction * (v.table.after[1] - v.table.before[1])),
        },
        table=table,
    )
