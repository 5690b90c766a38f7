"""docs/json.md against the code: it has every key of what the commands print."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import urmpipe
from urmpipe_datasets import LOGS

PAGE = (Path(__file__).parents[2] / "docs" / "json.md").read_text(encoding="utf-8")
NAMED = set(re.findall(r"`(\w+)`", PAGE))
FREE = {"units", "tolerance", "noise", "before", "now", "delta", "start", "joints", "joint_turns"}
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
