"""Two results of a recording held against each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def assert_same(found: Any, wanted: Any, place: str = "result") -> None:
    """Hold two results against each other: arrays by dtype, shape and bits, the rest by value; NaN is NaN."""
    if isinstance(wanted, np.ndarray):
        assert (found.dtype, found.shape) == (wanted.dtype, wanted.shape), place
        if wanted.dtype == np.object_:  # its bytes say where its texts stand in memory
            assert found.tolist() == wanted.tolist(), place
        else:
            assert found.tobytes() == wanted.tobytes(), place
    elif is_dataclass(wanted) and not isinstance(wanted, type):
        assert type(found) is type(wanted), place
        for field in fields(wanted):
            if field.name != "recording":  # where it stands: not a part of what is recorded
                assert_same(getattr(found, field.name), getattr(wanted, field.name), f"{place}.{field.name}")
    elif isinstance(wanted, Mapping):
        assert list(found) == list(wanted), place
        for key, value in wanted.items():
            assert_same(found[key], value, f"{place}[{key!r}]")
    elif isinstance(wanted, tuple):
        assert isinstance(found, tuple), place
        assert len(found) == len(wanted), place
        for i, (one, other) in enumerate(zip(found, wanted, strict=True)):
            assert_same(one, other, f"{place}[{i}]")
    elif isinstance(wanted, float) and np.isnan(wanted):
        assert np.isnan(found), place
    else:
        assert found == wanted, place
