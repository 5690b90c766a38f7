"""Which signals share a plot: one block, one unit, a colour for each line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from urmpipe_pipeline.presentation.palette import AXIS_COLOURS, JOINT_COLOURS
from urmpipe_pipeline.simulations.signal_groups import groups_of
from urmpipe_pipeline.simulations.simulation import Signal, SimulatedBlock, Simulation
from urmpipe_pipeline.text import choose_unit

MakeSimulation = Callable[..., Simulation]


def test_signals_stand_by_block_and_unit_and_what_is_judged_by_itself(
    make_simulation: MakeSimulation,
) -> None:
    simulation = make_simulation(3)
    found = [(one.block, one.variables, one.unit) for one in groups_of(simulation)]
    assert found == [
        ("log", "q", "rad"),
        ("chain", "p7", "m"),
        ("meter", "delta, norm", "m"),
        ("meter", "out_of_tolerance", ""),
    ]
    judged = groups_of(simulation)[2]
    assert judged.verdict is simulation.verdicts[0]
    assert judged.colours == (tuple(AXIS_COLOURS.values())[:3], (AXIS_COLOURS["norm"],))


def with_signals(simulation: Simulation, *signals: Signal) -> Simulation:
    return replace(simulation, signals=signals, verdicts=())


def test_a_plot_has_no_more_lines_than_colours_but_an_array_stays_whole(
    make_simulation: MakeSimulation,
) -> None:
    simulation = make_simulation(2)
    scalars = [Signal("b", f"x{k}", np.zeros(2), "V") for k in range(10)]
    wide = Signal("b", "w", np.zeros((2, 12)), "A")
    groups = groups_of(with_signals(simulation, *scalars[:5], wide, *scalars[5:]))
    assert [(one.variables, one.unit) for one in groups] == [("x0 ... x7", "V"), ("x8, x9", "V"), ("w", "A")]
    assert [one for colours in groups[0].colours for one in colours] == list(JOINT_COLOURS)
    assert groups[2].colours == ((*JOINT_COLOURS, *JOINT_COLOURS[:4]),)


def test_every_signal_is_in_one_group(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(2)
    signals = [
        Signal(f"b{k % 3}", f"x{k}", np.zeros((2, k % 5 + 1)), ("V", "A", "")[k % 2]) for k in range(20)
    ]
    simulation = with_signals(simulation, *signals)
    grouped = [one.name for group in groups_of(simulation) for one in group.signals]
    assert sorted(grouped) == sorted(one.name for one in simulation.signals)
    assert all(len({(one.block, one.unit) for one in group.signals}) == 1 for group in groups_of(simulation))


def test_three_blocks_of_one_kind_are_plotted_variable_by_variable(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(2)
    names = ["a1", "log", "a2", "a3"]
    signals = [
        Signal(name, variable, np.zeros((2, width)), unit)
        for name in names
        for variable, width, unit in (("Mk", 1, "N.m"), ("q", 4, "rad"))
    ]
    blocks = tuple(
        SimulatedBlock(name, "unit", "log_source" if name == "log" else "dc_drive", "") for name in names
    )
    groups = groups_of(replace(with_signals(simulation, *signals), blocks=blocks))
    assert [(one.block, one.variables, [signal.block for signal in one.signals]) for one in groups] == [
        ("a1 ... a3", "Mk", ["a1", "a2", "a3"]),
        ("a1 ... a3", "q", ["a1", "a2"]),  # eight lines
        ("a1 ... a3", "q", ["a3"]),
        ("log", "Mk", ["log"]),
        ("log", "q", ["log"]),
    ]
    assert groups[0].names == (("a1.Mk[1]",), ("a2.Mk[1]",), ("a3.Mk[1]",))
    assert groups[3].names == (("Mk[1]",),)


@pytest.mark.parametrize("other", ["unit", "variable", "verdict"])
def test_blocks_that_differ_or_are_judged_are_plotted_by_themselves(
    make_simulation: MakeSimulation, other: str
) -> None:
    simulation = make_simulation(2)
    signals = [Signal(name, "x", np.zeros(2), "V") for name in ("a", "b", "meter")]
    if other == "unit":
        signals[0] = replace(signals[0], unit="A")
    if other == "variable":
        signals[0] = replace(signals[0], variable="y")
    blocks = tuple(SimulatedBlock(name, "unit", "any", "") for name in ("a", "b", "meter"))
    verdicts = simulation.verdicts if other == "verdict" else ()
    found = groups_of(replace(simulation, signals=tuple(signals), blocks=blocks, verdicts=verdicts))
    assert [one.block for one in found] == ["a", "b", "meter"]


@pytest.mark.parametrize(
    ("unit", "wanted", "shown", "of_one"),
    [
        ("rad", "deg", "deg", 57.29577951308232), ("m", "mm", "mm", 1000.0),
        ("rad/s", "rpm", "rpm", 9.54929658551372),
        ("rad", "", "rad", 1.0), ("N.m", "lbf.ft", "N.m", 1.0), ("m", "deg", "m", 1.0),
    ],
)  # fmt: skip
def test_a_display_unit_that_is_known_is_shown(unit: str, wanted: str, shown: str, of_one: float) -> None:
    assert choose_unit(unit, wanted) == (shown, of_one)


def test_signals_with_two_display_units_are_shown_in_their_own(make_simulation: MakeSimulation) -> None:
    two = (Signal("b", "x", np.zeros(2), "m", "mm"), Signal("b", "y", np.zeros(2), "m"))
    assert groups_of(with_signals(make_simulation(2), *two))[0].shown == ("m", 1.0)
    assert groups_of(with_signals(make_simulation(2), two[0]))[0].shown == ("mm", 1000.0)
