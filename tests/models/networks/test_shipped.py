"""Shipped networks against closed forms: printed answers, then four perturbed mechanisms each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from known_mechanisms import tables_of
from random_networks import distance_of
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.networks.assembly import Assembly, AssemblyResult, assemble
from urmpipe_models.networks.file import load_network
from urmpipe_models.networks.mechanism import Mechanism, build_mechanism

CLOSED = 1e-9  # m, rad: the largest gap that assembly lets pass
ANSWER = 1e-9  # m, rad: printed answers have nine places, and descent ends at gaps near 1e-14
# m, rad: descent ends at gaps near 1e-14, which branches `MARGIN` apart magnify by about 10
PERTURBED = 1e-11
# of |C| / hypot(A, B): nearer to 1 both branches meet, and rounding grows like its distance's root
MARGIN = 0.98

Answer = dict[str, tuple[float, ...]]
Tables = dict[str, Any]


# --- the closed forms


def roots(A: float, B: float, C: float, margin: float = MARGIN) -> list[float]:
    """Return both x of A cos(x) + B sin(x) = C in [rad]; none where they do not exist or nearly meet."""
    size = math.hypot(A, B)
    if abs(C) > margin * size:
        return []
    return [math.atan2(B, A) + sign * math.acos(C / size) for sign in (1, -1)]


def four_bar(a: float, b: float, c: float, d: float, theta2: float) -> list[Answer]:
    """Return theta4 of |O4 + c u(theta4) - a u(theta2)| = b."""
    x, y = d - a * math.cos(theta2), -a * math.sin(theta2)
    return [{"theta4": (q,)} for q in roots(2 * c * x, 2 * c * y, b**2 - c**2 - x**2 - y**2)]


def slider_crank(r: float, length: float, e: float, theta: float) -> list[Answer]:
    """Return s = r cos(theta) +- sqrt(l^2 - (e - r sin(theta))^2)."""
    return [
        {"s": (r * math.cos(theta) + length * math.cos(rod),)}
        for rod in roots(0.0, length, e - r * math.sin(theta))
    ]


def bennett(alpha: float, beta: float, t1: float) -> list[Answer]:
    """Return t2 of tan(t1/2) tan(t2/2) = sin((beta + alpha)/2) / sin((beta - alpha)/2), t3 and t4."""
    product = math.sin((beta + alpha) / 2) / math.sin((beta - alpha) / 2)
    t2 = 2 * math.atan(product / math.tan(t1 / 2))
    return [{"t2": (t2,), "t3": (-t1,), "t4": (-t2,)}]


def bricard(alpha: float, t: float, margin: float = MARGIN) -> list[Answer]:
    """Return the angles of the three-fold symmetric linkage: t and f in turn; see its file."""
    c, s = math.cos(alpha), math.sin(alpha)
    A, B, C = s**2 + (1 + c**2) * math.cos(t), -2 * c * math.sin(t), -(c**2) - s**2 * math.cos(t)
    return [{"t2": (f,), "t3": (t,), "t4": (f,), "t5": (t,), "t6": (f,)} for f in roots(A, B, C, margin)]


def sarrus(leg_x: tuple[float, ...], leg_y: tuple[float, ...], t: float) -> list[Answer]:
    """Return the angles of two legs (l1, l2, e): l1 u(t) + l2 u(x) = (e, h) with u = (cos, sin)."""
    l1, l2, e = leg_x
    k1, k2, g = leg_y
    answers: list[Answer] = []
    for x in roots(l2, 0.0, e - l1 * math.cos(t)):
        h = l1 * math.sin(t) + l2 * math.sin(x)
        for y in roots(2 * k1 * g, 2 * k1 * h, k1**2 + g**2 + h**2 - k2**2):
            upper = math.atan2(h - k1 * math.sin(y), g - k1 * math.cos(y))
            answers.append({"x2": (x - t,), "x3": (-x,), "y1": (y,), "y2": (upper - y,), "y3": (-upper,)})
    return answers


def rssr(arms: Sequence[float], tilt: float, t: float) -> list[Answer]:
    """Return psi of |P2(psi) - P1(t)| = l, P2 = O + h2 n + r2 (cos(psi) m - sin(psi) m x n).

    `arms` are r1, h1, l, r2, h2, and x and y of O: arms and their heights along the axes, the second of
    which has a tilt.
    """
    r1, h1, length, r2, h2, x, y = arms
    n = np.array([0.0, math.sin(tilt), math.cos(tilt)])
    m = np.array([1.0, 0.0, 0.0])
    e = np.array([x, y, 0.0]) + h2 * n - np.array([r1 * math.cos(t), r1 * math.sin(t), h1])
    A, B = 2 * r2 * (e @ m), -2 * r2 * (e @ np.cross(m, n))
    return [{"psi": (q,)} for q in roots(A, B, length**2 - r2**2 - e @ e)]


def rccc(a: FloatArray, alpha: FloatArray, s1: float, t1: float) -> list[Answer]:
    """Return t4 and s4 of the loop with link lengths a, twists alpha and the offset s1.

    t4 solves the spherical equation F(t1, t4, alpha) = 0, that of the angle between axes 2 and 3:
    e1 Ry(-alpha_2) Rx(-t1) Ry(-alpha_1) Rx(-t4) Ry(-alpha_4) e1 = cos(alpha_3). By the principle of
    transference it holds for dual angles, too: F_t1 s1 + F_t4 s4 + sum F_alpha a = 0.
    """
    at = [spherical(t1, t4, alpha).real for t4 in (0.0, math.pi / 2, math.pi)]
    mean = (at[0] + at[2]) / 2  # of A cos(t4) + B sin(t4) - C
    answers: list[Answer] = []
    for t4 in roots((at[0] - at[2]) / 2, at[1] - mean, -mean):
        # steps of 1e-30 along the imaginary axis: exact derivatives, as dual numbers give them
        by_t4 = spherical(t1, t4 + 1e-30j, alpha).imag
        by_others = spherical(t1 + 1e-30j * s1, t4, alpha + 1e-30j * a).imag
        answers.append({"c4": (t4, -by_others / by_t4)})
    return answers


def spherical(t1: complex, t4: complex, alpha: FloatArray) -> complex:
    """Return F of `rccc`: the first entry of the product, less cos(alpha_3)."""
    row = np.array([1, 0, 0])
    for x, y in ((0, alpha[1]), (t1, alpha[0]), (t4, alpha[3])):  # Rx(-x) Ry(-y)
        c, s, cy, sy = np.cos(x), np.sin(x), np.cos(y), np.sin(y)
        row = row @ [[1, 0, 0], [0, c, s], [0, -s, c]] @ [[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]]
    return complex(row[0] - np.cos(alpha[2]))


# --- printed answers


@pytest.mark.parametrize(
    ("name", "joint", "answers"),
    [
        ("four-bar", "theta4", (1.481134361, -2.271319288)),
        ("slider-crank", "s", (1.023997546, -0.565092234)),
    ],
)
def test_both_branches_have_the_printed_answers(name: str, joint: str, answers: tuple[float, float]) -> None:
    mechanism, assembled = every_assembly(tables_of(name), {})
    assert_same_answers(mechanism, assembled, [{joint: (value,)} for value in answers], ANSWER)


def test_bennett_obeys_its_relation_and_does_not_close_with_a_longer_link() -> None:
    _, assembled = every_assembly(tables_of("bennett"), {})
    (values,) = [one.values for one in assembled.assemblies]
    product = math.tan(values["t1"][0] / 2) * math.tan(values["t2"][0] / 2)
    assert product == pytest.approx(5.0, rel=1e-8)  # tan magnifies the answer's 1e-9 by up to 8
    tables = tables_of("bennett")
    for name in ("t1", "t3"):
        tables["dh"]["elements"][name]["a"] *= 1.05
    longer = assemble(build_mechanism(load_network(tables)), restarts=200)
    assert not longer.assemblies
    assert max(longer.closure_errors[0].metres, longer.closure_errors[0].radians) > 1e-3


def test_the_platform_of_sarrus_rises_upright() -> None:
    mechanism = build_mechanism(load_network("sarrus"))
    for tilt in np.linspace(0.5, 1.4, 4):
        pose = pose_of(mechanism, assemble(mechanism, {"tilt": tilt}).assemblies[0], "platform")
        height = 0.3 * np.sin(tilt) + np.sqrt(0.35**2 - (-0.08 - 0.3 * np.cos(tilt)) ** 2)
        np.testing.assert_allclose(pose[:3, :3], np.eye(3), rtol=0, atol=ANSWER)
        np.testing.assert_allclose(pose[:3, 3], [0.0, 0.0, height], rtol=0, atol=ANSWER)


def test_no_two_axes_of_the_nine_are_parallel() -> None:
    mechanism = build_mechanism(load_network("nine-revolute"))
    assembly = assemble(mechanism).assemblies[0]
    lines = [(joint.bodies[0], joint.frames[0].columns[1]) for joint in mechanism.network.joints]
    axes = np.array([pose_of(mechanism, assembly, body)[:3, :3] @ n for body, n in lines])
    sines = np.linalg.norm(np.cross(axes[:, np.newaxis], axes), axis=2)
    assert sines[~np.eye(9, dtype=bool)].min() > 0.05  # about 3 degrees


@pytest.mark.slow
def test_dietmaiers_platform_has_forty_assemblies_with_legs_of_the_given_lengths() -> None:
    tables = tables_of("stewart-gough")
    mechanism, assembled = every_assembly(tables, {}, restarts=2000)
    assert len(assembled.assemblies) == 40
    for one in assembled.assemblies:
        assert_elements_measure(tables, pose_of(mechanism, one, "platform"))
    poses = np.array([pose_of(mechanism, one, "platform").ravel() for one in assembled.assemblies])
    apart = np.abs(poses[:, np.newaxis] - poses).max(axis=2)
    assert apart[~np.eye(40, dtype=bool)].min() > 0.1  # no assembly is listed twice


@pytest.mark.parametrize("kind", ["gg", "eg", "crc", "gc"])
def test_elements_measure_what_the_file_gives(kind: str) -> None:
    tables = tables_of(f"cluster-{kind}")
    mechanism = build_mechanism(load_network(tables))
    start = np.eye(4)
    x = tables["bodies"]["plate"]["start"]
    start[:3, :3], start[:3, 3] = Rotation.from_rotvec(x[3:]).as_matrix(), x[:3]
    assert_elements_measure(tables, start, 1e-3)  # lengths are rounded to 1 mm
    assert_elements_measure(tables, pose_of(mechanism, assemble(mechanism).assemblies[0], "plate"))


@pytest.mark.parametrize("turn", [60.0, -20.0, 500.0])
def test_the_tip_of_the_geared_five_bar_is_where_two_circles_meet(turn: float) -> None:
    mechanism, assembled = every_assembly(tables_of("geared-five-bar"), {"turn": turn})
    left, right = math.radians(turn), math.radians(60 - 2 * turn)
    p = 0.1 * np.array([math.cos(left), math.sin(left)])
    q = np.array([0.3, 0.0]) + 0.1 * np.array([math.cos(right), math.sin(right)])
    across = np.array([p[1] - q[1], q[0] - p[0]]) / np.linalg.norm(q - p)
    height = math.sqrt(0.35**2 - float((q - p) @ (q - p)) / 4)
    expected = sorted([((p + q) / 2 + sign * height * across).tolist() for sign in (1, -1)])
    tips = [pose_of(mechanism, one, "left_rod") @ [0.35, 0, 0, 1] for one in assembled.assemblies]
    np.testing.assert_allclose(sorted(tip[:2].tolist() for tip in tips), expected, rtol=0, atol=ANSWER)
    assert {round(one.values["right"][0] - right, 9) for one in assembled.assemblies} == {0.0}


@pytest.mark.parametrize("turn", [3.0, 47.0, 119.0, 130.0, 200.0, 299.0, 340.0, 407.0, -313.0])
def test_the_cam_lifts_its_follower_by_the_cycloidal_law(turn: float) -> None:
    angle = turn % 360
    x = min(angle, 120) / 120 if angle < 180 else 1 - min(angle - 180, 120) / 120
    found = assemble(build_mechanism(load_network("cam-follower")), {"turn": turn}).assemblies[0].values
    law = 0.02 * (x - math.sin(2 * math.pi * x) / (2 * math.pi))
    assert found["lift"][0] == pytest.approx(
        law, abs=1e-6
    )  # the file: the spline is within 0.001 mm of the law


@pytest.mark.parametrize("turn", [0.0, 360.0, -500.0])
def test_the_wheels_of_the_steering_are_where_its_rods_reach(turn: float) -> None:
    """|K + l u(left) - rack| = d with the knuckle K and its arm's length l: two angles of each wheel."""
    mechanism, assembled = every_assembly(tables_of("rack-and-pinion"), {"turn": turn}, restarts=200)
    arm, d2 = math.hypot(0.03, 0.14), 0.22**2 + 0.02**2
    answers: list[list[float]] = []
    for side in (-1.0, 1.0):
        x, y = side * 0.6 - (0.007 * math.radians(turn) + side * 0.35), 0.12
        own = math.atan2(-0.14, -side * 0.03)
        answers.append([q - own for q in roots(2 * arm * x, 2 * arm * y, d2 - arm**2 - x**2 - y**2)])
    expected: list[Answer] = [{"left": (a,), "right": (b,)} for a in answers[0] for b in answers[1]]
    assert_same_answers(mechanism, assembled, expected, ANSWER)


# --- perturbed mechanisms


def change(tables: Tables, rng: np.random.Generator, *places: str) -> list[float]:
    """Change numbers of tables, such as joints.A.a.0.0, by up to 10 %, and return them."""
    numbers = []
    for place in places:
        *path, key = [int(part) if part.isdigit() else part for part in place.split(".")]
        table: Any = tables
        for part in path:
            table = table[part]
        table[key] *= float(rng.uniform(0.9, 1.1))
        numbers.append(table[key])
    return numbers


def any_angle(rng: np.random.Generator) -> float:
    """Return an angle in [rad] that no whole or half turn is near to, where links may be in line."""
    return float(rng.choice([-1, 1]) * rng.uniform(0.2, 2.9))


def perturb(name: str, tables: Tables, rng: np.random.Generator) -> tuple[float, list[Answer]]:
    """Change tables by up to 10 %; return a value of the control, and the answers by the closed form."""
    joints, elements = tables.get("joints", {}), tables.get("dh", {}).get("elements", {})
    t = any_angle(rng)
    match name:
        case "four-bar":
            a, b, c, d = change(joints, rng, "A.a.0.0", "B.a.0.0", "B.a.1.0", "theta4.a.0.0")
            answers = four_bar(a, b, c, d, t)
        case "slider-crank":
            r, length, e = change(joints, rng, "A.a.0.0", "B.a.0.0", "s.a.0.1")
            answers = slider_crank(r, length, e, t)
        case "bennett":
            a, alpha, beta = change(elements, rng, "t2.a", "t2.alpha", "t1.alpha")
            b = a * math.sin(beta) / math.sin(alpha)
            for joint, element in elements.items():
                element["a"], element["alpha"] = (b, beta) if joint in ("t1", "t3") else (a, alpha)
            answers = bennett(alpha, beta, t)
        case "bricard":
            a, alpha = change(elements, rng, "t1.a", "t1.alpha")
            for element in elements.values():
                element["a"], element["alpha"] = a, math.copysign(alpha, element["alpha"])
            answers = bricard(alpha, t)
        case "sarrus":
            x, l1, l2, x_top = change(joints, rng, "x1.a.0.0", "x2.a.0.0", "x3.a.0.0", "x3.a.1.0")
            y, k1, k2, y_top = change(joints, rng, "y1.a.0.1", "y2.a.0.1", "y3.a.0.1", "y3.a.1.1")
            (t,) = change(tables, rng, "controls.tilt.start")
            answers = sarrus((l1, l2, x_top - x), (k1, k2, y_top - y), t)
        case "rssr":
            tilt = math.atan2(0.6, 0.8) * rng.uniform(0.9, 1.1)
            joints["psi"]["n"][0] = [0.0, math.sin(tilt), math.cos(tilt)]
            arms = change(joints, rng, "S1.a.0.0", "S1.a.0.2", "S2.a.0.0", "S2.a.1.0", "S2.a.1.1")
            arms += change(joints, rng, "psi.a.0.0", "psi.a.0.1")
            answers = rssr(arms, tilt, t)
        case "rccc":
            lengths = change(elements, rng, *(f"{joint}.a" for joint in elements))
            twists = change(elements, rng, *(f"{joint}.alpha" for joint in elements))
            (s,) = change(elements, rng, "r1.s")
            answers = rccc(np.array(lengths), np.array(twists), s, t)
        case _:  # screw-jack
            pitch, t = change(tables, rng, "joints.screw.pitch", "controls.turn.start")
            answers = [{"rise": (pitch * t,), "swivel": (-t,)}]
    return t, answers


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["four-bar", "slider-crank", "bennett", "bricard", "sarrus", "rssr", "rccc", "screw-jack"]
)
def test_four_perturbed_mechanisms_have_the_answers_of_the_closed_form(name: str) -> None:
    rng, checked = np.random.default_rng(7), 0
    while checked < 4:
        tables = tables_of(name)
        value, answers = perturb(name, tables, rng)
        if answers:
            mechanism, assembled = every_assembly(tables, {next(iter(tables["controls"])): value})
            assert_same_answers(mechanism, assembled, answers, PERTURBED)
            checked += 1


# --- helpers


def every_assembly(
    tables: Tables, controls: dict[str, float], restarts: int = 20
) -> tuple[Mechanism, AssemblyResult]:
    """Return the mechanism of tables, and its assemblies."""
    mechanism = build_mechanism(load_network(tables))
    return mechanism, assemble(mechanism, controls, find_all=True, restarts=restarts)


def pose_of(mechanism: Mechanism, assembly: Assembly, body: str) -> FloatArray:
    """Return the pose of a body in the ground, shape (4, 4)."""
    pose: FloatArray = assembly.poses[mechanism.network.body_names.index(body)]
    return pose


def assert_same_answers(
    mechanism: Mechanism, assembled: AssemblyResult, answers: list[Answer], tolerance: float
) -> None:
    """Assert that the assemblies are the expected ones, each once; angles are equal up to whole turns."""
    units = {one.name: one.units for one in mechanism.network.joints}
    owners = list(answers[0])
    turns = np.array([unit == "rad" for owner in owners for unit in units[owner]])
    found = np.array([[v for owner in owners for v in one.values[owner]] for one in assembled.assemblies])
    expected = np.array([[v for owner in owners for v in one[owner]] for one in answers])
    apart = found[:, np.newaxis] - expected
    apart -= 2 * np.pi * np.round(apart / (2 * np.pi)) * turns
    same = np.abs(apart).max(axis=2) < tolerance
    assert same.shape == (len(answers), len(answers)), f"{len(found)} assemblies, expected {len(answers)}"
    assert (same.sum(axis=0) == 1).all(), f"nearest: {np.abs(apart).max(axis=2).min(axis=0)}"


def assert_elements_measure(tables: Tables, pose: FloatArray, tolerance: float = CLOSED) -> None:
    """Compare the lengths of elements between the ground and a body with the file."""
    R, origin = pose[:3, :3], pose[:3, 3]
    for element in load_network(tables).elements:
        (p, q), (n, other) = np.array(element.points), np.array(element.normals)
        found = distance_of(element.kind, p, n, R @ q + origin, R @ other, np.zeros(3))
        row = tables["elements"][element.name]
        assert found == pytest.approx(row.get("d", row.get("h")), abs=tolerance)
