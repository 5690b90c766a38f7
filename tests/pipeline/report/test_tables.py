"""The tables: what stands in their rows and columns."""

from __future__ import annotations

from dataclasses import replace

import pytest

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.symbols import size_of
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.repolarization.audit_entry import AuditEntry
from urmpipe_pipeline.report.log_tables import audit_table
from urmpipe_pipeline.report.page import lay_out
from urmpipe_pipeline.report.tables import Table
from urmpipe_pipeline.report.verdict_tables import ranking_tables, statistics_tables
from urmpipe_pipeline.runs.results import Run


def row_of(table: Table, name: str) -> dict[str, str]:
    """The texts of the row of that name, by the column's head."""
    (row,) = [row for row in table.rows if row[0].text == name]
    return {column.title: cell.text for column, cell in zip(table.columns, row, strict=True)}


def test_the_logs_are_ranked_from_best_to_worst(everything: Comparison) -> None:
    far, where = ranking_tables(everything, ["#a", "#b"])
    names = [run.name for run in everything.ranking]
    assert names == ["joint-off", "shifted"]  # given the other way round
    for table in (far, where):
        assert [(row[0].text, row[0].href) for row in table.rows] == list(
            zip(names, ("#a", "#b"), strict=True)
        )


def test_the_ranking_holds_every_kind_of_deviation(everything: Comparison) -> None:
    off = everything.ranking[0]
    far, _ = ranking_tables(everything, ["#a", "#b"])
    found = off.statistics
    joint = max(off.joint_statistics.values(), key=lambda one: one.max)
    assert row_of(far, "joint-off") == {
        "Log": "joint-off",
        "Verdict": "FAIL",
        "Decided by": size_of(off.decisive),
        "max |Δx| [mm]": text.millimetres(found["x"].max, 0.0035),
        "max |Δy| [mm]": text.millimetres(found["y"].max, 0.0035),
        "max |Δz| [mm]": text.millimetres(found["z"].max, 0.0035),
        "max ‖Δ‖ [mm]": text.millimetres(found["norm"].max, 0.005),
        "max path [mm]": text.millimetres(found["path"].max, 0.002),
        "max angle [deg]": text.number(found["angle"].max, "rad", 0.01),
        "max joint [deg]": text.number(joint.max, "rad", 0.002),
        "Share out": text.percent(off.share_out),
        "Covered": text.percent(everything.covered(off)),
    }
    failed = {cell.text for cell in far.rows[0] if cell.used == 1.0}
    assert failed == {cell.text for cell in far.rows[0][3:] if cell.state == "fail"}
    assert failed


def test_the_ranking_says_when_where_and_how(everything: Comparison) -> None:
    off = everything.ranking[0]
    _, where = ranking_tables(everything, ["#a", "#b"])
    longest = off.longest_out
    assert longest is not None
    assert row_of(where, "joint-off") == {
        "Log": "joint-off",
        "Decided at t [s]": text.seconds(off.decisive.t_max),
        "Log there at x, y, z [m]": text.point(off.place(off.decisive)),
        "Longest out [s]": text.seconds(longest.duration),
        "Longest out from t [s]": text.seconds(longest.t),
        "Sync offset [s]": "0.500",
        "r(‖Δ‖, speed)": f"{off.speed_correlation:+.3f}",
        "Left out": str(off.left_out),
        "Warnings": str(len(everything.warnings_of(off))),
        "Alignment": "none",
    }


def test_what_a_comparison_says_of_a_log_counts_as_its_warning(everything: Comparison) -> None:
    told = (
        LogWarning("not-covered", "joint-off: it covers 1 s of the 4 s of path (25 %)"),
        LogWarning("large-tolerance", "a tolerance of 500 mm (axis) lets anything pass"),
    )
    off = next(run for run in everything.runs if run.name == "joint-off")
    gap = LogWarning("gap", "a gap", 7)
    warned_off = replace(off, run=replace(off.run, warnings=(gap,)))
    runs = tuple(warned_off if run is off else run for run in everything.runs)
    warned = replace(everything, runs=runs, warnings=told)
    assert warned.warnings_of(warned_off) == (gap, told[0])
    links = [f"#{run.name}" for run in warned.ranking]
    _, where = ranking_tables(warned, links)
    assert row_of(where, "joint-off")["Warnings"] == "2"
    (summary,) = lay_out([warned]).summaries
    (facts,) = (one.facts for one in summary.cards if one.name == "joint-off")
    assert [fact.value for fact in facts if fact.name == "Warnings"] == ["2"]


def test_columns_without_a_value_are_not_there(comparison: Comparison) -> None:
    shifted = replace(comparison.runs[0], joint_statistics={}, speed_correlation=None)
    far, where = ranking_tables(replace(comparison, runs=(shifted,)), ["#a"])
    titles = [column.title for column in (*far.columns, *where.columns)]
    assert "max joint [mm]" not in titles
    assert "max joint [deg]" not in titles
    assert "Longest out [s]" not in titles
    assert "r(‖Δ‖, speed)" not in titles
    _, angles = statistics_tables(comparison.runs[0])
    assert [column.title for column in angles.columns] == [
        "Quantity",
        "max |Δ| [deg]",
        "at t [s]",
        "rms [deg]",
        "p95 |Δ| [deg]",
        "mean [deg]",
        "std [deg]",
        "at start [deg]",
    ]


def test_every_quantity_has_its_statistics_with_its_own_tolerance(everything: Comparison) -> None:
    off = everything.ranking[0]
    lengths, angles = statistics_tables(off)
    assert (lengths.title, angles.title) == (
        "Statistics of position and path",
        "Statistics of orientation and joints",
    )
    assert [row[0].text for row in lengths.rows] == ["Δx", "Δy", "Δz", "‖Δ‖", "path"]
    assert [row[0].text for row in angles.rows] == ["angle", *(f"phi{k}" for k in range(1, 7))]
    assert row_of(lengths, "path")["tolerance [mm]"] == "2"
    assert row_of(angles, "angle")["tolerance [deg]"] == "0.572958"
    phi2 = row_of(angles, "phi2")
    one = off.joint_statistics["phi2"]
    assert phi2["samples out"] == str(one.out_of_tolerance)
    assert phi2["share out"] == text.percent(one.share_out or 0.0)
    assert off.joint_delta is not None
    assert phi2["at start [deg]"] == text.number(float(off.joint_delta[0, 1]), "rad")


def test_prismatic_joints_stand_among_the_lengths(everything: Comparison) -> None:
    off = everything.ranking[0]
    joints = dict(off.joint_statistics)
    joints["phi6"] = replace(joints["phi6"], unit="m")
    lengths, angles = statistics_tables(replace(off, joint_statistics=joints))
    assert lengths.title == "Statistics of position, path and joints"
    assert [row[0].text for row in lengths.rows][-1] == "phi6"
    assert len(angles.rows) == 6


def test_a_joint_may_be_called_like_a_quantity(everything: Comparison) -> None:
    off = everything.ranking[0]
    joints = {"norm": replace(off.joint_statistics["phi2"], quantity="norm")}
    angles = statistics_tables(
        replace(
            off,
            joint_statistics=joints,
            joint_delta=(off.joint_delta if off.joint_delta is None else off.joint_delta[:, 1:2]),
        )
    )[1]
    assert [row[0].text for row in angles.rows] == ["angle", "norm"]


def test_a_long_audit_is_folded_and_a_very_long_one_cut(bare_run: Run) -> None:
    item = AuditEntry("phi1", 2, 0.0075, 0.0025, -6.28, 0, 1)
    short = audit_table(replace(bare_run, audit=(item,) * 12))
    folded = audit_table(replace(bare_run, audit=(item,) * 13))
    cut = audit_table(replace(bare_run, audit=(item,) * 700))
    assert (short.folded, folded.folded, cut.folded) == (False, True, True)
    assert (cut.title, len(cut.rows)) == ("Audit of the repolarizer (700 wraps)", 500)
    assert cut.note == "200 more; the JSON output lists them all."


def test_the_audit_says_what_its_kinds_mean(bare_run: Run) -> None:
    wrap = AuditEntry("phi1", 2, 0.0075, 0.0025, -6.28, 0, 1)
    table = audit_table(
        replace(bare_run, audit=(wrap, replace(wrap, kind="repaired"), replace(wrap, kind="ambiguous")))
    )
    assert [row[0].text for row in table.rows] == ["wrap", "repaired", "ambiguous"]
    assert table.title == "Audit of the repolarizer (1 wrap)"
    assert table.note == (
        "repaired: a sample that a linear resampling left on a wrap, put on the line of its neighbours, Step"
        " deg away. ambiguous: a gap in which the joint can have turned more than half a period."
    )
    assert table.rows[0][5].text == f"{-6.28 * 180 / 3.141592653589793:+.4f}"


@pytest.mark.parametrize("share", [0.2, 1.0])
def test_a_bar_is_as_long_as_what_is_used_up(comparison: Comparison, share: float) -> None:
    shifted = comparison.runs[0]
    found = dict(shifted.statistics)
    found["z"] = replace(found["z"], tolerance=found["z"].max / share)
    lengths, _ = statistics_tables(replace(shifted, statistics=found))
    (cell,) = [row[3] for row in lengths.rows if row[0].text == "Δz"]
    assert cell.used == pytest.approx(share)


def test_the_joint_that_is_furthest_off_stands_out(everything: Comparison) -> None:
    off = everything.ranking[0]
    (table,) = [one for one in statistics_tables(off) if "joints" in one.title]
    marked = [row[0].text for row in table.rows if any(cell.most for cell in row)]
    joint = off.furthest_joint("rad")
    assert joint is not None
    assert marked == [joint.quantity]
