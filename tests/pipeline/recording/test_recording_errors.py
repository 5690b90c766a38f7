"""Files that are no recording of ours, or not whole, and outputs that cannot be written."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun as rr

from urmpipe_models.errors import OutputError, RecordingError
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.recording import is_ours, is_recording
from urmpipe_pipeline.recording.entities import LAYOUT_VERSION, blocks
from urmpipe_pipeline.recording.metadata import to_json
from urmpipe_pipeline.recording.verify import verify
from urmpipe_pipeline.results import read_recording, write_recording
from urmpipe_pipeline.runs.results import Run

MakeRun = Callable[..., Run]
MakeComparison = Callable[..., Comparison]


def trouble(path: Path) -> str:
    """Return what reading a file says, without the file's name."""
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    assert len(caught.value.findings) == 1
    assert caught.value.findings[0].file == str(path)
    return caught.value.findings[0].message


def foreign(path: Path, application: str, *properties: rr.AnyValues, rows: int = 3) -> Path:
    """Write a recording with Rerun alone: joints/raw and joints/repolarized of two joints, and properties."""
    with rr.RecordingStream(application, send_properties=False) as stream:
        stream.save(path)
        for one in properties:
            stream.send_property("urmpipe", one)
        for entity in ("/joints/raw", "/joints/repolarized"):
            times = [rr.TimeColumn("t", duration=np.arange(rows).astype("timedelta64[ns]"))]
            stream.send_columns(entity, times, rr.Scalars.columns(scalars=np.ones((rows, 2))))
    return path


def test_no_file(tmp_path: Path) -> None:
    wanted = "found no such file, allowed: a recording (.rrd) that urmpipe wrote"
    assert trouble(tmp_path / "run.rrd") == wanted
    assert trouble(tmp_path) == wanted


@pytest.mark.parametrize("content", [b"", b"RR", b"t,x,y,z\n0,0,0,0\n"])
def test_no_recording(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "log.rrd"
    path.write_bytes(content)
    assert not is_recording(path)
    assert not is_ours(path)
    assert trouble(path) == "found no Rerun recording, allowed: a recording (.rrd) that urmpipe wrote"


@pytest.mark.parametrize("share", [0.0001, 0.3, 0.9, 0.99999])
def test_a_recording_that_was_cut_off(make_run: MakeRun, tmp_path: Path, share: float) -> None:
    whole = write_recording(make_run(), tmp_path / "whole.rrd").read_bytes()
    path = tmp_path / "cut.rrd"
    path.write_bytes(whole[: max(12, int(len(whole) * share))])
    assert is_recording(path)
    assert trouble(path) == (
        "found a recording that was cut off (no footer), allowed: a whole one; what is left of it can be"
        f" looked at after: rerun rrd optimize {path} -o mended.rrd"
    )


@pytest.mark.parametrize("application", ["another", "urmpipeline", "my urmpipe"])
def test_a_recording_of_another_program(tmp_path: Path, application: str) -> None:
    path = foreign(tmp_path / "foreign.rrd", application)
    assert is_recording(path)
    assert not is_ours(path)
    assert trouble(path) == f"found a recording of {application}, allowed: one of urmpipe"


def test_a_recording_to_replace_is_known_without_rerun(make_run: MakeRun, tmp_path: Path) -> None:
    """Rerun takes long to import, which is done beside the work: not before it begins."""
    path = write_recording(make_run(), tmp_path / "run.rrd")
    script = (
        "import sys; from pathlib import Path; from urmpipe_pipeline.recording.identity import is_ours;"
        "print(is_ours(Path(sys.argv[1])), 'rerun' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=True, timeout=100
    )
    assert done.stdout == "True False\n"


def test_a_recording_without_metadata(tmp_path: Path) -> None:
    path = foreign(tmp_path / "bare.rrd", "urmpipe")
    assert is_ours(path)
    assert trouble(path) == "found a recording without urmpipe's metadata, allowed: one that urmpipe wrote"


def test_a_recording_of_a_newer_layout(tmp_path: Path) -> None:
    newer = rr.AnyValues(metadata=json.dumps({"layout_version": 99, "something": "new"}))
    path = foreign(tmp_path / "newer.rrd", "urmpipe", newer)
    assert trouble(path) == "found layout version 99, allowed: up to 5; a newer urmpipe wrote it"


@pytest.mark.parametrize(("kind", "known"), [("run", 4), ("comparison", 4), ("simulation", 5)])
def test_each_kind_has_a_newest_layout_of_its_own(tmp_path: Path, kind: str, known: int) -> None:
    """A run of layout 5 is of a newer urmpipe, though simulations of layout 5 are known."""
    newer = rr.AnyValues(metadata=json.dumps({"layout_version": known + 1, "kind": kind}))
    path = foreign(tmp_path / "newer.rrd", "urmpipe", newer)
    assert trouble(path) == (
        f"found layout version {known + 1}, allowed: up to {known}; a newer urmpipe wrote it"
    )


def test_a_recording_of_an_older_layout(tmp_path: Path) -> None:
    older = rr.AnyValues(metadata=json.dumps({"layout_version": LAYOUT_VERSION - 1}))
    path = foreign(tmp_path / "older.rrd", "urmpipe", older)
    assert trouble(path) == (
        f"found layout version {LAYOUT_VERSION - 1}, allowed: {LAYOUT_VERSION}; an older urmpipe wrote it:"
        " make it again from its log"
    )


@pytest.mark.parametrize(
    ("metadata", "reason"),
    [
        (
            "{",
            "JSONDecodeError('Expecting property name enclosed in double quotes: line 1 column 2 (char 1)')",
        ),
        ("[]", "TypeError('list indices must be integers or slices, not str')"),
        ("{}", "KeyError('layout_version')"),
        ('{"layout_version": 4, "kind": "run"}', "KeyError('arrays')"),
        ('{"layout_version": 4, "kind": "run", "arrays": {}, "result": {"place": {"key": 1}}}', None),
    ],
)
def test_a_recording_with_damaged_metadata(tmp_path: Path, metadata: str, reason: str | None) -> None:
    message = trouble(foreign(tmp_path / "bad.rrd", "urmpipe", rr.AnyValues(metadata=metadata)))
    assert message.startswith(f"found damaged metadata ({reason or 'TypeError('}")
    assert message.endswith("), allowed: what urmpipe wrote")


def test_a_recording_with_other_arrays_than_were_written(make_run: MakeRun, tmp_path: Path) -> None:
    """As `rerun rrd optimize` leaves it when the end of the data is lost."""
    run = make_run(rows=3)
    path = foreign(tmp_path / "less.rrd", "urmpipe", rr.AnyValues(metadata=to_json(run, blocks(run))), rows=2)
    assert trouble(path) == "found 2 x 2 values in /joints/raw, allowed: 3 x 6, as were written"


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 72 MB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=72m", "tmpfs", str(disk)]
    if sys.platform != "linux" or subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("mounting a small disk needs Linux and root")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


def test_a_full_disk_is_one_line_and_leaves_the_old_output(make_run: MakeRun, small_disk: Path) -> None:
    """Rerun's own writer would wait forever once the disk is full: so it is stopped before."""
    path = write_recording(make_run(rows=5), small_disk / "one.rrd")
    before = path.read_bytes()
    with pytest.raises(OutputError) as error:
        write_recording(make_run(rows=100_000), path)
    assert str(error.value) == f"{small_disk}: found less than 64 MB free on the disk"
    assert [(one, one.read_bytes()) for one in small_disk.iterdir()] == [(path, before)]


SWITCHED_OFF = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import conftest
from urmpipe_models.errors import OutputError
from urmpipe_pipeline.results import write_recording
try:
    write_recording(conftest.build_run(rows=5), Path(sys.argv[2]))
except OutputError as error:
    print(error)
"""


def test_rerun_switched_off_is_one_line(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", SWITCHED_OFF, str(Path(__file__).parent), str(tmp_path / "one.rrd")],
        capture_output=True, text=True, check=False, timeout=100, env={**os.environ, "RERUN": "off"},
    )  # fmt: skip
    wanted = "Rerun is switched off by the environment variable RERUN; allowed: unset or on\n"
    assert (done.stdout, done.returncode) == (wanted, 0), done.stderr
    assert list(tmp_path.iterdir()) == []


def test_rerun_is_not_imported_before_it_is_needed(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,q1\n0,1\n")
    script = (
        "import sys; from pathlib import Path;"
        "from urmpipe_pipeline.recording import is_recording, is_ours;"
        "print(is_recording(Path(sys.argv[1])), is_ours(Path(sys.argv[1])), 'rerun' in sys.modules);"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=True, timeout=100
    )
    assert done.stdout == "False False False\n"


def test_what_reads_back_otherwise_is_named(make_comparison: MakeComparison, tmp_path: Path) -> None:
    """The first, the last and the worst sample of each array, the number of rows, and the metadata."""
    comparison = make_comparison(("coppeliasim",), rows=70_000)
    path = write_recording(comparison, tmp_path / "one.rrd")
    every = blocks(comparison)
    metadata = to_json(comparison, every)
    verify(path, path, every, metadata)
    worst = comparison.runs[0].worst
    assert 0 < worst < 69_999
    altered = []
    rows = iter((0, 69_999, worst))
    for block in every:
        values = block.values.copy()
        if block.entity == "/joints/raw":
            altered.append(replace(block, t_ns=block.t_ns[:-1], values=values[:-1]))
        elif block.entity in ("/joints/velocity", "/tcp/position", "/delta/coppeliasim"):
            values[next(rows), 0] += 1e-12
            altered.append(replace(block, values=values))
        else:
            altered.append(block)
    with pytest.raises(OutputError) as caught:
        verify(path, Path("name.rrd"), altered, "{}")
    assert str(caught.value).splitlines() == [
        "name.rrd: reads back otherwise than written: the metadata",
        "name.rrd: reads back otherwise than written: /joints/raw has 70000 rows of 69999",
        "name.rrd: reads back otherwise than written: /joints/velocity in row 0",
        "name.rrd: reads back otherwise than written: /tcp/position in row 69999",
        f"name.rrd: reads back otherwise than written: /delta/coppeliasim in row {worst}",
    ]


def test_what_cannot_be_read_back_is_named(make_run: MakeRun, tmp_path: Path) -> None:
    run = make_run(rows=5)
    path = write_recording(run, tmp_path / "one.rrd")
    path.write_bytes(path.read_bytes()[:-20])
    every = blocks(run)
    with pytest.raises(OutputError) as caught:
        verify(path, Path("name.rrd"), every, to_json(run, every))
    assert str(caught.value).startswith(
        "name.rrd: could not be read back: found a recording that was cut off"
    )
