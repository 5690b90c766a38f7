"""One FMU in its process: FMPy's functions, called with arguments that were prepared once.

Blocks in algebraic loops whose outputs follow their inputs only after a step: they go back and step again.

FMI lets outputs be read right after inputs are set, but many an FMU computes its outputs in fmi2DoStep
alone. What such an FMU gives at t_k for inputs at t_k is what it gives after the step to t_k with these
inputs: its state before that step is restored, the inputs are set, and the step is done again.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from numpy.typing import NDArray

from urmpipe_fmus.cosim.job import BlockJob, Progress, Transfer, call_code
from urmpipe_fmus.fmu_file import find_binary

Call = Callable[[], int]
"""A prepared call: returns FMI's status."""

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
"""fmi2Status (FMI 2.0.4, section 2.1.3)."""

STATUS_NAMES = ("fmi2OK", "fmi2Warning", "fmi2Discard", "fmi2Error", "fmi2Fatal", "fmi2Pending")

LAST_SUCCESSFUL_TIME, TERMINATED = 2, 3
"""Of fmi2StatusKind (FMI 2.0.4, section 4.2.3)."""

EXCHANGE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p)
DO_STEP = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int)
STATE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)

ELEMENTS: dict[str, Any] = {"Real": ctypes.c_double, "Integer": ctypes.c_int, "Boolean": ctypes.c_int}


class FmuFailed(Exception):  # noqa: N818 - it ends the run, and is told as a result
    """An FMU did not do what it was asked.

    Attributes:
        code: Block and function.
        said: What happened.
        status: FMI's status; ERROR where the FMU gave none.
    """

    def __init__(self, code: int, said: str, status: int = ERROR) -> None:
        super().__init__(said)
        self.code, self.said, self.status = code, said, status


class Slave:
    """An instance of an FMU.

    Args:
        number: Number of its block.
        block: Its block.
        progress: Where each call is noted before it is made.
        warned: Told each call by `once` that returned fmi2Warning.

    Attributes:
        number: Number of its block.
        block: Its block.
        fatal: Whether it said fmi2Fatal: nothing may be called any more.
        failed: Whether it said fmi2Error: it may only be freed.
        running: Whether it is initialized: only then it may be terminated.
    """

    def __init__(
        self, number: int, block: BlockJob, progress: Progress, warned: Callable[[int], None]
    ) -> None:
        self.number, self.block, self._warned = number, block, warned
        self.note = progress.begin
        self.failed = self.fatal = self.running = False
        self._kept: list[Any] = []
        self._states: list[ctypes.c_void_p] = []
        code = call_code(number, "loading")
        self.note(code)
        try:
            self._fmu = FMU2Slave(
                guid=block.guid,
                unzipDirectory=str(block.folder),
                modelIdentifier=block.identifier,
                libraryPath=str(find_binary(block.folder, block.identifier)),
                instanceName=block.name,
            )
        except Exception as error:  # FMPy raises Exception itself, ctypes OSError and AttributeError
            raise FmuFailed(code, f"cannot be loaded: {error}") from error

    @property
    def _component(self) -> ctypes.c_void_p:
        return ctypes.c_void_p(self._fmu.component)

    def instantiate(self, callbacks: Any) -> None:
        """Make the instance."""
        code = call_code(self.number, "fmi2Instantiate")
        self.note(code)
        try:
            self._fmu.instantiate(callbacks=callbacks, loggingOn=True)
        except Exception as error:  # FMPy raises Exception itself
            raise FmuFailed(code, "gave no instance") from error

    def once(self, function: str, *arguments: Any) -> None:
        """Call a function that is not worth preparing."""
        code = call_code(self.number, function)
        self.note(code)
        try:
            if getattr(self._fmu, function)(self._component, *arguments) == WARNING:
                self._warned(code)
        except FMICallException as error:
            self.blame(error.status)
            raise FmuFailed(code, f"returned {status_name(error.status)}", error.status) from error

    def blame(self, status: int) -> None:
        """Remember what may still be called after a status."""
        self.failed = self.failed or status >= ERROR
        self.fatal = self.fatal or status == FATAL

    def set_start(self) -> None:
        """Set the start values."""
        for kind, reference, value in self.block.starts:
            references = (ctypes.c_uint * 1)(reference)
            held: Any = (ctypes.c_char_p * 1)(str(value).encode()) if kind == "String" else None
            if held is None:
                held = (ELEMENTS[kind] * 1)(value if kind == "Real" else int(value))
            self.once(f"fmi2Set{kind}", references, 1, held)

    def getter(self, transfer: Transfer, values: Mapping[str, NDArray[Any]]) -> tuple[int, Call]:
        """Return the code and the call that reads values into their places, which are neighbours.

        Args:
            transfer: Which variables, and where they stand.
            values: Of each FMI type, all values of the system, each in its own unit, shape (places,).
        """
        vector = values[transfer.type]
        target = vector.ctypes.data + transfer.places[0] * vector.itemsize
        return self._exchange(f"fmi2Get{transfer.type}", transfer.references, target)

    def setter(self, transfer: Transfer, values: Mapping[str, NDArray[Any]]) -> tuple[int, Call]:
        """Return the code and the call that sets values from their places.

        Args:
            transfer: Which variables, and where they stand.
            values: Of each FMI type, all values of the system, each in its own unit, shape (places,).
        """
        vector, places = values[transfer.type], transfer.places
        function = f"fmi2Set{transfer.type}"
        if all(b == a + 1 for a, b in pairwise(places)):
            source = vector.ctypes.data + places[0] * vector.itemsize
            return self._exchange(function, transfer.references, source)
        gathered = np.empty(len(places), vector.dtype)
        self._kept.append(gathered)
        code, call = self._exchange(function, transfer.references, gathered.ctypes.data)
        gather = partial(vector.take, np.array(places), None, gathered, "clip")

        def gather_and_call() -> int:
            """Bring the values together from their places, then set them; return the status."""
            gather()
            return call()

        return code, gather_and_call

    def _exchange(self, function: str, references: Sequence[int], address: int) -> tuple[int, Call]:
        held = (ctypes.c_uint * len(references))(*references)
        self._kept.append(held)
        call = partial(
            self._function(EXCHANGE, function),
            self._component,
            ctypes.c_void_p(ctypes.addressof(held)),
            ctypes.c_size_t(len(references)),
            ctypes.c_void_p(address),
        )
        return call_code(self.number, function), call

    def stepper(
        self, time: ctypes.c_double, step: ctypes.c_double, *, keep: bool = False
    ) -> tuple[int, Call]:
        """Return the code and the call that does a step; `keep`: the state before it may be restored."""
        flag = ctypes.c_int(0 if keep else 1)
        call = partial(self._function(DO_STEP, "fmi2DoStep"), self._component, time, step, flag)
        return call_code(self.number, "fmi2DoStep"), call

    def saver(self, state: ctypes.c_void_p) -> tuple[int, Call]:
        """Return the code and the call that saves the state to a place."""
        self._states.append(state)
        pointer = ctypes.c_void_p(ctypes.addressof(state))
        call = partial(self._function(STATE, "fmi2GetFMUstate"), self._component, pointer)
        return call_code(self.number, "fmi2GetFMUstate"), call

    def restorer(self, state: ctypes.c_void_p) -> tuple[int, Call]:
        """Return the code and the call that restores the state from a place."""
        call = partial(self._function(STATE, "fmi2SetFMUstate"), self._component, state)
        return call_code(self.number, "fmi2SetFMUstate"), call

    def _function(self, kind: Any, name: str) -> Any:
        """Return a function of the FMU with argument types that ctypes is quick with."""
        return kind(ctypes.cast(getattr(self._fmu.dll, name), ctypes.c_void_p).value)

    def terminated(self) -> bool:
        """Return whether a discarded step means that the FMU wants to end the simulation."""
        ended = ctypes.c_int(0)
        self._try("fmi2GetBooleanStatus", TERMINATED, ctypes.byref(ended))
        return bool(ended.value)

    def last_successful_time(self) -> float:
        """Return in [s] how far a discarded step came; nan if the FMU does not tell."""
        time = ctypes.c_double()
        told = self._try("fmi2GetRealStatus", LAST_SUCCESSFUL_TIME, ctypes.byref(time))
        return time.value if told else math.nan

    def end(self) -> None:
        """Terminate and free the instance, as far as its status lets it."""
        if self.fatal or not self._fmu.component:
            return
        if self.running and not self.failed:
            self._try("fmi2Terminate")
        for state in self._states:
            if state.value and not self.fatal:
                self._try("fmi2FreeFMUstate", ctypes.byref(state))
        if self.fatal:
            return
        self.note(call_code(self.number, "fmi2FreeInstance"))
        self._fmu.fmi2FreeInstance(self._component)

    def _try(self, function: str, *arguments: Any) -> bool:
        """Call a function whose failure changes nothing; return whether it did what it is for."""
        with suppress(FmuFailed):
            self.once(function, *arguments)
            return True
        return False


def status_name(status: int) -> str:
    """Return FMI's name of a status."""
    return STATUS_NAMES[status] if 0 <= status < len(STATUS_NAMES) else f"status {status}"


NUDGE = 1e-4
"""Relative: by how much inputs are moved to see whether outputs follow."""


class Member:
    """A block in a loop that can save its state.

    Args:
        slave: The block.
        time: The communication point in [s], as it stands.
        step: To the next one in [s], as it stands.
        check: Told block, function and status of a call.

    Attributes:
        stale: Whether its outputs follow its inputs only after a step; None: not seen yet.
    """

    def __init__(
        self,
        slave: Slave,
        time: ctypes.c_double,
        step: ctypes.c_double,
        check: Callable[[int, int], None],
    ) -> None:
        self.stale: bool | None = None
        self._slave, self._check = slave, check
        self._now, self._length = time, step
        self._then, self._back = ctypes.c_double(), ctypes.c_double()
        self._state, self._aside = ctypes.c_void_p(), ctypes.c_void_p()
        self._stepped = False
        self._forward = slave.stepper(self._now, self._length, keep=True)
        self._again = slave.stepper(self._then, self._back, keep=True)
        self._save, self._set_aside = slave.saver(self._state), slave.saver(self._aside)

    def step(self) -> int:
        """Do the step to the next communication point; its start is remembered. Returns FMI's status OK."""
        if self.stale is not False:
            self._call(self._save)
        self._then.value, self._back.value = self._now.value, self._length.value
        self._call(self._forward)
        self._stepped = True
        return OK

    @property
    def undecided(self) -> bool:
        """Whether it is still to be seen if its outputs follow its inputs only after a step."""
        return self.stale is None and self._stepped

    def step_again(self, sets: Callable[[], None]) -> None:
        """Do the last step again with other inputs."""
        self._call(self._slave.restorer(self._state))
        sets()
        self._call(self._again)

    def keep(self) -> None:
        """Set the state aside as it is."""
        self._call(self._set_aside)

    def return_to_kept(self) -> None:
        """Restore the state that was set aside."""
        self._call(self._slave.restorer(self._aside))

    def _call(self, prepared: tuple[int, Call]) -> None:
        code, call = prepared
        self._slave.note(code)
        status = call()
        if status:
            self._check(code, status)


class Moved(NamedTuple):
    """What a loop moves of a block.

    Attributes:
        values: The vector of the Reals, each in its own unit, shape (reals,).
        places: Where the inputs that the loop moves stand in it, shape (moved,).
        minimum: The least values that they may have, each in its own unit, shape (moved,).
        maximum: The largest, likewise.
        read: The outputs that may follow them, each in its own unit, shape (outputs of a type,) by type.
    """

    values: NDArray[np.float64]
    places: NDArray[np.intp]
    minimum: NDArray[np.float64]
    maximum: NDArray[np.float64]
    read: Sequence[NDArray[Any]]


class Exchange:
    """An exchange of a block in a loop: called, it sets its inputs and reads its outputs.

    Args:
        member: The block, if it can go back.
        sets: Sets its inputs.
        gets: Reads its outputs.
        moved: What the loop moves of it.

    Attributes:
        followed: Whether its outputs were ever seen to follow its inputs, at once or after a step.
    """

    def __init__(
        self, member: Member | None, sets: Callable[[], None], gets: Callable[[], None], moved: Moved
    ) -> None:
        self._member, self._sets, self._gets, self._moved = member, sets, gets, moved
        self.followed = not len(moved.places)

    def __call__(self) -> None:
        """Set the inputs and read the outputs that they give."""
        if not self.followed:
            self._decide()
        if self._member is not None and self._member.stale:
            self._member.step_again(self._sets)
        else:
            self._sets()
        self._gets()

    def begin(self) -> None:
        """Forget what was seen before the first step: an FMU may compute its outputs at once until then."""
        self.followed = not len(self._moved.places)
        if self._member is not None:
            self._member.stale = None

    def _decide(self) -> None:
        """See whether the outputs follow the inputs at once, or only after a step.

        If they follow neither way the inputs may not matter at this instant: it is seen again at the next.
        """
        member = self._member
        if member is not None and member.stale:
            self.followed = True  # another of its exchanges saw it
        elif self._follow(self._sets):
            self.followed = True
            if member is not None:
                member.stale = bool(member.stale)
        elif member is not None and member.undecided:
            member.keep()
            if self._follow(lambda: member.step_again(self._sets)):
                member.stale = self.followed = True
            member.return_to_kept()

    def _follow(self, apply: Callable[[], None]) -> bool:
        """Return whether the outputs change when the inputs are moved a little."""
        values, places, minimum, maximum, read = self._moved
        found = []
        inputs = values[places].copy()
        nudge = NUDGE * (1.0 + np.abs(inputs))
        nudged = np.where(inputs + nudge > maximum, np.maximum(inputs - nudge, minimum), inputs + nudge)
        for moved in (nudged, inputs):
            values[places] = moved
            apply()
            self._gets()
            found.append([one.copy() for one in read])
        return any(not np.array_equal(a, b) for a, b in zip(*found, strict=True))
