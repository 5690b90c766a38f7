"""Tolerances: what is allowed of each kind of deviation."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from numbers import Real

from urmpipe_models import DEFAULT_TOLERANCE
from urmpipe_models.errors import Finding, Hint, OptionError, format_value
from urmpipe_models.measure_units import WRITTEN, quantity_to_si, readings
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
