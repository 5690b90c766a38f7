"""From a request to drive a network to its motion: values with units, the assembly, the motion, its rates.

1. `DriveRequest`: what is requested; `check` refuses what makes no sense with any network.
2. `_parse_drives`, `_parse_values`, `_parse_point`, `_parse_wrench`: texts with units become SI.
3. `drive_network`: assembly (by default that of the file's start, else the nearest to start values, or one by
   its number), motion along a line or along a log, rates, transmission, static forces, singular poses in words.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from functools import partial
from numbers import Integral, Real
from typing import Any, TypeAlias

import numpy as np

from urmpipe_models.arrays import FloatArray, IndexArray
from urmpipe_models.elementwise import Vector
from urmpipe_models.errors import Finding, NetworkError, OptionError, for_each, shown
from urmpipe_models.measure_units import MEASURES, NAMES, WRITTEN, quantity
from urmpipe_models.names import not_among
from urmpipe_models.networks.assembly import CLOSED, RESTARTS, assemble
from urmpipe_models.networks.driving import (
    LAWS,
    Driven,
    Law,
    Motion,
    compute_shares,
    drive_line,
    drive_rows,
    find_driven,
)
from urmpipe_models.networks.forces import Wrench, compute_forces
from urmpipe_models.networks.mechanism import Mechanism, mechanism_of
from urmpipe_models.networks.motion import SingularPose
from urmpipe_models.networks.network import Network
from urmpipe_models.networks.parts import POSE_UNITS
from urmpipe_models.networks.rates import Rates, compute_rates
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import LogWarning, SourceFile, seconds
from urmpipe_pipeline.networks.network_motion import (
    DriveRange,
    MotionEvent,
    MotionForces,
    NetworkMotion,
    Transmission,
)
from urmpipe_pipeline.provenance import provenance
from urmpipe_pipeline.runs.results import Run

DEFAULT_STEPS = 200
MAX_ROWS = 10_000_000  # of a motion: about 2 GB of variables and rates of a network of ten

Quantity: TypeAlias = float | str
"""A number, or a text with a unit."""

Range: TypeAlias = Quantity | Sequence[Quantity]
"""From and to; one value holds a variable."""


@dataclass(frozen=True, slots=True)
class DriveRequest:
    """What drives a network, and what is wanted of its motion.

    Attributes:
        drives: From and to of controls and joints by name; one value holds. Of controls numbers are in the units of
            the file, of joints in [rad] and [m]; texts have their own unit, or that of the file. With a log: the
            name of the column that drives each; empty for columns of their names.
        steps: Equal steps of the drives, `tsp` each; None with a duration or a log.
        duration: Duration in [s]; None with steps.
        law: How the drives move over the duration.
        tsp: Time from row to row in [s].
        branch: Number of the assembly at the begin of the drives, from 1, as `network solve --all` lists them.
        start: Values of joints by name: the nearest assembly to them at the begin of the drives.
        point: A point of a body to trace: "BODY:X,Y,Z", or the body and x, y, z in [m].
        wrenches: Loads: "BODY:X,Y,Z:FX,FY,FZ" with MX,MY,MZ at the end if wanted, the point in the frame of the
            body in [m], force [N] and moment [N.m] along the axes of the ground.
        torques: Loads at joints by name in [N.m] or [N].
        restarts: Random starts in a row without a new assembly that end a search.
        seed: Of the random starts.
    """

    drives: Mapping[str, Range]
    steps: int | None = None
    duration: float | None = None
    law: Law = "uniform"
    tsp: float = 0.005
    branch: int | None = None
    start: Mapping[str, Quantity | Sequence[Quantity]] = field(default_factory=dict)
    point: str | tuple[str, Sequence[float]] | None = None
    wrenches: Sequence[str | Wrench] = ()
    torques: Mapping[str, float | str] = field(default_factory=dict)
    restarts: int = RESTARTS
    seed: int = 0

    def check(self) -> None:
        """Raise an `OptionError` with everything that makes no sense, whatever the network is."""
        if faults := list(self._faults()):
            raise OptionError(*faults)

    def _faults(self) -> Iterator[Finding]:
        for key, count, least in (
            ("steps", self.steps, 1), ("branch", self.branch, 1), ("restarts", self.restarts, 0), ("seed", self.seed, 0)
        ):  # fmt: skip
            if count is not None and (isinstance(count, bool) or not isinstance(count, Integral) or count < least):
                yield Finding(parameter=key, found=shown(count), allowed=f"a whole number, {least} or more")
        for key, value in (("duration", self.duration), ("tsp", self.tsp)):
            if value is not None and not (isinstance(value, Real) and 1e-9 <= float(value) < 1e9):
                yield Finding(parameter=key, found=shown(value), allowed="a time in s, 1e-9 to 1e9")
        if self.steps is not None and self.duration is not None:
            yield Finding("found together with steps, allowed: one of the two", parameter="duration")
        if self.law not in LAWS:
            yield Finding(not_among(str(self.law), LAWS), parameter="law")
        elif self.law != "uniform" and self.duration is None:
            yield Finding("found without a duration, allowed: with one", parameter="law")
        if self.branch is not None and self.start:
            yield Finding("found together with start, allowed: one of the two", parameter="branch")

    def times_ns(self) -> Any:
        """Return the times of the rows in integer [ns], shape (n,).

        Raises:
            OptionError: If there are too many.
        """
        count = self.steps or DEFAULT_STEPS
        if self.duration is not None:
            count = math.floor(self.duration / self.tsp + 1e-9)
        if not 1 <= count <= MAX_ROWS:
            allowed = f"1 to {MAX_ROWS} steps of {self.tsp:g} s"
            raise OptionError(Finding(parameter="duration" if self.duration else "steps", found=str(count), allowed=allowed))
        return np.round(np.arange(count + 1) * (self.tsp * 1e9)).astype(np.int64)


def drive_network(
    network: Network,
    request: DriveRequest,
    log: Run | None = None,
    inputs: Sequence[SourceFile] = (),
    progress: Callable[[float], None] = lambda share: None,
) -> NetworkMotion:
    """Return the motion of a network.

    Args:
        network: The network.
        request: What drives it.
        log: A log whose joints drive it, instead of ranges.
        inputs: The files that it is from.
        progress: Called with the share that is done, 0..1.

    Raises:
        UrmpipeError: With everything that is wrong with the request.
    """
    mechanism = mechanism_of(network)
    columns = _log_columns(network, request, log) if log is not None else {}
    names = list(columns) if log is not None else list(request.drives)
    parts: tuple[Callable[[], Any], ...] = (
        request.check,
        lambda: _find_driven(mechanism, names),
        lambda: _parse_ranges(network, request.drives) if log is None else None,
        lambda: _parse_start(network, request.start),
        lambda: _parse_point(network, request.point),
        lambda: [_parse_wrench(network, one) for one in request.wrenches],
        lambda: _parse_torques(network, request.torques),
    )
    _, driven, ranges, start, point, wrenches, torques = for_each(lambda make: make(), parts)
    t_ns = request.times_ns() if log is None else log.t_ns
    factors = np.array([_factor(network, name) for name in driven.names])
    values, d_values, dd_values = _drive_values(driven, ranges, factors, columns, log, request, t_ns)
    _check_control_ranges(mechanism, driven, values, log)
    x = _find_assembly(mechanism, driven, values[0], start, request)
    if log is None:
        begin, end = values[0], values[-1]
        shares = compute_shares(request.law, seconds(t_ns) / _duration(request, t_ns))[0]
        moved = drive_line(mechanism, x, driven, begin, end, shares, lambda share: progress(0.6 * share))
    else:
        moved = drive_rows(mechanism, x, driven, values, lambda share: progress(0.6 * share))
    n = moved.x.shape[1]
    if n == 0:
        raise NetworkError(Finding("the motion ends before its first row", parameter="drives"))
    rates = compute_rates(
        mechanism, moved.x, d_values[:n].T, dd_values[:n].T, driven.places, moved.free, moved.spins
    )
    progress(0.9)
    forces = None
    if wrenches or torques:
        forces = _forces(mechanism, moved, driven, factors, wrenches, torques)
    events = tuple(_events(mechanism, moved, driven, factors, values * factors, t_ns))
    warnings = tuple(log.warnings) if log is not None else ()
    options = {
        "network": network.name,
        "drives": {name: _plain(value) for name, value in (request.drives or columns).items()},
        "steps": request.steps, "duration": request.duration, "law": request.law if log is None else None,
        "tsp": request.tsp if log is None else None, "branch": request.branch,
        "start": {name: _plain(value) for name, value in request.start.items()} or None,
        "point": None if point is None else f"{point[0]}:{','.join(map(repr, point[1]))}",
        "wrenches": [str(one) for one in request.wrenches] or None,
        "torques": dict(request.torques) or None,
    }  # fmt: skip
    scaled = values * factors
    return NetworkMotion(
        name=network.name,
        network=network,
        drives=tuple(
            DriveRange(name, unit, float(scaled[0, k]), float(scaled[-1, k]))
            for k, (name, unit) in enumerate(zip(driven.names, driven.units, strict=True))
        ),
        law="log" if log is not None else request.law,
        tsp=log.tsp if log is not None else request.tsp,
        requested=len(values),
        t_ns=t_ns[:n],
        x=np.ascontiguousarray(moved.x.T),
        xd=np.ascontiguousarray(rates.xd.T),
        xdd=np.ascontiguousarray(rates.xdd.T),
        distance=rates.distance,
        body="" if point is None else point[0],
        point=(0.0, 0.0, 0.0) if point is None else point[1],
        events=events,
        transmission=tuple(_transmissions(mechanism, moved, driven, factors, scaled[:n], rates)),
        forces=forces,
        warnings=warnings,
        provenance=provenance("network drive", options, inputs),
    )


def _find_driven(mechanism: Mechanism, names: Sequence[str]) -> Driven:
    """Return the prescribed variables; raise an `OptionError` if there are none."""
    if not names:
        network = mechanism.network
        controls = [control.name for control in network.controls if control.value is None]
        listed = ", ".join(controls or [joint.name for joint in network.joints])
        message = f"found nothing that drives {network.name}, allowed: {listed}"
        raise OptionError(Finding(message, parameter="drives"))
    return find_driven(mechanism, names)


def _duration(request: DriveRequest, t_ns: Any) -> float:
    """Return the duration of the law in [s]; a last row may be earlier by less than tsp."""
    return request.duration if request.duration is not None else float(seconds(t_ns)[-1])


def _plain(value: Any) -> Any:
    return [*value] if isinstance(value, (list, tuple)) else value


# ---------------------------------------------------------------------------------------- values with units


def _factor(network: Network, name: str) -> float:
    """Return how many SI units one of a drive is: of a control in deg or mm; 1 for all others."""
    unit = network.unit_of(name)
    return float(unit[1]) if unit and name in {one.name for one in network.controls} else 1.0


def parse_quantity(network: Network, parameter: str, name: str, value: Quantity, unit: str, factor: Decimal) -> float:
    """Return a value in units of which one is `factor` SI units.

    Numbers are in these units; texts have a unit of their own, or the unit of the network's file.

    Raises:
        OptionError: If it is no such value.
    """
    if not isinstance(value, str):
        if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(float(value)):
            raise OptionError(Finding(parameter=parameter, found=f"{name} = {shown(value)}", allowed="a finite number"))
        return float(value)
    in_file = {"m": network.length_unit, "rad": network.angle_unit}.get(unit, "")
    units = {key: si / factor for key, si in WRITTEN.get(unit, {}).items()}
    units[""] = MEASURES[unit][in_file] / factor if unit else Decimal(1)
    number = quantity(value, units)
    if not math.isfinite(number):
        allowed = f"a number, or {NAMES[unit].partition(' in ')[0]} with its unit" if unit else "a number"
        raise OptionError(Finding(parameter=parameter, found=f"{name} = {value}", allowed=allowed))
    return number


def _unit_and_factor(network: Network, name: str) -> tuple[str, Decimal]:
    """Return the unit of a drive, and how many of it one of its own units is."""
    if name in {one.name for one in network.controls}:
        return network.unit_of(name) or ("", Decimal(1))
    owner, _, index = name.partition("[")
    joint = next((one for one in network.joints if one.name in (name, owner)), None)
    place = int(index.rstrip("]") or 1) - 1 if index.rstrip("]").isdigit() else 0
    known = joint is not None and place < len(joint.units)
    return (joint.units[place] if joint is not None and known else ""), Decimal(1)


def _parse_ranges(network: Network, drives: Mapping[str, Range]) -> list[tuple[float, float]]:
    """Return from and to of each drive in its own unit."""

    def parse(pair: tuple[str, Range]) -> tuple[float, float]:
        name, value = pair
        unit, factor = _unit_and_factor(network, name)
        ends = [*value] if isinstance(value, (list, tuple)) else [value]
        if isinstance(value, str):
            ends = value.split(":")
        if len(ends) not in (1, 2):
            raise OptionError(Finding(parameter="drives", found=f"{name} = {shown(value)}", allowed="FROM:TO, or one value"))
        read = [parse_quantity(network, "drives", name, end, unit, factor) for end in ends]
        return read[0], read[-1]

    return for_each(parse, drives.items())


def _parse_start(network: Network, start: Mapping[str, Any]) -> dict[str, tuple[float, ...]]:
    """Return values of joints and of bodies with freedoms of their own in [rad] and [m], by name.

    Values of controls, as an assembly has them, are left out: drives and controls say where these are.
    """
    joints = {one.name: one.units for one in network.joints if one.units}
    mechanism = mechanism_of(network)
    bodies = dict.fromkeys(mechanism.graph.roots[1:], POSE_UNITS)
    units: dict[str, tuple[str, ...]] = {**bodies, **joints}
    controls = {one.name for one in network.controls}

    def parse(pair: tuple[str, Any]) -> tuple[str, tuple[float, ...]] | None:
        name, value = pair
        if name in controls and name not in units:
            return None
        if name not in units:
            raise OptionError(Finding(f"joint {not_among(name, units)}", parameter="start"))
        values = value.split(",") if isinstance(value, str) else value
        values = [values] if isinstance(values, Real) else [*values]
        if len(values) != len(units[name]):
            allowed = f"{len(units[name])} in {', '.join(units[name])}"
            raise OptionError(Finding(parameter="start", found=f"{name} = {shown(value)}", allowed=allowed))
        read = [
            parse_quantity(network, "start", name, one, unit, Decimal(1))
            for one, unit in zip(values, units[name], strict=True)
        ]
        return name, tuple(read)

    return dict(one for one in for_each(parse, start.items()) if one is not None)


def _parse_vector(parameter: str, given: str, allowed: str, si: str = "m") -> list[float]:
    values = [quantity(part, WRITTEN.get(si, {"": Decimal(1)})) for part in given.split(",")]
    if len(values) not in (3, 6) or not all(map(math.isfinite, values)):
        raise OptionError(Finding(parameter=parameter, found=shown(given), allowed=allowed))
    return values


def _parse_point(network: Network, point: Any) -> tuple[str, Vector] | None:
    """Return the body and the place in its frame in [m] of a point to trace."""
    if point is None:
        return None
    allowed = "BODY:X,Y,Z in m, or with units, such as coupler:0.45,0.2,0"
    if isinstance(point, str):
        body, sign, place = point.rpartition(":")
        if not sign:
            body, place = point, "0,0,0"
        values = _parse_vector("point", place, allowed)
    else:
        body, values = point[0], [float(value) for value in point[1]]
    if body not in network.body_names:
        raise OptionError(Finding(f"body {not_among(str(body), network.body_names)}", parameter="point"))
    if len(values) != 3 or not all(map(math.isfinite, values)):
        raise OptionError(Finding(parameter="point", found=shown(point), allowed=allowed))
    return body, (values[0], values[1], values[2])


def _parse_wrench(network: Network, wrench: str | Wrench) -> Wrench:
    """Return a load on a body."""
    allowed = "BODY:X,Y,Z:FX,FY,FZ[,MX,MY,MZ] in m, N and N.m, such as coupler:0,0,0:0,-50,0"
    if isinstance(wrench, str):
        body, _, rest = wrench.partition(":")
        place, sign, load = rest.partition(":")
        if not sign:
            raise OptionError(Finding(parameter="wrenches", found=shown(wrench), allowed=allowed))
        at, forces = _parse_vector("wrenches", place, allowed), _parse_vector("wrenches", load, allowed, "1")
        forces += [0.0] * (6 - len(forces))
        wrench = Wrench(
            body, (at[0], at[1], at[2]), (forces[0], forces[1], forces[2]), (forces[3], forces[4], forces[5])
        )
    if wrench.body not in network.body_names:
        raise OptionError(Finding(f"body {not_among(wrench.body, network.body_names)}", parameter="wrenches"))
    return wrench


def _parse_torques(network: Network, torques: Mapping[str, float | str]) -> dict[str, float]:
    """Return loads at joints in [N.m] or [N], by name."""
    joints = {one.name: one for one in network.joints if one.units and one.kind != "global"}

    def parse(pair: tuple[str, float | str]) -> tuple[str, float]:
        name, value = pair
        if name not in joints:
            raise OptionError(Finding(f"joint {not_among(name, joints)}", parameter="torques"))
        number = quantity(value, {"": Decimal(1), "N": Decimal(1), "N.m": Decimal(1), "Nm": Decimal(1)}) if isinstance(value, str) else value
        if not math.isfinite(number):
            raise OptionError(Finding(parameter="torques", found=f"{name} = {value}", allowed="a number in N.m or N"))
        return name, float(number)

    return dict(for_each(parse, torques.items()))


def _log_columns(network: Network, request: DriveRequest, log: Run) -> dict[str, str]:
    """Return the joint of the log that drives each variable: as given, else those of the same names."""
    names = [one.name for one in network.controls if one.value is None] + [one.name for one in network.joints if one.units]
    if request.drives:
        wrong = [str(one) for one in request.drives.values() if one not in log.log.joints]
        if wrong:
            faults = [Finding(f"column {not_among(one, log.log.joints)}", parameter="drives") for one in wrong]
            raise OptionError(*faults)
        return {name: str(column) for name, column in request.drives.items()}
    lowered = {column.casefold(): column for column in log.log.joints}
    same = {name: lowered[name.casefold()] for name in names if name.casefold() in lowered}
    controls = [one.name for one in network.controls if one.value is None]
    same = {name: column for name, column in same.items() if name in controls} or same
    if same:
        return same
    if len(controls) == 1 and len(log.log.joints) == 1:
        return {controls[0]: log.log.joints[0]}
    found = f"found joints {', '.join(log.log.joints)} in the log, none of which is a control or joint of {network.name}"
    allowed = f"which of them drives what, such as {(controls or names)[0]}={log.log.joints[0]}"
    raise OptionError(Finding(f"{found}; allowed: {allowed}", parameter="drives"))


def _drive_values(
    driven: Driven,
    ranges: Sequence[tuple[float, float]] | None,
    factors: FloatArray,
    columns: Mapping[str, str],
    log: Run | None,
    request: DriveRequest,
    t_ns: Any,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return values of the drives in their own units, rates per [s] and second derivatives, shape (n, driven)."""
    if log is not None:
        which = [log.log.joints.index(columns[name]) for name in driven.names]
        units = log.joint_units
        faults = [
            Finding(f"column {columns[name]} is in {units[k]}, but {name} is in {unit}; allowed: the same", parameter="drives")
            for name, unit, k in zip(driven.names, driven.units, which, strict=True)
            if unit and units[k] != unit
        ]  # fmt: skip
        q = log.q[:, which]
        if not np.isfinite(q).all():
            row = int(np.argmax(~np.isfinite(q).all(axis=1))) + 1
            faults.append(Finding(f"row {row} has no value, allowed: a value in each row", log.name, parameter="log"))
        if not log.timed:
            faults.append(Finding("found static poses, allowed: a log with times", parameter="log"))
        if faults:
            raise OptionError(*faults)
        return q / factors, log.qd[:, which] / factors, log.qdd[:, which] / factors
    duration = _duration(request, t_ns)
    shares, speed, curvature = compute_shares(request.law, seconds(t_ns) / duration)
    begin, end = np.array(ranges, dtype=np.float64).reshape(-1, 2).T
    change = end - begin
    return (
        begin + np.outer(shares, change),
        np.outer(speed / duration, change),
        np.outer(curvature / duration**2, change),
    )


def _check_control_ranges(mechanism: Mechanism, driven: Driven, values: FloatArray, log: Run | None) -> None:
    """Raise a `NetworkError` for drives beyond the range of a control, or the limits of a driven joint."""
    from urmpipe_models.networks.driving import variable_limits

    limits = variable_limits(mechanism)[driven.places]
    faults = []
    for k, name in enumerate(driven.names):
        beyond = np.flatnonzero((values[:, k] < limits[k, 0]) | (values[:, k] > limits[k, 1]))
        if len(beyond):
            where = f"row {beyond[0] + 1} of the log: " if log is not None else ""
            worst = values[beyond[np.argmax(np.abs(values[beyond, k]))], k] if log is None else values[beyond[0], k]
            allowed = f"{limits[k, 0]:g} to {limits[k, 1]:g}"
            faults.append(Finding(f"{where}found {name} = {worst:g}, allowed: {allowed}", parameter="drives"))
    if faults:
        raise NetworkError(*faults)


# ---------------------------------------------------------------------------------------- assembly, events


def _find_assembly(
    mechanism: Mechanism,
    driven: Driven,
    begin: FloatArray,
    start: Mapping[str, tuple[float, ...]],
    request: DriveRequest,
) -> FloatArray:
    """Return the assembly that the motion is to contain, shape (variables,)."""
    own = {one.name for one in mechanism.network.controls if one.value is None}
    chosen = request.branch is not None or bool(start)
    controls = {
        name: float(value)
        for name, value in zip(driven.names, begin.tolist(), strict=True)
        if chosen and name in own
    }
    found = assemble(
        mechanism, controls, start=start or None, every=request.branch is not None, restarts=request.restarts,
        seed=request.seed,
    )  # fmt: skip
    if not found.assemblies:
        gap = found.gaps[0] if found.gaps else None
        what = f": {gap.name} has a gap of {gap.metres:.4g} m and {gap.radians:.4g} rad" if gap else ""
        raise NetworkError(Finding(f"the network does not close at the start{what}", parameter="drives"))
    number = request.branch or 1
    if number > found.x.shape[1]:
        raise OptionError(Finding(parameter="branch", found=str(number), allowed=f"1 to {found.x.shape[1]}"))
    return found.x[:, number - 1]


def _labels(mechanism: Mechanism) -> list[str]:
    """Return a name per variable: of its owner, numbered where that has several."""
    counts: dict[str, int] = {}
    for one in mechanism.variables:
        counts[one.owner] = counts.get(one.owner, 0) + 1
    return [one.owner if counts[one.owner] == 1 else f"{one.owner}[{one.index + 1}]" for one in mechanism.variables]


def _events(
    mechanism: Mechanism, moved: Motion, driven: Driven, factors: FloatArray, scaled: FloatArray, t_ns: Any
) -> Iterator[MotionEvent]:
    """Yield singular poses in words, then the limit that ends the motion; `scaled` are the drives in [rad] and [m]."""
    labels, rows = _labels(mechanism), np.arange(len(t_ns))
    for pose in moved.singular:
        values = dict(zip(driven.names, (pose.x[driven.places] * factors).tolist(), strict=True))
        parts = {labels[k]: float(share) for k, share in enumerate(pose.direction.tolist()) if abs(share) > 0.01}
        free = ", ".join(sorted(parts, key=lambda name: -abs(parts[name]))[:4])
        at = _at_words(driven, values)
        message = {
            "turns back": f"turns back at {at}: no configuration of this branch lies beyond; there {free} can still move",
            "branches": f"branches at {at}: two motions cross; this one goes straight on, the other moves {free}",
            "goes through": f"goes through a singular pose at {at}, at which {free} can move by themselves",
        }[pose.passage]
        yield MotionEvent(
            pose.passage, pose.s, float(np.interp(pose.s, rows, seconds(t_ns))), values, parts, message
        )
    if moved.stop is not None:
        variable = mechanism.variables[moved.stop.variable]
        label = labels[moved.stop.variable]
        values = {
            name: float(np.interp(moved.stop.s, rows, column))
            for name, column in zip(driven.names, scaled.T, strict=True)
        }
        limit = moved.stop.limit * (_factor(mechanism.network, variable.owner) if variable.kind == "control" else 1.0)
        unit = variable.unit or (mechanism.network.unit_of(variable.owner) or ("",))[0]
        message = f"{label} reaches its limit {text.in_words(limit, unit)}"
        t = float(np.interp(moved.stop.s, rows, seconds(t_ns)))
        yield MotionEvent("limit", moved.stop.s, t, values, {}, message)


def _at_words(driven: Driven, values: Mapping[str, float]) -> str:
    words = [
        f"{name} = {values[name]:.6g}{f' {unit}' if unit else ''}"
        + (f" ({math.degrees(values[name]):.4f} deg)" if unit == "rad" else "")
        for name, unit in zip(driven.names, driven.units, strict=True)
    ]
    return ", ".join(words[:4])


def _transmissions(
    mechanism: Mechanism, moved: Motion, driven: Driven, factors: FloatArray, values: FloatArray, rates: Rates
) -> Iterator[Transmission]:
    """Yield the ratio of each joint variable that follows, and of joints that are functions of the drives."""
    labels = _labels(mechanism)
    for k in moved.free.tolist():
        variable = mechanism.variables[k]
        if variable.kind != "joint":
            continue
        for d, name in enumerate(driven.names):
            ratio = rates.transmission[k, d] / factors[d]
            moves = values[:, d]
            low, high = int(np.argmin(ratio)), int(np.argmax(ratio))
            unit = f"{variable.unit}/{driven.units[d] or '1'}"
            yield Transmission(
                labels[k], name, unit, float(ratio[low]), float(moves[low]), float(ratio[high]), float(moves[high]),
                tuple(_zeros(moves, ratio)),
            )  # fmt: skip


def _zeros(x: FloatArray, y: FloatArray) -> Iterator[float]:
    """Yield where a curve changes its sign, by a cubic polynomial through the four rows around."""
    size = float(np.abs(y).max(initial=0.0))
    for k in np.flatnonzero((y[:-1] * y[1:] < 0.0) & (np.diff(x) != 0.0)).tolist():
        if max(abs(y[k]), abs(y[k + 1])) < 1e-9 * size:
            continue  # rounding about 0
        first = min(max(k - 1, 0), max(len(x) - 4, 0))
        around = slice(first, first + 4)
        roots = np.roots(np.polyfit(x[around] - x[k], y[around], min(3, len(x[around]) - 1)))
        inner = [float(root.real) for root in roots if abs(root.imag) < 1e-9 and 0.0 <= root.real / (x[k + 1] - x[k]) <= 1.0]
        yield float(x[k]) + (inner[0] if inner else float(y[k] / (y[k] - y[k + 1]) * (x[k + 1] - x[k])))


def _forces(
    mechanism: Mechanism,
    moved: Motion,
    driven: Driven,
    factors: FloatArray,
    wrenches: Sequence[Wrench],
    torques: Mapping[str, float],
) -> MotionForces:
    """Return static forces as tables of columns."""
    found = compute_forces(mechanism, moved.x, driven.places, moved.free, wrenches, torques)
    names: list[str] = []
    columns: list[FloatArray] = []
    for name, values in found.reactions.items():
        if len(values) == 1:
            names.append(f"{name} force")
        else:
            names += [f"{name} {what} {axis}" for what in ("force", "moment") for axis in ("m", "n", "m x n")]
        columns += [*values]
    return MotionForces(found.drives.T / factors, tuple(names), np.array(columns).T.reshape(moved.x.shape[1], -1))
