"""Units of the columns: given, in the name, known of the source, told by the data, or assumed and said so."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from urmpipe_models.chain import Chain, JointKind
from urmpipe_models.errors import Finding, LogError, OptionError
from urmpipe_pipeline.joint_log import FloatArray, Inference, IntArray, LogWarning
from urmpipe_pipeline.sources.columns import Column
from urmpipe_pipeline.sources.vocabulary import KnownSource, Quantity, Unit, vocabulary

FULL_TURN_DEG = 360.0
WRAP_SLACK_DEG = 20.0
"""A step this near to 360 is a wrap in degrees: in radians it would be 57 turns between two rows."""

FASTEST = 20.0
"""Speed in [rad/s] that no joint of an arm keeps up (1146 deg/s)."""

MOST_TURNS = 4
"""A joint value of more turns than this is not taken as rad without being told."""

LONGEST_REACH = 10.0
"""A coordinate above this in [m] is in mm: no arm reaches so far."""


BEYOND = 3.0
"""Values this many times beyond a joint's limit are no overshoot."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """What joints can do.

    Attributes:
        speed: No joint is faster for long, in [rad/s].
        reach: Largest absolute value that each joint's limits allow, in [rad]; inf without limits.
    """

    speed: float = FASTEST
    reach: tuple[float, ...] | float = math.inf

    @classmethod
    def of(cls, robot: Chain | None, turns: Sequence[int]) -> Bounds:
        """Return the bounds of some joints of a robot, by their index among those that move."""
        if robot is None:
            return cls()
        joints = [robot.moving[j] for j in turns]
        speed = min(FASTEST, 2 * max(joint.velocity for joint in joints))
        return cls(speed, tuple(max(abs(joint.lower), abs(joint.upper)) for joint in joints))


@dataclass(slots=True)
class UnitFinder:
    """Finds the units of the columns of one log, and keeps what was found out.

    Attributes:
        given: Units given by the user, by the column's number; by 0 that of all joints that turn.
        source: The source, if it is known.
        file: The file, for errors.
        warnings: What was assumed.
    """

    given: Mapping[int, Unit]
    source: KnownSource | None
    file: str
    warnings: list[LogWarning] = field(default_factory=list)
    _noted: dict[tuple[str, str], list[str]] = field(default_factory=dict)

    @property
    def inferences(self) -> list[Inference]:
        """What was found out, columns of one unit and evidence together."""
        return [
            Inference(f"unit of {', '.join(names)}", unit, evidence)
            for (unit, evidence), names in self._noted.items()
        ]

    def joints(
        self, columns: Sequence[Column], values: FloatArray, t_ns: IntArray | None, robot: Chain | None
    ) -> list[Unit]:
        """Return the units of the joint columns.

        Args:
            columns: The joint columns.
            values: Their values as the file has them, shape (n, joints).
            t_ns: Recorded times in [ns], None if the log has none.
            robot: The arm, or None.

        Raises:
            LogError: If a unit is not known, does not fit the robot, or cannot be told.
        """
        kinds: list[JointKind | None] = [j.kind for j in robot.moving] if robot else [None] * len(columns)
        found = [self._told(column, kind) for column, kind in zip(columns, kinds, strict=True)]
        unknown = [j for j, unit in enumerate(found) if unit is None]
        slides = [j for j in unknown if kinds[j] == "prismatic"]
        turns = [j for j in unknown if kinds[j] != "prismatic"]
        if slides:
            self._assume("m", "prismatic joints", [columns[j] for j in slides])
        if turns:
            told = {unit for unit in found if unit is not None and unit.quantity == "angle"}
            bounds = Bounds.of(robot, turns)
            turning = values if len(turns) == len(columns) else values[:, turns]
            unit = self._angle([columns[j] for j in turns], turning, t_ns, bounds, told)
            found = [unit if j in turns else other for j, other in enumerate(found)]
        metre = vocabulary().units["m"]
        return [metre if unit is None else unit for unit in found]

    def derivatives(self, columns: Sequence[Column], joints: Sequence[Unit], order: int) -> list[Unit]:
        """Return the units of recorded rates (order 1) or accelerations (2): unsaid, the joints' own."""
        units = []
        for column, joint in zip(columns, joints, strict=False):
            own = self._own(column)
            if own is None or own.quantity != joint.quantity:
                units.append(joint.per_second(order))
            else:
                units.append(own if own.order else own.per_second(order))
        return units

    def positions(self, columns: Sequence[Column], values: FloatArray) -> list[Unit]:
        """Return the units of recorded x, y, z.

        Args:
            columns: The three columns.
            values: Their values as the file has them, shape (n, 3).
        """
        found = [self._told(column, "prismatic") for column in columns]
        told = [unit for unit in found if unit is not None]
        unsaid = [k for k, unit in enumerate(found) if unit is None]
        if not unsaid:
            return told
        rest = self._length([columns[k] for k in unsaid], values[:, unsaid], set(told))
        return [rest if unit is None else unit for unit in found]

    def rotations(self, columns: Sequence[Column]) -> list[Unit]:
        """Return the units of a recorded rotation vector: rad, unless its columns tell.

        Raises:
            LogError: If a unit is not known or is none of an angle.
        """
        units = []
        for column in columns:
            own = self._own(column) or vocabulary().units["rad"]
            if own.quantity != "angle" or own.order:
                names = ", ".join(vocabulary().spelled("angle"))
                message = f"found the unit {own.name}, allowed: {names}"
                raise LogError(Finding(message, self.file, column=column.header))
            units.append(own)
        return units

    def _told(self, column: Column, kind: JointKind | None) -> Unit | None:
        """Return the unit that the user, the column's name or the source tells."""
        allowed: tuple[Quantity, ...] = ("length",) if kind == "prismatic" else ("angle",)
        allowed = ("angle", "length") if kind is None else allowed
        unit, evidence = self._first_told(column, kind)
        if unit is None:
            return None
        if unit.quantity not in allowed or unit.order:
            names = ", ".join(name for quantity in allowed for name in vocabulary().spelled(quantity))
            message = f"found the unit {unit.name} ({evidence}), allowed: {names}"
            if column.number in self.given:
                raise OptionError(f"--unit {column.name}: {message}")
            raise LogError(Finding(message, self.file, column=column.header))
        self._note([column], unit.name, evidence)
        return unit

    def _first_told(self, column: Column, kind: JointKind | None) -> tuple[Unit | None, str]:
        if column.number in self.given:
            return self.given[column.number], "given as an option"
        if 0 in self.given and kind != "prismatic":
            return self.given[0], "given as an option"
        own = self._own(column)
        if own is not None and own.quantity != "time":
            return own, "its name"
        default = (self.source.units if self.source else {}).get("length" if kind == "prismatic" else "angle")
        return default, f"{self.source.name} writes {default.name}" if self.source and default else ""

    def _own(self, column: Column) -> Unit | None:
        """Return the unit that the user or the name gives this very column; raise if it is not known."""
        if column.number in self.given:
            return self.given[column.number]
        if column.unit_text and column.unit is None:
            message = f"found the unit {column.unit_text!r}, allowed: rad, deg, m, mm, cm"
            hint = f"say which with --unit {column.name}=deg"
            raise LogError(Finding(f"{message}; {hint}", self.file, column=column.header))
        return column.unit

    def _length(self, columns: Sequence[Column], values: FloatArray, told: set[Unit]) -> Unit:
        """Return the unit of positions that say none: the others', mm if m cannot be, or m."""
        if len(told) == 1:
            unit = told.pop()
            self._note(columns, unit.name, "as the other position columns")
            return unit
        furthest = peak(values)
        if furthest > LONGEST_REACH:
            self._note(columns, "mm", f"values up to {furthest:.6g} reach further than any arm in m")
            return vocabulary().units["mm"]
        self._assume("m", "positions", columns)
        return vocabulary().units["m"]

    def _angle(
        self,
        columns: Sequence[Column],
        values: FloatArray,
        t_ns: IntArray | None,
        bounds: Bounds,
        told: set[Unit],
    ) -> Unit:
        """Return the unit of joints that turn and say none: the others', what the data tell, or rad."""
        names = ", ".join(column.name for column in columns)
        if len(told) == 1:
            unit = told.pop()
            self._note(columns, unit.name, "as the other joint columns")
            return unit
        evidence = degrees_evidence(values, t_ns, bounds)
        if evidence:
            self._note(columns, "deg", evidence)
            return vocabulary().units["deg"]
        largest = peak(values)
        if largest > MOST_TURNS * math.tau:
            message = f"found values up to {largest:.6g} in {names} and no unit, allowed: rad or deg"
            raise LogError(Finding(f"{message}; say which with --unit", self.file))
        self._assume("rad", "joints", columns)
        return vocabulary().units["rad"]

    def _note(self, columns: Sequence[Column], unit: str, evidence: str) -> None:
        self._noted.setdefault((unit, evidence), []).extend(column.name for column in columns)

    def _assume(self, unit: str, what: str, columns: Sequence[Column]) -> None:
        names = ", ".join(column.name for column in columns)
        self._note(columns, unit, "assumed")
        said = f"no unit is given for {names}: the {what} are taken as {unit}; --unit says otherwise"
        self.warnings.append(LogWarning("assumed-unit", said))


def degrees_evidence(values: FloatArray, t_ns: IntArray | None, bounds: Bounds | None = None) -> str | None:
    """Return why joint values cannot be in rad, or None if they can.

    They cannot if they wrap by about 360, or if it is in degrees only that they are no faster than a joint
    can be for a tenth of the time, or that they keep the robot's limits. Values within one turn in rad are
    never doubted.

    Args:
        values: Joint values, shape (n, joints).
        t_ns: Recorded times in [ns], shape (n,), or None.
        bounds: What the robot's joints can do, or None.
    """
    if peak(values) <= math.tau:
        return None
    bounds = bounds or Bounds()
    wraps, speed = 0, 0.0
    for column in values.T:
        steps = np.abs(np.diff(column))
        wraps += int((np.abs(steps - FULL_TURN_DEG) <= WRAP_SLACK_DEG).sum())
        if t_ns is not None:
            speed = max(speed, _usual_speed(steps, t_ns))
    if wraps:
        return f"{wraps} step{'s' if wraps > 1 else ''} of about 360 from one row to the next"
    if np.radians(speed) <= bounds.speed < speed:
        return f"as rad it would turn at {speed:.3g} rad/s for a tenth of the time"
    largest, reach = np.nanmax(np.abs(values), axis=0), np.asarray(bounds.reach)
    if (np.radians(largest) <= reach).all() and (largest > BEYOND * reach).any():
        return f"values up to {largest.max():.6g} are beyond the robot's limits as rad and within them as deg"
    return None


def peak(values: FloatArray) -> float:
    """Return the largest absolute value, missing samples left out; NaN if there is none.

    Args:
        values: Shape (n, columns), n > 0.
    """
    largest = max(values.max(), -values.min())
    if np.isnan(largest):  # slower, but deaf to NaN
        largest = max(np.fmax.reduce(values, axis=None), -np.fmin.reduce(values, axis=None))
    return float(largest)


def _usual_speed(steps: FloatArray, t_ns: IntArray) -> float:
    """Return the speed that is exceeded in a tenth of the steps, per second."""
    rates = steps / (np.diff(t_ns) * 1e-9)
    rates = rates[np.isfinite(rates)]
    return float(np.quantile(rates, 0.9)) if len(rates) else 0.0
