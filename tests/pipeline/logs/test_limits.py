"""What a log may hold: files beyond it are refused in one line, before they take memory or time."""

from __future__ import annotations

import io
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import feather
from pyarrow import parquet as pq
from scipy.io import savemat

from asserting import refusal
from urmpipe_models.errors import LogError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import read_log
from urmpipe_pipeline.logs.formats.text import MAX_LINE_BYTES, MAX_TABLE_COLUMNS

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]

A_ROW = "write one row per sample, one column per joint"
WIDE = f"found more than {MAX_TABLE_COLUMNS} columns, allowed: as many as that; {A_ROW}"
PLC = "VAR\n x : ARRAY[1..{}] OF REAL := [{}];\nEND_VAR\n"


def _table(columns: int, rows: int = 5) -> str:
    names = ["t", *(f"q{k}" for k in range(1, 7)), *(f"x{k}" for k in range(columns - 7))]
    cells = (
        ["%.3f" % (0.01 * r), *(f"{0.1 * k + 0.001 * r:.4f}" for k in range(columns - 1))]
        for r in range(rows)
    )
    return "\n".join(map(",".join, (names, *cells))) + "\n"


@pytest.mark.slow
def test_a_header_longer_than_the_first_look_is_read(read: Read) -> None:
    """9000 columns: names and rows of 60 kB and more each."""
    log = read(_table(9000, 3))
    assert (log.joints, log.rows) == (("q1", "q2", "q3", "q4", "q5", "q6"), 3)


def test_rows_below_many_comments_are_read(read: Read) -> None:
    log = read("# a setting of the recorder\n" * 8000 + _table(7))
    assert (log.joints, log.rows) == (("q1", "q2", "q3", "q4", "q5", "q6"), 5)


@pytest.mark.slow
@pytest.mark.parametrize("text", ["1 " * 200_000, "1," * 200_000], ids=["spaces", "commas"])
def test_a_line_of_too_many_columns(wrong: Wrong, text: str) -> None:
    assert wrong(text) == [f"log.csv: {WIDE}"]


@pytest.mark.slow
def test_too_many_names(wrong: Wrong) -> None:
    assert wrong(_table(MAX_TABLE_COLUMNS + 1)) == [f"log.csv:1: {WIDE}"]


def test_too_many_joints(wrong: Wrong) -> None:
    names = ",".join(["t", *(f"q{k}" for k in range(1, 502))])
    rows = "".join(f"{0.01 * r:.2f}" + ",0.1" * 501 + "\n" for r in range(3))
    assert wrong(f"{names}\n{rows}") == [
        "log.csv: found 501 joints, allowed: 500 at most; use --joints A,B,C"
    ]


def test_a_line_that_is_too_long(wrong: Wrong) -> None:
    """It is found where it begins, wherever that is."""
    text = _table(7) + "0.05," + "1" * MAX_LINE_BYTES + "\n" + _table(7)
    assert wrong(text) == [f"log.csv:7: found a line of more than 8 MiB, allowed: shorter lines; {A_ROW}"]


def test_a_long_line_among_short_ones_is_not_split(wrong: Wrong) -> None:
    text = _table(7) + "1," * 600_000 + "\n"
    assert wrong(text) == ["log.csv:7: found a line of 1200000 letters, allowed: 7 cells"]


def _npy(shape: str, kind: str = "<f8") -> bytes:
    head = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\x01\0" + struct.pack("<H", len(head)) + head + bytes(80)


@pytest.mark.parametrize(
    ("shape", "kind", "said"),
    [
        ("(100000000000, 7)", "<f8", "float64 (100000000000, 7)"),
        ("(10000000000000000000000, 7)", "<f8", "float64 (10000000000000000000000, 7)"),
        ("(5, 2)", "<U100000000", "<U100000000 (5, 2)"),
        ("(10000000000,)", "|S0", "|S0 (10000000000,)"),
        ("(-5, 7)", "<f8", "float64 (-5, 7)"),
    ],
)
def test_a_numpy_header_that_claims_too_much(tmp_path: Path, shape: str, kind: str, said: str) -> None:
    data = _npy(shape, kind)
    (path := tmp_path / "log.npy").write_bytes(data)
    message = f"{path}: cannot be read: {said} is more than {len(data)} bytes hold"
    assert refusal(LogError, read_log, [path]) == message


def test_a_numpy_header_that_does_not_end(tmp_path: Path) -> None:
    (path := tmp_path / "log.npy").write_bytes(
        b"\x93NUMPY\x01\0" + struct.pack("<H", 500) + b"(" * 499 + b"\n"
    )
    assert refusal(LogError, read_log, [path]).startswith(f"{path}: cannot be read: ")


@pytest.mark.parametrize("method", [1, 6, 9, 93, 95, 97, 99])
def test_archives_packed_in_other_ways(tmp_path: Path, method: int) -> None:
    kept = io.BytesIO()
    with zipfile.ZipFile(kept, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("q.npy", _npy("(5, 2)"))
    data = bytearray(kept.getvalue())
    for sign, place in ((b"PK\x03\x04", 8), (b"PK\x01\x02", 10)):
        start = data.index(sign) + place
        data[start : start + 2] = struct.pack("<H", method)
    (path := tmp_path / "log.npz").write_bytes(data)
    assert (
        refusal(LogError, read_log, [path])
        == f"{path}: cannot be read: That compression method is not supported"
    )
    table = tmp_path / "log.csv"
    table.write_bytes(data)
    assert refusal(LogError, read_log, [table]).startswith(
        f"{table}: found a zip archive, allowed: a text table"
    )


def _packed_numpy(path: Path, rows: int) -> None:
    np.savez_compressed(path, q=np.zeros((rows, 7)))


def _packed_mat(path: Path, rows: int) -> None:
    savemat(path, {"q": np.zeros((rows, 7))}, do_compression=True)


def _packed_parquet(path: Path, rows: int) -> None:
    pq.write_table(pa.table({f"q{k}": np.zeros(rows) for k in range(7)}), path)


def _packed_feather(path: Path, rows: int) -> None:
    feather.write_feather(pa.table({f"q{k}": np.zeros(rows) for k in range(7)}), path, compression="zstd")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("log.npz", _packed_numpy),
        ("log.mat", _packed_mat),
        ("log.parquet", _packed_parquet),
        ("log.feather", _packed_feather),
    ],
)
def test_a_file_that_unpacks_to_far_more(
    tmp_path: Path, name: str, write: Callable[[Path, int], None]
) -> None:
    """1.3 million rows of zeros, 73 MB, in less than 1.4 MB."""
    write(path := tmp_path / name, 1_300_000)
    said = refusal(LogError, read_log, [path])
    assert said.startswith(f"{path}: found {path.stat().st_size} bytes that unpack to ")
    assert said.endswith(f", allowed: {max(64 << 20, 50 * path.stat().st_size)} at most")


@pytest.mark.parametrize(
    "said", ["{", "5", "[]", '"a"', "[" * 50_000, '{"rows": 5}', '{"columns": {"q1": 5}}']
)
@pytest.mark.parametrize("key", ["pandas", "urmpipe"])
def test_metadata_that_others_wrote(tmp_path: Path, key: str, said: str) -> None:
    """They are passed over; where they are ours and tell nothing, the file is damaged."""
    table = pa.table({"t": [0.0, 0.1, 0.2], "q1": [0.0, 0.1, 0.2]}).replace_schema_metadata({key: said})
    pq.write_table(table, path := tmp_path / "log.parquet")
    if key == "urmpipe" and not said.startswith('{"'):
        damaged = "found a Parquet file of urmpipe whose metadata are damaged, allowed: as `export` wrote it"
        assert refusal(LogError, read_log, [path]) == f"{path}: {damaged}"
    else:
        assert read_log([path]).joints == ("q1",)


def test_roles_that_others_wrote(tmp_path: Path) -> None:
    fields = [
        pa.field("t", pa.float64()),
        pa.field("q1", pa.float64(), metadata={"role": "joint", "unit": b"\xff"}),
    ]
    pq.write_table(pa.table([[0.0, 0.1], [0.0, 0.1]], pa.schema(fields)), path := tmp_path / "log.parquet")
    assert read_log([path]).joints == ("q1",)


def test_lists_that_would_be_too_many_columns(tmp_path: Path) -> None:
    kind = pa.list_(pa.float64(), MAX_TABLE_COLUMNS + 1)
    lists = pa.array([np.zeros(MAX_TABLE_COLUMNS + 1)] * 2, kind)
    pq.write_table(pa.table({"t": [0.0, 0.1], "q": lists}), path := tmp_path / "log.parquet")
    assert refusal(LogError, read_log, [path]) == f"{path}: {WIDE}"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            PLC.format("*", "100000000(0.5)"),
            "log.csv:2: found more than 4000000 values in x, allowed: as many as that",
        ),
        (
            PLC.format("*", "9999(9999(9999(0.5)))"),
            "log.csv:2: found more than 4000000 values in x, allowed: as many as that",
        ),
        (PLC.format("1e999", "0.1, 0.2"), "log.csv: found no joint columns in x"),
        (
            "PTP {A1 1.1.1,A2 0,A3 0,A4 0,A5 0,A6 0}\n",
            "log.csv:1: found 'PTP {A1 1.1.1,A2 0,A3 0,A4 0,A5 0,A6 0}'",
        ),
        (
            "PROC a()\nCONST jointtarget p{1} := " + "[" * 9000 + "0" + "]" * 9000 + ";\n",
            "log.csv:2: found '[[[[",
        ),
    ],
    ids=["repeated", "repeated repetitions", "endless bounds", "points", "brackets"],
)
def test_programs_of_too_much(wrong: Wrong, text: str, said: str) -> None:
    (found,) = wrong(text)
    assert found.startswith(said), found


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        "VAR\n x : ARRAY[1..2] OF REAL := [0.0, 0.1];\n" + "(* " * 100_000,
        "VAR\n" + "a:ARRAY[" * 40_000 + "\nEND_VAR\n",
        "VAR" + " " * 60_000,
        "VAR (* a *)\n" * 5_000,
        "MODULE m\nCONST jointtarget p := [[0]];\n" + "a" * 300_000 + "\nENDMODULE\n",
        "MODULE m\nCONST jointtarget p := [[0]];\n!" + "a" * 300_000 + "\nENDMODULE\n",
        "DEF m()\nPTP {A1 0\n" + "a" * 300_000 + "\nEND\n",
    ],
    ids=["comments", "arrays", "blanks", "short comments", "a word", "a comment", "a word in KRL"],
)
def test_programs_whose_patterns_could_take_for_ever(wrong: Wrong, text: str) -> None:
    """Each took minutes: that it ends is the test."""
    assert len(wrong(text)) == 1
