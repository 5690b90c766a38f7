"""Units of the columns: stated, proved, assumed with a warning, or asked.

1. Stated (`UnitSources`): by the user for the column, by its name or the row of units, by the user for
   every angle, by the program that wrote the file; the first of them counts.
2. Proved by the kinematics (`proofs.prove_by_kinematics`): they overrule all but the user.
3. Without them a stated unit is compared with wraps, speed and size (`find_objection`): values that
   contradict it are asked about, unlikely ones are a warning.
4. Joints without a unit have that of the others, or that of their wraps. A column that does not wrap
   itself may be a joint that slides, unless an arm or another unit says that none does: it is assumed to
   be in deg, or in rad up to two turns; beyond it is asked.
5. Else rad is assumed up to two turns, deg if joints would be too fast in rad, m, and mm beyond
   `MAX_METRES` for a joint that slides or a position beside joints. Larger joint values are asked about.

Each unit has an `Evidence`: given, named, proved or assumed, and why. What the user gives is used; values
or kinematics that contradict it are a warning with the assumption.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Literal, NamedTuple

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
from urmpipe_pipeline.logs.log_map import Basis, Evidence
from urmpipe_pipeline.logs.proofs import (
    MAX_DEGREES,
    ONE_TURN,
    TWO_TURNS,
    KinematicUnits,
    count_wraps,
    peak,
    too_fast_as_radians,
    usual_peak,
    wraps_as_degrees,
    wraps_as_radians,
)
from urmpipe_pipeline.logs.vocabulary import KnownSource, Quantity, Unit, vocabulary

ASSUMED_UNIT = "assumed-unit"  # nothing states or proves it
DOUBTED_UNIT = "doubted-unit"  # the values may be in another unit than the stated one
UNIT_CONTRADICTION = "unit-contradiction"  # the kinematics fit with another unit
UNIT_NOT_REACHED = "unit-not-reached"  # the unit for every angle, by columns whose names state another one

GIVEN = "given as an option"  # evidence of what the user gives
MAX_REACH = 10.0  # [m], of a coordinate; no arm reaches further
MIN_REACH = 0.02  # [m]; coordinates that all stay below are hardly those of a tool
MAX_METRES = 20.0  # values without a unit beyond are hardly in [m]

_ALLOWED: dict[JointKind | None, tuple[Quantity, ...]] = {
    "revolute": ("angle",),
    "prismatic": ("length",),
    None: ("angle", "length"),
}  # quantities of a joint, the likely one first
_ALL_OF = {"joint": "the joints are", "position": "the positions are", "rotation": "the orientation is"}


class StatedUnit(NamedTuple):
    """A unit that the user, a name or the source states.

    Attributes:
        unit: The unit.
        by: The user for this column or for every angle, its name, the source, the source that the user gave,
            or its name in a file that urmpipe wrote.
        why: The same in words.
        is_confirmed: Whether the user gives what the name states, or the source that states it.
    """

    unit: Unit
    by: Literal["column", "name", "every angle", "source", "given source", "urmpipe"]
    why: str
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
        """Return the stated unit of a column that may hold some quantities, the likely one first; or None.

        Raises:
            LogError: If a name has a unit that is not known or allowed, and the user gives none.
            OptionError: If the user gives one that is not allowed.
        """
        stated = self._find_first(column, allowed)
        if stated is None or (stated.unit.quantity in allowed and not stated.unit.order):
            return stated
        names = ", ".join(name for quantity in allowed for name in vocabulary().spelled(quantity))
        message = f"found the unit {stated.unit.name} ({stated.why}), allowed: {names}"
        if stated.is_given:
            raise OptionError(Finding(message, column=column.name, parameter="unit"))
        raise LogError(Finding(message, self.file, column=column.header))

    def _find_first(self, column: Column, allowed: Sequence[Quantity]) -> StatedUnit | None:
        if column.number in self.given:
            unit = self.given[column.number]
            return StatedUnit(unit, "column", GIVEN, unit == column.unit)
        every = self.given.get(0) if "angle" in allowed else None
        by_name = self.find_of_column(column, allowed[0]) if every is None else column.unit
        if by_name is not None and by_name.quantity != "time" and by_name != every:
            by_urmpipe = self.source is not None and self.source.own
            return StatedUnit(by_name, "urmpipe" if by_urmpipe else "name", "its name")
        if every is not None:
            return StatedUnit(every, "every angle", GIVEN, by_name == every)
        default = self.source.units.get(allowed[0]) if self.source else None
        if self.source is None or default is None:
            return None
        why = f"{self.source.name} writes {default.name}"
        return StatedUnit(default, "given source" if self.source_given else "source", why, self.source_given)

    def find_of_column(self, column: Column, likely: Quantity = "angle") -> Unit | None:
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

    def of_joints(self, columns: Sequence[Column], robot: Chain | None) -> list[StatedUnit | None]:
        """Return the stated units of the joints; raises as `find`, also if one does not fit the robot."""
        kinds = [robot.moving[j].kind if robot else None for j in range(len(columns))]
        return [self.find(column, _ALLOWED[kind]) for column, kind in zip(columns, kinds, strict=True)]

    def of_lengths(self, columns: Sequence[Column]) -> list[StatedUnit | None]:
        """Return the stated units of recorded x, y, z; raises as `find`."""
        return [self.find(column, ("length",)) for column in columns]

    def of_rotation(
        self, columns: Sequence[Column], forms: Sequence[RotationForm]
    ) -> list[StatedUnit | None]:
        """Return the stated units of an orientation, None for forms without angles; raises as `find`."""
        has_angles = any(map(is_angular, forms))
        return [self.find(column) if has_angles else None for column in columns]


class Objection(NamedTuple):
    """Why joint values may not be in a unit, and which columns contradict it; none if it is only unlikely."""

    why: str
    columns: tuple[int, ...] = ()


def find_objection(
    unit: str, values: FloatArray, t_ns: IntArray | None, turns: float = ONE_TURN
) -> Objection | None:
    """Return the objection to a unit of joint values, None if they may be in it.

    Wraps of the other unit contradict it, in all columns but those that can only be in this one; so does a
    speed, but for values of less than two turns: there it is the clock that may be wrong.

    Args:
        unit: rad or deg.
        values: In the file's own units, shape (n, columns).
        t_ns: Times in [ns], shape (n,), or None.
        turns: Size in [rad] from which values in rad are unlikely.
    """
    columns, size = list(enumerate(values.T)), usual_peak(values)
    if unit == "deg":
        if wraps := wraps_as_radians(values):
            return Objection(wraps, tuple(j for j, column in columns if peak(column) <= TWO_TURNS))
        is_small = size <= TWO_TURNS and peak(values) > 0
        if not is_small or wraps_as_degrees(values) or too_fast_as_radians(values, t_ns):
            return None
        return Objection(f"values of no more than {peak(values):.6g} may be rad as well")
    contradiction = wraps_as_degrees(values)
    if contradiction is None and size > TWO_TURNS:
        contradiction = too_fast_as_radians(values, t_ns)
    if contradiction is not None:
        others = tuple(j for j, column in columns if not wraps_as_radians(column[:, np.newaxis]))
        return Objection(contradiction, others)
    if size <= turns or wraps_as_radians(values):
        return None
    limit = "a turn" if turns == ONE_TURN else "two turns"
    return Objection(f"values of {size:.6g} are more than {limit} as rad")


def doubt_warning(
    columns: Sequence[Column],
    stated: Collection[StatedUnit],
    unit: str,
    why: str,
    role: Role,
    *,
    are_all: bool = True,
) -> LogWarning:
    """Return the warning that values may not be in their unit, which is used all the same.

    Args:
        columns: The columns.
        stated: What states their unit.
        unit: The unit.
        why: What indicates that they are not.
        role: What they hold.
        are_all: Whether they are all columns of this role.
    """
    names = ", ".join(column.name for column in columns)
    evidence = " and ".join(sorted({item.why for item in stated}))
    every = role == "joint" and all(item.by_source for item in stated)
    message, hints = f"{names}: {unit} ({evidence}) is doubted: {why}", which_unit(columns, unit, every=every)
    if all(item.is_given for item in stated):
        message, hints = f"{names}: {unit} ({evidence}) is used, though {why}", hints[:1]
    assumption = f"{_subject(columns, role, are_all=are_all)} in {unit}"
    return LogWarning(DOUBTED_UNIT, message, hints=hints, assumption=assumption, role=role)


def _subject(columns: Sequence[Column], role: Role, *, are_all: bool) -> str:
    """Return the beginning of a sentence about columns: the joints are, or q1 is."""
    if are_all:
        return _ALL_OF[role]
    return f"{', '.join(column.name for column in columns)} {'are' if len(columns) > 1 else 'is'}"


def _find_common(units: Sequence[Unit | None], quantity: Quantity) -> Unit | None:
    """Return the unit that all columns of a quantity have; None if they have several, or none."""
    common = {unit for unit in units if unit is not None and unit.quantity == quantity}
    return common.pop() if len(common) == 1 else None


@dataclass(slots=True)
class UnitFinder:
    """Settles the units of the columns of one log, and keeps the evidence.

    Attributes:
        sources: What states units.
        kinematic: The units that the kinematics prove, if they do.
        warnings: Units that are assumed or doubted, and contradictions.
        evidence: The evidence of the unit of a column, by its number.
        uses_source: Whether the source stated a unit.
    """

    sources: UnitSources
    kinematic: KinematicUnits | None = None
    warnings: list[LogWarning] = field(default_factory=list)
    evidence: dict[int, Evidence] = field(default_factory=dict)
    uses_source: bool = False
    _notes: dict[tuple[str, str, Basis, bool], list[Column]] = field(default_factory=dict)

    @property
    def inferences(self) -> list[Inference]:
        """The units, columns of one unit and evidence together."""
        return [
            unit_inference(columns, unit, why, basis, every=every)
            for (unit, why, basis, every), columns in self._notes.items()
        ]

    def settle_joints(
        self, columns: Sequence[Column], values: FloatArray, t_ns: IntArray | None, robot: Chain | None
    ) -> list[Unit]:
        """Return the units of the joint columns.

        Their values are in the file's own units, shape (n, joints), at recorded times in [ns], shape (n,), if
        any.

        Raises:
            LogError: If a unit is not known, does not fit robot or values, or is to be asked.
            OptionError: If one that the user gave does not fit the robot.
        """
        stated, proved = self.sources.of_joints(columns, robot), (False,) * len(columns)
        if self.kinematic is not None:
            units, proved = self._overrule(columns, stated, "angle"), self.kinematic.proved
        else:
            units = self._complete_joints(columns, stated, values, t_ns, robot)
        for name, given in product(("rad", "deg"), (False, True)):
            group = {
                j: item
                for j, item in enumerate(stated)
                if item and item.by != "urmpipe" and item.is_given == given and units[j].name == name
            }
            unproved = {j: item for j, item in group.items() if not proved[j]}
            if unproved:
                is_open = len(unproved) == len(group) and (given or 0 not in self.sources.given)
                self._compare(columns, unproved, name, values, t_ns, can_doubt=is_open)
        self.warn_not_reached(columns, stated, units, "joint")
        return units

    def _compare(
        self,
        columns: Sequence[Column],
        stated: Mapping[int, StatedUnit],
        unit: str,
        values: FloatArray,
        t_ns: IntArray | None,
        *,
        can_doubt: bool,
    ) -> None:
        """Compare a stated unit with the values: ask if they contradict it, warn if they are unlikely."""
        are_all = len(stated) == len(columns)
        columns, values = [columns[j] for j in stated], values if are_all else values[:, list(stated)]
        given = all(item.is_given for item in stated.values())
        objection = find_objection(unit, values, t_ns, TWO_TURNS if given else ONE_TURN)
        if objection is None:
            return
        if objection.columns and not given:
            contradicting = [columns[j] for j in objection.columns]
            names = ", ".join(column.name for column in contradicting)
            message = f"found {names} in {unit} by name or source, but {objection.why}"
            hints = which_unit(contradicting, unit, every=all(item.by_source for item in stated.values()))
            allowed = "a unit that fits the data"
            raise LogError(Finding(f"{message}, allowed: {allowed}", self.sources.file, hints=hints))
        is_confirmed = all(item.is_confirmed for item in stated.values())
        if objection.columns or (can_doubt and not is_confirmed):
            by, why = stated.values(), objection.why
            warning = doubt_warning(columns, by, unit, why, "joint", are_all=are_all)
            self._warn(columns, warning, given=given)

    def settle_rates(self, columns: Sequence[Column], joints: Sequence[Unit], order: int) -> list[Unit]:
        """Return the units of recorded rates (order 1) or accelerations (2): the joints' own by default."""
        units = []
        for column, joint in zip(columns, joints, strict=False):
            stated = self.sources.find_of_column(column)
            unit = stated if stated is not None and stated.quantity == joint.quantity else joint
            units.append(unit if unit.order else unit.per_second(order))
        return units

    def settle_positions(
        self, columns: Sequence[Column], values: FloatArray, *, beside_joints: bool = False
    ) -> list[Unit]:
        """Return the units of recorded x, y, z, whose values are in the file's own units, shape (n, 3)."""
        stated = self.sources.of_lengths(columns)
        if self.kinematic is not None:
            return self._overrule(columns, stated, "length")
        self._note_stated(columns, stated)
        known, size = [item.unit if item else None for item in stated], usual_peak(values)
        unstated = [column for column, item in zip(columns, stated, strict=True) if item is None]
        default = _find_common(known, "length")
        if unstated and default is not None:
            self._note(unstated, default, "named", "as the other position columns")
        elif unstated:
            is_far, is_mm = size > MAX_METRES, size > MAX_METRES and beside_joints
            default, why = vocabulary().units["mm" if is_mm else "m"], ""
            if is_far:
                why = f", as values of {size:.6g} are beyond any arm in m"
                why = why if is_mm else f", though values of {size:.6g} reach further than any arm"
            hints = which_unit(columns, "m", every=False) if is_far else unit_hints(columns[:1], "mm")
            asks = is_far and not is_mm
            self._assume(unstated, default, "the positions are", "position", hints, why, asks=asks)
        units = [unit or default or vocabulary().units["m"] for unit in known]
        by = {item for item in stated if item and item.by != "urmpipe" and not item.is_confirmed}
        furthest = size * units[0].factor if units else 0.0
        if by and len(set(units)) == 1 and (furthest > MAX_REACH or 0 < furthest < MIN_REACH):
            is_far = furthest > MAX_REACH
            why = "reach further than any arm" if is_far else "are closer to the origin than any arm works"
            warning = doubt_warning(columns, by, units[0].name, f"values of {size:.6g} {why}", "position")
            self._warn(columns, warning, given=all(item.is_given for item in by))
        return units

    def _overrule(
        self, columns: Sequence[Column], stated: Sequence[StatedUnit | None], quantity: Quantity
    ) -> list[Unit]:
        """Return the units that the kinematics prove, but those that the user gave."""
        assert self.kinematic is not None
        proved, contradicted = self.kinematic.of(quantity), dict[StatedUnit, list[int]]()
        units = list(proved)
        role: Role = "joint" if quantity == "angle" else "position"
        for j, item in enumerate(stated):
            if item is None:
                self._note([columns[j]], proved[j], "proved", self.kinematic.format_evidence(quantity))
            elif item.unit == proved[j]:
                self._note_stated([columns[j]], [item])
            else:
                contradicted.setdefault(item, []).append(j)
        for item, places in contradicted.items():
            some, better = [columns[j] for j in places], proved[places[0]]
            rival = tuple(item.unit if j in places else unit for j, unit in enumerate(proved))
            evidence = self.kinematic.format_evidence(quantity, rival)
            names = ", ".join(column.name for column in some)
            message = f"{names}: {item.unit.name} ({item.why}) contradicts the kinematics: taken as"
            if not item.is_given:
                self._note(some, better, "proved", evidence)
                hints = unit_hints(some, item.unit.name)
                message = f"{message} {better.name}: {evidence}"
                self.warnings.append(LogWarning(UNIT_CONTRADICTION, message, hints=hints))
                continue
            for j in places:
                units[j] = item.unit
            self._note_stated(some, [item] * len(some))
            message = f"{message} {item.unit.name}, though as {better.name} it would fit: {evidence}"
            assumption = f"{_subject(some, role, are_all=len(some) == len(columns))} in {item.unit.name}"
            hints = unit_hints(some, better.name)
            warning = LogWarning(UNIT_CONTRADICTION, message, hints=hints, assumption=assumption, role=role)
            self._warn(some, warning, given=True)
        return units

    def _complete_joints(
        self,
        columns: Sequence[Column],
        stated: Sequence[StatedUnit | None],
        values: FloatArray,
        t_ns: IntArray | None,
        robot: Chain | None,
    ) -> list[Unit]:
        """Return the stated units of joints, and without the kinematics those of the others."""
        self._note_stated(columns, stated)
        metre, known = vocabulary().units["m"], [item.unit if item else None for item in stated]
        unknown = [j for j, unit in enumerate(known) if unit is None]
        slides = [j for j in unknown if robot and robot.moving[j].kind == "prismatic"]
        turns = [j for j in unknown if j not in slides]
        if slides:
            some, size = [columns[j] for j in slides], usual_peak(values[:, slides])
            is_far, why = size > MAX_METRES, f", as values of {size:.6g} are beyond any arm in m"
            unit = vocabulary().units["mm"] if is_far else metre
            hints = unit_hints(some, OTHER_UNIT[unit.name])
            self._assume(some, unit, "the prismatic joints are", "joint", hints, why if is_far else "")
            known = [unit if j in slides else other for j, other in enumerate(known)]
        if turns:
            some = [columns[j] for j in turns]
            turning = values if len(turns) == len(columns) else values[:, turns]
            common = _find_common(known, "angle")
            if common is not None:
                self._note(some, common, "named", "as the other joint columns")
                angle = common
            else:
                may_slide = robot is None and not any(stated)
                angle = self._settle_angles(some, turning, t_ns, may_slide=may_slide)
            known = [angle if j in turns else other for j, other in enumerate(known)]
        return [unit or metre for unit in known]

    def _settle_angles(
        self, columns: Sequence[Column], values: FloatArray, t_ns: IntArray | None, *, may_slide: bool
    ) -> Unit:
        """Return the unit of joints that nothing states: proved by wraps, or assumed.

        Raises:
            LogError: If it is to be asked.
        """
        rad, deg = (vocabulary().units[name] for name in ("rad", "deg"))
        for unit, proof in ((deg, wraps_as_degrees(values)), (rad, wraps_as_radians(values))):
            if not proof:
                continue
            sliding = self._find_sliding(columns, values, unit) if may_slide else []
            self._note([c for c in columns if c not in sliding], unit, "proved", proof, every=True)
            if sliding:
                hints = (
                    Hint("unit", {"": unit.name}, "confirms it"),
                    *unit_hints(sliding, "mm", "if they slide"),
                )
                subject = _subject(sliding, "joint", are_all=False)
                self._assume(sliding, unit, subject, "joint", hints, f", as the others have {proof}")
            return unit
        sizes = [peak(column) for column in values.T]
        large = [column for column, size in zip(columns, sizes, strict=True) if size > 2 * TWO_TURNS]
        if may_slide and len(columns) > 2 and len(large) == 1 and sum(size > ONE_TURN for size in sizes) == 1:
            raise LogError(self._ask_slides(large, peak(values)))
        fast = too_fast_as_radians(values, t_ns) if peak(values) <= MAX_DEGREES else None
        if not fast and usual_peak(values) > TWO_TURNS:
            raise LogError(self._ask_angle(columns, peak(values)))
        unit = deg if fast else rad
        hints = (Hint("unit", {"": OTHER_UNIT[unit.name]}, "overrides this"),)
        self._assume(columns, unit, "the joints are", "joint", hints, f": {fast}" if fast else "")
        return unit

    def _find_sliding(self, columns: Sequence[Column], values: FloatArray, unit: Unit) -> list[Column]:
        """Return the columns that may slide beside joints whose wraps prove a unit, by what they do not show.

        In deg these are all that do not wrap and are not 0; in rad the number is the same in m, and only
        those of more than two turns are asked about.
        """
        if unit.name == "rad":
            large = [c for c, x in zip(columns, values.T, strict=True) if usual_peak(x[:, None]) > TWO_TURNS]
            if large:
                raise LogError(self._ask_slides(large, peak(values)))
            return []
        wraps = count_wraps(values, unit.name)
        return [
            column
            for column, count, x in zip(columns, wraps, values.T, strict=True)
            if not count and peak(x) > 0
        ]

    def _ask_slides(self, columns: Sequence[Column], largest: float) -> Finding:
        """Return the question whether the only columns with values beyond those in rad are lengths."""
        names = ", ".join(column.name for column in columns)
        message = f"found values up to {largest:.6g} in {names} alone and no unit"
        lengths = {column.called: "mm" for column in columns}
        choices = ({"": "rad", **lengths}, {"": "deg"}, {"": "rad"})
        hints = tuple(Hint("unit", choice, "specifies it") for choice in choices)
        allowed = "the unit of a joint that slides, or one unit for all"
        return Finding(f"{message}, allowed: {allowed}", self.sources.file, hints=hints)

    def _ask_angle(self, columns: Sequence[Column], largest: float) -> Finding:
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
    ) -> None:
        """Warn of angles whose names state another unit than the user gives for every angle.

        Args:
            columns: The columns.
            stated: The stated unit of each.
            units: The unit of each.
            role: What they hold.
        """
        every, groups = self.sources.given.get(0), dict[str, list[Column]]()
        for column, item, unit in zip(columns, stated, units, strict=True):
            if every and item and not item.is_given and unit.quantity == "angle" and unit != every:
                groups.setdefault(unit.name, []).append(column)
        for name, some in groups.items():
            assert every is not None
            names = ", ".join(column.name for column in some)
            message = f"{names}: {every.name} does not reach them: their names say {name}"
            assumption = f"{_subject(some, role, are_all=len(some) == len(columns))} in {name}"
            hints = unit_hints(some, every.name, "does")
            warning = LogWarning(UNIT_NOT_REACHED, message, hints=hints, assumption=assumption, role=role)
            self._warn(some, warning)

    def _note_stated(self, columns: Sequence[Column], stated: Sequence[StatedUnit | None]) -> None:
        for column, item in zip(columns, stated, strict=True):
            if item is not None:
                every = item.by == "every angle" or item.by_source
                self._note([column], item.unit, "given" if item.is_given else "named", item.why, every=every)
                self.uses_source |= item.by_source

    def _note(
        self, columns: Sequence[Column], unit: Unit, basis: Basis, why: str, *, every: bool = False
    ) -> None:
        """Keep the evidence of a unit, and whether a unit given for every angle would reach its columns."""
        self._notes.setdefault((unit.name, why, basis, every), []).extend(columns)
        self.evidence |= {column.number: Evidence(basis, why) for column in columns}

    def _warn(self, columns: Sequence[Column], warning: LogWarning, *, given: bool = False) -> None:
        """Keep a warning: unless the user gave the unit, it is only assumed."""
        self.warnings.append(warning)
        if not given:
            self.evidence |= {column.number: Evidence("assumed", warning.message) for column in columns}

    def _assume(
        self,
        columns: Sequence[Column],
        unit: Unit,
        subject: str,
        role: Role,
        hints: Sequence[Hint],
        why: str = "",
        *,
        asks: bool = False,
    ) -> None:
        """Warn that columns are taken to be in a unit that nothing states or proves."""
        self._note(columns, unit, "assumed", "assumed", every=unit.quantity == "angle")
        names = ", ".join(column.name for column in columns)
        of = "" if subject.startswith(names) else f" for {names}"
        message = f"no unit is given{of}: {subject} taken as {unit.name}{why}"
        warning = LogWarning(ASSUMED_UNIT, message, hints=tuple(hints), role=role, blocks_verdict=asks)
        self._warn(columns, replace(warning, assumption=f"{subject} in {unit.name}"))
