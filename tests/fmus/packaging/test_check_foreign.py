"""Checking FMUs of a few lines of C that end their process, hang or give no number, in each call."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from foreign_fmus import HANGS, NAN_OUTPUT, STAIR, TAKES_MEMORY, fmu, trouble_in
from urmpipe_fmus.check import CheckReport, check_fmu

pytestmark = pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs signals and /proc")

CALLS = {
    "load": "loading",
    "start": "fmi2Instantiate",
    "setup": "fmi2SetupExperiment",
    "enter": "fmi2EnterInitializationMode",
    "exit": "fmi2ExitInitializationMode",
    "get": "fmi2GetReal of value reference 0",
    "step": "fmi2DoStep at 0.025 s",
    "terminate": "fmi2Terminate",
    "free": "fmi2FreeInstance",
}
"""How a check names each call in which the FMU breaks."""


def breaking(call: str, code: str) -> Path:
    """An FMU that runs some C in a call, of the steps in the sixth and those after it."""
    late = f"if (t > 0.022) {{ {code} }}" if call == "step" else code
    return fmu(replace(trouble_in(call, late), variable_step=False))


def of_run(found: CheckReport) -> tuple[str, ...]:
    """Return the problems of the run: none of the description, which lacks the InitialUnknowns."""
    first, *others = found.problems
    assert first.startswith("ModelStructure/InitialUnknowns does not contain the expected set of variables.")
    return tuple(others)


def checked(paths: list[Path], *, timeout: float = 60.0) -> list[CheckReport]:
    """Check FMUs at the same time."""
    with ThreadPoolExecutor(len(CALLS)) as pool:
        return list(pool.map(partial(check_fmu, timeout=timeout), paths))


@pytest.mark.slow
def test_an_fmu_that_ends_its_process_in_any_call_is_told_with_the_call() -> None:
    for call, found in zip(CALLS, checked([breaking(call, "exit(0);") for call in CALLS]), strict=True):
        assert of_run(found) == (f"{CALLS[call]} ended the process with the exit code 0",)
        assert not found.ran


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "ending"),
    [
        ("exit(1);", " with the exit code 1"),
        (TAKES_MEMORY, ": Segmentation fault (SIGSEGV)"),
    ],
)
def test_how_a_process_ended_is_told(code: str, ending: str) -> None:
    found = check_fmu(breaking("step", code))
    assert (of_run(found), found.ran) == ((f"fmi2DoStep at 0.025 s ended the process{ending}",), False)
    assert (found.variables[0].before, found.variables[0].after) == (0.0, None)


@pytest.mark.slow
def test_an_fmu_that_hangs_is_ended_and_told_with_the_call() -> None:
    calls = ("load", "enter", "step", "free")  # which call it is, is noted as for one that ends the process
    paths = [breaking(call, HANGS) for call in calls]
    for call, found in zip(calls, checked(paths, timeout=2.0), strict=True):
        assert (of_run(found), found.ran) == ((f"{CALLS[call]} did not return within 2 s",), False)


@pytest.mark.slow
def test_neither_logging_without_end_nor_a_stopped_process_is_waited_for() -> None:
    ways = ('for (;;) LOG(m, fmi2OK, "round and round");', "raise(SIGSTOP);")
    spins, stops = checked([breaking("step", way) for way in ways], timeout=1.0)
    hung = "fmi2DoStep at 0.025 s did not return within 1 s"
    assert of_run(spins) == (hung, *["its log: round and round"] * 5)
    assert of_run(stops) == (hung,)


def test_an_fmu_that_reads_its_input_gets_none() -> None:
    found = check_fmu(breaking("enter", "char letter; if (read(0, &letter, 1)) return fmi2Error;"))
    assert (of_run(found), found.warnings, found.ran) == ((), (), True)


def test_a_value_that_becomes_nan_is_a_problem_with_its_name_and_first_time() -> None:
    late = "v->r[0] = v->time > 0.0475 ? NAN : v->time; v->r[1] = v->time;"
    found = check_fmu(fmu(replace(NAN_OUTPUT, compute=late, variable_step=False)))
    assert of_run(found) == ("at 0.05 s: found y = nan, allowed: outputs that are finite",)
    assert (found.ran, found.variables[0].before, found.variables[0].after) == (True, 0.0, None)


@pytest.mark.slow
def test_a_run_that_the_fmu_ends_early_is_no_pass_and_its_values_are_those_of_its_last_time() -> None:
    early = replace(STAIR, start="m->v.r[0] = 0.0275;", variable_step=False)
    found = check_fmu(fmu(early))
    said = "fmi2DoStep at 0.025 s ended the run (fmi2Discard, terminated) after 5 of 20 steps"
    assert (of_run(found), found.ran) == ((said,), False)
    assert found.variables[1].after == 0.0275
    (said,) = of_run(check_fmu(breaking("step", "return fmi2Discard;")))
    assert said == "fmi2DoStep at 0.025 s: fmi2DoStep failed with status 2 (discard)."


@pytest.mark.slow
def test_warnings_of_an_fmu_are_told_and_are_no_problem() -> None:
    warm = 'LOG(m, fmi2Warning, "warm"); v->time = t + h; return fmi2Warning;'
    found = check_fmu(breaking("step", warm))
    assert (of_run(found), found.ran) == ((), True)
    assert found.warnings == (
        "fmi2DoStep at 0.025 s returned fmi2Warning, and 14 more of its calls; its log: warm",
    )
    assert check_fmu(breaking("terminate", "return fmi2Warning;")).warnings == (
        "fmi2Terminate returned fmi2Warning",
    )


def gone(process: int) -> bool:
    """Whether a process has ended, within 20 s: longer means that nothing ends it."""
    stat = Path(f"/proc/{process}/stat")
    for _ in range(400):
        if not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] == "Z":
            return True
        time.sleep(0.05)
    return False


def test_a_process_that_an_fmu_started_is_not_left() -> None:
    starts = 'pid_t other = fork(); if (other) LOG(m, fmi2OK, "started %d", (int)other); for (;;) pause();'
    hung, log = of_run(check_fmu(breaking("step", starts), timeout=1.0))
    assert hung == "fmi2DoStep at 0.025 s did not return within 1 s"
    [started] = re.fullmatch(r"its log: started (\d+)", log).groups()  # type: ignore[union-attr]
    assert gone(int(started))


def test_neither_process_nor_folder_is_left_when_the_one_that_checks_is_killed(
    tmp_path: Path,
) -> None:
    program = "import pathlib, sys, urmpipe_fmus.check as c; c.check_fmu(pathlib.Path(sys.argv[1]))"
    checking = subprocess.Popen(
        [sys.executable, "-c", program, str(breaking("step", HANGS))],
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )
    with checking:
        children = Path(f"/proc/{checking.pid}/task/{checking.pid}/children")
        while not any(b"DoStep" in one.read_bytes() for one in tmp_path.glob("*/call")):
            assert checking.poll() is None
            time.sleep(0.05)
        [child] = map(int, children.read_text().split())
        checking.send_signal(signal.SIGKILL)
    assert gone(child)
    assert list(tmp_path.iterdir()) == []
