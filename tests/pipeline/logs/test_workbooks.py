"""Workbooks: the numbers of their CSV files bit for bit, which sheet is read, times in cells, wrong files."""

from __future__ import annotations

import sys
import zipfile
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pandas as pd
import pytest
import xlwt

from asserting import refusal
from urmpipe.main import run
from urmpipe_models.errors import Hint, LogError, OptionError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.logs.log_map import read_options

K = np.arange(60)
Q = np.round(0.5 * np.sin(0.04 * K[:, None] + np.arange(6)), 6)  # openpyxl writes 16 digits: 6 are exact
HEADER = ["time [s]", *(f"joint_{k} [rad]" for k in range(1, 7))]
Rows = Sequence[Sequence[Any]]


def rows(first: Callable[[int], Any] = lambda k: k * 2 / 1000) -> list[list[Any]]:
    return [[first(k), *q] for k, q in enumerate(Q.tolist())]


def write(path: Path, **sheets: Rows) -> Path:
    book = openpyxl.Workbook()
    book.remove(book.worksheets[0])
    for name, cells in sheets.items():
        sheet = book.create_sheet(name)
        for row in cells:
            sheet.append(row)
    book.save(path)
    return path


def write_old(path: Path) -> None:
    book = xlwt.Workbook()
    sheet = book.add_sheet("log")
    for i, row in enumerate([HEADER, *rows()]):
        for j, cell in enumerate(row):
            sheet.write(i, j, cell)
    book.save(path)


def write_pandas(path: Path) -> None:
    pd.DataFrame(rows(), columns=HEADER).to_excel(path, index=False)


WRITERS: Mapping[str, Callable[[Path], object]] = {
    "log.xlsx": write_pandas,
    "log.xlsm": write_pandas,
    "log.ods": write_pandas,
    "log.xls": write_old,
    "log.csv": write_pandas,
}


def same(log: JointLog, expected: JointLog) -> None:
    np.testing.assert_array_equal(log.q, expected.q)
    np.testing.assert_array_equal(log.t_ns, expected.t_ns)


@pytest.fixture
def expected(tmp_path: Path) -> JointLog:
    path = tmp_path / "expected.txt"
    pd.DataFrame(rows(), columns=HEADER).to_csv(path, index=False)
    return read_log([path])


@pytest.mark.parametrize("name", WRITERS)
def test_the_same_numbers_as_the_csv_file(name: str, tmp_path: Path, expected: JointLog) -> None:
    written = tmp_path / (name if name != "log.csv" else "other.xlsx")
    WRITERS[name](written)
    log = read_log([written.rename(tmp_path / name)])  # known by its content
    same(log, expected)
    assert (log.joints, log.warnings) == (expected.joints, ())


@pytest.mark.parametrize(
    ("above", "first"),
    [
        ([["Log of cell 4"], [], ["Robot", "UR5e"], ["Rate", 500], [], HEADER], 7),
        ([["time", *(f"joint_{k}" for k in range(1, 7))], ["s", *["rad"] * 6]], 3),
        ([["made by", None, "me"], HEADER], 3),
    ],
)
def test_lines_above_the_numbers_and_rows_in_messages(
    above: Rows, first: int, tmp_path: Path, expected: JointLog
) -> None:
    path = write(tmp_path / "log.xlsx", log=[*above, *rows()])
    same(read_log([path]), expected)
    wrong = rows()
    wrong[4][3] = "open"
    write(path, log=[*above, *wrong])
    assert refusal(LogError, read_log, [path]).startswith(f"{path}:{first + 4}, column joint_3")


def test_empty_columns_texts_and_errors_in_cells(tmp_path: Path, expected: JointLog) -> None:
    cells = [[None, *row[:4], None, *row[4:], None] for row in (HEADER, *rows())]
    same(read_log([write(tmp_path / "log.xlsx", log=cells)]), expected)
    texts = [[row[0], *(f"{q:.6f}" for q in row[1:])] for row in rows()]
    same(read_log([write(tmp_path / "log.xlsx", log=[HEADER, *texts])]), expected)
    commas = [[row[0], *(str(q).replace(".", ",") for q in row[1:])] for row in texts]
    same(read_log([write(tmp_path / "log.xlsx", log=[HEADER, *commas])]), expected)
    commas[5][1] = "#N/A"
    log = read_log([write(tmp_path / "log.xlsx", log=[HEADER, *commas])])
    assert [warning.message for warning in log.warnings] == [
        "joint_1 has no value in 1 of 60 rows, first in this one"
    ]


def test_merged_groups_over_the_names(tmp_path: Path) -> None:
    path = tmp_path / "log.xlsx"
    names = ["t [s]", *["q1", "q2", "q3"] * 2]
    write(path, log=[[None, "position [rad]", None, None, "target [rad]"], names, *rows()])
    book = openpyxl.load_workbook(path)
    for cells in ("B1:D1", "E1:G1"):
        book["log"].merge_cells(cells)
    book.save(path)
    assert read_log([path]).joints == ("position [rad]/q1", "position [rad]/q2", "position [rad]/q3")


STAMPS: dict[str, tuple[Any, int]] = {
    "date": (datetime(2024, 1, 2, 23, 59, 59, 900_000), 1000),
    "length": (timedelta(), 0),
}


@pytest.mark.parametrize("kind", STAMPS)
@pytest.mark.parametrize("suffix", [".xlsx", ".ods"])
def test_times_in_cells(kind: str, suffix: str, tmp_path: Path, expected: JointLog) -> None:
    """A double of days counts in steps of 0.6 us in this century; openpyxl rounds it once more."""
    start, within_ns = STAMPS[kind]
    us = 2137 * K + K % 3
    header = ["time", *HEADER[1:]]
    cells = rows(lambda k: start + timedelta(microseconds=int(us[k])))
    path = tmp_path / f"log{suffix}"
    if suffix == ".xlsx":
        write(path, log=[header, *cells])
    elif kind == "date":
        pd.DataFrame(cells, columns=header).to_excel(path, index=False)
    else:
        return  # pandas writes lengths of time as numbers of days
    log = read_log([path])
    np.testing.assert_array_equal(log.q, expected.q)
    np.testing.assert_allclose(log.t_ns, us * 1000, rtol=0, atol=within_ns)


def test_of_several_sheets_urmpipe_asks(tmp_path: Path, expected: JointLog) -> None:
    info: Rows = [["Robot", "UR5e"], ["Rate", 500], ["Payload", 2.5]]
    path = write(
        tmp_path / "log.xlsx", info=info, **{"run 1": [HEADER, *rows()], "run 2": [HEADER, *rows()[:9]]}
    )
    with pytest.raises(LogError) as caught:
        read_log([path])
    assert str(caught.value) == (
        f"{path}: found 2 sheets with a table, allowed: one; --sheet 'run 1' reads its 60 rows of numbers;"
        " --sheet 'run 2' reads its 9 rows of numbers"
    )
    counts = [answer(path, hint).rows for hint in caught.value.findings[0].hints]
    assert counts == [60, 9]
    assert read_log([path], LogMap(sheet=3)).rows == 9  # type: ignore[arg-type]  # plain numbers are taken
    same(read_log([write(tmp_path / "one.xlsx", info=info, log=[HEADER, *rows()])]), expected)
    allowed = "allowed: 'info', 'run 1', 'run 2'"
    assert refusal(OptionError, read_log, [path], LogMap(sheet="4")).endswith(f"found '4', {allowed}")


def answer(path: Path, hint: Hint) -> JointLog:
    return read_log([path], read_options({hint.parameter: hint.value}))


def test_a_sheet_of_a_text_is_refused(write: Callable[..., Path]) -> None:
    path = write("t,q1\n0,1\n")
    said = refusal(OptionError, read_log, [path], LogMap(sheet="log"))
    assert said == "sheet (--sheet): found 'log', allowed: with a workbook"


COMPOUND = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"  # how .xls files and encrypted .xlsx files begin
WRONG = {
    "password.xlsx": (COMPOUND, "a workbook with a password, allowed: a workbook without one; "),
    "cut.xlsx": (b"PK\x03\x04\x14\x00", "a workbook that cannot be read (Cannot detect file format), "),
    "cut.xls": (COMPOUND, "a workbook that cannot be read ("),
    "empty.xlsx": (b"", "an empty file, allowed: "),
    "text.xls": (b"<html><table>", "a web page, allowed: "),
    "other.csv": (b"PK\x03\x04\x14\x00", "a zip archive, allowed: "),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_files(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    content, said = WRONG[name]
    path.write_bytes(content)
    assert refusal(LogError, read_log, [path]).startswith(f"{path}: found {said}")


@pytest.mark.parametrize("name", ["log.xlsx", "log.ods", "log.xls"])
@pytest.mark.parametrize("kept", [0.3, 0.9])
def test_a_cut_workbook(name: str, kept: float, tmp_path: Path) -> None:
    """Rust's reader of .xls ends its process where bytes are missing."""
    path = tmp_path / name
    WRITERS[name](path)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(kept * len(whole))])
    said = refusal(LogError, read_log, [path])
    assert said.startswith(f"{path}: found a workbook that cannot be read (")
    assert said.endswith("), allowed: a whole one; open it in a spreadsheet program and save it again")


def test_sheets_without_numbers(tmp_path: Path) -> None:
    texts = [["a", "b"], ["x", "y"]]
    formulas = [HEADER, *[[f"={k}/500", *["=SIN(1)"] * 6] for k in range(20)]]  # openpyxl computes no values
    for cells in (texts, formulas, []):
        said = refusal(LogError, read_log, [write(tmp_path / "log.xlsx", log=cells)])
        assert said == (
            f"{tmp_path}/log.xlsx: found no rows of numbers in 1 sheet (log), allowed: a table with one"
            " row per sample; if its cells are formulas, save it in a spreadsheet program, which adds their"
            " values"
        )


def test_a_bomb_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "log.xlsx", log=[HEADER])
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/worksheets/sheet2.xml", bytes(70 << 20))
    assert "bytes that unpack to" in refusal(LogError, read_log, [path])


def test_without_the_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / "log.xlsx", log=[HEADER, *rows()])
    monkeypatch.setitem(sys.modules, "python_calamine", None)
    assert refusal(LogError, read_log, [path]).endswith('install it: pip install "urmpipe[logs]"')


def test_ingest_without_options(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    header = ["header.stamp", *(f"position.shoulder_{k}_joint" for k in range(6))]
    write(tmp_path / "log.xlsx", log=[header, *rows(lambda k: 1_700_000_000 + k / 100)])
    assert run(["ingest", "log.xlsx", "-o", "log.rrd"]) == 0
    assert "60 rows" in capsys.readouterr().out
