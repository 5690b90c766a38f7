"""Units and FMUs in the terminal and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from urmpipe.printing.terminal import LISTED, new_console, new_table, say
from urmpipe.systems.units import FROM_LOG, example_of, example_subject
from urmpipe_fmus.blocks import block_names, block_option_help, block_summary, normalise_block_name
from urmpipe_fmus.build.description import TITLES as VARIABLE_HEADS
from urmpipe_fmus.build.description import variable_row
from urmpipe_fmus.cosim.checks import ELEMENT
from urmpipe_pipeline import text

if TYPE_CHECKING:
    from urmpipe_fmus.build.fmu import BuiltFmu
    from urmpipe_fmus.check import CheckedVariable, CheckReport

FIGURES = 6
"""Significant digits of a number in a table; --json has all."""

DESCRIBED_FROM = 140
"""Width of a terminal from which on the variables of an FMU stand with their descriptions, whose words would
break in a narrower one."""

LOG_HELP = "what it plays: a log (CSV), or a folder of plots"
COLUMNS_HELP = "columns of the log by name, such as u or u,i (default: its joints, or the x, y, z of a path)"


def options_of(name: str) -> dict[str, str]:
    """Return a line of help for each option of a unit, as the command line has them."""
    found = dict(block_option_help(name))
    if FROM_LOG[0] in found:
        del found[FROM_LOG[0]]
        found = {"log": LOG_HELP, **found, "columns": COLUMNS_HELP}
    return found


def units_dict() -> dict[str, Any]:
    """Return the object that `urmpipe fmu list --json` prints."""
    units = [
        {
            "name": name,
            "description": block_summary(name),
            "options": [{"name": option, "help": said} for option, said in options_of(name).items()],
        }
        for name in block_names()
    ]
    return {"schema": 1, "units": units}


def print_units() -> None:
    """Print each unit with a line, and its options."""
    table = new_table("Unit", "Description", "Option", "", title="Units")
    for name in block_names():
        options = list(options_of(name).items()) or [("", "")]
        for row, (option, said) in enumerate(options):
            first = (name, block_summary(name)) if not row else ("", "")
            shown = f"--{option}" if option in ("robot", "log") else option and f"-s {option}="
            table.add_row(*first, shown, said)
    new_console().print(table)
    say("Its inputs, outputs and parameters: urmpipe fmu list UNIT")
    say("Build one: urmpipe fmu build UNIT [--robot R] [--log LOG] [-s NAME=VALUE]")


def unit_dict(name: str) -> dict[str, Any]:
    """Return the object that `urmpipe fmu list UNIT --json` prints."""
    unit = example_of(name)
    options = options_of(name) if normalise_block_name(name) in block_names() else {}
    return {
        "schema": 1,
        "name": unit.name,
        "description": unit.description,
        "options": [{"name": option, "help": said} for option, said in options.items()],
        "variables": [
            dict(zip(("name", "part", "unit", "start", "min", "max", "description"), row, strict=True))
            for row in map(variable_row, unit.variables)
        ],
        "equations": list(unit.equations),
    }


def print_unit(name: str) -> None:
    """Print the inputs, outputs and parameters of a unit, and its equations."""
    unit = example_of(name)
    table = new_table(*VARIABLE_HEADS, title=f"{unit.name}: {unit.description}")
    subject, kind = example_subject(name)
    rows = [variable_row(one, digits=FIGURES) for one in unit.variables]
    for row in sorted(rows, key=lambda row: _part_order(row[1])):
        table.add_row(*row)
    new_console().print(table)
    for line in unit.equations:
        say(line)
    if subject:
        another = f"Those for another {kind}: build it, then urmpipe fmu check"
        say(f"These are the variables for {subject}. {another}")
    say("A parameter is set where the unit runs: in a system by start, in another tool as its start value")


def _part_order(part: str) -> int:
    """Return where a variable stands: what goes in, what comes out, what can be set, the rest."""
    order = ("input", "output", "parameter", "calculatedParameter", "local", "independent")
    causality = part.partition(",")[0]
    return order.index(causality) if causality in order else len(order)


def print_built(made: BuiltFmu) -> None:
    """Print what was built, where it is and what is inside."""
    say(f"Built {made.unit.name}: {made.unit.description}")
    inside = f"{made.backend}, {', '.join(made.platforms)}"
    size = f"{made.path.stat().st_size / 1e3:.0f} kB"
    say(f"FMU: {made.path}  ({inside}, {size}, guid {made.guid})")
    if made.note:
        say(f"note: {made.note}", err=True)


def checked_dict(checked: CheckReport) -> dict[str, Any]:
    """Return the object that `urmpipe fmu check --json` prints."""
    found = checked.to_dict()
    return {"schema": 1, "fmu": found.pop("path"), **found}


def print_checked(checked: CheckReport) -> None:
    """Print what was found in an FMU, and a table of its variables."""
    console = new_console()
    ran = f"{checked.steps} steps of {1e3 * checked.step:.6g} ms" if checked.ran else "it did not run"
    platforms = ", ".join(checked.platforms) or "no platform"
    say(f"{checked.path}: {checked.name} of {checked.generator or 'an unknown tool'}, {platforms}; {ran}")
    for problem in checked.problems:
        say(f"problem: {problem}")
    for warning in checked.warnings:
        say(f"warning: {warning}")
    if not checked.problems:
        say("No problem found.")
    heads = ("Variable", "Causality", "Type", "Unit", "Start", "Min", "Max", "Before", "After", "Description")
    shown = heads if console.width >= DESCRIBED_FROM else heads[:-1]
    table = new_table(*shown, title=text.counted(len(checked.variables), "variable"))
    rows = sorted(_arrays(checked.variables), key=lambda row: _part_order(row[1][0].causality))
    for name, elements in rows[:LISTED]:
        table.add_row(*_cells(name, elements)[: len(shown)])
    console.print(table)
    if shown is not heads:
        say(f"Descriptions: in a terminal of {DESCRIBED_FROM} columns, or --json")
    if len(rows) > LISTED:
        console.print(f"... and {len(rows) - LISTED} more; --json has all")


def _arrays(variables: Sequence[CheckedVariable]) -> list[tuple[str, list[CheckedVariable]]]:
    """Return the variables by their names, the elements of an array as one: `phi[1..6]`."""
    found: dict[tuple[str, str], list[CheckedVariable]] = {}
    for one in variables:
        array = ELEMENT.fullmatch(one.name)
        found.setdefault((array[1] if array else one.name, one.causality), []).append(one)
    return [(_array_name(name, elements), elements) for (name, _), elements in found.items()]


def _array_name(name: str, elements: Sequence[CheckedVariable]) -> str:
    """Return the name of a variable, or of an array with its first and its last index."""
    if len(elements) == 1:
        return elements[0].name
    first, last = (one.name.removeprefix(name).strip("[]") for one in (elements[0], elements[-1]))
    return f"{name}[{first}..{last}]"


def _cells(name: str, elements: Sequence[CheckedVariable]) -> tuple[str, ...]:
    """Return the cells of a variable or an array."""
    one = elements[0]
    columns = (
        [_number(each.start) for each in elements],
        [_bound(each.min) for each in elements],
        [_bound(each.max) for each in elements],
        [_shown(each.before) for each in elements],
        [_shown(each.after) for each in elements],
    )
    said = one.description if len({each.description for each in elements}) == 1 else f"{one.description}, ..."
    return (name, one.causality, one.type, one.unit, *map(_joined, columns), said)


def _joined(values: Sequence[str]) -> str:
    """Return the values of an array's elements; one value if they are all the same."""
    return values[0] if len(set(values)) == 1 else ", ".join(values)


def _number(written: str) -> str:
    """Return a start value as an FMU writes it, a number in six digits."""
    try:
        return _shown(float(written))
    except ValueError:
        return written


def _bound(value: float | None) -> str:
    """Return a bound; nothing where there is none."""
    return "" if value is None else _shown(value)


def _shown(value: Any) -> str:
    """Return a value of a variable, a number in six digits."""
    if value is None:
        return text.NOTHING
    return f"{value + 0.0:.{FIGURES}g}" if isinstance(value, float) else str(value)  # + 0.0: no -0
