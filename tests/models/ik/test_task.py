"""Small linear systems, and pose and Jacobian of the tool, against LAPACK, the kinematics and SciPy."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy
from scipy.spatial.transform import Rotation

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik import task
from urmpipe_models.kinematics.forward import jacobian_over_log, poses_over_log
from urmpipe_models.kinematics.singularity import characteristic_length
from urmpipe_models.math3d import from_offset, translation
from urmpipe_models.robots.catalogue import load_robot

SIZES = (1, 2, 3, 6, 8)
TURNS = [0.0, 1e-12, 1e-7, math.pi - 1e-7, math.pi - 1e-12, math.pi]
AXES = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: math.hypot(*v) > 0.1)


def matrices(k: int, p: int, n: int = 50) -> FloatArray:
    return np.random.default_rng(k * 10 + p).normal(size=(k, p, n))


@pytest.mark.parametrize("k", SIZES)
def test_systems_are_solved_as_lapack_solves_them_with_the_damping_on_the_diagonal(k: int) -> None:
    b = matrices(k, 1)[:, 0]
    damping = np.random.default_rng(1).uniform(0.1, 1.0, (b.shape[1],))
    # normal random matrices k x (k + 3) have conditions up to 1e3 squared: 1e-16 * 1e6; damped < 1e3
    for columns, damped, rtol, atol in ((k + 3, (), 1e-8, 1e-9), (2, (damping,), 1e-10, 1e-12)):
        A = task.gram(matrices(k, columns))
        each = A.transpose(2, 0, 1) + np.sum(damped, axis=0)[..., None, None] * np.eye(k)
        peer = np.linalg.solve(each, b.T[..., None])[..., 0].T
        np.testing.assert_allclose(task.factor(A, *damped).solve(b), peer, rtol=rtol, atol=atol)


def test_a_singular_system_has_a_finite_damped_solution() -> None:
    """Rank 1 of 6, damped by 1e-13 of its trace: rounding alone would make pivots negative."""
    rows = matrices(6, 1, 2000)
    A = task.gram(rows)
    trace = np.einsum("iin->n", A)
    least = 1e-18 * trace  # less than the rounding of the pivots
    assert (task.factor(A, least).inverse <= 1.0001 / least).all()
    assert (task.factor(A, least).inverse > 0.0).all()
    found = task.factor(A, 1e-13 * trace).solve(task.product(rows, np.ones((1, 2000))))
    step = task.transposed_product(rows, found)
    np.testing.assert_allclose(step, 1.0, atol=1e-2)  # rounding 1e-16 with a damping of 1e-13


def test_products_are_those_of_matrices() -> None:
    M, x, y, other = matrices(6, 8), matrices(8, 1)[:, 0], matrices(6, 1)[:, 0], matrices(6, 2)
    each = M.transpose(2, 0, 1)
    for found, subscripts, factors in (
        (task.product(M, x), "nij,jn->in", (each, x)),
        (task.transposed_product(M, y), "nij,in->jn", (each, y)),
        (task.gram(M), "nij,nkj->ikn", (each, each)),
        (task.column_squares(M), "nij,nij->jn", (each, each)),
        (task.dot_product(y, y), "in,in->n", (y, y)),
        (task.outer_sum(M, other), "nij,ikn->jkn", (each, other)),
    ):
        np.testing.assert_allclose(found, np.einsum(subscripts, *factors), atol=1e-13)


@settings(max_examples=40, deadline=None)
@given(data=st.data(), rows=st.integers(1, 4))
def test_pose_and_jacobian_of_a_chain(chains: SearchStrategy[Chain], data: st.DataObject, rows: int) -> None:
    """Fixed frames, slides, mimics, any axis; entries of some metres at most, some products: 1e-12."""
    chain = data.draw(chains)
    q = np.random.default_rng(rows).uniform(-3.0, 3.0, (rows, len(chain.coordinates)))
    tool = task.tool_motion(task.prepare_chain(chain), np.ascontiguousarray(q.T))
    position, rotation = poses_over_log(chain, q)
    np.testing.assert_allclose(tool.position.T, position, atol=1e-12)
    np.testing.assert_allclose(tool.columns.transpose(2, 1, 0), rotation, atol=1e-12)
    np.testing.assert_allclose(tool.jacobian.transpose(2, 0, 1), jacobian_over_log(chain, q), atol=1e-12)


def test_what_a_radian_counts_as_does_not_depend_on_where_a_description_puts_frames() -> None:
    chain = load_robot("ur5e")
    aside = Joint("aside", "fixed", translation(0.0, 0.0, 100.0))  # axis 2 of a calibrated arm
    back = replace(chain.joints[2], origin=translation(0.0, 0.0, -100.0) @ chain.joints[2].origin)
    other = replace(chain, joints=(*chain.joints[:2], aside, back, *chain.joints[3:]), visuals=())
    assert task.orientation_length(other) == pytest.approx(task.orientation_length(chain), rel=1e-12)
    assert task.orientation_length(chain) == characteristic_length(chain) / 4.0


@settings(max_examples=50, deadline=None)
@given(st.floats(0.0, math.pi) | st.sampled_from(TURNS), AXES)
def test_the_turn_between_two_frames_is_scipys(angle: float, axis: tuple[float, float, float]) -> None:
    vector = angle * np.array(axis) / math.hypot(*axis)
    pose = from_offset((0.0, 0.0, 0.0, 0.4, -1.1, 2.0))
    wanted = Rotation.from_rotvec(vector).as_matrix() @ np.array(pose.rotation)
    found = task.rotation_error(np.array(pose.columns)[..., None], wanted.T[..., None])[:, 0]
    np.testing.assert_allclose(np.linalg.norm(found), angle, atol=1e-14 + 1e-15 / max(math.sin(angle), 1e-7))
    again = Rotation.from_rotvec(found).as_matrix() @ np.array(pose.rotation)
    np.testing.assert_allclose(again, wanted, atol=3e-8)  # within 1e-6 of half a turn the axis has 8 digits
    if angle < 3.0:
        np.testing.assert_allclose(found, vector, atol=1e-14)
