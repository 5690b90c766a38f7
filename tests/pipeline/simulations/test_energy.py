"""The energy balance: what goes in is lost or stored, and what is left over is shown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from asserting import there
from presented import facts, figures
from urmpipe_pipeline.results import present
from urmpipe_pipeline.simulations.coupling import coupling_warnings
from urmpipe_pipeline.simulations.energy import energy_balance
from urmpipe_pipeline.simulations.signal_groups import groups_of
from urmpipe_pipeline.simulations.simulation import Signal, Simulation

MakeSimulation = Callable[..., Simulation]


@pytest.fixture
def swinging(make_simulation: MakeSimulation) -> Simulation:
    """Two blocks of which one starts with 5 J; 0.5 J are left over at the second sample, 0 at the end."""
    return replace(
        make_simulation(3),
        signals=(
            Signal("a", "energy_in", np.array([0.0, 4.0, 8.0]), "J"),
            Signal("a", "x", np.zeros(3), "m"),
            Signal("a", "energy_stored", np.array([5.0, 6.5, 9.0]), "J"),
            Signal("b", "energy_in", np.array([[0.0, 0.0], [1.0, -1.0], [1.0, 1.0]]), "J"),
            Signal("b", "energy_lost", np.array([1.0, 3.0, 7.0]), "J"),
        ),
        verdicts=(),
    )


def test_energies_of_all_blocks_count_from_the_first_sample(swinging: Simulation) -> None:
    balance = there(swinging.energy)
    np.testing.assert_array_equal(balance.supplied, [0.0, 4.0, 10.0])
    np.testing.assert_array_equal(balance.dissipated, [0.0, 2.0, 6.0])
    np.testing.assert_array_equal(balance.stored, [0.0, 1.5, 4.0])
    np.testing.assert_array_equal(balance.residual, [0.0, 0.5, 0.0])
    assert (balance.worst, balance.share(-0.5)) == (1, 0.05)
    assert swinging.to_dict()["energy"] == {
        "supplied": 10.0,
        "dissipated": 6.0,
        "stored": 4.0,
        "residual": 0.0,
    }


def test_the_share_of_a_system_that_exchanges_nothing_is_of_what_it_stores() -> None:
    kinetic, potential = np.array([0.0, 3.0, 5.0]), np.array([5.0, 2.0, 1e-6])
    stored = np.column_stack((kinetic + potential, [-3.0, -3.0, -3.0]))
    balance = there(energy_balance([("energy_stored", stored)]))
    assert balance.initial == 8.0
    assert balance.share(balance.residual[2]) == pytest.approx(1e-6 / 8.0)


def test_the_balance_stands_before_the_blocks_and_only_there(swinging: Simulation) -> None:
    body = present(swinging).body
    assert [one.title for one in body.sections] == ["Energy balance", "a"]
    assert [one.variables for one in groups_of(swinging)] == ["x"]
    (figure,) = figures(body.sections[0])
    energies, residual = (view.panels[0] for view in figure.views)
    np.testing.assert_array_equal(energies.lines[0].values, [[0, 0, 0], [4, 2, 1.5], [10, 6, 4]])
    np.testing.assert_array_equal(residual.lines[0].values, [0.0, 0.5, 0.0])
    assert (energies.unit, residual.unit, residual.peaks) == ("J", "J", (1,))
    assert figure.caption.startswith("Sums over a, b since the first sample: ")
    fact = facts(body)["Energy balance"]
    assert fact == (
        "2 blocks; not accounted for: at most 0.5 J at t = 0.005 s, 5.0 % of the largest energy"
        " supplied, dissipated or stored (coupling of the blocks, or a block without energies)"
    )
    assert "(coupling of the blocks, or a block without energies)" in figure.caption


def test_set_points_stand_before_the_balance(swinging: Simulation) -> None:
    answers = Signal("c", "set_x", np.zeros(3), "m"), Signal("c", "x", np.zeros(3), "m")
    shown = present(replace(swinging, signals=(*swinging.signals, *answers)))
    titles = [one.title for one in shown.body.sections]
    assert titles == ["Set point and answer", "Energy balance", "a", "c"]
    assert [one.title for one in shown.body.sections if one.opened] == ["Set point and answer"]


@pytest.mark.parametrize(("variable", "unit"), [("energy_in", "W"), ("energy", "J"), ("energy_in[1]", "J")])
def test_other_signals_are_no_part_of_it(make_simulation: MakeSimulation, variable: str, unit: str) -> None:
    simulation = replace(make_simulation(3), signals=(Signal("a", variable, np.zeros(3), unit),), verdicts=())
    assert (simulation.energy, simulation.to_dict()["energy"]) == (None, None)
    shown = present(simulation).body
    assert [one.title for one in shown.sections] == ["a"]
    assert "Energy balance" not in facts(shown)


@pytest.mark.parametrize(
    ("values", "worst", "end"),
    [
        (np.empty(0), None, None),
        (np.full(3, np.nan), None, None),
        (np.array([0.0, np.inf, 2.0]), 2, 2.0),
        (np.array([0.0, 3.0, np.nan]), 1, None),
        (np.zeros(3), 0, 0.0),
    ],
)
def test_values_that_are_not_finite_are_left_out(
    make_simulation: MakeSimulation, values: NDArray[np.float64], worst: int | None, end: float | None
) -> None:
    balance = there(energy_balance([("energy_in", values[:, np.newaxis])]))
    assert (balance.worst, balance.to_dict()["residual"]) == (worst, end)
    assert balance.share(0.0) == 0.0
    simulation = make_simulation(len(values))
    simulation = replace(simulation, signals=(Signal("a", "energy_in", values, "J"),), verdicts=(), arms=())
    shown = present(simulation).body
    assert (facts(shown)["Energy balance"] is None) == (worst is None)
    assert len(figures(shown.sections[0])) == (len(values) > 0)


def coupled(swinging: Simulation, **connections: str) -> Simulation:
    """Return blocks that leave over 0.5 J of 10 J, with other connections."""
    return replace(swinging, step=1e-3, connections={k.replace("_", "."): v for k, v in connections.items()})


def test_a_residual_above_5_percent_of_blocks_that_act_on_each_other_is_a_warning(
    swinging: Simulation,
) -> None:
    both = coupled(swinging, a_force="b.x", b_x="a.force")
    assert list(coupling_warnings(both)) == []  # 5.0 %
    kept = tuple(one for one in swinging.signals if one.block == "b" or one.variable != "energy_stored")
    (warning,) = coupling_warnings(replace(both, signals=kept))
    assert (warning.kind, str(warning)) == (
        "coarse-step",
        "blocks see each other's values held over 1 ms: residual of the energy balance: found 4 J, 40.0 %"
        " of the largest energy, allowed: 5 %; --step 0.0001 makes it smaller",
    )


def test_a_block_that_is_fed_from_itself_acts_on_itself_and_one_way_nothing_does(
    swinging: Simulation,
) -> None:
    signals = (swinging.signals[0],)
    itself = replace(coupled(swinging, a_x="a.force"), signals=signals)
    (warning,) = coupling_warnings(itself)
    assert there(warning.found) == "8 J, 100 % of the largest energy"
    assert warning.hints[0].value == 5e-5
    assert list(coupling_warnings(replace(coupled(swinging, b_x="a.force"), signals=signals))) == []
