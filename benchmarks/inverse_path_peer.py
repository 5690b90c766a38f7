"""Follow a path with roboticstoolbox's ik_LM, each sample from the last one; `inverse_path.py` runs it.

python benchmarks/inverse_path_peer.py JOB.npz

JOB.npz holds `links` (the constant frames before each joint about z, and the tip's, shape
(joints + 1, 4, 4)), `poses` (n, 4, 4), `start` (joints,), `mask` (6,) and `tolerance` [m]. Prints
seconds, samples solved and the largest miss [m] as JSON.
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np
from roboticstoolbox import ET, ETS


def main() -> None:
    """Follow the path, then measure what was found."""
    job = np.load(sys.argv[1])
    parts = [part for link in job["links"][:-1] for part in (ET.SE3(link), ET.Rz())]
    arm = ETS([*parts, ET.SE3(job["links"][-1])])
    q, mask, half_square = job["start"], job["mask"], 0.5 * float(job["tolerance"]) ** 2
    found, solved = np.empty((len(job["poses"]), len(q))), 0
    begin = time.perf_counter()
    for k, pose in enumerate(job["poses"]):
        answer = arm.ik_LM(pose, q0=q, tol=half_square, mask=mask, joint_limits=False, slimit=1)
        q = found[k] = answer.q
        solved += bool(answer.success)
    seconds = time.perf_counter() - begin
    miss = np.linalg.norm(arm.eval(found)[:, :3, 3] - job["poses"][:, :3, 3], axis=1)
    print(json.dumps({"seconds": seconds, "solved": solved, "miss": float(miss.max())}))


main()
