"""Inverse kinematics along a path of 7383 samples beside roboticstoolbox's C++ ik_LM, sample by sample.

python benchmarks/inverse_path.py [--rounds N] [--peer PYTHON]

PEER is the Python of an environment with roboticstoolbox-python (default: this one).
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pairs import Bound, machine, write_results

from urmpipe_datasets import LOGS
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.path import solve_path
from urmpipe_models.ik.solutions import Targets, forward_targets, pose_errors
from urmpipe_models.math3d import Transform
from urmpipe_models.robots.catalogue import load_robot

PEER = Path(__file__).parent / "inverse_path_peer.py"
PERIOD = 5_000_000
"""5 ms in ns."""
TOLERANCE = 1e-9
"""What the peer is asked for, in [m]: what urmpipe gives."""
BENT = np.array([0.3, 0.4, -0.5, 0.7, -0.6, 0.2])
BENT_UR = np.array([0.3, -1.2, 1.4, -0.8, 1.2, 0.3])
"""Poses in [rad] that the motions of the two other arms go around."""


@dataclass(frozen=True)
class Job:
    """An arm and a path for it."""

    chain: Chain
    targets: Targets
    start: FloatArray

    @property
    def t_ns(self) -> NDArray[np.int64]:
        """Times of the samples in [ns]."""
        return PERIOD * np.arange(len(self.targets), dtype=np.int64)


def demo_path() -> Job:
    """Return the bundled path, positions only, for urm6."""
    chain = load_robot("urm6")
    position = np.loadtxt(LOGS / "path.csv", delimiter=",", skiprows=1)[:, 1:]
    return Job(chain, Targets(position), np.array(chain.start))


def motion(robot: str, around: FloatArray, samples: int) -> Job:
    """Return the poses of a smooth motion of an arm around a pose, at most 0.5 rad off."""
    rng = np.random.default_rng(2)
    t = 1e-9 * PERIOD * np.arange(samples)[:, None]
    q = around + sum(
        rng.uniform(0.1, 0.17, 6) * np.sin(rng.uniform(0.2, 0.8, 6) * t + rng.uniform(0.0, 6.0, 6))
        for _ in range(3)
    )
    chain = load_robot(robot)
    return Job(chain, forward_targets(chain, q), q[0])


def links(chain: Chain) -> FloatArray:
    """Return the constant frames before each joint, which must turn about z, and the tip's."""
    frames, frame = [], chain.base
    for joint in chain.joints:
        frame = frame @ joint.origin
        if joint.kind == "revolute":
            frames.append(matrix(frame))
            frame = Transform()
    return np.array([*frames, matrix(frame @ chain.tip @ chain.tool)])


def matrix(frame: Transform) -> FloatArray:
    """Return a constant frame as a matrix of shape (4, 4)."""
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = frame.rotation, frame.translation
    return whole


def peers_time(python: str, job: Job, folder: Path) -> dict[str, float]:
    """Return what the peer took in [s], how many samples it solved and the largest miss [m]."""
    rotation = job.targets.rotation
    poses = np.tile(np.eye(4), (len(job.targets), 1, 1))
    poses[:, :3, 3] = job.targets.position
    poses[:, :3, :3] = np.eye(3) if rotation is None else rotation
    mask = np.ones(6)
    mask[3:] = rotation is not None
    file = folder / "job.npz"
    np.savez(file, links=links(job.chain), poses=poses, start=job.start, mask=mask, tolerance=TOLERANCE)
    ran = subprocess.run([python, str(PEER), str(file)], check=True, capture_output=True, text=True)
    told: dict[str, float] = json.loads(ran.stdout)
    return told


def own_time(job: Job) -> dict[str, float]:
    """Return the same of `follow`, the whole call."""
    begin = time.perf_counter()
    path = solve_path(job.chain, job.targets, job.t_ns, start=job.start)
    seconds = time.perf_counter() - begin
    distance, _ = pose_errors(job.chain, path.q, job.targets)
    miss = float(np.nanmax(np.linalg.norm(distance, axis=1)))
    return {"seconds": seconds, "solved": int(path.reached.sum()), "miss": miss}


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--peer", default=sys.executable)
    options = parser.parse_args()
    path = demo_path()
    samples = len(path.targets)
    jobs = {
        "urm6, positions (least motion)": path,
        "ur5e, poses (closed form)": motion("ur5e", BENT_UR, samples),
        "arm6, poses (closed form)": motion("arm6", BENT, samples),
    }
    ours: dict[str, list[dict[str, float]]] = {name: [] for name in jobs}
    theirs: dict[str, list[dict[str, float]]] = {name: [] for name in jobs}
    with tempfile.TemporaryDirectory() as folder:
        for number in range(options.rounds + 1):
            for name, job in jobs.items():
                mine, other = own_time(job), peers_time(options.peer, job, Path(folder))
                if number:
                    ours[name].append(mine)
                    theirs[name].append(other)
    lines = [
        f"# Inverse kinematics along a path of {samples} samples: {options.rounds} rounds in turn",
        "",
        *machine(),
        "urmpipe: the whole call of `follow`, jumps and joint speeds included. ik_LM: the loop over the",
        f"samples alone, each from the last one's solution, one search each, asked for {TOLERANCE:g} m. The",
        "path of urm6 is the bundled one, which starts in a singular pose.",
        "",
        "| path | urmpipe s, median (min-max) | solved | miss m"
        " | ik_LM s, median (min-max) | solved | miss m | ik_LM / urmpipe, median of pairs |",
        "|---|---|---|---|---|---|---|---|",
    ]
    bounds = []
    for name, own in ours.items():
        peers = theirs[name]
        ratio = statistics.median(b["seconds"] / a["seconds"] for a, b in zip(own, peers, strict=True))
        lines.append(f"| {name} | {cells(own)} | {cells(peers)} | {ratio:.2f} |")
        bounds.append(Bound(f"{name}: s", statistics.median(one["seconds"] for one in own), under=1.0))
        bounds.append(Bound(f"{name}: solved", own[-1]["solved"], least=samples))
    write_results("inverse_path", lines, bounds)


def cells(taken: list[dict[str, float]]) -> str:
    """Return median and span of the seconds, samples solved and the largest miss as cells of a table."""
    seconds = [one["seconds"] for one in taken]
    span = f"{statistics.median(seconds):.3f} ({min(seconds):.3f}-{max(seconds):.3f})"
    return f"{span} | {taken[-1]['solved']:.0f} | {taken[-1]['miss']:.1e}"


main()
