"""Spellings of units: their base units, which are the same, and how they are displayed."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asserting import refusal
from urmpipe_fmus.block import BlockModel, Input, Output, Parameter
from urmpipe_fmus.si_units import BaseUnit, coherent_unit, display_conversion, is_same_unit, parse_unit
from urmpipe_models.errors import UnitError

ALLOWED = (
    "allowed: powers of m, g, s, A, K, mol, cd, rad, Hz, N, Pa, J, W, C, V, F, Ohm, S, Wb, T, H, bar, kg,"
    " deg, rev, min, h, d (the SI ones also with a prefix such as k or m) as a product over one factor or a"
    " product in parentheses, such as N.m, kg.m2, rad/s2, N.m.s/rad, J/(kg.K), 1/s; degC alone; empty for"
    " a number without a unit"
)


@pytest.mark.parametrize(
    ("spelling", "expected"),
    [
        ("", BaseUnit()),
        ("1", BaseUnit()),
        ("rad", BaseUnit(rad=1)),
        ("deg", BaseUnit(rad=1, factor=math.pi / 180)),
        ("m", BaseUnit(m=1)),
        ("mm", BaseUnit(m=1, factor=1e-3)),
        ("mm2", BaseUnit(m=2, factor=1e-6)),
        ("s", BaseUnit(s=1)),
        ("ms", BaseUnit(s=1, factor=1e-3)),
        ("min", BaseUnit(s=1, factor=60.0)),
        ("V", BaseUnit(kg=1, m=2, s=-3, A=-1)),
        ("A", BaseUnit(A=1)),
        ("mA", BaseUnit(A=1, factor=1e-3)),
        ("N", BaseUnit(kg=1, m=1, s=-2)),
        ("N.m", BaseUnit(kg=1, m=2, s=-2)),
        ("rad/s", BaseUnit(s=-1, rad=1)),
        ("rev/min", BaseUnit(s=-1, rad=1, factor=2 * math.pi / 60)),
        ("rad/s2", BaseUnit(s=-2, rad=1)),
        ("m/s", BaseUnit(m=1, s=-1)),
        ("mm/ms", BaseUnit(m=1, s=-1)),
        ("m/s2", BaseUnit(m=1, s=-2)),
        ("kg.m2", BaseUnit(kg=1, m=2)),
        ("g", BaseUnit(kg=1, factor=1e-3)),
        ("mg", BaseUnit(kg=1, factor=1e-6)),
        ("N.m/rad", BaseUnit(kg=1, m=2, s=-2, rad=-1)),
        ("N.m.s/rad", BaseUnit(kg=1, m=2, s=-1, rad=-1)),
        ("N.m/A", BaseUnit(kg=1, m=2, s=-2, A=-1)),
        ("V.s/rad", BaseUnit(kg=1, m=2, s=-2, A=-1, rad=-1)),
        ("Ohm", BaseUnit(kg=1, m=2, s=-3, A=-2)),
        ("kOhm", BaseUnit(kg=1, m=2, s=-3, A=-2, factor=1e3)),
        ("H", BaseUnit(kg=1, m=2, s=-2, A=-2)),
        ("W", BaseUnit(kg=1, m=2, s=-3)),
        ("J", BaseUnit(kg=1, m=2, s=-2)),
        ("J/(kg.K)", BaseUnit(m=2, s=-2, K=-1)),
        ("1/s", BaseUnit(s=-1)),
        ("s-1", BaseUnit(s=-1)),
        ("Hz", BaseUnit(s=-1)),
        ("hPa", BaseUnit(kg=1, m=-1, s=-2, factor=100.0)),
        ("degC", BaseUnit(K=1, offset=273.15)),
        ("cd", BaseUnit(cd=1)),
        ("mol", BaseUnit(mol=1)),
        ("F", BaseUnit(kg=-1, m=-2, s=4, A=2)),
        ("S", BaseUnit(kg=-1, m=-2, s=3, A=2)),
        ("Wb", BaseUnit(kg=1, m=2, s=-2, A=-1)),
        ("C", BaseUnit(s=1, A=1)),
    ],
)
def test_a_spelling_is_these_base_units(spelling: str, expected: BaseUnit) -> None:
    assert parse_unit(spelling) == expected


@pytest.mark.parametrize(
    ("coherent", "product"),
    [
        *[("J", "N.m"), ("W", "J/s"), ("V", "W/A"), ("Ohm", "V/A"), ("H", "V.s/A"), ("Wb", "V.s")],
        *[("F", "C/V"), ("S", "A/V"), ("Pa", "N/m2"), ("N", "kg.m/s2"), ("Hz", "1/s"), ("C", "A.s")],
        ("T", "Wb/m2"),
    ],
)
def test_derived_units_are_the_products_of_which_they_are_made(coherent: str, product: str) -> None:
    assert is_same_unit(coherent, product)


@pytest.mark.parametrize(
    "spelling",
    [
        *["rad/s/s", "N.m/rad.s", "1/", "/s", "N..m", "m0", "s10", "mkg", "mdeg", "k"],
        *["degC/s", "J/(kg)K", "J/()", "metre", "²", "mm/(s", "3"],
    ],
)
def test_what_is_no_spelling_is_refused_with_what_is_allowed(spelling: str) -> None:
    assert refusal(UnitError, parse_unit, spelling) == str(UnitError(f"unit {spelling!r}: found, {ALLOWED}"))


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        *[("Nm", "N.m"), ("N*m", "N.m"), ("N·m", "N.m"), ("kNm", "kN.m"), ("Nms/rad", "N.m.s/rad")],
        *[("m^2", "m2"), ("m**2", "m2"), ("m²", "m2"), ("kg*m^2", "kg.m2"), ("kgm2", "kg.m2")],
        *[("ohm", "Ohm"), ("Ω", "Ohm"), ("°", "deg"), ("deg / s", "deg/s"), ("rpm", "rev/min"), (" m", "m")],
        *[("mpa", "MPa"), ("kpa", "kPa"), ("khz", "kHz"), ("mpa*s", "MPa.s"), ("Nrad", "N.rad")],
        *[("°C", "degC"), (" degC", "degC"), ("\u00b5m", "um"), ("\u03bcm", "um")],  # micro sign, Greek mu
    ],
)
def test_what_people_write_is_refused_with_what_it_may_mean(written: str, meant: str) -> None:
    assert refusal(UnitError, parse_unit, written) == (
        f"unit {written!r}: found (did you mean {meant}?), allowed: FMI's spelling, a dot between factors and"
        " powers as digits, such as N.m, kg.m2, rad/s2"
    )
    parse_unit(meant)


SYMBOLS = st.sampled_from(["m", "kg", "s", "A", "K", "mol", "cd", "rad", "N", "mm", "kOhm", "V", "deg", "J"])
POWERS = st.lists(st.tuples(SYMBOLS, st.integers(1, 9)), min_size=1, max_size=3)


def spelled(powers: list[tuple[str, int]]) -> str:
    return ".".join(symbol + (str(power) if power != 1 else "") for symbol, power in powers)


@pytest.mark.slow
@given(above=POWERS, below=POWERS)
def test_a_quotient_has_the_difference_of_exponents_and_the_quotient_of_factors(
    above: list[tuple[str, int]], below: list[tuple[str, int]]
) -> None:
    quotient = parse_unit(f"{spelled(above)}/({spelled(below)})")
    up, down = parse_unit(spelled(above)), parse_unit(spelled(below))
    assert quotient.exponents == tuple(a - b for a, b in zip(up.exponents, down.exponents, strict=True))
    # Rounding of at most 6 powers and a quotient.
    assert math.isclose(quotient.factor, up.factor / down.factor, rel_tol=1e-13)


@given(above=POWERS)
def test_the_order_of_factors_does_not_matter(above: list[tuple[str, int]]) -> None:
    assert is_same_unit(spelled(above), spelled(above[::-1]))


@given(text=st.text(alphabet="mskgNradVA./()-+123 ", max_size=12))
def test_any_text_is_a_unit_or_a_unit_error(text: str) -> None:
    try:
        found = parse_unit(text)
    except UnitError:
        return
    assert math.isfinite(found.factor) and found.factor > 0.0


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("rad", "rad", True),
        ("rad", "deg", False),
        ("m", "mm", False),
        ("rad/s", "1/s", False),
        ("N.m", "J", True),
        ("K", "degC", False),
        ("", "1", True),
        ("rad", "", False),
    ],
)
def test_units_are_the_same_if_their_values_are(one: str, other: str, same: bool) -> None:
    assert is_same_unit(one, other) is same
    assert is_same_unit(parse_unit(other), one) is same


def test_a_factor_written_with_ten_digits_is_the_same_unit() -> None:
    assert is_same_unit("deg", BaseUnit(rad=1, factor=0.01745329252))
    assert not is_same_unit("deg", BaseUnit(rad=1, factor=0.017453))


@pytest.mark.parametrize(
    ("unit", "display", "value", "shown"),
    [
        ("rad", "deg", math.pi, 180.0),
        ("m", "mm", 1.5, 1500.0),
        ("K", "degC", 300.0, 26.85),
        ("degC", "K", 20.0, 293.15),
        ("rad/s", "rev/min", 2 * math.pi, 60.0),
    ],
)
def test_a_value_is_displayed_by_factor_and_offset(
    unit: str, display: str, value: float, shown: float
) -> None:
    factor, offset = display_conversion(unit, display)
    assert factor * value + offset == pytest.approx(shown, rel=1e-14)  # three roundings


@pytest.mark.parametrize(
    ("spelling", "in_si"),
    [
        ("", ""),
        ("1/s", "1/s"),
        ("kg.m2", "kg.m2"),
        ("Hz", "Hz"),
        ("rev/min", "rad/s"),
        ("deg/s2", "rad/s2"),
        ("N.mm/deg", "N.m/rad"),
        ("g", "kg"),
        ("mg.cm2", "kg.m2"),
        ("kW", "W"),
        ("mbar", "Pa"),
        ("kOhm", "Ohm"),
        ("J/(g.mK)", "J/(kg.K)"),
        ("degC", "K"),
    ],
)
def test_the_unit_of_si_of_the_same_quantity(spelling: str, in_si: str) -> None:
    assert coherent_unit(spelling) == in_si
    assert parse_unit(in_si) == replace(parse_unit(spelling), factor=1.0, offset=0.0)


def test_a_display_unit_of_another_quantity_is_refused() -> None:
    with pytest.raises(UnitError, match=r"^display unit 'mm': found for values in 'rad', allowed: one of "):
        display_conversion("rad", "mm")


def test_a_unit_tells_all_variables_with_a_wrong_unit() -> None:
    with pytest.raises(UnitError) as caught:
        BlockModel(
            name="wrong",
            description="",
            variables=(
                Input(name="tau", description="", unit="Nm"),
                Input(name="phi", description="", unit="rad", display_unit="mm"),
                Input(name="n", description="", display_unit="mm"),
                Input(name="turns", description="", type="Integer", unit="rev"),
                Parameter(name="ws", description="", unit="deg/s", start=1.0),
                Parameter(name="play", description="", unit="mm", display_unit="um"),
                Output(name="y", description="", unit="m"),
            ),
            outputs=lambda v: {"y": v.tau},
        )
    assert [str(one) for one in caught.value.findings] == [
        "unit wrong: tau: unit 'Nm': found (did you mean N.m?), allowed: FMI's spelling, a dot between"
        " factors and powers as digits, such as N.m, kg.m2, rad/s2",
        "unit wrong: phi: display unit 'mm': found for values in 'rad', allowed: one of the same quantity",
        "unit wrong: n: found display unit 'mm' without a unit, allowed: both or none",
        "unit wrong: turns: found Integer with a unit, allowed: a unit of a Real",
        "unit wrong: ws: found unit 'deg/s', allowed: values in SI, unit='rad/s', with display_unit='deg/s'"
        " to show it so",
        "unit wrong: play: found unit 'mm', allowed: values in SI, unit='m'",
    ]
