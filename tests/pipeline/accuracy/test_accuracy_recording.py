"""An accuracy that is recorded comes back as it was, and leaves as tables and trajectories."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from exported import export_result
from recorded import rows_of
from same_results import assert_same
from urmpipe_models.errors import OptionError, RecordingError
from urmpipe_pipeline.accuracy.result import AccuracyResult
from urmpipe_pipeline.operands import load_runs
from urmpipe_pipeline.results import read_recording, write_recording
from urmpipe_pipeline.tables import ExportOptions


@pytest.mark.slow
@pytest.mark.parametrize("lazy", [True, False])
def test_it_comes_back_as_it_was(limited: AccuracyResult, tmp_path: Path, *, lazy: bool) -> None:
    """Every array bit for bit, and all that is derived from them."""
    back = read_recording(write_recording(limited, tmp_path / "a.rrd"), lazy=lazy)
    assert isinstance(back, AccuracyResult)
    assert_same(back, limited)
    assert (back.errors, back.verdict, back.running_speed) == (limited.errors, "fail", 0.2)
    assert json.loads(json.dumps(back.to_dict() | {"recording": None})) == json.loads(
        json.dumps(limited.to_dict())
    )
    pd.testing.assert_frame_equal(back.to_frame(), limited.to_frame(), check_exact=True)


def test_a_motion_that_diverged_comes_back(accuracy: Callable[..., AccuracyResult], tmp_path: Path) -> None:
    result = accuracy(0.5, 1.0, gone=1.0, force=(0.0, 0.0, -50.0))
    back = read_recording(write_recording(result, tmp_path / "a.rrd"))
    assert_same(back, result)
    assert back.to_dict()["errors"][1] is None


def test_the_arm_moves_in_the_viewer(limited: AccuracyResult, tmp_path: Path) -> None:
    """The point of the real path is where the tool was at 0.5 m/s, in single precision over 2 m."""
    path = write_recording(limited, tmp_path / "a.rrd")
    shown = limited.motions[1]
    seen = rows_of(path, r"/shown/scene/point/real\:\ \u{2016}Δ\u{2016}", "Points3D:positions")
    at = np.searchsorted(shown.t_ns, list(seen))
    assert shown.worst in at
    np.testing.assert_allclose(np.array([*seen.values()])[:, 0], shown.position[at], rtol=0, atol=2.5e-7)


def test_its_velocities_leave(accuracy: Callable[..., AccuracyResult], tmp_path: Path) -> None:
    result = accuracy(0.5, 1.0, gone=1.0)
    export_result(result, tmp_path / "v.csv", ExportOptions("csv"))
    export_result(result, tmp_path / "v.mat", ExportOptions("mat"))
    with pytest.raises(OptionError, match="found file with an accuracy, allowed: velocities, samples"):
        export_result(result, tmp_path / "f.csv", ExportOptions("csv", "file"))
    frame = pd.read_csv(tmp_path / "v.csv")
    names = ["velocity [m/s]", "reached [m/s]", "error [m]", "path_error [m]", "saturated_share"]
    assert list(frame) == names
    first = result.errors[0]
    assert frame.iloc[0].tolist() == [
        0.5,
        first.reached,
        first.error,
        first.path_error,
        first.saturated_share,
    ]
    assert frame.iloc[1][["error [m]", "path_error [m]"]].isna().all()


@pytest.mark.parametrize("to", ["csv", "parquet", "mat"])
def test_its_samples_leave(accuracy: Callable[..., AccuracyResult], tmp_path: Path, to: str) -> None:
    """All motions one below the other."""
    result = accuracy(0.5, 1.0)
    path = tmp_path / f"s.{to}"
    done = export_result(result, path, ExportOptions(to, "samples"))  # type: ignore[arg-type]
    (file,) = done.files
    assert file.rows == sum(map(len, result.motions))
    if to == "csv":
        frame = pd.read_csv(path)
        np.testing.assert_array_equal(
            frame[["dx [m]", "dy [m]", "dz [m]", "norm [m]"]].to_numpy(),
            np.concatenate([one.delta for one in result.motions]),
        )
        np.testing.assert_array_equal(
            frame["u_theta2 [V]"], np.concatenate([one.voltage[:, 1] for one in result.motions])
        )
        np.testing.assert_array_equal(frame["t [s]"], np.concatenate([one.t for one in result.motions]))


def test_its_trajectories_leave(accuracy: Callable[..., AccuracyResult], tmp_path: Path) -> None:
    done = export_result(accuracy(0.5, 1.0), tmp_path / "p.tum", ExportOptions("tum"))
    assert len(done.files) == 2


def test_its_recording_is_no_operand(limited: AccuracyResult, tmp_path: Path) -> None:
    write_recording(limited, tmp_path / "one.rrd")
    with pytest.raises(RecordingError, match=r"one\.rrd: found the recording of an accuracy"):
        load_runs([tmp_path / "one.rrd"])
