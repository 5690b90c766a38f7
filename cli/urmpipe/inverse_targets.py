"""The targets that `urmpipe.ik` is given: a file, or arrays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from urmpipe_models.errors import Finding, LogError, OptionError
from urmpipe_models.inverse.targets import FloatArray, Targets
from urmpipe_pipeline.joint_log import IntArray, LogWarning, SourceFile
from urmpipe_pipeline.recording import is_recording
from urmpipe_pipeline.sources import ReadOptions

TargetsLike: TypeAlias = str | Path | Targets | ArrayLike
"""A file, or positions in [m], shape (n, 3), or poses as matrices, shape (n, 4, 4)."""

SHAPES = "(n, 3), positions in m, or (n, 4, 4), poses"


@dataclass(frozen=True, slots=True, eq=False)
class GivenTargets:
    """Targets as they were given.

    Attributes:
        name: What to call them.
        row: Data row of each, from 1, shape (n,).
        t_ns: Times in integer [ns], shape (n,), of a path; None where each stands for itself.
        targets: Where the tool shall be; NaN where a row holds no target.
        faults: Why a row holds no target, one line; empty where it does, n of them.
        warnings: What a person should know of the file.
        file: Where they came from; None of arrays.
    """

    name: str
    row: IntArray
    t_ns: IntArray | None
    targets: Targets
    faults: tuple[str, ...]
    warnings: tuple[LogWarning, ...] = ()
    file: SourceFile | None = None


def given_targets(
    given: TargetsLike, t: ArrayLike | None, tsp: float | None, read: ReadOptions | None
) -> GivenTargets:
    """Return targets with their rows and times.

    Args:
        given: A file, or arrays.
        t: Times of arrays in [s], shape (n,): they are a path then.
        tsp: Time from target to target in [s], of a path without times.
        read: How to read a file where it cannot tell by itself.

    Raises:
        LogError: With all that is wrong with the file.
        OptionError: If an array has another shape, or times do not fit.
    """
    if isinstance(given, (str, Path)):
        if t is not None:
            raise OptionError("t: found times beside a file, allowed: with arrays; a file has its own")
        return _of_file(Path(given), tsp, read)
    targets = given if isinstance(given, Targets) else _of_array(np.asarray(given, dtype=float))
    count = len(targets)
    faults = list(_faults(count, t, tsp))
    if faults:
        raise OptionError(*faults)
    seconds = np.arange(count) * tsp if tsp is not None else t
    t_ns = None if seconds is None else np.round(np.asarray(seconds, dtype=float) * 1e9).astype(np.int64)
    return GivenTargets("targets", np.arange(1, count + 1), t_ns, targets, ("",) * count)


def _of_file(path: Path, tsp: float | None, read: ReadOptions | None) -> GivenTargets:
    """Return the targets of a file."""
    from urmpipe_pipeline.target_file import read_targets

    if path.is_file() and is_recording(path):
        raise LogError(Finding("found a recording, allowed: a table (CSV) of targets", str(path)))
    found = read_targets(path, read, tsp)
    t_ns = None if found.t_ns is None else found.t_ns + found.clock_start_ns
    faults = tuple(found.faults.get(int(row), "") for row in found.row)
    return GivenTargets(path.stem, found.row, t_ns, found.targets, faults, found.warnings, found.file)


def _of_array(array: FloatArray) -> Targets:
    """Return the targets of positions or of poses as matrices."""
    if array.shape in ((3,), (4, 4)):
        array = array[None]
    if array.ndim == 2 and array.shape[1] == 3:
        return Targets(array)
    if array.ndim == 3 and array.shape[1:] == (4, 4):
        return Targets(array[:, :3, 3], array[:, :3, :3])
    raise OptionError(f"targets: found an array of shape {array.shape}, allowed: {SHAPES}")


def _faults(count: int, t: ArrayLike | None, tsp: float | None) -> Iterator[str]:
    """Yield what is wrong with arrays and their times."""
    if not count:
        yield "targets: found none, allowed: one or more"
    if t is not None and tsp is not None:
        yield "found t and tsp, allowed: one of both"
    if t is not None:
        times = np.asarray(t, dtype=float)
        if times.shape != (count,):
            yield f"t: found shape {times.shape}, allowed: ({count},), one time for each target, in s"
        elif not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
            yield "t: found times that do not increase, allowed: finite, strictly increasing"
