"""The units that are shipped, by name, with the options that they are made with."""

from __future__ import annotations

import importlib
import inspect
from typing import Any

import numpy as np
import pytest

from made_masses import with_drives, with_masses
from urmpipe_fmus.block import Table
from urmpipe_fmus.blocks import block_names, block_option_help, block_summary, make_block
from urmpipe_models.robots.catalogue import load_robot

TABLE = Table(np.array([0, 5_000_000]), np.array([[0.5, 1.0], [0.25, 2.0]]))
TIP = {"body": "c3.body", "point": [0, 1, 0]}
UNITS: list[tuple[str, dict[str, Any]]] = [
    *((name, {}) for name in ("delta_meter", "dc_drive", "inertia", "drive_controller", "set_point")),
    ("repolarizer", {"joints": 3}),
    ("network_motion", {"network": "rccc", "points": {"tip": TIP}}),
    ("log_source", {"table": TABLE, "columns": [["q", "rad"], ["d", "m", None, "a way"]]}),
]
for robot in ("urm6", "ur5e"):
    arm = with_masses(load_robot(robot))
    UNITS += [
        ("kinematic_chain", {"robot": load_robot(robot), "points": ["p6", "p2"], "rates": True}),
        ("chain_dynamics", {"robot": arm}),
        ("driven_arm", {"robot": with_drives(arm)}),
    ]


def test_every_unit_that_is_shipped_is_here() -> None:
    assert {name for name, _ in UNITS} == set(block_names())


@pytest.mark.parametrize(("name", "options"), UNITS)
def test_a_unit_has_help_for_its_options_and_its_recipe_makes_it_again_bit_by_bit(
    name: str, options: dict[str, Any]
) -> None:
    model = make_block(name, **options)
    module, recipe = importlib.import_module(model.recipe.module), model.recipe
    assert list(inspect.signature(getattr(module, name)).parameters) == list(block_option_help(name))
    assert block_summary(name)
    assert model.name == name
    table = {"table": model.table} if model.table else {}
    again = getattr(module, recipe.function)(**recipe.arguments, **table)
    for attribute in ("variables", "description", "equations", "source", "recipe"):
        assert getattr(again, attribute) == getattr(model, attribute)
