"""The units that are shipped, by name, with the options that they are made with."""

from __future__ import annotations

import importlib
import inspect
from typing import Any

import pytest

from shipped_units import TABLE, UNITS
from urmpipe_fmus.blocks import block_names, block_option_help, block_summary, make_block
from urmpipe_models.robots.catalogue import load_robot

TIP = {"body": "c3.body", "point": [0, 1, 0]}
OTHERS: list[tuple[str, dict[str, Any]]] = [
    ("kinematic_chain", {"robot": load_robot("urm6"), "points": ["p6", "p2"]}),
    ("network_motion", {"network": "rccc", "points": {"tip": TIP}}),
    ("log_source", {"table": TABLE, "columns": [["q", "rad", 2], ["d", "m", None, "a way"]]}),
]


def test_every_unit_that_is_shipped_is_here() -> None:
    assert {name for name, _ in UNITS.values()} == set(block_names())


@pytest.mark.parametrize(("name", "options"), [*UNITS.values(), *OTHERS])
def test_a_unit_has_help_and_its_recipe_makes_it_again(name: str, options: dict[str, Any]) -> None:
    model = make_block(name, **options)
    module, recipe = importlib.import_module(model.recipe.module), model.recipe
    assert list(inspect.signature(getattr(module, name)).parameters) == list(block_option_help(name))
    assert block_summary(name)
    assert model.name == name
    table = {"table": model.table} if model.table else {}
    again = getattr(module, recipe.function)(**recipe.arguments, **table)
    for attribute in ("variables", "description", "equations", "source", "recipe"):
        assert getattr(again, attribute) == getattr(model, attribute)
