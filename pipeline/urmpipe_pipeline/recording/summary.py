"""The text beside the arm: what was recorded, and how it came out."""

from __future__ import annotations

import re
from collections.abc import Iterable

from urmpipe_pipeline.comparison import AXES, Comparison, Deviation
from urmpipe_pipeline.palette import run_colour_word
from urmpipe_pipeline.recording.entities import printable
from urmpipe_pipeline.results import Run


def summary(result: Run | Comparison) -> str:
    """Return a run or a comparison in a few lines of Markdown; lengths in [mm] here, where people read."""
    return _of_run(result) if isinstance(result, Run) else _of_comparison(result)


def _of_run(run: Run) -> str:
    files = ", ".join(_text(file.name) for file in run.log.files) or "no file"
    robot = "No robot, so no kinematics." if run.log.joints else "A path, without joints."
    if run.robot is not None:
        robot = f"Arm: {_text(run.robot.name)}."
    return "\n".join(
        (
            f"### {_text(run.name)}",
            f"{files}, read as {_text(run.log.source)}: {run.log.rows} rows, {run.duration:.6g} s. {robot}",
            "",
            f"Grid: {len(run.t_ns)} samples, one in {1e3 * run.tsp:.6g} ms. Repolarizations:"
            f" {len(run.repolarizations)}. Warnings: {len(run.warnings)}.",
        )
    )


def _of_comparison(result: Comparison) -> str:
    allowed = ", ".join(f"{_text(name)} {1e3 * limit:.6g} mm" for name, limit in result.tolerance.items())
    heads = ("run", "path drawn", *(f"largest {axis} [mm]" for axis in AXES), "out of tolerance", "verdict")
    return "\n".join(
        (
            f"### {result.verdict.upper()}",
            f"Reference: {_text(result.reference.name)}, drawn grey and dashed."
            f" Tolerance: {allowed or 'none'}.",
            "",
            _row(heads),
            _row("---" for _ in heads),
            *(_row(_cells(i, one)) for i, one in enumerate(result.runs)),
        )
    )


def _cells(index: int, one: Deviation) -> Iterable[str]:
    yield _text(one.name)
    yield run_colour_word(index)
    for axis in AXES:
        yield f"{1e3 * one.statistics[axis].max:.3f}"
    yield f"{100 * one.share_out:.2f} %"
    yield one.verdict.upper()


def _row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _text(value: str) -> str:
    """Return a text from a file so that Markdown shows it as it is."""
    return re.sub(r"([\\`*_{}\[\]<>#|~!-])", r"\\\1", " ".join(printable(value).split()))
