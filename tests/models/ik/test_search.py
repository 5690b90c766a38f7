from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from urmpipe_models.ik.solutions import DEFAULT_SEARCH, SearchOptions


def test_the_usual_search_makes_sense() -> None:
    assert list(DEFAULT_SEARCH.faults()) == []
    assert list(SearchOptions(1e-9, 0, 0).faults()) == []
    assert list(SearchOptions(restarts=np.int64(3)).faults()) == []  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"tolerance": 0.0}, "tolerance: found 0 m, allowed: more than 0, finite"),
        ({"tolerance": -1.0}, "tolerance: found -1 m, allowed: more than 0, finite"),
        ({"tolerance": math.inf}, "tolerance: found inf m, allowed: more than 0, finite"),
        ({"tolerance": math.nan}, "tolerance: found nan m, allowed: more than 0, finite"),
        ({"tolerance": {"axis": 0.1}}, "tolerance: found {'axis': 0.1}, allowed: a number of m, more than 0"),
        ({"restarts": -2}, "restarts: found -2, allowed: a whole number, 0 or more"),
        ({"restarts": 2.5}, "restarts: found 2.5, allowed: a whole number, 0 or more"),
        ({"seed": -1}, "seed: found -1, allowed: a whole number, 0 or more"),
        ({"seed": "1"}, "seed: found '1', allowed: a whole number, 0 or more"),
    ],
)
def test_a_value_that_makes_no_sense_is_told(wrong: dict[str, Any], text: str) -> None:
    assert [str(one) for one in SearchOptions(**wrong).faults()] == [text]


def test_all_values_that_make_no_sense_are_told() -> None:
    told = SearchOptions(tolerance=-1.0, restarts=-1, seed=-1).faults()
    assert [fault.parameter for fault in told] == ["tolerance", "restarts", "seed"]
