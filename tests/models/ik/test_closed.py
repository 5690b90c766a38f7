"""Which arm has a closed form, and arms that have one except for small deviations."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from asserting import there
from ik_arms import limited
from parallel_arms import apart
from spherical_arms import KINDS, assert_reached, away_from, random_arm, random_joints
from urmpipe_models.arm.chain import Chain, Joint, Mimic
from urmpipe_models.arm.denavit_hartenberg import DHRow, dh_chain, modified_dh_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.closed import (
    LOST_BRANCH_REASON,
    MET,
    ClosedForm,
    NearClosedForm,
    closed_form,
    compact_axis_points,
    exact_closed_form,
    iter_parallel_axes,
    iter_spherical_wrists,
)
from urmpipe_models.ik.parallel_axes import parallel_axes
from urmpipe_models.ik.solutions import Solutions, Targets, forward_targets, pose_errors
from urmpipe_models.ik.solve import solve
from urmpipe_models.ik.spherical import spherical_wrist
from urmpipe_models.ik.trigonometric import wrap_angle
from urmpipe_models.kinematics.forward import (
    chain_to_screws,
    jacobian_over_log,
    poses_over_log,
    screws_to_chain,
)
from urmpipe_models.math3d import Transform, from_offset, translation
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_models.robots.toml import read_robot_file, robot_toml
from urmpipe_models.robots.urdf import read_urdf
from urmpipe_models.robots.urdf_writer import urdf_text

FORMS = {
    **dict.fromkeys(("ur3", "ur3e", "ur5", "ur5e", "ur10", "ur10e"), "three parallel axes"),
    **dict.fromkeys(("arm6", "articulated6r"), "spherical wrist"),
    **dict.fromkeys(("urm4", "urm6", "urm8", "panda", "iiwa14", "irb60", "irb60-spring"), None),
}

RIGHT = math.pi / 2

UR5E = (  # standard DH: theta, d, a, alpha
    DHRow(name="a", d=0.1625, alpha=RIGHT),
    DHRow(name="b", a=-0.425),
    DHRow(name="c", a=-0.3922),
    DHRow(name="d", d=0.1333, alpha=RIGHT),
    DHRow(name="e", d=0.0997, alpha=-RIGHT),
    DHRow(name="f", d=0.0996),
)


def modified(rows: tuple[DHRow, ...]) -> Chain:
    """Return the same arm by modified parameters: a, alpha stand a row later, the last in none."""
    before = (DHRow(name="base"), *rows[:-1])
    shifted = [replace(row, a=one.a, alpha=one.alpha) for row, one in zip(rows, before, strict=True)]
    return modified_dh_chain("ur5e", shifted)


def name_of(chain: Chain) -> str | None:
    form = closed_form(chain)
    return None if form is None else form.name


def solutions_of(chain: Chain, q: FloatArray) -> FloatArray:
    form = there(closed_form(chain))
    return form.solve(forward_targets(chain, q)).q


def test_every_robot_of_the_catalogue_has_the_form_of_its_geometry() -> None:
    assert {name: name_of(load_robot(name)) for name in robot_names()} == FORMS


def described(how: str, chain: Chain, folder: Path) -> Chain:
    """Return an arm as it reads back from a description of it."""
    if how == "URDF":
        path = folder / "arm.urdf"
        path.write_text(urdf_text(chain), encoding="utf-8")
        return read_urdf(path)
    if how == "TOML joints":
        path = folder / "arm.toml"
        path.write_text(robot_toml(chain), encoding="utf-8")
        return read_robot_file(path)
    renamed = (replace(joint, name=f"axis {k}") for k, joint in enumerate(chain.joints))
    arm = replace(chain, name="other", joints=tuple(renamed), visuals=())
    return arm.placed(
        from_offset((0.3, -1.0, 2.0, 0.4, -0.8, 2.9)), from_offset((0.1, 0.2, -0.1, 1.0, 0.3, 0.7))
    )


@pytest.mark.parametrize("name", ["ur5e", "arm6", "articulated6r"])
@pytest.mark.parametrize("how", ["URDF", "TOML joints", "names, base and tool"])
def test_an_arm_is_recognised_whatever_describes_it(name: str, how: str, tmp_path: Path) -> None:
    chain = load_robot(name)
    other = described(how, chain, tmp_path)
    assert name_of(other) == FORMS[name]
    q = np.random.default_rng(2).uniform(-math.pi, math.pi, (50, 6))
    # the same branches in the same order, up to the rounding of what is written and of poses far from home
    np.testing.assert_allclose(solutions_of(other, q), solutions_of(chain, q), atol=1e-7)


def test_standard_and_modified_parameters_are_one_arm() -> None:
    chain, other = dh_chain("ur5e", UR5E), modified(UR5E)
    q = np.random.default_rng(2).uniform(-math.pi, math.pi, (50, 6))
    np.testing.assert_allclose(poses_over_log(other, q)[0], poses_over_log(chain, q)[0], atol=1e-15)
    assert name_of(chain) == name_of(other) == "three parallel axes"
    np.testing.assert_allclose(solutions_of(other, q), solutions_of(chain, q), atol=1e-9)
    np.testing.assert_allclose(solutions_of(load_robot("ur5e"), q), solutions_of(chain, q), atol=1e-9)


@pytest.mark.parametrize("size", ["ur3", "ur5", "ur10"])
def test_urdfs_that_others_wrote_are_recognised(shared: Path, size: str) -> None:
    path = shared / "robots" / "Gepetto_example-robot-data" / f"{size}_robot.urdf"
    chain = load_robot(path, tip_link="tool0")
    q = np.random.default_rng(2).uniform(-math.pi, math.pi, (200, 6))
    form = closed_form(chain)
    assert name_of(chain) == "three parallel axes"
    assert apart(there(form).solve(forward_targets(chain, q)), q).max() < 1e-8


def moved(chain: Chain, joint: int, offset: tuple[float, ...]) -> Chain:
    """Return an arm with the frame of a joint moved in itself: x, y, z in [m] and rx, ry, rz in [rad]."""
    joints = list(chain.joints)
    joints[joint] = replace(joints[joint], origin=joints[joint].origin @ from_offset(offset))
    return replace(chain, joints=tuple(joints), visuals=())


TEN_UM = 1e-5


@pytest.mark.parametrize(
    ("name", "joint", "offset"),
    [
        ("arm6", 6, (TEN_UM, 0.0, 0.0)),  # axis 5 passes the others by 10 um
        ("arm6", 7, (TEN_UM, 0.0, 0.0)),
        ("ur5e", 3, (0.0, 0.0, 0.0, TEN_UM)),  # axis 4 tilted by 10 um in a metre, as calibration finds
        ("ur5e", 2, (0.0, 0.0, 0.0, 0.0, TEN_UM)),
    ],
)
def test_an_arm_that_is_off_by_ten_micrometres_has_its_form_nearly(
    name: str, joint: int, offset: tuple[float, ...]
) -> None:
    off = moved(load_robot(name), joint, offset)
    assert exact_closed_form(off) is None
    assert name_of(off) == f"{FORMS[name]}, nearly"


def test_a_wrist_that_is_no_wrist_of_a_ur_arm_still_has_a_form() -> None:
    # axes 5 and 6 that pass each other leave three parallel axes
    passing = moved(load_robot("ur5e"), 5, (0.03, 0.0, 0.0))
    form = closed_form(passing)
    assert form is not None and form.branches[0] == "shoulder 1, elbow up"
    q = np.random.default_rng(2).uniform(-math.pi, math.pi, (50, 6))
    assert apart(form.solve(forward_targets(passing, q)), q).max() < 1e-7


def test_arms_with_more_or_fewer_joints_followers_or_sliding_joints_in_the_plane_have_none() -> None:
    chain = load_robot("ur5e")
    assert name_of(replace(chain, joints=chain.joints[:5], start=(), visuals=())) is None
    longer = (*chain.joints, Joint("seventh", origin=from_offset((0.1, 0.0, 0.0))))
    assert name_of(replace(chain, joints=longer, start=(), visuals=())) is None
    mimic = replace(chain.joints[3], mimic=Mimic("elbow_joint"))
    following = (*chain.joints[:3], mimic, *chain.joints[4:])
    assert name_of(replace(chain, joints=following, start=(), visuals=())) is None
    sliding = replace(chain.joints[2], kind="prismatic")
    assert name_of(replace(chain, joints=(*chain.joints[:2], sliding, *chain.joints[3:]), visuals=())) is None


def test_a_fixed_frame_between_joints_changes_nothing() -> None:
    chain = load_robot("ur5e")
    sensor = Joint("sensor", "fixed", Transform(translation=(0.0, 0.0, 0.01)))
    later = moved(chain, 3, (0.0, 0.0, 0.0)).joints[3]
    back = replace(later, origin=Transform(translation=(0.0, 0.0, -0.01)) @ later.origin)
    other = replace(chain, joints=(*chain.joints[:3], sensor, back, *chain.joints[4:]), visuals=())
    assert name_of(other) == "three parallel axes"
    q = np.random.default_rng(2).uniform(-math.pi, math.pi, (20, 6))
    np.testing.assert_allclose(solutions_of(other, q), solutions_of(chain, q), atol=1e-9)


def test_one_arm_has_its_form_made_once() -> None:
    assert closed_form(load_robot("ur5e")) is closed_form(load_robot("ur5e"))


def test_forms_say_what_they_are() -> None:
    for name in ("ur5e", "arm6"):
        form: ClosedForm | None = closed_form(load_robot(name))
        assert sorted(there(form).branches) == sorted(
            f"{side}, {elbow}, {flip}"
            for side in ("right", "left")
            for elbow in ("elbow up", "elbow down")
            for flip in ("flipped", "not flipped")
        )


SINGULAR = 1e-2  # least singular value of the Jacobian (m and rad) from which on no branch may be lost


def rounded(chain: Chain, folder: Path, digits: int) -> Chain:
    """Return an arm as its URDF has it with some decimals of the angles and lengths to the micrometre."""
    file = folder / f"rounded{digits}.urdf"
    text = urdf_text(replace(chain, visuals=()))
    for attribute, decimals in (("rpy", digits), ("xyz", 6)):
        pattern = rf'(<origin [^>]*{attribute}=")([^"]*)'
        for before, numbers in set(re.findall(pattern, text)):
            fewer = " ".join(f"{float(one):.{decimals}f}" for one in numbers.split())
            text = text.replace(f'{before}{numbers}"', f'{before}{fewer}"')
    file.write_text(text, encoding="utf-8")
    return read_urdf(file)


def as_built(chain: Chain, deviation: float, seed: int = 3) -> Chain:
    """Return an arm each of whose joints is off in its frame by some m and rad, drawn from a Gaussian."""
    off = np.random.default_rng(seed).normal(0.0, deviation, (len(chain.joints), 6))
    joints = [
        replace(joint, origin=joint.origin @ from_offset(one.tolist()))
        for joint, one in zip(chain.joints, off, strict=True)
    ]
    return replace(chain, joints=tuple(joints), visuals=())


def nearly(chain: Chain) -> NearClosedForm:
    form = closed_form(chain)
    assert isinstance(form, NearClosedForm)
    return form


def regular_joints(chain: Chain, count: int) -> FloatArray:
    """Return random joint values away from singular poses."""
    q = random_joints(np.random.default_rng(1), chain, count)
    least = np.linalg.svd(jacobian_over_log(chain, q), compute_uv=False)[:, -1]
    return q[least > SINGULAR]


def assert_all_found(chain: Chain, q: FloatArray, solutions: Solutions) -> None:
    """Hold solutions to their poses: each once, the joint values that the poses were made of among them."""
    targets = forward_targets(chain, q)
    assert_reached(chain, targets, solutions, MET + 1e-15)  # rounding of poses of some metres
    assert away_from(chain, solutions, q).min(axis=1).max() < 1e-6
    for k in range(1, solutions.q.shape[1]):
        assert np.nanmin(np.abs(wrap_angle(solutions.q[:, :k] - solutions.q[:, [k]])).max(axis=2)) > 1e-6
    assert ((solutions.reasons == "") == solutions.reached).all()


@pytest.mark.parametrize("name", ["arm6", "ur5e"])
@pytest.mark.parametrize("digits", [4, 6])
def test_a_urdf_with_rounded_numbers_has_all_solutions_of_the_exact_arm(
    tmp_path: Path, name: str, digits: int
) -> None:
    exact = load_robot(name)
    chain = rounded(exact, tmp_path, digits)
    before, form = closed_form(exact), closed_form(chain)
    assert before is not None and form is not None
    assert form.name in {before.name, f"{before.name}, nearly"}
    if (name, digits) == ("arm6", 4):
        assert form.name == "spherical wrist, nearly" and exact_closed_form(chain) is None
    assert form.branches == before.branches
    q = regular_joints(chain, 1000)
    solutions = form.solve(forward_targets(chain, q))
    assert_all_found(chain, q, solutions)
    count = before.solve(forward_targets(exact, q)).reached.sum(axis=1)
    # a branch on the edge of the reach of one arm may be beyond that of the other
    assert (solutions.reached.sum(axis=1) == count).mean() >= 0.997


@pytest.mark.parametrize("name", ["arm6", "articulated6r", "ur5e"])
def test_an_arm_as_built_has_every_branch_away_from_singular_poses(name: str) -> None:
    exact = load_robot(name)
    chain = as_built(exact, 1e-3)
    form = nearly(chain)
    assert form.name == f"{closed_form(exact).name}, nearly"  # type: ignore[union-attr]
    q = regular_joints(chain, 400)
    assert_all_found(chain, q, form.solve(forward_targets(chain, q)))


@pytest.mark.slow
def test_random_arms_with_sliding_joints_are_solved_beside_their_forms() -> None:
    generator = np.random.default_rng(5)
    for kinds in ("RRR", "PRR", "RRP", "RPR"):
        assert set(kinds) <= set(KINDS)
        chain = as_built(random_arm(generator, kinds=kinds), 1e-5)
        q = regular_joints(chain, 100)
        solutions = nearly(chain).solve(forward_targets(chain, q))
        assert_reached(chain, forward_targets(chain, q), solutions)
        assert (away_from(chain, solutions, q).min(axis=1) < 1e-5).mean() >= 0.99


def test_a_solution_stays_beside_that_of_the_idealised_arm(tmp_path: Path) -> None:
    chain = rounded(load_robot("arm6"), tmp_path, 4)
    form = nearly(chain)
    targets = forward_targets(chain, regular_joints(chain, 200))
    mine, ideal = form.solve(targets), form.form.solve(targets)
    distance = np.abs(wrap_angle(mine.q - ideal.q))[mine.reached & ideal.reached]
    # 2e-5 m and rad over the least singular value, 0.01; the other branches may be nearer to singular
    assert np.quantile(distance.max(axis=1), 0.95) < 2e-3


def test_limits_are_not_asked() -> None:
    chain = as_built(load_robot("ur5e"), 1e-4)
    narrow = limited(chain, -0.1, 0.1)
    targets = forward_targets(chain, regular_joints(chain, 20))
    np.testing.assert_array_equal(nearly(narrow).solve(targets).q, nearly(chain).solve(targets).q)


def test_a_target_out_of_reach_or_not_finite_has_a_reason_and_stops_no_other() -> None:
    chain = as_built(load_robot("arm6"), 1e-4)
    good = forward_targets(chain, regular_joints(chain, 3))
    assert good.rotation is not None
    position = good.position.copy()
    position[1], position[2] = (9.0, 0.0, 0.0), np.nan
    solutions = nearly(chain).solve(Targets(position, good.rotation))
    assert solutions.reached.any(axis=1).tolist() == [True, False, False]
    assert re.fullmatch(
        r"the wrist centre is \d\.\d{3} m from axis 2, allowed: \d\.\d{3} to \d\.\d{3} m",
        solutions.reasons[1, 0],
    )
    assert solutions.reason(2) == "the target is not finite, allowed: finite numbers"
    stays = nearly(chain).solve(Targets(position, good.rotation), np.zeros(6))
    assert stays.reached.any(axis=1).tolist() == [True, False, False]
    alone = nearly(chain).solve(good)
    np.testing.assert_array_equal(solutions.q[0], alone.q[0])


def test_a_branch_that_is_lost_beside_a_singular_pose_says_so() -> None:
    chain = as_built(load_robot("arm6"), 1e-3)
    q = random_joints(np.random.default_rng(2), chain, 200)
    q[:, 4] = np.random.default_rng(3).uniform(-2e-3, 2e-3, 200)  # about as far as the axes are off
    solutions = nearly(chain).solve(forward_targets(chain, q))
    assert_reached(chain, forward_targets(chain, q), solutions)
    assert ((solutions.reasons == "") == solutions.reached).all()
    assert (solutions.reasons == LOST_BRANCH_REASON).any()


def idealised(chain: Chain) -> Chain:
    """Return the arm whose closed form an arm has nearly."""
    found, names = chain_to_screws(chain), chain.coordinates
    assert found is not None
    ideals = (
        *(one for one in iter_spherical_wrists(found) if spherical_wrist(one, names)),
        *(one for one in iter_parallel_axes(found) if parallel_axes(one, names)),
    )
    return screws_to_chain(ideals[0], names)


@pytest.mark.parametrize("name", ["arm6", "ur5e"])
def test_the_deviation_is_about_the_largest_of_many_poses(name: str) -> None:
    chain = as_built(load_robot(name), 1e-4)
    q = random_joints(np.random.default_rng(7), chain, 1000)
    errors = pose_errors(chain, q, forward_targets(idealised(chain), q))
    for found, of_many in zip(nearly(chain).deviation, errors, strict=True):
        assert np.linalg.norm(of_many, axis=1).max() == pytest.approx(found, rel=0.3)


def test_what_is_left_of_singular_poses_is_told_where_a_solution_is_left() -> None:
    """The idealised arm's wrist is aligned in all poses but the first; the arm's own axis 5 passes by it."""
    exact = load_robot("articulated6r")
    shifted = replace(exact.joints[4], origin=exact.joints[4].origin @ translation(0.0, 1e-4, 0.0))
    chain = replace(exact, joints=(*exact.joints[:4], shifted, exact.joints[5]), visuals=())
    q = np.random.default_rng(5).uniform(-3.0, 3.0, (6, 6))
    q[1:, 4], q[3, 2] = 0.0, 0.0  # and the arm stretched in one of them
    form, targets = nearly(chain), forward_targets(idealised(chain), q)
    solutions = form.solve(targets)
    (before,), (after,) = form.form.solve(targets).singular, solutions.singular
    assert before.family == after.family == "wrist aligned"
    np.testing.assert_array_equal(after.where, before.where & solutions.reached)
    assert before.where.any(axis=1).tolist() == [False] + [True] * 5
    assert after.where.sum() < before.where.sum()


@pytest.mark.parametrize("near", [None, np.zeros(6)])
def test_no_targets_have_no_solutions(near: FloatArray | None) -> None:
    chain = as_built(load_robot("arm6"), 1e-4)
    solutions = nearly(chain).solve(Targets(np.empty((0, 3)), np.empty((0, 3, 3))), near)
    assert solutions.q.shape == (0, 8, 6)


def test_positions_with_any_orientation_are_refused() -> None:
    with pytest.raises(ValueError, match="allowed: poses"):
        nearly(as_built(load_robot("arm6"), 1e-4)).solve(Targets(np.zeros((1, 3))))


@pytest.mark.parametrize("name", ["arm6", "ur5e"])
def test_arms_that_are_truly_different_are_not_taken(name: str) -> None:
    chain = as_built(load_robot(name), 0.03)
    assert closed_form(chain) is None
    assert closed_form(moved(load_robot("arm6"), 6, (0.0, 0.03, 0.02))) is None  # a bent wrist


def test_frames_far_along_their_axes_change_nothing() -> None:
    found = there(chain_to_screws(as_built(load_robot("ur5e"), 1e-4)))
    far = replace(found, point=found.point + found.direction * np.array([[3, -50, 20, 70, 9, 1]]).T)
    one, other = compact_axis_points(found), compact_axis_points(far)
    np.testing.assert_allclose(one.point, other.point, atol=1e-9)  # feet on lines 1e-4 from parallel
    assert one.size == pytest.approx(other.size, abs=1e-9)


def test_the_documentation_has_every_word(tmp_path: Path) -> None:
    text = (Path(__file__).parents[3] / "docs" / "ik.md").read_text(encoding="utf-8")
    for name in ("arm6", "ur5e"):
        assert f"`{nearly(as_built(load_robot(name), 1e-4)).name}`" in text


def test_what_stands_at_q0_is_a_pose_as_any_other(tmp_path: Path) -> None:
    chain = rounded(load_robot("arm6"), tmp_path, 6)
    q = np.tile((0.3, 0.4, -0.5, 0.7, 0.0, 0.2), (1, 1))  # the wrist aligned, to the rounding of the file
    solutions = nearly(chain).solve(forward_targets(chain, q))
    assert_reached(chain, forward_targets(chain, q), solutions)
    assert solutions.reached.sum() >= 6
    assert math.isfinite(nearly(chain).deviation[0])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["arm6", "ur5e"])
def test_beside_a_singular_pose_an_arm_stays_where_it_is_wished(name: str) -> None:
    chain = as_built(load_robot(name), 3e-4)
    q = np.random.default_rng(1).uniform(-1.5, 1.5, (100, 6))
    q[:, 4] = 1e-3  # the wrist all but aligned
    targets = forward_targets(chain, q)
    solutions = nearly(chain).solve(targets, q)
    assert_reached(chain, targets, solutions)
    assert away_from(chain, solutions, q).min(axis=1).max() < 1e-4
    assert away_from(chain, nearly(chain).solve(targets), q).min(axis=1).max() > 0.1  # unasked


def test_where_no_branch_is_left_a_target_is_searched_for_unless_only_a_closed_form_is_allowed() -> None:
    chain = as_built(load_robot("ur5e"), 2e-3, seed=1)
    q = np.random.default_rng(2).uniform(-np.pi, np.pi, (20000, 6))[[0, 14555]]
    targets = forward_targets(chain, q)
    found = solve(chain, targets)
    assert_reached(chain, targets, found)
    assert found.reached[:, 0].all()
    only = solve(chain, targets, method="closed")
    assert only.reached[:, 0].tolist() == [True, False]  # else the second is no example any more
    assert found.labels[:, 0].tolist() == [only.labels[0, 0], "found by search"]
    assert np.array_equal(found.q[0], only.q[0])
    assert found.reasons[:, 0].tolist() == ["", ""]
