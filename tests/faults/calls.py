"""Calls from Python, many in one process: `python tests/faults/calls.py ROUNDS`, in a folder of its own.

A round ingests a log, compares it and reports the comparison, each with a file. Printed is a JSON line for
each round: the threads of the process, its open files and its memory in [MB].
"""

from __future__ import annotations

import gc
import json
import os
import sys
import warnings
from pathlib import Path

import urmpipe
from jobs import write_inputs


def main(rounds: int) -> None:
    """Make the calls, and tell after each round what the process holds."""
    warnings.simplefilter("ignore")
    write_inputs(Path())
    for _ in range(rounds):
        urmpipe.ingest("log.csv", robot="urm6", output="run.rrd")
        urmpipe.compare("path.csv", "log.csv", robot="urm6", output="all.rrd", junit="all.xml")
        urmpipe.report("all.rrd", "all.html")
        gc.collect()  # what stands in rings is let go of at some time, not at once
        print(json.dumps([_count("task"), _count("fd"), _memory()]), flush=True)


def _count(kind: str) -> int:
    """Return how many threads or files this process has."""
    return len(list(Path(f"/proc/self/{kind}").iterdir()))


def _memory() -> float:
    """Return the memory in use in [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


if __name__ == "__main__":
    main(int(sys.argv[1]))
