"""The articulated 6R arm of the geometric model: three joints for the place, three about one point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from urmpipe_models.chains.chain import Chain
from urmpipe_models.chains.geometric_model import GeometricRow, geometric_chain
from urmpipe_models.elementwise import Element
from urmpipe_models.transform import Step, made_of


def articulated_6r_rows(l0: Element, l1: Element, l2: Element, l3: Element) -> tuple[GeometricRow, ...]:
    """Return the joints of the arm: about z, x, x, z, x, z, the last three through one point.

    Args:
        l0: r_1^0, height of joint 1 in [m], any element.
        l1: r_2^1, from joint 1 to joint 2 in [m].
        l2: r_3^2, the upper arm in [m].
        l3: r_4^3, the forearm in [m], to the wrist centre.

    Source: [Geometric6R]_ eq. 21-26, 39.
    """
    return (
        GeometricRow("R", "z", (0.0, 0.0, l0)),
        GeometricRow("R", "x", (0.0, 0.0, l1)),
        GeometricRow("R", "x", (0.0, 0.0, l2)),
        GeometricRow("R", "z", (0.0, 0.0, l3)),
        GeometricRow("R", "x"),
        GeometricRow("R", "z"),
    )


def articulated_6r(
    l0: Element,
    l1: Element,
    l2: Element,
    l3: Element,
    l4: Element,
    *,
    name: str = "articulated6r",
    start: Sequence[float] = (),
    description: str = "",
    source: str = "",
) -> Chain:
    """Return the articulated 6R arm; at q = 0 it stands straight up, l0 + l1 + l2 + l3 + l4 high.

    Args:
        l0: Height of joint 1 in [m], any element.
        l1: From joint 1 to joint 2 in [m].
        l2: The upper arm in [m].
        l3: The forearm in [m], to the wrist centre.
        l4: From the wrist centre to the characteristic point of the gripper in [m].
        name: The robot's name.
        start: Calibration pose q(0) in [rad].
        description: One line for people.
        source: Where the numbers come from.

    Source: [Geometric6R]_ Figure 2, eq. 21-26, 39.
    """
    rows = articulated_6r_rows(l0, l1, l2, l3)
    chain = geometric_chain(name, rows, start=start, description=description, source=source)
    lengths = enumerate((l0, l1, l2, l3, l4))
    *links, tip = (made_of(Step("along", "z", length, f"l{k}", "6R length")) for k, length in lengths)
    origins = (*links, made_of(), made_of())  # the wrist's axes meet
    joints = (replace(joint, origin=at) for joint, at in zip(chain.joints, origins, strict=True))
    return replace(chain, joints=tuple(joints), tip=tip)
