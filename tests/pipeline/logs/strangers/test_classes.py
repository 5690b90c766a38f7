"""Files of strangers, class by class: read right, or asked with a question whose printed answer leads there.

None is wrong in silence. The truth comes from the motion and each writer's rounding, never from a reader."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

import strange_clocks  # noqa: F401 - each puts its files on the list of strangers
import strange_columns  # noqa: F401
import strange_layouts  # noqa: F401
import strange_names  # noqa: F401
from asking import outcome
from motion import sines, times
from ordinary import well_written
from stranger import STRANGERS, Stranger, judged
from urmpipe.main import run
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap

ORDINARY: Mapping[str, Stranger] = {f"ordinary-{k + 1}": one for k, one in enumerate(well_written())}


@pytest.mark.slow
@pytest.mark.parametrize("name", STRANGERS)
def test_a_strangers_file_is_read_right_or_asked_about(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = STRANGERS[name]
    verdict = judged(one, tmp_path)
    assert verdict.good, verdict
    assert not verdict.unit_first, verdict
    if verdict.last is not None and not one.arm:  # the command line takes what it prints
        words = shlex.split(" ".join(str(hint) for hint in verdict.last.answers))
        robot = ["--robot", one.robot] if one.robot else []
        code = run(["ingest", str(tmp_path / next(iter(one.files))), *words, *robot, "--explain", "-q"])
        assert code != 2, capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("name", ORDINARY)
def test_a_well_written_file_gets_no_question(name: str, tmp_path: Path) -> None:
    verdict = judged(ORDINARY[name], tmp_path)
    assert verdict.kind == "right", verdict


def with_times(cells: Sequence[str], head: str) -> str:
    motion = sines(times(len(cells), 0.05), 6, 601)
    rows = [",".join([cell, *(f"{v:.6f}" for v in row)]) for cell, row in zip(cells, motion.q, strict=True)]
    return "\n".join([*([head] if head else []), *rows, ""])


BROKEN: Mapping[str, Sequence[str]] = {
    "backwards": [f"{0.05 * (k if k < 60 else k - 20):.2f}" for k in range(120)],
    "unreadable": [f"{0.05 * k:.2f}" if k != 70 else "ERR" for k in range(120)],
    "coarse and uneven": [str((k + k % 7) // 30) for k in range(120)],
    "still": ["7.5"] * 120,
}


@pytest.mark.parametrize("head", ["time,q1,q2,q3,q4,q5,q6", ""])
@pytest.mark.parametrize("cells", BROKEN.values(), ids=BROKEN)
def test_each_message_about_time_names_its_option(cells: Sequence[str], head: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(with_times(cells, head))
    came = outcome([path], LogMap(), None).came
    told = came.warnings if isinstance(came, JointLog) else getattr(came, "findings", ())
    about = [one for one in told if re.search(r"\btimes?\b|clock", one.message + (one.allowed or ""))]
    for one in about:
        assert {"time"} & {hint.parameter for hint in one.hints}, one
    if not isinstance(came, JointLog) and about:
        values = [hint.value for one in about for hint in one.hints if hint.parameter == "time"]
        assert "none" in values, came
