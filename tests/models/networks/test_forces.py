"""Static forces of networks in motion: energy, equilibrium of bodies, a plane by hand, legs of a platform."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from asserting import there
from known_mechanisms import tables_of
from random_networks import matrix
from urmpipe import load_network, network_drive
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.networks.forces import Wrench
from urmpipe_models.networks.rates import point_motion
from urmpipe_pipeline.networks.network_motion import MotionForces, NetworkMotion

DRIVES: dict[str, dict[str, Any]] = {
    "four-bar": {"crank": (0.3, 5)},
    "slider-crank": {"crank": (0.3, 5)},
    "rssr": {"crank": (0.3, 5)},
    "rccc": {"crank": (0.3, 5)},
    "bennett": {"turn": (0.5, 5)},
    "bricard": {"turn": (0.5, 3)},
    "screw-jack": {"turn": (0, 5)},
    "geared-five-bar": {"turn": (0, 300)},  # deg: its control is no SI unit
    "stewart-gough-driven": {f"leg{k}": (0.8, 0.8 + 0.03 * (-1) ** k * k / 6) for k in range(1, 7)},
}

COMPONENTS = [f"{what} {axis}" for what in ("force", "moment") for axis in ("m", "n", "m x n")]
PINS = {"theta2": ("ground", 0.0), "A": ("input", 0.4), "B": ("coupler", 0.9), "theta4": ("ground", 1.0)}


def loaded(name: str) -> tuple[NetworkMotion, MotionForces, Wrench, dict[str, float]]:
    """Return a motion and forces under a wrench on the last body and torques at the last two joints."""
    network = load_network(name)
    load = Wrench(network.body_names[-1], (0.1, 0.2, 0.3), (5.0, -7.0, 3.0), (1.0, 2.0, -1.5))
    torques = {one.name: 2.0 + k for k, one in enumerate(network.joints[-2:]) if len(one.units) == 1}
    moved = network_drive(network, DRIVES[name], steps=20, wrenches=[load], torques=torques)
    return moved, there(moved.forces), load, torques


def velocity(moved: NetworkMotion, body: str, point: Any) -> FloatArray:
    return point_motion(moved.mechanism, moved.x.T, moved.xd.T, moved.xdd.T, body, point)[1]


@pytest.mark.slow
@pytest.mark.parametrize("name", DRIVES)
def test_drives_and_loads_do_no_work_together(name: str) -> None:
    """tau d' + F . v + M . w + torques q' = 0, where w = sum of c x c' / 2 over the axes c of the body."""
    moved, forces, load, torques = loaded(name)
    rates = dict(zip(moved.joints, moved.joint_motion[1].T, strict=True))
    factors = [1.0 if one.unit == "m" or name != "geared-five-bar" else np.pi / 180 for one in moved.drives]
    places = [moved.mechanism.variable_index[one.name, 0] for one in moved.drives]
    powers = list(forces.drives.T * moved.xd[:, places].T * np.array(factors)[:, np.newaxis])
    powers.append(velocity(moved, load.body, load.point) @ load.force)
    axes = moved.poses()[:, moved.network.body_names.index(load.body), :3, :3]
    origin = velocity(moved, load.body, (0.0, 0.0, 0.0))
    turning = [velocity(moved, load.body, tuple(one)) - origin for one in np.eye(3)]
    spin = sum(np.cross(axes[:, :, k], one) for k, one in enumerate(turning)) / 2
    powers.append(spin @ np.array(load.moment))
    powers += [torque * rates[joint] for joint, torque in torques.items()]
    size = np.abs(powers).sum(axis=0)
    assert (size > 1e-3).all()
    # Newton leaves gaps of 1e-13, which the Jacobian magnifies by about 10
    assert np.abs(np.sum(powers, axis=0) / size).max() < 1e-10


@pytest.mark.parametrize("name", [pytest.param("rccc", marks=pytest.mark.slow), "rssr"])
def test_every_body_is_in_equilibrium(name: str) -> None:
    """Reactions are on second bodies, at the frames of joints, and opposite on first ones."""
    moved, forces, load, _ = loaded(name)
    assert np.isfinite(forces.reactions).all()
    names, poses = moved.network.body_names, moved.poses()
    sums = {body: np.zeros((len(moved), 6)) for body in names}
    for joint in moved.network.joints:
        columns = [forces.names.index(f"{joint.name} {one}") for one in COMPONENTS]
        frame = poses[:, names.index(joint.bodies[0])] @ matrix(joint.frames[0])
        own = forces.reactions[:, columns].reshape(-1, 2, 3) @ frame[:, :3, :3].transpose(0, 2, 1)
        wrench = np.hstack((own[:, 0], own[:, 1] + np.cross(frame[:, :3, 3], own[:, 0])))
        sums[joint.bodies[1]] += wrench
        sums[joint.bodies[0]] -= wrench
    at = poses[:, names.index(load.body)] @ np.array([*load.point, 1.0])
    moment = np.cross(at[:, :3], load.force) + load.moment
    sums[load.body] += np.hstack((np.tile(load.force, (len(moved), 1)), moment))
    for body in names[1:]:
        # forces of up to some 100 N, by a system of condition 1e2
        np.testing.assert_allclose(sums[body], 0.0, rtol=0, atol=1e-10)


@pytest.mark.slow
def test_a_four_bar_in_its_plane_has_the_reactions_of_the_textbook() -> None:
    """Nine equations, three of each link, for the forces of four pins and the torque of the crank."""
    load = Wrench("coupler", (0.45, 0.2, 0.0), (3.0, -50.0, 0.0))
    moved = network_drive("four-bar", {"crank": (0.2, 6)}, steps=30, wrenches=[load])
    forces = there(moved.forces)
    poses = dict(zip(moved.network.body_names, moved.poses().transpose(1, 0, 2, 3), strict=True))
    joints = {one.name: one for one in moved.network.joints}
    for row in range(len(moved)):
        pins = [poses[body][row] @ [place, 0, 0, 1] for body, place in PINS.values()]
        at = (poses["coupler"][row] @ [0.45, 0.2, 0.0, 1.0])[:2]
        matrix_of, right = np.zeros((9, 9)), np.zeros(9)
        for k, (pin, sides) in enumerate(zip(pins, [(None, 0), (0, 1), (1, 2), (None, 2)], strict=True)):
            for body, sign in zip(sides, (-1.0, 1.0), strict=True):
                if body is not None:
                    block = np.array([[1.0, 0.0], [0.0, 1.0], [-pin[1], pin[0]]])
                    matrix_of[3 * body : 3 * body + 3, 2 * k : 2 * k + 2] += sign * block
        matrix_of[2, 8] = 1.0  # torque on the crank
        right[3:6] = -3.0, 50.0, -(at[0] * -50.0 - at[1] * 3.0)
        answer = np.linalg.solve(matrix_of, right)
        assert forces.drives[row, 0] == pytest.approx(answer[8], abs=1e-9)
        for k, (joint, (base, _)) in enumerate(PINS.items()):
            frame = poses[base][row] @ matrix(joints[joint].frames[0])
            values = forces.reactions[row, [forces.names.index(f"{joint} {one}") for one in COMPONENTS]]
            in_plane = frame[:2, :3] @ np.where(np.abs(frame[:3, :3][2]) < 0.5, values[:3], 0.0)
            np.testing.assert_allclose(in_plane, answer[2 * k : 2 * k + 2], rtol=0, atol=1e-9)
            assert np.isnan(values).tolist() == [False, True] * 3  # n is across the plane


def test_the_legs_of_a_platform_carry_its_load() -> None:
    """sum of f u = -F, sum of (p + R b) x f u = -M with the directions u from base to platform."""
    name, load_text = "stewart-gough-driven", "platform:0.1,0,0.2:3,4,-100,5,0,-2"
    moved = network_drive(name, DRIVES[name], steps=10, wrenches=[load_text])
    forces = there(moved.forces)
    points = np.array([one["a"] for one in tables_of("stewart-gough-driven")["elements"].values()])
    for row, pose in enumerate(moved.poses()[:, 1]):
        tops = points[:, 1] @ pose[:3, :3].T + pose[:3, 3]
        u = (tops - points[:, 0]) / np.linalg.norm(tops - points[:, 0], axis=1)[:, np.newaxis]
        at = pose[:3] @ [0.1, 0.0, 0.2, 1.0]
        load = [3, 4, -100, *np.add(np.cross(at, [3, 4, -100]), [5, 0, -2])]
        legs = np.linalg.solve(np.vstack((u.T, np.cross(tops, u).T)), -np.array(load))
        np.testing.assert_allclose(forces.drives[row], legs, rtol=0, atol=1e-9)  # 100 N, condition 1e2
        own = [forces.reactions[row, forces.names.index(f"rod{k} force")] for k in range(1, 7)]
        np.testing.assert_allclose(own, legs, rtol=0, atol=1e-9)
