"""From drives by name to a motion: which variables are prescribed, which follow, and where it begins.

1. `find_driven`: controls and joint variables by name.
2. `split_variables`: which variables follow. Controls without a drive keep their value; if joints are
   driven in their place, controls follow.
3. `move_to`: from an assembly along a straight line of the drives to where the motion begins.
4. `drive_line`, `drive_rows`: the motion along a line or along the rows of a log (`motion`, `row_motion`).
5. `compute_shares`: how far along the line it is over time.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from urmpipe_models.arrays import FloatArray, IndexArray
from urmpipe_models.errors import Finding, NetworkError
from urmpipe_models.names import not_among
from urmpipe_models.networks.idle_spins import idle_spins, spinning_parts, unspun
from urmpipe_models.networks.mechanism import Mechanism
from urmpipe_models.networks.mobility import mobility_nearby
from urmpipe_models.networks.motion import SINGULAR, Drive, LimitStop, SingularPose, Trace, sample, trace
from urmpipe_models.networks.row_motion import follow

Law = Literal["uniform", "trapezoid", "quintic"]
LAWS: tuple[Law, ...] = get_args(Law)

SAME_PLACE = 1e-9  # scaled distance of drives below which two values are the same


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """The prescribed variables of a network.

    Attributes:
        names: Their names, as they are given.
        places: Their numbers among the variables, shape (driven,) [-].
        units: rad, m, or "" of a control that drives neither an angle nor a length by itself.
    """

    names: tuple[str, ...]
    places: IndexArray
    units: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Configurations of a network along its drives, on one branch.

    Attributes:
        x: The variables, shape (variables, n), in [m], [rad] and as controls are given.
        free: The numbers of the variables that follow, shape (free,) [-].
        spins: The number of idle spins, which stay as at the start.
        singular: Singular poses, in their order; their s is the row, from 0, with a fraction.
        stop: The limit that ends the motion early, its s likewise; None without one.
        complete: Whether the drives reach their end.
    """

    x: FloatArray
    free: IndexArray
    spins: int
    singular: tuple[SingularPose, ...] = ()
    stop: LimitStop | None = None
    complete: bool = True


def find_driven(mechanism: Mechanism, names: Sequence[str]) -> Driven:
    """Return the variables that names stand for: of controls, of joints, or JOINT[k] from 1.

    Raises:
        NetworkError: With every name that stands for no variable that can be driven.
    """
    joints = {joint.name: joint for joint in mechanism.network.joints}
    controls = {control.name: control for control in mechanism.network.controls}
    faults, places, units = [], [], []
    for name in names:
        owner, index = _indexed(name)
        fault = ""
        if name in controls:
            if controls[name].value is not None:
                fault = f"{name} is a function of other controls, allowed: a control that can be set"
            owner, index = name, 0
        elif owner not in joints:
            driven = [*(control for control in controls if controls[control].value is None), *joints]
            fault = f"drive {not_among(name, driven)}"
        else:
            fault = _joint_fault(name, owner, index, joints[owner].units, joints[owner].drives)
            index = max(index or 1, 1) - 1
        if fault:
            faults.append(Finding(fault, parameter="drives"))
        else:
            places.append(mechanism.places[owner, index or 0])
            unit = mechanism.network.unit_of(name) if name in controls else None
            units.append(unit[0] if unit else "" if name in controls else joints[owner].units[index or 0])
    twice = sorted({name for name in names if names.count(name) > 1})
    faults += [Finding(f"{name} is driven twice, allowed: once", parameter="drives") for name in twice]
    if faults:
        raise NetworkError(*faults)
    return Driven(tuple(names), np.array(places, dtype=np.intp), tuple(units))


def _indexed(name: str) -> tuple[str, int | None]:
    """Return the owner and the number of NAME[k]."""
    match = re.fullmatch(r"(.+)\[(\d+)\]", name)
    return (match[1], int(match[2])) if match else (name, None)


def _joint_fault(
    name: str, owner: str, index: int | None, units: Sequence[str], drives: Sequence[object]
) -> str:
    """Return why a variable of a joint cannot be driven by name; empty if it can."""
    if not units:
        return f"{name} is a user joint without variables, allowed: a control or another joint"
    if index is None and len(units) > 1:
        listed = ", ".join(f"{owner}[{k}]" for k in range(1, len(units) + 1))
        return f"{name} has {len(units)} variables, allowed: {listed}"
    if index is not None and not 1 <= index <= len(units):
        return f"{name} has {len(units)} variables, allowed: a number from 1 to {len(units)}"
    if drives[(index or 1) - 1] is not None:
        return f"{name} is a function of controls, allowed: the controls themselves, or a joint that is free"
    return ""


def split_variables(mechanism: Mechanism, x: FloatArray, driven: Driven) -> IndexArray:
    """Return the numbers of the variables that follow.

    Args:
        mechanism: The network.
        x: An assembly, shape (variables,), in [m], [rad] and as controls are given.
        driven: The prescribed variables.

    Raises:
        NetworkError: If the drives leave the motion open, or it is not clear which controls keep their value.
    """
    places = set(driven.places.tolist())
    others = [k for k in mechanism.controls.tolist() if k not in places]
    spins = len(spinning_parts(mechanism, x))
    every = np.arange(len(mechanism.variables))
    kept: list[int] = others
    if len(places) > len(mechanism.controls) - len(others):  # joints are driven in the place of controls
        mobility = mobility_nearby(mechanism, x, every) - spins
        needed = mobility - len(places)
        if needed < 0:
            found = f"found {len(places)} drives, {', '.join(driven.names)}"
            raise NetworkError(Finding(f"{found}, allowed: {mobility}, the mobility", parameter="drives"))
        if 0 < needed < len(others):
            names = ", ".join(mechanism.variables[k].owner for k in others)
            allowed = f"values of {needed} more of them, such as {mechanism.variables[others[0]].owner}=VALUE"
            message = f"it is not clear which of the controls {names} keep their value; allowed: {allowed}"
            raise NetworkError(Finding(message, parameter="drives"))
        kept = others if needed > 0 else []
    free = np.setdiff1d(every, [*places, *kept])
    still = mobility_nearby(mechanism, x, free) - spins if len(free) else 0
    if still > 0:
        names = ", ".join(dict.fromkeys(mechanism.variables[k].owner for k in free[:12].tolist()))
        message = f"with {', '.join(driven.names)} driven, the network still moves, with mobility {still}"
        raise NetworkError(
            Finding(f"{message}; allowed: {still} more drives, of {names}", parameter="drives")
        )
    return np.asarray(free, dtype=np.intp)


def variable_limits(mechanism: Mechanism) -> FloatArray:
    """Return lower and upper limits of all variables, shape (variables, 2), infinite where there is none."""
    joints = {joint.name: joint for joint in mechanism.network.joints}
    controls = {control.name: control for control in mechanism.network.controls}
    limits = np.tile((-np.inf, np.inf), (len(mechanism.variables), 1))
    for k, variable in enumerate(mechanism.variables):
        if variable.kind == "control":
            limits[k] = controls[variable.owner].lower, controls[variable.owner].upper
        elif variable.kind == "joint" and joints[variable.owner].limits:
            limits[k] = joints[variable.owner].limits[variable.index]
    return limits


def within_turns(mechanism: Mechanism, x: FloatArray, limits: FloatArray) -> FloatArray:
    """Return an assembly with angles beyond their limits turned by whole turns, if that helps."""
    x = np.array(x)
    for k in mechanism.angles.tolist():
        lower, upper = limits[k]
        if np.isfinite(limits[k]).all() and not lower <= x[k] <= upper:
            turned = x[k] + 2.0 * np.pi * np.ceil((lower - x[k]) / (2.0 * np.pi))
            x[k] = turned if turned <= upper else x[k]
    return x


def move_to(
    mechanism: Mechanism,
    x: FloatArray,
    places: IndexArray,
    values: FloatArray,
    free: IndexArray,
    limits: FloatArray,
) -> tuple[FloatArray, Trace | None]:
    """Return the configuration at values of the drives on a straight line from an assembly.

    Args:
        mechanism: The network.
        x: The assembly, shape (variables,), in [m], [rad] and as controls are given.
        places: The numbers of the prescribed variables, shape (driven,) [-].
        values: Their values, likewise.
        free: The numbers of the variables that follow, shape (free,) [-].
        limits: Lower and upper limits of all variables, shape (variables, 2).

    Returns:
        The configuration, shape (variables,), and the trace that leads there; without one if it is there
        already. If the trace is not complete, as from a singular pose, the configuration is the assembly.
    """
    change = np.zeros(len(x))
    change[places] = values - x[places]
    if np.abs(change / mechanism.column_scales).max() < 1e-14 or not len(free):
        return np.where(np.isin(np.arange(len(x)), places), x + change, x), None
    drive = Drive(mechanism, x, change, free, limits)
    singular = drive.node(drive.coordinates(x, 0.0)).distance < SINGULAR
    branch = Trace() if singular else trace(drive, 0.0)
    if not branch.complete:
        return x, branch
    return unspun(mechanism, idle_spins(mechanism), sample(drive, branch, np.ones(1)), x)[:, 0], branch


def drive_line(
    mechanism: Mechanism,
    x: FloatArray,
    driven: Driven,
    begin: FloatArray,
    end: FloatArray,
    shares: FloatArray,
    progress: Callable[[float], None] = lambda share: None,
) -> Motion:
    """Return the motion of a network whose drives go along a straight line.

    Args:
        mechanism: The network.
        x: An assembly, shape (variables,), in [m], [rad] and as controls are given: the motion stays on its
            branch.
        driven: The prescribed variables.
        begin: Their values at the begin of the line, shape (driven,), as in x.
        end: Their values at its end.
        shares: Places along the line, not falling, 0..1, shape (n,).
        progress: Called with the share that is done, 0..1.

    Raises:
        NetworkError: If the drives do not determine the motion, or no motion from the assembly leads to the
            begin.
    """
    limits, places = variable_limits(mechanism), driven.places
    x = within_turns(mechanism, x, limits)
    free = split_variables(mechanism, x, driven)
    spins = len(spinning_parts(mechanism, x))
    change = np.zeros(len(x))
    change[places] = end - begin
    if not len(free):
        motion = np.repeat(x[:, np.newaxis], len(shares), axis=1)
        motion[places] = begin[:, np.newaxis] + np.outer(end - begin, shares)
        return Motion(motion, free, spins)
    scaled = (change / mechanism.column_scales)[places]
    begun = (x[places] - begin) / mechanism.column_scales[places]
    at = float(begun @ scaled) / (float(scaled @ scaled) or 1.0)
    distance = float(np.linalg.norm(begun - at * scaled))
    if distance > SAME_PLACE:
        x, at = _approach(mechanism, x, driven, begin, free, limits), 0.0
    if not scaled.any():
        return Motion(np.repeat(x[:, np.newaxis], len(shares), axis=1), free, spins)
    base = np.array(x)
    base[places] = begin
    drive = Drive(mechanism, base, change, free, limits)
    _check_start(drive, x, at, driven)
    branch = trace(drive, at, progress)
    first, last = branch.segments[0][0].z[-1] / drive.length, branch.segments[-1][1].z[-1] / drive.length
    if first > SAME_PLACE:
        _refuse_begin(mechanism, driven, begin, branch)
    reached = shares[shares <= last + 1e-12]
    motion = sample(drive, branch, np.minimum(reached, last))
    motion[places] = begin[:, np.newaxis] + np.outer(end - begin, reached)
    motion = unspun(mechanism, idle_spins(mechanism), motion, x)
    rows = _Rows(shares)
    return Motion(
        motion,
        free,
        spins,
        tuple(rows.place(pose) for pose, _ in branch.singular if -SAME_PLACE < pose.s < 1.0 + SAME_PLACE),
        rows.place_stop(branch.stop),
        len(reached) == len(shares),
    )


def drive_rows(
    mechanism: Mechanism,
    x: FloatArray,
    driven: Driven,
    values: FloatArray,
    progress: Callable[[float], None] = lambda share: None,
) -> Motion:
    """Return the motion of a network whose drives take values row by row.

    Args:
        mechanism: The network.
        x: An assembly, shape (variables,), in [m], [rad] and as controls are given: the motion stays on its
            branch.
        driven: The prescribed variables.
        values: Their values, shape (n, driven), as in x.
        progress: Called with the share that is done, 0..1.

    Raises:
        NetworkError: As `drive_line`.
    """
    limits, places = variable_limits(mechanism), driven.places
    x = within_turns(mechanism, x, limits)
    free = split_variables(mechanism, x, driven)
    spins = len(spinning_parts(mechanism, x))
    if not len(free):
        motion = np.repeat(x[:, np.newaxis], len(values), axis=1)
        motion[places] = values.T
        return Motion(motion, free, spins)
    x = _approach(mechanism, x, driven, values[0], free, limits)
    found = follow(mechanism, x, places, values, free, limits, progress)
    return Motion(found.x, free, spins, tuple(found.singular), found.stop, found.x.shape[1] == len(values))


@dataclass(frozen=True, slots=True)
class _Rows:
    """Places along a line as rows, with fractions."""

    shares: FloatArray

    def row(self, s: float) -> float:
        return float(np.interp(s, self.shares, np.arange(len(self.shares))))

    def place(self, pose: SingularPose) -> SingularPose:
        return SingularPose(pose.passage, self.row(pose.s), pose.x, pose.direction)

    def place_stop(self, stop: LimitStop | None) -> LimitStop | None:
        return None if stop is None else LimitStop(stop.variable, stop.limit, self.row(stop.s))


def _approach(
    mechanism: Mechanism,
    x: FloatArray,
    driven: Driven,
    begin: FloatArray,
    free: IndexArray,
    limits: FloatArray,
) -> FloatArray:
    """Return the configuration at the begin of the drives.

    Raises:
        NetworkError: If no motion from the assembly leads there on a straight line.
    """
    there, branch = move_to(mechanism, x, driven.places, begin, free, limits)
    if branch is not None and not branch.complete:
        _refuse_begin(mechanism, driven, begin, branch)
    return there


def _check_start(drive: Drive, x: FloatArray, s: float, driven: Driven) -> None:
    """Raise a `NetworkError` if the branch of an assembly is not defined, or does not move."""
    node = drive.node(drive.coordinates(x, s))
    if abs(node.tangent[-1]) < SINGULAR and node.distance > SINGULAR:
        message = f"{', '.join(driven.names)} cannot move at the start: the network has too many drives"
        raise NetworkError(Finding(message, parameter="drives"))
    if node.distance < SINGULAR:
        values = ", ".join(
            f"{name} = {value:.6g}" for name, value in zip(driven.names, x[driven.places], strict=True)
        )
        message = (
            f"found a singular pose at the start, {values}, where branches meet or the motion turns back"
        )
        allowed = "a start away from it: other start values in the file, or --start and --branch"
        raise NetworkError(Finding(f"{message}; allowed: {allowed}", parameter="drives"))


def _refuse_begin(mechanism: Mechanism, driven: Driven, begin: FloatArray, branch: Trace) -> None:
    """Raise a `NetworkError`: the begin of the drives is not reached from the assembly."""
    wanted = ", ".join(f"{name} = {value:.6g}" for name, value in zip(driven.names, begin, strict=True))
    why = "no step of the continuation succeeds"
    ends = [pose for pose, _ in branch.singular if pose.passage == "turns back"]
    if branch.stop is not None:
        limited = mechanism.variables[branch.stop.variable].owner
        why = f"{limited} reaches its limit {branch.stop.limit:.6g} before"
    elif ends:
        known = zip(driven.names, ends[0].x[driven.places], strict=True)
        at = [f"{name} = {value:.6g}" for name, value in known]
        why = f"the motion turns back at {', '.join(at)}"
    message = f"no motion from the assembly at the start leads to {wanted}: {why}"
    allowed = "a range on its branch, or another assembly by --branch or --start"
    raise NetworkError(Finding(f"{message}; allowed: {allowed}", parameter="drives"))


def compute_shares(law: Law, shares: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return how far a motion is at shares of its duration, with its first and second derivative by them.

    uniform: s = u. trapezoid: a third of the time accelerated, a third at the speed 3/2, a third braked.
        quintic:
    s = 10 u^3 - 15 u^4 + 6 u^5, whose speed and acceleration are 0 at both ends.

    Args:
        law: The law.
        shares: u, 0..1, shape (n,) [-].

    Returns:
        s, ds/du and d2s/du2, shape (n,) each [-].
    """
    u = shares
    if law == "quintic":
        s = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
        return s, 30.0 * u * u * (1.0 - u) ** 2, 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)
    if law == "trapezoid":
        late = 1.0 - u
        s = np.where(
            u < 1 / 3, 2.25 * u * u, np.where(late < 1 / 3, 1.0 - 2.25 * late * late, 1.5 * u - 0.25)
        )
        speed = np.minimum(1.5, 4.5 * np.minimum(u, late))
        return s, speed, np.where(u < 1 / 3, 4.5, np.where(late < 1 / 3, -4.5, 0.0))
    return np.array(u), np.ones_like(u), np.zeros_like(u)
