"""Tolerances: what is allowed of each kind of deviation."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from numbers import Real
from typing import Any

import numpy as np

from urmpipe_models import DEFAULT_TOLERANCE
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, OptionError, format_value
from urmpipe_models.measure_units import WRITTEN, quantity_to_si, readings
from urmpipe_pipeline.comparison.deviation import AXES, KINDS, Kind, Verdict
from urmpipe_pipeline.iso9283.criteria import UNITS as CRITERIA

DEVIATIONS = ("axis", "x", "y", "z", "norm", "path", "angle", "joint")

LEAST_SHARES = {"coverage": 0.9, "judged": 0.5}
"""What has to be seen unless other shares are given: of the reference's samples, of the log's motion."""

UNITS = {
    **{kind: "rad" if kind in ("angle", "joint") else "m" for kind in DEVIATIONS},
    **dict.fromkeys(LEAST_SHARES, "1"),
    **CRITERIA,
}
"""What a tolerance may be of, deviations and criteria after ISO 9283, and its SI unit; 1 of a share.

axis holds for x, y and z each; joint for each joint: a number without a unit is in rad where the joint turns
and in m where it slides. A unit of length is refused there: joints that turn would take it for rad.
"""

ALLOWED = (
    "a length in m, or axis=, x=, y=, z=, norm=, path= (m, mm, um), angle=, joint= (rad, mrad, deg;"
    " m of a joint that slides)"
)

ALLOWED_NUMBERS = (
    "numbers of axis, x, y, z, norm, path in m, of angle, joint in rad (m of a joint that slides)"
)

ALLOWED_CRITERIA = (
    "criteria: AP=, RP=, AD=, RD=, vAP=, OV=, dAP=, dRP=, AT=, RT=, CR=, CO= (m, mm, um), PSt= (s, ms), AV=,"
    " RV= (%), FV= (m/s, mm/s), AP_rz=, RP_ry=, AT_rx=, ... (rad, mrad, deg)"
)
"""What a tolerance of a test after ISO 9283 may be of."""

ALLOWED_SHARES = ", coverage=, judged= (least shares, %)"

DECIMAL_COMMA = re.compile(r"\s*[0-9]+,[0-9]+\s*[a-z]*\s*")
"""A length alone with a decimal comma: a comma parts two kinds."""


def parse_tolerance(
    text: str,
    parameter: str = "tolerance",
    bare: Sequence[str] = ("axis",),
    *,
    zero: bool = False,
    iso: bool = False,
) -> dict[str, float]:
    """Return what is allowed in [m] and [rad] by kind, from "0.0035", "3.5mm" or "axis=3.5mm,angle=0.5deg".

    Args:
        text: One length, or some kinds with theirs. What is not named has no tolerance.
        parameter: The keyword that gave it, for messages.
        bare: The kinds that a length without a name is for.
        zero: Whether it is a noise: 0 is allowed, and no share.
        iso: Whether criteria after ISO 9283 are judged: messages name them.

    Raises:
        OptionError: With everything that is wrong.
    """
    if DECIMAL_COMMA.fullmatch(text):
        point = text.strip().replace(",", ".")
        allowed = f"a point before the decimals, {point}"
        raise OptionError(Finding(parameter=parameter, found=format_value(text), allowed=allowed))
    found: dict[str, float] = {}
    named: set[str] = set()
    faults = []
    for part, kinds, value in _parts(text, bare):
        unit = UNITS.get(kinds[0], "")
        number = quantity_to_si(value, WRITTEN.get(unit, {}))
        fits = _fits(kinds[0], number, zero)
        both = readings(value, unit) if math.isfinite(number) else ()
        if both:
            name = f"{kinds[0]}=" if "=" in part else ""
            allowed = f"a unit: {' or '.join(f'{name}{one}' for one in both)}"
            faults.append(Finding(parameter=parameter, found=part.strip(), allowed=allowed))
        twice = " twice" if fits and not named.isdisjoint(kinds) else ""
        if (not fits and not both) or twice:
            angle = (
                "=" not in part and _fits("angle", quantity_to_si(value, WRITTEN["rad"]), zero) and not twice
            )
            of_what = ("angle", "joint") if angle else ()
            hints = tuple(Hint(parameter, f"{one}={part.strip()}", "specifies the kind") for one in of_what)
            said = f"{format_value(part.strip())}{twice}"
            allowed = (ALLOWED_CRITERIA if iso else ALLOWED) + ("" if zero else ALLOWED_SHARES)
            faults.append(Finding(parameter=parameter, found=said, allowed=allowed, hints=hints))
            continue
        named.update(kinds)
        found |= dict.fromkeys(kinds, number)
    if faults:
        raise OptionError(*faults)
    return found


def _parts(text: str, bare: Sequence[str]) -> Iterator[tuple[str, tuple[str, ...], str]]:
    """Yield each part of a tolerance with the kinds that it is for and the quantity, without its ±."""
    for part in text.split(","):
        name, sign, value = part.rpartition("=")
        yield part, (name.strip(),) if sign else tuple(bare), re.sub(r"^\s*(±|\+-)", "", value)


def check_tolerance(
    tolerance: Mapping[str, float],
    parameter: str = "tolerance",
    *,
    zero: bool = False,
    iso: bool | None = False,
) -> None:
    """Raise an `OptionError` with everything in a tolerance that is no kind or no positive number.

    Args:
        tolerance: In [m] or [rad], by kind; of criteria in their units.
        parameter: The keyword that gave it, for messages.
        zero: Whether it is a noise: 0 is allowed, and no share.
        iso: Whether criteria after ISO 9283 are judged, which need none; else deviations; None: of either.
    """
    sign = "0 or positive" if zero else "positive; coverage, judged 0 to 1"
    allowed = ALLOWED_CRITERIA if iso else ALLOWED_NUMBERS
    kinds = UNITS if iso is None else (*(CRITERIA if iso else DEVIATIONS), *LEAST_SHARES)
    faults = [
        Finding(parameter=parameter, found=f"{kind}={value}", allowed=f"{allowed}; {sign}")
        for kind, value in tolerance.items()
        if kind not in kinds or not isinstance(value, Real) or not _fits(kind, float(value), zero)
    ]
    if not tolerance and not iso:
        faults = [Finding(parameter=parameter, found="nothing", allowed=ALLOWED_NUMBERS)]
    if faults:
        raise OptionError(*faults)


def allowed_for(quantity: str, kind: str, tolerance: Mapping[str, float]) -> float | None:
    """Return what is allowed of a quantity: by its own name if it is a coordinate, else by its kind."""
    own = tolerance.get(quantity) if kind == "axis" else None
    return own if own is not None else tolerance.get(kind)


def complete_tolerance(given: Mapping[str, float]) -> dict[str, float]:
    """Return a tolerance with what always holds: least shares, and an axis where no deviation is named."""
    otherwise = {} if deviations_of(given) else {"axis": DEFAULT_TOLERANCE}
    return otherwise | deviations_of(given) | LEAST_SHARES | dict(given)


def deviations_of(tolerance: Mapping[str, float]) -> dict[str, float]:
    """Return a tolerance without its least shares."""
    return {kind: value for kind, value in tolerance.items() if kind not in LEAST_SHARES}


def _fits(kind: str, value: float, zero: bool) -> bool:
    if kind in LEAST_SHARES:
        return not zero and 0.0 <= value <= 1.0
    return 0.0 < value < math.inf or (zero and value == 0.0)


@dataclass(frozen=True, slots=True)
class DeltaMeterResult:
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
        caveats: What else keeps it from passing, such as "bad.y, which leads to it, is not finite".
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
    caveats: tuple[str, ...] = ()
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
    def utilisation(self) -> float | None:
        """Share of its tolerance that the worst value uses up; None where a sample has no value."""
        if self.allowed is None or not math.isfinite(self.worst):
            return None
        return float(_shares(np.array(self.worst), np.array(self.allowed)))

    @property
    def out_fraction(self) -> float:
        """Share of the samples out of tolerance, 0..1."""
        return self.out_of_tolerance / self.samples

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        worst = self.worst if math.isfinite(self.worst) else None
        told = asdict(self) | {"worst": worst, "caveats": list(self.caveats), "coverage": self.coverage}
        return {name: value for name, value in told.items() if name != "variables"}


def delta_verdict(
    block: str,
    t_ns: IntArray,
    delta: FloatArray,
    tolerance: Mapping[str, float],
    caveats: Sequence[str] = (),
) -> DeltaMeterResult | None:
    """Hold the deviation of a delta meter against a tolerance; None without a sample.

    Args:
        block: Name of the meter.
        t_ns: Times in integer [ns], shape (n,).
        delta: reference - actual in [m], shape (n, 3).
        tolerance: Largest absolute deviation allowed in [m]: axis, norm, or x, y, z.
        caveats: Why it shall not pass even where no sample is out of tolerance.

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
    return DeltaMeterResult(
        block=block,
        variables=("delta", "norm"),
        tolerance=dict(tolerance),
        quantity=AXES[axis],
        worst=float(sizes[row, axis]) if known[row] else math.nan,
        t=float(t_ns[row]) / 1e9,
        sample=row,
        samples=len(t_ns),
        out_of_tolerance=int(np.count_nonzero(out)),
        verdict="fail" if out.any() or caveats else "pass",
        caveats=tuple(caveats),
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
