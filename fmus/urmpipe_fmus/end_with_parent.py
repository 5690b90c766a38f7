"""How a process in which an FMU runs ends with the one that started it, however that ended."""

from __future__ import annotations

import os
import shutil
import signal
import threading
from contextlib import suppress
from pathlib import Path


def end_with_parent(folder: Path) -> None:
    """End this process when the one that started it does: its end of the standard input is closed then.

    The input is taken away from the standard one, so that an FMU that reads waits for nothing.

    Args:
        folder: The folder of the run, of no use to anybody then.
    """
    watched = os.dup(0)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)

    def watch() -> None:
        """Wait until the input is closed, then leave nothing behind."""
        while os.read(watched, 1024):
            pass
        shutil.rmtree(folder, ignore_errors=True)
        with suppress(AttributeError, OSError):  # Windows has no groups
            if os.getpgrp() == os.getpid():  # what the FMU started ends, too
                os.killpg(os.getpid(), signal.SIGKILL)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
