"""What is no text: one line that says what it is, with a command whose table is read."""

from __future__ import annotations

import os
import pickle
import re
import struct
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from asserting import refusal
from urmpipe_models.errors import LogError
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.logs.vocabulary import vocabulary

Write = Callable[[Path], object]

ROWS = 60
T = np.arange(ROWS) * 0.01
Q = 0.5 * np.sin(2 * np.pi * 0.7 * T[:, None] + np.arange(6))  # rad, six joints that all turn back
TABLE = pd.DataFrame({"t [s]": T, **{f"q{k + 1} [rad]": Q[:, k] for k in range(6)}})
CSV = TABLE.to_csv(index=False).encode()


def ulog(path: Path) -> None:
    """Write a ULog file: header, format and messages. Source: PX4 guide, ULog file format."""

    def message(kind: bytes, body: bytes) -> bytes:
        return struct.pack("<Hc", len(body), kind) + body

    with path.open("wb") as file:
        file.write(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message(b"B", bytes(40)))
        file.write(message(b"F", b"joints:uint64_t timestamp;double[6] q;"))
        file.write(message(b"A", struct.pack("<BH", 0, 0) + b"joints"))
        for t, q in zip(T, Q, strict=True):
            file.write(message(b"D", struct.pack("<HQ6d", 0, round(t * 1e6), *q)))


def tar(path: Path) -> None:
    (path.parent / "log.csv").write_bytes(CSV)
    with tarfile.open(path, "w:gz") as archive:
        archive.add(path.parent / "log.csv", "log.csv")
    (path.parent / "log.csv").unlink()


def zipped(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("log.csv", CSV)


def objects(path: Path) -> None:
    np.save(path, {"t": T, "q": Q}, allow_pickle=True)  # type: ignore[arg-type]


ARRAYS = {"t": T, "q": Q}
WRITERS: Mapping[str, Write] = {
    "a.pkl": lambda path: path.write_bytes(pickle.dumps(ARRAYS)),
    "frame.pkl": TABLE.to_pickle,
    "objects.npy": objects,
    "a.ulg": ulog,
    "a.tar.gz": tar,
    "a.zip": zipped,
}
COMMAND = re.compile(r"(?:python -|ulog2csv ).*?(?= \(with a password|$)")


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITERS)
def test_the_command_for_a_format_writes_a_table_that_is_read(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    WRITERS[name](path)
    said = refusal(LogError, read_log, [path])
    command = COMMAND.search(said)
    assert command is not None, said
    before = {file: file.stat().st_mtime_ns for file in tmp_path.iterdir()}
    env = {**os.environ, "PATH": os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))}
    subprocess.run(command[0], shell=True, cwd=tmp_path, env=env, check=True, capture_output=True)
    (written,) = [file for file in tmp_path.iterdir() if file not in before]
    assert path.stat().st_mtime_ns == before[path]  # the file itself is left as it is
    log = read_log([written], LogMap(unit={"": "rad"}))
    np.testing.assert_array_equal(log.q, Q)
    np.testing.assert_allclose(log.t_ns, T * 1e9, atol=1.0)  # times are whole ns
    assert log.period == 0.01


def test_every_container_has_a_command_that_runs_here() -> None:
    """But for what is no log."""
    others = ("Simulink", "robot", "TOML", "picture", "PDF", "web page")
    for one in vocabulary().containers:
        suffixed = any(name.lower().endswith(one.suffixes) for name in WRITERS)
        assert suffixed or any(word in one.what for word in others), one.what
