"""The warnings of inverse kinematics: singular poses, nearest points, units that are hardly meant."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray, row_norms
from urmpipe_models.errors import Hint
from urmpipe_models.ik.path import JointPath
from urmpipe_models.ik.solutions import Solutions, Targets
from urmpipe_models.kinematics.singularity import NEAR_SINGULAR, singularity_over_log
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.text import format_rounded, format_rows

MILLI = 1e-3
"""A target in mm that is read as m is a thousand times too far."""

FAR = 10.0
"""A target so many times farther than the arm reaches is no slip of the path, but may be one of the unit."""


ROUNDING = 1e-9
"""In [rad]: pi written and read is no angle beyond pi."""

MANY_TURNS = 4.0 * np.pi
"""Joint values beyond two turns in [rad] are hardly meant: they may be in deg."""


def singular_warnings(solutions: Solutions, row: IntArray, listed: BoolArray) -> Iterator[LogWarning]:
    """Yield one warning for each family of singular poses: what is infinite there, and what was chosen.

    Args:
        solutions: What was found.
        row: Data row of each target, shape (n,).
        listed: True of the solutions that a person is shown, shape (n, k).
    """
    for one in solutions.singular:
        rows = row[(one.where & listed & solutions.reached).any(axis=1)]
        if len(rows):
            said = f"{one.free}; chosen: {one.chosen}" if one.free else "a direction of motion is lost there"
            yield LogWarning("singular", f"{format_rows(rows)}: {one.family}: {said}")


def near_singular_warnings(
    chain: Chain, solutions: Solutions, row: IntArray, listed: BoolArray, *, orientation: bool
) -> Iterator[LogWarning]:
    """Yield a warning of solutions that are singular or nearly so, and lie in no family that has a name.

    A wrist that is aligned but for the digits of a file lies in none: nothing is infinite there, and yet
    the last of those digits turns joints far.

    Args:
        chain: The arm.
        solutions: What was found.
        row: Data row of each target, shape (n,).
        listed: True of the solutions that a person is shown, shape (n, k).
        orientation: Whether poses were asked for; False of positions.
    """
    named = np.zeros_like(solutions.reached)
    for one in solutions.singular:
        named |= one.where
    asked = listed & solutions.reached & ~named & (solutions.position_residual == 0.0)
    smallest = np.full(asked.shape, np.inf)
    if asked.any():
        smallest[asked] = singularity_over_log(chain, solutions.q[asked], orientation=orientation).smallest
    least = smallest.min(axis=1)
    near = least < NEAR_SINGULAR
    if near.any():
        worst = int(np.argmin(least))
        where = f" in row {row[worst]}" if near.sum() > 1 else ""
        said = (
            f"{format_rows(row[near])}: singular or nearly so: smallest singular value {least[worst]:.2g}"
            f"{where}; the least change of the target may turn joints far"
        )
        yield LogWarning("near-singular", said)


def start_warnings(chain: Chain, start: FloatArray | None, parameter: str = "start") -> Iterator[LogWarning]:
    """Yield a warning of a pose that is hardly in rad.

    Args:
        chain: The arm.
        start: The pose in [rad] or [m], shape (joints,).
        parameter: The keyword by which it was given.
    """
    if start is None:
        return
    found = [
        f"{joint.name} = {value:g} rad ({np.degrees(value):.6g} deg)"
        for joint, value in zip(chain.moving, start.tolist(), strict=True)
        if joint.kind == "revolute" and abs(value) > MANY_TURNS
    ]
    if found:
        said = "these values look like degrees"
        told = ", ".join(found)
        yield LogWarning("start-unit", said, parameter=parameter, found=told, allowed="rad")


def within_pi_warnings(chain: Chain, q: FloatArray) -> Iterator[LogWarning]:
    """Yield a warning of joints that have limits and go beyond pi: q in [rad] or [m], shape (..., joints)."""
    values = np.abs(q.reshape(-1, q.shape[-1]))
    furthest = np.where(np.isfinite(values), values, 0.0).max(axis=0, initial=0.0)
    found = [
        f"{joint.name} goes to {np.degrees(most):.6g} deg"
        for joint, most in zip(chain.moving, furthest.tolist(), strict=True)
        if joint.kind == "revolute" and most > np.pi + ROUNDING
    ]
    if found:
        said = f"{', '.join(found)}: it is for joints without limits; a joint with limits stays"
        yield LogWarning("beyond-pi", said, parameter="within_pi")


def shortfall_warnings(solutions: Solutions, row: IntArray) -> Iterator[LogWarning]:
    """Yield a warning of the targets in data rows `row`, shape (n,), that the tool only comes near to."""
    short = np.asarray(np.where(solutions.reached, solutions.position_residual, 0.0)).max(axis=1)
    if short.any():
        worst = int(np.argmax(short))
        said = (
            f"{format_rows(row[short > 0.0])}: out of reach, the nearest point within the tolerance is taken:"
            f" up to {1e3 * short[worst]:.4g} mm away, in row {row[worst]}"
        )
        yield LogWarning("nearest-point", said)


def far_warnings(
    chain: Chain, targets: Targets, row: IntArray, reached: BoolArray, *, of_file: bool
) -> Iterator[LogWarning]:
    """Yield a warning of targets that are far out of reach, and would not be if they were in mm.

    Args:
        chain: The arm.
        targets: What was asked for.
        row: Data row of each, shape (n,).
        reached: True of those that have a solution, shape (n,).
        of_file: Whether a file holds them, of which one may say the unit.
    """
    reach = longest(chain)
    away = row_norms(targets.position - np.asarray(chain.base.translation, dtype=float))
    with np.errstate(invalid="ignore"):
        far = ~reached & (away > FAR * reach) & (MILLI * away <= reach)
    if far.any():
        said = (
            f"{format_rows(row[far])}: up to {away[far].max():.6g} m from the base, while {chain.name}"
            f" reaches no farther than {reach:.4g} m: they may be in mm"
        )
        hints = (Hint("unit", {"": "mm"}, "applies this"),) if of_file else ()
        yield LogWarning("too-far", said, allowed="m", hints=hints)


def longest(chain: Chain) -> float:
    """Return what the tool centre point is away from the base at most, in [m]: all lengths in one line."""
    frames = [*(joint.origin for joint in chain.joints), chain.tip, chain.tool]
    slides = [max(abs(joint.lower), abs(joint.upper)) for joint in chain.moving if joint.kind == "prismatic"]
    return float(sum(np.linalg.norm(frame.translation) for frame in frames)) + sum(slides)


def path_warnings(path: JointPath) -> Iterator[LogWarning]:
    """Yield why no arm can follow the joint values along a path: its jumps, and joints that are too fast."""
    if path.jumps:
        first = path.jumps[0]
        steps = ", ".join(f"{one.joint} by {format_rounded(one.step, one.unit)}" for one in first.joints)
        yield LogWarning("jump", _first_of(len(path.jumps), "jump", steps), first.sample + 1)
    if path.speed_violations:
        one = path.speed_violations[0]
        speed, limit = format_rounded(one.speed, one.unit), format_rounded(one.allowed, one.unit)
        said = f"{one.joint} at {speed} of {limit} allowed"
        count = len({one.joint for one in path.speed_violations})
        yield LogWarning("joint-too-fast", _first_of(count, "joint", said, " too fast"), one.first + 1)


def unreached_warnings(reasons: Sequence[str | None]) -> Iterator[LogWarning]:
    """Yield how many targets have no solution, and why the first has none."""
    missed = [(row, reason) for row, reason in enumerate(reasons, start=1) if reason is not None]
    if missed:
        (row, reason), *others = missed
        here = ", here the first" if others else ""
        why = f": {reason.split('; ')[0]}" if reason else ""
        said = f"no solution for {len(missed)} of {len(reasons)} targets{here}{why}"
        yield LogWarning("unreachable", said, row)


def _first_of(count: int, noun: str, first: str, more: str = "") -> str:
    """Return how many there are, and the first: "2 joints too fast, here the first: ..."."""
    return f"{format_count(count, noun)}{more}{', here the first' if count > 1 else ''}: {first}"
