"""The arms of `faulty_logs`: a cause as the arm of a trial has it, and kinematics by products of matrices."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from urmpipe_models.arm.chain import Chain, Parameter
from urmpipe_models.elementwise import FloatArray

GRAVITY = np.array([0.0, 0.0, -9.81])
KNOWN_BY = ("URM", "DH", "6R")  # how the sources of parameters begin that have names in data sheets
AXES = np.eye(3)


@dataclass(frozen=True, eq=False)
class Fault:
    """One cause of a deviation: a change of the arm, or of how its log is read.

    Attributes:
        kind: As `Cause.kind`.
        value: As `Cause.value`; for a scale, the difference from 1.
        joints: Indices of its joints.
        name: What the diagnosis should call it; empty where its joints or its frame say it.
        axis: Unit vector along or about which a frame changes [-]; None: `value` has three numbers.
        place: Index of that frame in `Chain.frames`; None of other causes.
        at: The frame of the axis, in the frame before that one, shape (4, 4).
        first: Row from which on it holds.
        rows: Rows that are off.
    """

    kind: str
    value: tuple[float, ...] = ()
    joints: tuple[int, ...] = ()
    name: str = ""
    axis: FloatArray | None = None
    place: int | None = None
    at: FloatArray = field(default_factory=lambda: np.eye(4))
    first: int = 0
    rows: tuple[int, ...] = ()

    @property
    def turns(self) -> bool:
        """Whether a frame is turned, not shifted."""
        return self.kind in ("base_rotation", "tool_rotation", "tilt")

    @property
    def motion(self) -> FloatArray:
        """What a frame is multiplied by, shape (4, 4)."""
        vector = np.array(self.value) if self.axis is None else self.value[0] * self.axis
        turn = Rotation.from_rotvec(vector) if self.axis is not None else _rpy(vector)
        return matrix(turn.as_matrix()) if self.turns else matrix(AXES, vector)

    def __str__(self) -> str:
        """Return a line for lists, in SI."""
        of = self.name or " and ".join(f"joint {j + 1}" for j in self.joints)
        axis = "" if self.axis is None else f" {np.round(self.axis, 3).tolist()}"
        where = f" from row {self.first}" * bool(self.first) + f", {len(self.rows)} rows" * bool(self.rows)
        return f"{self.kind} {of}{axis} {[float(f'{v:.4g}') for v in self.value]}{where}"


def _rpy(vector: FloatArray) -> Rotation:
    return Rotation.from_euler("ZYX", vector[::-1])


def matrix(rotation: ArrayLike, translation: ArrayLike = (0.0, 0.0, 0.0)) -> FloatArray:
    """Return a frame, shape (4, 4), of its rotation and its origin in [m]."""
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = rotation, translation
    return frame


class Arm:
    """Forward kinematics of a chain by products of matrices."""

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        self.frames = [matrix(frame.rotation, frame.translation) for frame in chain.frames]

    def poses(
        self, q: FloatArray, faults: Sequence[Fault] = (), growth: FloatArray | None = None
    ) -> tuple[list[FloatArray], FloatArray]:
        """Return the frame of each joint and that of the tool, shape (n, 4, 4), of joints, shape (n, joints).

        Args:
            q: In [rad].
            faults: What differs of the arm.
            growth: Factor of all lengths of its segments in each row, shape (n,).
        """
        frames = [np.broadcast_to(fault, (len(q), 4, 4)).copy() for fault in self.frames]
        for fault in sorted(faults, key=lambda fault: not fault.turns):  # a shift is outermost
            if fault.place is not None:
                frames[fault.place] = fault.at @ fault.motion @ np.linalg.inv(fault.at) @ frames[fault.place]
        for frame in frames[1:-1] if growth is not None else ():
            frame[:, :3, 3] *= np.asarray(growth)[:, np.newaxis]
        at, links, columns = frames[0], [], iter(q.T)
        for joint, frame in zip(self.chain.joints, frames[1:-2], strict=True):
            turn = np.broadcast_to(np.eye(4), frame.shape).copy()
            if joint.kind == "revolute":
                turn[:, :3, :3] = Rotation.from_rotvec(np.outer(next(columns), joint.axis)).as_matrix()
            at = at @ frame @ turn
            links.append(at)
        return links, at @ frames[-2] @ frames[-1]

    def torque(self, q: FloatArray, j: int) -> FloatArray:
        """Return what gravity does about a joint in [N m]: to the masses, else to 1 kg at the tool."""
        links, tip = self.poses(q)
        names = [joint.name for joint in self.chain.joints]
        at = names.index(self.chain.coordinates[j])
        loads = [(1.0, tip[:, :3, 3])]
        if self.chain.inertials:
            carried = [
                (fault, names.index(fault.joint)) for fault in self.chain.inertials if fault.joint in names
            ]
            loads = [
                (float(fault.mass), links[k][:, :3, :3] @ np.array(fault.centre) + links[k][:, :3, 3])
                for fault, k in carried
                if k >= at
            ]
        axis, origin = links[at][:, :3, :3] @ np.array(self.chain.joints[at].axis), links[at][:, :3, 3]
        about = sum(mass * np.cross(centre - origin, GRAVITY) for mass, centre in loads)
        return np.asarray((axis * about).sum(axis=1))


@cache
def segments(chain: Chain, kind: str) -> list[Fault]:
    """Return the lengths, tilts or sideways shifts that an arm has, by the names that people know."""
    named = [
        parameter
        for parameter in chain.parameters
        if parameter.source.startswith(KNOWN_BY)
        and 0 < parameter.frame_index <= len(chain.joints) + 1
        and not parameter.name.startswith("theta_")
        and (parameter.kind == "along") == (kind == "link_length")
    ]
    if kind == "link_shift":
        return [shift for place in range(1, len(chain.joints) + 2) for shift in _sideways(chain, place)]
    places = range(1, len(chain.joints) + 2)
    return [_of_parameter(kind, parameter) for parameter in named] or [
        parameter for place in places for parameter in _unnamed(chain, kind, place)
    ]


def _of_parameter(kind: str, parameter: Parameter) -> Fault:
    at = matrix(parameter.before.rotation, parameter.before.translation)
    return Fault(
        kind, (1e-4,), (), parameter.name, AXES["xyz".index(parameter.axis)], parameter.frame_index, at
    )


def _unnamed(chain: Chain, kind: str, place: int) -> Iterator[Fault]:
    """Yield the length of a segment, or the tilts of a joint, of an arm that is known by its frames."""
    names = [*(joint.name for joint in chain.joints), "tip"]
    along = np.array(chain.frames[place].translation)
    if kind == "link_length" and np.linalg.norm(along) > 1e-9:
        axis = along / np.linalg.norm(along)
        yield Fault(kind, (1e-4,), name=f"segment to {names[place - 1]}", axis=axis, place=place)
    if kind == "tilt" and place <= len(chain.joints):
        at, turning_axis = Arm(chain).frames[place], chain.joints[place - 1].axis
        for letter, axis in zip("xyz", AXES, strict=True):
            if abs(axis @ turning_axis) < 1e-9:
                yield Fault(
                    kind, (1e-4,), name=f"{names[place - 1]} about {letter}", axis=axis, place=place, at=at
                )


def _sideways(chain: Chain, place: int) -> Iterator[Fault]:
    """Yield the shifts of a segment across its lengths: what no length of it can do."""
    lengths = [
        fault.at[:3, :3] @ fault.axis
        for fault in segments(chain, "link_length")
        if fault.place == place and fault.axis is not None
    ]
    spanned = np.linalg.matrix_rank(np.array(lengths), tol=1e-6) if lengths else 0
    across = np.linalg.svd(np.array(lengths))[2][spanned:] if spanned else np.empty((0, 3))
    for axis in across:
        yield Fault("link_shift", (1e-4,), axis=np.where(np.abs(axis) < 1e-9, 0.0, axis), place=place)
