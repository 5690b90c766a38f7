"""The process in which the FMUs of a system run: `python -m urmpipe_fmus.cosim.worker FOLDER`.

An FMU may end this process at any time. So the recording, the progress and the log are written at once, into
the files of the folder (`job`); the result is written when the run ends, before the FMUs are freed.
"""

from __future__ import annotations

import ctypes
import json
import mmap
import os
import pickle
import sys
import traceback
from pathlib import Path
from typing import Any

import fmpy.fmi2  # noqa: F401 - loaded while the job is prepared
import numpy as np
from numpy.typing import NDArray

from urmpipe_fmus.cosim.job import (
    JOB,
    LOG,
    NO_CALL,
    NOT_FINITE,
    PROGRESS,
    RECORDED,
    RESULT,
    WARNED,
    Job,
    Progress,
    decode_call,
)
from urmpipe_fmus.cosim.master import ConvergenceError, Master
from urmpipe_fmus.cosim.slave import FmuCallError, status_name
from urmpipe_fmus.process import await_job, callbacks_with
from urmpipe_models.processes import limit_memory

# Memory of all FMUs together, in addition to the files of the run, with what is only reserved, as runtimes of
# Python and Java do. An FMU that gets no more memory ends this process, not the computer.
MEMORY_BYTES = 8 * 2**30
LOG_BYTES = 1_000_000  # a longer log is started again; the previous one is kept as a second file


class FmuLog:
    """The log of the FMUs, one line per message: block, status and text, written at once."""

    def __init__(self, path: Path, job: Job, progress: Progress) -> None:
        self._path, self._job, self._progress = path, job, progress
        self._open()

    def _open(self) -> None:
        self._file = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        self._size = 0

    def write(
        self, _: Any, instance: bytes | None, status: int, category: bytes | None, text: bytes | None
    ) -> None:
        """Write a message of the block that is being called."""
        code = self._progress.code
        name = self._job.blocks[decode_call(code)[0]].name if code != NO_CALL else _decode(instance)
        words = " ".join(_decode(text).split())
        self._size += os.write(self._file, f"{name}\t{status_name(status)}\t{words}\n".encode())
        if self._size > LOG_BYTES:
            os.close(self._file)
            self._path.replace(self._path.with_suffix(".before"))
            self._open()


def _decode(text: bytes | None) -> str:
    return (text or b"").decode("utf-8", errors="replace")


def run_job(folder: Path) -> None:
    """Run the job of a folder, and write how it ended."""
    with (folder / JOB).open("rb") as file:
        job: Job = pickle.load(file)
    with (folder / PROGRESS).open("r+b") as file:
        progress = Progress.from_buffer(mmap.mmap(file.fileno(), ctypes.sizeof(Progress)))
    recorded = _map_doubles(folder / RECORDED).reshape(job.rows, -1)
    not_finite = _map_doubles(folder / NOT_FINITE)[: 3 * job.recorded["Real"]].reshape(3, -1)
    warned = _map_doubles(folder / WARNED).reshape(2, job.calls)
    callbacks = callbacks_with(FmuLog(folder / LOG, job, progress).write)
    master = Master(job, progress, recorded, not_finite, warned, callbacks)
    limit_memory(MEMORY_BYTES + sum(path.stat().st_size for path in folder.iterdir() if path.is_file()))
    result: dict[str, Any] = {"failed": None, "code": NO_CALL}
    try:
        master.run()
    except FmuCallError as error:
        result |= {"failed": str(error), "code": error.code}
    except ConvergenceError as error:
        result |= {"failed": str(error)}
    result["notes"] = master.notes
    partial = folder / f"{RESULT}.part"
    partial.write_text(json.dumps(result), encoding="utf-8")
    partial.replace(folder / RESULT)
    master.end()  # last: a crash there must not hide how the run ended
    progress.done = 1


def _map_doubles(path: Path) -> NDArray[np.float64]:
    """Return the doubles of a file as shared memory, shape (n,): they outlive this process."""
    with path.open("r+b") as file:
        return np.frombuffer(mmap.mmap(file.fileno(), 0), np.float64)


if __name__ == "__main__":
    job_folder = Path(sys.argv[1])
    await_job(job_folder)
    exit_code = 1
    try:
        run_job(job_folder)
        exit_code = 0
    except Exception:
        traceback.print_exc()
    sys.stdout.flush()
    os._exit(exit_code)  # without unloading the libraries, which could still crash
