"""Few rows of what is long, so that the viewer shows it whole and at once: every peak stays.

They stand beside the arrays that they are of, below overview/, and are there to be looked at only: those of a
deviation in the units that people read, of a short log with all its rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.decimate import decimate
from urmpipe_pipeline.recording.codec import Encoded
from urmpipe_pipeline.recording.entities import Block, Place, places_of
from urmpipe_pipeline.recording.shown_units import deviation_array, plotted_deviations
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Result, Simulation

LONG = 50_000
"""Rows that the viewer still draws whole at once; of more an overview is shown first."""

ROWS = 20_000
"""Rows of an overview, at most."""

SLICE = 65_536
"""Rows decimated at a time: what is computed on the way stays in the cache, and memory low."""

SPEED_ROWS = 2_000
"""Rows of the speed of a log that is not long: it is drawn only, so its recording hardly grows by it."""


def overview_entity(entity: str) -> str:
    """Return where the overview of an array stands."""
    return f"/overview{entity}"


def overviews(result: Result, every: Sequence[Block], encoded: Encoded) -> Iterator[Block]:
    """Yield the overview of each long array that has a plot, and the speed of a run.

    Args:
        result: What is recorded.
        every: Its arrays.
        encoded: Where they stand.
    """
    if isinstance(result, Simulation):
        yield from (_overview(one, ROWS) for one in every if one.series == "signal" and _long(one))
        return
    runs = [result] if isinstance(result, Run) else [one.run for one in result.runs]
    plotted = {encoded.entity_of(*array) for run in runs for array in _plotted(run)}
    if isinstance(result, Comparison):
        plotted |= {encoded.entity_of(one.speed, one.t_ns) for one in result.runs}
    yield from (_overview(block, ROWS) for block in every if block.entity in plotted and _long(block))
    if isinstance(result, Comparison):
        yield from _deviations(result, every, encoded)
    if isinstance(result, Run) and result.tcp is not None:
        velocity = result.tcp.velocity
        speed = np.sqrt(np.einsum("ij,ij->i", velocity, velocity))[:, np.newaxis]
        whole = Block(speed_entity(places_of(result)[0]), result.t_ns, speed, "number", ("speed",))
        yield _overview(whole, ROWS if len(speed) > LONG else SPEED_ROWS)


def _deviations(result: Comparison, every: Sequence[Block], encoded: Encoded) -> Iterator[Block]:
    """Yield what is plotted of each deviation, in the units that people read."""
    arrays = {block.entity: block for block in every}
    for one in result.runs:
        for plot, values in plotted_deviations(one):
            shown = replace(arrays[encoded.entity_of(deviation_array(one, plot), one.t_ns)], values=values)
            yield _overview(shown, ROWS) if _long(shown) else _beside(shown)


def _beside(block: Block) -> Block:
    """Return an array with all its rows, as it stands among the overviews."""
    return replace(block, entity=overview_entity(block.entity))


def _long(block: Block) -> bool:
    """Tell whether an array with values has more rows than the viewer draws at once."""
    return len(block.t_ns) > LONG and block.values.shape[1] > 0


def speed_entity(place: Place) -> str:
    """Return the entity that the speed of a run would have: only its overview stands in a recording."""
    return f"{place.prefix}tcp/speed"


def _plotted(run: Run) -> Iterator[tuple[FloatArray | None, IntArray]]:
    """Yield the arrays that the layout shows first, with their times."""
    if not run.log.joints:
        yield run.tcp_recorded, run.t_ns
    yield run.log.q, run.log.t_ns
    yield run.q, run.t_ns


def _overview(block: Block, most: int) -> Block:
    """Return the rows of an array that a drawing needs, so many at most."""
    starts = range(0, len(block.t_ns), SLICE)
    each = most // len(starts)
    parts = [start + decimate(block.values[start : start + SLICE], each) for start in starts]
    rows = np.concatenate(parts)
    numbers = None if block.numbers is None else (block.numbers[0], block.numbers[1][rows])
    return replace(_beside(block), t_ns=block.t_ns[rows], values=block.values[rows], numbers=numbers)
