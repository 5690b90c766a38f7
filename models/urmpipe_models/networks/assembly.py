"""Assembly of a network: the configurations in which it closes, from a rough start and from random ones.

1. `assemble`: the network's start is solved (`closure.solve_closure`). If it does not close, random starts
   follow until one does.
2. Nearest: random starts that are nearer to the network's start than the nearest assembly so far, again after
   each success, until NEAREST_RESTARTS of them lead to no nearer one.
3. All: random starts anywhere, until a number of them in a row leads to nothing new. Two configurations are
   one assembly if their bodies are in the same places; idle spins are first reset to the start (`mobility`).
4. If a network moves with its controls held, its assemblies are a continuum and are not listed.
5. If nothing closes: the configuration of least residual, and its gaps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, NetworkError, format_unknown_name
from urmpipe_models.networks.closure import DescentResult, evaluate_closure, pose_error, solve_closure
from urmpipe_models.networks.faults import validate_values
from urmpipe_models.networks.joint_motion import exp3
from urmpipe_models.networks.mechanism import Mechanism
from urmpipe_models.networks.mobility import (
    find_idle_spins,
    find_spinning_bodies,
    mobility_by_rank,
    nearby_mobility,
    reset_idle_spins,
)
from urmpipe_models.networks.parts import POSE_UNITS

CLOSED_TOLERANCE = 1e-9  # gap in lengths of the mechanism and in [rad]; less is rounding
SAME_ASSEMBLY = 1e-6  # distance of bodies in lengths of the mechanism, and of entries of their rotations
# Starts in a row without a nearer assembly that end the search for the nearest. From 30 rough starts of the
# Stewart-Gough platform, which has 40 assemblies, 20 missed the nearest twice, 50 never.
NEAREST_RESTARTS = 100
DEFAULT_RESTARTS = 2000  # starts in a row without a new assembly that end a search
BATCH_SIZE, MAX_ENTRIES = 500, 2e7  # starts solved side by side, and entries of their Jacobians together
MAX_STARTS = 200_000  # starts of a search
MAX_ASSEMBLIES = 1000  # more are a continuum


@dataclass(frozen=True, slots=True, eq=False)
class Assembly:
    """A configuration in which everything closes, or one that comes nearest to that.

    Attributes:
        values: The values of each control, joint (driven ones, too) and body with freedoms, by its name, in
            [rad] and [m] by `Joint.units` and `POSE_UNITS`, of a control as it is given.
        poses: The bodies in the ground, the ground first, in the order of `Network.body_names`, as matrices
            [-] and [m], shape (bodies, 4, 4).
        residual: The largest gap in [m] and [rad].
        mobility: Variables less the rank of the Jacobian.
    """

    values: dict[str, tuple[float, ...]]
    poses: FloatArray
    residual: float
    mobility: int


@dataclass(frozen=True, slots=True)
class ClosureError:
    """What does not close.

    Attributes:
        name: The cut joint, or the element.
        loop: The names of the joints of its loop; of an element its name.
        metres: Distance in [m]; what an element is too long or too short by.
        radians: Angle of the rotation between both sides in [rad]; the error of a gear or a rocker.
    """

    name: str
    loop: tuple[str, ...]
    metres: float
    radians: float


@dataclass(frozen=True, slots=True, eq=False)
class AssemblyResult:
    """Result of an assembly.

    Attributes:
        x: The variables of each assembly, the nearest to the start first, shape (variables, n), in [m], [rad]
            and as controls are given.
        assemblies: The assemblies; empty if nothing closes.
        nearest: What comes nearest to closing where nothing closes.
        x_nearest: Its variables in [m] and [rad], shape (variables,); of the first assembly if there is one.
        closure_errors: What does not close there, the largest first.
        start_count: Number of starts until one closed, or for all assemblies, the network's start counted.
        reason: Why the search ended.
        elsewhere: Whether only a random start closed, not the network's.
        continuum: Dimension of the assemblies with controls and idle spins held; 0 if they are separate.
        distances: Distances of all assemblies of the search from the start, in [rad] and lengths of the
            mechanism, rising: those of `assemblies` come first.
    """

    x: FloatArray
    assemblies: tuple[Assembly, ...]
    nearest: Assembly | None
    x_nearest: FloatArray
    closure_errors: tuple[ClosureError, ...]
    start_count: int
    reason: str
    elsewhere: bool
    continuum: int
    distances: tuple[float, ...] = ()


def assemble(
    mechanism: Mechanism,
    controls: Mapping[str, float] | None = None,
    *,
    start: Mapping[str, Sequence[float]] | None = None,
    find_all: bool = False,
    restarts: int = DEFAULT_RESTARTS,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> AssemblyResult:
    """Return the assembly nearest to the start, or all, with controls and idle spins held.

    The distance is the root of the squared differences of the free variables: angles by the shorter way
    round, rotations by the angle between them, lengths over that of the mechanism.

    Args:
        mechanism: The network.
        controls: Values to hold controls at instead of their starts.
        start: Values of joints and free bodies to be near to instead of the network's start, by name, in
            [rad] and [m]; then only these count for the distance.
        find_all: Whether all assemblies are sought.
        restarts: Random starts in a row without anything new that end the search; 0: the network's start
            alone.
        seed: Of the random starts.
        progress: Called with the share that is done, 0..1.

    Raises:
        NetworkError: If a control is not of the network, or its value out of its range.
    """
    begin = start_configuration(mechanism, controls or {})
    named = [
        (mechanism.variable_index[name, index], value)
        for name, values in (start or {}).items()
        for index, value in enumerate(values)
        if (name, index) in mechanism.variable_index
    ]
    for place, value in named:
        begin[place] = value
    search = _Search(mechanism, begin, [place for place, _ in named])
    closed = any(search.add(solve_closure(mechanism, begin[:, np.newaxis], mechanism.free)))
    tried, reason = 1, "the start closes"
    rng = np.random.default_rng(seed)
    if not closed:
        tried, reason = search.run(False, restarts, rng, progress)
    continuum = 0
    if search.kept:
        mobility = nearby_mobility(mechanism, search.kept[0], mechanism.free)
        continuum = max(0, mobility - len(find_spinning_bodies(mechanism, search.kept[0])))
    if search.kept and not continuum:
        search.seek_nearer(0 if named else min(restarts, NEAREST_RESTARTS), seed)
        if find_all or named:  # near in a few joints may be far in the others
            more, reason = search.run(True, restarts, rng, progress)
            tried += more - 1
    if continuum and find_all:
        reason = (
            f"with its controls held the network still moves, with mobility {continuum}: the assembly nearest"
            " to the start is shown"
        )
    is_elsewhere = not closed and bool(search.kept)
    return search.result(find_all, tried, reason, elsewhere=is_elsewhere, continuum=continuum)


def single_assembly(mechanism: Mechanism, x: FloatArray, reason: str) -> AssemblyResult:
    """Return a configuration that closes as the only assembly, its angles within -pi and pi.

    Args:
        mechanism: The network.
        x: The variables, shape (variables,), in [m], [rad] and as controls are given.
        reason: How it was reached.
    """
    search = _Search(mechanism, x)
    search.kept.append(_wrap_angles(mechanism, x[:, np.newaxis])[:, 0])
    return search.result(False, 1, reason, elsewhere=False, continuum=0)


def start_configuration(mechanism: Mechanism, controls: Mapping[str, float]) -> FloatArray:
    """Return where assembly starts with some controls set, in [m], [rad] and as given, shape (variables,).

    Raises:
        NetworkError: With every control that is not of the network or cannot be set, every value out of the
            control's range, and what such values make no number or no length.
    """
    settable = {control.name: control for control in mechanism.network.controls if control.value is None}
    faults = []
    for name, value in controls.items():
        if name not in settable:
            faults.append(Finding(f"control {format_unknown_name(name, settable)}", parameter="controls"))
        elif not (math.isfinite(value) and settable[name].lower <= value <= settable[name].upper):
            allowed = f"{settable[name].lower:g} to {settable[name].upper:g}"
            setting = f"{name} = {value:g}"
            faults.append(Finding(found=setting, allowed=allowed, parameter="controls"))  # plain: ok
    if controls and not faults:
        parts = mechanism.network.as_parts()
        moved = tuple(
            replace(control, start=controls.get(control.name, control.start)) for control in parts.controls
        )
        at = "at " + ", ".join(f"{name} = {value:g}" for name, value in controls.items())
        faults += validate_values(replace(parts, controls=moved), at)
    if faults:
        raise NetworkError(*faults)
    start = np.array(mechanism.start)
    for name, value in controls.items():
        start[mechanism.variable_index[name, 0]] = value
    return start


class _Search:
    """The assemblies so far, each once, and the configuration that comes nearest to closing."""

    def __init__(self, mechanism: Mechanism, start: FloatArray, named: Sequence[int] = ()) -> None:
        self.mechanism, self.start = mechanism, start
        self.kept: list[FloatArray] = []
        self._places: list[FloatArray] = []
        self._spins = find_idle_spins(mechanism)
        self._nearest, self._gap = start, np.inf
        self._counted = np.array(named, dtype=np.intp) if named else np.arange(len(start))

    def run(
        self,
        find_all: bool,
        restarts: int,
        rng: np.random.Generator,
        progress: Callable[[float], None] | None,
    ) -> tuple[int, str]:
        """Try random starts, and return how many starts were tried, and why the search ended."""
        mechanism = self.mechanism
        tried = in_vain = 0
        while in_vain < restarts and tried < MAX_STARTS and len(self.kept) < MAX_ASSEMBLIES:
            together = max(1, int(MAX_ENTRIES / len(self.start) ** 2))
            count = min(BATCH_SIZE, together, restarts - in_vain)
            starts = _random_starts(mechanism, self.start, count, rng)
            ends = solve_closure(mechanism, starts, mechanism.free, to_minimum=False)
            for is_new in self.add(ends):
                tried, in_vain = tried + 1, 0 if is_new else in_vain + 1
                if is_new and not find_all:
                    return tried + 1, "a random start closed"
                if in_vain >= restarts:
                    break
            if progress is not None:
                progress(min(in_vain / max(restarts, 1), 1.0))
        if in_vain < restarts:
            return tried + 1, f"at least {len(self.kept)}: the search was cut off"
        if not self.kept and not self._refine():
            return tried + 1, f"none of {in_vain} random starts closed"
        return tried + 1, f"at least {len(self.kept)}: {in_vain} random starts in a row found nothing new"

    def seek_nearer(self, count: int, seed: int) -> None:
        """Try `count` random starts nearer than the nearest assembly, again after each success."""
        mechanism, rng, before = self.mechanism, np.random.default_rng(seed), math.inf
        while count and SAME_ASSEMBLY < (now := float(self._distances().min())) < before - SAME_ASSEMBLY:
            before = now
            offsets = rng.normal(size=(len(mechanism.free), count))
            offsets *= now * rng.uniform(size=count) / np.linalg.norm(offsets, axis=0)
            starts = np.repeat(self.start[:, np.newaxis], count, axis=1)
            starts[mechanism.free] += offsets * mechanism.column_scales[mechanism.free, np.newaxis]
            for _ in self.add(solve_closure(mechanism, starts, mechanism.free, to_minimum=False)):
                pass

    def add(self, ends: DescentResult) -> Iterator[bool]:
        """Yield for each configuration whether it closes and is new; if so, it is kept."""
        gaps = np.where(np.isnan(ends.gap), np.inf, ends.gap)
        best = int(np.argmin(gaps))
        if gaps[best] < self._gap:
            self._nearest, self._gap = ends.x[:, best], float(gaps[best])
        closed = gaps <= CLOSED_TOLERANCE
        wrapped = _wrap_angles(self.mechanism, ends.x[:, closed])
        x = reset_idle_spins(self.mechanism, self._spins, wrapped, self.start)
        candidates = iter(zip(x.T, self._body_places(x), strict=True))
        for is_closed in closed:
            yield bool(is_closed) and self._keep(*next(candidates))

    def _keep(self, x: FloatArray, place: FloatArray) -> bool:
        """Keep a configuration that is none of those kept already; return whether it is kept."""
        if self.kept and (np.abs(np.array(self._places) - place).max(axis=1) <= SAME_ASSEMBLY).any():
            return False
        self.kept.append(x)
        self._places.append(place)
        return True

    def _body_places(self, x: FloatArray) -> FloatArray:
        """Return positions of the bodies in lengths of the mechanism, and rotations, shape (n, k).

        Of a body that spins idly the points where it is tied, of others the first of them and its rotation.
        """
        spinning = {name for spin in self._spins for name in spin.bodies}
        places = []
        for name, frame in self.mechanism.poses(x).items():
            points = self.mechanism.points[name]
            if name not in spinning:
                places += [entry for row in frame.rotation for entry in row]
            for point in points if name in spinning else points[:1]:
                places += [entry / self.mechanism.length for entry in frame.point(point)]
        return np.stack([np.broadcast_to(place, x.shape[1:]) for place in places], axis=1)

    def _refine(self) -> bool:
        """Solve what comes nearest to closing to its least residual; return whether it closes then."""
        self._gap = np.inf  # the minimum is of the sum of squared gaps, not of the largest gap
        nearest = self._nearest[:, np.newaxis]
        return any(self.add(solve_closure(self.mechanism, nearest, self.mechanism.free)))

    def _distances(self) -> FloatArray:
        """Return the distance of each assembly from the start, in [rad] and lengths, shape (n,)."""
        x, start = np.array(self.kept).T, self.start[:, np.newaxis]
        distances = (x - start) / self.mechanism.column_scales[:, np.newaxis]
        angles = self.mechanism.angles
        distances[angles] -= 2.0 * np.pi * np.round(distances[angles] / (2.0 * np.pi))
        for part in self.mechanism.rotations:
            turn = exp3(tuple(start[part])).inverse() @ exp3(tuple(x[part]))
            distances[part] = pose_error(turn, x.shape[1])[3:]
        return np.asarray(np.linalg.norm(distances[self._counted], axis=0))

    def result(
        self, find_all: bool, tried: int, reason: str, *, elsewhere: bool, continuum: int
    ) -> AssemblyResult:
        """Return the nearest assembly, or all, sorted by the distance from the start."""
        mechanism = self.mechanism
        distances = self._distances().round(6) if self.kept else np.empty(0)
        pairs = sorted(zip(distances, self.kept, strict=True), key=lambda pair: (pair[0], *pair[1]))
        order = [x for _, x in (pairs if find_all else pairs[:1])]
        nearest = order[0] if order else _wrap_angles(mechanism, self._nearest[:, np.newaxis])[:, 0]
        return AssemblyResult(
            np.array(order).T.reshape(len(self.start), -1),
            tuple(_build_assembly(mechanism, x) for x in order),
            None if order else _build_assembly(mechanism, nearest),
            nearest,
            () if order else _find_gaps(mechanism, nearest),
            tried,
            reason,
            elsewhere,
            continuum,
            tuple(sorted(distances.tolist())),
        )


def _random_starts(
    mechanism: Mechanism, start: FloatArray, count: int, rng: np.random.Generator
) -> FloatArray:
    """Return random angles and orientations, and lengths near the start, shape (variables, n)."""
    x = np.repeat(start[:, np.newaxis], count, axis=1)
    for k in mechanism.free:
        if mechanism.variables[k].unit == "m":
            x[k] += mechanism.length * rng.normal(size=count)
        else:
            x[k] = rng.uniform(-np.pi, np.pi, count)
    for part in mechanism.rotations:
        quat = rng.normal(size=(4, count))
        quat /= np.linalg.norm(quat, axis=0)
        axis = quat[:3] / np.linalg.norm(quat[:3], axis=0)
        x[part] = 2.0 * np.arccos(np.clip(np.abs(quat[3]), 0.0, 1.0)) * np.where(quat[3] < 0.0, -axis, axis)
    return x


def _wrap_angles(mechanism: Mechanism, x: FloatArray) -> FloatArray:
    """Return the same configurations with angles within -pi and pi; helices stay."""
    angles, wrapped = mechanism.angles, np.array(x)
    wrapped[angles] -= 2.0 * np.pi * np.round(wrapped[angles] / (2.0 * np.pi))
    return wrapped


def _build_assembly(mechanism: Mechanism, x: FloatArray) -> Assembly:
    """Return a configuration, its variables in [m], [rad] and as controls are given, shape (variables,)."""
    controls = mechanism.control_values(x)
    values: dict[str, tuple[float, ...]] = {
        name: (float(control.value),) for name, control in controls.items()
    }
    for joint in mechanism.network.joints:
        if joint.units:
            values[joint.name] = tuple(float(value.value) for value in mechanism.joint_values(joint, x))
    for name in mechanism.graph.roots[1:]:
        first = mechanism.variable_index[name, 0]
        values[name] = tuple(x[first : first + len(POSE_UNITS)].tolist())
    residual = evaluate_closure(mechanism, x[:, np.newaxis]).residual
    return Assembly(
        values,
        body_poses(mechanism, x),
        float(np.abs(residual).max(initial=0.0)),
        mobility_by_rank(mechanism, x, np.arange(len(x))),
    )


def body_poses(mechanism: Mechanism, x: FloatArray) -> FloatArray:
    """Return the poses of the bodies, the ground first, as matrices [-] and [m], shape (bodies, 4, 4)."""
    frames = mechanism.poses([float(value) for value in x])
    poses = np.tile(np.eye(4), (len(frames), 1, 1))
    for pose, name in zip(poses, mechanism.network.body_names, strict=True):
        pose[:3, :3], pose[:3, 3] = frames[name].rotation, frames[name].translation
    return poses


def _find_gaps(mechanism: Mechanism, x: FloatArray) -> tuple[ClosureError, ...]:
    """Return what does not close at variables x, shape (variables,), in [m] and [rad], the largest first."""
    residual = evaluate_closure(mechanism, x[:, np.newaxis]).residual[:, 0]
    network, graph = mechanism.network, mechanism.graph
    gaps = []
    for k, cut in enumerate(graph.cuts):
        metres, radians = (float(np.linalg.norm(part)) for part in np.split(residual[6 * k : 6 * k + 6], 2))
        gaps.append(ClosureError(network.joints[cut].name, graph.loops[k], metres, radians))
    errors = np.abs(residual[6 * len(graph.cuts) :]).tolist()
    for element, unit, error in zip(network.elements, network.element_units, errors, strict=True):
        gaps.append(
            ClosureError(element.name, (element.name,), *((error, 0.0) if unit == "m" else (0.0, error)))
        )
    sizes = [max(gap.metres / mechanism.length, gap.radians) for gap in gaps]
    worst_first = sorted(zip(sizes, gaps, strict=True), key=lambda pair: -pair[0])
    return tuple(gap for size, gap in worst_first if size > CLOSED_TOLERANCE)
