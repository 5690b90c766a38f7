"""The master runs foreign FMUs without a delay, at the times that are meant, with the values of all types."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foreign_fmus import COUNTER, INTEGRATOR, Foreign, Scalar, follow, gain, planned, ran
from urmpipe_fmus.cosim import LogColumn, Port, simulate

RAMP = Foreign(
    name="ramp",  # y_i = i t
    scalars=tuple(Scalar(f"y[{i}]", i, unit="m") for i in range(1, 4)),
    compute="for (int i = 1; i < 4; i++) v->r[i] = i * v->time;",
)
TERMS = tuple(Scalar(f"u[{i}]", i, "input", unit="m") for i in range(1, 4))
SUM = Foreign(
    name="sum",
    scalars=(*TERMS, Scalar("y", 9, on=("u[1]", "u[2]", "u[3]"), unit="m")),
    compute="v->r[9] = v->r[1] + 10 * v->r[2] + 100 * v->r[3];",
)


@pytest.mark.slow
def test_a_row_of_blocks_with_feedthrough_has_no_delay_and_runs_again_with_the_same_bits() -> None:
    names = [f"b{i}" for i in range(12)]
    blocks = {name: gain("metres", unit="m") for name in reversed(names)} | {"ramp": RAMP}
    connections = {f"{b}.u": f"{a}.y" for a, b in pairwise(names)} | {"b0.u": "ramp.y[2]"}
    plan = planned(blocks, connections, {name: {"c": 1.0} for name in names})
    recorded, t = simulate(plan), 0.1 * np.arange(11)
    assert recorded.failed is None
    assert recorded.t_ns.tolist() == [round(k * 1e8) for k in range(11)]
    for passed in (1, 12):
        assert recorded.column(names[passed - 1], "y").tolist() == (2.0 * t + 1.0 * passed).tolist()
    assert np.array_equal(simulate(plan).values, recorded.values)


def test_a_ring_with_an_integrator_is_eulers_method() -> None:
    ring, start = {"decay.u": "x.y", "x.u": "decay.y"}, {"decay": {"k": -2.0}, "x": {"x": 3.0}}
    recorded = ran({"decay": gain(), "x": INTEGRATOR}, ring, start, step=0.01)
    x = recorded.column("x", "y")
    assert np.allclose(x, 3.0 * 0.98 ** np.arange(101), rtol=1e-13, atol=0.0)  # rounding
    assert np.array_equal(recorded.column("decay", "y"), -2.0 * x)


@pytest.mark.slow
@settings(max_examples=5, deadline=None)  # each starts a process
@given(st.floats(1e-6, 10.0), st.integers(1, 300))
def test_time_is_k_steps_and_an_fmus_own_time_meets_it(step: float, count: int) -> None:
    """The foreign FMUs refuse a step from a time that is not, to the last bit, where they stand."""
    recorded = ran({"ramp": RAMP}, step=step, duration=step * count)
    assert recorded.failed is None
    assert recorded.column("ramp", "y[1]").tolist() == [k * step for k in range(len(recorded.t_ns))]
    assert len(recorded.t_ns) == count + 1


def test_an_fmu_of_one_step_size_is_always_given_the_same() -> None:
    """t_k+1 - t_k differs from step to step in its last bits; such an FMU refuses any step but its first."""
    code = "if (!v->r[0]) v->r[0] = h; if (h != v->r[0]) return fmi2Error; v->r[1] += 1;"
    fixed = Foreign("fixed", (Scalar("y", 1),), step=code, variable_step=False)
    assert len({(k + 1) * 0.1 - k * 0.1 for k in range(10)}) > 1
    recorded = ran({"a": fixed})
    assert recorded.failed is None
    assert recorded.column("a", "y").tolist() == list(range(11))


@pytest.mark.slow
@pytest.mark.parametrize("every", [3, 10, 11])
def test_every_so_many_points_are_recorded(every: int) -> None:
    recorded = ran({"ramp": RAMP}, record_every=every)
    assert recorded.t_ns.tolist() == [k * 10**8 for k in range(0, 11, every)]
    assert recorded.column("ramp", "y[3]").tolist() == [3 * (k * 0.1) for k in range(0, 11, every)]


@pytest.mark.slow
def test_arrays_and_elements_are_connected_one_by_one() -> None:
    orders = {"rising": (1, 2, 3), "turned": (3, 1, 2), "twice": (2, 2, 1)}
    connections = {
        f"{name}.u[{i}]": f"ramp.y[{k}]" for name, order in orders.items() for i, k in enumerate(order, 1)
    }
    blocks = {**dict.fromkeys(orders, SUM), "whole": SUM, "ramp": RAMP}
    recorded = ran(blocks, connections | {"whole.u": "ramp.y"})
    for name, order in orders.items():
        factor = order[0] + 10 * order[1] + 100 * order[2]
        found = recorded.column(name, "y")
        assert np.allclose(found, factor * 0.1 * np.arange(11), rtol=1e-15)  # three roundings
    assert np.array_equal(recorded.column("whole", "y"), recorded.column("rising", "y"))
    sums = (Port(name, "y") for name in (*orders, "whole"))
    assert recorded.names == (*sums, *(Port("ramp", f"y[{i}]") for i in (1, 2, 3)))
    assert recorded.units == ("m",) * 7


def test_inputs_follow_logs_held_or_interpolated() -> None:
    columns = {
        "u": LogColumn(np.array([100, 250, 800]) * 10**6, np.array([1.0, 4.0, -7.0]), "m"),
        "n": LogColumn(np.array([0, 300]) * 10**6, np.array([2.0, 5.0])),
        "on": LogColumn(np.array([0, 500]) * 10**6, np.array([1.0, 0.0])),
    }
    metres, t = gain("metres", unit="m"), 0.1 * np.arange(11)
    inputs = [follow("held.u"), follow("linear.u", interpolate=True)]
    inputs += [follow("n.by", "n"), follow("n.on", "on")]
    blocks = {"held": metres, "linear": metres, "n": COUNTER}
    recorded = ran(blocks, None, None, inputs, column=lambda log_input: columns[log_input.column])
    assert recorded.column("held", "y").tolist() == [1, 1, 1, 4, 4, 4, 4, 4, -7, -7, -7]
    assert recorded.column("held", "u").tolist() == recorded.column("held", "y").tolist()
    expected = np.interp(t, columns["u"].t_ns * 1e-9, columns["u"].values)
    assert np.allclose(recorded.column("linear", "y"), expected, rtol=0.0, atol=1e-14)  # rounding of t and y
    assert recorded.column("n", "n").tolist() == [0, 2, 4, 6, 11, 16, 16, 16, 16, 16, 16]
    assert recorded.column("n", "by").tolist() == [2, 2, 2, 5, 5, 5, 5, 5, 5, 5, 5]


def test_one_fmu_under_two_names_is_two_instances() -> None:
    recorded = ran({"a": INTEGRATOR, "b": INTEGRATOR}, None, {"a": {"u": 1.0}, "b": {"u": -2.0, "x": 5.0}})
    assert recorded.column("a", "y")[-1] == pytest.approx(1.0, rel=1e-15)  # ten additions
    assert recorded.column("b", "y")[-1] == pytest.approx(3.0, rel=1e-15)


def test_progress_rises_to_what_is_done() -> None:
    slow = Foreign(name="slow", scalars=(Scalar("y", 0),), step="usleep(20000);")
    shares: list[float] = []
    simulate(planned({"slow": slow}, step=0.05), progress=shares.append)
    assert shares == sorted(shares)
    assert all(0.0 <= share <= 1.0 for share in shares)
    assert len(set(shares)) > 3
