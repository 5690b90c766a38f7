"""How a comparison is said in words: the same in the terminal, the recording and the report."""

from __future__ import annotations

from urmpipe_models.chains.chain import Chain
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.alignment import tool_with
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.delta_verdict import DeltaVerdict
from urmpipe_pipeline.comparison.deviation import Statistics
from urmpipe_pipeline.comparison.symbols import allowed_words
from urmpipe_pipeline.comparison.trajectory import Alignment, Sync


def excess(one: Statistics) -> str:
    """Return how far a quantity goes, and of how much: "x reaches 4.2000 mm of 3.5 mm allowed".

    Where a quantity with a tolerance lacks values, that: "angle has no value at 3 of 40 samples".
    """
    if one.tolerance is not None and one.missing:
        return f"{one.quantity} has {lacking_words(one)}"
    return f"{one.quantity} reaches {text.quantity(one.max, one.unit, one.tolerance)}{of_allowed(one)}"


def lacking_words(one: Statistics) -> str:
    """Return at how many of the compared samples a quantity has no value."""
    return f"no value at {one.missing} of {(one.samples or 0) + one.missing} samples"


def of_allowed(one: Statistics) -> str:
    """Return of how much a quantity is: " of 3.5 mm allowed"; nothing without a tolerance."""
    if one.tolerance is None:
        return ""
    return f" of {text.limit(one.tolerance, one.unit)} {text.SHOWN[one.unit][0]} allowed"


def tolerance_words(comparison: Comparison) -> str:
    """Return what a comparison allows, that of joints in the units of those that were compared."""
    units = {one.unit for run in comparison.runs for one in run.joint_statistics.values()}
    return allowed_words(comparison.tolerance, units or {"rad"})


def meter_words(one: DeltaVerdict) -> str:
    """Return what a delta meter found: how much of how much, when, and how often it was too much."""
    if one.used is None or one.allowed is None:
        said = f"no value at t = {text.seconds(one.t)} s"
    else:
        size = "‖Δ‖" if one.quantity == "norm" else f"|Δ{one.quantity}|"
        amount = text.quantity(one.worst, "m", one.allowed)
        said = f"{size} = {amount} of {text.limit(one.allowed)} mm allowed at t = {text.seconds(one.t)} s"
    return f"{said}; out of tolerance: {one.out_of_tolerance} of {text.counted(one.samples, 'sample')}"


def correlation(r: float | None) -> str:
    """Return a correlation with its sign; a dash where it is not known."""
    return text.NOTHING if r is None else f"{round(r, 3) + 0.0:+.3f}"  # + 0.0: no -0.000


def sync_words(sync: Sync) -> str:
    """Return how two clocks were put together; nothing if both simply start together."""
    if sync.mode == "start":
        return ""
    how = "as given" if sync.mode == "given" else f"estimated from {sync.by}"
    said = f"clocks: t_reference = t_log {'-' if sync.offset < 0.0 else '+'} {abs(sync.offset):.6g} s, {how}"
    if sync.precision is not None:
        said += f", ± {text.standard_error(sync.precision)}"
    return said + ("" if sync.similarity is None else f", similarity {sync.similarity:.4f}")


def alignment_words(alignment: Alignment) -> str:
    """Return how a log was moved in space before it was compared; nothing if it was not."""
    if alignment.mode == "none":
        return ""
    if alignment.mode == "tool":
        return f"aligned (tool): tool centre point moved by {_vector(alignment.tool)} mm in the tool's frame"
    turned, by = text.quantity(alignment.angle, "rad"), _vector(alignment.translation)
    return f"aligned ({alignment.mode}): turned by {turned} about the origin, then moved by {by} mm"


def tool_option(robot: Chain, alignment: Alignment) -> str:
    """Return the option that gives an arm the tool that a comparison found, to a tenth of a micrometre.

    Args:
        robot: The arm, perhaps with a tool already.
        alignment: That of the mode tool.
    """
    rounded = (f"{round(value, 7) + 0.0:.7f}" for value in tool_with(robot, alignment))  # + 0.0: no -0
    return "--tool " + ",".join(value.rstrip("0").rstrip(".") for value in rounded)


def _vector(metres: tuple[float, ...]) -> str:
    """Return a vector in [m] as (x, y, z) in [mm]."""
    return f"({', '.join(text.millimetres(value) for value in metres)})"
