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
    " m of a prismatic joint)"
)
ALLOWED_NUMBERS = "numbers of axis, x, y, z, norm, path in m, of angle, joint in rad (m of a prismatic joint)"
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
            possible = [
                f"{prefix}{reading}"
                for reading in ambiguous
                if _is_in_range(kinds[0], quantity_to_si(reading, WRITTEN[unit]), zero)
            ]
            allowed = f"a unit: {' or '.join(possible)}"
            errors.append(Finding(parameter=parameter, found=part, allowed=allowed))
        fits = _is_in_range(kinds[0], number, zero)
        twice = " twice" if fits and not tolerance.keys().isdisjoint(kinds) else ""
        if twice or not (fits or ambiguous):
            angle = not (sign or twice) and _is_in_range("angle", quantity_to_si(value, WRITTEN["rad"]), zero)
            likely = ("angle", "joint") if angle else ()
            hints = tuple(Hint(parameter, f"{kind}={part}", "specifies the kind") for kind in likely)
            allowed = (ALLOWED_CRITERIA if iso else ALLOWED) + ("" if zero else ALLOWED_SHARES)
            quoted = f"{format_value(part)}{twice}"
            errors.append(Finding(parameter=parameter, found=quoted, allowed=allowed, hints=hints))
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


# The symbols of the quantities of a deviation.
SYMBOLS = dict(zip(AXES, ("Δx", "Δy", "Δz", "‖Δ‖"), strict=True))

MAX_NAMED = 3  # logs out of tolerance that a verdict names; more are only counted


def format_verdict(comparison: Comparison) -> str:
    """Return the logs out of tolerance, or that all are within, the reference, and the assumptions."""
    failed = [run for run in comparison.runs if run.verdict == "fail"]
    total = len(comparison.runs) + len(comparison.failed_logs)
    is_out = any(statistics.verdict == "fail" for run in failed for statistics in run.all_statistics)
    verdict = "within tolerance" if not failed else "out of tolerance" if is_out else "not fully judged"
    message = f"{_who(failed or comparison.runs, total)} {verdict} against {comparison.reference.name}"
    message += f"{_points(comparison)}{_part(comparison)}{_clocks(comparison)}"
    if comparison.baseline and comparison.baseline.verdict == "fail":
        message += f", {'and' if failed else 'but'} worse than the baseline {comparison.baseline.name}"
    message += format_assumptions(comparison.assumptions) + format_defaults(comparison.provenance)
    if comparison.failed_logs:
        message += f"; not judged: {text.join_list([log.name for log in comparison.failed_logs])}"
    return message


def _who(runs: Sequence[Deviation], total: int) -> str:
    """Return a single log by name, else the number of logs out of the total, with their names if few."""
    if total == 1:
        return runs[0].name
    if len(runs) == total:
        return "both logs" if total == 2 else f"all {total} logs"
    names = f" ({', '.join(run.name for run in runs)})" if len(runs) <= MAX_NAMED else ""
    return f"{len(runs)} of {total} logs{names}"


def _points(comparison: Comparison) -> str:
    """Return the tool centre points that are compared; empty if a path is the reference."""
    if not comparison.reference.joints:
        return ""
    if comparison.provenance.options.get("tcp") == "recorded":
        return ", as recorded on both sides"
    if not comparison.worst.statistics:
        return ", by the joints alone"
    all_computed = all(run.run.log.joints for run in comparison.runs)
    return f", by the joints {'on both sides' if all_computed else 'of the reference'}"


def _part(comparison: Comparison) -> str:
    """Return the shares that are too small, as "; coverage 0.5 % of 90 % needed, ..."; empty without any."""
    partly = [run for run in comparison.runs if run.incomplete_shares]
    if len(partly) > MAX_NAMED:
        return f"; coverage or judged below 99 % in {len(partly)} logs"
    several = len(comparison.runs) > 1
    return "".join(
        f"; {format_share(share, run.name if several else '')}"
        for run in partly
        for share in run.incomplete_shares
    )


def _clocks(comparison: Comparison) -> str:
    """Return the clocks that absolute stamps synchronise, with the offset of a single log; else empty."""
    stamped = [run.sync for run in comparison.runs if run.sync.mode == "stamps"]
    if not stamped:
        return ""
    if len(comparison.runs) == 1:
        return f"; clocks by their stamps (offset {text.format_seconds(stamped[0].offset)} s)"
    some = "" if len(stamped) == len(comparison.runs) else f" of {format_count(len(stamped), 'log')}"
    return f"; clocks{some} by their stamps"


def format_share(share: Share, whose: str = "") -> str:
    """Return a share, with the name of the log if there are several, and the unseen part if too small.

    As in "coverage 0.5 % of 90 % needed, longest part not compared: 3.97 s from t = 0.01 s of the reference".
    """
    of_log = f" of {whose}" if whose else ""
    if share.verdict != "fail":
        return f"{share.quantity}{of_log} {text.format_percent(share.value)}"
    message = f"{share.quantity}{of_log} {held(Value(share.value, '%', share.tolerance, least=True))}"
    return message if whose else f"{message}{format_unseen(share)}"


def format_unseen(share: Share) -> str:
    """Return the longest unseen part, as ", longest part not compared: 3.97 s from t = 0.01 s of the log"."""
    side = "reference" if share.quantity == "coverage" else "log"
    longest = share.longest_unseen
    return "" if longest is None else f", longest part not compared: {format_interval(longest)} of the {side}"


def symbol(quantity: Statistics | Share | DeltaMeterResult) -> str:
    """Return the symbol of a quantity: Δx, ‖Δ‖, path, angle, coverage, or a joint by its name."""
    return SYMBOLS[quantity.quantity] if quantity.kind in ("axis", "norm") else quantity.quantity


def absolute_symbol(quantity: Statistics | Share | DeltaMeterResult) -> str:
    """Return the symbol of the absolute value of a quantity: |Δx|, ‖Δ‖, path, angle, |Δ phi1|."""
    if quantity.kind == "joint":
        return f"|Δ {quantity.quantity}|"
    return f"|{symbol(quantity)}|" if quantity.kind == "axis" else symbol(quantity)


def quantity_name(quantity: Statistics | Share) -> str:
    """Return the name of a quantity, unique in its log: a joint may be called x."""
    return f"joint {quantity.quantity}" if quantity.kind == "joint" else quantity.quantity


def format_utilisation(quantity: Statistics | Share | DeltaMeterResult) -> str:
    """Return the utilisation of the tolerance: "71.0 % of the tolerance"; empty without one."""
    if quantity.utilisation is None or isinstance(quantity, Share):
        return ""
    if isinstance(quantity, Statistics) and quantity.missing:
        return f"no value at {quantity.missing} of {(quantity.samples or 0) + quantity.missing} samples"
    if math.isinf(quantity.utilisation):
        return ""
    return f"{text.format_portion(quantity.utilisation)} the tolerance"


def format_amount(quantity: Statistics | Share) -> str:
    """Return the largest value of a quantity and its tolerance: "|Δx| = 4.2000 mm of 3.5 mm allowed".

    Where a quantity with a tolerance lacks values, their number: "angle has no value at 3 of 40 samples".
    """
    if isinstance(quantity, Share):
        return f"{quantity.quantity} = {held(Value(quantity.value, '%', quantity.tolerance, least=True))}"
    if quantity.tolerance is not None and quantity.missing:
        return f"{absolute_symbol(quantity)} has {format_utilisation(quantity)}"
    return f"{absolute_symbol(quantity)} = {held(Value(quantity.max, quantity.unit, quantity.tolerance))}"


def format_decisive(quantity: Statistics | Share) -> str:
    """Return the largest value of a quantity, its tolerance and its time; of a share the unseen part.

    As in "|Δx| = 4.2000 mm of 3.5 mm allowed (1.2 times the tolerance) at t = 1.250 s".
    """
    if isinstance(quantity, Share):
        counts = f"{quantity.samples} of {format_count(quantity.total, 'sample')}"
        return f"{format_amount(quantity)} ({counts}){format_unseen(quantity)}"
    amount = format_amount(quantity)
    if quantity.tolerance is not None and quantity.missing:
        return amount
    used = format_utilisation(quantity)
    return f"{amount}{f' ({used})' if used else ''} {format_time_of_max(quantity)}"


def format_peak(deviation: Deviation) -> str:
    """Return the caption of the largest value of the worst quantity: it decides, if no share does."""
    return "decides" if isinstance(deviation.decisive, Statistics) else "deviates most"


def format_time_of_max(statistics: Statistics) -> str:
    """Return the time of the largest value: "at t = 1.250 s"; of static poses its row: "in row 3"."""
    if math.isnan(statistics.t_max):
        return f"in row {statistics.sample_max + 1}"
    return f"at t = {text.format_seconds(statistics.t_max)} s"


def format_delta_meter(meter: DeltaMeterResult) -> str:
    """Return the largest value of a delta meter, its tolerance and time, the samples out, and the caveats."""
    amount = (
        "has no value" if meter.utilisation is None else f"= {held(Value(meter.worst, 'm', meter.allowed))}"
    )
    used = format_utilisation(meter)
    time = f"at t = {text.format_seconds(meter.t)} s"
    message = f"{absolute_symbol(meter)} {amount}{f' ({used})' if used else ''} {time}"
    out = f"out of tolerance: {format_out_of_tolerance(meter.out_of_tolerance, meter.samples)}"
    parts = [message, out]
    if meter.missing:
        parts.append(f"coverage {text.format_percent(meter.coverage)}: {meter.missing} without a value")
    return "; ".join([*parts, *filter(None, meter.caveats)])


def format_out_of_tolerance(out: int, of: int) -> str:
    """Return the number of samples out of tolerance: "13 of 100 samples (13.0 %)"."""
    return f"{out} of {format_count(of, 'sample')} ({text.format_percent(out / of)})"


def format_interval(interval: SampleInterval) -> str:
    """Return the duration and start of an interval out of tolerance or unseen: "0.500 s from t = 1.250 s"."""
    if interval.t is None or interval.duration is None:
        return f"{format_count(interval.samples, 'row')} from row {interval.sample + 1}"
    lasts = "1 sample at" if interval.samples == 1 else f"{text.format_seconds(interval.duration)} s from"
    return f"{lasts} t = {text.format_seconds(interval.t)} s"


def format_tolerance(allowed: Mapping[str, float], joint_units: Iterable[str] = ("rad",)) -> str:
    """Return a comparison's tolerance as text: "±3.5 mm per axis, 0.5 deg of orientation".

    Args:
        allowed: In [m] or [rad], by kind or coordinate; least shares, named if they are not the default.
        joint_units: The units of the joints that have a tolerance, rad or m.
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
