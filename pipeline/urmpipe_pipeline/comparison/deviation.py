"""The deviation of one log: arrays at the compared samples, statistics and verdicts."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.display import Displayable, format_count, format_headline
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.diagnosis.result import Diagnosis
from urmpipe_pipeline.joint_log import ns_to_seconds
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import Alignment, Sync

if TYPE_CHECKING:
    import pandas as pd

Verdict = Literal["pass", "fail"]

# Of a coordinate, the distance at one time, the distance from the path, the orientation, a joint.
Kind = Literal["axis", "norm", "path", "angle", "joint"]
ShareKind = Literal["coverage", "judged"]

AXES = ("x", "y", "z", "norm")  # columns of `Deviation.delta`
KINDS: dict[str, Kind] = {"x": "axis", "y": "axis", "z": "axis", "norm": "norm"}
# A smaller share is in the verdict's line: starts and ends of logs that are recorded by hand vary by less.
COMPLETE = 0.99


@dataclass(frozen=True, slots=True)
class Statistics:
    """Statistics of one quantity; max, rms and p95 are of absolute values, mean and std signed.

    Attributes:
        quantity: x, y, z, norm, path, angle, or a joint's name.
        kind: Its kind; a tolerance of that name applies to it.
        unit: m or rad, of all lengths and angles here.
        max: Largest absolute value.
        rms: Root mean square.
        mean: Mean.
        std: Standard deviation about the mean, of the samples themselves (n, not n - 1).
        p95: 95th percentile of the absolute values.
        t_max: Time of the largest in [s] of the log; NaN without times.
        sample_max: Row of the log with the largest, from 0.
        tolerance: Largest absolute value allowed, or None.
        out_of_tolerance: Compared samples above it or without a value; None without a tolerance.
        out_fraction: Their share of the compared samples, 0..1; None without a tolerance.
        verdict: pass or fail, None without a tolerance.
        samples: Compared samples that have a value; None in a recording made before they were counted.
        missing: Compared samples without a value: they cannot be shown to be within a tolerance.
    """

    quantity: str
    kind: Kind
    unit: str
    max: float
    rms: float
    mean: float
    std: float
    p95: float
    t_max: float
    sample_max: int
    tolerance: float | None
    out_of_tolerance: int | None
    out_fraction: float | None
    verdict: Verdict | None
    samples: int | None = None
    missing: int = 0

    @property
    def utilisation(self) -> float | None:
        """Utilisation of the tolerance by the largest value; None without one, inf if a value is missing."""
        if not self.tolerance:
            return None
        return math.inf if self.missing else self.max / self.tolerance

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {key: value for key, value in self.fields().items() if key not in ("quantity", "kind")}

    def fields(self) -> dict[str, Any]:
        """Return every field by its name; `t_max` is None without times."""
        return asdict(self) | {"t_max": None if math.isnan(self.t_max) else self.t_max}


@dataclass(frozen=True, slots=True)
class SampleInterval:
    """Interval of consecutive samples that are out of tolerance, or unseen.

    Attributes:
        samples: Number of samples.
        sample: The first, by its row of the log from 0; of coverage by that of the reference.
        t: Its start in [s] of the log, of coverage in [s] of the reference; None without times.
        duration: From its first to its last sample in [s]; None without times.
    """

    samples: int
    sample: int
    t: float | None
    duration: float | None


@dataclass(frozen=True, slots=True)
class Share:
    """How much of a motion a verdict is based on, as `comparison.measure` defines it.

    Attributes:
        quantity: coverage or judged.
        value: Share of the reference's samples that the log shows; of the log's motion that was judged; 0..1.
        samples: Samples shown or judged.
        total: Samples with a value, of the reference or of the log.
        tolerance: Least share allowed, or None.
        verdict: pass or fail, None without a tolerance.
        longest_unseen: The longest interval not seen, the first of equally long ones; None without any.
    """

    quantity: ShareKind
    value: float
    samples: int
    total: int
    tolerance: float | None
    verdict: Verdict | None
    longest_unseen: SampleInterval | None

    @property
    def kind(self) -> ShareKind:
        """Its kind: a tolerance of that name applies to it."""
        return self.quantity

    @property
    def utilisation(self) -> float | None:
        """Unseen share / allowed unseen share; None without a tolerance, inf if nothing may be unseen."""
        if self.tolerance is None:
            return None
        unseen, allowed = 1.0 - self.value, 1.0 - self.tolerance
        return unseen / allowed if allowed else math.inf if unseen else 0.0

    def fields(self) -> dict[str, Any]:
        """Return its fields by the names of `Statistics`, its share as `value`."""
        shared = {name: getattr(self, name) for name in ("quantity", "kind", "value", "tolerance", "verdict")}
        return shared | {"unit": "1", "samples": self.samples, "missing": self.total - self.samples}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Deviation(Displayable):
    """The deviation of one log from the reference.

    Attributes:
        name: The log's name, unique in the comparison.
        run: The ingested log.
        sample: Rows of the log that were compared, from 0, shape (m,).
        t_ns: Their times on the log's clock in integer [ns], shape (m,).
        reference: Position of the reference in [m], shape (m, 3).
        actual: Position of the log in [m], aligned, shape (m, 3).
        delta: x, y, z and norm of reference - actual, in [m], shape (m, 4).
        path: Distance of `actual` from the nearest point of the reference's path, in [m], shape (m,).
        speed: Speed of the log's tool centre point in [m/s], shape (m,); NaN where it is unknown.
        angle: Angle between the orientations in [rad], shape (m,); None if a side has no orientation.
        joint_delta: reference - log of each joint, turns included, in [rad] or [m], shape (m, joints); None
            if a side has no joints.
        joint_turns: Difference of the whole turns that two motions count for the pose they start in, one per
            joint; they are subtracted from `joint_delta`.
        out_of_tolerance: Where any quantity with a tolerance is out of it, shape (m,).
        sync: How the clocks are aligned.
        alignment: How the log was moved in space.
        left_out: Samples of the log without a reference or without a value.
        reference_left_out: Samples of the reference outside the log's time.
        statistics: Of x, y, z, norm and path, and of angle if there is one; empty if joints alone are
            compared.
        joint_statistics: Of each joint, by its name in the log; empty if a side has no joints.
        start: delta at the first compared sample in [m]: x, y, z, norm (the paper's mutual calibration).
        speed_correlation: Pearson's r of the norm and the speed; None where one of them does not change.
        verdict: pass or fail; None of a cycle, which is not judged alone.
        diagnosis: Why it deviates, if a diagnosis was requested.
        shares: `coverage` of the reference, `judged` of the log's motion; empty in a recording made before
            they were measured.
    """

    name: str
    run: Run
    sample: IntArray
    t_ns: IntArray
    reference: FloatArray
    actual: FloatArray
    delta: FloatArray
    path: FloatArray
    speed: FloatArray
    angle: FloatArray | None
    joint_delta: FloatArray | None
    joint_turns: tuple[int, ...]
    out_of_tolerance: NDArray[np.bool_]
    sync: Sync
    alignment: Alignment
    left_out: int
    reference_left_out: int
    statistics: dict[str, Statistics]
    joint_statistics: dict[str, Statistics]
    start: tuple[float, float, float, float]
    speed_correlation: float | None
    verdict: Verdict | None
    diagnosis: Diagnosis | None = None
    shares: dict[str, Share] = field(default_factory=dict)

    @property
    def t(self) -> FloatArray:
        """Times of the compared samples in [s], shape (m,)."""
        return ns_to_seconds(self.t_ns)

    @property
    def axis_ns(self) -> IntArray | None:
        """Axis of plots: times of the compared samples in [ns], shape (m,); None for the rows."""
        return self.t_ns if self.run.timed else None

    @property
    def duration(self) -> float:
        """From the first to the last compared sample in [s]."""
        return float(self.t_ns[-1] - self.t_ns[0]) / 1e9

    @property
    def worst(self) -> int:
        """Index into the compared samples of the largest norm."""
        return int(np.argmax(self.delta[:, 3])) if self.statistics else self.worst_statistics_index

    @property
    def out_fraction(self) -> float:
        """Share of the compared samples out of tolerance, 0..1."""
        return float(np.count_nonzero(self.out_of_tolerance)) / len(self.sample)

    @property
    def longest_out_interval(self) -> SampleInterval | None:
        """The longest interval out of tolerance, the first of equally long ones; None without any."""
        edges = np.flatnonzero(np.diff(self.sample) > 1) + 1  # an interval ends where samples are left out
        changes = np.flatnonzero(np.diff(self.out_of_tolerance)) + 1
        starts = np.unique(np.concatenate(([0], edges, changes)))
        ends = np.append(starts[1:], len(self.sample))
        lengths = np.where(self.out_of_tolerance[starts], ends - starts, 0)
        longest = int(np.argmax(lengths))
        if not lengths[longest]:
            return None
        first, last = int(starts[longest]), int(ends[longest]) - 1
        count, sample = last - first + 1, int(self.sample[first])
        if not self.run.timed:
            return SampleInterval(count, sample, None, None)
        lasts = float(self.t_ns[last] - self.t_ns[first]) / 1e9
        return SampleInterval(count, sample, float(self.t[first]), lasts)

    @property
    def all_statistics(self) -> tuple[Statistics, ...]:
        """Of every quantity: x, y, z, norm, path, angle and the joints."""
        return (*self.statistics.values(), *self.joint_statistics.values())

    @property
    def quantities(self) -> tuple[Statistics | Share, ...]:
        """Everything that may have a tolerance: every deviation, then the shares."""
        return (*self.all_statistics, *self.shares.values())

    @property
    def values(self) -> tuple[FloatArray, ...]:
        """Every quantity at the compared samples in [m] or [rad], shape (m,) each; as `all_statistics`."""
        angle = () if self.angle is None else (self.angle,)
        joints = () if self.joint_delta is None else tuple(self.joint_delta.T)
        return (*self.delta.T, self.path, *angle, *joints) if self.statistics else joints

    def worst_joint(self, unit: str) -> Statistics | None:
        """Return the joint in rad or m with the largest deviation; None without one."""
        joints = [statistics for statistics in self.joint_statistics.values() if statistics.unit == unit]
        return max(joints, key=lambda joint: joint.max, default=None)

    def peak(self, statistics: Statistics) -> int:
        """Return the index into the compared samples at which a quantity of it is largest."""
        return int(np.searchsorted(self.sample, statistics.sample_max))

    @property
    def worst_statistics_index(self) -> int:
        """Index into the compared samples of the worst statistics; the norm need not be largest there."""
        return self.peak(self.worst_statistics)

    def place(self, statistics: Statistics) -> tuple[float, float, float] | None:
        """Return the log's position at the largest value of a quantity in [m]; None without positions."""
        x, y, z = (float(value) for value in self.actual[self.peak(statistics)])
        return (x, y, z) if self.statistics else None

    def row(self, statistics: Statistics) -> int:
        """Return the log's data row, from 1, of the largest value of a quantity."""
        if (
            self.run.rows is None and self.run.resampled
        ):  # of an old recording, judged on the grid: the nearest
            row = int(np.argmin(np.abs(self.run.log.t_ns - self.t_ns[self.peak(statistics)]))) + 1
        else:
            row = statistics.sample_max + 1
        return self.run.log.file_row(row)

    @property
    def worst_statistics(self) -> Statistics:
        """The deviation of the largest utilisation of its tolerance; the norm if nothing has one."""
        judged = [statistics for statistics in self.all_statistics if statistics.utilisation is not None]
        default = self.statistics.get("norm", self.all_statistics[0])
        return max(judged, key=lambda statistics: statistics.utilisation or 0.0, default=default)

    @property
    def decisive(self) -> Statistics | Share:
        """The quantity that decides the verdict: the worst statistics; if these pass, a share that fails."""
        small = [share for share in self.shares.values() if share.verdict == "fail"]
        if self.worst_statistics.verdict == "fail" or not small:
            return self.worst_statistics
        return max(small, key=lambda share: share.utilisation or 0.0)

    @property
    def incomplete_shares(self) -> tuple[Share, ...]:
        """The shares that are not nearly 1, which its verdict has to name."""
        return tuple(share for share in self.shares.values() if share.value < COMPLETE)

    def _headline(self) -> str:
        critical, samples = self.worst_statistics, format_count(len(self.sample), "sample")
        largest = f"{critical.quantity} up to {critical.max:.4g} {critical.unit}"
        shares = (f"{share.quantity} {share.value:.1%}" for share in self.incomplete_shares)
        return format_headline(self.name, self.verdict, largest, f"{samples} compared", *shares)

    def _notes(self) -> list[str]:
        return [str(warning) for warning in self.run.warnings]

    def to_frame(self) -> pd.DataFrame:
        """Return one row per compared sample: t [s], then every quantity, in [m] or [rad].

        Static poses have the number of the row, from 1, instead of t. The columns are named as the
        statistics: x, y, z, norm, path, angle if there is one, the joints.
        """
        import pandas as pd

        names = [statistics.quantity for statistics in self.all_statistics]
        axis = {"t": self.t} if self.run.timed else {"row": self.sample + 1}
        return pd.DataFrame({**axis, **dict(zip(names, self.values, strict=True))})

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object of one run."""
        worst, longest, timed = self.worst, self.longest_out_interval, self.run.timed
        in_space = {name: statistics.to_dict() for name, statistics in self.statistics.items()}
        norm = float(self.delta[worst, 3]) if in_space else None
        return {
            "name": self.name,
            "samples": len(self.sample),
            "left_out": self.left_out,
            "reference_left_out": self.reference_left_out,
            "duration": self.duration if timed else None,
            "sync_offset": self.sync.offset if timed else None,
            "sync": self.sync.to_dict() if timed else None,
            "alignment": self.alignment.to_dict(),
            "delta": {axis: in_space[axis] for axis in AXES if in_space},
            "path": in_space.get("path"),
            "angle": in_space.get("angle"),
            "joints": {name: statistics.to_dict() for name, statistics in self.joint_statistics.items()},
            **dict.fromkeys(get_args(ShareKind)),
            **{name: asdict(share) for name, share in self.shares.items()},
            "joint_turns": dict(zip(self.joint_statistics, self.joint_turns, strict=True)),
            "start": dict(zip(AXES, self.start, strict=True)) if in_space else {},
            "worst": {
                "t": float(self.t[worst]) if timed else None,
                "sample": int(self.sample[worst]),
                "norm": norm,
            },
            "out_of_tolerance": int(np.count_nonzero(self.out_of_tolerance)),
            "out_fraction": self.out_fraction,
            "longest_out_interval": None if longest is None else asdict(longest),
            "speed_correlation": self.speed_correlation,
            "verdict": self.verdict,
            "warnings": [warning.to_dict() for warning in self.run.warnings],
            "diagnosis": None if self.diagnosis is None else self.diagnosis.to_dict(),
        }
