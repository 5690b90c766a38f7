"""The process in which the FMUs of a system run: `python -m urmpipe_fmus.cosim.worker FOLDER`.

An FMU may end its process, so it has one of its own. It waits for a line on its input: the folder holds the
job then, and the run leaves there what it recorded, how far it came, what the FMUs logged, and how it ended.
"""

from __future__ import annotations

import ctypes
import json
import mmap
import os
import pickle
import shutil
import signal
import sys
import traceback
from pathlib import Path
from typing import Any

import fmpy.fmi2  # noqa: F401 - loaded while the job is prepared
import numpy as np
from numpy.typing import NDArray

from urmpipe_fmus.cosim.job import (
    ELSEWHERE,
    JOB,
    LOG,
    NOT_FINITE,
    PROGRESS,
    RECORDED,
    RESULT,
    WARNED,
    Job,
    Progress,
    called,
)
from urmpipe_fmus.cosim.master import Master, NoConvergence
from urmpipe_fmus.cosim.slave import FmuFailed, status_name
from urmpipe_fmus.process import callbacks_with, end_with_parent
from urmpipe_models.processes import limit_memory

MEMORY = 8 * 2**30
"""Bytes that the FMUs may ask for together, beside the files of the run, with what is only reserved, as
runtimes of Python and Java do. An FMU that is given no more ends this process, not the computer."""

LOG_BYTES = 1_000_000
"""A log that is longer is begun anew; the one before is kept beside it."""


class Log:
    """What the FMUs log, a line a message: block, status and text, written at once."""

    def __init__(self, path: Path, job: Job, progress: Progress) -> None:
        self._path, self._job, self._progress = path, job, progress
        self._open()

    def _open(self) -> None:
        self._file = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        self._size = 0

    def take(
        self, _: Any, instance: bytes | None, status: int, category: bytes | None, text: bytes | None
    ) -> None:
        """Take a message of the block that is being called."""
        code = self._progress.code
        name = self._job.blocks[called(code)[0]].name if code != ELSEWHERE else _decoded(instance)
        words = " ".join(_decoded(text).split())
        line = f"{name}\t{status_name(status)}\t{words}\n".encode()
        self._size += os.write(self._file, line)
        if self._size > LOG_BYTES:
            os.close(self._file)
            self._path.replace(self._path.with_suffix(".before"))
            self._open()


def _decoded(text: bytes | None) -> str:
    return (text or b"").decode("utf-8", errors="replace")


def work(folder: Path) -> None:
    """Run the job of a folder, and write how it ended."""
    with (folder / JOB).open("rb") as file:
        job: Job = pickle.load(file)
    with (folder / PROGRESS).open("r+b") as file:
        progress = Progress.from_buffer(mmap.mmap(file.fileno(), ctypes.sizeof(Progress)))
    recorded = _shared(folder / RECORDED).reshape(job.rows, -1)
    not_finite = _shared(folder / NOT_FINITE)[: 3 * job.recorded["Real"]].reshape(3, -1)
    warned = _shared(folder / WARNED).reshape(2, job.calls)
    log = Log(folder / LOG, job, progress)
    callbacks = callbacks_with(log.take)
    master = Master(job, progress, recorded, not_finite, warned, callbacks)
    limit_memory(MEMORY + sum(one.stat().st_size for one in folder.iterdir() if one.is_file()))
    result: dict[str, Any] = {"failed": None, "code": ELSEWHERE}
    try:
        master.run()
    except FmuFailed as error:
        result |= {"failed": error.said, "code": error.code}
    except NoConvergence as error:
        result |= {"failed": str(error)}
    result["notes"] = master.notes
    partial = folder / f"{RESULT}.part"
    partial.write_text(json.dumps(result), encoding="utf-8")
    partial.replace(folder / RESULT)
    master.end()  # last: what an FMU does there must not hide how the run ended
    progress.done = 1


def _shared(path: Path) -> NDArray[np.float64]:
    """Return the doubles of a file, where what is written outlives this process, shape (n,)."""
    with path.open("r+b") as file:
        return np.frombuffer(mmap.mmap(file.fileno(), 0), np.float64)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent is interrupted too, and ends this process
    own = Path(sys.argv[1])
    if not sys.stdin.buffer.readline():  # there is no job, nor will be
        shutil.rmtree(own, ignore_errors=True)
        os._exit(0)
    end_with_parent(own)
    code = 1
    try:
        work(own)
        code = 0
    except Exception:
        traceback.print_exc()
    sys.stdout.flush()
    os._exit(code)  # leaves the FMUs' libraries loaded: what they do when unloaded cannot spoil the run
