"""The verdict of a delta meter: its deviation held against what is allowed, as `compare` does it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import OptionError
from urmpipe_pipeline.comparison.deviation import AXES, KINDS, Kind, Verdict
from urmpipe_pipeline.comparison.tolerance import allowed_for


@dataclass(frozen=True, slots=True)
class DeltaVerdict:
    """What a delta meter of a co-simulated system found.

    Attributes:
        block: Name of the meter.
        variables: Its signals that are held to the tolerance, such as ("delta", "norm").
        tolerance: Largest absolute deviation allowed in [m], by kind (axis, norm) or coordinate (x, y, z).
        quantity: x, y, z or norm: what uses up most of its tolerance.
        worst: Its largest absolute value in [m].
        t: When that stands in [s].
        sample: Its sample, from 0.
        samples: How many were judged.
        out_of_tolerance: How many of them are out of it in any quantity; one without a value is.
        verdict: pass if none is, and nothing else is to be doubted.
        doubts: What else keeps it from passing, such as "bad.y, which leads to it, is not finite".
        missing: Samples without a value, which are out of tolerance.
    """

    block: str
    variables: tuple[str, ...]
    tolerance: Mapping[str, float]
    quantity: str
    worst: float
    t: float
    sample: int
    samples: int
    out_of_tolerance: int
    verdict: Verdict
    doubts: tuple[str, ...] = ()
    missing: int = 0

    @property
    def coverage(self) -> float:
        """Share of the samples, 0..1, that have a value."""
        return 1.0 - self.missing / self.samples

    @property
    def kind(self) -> Kind:
        """Of what the worst quantity is measured: axis or norm."""
        return KINDS[self.quantity]

    @property
    def allowed(self) -> float | None:
        """What is allowed of the worst quantity in [m]; None if it has no tolerance."""
        return allowed_for(self.quantity, self.kind, self.tolerance)

    @property
    def used(self) -> float | None:
        """Share of its tolerance that the worst value uses up; None where a sample has no value."""
        if self.allowed is None or not math.isfinite(self.worst):
            return None
        return float(_shares(np.array(self.worst), np.array(self.allowed)))

    @property
    def share_out(self) -> float:
        """Share of the samples out of tolerance, 0..1."""
        return self.out_of_tolerance / self.samples

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        worst = self.worst if math.isfinite(self.worst) else None
        told = asdict(self) | {"worst": worst, "doubts": list(self.doubts), "coverage": self.coverage}
        return {name: value for name, value in told.items() if name != "variables"}


def delta_verdict(
    block: str,
    t_ns: IntArray,
    delta: FloatArray,
    tolerance: Mapping[str, float],
    doubts: Sequence[str] = (),
) -> DeltaVerdict | None:
    """Hold the deviation of a delta meter against a tolerance; None without a sample.

    Args:
        block: Name of the meter.
        t_ns: Times in integer [ns], shape (n,).
        delta: reference - actual in [m], shape (n, 3).
        tolerance: Largest absolute deviation allowed in [m]: axis, norm, or x, y, z.
        doubts: Why it shall not pass even where no sample is out of tolerance.

    Raises:
        OptionError: If a tolerance is none of those, or negative.
    """
    _check(block, tolerance)
    if not len(t_ns):
        return None
    x, y, z = np.abs(delta).T
    sizes = np.column_stack((x, y, z, np.sqrt(x * x + y * y + z * z)))  # summed as the model does it
    held = [allowed_for(axis, KINDS[axis], tolerance) for axis in AXES]
    allowed = np.array([math.inf if one is None else one for one in held])
    known = np.isfinite(sizes).all(axis=1)
    out = ~known | (sizes > allowed).any(axis=1)
    row, axis = _worst(np.where(known[:, np.newaxis], sizes, math.inf), allowed)
    return DeltaVerdict(
        block=block,
        variables=("delta", "norm"),
        tolerance=dict(tolerance),
        quantity=AXES[axis],
        worst=float(sizes[row, axis]) if known[row] else math.nan,
        t=float(t_ns[row]) / 1e9,
        sample=row,
        samples=len(t_ns),
        out_of_tolerance=int(np.count_nonzero(out)),
        verdict="fail" if out.any() or doubts else "pass",
        doubts=tuple(doubts),
        missing=int(np.count_nonzero(~known)),
    )


def _worst(sizes: FloatArray, allowed: FloatArray) -> tuple[int, int]:
    """Return the sample and the column of the value that uses up most of what is allowed.

    Each column has its largest value; of several that use up infinitely much the larger one is worse. A
    sample without a value, whose sizes are infinite, is the worst of all.
    """
    judged = np.flatnonzero(np.isfinite(allowed))
    rows = np.argmax(sizes[:, judged], axis=0)
    largest = sizes[rows, judged]
    shares = _shares(largest, allowed[judged])
    worst = int(np.argmax(np.where(np.isinf(shares), largest, 0.0) if np.isinf(shares).any() else shares))
    return int(rows[worst]), int(judged[worst])


def _shares(sizes: FloatArray, allowed: FloatArray) -> FloatArray:
    """Return the shares of what is allowed that sizes use up: of nothing allowed, anything is infinite."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.where(sizes > 0.0, sizes / allowed, 0.0)


def _check(block: str, tolerance: Mapping[str, float]) -> None:
    allowed = ("axis", *AXES)
    faults = [
        f"{block}: found a tolerance {kind}={value:g}, allowed: {', '.join(allowed)}; 0 or positive"
        for kind, value in tolerance.items()
        if kind not in allowed or not 0.0 <= value < math.inf
    ]
    if faults or not tolerance:
        raise OptionError(*(faults or [f"{block}: found no tolerance, allowed: {', '.join(allowed)}"]))
