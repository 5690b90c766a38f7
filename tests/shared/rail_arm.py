"""An arm on a rail, as a URDF: one joint slides, five turn, none stands on an axis of its frame."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from urmpipe_models.arm.chain import Chain
from urmpipe_models.robots.catalogue import load_robot

_JOINTS = (
    ("rail", "prismatic", "0.1 0 0.3", "0 0 0.1", "0 1 0"),
    ("turn", "revolute", "0 0.05 0.2", "0 0 0", "0 0 1"),
    ("lift", "revolute", "0.1 0 0.15", "1.2 0 0", "0 0 1"),
    ("elbow", "revolute", "0.4 0 0.02", "0 0.2 0", "0 0 1"),
    ("roll", "revolute", "0.3 0 0", "0 1.5 0", "0 0 1"),
    ("bend", "revolute", "0 0 0.1", "-1.5 0 0", "0 0 1"),
    ("flange", "fixed", "0.08 0 0.12", "0 0.3 0", "0 0 1"),
)
"""Name, kind, place in [m], turn as roll, pitch, yaw in [rad], axis."""


@cache
def rail_arm() -> Chain:
    """Return the arm, read from its URDF."""
    links = "".join(f'<link name="link{k}"/>' for k in range(len(_JOINTS) + 1))
    joints = "".join(
        f'<joint name="{name}" type="{kind}"><parent link="link{k}"/><child link="link{k + 1}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
        '<limit lower="-6" upper="6" effort="1" velocity="3"/></joint>'
        for k, (name, kind, xyz, rpy, axis) in enumerate(_JOINTS)
    )
    with TemporaryDirectory() as folder:
        file = Path(folder) / "rail_arm.urdf"
        file.write_text(f'<robot name="rail_arm">{links}{joints}</robot>', encoding="utf-8")
        return load_robot(str(file))
