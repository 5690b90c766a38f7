"""Making a unit again from its recipe, where its FMU runs."""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType

from urmpipe_fmus.block import BlockModel, Recipe, Table
from urmpipe_models.errors import UnitError


def remake(recipe: Recipe, name: str, table: Table | None, module_name: str) -> BlockModel:
    """Return the unit that a recipe makes.

    Args:
        recipe: The recipe.
        name: Name of the unit.
        table: What it is given as the argument `table`; None for a unit without one.
        module_name: What a user's file is called among the loaded modules: no other one is called that.

    Raises:
        UnitError: If there is no recipe, or it makes no unit of that name.
    """
    if not recipe.module:
        raise UnitError(
            f"unit {name}: found no recipe to make it again, allowed for a Python FMU: a unit of urmpipe's or"
            " of a file of its own; a native FMU needs none"
        )
    module = _ran(recipe, module_name) if recipe.source else import_module(recipe.module)
    if recipe.function:
        given = {} if table is None else {"table": table}
        made = [getattr(module, recipe.function)(**recipe.arguments, **given)]
    else:
        made = [one for one in vars(module).values() if isinstance(one, BlockModel)]
    for one in made:
        if isinstance(one, BlockModel) and one.name == name:
            return one
    raise UnitError(
        f"unit {name}: found no unit of that name in {recipe.module}, allowed: its recipe makes it"
    )


def _ran(recipe: Recipe, module_name: str) -> ModuleType:
    """Return the module of a user's file, run from its text."""
    module = ModuleType(module_name)
    module.__file__ = (
        f"<FMU>/{recipe.module}"  # a place with nothing beside it: only the file goes into an FMU
    )
    sys.modules[module_name] = module  # dataclasses look their module up there
    exec(compile(recipe.source, recipe.module, "exec"), vars(module))
    return module
