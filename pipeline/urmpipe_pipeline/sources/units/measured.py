"""The unit of positions that were measured from outside: the joints tell how far the tool moves.

Such positions stand in a frame of their own, so that the kinematics do not come out at them. But no frame
changes distances, and a tool only by its length: the measured points spread as those of the kinematics do.
"""

from __future__ import annotations

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_pipeline.sources.units.evidence import extent, has_both, spread
from urmpipe_pipeline.sources.vocabulary import Unit, vocabulary

ALIKE = 2.0
"""Spreads by this factor apart may be the same but for a tool; units of length are ten apart or more."""


def length_by_spread(robot: Chain, q: FloatArray, position: FloatArray) -> tuple[Unit, str] | None:
    """Return the unit of measured positions, and why; None if their spread tells none.

    Args:
        robot: The arm.
        q: Joint values in [rad] or [m], shape (n, joints).
        position: Measured positions in the file's own unit, shape (n, 3).
    """
    rows = spread(len(q))
    q, position = q[rows], position[rows]
    known = has_both(q, position)
    if not known.any():
        return None
    wanted, found = extent(positions_over_log(robot, q[known])), extent(position[known])
    units = [vocabulary().units[name] for name in vocabulary().spelled("length")]
    near = [unit for unit in units if wanted and wanted / ALIKE < found * unit.factor < wanted * ALIKE]
    if len(near) != 1:
        return None
    moved, measured = wanted * 1e3, found * near[0].factor * 1e3
    said = f"in it the measured points spread by {measured:.0f} mm (rms), as the arm's by {moved:.0f} mm"
    return near[0], said
