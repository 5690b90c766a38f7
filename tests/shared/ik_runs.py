"""`urmpipe ik` run for its JSON, and paths for it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asserting import there
from urmpipe.main import run
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import forward_targets
from urmpipe_models.math3d import to_quaternions
from urmpipe_models.robots.catalogue import load_robot

Captured = pytest.CaptureFixture[str]


def answer(capsys: Captured, code: int, *arguments: str | Path) -> dict[str, Any]:
    """Return what a command prints as JSON."""
    assert run(["ik", *map(str, arguments), "--json"]) == code
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def wave(middle: Sequence[float] | FloatArray, size: float, rows: int) -> FloatArray:
    """Return joint values that swing about a middle, each joint faster than the one before."""
    phase = np.outer(np.arange(rows) / rows, np.arange(1, len(middle) + 1))
    return np.asarray(np.array(middle) + size * np.sin(phase))


def write_path(path: Path, robot: str, q: FloatArray, period: float = 0.01) -> str:
    """Write the poses of joint values as a path of poses, and return the first values as a start."""
    targets = forward_targets(load_robot(robot), q)
    quat = to_quaternions(there(targets.rotation).reshape(-1, 9), "matrix")
    table = np.column_stack([period * np.arange(len(q)), targets.position, quat])
    np.savetxt(path, table, delimiter=",", header="t,x,y,z,qx,qy,qz,qw", comments="", fmt="%.16g")
    return ",".join(map(str, q[0]))
