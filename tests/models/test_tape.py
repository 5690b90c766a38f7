"""A function over a log, run from its tape: the very bits that it gives on whole arrays and on floats."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import Element, FloatArray, cosine_sine, map_blocks
from urmpipe_models.kinematics.forward import poses_over_log, tip_pose
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.tape import BLOCK, LONG, aligned, fill_over_log


def entries(chain: Chain, q: Sequence[Element]) -> list[Element]:
    pose = tip_pose(chain, q)
    return [element for vector in (pose.translation, *pose.rotation) for element in vector]


def over_log(function: Callable[[Sequence[Element]], list[Element]], q: FloatArray, count: int) -> FloatArray:
    """Fill targets that no cache line starts, so that alignment cannot be what makes bits agree."""
    targets = np.full((count, len(q) + 1), np.nan)[:, 1:]
    fill_over_log(function, q, [*targets])
    return targets


def assert_the_bits(got: FloatArray, elements: Sequence[Element]) -> None:
    for values, element in zip(got, elements, strict=True):
        expected = np.ascontiguousarray(np.broadcast_to(element, values.shape), dtype=float)
        np.testing.assert_array_equal(values.view(np.int64), expected.view(np.int64))


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(data=st.data(), seed=st.integers(0, 2**32 - 1))
def test_a_pose_over_a_long_log_has_the_bits_of_whole_arrays_and_of_floats(
    chains: SearchStrategy[Chain], data: st.DataObject, seed: int
) -> None:
    chain = data.draw(chains)
    q = np.random.default_rng(seed).uniform(-30.0, 30.0, (LONG + 5, len(chain.coordinates)))
    got = over_log(lambda values: entries(chain, values), q, 12)
    assert_the_bits(got, entries(chain, [*np.ascontiguousarray(q.T)]))
    for k in (0, BLOCK - 1, BLOCK, len(q) - 1):
        np.testing.assert_array_equal(got[:, k], entries(chain, q[k].tolist()))


@pytest.mark.parametrize("count", [0, 1, LONG - 1, LONG, LONG + 1, 3 * BLOCK - 1, 3 * BLOCK])
def test_logs_of_any_length_and_strides_have_the_bits_of_whole_arrays(count: int) -> None:
    def function(q: Sequence[Element]) -> list[Element]:
        (c, s), (again, _), seventh = cosine_sine(q[0] * 3.0), cosine_sine(q[1]), q[1] / 7
        both = c + s
        return [both, q[1], -0.0, both, np.floor(seventh) - 2, 2.5, np.hypot(-c, again), np.abs(1 - q[0])]

    rows = np.random.default_rng(count).uniform(-9.0, 9.0, (count, 5))
    for q in (rows[:, 1:3], np.asfortranarray(rows[:, :2]), rows[::-1, ::-3]):
        before = q.copy()
        assert_the_bits(over_log(function, q, 8), function([*np.ascontiguousarray(q.T)]))
        np.testing.assert_array_equal(q, before)


def test_angles_of_many_turns_and_missing_ones_are_as_in_whole_arrays() -> None:
    chain = load_robot("ur5e")
    q = np.random.default_rng(1).uniform(-4.0, 4.0, (LONG, 6))
    q[5, 1], q[BLOCK, 2], q[BLOCK + 1, 3], q[-1] = np.nan, 1e7, -np.inf, -0.0
    with np.errstate(invalid="ignore"):  # of an infinite angle, as np.cos
        got = over_log(lambda values: entries(chain, values), q, 12)
        expected = entries(chain, [*np.ascontiguousarray(q.T)])
    np.testing.assert_array_equal(got, expected)
    assert np.flatnonzero(np.isnan(got).any(axis=0)).tolist() == [5, BLOCK + 1]


def test_logs_side_by_side_do_not_disturb_each_other() -> None:
    chain = load_robot("urm6")
    logs = np.random.default_rng(2).uniform(-4.0, 4.0, (6, LONG + 100, 6))
    together = map_blocks(lambda q: poses_over_log(chain, q), [*logs], threads=4)
    for q, (position, rotation) in zip(logs, together, strict=True):
        expected = entries(chain, [*np.ascontiguousarray(q.T)])
        assert_the_bits(np.vstack((position.T, rotation.reshape(-1, 9).T)), expected)


CHOICE = "a choice by a value is not recorded; allowed: operations on every value"
OPTIONS = "np.{} is not recorded; allowed: one result, no options"


@pytest.mark.parametrize(
    ("function", "complaint"),
    [
        (lambda x: np.where(x > 0.0, 1.0, 2.0), CHOICE),
        (lambda x: max(x, 0.0), CHOICE),
        (lambda x: np.modf(x)[0], OPTIONS.format("modf")),
        (np.add.accumulate, OPTIONS.format("add")),
        (lambda x: x.__iadd__(1.0), OPTIONS.format("add")),
    ],
)
def test_what_is_not_of_every_value_alone_is_refused(function: Any, complaint: str) -> None:
    with pytest.raises(TypeError, match=f"^{complaint}$"):
        over_log(lambda q: [function(q[0])], np.zeros((LONG, 1)), 1)


@pytest.mark.parametrize("rows", [1, LONG])
@pytest.mark.parametrize("targets", [1, 3])
def test_as_many_elements_as_targets_are_needed(rows: int, targets: int) -> None:
    with pytest.raises(ValueError, match=r"zip\(\) argument 2 is (shorter|longer) than argument 1"):
        over_log(lambda q: [q[0], q[0]], np.zeros((rows, 1)), targets)


@pytest.mark.parametrize("length", [1, 8, 1003])
def test_rows_of_aligned_arrays_start_lines_of_the_cache(length: int) -> None:
    made = aligned(3, length)
    assert made.shape == (3, length)
    assert all(row.ctypes.data % 64 == 0 for row in made)
    assert not np.shares_memory(made[0], made[1])
