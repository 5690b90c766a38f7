"""However an FMU ends or hangs in a check or a simulation, the call is named, and no process is left."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from asserting import there
from foreign_fmus import HANGS, OVERFLOWS, TAKES_MEMORY, Foreign, Scalar, fmu, gain, planned, trouble_in
from urmpipe_fmus.check import CheckReport, check_fmu
from urmpipe_fmus.cosim import CosimulationRecord, simulate, start_worker

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="needs signals and /proc")

CALLS = {  # where C is in an FMU: the call in a simulation, recorded rows before, the call in a check
    "load": ("loading", 0, "loading"),
    "start": ("fmi2Instantiate", 0, "fmi2Instantiate"),
    "setup": ("fmi2SetupExperiment", 0, "fmi2SetupExperiment"),
    "set": ("fmi2SetReal", 0, ""),  # a check sets nothing
    "enter": ("fmi2EnterInitializationMode", 0, "fmi2EnterInitializationMode"),
    "get": ("fmi2GetReal", 0, "fmi2GetReal of value reference 0"),
    "exit": ("fmi2ExitInitializationMode", 0, "fmi2ExitInitializationMode"),
    "step": ("fmi2DoStep", 1, "fmi2DoStep at 0 s"),
    "terminate": ("fmi2Terminate", 11, "fmi2Terminate"),
    "free": ("fmi2FreeInstance", 11, "fmi2FreeInstance"),
}


def simulated(bad: Foreign, timeout: float = 60.0) -> CosimulationRecord:
    """Run a system of an FMU and one that follows it."""
    plan = planned({"good": gain(), "bad": bad}, {"good.u": "bad.y"}, {"bad": {"u": 0.0}})
    return simulate(plan, timeout=timeout)


def checked(bad: Foreign, timeout: float = 60.0) -> CheckReport:
    return check_fmu(fmu(replace(bad, variable_step=False)), timeout=timeout)


def run_problems(report: CheckReport) -> tuple[str, ...]:
    """Return the problems of the run, without that of the description, which lacks the InitialUnknowns."""
    first, *others = report.problems
    assert first.startswith("ModelStructure/InitialUnknowns does not contain the expected set of variables.")
    return tuple(others)


def children(pid: int) -> list[int]:
    lists = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for each in lists for child in each.read_text().split()]


def ends(pid: int) -> bool:
    """Return whether a process ends within 20 s: nothing but a kill ends it, and that takes a moment."""
    until = time.monotonic() + 20.0
    runs = Path(f"/proc/{pid}/exe")  # a process that ended and was not waited for has none
    while runs.exists() and time.monotonic() < until:
        time.sleep(0.05)
    return not runs.exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "timeout", "how", "calls"),
    [
        ("exit(0);", 60.0, "ended the process with the exit code 0", CALLS),
        # which call it is, is noted alike for both
        (HANGS, 3.0, "did not return within 3 s", ["load", "get", "step", "free"]),
    ],
)
def test_any_call_may_hang_or_exit(code: str, timeout: float, how: str, calls: Iterable[str]) -> None:
    before = set(children(os.getpid()))
    troubles = {call: trouble_in(call, code) for call in calls}
    with ThreadPoolExecutor(len(troubles)) as pool:
        records = [*pool.map(lambda trouble: simulated(trouble, timeout), troubles.values())]
        reports = [*pool.map(lambda trouble: checked(trouble, timeout), troubles.values())]
    for call, record, report in zip(troubles, records, reports, strict=True):
        name, rows, check_name = CALLS[call]
        assert record.failed == f"block bad: {name} at t = {rows // 11} s: {how}; it logged nothing"
        assert len(record.t_ns) == rows
        if check_name:
            assert (run_problems(report), report.ran) == ((f"{check_name} {how}",), False)
    assert set(children(os.getpid())) <= before


SEGMENTATION = ": Segmentation fault (SIGSEGV)"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "how"),
    [("exit(1);", " with the exit code 1"), (OVERFLOWS, SEGMENTATION), (TAKES_MEMORY, SEGMENTATION)],
)
def test_how_a_process_ended_is_reported(code: str, how: str) -> None:
    bad = trouble_in("step", code)
    record, report = simulated(bad), checked(bad)
    assert record.failed == f"block bad: fmi2DoStep at t = 0 s: ended the process{how}; it logged nothing"
    assert run_problems(report) == (f"fmi2DoStep at 0 s ended the process{how}",)
    assert (report.ran, report.variables[0].before, report.variables[0].after) == (False, 0.0, None)


@pytest.mark.slow
def test_many_short_calls_do_not_hang() -> None:
    assert simulated(trouble_in("step", "usleep(200000);"), timeout=1.5).failed is None  # 2 s in all


def test_an_fmu_that_reads_its_input_gets_none() -> None:
    report = checked(trouble_in("enter", "char letter; if (read(0, &letter, 1)) return fmi2Error;"))
    assert (run_problems(report), report.warnings, report.ran) == ((), (), True)


@pytest.mark.slow
def test_a_process_that_an_fmu_started_ends_with_it() -> None:
    code = f'int pid = fork(); if (!pid) {HANGS} LOG(m, fmi2Error, "%d", pid);'
    failed = there(simulated(trouble_in("step", f"{code} return fmi2Error;")).failed)
    hung, log = run_problems(checked(trouble_in("step", f"{code} {HANGS}"), timeout=1.0))
    assert hung == "fmi2DoStep at 0 s did not return within 1 s"
    for text in (failed, log):
        assert ends(int(there(re.search(r": (\d+)$", text))[1]))


CALLS_OF_FMUS = ["check_fmu(path)", "simulate(prepare(system, lambda block: path))"]
PROGRAM = """
import signal, sys
from pathlib import Path
from urmpipe_fmus.check import check_fmu
from urmpipe_fmus.cosim import Block, System, prepare, simulate
path = Path(sys.argv[1])
signal.signal(signal.SIGINT, signal.default_int_handler)  # also below a shell that ignores it
blocks = (Block(name="bad", fmu=path, start={"u": 0.0}),)
system = System(name="test", path=Path("test.toml"), step=0.1, duration=1.0, blocks=blocks)
"""


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
@pytest.mark.parametrize("call", CALLS_OF_FMUS, ids=["check", "simulate"])
def test_an_fmu_that_hangs_ends_with_its_parent(how: signal.Signals, call: str, tmp_path: Path) -> None:
    started = tmp_path / "started"
    path = fmu(trouble_in("step", f'if (fork()) creat("{started}", 0600); {HANGS}'))
    environment = {**os.environ, "TMPDIR": str(tmp_path), "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", PROGRAM + call, str(path)]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL, env=environment) as parent:
        while not started.exists():
            assert parent.poll() is None
            time.sleep(0.05)
        (worker,) = children(parent.pid)
        (forked,) = children(worker)
        parent.send_signal(how)
        assert parent.wait(20) != 0
    assert ends(worker)
    assert ends(forked)
    assert list(tmp_path.iterdir()) == [started]


@pytest.mark.slow
def test_endless_prints_do_not_fill_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flood = Foreign(
        name="flood",
        scalars=(Scalar("y", 0),),
        step="""
        static char text[1000000]; memset(text, '.', sizeof text); text[sizeof text - 1] = '\\n';
        write(1, text, sizeof text); usleep(50000);
        if (t > 0.85) { write(2, "no more\\n", 8); abort(); }
        """,
    )
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr("urmpipe_fmus.cosim.simulation.MAX_OUTPUT_BYTES", 10_000)
    sizes: list[int] = []

    def look(_: float) -> None:
        sizes.extend(path.stat().st_size for path in tmp_path.glob("urmpipe-*/output.txt"))

    record = simulate(planned({"f": flood}, step=0.05), progress=look)
    assert max(sizes) < 9_000_000  # of 18 MB; it is polled between two of them
    assert there(record.failed).endswith("no more")


@pytest.mark.slow
def test_neither_logging_without_end_nor_a_stopped_process_is_waited_for() -> None:
    hung = "fmi2DoStep at 0 s did not return within 1 s"
    spins = checked(trouble_in("step", 'for (;;) LOG(m, fmi2OK, "round and round");'), timeout=1.0)
    assert run_problems(spins) == (hung, *["its log: round and round"] * 5)
    assert run_problems(checked(trouble_in("step", "raise(SIGSTOP);"), timeout=1.0)) == (hung,)


def test_a_process_ends_without_a_job_and_one_that_ended_before_is_reported_by_its_exit_code() -> None:
    with start_worker() as worker:
        assert worker.process.poll() is None
    assert worker.process.poll() is not None
    assert not worker.folder.exists()
    with start_worker() as worker:
        worker.process.kill()
        worker.process.wait()
        assert worker.run(str) == "ended the process: Killed (SIGKILL)"
