"""The criteria of ISO 9283: names, units, verdicts, and the statistics that several of them share.

Over n cycles, with attained points p_j, their barycentre p_m and the command c:

- accuracy (AP, AT): |p_m - c|
- repeatability (RP, RT): mean l + 3 S of the distances l_j = |p_j - p_m|
- 3 S of other quantities x_j (RD, RV, repeatability of an angle), S = sqrt(sum (x_j - mean x)^2 / (n - 1))
- angles rz, ry, rx of an orientation, R = Rz Ry Rx; accuracy |mean - command|, repeatability 3 S

Source: after ISO 9283; accuracy and repeatability as public evaluations have them, the others from common
knowledge. The text of the standard was not at hand.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import euler_zyx, to_matrices

ANGLES = ("rz", "ry", "rx")  # the order of their columns

UNITS: dict[str, str] = {
    "AP": "m", "RP": "m",
    **{f"{name}_{angle}": "rad" for name in ("AP", "RP") for angle in ANGLES},
    "AD": "m", "RD": "m", "vAP": "m", "PSt": "s", "OV": "m", "dAP": "m", "dRP": "m",
    "AT": "m", "RT": "m",
    **{f"{name}_{angle}": "rad" for name in ("AT", "RT") for angle in ANGLES},
    "CR": "m", "CO": "m", "AV": "1", "RV": "1", "FV": "m/s",
}  # fmt: skip
"""The SI unit of each criterion, in the order in which they are listed; 1 of a fraction."""

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
"""The full name of each criterion; those of an angle have the name of the one of the position."""

Verdict: TypeAlias = Literal["pass", "fail"] | None

Value: TypeAlias = tuple[str, str, float | None]
"""Name of a criterion, the pose, plane, corner or leg, and its value."""


def min_cycles(name: str) -> int:
    """Return the number of cycles that a criterion needs: two for a spread, eleven for that of two tenths."""
    if name == "dRP":
        return 11
    return 2 if name.partition("_")[0] in ("RP", "RD", "RT", "RV", "dAP") else 1


@dataclass(frozen=True, slots=True)
class Criterion:
    """The value of one criterion.

    Attributes:
        name: AP, RP, AP_rz, ...
        at: Its pose, plane, corner or leg, such as "pose 1"; None: the largest of all.
        value: In `unit`; signed for AV; None if the cycles do not determine it.
        unit: m, rad, s, m/s or 1 (a fraction).
        cycles: Number of cycles.
        tolerance: Largest absolute value allowed, or None.
        verdict: pass or fail; None without a tolerance.
    """

    name: str
    at: str | None
    value: float | None
    unit: str
    cycles: int
    tolerance: float | None = None
    verdict: Verdict = None

    @property
    def utilisation(self) -> float | None:
        """Its absolute value divided by its tolerance; None without one."""
        if self.tolerance is None or self.value is None:
            return None
        return abs(self.value) / self.tolerance


def combine_verdicts(verdicts: Iterable[Verdict]) -> Verdict:
    """Return fail if a verdict is fail, else pass if there is one, else None."""
    known = set(verdicts) - {None}
    return None if not known else "fail" if "fail" in known else "pass"


def judge_criterion(
    name: str, at: str | None, value: float | None, cycles: int, tolerance: Mapping[str, float]
) -> Criterion:
    """Return a criterion with its verdict.

    Args:
        name: Its name.
        at: Its pose, plane, corner or leg; None over all.
        value: Its value in its unit.
        cycles: Number of cycles.
        tolerance: Largest absolute values allowed, by criterion, in their units.
    """
    allowed = tolerance.get(name)
    if allowed is None or value is None:
        return Criterion(name, at, value, UNITS[name], cycles, allowed)
    verdict: Verdict = "pass" if abs(value) <= allowed else "fail"
    return Criterion(name, at, value, UNITS[name], cycles, allowed, verdict)


def judge_all(values: Sequence[Value], cycles: int, tolerance: Mapping[str, float]) -> Iterator[Criterion]:
    """Yield each criterion at its largest value, then at each place, in the order of `UNITS`."""
    for name in UNITS:
        own_values = [(at, value) for other, at, value in values if other == name]
        finite = [
            (at, value if value is not None and np.isfinite(value) else None) for at, value in own_values
        ]
        if finite:
            known = [value for _, value in finite if value is not None]
            yield judge_criterion(name, None, max(known, key=abs, default=None), cycles, tolerance)
            yield from (judge_criterion(name, at, value, cycles, tolerance) for at, value in finite)


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
        In [m], shape (k,); None for one cycle.

    Source: after ISO 9283, as public evaluations have it.
    """
    if len(attained) < 2:
        return None
    distance = np.linalg.norm(attained - attained.mean(axis=0), axis=2)
    return np.asarray(distance.mean(axis=0) + 3.0 * distance.std(axis=0, ddof=1))


def three_sigma(values: FloatArray) -> FloatArray | None:
    """Return 3 S of values over the cycles: RD, RV, and the repeatability of an angle.

    S = sqrt(sum (x_j - mean x)^2 / (n - 1)).

    Args:
        values: In any unit, shape (n, ...): cycles first.

    Returns:
        In the same unit, shape (...); None for one cycle.

    Source: after ISO 9283, from common knowledge.
    """
    return None if len(values) < 2 else np.asarray(3.0 * values.std(axis=0, ddof=1))


def euler_angles(quat_xyzw: FloatArray) -> FloatArray:
    """Return rz, ry, rx of orientations [-], shape (n, 4), with R = Rz Ry Rx, in [rad], shape (n, 3)."""
    r = to_matrices(quat_xyzw)
    rows = tuple(tuple(r[:, i, j] for j in range(3)) for i in range(3))
    rz, ry, rx, _ = euler_zyx(rows)  # type: ignore[arg-type]
    return np.column_stack((rz, ry, rx))


def angle_values(
    kind: str, places: Sequence[str], attained: FloatArray, command: FloatArray
) -> Iterator[Value]:
    """Yield accuracy and repeatability of the angles rz, ry and rx.

    A = |mean angle - commanded angle|, R = 3 S of the angle over the cycles; differences -pi to pi.

    Args:
        kind: P of poses, T of paths.
        places: Names of the places.
        attained: rz, ry, rx in [rad], shape (n, k, 3).
        command: Likewise, shape (k, 3).

    Source: after ISO 9283, from common knowledge.
    """
    difference = np.remainder(attained - command + np.pi, 2.0 * np.pi) - np.pi
    spread = three_sigma(difference)
    for axis, angle in enumerate(ANGLES):
        yield from values_at(f"A{kind}_{angle}", places, np.abs(difference[:, :, axis].mean(axis=0)))
        yield from values_at(f"R{kind}_{angle}", places, None if spread is None else spread[:, axis])


def values_at(name: str, places: Sequence[str], values: FloatArray | None) -> Iterator[Value]:
    """Yield a criterion at each of k places; its values in [m] or [rad], shape (k,), or None."""
    for k, place in enumerate(places):
        yield name, place, None if values is None else float(values[k])
