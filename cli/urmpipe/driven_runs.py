"""The unit of an arm with drives as it is run along a path: set points in, its motion out."""

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
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import CosimulationError, UnitError
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.accuracy.driven_motion import Diverged, DrivenMotion
from urmpipe_pipeline.accuracy.result import FASTEST, FINE, SLOWEST
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


BLOCK = "arm"

NOT_FINITE = "not finite"
"""By these words of a unit a run that diverges is told from one that fails."""


@dataclass(eq=False)
class ArmRuns:
    """An arm that is run along planned paths.

    Attributes:
        arm: The arm, at rest where the paths begin.
        plan: Returns the plan at a velocity in [m/s].
        compiled: Whether it runs as machine code.
        told: Told what takes its time, a line each.
        progress: Told the share of what is asked for at once that is done, 0..1.
        found: Every motion that was run, by velocity.
    """

    arm: ArmUnit
    plan: Callable[[float], PlannedPath]
    compiled: bool
    told: Callable[[str], None]
    progress: Callable[[float], None]
    found: dict[float, DrivenMotion] = field(default_factory=dict)

    def at(self, velocities: Sequence[float]) -> list[DrivenMotion]:
        """Return the motions at some velocities in [m/s]; those that were run before are kept.

        Raises:
            UrmpipeError: If a path cannot be planned, the machine code cannot be built, or a run fails.
        """
        asked = [one for one in dict.fromkeys(velocities) if one not in self.found]
        plans = [self.plan(one) for one in asked]
        if asked:
            run = self._compiled if self.compiled else self._in_numpy
            self.found |= dict(zip(asked, run(asked, plans), strict=True))
        return [self.found[one] for one in velocities]

    def _compiled(self, velocities: Sequence[float], plans: Sequence[PlannedPath]) -> list[DrivenMotion]:
        """Return motions that are run side by side, a process each."""
        fmu = cached_fmu(self.arm.unit, "native", on_message=lambda name: self.told(f"building {name} ..."))
        shares = [0.0] * len(plans)

        def run(k: int) -> DrivenMotion:
            """Run along one plan."""

            def went(share: float) -> None:
                """Take down the share of a run that is done."""
                shares[k] = share
                self.progress(sum(shares) / len(shares))

            return self._process(fmu, plans[k], velocities[k], went)

        with ThreadPoolExecutor(processors()) as pool:
            return list(pool.map(run, range(len(plans))))

    def _process(
        self, fmu: Path, plan: PlannedPath, velocity: float, progress: Callable[[float], None]
    ) -> DrivenMotion:
        """Return a motion that is run in a process of its own."""
        given = dict(zip(self.arm.inputs, self.arm.set_points(plan).T, strict=True))
        inputs = [LogInput(destination=Port(BLOCK, one), log=plan.name, column=one) for one in given]
        starts = {name: list(values) for name, values in self.arm.starts.items()}
        system = System(
            name="accuracy",
            path=Path(),
            step=plan.tsp,
            duration=float(plan.t[-1]),
            blocks=(Block(name=BLOCK, unit="driven_arm", start=starts),),
            inputs=tuple(inputs),
        )

        def column(one: LogInput) -> LogColumn:
            """Return the set points of an input."""
            return LogColumn(plan.t_ns, given[one.column])

        recorded = simulate(prepare(system, lambda block: fmu, column=column), progress=progress)
        if recorded.failed is not None and NOT_FINITE not in recorded.failed:
            raise CosimulationError(recorded.failed)
        values = np.column_stack([recorded.column(BLOCK, one) for one in self.arm.outputs])
        return self.arm.motion(plan, velocity, values, failed=recorded.failed is not None)

    def _in_numpy(self, velocities: Sequence[float], plans: Sequence[PlannedPath]) -> list[DrivenMotion]:
        """Return motions that are run at once in NumPy: each value of the unit holds one element a run."""
        values, ended = step_at_once(self.arm, plans, self.progress)
        return [
            self.arm.motion(plan, velocity, rows, failed=failed)
            for plan, velocity, rows, failed in zip(plans, velocities, values, ended, strict=True)
        ]


def step_at_once(
    arm: ArmUnit, plans: Sequence[PlannedPath], progress: Callable[[float], None]
) -> tuple[list[FloatArray], list[bool]]:
    """Return the outputs along some plans in SI, shape (samples, outputs), and which were no longer finite.

    Args:
        arm: The arm.
        plans: Of one period.
        progress: Told the share that is done, 0..1.
    """
    together = _Together(arm, plans)
    count = max(map(len, plans))
    for k in range(count):
        together.read(k)
        together.step(k)
        if not together.running:
            break
        progress((k + 1) / count)
    rows = zip(together.found, together.lengths, strict=True)
    return [values[:length] for values, length in rows], together.ended


class _Together:
    """Runs that one instance steps side by side, an element each, until the plan of each ends or it diverges.

    Attributes:
        running: Which runs still go on, in the order of the elements.
        found: Their outputs.
        lengths: So many samples of each are found.
        ended: Which of them were no longer finite.
    """

    def __init__(self, arm: ArmUnit, plans: Sequence[PlannedPath]) -> None:
        self._arm, self._period, self._instance = arm, plans[0].tsp, Instance(arm.unit)
        for name, values in arm.starts.items():
            names = [f"{name}[{k + 1}]" for k in range(len(values))]
            self._instance.set(self._references(names), list(values))
        self._inputs, self._outputs = self._references(arm.inputs), self._references(arm.outputs)
        self._given = [arm.set_points(plan) for plan in plans]
        self._wanted = [plan.joints.q for plan in plans if plan.joints is not None]
        self.running = list(range(len(plans)))
        self.found = [np.empty((len(plan), len(arm.outputs))) for plan in plans]
        self.lengths, self.ended = [len(plan) for plan in plans], [False] * len(plans)

    def read(self, k: int) -> None:
        """Set the inputs of a sample and keep its outputs; leave what is at its end or too far off."""
        self._instance.set(self._inputs, list(np.array([self._given[run][k] for run in self.running]).T))
        self._leave(self._failing(lambda: self._instance.get(self._outputs)), k)
        if not self.running:
            return
        read = self._instance.get(self._outputs)
        values = np.stack([np.broadcast_to(one, len(self.running)) for one in read])
        for place, run in enumerate(self.running):
            self.found[run][k] = values[:, place]
        wanted = np.array([self._wanted[run][k] for run in self.running]).T
        off = self._arm.beyond(list(values[: len(wanted)]), wanted).max(axis=0)
        for place, run in enumerate(self.running):
            if off[place] > 1.0:
                self.lengths[run] = k + 1
        self._keep([p for p, run in enumerate(self.running) if k + 1 < self.lengths[run]])

    def step(self, k: int) -> None:
        """Go to the next sample; leave what cannot."""
        if self.running:
            time = k * self._period
            self._leave(self._failing(lambda: self._instance.do_step(time, self._period)), k + 1)

    def _failing(self, act: Callable[[], object]) -> list[int]:
        """Do something with all elements, without those that fail at it; return the places of these."""
        before = self._instance.save()
        try:
            act()
        except UnitError:
            every = range(len(self.running))
            failing = [p for p in every if not self._works(act, before, [p])]
            self._works(act, before, [p for p in every if p not in failing])
            return failing
        return []

    def _works(self, act: Callable[[], object], before: Any, places: Sequence[int]) -> bool:
        """Do something with some elements alone; return whether it can be done."""
        self._instance.restore(_elements(before, places))
        try:
            act()
        except UnitError:
            return False
        return True

    def _leave(self, failing: Sequence[int], length: int) -> None:
        """Leave runs whose elements the instance holds no longer."""
        for place in failing:
            self.lengths[self.running[place]], self.ended[self.running[place]] = length, True
        self.running = [run for place, run in enumerate(self.running) if place not in failing]

    def _keep(self, places: Sequence[int]) -> None:
        """Keep some of the runs by their places."""
        if len(places) < len(self.running):
            self._instance.restore(_elements(self._instance.save(), places))
            self.running = [self.running[place] for place in places]

    def _references(self, names: Sequence[str]) -> list[int]:
        """Return the value references of scalars."""
        return [self._instance.reference(one) for one in names]


def _elements(saved: Any, places: Sequence[int]) -> Any:
    """Return what an instance remembers, of some of its elements alone."""
    time, started, values = saved
    return time, started, [one[list(places)] if np.ndim(one) else one for one in values]


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


AT_ONCE = 2
"""So many halvings are run at once, with all velocities that they may need: the processors share them."""

Within = Callable[[Sequence[float]], Sequence[bool]]
"""Runs some velocities in [m/s]; tells of each whether it is within the limit."""


def running_speed(within: Within, begun: Sequence[float]) -> float | None:
    """Return the largest velocity within the limit in [m/s], to 1 %; None if none is from 0.01 m/s on.

    From below: of the velocities that were run, the first that is not within the limit bounds it, whatever
    those above it do. Between it and the last one below the ratio is halved until it is 1 % or less. At
    10 m/s the search ends.

    Args:
        within: Runs velocities, and tells of each whether it is within the limit.
        begun: Velocities in [m/s] to begin with.
    """
    low, high = _bracket(within, sorted({min(max(one, SLOWEST), FASTEST) for one in begun}))
    if low is None or high is None:
        return low
    while high / low > FINE:
        middles = _inner(low, high, AT_ONCE)
        held = dict(zip(middles, within(middles), strict=True))
        while middles and high / low > FINE:
            middle = middles[len(middles) // 2]
            low, high = (middle, high) if held[middle] else (low, middle)
            middles = [one for one in middles if low < one < high]
    return low


def _bracket(within: Within, begun: Sequence[float]) -> tuple[float | None, float | None]:
    """Return the last velocity within the limit and the first that is not; None where there is none."""
    held = within(begun)
    if not held[0]:
        high = begun[0]
        while high > SLOWEST:
            low = max(high / 2.0, SLOWEST)
            if within([low])[0]:
                return low, high
            high = low
        return None, high
    first = next((k for k, one in enumerate(held) if not one), None)
    if first is not None:
        return begun[first - 1], begun[first]
    low = begun[-1]
    while low < FASTEST:
        high = min(2.0 * low, FASTEST)
        if not within([high])[0]:
            return low, high
        low = high
    return low, None


def _inner(low: float, high: float, halvings: int) -> list[float]:
    """Return the velocities that part a ratio into 2^halvings equal ones, without its ends."""
    parts = 2**halvings
    return [low * (high / low) ** (k / parts) for k in range(1, parts)]
