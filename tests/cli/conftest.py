"""The command line as a user runs it: in its own process, in an empty folder."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest


@dataclass
class Ran:
    code: int
    out: str
    err: str


@pytest.fixture
def urmpipe(tmp_path: Path) -> Callable[..., Ran]:
    """Run `urmpipe ARGUMENTS` in an empty folder."""

    def run(*arguments: str | Path) -> Ran:
        command = [sys.executable, "-m", "urmpipe", *map(str, arguments)]
        done = subprocess.run(
            command, capture_output=True, text=True, cwd=tmp_path, encoding="utf-8", check=False
        )
        return Ran(done.returncode, done.stdout, done.stderr)

    return run
