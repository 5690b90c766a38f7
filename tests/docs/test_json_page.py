"""docs/json.md against the code: it has every key of what the commands print."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urmpipe
from urmpipe_datasets import LOGS
from urmpipe_models.inverse.targets import targets_of
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.delta_verdict import delta_verdict
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.provenance import provenance
from urmpipe_pipeline.simulations.simulation import Signal, SimulatedBlock, Simulation

PAGE = (Path(__file__).parents[2] / "docs" / "json.md").read_text(encoding="utf-8")
NAMED = set(re.findall(r"`(\w+)`", PAGE))
FREE = {"steps", "units", "tolerance", "noise", "before", "now", "delta", "start", "joints", "joint_turns"}
"""Objects whose keys are names of columns, axes, joints, kinds or options."""


def keys(value: Any) -> set[str]:
    """Return the keys of objects and of the objects in them."""
    if isinstance(value, list):
        return set().union(*map(keys, value))
    if not isinstance(value, dict):
        return set()
    inner = [keys(item) for key, item in value.items() if key not in FREE]
    return set(value).union(*inner)


@pytest.fixture(scope="module")
def printed() -> list[dict[str, Any]]:
    """What ingest and compare print of a log with wraps."""
    run = urmpipe.ingest(LOGS / "coppeliasim.csv", robot="urm6")
    before = urmpipe.compare(LOGS / "path.csv", [run], tolerance=0.001)
    result = urmpipe.compare(LOGS / "path.csv", [run], baseline=before)
    return [run.to_dict(), result.to_dict(), *(one["delta"]["x"] for one in result.to_dict()["runs"])]


def test_each_key_is_named(printed: list[dict[str, Any]]) -> None:
    assert keys(printed) - NAMED == set()
    assert {"from", "half_period", "share_out", "sample_max"} <= keys(printed)


def test_each_key_of_inverse_kinematics_is_named() -> None:
    arm = load_robot("ur5e")
    narrow = [replace(one, lower=-3.0, upper=0.8) if one is arm.moving[0] else one for one in arm.joints]
    arm = replace(arm, joints=tuple(narrow))  # beyond 0.8 only the other arm goes on
    q = np.tile([0.1, -0.9, 1.2, -0.5, 0.7, 0.2], (20, 1))
    q[:, 0] += 0.6 + 0.01 * np.arange(20)
    poses = targets_of(arm, q)
    path = urmpipe.ik(poses, arm, tsp=0.01, start=q[0])
    found = path.to_dict()
    assert found["jumps"]
    assert found["too_fast"]
    assert keys(found) - NAMED == set()
    assert {"branch", "nearest", "singular", "last_row", "steps", "miss", "smallest"} <= keys(found)
    assert keys(urmpipe.ik(poses, arm).to_dict()) <= keys(found)


def test_each_key_of_a_simulation_is_named() -> None:
    t_ns, block = np.arange(2), SimulatedBlock("meter", "unit", "delta_meter", "")
    simulation = Simulation(
        name="system", description="", t_ns=t_ns, step=0.005, signals=(Signal("meter", "norm", np.zeros(2)),),
        system_svg="", system_text="", blocks=(block,), failed=None, warnings=(LogWarning("gap", "a gap"),),
        provenance=provenance("simulate", {}, ()),
        verdicts=tuple(filter(None, [delta_verdict("meter", t_ns, np.zeros((2, 3)), {"axis": 1.0})])),
    )  # fmt: skip
    found = keys(simulation.to_dict())
    assert found - NAMED == set()
    assert {"t_min", "quantity", "content", "message"} <= found
