"""Instances of FMUs (`Slave`), and their role in algebraic loops (`LoopMember`, `LoopExchange`).

**Calls** of the loop over the communication points are prepared once: their arguments are fixed addresses,
and what they point to changes. Each call has a code (`job.encode_call`), noted before the call is made.

**Delayed outputs.** FMI lets outputs be read right after inputs are set, but many FMUs compute their outputs
in fmi2DoStep only. The output of such an FMU at t_k for inputs at t_k is its output after the step to t_k
with these inputs: its state before that step is restored, the inputs are set, and the step is repeated.
Whether outputs are delayed is observed: the inputs are perturbed, and the outputs are compared.
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

from urmpipe_fmus.cosim.job import BlockJob, Progress, Transfer, encode_call
from urmpipe_fmus.fmu_file import find_binary
from urmpipe_fmus.process import (
    C_TYPES,
    ERROR,
    FATAL,
    LAST_SUCCESSFUL_TIME,
    OK,
    STATUS_NAMES,
    TERMINATED,
    WARNING,
)

Call = Callable[[], int]  # a prepared call: returns FMI's status

EXCHANGE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p)
DO_STEP = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int)
STATE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
PERTURBATION = 1e-4  # relative change of inputs to observe whether outputs follow


def status_name(status: int) -> str:
    """Return FMI's name of a status."""
    return STATUS_NAMES[status] if 0 <= status < len(STATUS_NAMES) else f"status {status}"


class FmuCallError(Exception):
    """A call of an FMU function failed.

    Attributes:
        code: Block and function, see `encode_call`.
        status: FMI's status; ERROR where the FMU gave none.
    """

    def __init__(self, code: int, message: str, status: int = ERROR) -> None:
        super().__init__(message)
        self.code, self.status = code, status


class Slave:
    """An instance of an FMU.

    Args:
        number: Number of its block.
        block: Its block.
        progress: Each call is noted here before it is made.
        on_warning: Called with the code of each call by `once` that returned fmi2Warning.

    Attributes:
        number: Number of its block.
        block: Its block.
        fatal: Whether it returned fmi2Fatal: no call is allowed.
        failed: Whether it returned fmi2Error: it may only be freed.
        running: Whether it is initialized: only then it may be terminated.
    """

    def __init__(
        self, number: int, block: BlockJob, progress: Progress, on_warning: Callable[[int], None]
    ) -> None:
        self.number, self.block, self._on_warning = number, block, on_warning
        self.note = progress.begin
        self.failed = self.fatal = self.running = False
        self._kept: list[Any] = []  # memory whose addresses are in prepared calls
        self._states: list[ctypes.c_void_p] = []
        code = encode_call(number, "loading")
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
            raise FmuCallError(code, f"cannot be loaded: {error}") from error

    @property
    def _component(self) -> ctypes.c_void_p:
        return ctypes.c_void_p(self._fmu.component)

    def instantiate(self, callbacks: Any) -> None:
        """Create the instance."""
        code = encode_call(self.number, "fmi2Instantiate")
        self.note(code)
        try:
            self._fmu.instantiate(callbacks=callbacks, loggingOn=True)
        except Exception as error:  # FMPy raises Exception itself
            raise FmuCallError(code, "gave no instance") from error

    def once(self, function: str, *arguments: Any) -> None:
        """Make a call without preparation.

        Raises:
            FmuCallError: If it fails.
        """
        code = encode_call(self.number, function)
        self.note(code)
        try:
            if getattr(self._fmu, function)(self._component, *arguments) == WARNING:
                self._on_warning(code)
        except FMICallException as error:
            self.update_allowed_calls(error.status)
            raise FmuCallError(code, f"returned {status_name(error.status)}", error.status) from error

    def _try(self, function: str, *arguments: Any) -> bool:
        """Make a call whose failure changes nothing; return whether it succeeded."""
        with suppress(FmuCallError):
            self.once(function, *arguments)
            return True
        return False

    def update_allowed_calls(self, status: int) -> None:
        """Note which calls a status still allows."""
        self.failed = self.failed or status >= ERROR
        self.fatal = self.fatal or status == FATAL

    def set_start(self) -> None:
        """Set the start values."""
        for kind, reference, value in self.block.starts:
            references = (ctypes.c_uint * 1)(reference)
            to_c: Any = {"Real": float, "String": lambda text: str(text).encode()}.get(kind, int)
            self.once(f"fmi2Set{kind}", references, 1, (C_TYPES[kind] * 1)(to_c(value)))

    def getter(self, transfer: Transfer, values: Mapping[str, NDArray[Any]]) -> tuple[int, Call]:
        """Return the code and the call that reads values into their places, which are neighbours.

        Args:
            transfer: The variables and their places.
            values: Of each FMI type, all values of the system, each in its own unit, shape (places,).
        """
        vector = values[transfer.type]
        target = vector.ctypes.data + transfer.places[0] * vector.itemsize
        return self._exchange(f"fmi2Get{transfer.type}", transfer.references, target)

    def setter(self, transfer: Transfer, values: Mapping[str, NDArray[Any]]) -> tuple[int, Call]:
        """Return the code and the call that sets values from their places.

        Args:
            transfer: The variables and their places.
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
            gather()
            return call()

        return code, gather_and_call

    def _exchange(self, function: str, references: Sequence[int], address: int) -> tuple[int, Call]:
        c_references = (ctypes.c_uint * len(references))(*references)
        self._kept.append(c_references)
        call = partial(
            self._function(EXCHANGE, function),
            self._component,
            ctypes.c_void_p(ctypes.addressof(c_references)),
            ctypes.c_size_t(len(references)),
            ctypes.c_void_p(address),
        )
        return encode_call(self.number, function), call

    def stepper(
        self, time: ctypes.c_double, step: ctypes.c_double, *, keep: bool = False
    ) -> tuple[int, Call]:
        """Return the code and the call that does a step; `keep`: the state before it may be restored."""
        flag = ctypes.c_int(0 if keep else 1)
        call = partial(self._function(DO_STEP, "fmi2DoStep"), self._component, time, step, flag)
        return encode_call(self.number, "fmi2DoStep"), call

    def saver(self, state: ctypes.c_void_p) -> tuple[int, Call]:
        """Return the code and the call that saves the state."""
        self._states.append(state)
        pointer = ctypes.c_void_p(ctypes.addressof(state))
        call = partial(self._function(STATE, "fmi2GetFMUstate"), self._component, pointer)
        return encode_call(self.number, "fmi2GetFMUstate"), call

    def restorer(self, state: ctypes.c_void_p) -> tuple[int, Call]:
        """Return the code and the call that restores a saved state."""
        call = partial(self._function(STATE, "fmi2SetFMUstate"), self._component, state)
        return encode_call(self.number, "fmi2SetFMUstate"), call

    def _function(self, kind: Any, name: str) -> Any:
        """Return a function of the FMU with argument types for which ctypes is fast."""
        return kind(ctypes.cast(getattr(self._fmu.dll, name), ctypes.c_void_p).value)

    def is_terminated(self) -> bool:
        """Return whether a step was discarded to end the simulation."""
        terminated = ctypes.c_int(0)
        self._try("fmi2GetBooleanStatus", TERMINATED, ctypes.byref(terminated))
        return bool(terminated.value)

    def last_successful_time(self) -> float:
        """Return the time in [s] that a discarded step reached; nan if the FMU does not state it."""
        time = ctypes.c_double()
        stated = self._try("fmi2GetRealStatus", LAST_SUCCESSFUL_TIME, ctypes.byref(time))
        return time.value if stated else math.nan

    def end(self) -> None:
        """Terminate and free the instance, if its status allows it."""
        if self.fatal or not self._fmu.component:
            return
        if self.running and not self.failed:
            self._try("fmi2Terminate")
        for state in self._states:
            if state.value and not self.fatal:
                self._try("fmi2FreeFMUstate", ctypes.byref(state))
        if self.fatal:
            return
        self.note(encode_call(self.number, "fmi2FreeInstance"))
        self._fmu.fmi2FreeInstance(self._component)


class LoopMember:
    """A block in a loop that can save its state, and so repeat its step.

    Args:
        slave: The block.
        time: Current communication point in [s], updated by the caller.
        step: Step to the next one in [s], updated by the caller.
        check: Called with code and status of a call that did not return fmi2OK.

    Attributes:
        delayed: Whether its outputs follow its inputs only after a step; None: not observed yet.
    """

    def __init__(
        self,
        slave: Slave,
        time: ctypes.c_double,
        step: ctypes.c_double,
        check: Callable[[int, int], None],
    ) -> None:
        self.delayed: bool | None = None
        self._slave, self._check = slave, check
        self._time, self._step = time, step
        self._last_time, self._last_step = ctypes.c_double(), ctypes.c_double()
        self._state, self._kept_state = ctypes.c_void_p(), ctypes.c_void_p()
        self._stepped = False
        self._do_step = slave.stepper(self._time, self._step, keep=True)
        self._repeat_step = slave.stepper(self._last_time, self._last_step, keep=True)
        self._save, self._keep = slave.saver(self._state), slave.saver(self._kept_state)

    def step(self) -> int:
        """Do the step to the next communication point, and save the state before; return FMI's status OK."""
        if self.delayed is not False:
            self._call(self._save)
        self._last_time.value, self._last_step.value = self._time.value, self._step.value
        self._call(self._do_step)
        self._stepped = True
        return OK

    @property
    def is_undecided(self) -> bool:
        """Whether it has done a step, and it is not known whether its outputs are delayed."""
        return self.delayed is None and self._stepped

    def step_again(self, sets: Callable[[], None]) -> None:
        """Repeat the last step with other inputs."""
        self._call(self._slave.restorer(self._state))
        sets()
        self._call(self._repeat_step)

    def keep(self) -> None:
        """Keep the current state."""
        self._call(self._keep)

    def return_to_kept(self) -> None:
        """Restore the state that was kept."""
        self._call(self._slave.restorer(self._kept_state))

    def _call(self, prepared: tuple[int, Call]) -> None:
        code, call = prepared
        self._slave.note(code)
        status = call()
        if status:
            self._check(code, status)


class LoopVariables(NamedTuple):
    """Inputs and outputs of a block in a loop.

    Attributes:
        values: The vector of the Reals, each in its own unit, shape (reals,).
        places: Places of the inputs that the loop changes, shape (inputs,).
        minimum: Their minimum, each in its own unit, shape (inputs,).
        maximum: Their maximum, each in its own unit, shape (inputs,).
        outputs: The outputs that may follow them, each in its own unit, shape (outputs of a type,) by type.
    """

    values: NDArray[np.float64]
    places: NDArray[np.intp]
    minimum: NDArray[np.float64]
    maximum: NDArray[np.float64]
    outputs: Sequence[NDArray[Any]]


class LoopExchange:
    """An exchange of a block in a loop: called, it sets its inputs and reads its outputs.

    Args:
        member: The block, if it can repeat its step.
        sets: Sets its inputs.
        gets: Reads its outputs.
        variables: Its inputs and outputs in the loop.

    Attributes:
        followed: Whether its outputs were ever observed to follow its inputs, at once or after a step.
    """

    def __init__(
        self,
        member: LoopMember | None,
        sets: Callable[[], None],
        gets: Callable[[], None],
        variables: LoopVariables,
    ) -> None:
        self._member, self._sets, self._gets, self._variables = member, sets, gets, variables
        self.followed = not len(variables.places)

    def __call__(self) -> None:
        """Set the inputs and read the outputs that follow from them."""
        if not self.followed:
            self._observe()
        if self._member is not None and self._member.delayed:
            self._member.step_again(self._sets)
        else:
            self._sets()
        self._gets()

    def reset(self) -> None:
        """Discard the observations before the first step: until then an FMU may compute outputs at once."""
        self.followed = not len(self._variables.places)
        if self._member is not None:
            self._member.delayed = None

    def _observe(self) -> None:
        """Observe whether the outputs follow the inputs at once, or only after a step.

        If they do neither, the inputs may have no effect at this instant: the next one is observed again.
        """
        member = self._member
        if member is not None and member.delayed:
            self.followed = True  # another exchange of the block observed it
        elif self._is_followed(self._sets):
            self.followed = True
            if member is not None:
                member.delayed = bool(member.delayed)
        elif member is not None and member.is_undecided:
            member.keep()
            if self._is_followed(lambda: member.step_again(self._sets)):
                member.delayed = self.followed = True
            member.return_to_kept()

    def _is_followed(self, apply: Callable[[], None]) -> bool:
        """Return whether the outputs change with perturbed inputs."""
        values, places, minimum, maximum, outputs = self._variables
        observed = []
        inputs = values[places].copy()
        change = PERTURBATION * (1.0 + np.abs(inputs))
        perturbed = np.where(inputs + change > maximum, np.maximum(inputs - change, minimum), inputs + change)
        for candidate in (perturbed, inputs):
            values[places] = candidate
            apply()
            self._gets()
            observed.append([output.copy() for output in outputs])
        return any(not np.array_equal(a, b) for a, b in zip(*observed, strict=True))
