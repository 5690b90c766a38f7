"""URM arms: universal rotational modules, one on the other, each tilted against the one before."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_models.elementwise import Element
from urmpipe_models.errors import RobotError
from urmpipe_models.transform import Transform, rotation_y, translation

ROUNDING = 1e-15
"""Entries of frames of about 1 are the same if they differ by no more than rounding."""


def urm_chain(
    name: str,
    lengths: Sequence[Element],
    tilts: Sequence[Element],
    *,
    directions: Sequence[float] = (),
    start: Sequence[float] = (),
    description: str = "",
    source: str = "",
) -> Chain:
    """Return the chain of n modules: n + 1 segments r_i, n tilts theta_2..theta_{n+1}, n joints about z.

    p_{i+1} = Rz1 [r_1 + sum_k prod_j (Ry_{j+1}(theta_{j+1}) Rz_{j+1}(phi_{j+1})) r_{k+1}]; the last segment
    is the effector, tilted but not turned (there is no Rz_{n+1}).

    Args:
        name: The robot's name.
        lengths: r_1..r_{n+1} in [m], any elements.
        tilts: theta_2..theta_{n+1} in [rad], any elements.
        directions: +1 or -1 a module; -1 for one that counter-rotates.
        start: Calibration pose phi(0) in [rad].
        description: One line for people.
        source: Where the numbers come from.

    Raises:
        RobotError: If the counts do not fit each other.

    Source: [UrmArm2021]_ eq. 1-8, Figure 1.
    """
    modules = len(tilts)
    if len(lengths) != modules + 1 or modules < 1:
        raise RobotError(
            f"robot {name}: {len(lengths)} lengths and {modules} tilts; n modules need"
            " n + 1 lengths and n tilts"
        )
    turns = tuple(directions) or (1,) * modules
    if len(turns) != modules or any(turn not in (1, -1) for turn in turns):
        raise RobotError(f"robot {name}: directions {list(turns)}; allowed: {modules} values, each 1 or -1")
    origins = [Transform()] + [
        translation(0.0, 0.0, length) @ rotation_y(tilt)
        for length, tilt in zip(lengths[:-1], tilts, strict=True)
    ]
    joints = [
        Joint(f"phi{k}", "revolute", origin, (0.0, 0.0, float(turn)))
        for k, (origin, turn) in enumerate(zip(origins, turns, strict=False), start=1)
    ]
    effector = Joint("effector", "fixed", origins[-1])
    return Chain(
        name,
        (*joints, effector),
        tip=translation(0.0, 0.0, lengths[-1]),
        start=tuple(float(value) for value in start),
        description=description,
        source=source,
    )


class UrmGeometry(NamedTuple):
    """What `urm_chain` makes an arm from.

    Attributes:
        lengths: r_1..r_{n+1} in [m].
        tilts: theta_2..theta_{n+1} in [rad], within (-pi, pi].
        directions: +1 or -1 a module.
    """

    lengths: tuple[float, ...]
    tilts: tuple[float, ...]
    directions: tuple[float, ...]


def urm_geometry(chain: Chain) -> UrmGeometry | None:
    """Return what a URM arm is made from, on whatever base and with whatever tool; None of any other arm."""
    modules, links = chain.joints[:-1], chain.joints[1:]
    found = UrmGeometry(
        (*(link.origin.translation[2] for link in links), chain.tip.translation[2]),
        tuple(_tilt(link.origin) for link in links),
        tuple(module.axis[2] for module in modules),
    )
    if not modules or any(direction not in (1.0, -1.0) for direction in found.directions):
        return None
    again = urm_chain(chain.name, found.lengths, found.tilts, directions=found.directions)
    same = _near(chain.tip, again.tip) and all(
        (joint.kind, joint.mimic) == (other.kind, other.mimic)
        and (joint.kind == "fixed" or joint.axis == other.axis)
        and _near(joint.origin, other.origin)
        for joint, other in zip(chain.joints, again.joints, strict=True)
    )
    return found if same else None


def _tilt(origin: Transform) -> float:
    """Return by how much a frame is turned about y, in [rad]: half a turn is pi, whatever rounding left."""
    tilt = math.atan2(origin.rotation[0][2], origin.rotation[0][0])
    return math.pi if tilt == -math.pi else tilt


def _near(one: Transform, other: Transform) -> bool:
    """Return whether two constant frames are the same but for rounding."""
    pairs = zip((*one.rotation, one.translation), (*other.rotation, other.translation), strict=True)
    return all(abs(a - b) <= ROUNDING for rows in pairs for a, b in zip(*rows, strict=True))
