"""A window that is closed before it shows its recording, against a viewer that fails."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from recordable import build_run
from urmpipe_models.errors import ViewerError
from urmpipe_pipeline.recording import viewer
from urmpipe_pipeline.results import write_recording


@pytest.fixture
def recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A recording, on a computer that says it has a display."""
    monkeypatch.setenv("DISPLAY", ":0")
    return write_recording(build_run(rows=5), tmp_path / "run.rrd")


def ends_as(program: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a program that ends at once stand where the viewer does."""
    found = shutil.which(program)
    if found is None:
        pytest.skip(f"there is no program {program} here")
    monkeypatch.setattr(viewer, "_program", lambda: Path(found))


def test_a_window_may_be_closed_at_any_time(
    recording: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    ends_as("true", monkeypatch)
    viewer.view_recordings([recording])  # a closed window is no fault: nothing is raised, or said
    assert capfd.readouterr() == ("", "")


def test_a_viewer_that_fails_is_told_with_its_exit_code(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ends_as("false", monkeypatch)
    with pytest.raises(ViewerError, match=r"^the viewer ended with exit code 1, allowed: a display and "):
        viewer.view_recordings([recording])
