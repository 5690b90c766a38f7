"""An FMU that fails is told by its name, the time and its last words; what was recorded stays."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

from asserting import there
from foreign_fmus import TROUBLE, Foreign, Scalar, fmu, gain, planned, ran, system
from urmpipe_fmus.cosim import prepare, simulate
from urmpipe_fmus.cosim.simulation import start_worker

WELL = "fmi2OK: trouble: all is well at 0.05 s"

SAID = f"its last lines: {WELL}"

FAILURES = {
    1: f"ended the process: Segmentation fault (SIGSEGV); {SAID} | fmi2Warning: about to break",
    2: f"ended the process: Aborted (SIGABRT); {SAID}",
    3: f"ended the process with the exit code 7; {SAID}",
    4: f"returned fmi2Error; {SAID} | fmi2Error: the motor is hot",
    5: f"returned fmi2Discard, it cannot step by 0.01 s from there: a smaller system.step may help; {SAID}",
    8: f"returned fmi2Fatal; {SAID}",
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", sorted(FAILURES))
def test_a_failing_block_is_told_and_what_was_recorded_stays(kind: int) -> None:
    recorded = ran({"good": gain(), "bad": TROUBLE}, {"good.u": "bad.y"}, {"bad": {"kind": kind}}, step=0.01)
    assert recorded.failed == f"block bad: fmi2DoStep at t = 0.05 s: {FAILURES[kind]}"
    assert recorded.t_ns.tolist() == [k * 10**7 for k in range(6)]
    assert np.array_equal(recorded.column("good", "y"), 0.01 * np.arange(6))


def test_an_fmu_may_end_the_simulation() -> None:
    recorded = ran({"bad": TROUBLE}, None, {"bad": {"kind": 6}}, step=0.01)
    assert recorded.failed is None
    assert recorded.notes == ("block bad ended the simulation at t = 0.05 s",)
    assert len(recorded.t_ns) == 6


def test_warnings_are_counted() -> None:
    recorded = ran({"bad": TROUBLE}, None, {"bad": {"kind": 7}}, step=0.01)
    assert recorded.failed is None
    assert recorded.notes == (
        "block bad: fmi2DoStep returned fmi2Warning 95 times, first at t = 0.05 s, the last: warm",
    )
    assert len(recorded.t_ns) == 101


def test_a_warning_before_a_failure_is_told_too() -> None:
    warns = Foreign(
        name="warns",
        scalars=(Scalar("y", 0),),
        step="if (t > 0.25) abort(); if (t > 0.15) { return fmi2Warning; }",
    )
    recorded = ran({"bad": warns})
    assert recorded.failed is not None
    assert recorded.notes == ("block bad: fmi2DoStep returned fmi2Warning once, at t = 0.2 s",)


@pytest.mark.slow
def test_only_the_last_lines_are_kept_of_a_long_log() -> None:
    talker = Foreign(
        name="talker",
        scalars=(Scalar("y", 0),),
        step="""
        for (int i = 0; i < 200; i++) LOG(m, fmi2OK, "%0200d", i);
        if (t > 4.95) { LOG(m, fmi2Error, "last one\\nin two lines"); return fmi2Error; }
        """,
    )
    recorded = ran({"talker": talker}, duration=10.0)
    words = [f"fmi2OK: {i:0200d}" for i in range(196, 200)] + ["fmi2Error: last one in two lines"]
    assert recorded.failed == (
        f"block talker: fmi2DoStep at t = 5 s: returned fmi2Error; its last lines: {' | '.join(words)}"
    )


def test_what_a_process_prints_is_among_its_last_words() -> None:
    printer = Foreign(
        name="printer", scalars=(Scalar("y", 0),), step='write(2, "assertion failed: x > 0\\n", 24); abort();'
    )
    assert ran({"p": printer}).failed == (
        "block p: fmi2DoStep at t = 0 s: ended the process: Aborted (SIGABRT); its last lines: assertion"
        " failed: x > 0"
    )


def test_a_state_that_cannot_be_freed_spoils_no_run_that_is_over() -> None:
    stingy = Foreign(
        name="stingy",
        scalars=(Scalar("u", 0, "input"), Scalar("y", 1, on=("u",))),
        compute="v->r[1] = cos(v->r[0]);",
        step="v->i[15] = 1;",
        fresh=False,
    )
    recorded = ran({"a": stingy}, {"a.u": "a.y"}, iterate=True)
    assert recorded.failed is None
    assert len(recorded.t_ns) == 11


@pytest.mark.slow
def test_an_fmu_that_prints_without_end_does_not_fill_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flood = Foreign(
        name="flood",
        scalars=(Scalar("y", 0),),
        step="""
        static char text[1000000]; memset(text, '.', sizeof text); text[sizeof text - 1] = '\\n';
        write(1, text, sizeof text); usleep(50000);
        if (t > 0.85) { write(2, "no more\\n", 8); abort(); }
        """,
    )
    plan = planned({"f": flood}, step=0.05)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr("urmpipe_fmus.cosim.simulation.MAX_OUTPUT_BYTES", 10_000)
    sizes: list[int] = []

    def look(_: float) -> None:
        sizes.extend(one.stat().st_size for one in tmp_path.glob("urmpipe-*/output.txt"))

    recorded = simulate(plan, progress=look)
    assert max(sizes) < 9_000_000  # of 18 MB; it is looked at between two of them
    assert there(recorded.failed).endswith("no more")


def test_an_fmu_that_gives_no_instance_is_told() -> None:
    other = Foreign(name="other", scalars=(Scalar("y", 0),), start="free(m); return NULL;")
    recorded = ran({"a": other})
    assert recorded.failed == "block a: fmi2Instantiate at t = 0 s: gave no instance; it logged nothing"
    assert recorded.values.shape == (0, 1)


def test_a_library_that_is_none_is_told(tmp_path: Path) -> None:
    broken = tmp_path / "broken.fmu"
    with zipfile.ZipFile(fmu(gain())) as given, zipfile.ZipFile(broken, "w") as made:
        for name in given.namelist():
            made.writestr(name, b"no library" if name.startswith("binaries") else given.read(name))
    recorded = simulate(prepare(system({"a": gain()}, None, {"a": {"u": 0.0}}), lambda block: broken))
    assert there(recorded.failed).startswith(
        "block a: loading at t = 0 s: cannot be loaded: Failed to load shared library"
    )


def test_a_refused_value_is_told() -> None:
    picky = Foreign(
        name="picky",
        scalars=(Scalar("u", 0, "input"), Scalar("y", 1)),
        step='if (v->r[0] > 0.5) { LOG(m, fmi2Error, "u = %g is too much", v->r[0]); return fmi2Error; }',
    )
    recorded = ran({"a": picky}, None, {"a": {"u": 0.75}})
    assert recorded.failed == (
        "block a: fmi2DoStep at t = 0 s: returned fmi2Error; its last lines: fmi2Error: u = 0.75 is too much"
    )
    assert len(recorded.t_ns) == 1


SCRIPT = """
from dataclasses import replace
from foreign_fmus import HANGS, TROUBLE, planned
from urmpipe_fmus.cosim import simulate
forks = replace(TROUBLE, name="forks", start=f"{TROUBLE.start} if (!fork()) {HANGS}")
plan = planned({"bad": forks}, None, {"bad": {"kind": 9}}, step=0.01)
simulate(plan, progress=lambda share: print(share, flush=True))
"""


def children(pid: int) -> list[int]:
    found = Path(f"/proc/{pid}/task/{pid}/children")
    return [int(one) for one in found.read_text().split()] if found.exists() else []


def ends(pid: int) -> bool:
    """Return whether a process ends soon."""
    until = time.monotonic() + 20.0
    runs = Path(f"/proc/{pid}/exe")  # of a process that ended and was not yet waited for there is none
    while runs.exists() and time.monotonic() < until:
        time.sleep(0.05)
    return not runs.exists()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="looks for the child in /proc")
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_an_fmu_that_hangs_ends_with_who_started_it(how: signal.Signals, tmp_path: Path) -> None:
    environment = {**os.environ, "TMPDIR": str(tmp_path), "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, "-c", SCRIPT], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
    ) as one:
        while not there(one.stdout).readline().startswith(b"0.05"):
            assert one.poll() is None
        (worker,) = children(one.pid)
        (forked,) = children(worker)
        one.send_signal(how)
        assert one.wait(20) != 0
    assert ends(worker)
    assert ends(forked)
    assert not list(tmp_path.glob("urmpipe-*"))


def test_the_process_that_runs_the_fmus_imports_little() -> None:
    code = "import sys, urmpipe_fmus.cosim.worker; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"pandas", "scipy", "casadi", "rerun", "pyarrow", "pythonfmu", "click"} & set(loaded)
    assert not {"urmpipe_fmus.block", "urmpipe_fmus.cosim.plan"} & set(loaded)


@pytest.mark.slow
def test_a_crash_at_the_end_does_not_hide_why_the_run_ended() -> None:
    rude = Foreign(
        name="rude",
        scalars=(Scalar("y", 0),),
        step='if (t > 0.25) { LOG(m, fmi2Error, "enough"); return fmi2Error; }',
        free="raise(SIGSEGV);",
    )
    assert ran({"a": rude}).failed == (
        "block a: fmi2DoStep at t = 0.3 s: returned fmi2Error; its last lines: fmi2Error: enough"
    )
    short = ran({"a": rude}, duration=0.2)
    assert len(short.t_ns) == 3
    assert short.failed == (
        "block a: fmi2FreeInstance at t = 0.2 s: ended the process: Segmentation fault (SIGSEGV); it logged"
        " nothing"
    )


def test_a_process_that_waits_for_its_job_ends_without_one() -> None:
    with start_worker() as worker:
        folder, process = worker.folder, worker.process
        assert process.poll() is None
    assert process.poll() is not None
    assert not folder.exists()


def test_a_process_that_ended_before_its_job_tells_by_its_exit_code() -> None:
    with start_worker() as worker:
        worker.process.kill()
        worker.process.wait()
        assert worker.run(str) == "ended the process: Killed (SIGKILL)"
