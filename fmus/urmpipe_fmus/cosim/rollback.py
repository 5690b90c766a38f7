"""Blocks in algebraic loops whose outputs follow their inputs only after a step: they go back and step again.

FMI lets outputs be read right after inputs are set, but many an FMU computes its outputs in fmi2DoStep
alone. What such an FMU gives at t_k for inputs at t_k is what it gives after the step to t_k with these
inputs: its state before that step is restored, the inputs are set, and the step is done again.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe_fmus.cosim.slave import OK, Call, Slave

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
