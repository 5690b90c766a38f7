"""Units of the columns: told, by the data, by the kinematics, or assumed and said so.

A unit that a name or the source tells is evidence, no proof. Where the log recorded its tool centre point the
arm's kinematics decide. Else values that can only be in the other unit are asked for, and those that may be
in either are doubted: a verdict that rests on them says so.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from urmpipe_models.arm.chain import Chain, JointKind
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_models.math3d import RotationForm, is_angular
from urmpipe_pipeline.joint_log import Inference, LogWarning, Role
from urmpipe_pipeline.sources.columns.columns import Column
from urmpipe_pipeline.sources.columns.questions import NAME_JOINTS
from urmpipe_pipeline.sources.units.doubts import assumed, contradiction, doubt, not_reached
from urmpipe_pipeline.sources.units.kinematic_units import KinematicUnits
from urmpipe_pipeline.sources.units.told import GIVEN, Tellers, Told
from urmpipe_pipeline.sources.units.unit_evidence import (
    Bounds,
    degrees_proof,
    peak,
    radians_proof,
    too_fast,
    usual_peak,
)
from urmpipe_pipeline.sources.units.unit_hints import OTHER_UNIT, unit_hints, unit_inference, which_unit
from urmpipe_pipeline.sources.vocabulary import Quantity, Unit, vocabulary

MOST_DEGREES = 720.0
"""Values beyond two turns in [deg] are hardly those of an arm's joints: they are asked about."""

MOST_TURNS = 4
"""A joint value of more turns than this is not taken as rad without being told."""

LONGEST_REACH = 10.0
"""A coordinate above this in [m] is hardly one: no arm reaches so far."""

SHORTEST_REACH = 0.02
"""Coordinates that all stay below this in [m] are hardly those of an arm's tool."""

POSITIONS = "positions"

_ALLOWED: dict[JointKind | None, tuple[Quantity, ...]] = {
    "revolute": ("angle",),
    "prismatic": ("length",),
    None: ("angle", "length"),
}
"""What a joint may be in, the likely quantity first."""


def told_joints(tellers: Tellers, columns: Sequence[Column], robot: Chain | None) -> list[Told | None]:
    """Return the units that are told of the joint columns.

    Raises:
        LogError: If a unit is not known, or does not fit the robot.
        OptionError: If one that the user gave does not.
    """
    kinds = [robot.moving[j].kind if robot else None for j in range(len(columns))]
    return [tellers.of(column, _ALLOWED[kind]) for column, kind in zip(columns, kinds, strict=True)]


def told_lengths(tellers: Tellers, columns: Sequence[Column]) -> list[Told | None]:
    """Return the units that are told of recorded x, y, z; raises as `told_joints` does."""
    return [tellers.of(column, ("length",)) for column in columns]


def _evidence(by: Collection[Told]) -> str:
    return " and ".join(sorted({one.evidence for one in by}))


@dataclass(frozen=True, slots=True, eq=False)
class _Judged:
    """Joints whose unit, rad or deg, is held against their values in it, shape (n, joints)."""

    columns: Sequence[Column]
    unit: str
    values: FloatArray
    t_ns: IntArray | None
    bounds: Bounds


@dataclass(slots=True)
class UnitFinder:
    """Finds the units of the columns of one log, and keeps what was found out.

    Attributes:
        tellers: Who tells units.
        kinematic: The units that the kinematics single out, if they do.
        warnings: What was assumed or is doubted, and what contradicts the kinematics or the user.
        doubts: Why a column's unit is only assumed, by its number.
        by_source: Whether the source told a unit.
    """

    tellers: Tellers
    kinematic: KinematicUnits | None = None
    warnings: list[LogWarning] = field(default_factory=list)
    doubts: dict[int, str] = field(default_factory=dict)
    by_source: bool = False
    _noted: dict[tuple[str, str, bool], list[Column]] = field(default_factory=dict)

    @property
    def inferences(self) -> list[Inference]:
        """What was found out, columns of one unit and evidence together."""
        return [
            unit_inference(columns, unit, evidence, every=every)
            for (unit, evidence, every), columns in self._noted.items()
        ]

    def joints(
        self, columns: Sequence[Column], values: FloatArray, t_ns: IntArray | None, robot: Chain | None
    ) -> list[Unit]:
        """Return the units of the joint columns.

        Their values are in the file's own units, shape (n, joints), at recorded times in [ns], shape (n,), if
        any.

        Raises:
            LogError: If a unit is not known, does not fit the robot, or cannot be told.
            OptionError: If one that the user gave does not fit the robot.
        """
        told = told_joints(self.tellers, columns, robot)
        if self.kinematic is not None:
            units = self._by_kinematics(columns, told, "angle")
            proved = self.kinematic.proved
        else:
            units = self._joints_by_themselves(columns, told, values, t_ns, robot)
            proved = (False,) * len(columns)
        for name in ("rad", "deg"):
            group = [j for j, one in enumerate(told) if one and not one.certain and units[j].name == name]
            unproved = [j for j in group if not proved[j]]
            if unproved:
                mine = values if len(unproved) == len(columns) else values[:, unproved]
                judged = _Judged([columns[j] for j in unproved], name, mine, t_ns, Bounds.of(robot, unproved))
                by = {one for j in unproved if (one := told[j])}
                self._refuse_contradiction(judged, by)
                if len(unproved) == len(group) and 0 not in self.tellers.given:
                    self._doubt(judged, by, "the joints are" if len(group) == len(columns) else "")
        self.tell_reach(columns, told, units, "joint", "the joints are")
        return units

    def derivatives(self, columns: Sequence[Column], joints: Sequence[Unit], order: int) -> list[Unit]:
        """Return the units of recorded rates (order 1) or accelerations (2): unsaid, the joints' own."""
        units = []
        for column, joint in zip(columns, joints, strict=False):
            own = self.tellers.own(column)
            unit = own if own is not None and own.quantity == joint.quantity else joint
            units.append(unit if unit.order else unit.per_second(order))
        return units

    def positions(self, columns: Sequence[Column], values: FloatArray) -> list[Unit]:
        """Return the units of recorded x, y, z: told, by the kinematics, or m, and said so.

        They are never rescaled because they look too far for an arm. Values are in the file's own units,
        shape (n, 3).
        """
        told = told_lengths(self.tellers, columns)
        if self.kinematic is not None:
            return self._by_kinematics(columns, told, "length")
        known, furthest = self._told_units(columns, told), usual_peak(values)
        some = [column for column, one in zip(columns, told, strict=True) if one is None]
        rest = self._like_others(some, known, "position") if some else None
        if some and rest is None:
            far = furthest > LONGEST_REACH
            why = f", though values of {furthest:.6g} reach further than any arm" if far else ""
            hints = which_unit(columns, "m", every=False) if far else unit_hints(columns[:1], OTHER_UNIT["m"])
            self._assume(some, vocabulary().units["m"], POSITIONS, hints, why, asks=far)
        units = [unit or rest or vocabulary().units["m"] for unit in known]
        by = {one for one in told if one and not one.certain}
        if by and len(set(units)) == 1:
            self._doubt_lengths(columns, by, units[0], furthest)
        return units

    def _doubt_lengths(
        self, columns: Sequence[Column], by: Collection[Told], unit: Unit, furthest: float
    ) -> None:
        """Say so where x, y, z, in the unit that names or source tell, are nowhere near where arms work."""
        if furthest * unit.factor > LONGEST_REACH:
            why = f"values of {furthest:.6g} reach further than any arm"
        elif 0 < furthest * unit.factor < SHORTEST_REACH:
            why = f"values of {furthest:.6g} are closer to the origin than any arm works"
        else:
            return
        names, evidence = ", ".join(column.name for column in columns), _evidence(by)
        said = f"{names}: {unit.name} ({evidence}) is doubted: {why}"
        hints = which_unit(columns, unit.name, every=False)
        taken = assumed(columns, unit.name, "the positions are")
        self._warn(columns, LogWarning("doubted-unit", said, hints=hints, assumption=taken, role="position"))

    def rotations(self, columns: Sequence[Column], forms: Sequence[RotationForm]) -> list[Told | None]:
        """Return the units that are told of the columns of a recorded orientation, None where none is.

        Raises:
            LogError: If a unit is not known or is none of an angle.
            OptionError: If one that the user gave is none.
        """
        turned = any(map(is_angular, forms))
        return [self.tellers.of(column) if turned else None for column in columns]

    def _told_units(self, columns: Sequence[Column], told: Sequence[Told | None]) -> list[Unit | None]:
        """Return the units that are told, having noted them."""
        for column, one in zip(columns, told, strict=True):
            if one is not None:
                self._note([column], one.unit, one.evidence, every=one.by == "every angle" or one.by_source)
                self.by_source |= one.by_source
        return [one.unit if one else None for one in told]

    def _like_others(
        self, columns: Sequence[Column], known: Sequence[Unit | None], what: str, of: str = "length"
    ) -> Unit | None:
        """Return the unit that the other columns agree on; None if they do not."""
        others = {unit for unit in known if unit is not None and unit.quantity == of}
        if len(others) != 1:
            return None
        (unit,) = others
        self._note(columns, unit, f"as the other {what} columns")
        return unit

    def _by_kinematics(
        self, columns: Sequence[Column], told: Sequence[Told | None], quantity: Quantity
    ) -> list[Unit]:
        """Return the units that the kinematics single out, but those that the user gave a column."""
        assert self.kinematic is not None
        units, overruled = list(self.kinematic.of(quantity)), dict[Told, list[int]]()
        unsaid = [j for j, one in enumerate(told) if one is None]
        if unsaid:
            evidence = self.kinematic.evidence(quantity)
            for j in unsaid:
                self._note([columns[j]], units[j], evidence)
        for j, one in enumerate(told):
            if one is not None and one.unit == units[j]:
                self._told_units([columns[j]], [one])
            elif one is not None:
                overruled.setdefault(one, []).append(j)
        for one, places in overruled.items():
            others = [one.unit if j in places else None for j in range(len(columns))]
            by_how_much = self.kinematic.evidence(quantity, others)
            self._overrule([columns[j] for j in places], one, units[places[0]], by_how_much)
            if one.by == "column":
                units = [one.unit if j in places else unit for j, unit in enumerate(units)]
        return units

    def _overrule(self, columns: Sequence[Column], told: Told, better: Unit, by_how_much: str) -> None:
        """Note and say that the kinematics contradict what is told of some columns."""
        if told.by == "every angle":  # as `tell_reach` says
            self._note(columns, better, by_how_much)
            return
        names = ", ".join(column.name for column in columns)
        contradicted = f"{names}: {told.unit.name} ({told.evidence}) contradicts the kinematics: taken as"
        if told.by == "column":
            self._note(columns, told.unit, GIVEN)
            said = f"{contradicted} {told.unit.name}, though as {better.name} it would fit: {by_how_much}"
            self.warnings.append(LogWarning("unit-contradiction", said))
            return
        self._note(columns, better, by_how_much)
        said, hints = f"{contradicted} {better.name}: {by_how_much}", unit_hints(columns, told.unit.name)
        self.warnings.append(LogWarning("unit-contradiction", said, hints=hints))

    def _joints_by_themselves(
        self,
        columns: Sequence[Column],
        told: Sequence[Told | None],
        values: FloatArray,
        t_ns: IntArray | None,
        robot: Chain | None,
    ) -> list[Unit]:
        """Return the units of joints without the kinematics: those that are told, and of the others."""
        known = self._told_units(columns, told)
        unknown = [j for j, one in enumerate(told) if one is None]
        slides = [j for j in unknown if robot and robot.moving[j].kind == "prismatic"]
        turns = [j for j in unknown if j not in slides]
        metre = vocabulary().units["m"]
        if slides:
            some = [columns[j] for j in slides]
            self._assume(some, metre, "prismatic joints", unit_hints(some, OTHER_UNIT["m"]))
        if turns:
            turning = values if len(turns) == len(columns) else values[:, turns]
            if robot is None and not any(known):
                self._check_prismatic(columns, turning)
            unit = self._angle([columns[j] for j in turns], turning, t_ns, Bounds.of(robot, turns), known)
            known = [unit if j in turns else other for j, other in enumerate(known)]
        return [unit or metre for unit in known]

    def _check_prismatic(self, columns: Sequence[Column], values: FloatArray) -> None:
        """Raise the question whether the only column with values beyond those in rad is a length."""
        sizes = [peak(column) for column in values.T]
        large = [k for k, size in enumerate(sizes) if size > MOST_TURNS * math.tau]
        if len(large) != 1 or any(size > math.tau for k, size in enumerate(sizes) if k != large[0]):
            return
        column = columns[large[0]]
        if len(columns) < 3 or radians_proof(values) or degrees_proof(values):
            return
        message = f"found values up to {sizes[large[0]]:.6g} in {column.name} alone and no unit"
        choices = ({"": "rad", column.called: "mm"}, {"": "deg"}, {"": "rad"})
        hints = tuple(Hint("unit", choice, "specifies it") for choice in choices)
        allowed = "the unit of a joint that slides, or one unit for all"
        raise LogError(Finding(f"{message}, allowed: {allowed}", self.tellers.file, hints=hints))

    def _angle(
        self,
        columns: Sequence[Column],
        values: FloatArray,
        t_ns: IntArray | None,
        bounds: Bounds,
        known: Sequence[Unit | None],
    ) -> Unit:
        """Return the unit of joints that turn and say none: the others', what the data tell, or rad."""
        settled = self._like_others(columns, known, "joint", of="angle")
        if settled is not None:
            return settled
        rad, deg = (vocabulary().units[name] for name in ("rad", "deg"))
        for unit, proof in ((deg, degrees_proof(values, bounds)), (rad, radians_proof(values))):
            if proof:
                self._note(columns, unit, proof, every=True)
                return unit
        names = ", ".join(column.name for column in columns)
        largest, fast = peak(values), too_fast(values, t_ns, bounds)
        fast = fast if largest <= MOST_DEGREES else None  # neither rad nor deg: ticks, percents
        if not fast and largest > MOST_TURNS * math.tau:
            message = f"found values up to {largest:.6g} in {names} and no unit, allowed: rad or deg"
            message += "; convert ticks and counts" if largest > MOST_DEGREES else ""
            unnamed = all(column.header.isdigit() for column in columns)
            hints = [Hint("unit", {"": name}, "specifies it") for name in ("rad", "deg")]
            hints += (
                [Hint("source", "path", "reads them as x, y, z")] if unnamed and len(columns) == 3 else []
            )
            hints += [NAME_JOINTS] if unnamed else []
            raise LogError(Finding(message, self.tellers.file, hints=tuple(hints)))
        unit = deg if fast else rad
        hints = [Hint("unit", {"": OTHER_UNIT[unit.name]}, "overrides this")]
        self._assume(columns, unit, "joints", hints, f": {fast}" if fast else "")
        return unit

    def _refuse_contradiction(self, judged: _Judged, by: Collection[Told]) -> None:
        """Raise a `LogError` if the data contradict what names or source tell of joints that turn."""
        found = contradiction(judged.unit, judged.values, judged.t_ns, judged.bounds)
        if found is None:
            return
        why, places = found
        columns, every = [judged.columns[j] for j in places], all(one.by_source for one in by)
        names = ", ".join(column.name for column in columns)
        said = f"found {names} in {judged.unit} by name or source, but {why}"
        hints = which_unit(columns, judged.unit, every=every)
        allowed = "a unit that fits the data"
        raise LogError(Finding(f"{said}, allowed: {allowed}", self.tellers.file, hints=hints))

    def _doubt(self, judged: _Judged, by: Collection[Told], whole: str) -> None:
        """Say so where what names or source tell of joints that turn may as well be the other unit."""
        why = doubt(judged.unit, judged.values, judged.t_ns, judged.bounds)
        if why is None:
            return
        names, evidence = ", ".join(column.name for column in judged.columns), _evidence(by)
        said = f"{names}: {judged.unit} ({evidence}) is doubted: {why}"
        hints = which_unit(judged.columns, judged.unit, every=all(one.by_source for one in by))
        taken = assumed(judged.columns, judged.unit, whole)
        self._warn(
            judged.columns, LogWarning("doubted-unit", said, hints=hints, assumption=taken, role="joint")
        )

    def tell_reach(
        self,
        columns: Sequence[Column],
        told: Sequence[Told | None],
        units: Sequence[Unit],
        role: Role,
        whole: str,
    ) -> None:
        """Name the angles that have another unit than the user gave for every angle.

        Args:
            columns: The columns.
            told: What is told of each.
            units: What they are taken as.
            role: What they hold.
            whole: What they are together: "the joints are".
        """
        every, groups = self.tellers.given.get(0), dict[tuple[Unit, bool], list[Column]]()
        if every is None:
            return
        for column, one, unit in zip(columns, told, units, strict=True):
            if one and one.by != "column" and unit.quantity == "angle" and unit != every:
                groups.setdefault((unit, one.unit == unit), []).append(column)
        for (unit, named), some in groups.items():
            together = whole if len(some) == len(columns) else ""
            said = not_reached(some, every.name, unit.name, named=named, role=role, whole=together)
            self._warn(some, said)

    def _warn(self, columns: Sequence[Column], said: LogWarning) -> None:
        """Keep a warning; of columns whose unit it only assumes with what it says."""
        self.warnings.append(said)
        if said.assumption:
            self.doubts |= {column.number: said.message for column in columns}

    def _note(self, columns: Sequence[Column], unit: Unit, evidence: str, *, every: bool = False) -> None:
        """Note the unit of some columns, and whether what is given for every angle would reach them."""
        self._noted.setdefault((unit.name, evidence, every), []).extend(columns)

    def _assume(
        self,
        columns: Sequence[Column],
        unit: Unit,
        what: str,
        hints: Sequence[Hint],
        why: str = "",
        *,
        asks: bool = False,
    ) -> None:
        """Say that some columns are taken to be in a unit that nothing tells."""
        self._note(columns, unit, "assumed", every=unit.quantity == "angle")
        names = ", ".join(column.name for column in columns)
        said = f"no unit is given for {names}: the {what} are taken as {unit.name}{why}"
        role: Role = "position" if what == POSITIONS else "joint"
        taken = f"the {what} are in {unit.name}"
        doubted = LogWarning(
            "assumed-unit", said, hints=tuple(hints), assumption=taken, role=role, blocks_verdict=asks
        )
        self._warn(columns, doubted)
