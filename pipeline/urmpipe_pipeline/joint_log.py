"""What a source reader makes of a file: plain arrays in SI, with names and where they came from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from urmpipe_models.display import Displayable, format_count, format_headline
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, Message
from urmpipe_models.math3d import COLUMN_NAMES, RotationForm, to_quaternions
from urmpipe_models.wraps import unwrap_orientations, unwrap_quaternions

if TYPE_CHECKING:
    import pandas as pd

ROW_NS = 1_000_000_000
"""How much of `t_ns` a row without a time counts: `t` is then the number of the row from 0, and no time."""


URMPIPE_SOURCE = "urmpipe"
"""The source of a file that urmpipe wrote: a joint log of inverse kinematics, or a plan."""


SOLVED = "ik"
"""The source of a log that inverse kinematics made: a reader's name stands in others."""


NETWORK = "network"  # source of a log that is the motion of a network: its traced point is its kinematics

ASSUMED_PERIOD = "assumed-period"
"""The kind of the warning of a log whose rows have neither times nor a given period."""


PASSED_OVER = "columns-passed-over"
"""The kind of the warning about columns that were not read because others were: `--strict` accepts it."""


def ns_to_seconds(nanoseconds: IntArray) -> FloatArray:
    """Return integer `nanoseconds` as [s], each rounded once, of the same shape."""
    return np.true_divide(nanoseconds, 1e9, dtype=np.float64)


Role = Literal["time", "joint", "rate", "acceleration", "position", "rotation"]
ROLES: tuple[Role, ...] = get_args(Role)


@dataclass(frozen=True, slots=True)
class SourceFile:
    """An input file, so that a result can be traced to its bytes.

    Attributes:
        name: File name without folders.
        sha256: Hash of its bytes, in hex.
        size: Length in bytes.
    """

    name: str
    sha256: str
    size: int


@dataclass(frozen=True, slots=True)
class Inference:
    """One thing that a reader found out about a file by itself.

    Attributes:
        what: The subject, such as "delimiter", "time column", "unit of q1".
        value: What was found.
        evidence: Why.
        kind: A short word to find it by: "unit", "form"; by default its subject.
        columns: Names of the columns or joints that it is about, where it is not about the whole file.
        hints: What to give to have it otherwise.
    """

    what: str
    value: str
    evidence: str
    kind: str = ""
    columns: tuple[str, ...] = ()
    hints: tuple[Hint, ...] = ()

    def __post_init__(self) -> None:
        """Take the subject as the kind where none is given."""
        if not self.kind:
            object.__setattr__(self, "kind", self.what)

    def to_dict(self) -> dict[str, Any]:
        """Return its fields for JSON, and `otherwise`."""
        told = asdict(self)
        lists = {name: list(told[name]) for name in ("columns", "hints")}
        return told | lists | {"otherwise": self.otherwise()}

    def otherwise(self) -> str:
        """Return how to have it otherwise; empty where it cannot be."""
        return ", or ".join(f"{hint} {hint.does}".strip() for hint in self.hints)


@dataclass(frozen=True, slots=True)
class LogWarning(Message):
    """Something about a log that a person should know, and that did not stop the work.

    Attributes:
        kind: A short word to filter by, such as "missing", "gap", "assumed-unit".
        message: The sentence, in one line.
        row: Data row of the file from 1, where there is one.
        about: The log or block that it is about, to stand among others.
        column: Name of the column or joint that it is about.
        parameter: Keyword of the public function that it is about.
        found: What was found.
        allowed: What is allowed.
        hints: What to give to have it otherwise.
        assumption: What a verdict takes for granted that rests on it, as the end of "assuming ...": "the
            joints are in deg"; empty where there is none.
        role: What the columns hold that it is about: a verdict may rest on others.
        asks: Whether no verdict rests on it before it is answered.
    """

    kind: str
    message: str
    row: int | None = None
    about: str | None = None
    column: str | None = None
    parameter: str | None = None
    found: str | None = None
    allowed: str | None = None
    hints: tuple[Hint, ...] = ()
    assumption: str = ""
    role: Role | None = None
    asks: bool = False

    def of(self, name: str) -> LogWarning:
        """Return it as one about a log or a block of this name."""
        return replace(self, about=name)

    def as_finding(self) -> Finding:
        """Return it as what is wrong, where warnings are errors."""
        own = ("assumption", "role", "asks")
        return Finding(**{f.name: getattr(self, f.name) for f in fields(self) if f.name not in own})

    def place(self) -> str:
        """Return log, row and column: "log: row 5: q1"."""
        row = None if self.row is None else f"row {self.row}"
        return ": ".join(filter(None, (self.about, row, self.column)))


@dataclass(frozen=True, slots=True)
class LogColumn:
    """A column of the file that was used, so that what was read can be written as it was.

    value in SI = factor (sign value + offset), with the value as the file has it.

    Attributes:
        name: What it is called: its header without the unit, unique in the log.
        header: Its name as the file has it; empty in a file without a header.
        role: What it holds.
        index: Its place among the columns of this role, from 0.
        unit: The file's unit: rad, deg/s, mm, ns, ...
        factor: To SI.
        sign: 1, or -1 where the file counts the other way.
        offset: Added before the factor, in the file's unit.
        number: Its number among the columns of all tables of the log, from 1.
        doubt: Why its unit is only assumed; empty where it is given or proved.
    """

    name: str
    header: str
    role: Role
    index: int
    unit: str
    factor: float = 1.0
    sign: int = 1
    offset: float = 0.0
    number: int = 0
    doubt: str = ""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class JointLog(Displayable):
    """A log as its file has it: the file's own rows, in SI, neither repolarized nor resampled.

    A path (t, x, y, z) is a log without joints.

    Attributes:
        name: The file's stem.
        source: Which reader read it, such as "coppeliasim" or "table".
        files: The files it came from.
        t_ns: Time of each row in integer [ns] from the first row, shape (n,), strictly increasing; of rows
            without times their number from 0, `ROW_NS` a row.
        clock_start_ns: The file's own clock at the first row in integer [ns].
        joints: Names of the joint columns, in the robot's order.
        q: Joint values in [rad] or [m], shape (n, joints); NaN where a sample is missing.
        first_line: Line of the file that holds row 1 (row r of a plain table is line first_line + r - 1).
        qd: Recorded rates in [rad/s] or [m/s], shape (n, joints).
        qdd: Recorded second derivatives in [rad/s2] or [m/s2], shape (n, joints).
        tcp_position: Recorded tool centre point in [m], shape (n, 3).
        tcp_rotation: Recorded orientation as the file has it, in [rad] or [-], shape (n, k).
        rotation_form: What its columns are, such as "vector"; None without one.
        columns: The columns of the file that were used.
        digits: Significant digits of the joint values where the file was seen to be quantised.
        inferences: What the reader found out.
        warnings: What a person should know.
        timed: Whether the rows have times; else they are poses that no motion joins.
        measured: Whether the recorded tool centre point was measured from outside: it stands in a frame of
            its own.
    """

    name: str
    source: str
    files: tuple[SourceFile, ...]
    t_ns: IntArray
    joints: tuple[str, ...]
    q: FloatArray
    clock_start_ns: int = 0
    first_line: int = 2
    qd: FloatArray | None = None
    qdd: FloatArray | None = None
    tcp_position: FloatArray | None = None
    tcp_rotation: FloatArray | None = None
    rotation_form: RotationForm | None = None
    columns: tuple[LogColumn, ...] = ()
    digits: int | None = None
    inferences: tuple[Inference, ...] = ()
    warnings: tuple[LogWarning, ...] = ()
    timed: bool = True
    measured: bool = False

    @property
    def t(self) -> FloatArray:
        """Time from the first row in [s], shape (n,)."""
        return ns_to_seconds(self.t_ns)

    @property
    def clock_start(self) -> float:
        """The file's own clock at the first row in [s]."""
        return self.clock_start_ns / 10**9  # integers divide exactly

    @property
    def units(self) -> dict[str, str]:
        """The file's unit of every column used, by its name: rad, deg, m, mm, s, ..."""
        return {column.name: column.unit for column in self.columns}

    @property
    def joint_units(self) -> tuple[str, ...]:
        """The SI unit of each joint by its column: m if that is a length, else rad."""
        columns = {column.index: column.unit for column in self.columns if column.role == "joint"}
        return tuple("m" if columns.get(j) in ("m", "mm", "cm") else "rad" for j in range(len(self.joints)))

    @property
    def tcp_quat_xyzw(self) -> FloatArray | None:
        """Recorded orientation as unit quaternions x, y, z, w [-], shape (n, 4); None without one.

        Of q and -q, which are one rotation, each is the nearest to the one before, so that they can be
        interpolated.
        """
        if self.tcp_rotation is None or self.rotation_form is None:
            return None
        return unwrap_quaternions(to_quaternions(self.tcp_rotation, self.rotation_form))

    @property
    def tcp_rotation_continuous(self) -> FloatArray | None:
        """Recorded orientation in its own form [rad] or [-], shape (n, k); None without one.

        Of the names of one rotation each is the nearest to the one before: rotation vectors go on past pi,
        Euler angles past their limits. So they can be plotted, interpolated and differentiated.
        """
        if self.tcp_rotation is None or self.rotation_form is None:
            return None
        return unwrap_orientations(self.tcp_rotation, self.rotation_form)

    @property
    def period_assumed(self) -> bool:
        """Whether the time between its rows is assumed: then its rates are, too."""
        return any(one.kind == ASSUMED_PERIOD for one in self.warnings)

    @property
    def rows(self) -> int:
        """Number of rows read; rows that were left out count nowhere."""
        return len(self.t_ns)

    @property
    def period(self) -> float:
        """Median time between rows in [s]; 0 for a log of one row, and without times."""
        return float(np.median(np.diff(self.t_ns))) / 1e9 if self.rows > 1 and self.timed else 0.0

    def _headline(self) -> str:
        """Return its name, its source and how long it is."""
        joints = format_count(len(self.joints), "joint") if self.joints else "a path"
        rows = format_count(self.rows, "row") + (f" {self.period:g} s apart" if self.timed else "")
        return format_headline(self.name, self.source, joints, rows)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a row of the file: t [s], the joints, and what else was recorded, in SI.

        Without times the number of the row stands for t, from 1.
        """
        import pandas as pd

        columns: dict[str, Any] = {"t": self.t} if self.timed else {"row": np.arange(1, self.rows + 1)}
        roles: dict[str, tuple[Role, int]] = {"t": ("time", 0)} if self.timed else {}
        units = {"t": "s"}
        for role, names, own, values in self._groups():
            if values is not None:
                columns |= {name: values[:, i] for i, name in enumerate(names)}
                roles |= {name: (role, i) for i, name in enumerate(names)}
                units |= dict(zip(names, own, strict=True))
        frame = pd.DataFrame(columns)
        frame.attrs[URMPIPE_SOURCE] = {"columns": roles, "units": units}  # by which `ingest` reads it again
        return frame

    def _groups(self) -> Iterator[tuple[Role, Sequence[str], Sequence[str], FloatArray | None]]:
        """Yield the columns of its table by role: names, units in SI, and values."""
        orders: dict[Role, tuple[str, str, FloatArray | None]] = {
            "joint": ("", "", self.q),
            "rate": ("d_", "/s", self.qd),
            "acceleration": ("dd_", "/s2", self.qdd),
        }
        for role, (before, behind, values) in orders.items():
            names, units = ([before + n for n in self.joints], [u + behind for u in self.joint_units])
            yield role, names, units, values
        yield "position", tuple("xyz"), ("m",) * 3, self.tcp_position
        rotation = COLUMN_NAMES[self.rotation_form] if self.rotation_form else ()
        yield "rotation", rotation, ("rad" if len(rotation) == 3 else "",) * len(rotation), self.tcp_rotation

    def to_dict(self) -> dict[str, Any]:
        """Return what the log is and how it was read, without its rows; messages in somebody's words."""
        return {
            "name": self.name,
            "source": self.source,
            "files": [asdict(one) for one in self.files],
            "samples": self.rows,
            "period": self.period if self.timed else None,
            "clock_start": self.clock_start if self.timed else None,
            "joints": list(self.joints),
            "units": self.units,
            "inferences": [one.to_dict() for one in self.inferences],
            "warnings": [one.to_dict() for one in self.warnings],
        }


GAP = 3.0
"""Two rows further apart than this many median periods have a gap between them, in which nothing is known."""

MISSED_SAMPLE = 1.5
"""Two values of a joint further apart than this many median periods lack one between them; a joint may turn
unseen there."""


def has_gap_after(t_ns: IntArray) -> BoolArray:
    """Return which rows at integer times in [ns], shape (n,), have a gap behind them, shape (n - 1,)."""
    step = np.diff(t_ns)
    return np.asarray(step > GAP * np.median(step)) if len(step) else np.empty(0, dtype=np.bool_)


def is_inside_gap(at_ns: IntArray, known_ns: IntArray, gaps: BoolArray | None = None) -> BoolArray:
    """Return which times lie strictly inside a gap between two known ones, shape (n,).

    Both are integer times in [ns], of shape (n,) and, rising, (k,). `gaps` are those of `has_gap_after`, of
    shape (k - 1,); None: computed.
    """
    if len(known_ns) < 2:
        return np.zeros(len(at_ns), dtype=np.bool_)
    after = np.clip(np.searchsorted(known_ns, at_ns, side="left"), 1, len(known_ns) - 1)
    wide = (has_gap_after(known_ns) if gaps is None else gaps)[after - 1]
    return np.asarray(wide & (at_ns > known_ns[after - 1]) & (at_ns < known_ns[after]))
