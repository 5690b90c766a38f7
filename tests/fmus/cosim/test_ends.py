"""However an FMU ends or hangs, block and call are named, what was recorded stays, and no process is left."""

from __future__ import annotations

import os
import re
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asserting import there
from foreign_fmus import (
    HANGS,
    OVERFLOWS,
    STAIR,
    TAKES_MEMORY,
    Foreign,
    Scalar,
    gain,
    planned,
    ran,
    trouble_in,
)
from urmpipe_fmus.cosim import CosimulationRecord, simulate

CALLS = {
    "load": ("loading", 0),
    "start": ("fmi2Instantiate", 0),
    "setup": ("fmi2SetupExperiment", 0),
    "set": ("fmi2SetReal", 0),
    "enter": ("fmi2EnterInitializationMode", 0),
    "get": ("fmi2GetReal", 0),
    "exit": ("fmi2ExitInitializationMode", 0),
    "step": ("fmi2DoStep", 1),
    "terminate": ("fmi2Terminate", 11),
    "free": ("fmi2FreeInstance", 11),
}
"""Where C stands in an FMU, the call that is, and how many rows are recorded before."""


def with_trouble(bad: Foreign, timeout: float = 60.0) -> CosimulationRecord:
    """Return what a system of an FMU and one that follows it recorded."""
    plan = planned({"good": gain(), "bad": bad}, {"good.u": "bad.y"}, {"bad": {"u": 0.0}})
    return simulate(plan, timeout=timeout)


def own_processes() -> set[str]:
    """Return the processes that this one started and that run; none where the system does not tell."""
    lists = Path(f"/proc/{os.getpid()}/task").glob("*/children")
    return {one for each in lists for one in each.read_text().split()}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "timeout", "how", "calls"),
    [
        ("exit(0);", 60.0, "ended the process with the exit code 0", tuple(CALLS)),
        # which call it is, is noted alike for both
        (HANGS, 3.0, "did not return within 3 s", ("load", "get", "step", "free")),
    ],
)
def test_any_call_may_hang_or_end_the_process(
    code: str, timeout: float, how: str, calls: tuple[str, ...]
) -> None:
    before = own_processes()
    troubles = [trouble_in(call, code) for call in calls]
    with ThreadPoolExecutor(len(troubles)) as pool:
        found = list(pool.map(lambda one: with_trouble(one, timeout), troubles))
    for recorded, (call, rows) in zip(found, (CALLS[one] for one in calls), strict=True):
        when = 1 if rows == 11 else 0
        assert recorded.failed == f"block bad: {call} at t = {when} s: {how}; it logged nothing"
        assert len(recorded.t_ns) == rows
    assert own_processes() <= before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "how"),
    [
        (OVERFLOWS, "ended the process: Segmentation fault (SIGSEGV)"),
        pytest.param(
            TAKES_MEMORY,
            "ended the process: Segmentation fault (SIGSEGV)",
            marks=pytest.mark.skipif(sys.platform != "linux", reason="needs a system that limits memory"),
        ),
    ],
)
def test_a_block_that_ends_the_process_is_told(code: str, how: str) -> None:
    failed = f"block bad: fmi2DoStep at t = 0 s: {how}; it logged nothing"
    assert with_trouble(trouble_in("step", code)).failed == failed


def runs(pid: str) -> bool:
    """Tell whether a process is there, and not only its exit code."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").split()[2] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(sys.platform != "linux", reason="looks for the process in /proc")
def test_what_an_fmu_started_ends_with_it() -> None:
    said = 'LOG(m, fmi2Error, "%d", pid); return fmi2Error;'
    forks = trouble_in("step", f"int pid = fork(); if (!pid) {HANGS} {said}")
    pid = there(re.search(r"fmi2Error: (\d+)$", there(with_trouble(forks).failed)))[1]
    late = time.monotonic() + 30.0  # s: nothing but the kill ends it, and that takes a moment
    while runs(pid) and time.monotonic() < late:
        time.sleep(0.01)
    assert not runs(pid)


def test_many_short_calls_are_none_that_hangs() -> None:
    slow = trouble_in("step", "usleep(200000);")
    assert with_trouble(slow, timeout=1.5).failed is None  # 2 s in all


STRICT = replace(
    STAIR,
    name="strict",
    scalars=(*STAIR.scalars, Scalar("u", 2, "input")),
    set="if (m->terminated) return fmi2Error;",
)
"""Ends at `at`, and lets nothing be set from then on, as FMI has it."""


def ended(at: float, **options: Any) -> CosimulationRecord:
    """Return what a block that ends the run at a time in [s], and a gain that follows it, recorded."""
    blocks = {"end": STRICT, "gain": gain(), "before": gain()}
    connections = {"gain.u": "end.y", "end.u": "before.y"}
    return ran(blocks, connections, {"end": {"at": at}, "before": {"u": 0.0}}, step=0.2, **options)


def test_one_that_ends_the_run_at_a_communication_point_is_read_there_with_all_others() -> None:
    recorded = ended(0.8)
    assert recorded.failed is None
    assert recorded.t_ns.tolist() == [0, 200_000_000, 400_000_000, 600_000_000, 800_000_000]
    assert recorded.column("end", "y")[-1] == 0.8
    assert np.array_equal(recorded.column("gain", "y"), recorded.column("end", "y"))
    assert recorded.notes == ("block end ended the simulation at t = 0.8 s",)


def test_one_that_ends_the_run_between_two_is_read_there_alone() -> None:
    recorded = ended(0.9)
    assert recorded.failed is None
    assert recorded.t_ns[-2:].tolist() == [800_000_000, 900_000_000]
    assert np.array_equal(recorded.column("end", "y")[-2:], [0.8, 0.9])
    assert np.array_equal(recorded.column("gain", "y")[-2:], [0.8, 0.8])
    assert recorded.notes == (
        "block end ended the simulation at t = 0.9 s",
        "at t = 0.9 s the other blocks have their values of t = 0.8 s",
    )


@pytest.mark.slow
def test_the_end_is_recorded_where_only_some_points_are() -> None:
    assert ended(0.9, record_every=3).t_ns.tolist() == [0, 600_000_000, 900_000_000]
    assert ended(1.0, record_every=3).t_ns.tolist() == [0, 600_000_000, 1_000_000_000]


def test_several_blocks_may_end_the_run_in_one_step() -> None:
    recorded = ran({"a": STAIR, "b": STAIR}, None, {one: {"at": 0.8} for one in "ab"}, step=0.2)
    assert recorded.t_ns[-1] == 800_000_000
    assert [recorded.column(one, "y")[-1] for one in "ab"] == [0.8, 0.8]
    assert recorded.notes == tuple(f"block {one} ended the simulation at t = 0.8 s" for one in "ab")
