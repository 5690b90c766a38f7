"""Block models: what variables allow, what functions read, and tables over time."""

from __future__ import annotations

import copy
import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from small_models import block, variable
from urmpipe_fmus.block import INTERNAL_STEP, Input, Parameter, State, Table, Values, read_table, table_bytes


def test_values_are_copied_pickled_and_asked_as_any_object_is() -> None:
    values = Values(0.5, {"x": 1.0, "phi": (2.0, 3.0)})
    for again in (copy.copy(values), copy.deepcopy(values), pickle.loads(pickle.dumps(values))):
        assert (again.time, again.x, again.phi, again.table) == (0.5, 1.0, (2.0, 3.0), None)
    assert not hasattr(values, "y")
    assert getattr(values, "y", 7.0) == 7.0


def test_an_array_has_a_scalar_an_element_counted_from_one() -> None:
    phi = variable(Input, "phi", size=3, start=(1.0, 2.0, 3.0))
    assert (phi.width, phi.names, phi.starts) == (3, ("phi[1]", "phi[2]", "phi[3]"), (1.0, 2.0, 3.0))
    u = variable(Input, "u", start=2)
    assert (u.width, u.names, u.starts) == (1, ("u",), (2.0,))


def test_a_unit_with_states_has_the_integrators_step_as_a_fixed_parameter() -> None:
    variables = variable(State, "x"), variable(Parameter, "k")
    model = block(*variables, derivatives=lambda v: {"x": v.k}, internal_step=2e-3)
    assert [name for name, _ in model.scalars] == ["x", "k", INTERNAL_STEP]
    step = model.parameters[-1]
    assert (step.start, step.unit, step.minimum, step.variability) == (2e-3, "s", 1e-9, "fixed")
    assert [one.name for one in model.arguments] == ["k", INTERNAL_STEP, "x"]


def counting(step_ns: int, rows: int, first_ns: int = 0) -> Table:
    """Row k, at first + k steps, holds k."""
    t_ns = first_ns + step_ns * np.arange(rows, dtype=np.int64)
    return Table(t_ns, np.arange(rows, dtype=np.float64)[:, np.newaxis])


@pytest.mark.parametrize(
    "step_ns", [5_000_000, 1_000_000, 3_333_333, 7, 1, 16_666_667, 8_000_003, 100_000_000]
)
def test_a_time_k_h_meets_row_k_and_no_neighbour(step_ns: int) -> None:
    table, h = counting(step_ns, 20_000), step_ns / 1e9
    k = np.arange(20_000)
    rows = table.rows_at(k * h)
    assert np.array_equal(rows.before[0], k)
    assert not rows.fraction.any()
    stepped = (k[:-1] * h) + h  # the instant that a step of h from (k - 1) h leads to
    assert np.array_equal(table.rows_at(stepped).before[0], k[1:])


@given(
    st.lists(st.integers(0, 10**13), min_size=1, max_size=30, unique=True), st.integers(-(10**12), 2 * 10**13)
)
def test_the_rows_are_those_that_a_search_by_hand_finds(times: list[int], instant: int) -> None:
    times = sorted(times)
    table = Table(np.array(times), np.arange(len(times), dtype=np.float64)[:, np.newaxis])
    rows = table.rows_at(instant / 1e9)
    before = max((k for k, t in enumerate(times) if t <= instant), default=0)
    after = min(before + 1, len(times) - 1)
    inside = times[0] <= instant < times[-1]
    fraction = (instant - times[before]) / (times[after] - times[before]) if inside else 0.0
    assert (rows.before[0], rows.after[0], rows.fraction) == (before, after, fraction)


def test_halves_of_a_nanosecond_go_away_from_zero_and_an_ulp_below_them_does_not() -> None:
    table = counting(1, 10)
    below = math.nextafter(0.5, 0.0) * 1e-9
    instants = (0.5e-9, below, 1.5e-9, 2.5e-9)
    assert [float(table.rows_at(t).before[0]) for t in instants] == [1.0, 0.0, 2.0, 3.0]


def test_where_half_a_nanosecond_is_an_ulp_the_time_is_not_rounded_again() -> None:
    odd = 2**52 + 1  # ns: adding 0.5 to it gives the even neighbour
    table = Table(np.array([odd - 1, odd, odd + 1]), np.array([[0.0], [1.0], [2.0]]))
    [seconds] = [t for t in (odd / 1e9, math.nextafter(odd / 1e9, 0.0)) if t * 1e9 == odd][:1]
    assert float(table.rows_at(seconds).before[0]) == 1.0


def test_a_column_of_times_gives_what_each_of_them_gives() -> None:
    table = Table(np.array([0, 3, 10, 11]), np.array([[1.0], [4.0], [2.0], [8.0]]))
    t = np.linspace(-2e-9, 13e-9, 61)
    rows = table.rows_at(t)
    singles = [table.rows_at(float(one)) for one in t]
    assert np.array_equal(rows.before[0], [one.before[0] for one in singles])
    assert np.array_equal(rows.after[0], [one.after[0] for one in singles])
    assert np.array_equal(rows.fraction, [one.fraction for one in singles])


def test_a_table_keeps_its_own_rows() -> None:
    t_ns, values = np.array([0, 1]), np.array([[1.0], [2.0]])
    table = Table(t_ns, values)
    values[:] = 9.0
    t_ns[:] = 7
    assert (table.t_ns.tolist(), table.values.tolist()) == ([0, 1], [[1.0], [2.0]])
    with pytest.raises(ValueError, match="read-only"):
        table.values[0] = 3.0


def test_times_may_go_from_the_first_to_the_last_of_64_bits() -> None:
    ends = [-(2**63), 2**63 - 1]
    assert Table(np.array(ends), np.zeros((2, 1))).t_ns.tolist() == ends


times = st.lists(st.integers(-(2**63), 2**63 - 1), min_size=1, max_size=9, unique=True).map(sorted)
values = st.floats(allow_nan=False, allow_infinity=False)


@given(times=times, columns=st.integers(1, 4), data=st.data())
def test_a_table_reads_back_bit_by_bit(
    times: list[int], columns: int, data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    row = st.lists(values, min_size=columns, max_size=columns)
    rows = data.draw(st.lists(row, min_size=len(times), max_size=len(times)))
    path = tmp_path_factory.mktemp("table") / "table.bin"
    path.write_bytes(table_bytes(Table(np.array(times), np.array(rows))))
    found = read_table(path)
    assert found.t_ns.tolist() == times
    assert found.values.tobytes() == np.array(rows).tobytes()
