"""Verdicts: tolerances of every kind of deviation, and a delta meter's deviation judged as `compare` does it.

1. `parse_tolerance` and `check_tolerance` take a tolerance from the user, `complete_tolerance` its defaults.
2. `tolerance_for` looks up that of a quantity: |deviation| <= tolerance passes, a missing value fails.
3. `judge_delta_meter` judges a meter of a co-simulated system by it.
4. `format_verdict`, `format_decisive` and others format them for the terminal, the recording and the report.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from numbers import Real
from typing import Any

import numpy as np

from urmpipe_models import DEFAULT_TOLERANCE
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, OptionError, format_value
from urmpipe_models.measure_units import WRITTEN, quantity_to_si, readings
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import (
    AXES,
    KINDS,
    Deviation,
    Kind,
    SampleInterval,
    Share,
    Statistics,
    Verdict,
)
from urmpipe_pipeline.iso9283.criteria import UNITS as CRITERIA
from urmpipe_pipeline.presentation.digits import held, written
from urmpipe_pipeline.presentation.section import Value
from urmpipe_pipeline.provenance import format_assumptions, format_defaults

DEVIATIONS = ("axis", "x", "y", "z", "norm", "path", "angle", "joint")

# Default least shares, of the reference's samples that are shown and of the log's motion that is judged.
MIN_SHARES = {"coverage": 0.9, "judged": 0.5}

# The SI units of everything that may have a tolerance, deviations and criteria after ISO 9283; 1 of a share.
# axis is for x, y and z each; joint for each joint: a number without a unit is in rad where the joint turns
# and in m where it slides. A unit of length is an error there: joints that turn would take it for rad.
UNITS = {
    **{kind: "rad" if kind in ("angle", "joint") else "m" for kind in DEVIATIONS},
    **dict.fromkeys(MIN_SHARES, "1"),
    **CRITERIA,
}

ALLOWED = (
    "a length in m, or axis=, x=, y=, z=, norm=, path= (m, mm, um), angle=, joint= (rad, mrad, deg;"
    " m of a joint that slides)"
)
ALLOWED_NUMBERS = (
    "numbers of axis, x, y, z, norm, path in m, of angle, joint in rad (m of a joint that slides)"
)
ALLOWED_CRITERIA = (  # with iso
    "criteria: AP=, RP=, AD=, RD=, vAP=, OV=, dAP=, dRP=, AT=, RT=, CR=, CO= (m, mm, um), PSt= (s, ms), AV=,"
    " RV= (%), FV= (m/s, mm/s), AP_rz=, RP_ry=, AT_rx=, ... (rad, mrad, deg)"
)
ALLOWED_SHARES = ", coverage=, judged= (least shares, %)"
DECIMAL_COMMA = re.compile(r"\s*[0-9]+,[0-9]+\s*[a-z]*\s*")  # of a length alone: a comma separates two kinds


def parse_tolerance(
    text: str,
    parameter: str = "tolerance",
    bare: Sequence[str] = ("axis",),
    *,
    zero: bool = False,
    iso: bool = False,
) -> dict[str, float]:
    """Return tolerances in [m] and [rad] by kind, from "0.0035", "3.5mm" or "axis=3.5mm,angle=0.5deg".

    Args:
        text: One length, or kinds with theirs. Other kinds have no tolerance.
        parameter: The keyword that gave it, for messages.
        bare: The kinds that a length without a name is for.
        zero: Whether it is a noise: 0 is allowed, and no share.
        iso: Whether criteria after ISO 9283 are judged: messages name them.

    Raises:
        OptionError: With all errors.
    """
    if DECIMAL_COMMA.fullmatch(text):
        point = text.strip().replace(",", ".")
        allowed = f"a point before the decimals, {point}"
        raise OptionError(Finding(parameter=parameter, found=format_value(text), allowed=allowed))
    tolerance: dict[str, float] = {}
    errors = []
    for part in map(str.strip, text.split(",")):
        name, sign, value = part.rpartition("=")
        kinds = (name.strip(),) if sign else tuple(bare)
        value = re.sub(r"^\s*(±|\+-)", "", value)
        unit = UNITS.get(kinds[0], "")
        number = quantity_to_si(value, WRITTEN.get(unit, {}))
        if ambiguous := readings(value, unit) if math.isfinite(number) else ():
            prefix = f"{kinds[0]}=" if sign else ""
            allowed = f"a unit: {' or '.join(f'{prefix}{reading}' for reading in ambiguous)}"
            errors.append(Finding(parameter=parameter, found=part, allowed=allowed))
        fits = _is_in_range(kinds[0], number, zero)
        twice = " twice" if fits and not tolerance.keys().isdisjoint(kinds) else ""
        if twice or not (fits or ambiguous):
            angle = not (sign or twice) and _is_in_range("angle", quantity_to_si(value, WRITTEN["rad"]), zero)
            meant = ("angle", "joint") if angle else ()
            hints = tuple(Hint(parameter, f"{kind}={part}", "specifies the kind") for kind in meant)
            allowed = (ALLOWED_CRITERIA if iso else ALLOWED) + ("" if zero else ALLOWED_SHARES)
            found = f"{format_value(part)}{twice}"
            errors.append(Finding(parameter=parameter, found=found, allowed=allowed, hints=hints))
        else:
            tolerance |= dict.fromkeys(kinds, number)
    if errors:
        raise OptionError(*errors)
    return tolerance


def check_tolerance(
    tolerance: Mapping[str, float],
    parameter: str = "tolerance",
    *,
    zero: bool = False,
    iso: bool | None = False,
) -> None:
    """Raise an `OptionError` with every entry of a tolerance that is no kind or no positive number.

    Args:
        tolerance: In [m] or [rad], by kind; of criteria in their units.
        parameter: The keyword that gave it, for messages.
        zero: Whether it is a noise: 0 is allowed, and no share.
        iso: Whether criteria after ISO 9283 are judged, which need none; else deviations; None: of either.
    """
    sign = "0 or positive" if zero else "positive; coverage, judged 0 to 1"
    allowed = ALLOWED_CRITERIA if iso else ALLOWED_NUMBERS
    kinds = UNITS if iso is None else (*(CRITERIA if iso else DEVIATIONS), *MIN_SHARES)
    errors = [
        Finding(parameter=parameter, found=f"{kind}={value}", allowed=f"{allowed}; {sign}")
        for kind, value in tolerance.items()
        if kind not in kinds or not isinstance(value, Real) or not _is_in_range(kind, float(value), zero)
    ]
    if not tolerance and not iso:
        errors = [Finding(parameter=parameter, found="nothing", allowed=ALLOWED_NUMBERS)]
    if errors:
        raise OptionError(*errors)


def tolerance_for(quantity: str, kind: str, tolerance: Mapping[str, float]) -> float | None:
    """Return the tolerance of a quantity: by its name if it is a coordinate, else by its kind."""
    by_name = tolerance.get(quantity) if kind == "axis" else None
    return by_name if by_name is not None else tolerance.get(kind)


def complete_tolerance(tolerance: Mapping[str, float]) -> dict[str, float]:
    """Return a tolerance with the least shares, and with an axis where it has no deviation."""
    deviations = deviation_tolerances(tolerance) or {"axis": DEFAULT_TOLERANCE}
    return deviations | MIN_SHARES | dict(tolerance)


def deviation_tolerances(tolerance: Mapping[str, float]) -> dict[str, float]:
    """Return a tolerance without its least shares."""
    return {kind: value for kind, value in tolerance.items() if kind not in MIN_SHARES}


def _is_in_range(kind: str, value: float, zero: bool) -> bool:
    if kind in MIN_SHARES:
        return not zero and 0.0 <= value <= 1.0
    return 0.0 < value < math.inf or (zero and value == 0.0)


@dataclass(frozen=True, slots=True)
class DeltaMeterResult:
    """Verdict on a delta meter of a co-simulated system.

    Attributes:
        block: Name of the meter.
        variables: Its signals that are compared with the tolerance, such as ("delta", "norm").
        tolerance: Largest absolute deviation allowed in [m], by kind (axis, norm) or coordinate (x, y, z).
        quantity: x, y, z or norm: the one that uses up most of its tolerance.
        worst: Its largest absolute value in [m].
        t: Its time in [s].
        sample: Its sample, from 0.
        samples: Number of judged samples.
        out_of_tolerance: Number of samples out of it in any quantity, or without a value.
        verdict: pass if that is 0, and there is no other reason to fail.
        caveats: Other reasons to fail, such as "bad.y, which leads to it, is not finite".
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
        """Kind of the worst quantity: axis or norm."""
        return KINDS[self.quantity]

    @property
    def allowed(self) -> float | None:
        """Tolerance of the worst quantity in [m]; None without one."""
        return tolerance_for(self.quantity, self.kind, self.tolerance)

    @property
    def utilisation(self) -> float | None:
        """Utilisation of its tolerance by the worst value; None where a sample has no value."""
        if self.allowed is None or not math.isfinite(self.worst):
            return None
        return float(_utilisation(np.array(self.worst), np.array(self.allowed)))

    @property
    def out_fraction(self) -> float:
        """Share of the samples out of tolerance, 0..1."""
        return self.out_of_tolerance / self.samples

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        worst = self.worst if math.isfinite(self.worst) else None
        fields = asdict(self) | {"worst": worst, "caveats": list(self.caveats), "coverage": self.coverage}
        return {name: value for name, value in fields.items() if name != "variables"}


def judge_delta_meter(
    block: str,
    t_ns: IntArray,
    delta: FloatArray,
    tolerance: Mapping[str, float],
    caveats: Sequence[str] = (),
) -> DeltaMeterResult | None:
    """Compare the deviation of a delta meter with a tolerance; None without a sample.

    Args:
        block: Name of the meter.
        t_ns: Times in integer [ns], shape (n,).
        delta: reference - actual in [m], shape (n, 3).
        tolerance: Largest absolute deviation allowed in [m]: axis, norm, or x, y, z.
        caveats: Reasons to fail even if all samples are within tolerance.

    Raises:
        OptionError: If a tolerance is of another kind, or negative.
    """
    allowed_kinds = ("axis", *AXES)
    errors = [
        f"{block}: found a tolerance {kind}={value:g}, allowed: {', '.join(allowed_kinds)}; 0 or positive"
        for kind, value in tolerance.items()
        if kind not in allowed_kinds or not 0.0 <= value < math.inf
    ]
    if errors or not tolerance:
        raise OptionError(*(errors or [f"{block}: found no tolerance, allowed: {', '.join(allowed_kinds)}"]))
    if not len(t_ns):
        return None
    x, y, z = np.abs(delta).T
    # The norm has the same order of summation as the block's, so that both are equal bit for bit.
    sizes = np.column_stack((x, y, z, np.sqrt(x * x + y * y + z * z)))
    limits = [tolerance_for(axis, KINDS[axis], tolerance) for axis in AXES]
    allowed = np.array([math.inf if limit is None else limit for limit in limits])
    known = np.isfinite(sizes).all(axis=1)
    out = ~known | (sizes > allowed).any(axis=1)
    # Each column has its largest value; of several of infinite utilisation the larger one is worse. A sample
    # without a value is the worst of all.
    judged = np.flatnonzero(np.isfinite(allowed))
    rows = np.argmax(np.where(known[:, np.newaxis], sizes, math.inf)[:, judged], axis=0)
    largest = np.where(known[rows], sizes[rows, judged], math.inf)
    used = _utilisation(largest, allowed[judged])
    worst = int(np.argmax(np.where(np.isinf(used), largest, 0.0) if np.isinf(used).any() else used))
    row, axis = int(rows[worst]), int(judged[worst])
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


def _utilisation(sizes: FloatArray, allowed: FloatArray) -> FloatArray:
    """Return sizes / allowed; infinite if nothing is allowed, 0 for a size of 0."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.where(sizes > 0.0, sizes / allowed, 0.0)


SYMBOLS = dict(zip(AXES, ("Δx", "Δy", "Δz", "‖Δ‖"), strict=True))
"""The quantities of a deviation as people read them."""

NAMED = 3
"""Logs out of tolerance that a verdict names; more are only counted."""


def format_verdict(one: Comparison) -> str:
    """Return which logs are out of tolerance against what, or that all are within, and what that rests on."""
    failed = [run for run in one.runs if run.verdict == "fail"]
    total = len(one.runs) + len(one.failed_logs)
    said = f"{_who(failed or one.runs, total)} {'out of' if failed else 'within'} tolerance"
    said += f" against {one.reference.name}{_points(one)}{_part(one)}{_clocks(one)}"
    if one.baseline and one.baseline.verdict == "fail":
        said += f", {'and' if failed else 'but'} worse than the baseline {one.baseline.name}"
    lost = f"; not judged: {text.join_list([log.name for log in one.failed_logs])}" if one.failed_logs else ""
    return said + format_assumptions(one.assumptions) + format_defaults(one.provenance) + lost


def _who(runs: Sequence[Deviation], total: int) -> str:
    """Return some of so many logs: the only one by name, else how many, and which if they are few."""
    if total == 1:
        return runs[0].name
    if len(runs) == total:
        return "both logs" if total == 2 else f"all {total} logs"
    names = f" ({', '.join(run.name for run in runs)})" if len(runs) <= NAMED else ""
    return f"{len(runs)} of {total} logs{names}"


def _points(one: Comparison) -> str:
    """Return by which tool centre points a log is held against others; nothing if a path is the reference."""
    if not one.reference.joints:
        return ""
    if one.provenance.options.get("tcp") == "recorded":
        return ", as recorded on both sides"
    if not one.worst.statistics:
        return ", by the joints alone"
    every = all(run.run.log.joints for run in one.runs)
    return f", by the joints {'on both sides' if every else 'of the reference'}"


def _part(one: Comparison) -> str:
    """Return what a verdict does not rest on, as "; coverage 0.5 % of 90 % needed, ..."; else nothing."""
    partly = [run for run in one.runs if run.incomplete_shares]
    if len(partly) > NAMED:
        return f"; coverage or judged below 99 % in {len(partly)} logs"
    several = len(one.runs) > 1
    return "".join(
        f"; {format_share(share, run.name if several else '')}"
        for run in partly
        for share in run.incomplete_shares
    )


def _clocks(one: Comparison) -> str:
    """Return which clocks were put together by absolute stamps, the offset of a single log; else nothing."""
    stamped = [run.sync for run in one.runs if run.sync.mode == "stamps"]
    if not stamped:
        return ""
    if len(one.runs) == 1:
        return f"; clocks by their stamps (offset {text.format_seconds(stamped[0].offset)} s)"
    some = "" if len(stamped) == len(one.runs) else f" of {format_count(len(stamped), 'log')}"
    return f"; clocks{some} by their stamps"


def format_share(one: Share, whose: str = "") -> str:
    """Return a share, of one of several logs with its name, and if it is too small what was not seen.

    As in "coverage 0.5 % of 90 % needed, longest unseen: 3.970 s from t = 0.010 s of the reference".
    """
    of = f" of {whose}" if whose else ""
    if one.verdict != "fail":
        return f"{one.quantity}{of} {text.format_percent(one.value)}"
    said = f"{one.quantity}{of} {held(Value(one.value, '%', one.tolerance, least=True))}"
    return said if whose else f"{said}{format_unseen(one)}"


def format_unseen(one: Share) -> str:
    """Return where most was unseen, as ", longest unseen: 3.970 s from t = 0.010 s of the reference"."""
    side = "reference" if one.quantity == "coverage" else "log"
    return (
        ""
        if one.longest_unseen is None
        else f", longest unseen: {format_interval(one.longest_unseen)} of the {side}"
    )


def symbol(one: Statistics | Share | DeltaMeterResult) -> str:
    """Return what a quantity is called: Δx, ‖Δ‖, path, angle, coverage, or a joint by its name."""
    return SYMBOLS[one.quantity] if one.kind in ("axis", "norm") else one.quantity


def absolute_symbol(one: Statistics | Share | DeltaMeterResult) -> str:
    """Return what the absolute value of a quantity is called: |Δx|, ‖Δ‖, path, angle, |Δ phi1|."""
    if one.kind == "joint":
        return f"|Δ {one.quantity}|"
    return f"|{symbol(one)}|" if one.kind == "axis" else symbol(one)


def quantity_name(one: Statistics | Share) -> str:
    """Return the name of a quantity, unique in its log: a joint may be called x."""
    return f"joint {one.quantity}" if one.kind == "joint" else one.quantity


def format_utilisation(one: Statistics | Share | DeltaMeterResult) -> str:
    """Return how much of its tolerance a deviation uses up: "71.0 % of the tolerance"; else nothing."""
    if one.utilisation is None or isinstance(one, Share):
        return ""
    if isinstance(one, Statistics) and one.missing:
        return f"no value at {one.missing} of {(one.samples or 0) + one.missing} samples"
    return "" if math.isinf(one.utilisation) else f"{text.format_portion(one.utilisation)} the tolerance"


def format_amount(one: Statistics | Share) -> str:
    """Return how far a quantity goes, and of how much: "|Δx| = 4.2000 mm of 3.5 mm allowed".

    Where a quantity with a tolerance lacks values, that: "angle has no value at 3 of 40 samples".
    """
    if isinstance(one, Share):
        return f"{one.quantity} = {held(Value(one.value, '%', one.tolerance, least=True))}"
    if one.tolerance is not None and one.missing:
        return f"{absolute_symbol(one)} has {format_utilisation(one)}"
    return f"{absolute_symbol(one)} = {held(Value(one.max, one.unit, one.tolerance))}"


def format_decisive(one: Statistics | Share) -> str:
    """Return how much of how much a quantity is, and when; of a share what was not seen.

    As in "|Δx| = 4.2000 mm of 3.5 mm allowed (1.2 times the tolerance) at t = 1.250 s".
    """
    if isinstance(one, Share):
        return (
            f"{format_amount(one)} ({one.samples} of {format_count(one.total, 'sample')}){format_unseen(one)}"
        )
    lacks = one.tolerance is not None and one.missing
    used = format_utilisation(one)
    return (
        format_amount(one)
        if lacks
        else f"{format_amount(one)}{f' ({used})' if used else ''} {format_time_of_max(one)}"
    )


def format_peak(one: Deviation) -> str:
    """Return what the furthest quantity of a log does where it is largest: it decides, if no share does."""
    return "decides" if isinstance(one.decisive, Statistics) else "deviates most"


def format_time_of_max(one: Statistics) -> str:
    """Return when a quantity was largest: "at t = 1.250 s"; of still poses in which row: "in row 3"."""
    timed = not math.isnan(one.t_max)
    return f"at t = {text.format_seconds(one.t_max)} s" if timed else f"in row {one.sample_max + 1}"


def format_delta_meter(one: DeltaMeterResult) -> str:
    """Return what a delta meter found: how much of how much, when, how often it was too much; its doubts."""
    amount = "has no value" if one.utilisation is None else f"= {held(Value(one.worst, 'm', one.allowed))}"
    used = format_utilisation(one)
    said = (
        f"{absolute_symbol(one)} {amount}{f' ({used})' if used else ''} at t = {text.format_seconds(one.t)} s"
    )
    out = f"out of tolerance: {format_out_of_tolerance(one.out_of_tolerance, one.samples)}"
    lacks = (
        f"coverage {text.format_percent(one.coverage)}: {one.missing} without a value" if one.missing else ""
    )
    return "; ".join(filter(None, (said, out, lacks, *one.caveats)))


def format_out_of_tolerance(out: int, of: int) -> str:
    """Return how many samples are out of tolerance: "13 of 100 samples (13.0 %)"."""
    return f"{out} of {format_count(of, 'sample')} ({text.format_percent(out / of)})"


def format_interval(found: SampleInterval) -> str:
    """Return how long and from when a log was out of tolerance or unseen: "0.500 s from t = 1.250 s"."""
    if found.t is None or found.duration is None:
        return f"{format_count(found.samples, 'row')} from row {found.sample + 1}"
    lasts = "1 sample at" if found.samples == 1 else f"{text.format_seconds(found.duration)} s from"
    return f"{lasts} t = {text.format_seconds(found.t)} s"


def format_tolerance(allowed: Mapping[str, float], joint_units: Iterable[str] = ("rad",)) -> str:
    """Return a comparison's tolerance as people read it: "±3.5 mm per axis, 0.5 deg of orientation".

    Args:
        allowed: In [m] or [rad], by kind or coordinate; least shares, named if they are not the default.
        joint_units: The units of the joints that are held to a tolerance, rad or m.
    """
    words = {
        "axis": "±{} per axis",
        "norm": "{} norm",
        "path": "{} from the path",
        "angle": "{} of orientation",
        "joint": "±{} per joint",
        **{axis: f"±{{}} {axis}" for axis in "xyz"},
        **{share: f"{share} {{}}" for share in MIN_SHARES},
    }
    units = {"angle": ["rad"], "joint": sorted(set(joint_units), reverse=True)}
    return ", ".join(
        words[kind].format(
            written(Value(value, "%", given=True), unit=True)
            if kind in MIN_SHARES
            else " or ±".join(text.format_stated(value, unit) for unit in units.get(kind, ["m"]))
        )
        for kind, value in allowed.items()
        if value != MIN_SHARES.get(kind)
    )
