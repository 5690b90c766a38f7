"""The map of a log: its columns, and how each is known. Its fields are options, keywords and keys of TOML.

- `LogMap`: the map, as given or as it was found.
- `read_options`: the fields among named values, such as those of a command.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
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
ROWS = "rows from 1, both ends included, such as 2:-1 or 1:99,101:-1; -1 is the last"
INTERVALS = "two ends for all revolute joints, or ends by joint, such as q1=-180:180"

GivenInterval: TypeAlias = tuple[float | str, float | str]
"""LOW and HIGH of a joint: numbers in the file's own unit, or both angles as texts with units."""


class Evidence(NamedTuple):
    """How an entry of a map is known, and why."""

    basis: Basis
    why: str


@dataclass(frozen=True)
class LogMap:
    """The columns of a log, as the user gives them or as they were found.

    Attributes:
        source: Name of the source, as `source_names` lists them.
        delimiter: Sign between cells, or comma, semicolon, tab, spaces, bar.
        decimal: Decimal sign, or point, comma.
        layout: What a row of the table is: "table" a sample, "transposed" a joint; of a flat array, sample by
            sample or joint by joint, "flat:N" or "flat-by-joint:N" with N numbers a sample.
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
            orientation) of which neither its own name nor the kinematics tell one.
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
            its own, and behind them of its orientation, if it was.
        shared: Whether they apply to several logs: columns and joints that a log lacks belong to another.
        pair: Of a comparison of two sides of a table, the word of this side, or "rest", and of the other.
        robot: Name or file of the arm, or None.
        base: Frame of the arm: X, Y, Z[, RX, RY, RZ] in [m] and [rad], or empty.
        tool: Tool centre point in the same form, or empty.
        evidence: How the entries are known: by field, the unit of a column by "unit.COLUMN".
        notes: Properties of the file that are no entries, each with its value and reason.
        questions: The entries that are open, with their choices as hints.
    """

    source: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    layout: str | None = None
    sheet: str | None = None
    topic: str | None = None
    episode: str | None = None
    rows: str | None = None
    time: str | None = None
    joints: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    signs: tuple[int, ...] = ()
    offsets: tuple[float, ...] = ()
    position: tuple[str, ...] = ()
    orientation: tuple[str, ...] = ()
    rotation: RotationForm | None = None
    unit: Mapping[str, str] = field(default_factory=dict)
    period: float | None = None
    skip_bad: bool = False
    interval: Mapping[str, GivenInterval] = field(default_factory=dict)
    repair: bool = False
    side: str | None = None
    poses: bool = False
    measured: tuple[str, ...] = ()
    shared: bool = False
    pair: tuple[str, str] | None = None
    robot: str | None = None
    base: tuple[float, ...] = ()
    tool: tuple[float, ...] = ()
    evidence: Mapping[str, Evidence] = field(default_factory=dict, compare=False, repr=False)
    notes: tuple[str, ...] = field(default=(), compare=False, repr=False)
    questions: tuple[Finding, ...] = field(default=(), compare=False, repr=False)

    def __post_init__(self) -> None:
        """Take lists as tuples and numbers of columns as text; refuse what is of a wrong kind.

        Raises:
            OptionError: With everything that is of a wrong kind.
        """
        for one in fields(self):
            if isinstance(value := getattr(self, one.name), Iterator):  # can be looked through only once
                object.__setattr__(self, one.name, tuple(value))
        for name in ("unit", "interval"):
            object.__setattr__(self, name, _for_all(getattr(self, name)))
        wrong = [
            Finding(parameter=one.name, found=format_value(value), allowed=allowed)
            for one in fields(self)
            if one.name in _KINDS
            for value, (fits, allowed) in [(getattr(self, one.name), _KINDS[one.name])]
            if not ((value is None and one.default is None) or fits(value))
        ]
        if wrong:
            raise OptionError(*wrong)
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


def _is_word(value: Any) -> bool:
    return isinstance(value, str) and value != ""


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _is_column(value: Any) -> bool:
    return isinstance(value, str) or _is_number(value)


def _are(fits: Callable[[Any], bool]) -> Callable[[Any], bool]:
    """Return what tells whether a value is a list of such; a text and a table are none."""

    def fit(value: Any) -> bool:
        alone = isinstance(value, (str, Mapping)) or hasattr(value, "columns")
        return not alone and isinstance(value, Iterable) and all(map(fits, value))

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


def _is_rows(value: Any) -> bool:
    return isinstance(value, str) and re.fullmatch(_ROWS, value) is not None


def _is_layout(value: Any) -> bool:
    return isinstance(value, str) and re.fullmatch(_LAYOUTS, value) is not None


_ROWS = r"(-?[1-9]\d*)?:(-?[1-9]\d*)?(,(-?[1-9]\d*)?:(-?[1-9]\d*)?)*"
_LAYOUTS = r"table|transposed|flat(-by-joint)?:[1-9]\d*"
_WORDS = re.compile(r"[^\W_]")
_TEXT = (_is_word, "a non-empty text")
_COLUMNS = (_are(_is_column), COLUMNS)
_FRAME = (
    lambda value: _are(_is_number)(value) and len(value) in (0, 3, 6),
    "X, Y, Z or X, Y, Z, RX, RY, RZ in m and rad",
)
_FLAG = (lambda value: isinstance(value, bool), "True or False")

_KINDS: Mapping[str, tuple[Callable[[Any], bool], str]] = {
    "source": _TEXT,
    "delimiter": _TEXT,
    "decimal": _TEXT,
    "layout": (_is_layout, "table, transposed, flat:N or flat-by-joint:N, with N numbers a sample"),
    "sheet": (_is_name, "a sheet by name or number"),
    "topic": _TEXT,
    "episode": (_is_name, EPISODES),
    "rows": (_is_rows, ROWS),
    "time": (_is_name, "a column by name or number, or FILE:COLUMN"),
    "joints": _COLUMNS,
    "names": (_are(_is_column), "a list of names, such as ['q1', 'q2']"),
    "signs": (_are(_is_number), "a list of 1 or -1, such as [1, -1]"),
    "offsets": (_are(_is_number), "a list of numbers, such as [0.0, 90.0]"),
    "position": _COLUMNS,
    "orientation": _COLUMNS,
    "rotation": (lambda value: isinstance(value, str) and value in FORMS, ", ".join(FORMS)),
    "unit": (_are_named(_is_word), UNITS),
    "period": (_is_number, "a number, in s"),
    "skip_bad": _FLAG,
    "interval": (_are_named(is_interval), INTERVALS),
    "repair": _FLAG,
    "shared": _FLAG,
    "side": (lambda value: _is_word(value) and _WORDS.search(value) is not None, SIDE),
    "pair": (lambda value: _are(_is_word)(value) and len(value) == 2, "two words"),
    "poses": _FLAG,
    "measured": _COLUMNS,
    "robot": _TEXT,
    "base": _FRAME,
    "tool": _FRAME,
}
"""What each field takes, and what to say of anything else."""


READING = tuple(name for name in _KINDS if name not in ("robot", "base", "tool"))
"""The fields that say how a log is read, without its arm."""


def _for_all(value: Any) -> Any:
    """Return a value that is given for all joints that turn as a mapping; what is one already as it is."""
    return {"": value} if isinstance(value, (str, list, tuple)) and value else value


def read_options(values: Mapping[str, Any], otherwise: LogMap | None = None) -> LogMap:
    """Return the map that some named values give; None means not given.

    Args:
        values: Options by name, others among them.
        otherwise: What holds where nothing is given, such as that of a map. Units of single columns and
            intervals of single joints add up; joints given anew leave behind what belonged to the others:
            names, signs, offsets and intervals.
    """
    base = otherwise or LogMap()
    given = {name: value for name, value in values.items() if name in READING and value is not None}
    given |= {name: _for_all(given[name]) for name in ("unit", "interval") if name in given}
    if isinstance(given.get("unit", {}), Mapping):
        given["unit"] = {**base.unit, **given.get("unit", {})}
    if "joints" in given:
        given = {"names": (), "signs": (), "offsets": (), "interval": {}, **given}
    elif isinstance(given.get("interval"), Mapping) and "" not in given["interval"]:
        given["interval"] = {**base.interval, **given["interval"]}
    return replace(base, **given)
