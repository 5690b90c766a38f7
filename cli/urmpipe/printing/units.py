"""Units, FMUs and systems in the terminal and as JSON.

1. Units: `urmpipe fmu list`, all with their options or one with its variables.
2. FMUs: what `fmu build` built and `fmu check` found; the elements of an array are one row.
3. Systems: `urmpipe simulate --list`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from urmpipe.printing.terminal import LISTED, join_lines, new_console, new_table, print_line
from urmpipe.systems.units import FROM_LOG, example_of, example_subject
from urmpipe_fmus.blocks import block_names, block_option_help, block_summary, normalise_block_name
from urmpipe_fmus.build.description import TITLES as VARIABLE_HEADS
from urmpipe_fmus.build.description import variable_row
from urmpipe_fmus.cosim.checks import ELEMENT
from urmpipe_models.display import format_count
from urmpipe_pipeline import text

if TYPE_CHECKING:
    from urmpipe_fmus.build.fmu import BuiltFmu
    from urmpipe_fmus.check import CheckedVariable, CheckReport
    from urmpipe_fmus.cosim.system import System

DIGITS = 6  # significant digits of a number in a table; --json has all
MIN_DESCRIPTION_WIDTH = 140  # characters of a terminal that has room for the descriptions of variables
CAUSALITIES = ("input", "output", "parameter", "calculatedParameter", "local", "independent")  # order of rows
LOG_HELP = "what it plays: a log (CSV), or a folder of plots"
COLUMNS_HELP = "columns of the log by name, such as u or u,i (default: its joints, or the x, y, z of a path)"


def units_dict() -> dict[str, Any]:
    """Return the object that `urmpipe fmu list --json` prints."""
    units = [
        {"name": name, "description": block_summary(name), "options": _options_list(name)}
        for name in block_names()
    ]
    return {"schema": 1, "units": units}


def unit_dict(name: str) -> dict[str, Any]:
    """Return the object that `urmpipe fmu list UNIT --json` prints."""
    unit = example_of(name)
    keys = ("name", "part", "unit", "start", "min", "max", "description")
    return {
        "schema": 1,
        "name": unit.name,
        "description": unit.description,
        "options": _options_list(name) if normalise_block_name(name) in block_names() else [],
        "variables": [dict(zip(keys, row, strict=True)) for row in map(variable_row, unit.variables)],
        "equations": list(unit.equations),
    }


def _options_list(name: str) -> list[dict[str, str]]:
    return [{"name": option, "help": line} for option, line in option_help(name).items()]


def option_help(name: str) -> dict[str, str]:
    """Return a line of help for each option of a unit on the command line."""
    options = dict(block_option_help(name))
    if FROM_LOG[0] in options:
        del options[FROM_LOG[0]]
        options = {"log": LOG_HELP, **options, "columns": COLUMNS_HELP}
    return options


def print_units() -> None:
    """Print each unit with a line, and its options."""
    table = new_table("Unit", "Description", "Option", "", title="Units")
    for name in block_names():
        first = (name, block_summary(name))
        for option, line in option_help(name).items() or [("", "")]:
            written = f"--{option}" if option in ("robot", "log") else option and f"-s {option}="
            table.add_row(*first, written, line)
            first = ("", "")
    new_console().print(table)
    print_line("Its inputs, outputs and parameters: urmpipe fmu list UNIT")
    print_line("Build one: urmpipe fmu build UNIT [--robot R] [--log LOG] [-s NAME=VALUE]")


def print_unit(name: str) -> None:
    """Print the inputs, outputs and parameters of a unit, and its equations."""
    unit = example_of(name)
    table = new_table(*VARIABLE_HEADS, title=f"{unit.name}: {unit.description}")
    rows = [variable_row(variable, digits=DIGITS) for variable in unit.variables]
    for row in sorted(rows, key=lambda row: _causality_order(row[1])):
        table.add_row(*row)
    new_console().print(table)
    for equation in unit.equations:
        print_line(equation)
    subject, kind = example_subject(name)
    if subject:
        another = f"Those for another {kind}: build it, then urmpipe fmu check"
        print_line(f"These are the variables for {subject}. {another}")
    print_line(
        "A parameter is set where the unit runs: in a system by start, in another tool as its start value"
    )


def _causality_order(part: str) -> int:
    causality = part.partition(",")[0]
    return CAUSALITIES.index(causality) if causality in CAUSALITIES else len(CAUSALITIES)


def print_systems(systems: Sequence[System]) -> None:
    """Print the shipped systems with a line and their arguments."""
    table = new_table("System", "Description", "--set", title="Systems")
    for system in systems:
        arguments = join_lines(f"{name}={value}" for name, value in system.arguments.items())
        table.add_row(system.name, system.description, arguments)
    new_console().print(table)
    print_line("Run one: urmpipe simulate SYSTEM [--set NAME=VALUE]")
    print_line("Change anything else: urmpipe simulate SYSTEM --write-system FILE.toml")


def print_built(fmu: BuiltFmu) -> None:
    """Print the unit, path and content of a built FMU."""
    print_line(f"Built {fmu.unit.name}: {fmu.unit.description}")
    content = f"{fmu.backend}, {', '.join(fmu.platforms)}"
    size = f"{fmu.path.stat().st_size / 1e3:.0f} kB"
    print_line(f"FMU: {fmu.path}  ({content}, {size}, guid {fmu.guid})")
    if fmu.note:
        print_line(f"note: {fmu.note}", err=True)


def checked_dict(report: CheckReport) -> dict[str, Any]:
    """Return the object that `urmpipe fmu check --json` prints."""
    fields = report.to_dict()
    return {"schema": 1, "fmu": fields.pop("path"), **fields}


def print_checked(report: CheckReport) -> None:
    """Print the problems of an FMU, and a table of its variables."""
    console = new_console()
    run = f"{report.steps} steps of {1e3 * report.step:.6g} ms" if report.ran else "it did not run"
    platforms = ", ".join(report.platforms) or "no platform"
    print_line(f"{report.path}: {report.name} of {report.generator or 'an unknown tool'}, {platforms}; {run}")
    for problem in report.problems:
        print_line(f"problem: {problem}")
    for warning in report.warnings:
        print_line(f"warning: {warning}")
    if not report.problems:
        print_line("No problem found.")
    heads = ["Variable", "Causality", "Type", "Unit", "Start", "Min", "Max", "Before", "After"]
    if console.width >= MIN_DESCRIPTION_WIDTH:
        heads.append("Description")
    table = new_table(*heads, title=format_count(len(report.variables), "variable"))
    rows = _arrays(report.variables)
    for name, elements in rows[:LISTED]:
        table.add_row(*_variable_cells(name, elements)[: len(heads)])
    console.print(table)
    if console.width < MIN_DESCRIPTION_WIDTH:
        print_line(f"Descriptions: in a terminal of {MIN_DESCRIPTION_WIDTH} columns, or --json")
    if len(rows) > LISTED:
        console.print(f"... and {len(rows) - LISTED} more; --json has all")


def _arrays(variables: Sequence[CheckedVariable]) -> list[tuple[str, list[CheckedVariable]]]:
    """Return the variables by name and causality; the elements of an array are one: `phi[1..6]`."""
    arrays: dict[tuple[str, str], list[CheckedVariable]] = {}
    for variable in variables:
        array = ELEMENT.fullmatch(variable.name)
        arrays.setdefault((array[1] if array else variable.name, variable.causality), []).append(variable)
    named = []
    for (name, _), elements in arrays.items():
        first, last = (element.name.removeprefix(name).strip("[]") for element in (elements[0], elements[-1]))
        named.append((f"{name}[{first}..{last}]" if len(elements) > 1 else elements[0].name, elements))
    return sorted(named, key=lambda row: _causality_order(row[1][0].causality))


def _variable_cells(name: str, elements: Sequence[CheckedVariable]) -> tuple[str, ...]:
    def join(value: Callable[[CheckedVariable], str]) -> str:
        values = [value(element) for element in elements]
        return values[0] if len(set(values)) == 1 else ", ".join(values)

    first = elements[0]
    description = first.description
    if len({element.description for element in elements}) > 1:
        description = f"{description}, ..."
    return (
        name, first.causality, first.type, first.unit,
        join(lambda element: _format_start(element.start)),
        join(lambda element: "" if element.min is None else _format_value(element.min)),
        join(lambda element: "" if element.max is None else _format_value(element.max)),
        join(lambda element: _format_value(element.before)),
        join(lambda element: _format_value(element.after)),
        description,
    )  # fmt: skip


def _format_start(start: str) -> str:
    """Return a start value as an FMU spells it, but a number in six digits."""
    try:
        return _format_value(float(start))
    except ValueError:
        return start


def _format_value(value: Any) -> str:
    if value is None:
        return text.NOTHING
    return f"{value + 0.0:.{DIGITS}g}" if isinstance(value, float) else str(value)  # + 0.0: no -0
