"""JSON: the numbers of the CSV file bit for bit, in lines and in documents; damaged files."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from asserting import refusal
from urmpipe_models.errors import LogError
from urmpipe_pipeline.logs import LogMap, read_log

Write = Callable[..., Path]

T = np.arange(60) / 500
Q = 0.5 * np.sin(0.04 * np.arange(60)[:, None] + np.arange(6))
NAMES = [f"q{k}" for k in range(1, 7)]
TABLE = pd.DataFrame({"t": T, **dict(zip(NAMES, Q.T, strict=True))})
CSV = TABLE.to_csv(index=False)


def lines(records: list[dict[str, Any]]) -> str:
    return "".join(json.dumps(record) + "\n" for record in records)


def records() -> list[dict[str, Any]]:
    return [{"t": t, "mode": "run", "arm": {"q": q}} for t, q in zip(T.tolist(), Q.tolist(), strict=True)]


DOCUMENTS: dict[str, tuple[str, str]] = {
    "log.jsonl": (TABLE.to_json(orient="records", lines=True, double_precision=15), "q{}"),
    "nested.ndjson": (lines(records()), "arm/q[{}]"),
    "records.json": (json.dumps(records()), "arm/q[{}]"),
    "indented.txt": (json.dumps(records(), indent=1), "arm/q[{}]"),
    "samples.json": (json.dumps({"robot": "ur5e", "limits": [1, 2], "log": records()}), "arm/q[{}]"),
    "columns.json": (json.dumps({"t": T.tolist(), "q": Q.tolist(), "base": [0.5, 0, 0]}), "q[{}]"),
    "pandas.json": (TABLE.to_json(double_precision=15), "q{}"),
    "split.json": (TABLE.to_json(orient="split", double_precision=15), "q{}"),
    "table.json": (TABLE.to_json(orient="table", index=False, double_precision=15), "q{}"),
    "rows.csv": (json.dumps([TABLE.columns.tolist(), *TABLE.to_numpy().tolist()]), "q{}"),
}


@pytest.mark.parametrize("name", DOCUMENTS)
def test_the_same_numbers_as_the_csv_file(name: str, write: Write) -> None:
    text, names = DOCUMENTS[name]
    log, expected = read_log([write(text, name)]), read_log([write(CSV, "expected.txt")])
    rounded = 1e-15 if names == "q{}" and name != "rows.csv" else 0.0
    np.testing.assert_allclose(log.q, expected.q, rtol=0, atol=rounded)  # pandas writes 15 decimals
    np.testing.assert_array_equal(log.t_ns, expected.t_ns)
    first = 0 if "[" in names else 1
    assert log.joints == tuple(names.format(k + first) for k in range(6))


def test_times_with_more_digits_than_a_double(write: Write) -> None:
    stamps = [f"17000000{k:02d}.123456789" for k in range(20)]
    text = "".join(f'{{"t": {t}, "q1": 0.{k}}}\n' for k, t in enumerate(stamps, start=10))
    for document in (text, f"[{text.strip().replace(chr(10), ',')}]"):
        log = read_log([write(document, "log.json")], LogMap(unit={"": "rad"}))
        assert log.clock_start_ns == 1_700_000_000_123_456_789


def test_units_missing_keys_another_order_and_compression(write: Write) -> None:
    rows = [{"t [s]": k / 100, "q [deg]": [k, k / 2], "tau": k} for k in range(40)]
    rows[3] = {"tau": 1, "q [deg]": [3, 1.5], "t [s]": 0.03}
    rows[7] = {"t [s]": 0.07, "q [deg]": [7, 3.5], "note": 'a\t"b"\n'}
    log = read_log([write(gzip.compress(lines(rows).encode()), "log.jsonl.gz")])
    assert (log.name, log.joints) == ("log", ("q[0]", "q[1]"))
    np.testing.assert_allclose(log.q[:, 0], np.radians(np.arange(40)), rtol=1e-15)  # one rounding


def test_a_damaged_line_is_a_row(write: Write) -> None:
    text = lines(records())
    path = write(text[:-20], "log.jsonl")
    assert refusal(LogError, read_log, [path]).startswith(f"{path}:60: found 1 cell (")
    path = write(f"{text}\n{text[:10]}", "log.jsonl")
    assert refusal(LogError, read_log, [path]).startswith(f"{path}:62: found 1 cell (")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (json.dumps(records())[:-50], ":1: found JSON that is damaged or cut ("),
        (json.dumps(records(), indent=1)[:900], " found JSON that is damaged or cut ("),
        ("[" * 100_000, ": found JSON that is damaged or cut ("),
        ('{"robot": "ur5e"}', ": found JSON without an array of numbers, allowed: an array of objects, or"),
        (
            json.dumps({"a": {"t": T.tolist()}, "b": {"t": T[:40].tolist()}}),
            ": found arrays of 2 lengths: a, b, allowed: one; --topic a reads 60 rows: a/t; --topic b ",
        ),
    ],
)
def test_wrong_documents(text: str, said: str, write: Write) -> None:
    path = write(text, "log.json")
    assert said in refusal(LogError, read_log, [path])
