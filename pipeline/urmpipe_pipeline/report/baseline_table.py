"""What changed since an earlier comparison: what is worse first, then what is better or only other."""

from __future__ import annotations

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.change import BaselineComparison, Change, Worse
from urmpipe_pipeline.comparison.symbols import symbol
from urmpipe_pipeline.report.tables import MOST, Cell, Table, numbers, without_empty_columns, words

SAID: dict[Worse, str] = {"max": "max", "rms": "rms", "share_out": "share out", "samples": "samples"}
"""What people call what may be worse."""


def baseline_table(found: BaselineComparison) -> Table:
    """Return one line a quantity that changed beyond the noise, and what is new or gone under it."""
    changed = sorted((one for one in found.changes if one.changed), key=lambda one: not one.worse)
    columns = (
        *words("Log", "Quantity", "Worse", "Better"),
        *numbers("max before", "max now", "rms before", "rms now"),
        *numbers("out before", "out now", "samples before", "samples now"),
        *numbers("most at one sample", "at t [s]"),
    )
    rows = tuple(_row(one) for one in changed[:MOST])
    return without_empty_columns(Table(_title(found), columns, rows, note=_note(found, len(changed))))


def worse_words(found: BaselineComparison) -> str:
    """Return how much is worse than the baseline: "5 quantities worse, run 3 gone"."""
    count = len(found.worse)
    said = [f"{count} {'quantity' if count == 1 else 'quantities'} worse"] if count else []
    if found.gone:
        said.append(f"{', '.join(map(str, found.gone))} gone")
    return ", ".join(said) or "nothing worse"


def _title(found: BaselineComparison) -> str:
    return f"Against the baseline {found.name}: {worse_words(found)}"


def _row(one: Change) -> tuple[Cell, ...]:
    before, now, unit = one.before, one.now, one.now.unit
    told = {*one.worse, *one.better}
    shares = (before.share_out, now.share_out) if "share_out" in told else (None, None)
    counts = (before.samples, now.samples) if "samples" in told else (None, None)
    return (
        Cell(one.run),
        Cell(f"{symbol(now)} [{text.SHOWN[unit][0]}]"),
        Cell(", ".join(SAID[name] for name in one.worse) or text.NOTHING, most=True),
        Cell(", ".join(SAID[name] for name in one.better) or text.NOTHING),
        *(_number(value, other, one) for value, other in ((before.max, now.max), (now.max, before.max))),
        *(_number(value, other, one) for value, other in ((before.rms, now.rms), (now.rms, before.rms))),
        *(Cell(text.NOTHING if share is None else text.percent(share)) for share in shares),
        *(Cell(text.NOTHING if count is None else str(count)) for count in counts),
        Cell(text.number(one.largest, unit)),
        Cell(text.NOTHING if one.t_largest is None else text.seconds(one.t_largest)),
    )


def _number(value: float, other: float, one: Change) -> Cell:
    """Return a statistic, with more digits where they tell a change beyond the noise."""
    against = other if abs(value - other) > one.noise else None
    return Cell(text.number(value, one.now.unit, against))


def _note(found: BaselineComparison, changed: int) -> str:
    """Return what else is to be known: what is new or gone, what was made otherwise, what is cut."""
    parts = [f"Baseline: {found.recording}." if found.recording else ""]
    parts += [f"New: {', '.join(map(str, found.new))}." if found.new else ""]
    parts += [f"Gone: {', '.join(map(str, found.gone))}." if found.gone else ""]
    if found.differences:
        parts.append(f"Made otherwise: {', '.join(one.what for one in found.differences)}.")
    if changed > MOST:
        parts.append(f"{changed - MOST} more; the JSON output lists them all.")
    parts.append("Only what changed by more than the noise is listed.")
    return " ".join(part for part in parts if part)
