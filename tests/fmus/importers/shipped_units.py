"""The shipped units as the tests of this folder need them, and inputs for them."""

from __future__ import annotations

from typing import Any

import numpy as np

from made_masses import with_drives, with_masses
from urmpipe_fmus.block import BlockModel, Input, Table
from urmpipe_fmus.blocks import block_names, make_block
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.robots.catalogue import load_robot

STEP = 0.005
"""Communication step in [s]."""

FARTHEST = 2.0
"""Inputs without bounds are drawn from -FARTHEST to FARTHEST: angles, rates and volts for a small drive."""


CROSS_BUILT = ("delta_meter", "repolarizer", "log_source")
"""Units that are built for Linux and Windows: truths, integers, a table; states: native/."""


def swinging_joints(rows: int, joints: int = 6, period: float = STEP) -> Table:
    """Return a log of joints in [rad] that swing by less than half a turn."""
    t = sample_times(rows, period)
    phases = np.arange(joints)
    q = np.sin(3.0 * t[:, None] + phases) + 0.1 * phases
    return Table(np.rint(t * 1e9).astype(np.int64), q)


def shipped_unit(name: str) -> BlockModel:
    """Return a shipped unit by name, of six joints where it has some."""
    options: dict[str, Any] = {}
    if name == "kinematic_chain":
        options = {"robot": load_robot("urm6"), "rates": True}
    elif name == "log_source":
        options = {"table": swinging_joints(400), "columns": [("q", "rad", 6)], "interpolate": True}
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


def shipped() -> tuple[str, ...]:
    """Return the names of all shipped units."""
    return block_names()


def drawn(one: Input, rng: np.random.Generator) -> FloatArray:
    """Return a value that an input may take, shape (width,)."""
    if one.type == "Boolean":
        return rng.integers(0, 2, one.width).astype(np.float64)
    low, high = max(one.minimum, -FARTHEST), min(one.maximum, FARTHEST)
    values = rng.uniform(low, high, one.width)
    return np.round(values) if one.type == "Integer" else values


def drawn_inputs(unit: BlockModel, rows: int, seed: int = 5) -> dict[str, FloatArray]:
    """Return values of all inputs that change every second row: shape (rows,), or (rows, size)."""
    rng = np.random.default_rng(seed)
    held: dict[str, FloatArray] = {}
    for one in unit.inputs:
        values = np.array([drawn(one, rng) for _ in range((rows + 1) // 2)])
        values = np.repeat(values, 2, axis=0)[:rows]
        held[one.name] = values[:, 0] if one.size is None else values
    return held


def columns(unit: BlockModel, values: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Return values by variable as one column a scalar, by the scalar's name: shape (rows,)."""
    found: dict[str, FloatArray] = {}
    for one in unit.variables:
        if one.name in values:
            rows = np.asarray(values[one.name], dtype=np.float64)
            found |= zip(one.names, rows.reshape(len(rows), -1).T, strict=True)
    return found
