"""Tolerances as they are written, and what they are for."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asserting import refusal
from four_logs import ALLOWED, NOISE
from urmpipe_models.errors import OptionError
from urmpipe_models.measure_units import DEGREE
from urmpipe_pipeline.comparison.verdict import (
    MIN_SHARES,
    UNITS,
    check_tolerance,
    parse_tolerance,
    tolerance_for,
)

NUMBERS = (
    "allowed: numbers of axis, x, y, z, norm, path in m, of angle, joint in rad (m of a joint that slides)"
)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("0.0035", {"axis": 0.0035}),
        ("3.5mm", {"axis": 0.0035}),
        ("1.1 mm", {"axis": 0.0011}),
        ("7um", {"axis": 7e-6}),
        ("1e-3", {"axis": 0.001}),
        (".5mm", {"axis": 0.0005}),
        ("0.0035,norm=5mm", {"axis": 0.0035, "norm": 0.005}),
        (" axis = 3.5 mm , z=2mm ", {"axis": 0.0035, "z": 0.002}),
        (
            "axis=0.0035,norm=0.005,angle=0.01,joint=0.002",
            {"axis": 0.0035, "norm": 0.005, "angle": 0.01, "joint": 0.002},
        ),
        ("path=0.1mm,angle=10mrad,joint=2mrad", {"path": 1e-4, "angle": 0.01, "joint": 0.002}),
        ("angle=0.5deg", {"angle": math.pi / 360}),
        ("1mm,coverage=40%,judged=0", {"axis": 0.001, "coverage": 0.4, "judged": 0.0}),
        ("±3.5mm,norm=+-5mm", {"axis": 0.0035, "norm": 0.005}),
    ],
)
def test_what_is_written_is_found_in_si(text: str, found: dict[str, float]) -> None:
    assert parse_tolerance(text) == found


@given(st.floats(1e-9, 1e3), st.sampled_from(sorted(UNITS.keys() - MIN_SHARES)))
def test_a_number_in_si_comes_back_bit_for_bit(value: float, kind: str) -> None:
    unit = UNITS[kind].removesuffix("1")  # a share has none
    value = value if unit else min(value, 1.0)
    assert parse_tolerance(f"{kind}={value!r}{unit}") == {kind: value}


@given(st.integers(1, 999_999))
def test_a_unit_is_a_shift_of_the_decimal_point(number: int) -> None:
    assert parse_tolerance(f"{number}um") == parse_tolerance(f"{number}e-6m")
    assert parse_tolerance(f"{number}mm") == parse_tolerance(f"{number}e-3m")


@pytest.mark.parametrize(
    ("clear", "unclear", "both"),
    [
        ("axis=0.0199", "axis=0.02", "axis=0.02mm or axis=0.02m"),
        ("0.0199", "±3.5", "3.5mm or 3.5m"),
        ("angle=0.2", "angle=0.2001", "angle=0.2001deg or angle=0.2001rad"),
        ("joint=.2", "joint=1", "joint=1deg or joint=1rad"),
        ("AP_rz=0.2", "AP_rz=0.21", "AP_rz=0.21deg or AP_rz=0.21rad"),
        ("AV=1", "AV=1.01", "AV=1.01% or AV=101%"),
        ("coverage=1", "coverage=90", "coverage=90% or coverage=9000%"),
    ],
)
def test_a_large_number_needs_its_unit(clear: str, unclear: str, both: str) -> None:
    assert parse_tolerance(clear) == {clear.rpartition("=")[0] or "axis": float(clear.rpartition("=")[2])}
    said = f"tolerance (--tolerance): found {unclear}, allowed: a unit: {both}"
    assert refusal(OptionError, parse_tolerance, unclear) == said


def test_times_and_speeds_need_none() -> None:
    assert parse_tolerance("PSt=20,FV=3", iso=True) == {"PSt": 20.0, "FV": 3.0}


def test_a_degree_is_that_of_pi() -> None:
    assert float(DEGREE) == math.pi / 180


@pytest.mark.parametrize(
    ("part", "said"),
    [
        ("", "''"),
        ("3 inch", "'3 inch'"),
        ("-1mm", "'-1mm'"),
        ("0", "'0'"),
        ("nan", "'nan'"),
        ("inf", "'inf'"),
        ("1_0", "'1_0'"),
        ("1e400", "'1e400'"),
        ("tcp=1mm", "'tcp=1mm'"),
        ("=1mm", "'=1mm'"),
        ("axis=", "'axis='"),
        ("angle=3mm", "'angle=3mm'"),
        ("norm=1deg", "'norm=1deg'"),
        ("±±1mm", "'±±1mm'"),
        ("joint=2mm", "'joint=2mm'"),  # of joints that turn it would be 2 mrad
        ("a=b=1", "'a=b=1'"),
        ("coverage=190%", "'coverage=190%'"),
    ],
)
def test_what_is_no_tolerance_is_one_line(part: str, said: str) -> None:
    assert refusal(OptionError, parse_tolerance, part) == f"tolerance (--tolerance): found {said}, {ALLOWED}"


def test_an_angle_alone_and_a_decimal_comma_are_told_how_to_be_written() -> None:
    with pytest.raises(OptionError) as error:
        parse_tolerance("0.5deg")
    assert str(error.value) == (
        f"tolerance (--tolerance): found '0.5deg', {ALLOWED};"
        " --tolerance angle=0.5deg or --tolerance joint=0.5deg specifies the kind"
    )
    with pytest.raises(OptionError) as error:
        parse_tolerance("3,5mm")
    assert str(error.value) == (
        "tolerance (--tolerance): found '3,5mm', allowed: a point before the decimals, 3.5mm"
    )


def test_everything_that_is_wrong_is_told_at_once() -> None:
    with pytest.raises(OptionError) as error:
        parse_tolerance("1mm, foo=2, axis=3mm,norm=x,,norm=4mm,norm=5mm,angle= 1", "noise", zero=True)
    assert [str(one) for one in error.value.findings] == [
        f"noise (--noise): found 'foo=2', {NOISE}",
        f"noise (--noise): found 'axis=3mm' twice, {NOISE}",
        f"noise (--noise): found 'norm=x', {NOISE}",
        f"noise (--noise): found '', {NOISE}",
        f"noise (--noise): found 'norm=5mm' twice, {NOISE}",
        "noise (--noise): found angle= 1, allowed: a unit: angle=1deg or angle=1rad",
    ]


def test_a_bare_length_may_be_for_several_kinds_and_zero() -> None:
    assert parse_tolerance("0", bare=("axis", "norm"), zero=True) == {"axis": 0.0, "norm": 0.0}


def test_a_tolerance_in_numbers_is_checked_whole() -> None:
    check_tolerance({"axis": 1, "joint": 0.1})
    check_tolerance({"axis": 0.0}, zero=True)
    with pytest.raises(OptionError) as error:
        check_tolerance({"foo": 1.0, "axis": 0.0, "norm": math.nan, "path": "1mm", "judged": 1.1})  # type: ignore[dict-item]
    assert [str(one) for one in error.value.findings] == [
        f"tolerance (--tolerance): found {found}, {NUMBERS}; positive; coverage, judged 0 to 1"
        for found in ("foo=1.0", "axis=0.0", "norm=nan", "path=1mm", "judged=1.1")
    ]
    assert refusal(OptionError, check_tolerance, {}) == f"tolerance (--tolerance): found nothing, {NUMBERS}"


def test_a_coordinate_goes_before_the_axes_and_a_joint_of_that_name_does_not() -> None:
    tolerance = {"axis": 1.0, "z": 2.0, "joint": 3.0}
    assert tolerance_for("x", "axis", tolerance) == 1.0
    assert tolerance_for("z", "axis", tolerance) == 2.0
    assert tolerance_for("z", "joint", tolerance) == 3.0
    assert tolerance_for("norm", "norm", tolerance) is None
