"""The events of a recording: what was done to a log, and what a comparison found, at its time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from recording_contents import columns
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.trajectory import Alignment, Sync
from urmpipe_pipeline.repolarization.audit_entry import AuditEntry, AuditKind
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.runs.results import Run

MakeRun = Callable[..., Run]
MakeComparison = Callable[..., Comparison]


def test_events_tell_the_whole_audit(make_run: MakeRun, tmp_path: Path) -> None:
    kinds: tuple[AuditKind, ...] = ("wrap", "in-between", "repaired", "unexplained", "ambiguous")
    audit = tuple(AuditEntry("phi1", 2, 0.005, 0.0025, -1.5, 0, 1, kind) for kind in kinds)
    path = write_recording(replace(make_run(rows=5), audit=audit), tmp_path / "one.rrd")
    said = [row[0] for row in columns(path, "/events/repolarization", "TextLog:text")]
    assert [line.removeprefix("0.0050 s  phi1 ") for line in said] == [
        "repolarized in row 2: step -1.5000 rad, +0 to +1 turns, +-2.5 ms",
        "left on a wrap in row 2: -1.5000 rad off the line of its neighbours",
        "repaired in row 2: -1.5000 rad off the line of its neighbours",
        "unexplained in row 2: step -1.5000 rad, no wrap",
        "ambiguous in row 2: step -1.5000 rad, a gap of 5 ms: turns unknown",
    ]
    levels = [row[0] for row in columns(path, "/events/repolarization", "TextLog:level")]
    assert levels == ["INFO", "WARN", "INFO", "WARN", "WARN"]


def test_events_name_joint_row_and_turns(make_comparison: MakeComparison, tmp_path: Path) -> None:
    path = write_recording(make_comparison(), tmp_path / "both.rrd")
    assert columns(path, "/events/repolarization", "TextLog:text") == [
        ["0.0025 s  phi6 repolarized in row 2: step +6.2808 rad, +0 to -1 turns, +-2.5 ms"],
        ["6.2625 s  phi1 repolarized in row 1254: step -6.2817 rad, +0 to +1 turns, +-2.5 ms"],
    ]
    assert columns(path, "/runs/matlab/events/warning", "TextLog:text") == [
        ["0.0300 s  gap in row 7: two rows lie far apart"]
    ]


def test_events_tell_how_a_log_compares(make_comparison: MakeComparison, tmp_path: Path) -> None:
    one = replace(
        make_comparison(("solid",)).runs[0],
        sync=Sync("auto", 3.4, "joints", 0.0002, 0.99999),
        alignment=Alignment("tool", tool=(0.001, 0.0, -0.0025)),
        left_out=12,
    )
    outside = np.zeros(1500, dtype=bool)
    outside[[3, 100, 101, 102]] = True
    one = replace(one, outside=outside, verdict="fail")
    path = write_recording(replace(make_comparison(), runs=(one,)), tmp_path / "one.rrd")
    x, y, z, norm = 1e3 * one.delta[one.worst]
    decisive = one.decisive
    wanted = [
        (0.0, "clocks: t_reference = t_log + 3.4 s, estimated from joints, ± 0.2 ms, similarity 1.0000"),
        (0.0, "aligned (tool): tool centre point moved by (1.0000, 0.0000, -2.5000) mm in the tool's frame"),
        (0.0, "12 of 1512 samples left out: no reference or no value"),
        (0.5, "longest stretch out of tolerance begins: 3 samples, 0.010 s"),
        (
            decisive.t_max,
            f"decides: |Δ{decisive.quantity}| = {1e3 * decisive.max:.4f} mm of 3.5 mm allowed",
        ),
        (
            one.t[one.worst],
            f"largest deviation: {norm:.4f} mm (x {x:.4f} mm, y {y:.4f} mm, z {z:.4f} mm)",
        ),
    ]
    said = [row[0] for row in columns(path, "/events/deviation", "TextLog:text")]
    assert said == [f"{t:.4f} s  {text}" for t, text in sorted(wanted, key=lambda event: event[0])]
    levels = [row[0] for row in columns(path, "/events/deviation", "TextLog:level")]
    assert levels == ["INFO", "INFO", "WARN", "ERROR", "ERROR", "ERROR"]


def test_what_no_text_can_hold_is_told_all_the_same(make_comparison: MakeComparison, tmp_path: Path) -> None:
    """A file's name or header of undecodable bytes ends up in the verdict's words."""
    one = make_comparison(("coppeliasim",)).runs[0]
    worst = replace(one.joint_statistics["phi2"], quantity="q\udcff", tolerance=1e-9)
    one = replace(one, joint_statistics={"q\udcff": worst})
    path = write_recording(replace(make_comparison(), runs=(one,)), tmp_path / "odd.rrd")
    said = [row[0] for row in columns(path, "/events/deviation", "TextLog:text")]
    assert any("decides: |Δ q?| = 0.1146 deg of 5.72958e-08 deg allowed" in line for line in said)
