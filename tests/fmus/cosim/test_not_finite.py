"""Values of foreign FMUs that are not finite are noted, with the first time, whatever is recorded of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foreign_fmus import Foreign, Scalar, gain, ran
from urmpipe_fmus.cosim import Port

GLITCH = Foreign(
    name="glitch",
    scalars=(Scalar("y", 0), Scalar("high", 1), Scalar("well", 2)),
    compute="""
    v->r[0] = v->time > 0.15 && v->time < 0.35 ? NAN : v->time;
    v->r[1] = v->time > 0.65 ? -INFINITY : 0;
    v->r[2] = 1;
    """,
)
"""y is nan at 0.2 s and 0.3 s, high is infinite from 0.7 s on."""

CLIP = gain("clip", formula="fmin(u, 0.0)")
"""Of nan it makes 0, as fmin of C does."""


def noted(*arguments: object, **options: object) -> dict[Port, tuple[float, float, int]]:
    recorded = ran(*arguments, **options)
    assert recorded.failed is None
    return {port: (one.value, one.t, one.count) for port, one in recorded.not_finite.items()}


@pytest.mark.slow
def test_the_first_value_its_time_and_how_many_there_are() -> None:
    found = noted({"a": GLITCH, "b": CLIP}, {"b.u": "a.y"})
    assert list(found) == [Port("a", "y"), Port("a", "high")]
    value, t, count = found[Port("a", "y")]
    assert (math.isnan(value), t, count) == (True, 0.2, 2)
    assert found[Port("a", "high")] == (-math.inf, 7 * 0.1, 4)


def test_one_between_two_recorded_points_is_noted_too() -> None:
    recorded = ran({"a": GLITCH, "b": CLIP}, {"b.u": "a.y"}, record_every=5)
    assert np.isfinite(recorded.column("a", "y")).all()
    one = recorded.not_finite[Port("a", "y")]
    assert (one.t, one.count) == (0.2, 2)


def test_one_that_is_exchanged_in_the_initialization_alone_is_noted() -> None:
    unset = Foreign(
        name="unset", scalars=(Scalar("y", 0),), compute="v->r[0] = 1;", start="m->v.r[0] = NAN;", fresh=False
    )
    recorded = ran({"a": unset, "b": CLIP}, {"b.u": "a.y"})
    assert np.isfinite(recorded.column("a", "y")).all()
    one = recorded.not_finite[Port("a", "y")]
    assert (one.t, one.count) == (0.0, 1)


def test_one_is_noted_where_the_run_fails_later() -> None:
    picky = Foreign(
        name="picky",
        scalars=(Scalar("u", 0, "input"), Scalar("y", 1)),
        step='if (isnan(v->r[0])) { write(2, "nan\\n", 4); exit(0); }',
    )
    recorded = ran({"a": GLITCH, "b": picky}, {"b.u": "a.y"})
    assert recorded.failed == (
        "block b: fmi2DoStep at t = 0.2 s: ended the process with the exit code 0; its last lines: nan"
    )
    assert [(port, one.t, one.count) for port, one in recorded.not_finite.items()] == [
        (Port("a", "y"), 0.2, 1)
    ]


def test_finite_runs_note_nothing() -> None:
    assert noted({"a": gain()}, None, {"a": {"u": 1.0}}) == {}
