"""Units of the columns: stated, proved, assumed with a warning, or asked.

1. Stated (`UnitSources`): by the user for the column, by its name or the row of units, by the user for
   every angle, by the program that wrote the file; the first of them counts.
2. Proved by the kinematics (`proofs.prove_by_kinematics`): they overrule everyone except the user.
3. Without them a stated unit is compared with wraps, speed and size (`find_objection`): values that
   contradict it are asked about, unlikely ones are a warning.
4. Joints without a unit have that of the other joints, or that of their wraps. A column that does not
   wrap itself may be a joint that slides, unless an arm or another unit says that none does: it is assumed
   to be in deg, or in rad up to two turns; a larger one is asked about.
5. Else rad is assumed up to two turns, deg if joints would be too fast in rad, or two of them too far; m,
   and mm from `MAX_REACH`, for a joint that slides or a position. Other values beyond two turns are asked
   about, as are those that may be per cent.

The inference of a unit states its basis (given, named, proved or assumed) and why. What the user gives is
used; values or kinematics that contradict it are a warning with the assumption.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain, JointKind
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_models.math3d import RotationForm, is_angular
from urmpipe_pipeline.joint_log import Basis, Inference, LogWarning, Role
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
    TURN,
    TWO_TURNS,
    KinematicUnits,
    count_wraps,
    peak,
    too_far_as_radians,
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

GIVEN = "given as an option"  # why a unit is that of the user
MAX_REACH = 10.0  # [m], of a coordinate; no arm reaches further
MIN_REACH = 0.02  # [m]; a tool that moves has a larger coordinate
MAX_SLIDES = 3  # joints of a gantry or a delta robot
COUNTS_PER_TURN = (1024, 4096, 16384, 65536)  # of the encoders of servos and motors
USUAL_COUNTS = 4096  # Dynamixel, Feetech
PER_CENT = 100.0  # of a joint's range, either way
PATH_WIDTHS = (3, 6, 7)  # columns of a path: x, y, z, and three angles or a quaternion

_ALLOWED: dict[JointKind | None, tuple[Quantity, ...]] = {
    "revolute": ("angle",),
    "prismatic": ("length",),
    None: ("angle", "length"),
}  # quantities of a joint, the likely one first
_ALL_OF = {"joint": "the joints are", "position": "the positions are", "rotation": "the orientation is"}


class StatedUnit(NamedTuple):
    """A unit that is stated.

    Attributes:
        unit: The unit.
        by: Who states it: the user, the column's name, the source, or the name in a file that urmpipe wrote.
        why: The same as text.
        is_confirmed: Whether the user gives what the name states, or the source that states it.
    """

    unit: Unit
    by: Literal["user", "name", "source", "urmpipe"]
    why: str
    is_confirmed: bool = False


@dataclass(frozen=True, slots=True)
class UnitSources:
    """What states the units of the columns of a log.

    Attributes:
        options: Units that the user gives, by the column's number; by 0 that of every angle.
        source: The source, if it is known.
        file: The file, for errors.
        is_source_given: Whether the user gave the source.
    """

    options: Mapping[int, Unit]
    source: KnownSource | None
    file: str
    is_source_given: bool = False

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
        if stated.by == "user":
            raise OptionError(Finding(message, column=column.name, parameter="unit"))
        raise LogError(Finding(message, self.file, column=column.header))

    def _find_first(self, column: Column, allowed: Sequence[Quantity]) -> StatedUnit | None:
        if column.number in self.options:
            unit = self.options[column.number]
            return StatedUnit(unit, "user", GIVEN, is_confirmed=unit == column.unit)
        every = self.options.get(0) if "angle" in allowed else None
        by_name = self.find_of_column(column, allowed[0]) if every is None else column.unit
        if by_name is not None and by_name.quantity != "time" and by_name != every:
            by_urmpipe = self.source is not None and self.source.own
            return StatedUnit(by_name, "urmpipe" if by_urmpipe else "name", "its name")
        if every is not None:
            return StatedUnit(every, "user", GIVEN, is_confirmed=by_name == every)
        default = self.source.units.get(allowed[0]) if self.source else None
        if self.source is None or default is None:
            return None
        why = f"{self.source.name} writes {default.name}"
        return StatedUnit(default, "source", why, is_confirmed=self.is_source_given)

    def find_of_column(self, column: Column, likely: Quantity = "angle") -> Unit | None:
        """Return the unit that the user or the name gives this very column.

        Raises:
            LogError: If it is not known.
        """
        if column.number in self.options:
            return self.options[column.number]
        if column.unit_text and column.unit is None:
            message = f"found the unit {format_value(column.unit_text)}, allowed: rad, deg, turn/N, m, mm, cm"
            hints = unit_hints([column], "mm" if likely == "length" else "deg", "keeps the values unchanged")
            raise LogError(
                Finding(f"{message}; convert the values", self.file, column=column.header, hints=hints)
            )
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
    unit: Unit, values: FloatArray, t_ns: IntArray | None, turns: float = ONE_TURN
) -> Objection | None:
    """Return the objection to a unit of joint values, None if they may be in it.

    Wraps of the other unit contradict it, in all columns except those that can only be in this one; so does a
    speed, if the values are of more than two turns: of smaller ones the clock may be wrong.

    Args:
        unit: rad, deg or turn/N, whose size alone is compared.
        values: In the file's own units, shape (n, columns).
        t_ns: Times in [ns], shape (n,), or None.
        turns: Size in [rad] from which values in rad are unlikely; two turns in counts.
    """
    columns, size = list(enumerate(values.T)), usual_peak(values)
    if unit.name == "deg":
        if wraps := wraps_as_radians(values):
            return Objection(wraps, tuple(j for j, column in columns if peak(column) <= TWO_TURNS))
        is_small = size <= TWO_TURNS and peak(values) > 0
        if not is_small or wraps_as_degrees(values) or too_fast_as_radians(values, t_ns):
            return None
        return Objection(f"values of no more than {peak(values):.6g} may be rad as well")
    why, turns = None, TWO_TURNS if unit.name != "rad" else turns
    if unit.name == "rad":
        why = wraps_as_degrees(values) or (too_fast_as_radians(values, t_ns) if size > TWO_TURNS else None)
    if why:
        return Objection(why, tuple(j for j, x in columns if not wraps_as_radians(x[:, np.newaxis])))
    if size * unit.factor <= turns or wraps_as_radians(values):
        return None
    limit = "a turn" if turns == ONE_TURN else "two turns"
    return Objection(f"values of {size:.6g} are more than {limit} as {unit.name}")


def _are_unnamed(columns: Sequence[Column]) -> bool:
    return all(column.header.isdigit() for column in columns)


def _list_names(columns: Sequence[Column]) -> str:
    return ", ".join(column.name for column in columns)


def _find_common(units: Sequence[Unit | None], quantity: Quantity) -> Unit | None:
    """Return the unit that all columns of a quantity have; None if they have several, or none."""
    common = {unit for unit in units if unit is not None and unit.quantity == quantity}
    return common.pop() if len(common) == 1 else None


class _Joints(NamedTuple):
    """Joint columns, their stated units, values, shape (n, columns), and recorded times in [ns] or None."""

    columns: Sequence[Column]
    stated: Sequence[StatedUnit | None]
    values: FloatArray
    t_ns: IntArray | None

    def select(self, places: Sequence[int]) -> _Joints:
        """Return some of them, without a copy if they are all."""
        if len(places) == len(self.columns):
            return self
        columns, stated = [self.columns[j] for j in places], [self.stated[j] for j in places]
        return _Joints(columns, stated, self.values[:, places], self.t_ns)


@dataclass(slots=True)
class UnitFinder:
    """Settles the units of the columns of one log, and keeps the evidence.

    Attributes:
        sources: What states units.
        kinematic: The units that the kinematics prove, if they do.
        warnings: Units that are assumed or uncertain, contradictions, rows without an orientation.
        noted: Inferences about the orientation and a planar position.
        uncertainties: Why the unit of a column is only assumed, by its number.
        uses_source: Whether the source stated a unit.
    """

    sources: UnitSources
    kinematic: KinematicUnits | None = None
    warnings: list[LogWarning] = field(default_factory=list)
    noted: list[Inference] = field(default_factory=list)
    uncertainties: dict[int, str] = field(default_factory=dict)
    uses_source: bool = False
    _notes: dict[tuple[str, str, Basis], list[Column]] = field(default_factory=dict)
    _counts: dict[Role, int] = field(default_factory=dict)

    @property
    def inferences(self) -> list[Inference]:
        """The units, columns of one unit and evidence together, and the others."""
        inferences = []
        for (unit, why, basis), columns in self._notes.items():
            every = all(c.unit is None and c.number not in self.sources.options for c in columns)
            inferences.append(unit_inference(columns, unit, why, basis, every=every))
        return [*inferences, *self.noted]

    def settle_joints(
        self, columns: Sequence[Column], values: FloatArray, t_ns: IntArray | None, robot: Chain | None
    ) -> list[Unit]:
        """Return the units of the joint columns.

        Args:
            columns: The columns.
            values: In the file's own units, shape (n, joints).
            t_ns: Recorded times in [ns], shape (n,), or None.
            robot: The arm, or None.

        Raises:
            LogError: If a unit is not known, does not fit robot or values, or is to be asked.
            OptionError: If one that the user gave does not fit the robot.
        """
        stated, proved = self.sources.of_joints(columns, robot), (False,) * len(columns)
        joints, self._counts["joint"] = _Joints(columns, stated, values, t_ns), len(columns)
        if self.kinematic is not None:
            units, proved = self._overrule(columns, stated, "angle"), self.kinematic.proved
        else:
            units = self._complete_joints(joints, robot)
        groups: dict[tuple[bool, Unit], list[int]] = {}
        for j, item in enumerate(stated):
            if item is not None and item.by != "urmpipe" and units[j].quantity == "angle":
                groups.setdefault((item.by == "user", units[j]), []).append(j)
        for (by_user, unit), group in groups.items():
            if unproved := [j for j in group if not proved[j]]:
                is_open = len(unproved) == len(group) and (by_user or 0 not in self.sources.options)
                self._compare_stated(joints.select(unproved), unit, is_open=is_open)
        self.warn_not_reached(columns, stated, units, "joint")
        return units

    def _compare_stated(self, joints: _Joints, unit: Unit, *, is_open: bool) -> None:
        """Compare a stated unit with the values: ask if they contradict it, warn if they are unlikely."""
        columns, by = joints.columns, [item for item in joints.stated if item]
        by_user = all(item.by == "user" for item in by)
        objection = find_objection(unit, joints.values, joints.t_ns, TWO_TURNS if by_user else ONE_TURN)
        if objection is None:
            return
        if objection.columns and not by_user:
            contradicting = [columns[j] for j in objection.columns]
            message = (
                f"found {_list_names(contradicting)} in {unit.name} by name or source, but {objection.why}"
            )
            hints = which_unit(contradicting, unit.name, every=all(item.by == "source" for item in by))
            allowed = "a unit that fits the data"
            raise LogError(Finding(f"{message}, allowed: {allowed}", self.sources.file, hints=hints))
        if objection.columns or (is_open and not all(item.is_confirmed for item in by)):
            self.warn_uncertain(columns, by, unit.name, objection.why, "joint")

    def settle_rates(self, columns: Sequence[Column], joints: Sequence[Unit], order: int) -> list[Unit]:
        """Return the units of recorded rates (order 1) or accelerations (2): the joints' own by default."""
        units = []
        for column, joint in zip(columns, joints, strict=False):
            stated = self.sources.find_of_column(column)
            unit = stated if stated is not None and stated.quantity == joint.quantity else joint
            units.append(unit if unit.order else unit.per_second(order))
        return units

    def settle_positions(self, columns: Sequence[Column], values: FloatArray) -> list[Unit]:
        """Return the units of recorded x, y, z, whose values are in the file's own units, shape (n, 3)."""
        stated, self._counts["position"] = self.sources.of_lengths(columns), len(columns)
        if self.kinematic is not None:
            return self._overrule(columns, stated, "length")
        self._note_stated(columns, stated)
        known, size = [item.unit if item else None for item in stated], usual_peak(values)
        unstated = [column for column, item in zip(columns, stated, strict=True) if item is None]
        default = _find_common(known, "length")
        if unstated and default is not None:
            self._note(unstated, default, "named", "as the other position columns")
        elif unstated:
            default = self._assume_length(unstated, size, "position")
        units = [unit or default or vocabulary().units["m"] for unit in known]
        by = {item for item in stated if item and item.by != "urmpipe" and not item.is_confirmed}
        reach = size * units[0].factor if units else 0.0
        if by and len(set(units)) == 1 and (reach > MAX_REACH or 0 < reach < MIN_REACH):
            is_far = reach > MAX_REACH
            why = "reach further than any arm" if is_far else "are closer to the origin than any arm works"
            why = f"values of {size:.6g} {why}"
            self.warn_uncertain(columns, by, units[0].name, why, "position")
        return units

    def _overrule(
        self, columns: Sequence[Column], stated: Sequence[StatedUnit | None], quantity: Quantity
    ) -> list[Unit]:
        """Return the units that the kinematics prove, except those that the user gave."""
        assert self.kinematic is not None
        proved, contradicted = self.kinematic.of(quantity), dict[StatedUnit, list[int]]()
        role: Role = "joint" if quantity == "angle" else "position"
        for j, item in enumerate(stated):
            if item is None:
                self._note([columns[j]], proved[j], "proved", self.kinematic.format_evidence(quantity))
            elif item.unit == proved[j]:
                self._note_stated([columns[j]], [item])
            else:
                contradicted.setdefault(item, []).append(j)
        units = list(proved)
        for item, places in contradicted.items():
            some, better, unit = [columns[j] for j in places], proved[places[0]], item.unit
            rival = tuple(unit if j in places else other for j, other in enumerate(proved))
            evidence = self.kinematic.format_evidence(quantity, rival)
            message = f"{_list_names(some)}: {unit.name} ({item.why}) contradicts the kinematics: taken as"
            if item.by == "user":
                units = [unit if j in places else other for j, other in enumerate(units)]
                self._note_stated(some, [item] * len(some))
                message = f"{message} {unit.name}, though as {better.name} it would fit: {evidence}"
                warning = LogWarning(
                    UNIT_CONTRADICTION, message, hints=unit_hints(some, better.name), role=role
                )
                warning = replace(warning, assumption=f"{self._subject(some, role)} in {unit.name}")
            else:
                self._note(some, better, "proved", evidence)
                message, hints = f"{message} {better.name}: {evidence}", unit_hints(some, unit.name)
                warning = LogWarning(UNIT_CONTRADICTION, message, hints=hints)
            self.warnings.append(warning)
        return units

    def _complete_joints(self, joints: _Joints, robot: Chain | None) -> list[Unit]:
        """Return the stated units of joints, and without the kinematics those of the others."""
        self._note_stated(joints.columns, joints.stated)
        units = {j: item.unit for j, item in enumerate(joints.stated) if item}
        unknown = [j for j in range(len(joints.columns)) if j not in units]
        slides = [j for j in unknown if robot and robot.moving[j].kind == "prismatic"]
        turns = [j for j in unknown if j not in slides]
        if slides:
            sliding = joints.select(slides)
            size = usual_peak(sliding.values)
            unit = self._assume_length(sliding.columns, size, "joint")
            units |= dict.fromkeys(slides, unit)
        if turns:
            turning, angle = joints.select(turns), _find_common(list(units.values()), "angle")
            if angle is not None:
                self._note(turning.columns, angle, "named", "as the other joint columns")
            else:
                angle = self._settle_angles(turning, may_slide=robot is None and not any(joints.stated))
            units |= dict.fromkeys(turns, angle)
        return [units[j] for j in range(len(joints.columns))]

    def _assume_length(self, columns: Sequence[Column], size: float, role: Role) -> Unit:
        """Return m, or mm beyond any arm."""
        is_far = size > MAX_REACH
        unit = vocabulary().units["mm" if is_far else "m"]
        hints = unit_hints(columns if role == "joint" else columns[:1], OTHER_UNIT[unit.name])
        hints = which_unit(columns, "m", every=False) if is_far else hints
        why = f", as values of {size:.6g} are beyond any arm in m" if is_far else ""
        self._assume(columns, unit, role, hints, why)
        return unit

    def _settle_angles(self, joints: _Joints, *, may_slide: bool) -> Unit:
        """Return the unit of joints that nothing states: proved by wraps, or assumed.

        Raises:
            LogError: If it is to be asked.
        """
        columns, values, largest = joints.columns, joints.values, peak(joints.values)
        rad, deg = (vocabulary().units[name] for name in ("rad", "deg"))
        each = [(column, x[:, np.newaxis]) for column, x in zip(columns, values.T, strict=True)]
        for unit, proof in ((deg, wraps_as_degrees(values)), (rad, wraps_as_radians(values))):
            if not proof:
                continue
            still: list[Column] = []  # columns that show neither; of those in rad the number is the same in m
            if may_slide and unit == deg:
                still = [column for column, x in each if peak(x) > 0 and not count_wraps(x, "deg").any()]
            elif may_slide and (large := [column for column, x in each if usual_peak(x) > TWO_TURNS]):
                raise LogError(self._ask_angle(large, values, large))
            self._note([column for column in columns if column not in still], unit, "proved", proof)
            if still:
                hints = (Hint("unit", {"": "deg"}, "confirms it"), *unit_hints(still, "mm", "if they slide"))
                self._assume(still, deg, "joint", hints, f", as the others have {proof}")
            return unit
        large = [column for column, x in each if peak(x) > ONE_TURN]
        if may_slide and len(columns) > 2 and len(large) == 1 and largest > 2 * TWO_TURNS:
            raise LogError(self._ask_angle(large, values, large))
        fast = too_fast_as_radians(values, joints.t_ns) if largest <= MAX_DEGREES else None
        may_be_path = _are_unnamed(columns) and len(columns) in PATH_WIDTHS
        may_be_share = largest <= PER_CENT and any(
            pattern.search(column.bare) for column in columns for pattern in vocabulary().per_cent
        )
        far = None if may_be_path or may_be_share else too_far_as_radians(values)
        if not (fast or far) and usual_peak(values) > TWO_TURNS:
            all_slide = may_slide and len(columns) == MAX_SLIDES
            sliding = columns if all_slide else () if may_slide else None
            raise LogError(self._ask_angle(columns, values, sliding))
        unit, why = (deg, f": {fast or far}") if fast or far else (rad, "")
        hints = (Hint("unit", {"": OTHER_UNIT[unit.name]}, "overrides this"),)
        self._assume(columns, unit, "joint", hints, why)
        return unit

    def _ask_angle(
        self, columns: Sequence[Column], values: FloatArray, sliding: Sequence[Column] | None
    ) -> Finding:
        """Return the question whether joints are in rad, deg, counts, or some in mm; None if none slide."""
        largest, are_whole = peak(values), bool((np.isnan(values) | (values == np.rint(values))).all())
        finer = [n for n in COUNTS_PER_TURN if largest < n] if are_whole and largest > TURN["deg"] else []
        counts = dict.fromkeys((*finer[:1], USUAL_COUNTS)) if finer else ()
        message = f"found values up to {largest:.6g} in {_list_names(columns)} and no unit"
        choices = [{"": "rad"}, {"": "deg"}, *({"": f"turn/{n}"} for n in counts)]
        far = [column for column, x in zip(columns, values.T, strict=False) if peak(x) > np.degrees(ONE_TURN)]
        if sliding is not None and not counts and 0 < len(far) < len(columns) == values.shape[1]:
            choices.append({"": "deg"} | {column.called: "mm" for column in far})
        choices += [{"": "rad"} | {column.called: "mm" for column in sliding}] if sliding else []
        hints = [Hint("unit", choice, "specifies it") for choice in choices]
        if _are_unnamed(columns):
            if sliding is not None and len(columns) in PATH_WIDTHS:
                hints.append(Hint("source", "path", "reads x, y, z, and an orientation after them"))
            hints.append(NAME_JOINTS)
        allowed = (
            "rad, deg or turn/N with N counts a turn" if counts or largest > MAX_DEGREES else "rad or deg"
        )
        message += f", allowed: {allowed}{', or mm where they slide' if sliding else ''}"
        return Finding(message, self.sources.file, hints=tuple(hints))

    def warn_not_reached(
        self,
        columns: Sequence[Column],
        stated: Sequence[StatedUnit | None],
        units: Sequence[Unit],
        role: Role,
    ) -> None:
        """Warn of angles of a role whose names state another unit than the user gives for every angle."""
        every, groups = self.sources.options.get(0), dict[str, list[Column]]()
        for column, item, unit in zip(columns, stated, units, strict=True):
            if every and item and item.by != "user" and unit.quantity == "angle" and unit != every:
                groups.setdefault(unit.name, []).append(column)
        for name, some in groups.items():
            assert every is not None
            message = f"{_list_names(some)}: {every.name} does not reach them: their names say {name}"
            hints = unit_hints(some, every.name, "does")
            assumption = f"{self._subject(some, role)} in {name}"
            warning = LogWarning(UNIT_NOT_REACHED, message, hints=hints, assumption=assumption, role=role)
            self.warn(some, warning)

    def _note_stated(self, columns: Sequence[Column], stated: Sequence[StatedUnit | None]) -> None:
        for column, item in zip(columns, stated, strict=True):
            if item is not None:
                basis: Basis = "given" if item.by == "user" else "named"
                self._note([column], item.unit, basis, item.why)
                self.uses_source |= item.by == "source"

    def _note(self, columns: Sequence[Column], unit: Unit, basis: Basis, why: str) -> None:
        self._notes.setdefault((unit.name, why, basis), []).extend(columns)

    def warn_uncertain(
        self,
        columns: Sequence[Column],
        stated: Collection[StatedUnit],
        unit: str,
        why: str,
        role: Role,
        *,
        is_excluded: bool = False,
    ) -> None:
        """Warn why columns of a role, or all of them, may not be in their unit, which is used.

        No verdict rests on a unit that the values exclude, unless the user gave it.
        """
        evidence = " and ".join(sorted({item.why for item in stated}))
        message, by_user = f"{_list_names(columns)}: {unit} ({evidence})", all(s.by == "user" for s in stated)
        every = role == "joint" and all(item.by == "source" for item in stated)
        hints = which_unit(columns, unit, every=every)[: -1 if by_user else None]
        message += f" is used, though {why}" if by_user else f" is doubted: {why}"
        assumption = f"{self._subject(columns, role)} in {unit}"
        blocks = is_excluded and not by_user
        warning = LogWarning(
            DOUBTED_UNIT, message, hints=hints, assumption=assumption, role=role, blocks_verdict=blocks
        )
        self.warn(columns, warning, by_user=by_user)

    def warn(self, columns: Sequence[Column], warning: LogWarning, *, by_user: bool = False) -> None:
        """Keep a warning: unless the user gave the unit, it is only assumed."""
        self.warnings.append(warning)
        if not by_user:
            self.uncertainties |= {column.number: warning.message for column in columns}

    def _assume(
        self,
        columns: Sequence[Column],
        unit: Unit,
        role: Role,
        hints: Sequence[Hint],
        why: str = "",
    ) -> None:
        """Warn that columns are taken to be in a unit that nothing states or proves."""
        self._note(columns, unit, "assumed", "assumed")
        subject = self._subject(columns, role)
        names = f" for {_list_names(columns)}" if subject == _ALL_OF[role] else ""
        message = f"no unit is given{names}: {subject} taken as {unit.name}{why}"
        warning = LogWarning(ASSUMED_UNIT, message, hints=tuple(hints), role=role)
        self.warn(columns, replace(warning, assumption=f"{subject} in {unit.name}"))

    def _subject(self, columns: Sequence[Column], role: Role) -> str:
        """Return the beginning of a sentence about columns: the joints are, or q1 is."""
        if len(columns) == self._counts.get(role, len(columns)):
            return _ALL_OF[role]
        return f"{_list_names(columns)} {'are' if len(columns) > 1 else 'is'}"
