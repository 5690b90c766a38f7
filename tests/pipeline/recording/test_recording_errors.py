"""Files that are no recording of ours, or not whole, and outputs that cannot be written."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun as rr

from asserting import refusal
from recordable import build_comparison, build_run
from urmpipe_models.errors import OutputError, RecordingError
from urmpipe_pipeline.recording import is_ours, is_recording
from urmpipe_pipeline.recording.codec import encode
from urmpipe_pipeline.recording.layout import LAYOUT_VERSION, checksum, metadata_json
from urmpipe_pipeline.recording.reader import Store
from urmpipe_pipeline.recording.writer import verify
from urmpipe_pipeline.results import read_recording, write_recording


def trouble(path: Path) -> str:
    """Return what reading a file says, without the file's name."""
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    assert len(caught.value.findings) == 1
    assert caught.value.findings[0].file == str(path)
    return caught.value.findings[0].message


def foreign(path: Path, application: str, *properties: rr.AnyValues, rows: int = 3) -> Path:
    """Write a recording with Rerun alone: two arrays of two columns, and properties."""
    with rr.RecordingStream(application, send_properties=False) as stream:
        stream.save(path)
        for one in properties:
            stream.send_property("urmpipe", one)
        for entity in ("/q", "/log/q"):
            times = [rr.TimeColumn("row", sequence=np.arange(1, rows + 1))]
            stream.send_columns(entity, times, rr.Scalars.columns(scalars=np.ones((rows, 2))))
    return path


def told(metadata: str) -> rr.AnyValues:
    """Return the property of a recording with some metadata that are as they were written."""
    return rr.AnyValues(metadata=metadata, checksum=checksum(metadata))


@pytest.mark.parametrize("content", [None, b"", b"RR", b"t,x,y,z\n0,0,0,0\n"])
def test_no_recording(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "log.rrd"
    if content is not None:
        path.write_bytes(content)
    assert not is_recording(path)
    assert not is_ours(path)
    kind = "no such file" if content is None else "no Rerun recording"
    assert trouble(path) == f"found {kind}, allowed: a recording (.rrd) that urmpipe wrote"
    assert trouble(tmp_path) == "found no such file, allowed: a recording (.rrd) that urmpipe wrote"


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0001, 0.3, 0.9, 0.99999])
def test_a_recording_that_was_cut_off(tmp_path: Path, share: float) -> None:
    whole = write_recording(build_run(), tmp_path / "whole.rrd").read_bytes()
    path = tmp_path / "cut.rrd"
    path.write_bytes(whole[: max(12, int(len(whole) * share))])
    assert is_recording(path)
    assert trouble(path) == (
        "found a recording that was cut off (no footer), allowed: a whole one; what is left of it can be"
        f" looked at after: rerun rrd optimize {path} -o mended.rrd"
    )


@pytest.mark.slow
@pytest.mark.parametrize("application", ["another", "urmpipeline", "my urmpipe"])
def test_a_recording_of_another_program(tmp_path: Path, application: str) -> None:
    path = foreign(tmp_path / "foreign.rrd", application)
    assert (is_recording(path), is_ours(path)) == (True, False)
    assert trouble(path) == f"found a recording of {application}, allowed: one of urmpipe"


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


MADE_BY = {"provenance": {"command": "compare", "inputs": [{"name": "asked.csv"}, {"name": "log.csv"}]}}
"""What recordings of all layouts have said of where they come from."""

ALLOWED_LAYOUT = f"allowed: {LAYOUT_VERSION}; "


def of_layout(version: int, result: object) -> rr.AnyValues:
    """Return the property of a recording of another layout, which had no checksum."""
    document = {"layout_version": version, "kind": "comparison", "result": result}
    return rr.AnyValues(metadata=json.dumps(document))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("metadata", "said"),
    [
        (None, "found a recording without urmpipe's metadata, allowed: one that urmpipe wrote"),
        (of_layout(4, MADE_BY), f"found layout version 4, {ALLOWED_LAYOUT}an older urmpipe wrote it: make it"
         " again: urmpipe compare asked.csv log.csv and its options"),
        (of_layout(5, {"provenance": []}), f"found layout version 5, {ALLOWED_LAYOUT}an older urmpipe wrote"
         " it: make it again from what it was made of"),
        (of_layout(99, None), f"found layout version 99, {ALLOWED_LAYOUT}a newer urmpipe wrote it: make it"
         " again from what it was made of"),
        ("{", "found damaged metadata (JSONDecodeError("),
        ("[]", "found damaged metadata (TypeError("),
        ("{}", "found damaged metadata (KeyError('layout_version'))"),
        (metadata_json("", {}), "found a result of kind '', allowed: run, comparison, diagnosis, simulation"),
        (metadata_json("run", None), "found damaged metadata, /: found None, allowed: Run"),
        (metadata_json("run", {"name": 1}), "found damaged metadata, /name: found 1, allowed: str"),
        (metadata_json("run", {}, {"/q": "/q"}),
         "found damaged metadata, /clocks: found {'/q': '/q'}, allowed: the paths of times"),
        (metadata_json("run", {"name": "a"}),
         "found damaged metadata, /: found None, allowed: the field log of Run"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_the_metadata_is_said(
    metadata: rr.AnyValues | str | None, said: str, tmp_path: Path
) -> None:
    properties = [told(metadata)] if isinstance(metadata, str) else [metadata] if metadata else []
    path = foreign(tmp_path / "bad.rrd", "urmpipe", *properties)
    assert is_ours(path)
    message = trouble(path)
    assert message.startswith(said) if isinstance(metadata, str) else message == said


@pytest.mark.slow
def test_a_recording_without_an_array(tmp_path: Path) -> None:
    """As `rerun rrd optimize` leaves it when the end of the data is lost."""
    metadata = metadata_json("run", encode(build_run(rows=3)).tree)
    path = foreign(tmp_path / "less.rrd", "urmpipe", told(metadata))
    assert trouble(path) == "found 0 of 3 rows in /log/t_ns, allowed: all as were written"


def test_an_array_of_another_size_or_type_is_one_line(tmp_path: Path) -> None:
    store = Store(foreign(tmp_path / "a.rrd", "urmpipe", rr.AnyValues(metadata="{}"), rows=3))
    double = np.dtype(np.float64)
    assert store.read("/q", 0, 3, (2,), double).tolist() == [[1.0, 1.0]] * 3
    for width, rows, dtype, said in (
        ((2,), 4, double, "found 3 of 4 rows in /q"),
        ((3,), 3, double, "found damaged data in /q: cannot reshape"),
        ((2,), 3, np.dtype(np.int64), "found damaged data in /q: values of type float64 instead of int64"),
    ):
        with pytest.raises(RecordingError, match=said):
            store.read("/q", 0, rows, width, dtype)


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


SWITCHED_OFF = """
import sys
from pathlib import Path
sys.path[:0] = sys.argv[2:]
import recordable
from urmpipe_models.errors import OutputError
from urmpipe_pipeline.results import write_recording
try:
    write_recording(recordable.build_run(rows=5), Path(sys.argv[1]))
except OutputError as error:
    print(error)
"""


@pytest.mark.slow
def test_rerun_switched_off_is_one_line(tmp_path: Path) -> None:
    shared = Path(__file__).parents[2] / "shared"
    done = subprocess.run(
        [sys.executable, "-c", SWITCHED_OFF, str(tmp_path / "one.rrd"), str(shared)],
        capture_output=True, text=True, check=False, timeout=100, env={**os.environ, "RERUN": "off"},
    )  # fmt: skip
    wanted = "Rerun is switched off by the environment variable RERUN; allowed: unset or on\n"
    assert (done.stdout, done.returncode) == (wanted, 0), done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_what_reads_back_otherwise_is_named(tmp_path: Path) -> None:
    """The first, the middle and the last row of each array, the number of rows, and the metadata."""
    comparison = build_comparison(("coppeliasim",), rows=40_000)
    path = write_recording(comparison, tmp_path / "one.rrd")
    found = encode(comparison)
    metadata = Store(path).metadata
    verify(path, path, found, metadata)
    altered, rows = [], iter((0, 39_999, 20_000))
    for column in found.arrays:
        values = column.values.copy()
        if column.path == "/runs/coppeliasim/run/log/q":
            values = values[:-1]
        elif column.path.endswith(("/qd", "/tcp/position", "/coppeliasim/delta")):
            values[next(rows), 0] += 1e-12
        altered.append(column._replace(values=values))
    altered_result = found._replace(arrays=tuple(altered))
    said = refusal(OutputError, verify, path, Path("name.rrd"), altered_result, "{}")
    assert said.splitlines() == [
        f"name.rrd: differs when read back: {one}"
        for one in (
            "the metadata",
            "/runs/coppeliasim/run/log/q has 40000 rows of 39999",
            "/runs/coppeliasim/run/qd in row 1",
            "/runs/coppeliasim/run/tcp/position in row 40000",
            "/runs/coppeliasim/delta in row 20001",
        )
    ]


@pytest.mark.slow
def test_what_cannot_be_read_back_is_named(tmp_path: Path) -> None:
    run = build_run(rows=5)
    path = write_recording(run, tmp_path / "one.rrd")
    path.write_bytes(path.read_bytes()[:-20])
    found = encode(run)
    said = refusal(OutputError, verify, path, Path("name.rrd"), found, metadata_json("run", found.tree))
    assert said.startswith("name.rrd: could not be read back: found a recording that was cut off")


def test_what_could_not_be_read_back_is_not_written(tmp_path: Path) -> None:
    run = build_run(rows=5)
    run = replace(run, log=replace(run.log, digits="four"))  # type: ignore[arg-type]
    path = tmp_path / "one.rrd"
    said = refusal(OutputError, write_recording, run, path)
    assert said == f"{path}: cannot be recorded: /log/digits: found 'four', allowed: int or None"
    assert list(tmp_path.iterdir()) == []
