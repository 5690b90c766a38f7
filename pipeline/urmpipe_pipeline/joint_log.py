"""What a source reader makes of a file: plain arrays in SI, with names and where they came from."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]


def seconds(nanoseconds: IntArray) -> FloatArray:
    """Return integer [ns] as [s], each rounded once."""
    return np.true_divide(nanoseconds, 1e9, dtype=np.float64)


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
    """

    what: str
    value: str
    evidence: str


@dataclass(frozen=True, slots=True)
class LogWarning:
    """Something about a log that a person should know, and that did not stop the work.

    Attributes:
        kind: A short word to filter by, such as "missing", "gap", "assumed-unit".
        message: One line.
        row: Data row of the file from 1, where there is one.
    """

    kind: str
    message: str
    row: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class JointLog:
    """A log as its file has it: the file's own rows, in SI, neither repolarized nor resampled.

    A path (t, x, y, z) is a log without joints.

    Attributes:
        name: The file's stem.
        source: Which reader read it, such as "coppeliasim" or "table".
        files: The files it came from.
        t_ns: Time of each row in integer [ns] from the first row, shape (n,), strictly increasing.
        clock_start: The file's own clock at the first row, in [s].
        joints: Names of the joint columns, in the robot's order.
        q: Joint values in [rad] or [m], shape (n, joints); NaN where a sample is missing.
        first_line: Line of the file that holds row 1 (row r of a plain table is line first_line + r - 1).
        qd: Recorded rates in [rad/s] or [m/s], shape (n, joints).
        qdd: Recorded second derivatives in [rad/s2] or [m/s2], shape (n, joints).
        tcp_position: Recorded tool centre point in [m], shape (n, 3).
        tcp_quat_xyzw: Recorded orientation [-], shape (n, 4).
        units: The file's unit of every column used: rad, deg, m, mm, s, ...
        digits: Significant digits of the joint values where the file was seen to be quantised.
        inferences: What the reader found out.
        warnings: What a person should know.
    """

    name: str
    source: str
    files: tuple[SourceFile, ...]
    t_ns: IntArray
    joints: tuple[str, ...]
    q: FloatArray
    clock_start: float = 0.0
    first_line: int = 2
    qd: FloatArray | None = None
    qdd: FloatArray | None = None
    tcp_position: FloatArray | None = None
    tcp_quat_xyzw: FloatArray | None = None
    units: dict[str, str] = field(default_factory=dict)
    digits: int | None = None
    inferences: tuple[Inference, ...] = ()
    warnings: tuple[LogWarning, ...] = ()

    @property
    def t(self) -> FloatArray:
        """Time from the first row in [s], shape (n,)."""
        return seconds(self.t_ns)

    @property
    def rows(self) -> int:
        """Number of rows read."""
        return len(self.t_ns)

    @property
    def period(self) -> float:
        """Median time between rows in [s]; 0 for a log of one row."""
        return float(np.median(np.diff(self.t_ns))) / 1e9 if self.rows > 1 else 0.0
