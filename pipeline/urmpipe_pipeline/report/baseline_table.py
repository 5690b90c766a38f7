"""What changed since an earlier comparison: what is worse first, then what is better or only other."""

from __future__ import annotations

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.change import BaselineComparison, Change
from urmpipe_pipeline.comparison.change_wording import WORDS, share_pair, since_words, statistic_pair
from urmpipe_pipeline.comparison.symbols import symbol
from urmpipe_pipeline.report.tables import MOST, Cell, Table, numbers, without_empty_columns, words


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


def _title(found: BaselineComparison) -> str:
    return f"Against the baseline {found.name}: {since_words(found)}"


def _row(one: Change) -> tuple[Cell, ...]:
    before, now, unit = one.before, one.now, one.now.unit
    told = {*one.worse, *one.better}
    shares = share_pair(one) if "share_out" in told else (text.NOTHING, text.NOTHING)
    counts = (before.samples, now.samples) if "samples" in told else (None, None)
    return (
        Cell(one.run),
        Cell(f"{symbol(now)} [{text.SHOWN[unit][0]}]"),
        Cell(", ".join(WORDS[name] for name in one.worse) or text.NOTHING, most=True),
        Cell(", ".join(WORDS[name] for name in one.better) or text.NOTHING),
        *map(Cell, (*statistic_pair(one, "max"), *statistic_pair(one, "rms"), *shares)),
        *(Cell(text.NOTHING if count is None else str(count)) for count in counts),
        Cell(text.number(one.largest, unit)),
        Cell(text.NOTHING if one.t_largest is None else text.seconds(one.t_largest)),
    )


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
