"""Several operands: the reading options hold for every log among them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from asserting import INCREASE
from urmpipe_models.arm.denavit_hartenberg import urm_chain
from urmpipe_models.errors import LogError, OptionError, UrmpipeError
from urmpipe_pipeline.operands import load_runs
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.sources import ReadOptions

TIMES = np.arange(6) / 100
TURN = np.arange(6) / 10  # as they are read: the nearest to 0.1, 0.2, ...
ROBOT = urm_chain("urm2", (0.2, 0.2, 0.2), [0.5, 0.5])

Load = Callable[..., list[Run]]


def table(*columns: tuple[str, np.ndarray]) -> str:
    """Return a table as text."""
    rows = zip(*(values for _, values in columns), strict=True)
    lines = [",".join(f"{value:.6g}" for value in row) for row in rows]
    return "\n".join([",".join(name for name, _ in columns), *lines, ""])


PATH = table(("t [s]", TIMES), ("x", TURN), ("y", TURN), ("z", TURN))
LOG = table(("t [s]", TIMES), ("a [rad]", TURN), ("b [rad]", -TURN))


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Write some texts as files of their own, and load them as runs."""

    def load(*texts: str, **options: object) -> list[Run]:
        files = [tmp_path / f"log{k}.csv" for k in range(len(texts))]
        for file, text in zip(files, texts, strict=True):
            file.write_text(text)
        read = ReadOptions(**options)  # type: ignore[arg-type]
        return load_runs(files, robot=ROBOT, read=read)

    return load


@pytest.mark.parametrize("joints", [("b", "a"), ("b [rad]", "a"), ("3", "2")])
def test_the_options_hold_for_every_log(joints: tuple[str, ...], load: Load) -> None:
    for run in load(LOG, LOG, joints=joints, unit={"a": "deg"}):
        np.testing.assert_allclose(run.log.q, np.column_stack((-TURN, np.radians(TURN))), rtol=1e-15)
        assert (run.log.joints, run.log.units) == (("b", "a"), {"t": "s", "b": "rad", "a": "deg"})


def test_a_run_and_its_recording_stand_as_they_were_read(load: Load, tmp_path: Path) -> None:
    """Logs that need other options are ingested first."""
    (made,) = load(LOG, joints=("b", "a"))
    recording = write_recording(made, tmp_path / "made.rrd")
    (tmp_path / "log.csv").write_text(LOG.replace("a [rad]", "c").replace("b [rad]", "d"))
    read = ReadOptions(joints=("c", "d"), unit={"": "deg"})
    runs = load_runs([made, recording, tmp_path / "log.csv"], robot=ROBOT, read=read)
    assert [run.log.joints for run in runs] == [("b", "a"), ("b", "a"), ("c", "d")]
    for run in runs[:2]:
        np.testing.assert_array_equal(run.q, made.q)
    np.testing.assert_allclose(runs[2].log.q, np.radians(np.column_stack((TURN, -TURN))), rtol=1e-15)


def test_a_log_without_a_column_that_is_named_is_told_by_its_file(load: Load, tmp_path: Path) -> None:
    with pytest.raises(LogError) as caught:
        load(PATH, LOG, LOG, joints=("a", "c"))
    assert str(caught.value).replace(f"{tmp_path}/", "").split("\n") == [
        "log0.csv: joints (--joints): found no column 'a', allowed: x, y, z",
        "log1.csv: joints (--joints): found no column 'c', allowed: a [rad], b [rad]",
        "log2.csv: joints (--joints): found no column 'c', allowed: a [rad], b [rad]",
    ]


def test_what_is_wrong_with_an_option_is_told_once(load: Load) -> None:
    with pytest.raises(OptionError) as caught:
        load(PATH, LOG, source="excel")
    assert str(caught.value).startswith("source (--source): found 'excel', allowed: coppeliasim, ")
    assert len(caught.value.findings) == 1


def test_a_log_that_cannot_be_read_is_told_with_the_others(load: Load, tmp_path: Path) -> None:
    with pytest.raises(UrmpipeError) as caught:
        load(LOG.replace("0.01,", "0,"), "", joints=("b", "a"))
    assert str(caught.value).replace(f"{tmp_path}/", "").split("\n") == [
        f"log0.csv:3, column t [s]: found 0 s again, {INCREASE}",
        "log1.csv: found an empty file, allowed: a table with one row per sample",
    ]
