"""How far an arm can reach at most, by the lengths of its links alone: what lies beyond needs no search."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from urmpipe_models.chains.chain import Chain
from urmpipe_models.inverse.targets import Targets
from urmpipe_models.row_blocks import norms

SURE = 1e-3
"""A target is too far if it is by more than this, in [m]: the edge of the reach is left to the search."""


def farthest(chain: Chain) -> float:
    """Return what the tool centre point can be away from the first joint's frame at most, in [m].

    It is the sum of the offsets from frame to frame, and of what each prismatic joint can add: no posture
    is longer. Limits of revolute joints are not asked, so that few arms get there.
    """
    offsets = [joint.origin.translation for joint in chain.joints[1:]]
    offsets += [chain.tip.translation, chain.tool.translation]
    return sum(math.hypot(*offset) for offset in offsets) + sum(_strokes(chain))


def too_far(chain: Chain, targets: Targets, tolerance: float | None) -> list[str]:
    """Return why targets are out of any posture's reach, one text each; empty where they may be in it.

    Args:
        chain: The arm.
        targets: n of them; one that is not finite has no reason here.
        tolerance: In [m] along each axis, of targets that the tool need only come near to.
    """
    most = farthest(chain)
    first = (chain.base @ chain.joints[0].origin).translation
    away = norms(targets.position - np.array(first))
    reasons = [""] * len(targets)
    for row in np.flatnonzero(away > most + SURE + math.sqrt(3.0) * (tolerance or 0.0)).tolist():
        reasons[row] = f"the target is {away[row]:.3f} m from the first joint, allowed: {most:.3f} m at most"
    return reasons


def _strokes(chain: Chain) -> Iterator[float]:
    """Yield what each prismatic joint can add at most, in [m]."""
    coordinates = {joint.name: joint for joint in chain.moving}
    for joint in chain.joints:
        if joint.kind == "prismatic" and joint.mimic is None:
            yield max(abs(joint.lower), abs(joint.upper))
        elif joint.kind == "prismatic" and joint.mimic is not None:
            led = coordinates[joint.mimic.joint]
            ends = (joint.mimic.multiplier * end + joint.mimic.offset for end in (led.lower, led.upper))
            yield max(map(abs, ends))
