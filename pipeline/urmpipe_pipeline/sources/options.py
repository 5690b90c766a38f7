"""What the user says about a log."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from urmpipe_models.errors import OptionError
from urmpipe_models.orientation import RotationForm

COLUMNS = "columns by name or number, such as ['q1', 'q2'] or [2, 3]"
UNITS = "a mapping, such as {'q1': 'deg'}, or {'': 'deg'} for all joints that turn"
INTERVALS = "a mapping, such as {'q1': (-180.0, 180.0)}, or with '' for all joints that turn"


@dataclass(frozen=True)
class ReadOptions:
    """What the user says about a log where the file need not, or cannot, tell.

    Attributes:
        source: Name of the source, as `source_names` lists them.
        delimiter: Sign between cells, or comma, semicolon, tab, spaces, bar.
        decimal: Decimal sign, or point, comma.
        time: Name or number (from 1) of the time column; "none" if there is none.
        joints: Names or numbers (from 1) of the joint columns, in the robot's order.
        names: What to call the joints, in the same order; by default as their columns.
        signs: 1 or -1 for each joint: -1 where the file counts against the robot's axis.
        offsets: Added to each joint after its sign, in the unit of its column.
        position: Names or numbers of the recorded x, y, z.
        orientation: Names or numbers of the columns of the recorded orientation, in the order of its form.
        rotation: Form of the recorded orientation, as `RotationForm` lists them.
        units: Unit of a column by its name or number; by "" that of all joint columns that turn.
        period: Time between rows in [s], of a log without a time column.
        skip_bad: Leave out rows that cannot be read, up to one in a hundred; each is a warning.
        interval: LOW, HIGH of the interval to which the environment limits a joint, by its name; by "" that
            of all joints that turn; in the file's own unit.
        repair: Whether samples that a linear resampling left on a wrap are put on the line through their
            neighbours.
    """

    source: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    time: str | None = None
    joints: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    signs: tuple[int, ...] = ()
    offsets: tuple[float, ...] = ()
    position: tuple[str, ...] = ()
    orientation: tuple[str, ...] = ()
    rotation: RotationForm | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    period: float | None = None
    skip_bad: bool = False
    interval: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    repair: bool = False

    def __post_init__(self) -> None:
        """Take numbers of columns as text; refuse what is no list of names or no mapping.

        Raises:
            OptionError: With everything that is of a wrong kind.
        """
        wrong = []
        for name in ("joints", "names", "position", "orientation"):
            value = getattr(self, name)
            if isinstance(value, str) or not isinstance(value, Iterable):
                wrong.append(f"{name}: found {value!r}, allowed: {COLUMNS}")
            else:
                object.__setattr__(self, name, tuple(map(str, value)))
        for name, allowed in (("units", UNITS), ("interval", INTERVALS)):
            if not isinstance(getattr(self, name), Mapping):
                wrong.append(f"{name}: found {getattr(self, name)!r}, allowed: {allowed}")
        if wrong:
            raise OptionError(*wrong)
        object.__setattr__(self, "time", None if self.time is None else str(self.time))
        object.__setattr__(self, "units", {str(column): unit for column, unit in self.units.items()})


def read_options(values: Mapping[str, Any], otherwise: ReadOptions | None = None) -> ReadOptions:
    """Return the reading options among some named values; None means not given.

    Args:
        values: Options by name, others among them.
        otherwise: What holds where nothing is given, such as that of a map. Units of single columns and
            intervals of single joints add up; joints given anew leave behind what belonged to the others:
            names, signs, offsets and intervals.
    """
    base = otherwise or ReadOptions()
    known = {field.name for field in fields(ReadOptions)}
    given = {name: value for name, value in values.items() if name in known and value is not None}
    given["units"] = {**base.units, **given.get("units", {})}
    if "joints" in given:
        given = {"names": (), "signs": (), "offsets": (), "interval": {}, **given}
    elif "" not in given.get("interval", {"": None}):
        given["interval"] = {**base.interval, **given["interval"]}
    return replace(base, **given)
