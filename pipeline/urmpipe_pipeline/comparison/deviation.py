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

Kind = Literal["axis", "norm", "path", "angle", "joint"]
"""What a deviation is measured of: a coordinate, the distance at one time, the distance from the path,
the orientation, a joint."""

ShareKind = Literal["coverage", "judged"]

AXES = ("x", "y", "z", "norm")
"""The columns of `Deviation.delta`."""

KINDS: dict[str, Kind] = {"x": "axis", "y": "axis", "z": "axis", "norm": "norm"}
"""What these are measured of."""

WHOLE = 0.99
"""A smaller share stands in the verdict's line: by hand, starts and ends of logs vary by less."""


@dataclass(frozen=True, slots=True)
class Statistics:
    """How one quantity deviates; max, rms and p95 are of absolute values, mean and std signed.

    Attributes:
        quantity: x, y, z, norm, path, angle, or a joint's name.
        kind: What it is measured of; a tolerance of that name holds for it.
        unit: m or rad, that of all lengths and angles here.
        max: Largest absolute value.
        rms: Root mean square.
        mean: Mean.
        std: Standard deviation about the mean, of the samples themselves (n, not n - 1).
        p95: 95th percentile of the absolute values.
        t_max: When the largest stands, in [s] of the log; NaN without times.
        sample_max: Row of the log with the largest, from 0.
        tolerance: Largest absolute value allowed, or None.
        out_of_tolerance: Compared samples above it or without a value; None without a tolerance.
        out_fraction: Their fraction of the compared samples, 0..1; None without a tolerance.
        verdict: pass or fail, None without a tolerance.
        samples: Compared samples that have a value; None in a recording made before they were counted.
        missing: Compared samples that have none: they cannot be shown to be within a tolerance.
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
        """Share of the tolerance that the largest value uses up; None without one, inf if one is missing."""
        if not self.tolerance:
            return None
        return math.inf if self.missing else self.max / self.tolerance

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {key: value for key, value in self.fields().items() if key not in ("quantity", "kind")}

    def fields(self) -> dict[str, Any]:
        """Return every field by its name; without times there is no `t_max`."""
        return asdict(self) | {"t_max": None if math.isnan(self.t_max) else self.t_max}


@dataclass(frozen=True, slots=True)
class SampleInterval:
    """Samples in a row that are out of tolerance, or unseen.

    Attributes:
        samples: How many.
        sample: The first of them, by its row of the log from 0; of coverage by that of the reference.
        t: When it begins, in [s] of the log, of coverage in [s] of the reference; None without times.
        duration: From its first to its last sample in [s]; None without times.
    """

    samples: int
    sample: int
    t: float | None
    duration: float | None


@dataclass(frozen=True, slots=True)
class Share:
    """How much of a motion a verdict rests on, as `comparison.coverage` defines it.

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
        """What it is measured of: a tolerance of that name holds for it."""
        return self.quantity

    @property
    def utilisation(self) -> float | None:
        """Part of what may be unseen that is; None without a tolerance, inf if nothing may be."""
        if self.tolerance is None:
            return None
        unseen, allowed = 1.0 - self.value, 1.0 - self.tolerance
        return unseen / allowed if allowed else math.inf if unseen else 0.0

    def fields(self) -> dict[str, Any]:
        """Return the fields of `Statistics` that it has, its share as `value`."""
        own = {name: getattr(self, name) for name in ("quantity", "kind", "value", "tolerance", "verdict")}
        return own | {"unit": "1", "samples": self.samples, "missing": self.total - self.samples}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Deviation(Displayable):
    """The deviation of one log from the reference.

    Attributes:
        name: The log's name, unique in the comparison.
        run: The ingested log.
        sample: Rows of the log that were compared, from 0, shape (m,).
        t_ns: Their times on the log's clock in integer [ns], shape (m,).
        reference: Where the reference was, in [m], shape (m, 3).
        actual: Where the log was, aligned, in [m], shape (m, 3).
        delta: x, y, z and norm of reference - actual, in [m], shape (m, 4).
        path: Distance of `actual` from the nearest point of the reference's path, in [m], shape (m,).
        speed: Speed of the log's tool centre point in [m/s], shape (m,); NaN where it is not known.
        angle: Angle between the orientations in [rad], shape (m,); None where a side has none.
        joint_delta: reference - log of each joint, turns included, in [rad] or [m], shape (m, joints); None
            where a side has none.
        joint_turns: Whole turns that two motions count apart for the pose they start in, one a joint; they
            are taken out of `joint_delta`.
        out_of_tolerance: Where any quantity with a tolerance is out of it, shape (m,).
        sync: How the clocks were put together.
        alignment: How the log was moved in space.
        left_out: Samples of the log without a reference or without a value.
        reference_left_out: Samples of the reference outside the log's time.
        statistics: One for each of x, y, z, norm and path, and for angle where there is one; none where
            joints alone are compared.
        joint_statistics: One a joint, by its name in the log; none where a side has no joints.
        start: delta at the first compared sample in [m]: x, y, z, norm (the paper's mutual calibration).
        speed_correlation: Pearson's r of the norm and the speed; None where one of them does not change.
        verdict: pass or fail; None of a cycle, which is not judged alone.
        diagnosis: Why it deviates, where that was asked for.
        shares: How much was seen: `coverage` of the reference, `judged` of the log's motion; none in a
            recording made before they were measured.
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
        """What it is drawn over: times of the compared samples in [ns], shape (m,); None for the rows."""
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
        """The longest stretch out of tolerance, the first of equally long ones; None without any."""
        edges = np.flatnonzero(np.diff(self.sample) > 1) + 1  # a stretch ends where samples are left out
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
        """Whatever may have a tolerance: every deviation, then the shares."""
        return (*self.all_statistics, *self.shares.values())

    @property
    def values(self) -> tuple[FloatArray, ...]:
        """Every quantity at the compared samples in [m] or [rad], shape (m,) each; as `all_statistics`."""
        angle = () if self.angle is None else (self.angle,)
        joints = () if self.joint_delta is None else tuple(self.joint_delta.T)
        return (*self.delta.T, self.path, *angle, *joints) if self.statistics else joints

    def worst_joint(self, unit: str) -> Statistics | None:
        """Return the joint in rad or m that is furthest off; None without one."""
        joints = [one for one in self.joint_statistics.values() if one.unit == unit]
        return max(joints, key=lambda one: one.max, default=None)

    def peak(self, one: Statistics) -> int:
        """Return the index into the compared samples at which one of its quantities is largest."""
        return int(np.searchsorted(self.sample, one.sample_max))

    @property
    def worst_statistics_index(self) -> int:
        """Index into the compared samples of the furthest quantity; the norm need not be largest there."""
        return self.peak(self.worst_statistics)

    def place(self, one: Statistics) -> tuple[float, float, float] | None:
        """Return where the log was when one of its quantities was largest, in [m]; None without a place."""
        x, y, z = (float(value) for value in self.actual[self.peak(one)])
        return (x, y, z) if self.statistics else None

    def row(self, one: Statistics) -> int:
        """Return the log's row of numbers, from 1, in which a quantity was largest."""
        if self.run.rows is None and self.run.resampled:  # judged on the grid, as it once was: the nearest
            return int(np.argmin(np.abs(self.run.log.t_ns - self.t_ns[self.peak(one)]))) + 1
        return one.sample_max + 1

    @property
    def worst_statistics(self) -> Statistics:
        """The deviation that uses up most of its tolerance; the norm where nothing has one."""
        held = [one for one in self.all_statistics if one.utilisation is not None]
        otherwise = self.statistics.get("norm", self.all_statistics[0])
        return max(held, key=lambda one: one.utilisation or 0.0, default=otherwise)

    @property
    def decisive(self) -> Statistics | Share:
        """What decides the verdict: the furthest deviation; if none fails, a share that is too small."""
        small = [one for one in self.shares.values() if one.verdict == "fail"]
        if self.worst_statistics.verdict == "fail" or not small:
            return self.worst_statistics
        return max(small, key=lambda one: one.utilisation or 0.0)

    @property
    def incomplete_shares(self) -> tuple[Share, ...]:
        """The shares that are not nearly whole, which its verdict has to name."""
        return tuple(one for one in self.shares.values() if one.value < WHOLE)

    def _headline(self) -> str:
        """Return its verdict, and by what it is decided."""
        one, samples = self.worst_statistics, format_count(len(self.sample), "sample")
        largest = f"{one.quantity} up to {one.max:.4g} {one.unit}"
        shares = (f"{share.quantity} {share.value:.1%}" for share in self.incomplete_shares)
        return format_headline(self.name, self.verdict, largest, f"{samples} compared", *shares)

    def _notes(self) -> list[str]:
        """Return what is to be known of the log."""
        return [str(warning) for warning in self.run.warnings]

    def to_frame(self) -> pd.DataFrame:
        """Return one row a compared sample: t [s], then every quantity, in [m] or [rad].

        Of still poses the number of the row stands for t, from 1. Its columns are called as
        its statistics: x, y, z, norm, path, angle where there is one, the joints.
        """
        import pandas as pd

        names = [one.quantity for one in self.all_statistics]
        axis = {"t": self.t} if self.run.timed else {"row": self.sample + 1}
        return pd.DataFrame({**axis, **dict(zip(names, self.values, strict=True))})

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object of one run."""
        worst, longest, timed = self.worst, self.longest_out_interval, self.run.timed
        told = {name: one.to_dict() for name, one in self.statistics.items()}
        norm = float(self.delta[worst, 3]) if told else None
        return {
            "name": self.name,
            "samples": len(self.sample),
            "left_out": self.left_out,
            "reference_left_out": self.reference_left_out,
            "duration": self.duration if timed else None,
            "sync_offset": self.sync.offset if timed else None,
            "sync": self.sync.to_dict() if timed else None,
            "alignment": self.alignment.to_dict(),
            "delta": {axis: told[axis] for axis in AXES if told},
            "path": told.get("path"),
            "angle": told.get("angle"),
            "joints": {name: one.to_dict() for name, one in self.joint_statistics.items()},
            **dict.fromkeys(get_args(ShareKind)),
            **{name: asdict(share) for name, share in self.shares.items()},
            "joint_turns": dict(zip(self.joint_statistics, self.joint_turns, strict=True)),
            "start": dict(zip(AXES, self.start, strict=True)) if told else {},
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
            "warnings": [one.to_dict() for one in self.run.warnings],
            "diagnosis": None if self.diagnosis is None else self.diagnosis.to_dict(),
        }
