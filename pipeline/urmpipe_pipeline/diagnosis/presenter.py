"""Presentation of a diagnosis: the answer, what to do, tables of causes, and untested causes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from urmpipe_models.errors import Hint
from urmpipe_pipeline import text
from urmpipe_pipeline.diagnosis.cause_texts import (
    KIND_TEXTS,
    build_remedy,
    format_amount,
    format_cause,
    format_interval,
    format_value,
    short_name,
)
from urmpipe_pipeline.diagnosis.causes import Alternative, Cause, UnidentifiableCauses
from urmpipe_pipeline.diagnosis.result import (
    PASSES,
    Diagnosis,
    format_explanation,
    format_own_tcp,
    format_residual,
    format_undecided,
    select_causes,
)
from urmpipe_pipeline.presentation.parts import Heads, columns_of, table_of
from urmpipe_pipeline.presentation.section import Advice, Fact, Presentation, Section, Table, Value

NOTE = (
    "Each row: the rms before and after its cause is removed, with the causes above it removed already;"
    " and the rms if this cause alone is removed."
)

MAX_NAMED = 3  # equivalent causes, and kinds untested for one reason, in a line of a terminal
EXPLAINED = {"explanation": "Explanation", "interval": "95 % interval", "equivalents": "equivalent causes"}
DETAILS = ("value", "from_row", "rms_alone", "equivalents", "exceeds_tolerance")  # only in a page


def present(diagnosis: Diagnosis, hints: Sequence[Hint] = ()) -> Presentation:
    """Return the presentation of a diagnosis alone; a report and a recording show its comparison.

    Args:
        diagnosis: The diagnosis.
        hints: Parameters that remove causes.
    """
    untested = "; ".join(_untested(diagnosis, MAX_NAMED))
    facts = tuple(
        replace(fact, brief=fact.name != "Undecided")
        for fact in (*diagnosis_facts(diagnosis, hints)[1:-1], Fact("Not tested", untested))
    )
    tables = tuple(diagnosis_tables(diagnosis))
    body = Section(f"Diagnosis of {diagnosis.name}", None, facts, tables, warnings=diagnosis.warnings)
    headline = diagnosis.summary.removeprefix(PASSES)  # the verdict precedes it
    return Presentation(diagnosis.name, headline, diagnosis.verdict, (), body)


def diagnosis_facts(diagnosis: Diagnosis, hints: Sequence[Hint] = ()) -> tuple[Fact, ...]:
    """Return the answer, what to do, what is undecided, and what remains.

    Args:
        diagnosis: The diagnosis.
        hints: Parameters that remove causes.
    """
    undecided = format_undecided(diagnosis.undecided) if diagnosis.undecided else ""
    has_residual = diagnosis.causes or diagnosis.undecided  # else the answer says it
    residual = format_residual(diagnosis.unexplained, diagnosis.unit) if has_residual else ""
    single = diagnosis.causes[0] if len(diagnosis.causes) == 1 else None

    equivalents = ""
    if single and single.equivalents and not undecided:
        equivalents = " or ".join([short_name(single), *_shorten(single.equivalents, MAX_NAMED)])
    own_tcp = "; ".join(map(format_own_tcp, diagnosis.recorded_tcp))
    return (
        Fact("Diagnosis" if diagnosis.verdict == "pass" else "Cause", diagnosis.summary, leads=True),
        Fact("Remedy", _remedy(diagnosis, hints), brief=False, leads=True),
        Fact("95 % interval", format_interval(single) if single else "", brief=False, page=False),
        Fact("Undecided", undecided, brief=False, page=False),  # the cause and a table say it
        Fact("Equivalent causes", equivalents, page=False),  # tables have all of them
        Fact("Remaining deviation", residual, brief=False, page=False),
        Fact("Own TCP", "" if diagnosis.origin else own_tcp, brief=False),
        Fact("Not tested", "; ".join(_untested(diagnosis)), brief=False),
    )


def _remedy(diagnosis: Diagnosis, hints: Sequence[Hint]) -> Advice | None:
    """Return what to do about the causes of the answer; None without any, or if the answer says it."""
    if not diagnosis.causes or diagnosis.unexplained.is_unrelated_motion:
        return None
    if diagnosis.verdict == "pass":
        return Advice(hints=tuple(hints)) if hints else None
    remedies = [build_remedy(cause) for cause in select_causes(diagnosis.causes)]
    last = {remedy.place: k for k, remedy in enumerate(remedies)}  # a place is named once, after the last
    steps = [
        remedy.imperative() if last[remedy.place] == k else remedy._replace(place="").imperative()
        for k, remedy in enumerate(remedies)
    ]
    if diagnosis.undecided:
        steps.append(f"{format_amount(diagnosis.causes[-1].rms_after, diagnosis.unit)} rms then remains")
    return Advice("; ".join(steps), tuple(hints))


def _untested(diagnosis: Diagnosis, most: int | None = None) -> Iterator[str]:
    """Yield which kinds were not tested, and why; without the reason that the answer gives."""
    for untested in diagnosis.untested:
        if untested.reason != diagnosis.unexplained.interpretation:
            labels = [KIND_TEXTS[kind].label for kind in untested.kinds]
            yield f"{text.join_list(_shorten(labels, most))} ({untested.reason})"


def _shorten(names: Sequence[str], most: int | None) -> list[str]:
    """Return at most `most` names, and the number of the others."""
    more = 0 if most is None else len(names) - most
    return [*names[:most], f"{more} more"] if more > 1 else list(names)


def diagnosis_tables(diagnosis: Diagnosis) -> Iterator[Table]:
    """Yield the causes, the undecided explanations, and those that are not determined."""
    if diagnosis.causes:
        several = len(diagnosis.causes) > 1 or diagnosis.unexplained.is_unrelated_motion
        shown = several or bool(diagnosis.causes[0].low)  # the answer has all of a cause without an interval
        columns = (
            replace(column, brief=column.key not in DETAILS, page=column.key != "few_equivalents")
            for column in columns_of(diagnosis.causes, _heads(diagnosis.unit))
        )
        yield Table("Causes", tuple(columns), NOTE, several, page=shown)
    if diagnosis.undecided:
        heads = {**EXPLAINED, "discriminating_joint": "more motion of this decides"}
        rows = [(*_explained(each), each.discriminating_joint or "none") for each in diagnosis.undecided]
        table = table_of("Undecided between", heads, rows, brief=True)
        yield replace(table, columns=(*table.columns[:-1], replace(table.columns[-1], brief=False)))
    if diagnosis.unidentifiable:
        heads = {
            **EXPLAINED, "rms_after": "rms after", "reason": "reason",
            "discriminating_joint": "more motion of this determines it",
        }  # fmt: skip
        refused = [
            (
                *_explained(each), format_amount(each.causes[-1].rms_after, diagnosis.unit),
                each.reason, each.discriminating_joint or "none",
            )
            for each in diagnosis.unidentifiable
        ]  # fmt: skip
        yield table_of("Not determined by this motion", heads, refused)


def _explained(explanation: Alternative | UnidentifiableCauses) -> tuple[str, str, str]:
    """Return the causes of an explanation, their intervals, and their equivalents."""
    intervals = "; ".join(filter(None, map(format_interval, explanation.causes)))
    equivalents = ", ".join(name for cause in explanation.causes for name in cause.equivalents)
    return format_explanation(explanation), intervals, equivalents


def _heads(unit: str) -> Heads[Cause]:
    """Return the columns of causes; deviations are in the unit of the diagnosis."""
    return {
        "cause": ("Cause", format_cause),
        "value": ("value", format_value),
        "interval": ("95 % interval", format_interval),
        "from_row": (
            "from row",
            lambda cause: None if cause.from_sample is None else Value(cause.from_sample + 1),
        ),
        "rms_before": ("rms before", lambda cause: Value(cause.rms_before, unit)),
        "rms_after": ("rms after", lambda cause: Value(cause.rms_after, unit)),
        "rms_alone": ("without it alone", lambda cause: Value(cause.rms_alone, unit)),
        "few_equivalents": (
            "equivalent causes",
            lambda cause: ", ".join(_shorten(cause.equivalents, MAX_NAMED)),
        ),
        "equivalents": ("equivalent causes", lambda cause: ", ".join(cause.equivalents)),
        "exceeds_tolerance": (
            "alone out of tolerance",
            lambda cause: "yes" if cause.exceeds_tolerance else "no",
        ),
    }
