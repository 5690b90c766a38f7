"""Iterative inverse kinematics of urm6 against roboticstoolbox's C++ ik_LM and a loop of Pinocchio.

python benchmarks/inverse_iterative.py [--peer OTHER/bin/python] [--poses N] [--rounds N]

The same targets, the same starts, the same criterion: a target counts as met if this program's forward
kinematics says that the tool is within 1e-6 m and 1e-6 rad of it. Each solver stops at a tolerance of its own
that just holds that. roboticstoolbox runs in a process and an environment of its own (`--peer`), by
`toolbox_ik.py`, in the same rounds; what it times is the solving alone.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pairs import Bound, machine, write_results

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.numeric import refine
from urmpipe_models.ik.restarts import solve_iteratively
from urmpipe_models.ik.solutions import SearchOptions, Targets, forward_targets, pose_errors
from urmpipe_models.robots.catalogue import load_robot

OURS_NEAR = "near: urmpipe, 1 thread"
OURS_PARTS = "near: urmpipe, 1 thread, 2000 at a time"
OURS_RANDOM = "random: urmpipe"
PEER = "roboticstoolbox ik_LM (C++)"
CLOSED_LOOP = "near: Pinocchio CLIK in a Python loop"

TOLERANCE = 1e-6
"""In [m] and [rad]."""

NOISE = 0.1
"""Standard deviation of what a start near the solution is beside it, each joint, in [rad]."""

RESTARTS = 20

PART = 2000
"""Poses of a small batch, in which NumPy's calls count."""


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--peer", help="the Python of an environment that has roboticstoolbox")
    parser.add_argument("--poses", type=int, default=20_000)
    parser.add_argument("--rounds", type=int, default=5)
    compare(parser.parse_args())


@dataclass(frozen=True, slots=True)
class Problem:
    """What all solvers are given: an arm, targets, starts near to them and random ones."""

    chain: Chain
    targets: Targets
    near: FloatArray
    random: FloatArray

    def met(self, found: FloatArray) -> float:
        """Return the share of the first targets that joint values meet."""
        distance, turn = pose_errors(self.chain, found, self.targets.rows(slice(len(found))))
        within = np.linalg.norm(distance, axis=1) <= TOLERANCE
        return float((within & (np.linalg.norm(turn, axis=1) <= TOLERANCE)).mean())

    def save(self, file: Path) -> None:
        """Write targets as 4 x 4 matrices and starts for a process of its own."""
        poses = np.tile(np.eye(4), (len(self.targets), 1, 1))
        poses[:, :3, 3], poses[:, :3, :3] = self.targets.position, self.targets.rotation
        np.savez(file, targets=poses, near=self.near, random=self.random)


@dataclass(frozen=True, slots=True)
class Taken:
    """What one run took for each target in [s], and the share of targets that it met."""

    seconds: float
    met: float


def problem(count: int) -> Problem:
    """Return random reachable poses of urm6 with their starts."""
    chain = load_robot("urm6")
    rng = np.random.default_rng(0)
    q = rng.uniform(-np.pi, np.pi, (count, 6))
    near, random = q + rng.normal(0.0, NOISE, q.shape), rng.uniform(-np.pi, np.pi, q.shape)
    return Problem(chain, forward_targets(chain, q), near, random)


def our_jobs(given: Problem) -> dict[str, Callable[[], FloatArray]]:
    """Return this program's solvers."""
    chain, targets = given.chain, given.targets
    half = TOLERANCE / 2
    parts = [slice(begin, begin + PART) for begin in range(0, len(targets), PART)]

    def part(rows: slice) -> FloatArray:
        """Solve some of the targets."""
        near = given.near[rows]
        return refine(chain, targets.rows(rows), near, threads=1, metres=half, radians=half).q

    return {
        OURS_NEAR: lambda: refine(chain, targets, given.near, threads=1, metres=half, radians=half).q,
        OURS_PARTS: lambda: np.concatenate([part(rows) for rows in parts]),
        "near: urmpipe, 2 threads": lambda: (
            refine(chain, targets, given.near, threads=2, metres=half, radians=half).q
        ),
        "near: urmpipe, 1 thread, to 1e-10": lambda: refine(chain, targets, given.near, threads=1).q,
        OURS_RANDOM: lambda: solve_iteratively(
            chain, targets, start=given.random, search=SearchOptions(restarts=RESTARTS)
        ).q[:, 0],
    }


def timed(given: Problem, job: Callable[[], FloatArray]) -> Taken:
    """Return what a job took for each of the targets that it returns joint values of."""
    begin = time.perf_counter()
    found = job()
    return Taken((time.perf_counter() - begin) / len(found), given.met(found))


def toolbox_runs(given: Problem, python: str, file: Path) -> dict[str, Taken]:
    """Run roboticstoolbox in its own environment."""
    command = [
        python,
        str(Path(__file__).with_name("toolbox_ik.py")),
        str(file),
        str(RESTARTS),
        str(TOLERANCE),
    ]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return {
        f"{name}: {PEER}": Taken(
            seconds / len(given.targets), given.met(np.load(file.with_suffix(f".{name}.npy")))
        )
        for name, seconds in zip(("near", "random"), map(float, text.split()), strict=True)
    }


def compare(options: argparse.Namespace) -> None:
    """Run all solvers in turn, some rounds, and write the table."""
    given = problem(options.poses)
    jobs = our_jobs(given)
    jobs[CLOSED_LOOP] = closed_loop(given, min(options.poses, 2000))
    taken: dict[str, list[Taken]] = {}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "given.npz"
        given.save(file)
        for _ in range(options.rounds):
            runs = {name: timed(given, job) for name, job in jobs.items()}
            runs |= toolbox_runs(given, options.peer, file) if options.peer else {}
            for name, run in runs.items():
                taken.setdefault(name, []).append(run)
    write_results("inverse_iterative", table(options, taken), bounds(taken))


def table(options: argparse.Namespace, taken: dict[str, list[Taken]]) -> list[str]:
    """Return what was measured, and how."""
    lines = [
        f"# Iterative inverse of {options.poses} random urm6 poses: {options.rounds} rounds in turn",
        "",
        *machine("pin"),
        f"Met: within {TOLERANCE:g} m and {TOLERANCE:g} rad, by the same forward kinematics, urmpipe's.",
        f"Near: starts are the joint values of the target plus a normal error of {NOISE} rad a joint.",
        f"Random: uniformly random starts, then up to {RESTARTS} random ones more; there urmpipe goes on to",
        "1e-10. roboticstoolbox 1.5: the same targets and starts, tol = 0.5e-12, Chan's damping with the",
        "quickest k of 1, 0.1 and 0.01: 0.01 near, 0.1 from random starts.",
        "Pinocchio: the closed loop of its example, undamped but for 1e-12, over the first 2000 at most.",
        "",
        "| solver | us a pose, median (min-max) | thousand poses a second | met |",
        "|---|---|---|---|",
    ]
    for name, runs in sorted(taken.items()):
        each = [1e6 * run.seconds for run in runs]
        middle = statistics.median(each)
        span = f"{middle:.1f} ({min(each):.1f}-{max(each):.1f})"
        lines.append(f"| {name} | {span} | {1e3 / middle:.1f} | {runs[0].met:.4f} |")
    return lines


def bounds(taken: dict[str, list[Taken]]) -> list[Bound]:
    """Return how many times as long the peers take; each is to take longer."""
    held = []
    for mine, peer in (
        (OURS_NEAR, f"near: {PEER}"),
        (OURS_PARTS, f"near: {PEER}"),
        (OURS_NEAR, CLOSED_LOOP),
        (OURS_RANDOM, f"random: {PEER}"),
    ):
        if peer in taken:
            pairs = zip(taken[peer], taken[mine], strict=True)
            ratio = statistics.median(theirs.seconds / ours.seconds for theirs, ours in pairs)
            held.append(Bound(f"{peer} / {mine}, median of pairs", ratio, least=1.0))
    return held


def closed_loop(given: Problem, count: int) -> Callable[[], FloatArray]:
    """Return Pinocchio's closed-loop inverse as a job: dq = J^T (J J^T + 1e-12 I)^-1 log6(T^-1 T_d)."""
    import pinocchio as pin
    from kinematics import peer_model

    model, tip = peer_model(given.chain)
    data = model.createData()
    assert given.targets.rotation is not None
    poses = zip(given.targets.rotation[:count], given.targets.position[:count], strict=True)
    goals, starts = [pin.SE3(R, p) for R, p in poses], given.near[:count]

    def solved() -> FloatArray:
        """Return the joint values of all targets."""
        found = np.empty_like(starts)
        for i, (goal, start) in enumerate(zip(goals, starts, strict=True)):
            q = start.copy()
            for _ in range(100):
                pin.forwardKinematics(model, data, q)
                error = pin.log6(pin.updateFramePlacement(model, data, tip).actInv(goal)).vector
                if error @ error < (TOLERANCE / 2) ** 2:
                    break
                J = pin.computeFrameJacobian(model, data, q, tip)
                q = q + J.T @ np.linalg.solve(J @ J.T + 1e-12 * np.eye(6), error)
            found[i] = q
        return found

    return solved


if __name__ == "__main__":
    main()
