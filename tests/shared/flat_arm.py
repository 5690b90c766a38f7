"""An arm of two joints with masses and drives, whose accuracy is soon found without a compiler."""

from __future__ import annotations

from pathlib import Path

ARM = """
name = "flat"
kind = "joints"
start = [0.5, 1.0]
tip = { steps = [{ along = "x", value = 0.4 }] }

[[joints]]
name = "a"

[[joints]]
name = "b"
origin = { steps = [{ along = "x", value = 0.5 }] }
"""

MASSES = "".join(
    f"""
[[inertials]]
joint = "{joint}"
mass = 2.0
centre = [0.2, 0, 0]
inertia = [0.01, 0.05, 0.05, 0, 0, 0]
source = "made up"
"""
    for joint in "ab"
)


def drive(joint: str, gain: float = 7.5) -> str:
    """Return the drive of a joint."""
    return (
        f"\n[drives.{joint}]\nk = 2500.0\nl = 5.0\ni_p = 100\nC = 0.05\nR = 0.5\nL = 0.001\nI1 = 0.5\n"
        f"period = 0.005\nKphi = {gain}\nKw = 0.75\nKeps = 0.01\nu_max = 48.0\n"
    )


def lay_flat_arm(folder: Path) -> None:
    """Write the arm, and a path of half a millimetre."""
    (folder / "short.csv").write_text("x,y,z\n0.5,0.5,0\n0.5,0.4995,0\n")
    (folder / "arm.toml").write_text(ARM + MASSES + drive("a") + drive("b"))
