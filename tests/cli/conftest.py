"""The command line as a user runs it, in an empty folder."""

from __future__ import annotations

import io
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import pytest

from urmpipe.main import run as run_line


@dataclass
class Ran:
    code: int
    out: str
    err: str


@pytest.fixture
def urmpipe(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Ran]:
    """Run `urmpipe ARGUMENTS` in an empty folder, in this process, which is quick."""

    def run(*arguments: str | Path) -> Ran:
        monkeypatch.chdir(tmp_path)
        out, err = io.StringIO(), io.StringIO()
        with redirect_stdout(out), redirect_stderr(err):
            code = run_line([*map(str, arguments)])
        return Ran(code, out.getvalue(), err.getvalue())

    return run
