"""Units and FMUs in the terminal and as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from urmpipe.printing.terminal import LISTED, new_console, new_table, say
from urmpipe.systems.units import FROM_LOG
from urmpipe_fmus.units import unit_help, unit_names, unit_options
from urmpipe_pipeline.text import NOTHING

if TYPE_CHECKING:
    from urmpipe_fmus.build import BuiltFmu
    from urmpipe_fmus.check import Checked, CheckedVariable

LOG_HELP = "what it plays: a log (CSV), or a folder of plots"
COLUMNS_HELP = "columns of the log by name, such as u or u,i (default: its joints, or the x, y, z of a path)"


def options_of(name: str) -> dict[str, str]:
    """Return a line of help for each option of a unit, as the command line has them."""
    found = dict(unit_options(name))
    if FROM_LOG[0] in found:
        del found[FROM_LOG[0]]
        found = {"log": LOG_HELP, **found, "columns": COLUMNS_HELP}
    return found


def units_dict() -> dict[str, Any]:
    """Return the object that `urmpipe fmu list --json` prints."""
    units = [
        {
            "name": name,
            "description": unit_help(name),
            "options": [{"name": option, "help": said} for option, said in options_of(name).items()],
        }
        for name in unit_names()
    ]
    return {"schema": 1, "units": units}


def print_units() -> None:
    """Print each unit with a line, and its options."""
    table = new_table("Unit", "What it does", "Option", "", title="Units")
    for name in unit_names():
        options = list(options_of(name).items()) or [("", "")]
        for row, (option, said) in enumerate(options):
            first = (name, unit_help(name)) if not row else ("", "")
            shown = f"--{option}" if option in ("robot", "log") else option and f"-s {option}="
            table.add_row(*first, shown, said)
    new_console().print(table)
    say("Build one: urmpipe fmu build UNIT [--robot R] [--log LOG] [-s NAME=VALUE]")


def print_built(made: BuiltFmu) -> None:
    """Print where an FMU is and what is inside."""
    inside = f"{made.backend}, {', '.join(made.platforms)}"
    size = f"{made.path.stat().st_size / 1e3:.0f} kB"
    say(f"FMU: {made.path}  ({inside}, {size}, guid {made.guid})")
    if made.note:
        say(f"note: {made.note}", err=True)


def checked_dict(checked: Checked) -> dict[str, Any]:
    """Return the object that `urmpipe fmu check --json` prints."""
    found = checked.to_dict()
    return {"schema": 1, "fmu": found.pop("path"), **found}


def print_checked(checked: Checked) -> None:
    """Print what was found in an FMU, and a table of its variables."""
    console = new_console()
    ran = f"{checked.steps} steps of {1e3 * checked.step:.6g} ms" if checked.ran else "it did not run"
    platforms = ", ".join(checked.platforms) or "no platform"
    say(f"{checked.path}: {checked.name} of {checked.generator or 'an unknown tool'}, {platforms}; {ran}")
    for problem in checked.problems:
        say(f"problem: {problem}")
    if not checked.problems:
        say("No problem found.")
    heads = ("Variable", "Causality", "Type", "Unit", "Start", "Before", "After", "Description")
    table = new_table(*heads, title=f"{len(checked.variables)} variables")
    for one in checked.variables[:LISTED]:
        table.add_row(*_cells(one))
    console.print(table)
    if len(checked.variables) > LISTED:
        console.print(f"... and {len(checked.variables) - LISTED} more; --json has all")


def _cells(one: CheckedVariable) -> tuple[str, ...]:
    """Return the cells of a variable."""
    values = (_shown(value) for value in (one.before, one.after))
    return (one.name, one.causality, one.type, one.unit, one.start, *values, one.description)


def _shown(value: Any) -> str:
    """Return a value of a variable."""
    if value is None:
        return NOTHING
    return f"{value:.6g}" if isinstance(value, float) else str(value)
