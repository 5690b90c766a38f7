"""Assembly: the configurations in which a network closes, from a rough start and from random ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, NetworkError, format_unknown_name
from urmpipe_models.networks.closure import (
    Reached,
    closure_of,
    descend,
    gap_of,
    idle_spins,
    spinning_parts,
    unspun,
)
from urmpipe_models.networks.faults import validate_values
from urmpipe_models.networks.joint_motion import exp3
from urmpipe_models.networks.mechanism import Mechanism
from urmpipe_models.networks.mobility import Assembly, Gap, mobility_at, mobility_nearby
from urmpipe_models.networks.parts import POSE_UNITS

CLOSED = 1e-9
"""A gap of less, in lengths of the mechanism and in [rad], is rounding."""

SAME = 1e-6
"""Assemblies whose bodies are nearer to each other, in lengths of the mechanism and in entries of their
rotations, are one."""

NEARER = 100
"""So many starts about the network's own that find no nearer assembly end the search for the nearest. From 30
rough starts of the Stewart-Gough platform, which has 40 assemblies, 20 missed the nearest twice, 50 never."""

RESTARTS = 2000
"""So many starts in a row that find nothing new end a search."""

BATCH, ENTRIES = 500, 2e7
"""Starts that are followed side by side, fewer where their Jacobians together have more entries."""

MOST_STARTS = 200_000
"""Starts of a search at most, and assemblies that it may find: more are a continuum."""

MANY = 1000
"""Assemblies that are listed at most."""


@dataclass(frozen=True, slots=True, eq=False)
class Assembled:
    """What assembly came to.

    Attributes:
        x: The variables of each assembly, the nearest to the start first, shape (variables, n), in [m], [rad]
            and as controls are given.
        assemblies: The assemblies; none if nothing closes.
        nearest: What comes nearest to closing where nothing closes.
        x_nearest: Its variables in [m] and [rad], shape (variables,); of the first assembly if there is one.
        gaps: What does not close there, the largest first.
        tried: How many starts were tried until one closed, or for every assembly, the network's own counted.
        reason: Why the search ended.
        elsewhere: Whether only a random start closed, not the network's own.
        continuum: Of how many dimensions the assemblies are where controls and idle spins are held; 0: apart.
        distances: How far all assemblies that the search came to are from the start, in [rad] and lengths
            of the mechanism, rising: those of `assemblies` come first.
    """

    x: FloatArray
    assemblies: tuple[Assembly, ...]
    nearest: Assembly | None
    x_nearest: FloatArray
    gaps: tuple[Gap, ...]
    tried: int
    reason: str
    elsewhere: bool
    continuum: int
    distances: tuple[float, ...] = ()


def assemble(
    mechanism: Mechanism,
    controls: Mapping[str, float] | None = None,
    *,
    start: Mapping[str, Sequence[float]] | None = None,
    every: bool = False,
    restarts: int = RESTARTS,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> Assembled:
    """Return the assembly nearest to the start, or every one, with controls and idle spins held.

    Near is the root of the squared differences of the free variables: angles by the shorter way round,
    rotations by the angle between them, lengths over that of the mechanism. The nearest is sought from the
    network's own start and from random ones that are nearer to it than what was found; every one from random
    starts anywhere, until `restarts` of them in a row find nothing new. Where the network's own start does
    not close, those are tried, too.

    Args:
        mechanism: The network.
        controls: Values to hold controls at instead of their starts.
        start: Values of joints, and of bodies with freedoms of their own, to be near to instead of the
            network's start, by name, in [rad] and [m]; then only these count for the distance.
        every: Whether all assemblies are sought.
        restarts: Random starts in a row without anything new that end the search; 0: the own start alone.
        seed: Of the random starts.
        progress: Called with the share that is done, 0..1.

    Raises:
        NetworkError: If a control is not of the network, or its value out of its range.
    """
    begin = start_with(mechanism, controls or {})
    named = [
        (mechanism.variable_index[name, index], value)
        for name, values in (start or {}).items()
        for index, value in enumerate(values)
        if (name, index) in mechanism.variable_index
    ]
    for place, value in named:
        begin[place] = value
    own = descend(mechanism, begin[:, np.newaxis], mechanism.free)
    found = _Found(mechanism, begin, [place for place, _ in named])
    closed = any(found.add(own))
    tried, reason = 1, "the start closes"
    rng = np.random.default_rng(seed)
    if not closed:
        tried, reason = _search(found, False, restarts, rng, progress)
    continuum = _continuum(mechanism, found.kept[0]) if found.kept else 0
    if found.kept and not continuum:
        _seek_nearer(found, 0 if named else min(restarts, NEARER), seed)
        if every or named:  # near in a few joints may be far in the others
            more, reason = _search(found, True, restarts, rng, progress)
            tried += more - 1
    if continuum and every:
        reason = (
            f"with its controls held the network still moves, with mobility {continuum}: the assembly nearest"
            " to the start is shown"
        )
    return found.result(every, tried, reason, elsewhere=not closed and bool(found.kept), continuum=continuum)


def assembled_at(mechanism: Mechanism, x: FloatArray, reason: str) -> Assembled:
    """Return a configuration that closes as the only assembly, its angles within -pi and pi.

    Args:
        mechanism: The network.
        x: The variables, shape (variables,), in [m], [rad] and as controls are given.
        reason: How it was reached.
    """
    found = _Found(mechanism, x)
    found.kept.append(found.turned(x[:, np.newaxis])[:, 0])
    return found.result(False, 1, reason, elsewhere=False, continuum=0)


def start_with(mechanism: Mechanism, controls: Mapping[str, float]) -> FloatArray:
    """Return where assembly starts with some controls set, in [m], [rad] and as controls are given.

    Of shape (variables,).

    Raises:
        NetworkError: With every control that is not of the network or cannot be set, every value out of the
            control's range, and what such values make no number or no length.
    """
    own = {one.name: one for one in mechanism.network.controls if one.value is None}
    faults = []
    for name, value in controls.items():
        if name not in own:
            faults.append(Finding(f"control {format_unknown_name(name, own)}", parameter="controls"))
        elif not (math.isfinite(value) and own[name].lower <= value <= own[name].upper):
            allowed = f"{own[name].lower:g} to {own[name].upper:g}"
            faults.append(Finding(found=f"{name} = {value:g}", allowed=allowed, parameter="controls"))
    if controls and not faults:
        parts = mechanism.network.as_parts()
        set_ones = (replace(one, start=controls.get(one.name, one.start)) for one in parts.controls)
        at = "at " + ", ".join(f"{name} = {value:g}" for name, value in controls.items())
        faults += validate_values(replace(parts, controls=tuple(set_ones)), at)
    if faults:
        raise NetworkError(*faults)
    start = np.array(mechanism.start)
    for name, value in controls.items():
        start[mechanism.variable_index[name, 0]] = value
    return start


def _seek_nearer(found: _Found, count: int, seed: int) -> None:
    """Try so many random starts nearer to the network's own than what was found, again after each success."""
    mechanism, rng, before = found.mechanism, np.random.default_rng(seed), math.inf
    while count and SAME < (now := float(found.distances().min())) < before - SAME:
        before = now
        way = rng.normal(size=(len(mechanism.free), count))
        way *= now * rng.uniform(size=count) / np.linalg.norm(way, axis=0)
        starts = np.repeat(found.start[:, np.newaxis], count, axis=1)
        starts[mechanism.free] += way * mechanism.column_scales[mechanism.free, np.newaxis]
        for _ in found.add(descend(mechanism, starts, mechanism.free, patient=False)):
            pass


def _search(
    found: _Found,
    every: bool,
    restarts: int,
    rng: np.random.Generator,
    progress: Callable[[float], None] | None,
) -> tuple[int, str]:
    """Try random starts, and return how many starts were tried, and why the search ended."""
    mechanism = found.mechanism
    tried = in_vain = 0
    while in_vain < restarts and tried < MOST_STARTS and len(found.kept) < MANY:
        together = max(1, int(ENTRIES / len(found.start) ** 2))
        count = min(BATCH, together, restarts - in_vain)
        starts = _random_starts(mechanism, found.start, count, rng)
        ends = descend(mechanism, starts, mechanism.free, patient=False)
        for new in found.add(ends):
            tried, in_vain = tried + 1, 0 if new else in_vain + 1
            if new and not every:
                return tried + 1, "a random start closed"
            if in_vain >= restarts:
                break
        if progress is not None:
            progress(min(in_vain / max(restarts, 1), 1.0))
    if in_vain < restarts:
        return tried + 1, f"at least {len(found.kept)}: the search was cut off"
    if not found.kept and not found.refine():
        return tried + 1, f"none of {in_vain} random starts closed"
    return tried + 1, f"at least {len(found.kept)}: {in_vain} random starts in a row found nothing new"


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
    for some in mechanism.rotations:
        quat = rng.normal(size=(4, count))
        quat /= np.linalg.norm(quat, axis=0)
        axis = quat[:3] / np.linalg.norm(quat[:3], axis=0)
        x[some] = 2.0 * np.arccos(np.clip(np.abs(quat[3]), 0.0, 1.0)) * np.where(quat[3] < 0.0, -axis, axis)
    return x


def _continuum(mechanism: Mechanism, x: FloatArray) -> int:
    """Return how many ways there are to move with controls and idle spins held."""
    return max(0, mobility_nearby(mechanism, x, mechanism.free) - len(spinning_parts(mechanism, x)))


class _Found:
    """The assemblies that were found, each once, and what came nearest to closing."""

    def __init__(self, mechanism: Mechanism, start: FloatArray, named: Sequence[int] = ()) -> None:
        self.mechanism, self.start = mechanism, start
        self.kept: list[FloatArray] = []
        self._places: list[FloatArray] = []
        self._spins = idle_spins(mechanism)
        self._nearest, self._gap = start, np.inf
        self._counted = np.array(named, dtype=np.intp) if named else np.arange(len(start))

    def add(self, ends: Reached) -> Iterator[bool]:
        """Yield of each configuration, in turn, whether it closes and is new: then it is kept."""
        known = np.where(np.isnan(ends.gap), np.inf, ends.gap)
        best = int(np.argmin(known))
        if known[best] < self._gap:
            self._nearest, self._gap = ends.x[:, best], float(known[best])
        closed = known <= CLOSED
        held = unspun(self.mechanism, self._spins, self.turned(ends.x[:, closed]), self.start)
        places = iter(zip(held.T, self._places_of(held), strict=True))
        for one in closed:
            yield bool(one) and self._keep(*next(places))

    def refine(self) -> bool:
        """Bring what comes nearest to closing as near as it gets; return whether it closes then."""
        self._gap = np.inf  # what is least is the root of the squared gaps, not the largest of them
        return any(self.add(descend(self.mechanism, self._nearest[:, np.newaxis], self.mechanism.free)))

    def _keep(self, x: FloatArray, place: FloatArray) -> bool:
        """Keep a configuration that is none of those kept already; return whether it is kept."""
        if self.kept and (np.abs(np.array(self._places) - place).max(axis=1) <= SAME).any():
            return False
        self.kept.append(x)
        self._places.append(place)
        return True

    def distances(self) -> FloatArray:
        """Return how far each assembly is from the start, in [rad] and lengths, shape (n,)."""
        x, start = np.array(self.kept).T, self.start[:, np.newaxis]
        apart = (x - start) / self.mechanism.column_scales[:, np.newaxis]
        turned = self.mechanism.angles
        apart[turned] -= 2.0 * np.pi * np.round(apart[turned] / (2.0 * np.pi))
        for some in self.mechanism.rotations:
            turn = exp3(tuple(start[some])).inverse() @ exp3(tuple(x[some]))
            apart[some] = gap_of(turn, x.shape[1])[3:]
        return np.asarray(np.linalg.norm(apart[self._counted], axis=0))

    def result(self, every: bool, tried: int, reason: str, *, elsewhere: bool, continuum: int) -> Assembled:
        """Return the nearest assembly, or every one, sorted by the distance from the start."""
        near = self.distances().round(6) if self.kept else np.empty(0)
        order = [x for _, x in sorted(zip(near, self.kept, strict=True), key=lambda one: (one[0], *one[1]))]
        order = order if every else order[:1]
        nearest = order[0] if order else self.turned(self._nearest[:, np.newaxis])[:, 0]
        return Assembled(
            np.array(order).T.reshape(len(self.start), -1),
            tuple(assembly_at(self.mechanism, x) for x in order),
            None if order else assembly_at(self.mechanism, nearest),
            nearest,
            () if order else gaps_at(self.mechanism, nearest),
            tried,
            reason,
            elsewhere,
            continuum,
            tuple(sorted(near.tolist())) if self.kept else (),
        )

    def turned(self, x: FloatArray) -> FloatArray:
        """Return the same configurations with angles within -pi and pi; helices stay."""
        angles, turned = self.mechanism.angles, np.array(x)
        turned[angles] -= 2.0 * np.pi * np.round(turned[angles] / (2.0 * np.pi))
        return turned

    def _places_of(self, x: FloatArray) -> FloatArray:
        """Return where the bodies are, in lengths of the mechanism, shape (n, k).

        Of a body that spins idly its points where it is tied, of others the first of them and its rotation.
        """
        spinning = {name for spin in self._spins for name in spin.bodies}
        places = []
        for name, frame in self.mechanism.poses(x).items():
            points = self.mechanism.points[name]
            if name not in spinning:
                places += [entry for row in frame.rotation for entry in row]
            for point in points if name in spinning else points[:1]:
                places += [entry / self.mechanism.length for entry in frame.point(point)]
        return np.stack([np.broadcast_to(one, x.shape[1:]) for one in places], axis=1)


def poses_at(mechanism: Mechanism, x: FloatArray) -> FloatArray:
    """Return the poses of the bodies, the ground first, as matrices [-] and [m], shape (bodies, 4, 4).

    Args:
        mechanism: The network.
        x: The variables, shape (variables,), in [m], [rad] and as controls are given.
    """
    frames = mechanism.poses([float(value) for value in x])
    poses = np.tile(np.eye(4), (len(frames), 1, 1))
    for pose, name in zip(poses, mechanism.network.body_names, strict=True):
        pose[:3, :3], pose[:3, 3] = frames[name].rotation, frames[name].translation
    return poses


def assembly_at(mechanism: Mechanism, x: FloatArray) -> Assembly:
    """Return a configuration, its variables in [m], [rad] and as controls are given, shape (variables,)."""
    controls = mechanism.control_values(x)
    values: dict[str, tuple[float, ...]] = {name: (float(one.value),) for name, one in controls.items()}
    for joint in mechanism.network.joints:
        if joint.units:
            values[joint.name] = tuple(float(one.value) for one in mechanism.joint_values(joint, x))
    for name in mechanism.graph.roots[1:]:
        first = mechanism.variable_index[name, 0]
        values[name] = tuple(x[first : first + len(POSE_UNITS)].tolist())
    residual = closure_of(mechanism, x[:, np.newaxis]).residual
    return Assembly(
        values,
        poses_at(mechanism, x),
        float(np.abs(residual).max(initial=0.0)),
        mobility_at(mechanism, x, np.arange(len(x))),
    )


def gaps_at(mechanism: Mechanism, x: FloatArray) -> tuple[Gap, ...]:
    """Return what does not close at a configuration, the largest first.

    Args:
        mechanism: The network.
        x: The variables, shape (variables,), in [m], [rad] and as controls are given.
    """
    residual = closure_of(mechanism, x[:, np.newaxis]).residual[:, 0]
    gaps = []
    for k, cut in enumerate(mechanism.graph.cuts):
        gap = residual[6 * k : 6 * k + 6]
        name = mechanism.network.joints[cut].name
        gaps.append(
            Gap(
                name, mechanism.graph.loops[k], float(np.linalg.norm(gap[:3])), float(np.linalg.norm(gap[3:]))
            )
        )
    errors = np.abs(residual[6 * len(mechanism.graph.cuts) :]).tolist()
    network = mechanism.network
    for element, unit, error in zip(network.elements, network.element_units, errors, strict=True):
        gaps.append(Gap(element.name, (element.name,), *((error, 0.0) if unit == "m" else (0.0, error))))
    sizes = [max(one.metres / mechanism.length, one.radians) for one in gaps]
    worst_first = sorted(zip(sizes, gaps, strict=True), key=lambda pair: -pair[0])
    return tuple(gap for size, gap in worst_first if size > CLOSED)
