"""The units that are shipped, by name, and the options that they are made with."""

from __future__ import annotations

import importlib
import inspect

import numpy as np
import pytest

from asserting import refusal
from made_masses import with_drives, with_masses
from urmpipe_fmus.block import Output, Table, Unit
from urmpipe_fmus.blocks import make_unit, unit_help, unit_name, unit_names, unit_options
from urmpipe_models.errors import UnitError
from urmpipe_models.robots.catalogue import load_robot

ARM = with_drives(with_masses(load_robot("urm4")))
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
    for name in unit_names():
        unit = make_unit(name, **given.get(name, {}))
        function = getattr(importlib.import_module(unit.recipe.module), name)
        assert list(inspect.signature(function).parameters) == list(unit_options(name))
        assert unit_help(name)
        assert unit.name == name


def remade(unit: Unit) -> Unit:
    recipe = unit.recipe
    given = dict(recipe.arguments) | ({"table": unit.table} if unit.table else {})
    made: Unit = getattr(importlib.import_module(recipe.module), recipe.function)(**given)
    return made


@pytest.mark.parametrize("robot", ["urm6", "ur5e"])
def test_a_unit_made_again_by_its_recipe_is_the_same_bit_by_bit(robot: str) -> None:
    for unit in (
        make_unit("kinematic_chain", robot=load_robot(robot), points=["p6", "p2"], rates=True),
        make_unit("chain_dynamics", robot=with_masses(load_robot(robot))),
        make_unit("driven_arm", robot=with_drives(with_masses(load_robot(robot)))),
        make_unit("repolarizer", joints=3),
        make_unit("network_motion", network="rccc", points={"tip": {"body": "c3.body", "point": [0, 1, 0]}}),
        make_unit("delta_meter"),
        make_unit("log_source", table=TABLE, columns=[["q", "rad"], ["d", "m", None, "a way"]]),
    ):
        again = remade(unit)
        assert again.variables == unit.variables
        assert (again.description, again.equations, again.source) == (
            unit.description,
            unit.equations,
            unit.source,
        )
        assert again.recipe == unit.recipe


def test_an_unknown_unit_is_told_what_there_is() -> None:
    with pytest.raises(UnitError) as error:
        make_unit("gearbox")
    names = ", ".join(unit_names())
    assert str(error.value) == f"unit: found 'gearbox', allowed: {names}, or a .py file with a unit in it"
    for ask in (unit_help, unit_options):
        with pytest.raises(UnitError, match="unit: found 'gearbox'"):
            ask("gearbox")


def test_hyphens_stand_for_underscores() -> None:
    assert make_unit("dc-drive").variables == make_unit("dc_drive").variables
    assert (unit_name("dc-drive"), unit_name("gear-box")) == ("dc_drive", "gear-box")
    assert unit_help("log-source") == unit_help("log_source")
    assert unit_options("log-source") == unit_options("log_source")


@pytest.mark.parametrize("name", ["DC_Drive", "dcdrive"])
def test_the_unit_that_was_meant_is_told(name: str) -> None:
    with pytest.raises(UnitError, match=rf"^unit: found '{name}' \(did you mean dc_drive\?\), allowed: "):
        make_unit(name)


def test_one_point_needs_no_list() -> None:
    arm = load_robot("urm4")
    one = make_unit("kinematic_chain", robot=arm, points="p5", sensors="p4")
    listed = make_unit("kinematic_chain", robot=arm, points=["p5"], sensors=["p4"])
    assert one.variables == listed.variables
    found = [var.name for var in one.variables if isinstance(var, Output)]
    assert found == ["p5", "rz4", "ry4", "rx4", "singular4"]


def test_unknown_and_missing_options_are_all_told_at_once() -> None:
    with pytest.raises(UnitError) as error:
        make_unit("repolarizer", axes=6, period=1.0)
    assert str(error.value).splitlines() == [
        "unit repolarizer: option axes: found, allowed: joints; a parameter is set where the unit runs, in"
        " a system by start = { axes = ... }, in another tool as the FMU's start value",
        "unit repolarizer: option period: found, allowed: joints; a parameter is set where the unit runs, in"
        " a system by start = { period = ... }, in another tool as the FMU's start value",
        "unit repolarizer: option joints: not found, it needs the number of joints, such as 6",
    ]
    with pytest.raises(UnitError, match=r"^unit delta_meter: option name: found, allowed: none"):
        make_unit("delta_meter", name="mine")
    assert refusal(UnitError, make_unit, "delta_meter", tolerance=0.001) == (
        "unit delta_meter: option tolerance: found, allowed: none, it has no options; a parameter is set"
        " where the unit runs, in a system by start = { tolerance = ... }, in another tool as the FMU's"
        " start value"
    )
    with pytest.raises(UnitError, match=r"option joint: found \(did you mean joints\?\), allowed: joints;"):
        make_unit("repolarizer", joint=6)


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("repolarizer", {"joints": 0}, "option joints: found 0, allowed: an integer, 1 or more"),
        ("repolarizer", {"joints": True}, "option joints: found True, allowed: an integer, 1 or more"),
        ("repolarizer", {"joints": "6"}, "option joints: found '6', allowed: an integer, 1 or more"),
        ("kinematic_chain", {"robot": "urm4"}, "option robot: found 'urm4', allowed: a robot (Chain)"),
        (
            "kinematic_chain",
            {"robot": load_robot("urm4"), "points": 5},
            "option points: found 5, allowed: a list of p1, p2, p3, p4, p5",
        ),
        (
            "kinematic_chain",
            {"robot": load_robot("urm4"), "sensors": ["p9"]},
            "option sensors: found 'p9', allowed: p1, p2, p3, p4, p5",
        ),
        (
            "kinematic_chain",
            {"robot": load_robot("urm4"), "points": [], "sensors": ()},
            "options points, sensors: found none, allowed: one of either",
        ),
        (
            "kinematic_chain",
            {"robot": load_robot("urm4"), "rates": 1},
            "option rates: found 1, allowed: true or false",
        ),
        (
            "log_source",
            {"table": TABLE, "columns": [["q", "rad", 6]]},
            "option columns: found 6 columns, allowed: 2 of the table",
        ),
        (
            "log_source",
            {"table": TABLE, "columns": ["q", "d"]},
            "option columns: found 'q', allowed: name, unit, size and description",
        ),
        (
            "log_source",
            {"table": TABLE, "columns": [["q", "rad", 2]], "interpolate": "yes"},
            "option interpolate: found 'yes', allowed: true or false",
        ),
    ],
)
def test_options_that_make_no_sense_are_refused(name: str, options: dict[str, object], said: str) -> None:
    assert refusal(UnitError, make_unit, name, **options) == f"unit {name}: {said}"
