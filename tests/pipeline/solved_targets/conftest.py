"""Tables of targets, written and read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from urmpipe_pipeline.logs import LogMap
from urmpipe_pipeline.solved_targets.target_file import TargetFile, read_targets

Read = Callable[..., TargetFile]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    """Write a file and read its targets."""

    def read(text: str | bytes, tsp: float | None = None, **options: Any) -> TargetFile:
        path = tmp_path / "targets.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_targets(path, LogMap(**options), tsp)

    return read
