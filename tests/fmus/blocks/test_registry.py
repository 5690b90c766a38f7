"""The units that are shipped, by name, and the options that they are made with."""

from __future__ import annotations

import importlib
import inspect

import numpy as np
import pytest

from asserting import refusal
from made_masses import with_drives, with_masses
from urmpipe_fmus.block import BlockModel, Output, Table
from urmpipe_fmus.blocks import (
    block_names,
    block_option_help,
    block_summary,
    make_block,
    normalise_block_name,
)
from urmpipe_models.errors import UnitError
from urmpipe_models.robots.catalogue import load_robot

ARM = with_drives(with_masses(load_robot("urm4")))
POINTS = "p1, p2, p3, p4, p5"
TABLE = Table(np.array([0, 5_000_000]), np.array([[0.5, 1.0], [0.25, 2.0]]))


def test_the_options_told_are_the_arguments_taken_and_a_unit_has_its_own_name() -> None:
    given: dict[str, dict[str, object]] = {
        "kinematic_chain": {"robot": load_robot("urm4")},
        "repolarizer": {"joints": 4},
        "log_source": {"table": TABLE, "columns": [["q", "rad", 2]]},
        "chain_dynamics": {"robot": ARM},
        "driven_arm": {"robot": ARM},
        "network_motion": {"network": "four-bar"},
    }
    for name in block_names():
        model = make_block(name, **given.get(name, {}))
        function = getattr(importlib.import_module(model.recipe.module), name)
        assert list(inspect.signature(function).parameters) == list(block_option_help(name))
        assert block_summary(name)
        assert model.name == name


def remade(model: BlockModel) -> BlockModel:
    recipe = model.recipe
    given = dict(recipe.arguments) | ({"table": model.table} if model.table else {})
    made: BlockModel = getattr(importlib.import_module(recipe.module), recipe.function)(**given)
    return made


@pytest.mark.parametrize("robot", ["urm6", "ur5e"])
def test_a_unit_made_again_by_its_recipe_is_the_same_bit_by_bit(robot: str) -> None:
    for model in (
        make_block("kinematic_chain", robot=load_robot(robot), points=["p6", "p2"], rates=True),
        make_block("chain_dynamics", robot=with_masses(load_robot(robot))),
        make_block("driven_arm", robot=with_drives(with_masses(load_robot(robot)))),
        make_block("repolarizer", joints=3),
        make_block("network_motion", network="rccc", points={"tip": {"body": "c3.body", "point": [0, 1, 0]}}),
        make_block("delta_meter"),
        make_block("log_source", table=TABLE, columns=[["q", "rad"], ["d", "m", None, "a way"]]),
    ):
        again = remade(model)
        for name in ("variables", "description", "equations", "source", "recipe"):
            assert getattr(again, name) == getattr(model, name)


def test_an_unknown_unit_is_told_what_there_is() -> None:
    names = ", ".join(block_names())
    for ask in (make_block, block_summary, block_option_help):
        message = refusal(UnitError, ask, "gearbox")
        assert message == f"unit: found 'gearbox', allowed: {names}, or a .py file with a unit in it"


def test_hyphens_stand_for_underscores() -> None:
    assert make_block("dc-drive").variables == make_block("dc_drive").variables
    assert (normalise_block_name("dc-drive"), normalise_block_name("gear-box")) == ("dc_drive", "gear-box")
    assert block_summary("log-source") == block_summary("log_source")
    assert block_option_help("log-source") == block_option_help("log_source")


@pytest.mark.parametrize("name", ["DC_Drive", "dcdrive"])
def test_the_unit_that_was_meant_is_told(name: str) -> None:
    with pytest.raises(UnitError, match=rf"^unit: found '{name}' \(did you mean dc_drive\?\), allowed: "):
        make_block(name)


def test_one_point_needs_no_list() -> None:
    arm = load_robot("urm4")
    one = make_block("kinematic_chain", robot=arm, points="p5", sensors="p4")
    listed = make_block("kinematic_chain", robot=arm, points=["p5"], sensors=["p4"])
    assert one.variables == listed.variables
    found = [var.name for var in one.variables if isinstance(var, Output)]
    assert found == ["p5", "rz4", "ry4", "rx4", "singular4"]


def test_unknown_and_missing_options_are_all_told_at_once() -> None:
    assert refusal(UnitError, make_block, "repolarizer", axes=6, period=1.0).splitlines() == [
        "unit repolarizer: option axes: found, allowed: joints; a parameter is set where the unit runs, in"
        " a system by start = { axes = ... }, in another tool as the FMU's start value",
        "unit repolarizer: option period: found, allowed: joints; a parameter is set where the unit runs, in"
        " a system by start = { period = ... }, in another tool as the FMU's start value",
        "unit repolarizer: option joints: not found, it needs the number of joints, such as 6",
    ]
    assert refusal(UnitError, make_block, "delta_meter", tolerance=0.001) == (
        "unit delta_meter: option tolerance: found, allowed: none, it has no options; a parameter is set"
        " where the unit runs, in a system by start = { tolerance = ... }, in another tool as the FMU's"
        " start value"
    )
    with pytest.raises(UnitError, match=r"option joint: found \(did you mean joints\?\), allowed: joints;"):
        make_block("repolarizer", joint=6)


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("repolarizer", {"joints": 0}, "option joints: found 0, allowed: an integer, 1 or more"),
        ("repolarizer", {"joints": True}, "option joints: found True, allowed: an integer, 1 or more"),
        ("repolarizer", {"joints": "6"}, "option joints: found '6', allowed: an integer, 1 or more"),
        ("repolarizer", {"joints": 1001}, "option joints: found 1001, allowed: 1000 at most"),
        ("kinematic_chain", {"robot": "urm4"}, "option robot: found 'urm4', allowed: a robot (Chain)"),
        ("kinematic_chain", {"robot": ARM, "points": 5},
         f"option points: found 5, allowed: a list of {POINTS}"),
        ("kinematic_chain", {"robot": ARM, "sensors": ["p9"]},
         f"option sensors: found 'p9', allowed: {POINTS}"),
        ("kinematic_chain", {"robot": ARM, "points": [], "sensors": ()},
         "options points, sensors: found none, allowed: one of either"),
        ("kinematic_chain", {"robot": ARM, "rates": 1}, "option rates: found 1, allowed: true or false"),
        ("log_source", {"table": TABLE, "columns": [["q", "rad", 6]]},
         "option columns: found 6 columns, allowed: 2 of the table"),
        ("log_source", {"table": TABLE, "columns": ["q", "d"]},
         "option columns: found 'q', allowed: name, unit, size and description"),
        ("log_source", {"table": TABLE, "columns": [["q", "rad", 2]], "interpolate": "yes"},
         "option interpolate: found 'yes', allowed: true or false"),
    ],
)  # fmt: skip
def test_options_that_make_no_sense_are_refused(name: str, options: dict[str, object], said: str) -> None:
    assert refusal(UnitError, make_block, name, **options) == f"unit {name}: {said}"
