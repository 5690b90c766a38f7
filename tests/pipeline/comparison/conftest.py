"""Comparisons whose deviations are known: paths held against a path, and arms against an arm."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.chains.urm import urm_chain
from urmpipe_models.kinematics.forward import point_over_log
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.joint_log import JointLog, SourceFile
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.runs.derivatives import derivatives
from urmpipe_pipeline.runs.results import Run

TSP = 0.005
PROVENANCE = Provenance("ingest", {}, (), {}, "")
URM6 = urm_chain("urm6", [0.243215, *[0.21243] * 5, 0.042215], [np.radians(52)] * 6)

Compared = Callable[..., Comparison]


def run_of(name: str, q: FloatArray, robot: Chain | None, position: FloatArray | None) -> Run:
    """Return a run at 5 ms."""
    t_ns = np.arange(len(q)) * 5_000_000
    names = tuple(f"q{i + 1}" for i in range(q.shape[1]))
    file = SourceFile(f"{Path(name).name}.csv", "0" * 64, 1)
    log = JointLog(name, "table", (file,), t_ns, names, q, tcp_position=position)
    qd, qdd = derivatives(q, TSP) if q.shape[1] else (q, q)
    tcp = None if robot is None else point_over_log(robot, q, qd, qdd)
    return Run(name, log, robot, TSP, t_ns, q, qd, qdd, tcp, position, (), (), PROVENANCE)


@pytest.fixture
def paths() -> Compared:
    """Compare paths with a path, each off by what is given: reference - log in [m], shape (n, 3)."""

    def compared(deltas: Mapping[str, FloatArray], **options: Any) -> Comparison:
        length = max(map(len, deltas.values()))
        wanted = np.column_stack([np.linspace(0.0, 1.0, length), np.zeros(length), np.ones(length)])
        runs = [
            run_of(name, np.empty((len(off), 0)), None, wanted[: len(off)] - off)
            for name, off in deltas.items()
        ]
        reference = run_of("path", np.empty((length, 0)), None, wanted)
        return compare_runs(reference, runs, CompareOptions(**options))

    return compared


@pytest.fixture
def arms() -> Compared:
    """Compare arms with an arm, each off by what is given: reference - log in [rad], shape (n, 6)."""

    def compared(deltas: Mapping[str, FloatArray], **options: Any) -> Comparison:
        t = TSP * np.arange(max(map(len, deltas.values())))
        q = np.column_stack([0.5 * np.sin(t * (1 + i)) + i for i in range(6)])
        runs = [run_of(name, q[: len(off)] - off, URM6, None) for name, off in deltas.items()]
        return compare_runs(run_of("wanted", q, URM6, None), runs, CompareOptions(**options))

    return compared
