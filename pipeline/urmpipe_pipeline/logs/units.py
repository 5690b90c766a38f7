"""Units of the columns: stated, proved, assumed, or a question.

- `StatedUnit`, `UnitSources`: what the user, a column's name or the source states.
- `UnitFinder`: the unit of each column. The kinematics overrule a name. Without them wraps prove the unit of
  joints, and values that contradict a name are asked about. A unit that only the size of values speaks
  against is doubted. What nothing states is assumed: rad up to two turns, deg if joints would be too fast as
  rad, m, or mm beyond `MAX_METRES` beside an arm. All else is asked.

What the user gives is used, and proved likewise: a contradiction is a warning with the assumption.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Literal

import numpy as np

from urmpipe_models.arm.chain import Chain, JointKind
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_models.math3d import RotationForm, is_angular
from urmpipe_pipeline.joint_log import Inference, LogWarning, Role
from urmpipe_pipeline.logs.columns import (
    NAME_JOINTS,
    OTHER_UNIT,
    Column,
    unit_hints,
    unit_inference,
    which_unit,
)
from urmpipe_pipeline.logs.proofs import (
    MAX_DEGREES,
    ONE_TURN,
    TWO_TURNS,
    KinematicUnits,
    peak,
    too_fast_as_radians,
    usual_peak,
    wraps_as_degrees,
    wraps_as_radians,
)
from urmpipe_pipeline.logs.vocabulary import KnownSource, Quantity, Unit, vocabulary

GIVEN = "given as an option"
MAX_REACH = 10.0  # [m], of a coordinate; no arm reaches further
MIN_REACH = 0.02  # [m]; coordinates that all stay below are hardly those of a tool
MAX_METRES = 20.0  # values without a unit beyond are hardly in [m]

_ALLOWED: dict[JointKind | None, tuple[Quantity, ...]] = {
    "revolute": ("angle",),
    "prismatic": ("length",),
    None: ("angle", "length"),
}  # quantities of a joint, the likely one first


@dataclass(frozen=True, slots=True)
class StatedUnit:
    """A unit that the user, a name or the source states.

    Attributes:
        unit: The unit.
        by: The user for this column or for every angle, its name, the source, the source that the user gave,
            or its name in a file that urmpipe wrote.
        evidence: The same in words.
        is_confirmed: Whether the user gives what the name states, or the source that states it.
    """

    unit: Unit
    by: Literal["column", "name", "every angle", "source", "given source", "urmpipe"]
    evidence: str
    is_confirmed: bool = False

    @property
    def is_given(self) -> bool:
        """Whether the user gives it: then it is used."""
        return self.by in ("column", "every angle")

    @property
    def by_source(self) -> bool:
        """Whether the source states it."""
        return self.by in ("source", "given source")


@dataclass(frozen=True, slots=True)
class UnitSources:
    """What states the units of the columns of a log.

    Attributes:
        given: Units given by the user, by the column's number; by 0 that of every angle.
        source: The source, if it is known.
        file: The file, for errors.
        source_given: Whether the user gave the source.
    """

    given: Mapping[int, Unit]
    source: KnownSource | None
    file: str
    source_given: bool = False

    def find(self, column: Column, allowed: Sequence[Quantity] = ("angle",)) -> StatedUnit | None:
        """Return the stated unit of a column; None if nothing states it.

        A unit for every angle comes behind the column's own name, and before the source.

        Args:
            column: The column.
            allowed: Quantities that it may hold; the first is the likely one.

        Raises:
            LogError: If a name has a unit that is not known or allowed, and the user gives none.
            OptionError: If the user gives one that is not allowed.
        """
        stated = self._find_first(column, allowed)
        if stated is None or (stated.unit.quantity in allowed and not stated.unit.order):
            return stated
        names = ", ".join(name for quantity in allowed for name in vocabulary().spelled(quantity))
        message = f"found the unit {stated.unit.name} ({stated.evidence}), allowed: {names}"
        if stated.is_given:
            raise OptionError(Finding(message, column=column.name, parameter="unit"))
        raise LogError(Finding(message, self.file, column=column.header))

    def find_own(self, column: Column, likely: Quantity = "angle") -> Unit | None:
        """Return the unit that the user or the name gives this very column.

        Raises:
            LogError: If it is not known.
        """
        if column.number in self.given:
            return self.given[column.number]
        if column.unit_text and column.unit is None:
            found = f"found the unit {format_value(column.unit_text)}"
            message = f"{found}, allowed: rad, deg, m, mm, cm; convert the values"
            hints = unit_hints([column], "mm" if likely == "length" else "deg", "keeps the values unchanged")
            raise LogError(Finding(message, self.file, column=column.header, hints=hints))
        return column.unit

    def _find_first(self, column: Column, allowed: Sequence[Quantity]) -> StatedUnit | None:
        if column.number in self.given:
            unit = self.given[column.number]
            return StatedUnit(unit, "column", GIVEN, unit == column.unit)
        every = self.given.get(0) if "angle" in allowed else None
        own = self.find_own(column, allowed[0]) if every is None else column.unit
        if own is not None and own.quantity != "time" and own != every:
            wrote = self.source is not None and self.source.own
            return StatedUnit(own, "urmpipe" if wrote else "name", "its name")
        if every is not None:
            return StatedUnit(every, "every angle", GIVEN, own == every)
        default = self.source.units.get(allowed[0]) if self.source else None
        if self.source is None or default is None:
            return None
        by: Literal["source", "given source"] = "given source" if self.source_given else "source"
        return StatedUnit(default, by, f"{self.source.name} writes {default.name}", self.source_given)

    def of_joints(self, columns: Sequence[Column], robot: Chain | None) -> list[StatedUnit | None]:
        """Return the stated units of the joints; raises as `find`, also if one does not fit the robot."""
        kinds = [robot.moving[j].kind if robot else None for j in range(len(columns))]
        return [self.find(column, _ALLOWED[kind]) for column, kind in zip(columns, kinds, strict=True)]

    def of_lengths(self, columns: Sequence[Column]) -> list[StatedUnit | None]:
        """Return the stated units of recorded x, y, z; raises as `find`."""
        return [self.find(column, ("length",)) for column in columns]


def find_contradiction(unit: str, values: FloatArray, t_ns: IntArray | None) -> tuple[str, list[int]] | None:
    """Return why joint values are not in a unit, and which columns that is about; None if they may be.

    It is about all columns but those that can only be in that unit. A speed alone excludes no values of less
    than two turns: there it is the clock that may be wrong.

    Args:
        unit: rad or deg.
        values: In the file's own units, shape (n, columns).
        t_ns: Times in [ns], shape (n,), or None.
    """
    columns = list(enumerate(values.T))
    if unit == "deg":
        why = wraps_as_radians(values)
        return (why, [j for j, column in columns if peak(column) <= TWO_TURNS]) if why else None
    why = wraps_as_degrees(values)
    if why is None and usual_peak(values) > TWO_TURNS:
        why = too_fast_as_radians(values, t_ns)
    return (why, [j for j, c in columns if not wraps_as_radians(c[:, np.newaxis])]) if why else None


def find_doubt(unit: str, values: FloatArray, t_ns: IntArray | None, turns: float = ONE_TURN) -> str | None:
    """Return why joint values may be in the other unit than rad or deg; None if nothing indicates it.

    Args:
        unit: rad or deg.
        values: In the file's own units, shape (n, columns).
        t_ns: Times in [ns], shape (n,), or None.
        turns: Size in [rad] from which values in rad are doubted.
    """
    size = usual_peak(values)
    if unit == "rad":
        is_small = size <= turns or wraps_as_radians(values)
        limit = "a turn" if turns == ONE_TURN else "two turns"
        return None if is_small else f"values of {size:.6g} are more than {limit} as rad"
    if (
        size > TWO_TURNS
        or not peak(values) > 0
        or wraps_as_degrees(values)
        or too_fast_as_radians(values, t_ns)
    ):
        return None
    return f"values of no more than {peak(values):.6g} may be rad as well"


def doubt_warning(
    columns: Sequence[Column], stated: Collection[StatedUnit], unit: str, why: str, whole: str, role: Role
) -> LogWarning:
    """Return the warning that values may not be in their unit, which is used all the same.

    Args:
        columns: The columns.
        stated: What states their unit.
        unit: The unit.
        why: What indicates that they are not.
        whole: What they are together, "the joints are"; empty for some of them.
        role: What they hold.
    """
    names = ", ".join(column.name for column in columns)
    evidence = " and ".join(sorted({item.evidence for item in stated}))
    every = role == "joint" and all(item.by_source for item in stated)
    taken = f"{whole or names + (' are' if len(columns) > 1 else ' is')} in {unit}"
    message, hints = f"{names}: {unit} ({evidence}) is doubted: {why}", which_unit(columns, unit, every=every)
    if all(item.is_given for item in stated):
        message, hints = f"{names}: {unit} ({evidence}) is used, though {why}", hints[:1]
    return LogWarning("doubted-unit", message, hints=hints, assumption=taken, role=role)


@dataclass(slots=True)
class UnitFinder:
    """Finds the units of the columns of one log, and keeps the results.

    Attributes:
        sources: What states units.
        kinematic: The units that the kinematics prove, if they do.
        warnings: Units that are assumed or doubted, and contradictions.
        doubts: Why a column's unit is only assumed, by its number.
        by_source: Whether the source stated a unit.
    """

    sources: UnitSources
    kinematic: KinematicUnits | None = None
    warnings: list[LogWarning] = field(default_factory=list)
    doubts: dict[int, str] = field(default_factory=dict)
    by_source: bool = False
    _noted: dict[tuple[str, str, bool], list[Column]] = field(default_factory=dict)

    @property
    def inferences(self) -> list[Inference]:
        """The units, columns of one unit and evidence together."""
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
            LogError: If a unit is not known, does not fit robot or values, or is to be asked.
            OptionError: If one that the user gave does not fit the robot.
        """
        stated = self.sources.of_joints(columns, robot)
        if self.kinematic is not None:
            units, settled = self._by_kinematics(columns, stated, "angle"), self.kinematic.proved
        else:
            units = self._joints_by_themselves(columns, stated, values, t_ns, robot)
            settled = (False,) * len(columns)
        for name, given in product(("rad", "deg"), (False, True)):
            places = [
                j
                for j, item in enumerate(stated)
                if item and item.by != "urmpipe" and item.is_given == given and units[j].name == name
            ]
            unproved = [j for j in places if not settled[j]]
            if unproved:
                some, by = [columns[j] for j in unproved], [item for j in unproved if (item := stated[j])]
                mine = values if len(unproved) == len(columns) else values[:, unproved]
                whole = "the joints are" if len(unproved) == len(columns) else ""
                can_doubt = len(unproved) == len(places) and (given or 0 not in self.sources.given)
                self._check_joints(some, by, name, mine, t_ns, whole, can_doubt=can_doubt)
        self.warn_not_reached(columns, stated, units, "joint", "the joints are")
        return units

    def _check_joints(
        self,
        columns: Sequence[Column],
        stated: Sequence[StatedUnit],
        unit: str,
        values: FloatArray,
        t_ns: IntArray | None,
        whole: str,
        *,
        can_doubt: bool,
    ) -> None:
        """Compare a stated unit with the values: ask if they contradict it, warn if they are unlikely.

        Raises:
            LogError: If they contradict a unit that the user did not give.
        """
        given, contradiction = stated[0].is_given, find_contradiction(unit, values, t_ns)
        if contradiction is not None and not given:
            why, places = contradiction
            some = [columns[j] for j in places]
            names = ", ".join(column.name for column in some)
            found = f"found {names} in {unit} by name or source, but {why}"
            hints = which_unit(some, unit, every=all(item.by_source for item in stated))
            raise LogError(
                Finding(f"{found}, allowed: a unit that fits the data", self.sources.file, hints=hints)
            )
        doubt = contradiction[0] if contradiction else None
        if doubt is None and can_doubt and not all(item.is_confirmed for item in stated):
            doubt = find_doubt(unit, values, t_ns, TWO_TURNS if given else ONE_TURN)
        if doubt is not None:
            warning = doubt_warning(columns, stated, unit, doubt, whole, "joint")
            self._warn(columns, warning, given=given)

    def derivatives(self, columns: Sequence[Column], joints: Sequence[Unit], order: int) -> list[Unit]:
        """Return the units of recorded rates (order 1) or accelerations (2): the joints' own by default."""
        units = []
        for column, joint in zip(columns, joints, strict=False):
            own = self.sources.find_own(column)
            unit = own if own is not None and own.quantity == joint.quantity else joint
            units.append(unit if unit.order else unit.per_second(order))
        return units

    def positions(self, columns: Sequence[Column], values: FloatArray, *, arm: bool = False) -> list[Unit]:
        """Return the units of recorded x, y, z: stated, proved by the kinematics, or assumed.

        Args:
            columns: The columns.
            values: In the file's own units, shape (n, 3).
            arm: Whether joints stand beside them: values far beyond an arm are then in mm.
        """
        stated = self.sources.of_lengths(columns)
        if self.kinematic is not None:
            return self._by_kinematics(columns, stated, "length")
        known, size = self._note_stated(columns, stated), usual_peak(values)
        unstated = [column for column, item in zip(columns, stated, strict=True) if item is None]
        rest = self._like_others(unstated, known, "position") if unstated else None
        if unstated and rest is None:
            is_far = size > MAX_METRES
            rest = vocabulary().units["mm" if is_far and arm else "m"]
            why = f", as values of {size:.6g} are beyond any arm in m" if is_far and arm else ""
            why = f", though values of {size:.6g} reach further than any arm" if is_far and not arm else why
            hints = which_unit(columns, "m", every=False) if is_far else unit_hints(columns[:1], "mm")
            self._assume(unstated, rest, "positions", "position", hints, why, asks=is_far and not arm)
        units = [unit or rest or vocabulary().units["m"] for unit in known]
        by = {item for item in stated if item and item.by != "urmpipe" and not item.is_confirmed}
        furthest = size * units[0].factor if units else 0.0
        if by and len(set(units)) == 1 and (furthest > MAX_REACH or 0 < furthest < MIN_REACH):
            why = (
                "reach further than any arm"
                if furthest > MAX_REACH
                else "are closer to the origin than any arm works"
            )
            why = f"values of {size:.6g} {why}"
            warning = doubt_warning(columns, by, units[0].name, why, "the positions are", "position")
            self._warn(columns, warning, given=all(item.is_given for item in by))
        return units

    def rotations(self, columns: Sequence[Column], forms: Sequence[RotationForm]) -> list[StatedUnit | None]:
        """Return the stated units of the columns of a recorded orientation, None where none is.

        Raises:
            LogError: If a unit is not known or is none of an angle.
            OptionError: If one that the user gave is none.
        """
        turned = any(map(is_angular, forms))
        return [self.sources.find(column) if turned else None for column in columns]

    def _note_stated(
        self, columns: Sequence[Column], stated: Sequence[StatedUnit | None]
    ) -> list[Unit | None]:
        """Return the stated units, having noted them."""
        for column, item in zip(columns, stated, strict=True):
            if item is not None:
                every = item.by == "every angle" or item.by_source
                self._note([column], item.unit, item.evidence, every=every)
                self.by_source |= item.by_source
        return [item.unit if item else None for item in stated]

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
        self, columns: Sequence[Column], stated: Sequence[StatedUnit | None], quantity: Quantity
    ) -> list[Unit]:
        """Return the units that the kinematics prove, except those that the user gave."""
        assert self.kinematic is not None
        proved, contradicted = self.kinematic.of(quantity), dict[StatedUnit, list[int]]()
        for j, item in enumerate(stated):
            if item is None:
                self._note([columns[j]], proved[j], self.kinematic.format_evidence(quantity))
            elif item.unit == proved[j]:
                self._note_stated([columns[j]], [item])
            else:
                contradicted.setdefault(item, []).append(j)
        units = list(proved)
        for item, places in contradicted.items():
            some, better = [columns[j] for j in places], proved[places[0]]
            others = [item.unit if j in places else None for j in range(len(columns))]
            evidence = self.kinematic.format_evidence(quantity, others)
            names = ", ".join(column.name for column in some)
            message = f"{names}: {item.unit.name} ({item.evidence}) contradicts the kinematics: taken as"
            if item.is_given:
                units = [item.unit if j in places else unit for j, unit in enumerate(units)]
                self._note_stated(some, [item] * len(some))
                role: Role = "joint" if quantity == "angle" else "position"
                all_of = "the joints are" if quantity == "angle" else "the positions are"
                whole = all_of if len(some) == len(columns) else f"{names} {'are' if len(some) > 1 else 'is'}"
                self._warn(
                    some,
                    LogWarning(
                        "unit-contradiction",
                        f"{message} {item.unit.name}, though as {better.name} it would fit: {evidence}",
                        hints=unit_hints(some, better.name),
                        assumption=f"{whole} in {item.unit.name}",
                        role=role,
                    ),
                    given=True,
                )
            else:
                self._note(some, better, evidence)
                hints = unit_hints(some, item.unit.name)
                self.warnings.append(
                    LogWarning("unit-contradiction", f"{message} {better.name}: {evidence}", hints=hints)
                )
        return units

    def _joints_by_themselves(
        self,
        columns: Sequence[Column],
        stated: Sequence[StatedUnit | None],
        values: FloatArray,
        t_ns: IntArray | None,
        robot: Chain | None,
    ) -> list[Unit]:
        """Return the units of joints without the kinematics: those that are stated, and of the others."""
        known = self._note_stated(columns, stated)
        unknown = [j for j, item in enumerate(stated) if item is None]
        slides = [j for j in unknown if robot and robot.moving[j].kind == "prismatic"]
        turns = [j for j in unknown if j not in slides]
        metre = vocabulary().units["m"]
        if slides:
            some = [columns[j] for j in slides]
            self._assume(some, metre, "prismatic joints", "joint", unit_hints(some, "mm"))
        if turns:
            turning = values if len(turns) == len(columns) else values[:, turns]
            if robot is None and not any(known):
                self._check_prismatic(columns, turning)
            unit = self._angle([columns[j] for j in turns], turning, t_ns, known)
            known = [unit if j in turns else other for j, other in enumerate(known)]
        return [unit or metre for unit in known]

    def _check_prismatic(self, columns: Sequence[Column], values: FloatArray) -> None:
        """Raise the question whether the only column with values beyond those in rad is a length."""
        sizes = [peak(column) for column in values.T]
        large = [k for k, size in enumerate(sizes) if size > 2 * TWO_TURNS]
        if len(large) != 1 or any(size > ONE_TURN for k, size in enumerate(sizes) if k != large[0]):
            return
        column = columns[large[0]]
        if len(columns) < 3 or wraps_as_radians(values) or wraps_as_degrees(values):
            return
        message = f"found values up to {sizes[large[0]]:.6g} in {column.name} alone and no unit"
        choices = ({"": "rad", column.called: "mm"}, {"": "deg"}, {"": "rad"})
        hints = tuple(Hint("unit", choice, "specifies it") for choice in choices)
        allowed = "the unit of a joint that slides, or one unit for all"
        raise LogError(Finding(f"{message}, allowed: {allowed}", self.sources.file, hints=hints))

    def _angle(
        self,
        columns: Sequence[Column],
        values: FloatArray,
        t_ns: IntArray | None,
        known: Sequence[Unit | None],
    ) -> Unit:
        """Return the unit of revolute joints that nothing states: the others', proved by wraps, or assumed.

        Raises:
            LogError: If it is to be asked: values of more than two turns as rad that are not too fast for it.
        """
        settled = self._like_others(columns, known, "joint", of="angle")
        if settled is not None:
            return settled
        rad, deg = (vocabulary().units[name] for name in ("rad", "deg"))
        for unit, proof in ((deg, wraps_as_degrees(values)), (rad, wraps_as_radians(values))):
            if proof:
                self._note(columns, unit, proof, every=True)
                return unit
        largest, fast = peak(values), too_fast_as_radians(values, t_ns)
        fast = fast if largest <= MAX_DEGREES else None
        if not fast and usual_peak(values) > TWO_TURNS:
            raise LogError(self._which_angle(columns, largest))
        unit = deg if fast else rad
        hints = [Hint("unit", {"": OTHER_UNIT[unit.name]}, "overrides this")]
        self._assume(columns, unit, "joints", "joint", hints, f": {fast}" if fast else "")
        return unit

    def _which_angle(self, columns: Sequence[Column], largest: float) -> Finding:
        """Return the question whether joints are in rad or deg."""
        names = ", ".join(column.name for column in columns)
        message = f"found values up to {largest:.6g} in {names} and no unit, allowed: rad or deg"
        message += "; convert ticks and counts" if largest > MAX_DEGREES else ""
        hints = [Hint("unit", {"": name}, "specifies it") for name in ("rad", "deg")]
        if all(column.header.isdigit() for column in columns):
            hints += [Hint("source", "path", "reads them as x, y, z")] if len(columns) == 3 else []
            hints += [NAME_JOINTS]
        return Finding(message, self.sources.file, hints=tuple(hints))

    def warn_not_reached(
        self,
        columns: Sequence[Column],
        stated: Sequence[StatedUnit | None],
        units: Sequence[Unit],
        role: Role,
        whole: str,
    ) -> None:
        """Name the angles whose names give another unit than the user for every angle.

        Args:
            columns: The columns.
            stated: The stated unit of each.
            units: What they are taken as.
            role: What they hold.
            whole: What they are together: "the joints are".
        """
        every, groups = self.sources.given.get(0), dict[str, list[Column]]()
        for column, item, unit in zip(columns, stated, units, strict=True):
            if every and item and not item.is_given and unit.quantity == "angle" and unit != every:
                groups.setdefault(unit.name, []).append(column)
        for name, some in groups.items():
            assert every is not None
            names = ", ".join(column.name for column in some)
            together = whole if len(some) == len(columns) else f"{names} {'are' if len(some) > 1 else 'is'}"
            message = f"{names}: {every.name} does not reach them: their names say {name}"
            hints, taken = unit_hints(some, every.name, "does"), f"{together} in {name}"
            self._warn(
                some, LogWarning("unit-not-reached", message, hints=hints, assumption=taken, role=role)
            )

    def _warn(self, columns: Sequence[Column], warning: LogWarning, *, given: bool = False) -> None:
        """Keep a warning, also as the reason why a unit is only assumed, unless the user gave it."""
        self.warnings.append(warning)
        self.doubts |= {} if given else {column.number: warning.message for column in columns}

    def _note(self, columns: Sequence[Column], unit: Unit, evidence: str, *, every: bool = False) -> None:
        """Note the unit of some columns, and whether a unit for every angle would reach them."""
        self._noted.setdefault((unit.name, evidence, every), []).extend(columns)

    def _assume(
        self,
        columns: Sequence[Column],
        unit: Unit,
        what: str,
        role: Role,
        hints: Sequence[Hint],
        why: str = "",
        *,
        asks: bool = False,
    ) -> None:
        """Warn that some columns are taken to be in a unit that nothing states or proves."""
        self._note(columns, unit, "assumed", every=unit.quantity == "angle")
        names, taken = ", ".join(column.name for column in columns), f"the {what} are in {unit.name}"
        message = f"no unit is given for {names}: the {what} are taken as {unit.name}{why}"
        warning = LogWarning(
            "assumed-unit", message, hints=tuple(hints), assumption=taken, role=role, blocks_verdict=asks
        )
        self._warn(columns, warning)
