"""What the viewer draws of the recording of a simulation: names and colours of its signals, and where else.

To be looked at only: overview/..., tolerance/<block>, marks/worst/<block>, summary, system/file, robot/...,
path/<block>, point/<block>.
"""

from __future__ import annotations

import numpy as np

from urmpipe_pipeline import text
from urmpipe_pipeline.recording.codec import Encoded
from urmpipe_pipeline.recording.entities import Block, entity_key, entity_path, places, printable
from urmpipe_pipeline.simulations.signal_groups import groups_of
from urmpipe_pipeline.simulations.simulation import Simulation

SYSTEM_FILE = "/system/file"
"""The system file as text."""


def arm_keys(simulation: Simulation) -> list[str]:
    """Return the names of the arms as parts of entity paths, all different."""
    return [place.key for place in places([arm.block for arm in simulation.arms])]


def verdict_entities(simulation: Simulation, root: str) -> list[str]:
    """Return an entity a verdict below a root, such as tolerance or marks/worst."""
    keys = text.unique([entity_key(one.block) for one in simulation.verdicts])
    return [entity_path(*root.split("/"), key) for key in keys]


def simulation_blocks(simulation: Simulation, encoded: Encoded) -> list[Block]:
    """Return every array of a simulation that has names and colours."""
    t_ns, samples = simulation.t_ns, ("sample", np.arange(len(simulation.t_ns)))
    found = []
    for group in groups_of(simulation):
        for one, called, colours in zip(group.signals, group.names, group.colours, strict=True):
            if entity := encoded.entity_of(one.values, t_ns):
                names = tuple(map(printable, called))
                found.append(Block(entity, t_ns, one.columns, "signal", names, samples, colours))
    for arm in simulation.arms:
        if entity := encoded.entity_of(arm.q, t_ns):
            names = tuple(printable(name) for name in arm.chain.coordinates)
            found.append(Block(entity, t_ns, arm.q, "joints", names, samples))
    return found
