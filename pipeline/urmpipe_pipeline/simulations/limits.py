"""The limits of signals: the limit of X is the parameter X_max of its block."""

from __future__ import annotations

import math

from urmpipe_pipeline.simulations.simulation import Simulation

MAX = "_max"
"""How the parameter ends that is the largest absolute value of the variable before it."""


def limits_of(simulation: Simulation) -> dict[str, float]:
    """Return the largest absolute values of scalars, in their units, by their names in the system.

    X_max is in the unit of X, and an array as X is, or one value for all elements of X.
    """
    parameters = {
        f"{block.name}.{one.variable}": one
        for block in simulation.blocks
        for one in block.settings
        if one.causality == "parameter"
    }
    found = {}
    for signal in simulation.signals:
        for name in signal.names:
            common = f"{signal.name}{MAX}"
            own = f"{common}{name.removeprefix(signal.name)}"
            one = parameters.get(own, parameters.get(common))
            if one is not None and one.unit == signal.unit and 0.0 <= one.value < math.inf:
                found[name] = one.value
    return found
