"""Compressed logs: read as the text in them is; damaged ones, bombs and other content are refused."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import tarfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from asserting import refusal
from urmpipe_models.errors import LogError
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.logs.formats.text import RATIO, UNPACKED

COMPRESS: dict[str, Callable[[bytes], bytes]] = {
    "gz": gzip.compress,
    "bz2": bz2.compress,
    "xz": lzma.compress,
    "zst": lambda data: pa.compress(data, "zstd", asbytes=True),
}
PROGRAMS = {"gz": "gzip", "bz2": "bzip2", "xz": "xz", "zst": "zstd"}

ROWS = [f"{k / 100:.2f};{k / 7:.9f};{-k / 11:.9f}" for k in range(3000)]
TEXT = "\n".join(["t [s];Gelenk 1 [°];Gelenk 2 [°]", *ROWS, ""]).replace(".", ",")


@pytest.mark.parametrize("suffix", COMPRESS)
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_the_same_numbers_as_the_text(suffix: str, encoding: str, tmp_path: Path) -> None:
    plain, packed = tmp_path / "log.csv", tmp_path / f"log.csv.{suffix}"
    plain.write_bytes(TEXT.encode(encoding))
    packed.write_bytes(COMPRESS[suffix](TEXT.encode(encoding)))
    expected, log = read_log([plain]), read_log([packed])
    np.testing.assert_array_equal(log.q, expected.q)
    np.testing.assert_array_equal(log.t_ns, expected.t_ns)
    assert (log.name, log.joints) == ("log", expected.joints)
    assert sorted(tmp_path.iterdir()) == [plain, packed]  # nothing is unpacked beside it


@pytest.mark.parametrize("suffix", COMPRESS)
def test_a_wrong_cell_has_the_line_of_the_text(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"log.csv.{suffix}"
    path.write_bytes(COMPRESS[suffix](TEXT.replace(ROWS[1998].replace(".", ","), "19,98;x;0").encode()))
    assert refusal(LogError, read_log, [path]).startswith(f"{path}:2000, column Gelenk 1 [°]: found 'x'")
    assert read_log([path], LogMap(skip_bad=True)).rows == 2999


@pytest.mark.parametrize("suffix", COMPRESS)
@pytest.mark.parametrize("kept", [0.02, 0.5, 0.98])
def test_a_cut_archive(suffix: str, kept: float, tmp_path: Path) -> None:
    path = tmp_path / f"log.{suffix}"
    whole = COMPRESS[suffix](TEXT.encode())
    path.write_bytes(whole[: int(kept * len(whole))])
    found, _, advice = refusal(LogError, read_log, [path]).partition(", allowed: a whole one; ")
    assert "archive that is damaged or cut (" in found
    assert advice == f'copy it again, or keep what can be read: {PROGRAMS[suffix]} -dc "{path}" > log.csv'


@pytest.mark.parametrize("suffix", COMPRESS)
def test_a_bomb_is_refused(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"log.{suffix}"
    path.write_bytes(COMPRESS[suffix](b"0,0\n" * ((UNPACKED >> 2) + 1)))
    size = path.stat().st_size
    assert size * RATIO < UNPACKED
    assert refusal(LogError, read_log, [path]).startswith(
        f"{path}: found {size} bytes that unpack to more, allowed: {UNPACKED} bytes; unpack it if it is a log"
    )


def test_what_is_no_text(tmp_path: Path) -> None:
    archive = io.BytesIO()
    with tarfile.open(fileobj=archive, mode="w") as tar:
        tar.addfile(tarfile.TarInfo("log.csv"))
    contents = {
        "a tar archive": archive.getvalue(),
        "a picture": b"\x89PNG\r\n\x1a\n\x00",
        "a binary file": bytes(range(256)),
    }
    path = tmp_path / "log.gz"
    for what, content in contents.items():
        path.write_bytes(gzip.compress(content))
        assert refusal(LogError, read_log, [path]) == (
            f"{path}: found {what} in a gzip archive, allowed: a text table in it;"
            f' unpack it: gzip -dk "{path}"'
        )
    path.write_bytes(gzip.compress(b""))
    assert "found an empty file" in refusal(LogError, read_log, [path])
