"""Set points and what came of them: signals that a person looks at together first."""

from __future__ import annotations

from urmpipe_pipeline.simulations.signal_groups import Group
from urmpipe_pipeline.simulations.simulation import Signal, Simulation

SET, REAL = "set_", "real_"
"""How the two inputs of a controller begin whose rests agree: set_theta, real_theta."""

TITLE = "Set point and answer"
"""What such plots are called."""


def answers_of(simulation: Simulation) -> list[Group]:
    """Return the groups of what controllers are to hold and what they measure, one a quantity and unit.

    A block whose inputs set_NAME and real_NAME are both connected to recorded signals is such a controller.
    """
    signals = {one.name: one for one in simulation.signals}
    pairs: dict[tuple[str, str], list[tuple[Signal, Signal]]] = {}
    for name, source in simulation.connections.items():
        block, _, variable = name.rpartition(".")
        if not variable.startswith(SET):
            continue
        quantity = variable.removeprefix(SET)
        measured = simulation.connections.get(f"{block}.{REAL}{quantity}", "")
        wanted, real = signals.get(source), signals.get(measured)
        if wanted is not None and real is not None and wanted.unit == real.unit:
            pairs.setdefault((quantity, real.unit), []).append((wanted, real))
    return [_group(unit, some) for (_, unit), some in pairs.items()]


def _group(unit: str, pairs: list[tuple[Signal, Signal]]) -> Group:
    """Return the set points, each once, and behind them the answers."""
    wanted = tuple({one.name: one for one, _ in pairs}.values())
    real = tuple({one.name: one for _, one in pairs}.values())
    return Group(TITLE, unit, (*wanted, *real), family=True, wanted=len(wanted))
