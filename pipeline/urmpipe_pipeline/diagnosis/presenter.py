"""How a diagnosis shows itself: the answer, the causes, what is undecided, what was not looked for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from urmpipe_pipeline.diagnosis.result import Cause, Diagnosis
from urmpipe_pipeline.diagnosis.wording import (
    KINDS,
    SAID,
    cause_words,
    explained,
    explanation_words,
    interval_words,
    remainder_words,
    undecided_words,
    value_words,
)
from urmpipe_pipeline.presentation.parts import Heads, columns_of, table_of
from urmpipe_pipeline.presentation.section import Fact, Presentation, Section, Table, Value

ADDED = "Value: the change of the robot or of the reading of the log that makes both sides agree."
ALONE = "rms without it: remaining deviation if only this cause is removed. Share: of the mean square."


def present(result: Diagnosis) -> Presentation:
    """Return what a diagnosis alone shows; a report and a recording show the comparison that it stands in."""
    tables = tuple(diagnosis_tables(result))
    facts = tuple(replace(one, brief=True) for one in diagnosis_facts(result)[1:])
    body = Section(f"Diagnosis of {result.name}", None, facts, tables, warnings=result.warnings)
    return Presentation(result.name, result.sentence, result.verdict, (), body)


def diagnosis_facts(result: Diagnosis) -> tuple[Fact, ...]:
    """Return the answer, what it means, what is undecided, and what stays."""
    alone = len(result.causes) == 1  # of several the table has interval and twins
    meant = [explained(one) for one in result.causes if alone or one.kind == "joint_sign"]
    meaning = "; ".join(one for one in meant if one not in result.sentence)
    undecided = undecided_words(result.undecided) if result.undecided else ""
    stays = result.causes or result.undecided  # else the answer says so
    return (
        Fact("Cause", result.sentence, leads=True),
        Fact("Meaning", meaning, brief=False, leads=True),
        Fact("Undecided", undecided, brief=False, page=False),  # the cause says it
        Fact(
            "Remaining deviation",
            remainder_words(result.remainder, result.unit) if stays else "",
            brief=False,
            page=False,
        ),
        Fact("Not tested", "; ".join(_not_looked_for(result)), brief=False),
    )


def _not_looked_for(result: Diagnosis) -> Iterator[str]:
    """Yield what these sides cannot tell, and why; not again what the answer gives as its reason."""
    for one in result.not_looked_for:
        if one.reason != result.remainder.words:
            yield f"{', '.join(KINDS.get(kind, kind) for kind in one.kinds)} ({one.reason})"


def diagnosis_tables(result: Diagnosis) -> Iterator[Table]:
    """Yield the causes, and the explanations that are not told apart."""
    if result.causes:
        several = len(result.causes) > 1
        columns = columns_of(result.causes, _heads(result.unit))
        yield Table("Causes", columns, f"{ADDED} {ALONE}", several, page=several)
    if result.undecided:
        heads = {"explanation": "Explanation", "needs": "a motion that would decide"}
        rows = [(explanation_words(one), one.needs or "none") for one in result.undecided]
        many = len(rows) > SAID  # else the answer names them all
        yield replace(table_of("Undecided between", heads, rows, brief=many), page=many)


def _heads(unit: str) -> Heads[Cause]:
    """Return the columns of causes; deviations are in the unit of the diagnosis."""
    return {
        "cause": ("Cause", cause_words),
        "value": ("value", value_words),
        "interval": ("95 % interval", interval_words),
        "from_row": ("from row", lambda one: None if one.from_sample is None else Value(one.from_sample + 1)),
        "twins": ("twins", lambda one: ", ".join(one.twins)),
        "rms_after": ("rms without it", lambda one: Value(one.rms_after, unit)),
        "share": ("share", lambda one: Value(one.share, "%")),
    }
