"""From a request to drive a network to its motion: values with units, the assembly, the motion, its rates.

1. `DriveRequest`: the drives and their options; `check` refuses what no network can follow.
2. `parse_ranges`, `parse_start`, `parse_point`, `parse_wrench`, `parse_torques`: texts with units become SI.
3. `drive_network`: assembly (by default that of the file's start, else the nearest to start values, or one by
   its number), motion along a line or along a log, rates, transmission, static forces, singular poses in
   words.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Integral, Real
from typing import Any

import numpy as np

from urmpipe_models.elementwise import FloatArray, Vector
from urmpipe_models.errors import (
    Finding,
    Hint,
    NetworkError,
    OptionError,
    format_unknown_name,
    format_value,
    map_collecting_errors,
)
from urmpipe_models.networks.assembly import DEFAULT_RESTARTS, MAX_STARTS, assemble
from urmpipe_models.networks.continuation import LimitStop, SingularPose
from urmpipe_models.networks.driving import (
    LAWS,
    DrivenMotion,
    DrivenVariables,
    Law,
    compute_shares,
    drive_rows,
    find_driven_variables,
    variable_limits,
)
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.forces import Wrench, compute_forces
from urmpipe_models.networks.mechanism import Mechanism, build_mechanism
from urmpipe_models.networks.rates import Rates, compute_rates
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import SourceFile, ns_to_seconds
from urmpipe_pipeline.networks.given_values import (
    Quantity,
    Range,
    drive_factor,
    format_wrench,
    is_word,
    parse_point,
    parse_ranges,
    parse_start,
    parse_torques,
    parse_wrench,
)
from urmpipe_pipeline.networks.network_motion import (
    DriveRange,
    MotionEvent,
    MotionForces,
    NetworkMotion,
    Transmission,
)
from urmpipe_pipeline.provenance import build_provenance
from urmpipe_pipeline.runs.run import Run

DEFAULT_STEPS = 200
MAX_ZERO_STEP = 0.5  # scaled step of a drive between rows, above which zeros between them are missed
MIN_RATIO = 1e-9  # a transmission whose size stays below is rounding
MAX_ROWS = 10_000_000  # of a motion: about 2 GB of variables and rates of a network of ten


@dataclass(frozen=True, slots=True)
class DriveRequest:
    """The drives of a network, and the options of its motion.

    Attributes:
        drives: From and to of controls and joints by name; one value holds. Of controls numbers are in the
            units of the file, of joints in [rad] and [m]; texts have their own unit, or that of the file.
            With a log: the name of the column that drives each; empty for columns of their names.
        steps: Equal steps of the drives, `tsp` each; None with a duration or a log.
        duration: Duration in [s]; None with steps.
        law: How the drives move over the duration.
        tsp: Time from row to row in [s].
        branch: Number of the assembly at the begin of the drives, from 1, as `network solve --all` lists
            them.
        start: Values of joints by name: the nearest assembly to them at the begin of the drives.
        point: A point of a body to trace: "BODY:X,Y,Z", or the body and x, y, z in [m].
        wrenches: Loads: "BODY:X,Y,Z:FX,FY,FZ" with MX,MY,MZ at the end if wanted, the point in the frame of
            the body in [m], force [N] and moment [N.m] along the axes of the ground.
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
    restarts: int = DEFAULT_RESTARTS
    seed: int = 0

    def check(self) -> None:
        """Raise an `OptionError` with everything that makes no sense, whatever the network is."""
        if faults := list(self._faults()):
            raise OptionError(*faults)

    def _faults(self) -> Iterator[Finding]:
        for key, least in (("steps", 1), ("branch", 1), ("restarts", 0), ("seed", 0)):
            count = getattr(self, key)
            if count is not None and (
                isinstance(count, bool) or not isinstance(count, Integral) or count < least
            ):
                yield Finding(
                    parameter=key, found=format_value(count), allowed=f"a whole number, {least} or more"
                )
        for key, value in (("duration", self.duration), ("tsp", self.tsp)):
            if value is not None and not (isinstance(value, Real) and 1e-9 <= float(value) < 1e9):
                yield Finding(parameter=key, found=format_value(value), allowed="a time in s, 1e-9 to 1e9")
        if self.steps is not None and self.duration is not None:
            yield Finding("found together with steps, allowed: one of the two", parameter="duration")
        if self.law not in LAWS:
            yield Finding(format_unknown_name(str(self.law), LAWS), parameter="law")
        elif self.law != "uniform" and self.duration is None:
            hints = (Hint("duration", None, "gives one"),)
            yield Finding(
                "found without a duration, allowed: only with a duration", parameter="law", hints=hints
            )
        if isinstance(self.restarts, Integral) and self.restarts > MAX_STARTS:
            yield Finding(
                parameter="restarts", found=format_value(self.restarts), allowed=f"{MAX_STARTS} at most"
            )
        if self.branch is not None and self.start:
            yield Finding("found together with start, allowed: one of the two", parameter="branch")

    def times_ns(self) -> Any:
        """Return the times of the rows in integer [ns], shape (n,).

        Raises:
            OptionError: If there are too many.
        """
        count = self.steps or DEFAULT_STEPS
        if self.duration is not None:
            count = math.ceil(self.duration / self.tsp - 1e-9)  # the last row is less than tsp after the end
        if not 1 <= count <= MAX_ROWS:
            allowed = f"1 to {MAX_ROWS} steps of {self.tsp:g} s"
            raise OptionError(
                Finding(parameter="duration" if self.duration else "steps", found=str(count), allowed=allowed)
            )
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
    mechanism = build_mechanism(network)
    columns = _log_columns(network, request, log) if log is not None else {}
    holds = {name: value for name, value in request.drives.items() if log is None or not is_word(value)}
    columns = {name: column for name, column in columns.items() if name not in holds}
    names = [*columns, *holds]
    parts: tuple[Callable[[], Any], ...] = (
        request.check,
        lambda: _find_driven(mechanism, names),
        lambda: parse_ranges(network, holds),
        lambda: parse_start(network, request.start),
        lambda: parse_point(network, request.point),
        lambda: [parse_wrench(network, wrench) for wrench in request.wrenches],
        lambda: parse_torques(network, request.torques),
    )
    _, driven, ranges, start, point, wrenches, torques = map_collecting_errors(lambda make: make(), parts)
    t_ns = request.times_ns() if log is None else log.t_ns
    factors = np.array([drive_factor(network, name) for name in driven.names])
    values, d_values, dd_values = _drive_values(driven, ranges, factors, columns, log, request, t_ns)
    _check_control_ranges(mechanism, driven, values, log)
    x = _find_assembly(mechanism, driven, values[0], start, request)
    moved = drive_rows(mechanism, x, driven, values, lambda share: progress(0.6 * share))
    n = moved.x.shape[1]
    if n == 0:
        raise NetworkError(Finding("the motion ends before its first row", parameter="drives"))
    rates = compute_rates(
        mechanism, moved.x, d_values[:n].T, dd_values[:n].T, driven.places, moved.free, moved.spins,
        moved.slopes,
    )  # fmt: skip
    progress(0.9)
    loaded = bool(wrenches or torques)
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
        events=tuple(_events(mechanism, moved, driven, factors, t_ns)),
        transmission=tuple(_transmissions(mechanism, moved, driven, factors, scaled[:n], rates)),
        forces=_forces(mechanism, moved, driven, factors, wrenches, torques) if loaded else None,
        warnings=() if log is None else tuple(log.warnings),
        provenance=build_provenance(
            "network drive", _options(network, request, columns, log, point, wrenches), inputs
        ),
    )


def _options(
    network: Network,
    request: DriveRequest,
    columns: Mapping[str, str],
    log: Run | None,
    point: tuple[str, Vector] | None,
    wrenches: Sequence[Wrench],
) -> dict[str, Any]:
    """Return how to repeat the motion: the request with points and loads in SI."""
    return {
        "network": network.name,
        "drives": {name: _plain(value) for name, value in {**columns, **request.drives}.items()},
        "steps": request.steps, "duration": request.duration, "law": request.law if log is None else None,
        "tsp": request.tsp if log is None else None, "branch": request.branch,
        "start": {name: _plain(value) for name, value in request.start.items()} or None,
        "point": None if point is None else f"{point[0]}:{','.join(map(repr, point[1]))}",
        "wrenches": [format_wrench(wrench) for wrench in wrenches] or None,
        "torques": dict(request.torques) or None, "restarts": request.restarts, "seed": request.seed,
        "log": None if log is None else dict(log.provenance.options),
    }  # fmt: skip


def _find_driven(mechanism: Mechanism, names: Sequence[str]) -> DrivenVariables:
    """Return the prescribed variables; raise an `OptionError` if there are none."""
    if not names:
        network = mechanism.network
        controls = [control.name for control in network.controls if control.value is None]
        free = [joint.name for joint in network.joints if None in joint.drives]
        ranges = ", ".join(f"{name}=FROM:TO" for name in controls or free)
        allowed = ranges or f"a network with a control or a joint that can be driven; {network.name} has none"
        raise OptionError(Finding(parameter="drives", found="none", allowed=allowed))
    return find_driven_variables(mechanism, names)


def _plain(value: Any) -> Any:
    return [*value] if isinstance(value, (list, tuple)) else value


def _log_columns(network: Network, request: DriveRequest, log: Run) -> dict[str, str]:
    """Return the joint of the log that drives each variable: as given, else those of the same names.

    A joint that a control drives by itself stands for the control, as in the log of a motion.
    """
    joints = log.log.joints
    by_name = {name: str(column) for name, column in request.drives.items() if is_word(column)}
    if invalid := [column for column in by_name.values() if column not in joints]:
        faults = [
            Finding(f"column {format_unknown_name(name, joints)}", parameter="drives") for name in invalid
        ]
        raise OptionError(*faults)
    if by_name:
        return by_name
    columns = {column.casefold(): column for column in joints}
    controls = [control.name for control in network.controls if control.value is None]
    named = {name: columns[name.casefold()] for name in controls if name.casefold() in columns}
    single = [joint for joint in network.joints if len(joint.units) == 1]
    for joint in single:
        control = network.sole_control(joint.drives[0].text) if joint.drives[0] is not None else None
        if control is not None and joint.name.casefold() in columns:
            named.setdefault(control, columns[joint.name.casefold()])
    free = [joint.name for joint in single if joint.drives[0] is None]
    named = named or {name: columns[name.casefold()] for name in free if name.casefold() in columns}
    if named:
        return named
    if len(controls) == 1 and len(joints) == 1:
        return {controls[0]: joints[0]}
    if not joints:
        raise OptionError(Finding(parameter="log", found="no joints", allowed="a log with joints"))
    listed = ", ".join(joints)
    message = f"found joints {listed} in the log, none of which is a control or joint of {network.name}"
    allowed = f"which of them drives what, such as {(controls or free or ['CONTROL'])[0]}={joints[0]}"
    raise OptionError(Finding(f"{message}; allowed: {allowed}", parameter="drives"))


def _drive_values(
    driven: DrivenVariables,
    ranges: Sequence[tuple[float, float]] | None,
    factors: FloatArray,
    columns: Mapping[str, str],
    log: Run | None,
    request: DriveRequest,
    t_ns: Any,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return values of the drives in their own units with two derivatives by time, shape (n, driven) each."""
    if log is not None:
        which = [log.log.joints.index(column) for column in columns.values()]
        units = log.joint_units
        pairs = zip(columns, driven.units, which, strict=False)
        invalid = [(name, unit, units[k]) for name, unit, k in pairs if unit and units[k] != unit]
        faults = [
            Finding(
                f"column {columns[name]} is in {other}, allowed: {unit}, the unit of {name}",
                parameter="drives",
            )
            for name, unit, other in invalid
        ]
        q = log.q[:, which]
        if not np.isfinite(q).all():
            row = int(np.argmax(~np.isfinite(q).all(axis=1))) + 1
            column = log.log.joints[which[int(np.argmax(~np.isfinite(q[row - 1])))]]
            message = (
                f"row {row} has no value of {column} (a gap), allowed: a value in each row; split the log"
            )
            faults.append(Finding(message, log.log.files[0].name if log.log.files else log.name))
        if not log.timed:
            faults.append(Finding("found static poses, allowed: a log with times", parameter="log"))
        if faults:
            raise OptionError(*faults)
        constants = np.tile([end for _, end in ranges or ()], (len(q), 1))
        if any(begin != end for begin, end in ranges or ()):
            message = "found a range beside a log, allowed: one value, which holds, or a joint of the log"
            raise OptionError(Finding(message, parameter="drives"))
        still, local = np.zeros_like(constants), factors[: len(which)]
        parts = (q, log.qd[:, which], log.qdd[:, which])
        values, rates, curvatures = (
            np.hstack((part / local, rest))
            for part, rest in zip(parts, (constants, still, still), strict=True)
        )
        return values, rates, curvatures
    duration = request.duration if request.duration is not None else float(ns_to_seconds(t_ns)[-1])
    shares, speed, curvature = compute_shares(request.law, ns_to_seconds(t_ns) / duration)
    begin, end = np.array(ranges, dtype=np.float64).reshape(-1, 2).T
    change = end - begin
    return (
        begin + np.outer(shares, change),
        np.outer(speed / duration, change),
        np.outer(curvature / duration**2, change),
    )


def _check_control_ranges(
    mechanism: Mechanism, driven: DrivenVariables, values: FloatArray, log: Run | None
) -> None:
    """Raise a `NetworkError` for drives beyond the range of a control, or the limits of a driven joint."""
    limits = variable_limits(mechanism)[driven.places]
    faults = []
    for k, name in enumerate(driven.names):
        beyond = np.flatnonzero((values[:, k] < limits[k, 0]) | (values[:, k] > limits[k, 1]))
        if len(beyond):
            where = f"row {beyond[0] + 1} of the log: " if log is not None else ""
            worst = (
                values[beyond[np.argmax(np.abs(values[beyond, k]))], k]
                if log is None
                else values[beyond[0], k]
            )
            allowed = f"{limits[k, 0]:g} to {limits[k, 1]:g}"
            faults.append(Finding(f"{where}found {name} = {worst:g}, allowed: {allowed}", parameter="drives"))
    if faults:
        raise NetworkError(*faults)


# ---------------------------------------------------------------------------------------- assembly, events


def _find_assembly(
    mechanism: Mechanism,
    driven: DrivenVariables,
    begin: FloatArray,
    start: Mapping[str, tuple[float, ...]],
    request: DriveRequest,
) -> FloatArray:
    """Return the assembly that the motion is to contain, shape (variables,)."""
    local = {control.name for control in mechanism.network.controls if control.value is None}
    chosen = request.branch is not None or bool(start)
    controls = {
        name: float(value)
        for name, value in zip(driven.names, begin.tolist(), strict=True)
        if chosen and name in local
    }
    solution = assemble(
        mechanism, controls, start=start or None, find_all=request.branch is not None,
        restarts=request.restarts, seed=request.seed,
    )  # fmt: skip
    if not solution.assemblies:
        gap = solution.closure_errors[0] if solution.closure_errors else None
        what = f": {gap.name} has a gap of {gap.metres:.4g} m and {gap.radians:.4g} rad" if gap else ""
        raise NetworkError(Finding(f"the network does not close at the start{what}", parameter="drives"))
    number = request.branch or 1
    if number > solution.x.shape[1]:
        raise OptionError(
            Finding(parameter="branch", found=str(number), allowed=f"1 to {solution.x.shape[1]}")
        )
    return solution.x[:, number - 1]


def _events(
    mechanism: Mechanism, moved: DrivenMotion, driven: DrivenVariables, factors: FloatArray, t_ns: Any
) -> Iterator[MotionEvent]:
    """Yield singular poses, then the limit that ends the motion."""

    def event(
        kind: Any, pose: SingularPose | LimitStop, parts: dict[str, float], message: str
    ) -> MotionEvent:
        t = float(np.interp(pose.s, np.arange(len(t_ns)), ns_to_seconds(t_ns)))
        values = dict(zip(driven.names, (pose.x[driven.places] * factors).tolist(), strict=True))
        return MotionEvent(kind, pose.s, t, values, parts, message.format(at=_at_words(driven, values)))

    for pose in moved.singular:
        shares = zip(mechanism.labels, pose.direction.tolist(), strict=True)
        parts = {label: share for label, share in shares if abs(share) > 0.01}
        free = ", ".join(sorted(parts, key=lambda name: -abs(parts[name]))[:4])
        message = {
            "turns back": f"turns back at {{at}}: this branch ends there; {free} can still move",
            "branches": f"branches at {{at}}: this motion goes straight on, the other one moves {free}",
            "goes through": f"goes through a singular pose at {{at}}; there {free} can move alone",
        }[pose.passage]
        yield event(pose.passage, pose, parts, message)
    if moved.stop is not None:
        stop = moved.stop
        control = stop.name if stop.name in {item.name for item in mechanism.network.controls} else ""
        unit = (mechanism.network.control_unit(control) or ("",))[0] if control else stop.unit
        limit = stop.limit * (drive_factor(mechanism.network, control) if control else 1.0)
        words = text.format_rounded(limit, unit) if unit else f"{limit:.6g}"
        words = f"{stop.name} reaches its limit {words} at {{at}}"
        yield event("limit", stop, {}, words)


def _at_words(driven: DrivenVariables, values: Mapping[str, float]) -> str:
    values = {name: round(value, 12) + 0.0 for name, value in values.items()}
    words = [
        f"{name} = {values[name]:.9g}{f' {unit}' if unit else ''}"
        + (f" ({math.degrees(values[name]):.4f} deg)" if unit == "rad" else "")
        for name, unit in zip(driven.names, driven.units, strict=True)
    ]
    return ", ".join(words[:4])


def _transmissions(
    mechanism: Mechanism,
    moved: DrivenMotion,
    driven: DrivenVariables,
    factors: FloatArray,
    values: FloatArray,
    rates: Rates,
) -> Iterator[Transmission]:
    """Yield the ratio of each joint variable that follows, and of joints that are functions of the drives."""
    labels = mechanism.labels
    for k in moved.free.tolist():
        variable = mechanism.variables[k]
        unit, factor = variable.unit, 1.0
        if variable.kind == "control":  # that follows a joint driven in its place
            unit, decimal = mechanism.network.control_unit(variable.owner) or ("1", 1)
            factor = float(decimal)
        if variable.kind == "body":
            continue
        for d, name in enumerate(driven.names):
            ratio, moves = rates.transmission[k, d] * factor / factors[d], values[:, d]
            if not np.isfinite(ratio).any():
                continue
            rows = (np.nanargmin(ratio), np.nanargmax(ratio))
            ends = [(float(ratio[row]), float(moves[row])) for row in rows]
            per = f"{unit}/{driven.units[d] or '1'}"
            steps = np.abs(np.diff(values[:, d] / factors[d])) / mechanism.column_scales[driven.places[d]]
            zeros = _find_zeros(moves, ratio) if steps.max(initial=0.0) < MAX_ZERO_STEP else ()
            yield Transmission(labels[k], name, per, *ends[0], *ends[1], zeros)


def _find_zeros(x: FloatArray, y: FloatArray) -> tuple[float, ...]:
    """Return where a curve changes its sign, once each, by inverse interpolation between the rows around."""
    size, span = float(np.nanmax(np.abs(y), initial=0.0)), float(np.ptp(x))
    zeros: list[float] = []
    if size < MIN_RATIO:
        return ()
    for k in np.flatnonzero((y[:-1] * y[1:] < 0.0) & (np.diff(x) != 0.0)).tolist():
        if max(abs(y[k]), abs(y[k + 1])) < 1e-9 * size:
            continue  # rounding about 0
        around = slice(max(k - 1, 0), k + 3)
        values, steps = y[around], np.diff(y[around])
        zero = float(x[k] + y[k] / (y[k] - y[k + 1]) * (x[k + 1] - x[k]))
        if (steps > 0.0).all() or (steps < 0.0).all():  # x as a polynomial of y at y = 0, by Lagrange
            others = [np.delete(values, i) for i in range(len(values))]
            weights = [np.prod(rest / (rest - value)) for rest, value in zip(others, values, strict=True)]
            zero = float(x[around] @ np.array(weights))
        zero = 0.0 if abs(zero) < 1e-12 * span else zero
        if not any(abs(zero - other) < 1e-6 * span for other in zeros):
            zeros.append(zero)
    return tuple(zeros)


def _forces(
    mechanism: Mechanism,
    moved: DrivenMotion,
    driven: DrivenVariables,
    factors: FloatArray,
    wrenches: Sequence[Wrench],
    torques: Mapping[str, float],
) -> MotionForces:
    """Return static forces as tables of columns."""
    solution = compute_forces(mechanism, moved.x, driven.places, moved.free, wrenches, torques, moved.slopes)
    names: list[str] = []
    columns: list[FloatArray] = []
    for name, values in solution.reactions.items():
        if len(values) == 1:
            names.append(f"{name} force")
        else:
            names += [f"{name} {what} {axis}" for what in ("force", "moment") for axis in ("m", "n", "m x n")]
        columns += [*values]
    return MotionForces(
        solution.drives.T / factors, tuple(names), np.array(columns).T.reshape(moved.x.shape[1], -1)
    )
