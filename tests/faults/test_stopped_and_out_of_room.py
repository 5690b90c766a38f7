"""Ctrl-C, kill -9, files that may not grow, full disks: outputs are whole or absent, all or none of them.

`docs/reliability_figures.py` does the same at more moments and sizes.
"""

from __future__ import annotations

import shutil
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from forks import Forks, forks
from jobs import JOBS, Job, write_inputs
from trials import full, interrupted, limited, small_disk

COMPARE = next(job for job in JOBS if job.name == "compare")

SIGNALS = (signal.SIGINT, signal.SIGKILL)

STOPPED = [
    (job, number)
    for k, job in enumerate(job for job in JOBS if job is not COMPARE)
    for number in (SIGNALS if len(job.outputs) > 1 else SIGNALS[k % 2 :][:1])
]
"""Commands of several outputs with each signal; the others, all of which write alike, with one in turn."""


@pytest.fixture(scope="module")
def forked() -> Iterator[Forks]:
    """A process that is forked for each command line."""
    with forks() as started:
        yield started


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The inputs of all jobs."""
    made = tmp_path_factory.mktemp("inputs")
    write_inputs(made)
    return made


@pytest.fixture
def folder(inputs: Path, tmp_path: Path) -> Path:
    """A folder of its own with the inputs of all jobs."""
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL, signal.SIGTERM])
def test_a_stopped_comparison_leaves_all_outputs_or_none(forked: Forks, number: int, folder: Path) -> None:
    trials = (interrupted(forked, COMPARE, folder, number, moments=4) for _ in range(3))
    # Most of its time goes before its outputs are in place; a busy machine may send the signals late.
    assert any(found["old"] >= 2 for found in trials)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("job", "number"), [pytest.param(job, number, id=f"{job.name}-{number:d}") for job, number in STOPPED]
)
def test_a_stopped_command_leaves_all_outputs_or_none(
    forked: Forks, job: Job, number: int, folder: Path
) -> None:
    assert interrupted(forked, job, folder, number, moments=2).total() == 2


@pytest.mark.slow
@pytest.mark.parametrize("job", JOBS, ids=lambda job: job.name)
def test_a_file_that_may_not_grow_is_one_line(forked: Forks, job: Job, folder: Path) -> None:
    found = limited(forked, job, folder, sizes=len(job.outputs))
    assert found["old"] > found["new"]


@pytest.mark.slow
def test_a_full_disk_is_one_line(forked: Forks, inputs: Path, tmp_path: Path) -> None:
    with small_disk(tmp_path, "6m") as mounted:
        if not mounted:
            pytest.skip("mounting a small disk needs Linux and root")
        shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
        found = full(forked, COMPARE, tmp_path, sizes=len(COMPARE.outputs))
    assert found["old"] > found["new"]
