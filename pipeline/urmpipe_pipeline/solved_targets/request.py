"""A request to inverse kinematics: the arm, the targets and the options, and which of them are refused."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, Hint, OptionError, format_value, map_collecting_errors
from urmpipe_models.ik.closed import ClosedForm, closed_form, exact_closed_form
from urmpipe_models.ik.solutions import SearchOptions
from urmpipe_models.ik.solve import METHODS, Method
from urmpipe_models.measure_units import NAMES, WRITTEN, quantity_to_si
from urmpipe_pipeline.solved_targets.given_targets import GivenTargets

TYPED = 1e-3
"""A start beyond a limit by this, in [rad] or [m], is on it: people type limits with few digits."""


@dataclass(frozen=True, slots=True, eq=False)
class Request:
    """What is to be solved, and how.

    Attributes:
        arm: The arm on its base and with its tool.
        given: Where its tool shall be.
        start: Joint values in [rad] or [m], shape (joints,), that solutions are to be near to; None for the
            robot's own.
        every: Whether all solutions are requested.
        within_pi: Whether joints that turn without end are written within -pi to pi.
        method: Which methods are allowed.
        search: How far to search for what does not follow from the start.
    """

    arm: Chain
    given: GivenTargets
    start: FloatArray | None
    every: bool
    within_pi: bool
    method: Method
    search: SearchOptions

    @property
    def form(self) -> ClosedForm | None:
        """The closed form by which the targets are solved, if they are."""
        if self.given.targets.rotation is None or self.method == "iterative":
            return None
        return closed_form(self.arm) if self.given.t_ns is None else exact_closed_form(self.arm)

    @property
    def begin(self) -> FloatArray:
        """Joint values in [rad] and [m] that solutions are to be near to, shape (joints,)."""
        return np.array(self.arm.start, dtype=float) if self.start is None else self.start

    @property
    def options(self) -> dict[str, Any]:
        """The options as a recording keeps them."""
        options = {name: getattr(self, name) for name in ("every", "within_pi", "method")}
        options |= asdict(self.search)
        return options | ({} if self.start is None else {"start": self.start.tolist()})


def check_request(request: Request, *, recorded: bool) -> None:
    """Raise an `OptionError` with every option that makes no sense, alone or with a path."""
    faults = [*_bad_values(request)]
    if not faults and request.given.t_ns is not None:
        faults += [*_not_for_paths(request, recorded)]
    if faults:
        raise OptionError(*faults)


def _bad_values(request: Request) -> Iterator[Finding]:
    """Yield which values make no sense."""
    if request.method not in METHODS:
        yield Finding(parameter="method", found=format_value(request.method), allowed=", ".join(METHODS))
    yield from request.search.faults()


def _not_for_paths(request: Request, recorded: bool) -> Iterator[Finding]:
    """Yield the options that a path does not have."""
    lacks = "positions only" if request.given.targets.rotation is None else "no closed form"
    if request.method == "iterative":
        hint = Hint("method", "auto", "takes the closed form of the arm if it has one")
        yield Finding(parameter="method", found="iterative with a path", allowed="auto", hints=(hint,))
    if request.method == "closed" and request.form is None:
        found = f"closed with a path of {request.arm.name} that has {lacks}"
        yield Finding(parameter="method", found=found, allowed="auto")
    if request.every and request.form is None:
        allowed = "with poses and an arm that has a closed form; or with targets without times"
        found = f"with a path of {request.arm.name} that has {lacks}"
        yield Finding(parameter="every", found=found, allowed=allowed)
    elif request.every and not recorded:
        allowed = "with a recording; or with targets without times"
        hint = Hint("output", "run.rrd", "records every branch as a ghost arm")
        found = "with a path and no recording"
        yield Finding(parameter="every", found=found, allowed=allowed, hints=(hint,))


JointValues: TypeAlias = Sequence[float | str] | FloatArray
"""Joint values in [rad] and [m], or as texts with units, shape (joints,)."""


def start_of(arm: Chain, start: JointValues | None) -> FloatArray | None:
    """Return the start as an array in [rad] and [m], shape (joints,).

    Raises:
        OptionError: If it has not one finite value for each joint, within the joint's limits.
    """
    if start is None:
        return None
    values = joint_values(arm, start, "start")
    beyond = list(_beyond_limits(arm, values))
    if beyond:
        raise OptionError(*beyond)
    return values


def joint_values(arm: Chain, given: JointValues, parameter: str) -> FloatArray:
    """Return joint values as an array in [rad] and [m], shape (joints,).

    Args:
        arm: The arm, whose joints say whether a value is an angle or a length.
        given: The values.
        parameter: The keyword that gave them, for messages.

    Raises:
        OptionError: If there is not one finite value for each joint, or its unit is not the joint's.
    """
    allowed = f"{len(arm.coordinates)} values, one for each of {', '.join(arm.coordinates)}"
    if isinstance(given, (list, tuple)) and len(given) == len(arm.coordinates):
        given = map_collecting_errors(
            partial(_joint_value, parameter), list(zip(arm.moving, given, strict=True))
        )
    try:
        values = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        allowed = f"{allowed}, in rad and m"
        raise OptionError(Finding(parameter=parameter, found=format_value(given), allowed=allowed)) from None
    if values.shape != (len(arm.coordinates),):
        raise OptionError(
            Finding(parameter=parameter, found=format_count(values.size, "value"), allowed=allowed)
        )
    if not np.isfinite(values).all():
        found, allowed = "a value that is not finite", f"{allowed}, in rad and m"
        raise OptionError(Finding(parameter=parameter, found=found, allowed=allowed))
    return values


def _joint_value(parameter: str, given: tuple[Joint, float | str]) -> float:
    """Return the value of one joint; a text is an angle or a length as its joint turns or slides."""
    joint, value = given
    if not isinstance(value, str):
        return value
    si = "m" if joint.kind == "prismatic" else "rad"
    number = quantity_to_si(value, WRITTEN[si])
    if not math.isfinite(number):
        found = f"{joint.name} = {value}"
        raise OptionError(Finding(parameter=parameter, found=found, allowed=NAMES[si]))
    return number


def _beyond_limits(arm: Chain, start: FloatArray) -> Iterator[Finding]:
    """Yield which values of a start the limits of their joints do not allow."""
    for joint, value in zip(arm.moving, start.tolist(), strict=True):
        if not joint.lower - TYPED <= value <= joint.upper + TYPED:
            unit = "rad" if joint.kind == "revolute" else "m"
            is_large = unit == "rad" and abs(value) > 2.0 * math.pi
            degrees = f"; write {value:g}deg if degrees are meant" if is_large else ""
            limits = f"{joint.lower:.6g} to {joint.upper:.6g} {unit}"
            found = f"{joint.name} = {value:g} {unit}"
            yield Finding(parameter="start", found=found, allowed=f"{limits}{degrees}")
