"""Mechanisms with known answers, drawn where every body's frame is the ground's and all variables are 0."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from random_networks import KINDS, Vec, axis_frame, matrix, transform, unit, vec
from urmpipe_datasets import NETWORKS
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import rotation_x, rotation_z, translation
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.parts import Body, ConstraintElement, Control, Expression, Joint, JointKind

X, Y, Z, ORIGIN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


def tied(name: str, kind: JointKind, bodies: tuple[str, str], n: Vec, p: Vec, pitch: float = 0.0) -> Joint:
    """Return a joint along n [-] at a point in [m] of the drawing."""
    frame = transform(axis_frame(unit(n), np.array(p), np.random.default_rng(0)))
    return Joint(name, kind, bodies, (frame, frame), pitch=pitch)


def driven(joint: Joint, *values: str | None) -> Joint:
    """Return a joint whose variables functions of controls drive."""
    return replace(joint, values=tuple(None if one is None else Expression(one) for one in values))


def with_drives(free: Network, **drives: str) -> Network:
    """Return a network with joints that functions of the control s drive, by their names."""
    joints = (driven(one, drives[one.name]) if one.name in drives else one for one in free.joints)
    return replace(free, joints=tuple(joints), controls=(Control("s"),))


def rod(name: str, bodies: tuple[str, str], p: Vec, q: Vec, more: str = "0") -> ConstraintElement:
    """Return a gg element between two points in [m] of the drawing, `more` longer than that."""
    length = float(np.linalg.norm(np.subtract(q, p)))
    return ConstraintElement(name, "gg", bodies, Expression(f"{length!r} + {more}"), (p, q))


def ring(kinds: str, axes: FloatArray, points: FloatArray, drives: str | None = None) -> Network:
    """Return a loop of joints r, p, c, h, g along axes [-] through points in [m]; drives turn the first."""
    named: dict[str, JointKind] = {kind[0]: kind for kind in KINDS}
    names = ["ground", *(f"b{k}" for k in range(1, len(kinds)))]
    joints = [
        tied(f"j{k}", named[kind], (names[k], names[(k + 1) % len(kinds)]), vec(axes[k]), vec(points[k]), 0.1)
        for k, kind in enumerate(kinds)
    ]
    free = Network(kinds, tuple(map(Body, names[1:])), tuple(joints))
    return with_drives(free, j0=drives) if drives else free


def circles(p: FloatArray, r: float, q: FloatArray, s: float, sign: float = 1.0) -> FloatArray:
    """Return the point at r from p and s from q in the plane, in [m]."""
    d = float(np.linalg.norm(q - p))
    along = (d**2 + r**2 - s**2) / (2.0 * d)
    e = (q - p) / d
    across = sign * np.sqrt(max(r**2 - along**2, 0.0))
    return np.asarray(p + along * e + across * np.array([-e[1], e[0]]))


def four_bar(
    a: float = 0.4, b: float = 0.9, c: float = 0.7, d: float = 1.0, t: float = 0.9, drive: str | None = None
) -> Network:
    """Return a planar four-bar: crank a, coupler b, rocker c, frame d in [m], its crank at t in [rad]."""
    crank, pivot = a * np.array([np.cos(t), np.sin(t)]), np.array([d, 0.0])
    joint = circles(crank, b, pivot, c)
    points = np.zeros((4, 3))
    points[1:, :2] = np.array([crank, joint, pivot])
    return ring("rrrr", np.tile(Z, (4, 1)), points, drive)


def tables_of(name: str) -> dict[str, Any]:
    """Return the tables of a shipped file."""
    return tomllib.loads((NETWORKS / f"{name}.toml").read_text(encoding="utf-8"))


def four_bar_tables(links: Sequence[float], at: dict[str, float]) -> dict[str, Any]:
    """Return the shipped four-bar with other links a, b, c, d [m], its crank and joints at angles [rad]."""
    a, b, c, d = links
    tables = tables_of("four-bar")
    tables["controls"]["crank"]["start"] = at["crank"]
    for name, first, second in (("A", a, 0.0), ("B", b, c), ("theta4", d, 0.0)):
        tables["joints"][name] |= {"a": [[first, 0.0, 0.0], [second, 0.0, 0.0]], "start": at[name]}
    return tables


def four_bar_angles(links: Sequence[float], crank: Any, sign: int = 1) -> dict[str, Any]:
    """Return its angles [rad] by the diagonal from O4, and the triangle of that, coupler and rocker."""
    a, b, c, d = links
    x, y = a * np.cos(crank) - d, a * np.sin(crank)
    square = x * x + y * y
    theta4 = np.arctan2(y, x) - sign * np.arccos((c * c + square - b * b) / (2 * c * np.sqrt(square)))
    coupler = np.arctan2(c * np.sin(theta4) - y, c * np.cos(theta4) - x)
    return {"crank": crank, "A": coupler - crank, "B": theta4 - coupler, "theta4": theta4}


def bennett(drive: str | None = None, alpha: float = 0.6, beta: float = 1.1, t: float = 0.8) -> Network:
    """Return Bennett's linkage: a / sin(alpha) = b / sin(beta)."""
    a, b = np.sin(alpha), np.sin(beta)
    other = 2.0 * np.arctan(np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2) / np.tan(t / 2))
    steps = [(t, a, alpha), (other, b, beta), (-t, a, alpha), (-other, b, beta)]
    frame, axes, points = np.eye(4), [], []
    for turn, length, twist in steps:
        axes.append(frame[:3, 2])
        points.append(frame[:3, 3])
        frame = frame @ matrix(rotation_z(turn) @ translation(length, 0.0, 0.0) @ rotation_x(twist))
    np.testing.assert_allclose(frame, np.eye(4), rtol=0.0, atol=1e-14)  # it closes
    return ring("rrrr", np.array(axes), np.array(points), drive)


def sarrus(drive: str | None = None) -> Network:
    """Return Sarrus' linkage: two legs of three parallel hinges in planes across each other."""
    axes = np.array([Y, Y, Y, X, X, X])
    along_x = [(0.5, 0, 0), (0.75, 0, 0.3), (0.4, 0, 0.6)]
    along_y = [(0, 0.35, 0.6), (0, 0.8, 0.35), (0, 0.45, 0)]
    points = np.array(along_x + along_y, dtype=float)
    return ring("rrrrrr", axes, points, drive)


def random_ring(kinds: str, seed: int, drive: str | None = None) -> Network:
    """Return one loop about axes and points at random."""
    rng = np.random.default_rng(seed)
    axes = np.array([unit(rng.normal(size=3)) for _ in kinds])
    return ring(kinds, axes, rng.uniform(-1.0, 1.0, (len(kinds), 3)), drive)


rssr, rccc = partial(random_ring, "rggr", 6), partial(random_ring, "rccc", 4)


def nine_revolutes(drive: str | None = None) -> Network:
    """Return nine hinges in a ring: three are driven by one control if asked, as in the paper."""
    free = random_ring("rrrrrrrrr", 9)
    return with_drives(free, j0=drive, j3=f"0.5 * ({drive})", j6=f"sin({drive})") if drive else free


def coupled_loops(drive: str | None = None) -> Network:
    """Return two planar four-bars: the rocker of the first is the crank of the second."""
    joints = (
        tied("A", "revolute", ("ground", "crank"), Z, (0.0, 0.0, 0.0)),
        tied("B", "revolute", ("crank", "coupler"), Z, (0.2, 0.35, 0.0)),
        tied("C", "revolute", ("rocker", "coupler"), Z, (1.1, 0.7, 0.0)),
        tied("D", "revolute", ("ground", "rocker"), Z, (1.0, 0.0, 0.0)),
        tied("E", "revolute", ("rocker", "rod"), Z, (1.4, 0.6, 0.0)),
        tied("F", "revolute", ("rod", "output"), Z, (2.1, 0.8, 0.0)),
        tied("G", "revolute", ("output", "ground"), Z, (2.0, 0.0, 0.0)),
    )
    free = Network("coupled", tuple(map(Body, ("crank", "coupler", "rocker", "rod", "output"))), joints)
    return with_drives(free, A=drive) if drive else free


def slider_crank(crank: float, drive: str | None = None, a: float = 0.3, b: float = 0.8) -> Network:
    """Return a slide j0 along x, driven if asked, a rod b and a crank a [m], which is at an angle [rad]."""
    pin = a * np.array([np.cos(crank), np.sin(crank), 0.0])
    slide = pin[0] + np.sqrt(b**2 - pin[1] ** 2)
    return ring("prrr", np.array([X, Z, Z, Z]), np.array([ORIGIN, (slide, 0.0, 0.0), pin, ORIGIN]), drive)


def rod_platform(drive: str | None = None, rods: int = 6) -> Network:
    """Return a platform on rods between random points; the first is driven if asked."""
    rng = np.random.default_rng(5)
    ends = rng.uniform(-1.0, 1.0, (rods, 2, 3)) + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.5]])
    elements = [
        rod(f"r{k}", ("ground", "platform"), vec(p), vec(q), drive if drive and k == 0 else "0")
        for k, (p, q) in enumerate(ends)
    ]
    controls = (Control("s"),) if drive is not None else ()
    return Network("platform", (Body("platform", (0.0,) * 6),), (), tuple(elements), controls)


MECHANISMS: dict[str, Callable[..., Network]] = {
    "four-bar": four_bar,
    "bennett": bennett,
    "sarrus": sarrus,
    "rssr": rssr,
    "rccc": rccc,
    "rod platform": rod_platform,
    "nine revolutes": nine_revolutes,
    "coupled loops": coupled_loops,
}
