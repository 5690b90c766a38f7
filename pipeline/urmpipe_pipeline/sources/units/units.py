"""Units of the columns: given, in the name, known of the source, told by the data, or assumed and said so.

Where the log recorded its tool centre point the arm's kinematics decide, whatever the name says.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.chains.chain import Chain, JointKind
from urmpipe_models.errors import Finding, LogError, OptionError, shown
from urmpipe_models.messages import Hint
from urmpipe_models.orientation import RotationForm, angles
from urmpipe_pipeline.joint_log import Inference, LogWarning, Role
from urmpipe_pipeline.sources.columns.columns import Column
from urmpipe_pipeline.sources.units.kinematic_units import KinematicUnits
from urmpipe_pipeline.sources.units.unit_evidence import Bounds, degrees_evidence, peak, radians_evidence
from urmpipe_pipeline.sources.units.unit_hints import OTHER_UNIT, unit_hints, unit_inference
from urmpipe_pipeline.sources.vocabulary import KnownSource, Quantity, Unit, vocabulary

GIVEN = "given as an option"

JOINTS = "prismatic joints"
"""Columns whose units do not follow from each other's."""

POSITIONS = "positions"

MOST_TURNS = 4
"""A joint value of more turns than this is not taken as rad without being told."""

LONGEST_REACH = 10.0
"""A coordinate above this in [m] is in mm: no arm reaches so far."""


@dataclass(slots=True)
class UnitFinder:
    """Finds the units of the columns of one log, and keeps what was found out.

    Attributes:
        given: Units given by the user, by the column's number; by 0 that of all joints that turn.
        source: The source, if it is known.
        file: The file, for errors.
        kinematic: The units that the kinematics single out, if they do.
        by_source: Whether the source told a unit.
    """

    given: Mapping[int, Unit]
    source: KnownSource | None
    file: str
    kinematic: KinematicUnits | None = None
    _assumed: list[LogWarning] = field(default_factory=list)
    _doubted: dict[tuple[Unit, Unit, str], list[Column]] = field(default_factory=dict)
    _overruled: dict[Unit, list[Column]] = field(default_factory=dict)
    _noted: dict[tuple[str, str], list[Column]] = field(default_factory=dict)
    by_source: bool = False

    @property
    def inferences(self) -> list[Inference]:
        """What was found out, columns of one unit and evidence together."""
        return [unit_inference(columns, unit, evidence) for (unit, evidence), columns in self._noted.items()]

    @property
    def warnings(self) -> list[LogWarning]:
        """What was assumed, and what contradicts the kinematics or the names of the columns."""
        return [*self._assumed, *self._contradictions(), *self._against_names()]

    def joints(
        self, columns: Sequence[Column], values: FloatArray, t_ns: IntArray | None, robot: Chain | None
    ) -> list[Unit]:
        """Return the units of the joint columns.

        Their values are in the file's own units, shape (n, joints), at recorded times in [ns], shape (n,), if
        any.

        Raises:
            LogError: If a unit is not known, does not fit the robot, or cannot be told.
        """
        kinds: list[JointKind | None] = [j.kind for j in robot.moving] if robot else [None] * len(columns)
        found = told_units = [self._told(column, kind) for column, kind in zip(columns, kinds, strict=True)]
        unknown = [j for j, unit in enumerate(found) if unit is None]
        slides = [j for j in unknown if kinds[j] == "prismatic"]
        turns = [j for j in unknown if kinds[j] != "prismatic"]
        if slides:
            self._assume("m", JOINTS, [columns[j] for j in slides])
        if turns:
            told = {unit for unit in found if unit is not None and unit.quantity == "angle"}
            bounds = Bounds.of(robot, turns)
            turning = values if len(turns) == len(columns) else values[:, turns]
            unit = self._angle([columns[j] for j in turns], turning, t_ns, bounds, told)
            found = [unit if j in turns else other for j, other in enumerate(found)]
        if self.kinematic is None:
            self._refuse_contradictions(columns, told_units, values, t_ns, robot)
        metre = vocabulary().units["m"]
        return [metre if unit is None else unit for unit in found]

    def derivatives(self, columns: Sequence[Column], joints: Sequence[Unit], order: int) -> list[Unit]:
        """Return the units of recorded rates (order 1) or accelerations (2): unsaid, the joints' own."""
        units = []
        for column, joint in zip(columns, joints, strict=False):
            own = self._own(column)
            unit = own if own is not None and own.quantity == joint.quantity else joint
            units.append(unit if unit.order else unit.per_second(order))
        return units

    def positions(self, columns: Sequence[Column], values: FloatArray) -> list[Unit]:
        """Return the units of recorded x, y, z; their values are in the file's own units, shape (n, 3)."""
        found = [self._told(column, "prismatic") for column in columns]
        told = [unit for unit in found if unit is not None]
        unsaid = [k for k, unit in enumerate(found) if unit is None]
        if not unsaid:
            return told
        rest = self._length([columns[k] for k in unsaid], values[:, unsaid], set(told))
        return [rest if unit is None else unit for unit in found]

    def rotations(self, columns: Sequence[Column], forms: Sequence[RotationForm]) -> list[Unit | None]:
        """Return the units that the columns of a recorded orientation tell, None where they do not.

        Raises:
            LogError: If a unit is not known or is none of an angle.
        """
        if not any(map(angles, forms)):
            return [None] * len(columns)
        default = self.source.units.get("angle") if self.source else None
        units: list[Unit | None] = []
        for column in columns:
            own = self._own(column) or default
            if own is not None and (own.quantity != "angle" or own.order):
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
                raise OptionError(Finding(message, column=column.name, parameter="unit"))
            raise LogError(Finding(message, self.file, column=column.header))
        return self._held_against_kinematics(column, unit, evidence)

    def _held_against_kinematics(self, column: Column, unit: Unit, evidence: str) -> Unit:
        """Return the unit that is told, or the one that the kinematics single out if the user gave none."""
        better = self.kinematic.of(unit.quantity) if self.kinematic else unit
        if self.kinematic is None or better == unit:
            self._note([column], unit.name, evidence)
            return unit
        by_how_much = self.kinematic.evidence(unit.quantity, unit)
        self._doubted.setdefault((unit, better, evidence), []).append(column)
        given = evidence == GIVEN
        self._note([column], unit.name if given else better.name, evidence if given else by_how_much)
        return unit if given else better

    def _contradictions(self) -> Iterator[LogWarning]:
        """Yield what the kinematics say against the units that were told."""
        for (unit, better, evidence), columns in self._doubted.items():
            names = ", ".join(column.name for column in columns)
            told = f"{names}: {unit.name} ({evidence}) contradicts the kinematics: taken as"
            by_how_much = self.kinematic.evidence(unit.quantity, unit) if self.kinematic else ""
            if evidence == GIVEN:
                said = f"{told} {unit.name}, though as {better.name} it would fit: {by_how_much}"
                yield LogWarning("unit-contradiction", said)
            else:
                hints = unit_hints(columns, unit.name)
                yield LogWarning("unit-contradiction", f"{told} {better.name}: {by_how_much}", hints=hints)

    def _against_names(self) -> Iterator[LogWarning]:
        """Yield the columns whose names tell another unit than the one given for all joints."""
        for unit, columns in self._overruled.items():
            names = ", ".join(column.name for column in columns)
            said = f"{names}: taken as {self.given[0].name} ({GIVEN}), though their names say {unit.name}"
            yield LogWarning("unit-contradiction", said)

    def _first_told(self, column: Column, kind: JointKind | None) -> tuple[Unit | None, str]:
        if column.number in self.given:
            return self.given[column.number], GIVEN
        if 0 in self.given and kind != "prismatic":
            if column.unit and column.unit.quantity == "angle" and column.unit != self.given[0]:
                self._overruled.setdefault(column.unit, []).append(column)
            return self.given[0], GIVEN
        own = self._own(column, "mm" if kind == "prismatic" else "deg")
        if own is not None and own.quantity != "time":
            return own, "its name"
        default = (self.source.units if self.source else {}).get("length" if kind == "prismatic" else "angle")
        if self.source is None or default is None:
            return None, ""
        self.by_source = True
        return default, f"{self.source.name} writes {default.name}"

    def _own(self, column: Column, likely: str = "deg") -> Unit | None:
        """Return the unit that the user or the name gives this very column; raise if it is not known."""
        if column.number in self.given:
            return self.given[column.number]
        if column.unit_text and column.unit is None:
            message = f"found the unit {shown(column.unit_text)}, allowed: rad, deg, m, mm, cm"
            hints = unit_hints([column], likely, "says which")
            raise LogError(Finding(message, self.file, column=column.header, hints=hints))
        return column.unit

    def _settled(
        self, columns: Sequence[Column], quantity: Quantity, told: set[Unit], others: str
    ) -> Unit | None:
        """Return the unit that the other columns agree on, or that the kinematics single out; else None."""
        if len(told) == 1:
            (unit,) = told
            self._note(columns, unit.name, others)
            return unit
        if self.kinematic is None:
            return None
        unit = self.kinematic.of(quantity)
        self._note(columns, unit.name, self.kinematic.evidence(quantity))
        return unit

    def _length(self, columns: Sequence[Column], values: FloatArray, told: set[Unit]) -> Unit:
        """Return the unit of positions that say none: the others', mm if m cannot be, or m."""
        settled = self._settled(columns, "length", told, "as the other position columns")
        if settled is not None:
            return settled
        furthest = peak(values)
        if furthest > LONGEST_REACH:
            self._note(columns, "mm", f"values up to {furthest:.6g} reach further than any arm in m")
            return vocabulary().units["mm"]
        self._assume("m", POSITIONS, columns)
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
        settled = self._settled(columns, "angle", told, "as the other joint columns")
        if settled is not None:
            return settled
        evidence = degrees_evidence(values, t_ns, bounds)
        if evidence:
            self._note(columns, "deg", evidence)
            return vocabulary().units["deg"]
        largest = peak(values)
        if largest > MOST_TURNS * math.tau:
            message = f"found values up to {largest:.6g} in {names} and no unit, allowed: rad or deg"
            unnamed = len(columns) == 3 and all(column.header.isdigit() for column in columns)
            hints = [Hint("unit", {"": name}, "says which") for name in ("rad", "deg")]
            hints += [Hint("source", "path", "reads them as x, y, z")] if unnamed else []
            raise LogError(Finding(message, self.file, hints=tuple(hints)))
        self._assume("rad", "joints", columns)
        return vocabulary().units["rad"]

    def _refuse_contradictions(
        self,
        columns: Sequence[Column],
        units: Sequence[Unit | None],
        values: FloatArray,
        t_ns: IntArray | None,
        robot: Chain | None,
    ) -> None:
        """Raise a `LogError` if the data contradict what names or source tell of joints that turn."""
        for name, other in (("rad", "deg"), ("deg", "rad")):
            which = [j for j, unit in enumerate(units) if unit and unit.name == name]
            which = [j for j in which if not {0, columns[j].number} & set(self.given)]
            if not which:
                continue
            bounds = Bounds.of(robot, which)
            doubted = values if len(which) == len(columns) else values[:, which]
            evidence = degrees_evidence(doubted, t_ns, bounds) if name == "rad" else radians_evidence(doubted)
            if evidence:
                names = ", ".join(columns[j].name for j in which)
                said = f"found {names} in {name} by name or source, but {evidence}"
                hints = tuple(Hint("unit", {"": one}, "says which") for one in (other, name))
                raise LogError(Finding(f"{said}, allowed: a unit that fits the data", self.file, hints=hints))

    def _note(self, columns: Sequence[Column], unit: str, evidence: str) -> None:
        self._noted.setdefault((unit, evidence), []).extend(columns)

    def _assume(self, unit: str, what: str, columns: Sequence[Column]) -> None:
        names = ", ".join(column.name for column in columns)
        self._note(columns, unit, "assumed")
        said = f"no unit is given for {names}: the {what} are taken as {unit}"
        other, does = OTHER_UNIT[unit], "reads them otherwise"
        turning = (Hint("unit", {"": other}, does),)  # of all joints that turn
        some = columns if what == JOINTS else columns[:1]
        hints = turning if unit == "rad" else unit_hints(some, other, does)
        role: Role = "position" if what == POSITIONS else "joint"
        taken = f"the {what} are in {unit}"
        self._assumed.append(LogWarning("assumed-unit", said, hints=hints, assumption=taken, role=role))
