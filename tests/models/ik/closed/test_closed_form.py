from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from asserting import there
from urmpipe_models.arm.chain import Chain, Joint, Mimic
from urmpipe_models.arm.geometric_models import DHRow, dh_chain, modified_dh_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.closed import ClosedForm, closed_form, exact_closed_form
from urmpipe_models.ik.solutions import forward_targets
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import Transform, from_offset
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


def nearest_misses(solutions: FloatArray, q: FloatArray) -> FloatArray:
    """Return how far the nearest solution is from q, the largest of the joints, by the shorter way."""
    away = np.remainder(solutions - q[:, None] + math.pi, 2 * math.pi) - math.pi
    return np.asarray(np.nanmin(np.abs(away).max(axis=2), axis=1))


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
    assert name_of(chain) == "three parallel axes"
    assert nearest_misses(solutions_of(chain, q), q).max() < 1e-8


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


def test_a_bent_wrist_has_none() -> None:
    bent = moved(load_robot("arm6"), 6, (0.0, 0.03, 0.02))
    assert name_of(bent) is None


def test_a_wrist_that_is_no_wrist_of_a_ur_arm_still_has_a_form() -> None:
    # axes 5 and 6 that pass each other leave three parallel axes
    passing = moved(load_robot("ur5e"), 5, (0.03, 0.0, 0.0))
    form = closed_form(passing)
    assert form is not None and form.branches[0] == "shoulder 1, elbow up"
    q = np.random.default_rng(2).uniform(-math.pi, math.pi, (50, 6))
    assert nearest_misses(solutions_of(passing, q), q).max() < 1e-7


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
