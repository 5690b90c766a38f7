"""What a minute is enough to read: the banner and the cards."""

from __future__ import annotations

from dataclasses import replace

import pytest

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.change import Absent, BaselineComparison
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.report.banner import Banner, comparison_banner, ingested_banner, joined
from urmpipe_pipeline.report.cards import card
from urmpipe_pipeline.runs.results import Run

LINKS = (("#a", "#b"),)

PATH = "path, by the joints on both sides"
"""What both are held against, and how."""


def test_a_banner_of_a_log_that_passes_says_how_close_when_and_where(comparison: Comparison) -> None:
    shifted = comparison.runs[0]
    said = comparison_banner([replace(comparison, runs=(shifted,))], [["#a"]])
    assert (said.state, said.word, said.headline) == (
        "pass",
        "PASS",
        f"shifted within tolerance against {PATH}",
    )
    z = shifted.statistics["z"]
    index = shifted.sample.tolist().index(z.sample_max)
    x, y, height = shifted.actual[index]
    assert [(fact.name, fact.value, fact.href) for fact in said.facts] == [
        ("Closest to the limit", "shifted", "#a"),
        ("How much", "|Δz| = 2.5000 mm of 3.5 mm allowed", ""),
        ("When", f"t = {text.seconds(z.t_max)} s", ""),
        ("Where the log was (x, y, z)", f"{x:.4f}, {y:.4f}, {height:.4f} m", ""),
        ("Reference", "path", ""),
        ("Tolerance", "±3.5 mm per axis", ""),
    ]


def test_a_banner_of_logs_that_fail_names_the_worst(comparison: Comparison) -> None:
    said = comparison_banner([comparison], LINKS)
    worst = comparison.runs[1].decisive
    assert said.headline == f"1 of 2 logs (joint-off) out of tolerance against {PATH}"
    assert (said.facts[0].name, said.facts[0].value, said.facts[0].href) == (
        "Furthest out",
        "joint-off",
        "#b",
    )
    assert said.facts[1].value.startswith(f"|Δ{worst.quantity}| = {worst.max * 1e3:.4f} mm of 3.5 mm")
    every = replace(comparison, runs=comparison.runs[1:] * 2)
    assert comparison_banner([every], LINKS).headline == f"both logs out of tolerance against {PATH}"
    many = replace(comparison, runs=comparison.runs[1:] * 4)
    assert comparison_banner([many], ("abcd",)).headline == f"all 4 logs out of tolerance against {PATH}"


def test_a_banner_names_the_joint_that_is_furthest_off(comparison: Comparison) -> None:
    off = comparison.runs[1]
    joint = off.furthest_joint("rad")
    assert joint is not None and off.decisive.kind == "axis"
    told = {fact.name: fact.value for fact in comparison_banner([comparison], LINKS).facts}
    assert told["Joint furthest off"] == f"phi2: {text.quantity(joint.max, 'rad')}"


@pytest.mark.parametrize(
    ("which", "said"),
    [
        (0, f"shifted within tolerance against {PATH}, but worse than the baseline before"),
        (1, f"joint-off out of tolerance against {PATH}, and worse than the baseline before"),
    ],
)
def test_a_banner_says_that_a_comparison_is_worse_than_its_baseline(
    comparison: Comparison, which: int, said: str
) -> None:
    gone = BaselineComparison("before", None, {}, (), (), (Absent("old"),), ())
    held = replace(comparison, runs=(comparison.runs[which],), baseline=gone)
    found = comparison_banner([held], [["#a"]])
    assert (found.state, found.word, found.headline) == ("fail", "FAIL", said)


def test_a_banner_of_some_comparisons_counts_those_that_are_worse_than_their_baselines(
    comparison: Comparison,
) -> None:
    gone = BaselineComparison("before", None, {}, (), (), (Absent("old"),), ())
    good = replace(comparison, runs=comparison.runs[:1])
    bad = replace(comparison, runs=comparison.runs[1:])
    worse = replace(good, baseline=gone)
    every, one = (
        f"both logs within tolerance against {PATH}",
        f"1 of 2 logs (joint-off) out of tolerance against {PATH}",
    )
    for some, said in (
        ([good, worse], f"{every}, but 1 of 2 comparisons is worse than its baseline"),
        ([worse, worse], f"{every}, but 2 of 2 comparisons are worse than their baselines"),
        ([bad, worse], f"{one}, and 1 of 2 comparisons is worse than its baseline"),
        ([good, bad], one),
    ):
        found = comparison_banner(some, [["#a"], ["#b"]])
        assert (found.headline, found.word) == (said, "FAIL")


def test_what_was_recorded_is_on_both_sides_also_of_a_path(comparison: Comparison) -> None:
    options = {**comparison.provenance.options, "tcp": "recorded"}
    run = comparison.runs[0]
    path = replace(run, run=replace(run.run, log=replace(run.run.log, joints=())))
    recorded = replace(comparison, runs=(path,), provenance=replace(comparison.provenance, options=options))
    assert comparison_banner([recorded], [["#a"]]).headline == (
        "shifted within tolerance against path, as recorded on both sides"
    )


def test_a_banner_of_some_comparisons_counts_their_logs(
    comparison: Comparison, everything: Comparison
) -> None:
    said = comparison_banner([comparison, everything], LINKS * 2)
    assert said.headline == (
        f"3 of 4 logs (joint-off, shifted, joint-off) out of tolerance against {PATH}; 2 logs cover only a"
        " part of the reference"
    )
    assert [fact.value for fact in said.facts[-2:]] == ["path", "as each comparison says"]


def test_a_banner_without_a_comparison(bare_run: Run) -> None:
    said = ingested_banner([bare_run])
    count = len(bare_run.repolarizations)
    assert said.word == "INGESTED"
    assert said.headline == f"bare: 3000 rows, {count} repolarizations"
    assert said.detail == "0 warnings. Nothing was compared: there is no verdict."
    assert said.facts == ()


FAILS, PASSES = (
    Banner("fail", "FAIL", "poses: 2 of 3", detail="1 jump."),
    Banner("pass", "PASS", "log within"),
)
NOTHING_JUDGED = Banner("ingested", "SIMULATED", "one-drive: 401 samples", detail="Nothing was judged.")


def test_of_several_kinds_of_results_none_hides_behind_another() -> None:
    said = joined([PASSES, NOTHING_JUDGED, FAILS])
    assert (said.state, said.headline) == ("fail", "poses: 2 of 3")
    assert said.detail == "1 jump. PASS: log within. SIMULATED: one-drive: 401 samples."
    assert joined([NOTHING_JUDGED, FAILS, PASSES]) == said
    said = joined([NOTHING_JUDGED, PASSES])
    assert (said.state, said.detail) == ("pass", "SIMULATED: one-drive: 401 samples.")
    said = joined([FAILS, replace(FAILS, headline="log out")])
    assert (said.headline, said.detail) == ("poses: 2 of 3", "1 jump. FAIL: log out. 1 jump.")
    assert joined([NOTHING_JUDGED]) == NOTHING_JUDGED


def test_a_card_holds_what_decides_and_the_rest(everything: Comparison) -> None:
    deviation = next(run for run in everything.runs if run.name == "joint-off")
    decisive, found = deviation.decisive, card(deviation, "#x", 0.25, 2)
    assert (found.name, found.href, found.state) == ("joint-off", "#x", "fail")
    assert decisive.used is not None
    assert found.share == 1.0
    assert found.used == f"{decisive.used:.3g} times the tolerance"
    facts = {fact.name: fact.value for fact in found.facts}
    longest = deviation.longest_out
    assert longest is not None
    assert facts["Longest out"] == f"{text.seconds(longest.duration)} s from t = {text.seconds(longest.t)} s"
    assert facts["Clocks"] == "+0.500 s"
    assert facts["Alignment"] == "none"
    assert facts["Largest ‖Δ‖"] == f"{deviation.statistics['norm'].max * 1e3:.4f} mm"
    assert facts["Largest angle"] == text.quantity(deviation.statistics["angle"].max, "rad", 0.01)
    assert facts["Largest joint"] == f"{text.quantity(deviation.joint_statistics['phi2'].max, 'rad')} (phi2)"
    assert facts["Out of tolerance"] == text.percent(deviation.share_out)
    assert facts["Covered"] == "25.0 % of the reference"
    assert facts["Warnings"] == "2"


def test_a_card_leaves_out_what_there_is_not(comparison: Comparison) -> None:
    deviation = replace(
        comparison.runs[0],
        statistics={
            name: one for name, one in comparison.runs[0].statistics.items() if name != "angle"
        },
        joint_statistics={},
        speed_correlation=None,
    )  # fmt: skip
    found = card(deviation, "#x", 0.25, 2)
    assert [fact.name for fact in found.facts] == [
        "When",
        "Where (x, y, z)",
        "Covered",
        "Largest ‖Δ‖",
        "Off the path",
        "Out of tolerance",
        "Clocks",
        "Alignment",
        "Warnings",
    ]
    assert (found.allowed, found.used) == ("3.5 mm", "71.4 % of the tolerance")
