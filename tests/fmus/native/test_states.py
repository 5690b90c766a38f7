"""States of a native FMU: saved, serialized, in many instances and threads, and all memory given back."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from urmpipe_fmus.block import BlockModel

DAMPING, GOAL, X, FORCE, COUNT = 1, 2, 5, 9, 7
EVERYTHING = [0, 1, 2, 5, 6, 8, 9, 12, 13]
"""All Reals of the oscillator."""


def wander(fmu: Any, first: int, count: int) -> list[Any]:
    """Some steps with inputs of their own; all that is seen of them."""
    seen = []
    for k in range(first, first + count):
        fmu.fmu.setReal([GOAL], [(k * 7919 % 13) / 3.0])
        seen.append(fmu.fmu.getReal(EVERYTHING) + fmu.fmu.getInteger([COUNT]))
        fmu.step(k * 0.01, 0.01)
    return seen


def test_a_saved_state_continues_bit_by_bit(native: Callable[..., Any], oscillator: BlockModel) -> None:
    fmu = native(oscillator)
    wander(fmu, 0, 20)
    state = fmu.fmu.getFMUstate()
    after = wander(fmu, 20, 20)
    fmu.fmu.setFMUstate(state)
    assert wander(fmu, 20, 20) == after
    fmu.fmu.freeFMUstate(state)


def test_outputs_are_those_of_the_state_that_is_set(
    native: Callable[..., Any], oscillator: BlockModel
) -> None:
    fmu = native(oscillator).fmu
    before = fmu.getReal([FORCE])
    fmu.setReal([GOAL], [4.0])
    state = fmu.getFMUstate()  # in which nobody has asked for the force of this goal yet
    (force,) = fmu.getReal([FORCE])
    assert force != before[0]
    for goal in (7.0, 1.0):
        fmu.setReal([GOAL], [goal])
        assert fmu.getReal([FORCE]) != [force]
        fmu.setFMUstate(state)
        assert fmu.getReal([FORCE]) == [force]
    fmu.freeFMUstate(state)


def test_outputs_are_those_of_the_start_time_that_is_set(
    native: Callable[..., Any], player: BlockModel
) -> None:
    fmu = native(player).fmu
    fmu.reset()
    assert fmu.getReal([0]) == [2.0]
    fmu.setupExperiment(startTime=0.01)
    assert fmu.getReal([0]) == [4.0]


def test_a_state_of_before_the_initialization_goes_back_to_it(
    native: Callable[..., Any], oscillator: BlockModel
) -> None:
    fmu = native(oscillator).fmu
    fmu.reset()
    state = fmu.getFMUstate()
    for damping in (1.0, 2.0):  # a fixed parameter, which the first step fixes
        fmu.setReal([DAMPING], [damping])
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.setReal([X], [damping])
        fmu.exitInitializationMode()
        assert fmu.getReal([X, DAMPING]) == [damping, damping]
        fmu.doStep(0.0, 0.1)
        fmu.setFMUstate(state)
    fmu.freeFMUstate(state)


def test_a_serialized_state_continues_in_another_instance(
    native: Callable[..., Any], oscillator: BlockModel
) -> None:
    one, other = native(oscillator), native(oscillator)
    wander(one, 0, 20)
    state = one.fmu.getFMUstate()
    content = one.fmu.serializeFMUstate(state)
    after = wander(one, 20, 20)
    copy = other.fmu.deSerializeFMUstate(content)
    other.fmu.setFMUstate(copy)
    assert wander(other, 20, 20) == after
    one.fmu.freeFMUstate(state)
    other.fmu.freeFMUstate(copy)


def test_foreign_states_are_refused(native: Callable[..., Any], oscillator: BlockModel) -> None:
    fmu = native(oscillator)
    state = fmu.fmu.getFMUstate()
    content = fmu.fmu.serializeFMUstate(state)
    fmu.fmu.freeFMUstate(state)
    assert fmu.refused(lambda: fmu.fmu.deSerializeFMUstate(content[:-1])) == [
        f"unit oscillator: serializedState: found {len(content) - 1} bytes, allowed: {len(content)}"
    ]
    assert fmu.refused(lambda: fmu.fmu.deSerializeFMUstate(b"{9" + content[2:])) == [
        "unit oscillator: serializedState: found that of another FMU,"
        " allowed: GUID {12345678-0000-0000-0000-000000000000}"
    ]
    assert fmu.refused(lambda: fmu.fmu.setFMUstate(None)) == [
        "unit oscillator: FMUstate: found none, allowed: one of fmi2GetFMUstate"
    ]
    wander(fmu, 0, 3)


def test_instances_are_independent_in_threads(native: Callable[..., Any], oscillator: BlockModel) -> None:
    alone = wander(native(oscillator), 0, 300)
    instances = [native(oscillator) for _ in range(8)]
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(lambda one: wander(one, 0, 300), instances)) == [alone] * 8


class Counted:
    """Callbacks whose memory is counted.

    Attributes:
        held: Addresses of what was taken and not yet given back.
        taken: How many blocks were taken.
    """

    def __init__(self) -> None:
        from fmpy import fmi2

        self.held: set[int] = set()
        self.taken = 0
        self.callbacks = fmi2.fmi2CallbackFunctions()
        self.callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(self._take)
        self.callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(self._give)

    def _take(self, count: int, size: int) -> int:
        """Take a block of zeros."""
        from fmpy import calloc

        address = int(calloc(count, size))
        self.held.add(address)
        self.taken += 1
        return address

    def _give(self, address: int) -> None:
        """Give a block back, which must be one that was taken."""
        from fmpy import free

        self.held.remove(address)
        free(address)


@pytest.mark.parametrize("what", ["oscillator", "player"])
def test_every_block_of_memory_is_given_back(
    built: Callable[..., Path], what: str, request: pytest.FixtureRequest
) -> None:
    from fmpy import fmi2

    folder, counted = built(request.getfixturevalue(what)), Counted()
    fmu = fmi2.FMU2Slave(
        guid="{12345678-0000-0000-0000-000000000000}", modelIdentifier=what, unzipDirectory=str(folder),
        instanceName="one",
    )  # fmt: skip
    fmu.instantiate(callbacks=counted.callbacks)
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    state = fmu.getFMUstate()
    again = fmu.deSerializeFMUstate(fmu.serializeFMUstate(state))
    fmu.doStep(0.0, 0.01)
    fmu.setFMUstate(again)
    fmu.reset()
    assert counted.taken >= 4  # the instance, its name, two states
    fmu.freeFMUstate(again)
    fmu.freeFMUstate(state)
    fmu.freeInstance()
    assert counted.held == set()


def test_it_works_without_callbacks_and_logger(built: Callable[..., Path], oscillator: BlockModel) -> None:
    folder = built(oscillator)
    (path,) = folder.glob("binaries/*/oscillator*")
    library = ctypes.CDLL(str(path))
    library.fmi2Instantiate.restype = ctypes.c_void_p
    component = library.fmi2Instantiate(
        b"one", 1, b"{12345678-0000-0000-0000-000000000000}", None, None, 0, 0
    )
    assert component
    one, references, values = ctypes.c_void_p(component), (ctypes.c_uint * 1)(99), (ctypes.c_double * 1)(1.0)
    assert library.fmi2SetReal(one, references, ctypes.c_size_t(1), values) == 3
    references[0] = GOAL
    assert library.fmi2SetReal(one, references, ctypes.c_size_t(1), values) == 0
    library.fmi2FreeInstance(one)
    library.fmi2FreeInstance(None)
    assert library.fmi2Terminate(None) == 3
    assert library.fmi2Instantiate(b"one", 0, None, None, None, 0, 0) is None


@pytest.mark.parametrize("guid", ["", "{9}"])
def test_a_wrong_guid_without_a_logger_gives_none(
    built: Callable[..., Path], oscillator: BlockModel, guid: str
) -> None:
    (path,) = built(oscillator).glob("binaries/*/oscillator*")
    library = ctypes.CDLL(str(path))
    library.fmi2Instantiate.restype = ctypes.c_void_p
    assert library.fmi2Instantiate(b"one", 1, guid.encode(), None, None, 0, 0) is None
