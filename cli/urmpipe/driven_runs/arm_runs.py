"""Runs of an arm with drives along one path at many velocities: compiled, or in NumPy at once."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe.driven_runs.arm_unit import ArmUnit
from urmpipe_fmus.build.fmu import cached_fmu
from urmpipe_fmus.cosim.plan import LogColumn, prepare
from urmpipe_fmus.cosim.simulation import simulate
from urmpipe_fmus.cosim.system import Block, LogInput, Port, System
from urmpipe_fmus.instance import Instance
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import CosimulationError, UnitError
from urmpipe_pipeline.accuracy.driven_motion import DrivenMotion
from urmpipe_pipeline.planned_paths.result import PlannedPath

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
