"""view as a user runs it; the viewer itself is looked at in tests/pipeline/recording."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from urmpipe_datasets import LOGS

RunCommand = Callable[..., Any]
PATIENCE = 60.0  # s that the viewer has: a software rasterizer on a busy machine is slow

NO_DRIVER = (
    "the viewer ended with exit code 1, allowed: a display and a graphics driver that it can use; to see"
)


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux may be without a display")
@pytest.mark.parametrize(
    ("name", "message"), [("", "found no display (neither DISPLAY nor "), (":4711", NO_DRIVER)]
)
def test_a_display_that_is_not_there_is_one_line(
    urmpipe: RunCommand, monkeypatch: pytest.MonkeyPatch, name: str, message: str
) -> None:
    monkeypatch.setenv("DISPLAY", name)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    urmpipe("ingest", LOGS / "path.csv", "-q", "-o", "run.rrd")
    ran = urmpipe("view", "run.rrd")
    assert (ran.code, ran.out, ran.err.count("\n")) == (2, "", 1)
    assert ran.err.startswith(f"error: {message}")


@pytest.fixture
def display() -> Iterator[str]:
    """Return the name of a display without a screen."""
    read, write = os.pipe()
    options = ["-displayfd", str(write), "-nolisten", "tcp", "-screen", "0", "1280x800x24"]
    with subprocess.Popen(["Xvfb", *options], pass_fds=[write], stderr=subprocess.DEVNULL) as server:
        os.close(write)
        with os.fdopen(read) as told:
            number = told.readline().strip()
        yield f":{number}"
        server.terminate()


def family(pid: int) -> list[int]:
    """Return a process and all that it has started."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    return [pid, *(one for child in children for one in family(int(child)))]


def listening(pid: int) -> set[tuple[str, int]]:
    """Return the addresses, as the kernel writes them, and the ports that a process listens on."""
    links = set[str]()
    for one in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(FileNotFoundError):  # closed since it was listed
            links.add(str(one.readlink()))
    lines = [
        line.split()
        for table in ("tcp", "tcp6")
        for line in Path(f"/proc/net/{table}").read_text(encoding="ascii").splitlines()[1:]
    ]
    listens = "0A"
    open_here = [line[1] for line in lines if line[3] == listens and f"socket:[{line[9]}]" in links]
    return {(address, int(port, 16)) for address, port in (one.split(":") for one in open_here)}


def state_of(port: int, views: int) -> Any:
    """Return the state of the viewer that listens on a port, once it shows so many views at a time."""
    from rerun.experimental import ViewerClient

    with ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy") as client:
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            state = client.get_state()
            if len(state.views) >= views and state.recordings[0].current_time:
                break
            time.sleep(0.2)
        return state


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="needs a display: apt-get install xvfb")
def test_a_window_opens_at_the_worst_sample_for_this_computer_only_and_closes_by_ctrl_c(
    urmpipe: RunCommand, display: str, tmp_path: Path
) -> None:
    ran = urmpipe(
        "compare", LOGS / "path.csv", LOGS / "matlab.csv", "--robot", "urm6", "--json", "-o", "both.rrd"
    )
    (one,) = json.loads(ran.out)["runs"]
    decided = max(
        (one["delta"][axis] for axis in "xyz"), key=lambda found: found["max"]
    )  # as axis= is judged
    environment = {**os.environ, "DISPLAY": display}
    environment.pop("WAYLAND_DISPLAY", None)
    command = [sys.executable, "-m", "urmpipe", "view", "both.rrd"]
    view = subprocess.Popen(
        command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    end, ports = time.monotonic() + PATIENCE, set[tuple[str, int]]()
    while not ports and view.poll() is None and time.monotonic() < end:
        time.sleep(0.2)
        started = family(view.pid)
        ports = {port for pid in started[1:] for port in listening(pid)}
    ((address, port),) = ports
    assert address == "0100007F"  # 127.0.0.1
    state = state_of(port, views=5)
    (shown,) = state.recordings
    assert (shown.current_timeline, shown.current_time) == ("t", round(decided["t_max"] * 1e9))
    assert "delta = reference - log [mm]" in {found.name for found in state.views}
    view.send_signal(signal.SIGINT)
    assert view.communicate(timeout=PATIENCE) == ("", "Closed.\n")
    assert view.returncode == 0
    assert [pid for pid in started if Path(f"/proc/{pid}").exists()] == []
