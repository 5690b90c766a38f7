"""Joints 1 to 3 of an arm: as many postures as a search finds, all digits in special arms, each once."""

from __future__ import annotations

import math

import numpy as np
import pytest

from closed_forms import FOLD, arm_with_wrist, distances, form_of, random_joints, solve_poses
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.spherical import SphericalWrist


def pieper(d: FloatArray, a: FloatArray, alpha: FloatArray, q3: FloatArray, wrist: FloatArray) -> FloatArray:
    """Pieper's equation of q3, zero at every posture.

    With the wrist at f(q3) before joint 2, r = |w - d1 z|^2 and h = z . w - d1 of the wrist centre w:
    ((r - |f|^2 - a1^2) / (2 a1))^2 + ((h - f_z cos alpha1) / sin alpha1)^2 = f_x^2 + f_y^2.

    Args:
        d: d1 to d4 in [m].
        a: a1 to a3 in [m].
        alpha: alpha1 to alpha3 in [rad].
        q3: The angle of joint 3, in [rad], shape (m,).
        wrist: In frame 0 in [m], shape (3,).
    """
    u, v, w = a[2], -d[3] * math.sin(alpha[2]), d[3] * math.cos(alpha[2]) + d[2]
    y = u * np.sin(q3) + v * np.cos(q3)
    f_x = u * np.cos(q3) - v * np.sin(q3) + a[1]
    f_y = y * math.cos(alpha[1]) - w * math.sin(alpha[1])
    f_z = y * math.sin(alpha[1]) + w * math.cos(alpha[1]) + d[1]
    height = wrist[2] - d[0]
    square = wrist[0] ** 2 + wrist[1] ** 2 + height**2
    along = (square - f_x**2 - f_y**2 - f_z**2 - a[0] ** 2) / (2.0 * a[0])
    across = (height - f_z * math.cos(alpha[0])) / math.sin(alpha[0])
    return np.asarray(along**2 + across**2 - f_x**2 - f_y**2)


def is_grazing(values: FloatArray) -> bool:
    """Whether the equation has an extremum that just reaches or just misses zero."""
    inner = values[1:-1]
    extremal = (inner - values[:-2]) * (values[2:] - inner) <= 0
    return bool((np.abs(inner[extremal]) < 1e-3 * np.abs(values).max()).any())


@pytest.mark.slow
def test_a_general_arm_has_as_many_postures_as_piepers_equation_has_roots() -> None:
    rng = np.random.default_rng(12)
    counts = set()
    q3 = np.linspace(-math.pi, math.pi, 20001)
    for _ in range(12):
        d, a = rng.uniform(-0.5, 0.5, 4), rng.uniform(-0.5, 0.5, 3)
        alpha = rng.choice((-1, 1), 3) * rng.uniform(0.4, 2.7, 3)
        rows = (("d", d), ("a", a), ("alpha", alpha))
        fixed = {f"{name}{k}": value for name, values in rows for k, value in enumerate(values, start=1)}
        chain = arm_with_wrist(rng, theta3=0.0, **fixed)
        form = form_of(chain)
        assert isinstance(form, SphericalWrist)
        at_base = chain.base.inverse()
        wrists = np.array(chain.base.rotation) @ rng.uniform(-0.6, 0.6, (3, 40))
        wrists += np.array(chain.base.translation)[:, None]
        postures = form.arm.solve(wrists)
        for row, wrist in enumerate(wrists.T):
            values = pieper(d, a, alpha, q3, np.array(at_base.point(tuple(wrist))))
            roots = np.flatnonzero(np.sign(values[1:]) != np.sign(values[:-1]))
            if (len(roots) and np.diff(roots).min(initial=99) < 20) or is_grazing(values):
                continue  # near a double root the grid may miss both
            found = np.sort(postures.q[2, np.isfinite(postures.q[2, :, row]), row])
            np.testing.assert_allclose(found, q3[roots] + math.pi / 20000, rtol=0, atol=math.pi / 10000)
            counts.add(len(found))
    assert counts == {0, 2, 4}


@pytest.mark.slow
@pytest.mark.parametrize("parameter", ["a1", "alpha1", "a2", "alpha2"])  # axes that nearly meet, are parallel
@pytest.mark.parametrize("off", [1e-2, 1e-4, 1e-6, 1e-7, 1e-8, 1e-10, 1e-12, 1e-14])
def test_an_arm_that_is_almost_special_loses_no_digit(parameter: str, off: float) -> None:
    rng = np.random.default_rng(13)
    lost = 0
    for _ in range(3):
        chain = arm_with_wrist(rng, "plain", "RRR", **{parameter: off})
        q = random_joints(rng, chain, 120)
        lost += int((distances(chain, solve_poses(chain, q, given=math.inf), q).min(axis=1) > FOLD).sum())
    # taken for special up to 1e-6, and polished from there: next to a fold a posture may be lost
    assert lost <= (0.01 * 360 if 1e-8 <= off <= 1e-6 else 0)


@pytest.mark.parametrize("off", [1e-7, 1e-8, 1e-10, 1e-12])
def test_an_arm_that_is_almost_special_twice_loses_no_posture(off: float) -> None:
    rng = np.random.default_rng(16)
    chain = arm_with_wrist(rng, a1=off, alpha2=off)
    solve_poses(chain, random_joints(rng, chain, 200))
