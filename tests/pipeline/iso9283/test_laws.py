"""Laws that hold for every test after ISO 9283: rigid motion, identical cycles, shifts, clouds, order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from asserting import there
from made_runs import path_run
from repeated import TICK, along, overall, value, values_of
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import to_quaternions
from urmpipe_pipeline.comparison.iso import IsoOptions, measure_iso
from urmpipe_pipeline.iso9283.criteria import UNITS, repeatability
from urmpipe_pipeline.iso9283.result import IsoTest
from urmpipe_pipeline.runs.run import Run

CORNERS = ((0.0, 0.0, 0.3), (0.15, 0.0, 0.3), (0.15, 0.1, 0.3), (0.0, 0.1, 0.325), (0.05, 0.05, 0.3))
WAY_IN = (0.8, -0.6, -0.1)
"""About the direction of the last leg."""

ANGLES = {name for name, unit in UNITS.items() if unit == "rad"}

ROUNDING = 1e-12
"""As the issue has it, in [m] and [rad]: coordinates below 2 m are rounded by 2e-16."""

SPEED_ROUNDING = 1e-10
"""Of speeds in [m/s] and their shares: differences of coordinates over 5 ms, 2 m . 2e-16 / 5 ms = 1e-13,
over v_c = 0.1 m/s, and times of crossings likewise."""

SHIFTS = st.tuples(*[st.floats(-3e-3, 3e-3)] * 3)
SOME = settings(max_examples=4, deadline=None)


def command() -> FloatArray:
    """A motion that rests at both ends and amid, shape (n, 3): three corners, one of them with a rest."""
    return along(CORNERS, 0.1, rest=0.2, rests=[2])


def turned(rows: int) -> FloatArray:
    """Rotations that change slowly, shape (n, 3, 3)."""
    share = np.linspace(0.0, 1.0, rows)
    half = np.column_stack((0.05 * share, 0.1 * share**2, 0.2 * np.sin(share), np.ones(rows)))
    return np.asarray(Rotation.from_quat(half).as_matrix())


def about(axis: Sequence[float], angle: float) -> FloatArray:
    """A rotation about an axis, shape (3, 3)."""
    return np.asarray(Rotation.from_rotvec(angle * np.asarray(axis) / np.linalg.norm(axis)).as_matrix())


def off(k: int, rows: int) -> FloatArray:
    """How far cycle k is from the command, in [m], shape (n, 3): some tenths of a millimetre."""
    rng = np.random.default_rng(k)
    nodes = np.linspace(0, rows - 1, 12)
    size = rng.normal(0.0, 2e-4, (12, 3))
    return np.column_stack([np.interp(np.arange(rows), nodes, column) for column in size.T])


def cycles() -> Iterator[tuple[FloatArray, FloatArray]]:
    """Places and rotations of four cycles, with other deviations and speeds."""
    for k in range(4):
        wanted = along(CORNERS, 0.1 * (1.0 + 0.01 * k), rest=0.2, rests=[2])
        moving = np.linalg.norm(np.gradient(wanted, axis=0), axis=1) > 1e-9
        deviation = off(k, len(wanted))
        last = np.maximum.accumulate(np.where(moving, np.arange(len(wanted)), 0))
        turns = turned(len(wanted))[last] @ about((1.0, 2.0, 3.0), 1e-3 * (k + 1))
        place = wanted + deviation[last]
        end = int(last[-1])  # it settles with a swing
        place[end + 1 : end + 5] += np.outer((3e-4, 2e-4, -1.5e-4, 5e-5), np.array(WAY_IN))
        yield place, turns


def evaluated(reference: FloatArray, *cycles: FloatArray, planes: int = 20) -> IsoTest:
    """The test of positions in [m], shape (n, 3), or with quaternions, shape (n, 7), a row each 5 ms."""

    def run(rows: FloatArray, name: str) -> Run:
        return path_run(rows[:, :3], rows[:, 3:] if rows.shape[1] > 3 else None, name=name, tsp=TICK)

    runs = [run(cycle, f"cycle{k}") for k, cycle in enumerate(cycles)]
    return there(measure_iso(run(reference, "command"), runs, IsoOptions(planes=planes)).iso)


def moved(rotation: FloatArray, shift: Sequence[float]) -> IsoTest:
    """The test of command and cycles, all of them moved."""

    def rows(place: FloatArray, turns: FloatArray) -> FloatArray:
        quat = to_quaternions((rotation @ turns).reshape(-1, 9), "matrix")
        return np.column_stack((place @ rotation.T + np.asarray(shift), quat))

    wanted = command()
    moving = np.linalg.norm(np.gradient(wanted, axis=0), axis=1) > 1e-9
    last = np.maximum.accumulate(np.where(moving, np.arange(len(wanted)), 0))
    return evaluated(rows(wanted, turned(len(wanted))[last]), *(rows(*one) for one in cycles()))


@pytest.fixture(scope="module")
def unmoved() -> IsoTest:
    return moved(np.eye(3), (0.0, 0.0, 0.0))


def same(one: IsoTest, other: IsoTest, names: set[str]) -> None:
    """All values of some criteria agree."""
    first, second = values_of(one), values_of(other)
    assert first.keys() == second.keys()
    for key, wanted in first.items():
        if key[0] in names:
            allowed = SPEED_ROUNDING if UNITS[key[0]] in ("m/s", "1", "s") else ROUNDING
            assert second[key] == (None if wanted is None else pytest.approx(wanted, abs=allowed, rel=0)), key


@pytest.mark.slow
def test_the_set_tells_every_criterion_but_vap(unmoved: IsoTest) -> None:
    values = overall(unmoved)
    assert set(values) == set(UNITS) - {"vAP"}
    assert {name for name, one in values.items() if one is None} == {"dRP"}
    assert min(abs(one) for one in values.values() if one is not None) > 0.0


@pytest.mark.slow
@SOME
@given(SHIFTS, st.tuples(*[st.floats(-1.0, 1.0)] * 2, st.floats(0.1, 1.0)), st.floats(-3.1, 3.1))
def test_rigid_motion_of_both_sides_changes_no_position(
    unmoved: IsoTest, shift: tuple[float, ...], axis: tuple[float, ...], angle: float
) -> None:
    same(unmoved, moved(about(axis, angle), shift), set(UNITS) - ANGLES)


@pytest.mark.slow
@SOME
@given(st.tuples(*[st.floats(-1.0, 1.0)] * 3), st.floats(-3.1, 3.1))
def test_shifts_and_turns_about_the_base_change_no_angle(
    unmoved: IsoTest, shift: tuple[float, ...], angle: float
) -> None:
    same(unmoved, moved(about((0.0, 0.0, 1.0), angle), shift), set(UNITS))


@pytest.mark.slow
def test_identical_cycles_have_no_spread() -> None:
    place, turns = next(cycles())
    rows = np.column_stack((place, to_quaternions(turns.reshape(-1, 9), "matrix")))
    values = overall(evaluated(rows, *[rows] * 5))
    for name in ("RP", "RT", "RD", "RV", *(name for name in ANGLES if name.startswith("R"))):
        # The mean of five equal doubles is rounded once: 1e-16 of lengths and angles below 1.
        assert values[name] == pytest.approx(0.0, abs=1e-15), name
    for name in ("AP", "AT", "AD", "AV", *(name for name in ANGLES if name.startswith("A"))):
        assert values[name] == pytest.approx(0.0, abs=1e-13), name
    assert values["dAP"] == 0.0


@pytest.mark.slow
@SOME
@given(SHIFTS)
def test_a_constant_shift_is_the_accuracy(shift: tuple[float, ...]) -> None:
    s, wanted = np.array(shift), command()
    iso = evaluated(wanted, *[wanted + s] * 3)
    corners = np.array(CORNERS)
    ways = np.diff(corners, axis=0) / np.linalg.norm(np.diff(corners, axis=0), axis=1)[:, np.newaxis]
    across = [float(np.linalg.norm(s - (s @ way) * way)) for way in ways]
    assert value(iso, "AP") == pytest.approx(float(np.linalg.norm(s)), abs=ROUNDING)
    assert value(iso, "AT") == pytest.approx(max(across), abs=ROUNDING)
    for name in ("RP", "RT", "AD", "RD", "OV", "dAP"):
        assert value(iso, name) == pytest.approx(0.0, abs=ROUNDING), name
    assert value(iso, "AV") == pytest.approx(0.0, abs=SPEED_ROUNDING)


@pytest.mark.slow
def test_a_shift_across_both_legs_of_a_corner_is_no_overshoot() -> None:
    # The mean path runs above the line of the second leg, on neither side of it: rounding must not decide.
    found = []
    corners = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.3, 0.2, 0.0]])
    for k in range(6):
        turn = about((1.0, 2.0, 3.0), 0.5 * k)
        wanted = along(corners @ turn.T, 0.1, rest=0.2)
        found.append(value(evaluated(wanted, *[wanted + turn @ [0.0, 0.0, 1e-3]] * 2, planes=5), "CO"))
    np.testing.assert_allclose(found, found[0], atol=ROUNDING)


SIGMA = 1e-4
FACTOR = 1.5958 + 3.0 * 0.6734  # mean and standard deviation of chi with 3 degrees of freedom: 3.616


@pytest.mark.parametrize("seed", range(3))
def test_a_gaussian_cloud_has_the_repeatability_of_chi(seed: int) -> None:
    cloud = np.random.default_rng(seed).normal(0.0, SIGMA, (100_000, 1, 3))
    spread = repeatability(cloud)
    assert spread is not None
    # 1 % as the issue has it; chance makes 0.673 . sqrt((1 + 9 . 0.56)/1e5)/3.616 = 0.15 % of it.
    assert spread[0] == pytest.approx(FACTOR * SIGMA, rel=0.01)


@pytest.mark.slow
@SOME
@given(st.permutations(range(4)))
def test_the_order_of_cycles_does_not_matter(order: list[int]) -> None:
    places = [place for place, _ in cycles()]
    first, second = evaluated(command(), *places), evaluated(command(), *(places[k] for k in order))
    same(first, second, set(UNITS) - {"dAP", "dRP"})


def test_the_attained_point_is_the_mean_of_the_second_half_of_a_rest() -> None:
    # It rests for 0.4 s, rows 0 to 80: creeps at 0.5 mm/s for 0.15 s, then stays, then goes on by 1 um a row,
    # 0.2 mm/s, in rows 60 to 69, and stays 10 um further on.
    wanted = along(((0.0, 0.0, 0.3), (0.2, 0.0, 0.3)), 0.1, rest=0.4)
    done = wanted.copy()
    ending = done[-81:, 0]
    ending[:30] -= 0.5e-3 * 0.005 * np.arange(30, 0, -1)
    ending[60:70] += 1e-6 * np.arange(1, 11)
    ending[70:] += 1e-5
    iso = evaluated(wanted, done, done, planes=50)
    # rows 40 to 80: (1 + 2 + ... + 10 + 11 . 10)/41 = 165/41 um
    assert value(iso, "AP", "pose 2") == pytest.approx(165e-6 / 41.0, abs=ROUNDING)
