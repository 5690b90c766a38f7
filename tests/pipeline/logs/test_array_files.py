"""Files of arrays: HDF5 by h5py and pandas, MAT 5 and 7.3, Octave; each is the log of the same CSV."""

from __future__ import annotations

import shutil
import struct
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from asserting import refusal
from urmpipe_models.errors import LogError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.logs.log_map import read_options

ROWS = 60
T = np.arange(ROWS) * 0.01
Q = 0.5 * np.sin(2 * np.pi * 0.7 * T[:, None] + np.arange(6))  # [rad], no joint increases throughout
RAD = LogMap(unit={"": "rad"})


@pytest.fixture(scope="module")
def wanted(tmp_path_factory: pytest.TempPathFactory) -> JointLog:
    """Return the log of the CSV with all digits."""
    path = tmp_path_factory.mktemp("csv") / "log.csv"
    rows = (",".join(map(repr, row)) for row in np.column_stack([T, Q]).tolist())
    path.write_text("\n".join(["t [s],q1,q2,q3,q4,q5,q6", *rows]))
    return read_log([path], RAD)


def is_same(log: JointLog, wanted: JointLog) -> None:
    """Compare numbers bit by bit."""
    assert (log.q == wanted.q).all()
    assert (log.t_ns == wanted.t_ns).all()
    assert (log.period, log.joint_units) == (wanted.period, wanted.joint_units)


def h5(path: Path, attributes: Mapping[str, Mapping[str, Any]] | None = None, **datasets: Any) -> None:
    """Write datasets by path (two underscores in the place of a slash), and attributes."""
    with h5py.File(path, "w") as file:
        for name, values in datasets.items():
            file[name.replace("__", "/")] = values
        for name, values in (attributes or {}).items():
            file[name].attrs.update(values)


TABLE = np.column_stack([T, Q])
NAMES = ["t", *(f"q{k}" for k in range(1, 7))]
COMPOUND = np.array(
    [(t, q, b"run") for t, q in zip(T, Q, strict=True)], [("t", "f8"), ("q", "f8", 6), ("m", "S3")]
)
IMAGES = np.zeros((ROWS, 4, 4, 3), np.uint8)
FRAME = {"pandas_type": np.bytes_(b"frame")}
INDEX = {"kind": np.bytes_(b"integer"), "name": np.bytes_(b"N.")}
BLOCK = {"pandas_type": np.bytes_(b"frame_table")}
PICKLED = b"(lp0\n" + b"".join(f"V{name}\np{k}\na".encode() for k, name in enumerate(NAMES, start=1)) + b"."
FIXED: dict[str, Any] = {"log": FRAME, "log/axis1": INDEX}
UNITS = {"t": {"unit": "ms"}, "q": {"units": "deg"}}
INDEXED = np.array(list(enumerate(TABLE)), [("index", "i8"), ("values_block_0", "f8", 7)])
HDF5: dict[str, dict[str, Any]] = {
    "two datasets": {"t": T, "q": Q},
    "units": {"t": T * 1e3, "q": np.degrees(Q), "attributes": UNITS},
    "groups": {"observations__qpos": Q, "observations__t": T, "images__top": IMAGES, "version": 1},
    "packed images": {"observations__qpos": Q, "time": T, "images": np.zeros((ROWS, 2000), np.uint8)},
    "as h5create writes": {"q": Q.T, "time": T[None]},
    "a table": {"data": TABLE},
    "a table with names": {"data": TABLE, "attributes": {"data": {"columns": NAMES}}},
    "fields": {"run__log": COMPOUND},
    "parameters": {"t": T, "q": Q, "dh": np.zeros((6, 4)), "limits": np.zeros((6, 2)), "name": "ur5"},
    "nanoseconds": {"q": Q, "stamp_ns": 1_700_000_000_000_000_001 + 10_000_000 * np.arange(ROWS)},
    "a period": {"q": Q, "attributes": {"/": {"dt": 0.01}}},
    "one episode": {"data__demo_7__q": Q, "data__demo_7__t": T, "other": np.zeros(99)},
    "to_hdf": {
        **{"log__axis0": NAMES, "log__axis1": np.arange(ROWS), "log__block0_items": NAMES},
        **{"log__block0_values": TABLE, "attributes": FIXED},
    },
    "to_hdf, format table": {
        "log__table": INDEXED,
        "log___i_table__sorted": np.zeros(1000),
        "attributes": {
            "log": BLOCK,
            "log/table": {"values_block_0_kind": np.bytes_(PICKLED), "index_kind": np.bytes_(b"integer")},
        },
    },
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("what", HDF5)
def test_datasets_are_the_table(what: str, tmp_path: Path, wanted: JointLog) -> None:
    h5(tmp_path / "log.h5", **HDF5[what])
    log = read_log([tmp_path / "log.h5"], RAD if what != "units" else None)
    if what == "units":  # a product of doubles is off by half a unit of the last place
        np.testing.assert_allclose(log.q, Q, rtol=2**-52)
        assert (log.t_ns == wanted.t_ns).all()
    else:
        is_same(log, wanted)
    assert {one.kind for one in log.warnings} <= {"assumed-unit", "assumed-joints"}, log.warnings


def follow(path: Path, texts: list[str], **options: str) -> list[int]:
    """Return the rows that each choice of a question reads; the question has these texts."""
    with pytest.raises(LogError) as caught:
        read_log([path], read_options(options, RAD))
    (finding,) = caught.value.findings
    assert [str(hint) for hint in finding.hints] == texts
    hints = ({hint.parameter: hint.value} for hint in finding.hints)
    return [read_log([path], read_options(hint, RAD)).rows for hint in hints]


@pytest.mark.slow
def test_episodes_and_lengths_are_questions(tmp_path: Path) -> None:
    path = tmp_path / "demos.hdf5"
    lengths = {0: 60, 1: 50, 10: 40}
    demos = {
        f"data__demo_{k}__{part}__q": Q[:n] + (part == "next_obs")
        for k, n in lengths.items()
        for part in ("obs", "next_obs")
    }
    h5(
        path,
        **demos,
        **{f"data__demo_{k}__actions": Q[:n] for k, n in lengths.items()},
        mask__train=[b"demo_0", b"demo_1"],
    )
    texts = ["--episode demo_0", "--episode demo_1", "--episode demo_10"]
    assert follow(path, texts) == [60, 50, 40]
    assert follow(path, texts, episode="2") == [60, 50, 40]
    log = read_log([path], LogMap(episode="1", unit={"": "rad"}))
    assert (log.rows, log.joints[0]) == (50, "obs/q[0]")
    h5(
        path,
        robot__t=T,
        robot__q=Q,
        ft__t=np.arange(600) * 1e-3,
        ft__q=np.cos(np.arange(600))[:, None] * Q[0],
    )
    assert follow(path, ["--topic ft", "--topic robot"]) == [600, 60]
    h5(path, **{f"joint_{k + 1}__position": Q[:, k] for k in range(6)}, time=T)
    assert (read_log([path], RAD).q == Q).all()  # groups of one length that are not called episodes


@pytest.mark.slow
def test_other_hdf5_files_are_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "log.h5"
    h5(path, images=IMAGES)
    assert refusal(LogError, read_log, [path]) == (
        f"{path}: found images (60, 4, 4, 3), allowed: datasets of numbers with one row per sample, such as"
        " t (n,) and q (n, joints)"
    )
    with h5py.File(path, "w") as file:
        file.create_dataset("q", (10**9, 6), "f4", chunks=(1000, 6), compression="gzip")
    assert "bytes that unpack to 24000000000, allowed: " in refusal(LogError, read_log, [path])
    h5(path, t=T, q=Q)
    data = path.read_bytes()
    for kept in (8, 300, len(data) - 1):
        path.write_bytes(data[:kept])
        said = refusal(LogError, read_log, [path])
        assert said.startswith(f"{path}: found an HDF5 file that cannot be read ("), said
        assert "\n" not in said
    monkeypatch.setitem(sys.modules, "h5py", None)
    assert refusal(LogError, read_log, [path]) == (
        f"{path}: found an HDF5 file, allowed: an HDF5 file with h5py installed; install it: pip install"
        ' "urmpipe[logs]"'
    )


def signal(values: Any, label: str = "", block: str = "") -> dict[str, Any]:
    return {"values": values, "dimensions": 1.0, "label": label, "blockName": block}


SCOPES = ("Scope", "Scope1", "Scope2", "Scope3", "Scope4", "Scope5")
MATS: dict[str, dict[str, Any]] = {
    "arrays": {"t": T, "q": Q, "n": 3.0, "robot": "ur5"},
    "joints as rows": {"t": T, "q": Q.T, "limits": np.zeros((6, 2))},
    "a struct": {"log": {"t": T, "q": Q, "info": {"name": "run"}}},
    "names beside": {"t": T, "q": Q, "names": ["a", "b"]},
    "scopes": {"Data": {"time": T, "signals": [signal(Q[:, k], f"q{k + 1}") for k in range(6)]}},
    "blocks": {"Data": {"time": T, "signals": [signal(Q[:, k], "", f"arm/q{k + 1}") for k in range(6)]}},
    "a variable": {"q": {"time": T, "signals": signal(Q, "", "arm/To Workspace")}},
    "samples along the third axis": {"q": {"time": T, "signals": signal(Q.T[None])}},
    "timeseries as structs": {"x": {"Name": "q", "Time": T, "Data": Q.T[:, None]}},
    "elements of a Dataset": {"x": {"Name": "q", "Values": {"Name": "", "Time": T, "Data": Q}}},
    "several scopes": {s: {"time": T, "signals": signal(Q[:, k], f"q{k + 1}")} for k, s in enumerate(SCOPES)},
}  # fmt: skip


def mat_73(path: Path, variables: Mapping[str, Any]) -> None:
    """Write what MATLAB's save -v7.3 writes: a header, arrays by columns, classes as attributes."""

    def put(group: Any, name: str, value: Any) -> None:
        if isinstance(value, dict) or (isinstance(value, list) and isinstance(value[0], dict)):
            node, kind = group.create_group(name), "struct"
            for key in value if isinstance(value, dict) else value[0]:
                if isinstance(value, dict):
                    put(node, key, value[key])
                else:
                    node[key] = np.array([[refer(one[key])] for one in value], h5py.ref_dtype)
        elif isinstance(value, list):
            node, kind = (
                group.create_dataset(name, data=np.array([[refer(one)] for one in value], h5py.ref_dtype)),
                "cell",
            )
        elif isinstance(value, str):
            letters = np.frombuffer(value.encode("utf-16-le"), "<u2")[:, None]
            node, kind = group.create_dataset(name, data=letters if value else np.zeros(2, np.uint64)), "char"
            node.attrs.update({} if value else {"MATLAB_empty": np.uint8(1)})
        else:
            array = np.asarray(value)[:, None] if np.ndim(value) == 1 else np.atleast_2d(value)
            node, kind = group.create_dataset(name, data=array.T), "double"
        node.attrs["MATLAB_class"] = np.bytes_(kind.encode())

    def refer(value: Any) -> Any:
        name = f"#refs#/{len(file['#refs#'])}"
        put(file, name, value)
        return file[name].ref

    with h5py.File(path, "w", userblock_size=512) as file:
        file.create_group("#refs#")
        for name, value in variables.items():
            put(file, name, value)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM")


@pytest.mark.slow
@pytest.mark.parametrize("write", [savemat, mat_73])
@pytest.mark.parametrize("what", MATS)
def test_variables_are_the_table(
    what: str, write: Callable[[Path, Mapping[str, Any]], None], tmp_path: Path, wanted: JointLog
) -> None:
    write(tmp_path / "log.mat", MATS[what])
    log = read_log([tmp_path / "log.mat"], RAD)
    is_same(log, wanted)
    assert log.warnings == ()


@pytest.mark.slow
def test_structs_of_two_sides_and_of_several_runs(tmp_path: Path) -> None:
    for write in (savemat, mat_73):
        path = tmp_path / "log.mat"
        write(path, {"cmd": {"t": T, "q": Q + 1}, "meas": {"t": T, "q": Q}})
        assert (read_log([path], RAD).q == Q).all()
        write(path, {"run": [{"t": T, "q": Q}, {"t": T[:40], "q": Q[:40]}]})
        assert follow(path, ["--episode 'run(1)'", "--episode 'run(2)'"]) == [60, 40]


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="needs Octave")
@pytest.mark.parametrize("form", ["-v7", "-hdf5"])
def test_what_octave_saves(form: str, tmp_path: Path) -> None:
    code = (
        "t = 0:0.01:0.59; q = 0.5 * sin(4.4 * t' + (0:5)); s.time = t'; name = 'ur5'; c = {'a', 1; 2, 'b'};"
        " for k = 1:6; s.signals(k).values = q(:, k); s.signals(k).label = sprintf('q%d', k); end;"
        f" save('{form}', 'q.mat', 't', 'q', 'name', 'c'); save('{form}', 's.mat', 's');"
        " save('-text', '-', 'q')"
    )
    text = subprocess.run(
        ["octave-cli", "--eval", code], cwd=tmp_path, check=True, capture_output=True, text=True
    ).stdout
    q = np.array([list(map(float, line.split())) for line in text.splitlines() if line[:1] == " "])
    for name in ("q.mat", "s.mat"):
        log = read_log([tmp_path / name], RAD)
        np.testing.assert_allclose(log.q, q, rtol=1e-15)  # Octave prints 16 digits
        assert log.t_ns.tolist() == [10_000_000 * k for k in range(60)]


def opaque(name: bytes, kind: bytes) -> bytes:
    """Return an object of a class as MAT 5 files hold it: names, and where its numbers are elsewhere."""

    def element(number: int, data: bytes) -> bytes:
        return struct.pack("<II", number, len(data)) + data + bytes(-len(data) % 8)

    flags, texts = element(6, struct.pack("<II", 17, 0)), (element(1, one) for one in (name, b"MCOS", kind))
    sizes = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 1, 1)) + element(1, b"")
    return element(14, b"".join((flags, *texts, element(14, sizes + element(6, bytes(4))))))


@pytest.mark.slow
def test_objects_of_classes_are_named_with_what_to_write(tmp_path: Path) -> None:
    path = tmp_path / "out.mat"
    path.write_bytes(
        b"MATLAB 5.0 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x01IM" + opaque(b"q", b"timeseries")
    )
    command = 'writetimetable(extractTimetable(q), "log.csv")'
    assert refusal(LogError, read_log, [path]) == (
        f"{path}: found no numbers with one row per sample in q (timeseries), allowed: such as t (n x 1),"
        f" q (n x joints); in MATLAB: {command}"
    )
    mat_73(path, {"q": np.zeros((1, 6)), "t": T})
    with h5py.File(path, "r+") as file:
        file["q"].attrs["MATLAB_class"], file["q"].attrs["MATLAB_object_decode"] = (
            np.bytes_(b"Simulink.SimulationOutput"),
            3,
        )
        del file["t"]
    assert refusal(LogError, read_log, [path]).endswith(command)
