"""Open recordings in the viewer that was installed with Rerun, each paused where its verdict was decided.

One window a recording: within one, the viewer shows all recordings of a program in the layout of the first.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from urmpipe_models.errors import ViewerError, map_collecting_errors, shell_quote
from urmpipe_pipeline.recording.store import TIME, Opening, Store

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

LOOPBACK = "127.0.0.1"
"""The only address that the viewer listens on: a recording is nobody else's business."""

PATIENCE = 60.0
"""Time in [s] that the viewer has to start and to open a recording."""

GRACE = 5.0
"""Time in [s] that a window has to close when it is asked to."""

DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")


class _ClosedError(ViewerError):
    """The window was closed before it showed the recording."""


def view_recordings(paths: Sequence[Path]) -> None:
    """Open a window for each recording, and return when all of them are closed, however early.

    Ctrl-C (KeyboardInterrupt) closes them.

    Args:
        paths: Recordings (.rrd) that urmpipe wrote, at least one.

    Raises:
        RecordingError: With every file that is none.
        ViewerError: If there is no display, or the viewer does not start.
    """
    opened = openings(paths)
    refuse_without_display(paths, os.environ)
    with ExitStack() as windows:
        processes = []
        for path, opening in opened.items():
            with suppress(_ClosedError):
                processes.append(windows.enter_context(open_window(path, opening))[0])
        for process in processes:
            process.wait()


def openings(paths: Sequence[Path]) -> dict[Path, Opening]:
    """Return at which time, or in which row, each recording opens.

    Raises:
        RecordingError: With every file that is no recording of urmpipe's.
    """
    return dict(zip(paths, map_collecting_errors(lambda path: Store(path).opening, paths), strict=True))


def refuse_without_display(
    paths: Sequence[Path], environment: Mapping[str, str], platform: str = sys.platform
) -> None:
    """Raise a `ViewerError` that says what to do if there is no display for a window.

    Args:
        paths: What is to be opened.
        environment: The environment's variables.
        platform: As `sys.platform` tells it: others than Linux always have a display.
    """
    if not platform.startswith("linux") or any(environment.get(name) for name in DISPLAYS):
        return
    files = " ".join(map(shell_quote, paths))
    raise ViewerError(
        f"found no display (neither {' nor '.join(DISPLAYS)} is set), allowed: a copy on a computer with one,"
        f" there: urmpipe view {files}; or a browser there, here: rerun --serve-web --bind {LOOPBACK}"
        f" {files}, there: ssh -L 9090:{LOOPBACK}:9090 -L 9876:{LOOPBACK}:9876 THIS-HOST,"
        " and the address that rerun prints"
    )


@contextmanager
def open_window(
    path: Path, opening: Opening, *, headless: bool = False
) -> Iterator[tuple[subprocess.Popen[bytes], ViewerClient]]:
    """Run the viewer with a recording open in it, paused at a time or a row; close it at the end.

    Without a window (headless), such as to take a picture, it needs a Vulkan driver, be it in software.

    Yields:
        The viewer's process, and what it is controlled by.

    Raises:
        ViewerError: If it does not start.
    """
    with run_viewer(headless=headless) as (process, url):
        yield process, _shown(process, url, path, opening)


@contextmanager
def run_viewer(*, headless: bool = False) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """Run the viewer, maybe without a window, and yield its process and the address it will listen on."""
    port = _free_port()
    options = ["--bind", LOOPBACK, "--port", str(port), "--hide-welcome-screen"]
    command = [str(_program()), *options, *(["--headless"] if headless else [])]
    quiet = subprocess.DEVNULL
    # Not as a context: after Ctrl-C, its end would not wait for the viewer, which would outlive us.
    process = subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet)
    try:
        yield process, f"rerun+http://{LOOPBACK}:{port}/proxy"
    finally:
        _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End the viewer, and wait until it is gone."""
    process.terminate()
    try:
        process.wait(GRACE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _program() -> Path:
    """Return the viewer that was installed with Rerun: another on the path may be of another version."""
    import rerun_cli

    return Path(rerun_cli.__file__).parent / ("rerun.exe" if sys.platform == "win32" else "rerun")


def _free_port() -> int:
    """Return a port that nobody listens on."""
    with socket.socket() as free:
        free.bind((LOOPBACK, 0))
        return int(free.getsockname()[1])


def _shown(process: subprocess.Popen[bytes], url: str, path: Path, opening: Opening) -> ViewerClient:
    """Wait until the viewer shows the recording where it opens, and return what it is controlled by."""
    from rerun.experimental import ViewerClient

    end = time.monotonic() + PATIENCE
    while process.poll() is None and time.monotonic() < end:
        try:
            client = ViewerClient.connect(url)
            client.open(str(path.resolve()))
            while not _stands(client, opening) and time.monotonic() < end:
                time.sleep(0.1)
            return client
        except OSError:  # it does not listen yet, or has just ended
            time.sleep(0.1)
    code = process.poll()
    if code == 0:
        raise _ClosedError(f"the window was closed before it showed {path}")
    how = f"did not answer within {PATIENCE:.0f} s" if code is None else f"ended with exit code {code}"
    raise ViewerError(
        f"the viewer {how}, allowed: a display and a graphics driver that it can use; to see its messages:"
        f" {shell_quote(_program())} {shell_quote(path)}"
    )


def _stands(client: ViewerClient, opening: Opening) -> bool:
    """Tell whether the viewer stands somewhere, and put it there if not: it must know the timeline first."""
    timeline, at = opening
    for one in client.get_state().recordings:
        if any(known.name == timeline for known in one.timelines):
            if (one.current_timeline, one.current_time) == opening:
                return True
            if timeline == TIME:
                client.set_time(timeline, duration=np.timedelta64(at, "ns"), play_state="paused")
            else:
                client.set_time(timeline, sequence=at, play_state="paused")
    return False
