"""The page of documentation inside an FMU."""

from __future__ import annotations

import math
from functools import cache, partial
from importlib.metadata import version
from typing import Any

from urmpipe_fmus.description import markup_text
from urmpipe_fmus.si_units import display_conversion
from urmpipe_fmus.unit import INTERNAL_STEP, Unit
from urmpipe_fmus.variable import Output, Variable

TITLES = ("Name", "Part", "Unit", "Start", "Min", "Max", "Description")
NUMBERS = ("Start", "Min", "Max")


def documentation(unit: Unit) -> str:
    """Return a page of HTML that needs nothing else: variables, equations, source, and what a step does."""
    page = _template().render(
        unit=unit,
        version=version("urmpipe"),
        titles=TITLES,
        numbers=NUMBERS,
        rows=[list(zip(TITLES, variable_row(one), strict=True)) for one in unit.variables],
        steps=_steps(unit),
    )
    return markup_text(page)


@cache
def _template() -> Any:
    """Return the page's template."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("urmpipe_fmus", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template("documentation.html.jinja")


def variable_row(one: Variable, digits: int | None = None) -> tuple[str, ...]:
    """Return what a table says of a variable, in the order of `TITLES`.

    Args:
        one: The variable.
        digits: So many significant digits of each number; None for all.
    """
    value = partial(_value, one, digits=digits)
    name = one.name if one.size is None else f"{one.name}[1]" + (f" .. [{one.size}]" if one.size > 1 else "")
    part = f"{one.causality}, {one.variability}"
    kind = one.type if one.type != "Real" else one.unit
    start = "computed" if isinstance(one, Output) else ", ".join(map(value, _starts(one)))
    return name, part, kind, start, value(one.minimum), value(one.maximum), one.description


def _starts(one: Variable) -> tuple[float, ...]:
    """Return the start values, one if they are all the same."""
    return one.starts[:1] if len(set(one.starts)) == 1 else one.starts


def _value(one: Variable, value: float, digits: int | None) -> str:
    """Return a value, and what it is in the unit that people like to see; nothing for no bound."""
    if not math.isfinite(value):
        return ""
    if one.type == "Boolean":
        return "true" if value else "false"
    short = f"{value:.{digits or 6}g}"
    said = short if digits or float(short) == value else repr(float(value))
    if not one.display_unit or one.display_unit == one.unit:
        return said
    factor, offset = display_conversion(one.unit, one.display_unit)
    return f"{said} ({factor * value + offset:.{digits or 7}g} {one.display_unit})"


def _steps(unit: Unit) -> list[str]:
    """Return what happens from one communication point to the next."""
    lines = [
        "Outputs are those of the inputs as they stand: set inputs, get outputs, without a step in between."
    ]
    if unit.table is not None:
        first, last = (float(t) / 1e9 for t in unit.table.t_ns[[0, -1]])
        lines.append(
            f"It reads a table of {len(unit.table.t_ns)} rows from {first:.9g} s to {last:.9g} s at the time"
            " of the communication point, rounded to nanoseconds; outside the table its first and last row"
            " hold."
        )
    if unit.memories:
        names = ", ".join(one.name for one in unit.memories)
        lines.append(
            f"fmi2DoStep first takes the sample: the next values of {names}, from the inputs as set."
        )
    if unit.states:
        names = ", ".join(one.name for one in unit.states)
        lines.append(
            f"{'Then it' if unit.memories else 'fmi2DoStep'} integrates {names} with the classical"
            f" Runge-Kutta method in equal steps of at most the parameter {INTERNAL_STEP}, the inputs held."
            " A step after which a state is not finite is an error, and undone."
        )
    if not unit.memories and not unit.states:
        lines.append("It remembers nothing: fmi2DoStep only moves the time on.")
    return lines
