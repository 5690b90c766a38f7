"""Units by the arm's kinematics: with the right ones they come out at the recorded tool centre point."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import TypeAlias

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_pipeline.sources.units.evidence import Fit, clearly_worse, has_both, single_out, spread, tool_fit
from urmpipe_pipeline.sources.units.unit_hints import OTHER_UNIT
from urmpipe_pipeline.sources.vocabulary import Quantity, Unit, vocabulary

Units: TypeAlias = tuple[Unit, ...]
"""The unit of each column of a group."""

Reading: TypeAlias = tuple[Units, Units]
"""The units of the joints, and those of the recorded x, y, z."""

LEAST_TURN = 0.1
"""A joint that turns less as rad (standard deviation) is not told apart from another base or tool."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """The joints of a log and the tool centre point that it recorded, before their units are known.

    Attributes:
        names: Names of the joints.
        q: Joint values in the file's own units, with signs and offsets, shape (n, joints).
        position: Recorded x, y, z in the file's own units, shape (n, 3), or without columns.
        joints: The unit that is told of each joint, None where none is.
        lengths: The same of x, y, z.
    """

    names: tuple[str, ...]
    q: FloatArray
    position: FloatArray
    joints: tuple[Unit | None, ...]
    lengths: tuple[Unit | None, ...]

    @cached_property
    def told(self) -> frozenset[Reading]:
        """The readings that contradict nothing that is told."""
        return frozenset(product(_filled(self.joints, "angle"), _filled(self.lengths, "length")))

    @cached_property
    def usual(self) -> tuple[Reading, ...]:
        """Those, and the readings in which all joints, or all of x, y, z, have one unit."""
        groups = ((self.joints, "angle"), (self.lengths, "length"))
        choices = [[*_filled(told, of), *_uniform(len(told), of)] for told, of in groups]  # type: ignore[arg-type]
        return tuple(dict.fromkeys(product(*choices)))  # type: ignore[arg-type]

    @cached_property
    def rows(self) -> tuple[FloatArray, FloatArray]:
        """Joints, shape (k, joints), and positions, shape (k, 3), of some rows, in the file's units."""
        rows = spread(len(self.q))
        q, position = self.q[rows], self.position[rows]
        known = has_both(q, position)
        return q[known], position[known]

    def judges(self, robot: Chain) -> bool:
        """Return whether the kinematics of a robot can be held against what was recorded."""
        fits = self.q.shape[1] == len(robot.moving) and self.position.shape[1] == 3
        return fits and len(self.rows[0]) > 0


def fits(robot: Chain, recorded: Recorded, readings: Sequence[Reading]) -> dict[Reading, Fit]:
    """Return how near a robot comes to the recorded points with each of some readings."""
    q, position = recorded.rows
    poses = {
        units: poses_over_log(robot, q * _factors(units)) for units in {joints for joints, _ in readings}
    }
    return {(a, b): tool_fit(*poses[a], position * _factors(b)) for a, b in readings}


@dataclass(frozen=True, slots=True)
class KinematicUnits:
    """The units with which the kinematics agree with the recorded tool centre point.

    Attributes:
        joints: Unit of each joint.
        lengths: Unit of x, y, z.
        needs_tool: Whether they agree only with a constant tool offset.
        proved: Of each joint, whether in its other unit they would not agree.
        robot: The arm.
        recorded: What was recorded.
    """

    joints: Units
    lengths: Units
    needs_tool: bool
    proved: tuple[bool, ...]
    robot: Chain
    recorded: Recorded

    def of(self, quantity: Quantity) -> Units:
        """Return the units of the joints (angle) or of x, y, z (length)."""
        return self.joints if quantity == "angle" else self.lengths

    def evidence(self, quantity: Quantity, others: Sequence[Unit | None] | None = None) -> str:
        """Say by how much these units beat others of some columns; the best other ones by default.

        Args:
            quantity: Whose units: of the joints (angle), or of x, y, z (length).
            others: The other unit of each column, None for its own.
        """
        own, reading = self.of(quantity), (self.joints, self.lengths)
        uniform = _uniform(len(own), quantity)
        told = [tuple(new or old for new, old in zip(others, own, strict=True))] if others else uniform
        compared = [(one, self.lengths) if quantity == "angle" else (self.joints, one) for one in told]
        rivals = [one for one in compared if one != reading]
        found = fits(self.robot, self.recorded, [reading, *rivals])
        near = {one: found[one].of(tool=self.needs_tool) for one in (reading, *rivals)}
        second = min(rivals, key=near.__getitem__)
        changed = (new for new, old in zip(second[quantity == "length"], own, strict=True) if new != old)
        x, y, z = found[reading].tool
        tool = f" with a tool of {x:.3f},{y:.3f},{z:.3f} m" if self.needs_tool else ""
        return (
            f"with it the arm comes within {near[reading] * 1e3:.2f} mm (rms){tool} of the recorded TCP,"
            f" as {next(changed).name} within {near[second] * 1e3:.2f} mm"
        )


def by_kinematics(robot: Chain | None, recorded: Recorded) -> KinematicUnits | None:
    """Return the units that the kinematics single out; None if they do not, or nothing was recorded.

    They are those that are told, or one for all joints and one for x, y, z; else one joint, which must turn,
    has the other unit. An arm with a joint that slides is not judged.
    """
    if robot is None or not recorded.judges(robot):
        return None
    if any(joint.kind != "revolute" for joint in robot.moving):
        return None
    best = None
    for readings in (recorded.usual, (*recorded.usual, *_with_another(recorded))):
        best = best or single_out(fits(robot, recorded, readings), recorded.told)
    if best is None:
        return None
    (joints, lengths), needs_tool = best
    flipped = [(_flipped(joints, j), lengths) for j in range(len(joints))]
    found = fits(robot, recorded, [(joints, lengths), *flipped])
    own, *apart = (found[one].of(tool=needs_tool) for one in ((joints, lengths), *flipped))
    proved = tuple(clearly_worse(distance, own) for distance in apart)
    return KinematicUnits(joints, lengths, needs_tool, proved, robot, recorded)


def _with_another(recorded: Recorded) -> Iterator[Reading]:
    """Yield the usual readings with one joint in the other unit, if it turns."""
    turns = np.flatnonzero(recorded.rows[0].std(axis=0) >= LEAST_TURN).tolist()
    for joints, lengths in recorded.usual:
        yield from ((_flipped(joints, j), lengths) for j in turns)


def _flipped(units: Units, j: int) -> Units:
    """Return units with that of one column exchanged for the other angle."""
    other = vocabulary().units[OTHER_UNIT[units[j].name]]
    return (*units[:j], other, *units[j + 1 :])


def _filled(told: Sequence[Unit | None], quantity: Quantity) -> list[Units]:
    """Return what is told of some columns, the others in each unit of a quantity."""
    return list(dict.fromkeys(tuple(one or unit for one in told) for unit in _units(quantity)))


def _uniform(count: int, quantity: Quantity) -> list[Units]:
    """Return all columns in each unit of a quantity."""
    return [(unit,) * count for unit in _units(quantity)]


def _factors(units: Units) -> FloatArray:
    return np.array([unit.factor for unit in units])


def _units(quantity: Quantity) -> list[Unit]:
    """Return the units of a quantity, each once."""
    return [vocabulary().units[name] for name in vocabulary().spelled(quantity)]
