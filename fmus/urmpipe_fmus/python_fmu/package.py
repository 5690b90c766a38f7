"""The files of a Python FMU: pythonfmu's binaries, and the unit's sources under names of their own."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import files as distribution_files
from importlib.resources import files
from pathlib import Path, PurePath

from urmpipe_fmus.block import BlockModel, Recipe
from urmpipe_fmus.fmu_file import content_guid
from urmpipe_fmus.python_fmu.closure import check_imports, imports_of, renamed, sources_of
from urmpipe_fmus.python_fmu.entry import RECIPE_FILE
from urmpipe_fmus.python_fmu.remake import remake
from urmpipe_models.errors import FmuError, UnitError, UrmpipeError

PLATFORMS = ("linux64", "win64")
"""Those that pythonfmu has binaries for."""

ENTRY = "urmpipe_fmus.python_fmu.entry"
USER_FILE = "unit_source.py"
LICENCE = "documentation/licenses/pythonfmu.txt"
SCRIPT = '''"""The unit {name}, run by pythonfmu's binary."""

from {entry} import slave_of

Slave = slave_of(globals(), locals())
'''


def python_files(unit: BlockModel, platforms: Sequence[str], table: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return binaries and resources of a unit's Python FMU by their path in it.

    What Python loads by name (the script, urmpipe's packages, the user's file) bears a hash of all of it: in
    one process two FMUs never meet each other's modules, nor those of an installed urmpipe.

    Args:
        unit: The unit.
        platforms: FMI's names of platforms.
        table: The file of the unit's table, if it has one.

    Raises:
        FmuError: If there is no binary for a platform.
        UnitError: If the unit cannot be made again from its recipe, or its file imports what an FMU does not
            bring.
    """
    recipe = _checked_recipe(unit)
    modules = imports_of(recipe.source) if recipe.source else {recipe.module}
    sources = sources_of({ENTRY, *modules})
    described = {
        "name": unit.name,
        "module": recipe.module,
        "function": recipe.function,
        "arguments": recipe.arguments,
        "source": USER_FILE if recipe.source else "",
    }
    text = json.dumps(described, sort_keys=True)
    own = {USER_FILE: recipe.source.encode()} if recipe.source else {}
    mark = _hash({**sources, **own, **table, RECIPE_FILE: text.encode(), "name": unit.name.encode()})
    packages = {renamed(name, mark): _renamed_file(name, sources[name], mark) for name in sources}
    packages |= {name: _renamed_file(name, own[name], mark) for name in own}
    if not recipe.source:
        described["module"] = renamed(recipe.module, mark)
    script = f"{unit.name}_{mark}"
    resources = {
        **packages,
        RECIPE_FILE: json.dumps(described, sort_keys=True).encode(),
        "slavemodule.txt": script.encode(),
        f"{script}.py": renamed(SCRIPT.format(name=unit.name, entry=ENTRY), mark).encode(),
    }
    binaries = _binaries(unit, platforms)
    return {**{f"resources/{name}": resources[name] for name in resources}, **table, **binaries}


def _checked_recipe(unit: BlockModel) -> Recipe:
    """Return the recipe as an FMU holds it, found to make the same variables."""
    recipe = unit.recipe
    try:
        recipe = replace(recipe, arguments=json.loads(json.dumps(dict(recipe.arguments), allow_nan=False)))
    except (TypeError, ValueError) as error:
        raise UnitError(f"unit {unit.name}: arguments of its recipe: found {error}, allowed: JSON") from error
    if recipe.source:
        check_imports(unit.name, recipe.module, recipe.source)
    name = f"urmpipe_unit_{_hash({'source': recipe.source.encode()})}"
    again = _remade(recipe, unit, name)
    if again.variables != unit.variables:
        raise UnitError(
            f"unit {unit.name}: found other variables when made again from its recipe, allowed in a Python"
            " FMU: the same ones"
        )
    return recipe


def _remade(recipe: Recipe, unit: BlockModel, module_name: str) -> BlockModel:
    """Return the unit made again, as the FMU will."""
    try:
        return remake(recipe, unit.name, unit.table, module_name)
    except UrmpipeError:
        raise
    except (Exception, SystemExit) as error:  # a file that reads another one may not find it
        raise UnitError(
            f"unit {unit.name}: found {type(error).__name__}: {error} when made again from its recipe,"
            " allowed in a Python FMU: a recipe that needs nothing else; a native FMU holds what was read"
        ) from error


def _hash(contents: Mapping[str, bytes]) -> str:
    """Return 16 digits of the hash of some files."""
    return content_guid(contents).replace("-", "")[1:17]


def _renamed_file(name: str, content: bytes, mark: str) -> bytes:
    """Return a file; of Python with the packages' names marked."""
    return renamed(content.decode(), mark).encode() if name.endswith(".py") else content


def _binaries(unit: BlockModel, platforms: Sequence[str]) -> dict[str, bytes]:
    """Return pythonfmu's binaries under the unit's name, and their licence."""
    unknown = [one for one in platforms if one not in PLATFORMS]
    if unknown:
        raise FmuError(
            f"unit {unit.name}: found platform {', '.join(unknown)}, allowed in a Python FMU:"
            f" {', '.join(PLATFORMS)}"
        )
    folder = files("pythonfmu") / "resources" / "binaries"
    found = {
        f"binaries/{platform}/{unit.name}{PurePath(one.name).suffix}": one.read_bytes()
        for platform in platforms
        for one in (folder / platform).iterdir()
    }
    licence = next(one for one in distribution_files("pythonfmu") or [] if one.name == "LICENSE")
    return {**found, LICENCE: Path(str(licence.locate())).read_bytes()}
