"""A table as a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from asserting import refusal
from urmpipe_fmus.block import Table, read_table, table_bytes
from urmpipe_models.errors import FmuError

times = st.lists(st.integers(-(2**63), 2**63 - 1), min_size=1, max_size=9, unique=True).map(sorted)
values = st.floats(allow_nan=False, allow_infinity=False)


@given(times=times, columns=st.integers(1, 4), data=st.data())
def test_a_table_reads_back_bit_by_bit(
    times: list[int], columns: int, data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    row = st.lists(values, min_size=columns, max_size=columns)
    rows = data.draw(st.lists(row, min_size=len(times), max_size=len(times)))
    path = tmp_path_factory.mktemp("table") / "table.bin"
    path.write_bytes(table_bytes(Table(np.array(times), np.array(rows))))
    found = read_table(path)
    assert found.t_ns.tolist() == times
    assert found.values.tobytes() == np.array(rows).tobytes()


def test_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "table.bin"
    content = table_bytes(Table(np.array([1, 2]), np.array([[1.0], [2.0]])))
    assert len(content) == 64

    def said_of(changed: bytes) -> str:
        path.write_bytes(changed)
        return refusal(FmuError, read_table, path).removeprefix(f"{path}: ")

    assert said_of(b"t,q\n1,2\n") == "found another kind of file, allowed: a table of urmpipe"
    assert said_of(content[:-1]) == "found version 1, 63 bytes, allowed: version 1, 64 bytes"
    assert (
        said_of(content[:8] + b"\2" + content[9:])
        == "found version 2, 64 bytes, allowed: version 1, 64 bytes"
    )
    assert said_of(content[:32] + content[40:48] + content[32:40] + content[48:]) == (
        "table: the time of row 2 is not after the one before; allowed: rising times"
    )
    path.unlink()
    assert refusal(FmuError, read_table, path) == f"{path}: cannot be read: No such file or directory"
