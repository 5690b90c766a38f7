"""The parts of a system: its robots, logs and units, and the FMU of each block from the cache.

1. Blocks: each has an FMU, a file or a unit, and a unit may have a robot and a log. All are read at once;
   errors are raised when a part is requested, so that the plan collects them.
2. Inputs: the column of a log that an input follows.
3. Held logs: samples of joints near a communication point are moved onto it; others are held, with a warning.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from urmpipe.arm_placing import place_robot
from urmpipe.reading import resolve_reading
from urmpipe.systems.logs import LogTable, hold_warning, read_table, snap_to_points
from urmpipe.systems.units import Backend, parse_columns, unit_of
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

ON_PYTHON = SLOW  # kind of the warning that no native FMUs can be built; also printed before the first step
CHAIN, METER = "kinematic_chain", "delta_meter"  # units that are shown as a robot, and judged


class Blocks:
    """The units, robots and logs of the blocks and inputs of a system.

    Args:
        system: The system.
        bundled: Names of logs that were shipped with urmpipe; they precede files with these names.
        backend: The backend of the FMUs of units.
        reading: How to read a log where it does not show it: keywords that override its map.
        on_message: Called with a line when an FMU is built, and if native FMUs cannot be built.

    Attributes:
        units: The unit of each block that is one.
        chains: The robot of each block that has one.
        files: The files that were read.
        warnings: The warnings of reading the logs, and that units run on Python.
        end: The end of the longest log in [s]; None without one.
        period: The shortest period in [s] of the joint logs that are held between samples; None without one.
    """

    def __init__(
        self,
        system: System,
        *,
        bundled: Collection[str] = (),
        backend: Backend | None = None,
        reading: Mapping[str, Any] | None = None,
        on_message: Callable[[str], None] | None = None,
    ) -> None:
        self._bundled, self._reading = bundled, reading or {}
        self._on_message = on_message or (lambda line: None)
        self._backend, reason = select_backend(backend)
        self.units: dict[str, BlockModel] = {}
        self.chains: dict[str, Chain] = {}
        self.files: list[Path] = []
        self.warnings: list[LogWarning] = []
        self.end: float | None = None
        self.period: float | None = None
        self._hold_times: dict[str, IntArray] = {}
        self._errors: dict[str, UrmpipeError] = {}
        self._columns: dict[Port, LogTable] = {}
        for block in system.blocks:
            if block.name not in system.unusable_blocks:
                with self._keep_error(block.name):
                    self._add_block(block)
        for followed in system.inputs:
            if followed.log:
                with self._keep_error(str(followed.destination)):
                    self._columns[followed.destination] = self._read(followed.log, [followed.column])
        self._snap_hold_times(system.step or self.period or DEFAULT_STEP)
        if reason and self.units:
            message = f"the units run on Python, a hundred times slower than native ones: {reason}"
            self.warnings.append(LogWarning(SLOW, message))
            self._on_message(message)

    def make(self, block: Block) -> Path:
        """Return the FMU of a block, built if it is not in the cache.

        Raises:
            UrmpipeError: With all faults of its unit, robot, log or file.
        """
        self._raise_error(block.name)

        def report(name: str) -> None:
            self._on_message(f"building {name} for block {block.name} ...")

        return block.fmu or cached_fmu(self.units[block.name], self._backend, on_message=report)

    def column(self, followed: LogInput) -> LogColumn:
        """Return the column of a log that an input follows.

        Raises:
            UrmpipeError: If it cannot be read.
        """
        self._raise_error(str(followed.destination))
        log = self._columns[followed.destination]
        return LogColumn(log.table.t_ns, log.table.values[:, 0], log.columns[0].unit)

    def hold_warnings(self, step: float, count: int) -> Iterator[LogWarning]:
        """Yield a warning for each joint log that is held at communication points between its samples.

        Args:
            step: Communication step in [s].
            count: Number of steps.
        """
        for block, t_ns in self._hold_times.items():
            if warning := hold_warning(block, t_ns, step, count):
                yield warning

    @contextmanager
    def _keep_error(self, name: str) -> Iterator[None]:
        try:
            yield
        except UrmpipeError as error:
            self._errors[name] = error

    def _raise_error(self, name: str) -> None:
        if name in self._errors:
            raise self._errors[name]

    def _add_block(self, block: Block) -> None:
        path = block.fmu or block.file
        if path is not None:
            self.files.append(path)
        if block.file is not None:
            self.units[block.name] = unit_of(block.file, options=block.options)
        elif block.fmu is None:
            self.units[block.name] = self._build_unit(block)

    def _build_unit(self, block: Block) -> BlockModel:
        options = dict(block.options)
        robot, log, log_map = (_parse_text(name, options.pop(name, None)) for name in ("robot", "log", "map"))
        arm = place_robot(robot)
        if arm is not None:
            self.chains[block.name] = arm
        named = (robot, options.get("network"))
        self.files += [Path(name) for name in named if isinstance(name, str) and Path(name).is_file()]
        if log is None and log_map is not None:
            message = f"found {log_map} without a log, allowed: with log = ..."
            raise OptionError(Finding(message, about="map"))
        if log is None:
            return unit_of(block.unit, robot=arm, options=options)
        columns = parse_columns(options.pop("columns", None))
        table = self._read(log, columns, arm, log_map)
        has_joints = columns is None and any(column.name in ("q", "s") for column in table.columns)
        if has_joints and not options.get("interpolate"):
            clock = row_clock(table.table.t_ns)
            self._hold_times[block.name] = clock.t_ns
            self.end = max(self.end or 0.0, float(clock.t_ns[-1]) / 1e9)
            if period := clock.period / 1e9:
                self.period = min(self.period or period, period)
        return unit_of(block.unit, robot=arm, log=table, options=options)

    def _read(
        self, name: str, columns: list[str] | None, robot: Chain | None = None, log_map: str | None = None
    ) -> LogTable:
        path = LOGS / name if name in self._bundled else Path(name)
        reading = self._reading if log_map is None else {**self._reading, "map": log_map}
        log = read_table(path, columns, robot=robot, read=resolve_reading(reading).options)
        self.files += log.files
        self.warnings += [warning for warning in log.warnings if warning not in self.warnings]
        self.end = max(self.end or 0.0, float(log.table.t_ns[-1]) / 1e9)
        return log

    def _snap_hold_times(self, step: float) -> None:
        """Move samples of held logs that are near communication points onto these."""
        for block in self._hold_times.keys() & self.units.keys():
            self._hold_times[block] = snap_to_points(self._hold_times[block], step)
            unit = self.units[block]
            if unit.table is not None:
                self.units[block] = replace(unit, table=Table(self._hold_times[block], unit.table.values))


def _parse_text(name: str, value: Any) -> str | None:
    if value is not None and not isinstance(value, str):
        raise OptionError(f"{name}: found {format_value(value)}, allowed: a name or a file")
    return value
