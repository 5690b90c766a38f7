"""Arms whatever describes them, and arms that have a closed form except for small deviations."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from itertools import chain as chain_of
from pathlib import Path

import numpy as np
import pytest

from asserting import refusal, there
from closed_forms import arm_with_wrist, as_built, assert_solved, distances, moved, random_joints, solve_poses
from ik_arms import limited
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.arm.denavit_hartenberg import DHRow, dh_chain, modified_dh_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik import closed
from urmpipe_models.ik.closed import LOST_BRANCH_REASON, MET, NearClosedForm, closed_form
from urmpipe_models.ik.parallel_axes import parallel_axes
from urmpipe_models.ik.solutions import Solutions, Targets, forward_targets, pose_errors
from urmpipe_models.ik.solve import solve
from urmpipe_models.ik.spherical import spherical_wrist
from urmpipe_models.ik.trigonometric import wrap_angle
from urmpipe_models.kinematics.forward import chain_to_screws, jacobian_over_log, screws_to_chain
from urmpipe_models.math3d import from_offset, translation
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.toml import read_robot_file, robot_toml
from urmpipe_models.robots.urdf import read_urdf
from urmpipe_models.robots.urdf_writer import urdf_text

RIGHT = math.pi / 2
D, A = (0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996), (0.0, -0.425, -0.3922, 0.0, 0.0, 0.0)
ALPHA = (RIGHT, 0.0, 0.0, RIGHT, -RIGHT, 0.0)
UR5E = [DHRow(d=d, a=a, alpha=alpha) for d, a, alpha in zip(D, A, ALPHA, strict=True)]  # standard DH
# of modified parameters a and alpha stand a row later, the last in none
ROWS = zip(UR5E, (DHRow(), *UR5E[:-1]), strict=True)
MODIFIED = [replace(row, a=before.a, alpha=before.alpha) for row, before in ROWS]


def described(how: str, chain: Chain, folder: Path) -> Chain:
    """Return an arm by another description of it."""
    if how == "URDF":
        (folder / "arm.urdf").write_text(urdf_text(chain), encoding="utf-8")
        return read_urdf(folder / "arm.urdf")
    if how == "TOML joints":
        (folder / "arm.toml").write_text(robot_toml(chain), encoding="utf-8")
        return read_robot_file(folder / "arm.toml")
    if how == "a fixed frame":
        back = replace(chain.joints[3], origin=translation(0.0, 0.0, -0.01) @ chain.joints[3].origin)
        sensor = Joint("sensor", "fixed", translation(0.0, 0.0, 0.01))
        return replace(chain, joints=(*chain.joints[:3], sensor, back, *chain.joints[4:]), visuals=())
    if how in ("standard", "modified"):
        return dh_chain("ur5e", UR5E) if how == "standard" else modified_dh_chain("ur5e", MODIFIED)
    base, tool = from_offset((0.3, -1.0, 2.0, 0.4, -0.8, 2.9)), from_offset((0.1, 0.2, -0.1, 1.0, 0.3, 0.7))
    renamed = tuple(replace(joint, name=f"axis {k}") for k, joint in enumerate(chain.joints))
    return replace(chain, name="other", joints=renamed, visuals=()).placed(base, tool)


HOW = ("URDF", "TOML joints", "names, base and tool")
DESCRIBED = [(name, how, 1e-7) for name in ("ur5e", "arm6", "articulated6r") for how in HOW]
DESCRIBED += [("ur5e", how, 1e-9) for how in ("standard", "modified", "a fixed frame")]


@pytest.mark.parametrize(("name", "how", "within"), DESCRIBED)
def test_branches_whatever_describes_an_arm(name: str, how: str, within: float, tmp_path: Path) -> None:
    chain = load_robot(name)
    other = described(how, chain, tmp_path)
    form, same = there(closed_form(chain)), there(closed_form(other))
    assert (same.name, same.branches) == (form.name, form.branches)
    q = random_joints(np.random.default_rng(2), chain, 50)
    # tolerance: rounding of the written numbers, and of poses far from the base
    found, expected = (f.solve(forward_targets(arm, q)).q for f, arm in ((same, other), (form, chain)))
    np.testing.assert_allclose(found, expected, atol=within)


@pytest.mark.parametrize("size", ["ur3", "ur5", "ur10"])
def test_urdfs_that_others_wrote_are_recognised(shared: Path, size: str) -> None:
    path = shared / "robots" / "Gepetto_example-robot-data" / f"{size}_robot.urdf"
    chain = load_robot(path, tip_link="tool0")
    assert there(closed_form(chain)).name == "three parallel axes"
    solve_poses(chain, random_joints(np.random.default_rng(2), chain, 200), given=1e-8)


def rounded(chain: Chain, folder: Path, digits: int) -> Chain:
    """Return an arm as its URDF has it with some decimals of the angles and lengths to the micrometre."""
    text = urdf_text(replace(chain, visuals=()))
    for attribute, decimals in (("rpy", digits), ("xyz", 6)):
        pattern = rf'(<origin [^>]*{attribute}=")([^"]*)'
        for before, numbers in set(re.findall(pattern, text)):
            fewer = " ".join(f"{float(number):.{decimals}f}" for number in numbers.split())
            text = text.replace(f'{before}{numbers}"', f'{before}{fewer}"')
    (folder / "rounded.urdf").write_text(text, encoding="utf-8")
    return read_urdf(folder / "rounded.urdf")


def near_form(chain: Chain) -> NearClosedForm:
    form = closed_form(chain)
    assert isinstance(form, NearClosedForm)
    return form


def regular_joints(chain: Chain, count: int) -> FloatArray:
    """Return random joint values away from singular poses, where no branch may be lost."""
    q = random_joints(np.random.default_rng(1), chain, count)
    return q[np.linalg.svd(jacobian_over_log(chain, q), compute_uv=False)[:, -1] > 1e-2]  # m and rad


def assert_all_found(chain: Chain, q: FloatArray) -> Solutions:
    """Assert the laws of a closed form, and that it has each solution once."""
    # rounding of poses of some metres
    solutions = solve_poses(chain, q, within=MET + 1e-15, given=1e-6, form=closed_form(chain))
    for k in range(1, solutions.q.shape[1]):
        assert np.nanmin(np.abs(wrap_angle(solutions.q[:, :k] - solutions.q[:, [k]])).max(axis=2)) > 1e-6
    return solutions


@pytest.mark.parametrize(("name", "digits"), [("arm6", 4), ("arm6", 6), ("ur5e", 4), ("ur5e", 6)])
def test_a_rounded_urdf_has_all_solutions_of_the_exact_arm(tmp_path: Path, name: str, digits: int) -> None:
    exact = load_robot(name)
    chain = rounded(exact, tmp_path, digits)
    before, form = there(closed_form(exact)), there(closed_form(chain))
    assert form.name in {before.name, f"{before.name}, nearly"}
    assert form.name == "spherical wrist, nearly" or (name, digits) != ("arm6", 4)
    assert form.branches == before.branches
    q = regular_joints(chain, 1000)
    solutions = assert_all_found(chain, q)
    count = before.solve(forward_targets(exact, q)).reached.sum(axis=1)
    # a branch on the edge of the reach of one arm may be beyond that of the other
    assert (solutions.reached.sum(axis=1) == count).mean() >= 0.997


@pytest.mark.parametrize("name", ["arm6", "articulated6r", "ur5e"])
def test_an_arm_as_built_has_every_branch_away_from_singular_poses(name: str) -> None:
    chain = as_built(load_robot(name), 1e-3)
    assert near_form(chain).name == f"{there(closed_form(load_robot(name))).name}, nearly"
    assert_all_found(chain, regular_joints(chain, 400))


@pytest.mark.slow
def test_random_arms_with_sliding_joints_are_solved_near_their_forms() -> None:
    rng = np.random.default_rng(5)
    for kinds in ("RRR", "PRR", "RRP", "RPR"):
        chain = as_built(arm_with_wrist(rng, kinds=kinds), 1e-5)
        q = regular_joints(chain, 100)
        solutions = solve_poses(chain, q, given=math.inf, form=near_form(chain))
        assert (distances(chain, solutions, q).min(axis=1) < 1e-5).mean() >= 0.99


def test_a_solution_stays_near_that_of_the_idealised_arm_whatever_the_limits(tmp_path: Path) -> None:
    chain = rounded(load_robot("arm6"), tmp_path, 4)
    form, targets = near_form(chain), forward_targets(chain, regular_joints(chain, 200))
    solutions, ideal = form.solve(targets), form.form.solve(targets)
    distance = np.abs(wrap_angle(solutions.q - ideal.q))[solutions.reached & ideal.reached]
    # 2e-5 m and rad over the least singular value, 0.01; the other branches may be nearer to singular
    assert np.quantile(distance.max(axis=1), 0.95) < 2e-3
    narrow = near_form(limited(chain, -0.1, 0.1))
    np.testing.assert_array_equal(narrow.solve(targets).q, solutions.q)


def test_a_target_out_of_reach_or_not_finite_has_a_reason_and_stops_no_other() -> None:
    chain = as_built(load_robot("arm6"), 1e-4)
    good, form = forward_targets(chain, regular_joints(chain, 3)), near_form(chain)
    targets = replace(good, position=good.position.copy())
    targets.position[1], targets.position[2] = (9.0, 0.0, 0.0), np.nan
    solutions = form.solve(targets)
    for found in (solutions, form.solve(targets, np.zeros(6))):
        assert found.reached.any(axis=1).tolist() == [True, False, False]
    expected = r"the wrist centre is \d\.\d{3} m from axis 2, allowed: \d\.\d{3} to \d\.\d{3} m"
    assert re.fullmatch(expected, solutions.reasons[1, 0])
    assert solutions.reason(2) == "the target is not finite, allowed: finite numbers"
    np.testing.assert_array_equal(solutions.q[0], form.solve(good).q[0])
    for near in (None, np.zeros(6)):
        assert form.solve(Targets(np.empty((0, 3)), np.empty((0, 3, 3))), near).q.shape == (0, 8, 6)
    for exact in (form, form.form):
        message = refusal(ValueError, exact.solve, Targets(np.zeros((1, 3))))
        assert message == "targets without orientation; allowed: poses"


def test_near_an_aligned_wrist_a_lost_branch_has_a_reason_and_others_are_solved(tmp_path: Path) -> None:
    chain = as_built(load_robot("arm6"), 1e-3)
    q = random_joints(np.random.default_rng(2), chain, 200)
    q[:, 4] = np.random.default_rng(3).uniform(-2e-3, 2e-3, 200)  # about as far as the axes are off
    solutions = solve_poses(chain, q, given=math.inf, form=near_form(chain))
    assert (solutions.reasons == LOST_BRANCH_REASON).any()
    chain = rounded(load_robot("arm6"), tmp_path, 6)
    q = np.array([[0.3, 0.4, -0.5, 0.7, 0.0, 0.2]])  # aligned to the rounding of the file
    assert solve_poses(chain, q, given=math.inf, form=near_form(chain)).reached.sum() >= 6
    assert math.isfinite(near_form(chain).deviation[0])


def idealised(chain: Chain) -> Chain:
    """Return the arm whose closed form an arm has nearly."""
    screws, names = there(chain_to_screws(chain)), chain.coordinates
    wrists = (ideal for ideal in closed.iter_spherical_wrists(screws) if spherical_wrist(ideal, names))
    planes = (ideal for ideal in closed.iter_parallel_axes(screws) if parallel_axes(ideal, names))
    return screws_to_chain(next(chain_of(wrists, planes)), names)


@pytest.mark.parametrize("name", ["arm6", "ur5e"])
def test_the_deviation_is_about_the_largest_of_many_poses_and_its_form_is_documented(name: str) -> None:
    chain = as_built(load_robot(name), 1e-4)
    q = random_joints(np.random.default_rng(7), chain, 1000)
    errors = pose_errors(chain, q, forward_targets(idealised(chain), q))
    for deviation, error in zip(near_form(chain).deviation, errors, strict=True):
        assert np.linalg.norm(error, axis=1).max() == pytest.approx(deviation, rel=0.3)
    text = (Path(__file__).parents[3] / "docs" / "ik.md").read_text(encoding="utf-8")
    assert f"`{near_form(chain).name}`" in text


def test_singular_poses_are_those_of_the_solutions_that_are_left() -> None:
    """The idealised arm's wrist is aligned in all poses but the first; the arm's own axis 5 passes by it."""
    chain = moved(load_robot("articulated6r"), 4, 0.0, 1e-4)
    q = np.random.default_rng(5).uniform(-3.0, 3.0, (6, 6))
    q[1:, 4], q[3, 2] = 0.0, 0.0  # and the arm stretched in one of them
    form, targets = near_form(chain), forward_targets(idealised(chain), q)
    solutions = form.solve(targets)
    (before,), (after,) = form.form.solve(targets).singular, solutions.singular
    assert before.family == after.family == "wrist aligned"
    np.testing.assert_array_equal(after.where, before.where & solutions.reached)
    assert before.where.any(axis=1).tolist() == [False] + [True] * 5
    assert after.where.sum() < before.where.sum()


def test_frames_far_along_their_axes_change_nothing() -> None:
    screws = there(chain_to_screws(as_built(load_robot("ur5e"), 1e-4)))
    far = replace(screws, point=screws.point + screws.direction * np.array([[3, -50, 20, 70, 9, 1]]).T)
    compact, other = closed.compact_axis_points(screws), closed.compact_axis_points(far)
    np.testing.assert_allclose(compact.point, other.point, atol=1e-9)  # feet on lines 1e-4 from parallel
    assert compact.size == pytest.approx(other.size, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["arm6", "ur5e"])
def test_near_a_singular_pose_an_arm_stays_where_it_is_wished(name: str) -> None:
    chain = as_built(load_robot(name), 3e-4)
    q = np.random.default_rng(1).uniform(-1.5, 1.5, (100, 6))
    q[:, 4] = 1e-3  # the wrist all but aligned
    form = near_form(chain)
    solve_poses(chain, q, q, given=1e-4, form=form)
    unasked = form.solve(forward_targets(chain, q))
    assert distances(chain, unasked, q).min(axis=1).max() > 0.1


def test_where_no_branch_is_left_a_target_is_searched_for_unless_only_a_closed_form_is_allowed() -> None:
    chain = as_built(load_robot("ur5e"), 2e-3, seed=1)
    q = random_joints(np.random.default_rng(2), chain, 20_000)[[0, 14555]]
    targets = forward_targets(chain, q)
    found, only = solve(chain, targets), solve(chain, targets, method="closed")
    assert_solved(chain, targets, found)
    assert found.reached[:, 0].all()
    assert only.reached[:, 0].tolist() == [True, False]  # else the second is no example any more
    assert found.labels[:, 0].tolist() == [only.labels[0, 0], "found by search"]
    assert np.array_equal(found.q[0], only.q[0])
