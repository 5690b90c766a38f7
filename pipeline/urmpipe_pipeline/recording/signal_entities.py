"""What stands where in the recording of a simulation.

    signals/<block>/<variable>      one array a variable, a column a scalar: timelines t and sample
    signals                         no values: it carries the times, also where no signal was recorded
    arms/<block>/joints             the joints of an arm

Signals have their own units, which the metadata tell. To be looked at only: overview/..., tolerance/<block>,
marks/worst/<block>, summary, system/file, robot/..., path/<block>, point/<block>.
"""

from __future__ import annotations

import numpy as np

from urmpipe_pipeline import text
from urmpipe_pipeline.recording.entities import Block, entity_key, entity_path, places, printable
from urmpipe_pipeline.simulations.signal_groups import groups_of
from urmpipe_pipeline.simulations.simulation import Simulation

TIMES = "/signals"
"""The entity that carries the times."""

SYSTEM_FILE = "/system/file"
"""The system file as text."""


def signal_entities(simulation: Simulation) -> dict[str, str]:
    """Return the entity of each signal by its name, all different."""
    found: dict[str, str] = {}
    taken: set[str] = set()
    for one in simulation.signals:
        block, variable, number = entity_key(one.block), entity_key(one.variable), 2
        entity = entity_path("signals", block, variable)
        while entity in taken:
            entity, number = entity_path("signals", block, f"{variable} ({number})"), number + 1
        taken.add(entity)
        found[one.name] = entity
    return found


def arm_keys(simulation: Simulation) -> list[str]:
    """Return the names of the arms as parts of entity paths, all different."""
    return [place.key for place in places([arm.block for arm in simulation.arms])]


def arm_entities(simulation: Simulation) -> list[str]:
    """Return the entity of the joints of each arm."""
    return [entity_path("arms", key, "joints") for key in arm_keys(simulation)]


def verdict_entities(simulation: Simulation, root: str) -> list[str]:
    """Return an entity a verdict below a root, such as tolerance or marks/worst."""
    keys = text.unique([entity_key(one.block) for one in simulation.verdicts])
    return [entity_path(*root.split("/"), key) for key in keys]


def simulation_blocks(simulation: Simulation) -> list[Block]:
    """Return every array of a simulation with its place, in the order of writing."""
    t_ns, samples = simulation.t_ns, ("sample", np.arange(len(simulation.t_ns)))
    found = [Block(TIMES, t_ns, np.empty((len(t_ns), 0)), "signal", (), samples)]
    entities = signal_entities(simulation)
    worst = {one.block: one.sample for one in simulation.verdicts}
    for group in groups_of(simulation):
        for one, called, colours in zip(group.signals, group.names, group.colours, strict=True):
            names = tuple(map(printable, called))
            row = worst.get(one.block)
            found.append(Block(entities[one.name], t_ns, one.columns, "signal", names, samples, row, colours))
    for arm, entity in zip(simulation.arms, arm_entities(simulation), strict=True):
        names = tuple(printable(name) for name in arm.chain.coordinates)
        found.append(Block(entity, t_ns, arm.q, "joints", names, samples))
    return found
