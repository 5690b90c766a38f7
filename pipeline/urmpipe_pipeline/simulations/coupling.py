"""Whether the communication step is short enough for blocks that exchange energy.

Each of two coupled blocks sees the other's values held over a step h. A spring whose far end is held pulls
back at a moving body by k v h / 2 on average: a drag that is in no block. The energy balance shows it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from urmpipe_models.errors import Hint
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.simulations.simulation import Simulation

ALLOWED = 0.05
"""Share of the largest energy that the balance may leave over. A choice: friction and motor constants of a
drive are rarely known better."""


def coupling_warnings(simulation: Simulation) -> Iterator[LogWarning]:
    """Yield that the energy balance leaves over too much, where blocks with energies act on each other.

    Elsewhere the rest is the work of blocks without energies, which a shorter step does not change.
    """
    balance = simulation.energy
    if balance is None or balance.worst is None or not _act_on_each_other(simulation):
        return
    residual = float(balance.residual[balance.worst])
    share = balance.share(residual)
    if share <= ALLOWED:
        return
    step = f"{1e3 * simulation.step:.6g} ms"
    shorter = _rounded_down(simulation.step * ALLOWED / share)
    yield LogWarning(
        "coarse-step",
        f"blocks see each other's values held over {step}: residual of the energy balance",
        found=f"{abs(residual):.3g} J, {text.format_percent(share)} of the largest energy",
        allowed=f"{100.0 * ALLOWED:g} %",
        hints=(Hint("step", shorter, "makes it smaller"),),
    )


def _act_on_each_other(simulation: Simulation) -> bool:
    """Return whether a block with energies has an input from another, or itself, that has one from it."""
    own = {one.block for one in simulation.signals if one.is_energy}
    into = {(to.partition(".")[0], of.partition(".")[0]) for to, of in simulation.connections.items()}
    return any((b, a) in into for a, b in into if a in own and b in own)


def _rounded_down(step: float) -> float:
    """Return the largest of 1, 2, 5, 10, 20, .. in their decade that is not above a step in [s]."""
    decade = 10.0 ** math.floor(math.log10(step))
    return float(f"{max(one for one in (1, 2, 5) if one * decade <= step * (1.0 + 1e-9)) * decade:.1g}")
