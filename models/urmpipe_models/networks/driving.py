"""Driven motion of a network, from drives by name: which variables follow, where it begins, its rows.

1. `find_driven_variables`: controls and joint variables by name.
2. `_split_variables`: which variables follow. Controls without a drive keep their value; if joints are
   driven in their place, controls follow.
3. `move_to`: from an assembly along a straight line of the drives to where the motion begins.
4. `drive_rows`: the motion along rows of the drives, on a line (`continuation`) or not (`row_motion`).
5. `compute_shares`: the place along the line over time.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, get_args

import numpy as np

from urmpipe_models.elementwise import FloatArray, IndexArray
from urmpipe_models.errors import Finding, NetworkError, format_unknown_name
from urmpipe_models.networks.continuation import (
    MAX_LENGTH,
    SINGULAR,
    BranchDerivatives,
    Drive,
    LimitStop,
    SingularPose,
    Trace,
    sample_branch,
    trace_branch,
)
from urmpipe_models.networks.mechanism import Mechanism
from urmpipe_models.networks.mobility import (
    find_idle_spins,
    find_spinning_bodies,
    nearby_mobility,
    reset_idle_spins,
)
from urmpipe_models.networks.row_motion import follow_rows

Law = Literal["uniform", "trapezoid", "quintic"]
LAWS: tuple[Law, ...] = get_args(Law)

SAME_TOLERANCE = 1e-9  # scaled distance of drives below which two values are the same


@dataclass(frozen=True, slots=True, eq=False)
class DrivenVariables:
    """The prescribed variables of a network.

    Attributes:
        names: Their names, as they are given.
        places: Their numbers among the variables, shape (driven,) [-].
        units: rad, m, or "" of a control that alone drives neither an angle nor a length.
    """

    names: tuple[str, ...]
    places: IndexArray
    units: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class DrivenMotion:
    """Configurations of a network along its drives, on one branch.

    Attributes:
        x: The variables, shape (variables, n), in [m], [rad] and as controls are given.
        free: The numbers of the variables that follow, shape (free,) [-].
        spins: The number of idle spins, which stay as at the start.
        singular: Singular poses, in their order; their s is the row, from 0, with a fraction.
        stop: The limit that ends the motion early, its s likewise; None without one.
        slopes: Derivatives along the line of the drives next to points where branches meet.
    """

    x: FloatArray
    free: IndexArray
    spins: int
    singular: tuple[SingularPose, ...] = ()
    stop: LimitStop | None = None
    slopes: tuple[BranchDerivatives, ...] = ()


def find_driven_variables(mechanism: Mechanism, names: Sequence[str]) -> DrivenVariables:
    """Return the variables that names stand for: of controls, of joints, or JOINT[k] from 1.

    Raises:
        NetworkError: With every name that stands for no variable that can be driven.
    """
    faults: list[Finding] = []
    places: list[int] = []
    units: list[str] = []
    for name in names:
        try:
            place, unit = _find_variable(mechanism, name)
        except NetworkError as error:
            faults += error.findings
        else:
            places.append(place)
            units.append(unit)
    repeated = [name for k, name in enumerate(names) if len(places) == len(names) and places[k] in places[:k]]
    faults += [Finding(f"{name} is driven twice, allowed: once", parameter="drives") for name in repeated]
    if faults:
        raise NetworkError(*faults)
    return DrivenVariables(tuple(names), np.array(places, dtype=np.intp), tuple(units))


def _find_variable(mechanism: Mechanism, name: str) -> tuple[int, str]:
    """Return number and unit of the variable with a name; raise a `NetworkError` if it cannot be driven."""
    joints = {joint.name: joint for joint in mechanism.network.joints}
    controls = {control.name: control for control in mechanism.network.controls}
    if name in controls:
        if controls[name].value is not None:
            raise _drive_error(f"{name} is a function of other controls, allowed: a control that can be set")
        unit = mechanism.network.control_unit(name)
        return mechanism.variable_index[name, 0], unit[0] if unit else ""
    match = re.fullmatch(r"(.+)\[(\d+)\]", name)
    owner, number = (match[1], int(match[2])) if match else (name, None)
    if owner not in joints:
        settable = [control.name for control in controls.values() if control.value is None]
        allowed = [*settable, *(joint.name for joint in joints.values() if None in joint.drives)]
        if not allowed:
            raise _drive_error(f"found {name}, but nothing can be driven")
        raise _drive_error(f"drive {format_unknown_name(name, allowed)}")
    units = joints[owner].units
    if not units:
        raise _drive_error(f"{name} is a user joint without variables, allowed: a control or another joint")
    if number is None and len(units) > 1:
        listed = ", ".join(f"{owner}[{k}]" for k in range(1, len(units) + 1))
        raise _drive_error(f"{name} has {len(units)} variables, allowed: {listed}")
    if number is not None and not 1 <= number <= len(units):
        allowed_numbers = f"a number from 1 to {len(units)}"
        raise _drive_error(f"{name} has {len(units)} variables, allowed: {allowed_numbers}")
    index = (number or 1) - 1
    if joints[owner].drives[index] is not None:
        allowed_drives = "the controls themselves, or a joint that is free"
        raise _drive_error(f"{name} is a function of controls, allowed: {allowed_drives}")
    return mechanism.variable_index[owner, index], units[index]


def _drive_error(message: str) -> NetworkError:
    return NetworkError(Finding(message, parameter="drives"))


def _split_variables(mechanism: Mechanism, x: FloatArray, driven: DrivenVariables) -> IndexArray:
    """Return the numbers of the variables that follow, shape (free,) [-].

    Args:
        mechanism: The network.
        x: An assembly, shape (variables,), in [m], [rad] and as controls are given.
        driven: The prescribed variables.

    Raises:
        NetworkError: If the drives leave the motion open, or it is not clear which controls keep their value.
    """
    places = set(driven.places.tolist())
    undriven = [k for k in mechanism.controls.tolist() if k not in places]
    spins = len(find_spinning_bodies(mechanism, x))
    variables = np.arange(len(mechanism.variables))
    kept: list[int] = undriven
    if len(places) > len(mechanism.controls) - len(undriven):  # joints are driven in the place of controls
        mobility = nearby_mobility(mechanism, x, variables) - spins
        needed = mobility - len(places)
        if needed < 0:
            names = ", ".join(driven.names)
            raise _drive_error(f"found {len(places)} drives, {names}, allowed: {mobility}, the mobility")
        if 0 < needed < len(undriven):
            names = ", ".join(mechanism.variables[k].owner for k in undriven)
            allowed = (
                f"values of {needed} more of them, such as {mechanism.variables[undriven[0]].owner}=VALUE"
            )
            message = f"it is not clear which of the controls {names} keep their value"
            raise _drive_error(f"{message}; allowed: {allowed}")
        kept = undriven if needed > 0 else []
    free = np.setdiff1d(variables, [*places, *kept])
    remaining = nearby_mobility(mechanism, x, free) - spins if len(free) else 0
    if remaining > 0:
        names = ", ".join(dict.fromkeys(mechanism.variables[k].owner for k in free[:12].tolist()))
        message = f"with {', '.join(driven.names)} driven, the network still moves, with mobility {remaining}"
        raise _drive_error(f"{message}; allowed: {remaining} more drives, of {names}")
    return np.asarray(free, dtype=np.intp)


def variable_limits(mechanism: Mechanism) -> FloatArray:
    """Return limits of all variables in [m], [rad] and as controls are given, infinite where there is none.

    Returns:
        Lower and upper limits, shape (variables, 2).
    """
    joints = {joint.name: joint for joint in mechanism.network.joints}
    controls = {control.name: control for control in mechanism.network.controls}
    limits = np.tile((-np.inf, np.inf), (len(mechanism.variables), 1))
    for k, variable in enumerate(mechanism.variables):
        if variable.kind == "control":
            limits[k] = controls[variable.owner].lower, controls[variable.owner].upper
        elif variable.kind == "joint" and joints[variable.owner].limits:
            limits[k] = joints[variable.owner].limits[variable.index]
    return limits


def _shift_into_limits(mechanism: Mechanism, x: FloatArray, limits: FloatArray) -> FloatArray:
    """Return an assembly with angles beyond their limits shifted by whole turns, where that is within them.

    Args:
        mechanism: The network.
        x: The assembly, shape (variables,), in [m], [rad] and as controls are given.
        limits: Lower and upper limits, likewise, shape (variables, 2).

    Returns:
        The assembly, shape (variables,), in [m], [rad] and as controls are given.
    """
    x = np.array(x)
    for k in mechanism.angles.tolist():
        lower, upper = limits[k]
        if np.isfinite(limits[k]).all() and not lower <= x[k] <= upper:
            shifted = x[k] + 2.0 * np.pi * np.ceil((lower - x[k]) / (2.0 * np.pi))
            x[k] = shifted if shifted <= upper else x[k]
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
        limits: Lower and upper limits of all variables in [m], [rad], shape (variables, 2).

    Returns:
        The configuration in [m], [rad], shape (variables,), and the trace that leads there; without one if
        it is there already. If the trace is not complete, as from a singular pose, the configuration is the
        assembly.
    """
    change = np.zeros(len(x))
    change[places] = values - x[places]
    if np.abs(change / mechanism.column_scales).max() < 1e-14 or not len(free):
        return np.where(np.isin(np.arange(len(x)), places), x + change, x), None
    drive = Drive(mechanism, x, change, free, limits)
    singular = drive.node(drive.coordinates(x, 0.0)).distance < SINGULAR
    branch = Trace() if singular else trace_branch(drive, 0.0)
    if not branch.complete:
        return x, branch
    return reset_idle_spins(
        mechanism, find_idle_spins(mechanism), sample_branch(drive, branch, np.ones(1))[0], x
    )[:, 0], branch


def drive_rows(
    mechanism: Mechanism,
    x: FloatArray,
    driven: DrivenVariables,
    values: FloatArray,
    progress: Callable[[float], None] = lambda share: None,
) -> DrivenMotion:
    """Return the motion of a network whose drives take values row by row.

    If all values are on a line, the branch is traced along it once, and rows are sampled from it. Else the
    rows are followed (`row_motion`): then only singular poses at which a row cannot be solved from the row
    before are found.

    Args:
        mechanism: The network.
        x: An assembly, shape (variables,), in [m], [rad] and as controls are given: the motion stays on its
            branch.
        driven: The prescribed variables.
        values: Their values in [m], [rad] and as controls are given, shape (n, driven).
        progress: Called with the share that is done, 0..1.

    Raises:
        NetworkError: If the drives do not determine the motion, or no motion from the assembly leads to the
            first row.
    """
    limits, places = variable_limits(mechanism), driven.places
    x = _shift_into_limits(mechanism, x, limits)
    # a driven angle begins at the turn that is nearest to the assembly
    turns = np.isin(places, mechanism.angles)
    x[places[turns]] += 2.0 * np.pi * np.round((values[0] - x[places])[turns] / (2.0 * np.pi))
    free = _split_variables(mechanism, x, driven)
    spins = len(find_spinning_bodies(mechanism, x))
    setup = _Setup(mechanism, driven, free, limits)
    line = _find_line(values / mechanism.column_scales[places])
    if line is None:
        x = _approach(setup, x, values[0])
        followed = follow_rows(mechanism, x, places, values, free, limits, progress)
        motion = DrivenMotion(followed.x, free, spins, tuple(followed.singular), followed.stop)
    elif not len(free) or not line.change.any():
        x = _approach(setup, x, values[0])
        rows = np.repeat(x[:, np.newaxis], len(values), axis=1)
        rows[places] = values.T
        motion = DrivenMotion(rows, free, spins)
    else:
        motion = _drive_along(setup, x, values, line, progress)
    return _stop_at_driven_limits(mechanism, motion)


class _Setup(NamedTuple):
    mechanism: Mechanism
    driven: DrivenVariables
    free: IndexArray
    limits: FloatArray


class _Line(NamedTuple):
    """A straight line in scaled drives, and the places of rows on it, 0..1, shape (n,)."""

    begin: FloatArray
    change: FloatArray
    shares: FloatArray


def _find_line(scaled: FloatArray) -> _Line | None:
    """Return the line through all rows, from the lowest place to the highest; None if there is none."""
    offsets = scaled - scaled[0]
    sizes = np.linalg.norm(offsets, axis=1)
    direction = offsets[int(np.argmax(sizes))]
    square = float(direction @ direction)
    along = offsets @ direction / square if square > 0.0 else np.zeros(len(scaled))
    if np.linalg.norm(offsets - np.outer(along, direction), axis=1).max() > SAME_TOLERANCE:
        return None
    low, high = float(along.min()), float(along.max())
    shares = (along - low) / (high - low) if high > low else along
    return _Line(scaled[0] + low * direction, (high - low) * direction, shares)


def _drive_along(
    setup: _Setup, x: FloatArray, values: FloatArray, line: _Line, progress: Callable[[float], None]
) -> DrivenMotion:
    """Return a motion whose drives are on a line: its branch is traced to both ends, then sampled."""
    mechanism, driven, free, limits = setup
    places, scales, shares = driven.places, mechanism.column_scales[driven.places], line.shares
    length = float(np.linalg.norm(line.change))
    if length > MAX_LENGTH:
        distance = f"{', '.join(driven.names)} moves by {length:.6g} rad or lengths of the mechanism"
        raise _drive_error(f"{distance}, allowed: {MAX_LENGTH:g}; split the motion")
    offset = x[places] / scales - line.begin
    at = float(offset @ line.change) / float(line.change @ line.change)
    if np.linalg.norm(offset - at * line.change) > SAME_TOLERANCE:
        x, at = _approach(setup, x, values[0]), float(shares[0])
    base, change = np.array(x), np.zeros(len(x))
    base[places], change[places] = line.begin * scales, line.change * scales
    drive = Drive(mechanism, base, change, free, limits)
    _check_start(drive, x, at, driven)
    back, forward = Trace(complete=True), Trace(complete=True)
    if at < 1.0:
        forward = trace_branch(drive, at, 1.0, progress)
    if at > 0.0:
        back = trace_branch(drive, at, 0.0, progress)
    ends = _check_ends(driven, values[0], float(shares[0]), back, forward, drive.length)
    outside = (shares < ends[0] - SAME_TOLERANCE) | (shares > ends[1] + SAME_TOLERANCE)
    count = int(np.argmax(outside)) if outside.any() else len(shares)
    branch = Trace(back.segments + forward.segments, [*back.singular, *forward.singular])
    motion, slopes = sample_branch(drive, branch, np.clip(shares[:count], *ends))
    motion[places] = values[:count].T
    motion = reset_idle_spins(mechanism, find_idle_spins(mechanism), motion, x)
    rows = [(pose, _find_row(shares[: count + 1], pose.s)) for pose, _ in branch.singular]
    poses = [replace(pose, s=row) for pose, row in rows if row is not None]
    poses.sort(key=lambda pose: pose.s)
    stop = None
    if outside.any():
        stop = forward.stop if shares[count] > ends[1] else back.stop
        if stop is not None:
            stop = replace(stop, s=_find_row(shares[: count + 1], stop.s) or 0.0)
    return DrivenMotion(motion, free, drive.spins, tuple(poses), stop, tuple(slopes))


def _check_ends(
    driven: DrivenVariables, begin: FloatArray, share: float, back: Trace, forward: Trace, length: float
) -> tuple[float, float]:
    """Return the places on a line to which its branch reaches.

    Raises:
        NetworkError: If the first row is beyond them.
    """
    segments = back.segments + forward.segments
    if not segments:
        raise _begin_error(driven, begin, forward if back.complete else back)
    ends = float(segments[0][0].z[-1]) / length, float(segments[-1][1].z[-1]) / length
    if share < ends[0] - SAME_TOLERANCE or share > ends[1] + SAME_TOLERANCE:
        raise _begin_error(driven, begin, back if share < ends[0] else forward)
    return ends


def _find_row(shares: FloatArray, s: float) -> float | None:
    """Return the first row, with a fraction, at which places along a line reach s; None if they do not."""
    before, after = shares[:-1] - s, shares[1:] - s
    rising = (before <= SAME_TOLERANCE) & (after >= -SAME_TOLERANCE)
    falling = (before >= -SAME_TOLERANCE) & (after <= SAME_TOLERANCE)
    reached = np.flatnonzero(rising | falling)
    if not len(reached):
        return None
    k = int(reached[0])
    step = float(shares[k + 1] - shares[k])
    return k + (float(np.clip((s - shares[k]) / step, 0.0, 1.0)) if step else 0.0)


def _stop_at_driven_limits(mechanism: Mechanism, motion: DrivenMotion) -> DrivenMotion:
    """End a motion before the first row at which a joint that controls drive is beyond its limits.

    Raises:
        NetworkError: If that is the first row.
    """
    for joint in mechanism.network.joints:
        for k, (drive, bounds) in enumerate(zip(joint.drives, joint.limits, strict=False)):
            if drive is None or not motion.x.shape[1]:
                continue
            values = np.broadcast_to(mechanism.joint_values(joint, motion.x)[k].value, motion.x.shape[1])
            beyond = np.flatnonzero(
                (values < bounds[0] - SAME_TOLERANCE) | (values > bounds[1] + SAME_TOLERANCE)
            )
            if not len(beyond):
                continue
            row = int(beyond[0])
            limit = bounds[int(values[row] > bounds[1])]
            if row == 0:
                place = f"{joint.name} is at {values[0]:.6g}"
                raise _drive_error(f"{place}, beyond its limit {limit:.6g}, at the first row")
            share = float((limit - values[row - 1]) / (values[row] - values[row - 1]))
            x = motion.x[:, row - 1] + share * (motion.x[:, row] - motion.x[:, row - 1])
            name = joint.name if len(joint.units) == 1 else f"{joint.name}[{k + 1}]"
            stop = LimitStop(name, joint.units[k], limit, row - 1 + share, x)
            singular = tuple(pose for pose in motion.singular if pose.s <= stop.s)
            motion = replace(motion, x=motion.x[:, :row], singular=singular, stop=stop)
    return motion


def _approach(setup: _Setup, x: FloatArray, begin: FloatArray) -> FloatArray:
    """Return the configuration at the begin of the drives.

    Raises:
        NetworkError: If no motion from the assembly leads there on a straight line.
    """
    mechanism, driven, free, limits = setup
    there, branch = move_to(mechanism, x, driven.places, begin, free, limits)
    if branch is not None and not branch.complete:
        raise _begin_error(driven, begin, branch)
    return there


def _check_start(drive: Drive, x: FloatArray, s: float, driven: DrivenVariables) -> None:
    """Raise a `NetworkError` if the branch of an assembly is not defined, or does not move."""
    node = drive.node(drive.coordinates(x, s))
    if abs(node.tangent[-1]) < SINGULAR and node.distance > SINGULAR:
        raise _drive_error(
            f"{', '.join(driven.names)} cannot move at the start: the network has too many drives"
        )
    if node.distance < SINGULAR:
        at = _format_values(driven, x[driven.places])
        message = f"found a singular pose at the start, {at}, where branches meet or the motion turns back"
        allowed = "a start away from it: other start values in the file, or --start and --branch"
        raise _drive_error(f"{message}; allowed: {allowed}")


def _begin_error(driven: DrivenVariables, begin: FloatArray, branch: Trace) -> NetworkError:
    """Return the error that the begin of the drives is not reached from the assembly, as a trace shows."""
    why = "no step of the continuation succeeds"
    ends = [pose for pose, _ in branch.singular if pose.passage == "turns back"]
    if branch.stop is not None:
        unit = f" {branch.stop.unit}" if branch.stop.unit else ""
        why = f"{branch.stop.name} reaches its limit {branch.stop.limit:.6g}{unit} before"
    elif ends:
        why = f"the motion turns back at {_format_values(driven, ends[0].x[driven.places])}"
    message = f"no motion from the assembly at the start leads to {_format_values(driven, begin)}: {why}"
    allowed = "a range on its branch, or another assembly by --branch or --start"
    return _drive_error(f"{message}; allowed: {allowed}")


def _format_values(driven: DrivenVariables, values: FloatArray) -> str:
    """Return the drives with values, as controls are given, in [rad] and [m] of joints."""
    pairs = zip(driven.names, values.tolist(), strict=True)
    return ", ".join(f"{name} = {value:.9g}" for name, value in pairs)


def compute_shares(law: Law, shares: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return how far a motion is at shares of its duration, with its first and second derivative by them.

    uniform: s = u. trapezoid: a third of the time accelerated, a third at the speed 3/2, a third braked.
    quintic: s = 10 u^3 - 15 u^4 + 6 u^5, whose speed and acceleration are 0 at both ends.

    Args:
        law: The law.
        shares: u, shape (n,) [-]; beyond 1 the drives stand still.

    Returns:
        s, ds/du and d2s/du2, shape (n,) each [-].
    """
    u, moves = np.minimum(shares, 1.0), np.where(shares > 1.0 + 1e-12, 0.0, 1.0)
    s, speed, curvature = np.array(u), np.ones_like(u), np.zeros_like(u)
    if law == "quintic":
        s = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
        speed, curvature = 30.0 * u * u * (1.0 - u) ** 2, 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)
    elif law == "trapezoid":
        late = 1.0 - u
        braked = np.where(late < 1 / 3, 1.0 - 2.25 * late * late, 1.5 * u - 0.25)
        s = np.where(u < 1 / 3, 2.25 * u * u, braked)
        speed = np.minimum(1.5, 4.5 * np.minimum(u, late))
        curvature = np.where(u < 1 / 3, 4.5, np.where(late < 1 / 3, -4.5, 0.0))
    return s, speed * moves, curvature * moves
