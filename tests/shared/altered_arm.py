"""Logs that deviate for a known reason, and what a search names for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from urmpipe_datasets import LOGS
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.wraps import repolarize
from urmpipe_pipeline.diagnosis.candidates import iter_onsets
from urmpipe_pipeline.diagnosis.explanations import Explanation
from urmpipe_pipeline.diagnosis.explanations import SearchResult as Found
from urmpipe_pipeline.diagnosis.hypotheses import Group, State, assign_columns, cause_groups
from urmpipe_pipeline.diagnosis.models import ArmModel
from urmpipe_pipeline.diagnosis.motion import Clock, Motion
from urmpipe_pipeline.diagnosis.search import Search
from urmpipe_pipeline.runs.reading_errors import Edit, Edits, robot_edits, sign_edits, swap_edits, unit_edits

DURATION = 36.91
"""Of every motion in [s]: that of the bundled path."""

PERIOD = 0.005
"""Between the knots of a motion in [s]."""

FLOOR = 3.5e-5
"""What means nothing in [m] and [rad]: a hundredth of the default tolerance."""

Posed = tuple[FloatArray, FloatArray | None]
"""Positions in [m], shape (3, n), and orientations as matrices, shape (3, 3, n), or None."""

Numbers = Mapping[str, FloatArray]
"""Sizes of causes by "kind:name", one or three each."""

Noise = Callable[[np.random.Generator, FloatArray], FloatArray]
"""Positions in [m], shape (3, n), with noise."""


@cache
def demo_motion() -> CubicSpline:
    """Return the joints of urm6 along the bundled path, over time in [s]."""
    t, *q = np.loadtxt(LOGS / "matlab.csv", delimiter=",", skiprows=1).T
    columns = np.array(q).T
    return CubicSpline(t, repolarize(columns, np.diff(t, prepend=0.0)).q)


@cache
def rich_motion(chain: Chain, seed: int = 1) -> CubicSpline:
    """Return sums of four sines a joint, over time in [s]; what slides moves a fifth."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, DURATION + PERIOD, PERIOD)
    sizes = [0.2 if one.kind == "prismatic" else 1.0 for one in chain.moving]
    waves = [
        sum(
            size * rng.uniform(0.2, 0.5) * np.sin(rng.uniform(0.13, 0.94) * t + rng.uniform(0.0, 6.28))
            for _ in range(4)
        )
        for size in sizes
    ]
    return CubicSpline(t, np.array(waves).T)


def times(samples: int) -> FloatArray:
    """Return so many times in [s], spread evenly over a motion, shape (samples,)."""
    return np.asarray(np.linspace(0.0, DURATION, samples))


def arm_model(
    chain: Chain, moved: CubicSpline, t: FloatArray, position: FloatArray, rotation: FloatArray | None = None
) -> ArmModel:
    """Return a log of a motion beside where its tool centre point should be.

    Args:
        chain: The arm.
        moved: Its joints over time.
        t: Times of the samples in [s], shape (n,).
        position: In [m], shape (3, n).
        rotation: Matrices [-], shape (3, 3, n); None without any.
    """
    names = chain.coordinates
    groups = assign_columns(cause_groups(chain, names, has_rotation=rotation is not None, timed=True))
    motion = Motion(t, *(moved(t, order).T.copy() for order in range(3)))
    return ArmModel(chain, groups, motion, Clock(t, -1.0, t), np.arange(len(t)), position, rotation)


def nominal(chain: Chain, moved: CubicSpline, t: FloatArray, *, oriented: bool = False) -> ArmModel:
    """Return a log of a motion beside the very poses that it has."""
    return arm_model(chain, moved, t, *poses(chain, moved(t), oriented=oriented))


def poses(chain: Chain, q: FloatArray, *, oriented: bool) -> Posed:
    """Return where an arm is with some joints, shape (n, joints); its orientations if they are wanted."""
    position, rotation = poses_over_log(chain, q)
    return position.T.copy(), rotation.transpose(1, 2, 0).copy() if oriented else None


def called(group: Group) -> str:
    """Return the key of a cause of some size: "kind:name", with its axis of one of base or tool."""
    if group.name not in ("base", "tool") or group.axis is None:
        return f"{group.kind}:{group.name}"
    return f"{group.kind}:{group.name} {'xyz'[group.axis.index(1.0)]}"


def state_of(model: ArmModel, numbers: Numbers, edits: Edits = ()) -> State:
    """Return an explanation by the names of its causes."""
    values = np.zeros(sum(len(group.columns) for group in model.groups))
    places = {called(group): list(group.columns) for group in model.groups}
    for name, size in numbers.items():
        values[places[name]] = size
    return State(values, edits)


def altered(model: ArmModel, moved: CubicSpline, numbers: Numbers, edits: Edits = ()) -> Posed:
    """Return where an arm is with some causes: its frames are altered by the model, its joints here."""
    state = state_of(model, numbers, edits)
    of = {
        kind: dict.fromkeys(model.chain.coordinates, 0.0)
        for kind in ("joint_offset", "joint_scale", "compliance", "joint_lag", "backlash", "sag")
    }
    lag = drift = servo = 0.0
    for name, size in numbers.items():
        kind, _, what = name.partition(":")
        if kind in of:
            of[kind][what] = size[0]
        elif kind == "time_lag":
            lag = size[0]
        elif kind == "clock_drift":
            drift = size[0]
        elif kind == "servo_lag":
            servo = size[0]
    t = model.clock.t
    at = t - lag - drift * t
    offset, scale, bend, late, play, sag = (np.array(list(of[kind].values())) for kind in of)
    q, rate, second = np.empty((3, len(t), len(late)))
    for j, more in enumerate(late):  # each joint from the whole arm at its own time: edits may exchange them
        every = [moved(at - more, order) for order in range(3)]
        for edit in edits:
            every = [_edited(part, edit, value=order == 0) for order, part in enumerate(every)]
        q[:, j], rate[:, j], second[:, j] = (part[:, j] for part in every)
    q = q + offset + scale * q + bend * second + servo * rate + play / 2.0 * np.sign(rate)
    if sag.any():
        now = moved(at)
        for edit in edits:
            now = _edited(now, edit)
        q = q + sag * _weights(model.chain, now)
    return poses(model.arm(state)[0], q, oriented=model.rotation is not None)


def _weights(chain: Chain, q: FloatArray) -> FloatArray:
    """Return how 9.80665 N at the tool centre point of an arm without masses turn each joint, (n, joints)."""
    assert not chain.inertials
    steps = 1e-6 * np.eye(q.shape[1])
    heights = (
        poses_over_log(chain, q + step)[0][:, 2] - poses_over_log(chain, q - step)[0][:, 2] for step in steps
    )
    return np.array([9.80665 * height / 2e-6 for height in heights]).T


def _edited(q: FloatArray, edit: Edit, *, value: bool = True) -> FloatArray:
    """Return joints, shape (n, joints), or their derivatives, with a change."""
    q = q.copy()
    joints = list(edit.joints)
    if edit.kind in ("joint_sign", "mirrored"):
        q[edit.first :, joints] *= -1.0
    elif edit.kind == "joints_swapped":
        q[:, joints] = q[:, joints[::-1]]
    elif edit.kind == "half_turn" and value:
        q[edit.first :, joints] += np.pi
    return q


def all_edits(model: ArmModel) -> tuple[Edits, ...]:
    """Return what may be there or not, of a log that has times."""
    chain, joints = model.chain, len(model.chain.moving)
    turning = [joint.kind == "revolute" for joint in chain.moving]
    start = State(np.zeros(sum(len(group.columns) for group in model.groups)))
    return (
        *sign_edits(joints, most=joints), *swap_edits(joints), *_robots(chain), *unit_edits("reference"),
        *iter_onsets(model, model.sample, turning, start, both_ways=False),
    )  # fmt: skip


@cache
def _robots(chain: Chain) -> tuple[Edits, ...]:
    return tuple(robot_edits(chain))


def search_of(model: ArmModel) -> Search:
    """Return the search for what makes a log deviate."""
    return Search(model, all_edits(model), np.full(len(model.blocks), FLOOR))


@dataclass(frozen=True)
class Named:
    """What a search names.

    Attributes:
        best: Kinds and names of the causes of the best explanation; of twins the one that stands for all.
        others: Those of the explanations that are not told apart from it.
    """

    best: frozenset[str]
    others: tuple[frozenset[str], ...]

    @property
    def sure(self) -> frozenset[str]:
        """What all explanations have."""
        return self.best.intersection(*self.others)

    def is_only(self, causes: frozenset[str]) -> bool:
        """Return whether exactly these causes are named, and nothing is undecided."""
        return self.best == causes and not self.others


def named(search: Search, found: Found) -> Named:
    """Return what a search names, by kinds and names."""

    def of(explanation: Explanation) -> frozenset[str]:
        numbers = [called(group) for k, group in enumerate(search.model.groups) if k in explanation.subset]
        return names_of(search, found, numbers, explanation.state.edits)

    return Named(of(found.best), tuple(map(of, found.rivals)))


def names_of(search: Search, found: Found, numbers: Sequence[str], edits: Edits = ()) -> frozenset[str]:
    """Return the names of causes, of twins the one that stands for all."""
    groups = [called(group) for group in search.model.groups]
    told = {groups[g]: groups[by] for g, by in found.representatives.items()}
    said = (f"{edit.kind}:{edit.name or sorted(edit.joints)}" for edit in edits)
    return frozenset((*(told.get(name, name) for name in numbers), *said))


def uniform(rng: np.random.Generator, position: FloatArray) -> FloatArray:
    """Return positions, each coordinate up to 3.5 mm off."""
    return np.asarray(position + rng.uniform(-3.5e-3, 3.5e-3, position.shape))


def fine(rng: np.random.Generator, position: FloatArray) -> FloatArray:
    """Return positions with Gaussian noise of 0.1 mm a coordinate."""
    return np.asarray(position + rng.normal(0.0, 1e-4, position.shape))


def spoilt(rng: np.random.Generator, position: FloatArray) -> FloatArray:
    """Return positions up to 3.5 mm off, one in a hundred 0.3 m."""
    far = rng.random(position.shape[1]) < 0.01
    away = rng.normal(size=position.shape) * far
    length = np.maximum(np.linalg.norm(away, axis=0), 1e-300)
    return np.asarray(uniform(rng, position) + 0.3 * away / length)


def drifting(rng: np.random.Generator, position: FloatArray, lasting: float) -> FloatArray:
    """Return positions with noise of 2 mm a coordinate whose correlation falls to 1/e in `lasting` s."""
    before = 3000
    a = np.exp(-DURATION / (position.shape[1] - 1) / lasting)
    white = rng.normal(0.0, 2e-3 * np.sqrt(1.0 - a * a), (3, before + position.shape[1]))
    return np.asarray(position + lfilter([1.0], [1.0, -a], white)[:, before:])


def turned(rng: np.random.Generator, rotation: FloatArray) -> FloatArray:
    """Return orientations, shape (3, 3, n), each turned by 0.1 deg of noise about each axis."""
    off = Rotation.from_rotvec(rng.normal(0.0, np.radians(0.1), (rotation.shape[2], 3))).as_matrix()
    return np.asarray(np.einsum("nij,jkn->ikn", off, rotation))


def noisy(model: ArmModel, rng: np.random.Generator, noise: Noise, data: Posed) -> ArmModel:
    """Return a log beside other data, with noise."""
    position, rotation = data
    return replace(
        model, position=noise(rng, position), rotation=None if rotation is None else turned(rng, rotation)
    )
