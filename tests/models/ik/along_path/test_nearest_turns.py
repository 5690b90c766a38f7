"""Samples solved beside each other follow each other by the nearest turns."""

from __future__ import annotations

import math

import numpy as np

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.ik.limits import unwrap_within_limits

TURN = 2.0 * math.pi


def test_each_sample_is_in_the_turn_nearest_to_the_one_before_it_that_there_is() -> None:
    chain = Chain(
        "arm", (Joint("free"), Joint("limited", lower=-4.0, upper=4.0), Joint("slide", "prismatic"))
    )
    way = np.array([[2.0, 3.0, 9.0], [4.0, 3.5, 9.0], [6.0, 3.9, 0.0], [8.0, 3.9, 0.0], [10.0, 3.9, 0.0]])
    q = way - TURN * np.round(way / TURN) * [1.0, 1.0, 0.0]
    q[3] = np.nan
    found = unwrap_within_limits(chain, q, np.array([2.5 - TURN, 3.0, 0.0]))
    expected = way - np.array([TURN, 0.0, 0.0])
    expected[3] = np.nan
    expected[4, 0] -= TURN  # 4 rad after 6 are nearer by the other way: 2.28 back
    np.testing.assert_allclose(found, expected, rtol=0, atol=4e-15)
    assert np.isnan(q[3]).all() and not np.shares_memory(found, q)
