"""Open forms against the numeric dynamics, against energy, and as C."""

from __future__ import annotations

import sys
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from asserting import refusal
from random_arms import Motion, c_terms, compiled, random_arm, random_motion, text_terms
from urmpipe_models.arm.chain import Chain, Inertial, Joint
from urmpipe_models.dynamics.equations import inverse_dynamics, mass_matrix, torque_terms
from urmpipe_models.dynamics.links import Wrench
from urmpipe_models.errors import OptionError
from urmpipe_models.kinematics.forward import iter_frames
from urmpipe_models.lagrange.derivation import TERMS
from urmpipe_models.lagrange.formulas import OpenForm, c_code, equations_text, open_form
from urmpipe_models.math3d import from_offset

# Numbers of coordinates and seeds of arms
CASES = [(1, 2), (1, 11), (1, 14), (2, 2), (2, 8), (3, 2), (3, 8), (3, 19), (4, 19)]
MARKED = [pytest.param(*case, marks=pytest.mark.slow if case[0] > 1 else ()) for case in CASES]


@cache
def seeded_form(count: int, seed: int) -> OpenForm:
    """Return the open form of an arm: seconds of SymPy, once for all tests."""
    return open_form(random_arm(np.random.default_rng(seed), count))


def has_parallel_neighbours(chain: Chain) -> bool:
    """Return whether the axes of two successive revolute joints are parallel in any pose."""
    q = random_motion(np.random.default_rng(7), chain)[0].tolist()
    frames = zip(chain.joints, list(iter_frames(chain, q))[1:], strict=True)
    axes = [np.array(frame.rotate(joint.axis), float) for joint, frame in frames if joint.kind == "revolute"]
    return any(float(np.linalg.norm(np.cross(*pair))) < 1e-9 for pair in pairwise(axes))


def test_the_arms_have_all_kinds_of_joints_and_parallel_axes_and_others() -> None:
    arms = [random_arm(np.random.default_rng(seed), count) for count, seed in CASES]
    kinds = {(len(arm.coordinates), joint.kind, joint.mimic is None) for arm in arms for joint in arm.joints}
    for count in (1, 2, 3, 4):
        assert kinds >= {(count, kind, free) for kind in ("revolute", "prismatic") for free in (False, True)}
    assert 3 <= sum(map(has_parallel_neighbours, arms)) <= len(arms) - 3


@pytest.mark.parametrize(("count", "seed"), MARKED)
def test_terms_in_text_and_c_are_those_of_numeric_dynamics(count: int, seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    chain = random_arm(rng, count)
    form = seeded_form(count, seed)
    library, text = compiled(c_code(form), tmp_path), text_terms(equations_text(form))
    for _ in range(5):
        motion, wrench = random_motion(rng, chain), rng.normal(0.0, 5.0, 6).tolist()
        outside = Wrench(tuple(wrench[:3]), tuple(wrench[3:]))
        q, qd, qdd = (values.tolist() for values in motion)
        numeric = torque_terms(chain, q, qd, qdd, outside)._asdict()
        numeric["torque"] = inverse_dynamics(chain, q, qd, qdd, outside)
        in_c, in_text = c_terms(library, chain, motion, wrench), text(motion, wrench)
        largest = max(np.abs(values).max() for values in in_c.values())
        for term, values in numeric.items():
            # two ways of some thousand products of numbers up to the largest, each rounded at 1e-16
            assert_allclose(in_c[term], values, rtol=0.0, atol=1e-10 * largest)
        for term in TERMS:
            # the same numbers in another order: a sum of some hundred products rounds at 1e-14
            assert_allclose(in_c[term], in_text[term], rtol=0.0, atol=1e-12 * largest)
        columns = [text((motion[0], motion[1], unit), wrench)["inertia"] for unit in np.eye(count)]
        assert_allclose(np.transpose(columns), mass_matrix(chain, q), rtol=0.0, atol=1e-10 * largest)
    for cost in form.costs:  # the reduction adds no operation
        assert cost.reduced.additions <= cost.operations.additions
        assert cost.reduced.multiplications <= cost.operations.multiplications


@pytest.mark.slow
@pytest.mark.parametrize(("count", "seed"), [(1, 2), (1, 11), (2, 8), (3, 19), (4, 19)])
def test_the_work_of_the_drives_is_the_change_of_energy(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    chain = random_arm(rng, count)
    terms = text_terms(equations_text(seeded_form(count, seed)))
    amplitude, begin, omega = rng.normal(0.0, 0.7, (3, count))

    def motion(t: float) -> Motion:
        """Swing each coordinate."""
        c, s = np.cos(omega * t), np.sin(omega * t)
        return begin + amplitude * s, amplitude * omega * c, -amplitude * omega**2 * s

    def energy(t: float) -> float:
        """Return T, as the inertia term gives it, and U, by the frames of the arm."""
        q, qd, _ = motion(t)
        kinetic = 0.5 * qd @ terms((q, qd, qd), [0.0] * 6)["inertia"]
        names = (None, *(joint.name for joint in chain.joints))
        frames = dict(zip(names, iter_frames(chain, q.tolist()), strict=True))
        centres = [body.mass * np.array(frames[body.joint].point(body.centre)) for body in chain.inertials]
        return float(kinetic - np.sum(centres, axis=0) @ chain.gravity)

    nodes, weights = np.polynomial.legendre.leggauss(40)
    powers = [sum(terms(motion(t), [0.0] * 6).values()) @ motion(t)[1] for t in 1.0 + nodes]
    scale = float(np.abs(powers).max())
    # 40 nodes integrate swings of this speed to rounding; the sums of terms round at some 1e-15 of the power
    assert weights @ powers == pytest.approx(energy(2.0) - energy(0.0), abs=1e-11 * scale)


def test_names_that_have_no_meaning_in_a_formula_or_in_c(tmp_path: Path) -> None:
    joints = tuple(Joint(name, origin=from_offset([0.5, 0.0, 0.0])) for name in ("a*/b", "c1"))
    chain = Chain("2 links/*", joints, inertials=(Inertial("c1", 2.0, (0.5, 0.0, 0.0)),))
    form, motion = open_form(chain), random_motion(np.random.default_rng(1), chain)
    in_c = c_terms(compiled(c_code(form), tmp_path), chain, motion, [0.0] * 6)["torque"]
    in_text = sum(text_terms(equations_text(form))(motion, [0.0] * 6).values())
    assert_allclose(in_c, in_text, rtol=0.0, atol=1e-13)  # rounding of some 10 N.m


def test_sympy_missing_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sympy", None)
    message = 'found equations without sympy, allowed: with sympy: pip install "urmpipe[planning]"'
    assert refusal(OptionError, open_form, random_arm(np.random.default_rng(2), 1)) == message
