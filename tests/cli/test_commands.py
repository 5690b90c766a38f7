"""A command whose reader leaves."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from thinned_logs import lay_thinned_logs


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no closed pipes of this kind")
def test_a_reader_that_leaves_does_not_turn_a_pass_into_a_fail(tmp_path: Path) -> None:
    lay_thinned_logs(tmp_path)
    command = [sys.executable, "-m", "urmpipe", "compare", "path.csv", "matlab.csv", "--robot", "urm6"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None and process.stderr is not None
    process.stdout.close()
    said = process.stderr.read().decode()
    process.stderr.close()
    assert process.wait() == 0
    assert "Traceback" not in said
