"""The limit of a signal X: the parameter X_max of its block, drawn where X is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from presented import figures
from urmpipe_pipeline.presentation.figure import Figure
from urmpipe_pipeline.results import present
from urmpipe_pipeline.simulations.limits import limits_of
from urmpipe_pipeline.simulations.simulation import Setting, Signal, SimulatedBlock, Simulation

MakeSimulation = Callable[..., Simulation]

U = np.array([[-3.0, 0.0], [3.0, 5.0]])


@pytest.fixture
def limited(make_simulation: MakeSimulation) -> Callable[..., Simulation]:
    """A block with the voltages u and w, and its settings."""

    def limited(*settings: Setting) -> Simulation:
        signals = Signal("arm", "u", U, "V"), Signal("arm", "w", np.zeros(2), "V")
        blocks = (SimulatedBlock("arm", "unit", "any", "", settings),)
        return replace(make_simulation(2), signals=signals, blocks=blocks, verdicts=(), arms=())

    return limited


def only_figure(simulation: Simulation) -> Figure:
    (section,) = present(simulation).body.sections
    (figure,) = figures(section)
    return figure


@pytest.mark.parametrize(
    "settings",
    [(Setting("u_max", 4.0, "V"),), (Setting("u_max[1]", 4.0, "V"), Setting("u_max[2]", 4.0, "V"))],
)
def test_a_limit_is_drawn_beside_what_has_none(
    limited: Callable[..., Simulation], settings: tuple[Setting, ...]
) -> None:
    figure = only_figure(limited(*settings))
    u, w = figure.views[0].panels
    assert (u.title, u.limit, u.limit_name, u.unit) == ("u[1], u[2]", 4.0, "limit of u[1], u[2]", "V")
    np.testing.assert_array_equal(u.lines[0].values, U)
    assert (w.title, w.limit) == ("w", None)
    assert figure.caption == "Dashed: the limit of |u|, 4 V; tinted: beyond it."


def test_elements_of_different_limits_stand_in_panels_of_their_own(
    limited: Callable[..., Simulation],
) -> None:
    settings = Setting("u_max[1]", 4.0, "V"), Setting("u_max[2]", 6.0, "V"), Setting("w_max", 6.0, "V")
    figure = only_figure(limited(*settings))
    first, second = figure.views[0].panels
    assert [(one.title, one.limit) for one in (first, second)] == [("u[1]", 4.0), ("u[2], w", 6.0)]
    np.testing.assert_array_equal(first.lines[0].values, U[:, :1])
    np.testing.assert_array_equal(second.lines[0].values, U[:, 1:])
    colours = [colour for panel in (first, second) for line in panel.lines for colour in line.colours]
    assert len(set(colours)) == 3
    words = "the limit of |u|, 4 and 6 V and the limit of |w|, 6 V"
    assert figure.caption == f"Dashed: {words}; tinted: beyond it."


def test_one_limit_of_several_like_blocks_is_one_panel(make_simulation: MakeSimulation) -> None:
    names = ("c1", "c2", "c3")
    simulation = replace(
        make_simulation(2),
        signals=tuple(Signal(name, "u", np.zeros(2), "V") for name in names),
        blocks=tuple(
            SimulatedBlock(name, "unit", "any", "", (Setting("u_max", 48.0, "V"),)) for name in names
        ),
        verdicts=(),
    )
    (panel,) = only_figure(simulation).views[0].panels
    assert (panel.title, panel.limit, len(panel.lines)) == ("u", 48.0, 3)


@pytest.mark.parametrize(
    "setting",
    [
        Setting("u_max", 4.0, "A"),
        Setting("u_max", -4.0, "V"),
        Setting("u_max", np.inf, "V"),
        Setting("u_max", np.nan, "V"),
        Setting("u_max", 4.0, "V", "output"),
        Setting("u_max[3]", 4.0, "V"),
        Setting("umax", 4.0, "V"),
    ],
)
def test_what_is_no_limit_is_not_drawn(limited: Callable[..., Simulation], setting: Setting) -> None:
    simulation = limited(setting)
    assert limits_of(simulation) == {}
    figure = only_figure(simulation)
    (panel,) = figure.views[0].panels
    assert (panel.title, panel.limit, figure.caption) == ("u, w", None, "")
