"""Open recordings in the viewer that was installed with Rerun, each paused where its verdict was decided.

Each recording has a window: in one window, the viewer shows all recordings of a program in the layout of the
first. The viewer is started on a free port of the loopback address, and is asked over it to open the file.
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
from urmpipe_pipeline.recording.layout import TIME, Opening
from urmpipe_pipeline.recording.reader import Store

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

LOOPBACK = "127.0.0.1"  # the only address that the viewer listens on: no other computer sees the recording
START_TIMEOUT = 60.0  # [s] for the viewer to start and to open a recording
EXIT_TIMEOUT = 5.0  # [s] for a window to close
DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")  # environment variables


class _ClosedError(ViewerError):
    """The window was closed before it showed the recording."""


def view_recordings(paths: Sequence[Path]) -> None:
    """Open a window for each recording, and return when all of them are closed, however early.

    Ctrl-C (KeyboardInterrupt) closes them.

    Args:
        paths: Recordings (.rrd) that urmpipe wrote, at least one.

    Raises:
        RecordingError: With every file that is no recording of urmpipe.
        ViewerError: If there is no display, or the viewer does not start.
    """
    at = openings(paths)
    check_display(paths, os.environ)
    with ExitStack() as windows:
        processes = []
        for path, opening in at.items():
            with suppress(_ClosedError):
                processes.append(windows.enter_context(open_window(path, opening))[0])
        for process in processes:
            process.wait()


def openings(paths: Sequence[Path]) -> dict[Path, Opening]:
    """Return the time, or the row, at which each recording opens.

    Raises:
        RecordingError: With every file that is no recording of urmpipe.
    """
    return dict(zip(paths, map_collecting_errors(lambda path: Store(path).opening, paths), strict=True))


def check_display(
    paths: Sequence[Path], environment: Mapping[str, str], platform: str = sys.platform
) -> None:
    """Raise a `ViewerError` that says what to do if there is no display for a window.

    Args:
        paths: Recordings to open.
        environment: Environment variables.
        platform: `sys.platform`; platforms other than Linux always have a display.
    """
    if not platform.startswith("linux") or any(environment.get(name) for name in DISPLAYS):
        return
    files = " ".join(map(shell_quote, paths))
    raise ViewerError(
        f"found no display (neither {' nor '.join(DISPLAYS)} is set), allowed: a computer with a display;"
        f" copy the files to it and run there: urmpipe view {files}; or use a browser there: 1. on this"
        f" computer: rerun --serve-web --bind {LOOPBACK} {files}; 2. on the other one:"
        f" ssh -L 9090:{LOOPBACK}:9090 -L 9876:{LOOPBACK}:9876 THIS-HOST;"
        " 3. open there the address that rerun prints"
    )


@contextmanager
def open_window(
    path: Path, opening: Opening, *, headless: bool = False
) -> Iterator[tuple[subprocess.Popen[bytes], ViewerClient]]:
    """Run the viewer with a recording open in it, paused at a time or a row; close it at the end.

    Without a window (headless), such as to take a picture, it needs a Vulkan driver, at least in software.

    Yields:
        The process of the viewer, and the client that controls it.

    Raises:
        ViewerError: If it does not start.
    """
    with run_viewer(headless=headless) as (process, url):
        yield process, _open_recording(process, url, path, opening)


@contextmanager
def run_viewer(*, headless: bool = False) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """Run the viewer, with or without a window, and yield its process and its address."""
    with socket.socket() as free:
        free.bind((LOOPBACK, 0))
        port = int(free.getsockname()[1])
    options = ["--bind", LOOPBACK, "--port", str(port), "--hide-welcome-screen"]
    command = [str(_program()), *options, *(["--headless"] if headless else [])]
    quiet = subprocess.DEVNULL
    # Not as a context: after Ctrl-C, its end would not wait for the viewer, which would outlive us.
    process = subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet)
    try:
        yield process, f"rerun+http://{LOOPBACK}:{port}/proxy"
    finally:
        process.terminate()
        try:
            process.wait(EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _program() -> Path:
    """Return the viewer that was installed with Rerun: another on the path may be of another version."""
    import rerun_cli

    return Path(rerun_cli.__file__).parent / ("rerun.exe" if sys.platform == "win32" else "rerun")


def _open_recording(process: subprocess.Popen[bytes], url: str, path: Path, opening: Opening) -> ViewerClient:
    """Wait until the viewer shows the recording where it opens, and return the client that controls it."""
    from rerun.experimental import ViewerClient

    end = time.monotonic() + START_TIMEOUT
    while process.poll() is None and time.monotonic() < end:
        try:
            client = ViewerClient.connect(url)
            client.open(str(path.resolve()))
            while not _is_paused_at(client, opening) and time.monotonic() < end:
                time.sleep(0.1)
            return client
        except OSError:  # it does not listen yet, or has just ended
            time.sleep(0.1)
    code = process.poll()
    if code == 0:
        raise _ClosedError(f"the window was closed before it showed {path}")
    how = f"did not answer within {START_TIMEOUT:.0f} s" if code is None else f"ended with exit code {code}"
    raise ViewerError(
        f"the viewer {how}, allowed: a display and a graphics driver that it can use; to see its messages:"
        f" {shell_quote(_program())} {shell_quote(path)}"
    )


def _is_paused_at(client: ViewerClient, opening: Opening) -> bool:
    """Return whether the viewer is paused there; if not, move it there, once it knows the timeline."""
    timeline, at = opening
    for recording in client.get_state().recordings:
        if any(known.name == timeline for known in recording.timelines):
            if (recording.current_timeline, recording.current_time) == opening:
                return True
            if timeline == TIME:
                client.set_time(timeline, duration=np.timedelta64(at, "ns"), play_state="paused")
            else:
                client.set_time(timeline, sequence=at, play_state="paused")
    return False
