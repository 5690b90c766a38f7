"""The parts of a system: its robots, logs and units, and the FMU of each block from the cache."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from urmpipe.arm_placing import place_robot
from urmpipe.log_table import LogTable
from urmpipe.reading import resolved
from urmpipe.systems.held_logs import between_samples, on_points
from urmpipe.systems.log_tables import read_table
from urmpipe.systems.units import Backend, column_names, unit_of
from urmpipe_datasets import LOGS
from urmpipe_fmus.block import Table
from urmpipe_fmus.build.fmu import cached_fmu, select_backend
from urmpipe_fmus.cosim.plan import LogColumn
from urmpipe_fmus.cosim.system import DEFAULT_STEP
from urmpipe_models.errors import Finding, OptionError, UrmpipeError, format_value
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.runs.grid import row_clock
from urmpipe_pipeline.simulations.simulation import SLOW

if TYPE_CHECKING:
    from urmpipe_fmus.block import BlockModel
    from urmpipe_fmus.cosim.system import Block, LogInput, Port, System
    from urmpipe_models.arm.chain import Chain
    from urmpipe_models.elementwise import IntArray

ON_PYTHON = SLOW
"""The kind of the warning that no native FMUs can be built; it is told before the first step, too."""

CHAIN, METER = "kinematic_chain", "delta_meter"
"""The units that are shown as an arm, and judged."""


class Blocks:
    """What the blocks and inputs of a system are made of, read at once.

    What is wrong with one is raised when it is asked for, so that all of it is told together.

    Args:
        system: The system.
        bundled: Names of logs that came with urmpipe, and are those whatever else is called so.
        backend: What the FMUs of units are built with.
        reading: How to read a log where it cannot tell by itself: keywords that come before its own map.
        told: Told what takes its time: an FMU that is built, and Python where native is not to be had.

    Attributes:
        units: The unit of each block that is one.
        chains: The arm of each block that has one.
        files: The files that were read.
        warnings: What a person should know of the logs.
        end: Where the longest log ends in [s]; None without one.
        period: The finest period in [s] of the joint logs that are held between samples; None without one.
    """

    def __init__(
        self,
        system: System,
        *,
        bundled: Collection[str] = (),
        backend: Backend | None = None,
        reading: Mapping[str, Any] | None = None,
        told: Callable[[str], None] | None = None,
    ) -> None:
        self._bundled, self._reading = bundled, reading or {}
        self._told = told or (lambda line: None)
        self._backend, self._slow = select_backend(backend)
        self.units: dict[str, BlockModel] = {}
        self.chains: dict[str, Chain] = {}
        self.files: list[Path] = []
        self.warnings: list[LogWarning] = []
        self.end: float | None = None
        self.period: float | None = None
        self._held: dict[str, IntArray] = {}
        self._faults: dict[str, UrmpipeError] = {}
        self._columns: dict[Port, LogTable] = {}
        for block in (one for one in system.blocks if one.name not in system.unusable_blocks):
            self._try(block.name, partial(self._take, block))
        for one in (each for each in system.inputs if each.log):
            self._try(str(one.destination), partial(self._follow, one))
        self._meet(system.step or self.period or DEFAULT_STEP)
        if self._slow and self.units:
            said = f"the units run on Python, a hundred times slower than native ones: {self._slow}"
            self.warnings.append(LogWarning(SLOW, said))
            self._told(said)

    def make(self, block: Block) -> Path:
        """Return the FMU of a block, built if it is not in the cache.

        Raises:
            UrmpipeError: With what is wrong with its unit, its robot, its log or its file.
        """
        if block.name in self._faults:
            raise self._faults[block.name]
        return block.fmu or self._fmu(block.name)

    def column(self, asked: LogInput) -> LogColumn:
        """Return the column of a log that an input follows.

        Raises:
            UrmpipeError: If it cannot be read.
        """
        if str(asked.destination) in self._faults:
            raise self._faults[str(asked.destination)]
        found = self._columns[asked.destination]
        return LogColumn(found.table.t_ns, found.table.values[:, 0], found.columns[0].unit)

    def _try(self, name: str, take: Callable[[], None]) -> None:
        """Take a part, or remember what is wrong with it."""
        try:
            take()
        except UrmpipeError as error:
            self._faults[name] = error

    def _take(self, block: Block) -> None:
        """Take a block: its file, or its unit."""
        path = block.fmu or block.file
        if path is not None:
            self.files.append(path)
        if block.fmu is None:
            self.units[block.name] = self._unit(block)

    def _follow(self, asked: LogInput) -> None:
        """Take the log of an input."""
        self._columns[asked.destination] = self._table(asked.log, [asked.column])

    def _unit(self, block: Block) -> BlockModel:
        """Return the unit of a block."""
        options = dict(block.options)
        if block.file is not None:
            return unit_of(block.file, options=options)
        robot, log, log_map = (_text(name, options.pop(name, None)) for name in ("robot", "log", "map"))
        arm = place_robot(robot)
        if arm is not None:
            self.chains[block.name] = arm
        parts = (robot, options.get("network"))
        self.files += [Path(part) for part in parts if isinstance(part, str) and Path(part).is_file()]
        if log is None and log_map is not None:
            found = f"{log_map} without a log"
            raise OptionError(Finding(about="map", found=found, allowed="with log = ..."))
        if log is None:
            return unit_of(block.unit, robot=arm, options=options)
        names = column_names(options.pop("columns", None))
        table = self._table(log, names, arm, log_map)
        motion = names is None and any(one.name in ("q", "s") for one in table.columns)
        if motion and not options.get("interpolate"):
            self._hold(block.name, table.table.t_ns)
        return unit_of(block.unit, robot=arm, log=table, options=options)

    def _hold(self, block: str, t_ns: IntArray) -> None:
        """Remember the clock of joint values that are held between samples."""
        clock = row_clock(t_ns)
        self._held[block] = clock.t_ns
        self.end = max(self.end or 0.0, float(clock.t_ns[-1]) / 1e9)
        if period := clock.period / 1e9:
            self.period = min(self.period or period, period)

    def _meet(self, step: float) -> None:
        """Let the samples of held logs that are on communication points be met by these."""
        for block in self._held.keys() & self.units.keys():
            self._held[block] = on_points(self._held[block], step)
            unit = self.units[block]
            if unit.table is not None:
                self.units[block] = replace(unit, table=Table(self._held[block], unit.table.values))

    def between_samples(self, step: float, count: int) -> Iterator[LogWarning]:
        """Yield which joint logs are held at communication points that lie between two of their samples.

        Args:
            step: Communication step in [s].
            count: Number of steps.
        """
        for block, t_ns in self._held.items():
            if said := between_samples(block, t_ns, step, count):
                yield said

    def _fmu(self, block: str) -> Path:
        """Return the FMU of a block from the cache; tell if it is built."""

        def built(name: str) -> None:
            """Tell that the FMU of a unit is built."""
            self._told(f"building {name} for block {block} ...")

        return cached_fmu(self.units[block], self._backend, on_message=built)

    def _table(
        self, name: str, columns: list[str] | None, robot: Chain | None = None, log_map: str | None = None
    ) -> LogTable:
        """Return a log by the name that the system gives it, and remember what there is to know of it."""
        path = LOGS / name if name in self._bundled else Path(name)
        reading = self._reading if log_map is None else {**self._reading, "log_map": log_map}
        found = read_table(path, columns, robot=robot, read=resolved(reading).options)
        self.files += found.files
        self.warnings += [one for one in found.warnings if one not in self.warnings]
        self.end = max(self.end or 0.0, float(found.table.t_ns[-1]) / 1e9)
        return found


def _text(name: str, value: Any) -> str | None:
    """Return an option that names a robot or a file."""
    if value is not None and not isinstance(value, str):
        raise OptionError(f"{name}: found {format_value(value)}, allowed: a name or a file")
    return value
