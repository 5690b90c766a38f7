"""Two results held against each other, and a result against its recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.results import read_recording, write_recording


def assert_same(found: Any, wanted: Any, place: str = "result") -> None:
    """Hold two results against each other: arrays by dtype, shape and bits, the rest by value; NaN is NaN."""
    if isinstance(wanted, np.ndarray):
        assert (found.dtype, found.shape) == (wanted.dtype, wanted.shape), place
        if wanted.dtype == np.object_:  # its bytes say where its texts stand in memory
            assert found.tolist() == wanted.tolist(), place
        else:
            assert found.tobytes() == wanted.tobytes(), place
    elif isinstance(wanted, float) and np.isnan(wanted):
        assert np.isnan(found), place
    elif (parts := _parts(wanted)) is None:
        assert found == wanted, place
    else:
        other = _parts(found)
        assert type(found) is type(wanted) or isinstance(wanted, Mapping), place
        assert other is not None, place
        assert list(other) == list(parts), place
        for name, part in parts.items():
            assert_same(other[name], part, f"{place}.{name}")


def assert_comes_back(result: Result, folder: Path) -> None:
    """Write a result into an empty folder, and hold what is read back against it."""
    path = folder / "result.rrd"
    assert write_recording(result, path) == path
    back = read_recording(path)
    assert_same(back, result)
    assert back.recording == path
    assert list(folder.iterdir()) == [path]


def _parts(whole: Any) -> dict[Any, Any] | None:
    """Return the parts of a dataclass, a mapping, a tuple or a list by name, key or place; else None."""
    if is_dataclass(whole) and not isinstance(whole, type):  # `recording` says where it stands: no part of it
        return {each.name: getattr(whole, each.name) for each in fields(whole) if each.name != "recording"}
    if isinstance(whole, Mapping):
        return dict(whole)
    return dict(enumerate(whole)) if isinstance(whole, (tuple, list)) else None
