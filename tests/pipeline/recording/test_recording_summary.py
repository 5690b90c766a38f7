"""The summary of a recording: the verdict first, then how much, where and when."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.trajectory import Alignment, Sync
from urmpipe_pipeline.recording.summary import summary
from urmpipe_pipeline.runs.results import Run

MakeRun = Callable[..., Run]
MakeComparison = Callable[..., Comparison]


def test_the_summary_of_a_run(make_run: MakeRun) -> None:
    assert summary(make_run("a_b|c", rows=201)) == (
        "### a\\_b\\|c\n"
        "a\\_b\\|c.csv, read as table: 201 rows, 1 s. Arm: urm6.\n\n"
        "Grid: 201 samples, one in 5 ms. Repolarizations: 1, marked by triangles in the joint's colour.\n\n"
        "Warnings: 1\n\n"
        "- two rows lie far apart (row 7)"
    )


def test_the_summary_of_a_comparison_says_the_verdict_first(make_comparison: MakeComparison) -> None:
    comparison = make_comparison(("coppeliasim", "solid*", "matlab"))
    worst = comparison.runs[2]
    decisive, longest = worst.decisive, worst.longest_out
    assert longest is not None and decisive.used is not None
    lines = summary(comparison).splitlines()
    assert lines[0] == (
        "### FAIL: 1 of 3 logs (matlab) out of tolerance against asked for, by the joints on both sides"
    )
    assert lines[1] == (
        f"**matlab**: \\|Δ{decisive.quantity}\\| = {1e3 * decisive.max:.4f} mm of 3.5 mm allowed"
        f" ({decisive.used:.3g} times the tolerance) at t = {decisive.t_max:.3f} s. Out of tolerance:"
        f" {np.count_nonzero(worst.outside)} of 1500 samples ({100 * worst.share_out:.1f} %), the longest"
        f" stretch: {longest.duration:.3f} s from t = {longest.t:.3f} s."
    )
    assert lines[3] == "Reference: asked for (grey, dashed). Tolerance: ±3.5 mm per axis."
    assert lines[5] == (
        "| log | drawn | max \\|Δx\\| \\[mm\\] | max \\|Δy\\| \\[mm\\] | max \\|Δz\\| \\[mm\\] | max ‖Δ‖"
        " \\[mm\\] | decided by | at t [s] | out | verdict |"
    )
    rows = [line.split(" | ") for line in lines if line.startswith("| ")][2:]
    assert rows[2][6] == f"\\|Δ{decisive.quantity}\\|"
    assert [(row[0], row[1], row[-1]) for row in rows] == [
        ("| coppeliasim", "orange", "PASS |"),
        ("| solid\\*", "sky blue", "PASS |"),
        ("| matlab", "violet", "FAIL |"),
    ]
    assert rows[2][2:6] == [f"{1e3 * worst.statistics[axis].max:.4f}" for axis in ("x", "y", "z", "norm")]
    assert lines[-1] == (
        f"Decided at {decisive.t_max:.3f} s: `urmpipe view` opens this there, other programs at the first"
        " sample. All figures, statistics and provenance: `urmpipe report` with this file."
    )
    assert lines[-6:-2] == [
        "- asked for: two rows lie far apart (row 7)",
        "- coppeliasim: two rows lie far apart (row 7)",
        "- solid\\*: two rows lie far apart (row 7)",
        "- matlab: two rows lie far apart (row 7)",
    ]


def test_the_summary_says_each_tolerance_in_its_unit(make_comparison: MakeComparison) -> None:
    allowed = {"axis": 0.0035, "path": 0.002, "angle": math.radians(0.5), "joint": math.radians(0.1)}
    assert (
        "Reference: asked for (grey, dashed)."
        " Tolerance: ±3.5 mm per axis, 2 mm from the path, 0.5 deg of orientation, ±0.1 deg per joint."
    ) in summary(replace(make_comparison(), tolerance=allowed)).splitlines()


def test_the_summary_tells_how_clocks_and_places_were_put_together(make_comparison: MakeComparison) -> None:
    comparison = make_comparison(("coppeliasim",))
    turn = 0.01
    rotation = (
        (math.cos(turn), -math.sin(turn), 0.0),
        (math.sin(turn), math.cos(turn), 0.0),
        (0.0, 0.0, 1.0),
    )
    one = replace(
        comparison.runs[0],
        sync=Sync("given", -0.25),
        alignment=Alignment("rigid", rotation, (0.001, 0.002, 0.003)),
        reference_left_out=50,
    )
    assert (
        "clocks: t\\_reference = t\\_log \\- 0.25 s, as given; aligned (rigid): turned by 0.5730 deg about"
        " the origin, then moved by (1.0000, 2.0000, 3.0000) mm; 50 samples of the reference outside its time"
    ) in summary(replace(comparison, runs=(one,))).splitlines()
