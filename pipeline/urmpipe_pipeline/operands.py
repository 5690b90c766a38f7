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
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.recording import is_recording
from urmpipe_pipeline.results import kind_of, read_recording
from urmpipe_pipeline.runs.derivatives import Method
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.other_robot import on_robot
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Simulation
from urmpipe_pipeline.solved_targets.result import SolvedTargets
from urmpipe_pipeline.sources import ReadOptions
from urmpipe_pipeline.sources.vocabulary import key

JUDGED = "found the recording of {}, allowed: one that ingest wrote"

WITH_BASELINE = Hint("baseline", None, "compares it, alone, with an earlier one")

SIMULATION = (
    "found the recording of a simulation, allowed: one that ingest wrote; a simulation is judged by the delta"
    " meters in it: urmpipe report shows what they found"
)


MadeRun: TypeAlias = Run | SolvedTargets | PlannedPath
MADE_RUNS: tuple[type[MadeRun], ...] = (Run, SolvedTargets, PlannedPath)
"""Results that are a run, or have one."""


def load_runs(
    operands: Sequence[Path | MadeRun],
    *,
    sides: tuple[str, str] | None = None,
    robot: Chain | None = None,
    read: ReadOptions | None = None,
    tsp: float | None = None,
    derivative: Method | None = None,
    judged: Sequence[Hint] = (WITH_BASELINE,),
) -> list[Run]:
    """Return the runs of several operands, or both sides of one log; the reading options hold for every log.

    Args:
        operands: Recordings (.rrd), logs and paths (CSV), folders whose CSV files make one log; runs, and
            solved targets as theirs.
        sides: What was asked for, then what was done, of one log that is yet to be read: a word in the names
            of the columns of each side, or "rest" for all others.
        robot: The arm; of a recording or a run it replaces the one inside.
        read: How to read the CSV files, all of them; the unit of a column holds for those that have it.
        tsp: Period of the grid in [s], of the CSV files.
        derivative: How the joints of CSV files are differentiated.
        judged: What the recording of a comparison, which is no operand, can be given to.

    Raises:
        UrmpipeError: With everything that is wrong with any of them: a bad CSV, a recording without a run.
        OptionError: If sides are wanted of anything but one log.
    """
    shared = sum(isinstance(one, Path) and not _is_recording(one) for one in operands) > 1
    read = replace(read or ReadOptions(), shared=shared)

    def run_of(one: tuple[Path | MadeRun, tuple[str, str] | None]) -> Run:
        """Return the run that an operand is, is recorded in, or is read as."""
        operand, side = one
        if not isinstance(operand, Path):
            return on_robot(operand.as_run(), robot)
        name = operand.resolve().name if operand.is_dir() else None
        name = name if side is None else f"{operand.resolve().stem} ({side[0]})"
        try:
            if _is_recording(operand):
                return on_robot(_recorded(operand, judged).as_run(), robot)
            files, own = log_files(operand), replace(read, side=side)
            return ingest_log(files, robot=robot, read=own, tsp=tsp, derivative=derivative, name=name)
        except LogError as error:  # of several logs, each is named
            found = (one if one.file else replace(one, file=str(operand)) for one in error.findings)
            raise LogError(*found) from error

    if sides is not None:
        _refuse_sides(operands, sides)
        return _on_one_arm(for_each(run_of, [(operands[0], side) for side in (sides, sides[::-1])]))
    runs = for_each(run_of, [(operand, None) for operand in operands])
    if shared:
        _refuse_unreached(read, runs)
    return _told_apart(operands, runs)


def _refuse_sides(operands: Sequence[Path | MadeRun], sides: tuple[str, str]) -> None:
    """Raise an `OptionError` if there is more than one log, it was read before, or its sides are one."""
    log, several = operands[0], len(operands) > 1
    if several or not isinstance(log, Path) or _is_recording(log) or sides[0].lower() == sides[1].lower():
        found = ",".join(sides) + (" with several logs" if several else "")
        allowed = "two words for two sides of one log that is yet to be read"
        raise OptionError(Finding(parameter="sides", found=found, allowed=allowed))


def _on_one_arm(runs: Sequence[Run]) -> list[Run]:
    """Return runs of which those without an arm have the one that another singles out."""
    arm = next((run.robot for run in runs if run.robot), None)
    return [on_robot(run, arm) if run.log.joints and run.robot is None else run for run in runs]


def _refuse_unreached(read: ReadOptions, runs: Sequence[Run]) -> None:
    """Raise an `OptionError` with each column that is given a unit, and that no log of several has in use."""
    columns = [one for run in runs for one in run.log.columns]
    used = {called for one in columns for called in (one.name, one.header, key(one.name), str(one.number))}
    lost = [name for name in read.unit if name and not {name, key(name)} & used]
    if lost:
        allowed = "a column that a log has, and that is read"
        said = (Finding(parameter="unit", found=f"no column {shown(name)}", allowed=allowed) for name in lost)
        raise OptionError(*said)


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


def _recorded(operand: Path, judged: Sequence[Hint]) -> MadeRun:
    """Return the run of a recording, or raise a `RecordingError` that says what else it is."""
    result = read_recording(operand)
    if isinstance(result, MADE_RUNS):
        return result
    if isinstance(result, Simulation):
        raise RecordingError(Finding(SIMULATION, file=str(operand)))
    hints = judged if isinstance(result, Comparison) else ()
    raise RecordingError(
        Finding(JUDGED.format(kind_of(result).with_article), str(operand), hints=tuple(hints))
    )


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
