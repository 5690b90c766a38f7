"""What the offset between two clocks is looked for in: joints or positions, as both sides have them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.math3d import to_matrices
from urmpipe_pipeline.trajectories import AlignMode, Trajectory, joint_order


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """The same channels of two motions.

    Attributes:
        by: What the channels are.
        turned: Whether the frames of the two sides may be turned against each other; of positions.
        reference_ns: Times of the reference in integer [ns], shape (n,).
        reference: Its channels in [rad] or [m], shape (n, k).
        log_ns: Times of the log in integer [ns], shape (m,).
        log: Its channels in [rad] or [m], shape (m, k).
        tool_axes: Axes of the log's tool as the columns of rotation matrices [-], shape (m, 3, 3), where a
            tool between the two sides is not known; else None.
    """

    by: Literal["joints", "position"]
    turned: bool
    reference_ns: IntArray
    reference: FloatArray
    log_ns: IntArray
    log: FloatArray
    tool_axes: FloatArray | None = None


def views(reference: Trajectory, log: Trajectory, align: AlignMode) -> Iterator[View]:
    """Yield the views of two trajectories, the one that assumes least about their frames and tools first.

    Joints do not depend on frames, structure or tools. Positions do: they are taken as they stand, unless the
    alignment that follows would turn the log anyway (start, rigid, base+tool), and at last as if the frames
    were turned; of the alignments `tool` and `base+tool` the tool is unknown.
    """
    order = joint_order(reference.joints, log.joints)
    if order is not None and reference.q is not None and log.q is not None:
        yield View("joints", False, reference.t_ns, reference.q[:, order], log.t_ns, log.q)
    axes = None if "tool" not in align or log.quat_xyzw is None else to_matrices(log.quat_xyzw)
    if align in ("none", "tool"):
        yield View("position", False, reference.t_ns, reference.position, log.t_ns, log.position, axes)
    both = axes if align == "base+tool" else None
    yield View("position", True, reference.t_ns, reference.position, log.t_ns, log.position, both)
