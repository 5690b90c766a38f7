"""Many calls from Python in one process: threads, open files and memory stay as they are after the first."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
from pathlib import Path

import pytest

from urmpipe_models.processes import module_environment

WARM, MORE = 6, 12
"""Rounds until all is loaded, and the allocator has what it needs; rounds after that."""

ONE_HEAP = {"MALLOC_ARENA_MAX": "1", "ARROW_DEFAULT_MEMORY_POOL": "system"}
"""Else allocators keep heaps of threads that ended, and more of them on a busy machine."""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="counted in /proc")
def test_many_rounds_leave_nothing_behind(tmp_path: Path) -> None:
    """A recording left 4 threads and 2.5 MB behind: that would be 96 threads and 60 MB here."""
    done = subprocess.run(
        [sys.executable, Path(__file__).with_name("calls.py"), str(WARM + MORE)],
        cwd=tmp_path, env=module_environment() | ONE_HEAP,
        capture_output=True, text=True, check=True, timeout=500,
    )  # fmt: skip
    threads, files, memory = zip(*map(json.loads, done.stdout.splitlines()), strict=True)
    assert max(threads[WARM:]) <= max(threads[:WARM])
    assert max(files[WARM:]) <= max(files[:WARM])
    early, late = map(statistics.median, (memory[WARM : -MORE // 2], memory[-MORE // 2 :]))
    assert late <= 1.05 * early
