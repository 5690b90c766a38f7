"""A reference and three logs of one motion, and `urmpipe compare` on them."""

from __future__ import annotations

from functools import cache
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from urmpipe.main import run
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.results import read_recording

Captured = pytest.CaptureFixture[str]


def lay_logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Enter a folder with a reference and three logs: within tolerance, a little worse, out of it."""
    monkeypatch.chdir(tmp_path)
    for name, off in (("wanted", 0.0), ("good", 0.0005), ("slack", 0.0006), ("bad", 0.02)):
        Path(f"{name}.csv").write_text(log_text(off), encoding="utf-8")
    return tmp_path


@cache
def log_text(off: float) -> str:
    """Return the text of a log that differs by so much from the one that is wanted."""
    t, text = 0.005 * np.arange(200), StringIO()
    q = np.cos(np.outer(t, 0.5 + 0.1 * np.arange(6)))
    header = "t [s]," + ",".join(f"q{i} [rad]" for i in range(1, 7))
    table = np.column_stack([t, q - off * np.sin(t)[:, np.newaxis]])
    np.savetxt(text, table, fmt="%.9f", delimiter=",", header=header, comments="")
    return text.getvalue()


def compare(*arguments: str) -> int:
    """Run `urmpipe compare wanted.csv ...` with an arm."""
    return run(["compare", "wanted.csv", *arguments, "--robot", "ur5e"])


def recorded(name: str) -> Comparison:
    """Return the comparison that a recording holds."""
    result = read_recording(Path(name))
    assert isinstance(result, Comparison)
    return result


def names() -> set[str]:
    """Return what stands in the folder beside the logs."""
    return {path.name for path in Path.cwd().iterdir()} - {
        f"{n}.csv" for n in ("wanted", "good", "slack", "bad")
    }


def read_lines(name: str) -> list[str]:
    """Return the lines of a file with their ends."""
    return Path(name).read_text(encoding="utf-8").splitlines(keepends=True)
