"""What is no log: one clear line each, with the command that makes it one."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from asserting import refusal
from urmpipe_models.errors import LogError, OptionError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]

ALLOWED = "allowed: a text table; --robot NAME|FILE takes a robot"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("arm.urdf", f"the model of a robot, {ALLOWED}"),
        ("arm.csv", f"the model of a robot, {ALLOWED}"),
        ("arm.toml", f"a TOML file, {ALLOWED}; --map FILE.toml takes a map"),
    ],
)
def test_a_robot_is_no_log(wrong: Wrong, name: str, said: str) -> None:
    assert wrong(b'<robot name="arm">\n', name=name) == [f"{name}: found {said}"]


def test_real_containers_are_known(tmp_path: Path) -> None:
    paths = [tmp_path / f"{name}.csv" for name in ("db3", "pdf")]
    connection = sqlite3.connect(paths[0])
    connection.execute("create table messages (id integer)")
    connection.close()
    paths[1].write_bytes(b"%PDF-1.7\n")
    with pytest.raises(LogError) as caught:
        read_log(paths)
    kinds = ["no message (db3.csv: is a database without messages of ROS 2)", "a PDF"]
    assert [str(f).partition("found ")[2].partition(",")[0] for f in caught.value.findings] == kinds


def test_matlab_save_ascii_may_be_called_mat(read: Read, arm: Callable[..., object]) -> None:
    text = "   7.6916151e-01  -2.4290446e-01\r\n   7.6915741e-01  -2.4292719e-01\r\n"
    log = read(text, arm(2), name="q.mat", source="matlab")
    assert log.q[0].tolist() == [0.76916151, -0.24290446]
    assert log.source == "matlab"


def test_missing_folder_empty_binary(wrong: Wrong, tmp_path: Path) -> None:
    assert wrong(b"") == ["log.csv: found an empty file, allowed: a table with one row per sample"]
    assert wrong(bytes(range(256))) == ["log.csv: found a binary file, allowed: a text table (CSV)"]
    assert wrong(np.arange(50.0).tobytes()) == ["log.csv: found a binary file, allowed: a text table (CSV)"]
    assert (
        refusal(LogError, read_log, [tmp_path / "no.csv", tmp_path])
        == f"{tmp_path}/no.csv: found no such file\n{tmp_path}: found a folder, allowed: a file"
    )


def test_unknown_source_and_no_file(tmp_path: Path) -> None:
    with pytest.raises(
        OptionError, match=r"^source \(--source\): found 'vendor', allowed: coppeliasim, .*, path, table$"
    ):
        read_log([tmp_path / "log.csv"], LogMap(source="vendor"))
    with pytest.raises(OptionError, match=r"^found no log file, allowed: one, or several"):
        read_log([])


@pytest.mark.parametrize(
    ("options", "kind", "said"),
    [
        ({"source": "coppeliasim"}, "source-not-used", "coppeliasim has no effect: {none}"),
        ({"source": "abb"}, "source-not-used", "abb has no effect: {none}"),
        ({"rotation": "zyx"}, "rotation-not-used", "zyx has no effect: no orientation was found in the log"),
    ],
)
def test_an_option_that_changes_nothing_is_said(
    read: Read, options: dict[str, str], kind: str, said: str
) -> None:
    log = read("t [s],q1 [rad]\n0,1\n0.1,2\n", **options)
    none = "the log has none of its columns or graphs"
    assert [(one.kind, one.message) for one in log.warnings] == [(kind, said.format(none=none))]


@pytest.mark.parametrize("source", ["table", "matlab", "ur-rtde", "abb"])
def test_a_source_that_tells_a_unit_or_nothing_else_is_not_doubted(read: Read, source: str) -> None:
    log = read("t,q1\n0,1\n0.1,2\n", source=source)
    assert [one.kind for one in log.warnings if one.kind != "assumed-unit"] == []
    assert log.source == source


def test_signs_that_are_none(wrong: Wrong) -> None:
    assert wrong("t,q1\n0,1\n", delimiter="x") == [
        "delimiter (--delimiter): found 'x', allowed: comma, semicolon, tab, spaces, bar, or the character"
        " itself"
    ]
    assert wrong("t,q1\n0,1\n", decimal=";") == [
        "decimal (--decimal): found ';', allowed: point, comma, or the character itself"
    ]


def test_signs_that_the_file_does_not_have(wrong: Wrong) -> None:
    found = "log.csv:1: found 't,q1,q2' and no row of numbers below it"
    allowed = "a table with one row per sample"
    text = "t,q1,q2\n0,1,2\n1,1,2\n"
    assert wrong(text, delimiter=";") == [f"{found} with delimiter semicolon, allowed: {allowed}"]
    assert wrong(text, delimiter="Tab", decimal="comma") == [
        f"{found} with delimiter tab and decimal sign comma, allowed: {allowed}"
    ]


@pytest.mark.slow
def test_reading_loads_neither_pandas_nor_scipy(tmp_path: Path) -> None:
    """Half a second that a command would lose before it begins."""
    path = tmp_path / "log.csv"
    path.write_text("t,q1,q2\n" + "".join(f"{0.005 * k:.3f},0.5,{'' if k % 7 else 1}\n" for k in range(5000)))
    code = (
        "import sys; from pathlib import Path; from urmpipe_pipeline.logs import read_log;"
        f"log = read_log([Path({str(path)!r})]); assert log.rows == 5000;"
        "print([name for name in ('pandas', 'scipy', 'pyarrow.compute') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
