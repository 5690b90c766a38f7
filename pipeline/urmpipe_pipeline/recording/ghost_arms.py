"""The further branches of solved joint values as arms: where their links lie, and where their names stand."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.kinematics.forward import frames_over_log, points_over_log
from urmpipe_pipeline.palette import ghost_colour
from urmpipe_pipeline.recording.entities import Place, branch_entity, branch_keys, printable
from urmpipe_pipeline.recording.ghost_names import name_places, placed_names
from urmpipe_pipeline.recording.ways import Gone, thinned
from urmpipe_pipeline.runs.ghosts import Ghost
from urmpipe_pipeline.runs.results import Run

STUB = 0.1
"""Length of the piece of each joint's axis that is drawn, as a share of the arm's own reach."""


POSES = 2_000
"""Poses of a ghost that are drawn, at most, and as many at which it begins anew. Of single poses the first
are drawn: between those of every tenth, say, a ghost would stand beside an arm of another target."""


@dataclass(frozen=True, slots=True, eq=False)
class GhostArm:
    """A branch as an arm that is there at some times.

    Attributes:
        name: What the branch is called.
        entity: What it is drawn at.
        label: Where its name stands.
        colour: As #rrggbb.
        t_ns: Time of each pose drawn in integer [ns], shape (m,).
        sample: The grid sample at each, shape (m,).
        start: Where each bone starts in [m], shape (m, bones, 3): the links, then the axes of the joints.
        end: Where it ends, likewise.
        links: How many of the bones are links.
        named: Where the name stands in each pose, shape (m,): which of `name_places`.
        thin: True of every second branch. Two that differ in the turn of the wrist alone have all their links
            in common: then one is seen inside the other.
        gone: From when on there is no such solution.
    """

    name: str
    entity: str
    label: str
    colour: str
    t_ns: IntArray
    sample: IntArray
    start: FloatArray
    end: FloatArray
    links: int
    named: IntArray
    thin: bool
    gone: Gone


@dataclass(frozen=True, slots=True, eq=False)
class ArmName:
    """The name of the branch chosen, which stands at the arm itself.

    Attributes:
        t_ns: Times at which it stands elsewhere or is another in integer [ns], shape (m,).
        sample: The grid sample at each, shape (m,).
        position: Where it stands in [m], shape (m, 3).
        texts: What it says, m of them.
        gone: From when on there is no arm.
    """

    t_ns: IntArray
    sample: IntArray
    position: FloatArray
    texts: tuple[str, ...]
    gone: Gone


def ghost_arms(run: Run, place: Place, view: float = 0.0) -> tuple[tuple[GhostArm, ...], ArmName | None]:
    """Return the further branches of a run as arms, thinned out for drawing, and the name of the chosen.

    The chosen one has a name where there are others to be told from, and a solution anywhere.

    Args:
        run: A solved run.
        place: Where it stands in the recording.
        view: The diagonal of all else that is in view in [m].
    """
    if run.robot is None or not run.ghosts:
        return (), None
    from_ns, named = _names(run, run.robot, view)
    ghosts = (
        _ghost_arm(run, run.robot, ghost, i, branch_entity(place, key), at[_rows_at(from_ns, ghost.t_ns)])
        for i, (ghost, key, at) in enumerate(zip(run.ghosts, branch_keys(run), named[1:], strict=True))
    )
    return tuple(ghosts), _arm_name(run, run.robot, named[0][_rows_at(from_ns, run.log.t_ns)])


def _arm_name(run: Run, robot: Chain, named: IntArray) -> ArmName | None:
    """Return the name of the branch chosen; `named` tells where it stands in each row of the log."""
    there = np.flatnonzero(np.isfinite(run.log.q).all(axis=1))
    if run.goals is None or not run.goals.branches or not len(there):
        return None
    t_ns, every = run.log.t_ns[there], np.array(run.goals.branches, dtype=object)[there]
    others = np.flatnonzero(every[1:] != every[:-1]) + 1
    rows = np.union1d(_drawn_rows(run, t_ns), others[:POSES])
    places = name_places(*bones_of(robot, run.log.q[there[rows]]))
    return ArmName(
        t_ns=t_ns[rows],
        sample=_rows_at(run.t_ns, t_ns[rows]),
        position=places[np.arange(len(rows)), named[there[rows]]],
        texts=tuple(printable(f"chosen: {name}") for name in every[rows]),
        gone=gone_after(run, t_ns),
    )


def _ghost_arm(run: Run, robot: Chain, ghost: Ghost, number: int, root: str, named: IntArray) -> GhostArm:
    """Return a branch as an arm; `named` tells where its name stands in each of its poses."""
    rows = _drawn_rows(run, ghost.t_ns)
    start, end = bones_of(robot, ghost.q[rows])
    return GhostArm(
        name=printable(ghost.name),
        entity=f"{root}/arm",
        label=f"{root}/name",
        colour=ghost_colour(number),
        t_ns=ghost.t_ns[rows],
        sample=_rows_at(run.t_ns, ghost.t_ns[rows]),
        start=start,
        end=end,
        links=len(robot.joints),
        named=named[rows],
        thin=bool(number % 2),
        gone=gone_after(run, ghost.t_ns[rows] if not run.timed else ghost.t_ns),
    )


def fullest_time(run: Run) -> int:
    """Return the first time in [ns] at which most branches are there, the chosen one among them."""
    there: IntArray = np.asarray(np.isfinite(run.log.q).all(axis=1), dtype=np.int64)
    for ghost in run.ghosts:
        there[np.searchsorted(run.log.t_ns, ghost.t_ns)] += 1
    return int(run.log.t_ns[np.argmax(there)])


def bones_of(robot: Chain, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what is drawn of an arm as lines: its links, and a piece of the axis of each joint that turns.

    Two solutions can differ in the turn of a wrist alone: then all their points are the same, and only the
    axes of the joints in between point otherwise.

    Args:
        robot: The arm.
        q: Joint values in [rad] or [m], shape (m, joints); NaN where there is no pose.

    Returns:
        Where each line starts and where it ends in [m], shape (m, lines, 3) each; NaN where there is no pose.
    """
    points = points_over_log(robot, q)
    position, rotation = frames_over_log(robot, q)
    turning = [k for k, joint in enumerate(robot.joints) if joint.kind == "revolute"]
    axes = np.array([robot.joints[k].axis for k in turning]).reshape(-1, 3)
    moved = np.array(turning, dtype=np.intp) + 1  # frame 0 is the base's
    direction = np.einsum("mkij,kj->mki", rotation[:, moved], axes)
    lengths = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    reach = float(np.fmax.reduce(lengths, initial=0.0))
    stubs = position[:, moved] + STUB * reach * direction
    return (
        np.concatenate((points[:, :-1], position[:, moved]), axis=1),
        np.concatenate((points[:, 1:], stubs), axis=1),
    )


def gone_after(run: Run, t_ns: IntArray) -> Gone:
    """Return when something that is at some rows of a run has just ended: at the next row.

    Args:
        run: The run.
        t_ns: When it is there, in integer [ns], shape (m,).
    """
    there = np.isin(run.log.t_ns, t_ns)
    gone = run.log.t_ns[1:][there[:-1] & ~there[1:]]
    return Gone(gone, _rows_at(run.t_ns, gone))


def _drawn_rows(run: Run, t_ns: IntArray) -> IntArray:
    """Return the rows of something at some rows of a run that are drawn.

    Of single poses the first; else those thinned out, and those at which it begins anew.
    """
    rows = np.searchsorted(run.log.t_ns, t_ns)
    if not run.timed:
        return np.flatnonzero(rows < POSES)
    begins = np.flatnonzero(np.diff(rows, prepend=-2) > 1)
    drawn = thinned(t_ns, np.zeros((len(t_ns), 1)), None)
    return np.union1d(*(some[:: math.ceil(len(some) / POSES)] for some in (begins, drawn)))


def _names(run: Run, robot: Chain, view: float) -> tuple[IntArray, IntArray]:
    """Return at which of its places the name of each arm stands, and from which times on.

    In a motion it keeps the place that is good in the view that opens; between single poses it may leap.

    Returns:
        Times in integer [ns], shape (p,), and places, shape (1 + ghosts, p), those of the arm chosen first.
    """
    t_ns = run.log.t_ns[:POSES] if not run.timed else np.array([fullest_time(run)])
    chosen = run.log.q[_rows_at(run.log.t_ns, t_ns)]
    ghosts = [ghost.q[_rows_at(ghost.t_ns, t_ns)] for ghost in run.ghosts]
    places = np.array([name_places(*bones_of(robot, q)) for q in (chosen, *ghosts)])
    return t_ns, placed_names(places, view)


def _rows_at(t_ns: IntArray, at: IntArray) -> IntArray:
    """Return the last row at or before each time, else the first."""
    return np.maximum(np.searchsorted(t_ns, at, side="right") - 1, 0)
