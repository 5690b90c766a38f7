"""Formats: each is the log of the CSV of the same motion, bit for bit; which table is read; wrong files.

Files are read in this process, but for damaged ones: a process for each takes longer than reading.
"""

from __future__ import annotations

import gzip
import json
import re
import shutil
import struct
import subprocess
import sys
import zipfile
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import openpyxl
import pandas as pd
import pyarrow as pa
import pyarrow.feather as pf
import pyarrow.parquet as pq
import pytest
import xlwt
from scipy.io import savemat

import urmpipe
from asserting import refusal
from urmpipe.main import run
from urmpipe_models.errors import LogError, OptionError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.logs.log_map import read_options
from urmpipe_pipeline.subprocess_reader import mark_safe

ROWS = 60
T = np.arange(ROWS) / 100
Q = np.round(0.5 * np.sin(2 * np.pi * 0.7 * T[:, None] + np.arange(6)), 6)  # spreadsheets have 16 digits
RAD = LogMap(unit={"": "rad"})
NAMES = ["t", *(f"q{k}" for k in range(1, 7))]
FRAME = pd.DataFrame(np.column_stack([T, Q]), columns=NAMES)
CELLS = FRAME.to_numpy().tolist()
HEADER = ["time [s]", *(f"joint_{k} [rad]" for k in range(1, 7))]
RECORDS = [{"t": t, "mode": "run", "arm": {"q": q}} for t, *q in CELLS]


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> JointLog:
    path = tmp_path_factory.mktemp("csv") / "log.csv"
    FRAME.to_csv(path, index=False)
    return read_log([path], RAD)


def read(path: Path, options: LogMap = RAD) -> JointLog:
    if path.is_file():
        mark_safe(path)
    return read_log([path], options)


def is_same(log: JointLog, expected: JointLog) -> None:
    np.testing.assert_array_equal(log.q, expected.q)
    np.testing.assert_array_equal(log.t_ns, expected.t_ns)
    assert (log.period, log.joint_units) == (expected.period, expected.joint_units)


def follow(path: Path, choices: Sequence[str], **options: str) -> list[int]:
    """Return the rows that each choice of a question reads; the question has these choices."""
    with pytest.raises(LogError) as caught:
        read(path, read_options(options, RAD))
    (finding,) = caught.value.findings
    assert [str(hint).partition(" reads")[0] for hint in finding.hints] == choices
    hints = ({hint.parameter: hint.value} for hint in finding.hints)
    return [read(path, read_options(hint, RAD)).rows for hint in hints]


# Writers


def h5(path: Path, attributes: Mapping[str, Mapping[str, Any]] | None = None, **datasets: Any) -> None:
    """Write datasets by path (two underscores in the place of a slash), and attributes."""
    with h5py.File(path, "w") as file:
        for name, values in datasets.items():
            file[name.replace("__", "/")] = values
        for name, values in (attributes or {}).items():
            file[name].attrs.update(values)


def mat_73(path: Path, variables: Mapping[str, Any]) -> None:
    """Write what MATLAB's save -v7.3 writes: a header, arrays by columns, classes as attributes."""

    def refer(values: Sequence[Any]) -> Any:
        places = [f"#refs#/{len(file['#refs#'])}_{k}" for k in range(len(values))]
        for place, value in zip(places, values, strict=True):
            put(file, place, value)
        return np.array([[file[place].ref] for place in places], h5py.ref_dtype)

    def put(group: Any, name: str, value: Any) -> None:
        kind, empty = "double", {}
        if isinstance(value, dict) or (isinstance(value, list) and isinstance(value[0], dict)):
            node, kind = group.create_group(name), "struct"
            for key in value if isinstance(value, dict) else value[0]:
                if isinstance(value, dict):
                    put(node, key, value[key])
                else:
                    node[key] = refer([struct[key] for struct in value])
        elif isinstance(value, list):
            node, kind = group.create_dataset(name, data=refer(value)), "cell"
        elif isinstance(value, str):
            letters = np.frombuffer(value.encode("utf-16-le"), "<u2")[:, None]
            node, kind = group.create_dataset(name, data=letters if value else np.zeros(2, np.uint64)), "char"
            empty = {} if value else {"MATLAB_empty": np.uint8(1)}
        else:
            array = np.asarray(value)[:, None] if np.ndim(value) == 1 else np.atleast_2d(value)
            node = group.create_dataset(name, data=array.T)
        node.attrs.update({"MATLAB_class": np.bytes_(kind.encode()), **empty})

    with h5py.File(path, "w", userblock_size=512) as file:
        file.create_group("#refs#")
        for name, value in variables.items():
            put(file, name, value)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM")


def excel(path: Path, **sheets: Sequence[Sequence[Any]]) -> Path:
    book = openpyxl.Workbook()
    book.remove(book.worksheets[0])
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def old_excel(path: Path) -> None:
    book = xlwt.Workbook()
    sheet = book.add_sheet("log")
    for i, row in enumerate([HEADER, *CELLS]):
        for j, cell in enumerate(row):
            sheet.write(i, j, cell)
    book.save(path)


def pandas_excel(path: Path, suffix: str = "") -> None:
    written = path.with_suffix(suffix or path.suffix)
    FRAME.set_axis(HEADER, axis=1).to_excel(written, index=False)
    written.rename(path)


def numpy_fields(path: Path) -> None:
    fields = np.zeros(ROWS, dtype=[("t", "f8"), ("q", "f8", (6,))])
    fields["t"], fields["q"] = T, Q
    np.save(path, fields)


# The same log


TABLE = FRAME.to_numpy()
IMAGES = np.zeros((ROWS, 4, 4, 3), np.uint8)
COMPOUND = np.array(
    [(t, q, b"run") for t, q in zip(T, Q, strict=True)], [("t", "f8"), ("q", "f8", 6), ("m", "S3")]
)
PICKLED = b"(lp0\n" + b"".join(f"V{name}\np{k}\na".encode() for k, name in enumerate(NAMES, start=1)) + b"."
FIXED = {
    "log": {"pandas_type": np.bytes_(b"frame")},
    "log/axis1": {"kind": np.bytes_(b"integer"), "name": np.bytes_(b"N.")},
}
BLOCKS = {
    "log": {"pandas_type": np.bytes_(b"frame_table")},
    "log/table": {"values_block_0_kind": np.bytes_(PICKLED), "index_kind": np.bytes_(b"integer")},
}
INDEXED = np.array(list(enumerate(TABLE)), [("index", "i8"), ("values_block_0", "f8", 7)])
HDF5: dict[str, dict[str, Any]] = {
    "two datasets": {"t": T, "q": Q},
    "units": {"t": T * 1e3, "q": Q, "attributes": {"t": {"unit": "ms"}, "q": {"units": "rad"}}},
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
    "groups of one length": {**{f"joint_{k + 1}__position": Q[:, k] for k in range(6)}, "time": T},
    "to_hdf": {
        **{"log__axis0": NAMES, "log__axis1": np.arange(ROWS), "log__block0_items": NAMES},
        **{"log__block0_values": TABLE, "attributes": FIXED},
    },
    "to_hdf, format table": {
        **{"log__table": INDEXED, "log___i_table__sorted": np.zeros(1000)},
        "attributes": BLOCKS,
    },
}  # fmt: skip


def signal(values: Any, label: str = "", block: str = "") -> dict[str, Any]:
    return {"values": values, "dimensions": 1.0, "label": label, "blockName": block}


SCOPES = ("Scope", "Scope1", "Scope2", "Scope3", "Scope4", "Scope5")
MATS: dict[str, dict[str, Any]] = {
    "arrays": {"t": T, "q": Q, "n": 3.0, "robot": "ur5"},
    "column and matrix": {"t": T[:, None], "q": Q, "fs": 100.0},
    "vectors": {"t": T, **{f"q{k}": Q[:, k - 1] for k in range(1, 7)}},
    "joints as rows": {"t": T, "q": Q.T, "limits": np.zeros((6, 2)), "DH": np.zeros((6, 4))},
    "a struct": {"log": {"t": T, "q": Q, "info": {"name": "run"}}},
    "names beside": {"t": T, "q": Q, "names": ["a", "b"]},
    "two sides": {"cmd": {"t": T, "q": Q + 1}, "meas": {"t": T, "q": Q}},
    "scopes": {"Data": {"time": T, "signals": [signal(Q[:, k], f"q{k + 1}") for k in range(6)]}},
    "blocks": {"Data": {"time": T, "signals": [signal(Q[:, k], "", f"arm/q{k + 1}") for k in range(6)]}},
    "a variable": {"q": {"time": T, "signals": signal(Q, "", "arm/To Workspace")}},
    "samples along the third axis": {"q": {"time": T, "signals": signal(Q.T[None])}},
    "timeseries as structs": {"x": {"Name": "q", "Time": T, "Data": Q.T[:, None]}},
    "elements of a Dataset": {"x": {"Name": "q", "Values": {"Name": "", "Time": T, "Data": Q}}},
    "several scopes": {s: {"time": T, "signals": signal(Q[:, k], f"q{k + 1}")} for k, s in enumerate(SCOPES)},
}
JSONS = {
    "lines.jsonl": FRAME.to_json(orient="records", lines=True, double_precision=15),
    "nested.ndjson": "".join(json.dumps(record) + "\n" for record in RECORDS),
    "records.json": json.dumps(RECORDS),
    "indented.txt": json.dumps(RECORDS, indent=1),
    "samples.json": json.dumps({"robot": "ur5e", "limits": [1, 2], "log": RECORDS}),
    "columns.json": json.dumps({"t": T.tolist(), "q": Q.tolist(), "base": [0.5, 0, 0]}),
    "pandas.json": FRAME.to_json(double_precision=15),
    "split.json": FRAME.to_json(orient="split", double_precision=15),
    "orient table.json": FRAME.to_json(orient="table", index=False, double_precision=15),
    "rows.csv": json.dumps([NAMES, *CELLS]),
}
TYPED: dict[str, Callable[[Path], Any]] = {
    "pandas": FRAME.to_parquet,
    "groups of rows": lambda path: pq.write_table(pa.table(dict(FRAME)), path, row_group_size=7),
    "compressed": lambda path: FRAME.to_parquet(path, compression="zstd"),
    "a dictionary beside": lambda path: FRAME.assign(m=pd.Categorical(["run"] * ROWS)).to_parquet(path),
    "Feather": lambda path: pf.write_feather(pa.table(dict(FRAME)), path),
    "an Arrow file": lambda path: pf.write_feather(pa.table(dict(FRAME)), path, compression="uncompressed"),
}
GROUP: dict[str, Any] = {"run/t": T, "run/q": Q, "limits": Q[:6]}
PACKED = ("arrays", "a struct")
FORMATS: dict[str, Callable[[Path], Any]] = {
    **{f"{what}.h5": partial(h5, **datasets) for what, datasets in HDF5.items()},
    **{f"{what}.mat": partial(savemat, mdict=variables) for what, variables in MATS.items()},
    **{f"compressed {what}.mat": partial(savemat, mdict=MATS[what], do_compression=True) for what in PACKED},
    "cells.mat": partial(savemat, mdict={"t": T, "q": Q, "names": np.array(["a", "b"], dtype=object)}),
    **{f"7.3 {what}.mat": partial(mat_73, variables=variables) for what, variables in MATS.items()},
    **{name: partial(Path.write_text, data=text) for name, text in JSONS.items()},
    **{f"{what}{suffix}": write for what, write in TYPED.items() for suffix in (".parquet", ".csv")},
    **{f"pandas{suffix}": pandas_excel for suffix in (".xlsx", ".xlsm", ".ods")},
    "workbook.csv": partial(pandas_excel, suffix=".xlsx"),
    "old.xls": old_excel,
    "table.npy": lambda path: np.save(path, TABLE),
    "fields.npy": numpy_fields,
    "arrays.npz": lambda path: np.savez(path, t=T, q=Q, robot=np.array("u"), o=np.array([{}], dtype=object)),
    "packed.npz": lambda path: np.savez_compressed(path, **GROUP),
}  # fmt: skip
JOINTS = {
    "joint_{}": ("pandas.xlsx", "old.xls"),
    "arm/q[{}]": ("nested.ndjson", "records.json"),
    "q[{}]": ("columns.json",),
    "q{}": ("split.json",),
}
ASSUMED = {"assumed-unit", "assumed-joints"}


@pytest.mark.slow
@pytest.mark.parametrize("what", FORMATS)
def test_every_format_is_the_log_of_its_csv(what: str, tmp_path: Path, expected: JointLog) -> None:
    path = tmp_path / f"log{Path(what).suffix}"
    FORMATS[what](path)
    log = read(path)
    is_same(log, expected)
    assert (log.name, log.files[0].name) == ("log", path.name)
    assert {warning.kind for warning in log.warnings} <= (
        ASSUMED if path.suffix in (".h5", ".npy") else {"columns-passed-over"}
    )
    for form in (form for form, names in JOINTS.items() if what in names):
        assert log.joints == tuple(form.format(k + ("[" not in form)) for k in range(6))


def test_degrees_by_an_attribute(tmp_path: Path) -> None:
    h5(tmp_path / "log.h5", t=T, q=np.degrees(Q), attributes={"q": {"units": "deg"}})
    np.testing.assert_allclose(read(tmp_path / "log.h5", LogMap()).q, Q, rtol=2**-52)  # one rounding


def test_a_matrix_of_matlab_has_its_samples_along_its_longer_side(tmp_path: Path) -> None:
    for q in (Q, Q.T):
        savemat(tmp_path / "log.mat", {"q": q})
        assert (read(tmp_path / "log.mat", LogMap(unit={"": "rad"}, period=0.01)).q == Q).all()


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
    command = ["octave-cli", "--eval", code]
    text = subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    q = np.array([list(map(float, line.split())) for line in text.splitlines() if line[:1] == " "])
    for name in ("q.mat", "s.mat"):
        log = read(tmp_path / name)
        np.testing.assert_allclose(log.q, q, rtol=1e-15)  # Octave prints 16 digits
        assert log.t_ns.tolist() == [10_000_000 * k for k in range(60)]


def test_text_in_a_mat_file(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "log.mat", TABLE, fmt="%14.7e")  # as save -ascii
    np.testing.assert_allclose(read_log([tmp_path / "log.mat"], RAD).q, Q, atol=5e-8)  # eight digits


# Episodes, lengths, sheets

EPISODES: dict[str, Any] = {"demo_0/q": Q, "demo_0/t": T, "demo_1/q": Q[:40], "demo_1/t": T[:40]}


@pytest.mark.slow
def test_episodes_and_lengths_are_questions(tmp_path: Path) -> None:
    path = tmp_path / "demos.hdf5"
    lengths = {0: 60, 1: 50, 10: 40}
    demos: dict[str, Any] = {
        f"data__demo_{k}__{part}__q": Q[:n] + (part == "next_obs")
        for k, n in lengths.items()
        for part in ("obs", "next_obs")
    }
    actions: dict[str, Any] = {f"data__demo_{k}__actions": Q[:n] for k, n in lengths.items()}
    h5(path, **demos, **actions, mask__train=[b"demo_0", b"demo_1"])
    choices = ["--episode demo_0", "--episode demo_1", "--episode demo_10"]
    assert follow(path, choices) == [60, 50, 40]
    allowed = "found '2', allowed: demo_0, demo_1, demo_10"
    assert refusal(OptionError, read, path, LogMap(episode="2")).endswith(allowed)
    log = read(path, LogMap(episode="1", unit={"": "rad"}))
    assert (log.rows, log.joints[0]) == (50, "obs/q[0]")
    fast = {"ft/t": np.arange(600) * 1e-3, "ft/q": np.cos(np.arange(600))[:, None] * Q[0]}
    arrays: dict[str, Any] = {"robot/t": T, "robot/q": Q, **fast}
    h5(path, **{name.replace("/", "__"): array for name, array in arrays.items()})
    assert follow(path, ["--topic ft", "--topic robot"]) == [600, 60]
    np.savez(tmp_path / "log.npz", **arrays)
    assert follow(tmp_path / "log.npz", ["--topic ft", "--topic robot"]) == [600, 60]
    np.savez(tmp_path / "log.npz", **EPISODES)
    assert follow(tmp_path / "log.npz", choices[:2]) == [60, 40]
    for write in (savemat, mat_73):
        write(tmp_path / "log.mat", {"run": [{"t": T, "q": Q}, {"t": T[:40], "q": Q[:40]}]})
        assert follow(tmp_path / "log.mat", ["--episode 'run(1)'", "--episode 'run(2)'"]) == [60, 40]
    (tmp_path / "log.json").write_text(json.dumps({"a": {"log": RECORDS}, "b": {"log": RECORDS[:40]}}))
    assert follow(tmp_path / "log.json", ["--topic a", "--topic b"]) == [60, 40]


def test_of_several_sheets_urmpipe_asks(tmp_path: Path, expected: JointLog) -> None:
    info: list[list[Any]] = [["Robot", "UR5e"], ["Rate", 500], ["Payload", 2.5]]
    sheets = {"run 1": [HEADER, *CELLS], "run 2": [HEADER, *CELLS[:19]]}
    path = excel(tmp_path / "log.xlsx", info=info, **sheets)
    assert follow(path, ["--sheet 'run 1'", "--sheet 'run 2'"]) == [60, 19]
    assert read(path, LogMap(sheet=3)).rows == 19  # type: ignore[arg-type]  # plain numbers are taken
    allowed = "allowed: info, run 1, run 2"
    assert refusal(OptionError, read, path, LogMap(sheet="4")).endswith(f"found '4', {allowed}")
    is_same(read(excel(tmp_path / "log.xlsx", info=info, log=sheets["run 1"])), expected)
    FRAME.to_csv(tmp_path / "log.csv", index=False)
    text = refusal(OptionError, read, tmp_path / "log.csv", LogMap(sheet="log"))
    assert text == "sheet (--sheet): found 'log', allowed: with a workbook"


# Workbooks


@pytest.mark.parametrize(
    ("above", "first"),
    [
        ([["Log of cell 4"], [], ["Robot", "UR5e"], ["Rate", 500], [], HEADER], 7),
        ([["time", *(f"joint_{k}" for k in range(1, 7))], ["s", *["rad"] * 6]], 3),
        ([["made by", None, "me"], HEADER], 3),
    ],
)
def test_lines_above_the_numbers(
    above: list[list[Any]], first: int, tmp_path: Path, expected: JointLog
) -> None:
    is_same(read(excel(tmp_path / "log.xlsx", log=[*above, *CELLS])), expected)
    wrong = [*CELLS[:4], [*CELLS[4][:3], "open", *CELLS[4][4:]], *CELLS[5:]]
    path = excel(tmp_path / "log.xlsx", log=[*above, *wrong])
    assert refusal(LogError, read, path).startswith(f"{path}:{first + 4}, column joint_3")


def test_empty_columns_texts_groups_and_errors_in_cells(tmp_path: Path, expected: JointLog) -> None:
    path = tmp_path / "log.xlsx"
    cells = [[None, *row[:4], None, *row[4:], None] for row in (HEADER, *CELLS)]
    texts = [[row[0], *(f"{q:.6f}" for q in row[1:])] for row in CELLS]
    commas = [[row[0], *(str(q).replace(".", ",") for q in row[1:])] for row in texts]
    for rows in (cells, [HEADER, *texts], [HEADER, *commas]):
        is_same(read(excel(path, log=rows)), expected)
    commas[5][1] = "#N/A"
    log = read(excel(path, log=[HEADER, *commas]))
    assert [warning.message for warning in log.warnings] == [
        "joint_1 has no value in 1 of 60 rows, first in this one"
    ]
    groups = [None, "position [rad]", None, None, "target [rad]"]
    excel(path, log=[groups, ["t [s]", *["q1", "q2", "q3"] * 2], *CELLS])
    book = openpyxl.load_workbook(path)
    for merged in ("B1:D1", "E1:G1"):
        book["log"].merge_cells(merged)
    book.save(path)
    assert read(path).joints == ("position [rad]/q1", "position [rad]/q2", "position [rad]/q3")


@pytest.mark.parametrize("name", ["date.xlsx", "length.xlsx", "date.ods"])
def test_times_in_cells(name: str, tmp_path: Path) -> None:
    """A double of days counts in steps of 0.6 us in this century; openpyxl rounds it once more."""
    start: Any = datetime(2024, 1, 2, 23, 59, 59, 900_000) if "date" in name else timedelta()
    us = 2137 * np.arange(ROWS) + np.arange(ROWS) % 3
    rows = [[start + timedelta(microseconds=int(k)), *row[1:]] for k, row in zip(us, CELLS, strict=True)]
    if name.endswith(".xlsx"):
        excel(tmp_path / name, log=[["time", *HEADER[1:]], *rows])
    else:
        pd.DataFrame(rows, columns=["time", *HEADER[1:]]).to_excel(tmp_path / name, index=False)
    log = read(tmp_path / name)
    np.testing.assert_array_equal(log.q, Q)
    np.testing.assert_allclose(log.t_ns, us * 1000, rtol=0, atol=1000 if "date" in name else 0)


@pytest.mark.slow
def test_ingest_a_workbook_without_options(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names = ["header.stamp", *(f"position.shoulder_{k}_joint" for k in range(6))]
    excel(Path("log.xlsx"), log=[names, *([1_700_000_000 + row[0], *row[1:]] for row in CELLS)])
    assert run(["ingest", "log.xlsx", "-o", "log.rrd"]) == 0
    assert "60 rows" in capsys.readouterr().out


# JSON


def test_json_times_with_more_digits_than_a_double(tmp_path: Path) -> None:
    text = "".join(f'{{"t": 17000000{k}.123456789, "q1": 0.{k}}}\n' for k in range(10, 30))
    for document in (text, f"[{text.strip().replace(chr(10), ',')}]"):
        (tmp_path / "log.json").write_text(document)
        assert read(tmp_path / "log.json").clock_start_ns == 1_700_000_010_123_456_789


def test_json_units_missing_keys_another_order_and_compression(tmp_path: Path) -> None:
    rows: list[dict[str, Any]] = [{"t [s]": k / 100, "q [deg]": [k, k / 2], "tau": k} for k in range(40)]
    rows[3] = {"tau": 1, "q [deg]": [3, 1.5], "t [s]": 0.03}
    rows[7] = {"t [s]": 0.07, "q [deg]": [7, 3.5], "note": 'a\t"b"\n'}
    text = "".join(json.dumps(row) + "\n" for row in rows)
    (tmp_path / "log.jsonl.gz").write_bytes(gzip.compress(text.encode()))
    log = read_log([tmp_path / "log.jsonl.gz"])
    assert (log.name, log.joints) == ("log", ("q[0]", "q[1]"))
    np.testing.assert_allclose(log.q[:, 0], np.radians(np.arange(40)), rtol=1e-15)  # one rounding


# LeRobot

ARM = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
LENGTHS = {0: 60, 1: 50, 2: 40}
Q32 = Q.astype(np.float32)


def episode(number: int) -> pa.Table:
    """Return the rows of an episode; the state is Q plus its number."""
    rows, kind = LENGTHS[number], pa.list_(pa.float32(), 6)
    q = Q32[:rows] + np.float32(number)
    return pa.table({
        "action": pa.array((q + np.float32(0.01)).tolist(), kind),
        "observation.state": pa.array(q.tolist(), kind),
        "observation.images.top": [{"bytes": b"JPEG", "path": "0.jpg"}] * rows,
        "timestamp": T[:rows].astype(np.float32),
        "frame_index": np.arange(rows),
        "episode_index": np.full(rows, number),
    })  # fmt: skip


@pytest.fixture(params=[2, 3])
def data_set(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """Write a data set of three episodes as LeRobot 2.1 does, a file each, or as 3.0, two in one file."""
    is_old, folder = request.param == 2, tmp_path / "pick"
    data, meta = folder / "data" / "chunk-000", folder / "meta" / "episodes" / "chunk-000"
    data.mkdir(parents=True)
    meta.mkdir(parents=True)
    names = {"motors": [f"main_{name}" for name in ARM]} if is_old else [f"{name}.pos" for name in ARM]
    feature = {"dtype": "float32", "shape": [6], "names": names}
    features = {"action": feature, "observation.state": feature, "timestamp": {"shape": [1], "names": None}}
    (folder / "meta" / "info.json").write_text(json.dumps({"fps": 50, "features": features}))
    files = {f"episode_00000{k}": [k] for k in LENGTHS} if is_old else {"file-000": [0, 1], "file-001": [2]}
    for name, numbers in files.items():
        pq.write_table(pa.concat_tables(map(episode, numbers)), data / f"{name}.parquet")
    if not is_old:
        index = {"episode_index": [0, 1, 2], "data/chunk_index": [0, 0, 0], "data/file_index": [0, 0, 1]}
        pq.write_table(pa.table(index), meta / "file-000.parquet")
    return folder


@pytest.mark.slow
def test_each_episode_of_a_data_set_is_a_choice(data_set: Path) -> None:
    assert follow(data_set, ["--episode 0", "--episode 1", "--episode 2"]) == [*LENGTHS.values()]
    for number, rows in LENGTHS.items():
        log = read(data_set, LogMap(episode=str(number), unit={"": "rad"}))
        assert (log.q == Q32[:rows, :5] + np.float32(number)).all()  # not the gripper
        assert log.t_ns.tolist() == [10_000_000 * k for k in range(rows)]
        form = "{}.pos" if log.files[0].name.startswith("file-") else "main_{}"
        assert log.joints == tuple(f"observation.state.{form.format(name)}" for name in ARM[:5])
        assert [warning.kind for warning in log.warnings] == ["columns-passed-over"]  # the action
    text = refusal(OptionError, read, data_set, LogMap(episode="9"))
    assert text.endswith("found '9', allowed: 0, 1, 2")
    path = sorted((data_set / "data" / "chunk-000").iterdir())[0]
    if path.stem == "file-000":
        assert "found 2 episodes: 0, 1, allowed: one" in refusal(LogError, read, path)
        assert read(path, LogMap(episode="1", unit={"": "rad"})).rows == 50
    options: dict[str, Any] = {"episode": 1, "unit": "rad", "tolerance": "joint=0.1rad", "sync": "start"}
    result = urmpipe.compare(data_set, sides="action,state", **options)
    assert result.runs[0].run.log.rows == 50
    assert result.runs[0].joint_delta is not None
    np.testing.assert_allclose(result.runs[0].joint_delta, 0.01, atol=1e-6)  # floats of 32 bits


def test_a_data_set_without_episodes_or_names(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "info.json").write_text("{}")
    text = f"{tmp_path}: found a data set without episodes, allowed: one or more"
    assert refusal(LogError, read, tmp_path) == text
    path = tmp_path / "data" / "a.parquet"
    pq.write_table(episode(0).select(["observation.state", "timestamp", "episode_index"]), path)
    assert (read(path).q == Q32).all()
    (tmp_path / "meta" / "info.json").write_text("{")
    text = refusal(LogError, read, path)
    assert text.startswith(f"{tmp_path}/meta/info.json: found a description that cannot be read (")


# Wrong files

COMPOUND_FILE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"  # how .xls files and encrypted .xlsx files begin
JSON = ": found JSON that is damaged or cut ("
WRONG: dict[str, tuple[bytes | str, str]] = {
    "password.xlsx": (COMPOUND_FILE, ": found a workbook with a password, allowed: a workbook without one; "),
    "cut.xlsx": (b"PK\x03\x04\x14\x00", ": found a workbook that cannot be read (Cannot detect file format)"),
    "cut.xls": (COMPOUND_FILE, ": found a workbook that cannot be read ("),
    "empty.xlsx": (b"", ": found an empty file, allowed: a table with one row per sample"),
    "text.xls": (b"<html><table>", ": found a web page, allowed: "),
    "other.csv": (b"PK\x03\x04\x14\x00", ": found a zip archive, allowed: "),
    "encrypted.parquet": (b"PARE" + bytes(100) + b"PARE", ": found an encrypted Parquet file, allowed: "),
    "cut.json": (JSONS["records.json"][:-50], ":1" + JSON),
    "cut lines.json": (JSONS["indented.txt"][:900], ":84" + JSON),
    "deep.json": ("[" * 100_000, JSON),
    "other.json": ('{"robot": "ur5e"}', ": found JSON without an array of numbers, allowed: an array of"),
    "last line.jsonl": (JSONS["nested.ndjson"][:-20], ":60: found 1 cell ("),
    "blank line.jsonl": (JSONS["nested.ndjson"] + "\n" + JSONS["nested.ndjson"][:10], ":62: found 1 cell ("),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_files_are_one_line(name: str, tmp_path: Path) -> None:
    path, (content, text) = tmp_path / name, WRONG[name]
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert refusal(LogError, read_log, [path]).partition("\n")[0].startswith(f"{path}{text}")


DAMAGED = {
    "two datasets.h5": ((8, 300, 0.999), ": found an HDF5 file that cannot be read ("),
    "pandas.parquet": ((4, 20, 0.5, 0.99), ": found a Parquet file that cannot be read ("),
    "compressed arrays.mat": ((129, 0.5, 0.99), ": found "),
    "pandas.xlsx": ((0.3, 0.9), ": found a workbook that cannot be read ("),
    "pandas.ods": ((0.3, 0.9), ": found a workbook that cannot be read ("),
    "old.xls": ((0.3, 0.9), ": found a workbook that cannot be read ("),  # its reader ends its process
    "table.npy": ((8, 100, 700), ": cannot be read: "),
    "arrays.npz": ((8, 100, 700), ": cannot be read: "),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", DAMAGED)
def test_cut_files_are_one_line(name: str, tmp_path: Path) -> None:
    path, (parts, text) = tmp_path / f"log{Path(name).suffix}", DAMAGED[name]
    FORMATS[name](path)
    data = path.read_bytes()
    for part in parts:
        path.write_bytes(data[: part if isinstance(part, int) else int(part * len(data))])
        assert re.fullmatch(re.escape(f"{path}{text}") + "[^\n]+", refusal(LogError, read_log, [path]))


@pytest.mark.slow
def test_files_without_samples_are_one_line(tmp_path: Path) -> None:
    path = tmp_path / "log"
    h5(path, images=IMAGES)
    allowed = "datasets of numbers with one row per sample, such as t (n,) and q (n, joints)"
    assert refusal(LogError, read, path) == f"{path}: found images (60, 4, 4, 3), allowed: {allowed}"
    savemat(path, {"name": "run", "fs": 100.0}, appendmat=False)
    text = refusal(LogError, read, path)
    assert text.startswith(
        f"{path}: found no numbers with one row per sample in name, fs, allowed: such as t (n x 1)"
    )
    pq.write_table(pa.table({"a": ["x"], "b": ["y"]}), path)
    assert refusal(LogError, read, path) == f"{path}: found no number in a, b, allowed: one column per joint"
    pq.write_table(pa.table({"t": pa.array([], pa.float64())}), path)
    assert refusal(LogError, read, path) == f"{path}: found a table without rows, allowed: one row per sample"
    formulas = [HEADER, *[[f"={k}/500", *["=SIN(1)"] * 6] for k in range(20)]]  # openpyxl computes no values
    fault = "found no rows of numbers in 1 sheet (log), allowed: a table with one row per sample"
    save = "if its cells are formulas, save it in a spreadsheet program, which adds their values"
    for cells in ([["a", "b"], ["x", "y"]], formulas, []):
        path = excel(tmp_path / "log.xlsx", log=cells)
        assert refusal(LogError, read, path) == f"{path}: {fault}; {save}"


@pytest.mark.slow
def test_what_unpacks_to_too_much_is_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file.create_dataset("q", (10**9, 6), "f4", chunks=(1000, 6), compression="gzip")
    assert "bytes that unpack to 24000000000, allowed: " in refusal(LogError, read, tmp_path / "log.h5")
    path = excel(tmp_path / "log.xlsx", log=[HEADER])
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/worksheets/sheet2.xml", bytes(70 << 20))
    assert "bytes that unpack to" in refusal(LogError, read, path)


@pytest.mark.parametrize(("library", "name"), [("h5py", "a period.h5"), ("python_calamine", "pandas.xlsx")])
def test_without_the_library(
    library: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / f"log{Path(name).suffix}"
    FORMATS[name](path)
    monkeypatch.setitem(sys.modules, library, None)
    what = "an HDF5 file" if library == "h5py" else "a workbook"
    package = library.replace("_", "-")
    assert refusal(LogError, read, path) == (
        f"{path}: found {what}, allowed: {what} with {package} installed; install it: pip install"
        ' "urmpipe[logs]"'
    )


def opaque(name: bytes, kind: bytes) -> bytes:
    """Return an object of a class as MAT 5 files hold it: names, and where its numbers are elsewhere."""

    def element(number: int, data: bytes) -> bytes:
        return struct.pack("<II", number, len(data)) + data + bytes(-len(data) % 8)

    flags, texts = element(6, struct.pack("<II", 17, 0)), (element(1, text) for text in (name, b"MCOS", kind))
    sizes = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 1, 1)) + element(1, b"")
    return element(14, b"".join((flags, *texts, element(14, sizes + element(6, bytes(4))))))


def test_objects_of_matlab_are_named_with_what_to_write(tmp_path: Path) -> None:
    path = tmp_path / "out.mat"
    head = b"MATLAB 5.0 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x01IM"
    path.write_bytes(head + opaque(b"q", b"timeseries"))
    command = 'writetimetable(extractTimetable(q), "log.csv")'
    assert refusal(LogError, read, path) == (
        f"{path}: found no numbers with one row per sample in q (timeseries), allowed: such as t (n x 1),"
        f" q (n x joints); in MATLAB: {command}"
    )
    mat_73(path, {"q": np.zeros((1, 6))})
    with h5py.File(path, "r+") as file:
        file["q"].attrs["MATLAB_class"] = np.bytes_(b"Simulink.SimulationOutput")
    assert refusal(LogError, read, path).endswith(command)
