"""What a native FMU refuses: with a message, nothing changed, and usable afterwards."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from urmpipe_fmus.block import BlockModel, Input, Output, State
from urmpipe_fmus.instance import Instance
from urmpipe_models.errors import UnitError

K, DAMPING, GOAL, ON, GEAR, X, COUNT, FORCE, FAR = 0, 1, 2, 3, 4, 5, 7, 9, 11


def test_values_are_refused_as_the_instance_refuses_them(
    native: Callable[..., Any], oscillator: BlockModel
) -> None:
    fmu, instance = native(oscillator), Instance(oscillator)
    for running in (False, True):
        wrong = [
            ([K], [math.nan]),
            ([GOAL], [math.inf]),
            ([GOAL], [-math.inf]),
            ([K], [-0.5]),
            ([K], [100.00000000000001]),
            ([99], [1.0]),
            ([FORCE], [1.0]),
            ([GOAL, K, FORCE], [5.0, 1e30, 2.0]),
            *([([DAMPING], [1.0]), ([X], [0.5])] if running else []),
        ]
        for references, values in wrong:
            before = fmu.fmu.getReal([K, DAMPING, GOAL, X, FORCE])
            with pytest.raises(UnitError) as error:
                instance.set(references, values)
            said = fmu.refused(lambda r=references, v=values: fmu.fmu.setReal(r, v))
            assert said == [one.message for one in error.value.findings]
            assert fmu.fmu.getReal([K, DAMPING, GOAL, X, FORCE]) == before
        fmu.step(running * 0.01, 0.01)
        instance.do_step(running * 0.01, 0.01)
    # a step of RK4: some ten roundings, and a sine of another library
    assert fmu.fmu.getReal([FORCE]) == pytest.approx(instance.get([FORCE]), rel=1e-14)


def test_other_types_are_refused(native: Callable[..., Any], oscillator: BlockModel) -> None:
    one = native(oscillator)
    fmu = one.fmu
    assert one.refused(lambda: fmu.setInteger([GEAR, GEAR], [4, 6])) == [
        "unit oscillator: gear: found 6, allowed: -1 to 5"
    ]
    assert fmu.getInteger([GEAR]) == [1]
    assert one.refused(lambda: fmu.setBoolean([ON], [2])) == ["unit oscillator: on: found 2, allowed: 0 or 1"]
    assert one.refused(lambda: fmu.setInteger([COUNT], [-(2**31)])) == [
        "unit oscillator: count: found -2147483648, allowed: an integer of 32 bits"
    ]
    assert one.refused(lambda: fmu.setReal([ON], [1.0])) == [
        "unit oscillator: on: found fmi2SetReal, allowed: fmi2SetBoolean"
    ]
    assert one.refused(lambda: fmu.getInteger([K])) == [
        "unit oscillator: k: found fmi2GetInteger, allowed: fmi2GetReal"
    ]
    assert one.refused(lambda: fmu.getBoolean([77])) == [
        "unit oscillator: value reference 77: found, allowed: 0 to 13"
    ]
    assert one.refused(lambda: fmu.getString([K])) == [
        "unit oscillator: found a String, allowed: Real, Integer and Boolean variables"
    ]
    assert fmu.getBoolean([ON]) == [1]


def test_a_step_that_cannot_be_taken_changes_nothing(
    native: Callable[..., Any], oscillator: BlockModel
) -> None:
    fmu = native(oscillator)
    fmu.step(0.0, 0.01)
    before = fmu.fmu.getReal([X, X + 1, FORCE])
    for time, size in ((0.01, 0.0), (0.01, -1.0), (math.nan, 0.1), (0.01, math.inf), (1e308, 1e308)):
        said = fmu.refused(lambda t=time, s=size: fmu.step(t, s))
        assert said == [
            f"unit oscillator: found a step of {size:g} s at {time:g} s, allowed: finite, above 0"
        ]
    assert fmu.refused(lambda: fmu.step(0.01, 1e8)) == [
        "unit oscillator: found a step of 1e+08 s in internal steps of 0.003 s,"
        " allowed: 2147483647 internal steps"
    ]
    assert fmu.fmu.getReal([X, X + 1, FORCE]) == before


@pytest.fixture
def runaway() -> BlockModel:
    """A unit whose state goes out of all bounds if it is pushed."""
    return BlockModel(
        name="runaway",
        description="",
        variables=(
            Input(name="push", description=""),
            State(name="x", description="", start=1.0),
            Output(name="log", description="100 % of it"),
        ),
        outputs=lambda v: {"log": np.log(v.x - v.push)},
        derivatives=lambda v: {"x": v.push * v.x**3},
        internal_step=1e-2,
    )


@pytest.mark.slow
def test_a_step_that_runs_away_is_undone(native: Callable[..., Any], runaway: BlockModel) -> None:
    fmu, instance = native(runaway), Instance(runaway)
    for one in (fmu.fmu.setReal, instance.set):
        one([0], [1e3])
    said = fmu.refused(lambda: fmu.step(0.0, 1.0))
    with pytest.raises(UnitError) as error:
        instance.do_step(0.0, 1.0)
    assert said == [str(error.value)] == ["unit runaway: state x is not finite at 0 s"]
    assert fmu.fmu.getReal([1]) == [1.0]
    assert fmu.refused(lambda: fmu.fmu.getReal([1, 2])) == ["unit runaway: output log is not finite at 0 s"]
    fmu.fmu.setReal([0], [0.0])
    fmu.step(0.0, 1.0)
    assert fmu.fmu.getReal([1, 2]) == [1.0, 0.0]


def test_calls_out_of_their_sequence_are_refused(native: Callable[..., Any], oscillator: BlockModel) -> None:
    one = native(oscillator)
    fmu = one.fmu
    assert one.refused(fmu.enterInitializationMode) == [
        "unit oscillator: fmi2EnterInitializationMode: found a call after fmi2ExitInitializationMode"
        " and before fmi2Terminate, allowed: before fmi2EnterInitializationMode"
    ]
    fmu.terminate()
    assert one.refused(lambda: one.step(0.0, 0.1)) == [
        "unit oscillator: fmi2DoStep: found a call after fmi2Terminate,"
        " allowed: after fmi2ExitInitializationMode and before fmi2Terminate"
    ]
    assert one.refused(lambda: fmu.setReal([GOAL], [1.0])) == [
        "unit oscillator: fmi2SetReal: found a call after fmi2Terminate, allowed: before fmi2Terminate"
    ]
    fmu.reset()
    assert one.refused(fmu.exitInitializationMode) == [
        "unit oscillator: fmi2ExitInitializationMode: found a call before fmi2EnterInitializationMode,"
        " allowed: in initialization mode"
    ]
    assert one.refused(lambda: fmu.setupExperiment(startTime=math.inf)) == [
        "unit oscillator: startTime: found inf, allowed: a finite number"
    ]
    assert one.refused(lambda: fmu.setupExperiment(startTime=1.0, stopTime=0.5)) == [
        "unit oscillator: stopTime: found 0.5, allowed: from the start time 1 on"
    ]
    fmu.setupExperiment(startTime=1.0)


def test_a_step_past_the_stop_time_is_refused(native: Callable[..., Any], oscillator: BlockModel) -> None:
    one = native(oscillator)

    def begin(**experiment: float) -> None:
        one.fmu.reset()
        if experiment:
            one.fmu.setupExperiment(**experiment)
        one.fmu.enterInitializationMode()
        one.fmu.exitInitializationMode()

    begin(startTime=0.0, stopTime=0.5)
    one.step(0.0, 0.4)
    one.step(0.4, 0.1001)  # what rounding may add
    before = one.fmu.getReal([X, FORCE])
    assert one.refused(lambda: one.step(0.5001, 0.25)) == [
        "unit oscillator: found a step to 0.7501 s, allowed: to the stop time, 0.5 s"
    ]
    assert one.fmu.getReal([X, FORCE]) == before
    begin()
    one.step(0.0, 0.75)
    begin(startTime=0.0, stopTime=0.5)
    begin(startTime=0.5)
    one.step(0.5, 0.25)


def test_what_it_cannot_do_is_said(native: Callable[..., Any], oscillator: BlockModel) -> None:
    one = native(oscillator)
    fmu = one.fmu
    for name, call in (
        ("fmi2GetDirectionalDerivative", lambda: fmu.getDirectionalDerivative([FORCE], [GOAL], [1.0])),
        ("fmi2SetRealInputDerivatives", lambda: fmu.setRealInputDerivatives([GOAL], [1], [1.0])),
        ("fmi2GetRealOutputDerivatives", lambda: fmu.getRealOutputDerivatives([FORCE], [1])),
    ):
        assert one.refused(call) == [
            f"unit oscillator: {name}: found a call, allowed: what the model description says the FMU can do"
        ]
    assert one.refused(lambda: fmu.fmi2CancelStep(fmu.component)) == [
        "unit oscillator: fmi2CancelStep: found no step that runs, allowed: while fmi2DoStep is pending"
    ]
    one.step(0.0, 0.5)
    time, done, ended = ctypes.c_double(), ctypes.c_int(9), ctypes.c_int(9)
    fmu.fmi2GetRealStatus(fmu.component, 2, ctypes.byref(time))
    fmu.fmi2GetStatus(fmu.component, 0, ctypes.byref(done))
    fmu.fmi2GetBooleanStatus(fmu.component, 3, ctypes.byref(ended))
    assert (time.value, done.value, ended.value) == (0.5, 0, 0)
    assert (fmu.getTypesPlatform(), fmu.getVersion()) == ("default", "2.0")


def failed_instance(folder: Path, name: str, blocks: int | None = None, **options: Any) -> list[str]:
    """What is told when an instance cannot be made: where there is memory for some blocks only, or at all."""
    from fmpy import fmi2

    said: list[str] = []
    held: set[int] = set()

    def take(_environment: Any, instance: bytes, _status: int, _category: bytes, message: bytes) -> None:
        assert instance == b"one"
        said.append(message.decode())

    def allocate(count: int, size: int) -> int | None:
        if blocks is not None and len(held) >= blocks:
            return None
        block: int = fmi2.calloc(count, size)
        held.add(block)
        return block

    def free(block: int) -> None:
        held.remove(block)
        fmi2.free(block)

    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(take)
    callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(allocate)
    callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
    given = {"guid": "{12345678-0000-0000-0000-000000000000}", "unzipDirectory": str(folder)} | options
    fmu = fmi2.FMU2Slave(modelIdentifier=name, instanceName="one", **given)
    with pytest.raises(Exception, match="Failed to instantiate model"):
        fmu.instantiate(callbacks=callbacks)
    fmu.freeLibrary()
    assert not held
    return said


@pytest.mark.slow
def test_where_there_is_no_memory_there_is_no_instance_and_nothing_is_kept(
    built: Callable[..., Path], player: BlockModel
) -> None:
    folder = built(player)
    (said,) = failed_instance(folder, "player", blocks=0)
    assert said.startswith("unit player: found no memory for an instance, allowed: ")
    assert failed_instance(folder, "player", blocks=1) == [
        "unit player: found no memory for the name of an instance"
    ]
    assert failed_instance(folder, "player", blocks=2) == [
        f"unit player: table.bin in {(folder / 'resources').as_uri()}: found no memory for its rows"
    ]


def test_a_long_message_ends_with_a_whole_character(
    built: Callable[..., Path], oscillator: BlockModel
) -> None:
    for start in ("{", "{a"):
        (said,) = failed_instance(built(oscillator), "oscillator", guid=start + "\u00fc" * 5000)
        assert said.startswith(f"unit oscillator: GUID: found {start}\u00fc")
        assert len(said.encode()) in (1997, 1998)
        assert said.endswith("\u00fc")


def test_another_guid_is_refused(built: Callable[..., Path], oscillator: BlockModel) -> None:
    assert failed_instance(built(oscillator), "oscillator", guid="{5}%") == [
        "unit oscillator: GUID: found {5}%%, allowed: {12345678-0000-0000-0000-000000000000}"
    ]


def test_a_table_that_is_missing_cut_or_foreign_is_refused(
    built: Callable[..., Path], player: BlockModel
) -> None:
    folder = built(player)
    table = folder / "resources" / "table.bin"
    content = table.read_bytes()
    place = f"unit player: table.bin in {(folder / 'resources').as_uri()}: "

    def said_of(changed: bytes | None) -> str:
        table.unlink(missing_ok=True)
        if changed is not None:
            table.write_bytes(changed)
        (said,) = failed_instance(folder, "player")
        return said.removeprefix(place)

    nan = np.float64(np.nan).tobytes()
    assert said_of(None) == "cannot be opened, allowed: the file that the FMU was built with"
    assert said_of(b"t,q\n") == "found another kind of file, allowed: a table of urmpipe, version 1"
    assert said_of(content[:8] + b"\2" + content[9:]) == (
        "found another kind of file, allowed: a table of urmpipe, version 1"
    )
    assert said_of(content[:-1]) == "found its end too early, allowed: all rows that it names"
    assert said_of(content + b"\0") == "found more after its last row, allowed: the rows that it names"
    assert said_of(content[:24] + b"\3" + content[25:]) == (
        "found another number of columns, allowed: that of the model's table"
    )
    assert (
        said_of(content[:16] + bytes(8) + content[24:])
        == "found no rows or too many, allowed: 1 to 2147483647"
    )
    assert said_of(content[:-8] + nan) == "found a value that is not finite, allowed: finite ones"
    swapped = content[:40] + content[48:56] + content[40:48] + content[56:]
    assert said_of(swapped) == "found times that fall, allowed: rising ones"


def first_value(folder: Path, resources: str | None) -> float | None:
    """What the player shows at 0 s if it is told that its resources are somewhere; None if it is not made."""
    (path,) = folder.glob("binaries/*/player*")
    library = ctypes.CDLL(str(path))
    library.fmi2Instantiate.restype = ctypes.c_void_p
    place = None if resources is None else resources.encode()
    guid = b"{12345678-0000-0000-0000-000000000000}"
    made = library.fmi2Instantiate(b"one", 1, guid, place, None, 0, 0)
    if made is None:
        return None
    value = (ctypes.c_double * 1)()
    assert library.fmi2GetReal(ctypes.c_void_p(made), (ctypes.c_uint * 1)(0), ctypes.c_size_t(1), value) == 0
    library.fmi2FreeInstance(ctypes.c_void_p(made))
    return value[0]


def test_resources_are_found_in_any_form_of_a_uri(built: Callable[..., Path], player: BlockModel) -> None:
    folder = built(player, "a folder, 100% \u00fc\u4e2d#")
    resources = folder / "resources"
    uri = resources.as_uri()
    path = uri.removeprefix("file://")
    for form in (uri, f"{uri}/", f"file:{path}", f"file://localhost{path}", str(resources), f"{resources}/"):
        assert first_value(folder, form) == 2.0
    assert first_value(folder, None) is None
    for form in ("", "file:", "file:///nowhere", f"{uri}%", "file:///" + "a" * 5000, "b" * 5000):
        assert first_value(folder, form) is None
