"""Logs that benchmarks are run on."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def write_log(path: Path, rows: int) -> None:
    """Write a smooth multi-turn motion of six joints, wrapped to +-pi, at 5 ms."""
    t = 0.005 * np.arange(rows)
    rng = np.random.default_rng(11)
    q = np.column_stack(
        [
            a * np.sin(w * t + p) + s * t
            for a, w, p, s in rng.uniform((1, 0.1, 0, -0.05), (3, 0.5, 6, 0.05), (6, 4))
        ]
    )
    wrapped = q - 2.0 * np.pi * np.floor((q + np.pi) / (2.0 * np.pi))
    header = "t,q1,q2,q3,q4,q5,q6"
    np.savetxt(
        path,
        np.column_stack([t, wrapped]),
        fmt=["%.3f", *["%.7f"] * 6],
        delimiter=",",
        header=header,
        comments="",
    )
