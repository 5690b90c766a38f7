"""A robot with drives, run along one path at many velocities; the running speed.

1. Unit: set points in; joints, rates, voltages and currents out, until the robot leaves its set points.
2. Runs: as machine code, one process per velocity; or in NumPy, where each value of one instance has one
   element per velocity. An element that is no longer finite is removed, the others continue.
3. Running speed: the largest velocity within a limit, found from below by halving ratios.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.blocks.coordinates import coordinate_kinds
from urmpipe_fmus.blocks.driven_arm import driven_arm, start_values
from urmpipe_fmus.build.fmu import cached_fmu
from urmpipe_fmus.cosim.plan import LogColumn, prepare
from urmpipe_fmus.cosim.simulation import simulate
from urmpipe_fmus.cosim.system import Block, LogInput, Port, System
from urmpipe_fmus.instance import Instance
from urmpipe_models.arm.chain import Chain
from urmpipe_models.drives import DrivenJoint
from urmpipe_models.elementwise import BoolArray, FloatArray
from urmpipe_models.errors import CosimulationError, UnitError
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.accuracy.driven_motion import Divergence, DrivenMotion
from urmpipe_pipeline.accuracy.result import FASTEST, FINE, SLOWEST
from urmpipe_pipeline.planned_paths.result import PlannedPath

SET_POINT_ENDINGS = ("", "d", "dd")  # value, rate, second derivative
MAX_PRISMATIC_DEVIATION = 1.0  # m from its set point, where a run ends; of a revolute joint a turn
BLOCK = "arm"
NON_FINITE = "not finite"  # in the message of a run that diverges; other messages are errors
HALVINGS_AT_ONCE = 2  # all velocities that they may need run side by side
Within = Callable[
    [Sequence[float]], Sequence[bool]
]  # runs velocities in [m/s]: whether each is within the limit


@dataclass(frozen=True, eq=False)
class ArmUnit:
    """The unit of a robot with drives that starts a path at rest, with a force on its tool.

    Attributes:
        robot: The robot; its start pose is the first pose of the path.
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
        names = {drive.joint for drive in self.robot.drives if isinstance(drive, DrivenJoint)}
        return [k for k, name in enumerate(self.robot.coordinates) if name in names]

    @cached_property
    def outputs(self) -> list[str]:
        """Scalar outputs: q and q' of all coordinates, then u and i_a of those with a drive."""
        all_coordinates = range(len(self.robot.coordinates))
        return [
            *(self._scalar("", ending, k, all_coordinates) for ending in ("", "d") for k in all_coordinates),
            *(self._scalar(name, "", k, self.driven) for name in ("u", "i_a") for k in self.driven),
        ]

    @cached_property
    def inputs(self) -> list[str]:
        """Scalar inputs: set values, rates and second derivatives of the driven coordinates."""
        return [
            self._scalar("set_", ending, k, self.driven) for ending in SET_POINT_ENDINGS for k in self.driven
        ]

    def _scalar(self, name: str, ending: str, coordinate: int, among: Sequence[int]) -> str:
        """Return the scalar of a coordinate by its place among those of its kind that have the variable.

        The kind (phi, s) ends a name that is empty or ends in _, and follows any other name (u, u_s).
        """
        for kind in coordinate_kinds(self.robot):
            indices = [k for k in kind.indices(self.robot) if k in among]
            if coordinate in indices:
                variable = name + kind.name + ending
                if name and not name.endswith("_"):
                    variable = name if kind.kind == "revolute" else f"{name}_{kind.name}"
                return f"{variable}[{indices.index(coordinate) + 1}]"
        raise KeyError(coordinate)

    def set_points(self, plan: PlannedPath) -> FloatArray:
        """Return the values of the inputs along a plan, in [rad] or [m] and per [s], shape (n, inputs)."""
        joints = plan.joints
        assert joints is not None  # a plan for a robot
        return np.hstack([values[:, self.driven] for values in (joints.q, joints.qd, joints.qdd)])

    def motion(self, plan: PlannedPath, velocity: float, values: FloatArray, *, failed: bool) -> DrivenMotion:
        """Return a recorded motion until it leaves its set points.

        Args:
            plan: The path at this velocity.
            velocity: The commanded velocity in [m/s].
            values: The outputs in SI ([rad], [m], [V], [A]), shape (m, outputs); if it failed, m is smaller
                than the number of samples of the plan.
            failed: Whether it ended because a state was no longer finite.
        """
        joints, count = plan.joints, len(self.robot.coordinates)
        assert joints is not None
        deviation = np.abs(values[:, :count] - joints.q[: len(values)]) / self._max_deviation
        exceeding = np.flatnonzero((deviation > 1.0).any(axis=1))
        diverged, rows = None, len(values)
        if failed or len(exceeding):
            last = int(exceeding[0]) if len(exceeding) else rows - 1
            joint = self.robot.coordinates[int(np.argmax(deviation[last]))]
            diverged, rows = Divergence(float(plan.t[last]), joint), last + 1
        q, qd, voltage, current = np.split(values[:rows], np.cumsum([count, count, len(self.driven)]), axis=1)
        arcs = plan.path.arcs
        middles = (plan.segment_times[arcs] + plan.segment_times[arcs + 1]) / 2.0
        drives = {drive.joint: drive for drive in self.robot.drives if isinstance(drive, DrivenJoint)}
        limits = [drives[self.robot.coordinates[k]].largest_voltage for k in self.driven]
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
            limits=np.array(limits),
            corner_times_ns=np.round(middles * 1e9).astype(np.int64),
            diverged=diverged,
        )

    def has_left(self, values: FloatArray, q: FloatArray) -> BoolArray:
        """Return which runs have left their set points, shape (runs,).

        Args:
            values: The coordinates in [rad] or [m], shape (coordinates, runs).
            q: Their set values in [rad] or [m], shape (coordinates, runs).
        """
        exceeding: BoolArray = (np.abs(values - q) / self._max_deviation[:, np.newaxis]).max(axis=0) > 1.0
        return exceeding

    @cached_property
    def _max_deviation(self) -> FloatArray:
        """Deviations in [rad] or [m] at which a run ends, shape (coordinates,)."""
        return np.array(
            [
                FULL_TURN if joint.kind == "revolute" else MAX_PRISMATIC_DEVIATION
                for joint in self.robot.moving
            ]
        )


@dataclass(eq=False)
class ArmRuns:
    """Runs of a robot along planned paths; each velocity runs once.

    Attributes:
        arm: The robot, at rest at the start of the paths.
        plan: Returns the plan at a velocity in [m/s].
        compiled: Whether it runs as machine code.
        on_message: Called with a line when machine code is built.
        progress: Called with the completed share of the velocities of one call, 0..1.
        motions: The motions by velocity.
    """

    arm: ArmUnit
    plan: Callable[[float], PlannedPath]
    compiled: bool
    on_message: Callable[[str], None]
    progress: Callable[[float], None]
    motions: dict[float, DrivenMotion] = field(default_factory=dict)

    def run(self, velocities: Sequence[float]) -> list[DrivenMotion]:
        """Return the motions at some velocities in [m/s].

        Raises:
            UrmpipeError: If a path cannot be planned, the machine code cannot be built, or a run fails.
        """
        new = [velocity for velocity in dict.fromkeys(velocities) if velocity not in self.motions]
        plans = [self.plan(velocity) for velocity in new]
        if new:
            recorded = self._run_compiled(plans) if self.compiled else self._run_in_numpy(plans)
            for velocity, plan, (values, failed) in zip(new, plans, recorded, strict=True):
                self.motions[velocity] = self.arm.motion(plan, velocity, values, failed=failed)
        return [self.motions[velocity] for velocity in velocities]

    def _run_compiled(self, plans: Sequence[PlannedPath]) -> list[tuple[FloatArray, bool]]:
        """Return the outputs along plans that run side by side, a process each, and which runs failed."""
        fmu = cached_fmu(
            self.arm.unit, "native", on_message=lambda name: self.on_message(f"building {name} ...")
        )
        shares = [0.0] * len(plans)

        def run(k: int) -> tuple[FloatArray, bool]:
            def report(share: float) -> None:
                shares[k] = share
                self.progress(sum(shares) / len(shares))

            return self._run_process(fmu, plans[k], report)

        with ThreadPoolExecutor(_count_processors()) as pool:
            return list(pool.map(run, range(len(plans))))

    def _run_process(
        self, fmu: Path, plan: PlannedPath, progress: Callable[[float], None]
    ) -> tuple[FloatArray, bool]:
        set_points = dict(zip(self.arm.inputs, self.arm.set_points(plan).T, strict=True))
        starts = {name: list(values) for name, values in self.arm.starts.items()}
        system = System(
            name="accuracy",
            path=Path(),
            step=plan.tsp,
            duration=float(plan.t[-1]),
            blocks=(Block(name=BLOCK, unit="driven_arm", start=starts),),
            inputs=tuple(
                LogInput(destination=Port(BLOCK, name), log=plan.name, column=name) for name in set_points
            ),
        )

        def column(followed: LogInput) -> LogColumn:
            return LogColumn(plan.t_ns, set_points[followed.column])

        recorded = simulate(prepare(system, lambda block: fmu, column=column), progress=progress)
        if recorded.failed is not None and NON_FINITE not in recorded.failed:
            raise CosimulationError(recorded.failed)
        values = np.column_stack([recorded.column(BLOCK, name) for name in self.arm.outputs])
        return values, recorded.failed is not None

    def _run_in_numpy(self, plans: Sequence[PlannedPath]) -> list[tuple[FloatArray, bool]]:
        """Return the outputs along plans of one period, and which runs failed."""
        batch = _Batch(self.arm, plans)
        count = max(map(len, plans))
        for k in range(count):
            batch.read(k)
            batch.step(k)
            if not batch.running:
                break
            self.progress((k + 1) / count)
        runs = zip(batch.values, batch.lengths, batch.failed, strict=True)
        return [(values[:length], failed) for values, length, failed in runs]


class _Batch:
    """Runs that one instance steps together, one element each, until the plan of each ends or it diverges.

    Attributes:
        running: Indices of the runs of the instance's elements.
        values: The outputs of each run in SI, shape (samples, outputs).
        lengths: Number of valid samples of each run.
        failed: Whether each run was no longer finite.
    """

    def __init__(self, arm: ArmUnit, plans: Sequence[PlannedPath]) -> None:
        self._arm, self._period, self._instance = arm, plans[0].tsp, Instance(arm.unit)
        for name, values in arm.starts.items():
            names = [f"{name}[{k + 1}]" for k in range(len(values))]
            self._instance.set(self._references(names), list(values))
        self._inputs, self._outputs = self._references(arm.inputs), self._references(arm.outputs)
        self._set_points = [arm.set_points(plan) for plan in plans]
        self._set_q = [plan.joints.q for plan in plans if plan.joints is not None]
        self.running = list(range(len(plans)))
        self.values = [np.empty((len(plan), len(arm.outputs))) for plan in plans]
        self.lengths, self.failed = [len(plan) for plan in plans], [False] * len(plans)

    def read(self, k: int) -> None:
        """Set the inputs of a sample and store its outputs; remove runs that end there or diverge."""
        set_points = np.array([self._set_points[run][k] for run in self.running]).T
        self._instance.set(self._inputs, list(set_points))
        self._remove_failing(lambda: self._instance.get(self._outputs), k)
        if not self.running:
            return
        outputs = self._instance.get(self._outputs)
        values = np.stack([np.broadcast_to(output, len(self.running)) for output in outputs])
        set_q = np.array([self._set_q[run][k] for run in self.running]).T
        for i, (run, left) in enumerate(
            zip(self.running, self._arm.has_left(values[: len(set_q)], set_q), strict=True)
        ):
            self.values[run][k] = values[:, i]
            if left:
                self.lengths[run] = k + 1
        kept = [i for i, run in enumerate(self.running) if k + 1 < self.lengths[run]]
        if len(kept) < len(self.running):
            self._instance.restore(_select_elements(self._instance.save(), kept))
            self.running = [self.running[i] for i in kept]

    def step(self, k: int) -> None:
        """Go to the next sample; remove runs that fail."""
        if self.running:
            time = k * self._period
            self._remove_failing(lambda: self._instance.do_step(time, self._period), k + 1)

    def _remove_failing(self, action: Callable[[], object], length: int) -> None:
        """Do an action with all elements; if it fails, with those alone for which it does not fail."""
        state = self._instance.save()
        try:
            action()
        except UnitError:
            indices = range(len(self.running))
            working = [i for i in indices if self._works(action, state, [i])]
            self._works(action, state, working)
            for i in set(indices) - set(working):
                self.lengths[self.running[i]], self.failed[self.running[i]] = length, True
            self.running = [self.running[i] for i in working]

    def _works(self, action: Callable[[], object], state: Any, elements: Sequence[int]) -> bool:
        """Do an action with some elements alone; return whether it succeeds."""
        self._instance.restore(_select_elements(state, elements))
        try:
            action()
        except UnitError:
            return False
        return True

    def _references(self, names: Sequence[str]) -> list[int]:
        return [self._instance.reference(name) for name in names]


def _select_elements(state: Any, elements: Sequence[int]) -> Any:
    """Return the saved state of an instance with some of its elements."""
    time, started, values = state
    return time, started, [value[list(elements)] if np.ndim(value) else value for value in values]


def _count_processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def running_speed(within: Within, begun: Sequence[float]) -> float | None:
    """Return the largest velocity within the limit in [m/s], to 1 %; None if none is from 0.01 m/s on.

    The first of the given velocities that exceeds the limit bounds it from above, whatever those above it do;
    without one, velocities are doubled up to 10 m/s. Between it and the last one below, the ratio is halved
    until it is 1 % or less.

    Args:
        within: Runs velocities, and returns whether each is within the limit.
        begun: Velocities in [m/s] to begin with.
    """
    low, high = _bracket(within, sorted({min(max(velocity, SLOWEST), FASTEST) for velocity in begun}))
    if low is None or high is None:
        return low
    while high / low > FINE:
        parts = 2**HALVINGS_AT_ONCE
        middles = [low * (high / low) ** (k / parts) for k in range(1, parts)]
        is_within = dict(zip(middles, within(middles), strict=True))
        while middles and high / low > FINE:
            middle = middles[len(middles) // 2]
            low, high = (middle, high) if is_within[middle] else (low, middle)
            middles = [velocity for velocity in middles if low < velocity < high]
    return low


def _bracket(within: Within, begun: Sequence[float]) -> tuple[float | None, float | None]:
    """Return the last velocity within the limit and the first that exceeds it; None where there is none."""
    is_within = within(begun)
    if not is_within[0]:
        high = begun[0]
        while high > SLOWEST:
            low = max(high / 2.0, SLOWEST)
            if within([low])[0]:
                return low, high
            high = low
        return None, high
    if not all(is_within):
        first = list(is_within).index(False)
        return begun[first - 1], begun[first]
    low = begun[-1]
    while low < FASTEST:
        high = min(2.0 * low, FASTEST)
        if not within([high])[0]:
            return low, high
        low = high
    return low, None
