"""A compared log that was diagnosed: its cause beside the verdict, over time, in space and on the arm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from asserting import there
from diagnoses import LENGTH, SIGN, diagnosis_of
from made_runs import arms, off, paths
from presented import cells, facts, figures, scene_of
from urmpipe_models.errors import Hint
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.figures import cause_marks
from urmpipe_pipeline.comparison.presenter import decisive_facts
from urmpipe_pipeline.diagnosis.presenter import diagnosis_facts, diagnosis_tables
from urmpipe_pipeline.presentation.palette import AXIS_COLOURS, CORRECTED_COLOUR, DEVIATION_COLOUR
from urmpipe_pipeline.presentation.scene import ArmMark
from urmpipe_pipeline.presentation.section import Advice, Fact
from urmpipe_pipeline.results import present


def diagnosed(result: Comparison) -> Comparison:
    """Return a comparison of which each log has a diagnosis."""
    return replace(result, runs=tuple(replace(one, diagnosis=diagnosis_of(one)) for one in result.runs))


def test_its_cause_stands_under_the_verdict() -> None:
    result = diagnosed(paths({"log": off(0.5)}))
    shown = present(result)
    (section,) = shown.body.sections
    said = there(result.runs[0].diagnosis).summary
    assert [fact.name for fact in shown.facts][:2] == ["Cause", "Furthest out"]
    assert shown.facts[0].value == facts(section)["Cause"] == section.properties["cause"] == said


def test_a_log_out_of_tolerance_says_what_tells_its_cause() -> None:
    result = paths({"log": off(0.5), "near": off(0.001)})
    shown = present(result)
    far, near = shown.body.sections
    hint = Fact("Cause", Advice(hints=(Hint("diagnose", True, "says why"),)))
    assert replace(hint, page=False) in shown.facts[1:]  # behind what decided; a page says it at the log
    assert facts(far)["Cause"] == hint.value
    assert "Cause" not in facts(near)
    assert "cause" not in far.properties
    few = paths({"log": off(0.5, 9)}).runs[0]
    assert not [fact for fact in decisive_facts(few, "red") if fact.name == "Cause"]  # nor does a diagnosis
    aligned = replace(result.runs[0], alignment=replace(result.runs[0].alignment, mode="rigid"))
    (section, _) = present(replace(result, runs=(aligned, result.runs[1]))).body.sections
    assert "Cause" not in facts(section)  # a diagnosis is refused with an alignment


def test_causes_and_what_is_undecided_are_tables_and_what_was_not_looked_for_is_a_line() -> None:
    (section,) = present(diagnosed(paths({"log": off(0.01)}))).body.sections
    tables = {one.title: one for one in section.tables}
    assert list(tables)[:2] == ["Causes", "Undecided between"]
    assert facts(section)["Not tested"] == "orientation of the tool (the reference has no orientation)"
    assert cells(tables["Causes"]) == {
        "cause": ["module 3 (phi3) counter-rotates", "r_4 needs +1.2 mm from row 4 on"],
        "value": ["", "+1.2 mm"],
        "interval": ["", "+1.1 to +1.3 mm"],
        "from_row": [None, 4],
        "equivalents": ["", "d_5, tool shift z"],
        "rms_before": [SIGN.rms_before, LENGTH.rms_before],
        "rms_after": [SIGN.rms_after, LENGTH.rms_after],
        "rms_alone": [SIGN.rms_alone, LENGTH.rms_alone],
        "few_equivalents": ["", "d_5, tool shift z"],
        "exceeds_tolerance": ["yes", "no"],
    }
    undecided = cells(tables["Undecided between"])
    assert undecided["discriminating_joint"] == ["phi5", "phi5"]
    assert undecided["interval"][1] == "0.1089 to 0.1203 deg too low"


def test_one_cause_is_no_table_in_the_terminal() -> None:
    one = paths({"log": off(0.01)}).runs[0]
    several, alone = (replace(diagnosis_of(one), causes=causes) for causes in ((SIGN, LENGTH), (SIGN,)))
    assert [next(diagnosis_tables(found)).brief for found in (several, alone)] == [True, False]


def test_what_stays_is_said_only_beside_a_cause() -> None:
    found = diagnosis_of(paths({"log": off(0.01)}).runs[0])
    said = {fact.name: fact.value for fact in diagnosis_facts(found)}
    assert said["Remaining deviation"] == "rms 0.0574 mm: the digits of the log"
    empty = replace(found, causes=(), undecided=(), unidentifiable=())
    nothing = {fact.name: fact.value for fact in diagnosis_facts(empty)}
    assert nothing["Remaining deviation"] == ""
    assert str(nothing["Cause"]).startswith("no cause found: rms ")


def test_each_axis_is_drawn_mended_with_its_tolerance() -> None:
    result = diagnosed(paths({"log": off(0.01)}))
    one = result.runs[0]
    figure = figures(present(result).body.sections[0])[1]
    assert figure.beside
    (view,) = figure.views
    assert [panel.limit for panel in view.panels] == [0.0035] * 3
    assert [panel.close for panel in view.panels] == [np.abs(one.delta[::2, :3]).max() / 100.0] * 3
    for axis, panel in enumerate(view.panels):
        (mended,) = panel.lines
        assert mended.colours == (AXIS_COLOURS["xyz"[axis]],)
        np.testing.assert_array_equal(mended.values[:], one.delta[::2, axis] / 100.0)
        np.testing.assert_array_equal(mended.t_ns, one.t_ns[::2])


def test_joints_alone_are_drawn_one_by_one_beside_their_deviation() -> None:
    off_by = np.outer(np.linspace(0.0, 0.01, 60), np.arange(1.0, 7.0))
    result = arms({"log": off_by}, tolerance={"joint": 0.002})
    one = replace(result.runs[0], statistics={})
    joints = there(one.joint_delta)
    found = replace(diagnosis_of(one), unit="rad", sample=one.sample, residual=joints / 10.0)
    result = replace(result, runs=(replace(one, diagnosis=found),))
    deviation, mended, *_ = figures(present(result).body.sections[0])
    assert (deviation.title, mended.beside) == ("Deviation of joints", True)
    panels = mended.views[0].panels
    assert [panel.title for panel in panels] == [f"Δ q{k}" for k in range(1, 7)]
    assert {(panel.unit, panel.limit) for panel in panels} == {("rad", 0.002)}
    for k, panel in enumerate(panels):
        np.testing.assert_array_equal(panel.lines[0].values[:], joints[:, k] / 10.0)


def test_the_mended_path_lies_beside_the_reference_by_what_stays() -> None:
    result = diagnosed(paths({"log": off(0.01)}))
    one = result.runs[0]
    (mended,) = (path for path in scene_of(present(result)).paths if path.name == "without the causes")
    assert mended.colour == CORRECTED_COLOUR
    np.testing.assert_array_equal(mended.position, (one.reference - one.delta[:, :3] / 100.0)[::2])
    np.testing.assert_array_equal(mended.t_ns, one.t_ns[::2])


def test_what_is_named_is_marked_on_the_arm() -> None:
    (one,) = diagnosed(arms({"log": np.full((60, 6), 0.01)})).runs
    chain = there(one.run.robot)
    assert cause_marks(one, chain) == (
        ArmMark(2, "module 3 (phi3) counter-rotates", DEVIATION_COLOUR),
        ArmMark(4, "r_4 needs +1.2 mm from row 4 on", DEVIATION_COLOUR, segment=True),
    )
    assert scene_of(present(diagnosed(arms({"log": np.full((60, 6), 0.01)})))).arms[0].marks
    found = there(one.diagnosis)
    twice = replace(SIGN, kind="joint_offset", value=(0.1,), unit="rad")
    both = replace(one, diagnosis=replace(found, causes=(SIGN, twice)))
    assert [mark.words for mark in cause_marks(both, chain)] == [
        "module 3 (phi3) counter-rotates and module 3 (phi3) reads 5.7296 deg too low"
    ]


def test_without_a_cause_nothing_is_mended() -> None:
    result = paths({"log": off(0.01)})
    one = result.runs[0]
    nothing = replace(diagnosis_of(one), causes=(), undecided=())
    result = replace(result, runs=(replace(one, diagnosis=nothing),))
    assert not any(figure.beside for figure in figures(present(result).body.sections[0]))
    assert not any(path.name == "without the causes" for path in scene_of(present(result)).paths)
