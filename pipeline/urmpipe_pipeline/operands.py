"""Operands of a command: a log, a folder of plots, a path or a recording, each as a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

from urmpipe_models.chains.chain import Chain
from urmpipe_models.errors import Finding, LogError, OptionError, RecordingError, for_each, shown
from urmpipe_models.messages import Hint
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.recording import is_recording
from urmpipe_pipeline.results import read_recording
from urmpipe_pipeline.runs.derivatives import Method
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.other_robot import on_robot
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.solved_targets.result import SolvedTargets
from urmpipe_pipeline.sources import ReadOptions
from urmpipe_pipeline.sources.vocabulary import key

COMPARISON = "found the recording of a comparison, allowed: one that ingest wrote"

WITH_BASELINE = Hint("baseline", None, "compares it, alone, with an earlier one")

SIMULATION = (
    "found the recording of a simulation, allowed: one that ingest wrote; a simulation is judged by the delta"
    " meters in it: urmpipe report shows what they found"
)


MadeRun: TypeAlias = Run | SolvedTargets
"""Results that are a run, or have one."""


def load_runs(
    operands: Sequence[Path | MadeRun],
    *,
    robot: Chain | None = None,
    read: ReadOptions | None = None,
    tsp: float | None = None,
    derivative: Method | None = None,
) -> list[Run]:
    """Return the runs of several operands; the reading options hold for every log among them.

    Args:
        operands: Recordings (.rrd), logs and paths (CSV), folders whose CSV files make one log; runs, and
            solved targets as theirs.
        robot: The arm; of a recording or a run it replaces the one inside.
        read: How to read the CSV files, all of them; the unit of a column holds for those that have it.
        tsp: Period of the grid in [s], of the CSV files.
        derivative: How the joints of CSV files are differentiated.

    Raises:
        UrmpipeError: With everything that is wrong with any of them: a bad CSV, a recording without a run.
    """
    shared = sum(isinstance(one, Path) and not _is_recording(one) for one in operands) > 1
    read = replace(read or ReadOptions(), shared=shared)

    def run_of(operand: Path | MadeRun) -> Run:
        """Return the run that an operand is, is recorded in, or is read as."""
        if not isinstance(operand, Path):
            return on_robot(operand.as_run(), robot)
        name = operand.resolve().name if operand.is_dir() else None
        try:
            if _is_recording(operand):
                return on_robot(_recorded(operand).as_run(), robot)
            files = log_files(operand)
            return ingest_log(files, robot=robot, read=read, tsp=tsp, derivative=derivative, name=name)
        except LogError as error:  # of several logs, each is named
            found = (one if one.file else replace(one, file=str(operand)) for one in error.findings)
            raise LogError(*found) from error

    runs = for_each(run_of, operands)
    if shared:
        _refuse_unreached(read, runs)
    return _told_apart(operands, runs)


def _refuse_unreached(read: ReadOptions, runs: Sequence[Run]) -> None:
    """Raise an `OptionError` with each column that is given a unit, and that no log of several has in use."""
    columns = [one for run in runs for one in run.log.columns]
    used = {called for one in columns for called in (one.name, one.header, key(one.name), str(one.number))}
    lost = [name for name in read.unit if name and not {name, key(name)} & used]
    if lost:
        allowed = "a column that a log has, and that is read"
        said = (Finding(parameter="unit", found=f"no column {shown(name)}", allowed=allowed) for name in lost)
        raise OptionError(*said)


def load_sides(
    operands: Sequence[Path | MadeRun],
    sides: tuple[str, str],
    *,
    robot: Chain | None = None,
    read: ReadOptions | None = None,
    tsp: float | None = None,
    derivative: Method | None = None,
) -> list[Run]:
    """Return both sides of one log as runs: what was asked for, then what was done.

    Args:
        operands: The log (CSV), or a folder whose CSV files make it.
        sides: A word in the names of the columns of each side, or "rest" for all others.
        robot: The arm; None for the one that a side singles out.
        read: How to read the log.
        tsp: Period of the grid in [s].
        derivative: How the joints are differentiated.

    Raises:
        UrmpipeError: With everything that is wrong with it.
        OptionError: If there is more than one log, or it is a recording.
    """
    log = operands[0]
    if (
        len(operands) > 1
        or not isinstance(log, Path)
        or _is_recording(log)
        or sides[0].lower() == sides[1].lower()
    ):
        found = ",".join(sides) + (" with several logs" if len(operands) > 1 else "")
        allowed = "two words for two sides of one log that is yet to be read"
        raise OptionError(Finding(parameter="sides", found=found, allowed=allowed))

    def run_of(side: tuple[str, str]) -> Run:
        """Return the run of one side."""
        one = replace(read or ReadOptions(), side=side)
        name = f"{log.resolve().stem} ({side[0]})"
        return ingest_log(log_files(log), robot=robot, read=one, tsp=tsp, derivative=derivative, name=name)

    runs = for_each(run_of, (sides, sides[::-1]))
    found_arm = next((run.robot for run in runs if run.robot), None)
    return [on_robot(run, found_arm) if run.log.joints and run.robot is None else run for run in runs]


def _told_apart(operands: Sequence[Path | MadeRun], runs: Sequence[Run]) -> list[Run]:
    """Return runs of which no two have one name: those of files by these, or by their folders, too."""
    files = [one.resolve() if isinstance(one, Path) else None for one in operands]
    stems = [None if path is None else path.name if path.is_dir() else path.stem for path in files]

    def named(run: Run, path: Path | None, stem: str | None) -> Run:
        """Return a run under a name of its own."""
        if path is None or stem is None or [one.name for one in runs].count(run.name) == 1:
            return run
        return replace(run, name=stem if stems.count(stem) == 1 else f"{stem} ({path.parent.name})")

    return [named(*each) for each in zip(runs, files, stems, strict=True)]


def _recorded(operand: Path) -> MadeRun:
    result = read_recording(operand)
    if isinstance(result, (Run, SolvedTargets)):
        return result
    if isinstance(result, Comparison):
        raise RecordingError(Finding(COMPARISON, str(operand), hints=(WITH_BASELINE,)))
    raise RecordingError(Finding(SIMULATION, file=str(operand)))


def load_comparison(operand: Path) -> Comparison | None:
    """Return the comparison that an operand is the recording of; None if it is anything else.

    Raises:
        RecordingError: If it is a recording, and bad.
    """
    result = read_recording(operand) if _is_recording(operand) else None
    return result if isinstance(result, Comparison) else None


def is_log(operand: Path) -> bool:
    """Return whether an operand is a log that is yet to be read."""
    return not _is_recording(operand)


def _is_recording(operand: Path) -> bool:
    return operand.suffix == ".rrd" or (operand.is_file() and is_recording(operand))


def log_files(operand: Path) -> list[Path]:
    """Return the files of one log: the file itself, or the CSV files of a folder by name.

    Raises:
        LogError: If a folder holds no CSV file.
    """
    if not operand.is_dir():
        return [operand]
    files = sorted(path for path in operand.iterdir() if path.suffix.lower() in (".csv", ".txt"))
    if not files:
        said = "found a folder without CSV files, allowed: the plots of one log"
        raise LogError(Finding(said, file=str(operand)))
    return files
