"""A diagnosis in words: each kind of cause, what is undecided, and what stays."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from diagnoses import BASE, LENGTH, OFFSET, SIGN
from urmpipe_pipeline.diagnosis.result import Alternative, Cause, Diagnosis, Kind, Remainder
from urmpipe_pipeline.diagnosis.wording import (
    KINDS,
    amount,
    cause_words,
    explained,
    remainder_words,
    sentence,
    share_words,
    undecided_words,
)

SENTENCES = {
    "module 3 (phi3) counter-rotates": SIGN,
    "joint q3 rotates in reverse": Cause("joint_sign", "q3", ("q3",)),
    "modules 2 (phi2) and 4 (phi4) are exchanged": Cause("joints_swapped", "phi2 and phi4", ("a", "b")),
    "joints q1 and q2 are exchanged": Cause("joints_swapped", "q1 and q2", ("q1", "q2")),
    "joint q1 needs half a turn from row 13 on": Cause("half_turn", "q1", ("q1",), from_sample=12),
    "joint q1 is mirrored from row 13 on": Cause("mirrored", "q1", ("q1",), from_sample=12),
    "joint q1 needs -2 turns from row 13 on": Cause(
        "turns", "q1", ("q1",), value=(-2.0,), unit="turns", from_sample=12
    ),
    "module 1 (phi1) reads 0.1146 deg too low": OFFSET,
    "joint slide reads 2.5000 mm too high": Cause(
        "joint_offset", "slide", ("slide",), value=(-0.0025,), unit="m"
    ),
    "elbow_joint reads 0.5730 deg too high": Cause(
        "joint_offset", "elbow_joint", ("elbow_joint",), value=(-0.01,), unit="rad"
    ),
    "Joint1 and Joint2 are exchanged": Cause("joints_swapped", "Joint1 and Joint2", ("Joint1", "Joint2")),
    "joint q1 needs a factor of 1.0125": Cause("joint_scale", "q1", ("q1",), value=(1.0125,)),
    "joint q1 is compliant: +0.00013 s2 of its acceleration": Cause(
        "compliance", "q1", ("q1",), value=(1.3e-4,), unit="s2"
    ),
    "r_4 needs +1.2000 mm from row 4 on": LENGTH,
    "theta_4 needs -0.0573 deg": Cause("tilt", "theta_4", segment="p4", value=(-0.001,), unit="rad"),
    "the base needs (+1.0000, -2.0000, +0.0000) mm": Cause(
        "base_shift", "base", value=(0.001, -0.002, 0.0), unit="m"
    ),
    "the base needs (+0.0000, +0.0000, +0.1146) deg": BASE,
    "the tool centre point needs (+0.0000, +0.0000, +150.0000) mm": Cause(
        "tool_shift", "tool", value=(0.0, 0.0, 0.15), unit="m"
    ),
    "the tool needs (+0.0000, +0.0000, +0.1146) deg": replace(BASE, kind="tool_rotation", name="tool"),
    "the positions of the reference are in mm, read as m": Cause(
        "path_unit", "reference in mm", value=(0.001,)
    ),
    "the positions of the log are in inch, read as m": Cause("path_unit", "log in inch", value=(0.0254,)),
    "the log is 30 ms late": Cause("time_lag", "clock", value=(-0.03,), unit="s"),
    "the log is 1.5 ms early": Cause("time_lag", "clock", value=(0.0015,), unit="s"),
    "the log's clock needs +0.1200 ms/s": Cause("clock_drift", "clock", value=(1.2e-4,), unit="s/s"),
    "another arm fits: ur5e": Cause("other_robot", "ur5e"),
}


@pytest.mark.parametrize("words", SENTENCES)
def test_each_cause_is_a_clause_with_its_value_in_the_unit_that_people_read(words: str) -> None:
    assert cause_words(SENTENCES[words]) == words


def test_each_kind_has_a_name_and_is_put_into_words_here() -> None:
    assert set(KINDS) == set(get_args(Kind)) == {one.kind for one in SENTENCES.values()}


def test_a_cause_is_explained_with_interval_and_twins() -> None:
    assert explained(LENGTH) == (
        "r_4 needs +1.2000 mm from row 4 on (95 %: +1.1000 to +1.3000 mm), or its twin d_5 or tool shift z"
    )


def test_positions_cannot_tell_a_sense_from_a_column() -> None:
    assert explained(SIGN) == (
        "module 3 (phi3) counter-rotates, or its column has the opposite sign: positions cannot"
        " distinguish these"
    )


@pytest.mark.parametrize(
    ("value", "unit", "said"),
    [
        (0.41657442, "m", "416.57 mm"),
        (1.25e-7, "m", "0.0001 mm"),
        (4e-8, "m", "4e-05 mm"),
        (3e-10, "m", "3e-07 mm"),
        (0.0, "m", "0 mm"),
        (12.3456, "m", "12346 mm"),
        (0.01, "rad", "0.573 deg"),
    ],
)
def test_a_deviation_has_five_digits_four_of_them_behind_the_point_unless_it_is_less(
    value: float, unit: str, said: str
) -> None:
    assert amount(value, unit) == said


def diagnosis(*causes: Cause, remainder: Remainder, undecided: tuple[Alternative, ...] = ()) -> Diagnosis:
    """Return a diagnosis of a deviation of 416.57 mm."""
    return Diagnosis(
        "log", "fail", 9, "m", 0.41657, causes, undecided, (), remainder, np.arange(9), np.zeros((9, 3))
    )


def test_one_cause_is_the_answer_with_the_deviation_before_and_after() -> None:
    found = diagnosis(SIGN, remainder=Remainder(1e-7, 6e-14))
    assert sentence(found) == "module 3 (phi3) counter-rotates: rms 416.57 mm -> 0.0001 mm"
    assert repr(found) == f"<Diagnosis log: {sentence(found)}>"


def test_of_several_causes_each_has_its_share_and_what_stays_is_told() -> None:
    assert sentence(diagnosis(SIGN, OFFSET, LENGTH, remainder=Remainder(0.001, 6e-6))) == (
        "module 3 (phi3) counter-rotates (99.80 %) and r_4 needs +1.2000 mm from row 4 on (0.2 %):"
        " rms 416.57 mm -> 1 mm, under 0.01 % of the mean square remains"
    )


def test_the_answer_has_three_causes_at_most_and_none_of_next_to_no_share() -> None:
    names = ("r_1", "r_2", "r_3", "r_4", "r_5", "r_6")
    shares = (0.9, 0.2, 0.05, 0.04, 2e-4, -0.191)
    causes = [
        replace(LENGTH, name=one, from_sample=None, share=share)
        for one, share in zip(names, shares, strict=True)
    ]
    assert sentence(diagnosis(*causes, remainder=Remainder(0.001, 6e-6))) == (
        "r_1 needs +1.2000 mm (90.0 %), r_2 needs +1.2000 mm (20.0 %), r_3 needs +1.2000 mm (5.0 %)"
        " and 2 more: rms 416.57 mm -> 1 mm, under 0.01 % of the mean square remains"
    )
    tiny = Alternative((causes[4],)), Alternative((replace(causes[4], name="r_7"),))
    assert sentence(diagnosis(SIGN, remainder=Remainder(0.001, 6e-6), undecided=tiny)) == (
        "module 3 (phi3) counter-rotates: rms 416.57 mm -> 1 mm"
    )


def test_a_cause_that_hides_a_part_of_another_has_no_share_in_the_answer() -> None:
    hides = replace(LENGTH, from_sample=None, share=-1.2)
    assert sentence(diagnosis(replace(SIGN, share=2.2), hides, remainder=Remainder(0.001, 6e-6))) == (
        "module 3 (phi3) counter-rotates (220.0 %) and r_4 needs +1.2000 mm (hides a part of the others):"
        " rms 416.57 mm -> 1 mm, under 0.01 % of the mean square remains"
    )


@pytest.mark.parametrize(
    ("share", "said"),
    [(1.798, "179.8 %"), (-1.2, "-120.0 %"), (-0.0005, "-0.05 %"), (-2.1e-7, "under 0.01 %"), (0.0, "0 %")],
)
def test_shares_are_plain_percents(share: float, said: str) -> None:
    assert share_words(share) == said


def test_different_motions_are_the_answer_and_not_what_happens_to_leave_less() -> None:
    left = Remainder(0.19238, 0.158, "more than half", different=True)
    assert sentence(diagnosis(SIGN, OFFSET, remainder=left)) == (
        "probably different motions: rms 416.57 mm, the causes found leave 192.38 mm of it"
    )
    assert sentence(diagnosis(remainder=left)) == (
        "probably different motions: rms 416.57 mm, no cause found"
    )


def test_nothing_named_is_said_with_what_it_is_taken_for() -> None:
    nothing = diagnosis(remainder=Remainder(0.41657, 1.0, "no motion of the arm explains it"))
    assert sentence(nothing) == "no cause found: rms 416.57 mm remains (no motion of the arm explains it)"


def test_what_is_undecided_names_both_and_what_would_decide() -> None:
    both = (Alternative((BASE,), "phi5"), Alternative((OFFSET, LENGTH), "phi5"))
    said = (
        "either the base needs (+0.0000, +0.0000, +0.1146) deg or module 1 (phi1) reads"
        " 0.1146 deg too low and r_4 needs +1.2000 mm from row 4 on: a motion of phi5 would decide"
    )
    assert undecided_words(both) == said
    either = said.removesuffix(": a motion of phi5 would decide") + " (a motion of phi5 would decide)"
    found = diagnosis(SIGN, remainder=Remainder(1e-7, 6e-14), undecided=both)
    assert sentence(found) == (
        f"module 3 (phi3) counter-rotates and {either}: rms 416.57 mm -> 0.0001 mm, under 0.01 % of the mean"
        " square remains"
    )
    alone = diagnosis(remainder=Remainder(0.2, 0.23), undecided=both)
    assert sentence(alone) == f"{either}: rms 416.57 mm -> 200 mm"


def test_one_explanation_may_be_nothing_and_the_log_may_not_decide() -> None:
    said = undecided_words((Alternative((OFFSET,)), Alternative(())))
    assert said == (
        "either module 1 (phi1) reads 0.1146 deg too low or none of these: this log cannot decide"
    )


def test_what_stays_is_told_with_its_share() -> None:
    assert remainder_words(Remainder(0.001, 0.25), "m") == "rms 1 mm, 25.0 % of the mean square"
