"""Open forms against the numeric dynamics, against energy, and as C; what is refused."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from asserting import refusal
from random_arms import Motion, c_terms, compiled, random_arm, random_motion, text_terms
from urmpipe_models.arm.chain import Chain, Inertial, Joint, Mimic
from urmpipe_models.dynamics.equations import inverse_dynamics, mass_matrix, torque_terms
from urmpipe_models.dynamics.links import Wrench
from urmpipe_models.errors import OptionError, RobotError
from urmpipe_models.kinematics.forward import iter_frames
from urmpipe_models.lagrange.derivation import TERMS
from urmpipe_models.lagrange.formulas import OpenForm, c_code, equations_text, open_form
from urmpipe_models.math3d import from_offset

QUICK = {1: (2, 11, 14), 2: (2, 8), 3: (2, 8, 19), 4: (19,)}
"""Seeds of arms by their number of coordinates."""

CASES = [
    pytest.param(count, seed, marks=pytest.mark.slow if count > 1 else ())
    for count, seeds in QUICK.items()
    for seed in seeds
]


def seeded_arm(count: int, seed: int) -> Chain:
    return random_arm(np.random.default_rng(seed), count)


@cache
def seeded_form(count: int, seed: int) -> OpenForm:
    """Return the open form of an arm: seconds of SymPy, once for all tests."""
    return open_form(seeded_arm(count, seed))


def parallel_neighbours(chain: Chain) -> int:
    """How many pairs of turning joints that follow each other have parallel axes, wherever they stand."""
    q = random_motion(np.random.default_rng(7), chain)[0].tolist()
    placed = zip(chain.joints, list(iter_frames(chain, q))[1:], strict=True)
    axes = [np.array(frame.rotate(one.axis), float) for one, frame in placed if one.kind == "revolute"]
    return sum(float(np.linalg.norm(np.cross(*pair))) < 1e-9 for pair in pairwise(axes))


def test_the_arms_turn_slide_follow_and_have_parallel_axes_and_others() -> None:
    arms = {count: [seeded_arm(count, seed) for seed in seeds] for count, seeds in QUICK.items()}
    assert list(arms) == [1, 2, 3, 4]
    for count, some in arms.items():
        assert {len(chain.coordinates) for chain in some} == {count}
        joints = [joint for chain in some for joint in chain.joints]
        for follows in (False, True):
            kinds = {one.kind for one in joints if (one.mimic is not None) == follows} - {"fixed"}
            assert kinds == {"revolute", "prismatic"}
    parallel = [parallel_neighbours(chain) for some in arms.values() for chain in some]
    assert parallel.count(0) >= 3
    assert len(parallel) - parallel.count(0) >= 3


@pytest.mark.parametrize(("count", "seed"), CASES)
def test_each_term_is_that_of_the_numeric_dynamics_in_text_and_in_c(
    count: int, seed: int, tmp_path: Path
) -> None:
    rng = np.random.default_rng(seed)
    chain = random_arm(rng, count)
    form = seeded_form(count, seed)
    library, text = compiled(c_code(form), tmp_path), text_terms(equations_text(form))
    for _ in range(5):
        motion, wrench = random_motion(rng, chain), rng.normal(0.0, 5.0, 6).tolist()
        outside = Wrench((wrench[0], wrench[1], wrench[2]), (wrench[3], wrench[4], wrench[5]))
        q, qd, qdd = (one.tolist() for one in motion)
        wanted = torque_terms(chain, q, qd, qdd, outside)._asdict()
        wanted["torque"] = inverse_dynamics(chain, q, qd, qdd, outside)
        in_c, in_text = c_terms(library, chain, motion, wrench), text(motion, wrench)
        largest = max(np.abs(one).max() for one in in_c.values())
        for term, values in wanted.items():
            # two ways of some thousand products of numbers up to the largest, each rounded at 1e-16
            np.testing.assert_allclose(in_c[term], values, rtol=0.0, atol=1e-10 * largest)
        for term in TERMS:
            # the same numbers in another order: a sum of some hundred products rounds at 1e-14
            np.testing.assert_allclose(in_c[term], in_text[term], rtol=0.0, atol=1e-12 * largest)
        unit = [text((motion[0], motion[1], one), wrench)["inertia"] for one in np.eye(count)]
        np.testing.assert_allclose(np.transpose(unit), mass_matrix(chain, q), rtol=0.0, atol=1e-10 * largest)


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
        placed = dict(
            zip((None, *(one.name for one in chain.joints)), iter_frames(chain, q.tolist()), strict=True)
        )
        heights = (
            one.mass * np.dot(chain.gravity, placed[one.joint].point(one.centre)) for one in chain.inertials
        )
        return float(kinetic - sum(heights))

    nodes, weights = np.polynomial.legendre.leggauss(40)
    times = 1.0 + nodes
    powers = [sum(terms(motion(t), [0.0] * 6).values()) @ motion(t)[1] for t in times]
    scale = float(np.abs(powers).max())
    # 40 nodes integrate swings of this speed to rounding; the sums of terms round at some 1e-15 of the power
    assert weights @ powers == pytest.approx(energy(2.0) - energy(0.0), abs=1e-11 * scale)


@pytest.mark.parametrize(("count", "seed"), CASES)
def test_the_reduction_adds_no_operation(count: int, seed: int) -> None:
    for one in seeded_form(count, seed).costs:
        assert one.reduced.additions <= one.operations.additions
        assert one.reduced.multiplications <= one.operations.multiplications


def arm(count: int = 1) -> Chain:
    joints = tuple(Joint(f"theta{k}", origin=from_offset([0.5, 0.0, 0.0])) for k in range(1, count + 1))
    return Chain("arm", joints, inertials=(Inertial(f"theta{count}", 2.0, (0.5, 0.0, 0.0)),))


TWISTER = tuple(
    Joint(f"j{k}", axis=[(0, 0, 1.0), (0, 1.0, 0), (1.0, 0, 0)][k % 3], mimic=Mimic("j0", 0.5) if k else None)
    for k in range(11)
)


@pytest.mark.parametrize(
    ("chain", "message"),
    [
        (arm(5), "robot arm: found 5 coordinates, allowed: up to 4 in the open form"),
        (
            Chain("twister", TWISTER, inertials=(Inertial("j10", 1.0, (0.1, 0.2, 0.3)),)),
            "robot twister: found 1 coordinates and 10 turns about axes that are not parallel to the one"
            " before, allowed: up to 9 of both in the open form",
        ),
        (
            replace(arm(), inertials=()),
            "robot arm: key inertials: found none, allowed: the masses of the arm (in a URDF <inertial>)",
        ),
    ],
)
def test_arms_without_masses_and_too_large_ones_are_refused(chain: Chain, message: str) -> None:
    open_form(arm(4), ("gravity",))
    assert refusal(RobotError, open_form, chain) == message


def test_sympy_missing_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sympy", None)
    message = 'found equations without sympy, allowed: with sympy: pip install "urmpipe[planning]"'
    assert refusal(OptionError, open_form, arm()) == message


def test_a_mass_that_stands_still_gives_no_term() -> None:
    chain = replace(arm(), inertials=(Inertial(None, 2.0, (1.0, 0.0, 0.0)),))
    assert "  inertia = 0\n" in equations_text(open_form(chain))


def test_names_that_are_none_in_a_formula_or_in_c(tmp_path: Path) -> None:
    chain = replace(arm(2), name="2 links/*", joints=tuple(
        replace(joint, name=name) for joint, name in zip(arm(2).joints, ("a*/b", "c1"), strict=True)
    ), inertials=(Inertial("c1", 2.0, (0.5, 0.0, 0.0)),))  # fmt: skip
    form = open_form(chain)
    text, motion = equations_text(form), random_motion(np.random.default_rng(1), chain)
    assert text.startswith("# urmpipe robot export: equations of motion of 2 links/*\n")
    assert "# q1: a*/b\n# q2: c1\n# c1 = cos(q1), s1 = sin(q1)\n" in text
    found = c_terms(compiled(c_code(form), tmp_path), chain, motion, [0.0] * 6)
    wanted = sum(text_terms(text)(motion, [0.0] * 6).values())
    np.testing.assert_allclose(found["torque"], wanted, rtol=0.0, atol=1e-13)  # rounding of some 10 N.m
    assert "q[0], qd[0], qdd[0]: a* /b in rad, rad/s, rad/s2; tau in N.m" in c_code(form)
