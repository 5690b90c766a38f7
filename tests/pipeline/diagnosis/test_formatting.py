# ruff: noqa: E501 - the tables of texts have a text per line
"""A diagnosis in words: each kind of cause with its remedy and short name, and every form of the sentence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, get_args

import numpy as np
import pytest

from diagnoses import BASE, LENGTH, OFFSET, SIGN
from urmpipe_pipeline.diagnosis.cause_texts import (
    KIND_TEXTS,
    build_remedy,
    format_amount,
    format_cause,
    format_interval,
    format_rows,
    short_name,
)
from urmpipe_pipeline.diagnosis.causes import (
    Alternative,
    Cause,
    Kind,
    RecordedTcpCheck,
    Unexplained,
    UnidentifiableCauses,
    UntestedCauses,
)
from urmpipe_pipeline.diagnosis.presenter import diagnosis_facts, present
from urmpipe_pipeline.diagnosis.result import Diagnosis
from urmpipe_pipeline.presentation.section import Advice

DEG = np.pi / 180.0
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
THREE = (0.001, -0.002, 0.0001)


def of_joint(kind: Any, name: str, *value: float, unit: str = "", **fields: Any) -> Cause:
    """Return a cause of one joint, or of two, that the log names otherwise."""
    return Cause(kind, name, ("a", "b")[: 1 + (" and " in name)], value=value, unit=unit, **fields)


def number(kind: Any, name: str, *value: float, unit: str = "m", **fields: Any) -> Cause:
    """Return a cause with numbers that is of no joint."""
    return Cause(kind, name, value=value, unit=unit, **fields)


COUPLED = "elbow_joint and shoulder_lift_joint"
TEXTS: Sequence[tuple[Cause, str, str, str]] = [
    (SIGN, "module 3 (phi3) counter-rotates", "module 3 (phi3) were counted the other way", "sense of phi3"),
    (of_joint("joint_sign", "q3"), "joint q3 rotates in reverse", "joint q3 were counted the other way", "sense of q3"),
    (of_joint("joints_swapped", "phi2 and phi4"), "modules 2 (phi2) and 4 (phi4) are exchanged", "modules 2 (phi2) and 4 (phi4) were exchanged with each other", "exchange of phi2 and phi4"),
    (of_joint("joints_swapped", "Joint1 and Joint2"), "Joint1 and Joint2 are exchanged", "Joint1 and Joint2 were exchanged with each other", "exchange of Joint1 and Joint2"),
    (of_joint("half_turn", "q1", from_sample=0), "joint q1 needs half a turn", "joint q1 were turned by half a turn", "half a turn of q1"),
    (of_joint("mirrored", "q1", from_sample=12), "joint q1 is mirrored from row 13 on", "joint q1 were counted the other way from row 13 on", "mirrored q1"),
    (of_joint("turns", "q1", -2.0, unit="turns", from_sample=12), "joint q1 needs -2 turns from row 13 on", "joint q1 were turned by -2 turns from row 13 on", "turns of q1"),
    (OFFSET, "module 1 (phi1) reads 0.1146 deg too low", "module 1 (phi1) were corrected by +0.1146 deg", "offset of phi1"),
    (of_joint("joint_offset", "slide", -0.0025, unit="m"), "joint slide reads 2.5 mm too high", "joint slide were corrected by -2.5 mm", "offset of slide"),
    (of_joint("joint_scale", "q1", 1.0125), "joint q1 needs a factor of 1.0125", "joint q1 were multiplied by 1.0125", "scale of q1"),
    (of_joint("joint_unit", "q1", DEG), "joint q1 is in deg, read as rad", "joint q1 were read in deg", "unit of q1"),
    (of_joint("joint_unit", "q1", 1.0 / DEG), "joint q1 is in rad, read as deg", "joint q1 were read in rad", "unit of q1"),
    (of_joint("joint_coupled", COUPLED, -1.0), "elbow_joint includes shoulder_lift_joint", "shoulder_lift_joint were subtracted from elbow_joint", f"coupling of {COUPLED}"),
    (of_joint("joint_coupled", COUPLED, 1.0), "elbow_joint includes the negative of shoulder_lift_joint", "shoulder_lift_joint were added to elbow_joint", f"coupling of {COUPLED}"),
    (of_joint("joint_lag", "q3", -0.0165, unit="s"), "joint q3 is 16.5 ms late", "the times of joint q3 were made 16.5 ms earlier", "lag of q3"),
    (number("servo_lag", "all joints", 0.03, unit="s"), "all joints lag by 30 ms, as a servo does", "the servo lag of 30 ms were compensated", "servo lag"),
    (number("servo_lag", "all joints", -0.03, unit="s"), "all joints are ahead by 30 ms", "all joints were delayed by 30 ms", "servo lag"),
    (of_joint("sag", "slide", 1e-5, unit="m/N"), "joint slide sags by 0.01 mm/N", "joint slide were corrected for a sag of 0.01 mm/N", "sag of slide"),
    (of_joint("compliance", "q1", 1.3e-4, unit="s2"), "joint q1 is compliant: +0.00013 s2 of its acceleration", "joint q1 were corrected by +0.00013 s2 of its acceleration", "compliance of q1"),
    (of_joint("backlash", "q1", 0.2 * DEG, unit="rad"), "joint q1 has a backlash of 0.2 deg", "joint q1 were corrected for a backlash of 0.2 deg", "backlash of q1"),
    (of_joint("sag", "q2", 0.01 * DEG, unit="rad/(N m)"), "joint q2 sags by 0.01 deg/(N m)", "joint q2 were corrected for a sag of 0.01 deg/(N m)", "sag of q2"),
    (of_joint("sag", "q2", 0.01 * DEG, unit="rad/kg"), "joint q2 sags by 0.01 deg/kg, like gravity", "joint q2 were corrected for a sag of 0.01 deg/kg", "sag of q2"),
    (LENGTH, "r_4 needs +1.2 mm from row 4 on", "r_4 were changed by +1.2 mm from row 4 on", "r_4"),
    (number("tilt", "theta_4", -0.1 * DEG, unit="rad"), "theta_4 needs -0.1 deg", "theta_4 were changed by -0.1 deg", "theta_4"),
    (number("link_shift", "segment 4 sideways y", 0.003, segment="p4", axis=Y), "segment 4 needs +3 mm sideways (y)", "segment 4 were moved by +3 mm sideways (y)", "segment 4 sideways y"),
    (Cause("own_geometry", "arm"), "the arm's own geometry, as a calibration finds it", "the arm were calibrated", "own geometry"),
    (number("base_shift", "base", *THREE), "the base needs (+1, -2, +0.1) mm", "the base were moved by (+1, -2, +0.1) mm", "base shift"),
    (BASE, "the base needs a turn of (0, 0, +0.1146) deg", "the base were turned by (0, 0, +0.1146) deg", "base rotation"),
    (number("base_rotation", "base", np.pi, unit="rad", axis=Z), "the base needs a turn of 180 deg about z", "the base were turned by 180 deg about z", "base rotation z"),
    (number("tool_shift", "tool", 0.0003, axis=Y), "the tool centre point needs +0.3 mm in y", "the tool centre point were moved by +0.3 mm in y", "tool shift y"),
    (number("tool_shift", "tool", *THREE, low=(0.0, -0.003, -0.012), high=(0.002, -0.001, 0.0122)), "the tool centre point needs +1 mm in x and -2 mm in y (z is not determined by this motion, ±12 mm)", "the tool centre point were moved by +1 mm in x and -2 mm in y (z is not determined by this motion, ±12 mm)", "tool shift"),
    (number("tool_rotation", "tool", 0.01, unit="rad", axis=(0.0, -1.0, 0.0)), "the tool needs a turn of +0.573 deg about -y", "the tool were turned by +0.573 deg about -y", "tool rotation -y"),
    (Cause("base_mirrored", "(x, y, -z)"), "the base is mirrored: z has the opposite sign", "x, y, z of the base were taken as (x, y, -z)", "mirrored base (x, y, -z)"),
    (Cause("base_mirrored", "(y, x, z)"), "the base is mirrored: x and y are exchanged", "x, y, z of the base were taken as (y, x, z)", "mirrored base (y, x, z)"),
    (Cause("base_mirrored", "(y, x, -z)"), "the base is mirrored: its x, y, z are (y, x, -z)", "x, y, z of the base were taken as (y, x, -z)", "mirrored base (y, x, -z)"),
    (number("path_unit", "log in inch", 0.0254, unit=""), "the positions of the log are in inch, read as m", "the positions of the log were read in inch", "log in inch"),
    (number("time_lag", "clock", -0.03, unit="s"), "the clocks differ by 30 ms (the log is late)", "the times of the log were made 30 ms earlier", "clock offset"),
    (number("time_lag", "clock", 1.35, unit="s"), "the clocks differ by 1.35 s (the log is early)", "the times of the log were made 1.35 s later", "clock offset"),
    (number("clock_drift", "clock", 1.2e-4, unit="s/s"), "the log's clock runs 0.12 ms/s slow", "the clock of the log were corrected for running 0.12 ms/s slow", "clock drift"),
    (Cause("other_robot", "ur5e"), "another arm fits: ur5e", "ur5e were used as the robot", "ur5e"),
    (number("outliers", "rows", 0.245, rows=(1, 2)), "rows 2 and 3 are off by 245 mm", "rows 2 and 3 were left out", "outliers"),
]  # fmt: skip


@pytest.mark.parametrize(("cause", "clause", "remedy", "short"), TEXTS)
def test_a_cause_has_a_clause_a_remedy_and_a_short_name(
    cause: Cause, clause: str, remedy: str, short: str
) -> None:
    assert (format_cause(cause), build_remedy(cause).conditional(), short_name(cause)) == (
        clause, remedy, short,
    )  # fmt: skip


def test_every_kind_has_its_texts() -> None:
    assert set(KIND_TEXTS) == set(get_args(Kind)) == {cause.kind for cause, *_ in TEXTS}


@pytest.mark.parametrize(
    ("cause", "interval"),
    [
        (LENGTH, "+1.1 to +1.3 mm"),
        (OFFSET, "0.1089 to 0.1203 deg too low"),
        (replace(OFFSET, value=(-0.002,), low=(-0.0021,), high=(-0.0019,)), "0.1089 to 0.1203 deg too high"),
        (number("time_lag", "clock", -1.35, unit="s", low=(-1.36,), high=(-1.34,)), "1.34 to 1.36 s late"),
        (
            number("tool_shift", "tool", *THREE, low=(0.0, -0.003, -0.012), high=(0.002, -0.001, 0.0122)),
            "x 0 to +2 mm; y -3 to -1 mm; z not determined by this motion (±12 mm)",
        ),
        (SIGN, ""),
    ],
)
def test_an_interval_has_the_sign_of_the_clause(cause: Cause, interval: str) -> None:
    assert format_interval(cause) == interval


@pytest.mark.parametrize(
    ("value", "unit", "expected"),
    [
        (0.41657442, "m", "416.57 mm"), (1.25e-7, "m", "0.0001 mm"), (4e-8, "m", "4e-05 mm"), (2e-15, "rad", "0 deg"),
        (0.0, "m", "0 mm"), (12.3456, "m", "12346 mm"), (0.01, "rad", "0.573 deg"),
    ],
)  # fmt: skip
def test_an_amount_has_five_digits_four_of_them_decimals_unless_it_is_less(
    value: float, unit: str, expected: str
) -> None:
    assert format_amount(value, unit) == expected


@pytest.mark.parametrize(
    ("samples", "expected"),
    [
        ([4], "row 5"), ([1, 2], "rows 2 and 3"), ([1, *range(119, 190)], "rows 2 and 120 to 190"),
        (range(0, 40, 2), "rows 1, 3, 5, 7, 9, 11 and 14 more ranges"),
    ],
)  # fmt: skip
def test_rows_are_counted_from_one_in_ranges(samples: Sequence[int], expected: str) -> None:
    assert format_rows(samples) == expected


def chain(*causes: Cause, last: float = 0.0002, **fields: Any) -> Diagnosis:
    """Return a diagnosis of 40 rows off by 300 mm, of which each cause takes as many times as another."""
    left = np.geomspace(0.3, last, len(causes) + 1).tolist()
    ordered = tuple(
        replace(cause, rms_before=before, rms_after=after)
        for cause, before, after in zip(causes, left, left[1:], strict=False)
    )
    stays = fields.pop("unexplained", Unexplained(last))
    verdict = fields.pop("verdict", "fail")
    undecided = fields.pop("undecided", ())
    return Diagnosis(
        "log",
        verdict,
        40,
        "m",
        0.3,
        ordered,
        undecided,
        (),
        stays,
        np.arange(40),
        np.zeros((40, 3)),
        **fields,
    )


def off_by(*left: float, **fields: Any) -> Diagnosis:
    """Return a diagnosis of joints that read too high, with the rms in [m] before the first and after each."""
    steps = zip(HIGH, left, left[1:], strict=False)
    causes = [replace(cause, rms_before=before, rms_after=after) for cause, before, after in steps]
    return replace(chain(last=left[-1], **fields), causes=tuple(causes))


LATE = number("time_lag", "clock", -1.35, unit="s", exceeds_tolerance=True)
DRIFT = number("clock_drift", "clock", 1e-4, unit="s/s")
WRONG_ROWS = number("outliers", "rows", 0.245, rows=(1, 2))
UNDECIDED = tuple(Alternative((cause,), "phi5") for cause in (BASE, OFFSET, LENGTH))
DIFFERENT = Unexplained(0.19238, "more than half", is_unrelated_motion=True)
HIGH = [of_joint("joint_offset", f"q{k}", -k * DEG, unit="rad") for k in range(1, 7)]
BREAKING = [replace(cause, exceeds_tolerance=k in (0, 3, 4, 5)) for k, cause in enumerate(HIGH)]
BOTH_TCP = (
    RecordedTcpCheck("robot", 5e-5, 1e-4, agrees=True),
    RecordedTcpCheck("sim", 0.01, 0.02, agrees=False),
)

SENTENCES: Sequence[tuple[Callable[[], Diagnosis], str]] = [
    (lambda: chain(SIGN), "module 3 (phi3) counter-rotates: rms 300 mm -> 0.2 mm"),
    (lambda: chain(LATE), "the clocks differ by 1.35 s (the log is late): rms 300 mm -> 0.2 mm"),
    (lambda: chain(SIGN, OFFSET, last=0.003), "module 3 (phi3) counter-rotates: rms 300 -> 30 mm; then module 1 (phi1) reads 0.1146 deg too low: 30 -> 3 mm"),
    (lambda: chain(LATE, OFFSET, last=0.003), "the clocks differ by 1.35 s (the log is late); after that 30 mm rms; then module 1 (phi1) reads 0.1146 deg too low: 30 -> 3 mm"),
    (lambda: chain(LATE, DRIFT, last=0.003), "the clocks differ by 1.35 s (the log is late) and the log's clock runs 0.1 ms/s slow: rms 300 mm -> 3 mm"),
    (lambda: chain(*HIGH[:4], last=3e-5), "joint q1 reads 1 deg too high: rms 300 -> 30 mm; then joint q2 reads 2 deg too high: 30 -> 3 mm; then joint q3 reads 3 deg too high: 3 -> 0.3 mm; 1 more in the table"),
    (lambda: chain(*BREAKING, last=3e-7), "joint q1 reads 1 deg too high: rms 300 -> 30 mm; then joint q4 reads 4 deg too high: 0.3 -> 0.03 mm; then joint q5 reads 5 deg too high: 0.03 -> 0.003 mm; then joint q6 reads 6 deg too high: 0.003 -> 0.0003 mm; 2 more in the table"),
    (lambda: chain(WRONG_ROWS), "rows 2 and 3 are off by 245 mm; the other 38 agree within 0.2 mm rms"),
    (lambda: chain(WRONG_ROWS, OFFSET, last=0.003), "rows 2 and 3 are off by 245 mm; without them 30 mm rms; then module 1 (phi1) reads 0.1146 deg too low: 30 -> 3 mm"),
    (lambda: chain(OFFSET, WRONG_ROWS, last=0.003), "module 1 (phi1) reads 0.1146 deg too low: rms 300 -> 30 mm; then rows 2 and 3 are off by 245 mm; the other 38 agree within 3 mm rms"),
    (lambda: chain(OFFSET, last=0.21), "explains little: module 1 (phi1) reads 0.1146 deg too low: rms 300 mm -> 210 mm"),
    (lambda: chain(OFFSET, last=0.19), "module 1 (phi1) reads 0.1146 deg too low: rms 300 mm -> 190 mm"),
    (lambda: chain(OFFSET, recorded_tcp=BOTH_TCP, origin="sim"), "module 1 (phi1) reads 0.1146 deg too low: rms 300 mm -> 0.2 mm; robot agrees with its own TCP within 0.1 mm, so that is in sim"),
    (lambda: chain(OFFSET, recorded_tcp=BOTH_TCP), "module 1 (phi1) reads 0.1146 deg too low: rms 300 mm -> 0.2 mm"),
    (lambda: chain(OFFSET, verdict="pass", last=0.1), "passes; 200 mm of 300 mm rms would go if module 1 (phi1) were corrected by +0.1146 deg"),
    (lambda: chain(*HIGH[:4], verdict="pass"), "passes; 299.8 mm of 300 mm rms would go if joint q1 were corrected by -1 deg, joint q2 were corrected by -2 deg and joint q3 were corrected by -3 deg; 1 more in the table"),
    (lambda: chain(verdict="pass", undecided=UNDECIDED[:2], last=0.1), "passes; 200 mm of 300 mm rms is explained: either the base needs a turn of (0, 0, +0.1146) deg or module 1 (phi1) reads 0.1146 deg too low (more motion of phi5 would decide)"),
    (lambda: chain(OFFSET, verdict="pass", last=0.28), "passes; only 20 mm of 300 mm rms would go if module 1 (phi1) were corrected by +0.1146 deg"),
    (lambda: chain(OFFSET, verdict="pass", last=0.299), "passes; next to nothing of 300 mm rms would go if module 1 (phi1) were corrected by +0.1146 deg"),
    (lambda: off_by(0.3, 0.4, 0.003), "joint q1 reads 1 deg too high and joint q2 reads 2 deg too high: rms 300 mm -> 3 mm"),
    (lambda: off_by(0.3, 0.2, 0.3, 0.003), "joint q1 reads 1 deg too high: rms 300 -> 200 mm; then joint q2 reads 2 deg too high and joint q3 reads 3 deg too high: 200 -> 3 mm"),
    (lambda: off_by(0.3, 0.2, 0.1, 0.25, 0.003), "joint q1 reads 1 deg too high: rms 300 -> 200 mm; then joint q2 reads 2 deg too high: 200 -> 100 mm; then joint q3 reads 3 deg too high and joint q4 reads 4 deg too high: 100 -> 3 mm"),
    (lambda: off_by(0.3, 0.15, 0.16, undecided=UNDECIDED[:2]), "joint q1 reads 1 deg too high and joint q2 reads 2 deg too high: rms 300 -> 160 mm; then either the base needs a turn of (0, 0, +0.1146) deg or module 1 (phi1) reads 0.1146 deg too low (more motion of phi5 would decide); rms 160 mm remains"),
    (lambda: chain(undecided=(Alternative(tuple(HIGH[:3])), Alternative(tuple(HIGH[2:5]))), last=0.1), "either joint q1 reads 1 deg too high, joint q2 reads 2 deg too high and joint q3 reads 3 deg too high or another (this log cannot decide): rms 300 mm -> 100 mm"),
    (lambda: chain(verdict="pass", last=0.3), "no cause found: rms 300 mm remains"),
    (lambda: chain(last=0.3, unexplained=Unexplained(0.3, "the log is at rest")), "no cause found: rms 300 mm remains (the log is at rest)"),
    (lambda: chain(last=0.3, unidentifiable=(UnidentifiableCauses((LENGTH,), "it changes", "phi5"),)), "not determined by this motion: r_4 needs +1.2 mm from row 4 on (it changes); more motion of phi5 would determine it; rms 300 mm remains"),
    (lambda: chain(last=0.3, unidentifiable=(UnidentifiableCauses((LENGTH,), "it changes"),)), "not determined by this motion: r_4 needs +1.2 mm from row 4 on (it changes); rms 300 mm remains"),
    (lambda: chain(undecided=UNDECIDED, last=0.1), "either the base needs a turn of (0, 0, +0.1146) deg or module 1 (phi1) reads 0.1146 deg too low or another (more motion of phi5 would decide): rms 300 mm -> 100 mm"),
    (lambda: chain(undecided=(Alternative((OFFSET,)), Alternative(())), last=0.1), "either module 1 (phi1) reads 0.1146 deg too low or none of these (this log cannot decide): rms 300 mm -> 100 mm"),
    (lambda: chain(SIGN, undecided=UNDECIDED[:2]), "module 3 (phi3) counter-rotates: rms 300 -> 0.2 mm; then either the base needs a turn of (0, 0, +0.1146) deg or module 1 (phi1) reads 0.1146 deg too low (more motion of phi5 would decide); rms 0.2 mm remains"),
    (lambda: chain(SIGN, unexplained=DIFFERENT), "probably different motions: rms 300 mm, the causes found leave 192.38 mm of it"),
    (lambda: chain(unexplained=DIFFERENT), "probably different motions: rms 300 mm, no cause found"),
]  # fmt: skip


@pytest.mark.parametrize(("build", "sentence"), SENTENCES)
def test_the_answer_is_one_sentence(build: Callable[[], Diagnosis], sentence: str) -> None:
    assert build().summary == sentence


def test_a_line_names_three_equivalent_causes_and_three_kinds_that_were_not_tested() -> None:
    kinds = ("time_lag", "clock_drift", "servo_lag", "joint_lag", "backlash")
    found = replace(
        chain(replace(LENGTH, equivalents=tuple("abcde"))), untested=(UntestedCauses(kinds, "why"),)
    )
    lines = {fact.name: fact.value for fact in present(found).body.facts}
    assert lines["Equivalent causes"] == "r_4 or a or b or c or 2 more"
    few = "offset of the clock, drift of the clock, lag of all joints"
    assert lines["Not tested"] == f"{few} and 2 more (why)"
    page = {fact.name: fact.value for fact in diagnosis_facts(found)}
    assert page["Not tested"] == f"{few}, lag of a joint and backlash of a joint (why)"


def test_the_meaning_says_what_to_do_and_a_place_once() -> None:
    place = "(as its offset in a map of the log, or as its zero in the robot file)"
    facts = {fact.name: fact.value for fact in diagnosis_facts(chain(SIGN, *HIGH[:2]))}
    assert facts["Meaning"] == Advice(
        "count module 3 (phi3) the other way (in the log or in the robot: positions do not show which);"
        f" correct joint q1 by -1 deg; correct joint q2 by -2 deg {place}"
    )
    nothing = (chain(last=0.3), chain(undecided=UNDECIDED), chain(SIGN, unexplained=DIFFERENT))
    assert [diagnosis_facts(diagnosis)[1].value for diagnosis in nothing] == [None] * 3
