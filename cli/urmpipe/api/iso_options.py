"""What `compare` takes of a test after ISO 9283, as the pipeline has it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np

from urmpipe.keyword_checks import refuse_recording
from urmpipe_models.errors import Finding, Hint, LogError, OptionError
from urmpipe_models.math3d import to_quaternions
from urmpipe_pipeline.comparison.iso import IsoOptions
from urmpipe_pipeline.iso9283.cycles import parse_cycles
from urmpipe_pipeline.iso9283.poses import Poses
from urmpipe_pipeline.planned_paths.command_marks import bends_of, stops_of
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.results import read_recording
from urmpipe_pipeline.solved_targets.given_targets import TargetsLike, given_targets
from urmpipe_pipeline.sources import ReadOptions

Cycles: TypeAlias = str | Sequence[tuple[int, int]]

ALONE = Hint("iso", True, "evaluates the logs as the cycles of a test")


def iso_options(
    reference: object,
    *,
    iso: bool,
    cycles: Cycles | None,
    planes: int | None,
    band: float | None,
    targets: TargetsLike | None,
    read: ReadOptions | None,
) -> IsoOptions | None:
    """Return how a test is evaluated; None without one.

    Raises:
        OptionError: If something of a test is given without one, or makes no sense.
        LogError: With everything that is wrong with the targets.
    """
    given = {"cycles": cycles, "planes": planes, "band": band, "targets": targets}
    usual = {"planes": IsoOptions().planes, "band": IsoOptions().band}
    if not iso:
        found = [name for name, value in given.items() if value is not None]
        if found:
            raise OptionError(
                *(
                    Finding(parameter=name, found="no test", allowed="with iso", hints=(ALONE,))
                    for name in found
                )
            )
        return None
    plan = _plan(reference)
    return IsoOptions(
        cycles=parse_cycles(cycles) if isinstance(cycles, str) else None if cycles is None else tuple(cycles),
        targets=None if targets is None else _poses(targets, read),
        bends=() if plan is None else bends_of(plan),
        stops=() if plan is None else stops_of(plan),
        planes=int(usual["planes"] if planes is None else planes),
        band=usual["band"] if band is None else band,
    )


def _plan(reference: object) -> PlannedPath | None:
    """Return the plan that a reference is, or is the recording of; None if it is anything else."""
    if isinstance(reference, (str, Path)) and Path(reference).suffix == ".rrd" and Path(reference).exists():
        reference = read_recording(Path(reference), lazy=True)
    return reference if isinstance(reference, PlannedPath) else None


def _poses(targets: TargetsLike, read: ReadOptions | None) -> Poses:
    """Return targets as the poses of a test; raise a `LogError` with what is wrong with each."""
    refuse_recording(targets, "a table (CSV) of targets")
    found = given_targets(targets, None, None, read)
    wrong = [(row, said) for row, said in zip(found.row.tolist(), found.faults, strict=True) if said]
    if wrong:
        raise LogError(*(Finding(said, found.name, row=row, parameter="targets") for row, said in wrong))
    rotation = found.targets.rotation
    quat = None if rotation is None else to_quaternions(np.reshape(rotation, (-1, 9)), "matrix")
    return Poses(found.targets.position, quat, (False,) * len(found.targets))
