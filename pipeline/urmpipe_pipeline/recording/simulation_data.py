"""Everything of a simulation that is not an array, as JSON and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from urmpipe_pipeline.comparison.delta_verdict import DeltaVerdict
from urmpipe_pipeline.json_values import flat
from urmpipe_pipeline.recording.entities import Block
from urmpipe_pipeline.recording.metadata import (
    document,
    provenance_data,
    provenance_from,
    robot_data,
    warnings_from,
)
from urmpipe_pipeline.recording.signal_entities import arm_entities, signal_entities
from urmpipe_pipeline.simulations.simulation import Setting, Signal, SimulatedBlock, Simulation


def simulation_json(simulation: Simulation, blocks: list[Block]) -> str:
    """Return the metadata of a simulation as JSON, with the shape of every array that belongs to it."""
    entities = signal_entities(simulation)
    data = {
        "name": simulation.name,
        "description": simulation.description,
        "step": simulation.step,
        "signals": [_signal(one, entities[one.name]) for one in simulation.signals],
        "system_svg": simulation.system_svg,
        "system_text": simulation.system_text,
        "blocks": [_block(one) for one in simulation.blocks],
        "connections": dict(simulation.connections),
        "failed": simulation.failed,
        "warnings": [asdict(one) for one in simulation.warnings],
        "provenance": provenance_data(simulation.provenance),
        "arms": [
            {"block": arm.block, "chain": robot_data(arm.chain), "entity": entity}
            for arm, entity in zip(simulation.arms, arm_entities(simulation), strict=True)
        ],
        "verdicts": [flat(one) for one in simulation.verdicts],
    }
    return document("simulation", data, blocks)


def simulation_fields(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a `Simulation` that hold no arrays."""
    plain = ("name", "description", "step", "system_svg", "system_text", "connections", "failed")
    return {
        **{name: data[name] for name in plain},
        "blocks": tuple(_block_from(one) for one in data["blocks"]),
        "warnings": warnings_from(data["warnings"]),
        "provenance": provenance_from(data["provenance"]),
        "verdicts": tuple(
            DeltaVerdict(**{**one, "variables": tuple(one["variables"])}) for one in data["verdicts"]
        ),
    }


def _signal(one: Signal, entity: str) -> dict[str, Any]:
    """Return a signal without its values: where they stand, and whether it is an array."""
    told = ("block", "variable", "unit", "display_unit", "type", "description")
    return {name: getattr(one, name) for name in told} | {"entity": entity, "array": one.values.ndim == 2}


def _block(one: SimulatedBlock) -> dict[str, Any]:
    return flat(one) | {"settings": [flat(setting) for setting in one.settings]}


def _block_from(data: Mapping[str, Any]) -> SimulatedBlock:
    return SimulatedBlock(**{**data, "settings": tuple(Setting(**one) for one in data["settings"])})
