"""Kinematic networks: assembly side by side and one by one, all assemblies of a platform, mobility, motion.

python benchmarks/networks.py [--rounds N] [--solves N] [--seeds N] [--box SECONDS] [--rows N]

The peer is SciPy's least_squares (MINPACK's Levenberg-Marquardt). Of the spatial loop RCCC it gets urmpipe's
own residual, with and without its Jacobian; of the Stewart-Gough platform the six lengths in NumPy, as a
script has them; of the motion of a hexapod row by row the same, from the solution of the row before. They are
run in turn with urmpipe in one process.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from pairs import Bound, machine, rounds, timed, write_results
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import urmpipe
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.networks.assembly import assemble
from urmpipe_models.networks.closure import evaluate_closure, solve_closure
from urmpipe_models.networks.driving import drive_rows, find_driven_variables
from urmpipe_models.networks.file import load_network
from urmpipe_models.networks.mechanism import Mechanism, build_mechanism
from urmpipe_models.networks.mobility import analyse_mobility

CLOSED = 1e-9
"""A gap of less, in lengths (of the script: in [m]) and in [rad], is closed."""

SAME = 1e-6
"""Assemblies that are nearer to each other in each variable, in [m] and [rad], are one."""

ALONE = 100
"""Control values that the jobs one by one solve in a round."""

POSTURES = 40
"""Real assemblies of the Stewart-Gough platform. Source: Dietmaier 1998."""

COUNTED = (
    "four-bar", "slider-crank", "screw-jack", "bennett", "bricard", "sarrus", "rssr", "nine-revolute",
    "nine-revolute-controlled", "cluster-gg", "stewart-gough",
)  # fmt: skip
"""The networks whose mobility is counted."""


TURNED = {
    "four-bar": "crank", "slider-crank": "crank", "rssr": "crank", "rccc": "crank", "bennett": "turn",
    "bricard": "turn",
}  # fmt: skip
"""The networks that turn fully, and the control that turns them."""

TURN = "360deg"


@dataclass(frozen=True, slots=True)
class Searched:
    """What a search for all assemblies came to: how many, from how many starts, and its time in [s]."""

    found: int
    tried: int
    seconds: float


def milliseconds(taken: list[float]) -> str:
    """Return the median and the span of times in [s], in ms."""
    middle, least, most = (1e3 * one for one in (statistics.median(taken), min(taken), max(taken)))
    return f"{middle:.3f} ({least:.3f}-{most:.3f})"


def turned(mechanism: Mechanism, count: int) -> FloatArray:
    """Return starts that differ by the control alone, which takes a full turn, shape (variables, count)."""
    x = np.repeat(mechanism.start[:, np.newaxis], count, axis=1)
    x[mechanism.controls[0]] = np.linspace(0.0, 2.0 * np.pi, count)
    return x


def alone(mechanism: Mechanism, x: FloatArray, *, slopes: bool) -> float:
    """Return the largest gap in lengths of the mechanism and [rad] that SciPy leaves, start by start.

    Args:
        mechanism: The network.
        x: The starts, shape (variables, n).
        slopes: Whether it gets the Jacobian; else it takes differences.
    """
    free, largest = mechanism.free, 0.0
    for start in x.T:
        at = start[:, np.newaxis].copy()

        def residual(values: FloatArray, at: FloatArray = at) -> FloatArray:
            at[free, 0] = values
            return np.asarray(evaluate_closure(mechanism, at).residual[:, 0])

        def jacobian(values: FloatArray, at: FloatArray = at) -> FloatArray:
            at[free, 0] = values
            return np.asarray(evaluate_closure(mechanism, at).jacobian[:, free, 0])

        how: Any = jacobian if slopes else "2-point"
        found = least_squares(residual, start[free], jac=how, method="lm", xtol=1e-14, ftol=1e-14, gtol=1e-14)
        largest = max(largest, float(np.abs(found.fun * mechanism.row_scales).max()))
    return largest


def batches(count: int, solves: int) -> tuple[list[str], list[Bound]]:
    """Return the table of RCCC, and what is held."""
    mechanism = build_mechanism(load_network("rccc"))
    x = turned(mechanism, solves)
    few = x[:, :: max(1, solves // ALONE)][:, :ALONE]
    single = few.shape[1]
    jobs: dict[str, tuple[int, Callable[[], float]]] = {
        "urmpipe, side by side": (
            solves,
            lambda: float(solve_closure(mechanism, x, mechanism.free).gap.max()),
        ),
        "urmpipe, one by one": (
            single,
            lambda: max(
                float(solve_closure(mechanism, one[:, None], mechanism.free).gap[0]) for one in few.T
            ),
        ),
        "SciPy with urmpipe's Jacobian, one by one": (single, lambda: alone(mechanism, few, slopes=True)),
        "SciPy by differences, one by one": (single, lambda: alone(mechanism, few, slopes=False)),
    }
    gaps = {name: job() for name, (_, job) in jobs.items()}
    taken: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(count):
        for name, (of, job) in jobs.items():
            taken[name].append(timed(job) / of)
    base = taken["urmpipe, side by side"]
    lines = [
        f"RCCC, a loop of one revolute and three cylindrical joints, at {solves} values of its control from 0"
        f" to 2 π, all from the start of the file; one by one at {single} of them. Gaps are in lengths of the"
        " mechanism and rad.",
        "",
        "| job | ms a solve, median (min-max) | solves a second | largest gap"
        " | times side by side, median of pairs |",
        "|---|---|---|---|---|",
    ]
    for name, seconds in taken.items():
        ratio = statistics.median(a / b for a, b in zip(seconds, base, strict=True))
        each = 1.0 / statistics.median(seconds)
        lines.append(f"| {name} | {milliseconds(seconds)} | {each:.0f} | {gaps[name]:.0e} | {ratio:.1f} |")
    closed = int((solve_closure(mechanism, x, mechanism.free).gap < CLOSED).sum())
    return lines, [
        Bound("RCCC: solves a second, side by side", 1.0 / statistics.median(base), least=2000.0),
        Bound(f"RCCC: assembled of {solves}", closed, least=solves),
    ]


def searched(mechanism: Mechanism, seed: int) -> Searched:
    """Return what urmpipe finds of a platform."""
    start = time.perf_counter()
    found = assemble(mechanism, find_all=True, seed=seed)
    return Searched(len(found.assemblies), found.start_count, time.perf_counter() - start)


def by_script(mechanism: Mechanism, seed: int, starts: int, box: float) -> Searched:
    """Return what a script finds of a platform from random starts, at most so many, and for so many seconds.

    Its residual is |g + R p - b| - d of the legs, in [m].
    """
    elements = mechanism.network.elements
    base, plate = (np.array([one.points[k] for one in elements]) for k in (0, 1))
    lengths = np.array([float(one.length.value({})) for one in elements])
    rng, kept = np.random.default_rng(seed), np.empty((0, 12))

    def residual(pose: FloatArray) -> FloatArray:
        points = pose[:3] + Rotation.from_rotvec(pose[3:]).apply(plate)
        return np.asarray(np.linalg.norm(points - base, axis=1) - lengths)

    begun, tried = time.perf_counter(), 0
    while tried < starts and time.perf_counter() - begun < box:
        tried += 1
        vector = Rotation.random(random_state=rng).as_rotvec()
        pose = np.concatenate((mechanism.start[:3] + mechanism.length * rng.normal(size=3), vector))
        found = least_squares(residual, pose, method="lm", xtol=1e-14, ftol=1e-14, gtol=1e-14)
        if np.abs(found.fun).max() < CLOSED:
            place = np.concatenate((found.x[:3], Rotation.from_rotvec(found.x[3:]).as_matrix().ravel()))
            if not (np.abs(kept - place).max(axis=1) < SAME).any():
                kept = np.vstack((kept, place))
    return Searched(len(kept), tried, time.perf_counter() - begun)


def platforms(seeds: int, box: float) -> tuple[list[str], list[Bound]]:
    """Return the table of the Stewart-Gough platform, and what is held."""
    mechanism = build_mechanism(load_network("stewart-gough"))
    lines = [
        f"All assemblies of Dietmaier's Stewart-Gough platform, which has {POSTURES}. The script takes as"
        f" many random starts as urmpipe, and {box:g} s at most.",
        "",
        "| seed | found, urmpipe | starts | s | found, script | starts | s |",
        "|---|---|---|---|---|---|---|",
    ]
    own = []
    for seed in range(seeds):
        own.append(searched(mechanism, seed))
        other = by_script(mechanism, seed, own[-1].tried, box)
        cells = (f"{one.found} | {one.tried} | {one.seconds:.2f}" for one in (own[-1], other))
        lines.append(f"| {seed} | {' | '.join(cells)} |")
    return lines, [
        Bound("Stewart-Gough: fewest assemblies of all seeds", min(one.found for one in own), least=POSTURES),
        Bound("Stewart-Gough: longest search, s", max(one.seconds for one in own), under=30.0),
    ]


def hexapod_rows(mechanism: Mechanism, rows: int) -> tuple[FloatArray, FloatArray]:
    """Return poses x, y, z [m] and rotation vector [rad], and leg lengths [m], 5 ms apart, shape (rows, 6).

    Sums of four sines of 0.05 to 0.5 Hz, with amplitudes of 30 mm and 0.1 rad.
    """
    rng, t = np.random.default_rng(0), 0.005 * np.arange(rows)
    sizes = np.repeat([0.03, 0.1], 3) / 4.0
    frequencies, phases = rng.uniform(0.05, 0.5, (4, 6)), rng.uniform(0.0, 2.0 * np.pi, (4, 6))
    waves = np.sin(2.0 * np.pi * frequencies * t[:, None, None] + phases) - np.sin(phases)
    pose = assemble(mechanism).x[6:, 0] + sizes * waves.sum(axis=1)
    base, plate = (np.array([one.points[k] for one in mechanism.network.elements]) for k in (0, 1))
    turned = np.einsum("nij,kj->nki", Rotation.from_rotvec(pose[:, 3:]).as_matrix(), plate)
    return pose, np.linalg.norm(pose[:, None, :3] + turned - base, axis=2)


def motions(rows: int, few: int = 2000) -> tuple[list[str], list[Bound]]:
    """Return the results for a hexapod that a log drives, and their bounds."""
    network = load_network("stewart-gough-driven")
    mechanism = build_mechanism(network)
    pose, lengths = hexapod_rows(mechanism, rows)
    table = pd.DataFrame(lengths, columns=[f"leg{k + 1} (m)" for k in range(6)])
    table.insert(0, "t (s)", 0.005 * np.arange(rows))
    begun = time.perf_counter()
    motion = urmpipe.network_drive(network, log=table)
    whole = time.perf_counter() - begun
    apart = float(np.abs(motion.x[:, 6:] - pose).max())
    begun = time.perf_counter()
    solved = drive_rows(
        mechanism, assemble(mechanism).x[:, 0], find_driven_variables(mechanism, motion.joints), lengths
    )
    alone_s = time.perf_counter() - begun
    base, plate = (np.array([one.points[k] for one in mechanism.network.elements]) for k in (0, 1))
    found, largest, begun = pose[0], 0.0, time.perf_counter()
    for row in range(few):

        def residual(x: FloatArray, row: int = row) -> FloatArray:
            points = x[:3] + Rotation.from_rotvec(x[3:]).apply(plate)
            return np.asarray(np.linalg.norm(points - base, axis=1) - lengths[row])

        found = least_squares(residual, found, method="lm", xtol=1e-14, ftol=1e-14, gtol=1e-14).x
        largest = max(largest, float(np.abs(found - pose[row]).max()))
    script = (time.perf_counter() - begun) / few
    lines = [
        f"Forward kinematics of `stewart-gough-driven` along {rows} rows, 5 ms apart: legs by the inverse in"
        f" closed form of sums of sines. The script solves {few} rows, each from the one before.",
        "",
        "| job | s | us a row | largest error, m and rad |",
        "|---|---|---|---|",
        f"| `urmpipe.network_drive` of a table: reading, motion, rates, accelerations | {whole:.1f}"
        f" | {1e6 * whole / rows:.1f} | {apart:.0e} |",
        f"| the motion alone | {alone_s:.1f} | {1e6 * alone_s / rows:.1f}"
        f" | {float(np.abs(solved.x[6:].T - pose).max()):.0e} |",
        f"| SciPy's least_squares | {script * rows:.0f} (by {few} rows) | {1e6 * script:.1f}"
        f" | {largest:.0e} |",
        "",
        "A full turn of the control at 1000 values, from the file's start, with rates and accelerations:",
        "",
        "| network | s |",
        "|---|---|",
    ]
    for name, control in TURNED.items():
        turn = timed(partial(urmpipe.network_drive, name, {control: (0.0, TURN)}, steps=999))
        lines.append(f"| {name} | {turn:.2f} |")
    return lines, [
        Bound(f"hexapod: {rows} rows of a log, s", whole, under=60.0),
        Bound("hexapod: largest error, m and rad", apart, under=1e-9),
    ]


def counts(count: int) -> list[str]:
    """Return the table of mobilities."""
    lines = [
        "| network | variables | rank | mobility | Kutzbach | redundant | idle spins | mobility alone, ms,"
        " median (min-max) |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in COUNTED:
        mechanism = build_mechanism(load_network(name))
        x = assemble(mechanism).x_nearest
        moves = analyse_mobility(mechanism, x)
        taken = [timed(lambda at=x, one=mechanism: analyse_mobility(one, at)) for _ in range(count)]  # type: ignore[misc]
        lines.append(
            f"| {name} | {moves.variables} | {moves.rank} | {moves.mobility} | {moves.kutzbach}"
            f" | {len(moves.redundant)} | {', '.join(moves.passive)} | {milliseconds(taken)} |"
        )
    return lines


def commands(count: int) -> list[str]:
    """Return the table of whole commands."""
    network = [sys.executable, "-m", "urmpipe", "network"]
    told = (
        "list", "check four-bar", "solve four-bar --all", "solve stewart-gough --all",
        "drive four-bar crank=0:360deg",
    )  # fmt: skip
    taken = rounds({one: [*network, *one.split()] for one in told}, count)
    lines = ["| urmpipe network | wall s, median (min-max) | CPU s | MB |", "|---|---|---|---|"]
    for name, usages in taken.items():
        walls = [one.wall for one in usages]
        cpu, rss = (statistics.median(getattr(one, key) for one in usages) for key in ("cpu", "rss"))
        span = f"{statistics.median(walls):.2f} ({min(walls):.2f}-{max(walls):.2f})"
        lines.append(f"| `{name}` | {span} | {cpu:.2f} | {rss:.0f} |")
    return lines


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--solves", type=int, default=1000)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--box", type=float, default=10.0)
    parser.add_argument("--rows", type=int, default=360_000)
    options = parser.parse_args()
    of_batches = batches(options.rounds, options.solves)
    of_platforms = platforms(options.seeds, options.box)
    of_motions = motions(options.rows)
    lines = [
        f"# Kinematic networks: {options.rounds} rounds in turn",
        "",
        *machine("scipy"),
        *of_batches[0],
        "",
        *of_platforms[0],
        "",
        *of_motions[0],
        "",
        *counts(options.rounds),
        "",
        *commands(options.rounds),
    ]
    write_results("networks", lines, [*of_batches[1], *of_platforms[1], *of_motions[1]])


main()
