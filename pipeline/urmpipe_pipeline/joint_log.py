"""A log as it is read: the rows of its file as plain arrays in SI, with their origin.

- `JointLog`: the arrays; `LogColumn`, `SourceFile`: their columns and files.
- `Inference`, `LogWarning`: properties that the reader inferred, and what a user should check.
- `has_gap_after`, `is_inside_gap`: rows that are farther apart than the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
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

ROW_NS = (
    1_000_000_000  # `t_ns` per row of rows without times: `t` is the number of the row from 0, not a time
)
GAP = 3.0  # median periods; rows farther apart have a gap between them, in which the motion is unknown
MISSED_SAMPLE = (
    1.5  # median periods; between values of a joint farther apart one is missing: it may turn there
)

# Sources of a log that are not readers.
URMPIPE_SOURCE = "urmpipe"  # a file that urmpipe wrote: a joint log of inverse kinematics, or a plan
SOLVED = "ik"  # inverse kinematics
NETWORK = "network"  # the motion of a network: its traced point is its kinematics

ASSUMED_PERIOD = "assumed-period"  # warning: the rows have neither times nor a given period
PASSED_OVER = "columns-passed-over"  # warning: columns not read, since others were; `--strict` accepts it


def ns_to_seconds(nanoseconds: IntArray) -> FloatArray:
    """Return integer `nanoseconds` as [s], each rounded once, of the same shape."""
    return np.true_divide(nanoseconds, 1e9, dtype=np.float64)


Basis = Literal["given", "named", "proved", "assumed"]
Role = Literal["time", "joint", "rate", "acceleration", "position", "rotation"]
ROLES: tuple[Role, ...] = get_args(Role)


@dataclass(frozen=True, slots=True)
class SourceFile:
    """An input file of a result.

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
    """A property of a file that the reader inferred.

    Attributes:
        what: The property, such as "delimiter", "time column", "unit of q1".
        value: Its value.
        evidence: The reason.
        kind: A word to filter by, such as "unit" or "form"; by default the property.
        columns: Names of the columns or joints that it is about; empty for the file.
        hints: Options that change it.
        basis: How it is known: by the user, by a name of the file, by its numbers, or not at all.
    """

    what: str
    value: str
    evidence: str
    kind: str = ""
    columns: tuple[str, ...] = ()
    hints: tuple[Hint, ...] = ()
    basis: Basis = "proved"

    def __post_init__(self) -> None:
        """Set the kind to the property by default."""
        if not self.kind:
            object.__setattr__(self, "kind", self.what)

    def to_dict(self) -> dict[str, Any]:
        """Return its fields for JSON, and `alternatives`."""
        values = asdict(self)
        lists = {name: list(values[name]) for name in ("columns", "hints")}
        return values | lists | {"alternatives": self.alternatives()}

    def alternatives(self) -> str:
        """Return how to change it as text; empty if that is not possible."""
        return ", or ".join(f"{hint} {hint.effect}".strip() for hint in self.hints)


@dataclass(frozen=True, slots=True)
class LogWarning(Message):
    """A property of a log that a user should check, and that is no error.

    Attributes:
        kind: A word to filter by, such as "missing", "gap", "assumed-unit".
        message: The sentence, in one line.
        row: Data row of the file from 1.
        about: Name of the log or block, among others.
        column: Name of the column or joint.
        parameter: Keyword of the public function.
        found: The value that was found.
        allowed: The values that are allowed.
        hints: Options that change it.
        assumption: The assumption of a verdict that depends on it, as the end of "assuming ...": "the joints
            are in deg"; empty without one.
        role: Role of its columns; a verdict may depend on other columns.
        blocks_verdict: Whether there is no verdict before the question is answered.
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
    blocks_verdict: bool = False

    def of(self, name: str) -> LogWarning:
        """Return this warning with the name of a log or block."""
        return replace(self, about=name)

    def as_finding(self) -> Finding:
        """Return it as an error, for `--strict`."""
        omitted = ("assumption", "role", "blocks_verdict")
        return Finding(**{f.name: getattr(self, f.name) for f in fields(self) if f.name not in omitted})

    def place(self) -> str:
        """Return log, row and column: "log: row 5: q1"."""
        row = None if self.row is None else f"row {self.row}"
        return ": ".join(filter(None, (self.about, row, self.column)))


def number_rows(warnings: Iterable[LogWarning], file_row: Callable[[int], int]) -> tuple[LogWarning, ...]:
    """Return warnings about rows of a log, from 1, with the data rows of the file."""
    return tuple(w if w.row is None else replace(w, row=file_row(w.row)) for w in warnings)


@dataclass(frozen=True, slots=True)
class LogColumn:
    """A column of the file that was used.

    value in SI = factor (sign value + offset), with the value in the file.

    Attributes:
        name: The header without the unit, unique in the log.
        header: The header in the file; empty in a file without headers.
        role: The quantity.
        index: Index among the columns of this role, from 0.
        unit: Unit in the file: rad, deg/s, mm, ns, ...
        factor: Factor to SI.
        sign: 1, or -1 for a reversed column.
        offset: Added before the factor, in the unit of the file.
        number: Number among the columns of all tables of the log, from 1.
        uncertainty: Reason why its unit is assumed; empty if it is stated or verified.
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
    uncertainty: str = ""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class JointLog(Displayable):
    """The rows of a log file in SI, neither repolarized nor resampled.

    A path (t, x, y, z) is a log without joints.

    Attributes:
        name: Stem of the file.
        source: Name of the reader, such as "coppeliasim" or "table".
        files: The files.
        t_ns: Time of each row from the first row in integer [ns], shape (n,), strictly increasing; for rows
            without times `ROW_NS` per row.
        clock_start_ns: Clock of the file at the first row in integer [ns].
        joints: Names of the joint columns, in the order of the robot.
        q: Joint values in [rad] or [m], shape (n, joints); NaN where a sample is missing.
        first_line: Line of data row 1 of the file (row r of a plain table is line first_line + r - 1).
        qd: Recorded joint velocities in [rad/s] or [m/s], shape (n, joints).
        qdd: Recorded joint accelerations in [rad/s2] or [m/s2], shape (n, joints).
        tcp_position: Recorded tool centre point in [m], shape (n, 3).
        tcp_rotation: Recorded orientation in the form of the file, in [rad] or [-], shape (n, k).
        rotation_form: That form, such as "vector"; None without an orientation.
        columns: The columns of the file that were used.
        digits: Significant digits of the joint values of a quantised file; else None.
        inferences: Properties that the reader inferred.
        warnings: Warnings of the reader.
        timed: Whether the rows have times; else they are static poses.
        externally_measured: Whether an external device measured the tool centre point, in a frame at an
            unknown pose.
        file_rows: Data row of the file of each row, from 1, shape (n,); None if no earlier row was left out.
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
    externally_measured: bool = False
    file_rows: IntArray | None = None

    def file_row(self, row: int) -> int:
        """Return the data row of the file of a row, both from 1."""
        return row if self.file_rows is None else int(self.file_rows[row - 1])

    @property
    def t(self) -> FloatArray:
        """Time from the first row in [s], shape (n,)."""
        return ns_to_seconds(self.t_ns)

    @property
    def clock_start(self) -> float:
        """Clock of the file at the first row in [s]."""
        return self.clock_start_ns / 10**9  # integers divide exactly

    @property
    def units(self) -> dict[str, str]:
        """Unit in the file of each used column, by its name: rad, deg, m, mm, s, ..."""
        return {column.name: column.unit for column in self.columns}

    @property
    def joint_units(self) -> tuple[str, ...]:
        """SI unit of each joint: m if its column is a length, else rad."""
        columns = {column.index: column.unit for column in self.columns if column.role == "joint"}
        return tuple("m" if columns.get(j) in ("m", "mm", "cm") else "rad" for j in range(len(self.joints)))

    @property
    def tcp_quat_xyzw(self) -> FloatArray | None:
        """Recorded orientation as unit quaternions x, y, z, w [-], shape (n, 4); None without one.

        The signs are continuous, so that they can be interpolated.
        """
        if self.tcp_rotation is None or self.rotation_form is None:
            return None
        return unwrap_quaternions(to_quaternions(self.tcp_rotation, self.rotation_form))

    @property
    def tcp_rotation_continuous(self) -> FloatArray | None:
        """Recorded orientation in its form, in [rad] or [-], shape (n, k); None without one.

        It is continuous, so that it can be plotted, interpolated and differentiated: rotation vectors
        continue beyond pi, Euler angles beyond their limits.
        """
        if self.tcp_rotation is None or self.rotation_form is None:
            return None
        return unwrap_orientations(self.tcp_rotation, self.rotation_form)

    @property
    def period_assumed(self) -> bool:
        """Whether the time between its rows, and so its derivatives, are assumed."""
        return any(warning.kind == ASSUMED_PERIOD for warning in self.warnings)

    @property
    def rows(self) -> int:
        """Number of rows, without those that were left out."""
        return len(self.t_ns)

    @property
    def period(self) -> float:
        """Median time between rows in [s]; 0 for one row or without times."""
        return float(np.median(np.diff(self.t_ns))) / 1e9 if self.rows > 1 and self.timed else 0.0

    def _headline(self) -> str:
        joints = format_count(len(self.joints), "joint") if self.joints else "a path"
        rows = format_count(self.rows, "row") + (f" {self.period:g} s apart" if self.timed else "")
        return format_headline(self.name, self.source, joints, rows)

    def to_frame(self) -> pd.DataFrame:
        """Return one row per row of the file: t [s], the joints, and the other recorded columns, in SI.

        Without times there is the number of the row, from 1, in place of t.
        """
        import pandas as pd

        columns: dict[str, Any] = {"t": self.t} if self.timed else {"row": np.arange(1, self.rows + 1)}
        roles: dict[str, tuple[Role, int]] = {"t": ("time", 0)} if self.timed else {}
        units = {"t": "s"}
        for role, names, si_units, values in self._groups():
            if values is not None:
                columns |= {name: values[:, i] for i, name in enumerate(names)}
                roles |= {name: (role, i) for i, name in enumerate(names)}
                units |= dict(zip(names, si_units, strict=True))
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
        for role, (prefix, per_time, values) in orders.items():
            names, units = ([prefix + n for n in self.joints], [u + per_time for u in self.joint_units])
            yield role, names, units, values
        yield "position", tuple("xyz"), ("m",) * 3, self.tcp_position
        rotation = COLUMN_NAMES[self.rotation_form] if self.rotation_form else ()
        yield "rotation", rotation, ("rad" if len(rotation) == 3 else "",) * len(rotation), self.tcp_rotation

    def to_dict(self) -> dict[str, Any]:
        """Return the log and how it was read as a JSON object, without its rows."""
        return {
            "name": self.name,
            "source": self.source,
            "files": [asdict(file) for file in self.files],
            "samples": self.rows,
            "period": self.period if self.timed else None,
            "clock_start": self.clock_start if self.timed else None,
            "joints": list(self.joints),
            "units": self.units,
            "inferences": [inference.to_dict() for inference in self.inferences],
            "warnings": [warning.to_dict() for warning in self.warnings],
        }


def has_gap_after(t_ns: IntArray) -> BoolArray:
    """Return which rows at integer times in [ns], shape (n,), are followed by a gap, shape (n - 1,)."""
    step = np.diff(t_ns)
    return np.asarray(step > GAP * np.median(step)) if len(step) else np.empty(0, dtype=np.bool_)


def is_inside_gap(at_ns: IntArray, known_ns: IntArray, gaps: BoolArray | None = None) -> BoolArray:
    """Return which times are strictly inside a gap between known times, shape (n,).

    Args:
        at_ns: Times in integer [ns], shape (n,).
        known_ns: Known times in integer [ns], strictly increasing, shape (k,).
        gaps: `has_gap_after` of the known times, shape (k - 1,); None: computed.
    """
    if len(known_ns) < 2:
        return np.zeros(len(at_ns), dtype=np.bool_)
    after = np.clip(np.searchsorted(known_ns, at_ns, side="left"), 1, len(known_ns) - 1)
    wide = (has_gap_after(known_ns) if gaps is None else gaps)[after - 1]
    return np.asarray(wide & (at_ns > known_ns[after - 1]) & (at_ns < known_ns[after]))
