"""What pythonfmu's binary calls: an instance of a unit, and how it says no.

The binary (pythonfmu 0.7, PySlaveInstance.cpp) knows two answers of a getter or setter: a result, or an
exception, which it turns into fmi2Fatal with the exception's repr as message. After an exception it gives
back the references that it has to the class, to the instance and to the list of messages, and keeps on using
them: the next calls would meet freed memory. So each of them is given one more before an exception goes out.
"""

from __future__ import annotations

import ctypes
import json
from collections.abc import Callable, Sequence
from functools import wraps
from math import isfinite
from typing import Any, ClassVar, NamedTuple

from urmpipe_fmus.block import MAX_INTEGER, BlockModel, ValueType
from urmpipe_fmus.instance import Instance
from urmpipe_models.errors import UnitError

ERROR = 3
"""fmi2Error."""


class Message(NamedTuple):
    """A message for the tool's log, as the binary reads it."""

    status: int
    category: str
    msg: str


class RefusedError(Exception):
    """A call is refused; its repr is the message."""

    def __repr__(self) -> str:
        return str(self)


class Unreadable(NamedTuple):
    """What was read from bytes that hold no state; it is refused when it is set."""

    why: str


def guarded(method: Callable[..., Any]) -> Callable[..., Any]:
    """Make a method raise nothing but `RefusedError`, and leave the binary's references whole."""

    @wraps(method)
    def call(self: Fmi2Slave, *arguments: Any) -> Any:
        """Call the method; give back the references that the binary drops when a call is refused."""
        try:
            return method(self, *arguments)
        except BaseException as error:  # an interrupt too must not pass the binary unguarded
            said = self.told(error)
        for one in (type(self), self, self.log_queue):
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(one))
        raise RefusedError(said)

    return call


class Fmi2Slave:
    """An instance of a unit behind pythonfmu's binary, which looks for a class derived from one of this name.

    Attributes:
        unit: The unit.
        instance: Its state, and the rules of a step.
        log_queue: Messages for the log; the binary empties it at the end of each call.
    """

    unit: ClassVar[BlockModel]

    def __init__(self, **_: Any) -> None:
        self.instance = Instance(self.unit)
        self.log_queue: list[Message] = []

    def told(self, error: BaseException) -> str:
        """Return what an error says, fit for a log that takes it for a format of C's printf."""
        text = str(error) if isinstance(error, UnitError) else f"{type(error).__name__}: {error}"
        start = f"unit {self.unit.name}: "
        text = text if start in text else start + text
        return text.encode("utf-8", "backslashreplace").decode().replace("%", "%%")

    @guarded
    def setup_experiment(self, start_time: float, stop_time: float | None = None, *_: Any) -> None:
        """Put it at the start time, and say where the simulation ends, in [s]."""
        self.instance.setup_experiment(start_time, stop_time)

    def enter_initialization_mode(self) -> None:
        """Nothing is to be computed: getters do."""

    def exit_initialization_mode(self) -> None:
        """Nothing is to be computed: getters do."""

    def terminate(self) -> None:
        """Nothing is to be closed."""

    def do_step(self, time: float, step: float) -> bool:
        """Go one step; if that fails nothing has changed, the reason is logged, and False is fmi2Discard."""
        try:
            self.instance.do_step(time, step)
        except BaseException as error:  # see `guarded`
            self.log_queue.append(Message(ERROR, "logStatusError", self.told(error)))
            return False
        return True

    @guarded
    def get_real(self, references: Sequence[int]) -> list[float]:
        """Return values of Reals."""
        return [float(one) for one in self._got(references, "Real")]

    @guarded
    def get_integer(self, references: Sequence[int]) -> list[int]:
        """Return values of Integers: of what was computed the nearest one, of two the even one."""
        found = [round(float(one)) for one in self._got(references, "Integer")]
        for reference, one in zip(references, found, strict=True):
            if abs(one) > MAX_INTEGER:
                raise UnitError(f"{self._name(reference)}: found {one}, allowed: an integer of 32 bits")
        return found

    @guarded
    def get_boolean(self, references: Sequence[int]) -> list[bool]:
        """Return values of Booleans: of what was computed all but 0 is true."""
        return [bool(one != 0.0) for one in self._got(references, "Boolean")]

    @guarded
    def get_string(self, references: Sequence[int]) -> list[str]:
        """Refuse: no unit has a String."""
        return self._no_strings(references)

    @guarded
    def set_real(self, references: Sequence[int], values: Sequence[float]) -> None:
        """Set Reals: all of them, or none."""
        self._put(references, values, "Real")

    @guarded
    def set_integer(self, references: Sequence[int], values: Sequence[int]) -> None:
        """Set Integers: all of them, or none."""
        self._put(references, [float(one) for one in values], "Integer")

    @guarded
    def set_boolean(self, references: Sequence[int], values: Sequence[bool]) -> None:
        """Set Booleans: all of them, or none."""
        self._put(references, [float(one) for one in values], "Boolean")

    @guarded
    def set_string(self, references: Sequence[int], values: Sequence[str]) -> None:
        """Refuse: no unit has a String."""
        self._no_strings(references)

    def _get_log_queue(self) -> list[Message]:
        return self.log_queue

    def _get_fmu_state(self) -> Any:
        return self.instance.save()

    @guarded
    def _set_fmu_state(self, state: Any) -> None:
        if isinstance(state, Unreadable):
            raise UnitError(state.why)
        self.instance.restore(state)

    @classmethod
    def _fmu_state_to_bytes(cls, state: Any) -> bytes:
        time, running, values = state
        numbers = [float(time), *(float(one) for one in values)]
        return json.dumps([cls.unit.name, bool(running), numbers]).encode()

    @classmethod
    def _fmu_state_from_bytes(cls, content: bytes) -> Any:
        """Return the state; this must not raise, as it knows no instance to guard."""
        try:
            name, running, (time, *values) = json.loads(content)
            numbers = [float(one) for one in (time, *values)]
            if (name, len(values)) == (cls.unit.name, len(cls.unit.scalars)) and all(map(isfinite, numbers)):
                return numbers[0], bool(running), numbers[1:]
        except (ValueError, TypeError):
            pass
        return Unreadable("serializedState: found other bytes, allowed: those of a state of this FMU")

    def _got(self, references: Sequence[int], kind: ValueType) -> list[Any]:
        known = self._known(references, kind, "Get")
        return self.instance.get(known)

    def _put(self, references: Sequence[int], values: Sequence[float], kind: ValueType) -> None:
        self.instance.set(self._known(references, kind, "Set"), values)

    def _known(self, references: Sequence[int], kind: ValueType, verb: str) -> list[int]:
        """Return references as they were given (the binary makes large ones negative), all of one type."""
        known = [one % 2**32 for one in references]
        wrong = [
            f"unit {self.unit.name}: {name}: found fmi2{verb}{kind}, allowed: fmi2{verb}{one.type}"
            for name, one in (self.unit.scalars[k] for k in known if k < len(self.unit.scalars))
            if one.type != kind
        ]
        if wrong:
            raise UnitError(*wrong)
        return known

    def _name(self, reference: int) -> str:
        return self.unit.scalars[reference][0]

    def _no_strings(self, references: Sequence[int]) -> list[str]:
        if references:
            raise UnitError("found a String, allowed: Real, Integer and Boolean variables")
        return []
