"""Forward kinematics of 1e6 urm6 poses against Pinocchio's Python loop, in one process, on one thread.

python benchmarks/kinematics.py [--poses N] [--rounds N]
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np
import pinocchio as pin
from pairs import Bound, machine, write_results

from urmpipe_models.arm.chain import Chain
from urmpipe_models.kinematics.forward import poses_over_log, positions_over_log
from urmpipe_models.math3d import Transform
from urmpipe_models.robots.catalogue import load_robot

TRIES = 3


def placement(frame: Transform) -> pin.SE3:
    """Return a constant frame as Pinocchio's."""
    return pin.SE3(np.array(frame.rotation, dtype=float), np.array(frame.translation, dtype=float))


def peer_model(chain: Chain) -> tuple[pin.Model, int]:
    """Return Pinocchio's model of a chain of revolute joints about z, and its tip frame."""
    model = pin.Model()
    parent, frame = 0, pin.SE3.Identity()
    for joint in chain.joints:
        frame = frame * placement(joint.origin)
        if joint.kind == "revolute":
            parent = model.addJoint(parent, pin.JointModelRZ(), frame, joint.name)
            frame = pin.SE3.Identity()
    tip = pin.Frame("tip", parent, 0, frame * placement(chain.tip), pin.FrameType.OP_FRAME)
    return model, model.addFrame(tip)


def cpu_seconds(job: Callable[[], object]) -> float:
    """Return the time in [s] that all threads of this process compute for a job."""
    start = time.process_time()
    job()
    return time.process_time() - start


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    chain = load_robot("urm6")
    model, tip = peer_model(chain)
    data = model.createData()
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (options.poses, 6))
    position, rotation = np.empty((len(q), 3)), np.empty((len(q), 3, 3))

    def bare() -> None:
        for row in q:
            pin.forwardKinematics(model, data, row)

    def stored() -> None:
        for i, row in enumerate(q):
            pin.forwardKinematics(model, data, row)
            pose = pin.updateFramePlacement(model, data, tip)
            position[i], rotation[i] = pose.translation, pose.rotation

    jobs: dict[str, Callable[[], object]] = {
        "urmpipe poses_over_log": lambda: poses_over_log(chain, q),
        "urmpipe positions_over_log": lambda: positions_over_log(chain, q),
        "Pinocchio loop, poses stored": stored,
        "Pinocchio loop, poses computed and dropped": bare,
    }
    taken: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(options.rounds):
        for name, job in jobs.items():
            taken[name].append(min(cpu_seconds(job) for _ in range(TRIES)))
    pairs = zip(poses_over_log(chain, q), (position, rotation), strict=True)
    error = max(np.abs(mine - peers).max() for mine, peers in pairs)
    lines = [
        f"# Forward kinematics of {options.poses} urm6 poses: {options.rounds} rounds in turn, one thread",
        "",
        *machine("pin"),
        "Seconds are CPU time, all threads of the process together: other programs use the machine as well.",
        f"Of each job the shortest of {TRIES} runs in a row counts in a round: memory that was not in use",
        "for a while is slow at first here, and not every job needs much of it.",
        f"Largest difference between the two, position [m] and rotation: {error:.1e}.",
        "",
        "| job | CPU s, median (min-max) | thousand poses a second | times urmpipe's, median of pairs |",
        "|---|---|---|---|",
    ]
    ratios: dict[str, float] = {}
    for name, seconds in taken.items():
        middle = statistics.median(seconds)
        ratios[name] = statistics.median(
            a / b for a, b in zip(seconds, taken["urmpipe poses_over_log"], strict=True)
        )
        span = f"{middle:.3f} ({min(seconds):.3f}-{max(seconds):.3f})"
        lines.append(f"| {name} | {span} | {options.poses / middle / 1e3:.0f} | {ratios[name]:.2f} |")
    bare_loop = ratios["Pinocchio loop, poses computed and dropped"]
    positions = bare_loop / ratios["urmpipe positions_over_log"]
    write_results(
        "kinematics",
        lines,
        [
            Bound("Pinocchio's bare loop / urmpipe's poses", bare_loop, least=3.3),
            Bound("Pinocchio's bare loop / urmpipe's positions", positions, least=5.0),
        ],
    )


if __name__ == "__main__":
    main()
