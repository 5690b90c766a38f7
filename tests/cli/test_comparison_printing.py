"""What a person reads of a comparison: the verdict first, tables that fit, the numbers of the statistics."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.cells import cell_len

import urmpipe
from urmpipe.main import run as run_command
from urmpipe.printing import terminal as printing
from urmpipe.printing.comparison import print_comparison
from urmpipe.printing.terminal import new_console
from urmpipe_models.arrays import FloatArray
from urmpipe_models.transform import from_rpy
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.trajectory import Alignment, Sync
from urmpipe_pipeline.text import limit, number

Captured = pytest.CaptureFixture[str]

NOTHING_OFF = np.zeros((5, 3))
Y_OFF = np.array([[0.0, 0.001, 0.0]] * 5)
Z_OFF = np.array([[0.0, 0.0, z] for z in (0.0, 0.004, 0.0045, 0.0, 0.0)])


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write_path(name: str, off: FloatArray) -> str:
    """Write a path of 1 s that is off a straight line by so much."""
    t = np.linspace(0.0, 1.0, 5)
    position = np.column_stack([0.4 * t, 0.0 * t, 1.0 + 0.0 * t]) - off
    values = np.column_stack([t, position])
    np.savetxt(name, values, fmt="%.9f", delimiter=",", header="t [s],x [m],y [m],z [m]", comments="")
    return name


def write_arm(name: str, off: float) -> str:
    """Write a log of six joints that are off a motion by so much."""
    t = 0.005 * np.arange(40)
    q = np.cos(np.outer(t, 0.5 + 0.1 * np.arange(6))) - off
    header = "t [s]," + ",".join(f"q{i} [rad]" for i in range(1, 7))
    np.savetxt(name, np.column_stack([t, q]), fmt="%.9f", delimiter=",", header=header, comments="")
    return name


def compared_arms() -> Comparison:
    """Two logs of an arm, a milliradian apart in each joint."""
    logs = write_arm("wanted.csv", 0.0), write_arm("done.csv", 0.001)
    return urmpipe.compare(logs[0], [logs[1]], robot="ur5e", tolerance={"joint": 0.01})


def printed(result: Comparison, capsys: Captured) -> list[str]:
    """Return the lines that are printed, without blanks at their ends."""
    capsys.readouterr()
    print_comparison(result)
    return [line.rstrip() for line in capsys.readouterr().out.splitlines()]


def fact(run: Deviation, word: str, capsys: Captured) -> list[str]:
    """Return the printed lines of a comparison with one log that begin with a word."""
    lines = printed(replace(compared_arms(), runs=(run,)), capsys)
    return [line.strip() for line in lines if line.strip().startswith(word)]


def test_what_a_log_out_of_tolerance_looks_like_is_said(capsys: Captured) -> None:
    logs = write_arm("wanted.csv", 0.0), write_arm("done.csv", 0.01)
    (line,) = (one for one in printed(urmpipe.compare(*logs, robot="ur5e"), capsys) if "looks like" in one)
    said, _, spread = line.partition(", std ")  # of rounding alone
    assert said == "  looks like: q1 is off by the same throughout (reference - log = 0.5730 deg"
    assert spread.endswith(" deg): another zero?")
    assert not any("looks like" in one for one in printed(compared_arms(), capsys))


def test_joints_are_said_to_have_decided_only_where_both_sides_have_some(capsys: Captured) -> None:
    log, path = write_arm("log.csv", 0.0), "path.csv"
    run = urmpipe.ingest(log, robot="ur5e")
    assert run.tcp is not None
    table = np.column_stack([run.t, run.tcp.position])
    np.savetxt(path, table, fmt="%.9f", delimiter=",", header="t [s],x [m],y [m],z [m]", comments="")
    assert run_command(["compare", log, path, "--robot", "ur5e", "-o", "a.rrd", "--strict"]) == 0
    said = capsys.readouterr()
    first = said.out.splitlines()[0]
    assert first == "PASS  path within tolerance against log, by the joints of the reference"
    assert said.err.splitlines() == [
        "warning: path: a path without joints, held against log, which has joints: the reference stands"
        " first, then the logs"
    ]
    assert run_command(["compare", path, log, "--robot", "ur5e", "-o", "a.rrd", "--strict"]) == 0
    assert capsys.readouterr().err == ""


def test_one_log_is_a_verdict_and_its_statistics(capsys: Captured) -> None:
    result = urmpipe.compare(write_path("path.csv", NOTHING_OFF), [write_path("a.csv", Y_OFF)])
    assert printed(result, capsys) == [
        "PASS  a within tolerance against path",
        "      |Δy| = 1.0000 mm of 3.5 mm allowed (28.6 % of the tolerance) at t = 0.000 s"
        " (row 1), at (0.0000, -0.0010, 1.0000) m",
        "",
        "a against path",
        "Quantity   Verdict  tolerance     max  at t [s]     rms     p95    mean     std  at start",
        "──────────────────────────────────────────────────────────────────────────────────────────",
        "Δx [mm]       PASS        3.5  0.0000     0.000  0.0000  0.0000  0.0000  0.0000    0.0000",
        "Δy [mm]       PASS        3.5  1.0000     0.000  1.0000  1.0000  1.0000  0.0000    1.0000",
        "Δz [mm]       PASS        3.5  0.0000     0.000  0.0000  0.0000  0.0000  0.0000    0.0000",
        "‖Δ‖ [mm]         –          –  1.0000     0.000  1.0000  1.0000  1.0000  0.0000    1.0000",
        "path [mm]        –          –  1.0000     0.000  1.0000  1.0000  1.0000  0.0000         –",
        "  5 samples compared over 1.000 s",
        "  clocks: both from their first samples",
    ]


def test_several_logs_are_one_table_from_best_to_worst(capsys: Captured) -> None:
    logs = [write_path("b.csv", Z_OFF), write_path("a.csv", Y_OFF)]
    tolerance = {"axis": 0.0035, "norm": 0.01}
    lines = printed(urmpipe.compare(write_path("path.csv", NOTHING_OFF), logs, tolerance=tolerance), capsys)
    assert lines[:4] == [
        "FAIL  1 of 2 logs (b) out of tolerance against path",
        "      b: |Δz| = 4.5000 mm of 3.5 mm allowed (1.29 times the tolerance) at t = 0.500 s"
        " (row 3), at (0.2000, 0.0000, 0.9955) m",
        "",
        "From best to worst",
    ]
    cells = [line.replace(" %", "%").split() for line in lines[7:9]]
    assert cells == [
        ["a", "PASS", "0.0000", "1.0000", "0.0000", "1.0000", "1.0000", "0%", "–", "–", "|Δy|", "0.000", "–"],
        [
            *("b", "FAIL", "0.0000", "0.0000", *["4.5000"] * 3, "40.0%", "0.250", "0.250"),
            *("|Δz|", "0.500", "-0.233"),
        ],
    ]
    z = next(line for line in lines if line.startswith("Δz") and "FAIL" in line)
    assert z.split()[2:] == [
        "FAIL", "3.5", "4.5000", "0.500", "2.6926", "4.4000", "1.7000", "2.0881", "0.0000", "40.0", "%",
    ]  # fmt: skip
    out = "2 of 5 samples (40.0 %), the longest stretch: 0.250 s from t = 0.250 s"
    assert f"  out of tolerance: {out}" in lines


def test_the_ranking_tells_what_decided_and_when(capsys: Captured) -> None:
    """One joint decides at the end, while the norm is largest in the middle."""
    result = compared_arms()
    run = result.runs[0]
    joints = dict(run.joint_statistics)
    joints["q4"] = replace(joints["q4"], max=0.009, t_max=0.195, sample_max=39)
    norm = replace(run.statistics["norm"], t_max=0.1, sample_max=20)
    decided = replace(run, joint_statistics=joints, statistics=run.statistics | {"norm": norm})
    lines = printed(replace(result, runs=(decided, replace(decided, name="again"))), capsys)
    assert lines[1].startswith("      again: |Δ q4| = 0.5157 deg of 0.572958 deg allowed (90.0 % of the")
    rows = [line.split() for line in lines if line.startswith(("again ", "done "))]
    assert [row[row.index("|Δ") : row.index("|Δ") + 3] for row in rows if "|Δ" in row] == [
        ["|Δ", "q4|", "0.195"]
    ] * 2


def test_the_log_that_is_told_of_is_the_one_furthest_out_also_where_another_ends_early(
    capsys: Captured,
) -> None:
    reference = write_path("path.csv", NOTHING_OFF)
    write_path("early.csv", Z_OFF)
    lines = Path("early.csv").read_text().splitlines()
    Path("early.csv").write_text("\n".join(lines[:4]) + "\n")
    result = urmpipe.compare(reference, ["early.csv", write_path("far.csv", 2 * Z_OFF)])
    assert [run.name for run in result.ranking] == ["far", "early"]
    assert result.worst.name == "far"
    assert printed(result, capsys)[:2] == [
        "FAIL  both logs out of tolerance against path; 1 log covers only a part of the reference",
        "      far: |Δz| = 9.0000 mm of 3.5 mm allowed (2.57 times the tolerance) at t = 0.500 s (row 3), at"
        " (0.2000, 0.0000, 0.9910) m",
    ]
    alone = urmpipe.compare(reference, ["early.csv"], tolerance=0.01)
    assert printed(alone, capsys)[0] == (
        "PASS  early within tolerance against path; only 60.0 % of the reference was judged"
    )


def test_of_many_logs_those_that_fail_have_their_statistics(capsys: Captured) -> None:
    good = [write_path(f"good{i}.csv", Y_OFF) for i in range(3)]
    bad = [write_path(f"bad{i}.csv", Z_OFF * (1 + i / 10)) for i in range(7)]
    reference = write_path("path.csv", NOTHING_OFF)
    lines = printed(urmpipe.compare(reference, [*good, bad[0]]), capsys)
    assert [line for line in lines if line.endswith("against path")] == [
        "FAIL  1 of 4 logs (bad0) out of tolerance against path", "bad0 against path",
    ]  # fmt: skip
    assert lines[-1] == "Statistics of 3 more logs: --csv FILE, --json or the report."
    lines = printed(urmpipe.compare(reference, [*bad, *good]), capsys)
    assert [line for line in lines if line.endswith("against path")][1:] == [
        f"bad{i} against path" for i in (2, 3, 4, 5, 6)
    ]
    assert lines[-1] == "Statistics of 5 more logs: --csv FILE, --json or the report."
    assert printed(urmpipe.compare(reference, [*good, good[0]]), capsys)[-1] == (
        "Statistics of 4 more logs: --csv FILE, --json or the report."
    )


@pytest.mark.parametrize("width", [60, 80, 120, 300])
def test_tables_fit_the_terminal_and_no_column_is_lost(
    capsys: Captured, monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    monkeypatch.setattr(printing, "PIPE_WIDTH", width)
    assert new_console().width == width
    result = compared_arms()
    run = replace(result.runs[0], name="a name that is far too long for any table that is to be read")
    lines = printed(replace(result, runs=(run, result.runs[0])), capsys)
    tables = [
        line
        for number, line in enumerate(lines)
        if line.startswith("─") or any(other.startswith("─") for other in lines[number + 1 : number + 3])
    ]
    assert tables
    assert max(cell_len(line) for line in tables if not line.endswith("against wanted")) <= width
    heads = " ".join(tables)
    for head in ("Verdict", "max |Δx|", "max angle", "max joint", "decided", "speed)", "p95", "at start"):
        assert head in heads


def test_angles_are_in_degrees_and_columns_that_no_log_has_are_not_shown(capsys: Captured) -> None:
    result = compared_arms()
    again = replace(result.runs[0], name="again")
    lines = printed(replace(result, runs=(result.runs[0], again)), capsys)
    assert "max angle" in lines[4] and "max joint" in lines[4]
    assert "max slide" not in lines[4] and "longest" not in lines[4]
    said = "again: |Δ q1| = 0.0573 deg of 0.572958 deg allowed (10.0 % of the tolerance) at t = "
    assert lines[1].startswith(f"      {said}")
    path = write_path("path.csv", NOTHING_OFF)
    paths = urmpipe.compare(path, [write_path("a.csv", Y_OFF), write_path("b.csv", Y_OFF)])
    assert not {"angle", "joint", "speed)", "out"} & set(" ".join(printed(paths, capsys)[4:6]).split())


def test_joints_that_slide_have_a_column_of_their_own_in_mm(capsys: Captured) -> None:
    result = compared_arms()
    run = result.runs[0]
    sliding = replace(run.joint_statistics["q3"], unit="m", max=0.012)
    slides = replace(run, name="slides", joint_statistics={**run.joint_statistics, "q3": sliding})
    lines = printed(replace(result, runs=(run, slides)), capsys)
    head = next(line for line in lines if "max slide" in line)
    row = next(line for line in lines if line.startswith("slides "))
    assert row[head.index("max slide") : head.index("max slide") + 9].strip() == "12.0000"
    assert any(line.startswith("q3 [mm]") and "    10  " in line for line in lines)
    assert "  the tolerance of joints is in m where they slide: q3 10 mm" in lines


def test_how_the_clocks_were_put_together_is_said(capsys: Captured) -> None:
    run = compared_arms().runs[0]
    found = Sync("auto", 3.4, "joints", 0.00021, 0.99876)
    assert fact(replace(run, sync=found), "clocks", capsys) == [
        "clocks: t_reference = t_log + 3.4 s, estimated from joints, ± 0.21 ms, similarity 0.9988"
    ]
    assert fact(replace(run, sync=replace(found, precision=6.1e-8)), "clocks", capsys) == [
        "clocks: t_reference = t_log + 3.4 s, estimated from joints, ± 0.001 ms, similarity 0.9988"
    ]
    assert fact(replace(run, sync=Sync("given", -0.5)), "clocks", capsys) == [
        "clocks: t_reference = t_log - 0.5 s, as given"
    ]


def test_what_was_left_out_is_said_on_both_sides(capsys: Captured) -> None:
    run = replace(compared_arms().runs[0], left_out=1, reference_left_out=12)
    assert fact(run, "left out", capsys) == [
        "left out: 1 sample of the log, 12 samples of the reference outside its time"
    ]


def test_turns_that_are_counted_apart_are_said(capsys: Captured) -> None:
    run = replace(compared_arms().runs[0], joint_turns=(0, 1, 0, 0, 0, -2))
    assert fact(run, "whole turns", capsys) == [
        "whole turns counted apart at the start, taken out: q2 by +1, q6 by -2"
    ]


def test_how_a_log_was_moved_is_said(capsys: Captured) -> None:
    run = compared_arms().runs[0]
    turned = from_rpy(0.0, 0.0, 0.01).rotation
    moved = Alignment("rigid", turned, (0.1, 0.0, -0.0005))
    assert fact(replace(run, alignment=moved), "aligned", capsys) == [
        "aligned (rigid): turned by 0.5730 deg about the origin, then moved by (100.0000, 0.0000, -0.5000) mm"
    ]


def test_a_tool_that_was_found_is_advised_behind_the_one_that_is_there(capsys: Captured) -> None:
    run = compared_arms().runs[0]
    found = replace(run, alignment=Alignment("tool", tool=(0.001, 0.002, 0.0)))
    assert fact(found, "to have it", capsys) == ["to have it so from the start: --tool 0.001,0.002,0"]
    assert run.run.robot is not None
    quarter = run.run.robot.placed(tool=from_rpy(0.0, 0.0, math.pi / 2))
    turned = replace(found, run=replace(run.run, robot=quarter))
    # In the frame of a tool that is turned by 90 deg, x is the tip's y and y its -x.
    assert fact(turned, "to have it", capsys) == [
        "to have it so from the start: --tool -0.002,0.001,0,0,0,1.5707963"
    ]


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, math.pi / 2, 3.0, math.pi - 1e-9, math.pi])
def test_the_angle_of_a_rotation_is_exact_near_none_and_near_half_a_turn(angle: float) -> None:
    # 1e-15: two units in the last place of pi. An arc sine alone would lose half the digits there.
    rotation = from_rpy(angle, 0.0, 0.0).rotation
    assert Alignment("rigid", rotation).angle == pytest.approx(angle, abs=1e-15, rel=0.0)


def test_a_figure_shows_as_many_digits_as_tell_it_from_its_limit() -> None:
    assert number(0.0035000001, "m", 0.0035) == "3.5000001"
    assert number(math.radians(0.50000001), "rad", math.radians(0.5)) == "0.50000001"
    assert (number(math.radians(0.5), "rad"), number(None, "rad"), number(None, "m")) == ("0.5000", "–", "–")
    assert (limit(math.radians(0.5), "rad"), limit(0.0035, "m"), limit(None, "rad")) == ("0.5", "3.5", "–")
