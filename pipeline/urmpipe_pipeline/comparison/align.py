"""Space: moving a log so that what remains is what the question is about."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, Vector
from urmpipe_models.errors import LogError
from urmpipe_models.hand_eye import solve_hand_eye
from urmpipe_models.math3d import (
    Transform,
    conjugate,
    fit_rotation,
    matrix_to_rpy,
    quaternion_product,
    rotation_angle,
    to_matrices,
    to_quaternions,
)
from urmpipe_pipeline import text
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import ORIENTED, Alignment, AlignMode, Matched, run_finding

RESOLVED = 1e-4
"""Positions that leave a line by less than this, root mean square in [m], leave the rotation about it open: a
joint angle of four digits puts a point as far off."""

TURNED = np.radians(1.0)
"""A tool that turns by less in [rad] is not told from a base: 1 mm of the base is 0.02 mm off as one of the
tool, as much as the best arms repeat to."""

LEAST_POSES = 4
"""Three positions have the nine numbers that a base and the offset of a tool have: they fit whatever is."""

IN_COMMON = 1e-9
"""Two motions across a line have nothing in common if their covariance is below this share of their sizes:
rounding leaves as much."""


def align(matched: Matched, mode: AlignMode, run: Run) -> Matched:
    """Return both sides with the log moved in space, and how it was moved (`alignment`).

    Args:
        matched: Both sides at the same times, at least one.
        mode: none, start (the first pose that both sides have agrees; without orientations the first
            position), rigid (the best rigid motion of the positions), tool (the best constant offset of the
            tool centre point) or base+tool (the best base and tool at once). The last two leave out samples
            of the log without an orientation.
        run: The log, for messages.

    Raises:
        LogError: If the positions leave the rotation open; a tool, by orientations that hardly turn; or
            base and tool, by too few poses.
    """
    match mode:
        case "none":
            return matched
        case "start":
            return _moved(matched, _start(matched))
        case "rigid":
            return _moved(matched, _rigid(matched, run))
        case "tool":
            return _with_tool(matched, run)
    return _with_base_and_tool(matched, run)


def placed(robot: Chain, alignment: Alignment) -> Chain:
    """Return an arm whose kinematics are where an alignment put those of a robot."""
    if alignment.mode == "none":
        return robot
    base, tool = (
        Transform(cast("tuple[Vector, Vector, Vector]", rotation), position)
        for rotation, position in (
            (alignment.rotation, alignment.translation),
            (alignment.tool_rotation, alignment.tool),
        )
    )
    return robot.placed(base @ robot.base, robot.tool @ tool)


def as_option(frame: Transform) -> tuple[float, ...]:
    """Return a frame as `base` and `tool` take it: X, Y, Z in [m]; RX, RY, RZ in [rad] if it is turned."""
    x, y, z = (float(value) for value in frame.translation)
    turned = matrix_to_rpy(frame.rotation)
    return (x, y, z, *turned) if any(turned) else (x, y, z)


def _start(matched: Matched) -> Alignment:
    """Return the motion that joins the first poses: R = R_reference R_log^T, t = p_reference - R p_log."""
    first, turn = 0, np.array([[0.0, 0.0, 0.0, 1.0]])
    if matched.reference_quat is not None and matched.actual_quat is not None:
        there = np.isfinite(matched.reference_quat).all(axis=1) & np.isfinite(matched.actual_quat).all(axis=1)
        if there.any():
            first = int(np.argmax(there))
            turn = quaternion_product(
                matched.reference_quat[[first]], conjugate(matched.actual_quat[[first]])
            )
    rotation = to_matrices(turn)[0]
    return _alignment("start", rotation, matched.reference[first] - rotation @ matched.actual[first])


def _rigid(matched: Matched, run: Run) -> Alignment:
    """Return the rigid motion with the least squared distances, if the positions tell it.

    Source: Umeyama 1991, eq. 38-42, without scale.
    """
    wanted, done = (side - side.mean(axis=0) for side in (matched.reference, matched.actual))
    rotation, common = fit_rotation(wanted.T @ done / len(done))
    size, breadth = zip(*map(_extent, (wanted, done)), strict=True)
    if min(breadth) < RESOLVED or common[1] + common[2] <= IN_COMMON * breadth[0] * breadth[1]:
        raise LogError(run_finding(run, _open_rotation(min(size), min(breadth)), parameter="align"))
    shift = matched.reference.mean(axis=0) - rotation @ matched.actual.mean(axis=0)
    return _alignment("rigid", rotation, shift)


def _extent(centred: FloatArray) -> tuple[float, float]:
    """Return the root mean square of positions about their middle, along their main line and across it."""
    sizes = np.linalg.svd(centred, compute_uv=False) / np.sqrt(len(centred))
    along, across = [*sizes.tolist(), 0.0][:2]  # a position alone has one
    return along, across


def _open_rotation(size: float, breadth: float) -> str:
    """Say why positions leave the rotation open, and what is allowed."""
    if size < RESOLVED:
        found = f"compared positions in one point (within {size * 1e3:.4f} mm rms)"
    elif breadth < RESOLVED:
        found = f"compared positions on one line (within {breadth * 1e3:.4f} mm rms)"
    else:
        found = "two motions without anything in common"
    return f"rigid: found {found}, which leaves the rotation open, allowed: start, tool, none"


def _alignment(mode: AlignMode, rotation: FloatArray, shift: FloatArray) -> Alignment:
    """Return an alignment of plain numbers."""
    x, y, z = (float(value) for value in shift)
    return Alignment(mode, _rows(rotation), (x, y, z))


def _rows(rotation: FloatArray) -> tuple[tuple[float, ...], ...]:
    """Return a rotation matrix as plain numbers."""
    return tuple(tuple(row) for row in rotation.tolist())


def _moved(matched: Matched, alignment: Alignment) -> Matched:
    """Return both sides with the log moved by the rotation and translation of an alignment."""
    rotation = np.array(alignment.rotation)
    done = matched.actual @ rotation.T + np.array(alignment.translation)
    quat = matched.actual_quat
    if quat is not None:
        quat = quaternion_product(to_quaternions(rotation.reshape(1, 9), "matrix"), quat)
    return matched._replace(actual=done, actual_quat=quat, alignment=alignment)


def _with_tool(matched: Matched, run: Run) -> Matched:
    """Move the log by the d of the least |p_reference - p - R d|^2, the mean of R^T (p_reference - p)."""
    posed, quat = _oriented(matched, "tool", run)
    turned = float(rotation_angle(quat, np.broadcast_to(quat[0], quat.shape)).max())
    if turned < TURNED:
        found = f"tool: found a tool that turns by {np.degrees(turned):.4f} deg in all"
        said = "which an offset of the base explains as well, allowed: a log that turns it; start, none"
        raise LogError(run_finding(run, f"{found}, {said}", parameter="align"))
    rotation = to_matrices(quat)
    x, y, z = np.einsum("nji,nj->ni", rotation, posed.reference - posed.actual).mean(axis=0).tolist()
    moved = posed.actual + rotation @ np.array((x, y, z))
    return posed._replace(actual=moved, alignment=Alignment("tool", tool=(x, y, z)))


def _with_base_and_tool(matched: Matched, run: Run) -> Matched:
    """Move the log by the base and the tool of the least misses: p' = Z (p + R d), R' = Z R X."""
    posed, quat = _oriented(matched, "base+tool", run)
    if len(quat) < LEAST_POSES:
        few = text.counted(len(quat), "compared pose")
        said = f"base+tool: found {few}, which some base and tool fit, allowed: {LEAST_POSES} or more"
        raise LogError(run_finding(run, said, parameter="align"))
    rotation, wanted = to_matrices(quat), posed.reference_quat
    found = solve_hand_eye(
        posed.actual, rotation, posed.reference, None if wanted is None else to_matrices(wanted)
    )
    moved = _alignment("base+tool", found.base_rotation, found.base_position)
    x, y, z = found.tool_position.tolist()
    alignment = replace(
        moved, tool=(x, y, z), tool_rotation=_rows(found.tool_rotation), unobservable=found.unobservable
    )
    tool = np.broadcast_to(found.tool_rotation.reshape(1, 9), (len(quat), 9))
    with_tool = posed._replace(
        actual=posed.actual + rotation @ found.tool_position,
        actual_quat=quaternion_product(quat, to_quaternions(tool, "matrix")),
    )
    return _moved(with_tool, alignment)


def _oriented(matched: Matched, mode: AlignMode, run: Run) -> tuple[Matched, FloatArray]:
    """Return the samples of which the log has an orientation, and these.

    Raises:
        LogError: If there is none.
    """
    quat = matched.actual_quat
    known = np.zeros(0, np.intp) if quat is None else np.flatnonzero(np.isfinite(quat).all(axis=1))
    if quat is None or not len(known):
        said = f"{mode}: found no orientation of the log, allowed: {ORIENTED}"
        raise LogError(run_finding(run, said, parameter="align"))
    return matched if len(known) == len(quat) else matched.at(known), quat[known]
