"""Lines, tints and panels are where they belong, and the pointer tells what the tables tell."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.report.spec import Panel, stacked, time_axis, typed
from urmpipe_pipeline.report.traces import line, pointer_digits, precision, shaded, told


def numbers(spec: dict[str, Any]) -> FloatArray:
    """The array that plotly.js reads from a typed one."""
    values = np.frombuffer(base64.b64decode(spec["bdata"]), f"<{spec['dtype']}").astype(np.float64)
    return values.reshape([int(n) for n in spec["shape"].split(",")]) if "shape" in spec else values


def test_typed_arrays_come_back() -> None:
    values = np.array([[0.0, -1.5], [np.nan, 1e6]])
    np.testing.assert_array_equal(numbers(typed(values)), values)
    exact = np.array([0.005 * 1e6, np.pi])
    np.testing.assert_array_equal(numbers(typed(exact, "f8")), exact)


def test_stretches_near_each_other_are_tinted_as_one_and_a_sample_is_seen() -> None:
    t = np.arange(10_001) / 100.0  # 100 s
    where = np.zeros(len(t), dtype=np.bool_)
    where[[1000, 1040, 5000]] = True  # 0.4 s apart, and far away
    first, second = shaded(t, where, 100.0)
    assert (first["x0"], first["x1"]) == (10.0, 10.4)
    assert (second["x0"], second["x1"]) == pytest.approx((49.95, 50.05))  # a thousandth of it wide
    assert shaded(t, np.zeros(len(t), dtype=np.bool_), 100.0) == []


@given(st.floats(-1e9, 1e9), st.integers(1, 6))
def test_the_pointer_tells_the_extremes_as_the_tables_do(value: float, digits: int) -> None:
    values = np.array([value, np.nan, value / 3])
    drawn = numbers(typed(values, precision(values, digits)))
    form = told(values, digits)
    assert form == (".3e" if 0 < abs(value) < 1e-3 else f".{digits}f")
    assert f"{drawn[0]:{form}}" == f"{value:{form}}"


def test_panels_do_not_overlap_and_fill_the_height() -> None:
    t = np.arange(3.0)
    panels = [Panel("a [m]", [line(t, t, "a", "#000000", "m")], share=share) for share in (2.0, 1.0, 1.0)]
    layout = stacked(panels, time_axis(0.0, 2.0))["layout"]
    domains = [layout[f"yaxis{number}"]["domain"] for number in ("", "2", "3")]
    assert domains[0][1] == 1.0
    assert domains[2][0] == pytest.approx(0.0, abs=1e-3)  # rounded to four digits
    assert domains[0][0] > domains[1][1] > domains[1][0] > domains[2][1]
    assert layout["xaxis"]["range"] == [0.0, 2.0]


@pytest.mark.filterwarnings("error")
def test_a_line_without_any_value_is_drawn_as_nothing() -> None:
    drawn = line(np.arange(3.0), np.full(3, np.nan), "a", "#000000", "m")
    assert np.isnan(numbers(drawn["y"])).all()
    assert drawn["hovertemplate"] == "%{y:.6f} m"


def test_a_single_sample_is_drawn_as_a_point() -> None:
    one = line(np.zeros(1), np.ones(1), "one", "#000000", "m")
    two = line(np.arange(2.0), np.ones(2), "two", "#000000", "m")
    assert (one["mode"], two["mode"]) == ("lines+markers", "lines")


def test_samples_crowded_in_time_take_no_points_from_the_others() -> None:
    t = np.concatenate([np.linspace(0.0, 1.0, 100_000, endpoint=False), np.linspace(1.0, 10.0, 2000)])
    drawn = line(t, np.sin(20.0 * t), "crowded", "#000000", "rad", points=4000)
    late = numbers(drawn["x"])
    late = late[late >= 1.0]
    assert np.max(np.diff(late)) < 10.0 / 400  # a sample in each of 1000 buckets, two of them at its ends


@pytest.mark.parametrize(
    ("unit", "largest", "digits"),
    [
        ("mm", 1234.5, 4),
        ("deg", 0.1, 4),
        ("m", 1.5, 6),
        ("m", 31.5, 5),
        ("rad", 3.1, 4),
        ("m/s²", 3.8e6, 0),
        ("", 0.5, 6),
    ],
)
def test_the_pointer_tells_no_more_digits_than_are_known(unit: str, largest: float, digits: int) -> None:
    assert pointer_digits(unit, np.array([0.0, -largest, np.nan])) == digits
