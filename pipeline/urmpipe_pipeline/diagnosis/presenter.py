"""How a diagnosis shows itself: the answer, the causes, what is undecided, what was not looked for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from urmpipe_pipeline.diagnosis.result import Alternative, Cause, Diagnosis
from urmpipe_pipeline.diagnosis.wording import (
    KINDS,
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

ADDED = "Value: to be added to the robot or to the reading of the log, so that both sides agree."
ALONE = (
    "rms without it: remaining deviation if only this cause is removed. Share: of the mean square; all shares"
    " and the remainder make up 100 %. Below 0: the cause hides a part of another."
)


def present(result: Diagnosis) -> Presentation:
    """Return what a diagnosis alone shows; a report and a recording show the comparison that it stands in."""
    tables = tuple(diagnosis_tables(result))
    facts = tuple(replace(one, brief=one.name != "Undecided") for one in diagnosis_facts(result)[1:])
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
        Fact("Undecided", undecided, brief=False, page=False),  # the cause and a table say it
        Fact("Twins", "; ".join(_twins(result)), page=False),  # meaning or tables of a page say it
        Fact(
            "Remaining deviation",
            remainder_words(result.remainder, result.unit) if stays else "",
            brief=False,
            page=False,
        ),
        Fact("Not tested", "; ".join(_not_looked_for(result)), brief=False),
    )


def _twins(result: Diagnosis) -> Iterator[str]:
    """Yield causes with their twins, which the log does not tell from them."""
    for one in (*result.causes, *(cause for each in result.undecided for cause in each.causes)):
        if one.twins:
            yield f"{cause_words(one)}, or its twin {' or '.join(one.twins)}"


def _not_looked_for(result: Diagnosis) -> Iterator[str]:
    """Yield what these sides cannot tell, and why; not again what the answer gives as its reason."""
    for one in result.not_looked_for:
        if one.reason != result.remainder.words:
            yield f"{', '.join(KINDS.get(kind, kind) for kind in one.kinds)} ({one.reason})"


def diagnosis_tables(result: Diagnosis) -> Iterator[Table]:
    """Yield the causes, and the explanations that are not told apart."""
    if result.causes:
        several = len(result.causes) > 1 or result.remainder.different
        columns = columns_of(result.causes, _heads(result.unit))
        yield Table("Causes", columns, f"{ADDED} {ALONE}", several, page=several)
    if result.undecided:
        heads = {
            "explanation": "Explanation",
            "interval": "95 % interval",
            "twins": "twins",
            "needs": "a motion that would decide",
        }
        rows = [(explanation_words(one), *_of_causes(one), one.needs or "none") for one in result.undecided]
        yield table_of("Undecided between", heads, rows, brief=True)


def _of_causes(one: Alternative) -> tuple[str, str]:
    """Return the intervals and the twins of the causes of an explanation."""
    intervals = "; ".join(filter(None, map(interval_words, one.causes)))
    return intervals, ", ".join(twin for cause in one.causes for twin in cause.twins)


def _heads(unit: str) -> Heads[Cause]:
    """Return the columns of causes; deviations are in the unit of the diagnosis."""
    return {
        "cause": ("Cause", cause_words),
        "value": ("value", value_words),
        "interval": ("95 % interval", interval_words),
        "from_row": ("from row", lambda one: None if one.from_sample is None else Value(one.from_sample + 1)),
        "twins": ("twins", lambda one: ", ".join(one.twins)),
        "rms_before": ("rms before", lambda one: Value(one.rms_before, unit)),
        "rms_after": ("rms after", lambda one: Value(one.rms_after, unit)),
        "rms_alone": ("without it alone", lambda one: Value(one.rms_alone, unit)),
    }
