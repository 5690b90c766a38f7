"""A native FMU does what an instance in Python does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.instance import Instance


def assert_same(found: Sequence[float], expected: Sequence[float]) -> None:
    """Assert equality but for some units in the last place, by which elementary functions differ."""
    np.testing.assert_allclose(np.array(found), np.array(expected), rtol=1e-12, atol=1e-12)


def references(model: BlockModel, *kinds: str) -> list[int]:
    """The value references of the Reals of some causalities."""
    return [k for k, (_, one) in enumerate(model.scalars) if one.causality in kinds and one.type == "Real"]


def index(model: BlockModel, name: str) -> int:
    return [scalar for scalar, _ in model.scalars].index(name)


@pytest.mark.slow
def test_every_step_gives_what_the_instance_gives(native: Callable[..., Any], oscillator: BlockModel) -> None:
    fmu, instance = native(oscillator, start=0.25), Instance(oscillator, 0.25)
    shown = references(oscillator, "output", "local")
    goal, gear, time = index(oscillator, "goal"), index(oscillator, "gear"), 0.25
    for k, value in enumerate(np.random.default_rng(3).normal(size=200).tolist()):
        step = 0.01 if k % 3 else 0.0101
        fmu.fmu.setReal([goal], [value])
        fmu.fmu.setInteger([gear], [k % 5])
        instance.set([goal, gear], [value, k % 5])
        assert_same(fmu.fmu.getReal(shown), instance.get(shown))
        fmu.step(time, step)
        instance.do_step(time, step)
        time += step
        assert_same(fmu.fmu.getReal(shown), instance.get(shown))
    count = index(oscillator, "count")
    assert fmu.fmu.getInteger([count]) == [200] == instance.get([count])


@pytest.mark.slow
def test_outputs_are_those_of_the_inputs_just_set(native: Callable[..., Any], oscillator: BlockModel) -> None:
    fmu = native(oscillator)
    goal, force, k = (index(oscillator, name) for name in ("goal", "force", "k"))
    fmu.fmu.setReal([goal], [3.0])
    assert fmu.fmu.getReal([force]) == [2.0 * (3.0 - 0.1)]
    fmu.fmu.setReal([goal, k], [4.0, 10.0])
    assert fmu.fmu.getReal([force]) == [10.0 * (4.0 - 0.1)]


def test_computed_integers_are_the_nearest_and_booleans_all_but_zero(
    native: Callable[..., Any], oscillator: BlockModel
) -> None:
    fmu = native(oscillator)
    x, turns, far = (index(oscillator, name) for name in ("x[1]", "turns", "far"))
    for place, whole, is_far in ((0.625, 2, 0), (0.875, 4, 0), (-0.15, -1, 0), (1.5, 6, 1)):
        fmu.fmu.reset()
        fmu.fmu.setReal([x], [place])
        assert fmu.fmu.getInteger([turns]) == [whole]
        assert fmu.fmu.getBoolean([far]) == [is_far]


@pytest.mark.slow
def test_a_table_gives_the_rows_that_python_finds(native: Callable[..., Any], player: BlockModel) -> None:
    half = 10_000_000.5e-9
    times = [0.0, 4.999e-3, 0.01, np.nextafter(0.01, 0), 0.0175, 0.025, 0.03, half, -5e-9, -4.5e-9, -1.0]
    for time in times:
        fmu, instance = native(player, start=time), Instance(player, time)
        assert fmu.fmu.getReal([0, 1, 2]) == [float(one) for one in instance.get([0, 1, 2])]


def test_reset_goes_back_to_the_start(native: Callable[..., Any], oscillator: BlockModel) -> None:
    fmu = native(oscillator)
    everything = [k for k, (_, one) in enumerate(oscillator.scalars) if one.type == "Real"]
    before = fmu.fmu.getReal(everything)
    fmu.fmu.setReal([index(oscillator, "k")], [7.0])
    fmu.step(0.0, 0.1)
    fmu.fmu.reset()
    assert fmu.fmu.getReal(everything) == before
    fmu.fmu.setReal([index(oscillator, "damping")], [1.0])  # fixed, but it does not run any more
