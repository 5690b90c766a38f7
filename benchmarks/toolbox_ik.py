"""Iterative inverse kinematics of urm6 by roboticstoolbox, in its own environment: see inverse_iterative.py.

OTHER/bin/python benchmarks/toolbox_ik.py GIVEN.npz RESTARTS TOLERANCE
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from roboticstoolbox import ET

LENGTHS = (0.243215, 0.212430, 0.212430, 0.212430, 0.212430, 0.212430, 0.042215)
TILT = 52.0


def main() -> None:
    """Solve the targets of a file one by one; print the seconds, write the joint values beside the file."""
    file, restarts, tolerance = Path(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
    given = np.load(file)
    arm = ET.Rz() * ET.tz(LENGTHS[0])
    for length in LENGTHS[1:-1]:
        arm = arm * ET.Ry(TILT, "deg") * ET.Rz() * ET.tz(length)
    arm = arm * ET.Ry(TILT, "deg") * ET.tz(LENGTHS[-1])
    error = 0.5 * tolerance**2  # E = e^T e / 2 <= tol, e in m and rad
    seconds = []
    for name, searches, k in (("near", 1, 0.01), ("random", restarts + 1, 0.1)):
        found = np.empty_like(given[name])
        begin = time.perf_counter()
        for i, (target, start) in enumerate(zip(given["targets"], given[name], strict=True)):
            solution = arm.ik_LM(target, start, 100, searches, error, joint_limits=False, k=k, method="chan")
            found[i] = solution.q
        seconds.append(time.perf_counter() - begin)
        np.save(file.with_suffix(f".{name}.npy"), found)
    print(*seconds)


main()
