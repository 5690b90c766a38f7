"""Units by the arm's kinematics: with the right ones they come out at the recorded tool centre point."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_pipeline.sources.units.evidence import Fit, fit, single_out, spread
from urmpipe_pipeline.sources.vocabulary import Quantity, Unit, vocabulary


@dataclass(frozen=True, slots=True)
class KinematicUnits:
    """The units with which the kinematics agree with the recorded tool centre point.

    Attributes:
        angle: Unit of the joints that turn.
        length: Unit of the recorded positions.
        needs_tool: Whether they agree only with a constant tool offset.
        fits: How near each pair of units comes.
    """

    angle: Unit
    length: Unit
    needs_tool: bool
    fits: dict[tuple[Unit, Unit], Fit]

    def of(self, quantity: Quantity) -> Unit:
        """Return the unit of a quantity."""
        return self.angle if quantity == "angle" else self.length

    def evidence(self, quantity: Quantity, other: Unit | None = None) -> str:
        """Say by how much this unit beats another one of its quantity; the best other one by default."""
        own = self._distance(self.fits[self.angle, self.length])
        others = {
            angle if quantity == "angle" else length: self._distance(one)
            for (angle, length), one in self.fits.items()
            if (length == self.length if quantity == "angle" else angle == self.angle)
        }
        del others[self.of(quantity)]
        second = other or min(others, key=others.__getitem__)
        x, y, z = self.fits[self.angle, self.length].tool
        tool = f" with a tool of {x:.3f},{y:.3f},{z:.3f} m" if self.needs_tool else ""
        return (
            f"with it the arm comes within {own * 1e3:.2f} mm (rms){tool} of the recorded TCP,"
            f" as {second.name} within {others[second] * 1e3:.2f} mm"
        )

    def _distance(self, one: Fit) -> float:
        return one.with_tool if self.needs_tool else one.distance


def by_kinematics(robot: Chain | None, q: FloatArray, position: FloatArray) -> KinematicUnits | None:
    """Return the units that the kinematics single out; None if they do not, or nothing was recorded.

    An arm with a joint that slides is not judged. In the file's own units are joint values, shape (n,
    joints), and positions, shape (n, 3) or without columns.
    """
    if robot is None or position.shape[1] != 3 or q.shape[1] != len(robot.moving):
        return None
    if any(joint.kind != "revolute" for joint in robot.moving):
        return None
    rows = spread(len(q))
    fits = {}
    for pair in product(_units("angle"), _units("length")):
        found = fit(robot, q[rows] * pair[0].factor, position[rows] * pair[1].factor)
        if found is None:
            return None
        fits[pair] = found
    best = single_out(fits)
    if best is None:
        return None
    (angle, length), needs_tool = best
    return KinematicUnits(angle, length, needs_tool, fits)


def _units(quantity: Quantity) -> list[Unit]:
    """Return the units of a quantity, each once."""
    return [vocabulary().units[name] for name in vocabulary().spelled(quantity)]
