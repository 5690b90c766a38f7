"""The unit of an arm with drives as it is run along a path: set points in, its motion out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.blocks.coordinates import coordinate_kinds
from urmpipe_fmus.blocks.driven_arm import driven_arm, start_values
from urmpipe_models.arm.chain import Chain
from urmpipe_models.drives import DrivenJoint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.accuracy.driven_motion import Diverged, DrivenMotion
from urmpipe_pipeline.planned_paths.result import PlannedPath

SET = ("", "d", "dd")
"""Endings of set points: value, rate, second derivative."""

SLID = 1.0
"""A joint that slides has left its set point so far off in [m]; one that turns by a turn."""


@dataclass(frozen=True, eq=False)
class ArmUnit:
    """An arm with drives that starts a path at rest, with a force on its tool.

    Attributes:
        robot: The arm, its start pose that of the path.
        force: In [N], along the axes of the world.
    """

    robot: Chain
    force: tuple[float, float, float]

    @cached_property
    def unit(self) -> BlockModel:
        """Its unit."""
        return driven_arm(self.robot)

    @cached_property
    def starts(self) -> Mapping[str, Sequence[Any]]:
        """Its start values by variable."""
        return start_values(self.robot, self.force)

    @cached_property
    def driven(self) -> list[int]:
        """Indices of the coordinates that have a drive."""
        names = {one.joint for one in self.robot.drives if isinstance(one, DrivenJoint)}
        return [k for k, name in enumerate(self.robot.coordinates) if name in names]

    @cached_property
    def outputs(self) -> list[str]:
        """The scalars that are read: q and q' of all coordinates, then u and i_a of those with a drive."""
        every, driven = range(len(self.robot.coordinates)), self.driven
        return [
            *(self._scalar("", ending, k, every) for ending in ("", "d") for k in every),
            *(self._scalar(name, "", k, driven) for name in ("u", "i_a") for k in driven),
        ]

    @cached_property
    def inputs(self) -> list[str]:
        """The scalars that are set: set values, rates and second derivatives of the driven coordinates."""
        return [self._scalar("set_", ending, k, self.driven) for ending in SET for k in self.driven]

    def _scalar(self, name: str, ending: str, coordinate: int, among: Sequence[int]) -> str:
        """Return a scalar of a coordinate by its place among those of its kind that have the variable.

        Its variable is called by the kind (phi, s) after a name that ends in _ or is empty; any other name
        has the kind behind it (u, u_s).
        """
        for kind in coordinate_kinds(self.robot):
            own = [k for k in kind.indices(self.robot) if k in among]
            if coordinate in own:
                whole = name + kind.name + ending
                if name and not name.endswith("_"):
                    whole = name if kind.kind == "revolute" else f"{name}_{kind.name}"
                return f"{whole}[{own.index(coordinate) + 1}]"
        raise KeyError(coordinate)

    def set_points(self, plan: PlannedPath) -> FloatArray:
        """Return what the inputs are set to along a plan, in [rad] or [m] and per [s], shape (n, inputs)."""
        joints = plan.joints
        assert joints is not None  # a plan for an arm
        return np.hstack([one[:, self.driven] for one in (joints.q, joints.qd, joints.qdd)])

    def motion(self, plan: PlannedPath, velocity: float, values: FloatArray, *, failed: bool) -> DrivenMotion:
        """Return the motion that was recorded, until it leaves its set points.

        Args:
            plan: The path at this velocity.
            velocity: What was asked for in [m/s].
            values: The outputs in SI ([rad], [m], [V], [A]), shape (m, outputs); where it failed m is smaller
                than the number of samples of the plan.
            failed: Whether it ended since a state was no longer finite.
        """
        joints, count = plan.joints, len(self.robot.coordinates)
        assert joints is not None
        off = np.abs(values[:, :count] - joints.q[: len(values)]) / self._turns
        beyond = np.flatnonzero((off > 1.0).any(axis=1))
        diverged, rows = None, len(values)
        if failed or len(beyond):
            last = int(beyond[0]) if len(beyond) else rows - 1
            joint = self.robot.coordinates[int(np.argmax(off[last]))]
            diverged, rows = Diverged(float(plan.t[last]), joint), last + 1
        q, qd, voltage, current = np.split(values[:rows], np.cumsum([count, count, len(self.driven)]), axis=1)
        arcs = plan.path.arcs
        middles = (plan.segment_times[arcs] + plan.segment_times[arcs + 1]) / 2.0
        return DrivenMotion(
            velocity=velocity,
            t_ns=plan.t_ns[:rows],
            planned=plan.position[:rows],
            set_q=joints.q[:rows],
            set_qd=joints.qd[:rows],
            speed=plan.motion.v[:rows],
            position=positions_over_log(self.robot, q),
            q=q,
            qd=qd,
            voltage=voltage,
            current=current,
            limits=self._limits,
            corner_ns=np.round(middles * 1e9).astype(np.int64),
            diverged=diverged,
        )

    def beyond(self, values: Sequence[Any], q: FloatArray) -> FloatArray:
        """Return how far coordinates are off, as shares of what ends a motion [-], shape (coordinates, runs).

        Args:
            values: One element a coordinate, in [rad] or [m].
            q: Their set values in [rad] or [m], shape (coordinates, runs).
        """
        return np.abs(np.stack(np.broadcast_arrays(*values)) - q) / self._turns[:, np.newaxis]

    @cached_property
    def _turns(self) -> FloatArray:
        """How far off each coordinate may be in [rad] or [m], shape (coordinates,)."""
        return np.array([FULL_TURN if one.kind == "revolute" else SLID for one in self.robot.moving])

    @cached_property
    def _limits(self) -> FloatArray:
        """The largest voltages in [V], shape (driven,)."""
        by_joint = {one.joint: one for one in self.robot.drives}
        drives = (by_joint[self.robot.coordinates[k]] for k in self.driven)
        return np.array([one.largest_voltage for one in drives if isinstance(one, DrivenJoint)])
