"""Comparisons whose deviations are known: paths held against a path, and arms against an arm."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

from made_runs import TSP, path_run, run_of
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison

Compared = Callable[..., Comparison]


@pytest.fixture
def paths() -> Compared:
    """Compare paths with a path, each off by what is given: reference - log in [m], shape (n, 3)."""

    def compared(deltas: Mapping[str, FloatArray], **options: Any) -> Comparison:
        length = max(map(len, deltas.values()))
        wanted = np.column_stack([np.linspace(0.0, 1.0, length), np.zeros(length), np.ones(length)])
        runs = [path_run(wanted[: len(off)] - off, name=name) for name, off in deltas.items()]
        return compare_runs(path_run(wanted), runs, CompareOptions(**options))

    return compared


@pytest.fixture
def arms() -> Compared:
    """Compare arms with an arm, each off by what is given: reference - log in [rad], shape (n, 6)."""

    def compared(deltas: Mapping[str, FloatArray], **options: Any) -> Comparison:
        t = TSP * np.arange(max(map(len, deltas.values())))
        q = np.column_stack([0.5 * np.sin(t * (1 + i)) + i for i in range(6)])
        runs = [run_of(q[: len(off)] - off, name=name) for name, off in deltas.items()]
        return compare_runs(run_of(q, name="wanted"), runs, CompareOptions(**options))

    return compared
