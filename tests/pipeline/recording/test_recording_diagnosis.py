"""A diagnosis in a recording: it reads back bit for bit, and is there to be seen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from asserting import refusal, there
from diagnoses import diagnosis_of
from recordable import build_comparison
from recorded import columns, rows_of, static, views
from same_results import assert_comes_back, assert_same
from urmpipe_models.errors import RecordingError
from urmpipe_models.kinematics.forward import points_over_log
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.operands import load_runs
from urmpipe_pipeline.results import enclosing_result, read_recording, write_recording


@pytest.fixture
def diagnosed() -> Comparison:
    """A comparison of one log that was diagnosed."""
    result = build_comparison(("log",))
    return replace(result, runs=(replace(result.runs[0], diagnosis=diagnosis_of(result.runs[0])),))


def test_it_reads_back_bit_for_bit(diagnosed: Comparison, tmp_path: Path) -> None:
    assert_comes_back(diagnosed, tmp_path)


def test_one_alone_reads_back_and_is_no_log(diagnosed: Comparison, tmp_path: Path) -> None:
    alone = there(diagnosed.runs[0].diagnosis)
    assert_comes_back(alone, tmp_path)
    path = tmp_path / "result.rrd"
    said = f"{path}: found the recording of a diagnosis, allowed: one that ingest wrote"
    assert refusal(RecordingError, load_runs, [path]) == said


def test_with_its_comparison_it_is_recorded_as_that(diagnosed: Comparison, tmp_path: Path) -> None:
    found = replace(there(diagnosed.runs[0].diagnosis), comparison=diagnosed)
    assert enclosing_result(found) is diagnosed
    assert_same(read_recording(write_recording(found, tmp_path / "run.rrd")), diagnosed)


def test_its_answer_stands_in_the_summary_and_mended_deviations_in_a_tab(
    diagnosed: Comparison, tmp_path: Path
) -> None:
    path = write_recording(diagnosed, tmp_path / "run.rrd")
    (text,) = static(path, "/shown/summary", "TextDocument:text")
    said = there(diagnosed.runs[0].diagnosis).summary
    assert "Diagnosis: **passes; " in text.replace("\\", "")
    assert said in text.replace("\\", "")
    tabs = views(path)["ViewBlueprint:display_name"]
    assert tabs.index("delta without the causes [mm]") == tabs.index("delta = reference - log [mm]") + 3


def test_what_is_named_is_marked_where_the_arm_is(diagnosed: Comparison, tmp_path: Path) -> None:
    path = write_recording(diagnosed, tmp_path / "run.rrd")
    run = diagnosed.runs[0].run
    skeleton = points_over_log(there(run.robot), run.q)
    wanted = (skeleton[:, 2], (skeleton[:, 3] + skeleton[:, 4]) / 2.0)
    words = ("module 3 (phi3) counter-rotates", "r_4 needs +1.2 mm from row 4 on")
    for number, (place, said) in enumerate(zip(wanted, words, strict=True)):
        entity = f"/shown/scene/robot/mark/{number}"
        found = rows_of(path, entity, "Points3D:positions")
        rows = np.searchsorted(run.t_ns, list(found))
        drawn = np.array(list(found.values()))[:, 0]
        np.testing.assert_array_equal(drawn, place[rows].astype(np.float32))
        assert columns(path, f"{entity}/label", "Points3D:labels") == [[said]]
