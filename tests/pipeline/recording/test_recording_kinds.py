"""A kind of result that a test defines is recorded and read back; arrays are read when they are used."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from recordable import build_run
from recorded import times_of
from same_results import assert_comes_back, assert_same
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray, TextArray
from urmpipe_pipeline import results
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.presentation.section import Presentation, Section
from urmpipe_pipeline.recording.layout import SLICE
from urmpipe_pipeline.results import Kind, read_recording, write_recording
from urmpipe_pipeline.simulations.simulation import Simulation

ROWS = SLICE + 3


@dataclass(frozen=True, eq=False)
class Accuracy(Result):
    """A result of every type of array, some of more rows than are sent at a time."""

    name: str
    t_ns: IntArray
    error: FloatArray
    inside: BoolArray
    count: NDArray[np.uint16]
    poses: FloatArray
    words: TextArray
    lone: FloatArray
    recording: Path | None = field(default=None, metadata={"stored": False})

    def _headline(self) -> str:
        return self.name

    def to_frame(self) -> pd.DataFrame:
        return pd.DataFrame(self.error)

    def to_dict(self) -> dict[str, Any]:
        return {"name": self.name}


def accuracy() -> Accuracy:
    rng = np.random.default_rng(3)
    error = rng.normal(size=(ROWS, 2))
    error[5] = np.nan, -0.0
    payload = np.array([0x7FF8000000000123, 0x8000000000000000], np.uint64).view(np.float64)
    error[-1] = payload  # every bit counts, also of what is no number
    words = np.array(["", "ü \ud800", "out of reach"], np.object_)[rng.integers(0, 3, ROWS)]
    t_ns = np.cumsum(rng.integers(1, 2**40, ROWS)) + 2**61  # beyond what a float tells apart
    return Accuracy(
        "toy", t_ns, error, rng.random(ROWS) < 0.1, rng.integers(0, 2**16, ROWS, np.uint16),
        rng.normal(size=(ROWS, 3, 3)), words, np.array(0.25),
    )  # fmt: skip


def shown(result: Accuracy) -> Presentation:
    return Presentation(result.name, "measured", None, (), Section(result.name))


@pytest.fixture
def known(monkeypatch: pytest.MonkeyPatch) -> None:
    """Add the kind to those of results, which is all that recording asks for."""
    monkeypatch.setattr(
        results, "KINDS", (*results.KINDS, Kind("accuracy", f"{__name__}:Accuracy", f"{__name__}:shown"))
    )


@pytest.mark.usefixtures("known")
@pytest.mark.parametrize("rising", [True, False])
def test_a_kind_of_ones_own_comes_back_as_it_was(rising: bool, tmp_path: Path) -> None:
    wanted = accuracy()
    if not rising:
        wanted.t_ns[[3, SLICE]] = wanted.t_ns[2], wanted.t_ns[5]
    assert_comes_back(wanted, tmp_path)
    if rising:
        assert sorted(times_of(tmp_path / "result.rrd", "/error")) == wanted.t_ns.tolist()


@pytest.mark.usefixtures("known")
def test_arrays_are_read_when_they_are_used(tmp_path: Path) -> None:
    wanted = accuracy()
    back: Any = read_recording(write_recording(wanted, tmp_path / "toy.rrd"), lazy=True)
    for name in ("t_ns", "error", "inside", "count", "poses"):
        rows, array = getattr(back, name), getattr(wanted, name)
        assert (rows.shape, rows.dtype, rows.ndim, len(rows)) == (array.shape, array.dtype, array.ndim, ROWS)
        columns = (slice(10, 20), *[slice(1, None)] * (array.ndim - 1))
        ends = slice(0, 2), slice(SLICE - 1, SLICE + 1), slice(-3, None), slice(None, None, -7)
        for part in (*ends, -1, 5, columns):
            assert_same(np.asarray(rows[part]), np.asarray(array[part]))
        assert rows._loaded is None
        assert_same(np.asarray(rows[array > 0]), array[array > 0])
        assert_same(np.asarray(rows), array)
    assert_same(np.diff(back.t_ns), np.diff(wanted.t_ns))
    assert_same(-back.error * 2 + back.error, -wanted.error * 2 + wanted.error)
    assert_same(back.error.T, wanted.error.T)
    assert write_recording(back, tmp_path / "again.rrd")


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(first=st.integers(-60, 60), end=st.integers(-60, 60), step=st.sampled_from([1, 2, 7, -1, -3]))
@example(first=3, end=3, step=1)
def test_any_slice_is_that_of_the_array(first: int, end: int, step: int, tmp_path: Path) -> None:
    path, run = tmp_path / "run.rrd", build_run(rows=50)
    if not path.exists():
        write_recording(run, path)
    back: Any = read_recording(path, lazy=True)
    assert_same(np.asarray(back.q[first:end:step]), run.q[first:end:step])


def test_a_simulation_is_opened_without_its_signals(
    make_simulation: Callable[..., Simulation], tmp_path: Path
) -> None:
    wanted = make_simulation(50)
    back: Any = read_recording(write_recording(wanted, tmp_path / "a.rrd"), lazy=True)
    assert all(one.values._loaded is None for one in back.signals)
    assert_same(back.to_dict() | {"recording": None}, wanted.to_dict())
