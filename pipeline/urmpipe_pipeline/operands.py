"""Operands of a command: a log, a folder of plots, a path, a recording or a simulation, each as a run.

- `load_runs`: the runs of several operands, or of both sides of one log, with all errors at once.
- `recording_to_run`, `load_comparison`: the run or the comparison of a recording.
- `is_log`, `log_files`: whether an operand is to be read, and the files of one log.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import compress
from os.path import isdir, isfile  # Path raises for a name that no file can have
from pathlib import Path
from typing import TypeAlias, TypeVar

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.errors import (
    Finding,
    Hint,
    LogError,
    OptionError,
    RecordingError,
    UrmpipeError,
    format_names,
    format_value,
    map_collecting_errors,
)
from urmpipe_models.files import log_stem
from urmpipe_pipeline.comparison.comparison import Comparison, FailedLog
from urmpipe_pipeline.logs import LogMap, MemoryTable
from urmpipe_pipeline.logs.formats.bag import is_bag_folder
from urmpipe_pipeline.logs.formats.parquet import is_data_set
from urmpipe_pipeline.logs.vocabulary import key
from urmpipe_pipeline.recording import is_recording
from urmpipe_pipeline.repolarization.audit import is_revolute
from urmpipe_pipeline.repolarization.interval import check_joint_names
from urmpipe_pipeline.results import read_recording, result_kind
from urmpipe_pipeline.runs.derivatives import Method
from urmpipe_pipeline.runs.ingest import ingest_log, with_robot
from urmpipe_pipeline.runs.run import Run, RunLike
from urmpipe_pipeline.simulations.simulation import Simulation

NOT_A_RUN = (
    "found the recording of {}, allowed: one with a motion, such as ingest, ik, plan or network drive write"
)
BLOCK_HINT = Hint("block", None, "takes the motion of a block", call="compare")
BASELINE_HINT = Hint("baseline", None, "compares it, alone, with an earlier one")

Operand: TypeAlias = Path | MemoryTable | RunLike | Simulation

_NUMBERS = re.compile(r"\d+(-\d+)?")  # of columns

MAX_VALUE = 1e12  # m or rad; larger doubles have a last digit of 0.1 mm, and powers that overflow

Item = TypeVar("Item")


def load_runs(
    operands: Sequence[Operand],
    *,
    sides: tuple[str, str] | None = None,
    robot: Chain | None = None,
    read: LogMap | None = None,
    tsp: float | None = None,
    derivative: Method | None = None,
    block: str | Sequence[str] | None = None,
    comparison_hints: Sequence[Hint] = (BASELINE_HINT,),
    failed: list[FailedLog] | None = None,
) -> list[Run]:
    """Return the runs of several operands, or both sides of one log; the reading options apply to all logs.

    Args:
        operands: Recordings (.rrd), logs and paths (CSV), folders whose CSV files make one log, tables in
            memory, runs, results that contain a run, and simulations, of which a block moves.
        sides: Command and measurement of one log that is to be read: a word in the names of the columns of
            each side, or "rest" for all others.
        robot: The arm; it replaces the one of a recording or a run.
        read: How to read the logs; the unit of a column applies to those logs that have it.
        tsp: Period of the grid of the logs in [s].
        derivative: How the joints of the logs are differentiated.
        block: The block whose motion is used, of every simulation, or one per simulation.
        comparison_hints: What to do with the recording of a comparison, which is no operand.
        failed: List that receives the logs after the reference that cannot be read, if another log can; None:
            a log that cannot be read is an error.

    Raises:
        UrmpipeError: With all errors of all operands: a bad CSV, a recording without a run.
        OptionError: If there are sides of anything except one log, or blocks without a simulation.
    """
    shared = sum(map(is_log, operands)) > 1
    read, blocks = replace(read or LogMap(), shared=shared), _Blocks(block)

    def load(operand_side: tuple[Operand, tuple[str, str] | None]) -> Run:
        operand, side = operand_side
        if isinstance(operand, Path) and _is_recording(operand):
            operand = _read_run_like(operand, comparison_hints)
        try:
            if isinstance(operand, (Path, MemoryTable)):
                run = _ingest(operand, replace(read, pair=side), robot, tsp, derivative)
            elif isinstance(operand, Simulation):
                from urmpipe_pipeline.simulations.motion import run_of_block  # few operands are simulations

                run = run_of_block(operand, blocks.next(), robot)
            else:
                run = with_robot(operand.as_run(), robot)
            _check_values(run)
        except LogError as error:  # the findings of several operands need their files
            file = str(operand_side[0]) if isinstance(operand_side[0], Path) else None
            findings = (replace(finding, file=finding.file or file) for finding in error.findings)
            raise LogError(*findings) from error
        return run

    if sides is not None:
        _check_sides(operands, sides)
        runs = map_collecting_errors(load, [(operands[0], side) for side in (sides, sides[::-1])])
        blocks.check_all_used()
        _check_intervals(read, runs)
        arm = next((run.robot for run in runs if run.robot), None)  # may be inferred from one side only
        return [with_robot(run, arm) if run.log.joints and run.robot is None else run for run in runs]
    load_each = map_collecting_errors if failed is None else _map_keeping_errors
    results: Sequence[Run | UrmpipeError] = load_each(load, [(operand, None) for operand in operands])
    blocks.check_all_used()
    runs = [result for result in results if isinstance(result, Run)]
    if shared and len(runs) == len(results):
        _check_columns(read, runs)
        _check_intervals(read, runs)
    named = list(zip(_unique_names(operands, results), results, strict=True))
    if failed is not None:
        failed += [
            FailedLog(name, error.findings) for name, error in named if isinstance(error, UrmpipeError)
        ]
    return [replace(run, name=name) for name, run in named if isinstance(run, Run)]


def _ingest(
    log: Path | MemoryTable,
    read: LogMap,
    robot: Chain | None,
    tsp: float | None,
    derivative: Method | None,
) -> Run:
    """Return the run of a log, a folder, or a side of a log."""
    files = [log] if isinstance(log, MemoryTable) else log_files(log)
    name = log.resolve().name if isinstance(log, Path) and log.is_dir() else None
    if read.pair is not None:
        name = f"{log.name if isinstance(log, MemoryTable) else log_stem(log.resolve())} ({read.pair[0]})"
    return ingest_log(files, robot=robot, read=read, tsp=tsp, derivative=derivative, name=name)


def _check_values(run: Run) -> None:
    log = run.log
    positions = [] if log.tcp_position is None else [*zip(("x", "y", "z"), log.tcp_position.T, strict=True)]
    findings = []
    for name, values in (*zip(log.joints, log.q.T, strict=True), *positions):
        rows = np.flatnonzero(np.abs(values) > MAX_VALUE)
        if len(rows):
            more = f" and {len(rows) - 1} more" if len(rows) > 1 else ""
            message = f"found {values[rows[0]]:g} (in SI){more}, allowed: up to {MAX_VALUE:g}"
            findings.append(Finding(message, row=int(rows[0]) + 1, column=name))
    if findings:
        raise LogError(*findings)


def _map_keeping_errors(
    function: Callable[[Item], Run], items: Sequence[Item]
) -> Sequence[Run | UrmpipeError]:
    """Return the run or the error of each item.

    Raises:
        UrmpipeError: With all errors, if the first item or all others have one.
    """

    def run_or_error(item: Item) -> Run | UrmpipeError:
        try:
            return function(item)
        except UrmpipeError as error:
            return error

    def raise_error(result: Run | UrmpipeError) -> Run:
        if isinstance(result, Run):
            return result
        raise result

    results = [run_or_error(item) for item in items]
    reference, *logs = (isinstance(result, Run) for result in results)
    return results if reference and any(logs) else map_collecting_errors(raise_error, results)


class _Blocks:
    """The blocks whose motions are used: one for all simulations, or one per simulation.

    Args:
        names: Their names; None for the only block that has a motion.
    """

    def __init__(self, names: str | Sequence[str] | None) -> None:
        self._names = [names] if isinstance(names, str) else list(names or ())
        self._simulations = 0

    def next(self) -> str | None:
        """Return the block of the next simulation; None without a name."""
        self._simulations += 1
        if len(self._names) == 1:
            return self._names[0]
        return self._names[self._simulations - 1] if self._simulations <= len(self._names) else None

    def check_all_used(self) -> None:
        """Raise an `OptionError` if there is no simulation for a name, or no name for one of several."""
        if len(self._names) in {0, 1, self._simulations} and (self._simulations or not self._names):
            return
        names = ", ".join(map(format_value, self._names))
        found = f"{names} with {format_count(self._simulations, 'simulation')}"
        allowed = "one block, or one for each simulation"
        if not self._simulations:
            found, allowed = f"{names} without a simulation", "only with the recording of a simulation"
        raise OptionError(Finding(parameter="block", found=found, allowed=allowed))


def _check_sides(operands: Sequence[Operand], sides: tuple[str, str]) -> None:
    if len(operands) > 1:
        fault, allowed = f" with {len(operands)} logs", "one log"
    elif not is_log(operands[0]):
        fault, allowed = " with a log that was read before", "a log file"
    elif sides[0].lower() == sides[1].lower():
        fault, allowed = ", the same word twice", "two words, such as target,actual"
    else:
        return
    raise OptionError(Finding(parameter="sides", found=f"{','.join(sides)}{fault}", allowed=allowed))


def _check_columns(read: LogMap, runs: Sequence[Run]) -> None:
    """Raise an `OptionError` with each column that the options name, and that no log uses."""
    columns = [column for run in runs for column in run.log.columns]
    used = {
        name
        for column in columns
        for name in (column.name, column.header, key(column.name), str(column.number))
    }
    named = {"unit": [name for name in read.unit if name]} | {
        field: [name for name in getattr(read, field) if not _NUMBERS.fullmatch(name)]
        for field in ("joints", "position", "orientation", "measured")
    }
    unused = [
        (field, name) for field, names in named.items() for name in names if not {name, key(name)} & used
    ]
    if unused:
        read_names = [column.name for column in columns]
        raise OptionError(
            *(
                Finding(
                    parameter=field,
                    found=f"no column {format_value(name)}",
                    allowed=format_names(name, read_names),
                )
                for field, name in unused
            )
        )


def _check_intervals(read: LogMap, runs: Sequence[Run]) -> None:
    revolute = (name for run in runs for name in compress(run.log.joints, is_revolute(run.log, run.robot)))
    check_joint_names(read.interval, revolute)


def _unique_names(operands: Sequence[Operand], results: Sequence[Run | UrmpipeError]) -> list[str]:
    """Return unique names of runs: of files with the same name by their stems, or also by their folders."""
    files = [operand.resolve() if isinstance(operand, Path) else None for operand in operands]
    stems = ["" if file is None else file.name if file.is_dir() else log_stem(file) for file in files]
    names = [
        result.name if isinstance(result, Run) else stem or operand.name
        for operand, result, stem in zip(operands, results, stems, strict=True)
    ]
    unique = []
    for name, file, stem in zip(names, files, stems, strict=True):
        if file is None or names.count(name) == 1:
            unique.append(name)
        else:
            unique.append(stem if stems.count(stem) == 1 else f"{stem} ({file.parent.name})")
    return unique


def _read_run_like(path: Path, comparison_hints: Sequence[Hint]) -> RunLike | Simulation:
    """Return the result of a recording that contains a run or motions.

    Raises:
        RecordingError: If it is another kind of result.
    """
    result = read_recording(path)
    if isinstance(result, (RunLike, Simulation)):
        return result
    hints = tuple(comparison_hints) if isinstance(result, Comparison) else ()
    raise RecordingError(Finding(NOT_A_RUN.format(result_kind(result).with_article), str(path), hints=hints))


def recording_to_run(
    files: Sequence[Path | MemoryTable], robot: Chain | None, reading: Mapping[str, object]
) -> Run | None:
    """Return the run of a recording, with another arm if one is given; None for logs, which are to be read.

    Args:
        files: One recording, or the files of a log.
        robot: The arm that replaces the one of the recording.
        reading: Reading options by keyword; None or False if unset.

    Raises:
        RecordingError: If it is a recording without a run, or one of several files.
        OptionError: With all reading options: a recording is used as it was ingested.
    """
    recordings = [file for file in files if isinstance(file, Path) and _is_recording(file)]
    if not recordings:
        return None
    if len(files) > 1:
        message = "found a recording among files of one log, allowed: it alone, or the files"
        raise RecordingError(*(Finding(message, str(file)) for file in recordings))
    reject_reading_options(reading)
    result = _read_run_like(recordings[0], ())
    if isinstance(result, Simulation):
        message = NOT_A_RUN.format("a simulation")
        raise RecordingError(Finding(message, str(recordings[0]), hints=(BLOCK_HINT,)))
    return with_robot(result.as_run(), robot)


def reject_reading_options(reading: Mapping[str, object]) -> None:
    """Raise an `OptionError` with all reading options that are set, as there is no log to be read."""
    unused = [name for name, value in reading.items() if value is not None and value is not False]
    if unused:
        found = "found with an ingested log"
        allowed = "with a log; a run or a recording is used as ingested"
        raise OptionError(*(Finding(found, parameter=name, allowed=allowed) for name in unused))


def load_comparison(operand: Path) -> Comparison | None:
    """Return the comparison in a recording; None if the operand is anything else.

    Raises:
        RecordingError: If it is a damaged recording.
    """
    result = read_recording(operand) if _is_recording(operand) else None
    return result if isinstance(result, Comparison) else None


def is_log(operand: object) -> bool:
    """Return whether an operand is a log that is to be read."""
    return isinstance(operand, MemoryTable) or (isinstance(operand, Path) and not _is_recording(operand))


def _is_recording(operand: Path) -> bool:
    return operand.suffix == ".rrd" or (isfile(operand) and is_recording(operand))  # noqa: PTH113


def log_files(operand: Path) -> list[Path]:
    """Return the files of one log: the file, the folder of a recording or data set, or the CSV files of one.

    Raises:
        LogError: If a folder has no CSV file.
    """
    if not isdir(operand) or is_bag_folder(operand) or is_data_set(operand):  # noqa: PTH112
        return [operand]
    files = sorted(path for path in operand.iterdir() if path.suffix.lower() in (".csv", ".txt"))
    if not files:
        message = "found a folder without CSV files, allowed: the plots of one log"
        raise LogError(Finding(message, file=str(operand)))
    return files
