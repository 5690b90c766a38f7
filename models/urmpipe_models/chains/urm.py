"""URM arms: universal rotational modules, one on the other, each tilted against the one before."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_models.elementwise import Element
from urmpipe_models.errors import RobotError
from urmpipe_models.transform import Step, made_of

SEGMENT, TILT = "URM segment", "URM tilt"
"""The sources of an arm's parameters."""


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
    *segments, end = (Step("along", "z", r, f"r{k}", SEGMENT) for k, r in enumerate(lengths, start=1))
    turned = (Step("about", "y", tilt, f"theta{k}", TILT) for k, tilt in enumerate(tilts, start=2))
    origins = [made_of(), *map(made_of, segments, turned)]
    joints = [
        Joint(f"phi{k}", "revolute", origin, (0.0, 0.0, float(turn)))
        for k, (origin, turn) in enumerate(zip(origins, turns, strict=False), start=1)
    ]
    effector = Joint("effector", "fixed", origins[-1])
    return Chain(
        name,
        (*joints, effector),
        tip=made_of(end),
        start=tuple(float(value) for value in start),
        description=description,
        source=source,
    )
