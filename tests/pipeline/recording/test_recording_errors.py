"""Recordings that cannot be written or verified; those that cannot be read are in files.cases."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from asserting import refusal
from recordable import build_comparison, build_run
from urmpipe_models.errors import OutputError
from urmpipe_pipeline.recording.codec import encode
from urmpipe_pipeline.recording.reader import Store
from urmpipe_pipeline.recording.writer import verify
from urmpipe_pipeline.results import write_recording


def test_a_recording_is_known_without_rerun(tmp_path: Path) -> None:
    """Rerun takes long to import, which is done while a log is read: not before it begins."""
    ours, other = write_recording(build_run(), tmp_path / "run.rrd"), tmp_path / "log.csv"
    other.write_text("t,q1\n0,1\n")
    script = (
        "import sys; from pathlib import Path; from urmpipe_pipeline.recording import is_ours, is_recording;"
        "paths = map(Path, sys.argv[1:]);"
        "print([(is_recording(path), is_ours(path)) for path in paths], 'rerun' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(ours), str(other)],
        capture_output=True, text=True, check=True, timeout=100,
    )  # fmt: skip
    assert done.stdout == "[(True, True), (False, False)] False\n"


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 1 MB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(disk)]
    if sys.platform != "linux" or subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("mounting a small disk needs Linux and root")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


@pytest.mark.slow
def test_a_full_disk_is_one_line_and_leaves_the_old_output(small_disk: Path) -> None:
    path = write_recording(build_run(rows=5), small_disk / "one.rrd")
    before = path.read_bytes()
    said = refusal(OutputError, write_recording, build_run(rows=100_000), path)
    assert said == f"{path}: cannot be written: No space left on device"
    assert [(one, one.read_bytes()) for one in small_disk.iterdir()] == [(path, before)]


@pytest.mark.slow
def test_rerun_switched_off_is_one_line(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t,q1\n0,0.1\n1,0.2\n2,0.1\n")
    done = subprocess.run(
        [sys.executable, "-m", "urmpipe", "ingest", str(log), "-o", str(tmp_path / "one.rrd")],
        capture_output=True, text=True, check=False, timeout=100, env={**os.environ, "RERUN": "off"},
    )  # fmt: skip
    wanted = "error: Rerun is switched off by the environment variable RERUN; allowed: unset or on"
    assert (done.stderr.splitlines()[-1], done.returncode) == (wanted, 2)
    assert list(tmp_path.iterdir()) == [log]


@pytest.mark.slow
def test_what_reads_back_otherwise_is_named(tmp_path: Path) -> None:
    """The first, the middle and the last row of each array, the number of rows, and the metadata."""
    comparison = build_comparison(("coppeliasim",), rows=40_000)
    path = write_recording(comparison, tmp_path / "one.rrd")
    found = encode(comparison)
    verify(path, path, found, Store(path).metadata)
    altered, rows = [], iter((0, 39_999, 20_000))
    for column in found.arrays:
        values = column.values.copy()
        if column.path == "/runs/coppeliasim/run/log/q":
            values = values[:-1]
        elif column.path.endswith(("/qd", "/tcp/position", "/coppeliasim/delta")):
            values[next(rows), 0] += 1e-12
        altered.append(column._replace(values=values))
    said = refusal(OutputError, verify, path, Path("one"), found._replace(arrays=tuple(altered)), "{}")
    assert said.replace("one: differs when read back: ", "").splitlines() == [
        "the metadata",
        "/runs/coppeliasim/run/log/q has 40000 rows of 39999",
        "/runs/coppeliasim/run/qd in row 1",
        "/runs/coppeliasim/run/tcp/position in row 40000",
        "/runs/coppeliasim/delta in row 20001",
    ]


@pytest.mark.slow
def test_what_cannot_be_read_back_is_named(tmp_path: Path) -> None:
    run = build_run(rows=5)
    path = write_recording(run, tmp_path / "one.rrd")
    path.write_bytes(path.read_bytes()[:-20])
    said = refusal(OutputError, verify, path, Path("name.rrd"), encode(run), "{}")
    assert said.startswith("name.rrd: could not be read back: found an incomplete recording")


def test_what_could_not_be_read_back_is_not_written(tmp_path: Path) -> None:
    run = build_run(rows=5)
    run = replace(run, log=replace(run.log, digits="four"))  # type: ignore[arg-type]
    path = tmp_path / "one.rrd"
    said = refusal(OutputError, write_recording, run, path)
    assert said == f"{path}: cannot be recorded: /log/digits: found 'four', allowed: int or None"
    assert list(tmp_path.iterdir()) == []
