"""The group, its help and the one error boundary."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner
from hypothesis import assume, given
from hypothesis import strategies as st

from urmpipe.main import cli, find_commands, run
from urmpipe_datasets import LOGS

RunCommand = Callable[..., Any]


def python(code: str, *words: str | Path, flags: tuple[str, ...] = ()) -> subprocess.CompletedProcess[str]:
    """Run code in a new process."""
    line = [sys.executable, *flags, "-c", code, *words]
    return subprocess.run(line, capture_output=True, text=True, check=False)


def test_the_short_help_of_every_command_is_its_own() -> None:
    context = click.Context(cli)
    for name, short in find_commands().items():
        command = cli.get_command(context, name)
        assert command is not None
        assert command.get_short_help_str(limit=200) == short


@pytest.mark.slow
def test_importing_urmpipe_leaves_the_garbage_collection_alone() -> None:
    code = (
        "import gc; before = gc.get_threshold();"
        "import urmpipe; urmpipe.ingest; import urmpipe.main;"
        "print(gc.get_threshold() == before)"
    )
    assert python(code).stdout == "True\n"


def test_version(urmpipe: RunCommand) -> None:
    for words in ((), ("ingest",), ("robot", "list")):
        ran = urmpipe(*words, "--version")
        assert (ran.code, ran.out) == (0, f"urmpipe, version {version('urmpipe')}\n")


HUGE = "t,q1 [rad],q2 [rad],q3 [rad],q4 [rad],q5 [rad],q6 [rad],x [m],y [m],z [m]\n"
HUGE += "".join(
    f"{0.01 * k:g},0.1,{9 * k}e199,1e160,0.4,0.5,{k % 7},{k}e200,{k}e300,1e300\n" for k in range(60)
)
UP_TO = "allowed: up to 1e+12"


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["ingest huge.csv --robot ur5e", "report huge.rrd"], ""),
        (["ik huge.csv --robot ur5e --unit m"], ""),
        (["compare huge.csv huge.csv --robot ur5e"], f"column q2: found 9e+199 (in SI) and 58 more, {UP_TO}"),
        (["diagnose huge.csv huge.csv --robot ur5e"], f"column z: found 1e+300 (in SI) and 59 more, {UP_TO}"),
        (["plan cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1 --acceleration 1e300"], "1e-09 to 1e+09 m/s2"),
        (["plan cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1 --tsp 1e300"], "1e-09 to 1e+09 s"),
    ],
)  # fmt: skip
def test_numpy_warns_of_no_huge_value(
    urmpipe: RunCommand, tmp_path: Path, lines: list[str], said: str
) -> None:
    (tmp_path / "huge.csv").write_text(HUGE, encoding="utf-8")
    for line in lines:
        ran = urmpipe(*line.split())
        assert said in ran.err
        assert "an error in urmpipe" not in ran.err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flags", "words", "shown"), [((), (), 0), ((), ("ingest", "--debug"), 1), (("-W", "error"), (), 1)]
)
def test_a_warning_of_numpy_reaches_who_debugs_alone(
    flags: tuple[str, ...], words: tuple[str, ...], shown: int
) -> None:
    code = (
        "import sys, numpy as np, urmpipe.main as main;"
        "main.cli.main = lambda *_, **__: np.zeros(1) / np.zeros(1);"
        "main.run(sys.argv[1:])"
    )
    assert python(code, *words, flags=flags).stderr.count("RuntimeWarning: invalid value") == shown


@pytest.mark.slow
def test_a_stop_in_a_callback_of_python_stops_all_the_same() -> None:
    code = (
        "import signal, sys, time, weakref, urmpipe.main as main;"
        "stop = lambda *_: signal.raise_signal(signal.SIGTERM);"
        "made = [type('A', (), {})()];"
        "kept = weakref.ref(made[0], stop);"
        "main.cli.main = lambda *_, **__: (made.clear(), [time.sleep(0.01) for _ in range(6000)]);"
        "main.main([])"
    )
    done = python(code)
    assert (done.returncode, done.stderr) == (2, "error: stopped; no file is left incomplete\n")


@given(name=st.sampled_from(sorted(find_commands())), at=st.integers(0, 20))
def test_a_command_with_a_letter_missing_is_meant(name: str, at: int) -> None:
    at %= len(name)
    typed = name[:at] + name[at + 1 :]
    assume(len(name) > 2 and typed != "eport")  # as much like report as like export
    result = CliRunner().invoke(cli, [typed], standalone_mode=False)
    assert isinstance(result.exception, click.UsageError)
    assert f"(did you mean {name}?)" in result.exception.message


def test_debug_adds_the_traceback(urmpipe: RunCommand) -> None:
    ran = urmpipe("ingest", "missing.csv", "--debug")
    assert ran.code == 2
    assert "Traceback (most recent call last)" in ran.err


@pytest.mark.parametrize("words", [(), ("robot",), ("fmu",)], ids=" ".join)
def test_a_group_alone_answers_with_its_help(urmpipe: RunCommand, words: tuple[str, ...]) -> None:
    ran = urmpipe(*words)
    assert (ran.code, ran.out, ran.err) == (2, "", urmpipe(*words, "--help").out)


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("urmpipe in", "plain,ingest\n"),
        ("urmpipe ingest log.csv --robot ur5", "file,ur5\nplain,ur5\nplain,ur5e\n"),
        ("urmpipe simulate log-to-delta --set l", "plain,log=\n"),
    ],
)
@pytest.mark.parametrize("lab", ['robot = "urm6"\n', "robot = urm6\n"], ids=["sound", "broken"])
def test_a_shell_completes_whatever_the_lab_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    line: str, offered: str, lab: str,
) -> None:  # fmt: skip
    (tmp_path / "urmpipe.toml").write_text(lab)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("_URMPIPE_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(line.count(" ")))
    with pytest.raises(SystemExit):
        run([])
    assert capsys.readouterr() == (offered, "")


FULL = "error: No space left on device\n"


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is full")
@pytest.mark.parametrize(
    ("line", "code", "error"),
    [
        ("simulate --list > /dev/full", 2, FULL),
        ("simulate --list --json > /dev/full", 2, FULL),
        ("simulate 2> /dev/full", 2, ""),
        ("simulate --list >&-", 0, ""),
        ("simulate --list 2>&-", 0, ""),
    ],
)
def test_an_output_that_is_full_is_an_error_of_one_line_and_a_closed_output_none(
    line: str, code: int, error: str
) -> None:
    command = ["sh", "-c", f'"$0" -m urmpipe {line}', sys.executable]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (code, error)


def test_an_error_that_a_stop_caused_is_a_stop(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C in the import of a library in C comes out of it as an ImportError."""

    def fail(*_: object, **__: object) -> None:
        raise ImportError("initialization failed")

    monkeypatch.setattr("urmpipe.main._stopped", [signal.SIGINT])
    monkeypatch.setattr(cli, "main", fail)
    assert run(["ingest", "log.csv"]) == 2
    assert capsys.readouterr().err == "error: stopped; no file is left incomplete\n"


def test_a_command_records_without_pandas_and_leaves_it_usable(tmp_path: Path) -> None:
    code = """
import atexit, sys
import pyarrow
from urmpipe.main import main
def check():
    print("pandas" in sys.modules, pyarrow.table({"a": [1]}).to_pandas()["a"].tolist())
atexit.register(check)
main()
"""
    done = python(code, "ingest", LOGS / "matlab.csv", "--robot", "urm6", "-q", "-o", tmp_path / "run.rrd")
    assert done.stdout == "False [1]\n"
