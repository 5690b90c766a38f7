"""A log played back as its file has it goes wrong at the jumps, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from asserting import there
from urmpipe_datasets import LOGS
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import jacobian_over_log, positions_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.repolarization.audit import AuditEntry
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.playback import MAX_JUMPS, PARTS, Playback, replay_raw
from urmpipe_pipeline.runs.run import Run

LENGTHS = (0.243215, *(0.212430,) * 5, 0.042215)  # Table 1 of the paper, in m


@pytest.fixture(scope="module")
def run() -> Run:
    """The demo's log, in which thirteen jumps are to be undone."""
    return ingest_log([LOGS / "coppeliasim.csv"], robot=load_robot("urm6"))


@pytest.fixture(scope="module")
def played(run: Run) -> Playback:
    return there(replay_raw(run))


def p7(phi: FloatArray) -> FloatArray:
    """The paper's eq. 7 with matrices: the tool centre point of six joint angles, in m."""

    def rz(a: float) -> FloatArray:
        return np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])

    c, s = np.cos(np.radians(52.0)), np.sin(np.radians(52.0))
    ry = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    rotation = rz(phi[0])
    point = rotation @ np.array([0.0, 0.0, LENGTHS[0]])
    for k in range(1, 7):
        rotation = rotation @ ry @ (rz(phi[k]) if k < 6 else np.eye(3))
        point = point + rotation @ np.array([0.0, 0.0, LENGTHS[k]])
    return np.asarray(point)


def test_at_rows_outside_the_jumps_the_tool_is_where_the_run_has_it(run: Run, played: Playback) -> None:
    at_rows = ~played.jumping
    rows = np.searchsorted(run.log.t, played.t[at_rows])
    np.testing.assert_array_equal(run.log.t[rows], played.t[at_rows])
    np.testing.assert_array_equal(played.q[at_rows], run.log.q[rows])
    assert run.tcp is not None
    # Whole turns move nothing; sin and cos of an angle some turns off are rounded at 1e-15 rad a turn.
    np.testing.assert_allclose(played.position[at_rows], run.tcp.position[rows], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(played.velocity[at_rows], run.tcp.velocity[rows])
    np.testing.assert_array_equal(played.acceleration[at_rows], run.tcp.acceleration[rows])
    assert not played.deviation[at_rows].any()


def test_of_a_resampled_run_the_rows_of_the_file_are_played_back(run: Run) -> None:
    coarse = ingest_log([LOGS / "coppeliasim.csv"], robot=run.robot, tsp=0.02)
    result = there(replay_raw(coarse))
    assert result.jumps == 13
    rows = np.searchsorted(run.log.t, result.t[~result.jumping])
    np.testing.assert_array_equal(result.q[~result.jumping], run.log.q[rows])
    places = there(run.tcp).position[rows]
    np.testing.assert_allclose(result.position[~result.jumping], places, rtol=0, atol=1e-12)  # as above
    # Linear over 20 ms instead of 5: the true path lies up to q'' dt^2 / 8 = 1e-4 rad beside the chord.
    assert result.deviation[there(result.worst)] == pytest.approx(1.16687706595, abs=2e-4)


def test_half_way_down_each_jump_stands_the_mean_of_its_two_rows(run: Run, played: Playback) -> None:
    assert played.jumps == len(run.repolarizations) == 13
    for entry in run.repolarizations:
        (at,) = np.flatnonzero(np.abs(played.t - entry.t) < 1e-9)  # parts are 0.16 ms apart
        mean = (run.log.q[entry.sample - 1] + run.log.q[entry.sample]) / 2.0
        np.testing.assert_allclose(played.q[at], mean, rtol=0, atol=1e-14)  # of values up to pi
        j = run.log.joints.index(entry.joint)
        assert abs(played.q[at, j]) < 0.01  # near 0, half a turn from where the joint is
        between = np.abs(played.t - entry.t) < entry.time_uncertainty + 1e-9
        assert played.jumping[between].all()
        assert np.count_nonzero(between) == PARTS + 1
        np.testing.assert_allclose(np.diff(played.q[between, j]), entry.step / PARTS, rtol=1e-12)


def test_the_tool_is_as_far_off_as_an_own_computation_finds(run: Run, played: Playback) -> None:
    furthest = 0.0
    for entry in run.repolarizations:
        row = entry.sample
        for part in range(PARTS + 1):
            raw = run.log.q[row - 1] + (run.log.q[row] - run.log.q[row - 1]) * part / PARTS
            right = run.q[row - 1] + (run.q[row] - run.q[row - 1]) * part / PARTS
            off = float(np.linalg.norm(p7(raw) - p7(right)))
            (at,) = np.flatnonzero(
                np.abs(played.t - (entry.t + entry.time_uncertainty * (2 * part / PARTS - 1))) < 1e-9
            )
            # Sums of seven segments of 0.2 m: 1e-15 m each.
            assert played.deviation[at] == pytest.approx(off, abs=1e-12)
            furthest = max(furthest, off)
    assert played.worst is not None
    assert played.deviation[played.worst] == pytest.approx(furthest, abs=1e-12)
    # phi2 lifts the whole arm but its foot: at t_r of row 909 it points the other way.
    assert played.t[played.worst] == pytest.approx(4.5375, abs=1e-12)
    assert furthest == pytest.approx(1.16687706595, abs=1e-10)


def test_speed_across_a_jump_is_the_jacobian_of_a_turn_a_period(run: Run, played: Playback) -> None:
    assert run.robot is not None
    entry = run.repolarizations[4]
    (at,) = np.flatnonzero(np.abs(played.t - entry.t) < 1e-9)
    rates = (run.log.q[entry.sample] - run.log.q[entry.sample - 1]) / run.tsp
    jacobian = jacobian_over_log(run.robot, played.q[[at]])[0, :3]
    np.testing.assert_allclose(played.velocity[at], jacobian @ rates, rtol=1e-9)
    # Half way down the joint turns evenly: what accelerates the tool is its turning alone.
    h = 1e-7
    q = played.q[at] + rates * h * np.array([[-1.0], [0.0], [1.0]])
    before, here, after = positions_over_log(run.robot, q)
    np.testing.assert_allclose(played.acceleration[at], (after - 2 * here + before) / h**2, rtol=1e-3)
    speed = np.linalg.norm(played.velocity, axis=1)
    assert speed[played.jumping].max() > 100 * speed[~played.jumping].max()


def test_a_log_without_a_jump_or_without_a_robot_is_not_played_back(run: Run) -> None:
    assert replay_raw(replace(run, audit=())) is None
    assert replay_raw(replace(run, robot=None, tcp=None)) is None


def test_a_missing_sample_at_a_jump_leaves_the_rest(run: Run) -> None:
    q = run.log.q.copy()
    row = run.repolarizations[4].sample
    q[row - 2, :] = np.nan
    holed = replace(run, log=replace(run.log, q=q))
    before = q.copy()
    result = there(replay_raw(holed))
    np.testing.assert_array_equal(holed.log.q, before)
    assert np.isfinite(result.deviation).all()
    assert result.deviation[there(result.worst)] == pytest.approx(1.16687706595, abs=1e-10)


def test_neighbouring_jumps_share_their_row_and_of_many_the_first_are_played(run: Run) -> None:
    q = run.log.q.copy()
    q[:, 0] = np.where(np.arange(len(q)) % 2, -3.14, 3.14)
    audit = tuple(
        AuditEntry(run.log.joints[0], row + 1, (row - 0.5) * run.tsp, run.tsp / 2, -6.28, 0, 1)
        for row in range(1, MAX_JUMPS + 500)
    )
    result = there(replay_raw(replace(run, log=replace(run.log, q=q), audit=audit)))
    assert result.jumps == MAX_JUMPS
    assert np.count_nonzero(result.jumping) == MAX_JUMPS * PARTS + 1
    assert (np.diff(result.t) > 0).all()
