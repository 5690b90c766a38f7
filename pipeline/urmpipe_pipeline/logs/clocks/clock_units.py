"""The unit of a clock of numbers: given, in its name, known of the source, or shown by its values.

Steps of 1 to 500 without a unit may be in s or in ms: how fast the joints would turn decides.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs.clocks.chosen import EVEN, EXPONENTS, OTHER_TIME
from urmpipe_pipeline.logs.clocks.halves import EPOCH
from urmpipe_pipeline.logs.clocks.steps import steps_of
from urmpipe_pipeline.logs.columns.columns import Column
from urmpipe_pipeline.logs.columns.questions import unit_hints
from urmpipe_pipeline.logs.tables.sniff import Layout
from urmpipe_pipeline.logs.units.proofs import peak
from urmpipe_pipeline.logs.vocabulary import KnownSource, Unit, vocabulary

SHORTEST, LONGEST = 0.0005, 1.0
"""Usual periods of a log in [s]: they tell the unit of a clock that does not say it."""

_UNUSUAL, _IMPOSSIBLE = 0.0002, 1e-5
"""Periods in [s] below which a log is unusual, and below which no joint is sampled: days or hours look so."""

FAST = 30.0  # no joint turns faster [rad/s]
USUAL = 5.0  # joints of logs seldom do [rad/s]: in s instead of ms they would turn at 0.3 deg/s at most
RESTS = 0.01  # share of the largest step of all joints below which they rest
SHORTEST_MS = 5.0  # a log in ms has seldom shorter steps: 200 Hz
_S_OR_MS = (1.0, 500.0)  # steps of these lengths may be in s or in ms

_DAYS = {
    "Excel's days since 1900": ((36_526.0, 73_051.0), "(t - 25569) * 86400 is Unix time in s"),
    "MATLAB's datenum in days": ((730_486.0, 767_011.0), "(t - 719529) * 86400 is Unix time in s"),
    "Julian days": ((2_451_544.5, 2_488_069.5), "(t - 2440587.5) * 86400 is Unix time in s"),
}
"""2000 to 2100 as some count days, and what makes a Unix time of them."""

_TICKS = {
    ".NET's ticks of 100 ns": ((6.308e17, 6.624e17), "(t - 621355968000000000) / 10 is Unix time in us"),
    "Windows' ticks of 100 ns": ((1.259e17, 1.575e17), "(t - 116444736000000000) / 10 is Unix time in us"),
}
"""The same in ticks."""

_SECONDS_A_DAY = 86_400.0

_UNITS = ", ".join(EXPONENTS)

Found = tuple[str, str, tuple[LogWarning, ...]]
"""A unit, why, and what a person should know."""


def unit_of(
    time: Column,
    layout: Layout,
    source: KnownSource | None,
    units: Mapping[int, Unit],
    *,
    lasts: bool = False,
) -> Found:
    """Return the unit of a time column, why, and a warning if it is assumed.

    Args:
        time: The column.
        layout: How its table is written.
        source: What is known of the source.
        units: Units given by the user, by the column's number.
        lasts: Whether it holds durations, not times.

    Raises:
        LogError: If it is a unit that is not read, or cannot be told.
        OptionError: If it is given as one that is no time.
    """
    given = units.get(time.number)
    if given is not None:
        if given.name not in EXPONENTS:
            found = f"{given.name} for the time {format_value(time.name)}"
            raise OptionError(Finding(parameter="unit", found=found, allowed=_UNITS, hints=OTHER_TIME))
        return given.name, "given as an option", ()
    named = time.unit or vocabulary().unit(time.key)  # "seconds" has no other name
    if named is not None and named.name in EXPONENTS:
        return named.name, "its name", ()
    long = time.unit_text or time.key.rpartition("_")[2]
    if long.lower() in vocabulary().long_times:
        message = f"found the unit {format_value(long)}, allowed: {_UNITS}; convert the times"
        raise layout.error(message, time.header, *EVEN)
    if source is not None and "time" in source.units:
        return source.units["time"].name, f"{source.name} writes {source.units['time'].name}", ()
    return _by_values(time, layout, lasts=lasts)


def _by_values(time: Column, layout: Layout, *, lasts: bool) -> Found:
    """Tell the unit by the year that the times give, or else by their steps; durations are steps."""
    times = layout.numbers(time.index)
    start = 0.0 if lasts or not times else times[0]
    steps = sorted(step for step in (times if lasts else steps_of(times)) if step > 0)
    step = steps[len(steps) // 2] if steps else 0.0
    likely = [u for u, e in EXPONENTS.items() if SHORTEST < step * 10.0 ** (e - 9) <= LONGEST]
    epoch = _since_1970(start, step)
    if epoch is not None and not (likely and step * 10.0 ** (EXPONENTS[epoch] - 9) > LONGEST):
        return epoch, "it counts from 1970, so as Unix time it is of our years", ()
    if epoch is not None:
        raise _question(time, layout, f"times of our years in steps of {step:g}", [epoch, *likely])
    _refuse_other_epochs(time, layout, start, step)
    if step <= SHORTEST:
        return _short(time, layout, step)
    evidence = f"its steps of {step:g}"
    if likely == ["ms"] and any(number % 1 for number in times):
        return "s", evidence, (_assumed(time, step),)
    if len(likely) == 1:
        return likely[0], evidence, ()
    if "s" in likely:
        return "s", evidence, (_assumed(time, step),)
    raise _question(time, layout, f"steps of {step:g}", likely or list(EXPONENTS))


def unit_by_speed(
    time: Column, layout: Layout, speed: Callable[[], float | None], *, lasts: bool
) -> Found | None:
    """Return s or ms by how fast the joints would turn; None if the steps show it.

    Args:
        time: The column; only its steps show its unit.
        layout: How its table is written.
        speed: Returns the joints' speed as if it were in s, in [rad/s]; None if none of them moves.
        lasts: Whether it holds durations, not times.

    Raises:
        LogError: If it may be either.
    """
    times = layout.numbers(time.index)
    steps = sorted(step for step in (times if lasts else steps_of(times)) if step > 0)
    step = steps[len(steps) // 2] if steps else 0.0
    since_1970 = not lasts and bool(times) and _since_1970(times[0], step)
    if since_1970 or not _S_OR_MS[0] <= step <= _S_OR_MS[1]:
        return None
    integers, in_s = not any(number % 1 for number in times), speed()
    if in_s is None:
        turn, unit = "no joint moves", "ms" if integers and step >= SHORTEST_MS else "s"
    else:
        turn = f"the joints turn at up to {1e3 * in_s:.2g} rad/s as ms, at {in_s:.2g} rad/s as s"
        usual = 1e3 * in_s <= USUAL
        unit = "s" if 1e3 * in_s > FAST or not (integers or usual) else "ms" if integers and usual else ""
    if not unit or (unit == "ms" and step < SHORTEST_MS):
        raise _question(time, layout, f"{'whole ' * integers}steps of {step:g} ({turn})", ["s", "ms"])
    return unit, f"its steps of {step:g}, and {turn}", (_assumed(time, step, unit, f", since {turn}"),)


def speed_of(q: FloatArray, passed: FloatArray) -> float | None:
    """Return how fast the joints turn in nine of ten rows in which they move, in [rad/s]; None if none moves.

    Their steps are in [rad], shape (n, joints), and take so many [s], shape (n,).
    """
    size = np.fmax.reduce(np.abs(q), axis=1, initial=0.0)
    moves = (size > RESTS * np.fmax.reduce(size, initial=0.0)) & (passed > 0)
    speeds = np.sort(size[moves] / passed[moves])
    return float(speeds[int(0.9 * (len(speeds) - 1))]) if len(speeds) else None


def in_si(
    values: FloatArray, joints: Sequence[Column], units: Mapping[int, Unit], source: KnownSource | None
) -> tuple[FloatArray, FloatArray]:
    """Return joint values in [rad] or [m], and a turn of each joint, shape (joints,): 0 where it slides.

    By the units of the columns; without one, values beyond a turn in rad are taken as deg. They are in
    the file's own units, shape (..., joints).
    """
    angle = source.units.get("angle") if source else None
    beyond = peak(values.reshape(-1, values.shape[-1])) > FULL_TURN
    usual = angle or vocabulary().units["deg" if beyond else "rad"]
    each = [units.get(joint.number) or units.get(0) or joint.unit or usual for joint in joints]
    slides = np.array([unit.quantity == "length" for unit in each])
    return values * [unit.factor for unit in each], np.where(slides, 0.0, FULL_TURN)


def _refuse_other_epochs(time: Column, layout: Layout, start: float, step: float) -> None:
    """Raise if times of our years count days, or ticks of 100 ns, from another year than 1970."""
    in_days = 0.0 < step * _SECONDS_A_DAY <= 20 * LONGEST
    in_ticks = SHORTEST < step * 1e-7 <= 20 * LONGEST
    kinds = (_DAYS if in_days else {}) | (_TICKS if in_ticks else {})
    for kind, ((first, last), cure) in kinds.items():
        if first <= start <= last:
            message = f"found {start:.15g} in steps of {step:.3g}, as {kind}, allowed: times in {_UNITS}"
            hints = unit_hints([time], "s" if in_days else "ns", "keeps them unchanged")
            raise layout.error(f"{message}; convert them: {cure}", time.header, *hints, *EVEN)


def _since_1970(start: float, step: float) -> str | None:
    """Return the unit in which a time is a Unix time of our years, if there is one."""
    for unit, exponent in EXPONENTS.items():
        scale = 10.0 ** (exponent - 9)
        if EPOCH[0] <= start * scale <= EPOCH[1] and step * scale <= 20 * LONGEST:
            return unit
    return None


def _short(time: Column, layout: Layout, step: float) -> Found:
    """Return s for short steps, or for none; raise where they are too short for a log."""
    if 0 < step < _IMPOSSIBLE:
        said = f"found steps of {step:.3g}, as of days or hours, allowed: times in {_UNITS}"
        hints = unit_hints([time], "s", "keeps them unchanged")
        raise layout.error(f"{said}; convert them", time.header, *hints, *EVEN)
    return "s", "the usual unit", (_assumed(time, step),) if 0 < step < _UNUSUAL else ()


def _assumed(time: Column, step: float, unit: str = "s", why: str = "") -> LogWarning:
    said = f"the time {format_value(time.name)} steps by {step:.6g}: taken as {unit}{why}"
    hints, taken = (*unit_hints([time], unit, "confirms it"), *OTHER_TIME), f"the times are in {unit}"
    return LogWarning("assumed-unit", said, hints=hints, assumption=taken, role="time")


def _question(time: Column, layout: Layout, found: str, units: list[str]) -> LogError:
    """Ask which of some units is meant."""
    hints = (*(Hint("unit", {time.called: unit}, "specifies it") for unit in units), *OTHER_TIME)
    return layout.error(f"found {found}, which may be {' or '.join(units)}", time.header, *hints)
