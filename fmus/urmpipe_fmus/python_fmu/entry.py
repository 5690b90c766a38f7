"""Where pythonfmu's binary enters the Python of an FMU."""

from __future__ import annotations

import ctypes
import json
import os
import sys
from pathlib import Path
from typing import Any

from urmpipe_fmus.block import TABLE_FILE, Recipe, read_table
from urmpipe_fmus.python_fmu.remake import remake
from urmpipe_fmus.python_fmu.slave import Fmi2Slave

RECIPE_FILE = "unit.json"


def slave_of(module: dict[str, Any], names: dict[str, Any]) -> type[Fmi2Slave]:
    """Return the class that the binary makes instances of.

    The binary imports the FMU's script once, and for every instance runs its text again with names of its
    own (findClass in pythonfmu 0.7); then it gives back a reference to the script's globals that it never
    took, which is made up for here.

    Args:
        module: The script's globals.
        names: The script's names where it calls: its globals when it is imported.
    """
    try:
        return _slave_of(module, names)
    finally:  # packages that the unit alone needs are found on the path until here
        _leave_path(module["__name__"])


def _slave_of(module: dict[str, Any], names: dict[str, Any]) -> type[Fmi2Slave]:
    if names is not module:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(module))
        again: type[Fmi2Slave] = module["Slave"]
        return again
    resources = Path(module["__file__"]).parent
    made = json.loads((resources / RECIPE_FILE).read_text(encoding="utf-8"))
    source = (resources / made["source"]).read_text(encoding="utf-8") if made["source"] else ""
    recipe = Recipe(made["module"], made["function"], made["arguments"], source)
    table_path = resources / Path(TABLE_FILE).name
    table = read_table(table_path) if table_path.exists() else None
    unit = remake(recipe, made["name"], table, f"{module['__name__']}_unit")
    return type("Slave", (Fmi2Slave,), {"unit": unit})


def _leave_path(module_name: str) -> None:
    """Take the FMU's folder out of the module path again, where the binary puts it for every instance."""
    if sys.path and os.path.isfile(os.path.join(sys.path[0], f"{module_name}.py")):  # noqa: PTH113, PTH118
        sys.path_importer_cache.pop(sys.path.pop(0), None)
