"""What stands in space of solved targets: the arm, its further branches as ghosts, and the targets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import to_quaternions
from urmpipe_pipeline.presentation.palette import ghost_colour, run_colour
from urmpipe_pipeline.presentation.scene import Arm, Path, Scene, Targets
from urmpipe_pipeline.solved_targets.result import IkResult

SAME = 1e-9
"""Joint values nearer than this in [rad] or [m] are one solution: rounding, far below what two branches
differ by where they can be told apart."""


@dataclass(frozen=True, slots=True, eq=False)
class Ghost:
    """A branch of the solutions that brings the tool to targets as the chosen ones do.

    Attributes:
        name: The branch, such as "right, elbow up, flipped".
        q: Joint values in [rad] or [m], shape (n, joints); NaN where there is none, or the chosen one.
    """

    name: str
    q: FloatArray


def ghosts(one: IkResult) -> tuple[Ghost, ...]:
    """Return the further branches, if all solutions were requested: those with a solution of their own."""
    if one.other_branches is None:
        return ()
    turns = np.array([joint.kind == "revolute" for joint in one.robot.moving])
    found = []
    for k, name in enumerate(one.other_branches.branches):
        q = np.array(one.other_branches.q[:, k])
        away = q - one.q
        away[:, turns] -= 2.0 * np.pi * np.round(away[:, turns] / (2.0 * np.pi))
        q[(np.abs(away) <= SAME).all(axis=1)] = np.nan  # where none is chosen, `away` is NaN: it stays
        if np.isfinite(q).any():
            found.append(Ghost(name, q))
    return tuple(found)


def opening_row(one: IkResult) -> int:
    """Return the first row, from 0, at which most branches are there, the chosen one among them."""
    there = one.reached.astype(np.int64)
    for ghost in ghosts(one):
        there += np.isfinite(ghost.q).all(axis=1)
    return int(np.argmax(there))


def scene(one: IkResult) -> Scene:
    """Return the arm in its chosen solutions, the other branches, the path of its tool, and the targets."""
    beside = ghosts(one)
    branch = tuple(f"chosen: {name}" if name else "" for name in one.branch) if beside else ""
    arms = [Arm(one.robot, one.q, one.t_ns, run_colour(0), branch, vanishes=True)]
    arms += [
        Arm(one.robot, ghost.q, one.t_ns, ghost_colour(i), ghost.name, ghost=True, vanishes=True)
        for i, ghost in enumerate(beside)
    ]
    return Scene("Arm and targets [m]", tuple(arms), _paths(one), targets=_targets(one))


def _paths(one: IkResult) -> tuple[Path, ...]:
    """Return where the tool goes, of targets with times."""
    run = None if one.t_ns is None else one.as_run()
    if run is None or run.tcp is None:
        return ()
    return (Path(one.name, run.tcp.position, run.t_ns, run_colour(0), vanishes=True),)


def _targets(one: IkResult) -> Targets:
    """Return the targets, those that are not reached with the first reason why."""
    rotation = one.targets.rotation
    quat = None if rotation is None else to_quaternions(np.asarray(rotation).reshape(-1, 9), "matrix")
    reasons = tuple(
        "" if reason is None else f"row {row}: {reason.split('; ')[0]}"
        for row, reason in zip(one.row, one.reasons, strict=True)
    )
    return Targets(one.targets.position, quat, one.reached, one.t_ns, reasons)
