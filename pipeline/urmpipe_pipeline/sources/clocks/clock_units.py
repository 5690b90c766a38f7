"""The unit of a clock of numbers: given, in its name, known of the source, or told by its values."""

from __future__ import annotations

from collections.abc import Mapping

from urmpipe_models.errors import Finding, LogError, OptionError, shown
from urmpipe_models.messages import Hint
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.sources.clocks.clock_columns import steps_of
from urmpipe_pipeline.sources.columns.columns import Column
from urmpipe_pipeline.sources.tables.sniff import Layout
from urmpipe_pipeline.sources.units.unit_hints import unit_hints
from urmpipe_pipeline.sources.vocabulary import KnownSource, Unit, vocabulary

EXPONENTS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
"""Powers of ten from a unit to [ns]."""

SHORTEST, LONGEST = 0.0005, 1.0
"""Usual periods of a log in [s]: they tell the unit of a clock that does not say it."""

_UNUSUAL, _IMPOSSIBLE = 0.0002, 1e-5
"""Periods in [s] below which a log is unusual, and below which no joint is sampled: days or hours look so."""

_EPOCH = (946_684_800.0, 4_102_444_800.0)  # 2000 to 2100 as Unix time in [s]

_UNITS = ", ".join(EXPONENTS)

EVEN = (
    Hint("time", "none", "leaves the time column out"),
    Hint("period", None, "sets the time between rows then"),
)
"""What to give where a time column is of no use."""

Found = tuple[str, str, tuple[LogWarning, ...]]
"""A unit, why, and what a person should know."""


def unit_of(time: Column, layout: Layout, source: KnownSource | None, units: Mapping[int, Unit]) -> Found:
    """Return the unit of a time column, why, and a warning if it is assumed.

    Raises:
        LogError: If it is a unit that is not read, or cannot be told.
        OptionError: If it is given as one that is no time.
    """
    given = units.get(time.number)
    if given is not None:
        if given.name not in EXPONENTS:
            found = f"{given.name} for the time {shown(time.name)}"
            raise OptionError(Finding(parameter="unit", found=found, allowed=_UNITS))
        return given.name, "given as an option", ()
    if time.unit is not None and time.unit.name in EXPONENTS:
        return time.unit.name, "its name", ()
    if time.unit_text is not None and time.unit_text.lower() in vocabulary().long_times:
        message = f"found the unit {shown(time.unit_text)}, allowed: {_UNITS}; convert the times"
        raise layout.error(message, time.header, *EVEN)
    if source is not None and "time" in source.units:
        return source.units["time"].name, f"{source.name} writes {source.units['time'].name}", ()
    return _by_values(time, layout)


def _by_values(time: Column, layout: Layout) -> Found:
    """Tell the unit by the year that the times give, or else by their steps."""
    times = layout.numbers(time.index)
    start = times[0] if times else 0.0
    steps = sorted(step for step in steps_of(times) if step > 0)
    step = steps[len(steps) // 2] if steps else 0.0
    likely = [u for u, e in EXPONENTS.items() if SHORTEST < step * 10.0 ** (e - 9) <= LONGEST]
    epoch = _since_1970(start, step)
    if epoch is not None and not (likely and step * 10.0 ** (EXPONENTS[epoch] - 9) > LONGEST):
        return epoch, "it counts from 1970, so as Unix time it is of our years", ()
    if epoch is not None:
        raise _question(time, layout, f"times of our years in steps of {step:g}", [epoch, *likely])
    if step <= SHORTEST:
        return _short(time, layout, step)
    evidence = f"its steps of {step:g}"
    if len(likely) == 1:
        return likely[0], evidence, ()
    if "s" in likely:
        return "s", evidence, (_assumed(time, step),)
    raise _question(time, layout, f"steps of {step:g}", likely or list(EXPONENTS))


def _since_1970(start: float, step: float) -> str | None:
    """Return the unit in which a time is a Unix time of our years, if there is one."""
    for unit, exponent in EXPONENTS.items():
        scale = 10.0 ** (exponent - 9)
        if _EPOCH[0] <= start * scale <= _EPOCH[1] and step * scale <= 20 * LONGEST:
            return unit
    return None


def _short(time: Column, layout: Layout, step: float) -> Found:
    """Return s for short steps, or for none; raise where they are too short for a log."""
    if 0 < step < _IMPOSSIBLE:
        said = f"found steps of {step:.3g}, as of days or hours, allowed: times in {_UNITS}"
        hints = unit_hints([time], "s", "takes them as they are")
        raise layout.error(f"{said}; convert them", time.header, *hints)
    return "s", "the usual unit", (_assumed(time, step),) if 0 < step < _UNUSUAL else ()


def _assumed(time: Column, step: float) -> LogWarning:
    said = f"the time {shown(time.name)} steps by {step:.6g}: taken as s"
    hints, taken = unit_hints([time], "s", "confirms it"), "the times are in s"
    return LogWarning("assumed-unit", said, hints=hints, assumption=taken, role="time")


def _question(time: Column, layout: Layout, found: str, units: list[str]) -> LogError:
    """Ask which of some units is meant."""
    hints = (Hint("unit", {time.called: unit}, "says which") for unit in units)
    return layout.error(f"found {found}, which may be {' or '.join(units)}", time.header, *hints)
