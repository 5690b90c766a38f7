"""The criteria after ISO 9283: what they are called, their units, and their verdicts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import euler_zyx, to_matrices

ANGLES = ("rz", "ry", "rx")
"""The angles of an orientation, R = Rz(rz) Ry(ry) Rx(rx), in the order of their columns."""

UNITS: dict[str, str] = {
    "AP": "m", "RP": "m",
    **{f"{name}_{angle}": "rad" for name in ("AP", "RP") for angle in ANGLES},
    "AD": "m", "RD": "m", "vAP": "m", "PSt": "s", "OV": "m", "dAP": "m", "dRP": "m",
    "AT": "m", "RT": "m",
    **{f"{name}_{angle}": "rad" for name in ("AT", "RT") for angle in ANGLES},
    "CR": "m", "CO": "m", "AV": "1", "RV": "1", "FV": "m/s",
}  # fmt: skip
"""Every criterion, in the order in which it is told, and its SI unit; 1 of a share."""

MEANING: dict[str, str] = {
    "AP": "pose accuracy", "RP": "pose repeatability",
    "AD": "distance accuracy", "RD": "distance repeatability",
    "vAP": "multi-directional pose accuracy variation",
    "PSt": "pose stabilisation time", "OV": "pose overshoot",
    "dAP": "drift of pose accuracy", "dRP": "drift of pose repeatability",
    "AT": "path accuracy", "RT": "path repeatability",
    "CR": "cornering round-off error", "CO": "cornering overshoot",
    "AV": "path velocity accuracy", "RV": "path velocity repeatability", "FV": "path velocity fluctuation",
}  # fmt: skip
"""What they are called in words; those of one angle are called as those of the position."""


def fewest_cycles(name: str) -> int:
    """Return of how many cycles a criterion is defined: two have a spread, and two tenths of 11 have one."""
    if name == "dRP":
        return 11
    return 2 if name.partition("_")[0] in ("RP", "RD", "RT", "RV", "dAP") else 1


@dataclass(frozen=True, slots=True)
class Criterion:
    """The value of one criterion.

    Attributes:
        name: AP, RP, AP_rz, ...
        at: The pose, plane, corner or leg it is of, such as "pose 1"; None: the largest of all.
        value: In `unit`; signed of AV; None where the cycles do not tell it.
        unit: m, rad, s, m/s or 1 (a share).
        cycles: How many cycles it rests on.
        tolerance: Largest absolute value allowed, or None.
        verdict: pass or fail; None without a tolerance.
    """

    name: str
    at: str | None
    value: float | None
    unit: str
    cycles: int
    tolerance: float | None = None
    verdict: Literal["pass", "fail"] | None = None

    @property
    def used(self) -> float | None:
        """Share of its tolerance that it uses up; None without one."""
        if self.tolerance is None or self.value is None:
            return None
        return abs(self.value) / self.tolerance


def overall_verdict(
    verdicts: Iterable[Literal["pass", "fail"] | None],
) -> Literal["pass", "fail"] | None:
    """Return fail if one of some verdicts is, else pass if there is one; None if nothing was judged."""
    known = set(verdicts) - {None}
    return None if not known else "fail" if "fail" in known else "pass"


def judged(
    name: str, at: str | None, value: float | None, cycles: int, tolerance: Mapping[str, float]
) -> Criterion:
    """Return a criterion with its verdict.

    Args:
        name: What it is called.
        at: Where it is; None over all.
        value: Its value in its unit.
        cycles: How many cycles it rests on.
        tolerance: Largest absolute values allowed, by criterion, in their units.
    """
    allowed = tolerance.get(name)
    if allowed is None or value is None:
        return Criterion(name, at, value, UNITS[name], cycles, allowed)
    verdict: Literal["pass", "fail"] = "pass" if abs(value) <= allowed else "fail"
    return Criterion(name, at, value, UNITS[name], cycles, allowed, verdict)


def accuracy(attained: FloatArray, command: FloatArray) -> FloatArray:
    """Return the accuracy of attained points: AP and AT, |barycentre - command|.

    Args:
        attained: In [m], shape (n, k, 3): cycles, places, coordinates.
        command: In [m], shape (k, 3).

    Returns:
        In [m], shape (k,).

    Source: after ISO 9283, as public evaluations have it.
    """
    return np.asarray(np.linalg.norm(attained.mean(axis=0) - command, axis=1))


def repeatability(attained: FloatArray) -> FloatArray | None:
    """Return the repeatability of attained points: RP and RT, mean l + 3 S.

    l_j = |p_j - barycentre|, S = sqrt(sum (l_j - mean l)^2 / (n - 1)).

    Args:
        attained: In [m], shape (n, k, 3): cycles, places, coordinates.

    Returns:
        In [m], shape (k,); None of one cycle.

    Source: after ISO 9283, as public evaluations have it.
    """
    if len(attained) < 2:
        return None
    distance = np.linalg.norm(attained - attained.mean(axis=0), axis=2)
    return np.asarray(distance.mean(axis=0) + 3.0 * distance.std(axis=0, ddof=1))


def threefold(values: FloatArray) -> FloatArray | None:
    """Return 3 S of values over the cycles: RD, RV, and the repeatability of an angle.

    S = sqrt(sum (x_j - mean x)^2 / (n - 1)).

    Args:
        values: In any unit, shape (n, ...): cycles first.

    Returns:
        In the same unit, shape (...); None of one cycle.

    Source: after ISO 9283, from common knowledge.
    """
    return None if len(values) < 2 else np.asarray(3.0 * values.std(axis=0, ddof=1))


def angles(quat_xyzw: FloatArray) -> FloatArray:
    """Return rz, ry, rx of orientations [-], shape (n, 4), with R = Rz Ry Rx, in [rad], shape (n, 3)."""
    r = to_matrices(quat_xyzw)
    rows = tuple(tuple(r[:, i, j] for j in range(3)) for i in range(3))
    rz, ry, rx, _ = euler_zyx(rows)  # type: ignore[arg-type]
    return np.column_stack((rz, ry, rx))


def turned(attained: FloatArray, command: FloatArray) -> FloatArray:
    """Return by how much attained angles differ from commanded ones, the shorter way round.

    Args:
        attained: rz, ry, rx in [rad], shape (n, k, 3).
        command: Likewise, shape (k, 3).

    Returns:
        In [rad], -pi to pi, shape (n, k, 3).
    """
    return np.asarray(np.remainder(attained - command + np.pi, 2.0 * np.pi) - np.pi)
