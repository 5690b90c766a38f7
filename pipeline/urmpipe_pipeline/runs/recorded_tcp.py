"""Forward kinematics against the tool centre point that the log recorded: where they do not meet."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.messages import Hint
from urmpipe_models.orientation import best_rotation
from urmpipe_models.transform import Transform, rpy_of
from urmpipe_pipeline.joint_log import JointLog, LogColumn, LogWarning
from urmpipe_pipeline.sources.units.evidence import CLEARLY, CLOSE_WITH_TOOL, fit, spread
from urmpipe_pipeline.sources.vocabulary import split_unit

LACKING_TOOL = "recorded-tcp-tool"
"""The kind of a hint beside a verdict of fail: it says nothing against the log."""

FAR_RECORDED = "recorded-tcp-far"

FAR = 0.03
"""Root mean square distance in [m] that no calibration and no rounding explain."""

FINEST = 1e-4
"""Options are told to a tenth of a millimetre: where kinematics are nearer than this in [m], none helps."""


def far_from_recorded(robot: Chain | None, log: JointLog) -> list[LogWarning]:
    """Return a warning if the kinematics of a robot do not come near the recorded tool centre point.

    A constant tool is allowed for. What would bring them together is said: two joints exchanged, one that
    turns the other way, another base. A log that hardly moves tells nothing, since some tool always fits.
    """
    if robot is None or log.tcp_position is None or log.q.shape[1] != len(robot.moving):
        return []
    rows = spread(log.rows)
    q, recorded = log.q[rows], log.tcp_position[rows]
    found = fit(robot, q, recorded)
    if found is None or not np.isfinite(found.with_tool) or min(found.distance, found.with_tool) <= FAR:
        return []
    said = (
        f"the kinematics of {robot.name} stay {found.distance * 1e3:.1f} mm (rms) from the recorded TCP"
        f" ({found.with_tool * 1e3:.1f} mm with the tool that fits best)"
    )
    unknown = "robot, base, units, zeros, signs or order of the joints may differ"
    remedy, *hints = next(_remedies(robot, log, q, recorded), (unknown,))
    return [LogWarning(FAR_RECORDED, f"{said}: {remedy}", hints=tuple(hints))]


def lacking_tool(robot: Chain | None, log: JointLog) -> list[LogWarning]:
    """Return a warning if kinematics and recorded positions lie apart by what a tool or a base explains."""
    if robot is None or log.tcp_position is None:
        return []
    rows = spread(log.rows)
    q, recorded = log.q[rows], log.tcp_position[rows]
    found, bare = fit(robot, q, recorded), fit(replace(robot, tool=Transform()), q, recorded)
    if found is None or bare is None or found.distance <= FINEST:
        return []
    apart = f"the kinematics of {robot.name} stay {found.distance * 1e3:.1f} mm (rms) from the recorded TCP"
    if not np.isfinite(found.with_tool):
        said = f"{apart}, and the log moves too little to tell why: {_asked(robot)}"
        return [LogWarning(LACKING_TOOL, said)]
    base, distance = _base(robot, q, recorded)
    near = min(CLOSE_WITH_TOOL, found.distance / CLEARLY)
    remedies = (("tool", _frame(bare.tool), found.with_tool), ("base", base, distance))
    hints = tuple(
        Hint(name, frame, f"brings them within {left * 1e3:.2f} mm")
        for name, frame, left in remedies
        if left <= near
    )
    return [LogWarning(LACKING_TOOL, apart, hints=hints)] if hints else []


def _asked(robot: Chain) -> str:
    """Return what to look at first: a tool or a base that is not there, or the tool that is."""
    length = float(np.linalg.norm(robot.tool.translation))
    if not length:
        return "is a tool or a base missing?"
    return f"is the tool, {length * 1e3:.1f} mm long, the right one, or a base missing?"


def _remedies(robot: Chain, log: JointLog, q: FloatArray, recorded: FloatArray) -> Iterator[tuple[str, Hint]]:
    """Yield what brings kinematics and recorded points together, and what to give then."""

    def agrees(changed: FloatArray) -> bool:
        found = fit(robot, changed, recorded)
        return found is not None and min(found.distance, found.with_tool) <= CLOSE_WITH_TOOL

    columns = [column for column in log.columns if column.role == "joint"]
    for first, second in combinations(range(q.shape[1]), 2):
        order = list(range(q.shape[1]))
        order[first], order[second] = second, first
        if agrees(q[:, order]):
            names = _called([columns[j] for j in order]) if columns else [log.joints[j] for j in order]
            said = f"with {log.joints[first]} and {log.joints[second]} exchanged they agree"
            yield said, Hint("joints", names, "exchanges them")
    for j, name in enumerate(log.joints):
        if agrees(q * np.where(np.arange(q.shape[1]) == j, -1.0, 1.0)):
            said = f"with {name} counted the other way they agree"
            yield said, Hint("log_map", None, "says so with sign = -1 for its column")
    base, distance = _base(robot, q, recorded)
    if distance <= CLOSE_WITH_TOOL:
        said = f"on another base they agree within {distance * 1e3:.2f} mm"
        yield said, Hint("base", base, "puts the arm there")


def _called(columns: Sequence[LogColumn]) -> list[str]:
    """Return what `joints` calls some columns, in order: their names, or numbers where names do not tell."""
    names = [split_unit(column.header)[0] if column.header else "" for column in columns]
    told = [name if name and "," not in name and names.count(name) == 1 else "" for name in names]
    return [name or str(column.number) for name, column in zip(told, columns, strict=True)]


def _base(robot: Chain, q: FloatArray, recorded: FloatArray) -> tuple[list[float], float]:
    """Return the base with which the points agree best, in [m] and [rad], and the rms left in [m]."""
    known = np.isfinite(q).all(axis=1) & np.isfinite(recorded).all(axis=1)
    computed, wanted = positions_over_log(replace(robot, base=Transform()), q[known]), recorded[known]
    middle, target = computed.mean(axis=0), wanted.mean(axis=0)
    turn, _ = best_rotation((wanted - target).T @ (computed - middle))
    shift = target - turn @ middle
    miss = computed @ turn.T + shift - wanted
    x, y, z = (tuple(row) for row in turn.tolist())
    numbers = (*shift.tolist(), *rpy_of((x, y, z)))
    return _frame(numbers), float(np.sqrt((miss**2).sum(axis=1).mean()))


def _frame(numbers: Sequence[float]) -> list[float]:
    """Return X,Y,Z[,RX,RY,RZ] with tenths of a millimetre or of a milliradian; no turn if it is none."""
    told = [round(float(value), 4) + 0.0 for value in numbers]  # + 0.0: no -0.0
    return told if any(told[3:]) else told[:3]
