"""A window that is closed before it shows its recording, against a viewer that fails."""

from __future__ import annotations

import contextlib
import shutil
from pathlib import Path

import pytest

from recordable import build_run
from urmpipe_models.errors import ViewerError
from urmpipe_pipeline.recording import viewer
from urmpipe_pipeline.results import write_recording


@pytest.mark.parametrize(
    ("program", "said"),
    [("true", ""), ("false", "the viewer ended with exit code 1, allowed: a display and ")],
)
def test_a_window_may_be_closed_at_any_time_and_a_viewer_that_fails_is_an_error(
    program: str,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """Another program stands where the viewer does, on a computer that says it has a display."""
    found = shutil.which(program)
    if found is None:
        pytest.skip(f"there is no program {program} here")
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(viewer, "_program", lambda: Path(found))
    recording = write_recording(build_run(rows=5), tmp_path / "run.rrd")
    with pytest.raises(ViewerError, match=f"^{said}") if said else contextlib.nullcontext():
        viewer.view_recordings([recording])
    assert capfd.readouterr() == ("", "")
