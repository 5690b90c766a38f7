"""Algebraic loops are solved as their equations require, or reported."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from foreign_fmus import INTEGRATOR, Foreign, Scalar, follow, gain, ran
from urmpipe_fmus.cosim import CosimulationRecord, LogColumn

RING = {"b.u": "a.y", "a.u": "b.y"}
TOLERANCE = 1e-12
FOLLOW_C = [follow("b.c", "c", interpolate=True)]
RISING = LogColumn(np.array([0, 10**9]), np.array([0.0, 1.0]))


def solved(*arguments: object, **options: object) -> CosimulationRecord:
    record = ran(*arguments, iterate=True, tolerance=TOLERANCE, **options)
    assert record.failed is None
    return record


def formula(name: str, inputs: str, y: str, **options: Any) -> Foreign:
    """Return an FMU whose output y follows from its inputs, one letter each."""
    values = ", ".join(f"{u} = v->r[{i}]" for i, u in enumerate(inputs))
    ports = [Scalar(u, i, "input") for i, u in enumerate(inputs)]
    scalars = (*ports, Scalar("y", len(inputs), on=tuple(inputs)))
    return Foreign(name, scalars, f"double {values}; v->r[{len(inputs)}] = {y};", **options)


def block(name: str, compute: str, *, u: str = "0", bounds: str = "", **options: Any) -> Foreign:
    """Return an FMU with an input u, an output y that depends on it, and an output x; C computes them."""
    scalars = (Scalar("u", 0, "input", start=u, extra=bounds), Scalar("y", 1, on=("u",)), Scalar("x", 2))
    return Foreign(name, scalars, compute, **{"start": f"m->v.r[0] = {u};", **options})


@pytest.mark.slow
def test_linear_rings_are_solved_even_where_plain_iteration_runs_away() -> None:
    """a = k1 b + 1, b = k2 a + 2: a = (2 k1 + 1) / (1 - k1 k2).

    Blocks that are not fresh, whose outputs follow only after a step, go back and step again: the ring holds
    from the first step on.
    """
    gains = ((0.5, 0.5), (-3.0, 4.0), (10.0, 10.0), (1.0, 0.0), (-1.0, 1.0))
    rings = [*((k1, k2, True, True) for k1, k2 in gains), (-3.0, 4.0, True, False), (-3.0, 4.0, False, False)]
    blocks: dict[str, Foreign] = {}
    starts: dict[str, dict[str, float]] = {}
    connections: dict[str, str] = {}
    for n, (k1, k2, *fresh) in enumerate(rings):
        a, b = f"a{n}", f"b{n}"
        blocks |= {a: gain(fresh=fresh[0]), b: gain(fresh=fresh[1])}
        starts |= {a: {"k": k1, "c": 1.0}, b: {"k": k2, "c": 2.0}}
        connections |= {f"{b}.u": f"{a}.y", f"{a}.u": f"{b}.y"}
    recorded = solved(blocks, connections, starts)
    for n, (k1, k2, *fresh) in enumerate(rings):
        y = (2.0 * k1 + 1.0) / (1.0 - k1 * k2)
        expected = (y, k2 * y + 2.0)
        condition = max(1.0, 1.0 / abs(1.0 - k1 * k2)) * (1.0 + abs(k1)) * (1.0 + abs(k2))
        # the residual, as the loop magnifies it
        allowed = 2.0 * TOLERANCE * condition * (1.0 + abs(expected[0]) + abs(expected[1]))
        first = 0 if all(fresh) else 1
        for name, value in zip("ab", expected, strict=True):
            assert np.allclose(recorded.column(f"{name}{n}", "y")[first:], value, rtol=0.0, atol=allowed)


def test_a_nonlinear_ring_is_solved_and_going_back_undoes_what_a_block_counted() -> None:
    """x = cos x: Dottie's number; a stale block counts each step once, however often it steps again."""
    counting = block("counting", "v->r[1] = cos(v->r[0]);", step="v->r[2] += 1;", fresh=False)
    blocks = {"fresh": gain("cosine", formula="cos(u)"), "stale": counting}
    recorded = solved(blocks, {f"{name}.u": f"{name}.y" for name in blocks})
    dottie = 0.7390851332151607
    assert np.allclose(recorded.column("fresh", "y"), dottie, rtol=0.0, atol=2.0 * TOLERANCE)
    assert np.allclose(recorded.column("stale", "y")[1:], dottie, rtol=0.0, atol=2.0 * TOLERANCE)
    assert recorded.column("stale", "x").tolist() == list(range(11))


@pytest.mark.slow
def test_the_solution_is_followed_over_time() -> None:
    """y = k u + c(t) with u = y^3 by two blocks: y^3 - 2 y + c = 0, from its root at y = 0."""
    c = LogColumn(np.arange(11) * 10**8, np.linspace(0.0, 0.8, 11))
    blocks = {"a": formula("cube", "u", "u * u * u"), "b": formula("line", "uc", "0.5 * (u + c)")}
    y = solved(blocks, RING, None, FOLLOW_C, column=lambda _: c).column("b", "y")
    assert np.allclose(y**3 - 2.0 * y + c.values, 0.0, atol=1e-11)  # the tolerance, magnified by at most ten
    assert (np.diff(y) > 0.0).all()
    assert (y < np.sqrt(2.0 / 3.0)).all()


@pytest.mark.slow
def test_a_ring_of_many_inputs_is_solved() -> None:
    """x = A x + b, with three of each."""
    names = range(3)
    row = "v->r[10 + {i}] = {a} * v->r[0] + {b} * v->r[1] + {c} * v->r[2] + {i} + 1;"
    matrix = np.array([[0.3, -2.0, 0.5], [1.5, 0.2, -0.7], [-0.4, 3.0, 0.1]])
    inputs = tuple(Scalar(f"u[{i}]", i, "input") for i in names)
    outputs = (Scalar(f"y[{i}]", 10 + i, on=("u[0]", "u[1]", "u[2]")) for i in names)
    rows = (row.format(i=i, a=a, b=b, c=c) for i, (a, b, c) in enumerate(matrix))
    map3 = Foreign("map3", (*inputs, *outputs), " ".join(rows))
    recorded = solved({"a": map3}, {"a.u": "a.y"})
    expected = np.linalg.solve(np.eye(3) - matrix, [1.0, 2.0, 3.0])
    assert np.allclose(recorded.values, expected, rtol=1e-10, atol=0.0)  # the tolerance, by the condition


@pytest.mark.slow
def test_a_loop_of_small_values_is_solved_to_their_nominal_size() -> None:
    """y = 0.99 u + 1e-12 = 1e-10: what the first guess, 0, leaves is within the tolerance of a value of 1."""
    small = formula("small", "u", "0.99 * u + 1e-12")
    u, y = small.scalars
    stated = {
        "u": replace(small, scalars=(replace(u, extra=' nominal="1e-10"'), y)),
        "y": replace(small, scalars=(u, replace(y, extra=' nominal="1e-10"'))),
    }
    found = solved(stated, {"u.u": "u.y", "y.u": "y.y"}).values
    assert np.allclose(found, 1e-10, rtol=2e2 * TOLERANCE, atol=0.0)  # twice the residual, magnified by 100


@pytest.mark.slow
def test_a_ring_with_a_state_is_the_implicit_equation_at_every_instant() -> None:
    """y = x - 3 y, x' = y by Euler's method: y = x / 4."""
    blocks = {"s": formula("sum_of", "xu", "x - 3 * u"), "i": INTEGRATOR}
    recorded = solved(blocks, {"s.u": "s.y", "s.x": "i.y", "i.u": "s.y"}, {"i": {"x": 1.0}})
    x = recorded.column("i", "y")
    assert np.allclose(recorded.column("s", "y"), x / 4.0, rtol=0.0, atol=1e-11)  # tolerance times Jacobian
    assert np.allclose(x, (1.0 + 0.1 / 4.0) ** np.arange(11), rtol=1e-10)


@pytest.mark.slow
def test_a_block_whose_outputs_follow_at_once_only_before_the_first_step_is_seen_through() -> None:
    """y = 1 - 3 u, in a ring with u = 4 y + c(t): y = (1 - 3 c) / 13."""
    step = "v->i[0] = 1; v->r[1] = 1 - 3 * v->r[0];"
    early = formula("early", "u", "v->i[0] ? v->r[1] : 1 - 3 * u", step=step)
    blocks = {"a": early, "b": formula("line4", "uc", "4 * u + c")}
    recorded = solved(blocks, RING, None, FOLLOW_C, column=lambda _: RISING)
    c = recorded.column("b", "c")
    assert np.allclose(recorded.column("a", "y"), (1.0 - 3.0 * c) / 13.0, rtol=0.0, atol=1e-10)


@pytest.mark.slow
def test_a_block_that_goes_back_gets_again_what_was_set_before_the_loop() -> None:
    """y = 1 - 3 u + w after a step, in a ring with u = 4 y: y = (1 + w) / 13; z = w is read before it."""
    late = formula("late", "uw", "1 - 3 * u + w; v->r[3] = w", fresh=False)
    late = replace(late, scalars=(*late.scalars[:2], Scalar("z", 3, on=("w",)), late.scalars[2]))
    inputs = [follow("a.w", "c", interpolate=True)]
    recorded = solved({"a": late, "b": gain()}, RING, {"b": {"k": 4.0}}, inputs, column=lambda _: RISING)
    expected = (1.0 + recorded.column("a", "w")) / 13.0
    assert np.allclose(recorded.column("a", "y")[1:], expected[1:], rtol=0.0, atol=1e-10)


@pytest.mark.slow
def test_looking_whether_outputs_follow_leaves_no_trace_where_they_do_not() -> None:
    """y = max(u, 0) with u = y / 2 + c(t) below 0: what the block integrates is u, held over each step."""
    limited = block("limited", "v->r[1] = v->r[0] > 0 ? v->r[0] : 0;", step="v->r[2] += h * v->r[0];")
    blocks = {"a": limited, "b": formula("plus", "uc", "0.5 * u + c")}
    falling = LogColumn(RISING.t_ns, np.array([-1.0, -3.0]))
    recorded = solved(blocks, RING, None, FOLLOW_C, column=lambda _: falling)
    integral = np.concatenate([[0.0], np.cumsum(0.1 * recorded.column("b", "c")[:-1])])
    assert np.allclose(recorded.column("a", "x"), integral, rtol=0.0, atol=1e-12)  # rounding


@pytest.mark.slow
def test_inputs_stay_in_their_range_and_at_its_end_are_not_moved_out_of_it() -> None:
    """u = 1: of y = 1 / sqrt(u) with u > 0.01, from a start at 4; of y = u / 2 + 1 / 2 with u in 0..1."""
    root = block("root", "v->r[1] = v->r[0] < 0.01 ? 1e9 : 1 / sqrt(v->r[0]);", u="4", bounds=' min="0.01"')
    count = "if (v->r[0] > 1 || v->r[0] < 0) v->r[2] += 1;"
    full = block("full", f"{count} v->r[1] = 0.5 * v->r[0] + 0.5;", u="1", bounds=' min="0" max="1"')
    blocks = {"root": root, "full": full, "late": replace(full, name="late_full", fresh=False)}
    recorded = solved(blocks, {f"{name}.u": f"{name}.y" for name in blocks})
    assert np.allclose(recorded.column("root", "y"), 1.0, rtol=0.0, atol=2.0 * TOLERANCE)
    for name in ("full", "late"):
        assert np.allclose(recorded.column(name, "y")[1:], 1.0, rtol=0.0, atol=4.0 * TOLERANCE)
        assert not recorded.column(name, "x").any()


@pytest.mark.slow
def test_a_step_to_where_a_block_gives_no_number_is_shortened_and_no_other_block_sees_it() -> None:
    """y = 2 + 10 log u from u = 9, where Newton steps below 0; the other block counts what is no number."""
    count = "if (!isfinite(v->r[0])) v->r[2] += 1;"
    picky = block("picky", f"{count} v->r[1] = v->r[0];", u="9", start="m->v.r[0] = 10;")
    log = gain("log10", formula="2 + 10 * log(u)")
    recorded = solved({"p": picky, "log": log}, {"log.u": "p.y", "p.u": "log.y"}, {"log": {"u": 9.0}})
    u = recorded.column("p", "y")
    assert np.allclose(u, 2.0 + 10.0 * np.log(u), rtol=0.0, atol=1e-10)  # the tolerance, by the slope
    assert not recorded.column("p", "x").any()
