"""How a log was put together with the reference, in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from urmpipe_models.inverse.targets import Targets
from urmpipe_models.robots.catalogue import load_robot, parse_offset
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Stretch
from urmpipe_pipeline.comparison.trajectory import Alignment, Sync
from urmpipe_pipeline.comparison.wording import tool_option
from urmpipe_pipeline.report import facts
from urmpipe_pipeline.solved_targets.drawn_run import Ghost, goals_of, row_times, solved_run

TURNED = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("sync", "value", "note"),
    [
        (Sync(), "both start together", "each from its first sample"),
        (
            Sync("given", -0.25),
            "-0.250 s",
            "as asked for; t of the reference = t of the log + this",
        ),
        (
            Sync("auto", 3.4, "position", 6.1e-8, 1.0),
            "+3.400 s ± 0.001 ms",
            "found by the motion of the position; t of the reference = t of the log + this;"
            " likeness of the motions there: 1.0000 of 1",
        ),
        (
            Sync("auto", 3.4, "joints", 1.25e-5, 0.99991),
            "+3.400 s ± 0.013 ms",
            "found by the motion of the joints; t of the reference = t of the log + this;"
            " likeness of the motions there: 0.9999 of 1",
        ),
    ],
)
def test_clocks_are_explained(comparison: Comparison, sync: Sync, value: str, note: str) -> None:
    found = facts.deviation_facts(replace(comparison.runs[0], sync=sync), comparison.reference)
    assert (found[0].name, found[0].value, found[0].note) == ("Clocks", value, note)


@pytest.mark.parametrize(
    ("alignment", "value", "note"),
    [
        (Alignment(), "none", "both stand where they say they stood"),
        (
            Alignment("start", translation=(0.003, 0.0, -0.004)),
            "start: moved by up to 5.0000 mm, turned by 0.0000 deg",
            "the first compared poses agree",
        ),
        (
            Alignment("tool", tool=(0.0, 0.0, 0.0025)),
            "tool moved by 2.5000 mm",
            "the constant offset of the tool centre point that fits best, as --tool 0,0,0.0025 does",
        ),
    ],
)
def test_alignments_are_explained(
    comparison: Comparison, alignment: Alignment, value: str, note: str
) -> None:
    found = facts.deviation_facts(replace(comparison.runs[0], alignment=alignment), comparison.reference)
    (told,) = [fact for fact in found if fact.name == "Alignment"]
    assert (told.value, told.note) == (value, note)


def test_a_rigid_motion_is_told_by_how_far_it_moves_and_turns(comparison: Comparison) -> None:
    deviation = comparison.runs[0]
    moved = deviation.actual @ np.array(TURNED).T + [0.0, 0.001, 0.0]
    aligned = replace(deviation, actual=moved, alignment=Alignment("rigid", TURNED, (0.0, 0.001, 0.0)))
    farthest = np.linalg.norm(moved - deviation.actual, axis=1).max()
    assert facts.alignment_value(aligned) == (
        f"rigid: moved by up to {farthest * 1e3:.4f} mm, turned by 90.0000 deg"
    )


def test_the_tool_option_repeats_a_tool_on_top_of_one_that_is_there() -> None:
    before = parse_offset("0.01,0,0.1,0,0,1.5707963267948966")
    arm = load_robot("urm6").placed(tool=before)
    option = tool_option(arm, Alignment("tool", tool=(0.002, 0.0, 0.0)))
    after = parse_offset(option.removeprefix("--tool "))
    wanted = before.point((0.002, 0.0, 0.0))
    # seven digits behind the point are printed
    np.testing.assert_allclose(np.array(after.translation), np.array(wanted), rtol=0, atol=5.1e-8)
    np.testing.assert_allclose(np.array(after.rotation), np.array(before.rotation), rtol=0, atol=1.1e-7)


def test_what_is_left_out_is_counted_on_both_sides(everything: Comparison) -> None:
    deviation = next(run for run in everything.runs if run.name == "shifted")
    told = facts.deviation_facts(deviation, everything.reference)
    (left,) = [fact.value for fact in told if fact.name == "Left out"]
    assert left == "100 of 3000 samples, 100 of 3000 of the reference"


def test_turns_counted_apart_are_told(comparison: Comparison) -> None:
    deviation = replace(comparison.runs[0], joint_turns=(0, 1, 0, -2, 0, 0))
    told = {fact.name: fact.value for fact in facts.deviation_facts(deviation, comparison.reference)}
    assert told["Turns"] == "phi2 +1, phi4 -2"
    assert "Turns" not in {
        fact.name for fact in facts.deviation_facts(comparison.runs[0], comparison.reference)
    }


def test_a_stretch_of_one_sample_has_no_length() -> None:
    assert facts.stretch(None) == ""
    assert facts.stretch(Stretch(1, 12, 0.06, 0.0)) == "1 sample at t = 0.060 s"
    assert facts.stretch(Stretch(3, 12, 0.06, 0.01)) == "0.010 s from t = 0.060 s"


def test_a_correlation_of_nearly_nothing_has_no_sign(comparison: Comparison) -> None:
    assert facts.speed_correlation(replace(comparison.runs[0], speed_correlation=-0.0001)) == "+0.000"
    assert facts.speed_correlation(replace(comparison.runs[0], speed_correlation=None)) == ""


def test_a_solved_run_tells_its_targets_and_its_branches() -> None:
    robot = load_robot("ur5e")
    q = np.array([[0.1, -1.2, 1.3, -0.4, 0.7, 0.3], [np.nan] * 6, [0.2, -1.2, 1.3, -0.4, 0.7, 0.3]])
    goals = goals_of(Targets(np.zeros((3, 3))), row_times(3), ["", "too far", ""])
    ghosts = [
        Ghost(name, row_times(3)[there], q[there] + 1) for name, there in (("up", [0, 2]), ("down", [2]))
    ]
    run = solved_run("targets", robot, None, q, goals=goals, ghosts=ghosts)
    told = {fact.name: fact.value for fact in facts.run_facts(run)}
    assert (told["Source"], told["Targets"]) == ("ik", "2 of 3 with a solution")
    assert told["Rows of other branches"] == "up: 2; down: 1"
    assert "Rows of other branches" not in {fact.name for fact in facts.run_facts(replace(run, ghosts=()))}
    log = facts.run_facts(replace(run, ghosts=(), goals=None))
    assert {"Targets", "Rows of other branches"}.isdisjoint(fact.name for fact in log)
