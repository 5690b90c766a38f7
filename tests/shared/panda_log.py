"""A smooth motion of the Panda, and its URDF with masses and efforts."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.robots.urdf import read_urdf

URDF = Path("robots", "Gepetto_example-robot-data", "panda.urdf")
"""The file in the folder `shared`."""


def panda(shared: Path) -> Chain:
    """The arm of the URDF, without its fingers."""
    return read_urdf(shared / URDF, tip_link="panda_hand_tcp")


def motion(t: FloatArray, pace: float = 1.0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return q, q' and q'' of seven joints that swing, shape (n, 7) each; pace 1 is within all efforts."""
    middle = np.array([0.0, 0.2, 0.0, -1.6, 0.0, 1.8, 0.3])
    sway = np.array([0.9, 0.6, 0.7, 0.5, 0.9, 0.6, 1.2])
    omega = 2.0 * np.pi * pace * np.array([0.25, 0.35, 0.3, 0.4, 0.5, 0.45, 0.6])
    phase = np.outer(t, omega) + 0.7 * np.arange(7)
    return (
        middle + sway * np.sin(phase),
        sway * omega * np.cos(phase),
        -sway * omega**2 * np.sin(phase),
    )


def panda_csv(folder: Path, names: tuple[str, ...], pace: float = 1.0, form: str = "%.12f") -> Path:
    """Write 801 rows of the motion, 5 ms apart."""
    t = 0.005 * np.arange(801, dtype=np.float64)
    path = folder / "panda.csv"
    header = ",".join(("t [s]", *(f"{name} [rad]" for name in names)))
    table = np.column_stack((t, motion(t, pace)[0]))
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt=["%.3f", *[form] * len(names)])
    return path
