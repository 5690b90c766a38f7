"""Arms with masses and drives that are made up for a test: of no real robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.arm.chain import Chain, Inertial
from urmpipe_models.drives import Drive, DrivenJoint, Gains, PassiveJoint


def body(joint: str | None, rng: np.random.Generator) -> Inertial:
    """Return a body of 0.5 to 3 kg within some 0.1 m, with an inertia that a body can have."""
    spread = rng.normal(size=(3, 3))
    second = spread @ spread.T * 0.01  # positive: the integral of r r^T dm
    inertia = np.trace(second) * np.eye(3) - second
    rows, columns = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
    ixx, iyy, izz, ixy, ixz, iyz = inertia[rows, columns].tolist()
    x, y, z = (0.1 * rng.normal(size=3)).tolist()
    return Inertial(joint, float(rng.uniform(0.5, 3.0)), (x, y, z), (ixx, iyy, izz, ixy, ixz, iyz), "made up")


def with_masses(chain: Chain, seed: int = 0) -> Chain:
    """Return an arm with a body on every joint, fixed ones included, and two on the last."""
    rng = np.random.default_rng(seed)
    joints = [joint.name for joint in chain.joints]
    return replace(chain, inertials=tuple(body(joint, rng) for joint in (*joints, joints[-1])))


DRIVE = Drive(
    stiffness=2500.0, damping=5.0, ratio=100.0, constant=0.05, resistance=0.5, inductance=1e-3, inertia=0.5
)
"""The drive of `dc_drive`."""


def driven(joint: str, drive: Drive = DRIVE) -> DrivenJoint:
    """Return a drive with the controller of `drive_controller`."""
    return DrivenJoint(joint, drive, 5e-3, Gains(7.5, 0.75, 0.01), 48.0)


def with_drives(chain: Chain, held: Sequence[str] = ()) -> Chain:
    """Return an arm with a drive on every coordinate, but for those that are held by 2500 N.m/rad."""
    drives = [PassiveJoint(one, 2500.0, 5.0) if one in held else driven(one) for one in chain.coordinates]
    return replace(chain, drives=tuple(drives))
