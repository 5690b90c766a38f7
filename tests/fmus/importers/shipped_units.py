"""The shipped units as the tests of this folder need them, and inputs for them."""

from __future__ import annotations

from typing import Any

import numpy as np

from made_masses import with_drives, with_masses
from urmpipe_fmus.block import BlockModel, Input, Table
from urmpipe_fmus.blocks import make_block
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.robots.catalogue import load_robot

STEP = 0.005  # s; communication step
MAX_INPUT = 2.0  # of inputs without bounds: angles, rates and volts for a small drive
CROSS_BUILT = ("delta_meter", "repolarizer", "log_source")  # booleans, integers, a table; states: native/


def shipped_unit(name: str) -> BlockModel:
    """Return a shipped unit by name, of six joints where it has some."""
    options: dict[str, Any] = {}
    if name == "kinematic_chain":
        options = {"robot": load_robot("urm6"), "rates": True}
    elif name == "log_source":
        t, joints = sample_times(400), np.arange(6)
        swings = Table(np.rint(t * 1e9).astype(np.int64), np.sin(3.0 * t[:, None] + joints) + 0.1 * joints)
        options = {"table": swings, "columns": [("q", "rad", 6)], "interpolate": True}
    elif name in ("chain_dynamics", "driven_arm"):
        options = {"robot": with_drives(with_masses(load_robot("urm6")))}
    elif name == "repolarizer":
        options = {"joints": 6}
    elif name == "network_motion":
        options = {"network": "four-bar"}
    return make_block(name, **options)


def sample_times(count: int, step: float = STEP) -> FloatArray:
    """Return the communication points in [s]."""
    return step * np.arange(count, dtype=np.float64)


def drawn(variable: Input, rng: np.random.Generator) -> FloatArray:
    """Return a value that an input may take, shape (width,)."""
    if variable.type == "Boolean":
        return rng.integers(0, 2, variable.width).astype(np.float64)
    low, high = max(variable.minimum, -MAX_INPUT), min(variable.maximum, MAX_INPUT)
    values = rng.uniform(low, high, variable.width)
    return np.round(values) if variable.type == "Integer" else values


def drawn_inputs(unit: BlockModel, rows: int, seed: int = 5) -> dict[str, FloatArray]:
    """Return values of all inputs that change every second row: shape (rows,), or (rows, size)."""
    rng = np.random.default_rng(seed)
    inputs: dict[str, FloatArray] = {}
    for variable in unit.inputs:
        values = np.array([drawn(variable, rng) for _ in range((rows + 1) // 2)])
        values = np.repeat(values, 2, axis=0)[:rows]
        inputs[variable.name] = values[:, 0] if variable.size is None else values
    return inputs


def columns(unit: BlockModel, values: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Return values by variable as one column a scalar, by the scalar's name: shape (rows,)."""
    found: dict[str, FloatArray] = {}
    for variable in unit.variables:
        if variable.name in values:
            rows = np.asarray(values[variable.name], dtype=np.float64)
            found |= zip(variable.names, rows.reshape(len(rows), -1).T, strict=True)
    return found
