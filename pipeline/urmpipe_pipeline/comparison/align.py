"""Space: a log is moved rigidly before it is compared, p' = R p + t + R' d with R' = R R_log.

`align` finds the motion, by mode:

- start: R = R_reference R_log^T, t = p_reference - R p_log of the first poses.
- rigid: the R, t of the least sum |p_reference - R p - t|^2 (Umeyama 1991, eq. 38-42, without scale).
- tool: the d of the least sum |p_reference - p - R_log d|^2, the mean of R_log^T (p_reference - p).
- base+tool: base and tool of the least residuals of hand-eye calibration.

`format_alignment` formats the motion and its rule.
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
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
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import ORIENTED, Alignment, AlignMode, Matched, run_finding

MIN_BREADTH = 1e-4  # m rms across a line: a joint angle of four digits puts a point as far off
# Below, an offset of the tool is not distinguishable from one of the base: 1 mm of the base is 0.02 mm off as
# one of the tool, which the best arms repeat to.
MIN_TURN = np.radians(1.0)  # rad, of the tool over the log
MIN_POSES = 4  # three positions have the nine numbers of a base and the offset of a tool: they always fit
# Covariance of two motions across a line / their sizes, below which they are unrelated: rounding leaves it.
MIN_COVARIANCE = 1e-9


def align(matched: Matched, mode: AlignMode, run: Run) -> Matched:
    """Return both sides with the log moved in space, and the motion (`alignment`).

    Args:
        matched: Both sides at the same times, at least one.
        mode: none, start (the first pose that both sides have agrees; without orientations the first
            position), rigid (the best rigid motion of the positions), tool (the best constant offset of the
            tool centre point) or base+tool (the best base and tool at once). The last two leave out samples
            of the log without an orientation.
        run: The log, for messages.

    Raises:
        LogError: If the positions do not determine the rotation; orientations that barely turn, the tool; or
            too few poses, base and tool.
    """
    match mode:
        case "none":
            return matched
        case "start":
            return _apply_rigid(matched, _start(matched))
        case "rigid":
            return _apply_rigid(matched, _rigid(matched, run))
        case "tool":
            return _align_tool(matched, run)
    return _align_base_and_tool(matched, run)


def apply_alignment(robot: Chain, alignment: Alignment) -> Chain:
    """Return a robot whose kinematics are those of the log after an alignment."""
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


def frame_to_option(frame: Transform) -> tuple[float, ...]:
    """Return a frame as `base` and `tool` take it: X, Y, Z in [m]; RX, RY, RZ in [rad] if it is rotated."""
    x, y, z = (float(value) for value in frame.translation)
    angles = matrix_to_rpy(frame.rotation)
    return (x, y, z, *angles) if any(angles) else (x, y, z)


def _start(matched: Matched) -> Alignment:
    first, turn = 0, np.array([[0.0, 0.0, 0.0, 1.0]])
    if matched.reference_quat is not None and matched.actual_quat is not None:
        both = np.isfinite(matched.reference_quat).all(axis=1) & np.isfinite(matched.actual_quat).all(axis=1)
        if both.any():
            first = int(np.argmax(both))
            inverse = conjugate(matched.actual_quat[[first]])
            turn = quaternion_product(matched.reference_quat[[first]], inverse)
    rotation = to_matrices(turn)[0]
    return _build_alignment("start", rotation, matched.reference[first] - rotation @ matched.actual[first])


def _rigid(matched: Matched, run: Run) -> Alignment:
    """Return the rigid motion of the least squared distances, if the positions determine it."""
    sides = matched.reference, matched.actual
    reference, actual = (side - side.mean(axis=0) for side in sides)
    rotation, covariance = fit_rotation(reference.T @ actual / len(actual))
    # Root mean squares about the mean, along the main line and across it; one position has no breadth.
    rms = [np.append(np.linalg.svd(side, compute_uv=False), 0.0) for side in (reference, actual)]
    (size, breadth), (other_size, other_breadth) = (side[:2] / np.sqrt(len(actual)) for side in rms)
    related = covariance[1] + covariance[2] > MIN_COVARIANCE * breadth * other_breadth
    if min(breadth, other_breadth) < MIN_BREADTH or not related:
        fault = "two unrelated motions"
        if min(size, other_size) < MIN_BREADTH:
            fault = f"compared positions in one point (within {min(size, other_size) * 1e3:.4f} mm rms)"
        elif min(breadth, other_breadth) < MIN_BREADTH:
            fault = f"compared positions on one line (within {min(breadth, other_breadth) * 1e3:.4f} mm rms)"
        allowed = "so the rotation is not determined, allowed: start, tool, none"
        raise LogError(run_finding(run, f"rigid: found {fault}, {allowed}", parameter="align"))
    shift = matched.reference.mean(axis=0) - rotation @ matched.actual.mean(axis=0)
    return _build_alignment("rigid", rotation, shift)


def _build_alignment(mode: AlignMode, rotation: FloatArray, shift: FloatArray) -> Alignment:
    x, y, z = (float(value) for value in shift)
    return Alignment(mode, _to_rows(rotation), (x, y, z))


def _to_rows(rotation: FloatArray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in rotation.tolist())


def _apply_rigid(matched: Matched, alignment: Alignment) -> Matched:
    """Return both sides with the log moved by the rotation and translation of an alignment."""
    rotation = np.array(alignment.rotation)
    actual = matched.actual @ rotation.T + np.array(alignment.translation)
    quat = matched.actual_quat
    if quat is not None:
        quat = quaternion_product(to_quaternions(rotation.reshape(1, 9), "matrix"), quat)
    return matched._replace(actual=actual, actual_quat=quat, alignment=alignment)


def _align_tool(matched: Matched, run: Run) -> Matched:
    posed, quat = _with_orientation(matched, "tool", run)
    turn = float(rotation_angle(quat, np.broadcast_to(quat[0], quat.shape)).max())
    if turn < MIN_TURN:
        fault = f"tool: found a tool that rotates by {np.degrees(turn):.4f} deg at most, so its offset"
        allowed = "cannot be separated from one of the base, allowed: a log that rotates it more; start, none"
        raise LogError(run_finding(run, f"{fault} {allowed}", parameter="align"))
    rotation = to_matrices(quat)
    x, y, z = np.einsum("nji,nj->ni", rotation, posed.reference - posed.actual).mean(axis=0).tolist()
    actual = posed.actual + rotation @ np.array((x, y, z))
    return posed._replace(actual=actual, alignment=Alignment("tool", tool=(x, y, z)))


def _align_base_and_tool(matched: Matched, run: Run) -> Matched:
    """Move the log by the base Z and the tool X, d of the least residuals: p' = Z (p + R d), R' = Z R X."""
    posed, quat = _with_orientation(matched, "base+tool", run)
    if len(quat) < MIN_POSES:
        poses = format_count(len(quat), "compared pose")
        message = (
            f"base+tool: found {poses}, too few to determine base and tool, allowed: {MIN_POSES} or more"
        )
        raise LogError(run_finding(run, message, parameter="align"))
    rotation, reference_quat = to_matrices(quat), posed.reference_quat
    reference_rotation = None if reference_quat is None else to_matrices(reference_quat)
    frames = solve_hand_eye(posed.actual, rotation, posed.reference, reference_rotation)
    x, y, z = frames.tool_position.tolist()
    alignment = replace(
        _build_alignment("base+tool", frames.base_rotation, frames.base_position),
        tool=(x, y, z),
        tool_rotation=_to_rows(frames.tool_rotation),
        unobservable=frames.unobservable,
    )
    tool = np.broadcast_to(frames.tool_rotation.reshape(1, 9), (len(quat), 9))
    with_tool = posed._replace(
        actual=posed.actual + rotation @ frames.tool_position,
        actual_quat=quaternion_product(quat, to_quaternions(tool, "matrix")),
    )
    return _apply_rigid(with_tool, alignment)


def _with_orientation(matched: Matched, mode: AlignMode, run: Run) -> tuple[Matched, FloatArray]:
    """Return the samples of which the log has an orientation, and these.

    Raises:
        LogError: If there is none.
    """
    quat = matched.actual_quat
    known = np.zeros(0, np.intp) if quat is None else np.flatnonzero(np.isfinite(quat).all(axis=1))
    if quat is None or not len(known):
        message = f"{mode}: found no orientation of the log, allowed: {ORIENTED}"
        raise LogError(run_finding(run, message, parameter="align"))
    return matched if len(known) == len(quat) else matched.at(known), quat[known]


def format_alignment(deviation: Deviation) -> tuple[str, str]:
    """Return the motion of the alignment of a log, and its rule."""
    alignment = deviation.alignment
    match alignment.mode:
        case "none":
            return "none", "both sides as recorded"
        case "tool":
            moved = text.format_quantity(float(np.linalg.norm(alignment.tool)), "m")
            by = f"{_vector(alignment.tool)} mm in the tool's frame"
            return f"tool centre point moved by {moved}", f"the best constant offset: {by}"
        case "base+tool":
            return _format_base_and_tool(alignment)
    turned = text.format_quantity(alignment.angle, "rad")
    moved = text.format_quantity(float(alignment.moved(deviation.actual).max()), "m")
    first = alignment.mode == "start"
    rule = "the first compared poses agree" if first else "the best rigid motion"
    about = f"rotated about the origin, then translated by {_vector(alignment.translation)} mm"
    return f"{alignment.mode}: moved by up to {moved}, turned by {turned}", f"{rule}: {about}"


def _format_base_and_tool(alignment: Alignment) -> tuple[str, str]:
    """Return the motion of base and tool, and where they are after it."""
    sides = (
        ("base", alignment.translation, alignment.angle),
        ("tool", alignment.tool, alignment.tool_angle),
    )
    moved = (
        f"{name} by {text.format_quantity(float(np.linalg.norm(shift)), 'm')}"
        f" and {text.format_quantity(turn, 'rad')}"
        for name, shift, turn in sides
    )
    base, tool = _vector(alignment.translation), _vector(alignment.tool)
    by = f"base at {base} mm, tool at {tool} mm in the tool's frame"
    return f"moved and turned: {', '.join(moved)}", f"the best base and tool: {by}"


def _vector(metres: tuple[float, ...]) -> str:
    """Return a vector in [m] as (x, y, z) in [mm]."""
    return f"({', '.join(text.format_number(value, 'm') for value in metres)})"
