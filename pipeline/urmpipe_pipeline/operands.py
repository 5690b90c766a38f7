"""Operands of a command: a log, a folder of plots, a path, a recording or a simulation, each as a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import compress
from os.path import isdir, isfile  # of a name that no file may have Path raises
from pathlib import Path
from typing import TypeAlias, TypeVar

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import (
    Finding,
    Hint,
    LogError,
    OptionError,
    RecordingError,
    UrmpipeError,
    format_value,
    map_collecting_errors,
)
from urmpipe_pipeline.comparison.comparison import Comparison, Unjudged
from urmpipe_pipeline.networks.network_motion import NetworkMotion
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.recording import is_recording
from urmpipe_pipeline.repolarization.audit import is_revolute
from urmpipe_pipeline.repolarization.interval import check_joint_names
from urmpipe_pipeline.results import read_recording, result_kind
from urmpipe_pipeline.runs.derivatives import Method
from urmpipe_pipeline.runs.ingest import ingest_log, with_robot
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.simulations.motion import run_of_block
from urmpipe_pipeline.simulations.simulation import Simulation
from urmpipe_pipeline.solved_targets.result import SolvedTargets
from urmpipe_pipeline.sources import Held, ReadOptions
from urmpipe_pipeline.sources.vocabulary import key
from urmpipe_pipeline.text import counted

JUDGED = "found the recording of {}, allowed: one that ingest wrote"

BLOCK_HINT = Hint("block", None, "takes the motion of a block", call="compare")

BASELINE_HINT = Hint("baseline", None, "compares it, alone, with an earlier one")

RunLike: TypeAlias = Run | SolvedTargets | PlannedPath | NetworkMotion
RUN_LIKE: tuple[type[RunLike], ...] = (Run, SolvedTargets, PlannedPath, NetworkMotion)
"""Results that are a run, or have one."""

Operand: TypeAlias = Path | Held | RunLike | Simulation
"""What stands for a run, or is read as one."""

MAX_VALUE = 1e12
"""In [m] or [rad]: the last digit of a double beyond is 0.1 mm, and powers of it overflow in a comparison."""

Given = TypeVar("Given")


def load_runs(
    operands: Sequence[Operand],
    *,
    sides: tuple[str, str] | None = None,
    robot: Chain | None = None,
    read: ReadOptions | None = None,
    tsp: float | None = None,
    derivative: Method | None = None,
    block: str | Sequence[str] | None = None,
    judged: Sequence[Hint] = (BASELINE_HINT,),
    unjudged: list[Unjudged] | None = None,
) -> list[Run]:
    """Return the runs of several operands, or both sides of one log; the reading options hold for every log.

    Args:
        operands: Recordings (.rrd), logs and paths (CSV), folders whose CSV files make one log; tables in
            memory, runs, solved targets as theirs, and simulations as the motion of a block.
        sides: What was asked for, then what was done, of one log that is yet to be read: a word in the names
            of the columns of each side, or "rest" for all others.
        robot: The arm; of a recording or a run it replaces the one inside.
        read: How to read the CSV files, all of them; the unit of a column holds for those that have it.
        tsp: Period of the grid in [s], of the CSV files.
        derivative: How the joints of CSV files are differentiated.
        block: The block whose motion is meant of every simulation, or one for each of them in their order.
        judged: What the recording of a comparison, which is no operand, can be given to.
        unjudged: Takes the logs behind the reference that cannot be read, if another can; None: none may be.

    Raises:
        UrmpipeError: With everything that is wrong with any of them: a bad CSV, a recording without a run.
        OptionError: If sides are wanted of anything but one log, or blocks of no simulation.
    """
    shared = sum(map(is_log, operands)) > 1
    read, blocks = replace(read or ReadOptions(), shared=shared), _Blocks(block)

    def run_of(one: tuple[Operand, tuple[str, str] | None]) -> Run:
        """Return the run that an operand is, has recorded, or is read as, with values to compare."""
        operand, side = one
        made = _recorded(operand, judged) if isinstance(operand, Path) and _is_recording(operand) else operand
        try:
            if isinstance(made, (Path, Held)):
                return _refuse_huge(_read(made, replace(read, side=side), robot, tsp, derivative))
            if isinstance(made, Simulation):
                return _refuse_huge(run_of_block(made, blocks.next(), robot))
            return _refuse_huge(with_robot(made.as_run(), robot))
        except LogError as error:  # of several operands, each is named
            name = str(operand) if isinstance(operand, Path) else None
            raise LogError(*(replace(one, file=one.file or name) for one in error.findings)) from error

    if sides is not None:
        _refuse_sides(operands, sides)
        both = map_collecting_errors(run_of, [(operands[0], one) for one in (sides, sides[::-1])])
        blocks.refuse_unused()
        _refuse_unturned(read, both)
        return _on_one_arm(both)
    found = (map_collecting_errors if unjudged is None else _runs_or_errors)(
        run_of, [(one, None) for one in operands]
    )
    blocks.refuse_unused()
    runs = [one for one in found if isinstance(one, Run)]
    if shared and len(runs) == len(found):
        _refuse_unreached(read, runs)
        _refuse_unturned(read, runs)
    named = list(zip(_names(operands, found), found, strict=True))
    if unjudged is not None:
        unjudged += [Unjudged(name, one.findings) for name, one in named if isinstance(one, UrmpipeError)]
    return [replace(one, name=name) for name, one in named if isinstance(one, Run)]


def _refuse_huge(run: Run) -> Run:
    """Return a run; raise a `LogError` with each column of its log that has values beyond `MAX_VALUE`."""
    log = run.log
    positions = [] if log.tcp_position is None else [*zip(("x", "y", "z"), log.tcp_position.T, strict=True)]
    faults = []
    for name, values in (*zip(log.joints, log.q.T, strict=True), *positions):
        rows = np.flatnonzero(np.abs(values) > MAX_VALUE)
        if len(rows):
            said = f"found {values[rows[0]]:g} (in SI) and {len(rows) - 1} more, allowed: up to {MAX_VALUE:g}"
            faults.append(Finding(said.replace(" and 0 more", ""), row=int(rows[0]) + 1, column=name))
    if faults:
        raise LogError(*faults)
    return run


def _read(
    log: Path | Held, read: ReadOptions, robot: Chain | None, tsp: float | None, derivative: Method | None
) -> Run:
    """Return the run that a log, a folder, or a side of a log is read as."""
    files = [log] if isinstance(log, Held) else log_files(log)
    name = log.resolve().name if isinstance(log, Path) and log.is_dir() else None
    stem = log.name if isinstance(log, Held) else log.resolve().stem
    name = name if read.side is None else f"{stem} ({read.side[0]})"
    return ingest_log(files, robot=robot, read=read, tsp=tsp, derivative=derivative, name=name)


def _runs_or_errors(make: Callable[[Given], Run], each: Sequence[Given]) -> Sequence[Run | UrmpipeError]:
    """Return what a function makes of the reference and of logs, or what is wrong with a log.

    Raises:
        UrmpipeError: With all that is wrong, if it is the reference, or every log.
    """

    def tried(one: Given) -> Run | UrmpipeError:
        try:
            return make(one)
        except UrmpipeError as error:
            return error

    def made(one: Run | UrmpipeError) -> Run:
        if isinstance(one, Run):
            return one
        raise one

    found = [tried(one) for one in each]
    reference, *logs = (isinstance(one, Run) for one in found)
    return found if reference and any(logs) else map_collecting_errors(made, found)


class _Blocks:
    """The blocks whose motions are meant: one for every simulation, or one for each in their order.

    Args:
        named: The names; None for the only block that has a motion.
    """

    def __init__(self, named: str | Sequence[str] | None) -> None:
        self._named = [named] if isinstance(named, str) else list(named or ())
        self._simulations = 0

    def next(self) -> str | None:
        """Return the block of the next simulation; None where none is named."""
        self._simulations += 1
        if len(self._named) == 1:
            return self._named[0]
        return self._named[self._simulations - 1] if self._simulations <= len(self._named) else None

    def refuse_unused(self) -> None:
        """Raise an `OptionError` if blocks are named of no simulation, or of more or fewer than there are."""
        if len(self._named) in {0, 1, self._simulations} and (self._simulations or not self._named):
            return
        found = (
            ", ".join(map(format_value, self._named)) + f" with {counted(self._simulations, 'simulation')}"
        )
        allowed = "a block of a simulation, or one for each of several"
        raise OptionError(Finding(parameter="block", found=found, allowed=allowed))


def _refuse_sides(operands: Sequence[Operand], sides: tuple[str, str]) -> None:
    """Raise an `OptionError` if there is more than one log, it was read before, or its sides are one."""
    log, several = operands[0], len(operands) > 1
    if several or not is_log(log) or sides[0].lower() == sides[1].lower():
        found = ",".join(sides) + (" with several logs" if several else "")
        allowed = "two words for two sides of one log that is yet to be read"
        raise OptionError(Finding(parameter="sides", found=found, allowed=allowed))


def _on_one_arm(runs: Sequence[Run]) -> list[Run]:
    """Return runs of which those without an arm have the one that another singles out."""
    arm = next((run.robot for run in runs if run.robot), None)
    return [with_robot(run, arm) if run.log.joints and run.robot is None else run for run in runs]


def _refuse_unreached(read: ReadOptions, runs: Sequence[Run]) -> None:
    """Raise an `OptionError` with each column that is given a unit, and that no log of several has in use."""
    columns = [one for run in runs for one in run.log.columns]
    used = {called for one in columns for called in (one.name, one.header, key(one.name), str(one.number))}
    lost = [name for name in read.unit if name and not {name, key(name)} & used]
    if lost:
        allowed = "a column that a log has, and that is read"
        said = (
            Finding(parameter="unit", found=f"no column {format_value(name)}", allowed=allowed)
            for name in lost
        )
        raise OptionError(*said)


def _refuse_unturned(read: ReadOptions, runs: Sequence[Run]) -> None:
    """Raise an `OptionError` with each joint that is given an interval, and that turns in no run."""
    turn = (name for run in runs for name in compress(run.log.joints, is_revolute(run.log, run.robot)))
    check_joint_names(read.interval, turn)


def _names(operands: Sequence[Operand], runs: Sequence[Run | UrmpipeError]) -> list[str]:
    """Return names of runs, of which no two are one: of files by these, or by their folders, too."""
    files = [one.resolve() if isinstance(one, Path) else None for one in operands]
    stems = ["" if path is None else path.name if path.is_dir() else path.stem for path in files]
    own = [
        run.name if isinstance(run, Run) else stem or operand.name
        for operand, run, stem in zip(operands, runs, stems, strict=True)
    ]

    def named(name: str, path: Path | None, stem: str) -> str:
        """Return a name of its own."""
        if path is None or own.count(name) == 1:
            return name
        return stem if stems.count(stem) == 1 else f"{stem} ({path.parent.name})"

    return [named(*each) for each in zip(own, files, stems, strict=True)]


def _recorded(operand: Path, judged: Sequence[Hint]) -> RunLike | Simulation:
    """Return the result of a recording that a run can be made of, or raise a `RecordingError`: what it is."""
    result = read_recording(operand)
    if isinstance(result, (RUN_LIKE, Simulation)):
        return result
    hints = judged if isinstance(result, Comparison) else ()
    raise RecordingError(
        Finding(JUDGED.format(result_kind(result).with_article), str(operand), hints=tuple(hints))
    )


def recording_to_run(
    files: Sequence[Path | Held], robot: Chain | None, reading: Mapping[str, object]
) -> Run | None:
    """Return the run of a recording, on another arm if one is given; None of logs, which are to be read.

    Args:
        files: A recording alone, or the files of a log.
        robot: The arm that replaces the one inside.
        reading: How a log is read, by keyword; None or False where nothing is said.

    Raises:
        RecordingError: If it is a recording without a run, or stands among other files.
        OptionError: With all that says how a log is read: a recording stands as it was ingested.
    """
    recordings = [one for one in files if isinstance(one, Path) and _is_recording(one)]
    if not recordings:
        return None
    if len(files) > 1:
        said = "found a recording among files of one log, allowed: it alone, or the files"
        raise RecordingError(*(Finding(said, str(one)) for one in recordings))
    reject_reading_options(reading)
    made = _recorded(recordings[0], ())
    if isinstance(made, Simulation):
        said = JUDGED.format("a simulation")
        raise RecordingError(Finding(said, str(recordings[0]), hints=(BLOCK_HINT,)))
    return with_robot(made.as_run(), robot)


def reject_reading_options(reading: Mapping[str, object]) -> None:
    """Raise an `OptionError` with all keywords that say how a log is read, as there is none to be read."""
    unused = [name for name, value in reading.items() if value is not None and value is not False]
    if unused:
        found = "found with an ingested log"
        allowed = "with a log; a run or a recording is used as ingested"
        raise OptionError(*(Finding(found, parameter=name, allowed=allowed) for name in unused))


def load_comparison(operand: Path) -> Comparison | None:
    """Return the comparison that an operand is the recording of; None if it is anything else.

    Raises:
        RecordingError: If it is a recording, and bad.
    """
    result = read_recording(operand) if _is_recording(operand) else None
    return result if isinstance(result, Comparison) else None


def is_log(operand: object) -> bool:
    """Return whether an operand is a log that is yet to be read."""
    return isinstance(operand, Held) or (isinstance(operand, Path) and not _is_recording(operand))


def _is_recording(operand: Path) -> bool:
    return operand.suffix == ".rrd" or (isfile(operand) and is_recording(operand))  # noqa: PTH113


def log_files(operand: Path) -> list[Path]:
    """Return the files of one log: the file itself, or the CSV files of a folder by name.

    Raises:
        LogError: If a folder holds no CSV file.
    """
    if not isdir(operand):  # noqa: PTH112
        return [operand]
    files = sorted(path for path in operand.iterdir() if path.suffix.lower() in (".csv", ".txt"))
    if not files:
        said = "found a folder without CSV files, allowed: the plots of one log"
        raise LogError(Finding(said, file=str(operand)))
    return files
