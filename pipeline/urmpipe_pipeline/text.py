"""How values are written: numbers with their units, counts, names, CSV cells and JSON.

Numbers in tables and sentences are plain digits, `SIGNIFICANT` of them, or as many as distinguish a value
from its limit; the unit is in the head of a table, or follows in a sentence. Programs get the shortest text
that gives the same double.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe_models.elementwise import IntArray
from urmpipe_models.errors import escape_control_characters
from urmpipe_models.measure_units import compatible_units, conversion_factor

NOTHING = "–"  # in place of a missing value

SIGNIFICANT = 4  # digits of a length or an angle; JSON, CSV and the tips of a report's cells have all
MAX_INTEGER_DIGITS = 9  # of a number without an exponent
MAX_DECIMALS = 4  # of a length in [mm] or an angle in [deg]: 0.1 micrometres, 2 microradians
MAX_DISTINGUISHING_DECIMALS = 18  # that distinguish a value from its limit
MIN_STANDARD_ERROR = 1e-3  # [ms], of a time: a fit may result in less, but no clock is more exact
MAX_NAMED_ROWS = 6  # rows or intervals of rows in a sentence; the others are counted

# Units that are shown, and their factors from the SI unit.
SHOWN = {si: (unit, conversion_factor(si, unit)) for si, unit in (("m", "mm"), ("rad", "deg"))}


def choose_unit(unit: str, preferred: str) -> tuple[str, float]:
    """Return the unit to show a quantity in, and the factor to it.

    Args:
        unit: Unit of the quantity, in SI.
        preferred: Preferred unit; empty for none. One that is unknown or of another quantity (an FMU may
            state any) is not used.
    """
    if preferred in compatible_units(unit):
        return preferred, conversion_factor(unit, preferred)
    return unit, 1.0


def format_number(value: float | None, unit: str, against: float | None = None) -> str:
    """Return a length in [m] as [mm], or an angle in [rad] as [deg].

    It has four significant digits, or as many as distinguish it from its limit. A value far below a
    thousandth, or far below its limit, ends at the same digit as that: 0.0000.

    Args:
        value: Value in [m] or [rad].
        unit: m or rad.
        against: Its limit in the same unit, if it has one.
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    scale = SHOWN[unit][1]
    scaled = value * scale
    finest = max(MAX_DECIMALS, decimals(against * scale)) if against else MAX_DECIMALS
    digits = min(decimals(scaled), finest) if abs(scaled) < 1e-3 else decimals(scaled)
    if against is not None and abs(value) != against:
        while (
            digits < MAX_DISTINGUISHING_DECIMALS
            and f"{abs(scaled):.{digits}f}" == f"{against * scale:.{digits}f}"
        ):
            digits += 1
    return f"{round(scaled, digits) + 0.0:.{digits}f}"  # + 0.0: no -0.0000


def decimals(value: float) -> int:
    """Return the number of decimals that show `SIGNIFICANT` digits of a value; one for 0."""
    if not value or not math.isfinite(value):
        return 1
    exponent = math.floor(math.log10(float(f"{abs(value):.{SIGNIFICANT - 1}e}")))  # 9.9996 is shown as 10.00
    return max(SIGNIFICANT - 1 - exponent, 0)


def format_quantity(value: float | None, unit: str, against: float | None = None) -> str:
    """Return a number with the unit that is shown: "2.500 mm", "0.1234 deg"."""
    return f"{format_number(value, unit, against)} {SHOWN[unit][0]}"


def format_limit(value: float | None, unit: str = "m") -> str:
    """Return a tolerance in [m] as [mm] or in [rad] as [deg], with all its digits."""
    return NOTHING if value is None else f"{value * SHOWN[unit][1]:.6g}"


def format_rounded(value: float, unit: str) -> str:
    """Return an angle, a length or a rate of one in [rad] or [m] for a sentence: "12.5 deg/s"."""
    base, slash, per = unit.partition("/")
    shown, scale = SHOWN[base]
    return f"{format_significant(value * scale)} {shown}{slash}{per}"


def format_significant(value: float) -> str:
    """Return a number in any unit with `SIGNIFICANT` digits, with an exponent if very small or large."""
    rounded = float(f"{value:.{SIGNIFICANT}g}")
    return f"{rounded:.{MAX_INTEGER_DIGITS}g}" if abs(rounded) >= 1.0 else f"{rounded:.{SIGNIFICANT}g}"


def format_stated(value: float, unit: str = "m") -> str:
    """Return a stated value with the unit that is shown: "3.5 mm", "0.5 deg", "5 %", "0.25 m/s"."""
    shown, scale = SHOWN.get(unit, (unit, 1.0)) if unit != "1" else ("%", 100.0)
    return f"{value * scale:.6g} {shown}"


def format_point(values: Any) -> str:
    """Return x, y, z in [m], to tenths of a millimetre."""
    return ", ".join(f"{value:.4f}" if math.isfinite(value) else NOTHING for value in values)


def format_seconds(value: float) -> str:
    """Return a time in [s] to milliseconds, or to microseconds if these are not 0."""
    if not math.isfinite(value):
        return NOTHING
    text = f"{round(value, 6) + 0.0:.6f}"  # + 0.0: no -0.000
    return text[:-3] + text[-3:].rstrip("0")


def format_standard_error(value: float) -> str:
    """Return the standard error of a time in [s] as [ms]: two digits, at least a microsecond."""
    return f"{float(f'{max(1e3 * value, MIN_STANDARD_ERROR):.2g}'):.6g} ms"


def format_percent(share: float) -> str:
    """Return a share in [%], never rounded to 0 or to 100 when it is not, and without an exponent."""
    scaled = share * 100.0
    if scaled in (0.0, 100.0):
        return f"{scaled:.0f} %"
    if scaled > 100.0:
        return f"{max(scaled, 100.01):.2f} %" if scaled < 101.0 else f"{scaled:.1f} %"
    if scaled > 99.0:
        return f"{min(scaled, 99.99):.2f} %"
    if round(abs(scaled), 6) < 1e-4:
        return "under 0.0001 %"
    return f"{scaled:.2g} %" if scaled < 1.0 else f"{scaled:.1f} %"


def format_portion(share: float) -> str:
    """Return a share to precede its whole: "71.0 % of", "1.2 times".

    Above 1 it has three digits, or as many as distinguish it from 1, without an exponent.
    """
    if share <= 1.0:
        return f"{format_percent(share)} of"
    if share >= 1000.0:
        return f"{share:.0f} times"
    digits = 3
    while digits < 15 and f"{share:.{digits}g}" == "1":
        digits += 1
    return f"{share:.{digits}g} times"


def format_rows(rows: Sequence[int] | IntArray) -> str:
    """Return rows, shape (n,), for a sentence: "row 3", "rows 3, 7-9 and 40 more"."""
    rows = np.asarray(rows)
    first = np.flatnonzero(np.diff(rows, prepend=rows[0] - 2) != 1)
    last = np.append(first[1:], len(rows)) - 1
    parts = [
        str(rows[a]) if a == b else f"{rows[a]}-{rows[b]}"
        for a, b in zip(first[:MAX_NAMED_ROWS], last[:MAX_NAMED_ROWS], strict=True)
    ]
    more = len(rows) - 1 - last[:MAX_NAMED_ROWS][-1]
    listed = ", ".join(parts) + (f" and {more} more" if more else "")
    return f"row{'' if len(rows) == 1 else 's'} {listed}"


def join_list(words: Sequence[str]) -> str:
    """Return texts as a list in a sentence: "a", "a and b", "a, b and c"."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def make_unique(names: Sequence[str]) -> list[str]:
    """Return names, those that repeat with a number: "log", "log-2"."""
    result: list[str] = []
    for name in names:
        candidate, number = name, 2
        while candidate in result:
            candidate, number = f"{name}-{number}", number + 1
        result.append(candidate)
    return result


def format_exact(value: Any) -> str:
    """Return a value for programs: empty for None, a float in the fewest digits that give the same double."""
    if value is None:
        return ""
    return value if isinstance(value, str) else repr(value)


def drop_surrogates(value: str) -> str:
    """Return a text without lone surrogates, which Python has for undecodable bytes of a file name."""
    return value.encode("utf-8", "replace").decode("utf-8")


_FORMULA = ("=", "+", "-", "@")  # start of a cell that a spreadsheet runs as a formula (OWASP, CSV Injection)


def to_csv_text(text: str) -> str:
    """Return a text as a cell of CSV: on one line, after an apostrophe if a spreadsheet would run it."""
    escaped = escape_control_characters(text)
    return f"'{escaped}" if text.startswith(_FORMULA) else escaped


def strip_apostrophe(cell: str) -> str:
    """Return a cell without the apostrophe of `to_csv_text`."""
    return cell[1:] if cell.startswith(tuple(f"'{sign}" for sign in _FORMULA)) else cell


def to_json_value(value: Any) -> Any:
    """Return a value as JSON: arrays as lists, NaN and infinities as null."""
    if isinstance(value, Mapping):
        return {str(key): to_json_value(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_json_value(item) for item in value]
    if isinstance(value, np.ndarray):
        return to_json_value(value.tolist())
    if isinstance(value, np.generic):
        return to_json_value(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def parse_json(written: str | bytes) -> Any:
    """Return the value of a JSON text.

    Raises:
        ValueError: If it is no JSON, or nested too deep.
    """
    try:
        return json.loads(written)
    except RecursionError:
        raise ValueError("nested too deep") from None


def format_option_value(value: Any) -> str:
    """Return the value of an option as one line: text as it is, other values as JSON."""
    return value if isinstance(value, str) else json.dumps(to_json_value(value), ensure_ascii=False)
