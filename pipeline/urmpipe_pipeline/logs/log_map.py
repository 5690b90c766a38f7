"""The map of a log: its columns, and how each is known. Its fields are options, keywords and keys of TOML.

- `LogMap`: the map, as given or as it was found.
- `read_options`: the fields among named values, such as those of a command.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from numbers import Real
from typing import Any, NamedTuple, TypeAlias

from urmpipe_models.errors import Finding, OptionError, format_value
from urmpipe_models.math3d import FORMS, RotationForm
from urmpipe_models.measure_units import compatible_units, quantity_to_si
from urmpipe_pipeline.joint_log import Basis

COLUMNS = "columns by name or number, such as q1,q2 or 2,3"
UNITS = "a unit of every angle, such as deg, or units by column, such as q1=deg"
SIDE = "a word in the names of columns, such as actual, or several, such as arm2_solved"
EPISODES = "an episode by number or name, or COLUMN=VALUE"
LAYOUTS = "table, transposed, long, flat:N or flat-by-joint:N, with N numbers a sample"
ROWS = "rows from 1, both ends included, such as 2:-1 or 1:99,101:-1; -1 is the last"
INTERVALS = "two ends for all revolute joints, or ends by joint, such as q1=-180:180"

GivenInterval: TypeAlias = tuple[float | str, float | str]
"""LOW and HIGH of a joint: numbers in the file's own unit, or both angles as texts with units."""


class Evidence(NamedTuple):
    """How an entry of a map is known, and why."""

    basis: Basis
    why: str


def _is_word(value: Any) -> bool:
    return isinstance(value, str) and value != ""


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _is_column(value: Any) -> bool:
    return isinstance(value, str) or _is_number(value)


def _are(fits: Callable[[Any], bool]) -> Callable[[Any], bool]:
    """Return a test for lists of such values; a text and a table are not."""

    def fit(value: Any) -> bool:
        is_single = isinstance(value, (str, Mapping)) or hasattr(value, "columns")
        return not is_single and isinstance(value, Iterable) and all(map(fits, value))

    return fit


def _are_named(fits: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, Mapping) and all(map(fits, value.values()))


def is_interval(value: Any) -> bool:
    """Return whether a value is two ends: numbers in the file's own unit, or angles with units."""
    angle = compatible_units("rad")
    kinds = (_is_number, lambda end: isinstance(end, str) and math.isfinite(quantity_to_si(end, angle)))
    return any(_are(fits)(value) for fits in kinds) and len(value) == 2


def _is_name(value: Any) -> bool:
    return _is_column(value) and value != ""


def _is_text_of(pattern: str) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, str) and re.fullmatch(pattern, value) is not None


def _entry(fits: Callable[[Any], bool], allowed: str, default: Any = None) -> Any:
    """Return a field of the map with its test, and the text of what it takes."""
    metadata = {"fits": fits, "allowed": allowed}
    if default == {}:
        return field(default_factory=dict, metadata=metadata)
    return field(default=default, metadata=metadata)


_ROWS = r"(-?[1-9]\d*)?:(-?[1-9]\d*)?(,(-?[1-9]\d*)?:(-?[1-9]\d*)?)*"
_LAYOUTS = r"table|transposed|long|flat(-by-joint)?:[1-9]\d*"
_SIDES = r"(?s).*[^\W_].*"
_TEXT = (_is_word, "a non-empty text")
_NAME = "a column by name or number, or FILE:COLUMN"
_COLUMNS = (_are(_is_column), COLUMNS)
_FRAME = (
    lambda value: _are(_is_number)(value) and len(value) in (0, 3, 6),
    "X, Y, Z or X, Y, Z, RX, RY, RZ in m and rad",
)
_FLAG = (lambda value: isinstance(value, bool), "True or False")
_PAIR = (lambda value: _are(_is_word)(value) and len(value) == 2, "two words")
_FORM = (_is_text_of("|".join(FORMS)), ", ".join(FORMS))


@dataclass(frozen=True)
class LogMap:
    """The columns of a log, as the user gives them or as they were found.

    Attributes:
        source: Name of the source, as `source_names` lists them.
        delimiter: Sign between cells, or comma, semicolon, tab, spaces, bar.
        decimal: Decimal sign, or point, comma.
        layout: What a row of the table is: "table" a sample, "transposed" a joint, "long" a joint in a
            sample; of a flat array, sample by sample or joint by joint, "flat:N" or "flat-by-joint:N" with N
            numbers a sample.
        sheet: Name or number (from 1) of the sheet of a workbook.
        topic: Name of the topic of a bag, or what the names of its columns begin with in a table of several.
        episode: The episode of a file of several: its number or name, or "COLUMN=VALUE".
        rows: Data rows to read, from 1, both ends included; negative ones count from the last, -1: "2:-1", or
            several such ranges, "1:99,101:-1".
        time: Name or number (from 1) of the time column; FILE:COLUMN of one in another file, with as many
            rows; "none" if there is none.
        joints: Names or numbers (from 1) of the joint columns, in the robot's order.
        names: What to call the joints, in the same order; by default as their columns.
        signs: 1 or -1 for each joint: -1 where the file counts against the robot's axis.
        offsets: Added to each joint after its sign, in the unit of its column.
        position: Names or numbers of the recorded x, y, z.
        orientation: Names or numbers of the columns of the recorded orientation, in the order of its form.
        rotation: Form of the recorded orientation, as `RotationForm` lists them.
        unit: Unit of a column by its name or number; by "" that of every angle (joints that turn, recorded
            orientation) of which neither its name nor the kinematics state one; turn/N of N counts.
        period: Time between rows in [s], of a log without a time column.
        skip_bad: Leave out rows that cannot be read, up to one in a hundred; each is a warning.
        interval: LOW, HIGH of the interval to which the environment limits a joint, by its name; by "" that
            of all joints that turn; in the file's own unit, or angles as texts with units.
        side: A word in the names of the columns to read, "actual" or "arm1", or several, "arm2_solved":
            columns with a word of another side are left out.
        repair: Whether samples that a linear resampling left on a wrap are put on the line through their
            neighbours.
        poses: Whether the rows are static poses, which no motion joins: a clock of theirs is a label.
        measured: Names or numbers of the x, y, z of the tool as it was measured from outside, in a frame of
            its own, and after them of its orientation, if it was.
        shared: Whether they apply to several logs: columns and joints that a log lacks belong to another.
        pair: Of a comparison of two sides of a table, the word of this side, or "rest", and of the other.
        robot: Name or file of the arm, or None.
        base: Frame of the arm: X, Y, Z[, RX, RY, RZ] in [m] and [rad], or empty.
        tool: Tool centre point in the same form, or empty.
        evidence: How the entries are known: by field, the unit of a column by "unit.COLUMN".
        notes: Properties of the file that are no entries, each with its value and reason.
        questions: The entries that are open, with their choices as hints.
    """

    source: str | None = _entry(*_TEXT)
    robot: str | None = _entry(*_TEXT)
    base: tuple[float, ...] = _entry(*_FRAME, ())
    tool: tuple[float, ...] = _entry(*_FRAME, ())
    delimiter: str | None = _entry(*_TEXT)
    decimal: str | None = _entry(*_TEXT)
    layout: str | None = _entry(_is_text_of(_LAYOUTS), LAYOUTS)
    sheet: str | None = _entry(_is_name, "a sheet by name or number")
    topic: str | None = _entry(*_TEXT)
    episode: str | None = _entry(_is_name, EPISODES)
    rows: str | None = _entry(_is_text_of(_ROWS), ROWS)
    side: str | None = _entry(_is_text_of(_SIDES), SIDE)
    time: str | None = _entry(_is_name, _NAME)
    period: float | None = _entry(_is_number, "a number, in s")
    poses: bool = _entry(*_FLAG, False)
    joints: tuple[str, ...] = _entry(*_COLUMNS, ())
    names: tuple[str, ...] = _entry(_are(_is_column), "a list of names, such as ['q1', 'q2']", ())
    signs: tuple[int, ...] = _entry(_are(_is_number), "a list of 1 or -1, such as [1, -1]", ())
    offsets: tuple[float, ...] = _entry(_are(_is_number), "a list of numbers, such as [0.0, 90.0]", ())
    position: tuple[str, ...] = _entry(*_COLUMNS, ())
    orientation: tuple[str, ...] = _entry(*_COLUMNS, ())
    rotation: RotationForm | None = _entry(*_FORM)  # noqa: RUF009 (a field)
    measured: tuple[str, ...] = _entry(*_COLUMNS, ())
    skip_bad: bool = _entry(*_FLAG, False)
    repair: bool = _entry(*_FLAG, False)
    unit: Mapping[str, str] = _entry(_are_named(_is_word), UNITS, {})
    interval: Mapping[str, GivenInterval] = _entry(_are_named(is_interval), INTERVALS, {})
    shared: bool = _entry(*_FLAG, False)
    pair: tuple[str, str] | None = _entry(*_PAIR)
    evidence: Mapping[str, Evidence] = field(default_factory=dict, compare=False, repr=False)
    notes: tuple[str, ...] = field(default=(), compare=False, repr=False)
    questions: tuple[Finding, ...] = field(default=(), compare=False, repr=False)

    def __post_init__(self) -> None:
        """Take lists as tuples and numbers of columns as text; refuse what is of a wrong kind.

        Raises:
            OptionError: With everything that is of a wrong kind.
        """
        for entry in fields(self):
            if isinstance(value := getattr(self, entry.name), Iterator):  # can be iterated only once
                object.__setattr__(self, entry.name, tuple(value))
        for name in ("unit", "interval"):
            object.__setattr__(self, name, _for_all(getattr(self, name)))
        errors = []
        for entry in fields(self):
            value, metadata = getattr(self, entry.name), entry.metadata
            if metadata and not ((value is None and entry.default is None) or metadata["fits"](value)):
                fault = format_value(value)
                errors.append(Finding(parameter=entry.name, found=fault, allowed=metadata["allowed"]))
        if errors:
            raise OptionError(*errors)
        for name in ("joints", "names", "position", "orientation", "measured"):
            object.__setattr__(self, name, tuple(map(str, getattr(self, name))))
        object.__setattr__(self, "signs", tuple(int(s) if s == int(s) else s for s in self.signs))
        for name in ("offsets", "base", "tool"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        for name in ("sheet", "episode", "time"):
            value = getattr(self, name)
            object.__setattr__(self, name, None if value is None else str(value))
        object.__setattr__(self, "unit", {str(column): unit for column, unit in self.unit.items()})
        intervals = {joint: (low, high) for joint, (low, high) in self.interval.items()}
        object.__setattr__(self, "interval", intervals)


KEYS = tuple(
    entry.name
    for entry in fields(LogMap)
    if entry.metadata and entry.default is not MISSING and entry.name not in ("shared", "pair")
)
"""The keys of a map before its tables, in the order in which it is written."""

TABLES = ("unit", "interval")
"""The tables of a map."""

READING = (*(key for key in KEYS if key not in ("robot", "base", "tool")), *TABLES, "shared", "pair")
"""The fields that state how a log is read, without its arm."""


def _for_all(value: Any) -> Any:
    """Return a value for all revolute joints as a mapping; a mapping as it is."""
    return {"": value} if isinstance(value, (str, list, tuple)) and value else value


def read_options(values: Mapping[str, Any], otherwise: LogMap | None = None) -> LogMap:
    """Return the map that some named values give; None means not given.

    Args:
        values: Options by name, others among them.
        otherwise: What holds where nothing is given, such as that of a map. Units of single columns and
            intervals of single joints add up; other joints drop what belonged to the former ones:
            names, signs, offsets and intervals.
    """
    base = otherwise or LogMap()
    stated = {name: value for name, value in values.items() if name in READING and value is not None}
    stated |= {name: _for_all(stated[name]) for name in ("unit", "interval") if name in stated}
    if isinstance(stated.get("unit", {}), Mapping):
        stated["unit"] = {**base.unit, **stated.get("unit", {})}
    if "joints" in stated:
        stated = {"names": (), "signs": (), "offsets": (), "interval": {}, **stated}
    elif isinstance(stated.get("interval"), Mapping) and "" not in stated["interval"]:
        stated["interval"] = {**base.interval, **stated["interval"]}
    return replace(base, **stated)
