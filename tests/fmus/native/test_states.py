"""States of an FMU: saved, serialized, in many instances and threads, and all memory given back."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from loaded_fmu import Loaded
from urmpipe_fmus.build.description import Backend
from written_units import loaded

DAMPING, GOAL, X, FORCE = 1, 2, 5, 9
both_backends = pytest.mark.parametrize("backend", ["native", "python"])


def wander(one: Loaded, first: int, count: int) -> list[Any]:
    """Some steps with inputs of their own; all values on the way."""
    values = []
    for k in range(first, first + count):
        one.set("goal", (k * 7919 % 13) / 3.0)
        values.append(one.get(list(one.references)))
        one.do_step(k * 0.01, 0.01)
    return values


@both_backends
def test_a_saved_state_continues_bit_by_bit_here_and_in_another_instance(backend: Backend) -> None:
    one, other = loaded("oscillator", backend), loaded("oscillator", backend)
    wander(one, 0, 20)
    state = one.fmu.getFMUstate()
    content = one.fmu.serializeFMUstate(state)
    after = wander(one, 20, 20)
    one.fmu.reset()
    one.initialize(0.0)
    for instance, saved in ((one, state), (other, other.fmu.deSerializeFMUstate(content))):
        instance.set("damping", 0.75)
        instance.fmu.setFMUstate(saved)
        assert instance.status_of("setReal", [DAMPING], [1.0]) > 2  # it is fixed, as it runs
        assert wander(instance, 20, 20) == after
        instance.fmu.freeFMUstate(saved)


@both_backends
def test_outputs_are_those_of_the_state_that_is_set(backend: Backend) -> None:
    fmu = loaded("oscillator", backend).fmu
    before = fmu.getReal([FORCE])
    fmu.setReal([GOAL], [4.0])
    state = fmu.getFMUstate()  # in which nobody has asked for the force of this goal yet
    force = fmu.getReal([FORCE])
    assert force != before
    for goal in (7.0, 1.0):
        fmu.setReal([GOAL], [goal])
        assert fmu.getReal([FORCE]) != force
        fmu.setFMUstate(state)
        assert fmu.getReal([FORCE]) == force


@both_backends
def test_a_reset_and_a_state_of_before_the_initialization_go_back_to_it(backend: Backend) -> None:
    one = loaded("oscillator", backend)
    names = list(one.references)
    before = one.get(names)
    wander(one, 0, 3)
    one.fmu.reset()
    assert one.get(names) == before
    state = one.fmu.getFMUstate()
    for damping in (1.0, 2.0):  # a fixed parameter, which the first step fixes
        one.set("damping", damping)
        one.fmu.setupExperiment(startTime=0.0)
        one.fmu.enterInitializationMode()
        one.set("x[1]", damping)
        one.fmu.exitInitializationMode()
        assert one.get(["x[1]", "damping"]) == [damping, damping]
        one.do_step(0.0, 0.1)
        one.fmu.setFMUstate(state)


def test_instances_are_independent_in_threads() -> None:
    alone = wander(loaded("oscillator"), 0, 300)
    instances = [loaded("oscillator") for _ in range(8)]
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(lambda one: wander(one, 0, 300), instances)) == [alone] * 8


@pytest.mark.parametrize(("name", "blocks"), [("oscillator", 2), ("player", 3)])
def test_every_block_of_memory_is_given_back(name: str, blocks: int) -> None:
    one = loaded(name)
    assert len(one.blocks) == blocks  # the instance, its name, and rows
    state = one.fmu.getFMUstate()
    again = one.fmu.deSerializeFMUstate(one.fmu.serializeFMUstate(state))
    one.do_step(0.0, 0.01)
    one.fmu.setFMUstate(again)
    one.fmu.reset()
    assert len(one.blocks) == blocks + 2
    one.fmu.freeFMUstate(again)
    one.fmu.freeFMUstate(state)
    one.fmu.freeInstance()
    assert one.blocks == set()
