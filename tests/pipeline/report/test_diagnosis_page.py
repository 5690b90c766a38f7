"""A diagnosis in a report: its answer right under the verdict, its tables, its figure."""

from __future__ import annotations

from dataclasses import replace

from asserting import there
from diagnoses import diagnosis_of
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.report.page import lay_out
from urmpipe_pipeline.report.spec import Figure
from urmpipe_pipeline.report.tables import Grid
from urmpipe_pipeline.results import present


def test_its_parts_stand_where_they_are_read_first(comparison: Comparison) -> None:
    runs = [replace(one, diagnosis=diagnosis_of(one)) for one in comparison.runs]
    result = replace(comparison, runs=tuple(runs))
    page = lay_out([present(result)])
    said = there(result.worst.diagnosis).summary
    assert [fact.value for fact in page.banner.facts if fact.leads] == [said]  # seen without scrolling
    (part,) = (one for one in page.parts[0].parts if one.title == result.worst.name)
    assert (part.facts[0].name, part.facts[0].value.split(" (")[0]) == (
        "Remedy",
        "reverse the sign of module 3",
    )
    assert said not in [fact.value for fact in part.facts]
    assert not part.folded
    assert isinstance(part.blocks[0], Figure)
    grids = [block for block in part.blocks if isinstance(block, Grid)]
    assert [(one.title, one.folded) for one in grids[:4]] == [
        ("Causes", False), ("Undecided between", False), ("Not determined by this motion", False),
        ("Statistics of position and path", False),
    ]  # fmt: skip
    assert [one.text for one in grids[0].rows[1]] == [
        "r_4 needs +1.2 mm from row 4 on", "+1.2 mm", "+1.1 to +1.3 mm", "4",
        "1.500", "1.000", "399.5", "d_5, tool shift z", "no",
    ]  # fmt: skip
    figures = [block.title for block in part.blocks if isinstance(block, Figure)]
    assert figures[:2] == ["Deviation over time", "Deviation of joints"]


def test_a_log_that_passes_has_no_cause_in_the_banner(comparison: Comparison) -> None:
    passed = replace(next(one for one in comparison.runs if one.verdict == "pass"))
    diagnosis = replace(diagnosis_of(passed), recorded_tcp=(), origin="")
    page = lay_out([present(replace(comparison, runs=(replace(passed, diagnosis=diagnosis),)))])
    assert not [fact for fact in page.banner.facts if fact.leads]
    (part,) = page.parts[0].parts
    assert part.facts[0].value == diagnosis.summary
    assert diagnosis.summary.startswith("passes; ")
