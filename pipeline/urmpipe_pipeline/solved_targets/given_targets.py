"""The targets that inverse kinematics is given: a file, or arrays."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, OptionError, format_value
from urmpipe_models.ik.solutions import ROTATION_TOLERANCE, Targets
from urmpipe_pipeline.joint_log import LogWarning, SourceFile
from urmpipe_pipeline.logs import LogMap
from urmpipe_pipeline.solved_targets.target_file import read_targets

TargetsLike: TypeAlias = str | Path | Targets | ArrayLike
"""A file, or positions in [m], shape (n, 3), or poses as matrices, shape (n, 4, 4)."""

LAST_ROW = (0.0, 0.0, 0.0, 1.0)
"""Of a pose as a matrix; a pose that was transposed has another."""

LONGEST = 9e9
"""Times in [s] that int64 can hold in [ns]."""

SHAPES = "(n, 3), positions in m, or (n, 4, 4), poses"


@dataclass(frozen=True, slots=True, eq=False)
class GivenTargets:
    """Targets as they were given.

    Attributes:
        name: What to call them.
        row: Data row of each, from 1, shape (n,).
        t_ns: Times of a path from its first row in integer [ns], shape (n,); None where each target stands
            for itself.
        targets: Where the tool shall be; NaN where a row holds no target.
        faults: Why a row holds no target, one line; empty where it does, n of them.
        clock_start_ns: The path's own clock at the first row in integer [ns].
        warnings: What a person should know of the file.
        file: Where they came from; None of arrays.
    """

    name: str
    row: IntArray
    t_ns: IntArray | None
    targets: Targets
    faults: tuple[str, ...]
    clock_start_ns: int = 0
    warnings: tuple[LogWarning, ...] = ()
    file: SourceFile | None = None


def given_targets(
    given: TargetsLike, t: ArrayLike | None, tsp: float | None, read: LogMap | None
) -> GivenTargets:
    """Return targets with their rows and times.

    Args:
        given: A file, or arrays: positions in [m], shape (n, 3), or poses, shape (n, 4, 4).
        t: Times of arrays in [s], shape (n,): they are a path then.
        tsp: Time from target to target in [s], of a path without times.
        read: How to read a file where it cannot tell by itself.

    Raises:
        LogError: With all that is wrong with the file.
        OptionError: If an array has another shape, or times do not fit.
    """
    if tsp is not None and not (isinstance(tsp, Real) and 0.0 < tsp < math.inf):
        raise OptionError(Finding(parameter="tsp", found=format_value(tsp), allowed="a positive time in s"))
    if isinstance(given, (str, Path)):
        if t is not None:
            allowed = "with arrays; a file has its own"
            raise OptionError(Finding(parameter="t", found="times beside a file", allowed=allowed))
        return _of_file(Path(given), tsp, read)
    targets, faults = (given, ()) if isinstance(given, Targets) else _of_array(_numbers("targets", given))
    count = len(targets)
    t_ns = _times(count, t, tsp)
    start = 0 if t_ns is None else int(t_ns[0])
    since = None if t_ns is None else t_ns - start
    return GivenTargets("targets", np.arange(1, count + 1), since, targets, faults or ("",) * count, start)


def _of_file(path: Path, tsp: float | None, read: LogMap | None) -> GivenTargets:
    """Return the targets of a file."""
    found = read_targets(path, read, tsp)
    faults = tuple(found.faults.get(int(row), "") for row in found.row)
    return GivenTargets(
        path.stem, found.row, found.t_ns, found.targets, faults, found.clock_start_ns, found.warnings,
        found.file,
    )  # fmt: skip


def _numbers(name: str, given: ArrayLike) -> FloatArray:
    """Return what was given as an array.

    Raises:
        OptionError: If it holds no numbers, or is a table: what stands in which of its columns is not asked.
    """
    allowed = SHAPES if name == "targets" else "numbers"
    if hasattr(given, "columns"):
        example = 'table[["x", "y", "z"]].to_numpy()'
        allowed = f"an array of shape {allowed}, such as {example}"
        raise OptionError(Finding(parameter=name, found="a table", allowed=allowed))
    try:
        return np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        found = f"{type(given).__name__} that is not an array of numbers"
        raise OptionError(Finding(parameter=name, found=f"a {found}", allowed=allowed)) from None


def _of_array(array: FloatArray) -> tuple[Targets, tuple[str, ...]]:
    """Return the targets of positions or of poses as matrices, and what is wrong with each; NaN there."""
    if array.shape in ((3,), (4, 4)):
        array = array[None]
    if array.ndim == 2 and array.shape[1] == 3:
        return Targets(array), ()
    if array.ndim != 3 or array.shape[1:] != (4, 4):
        found = f"an array of shape {array.shape}"
        raise OptionError(Finding(parameter="targets", found=found, allowed=SHAPES))
    wrong = ~(np.abs(array[:, 3] - LAST_ROW).max(axis=1) <= ROTATION_TOLERANCE)
    faults = tuple(
        f"the last row of the matrix is {', '.join(f'{value:g}' for value in row)}, allowed: 0, 0, 0, 1"
        if bad else ""
        for bad, row in zip(wrong.tolist(), array[:, 3], strict=True)
    )  # fmt: skip
    poses = np.where(wrong[:, None, None], np.nan, array)
    return Targets(poses[:, :3, 3], poses[:, :3, :3]), faults


def _times(count: int, t: ArrayLike | None, tsp: float | None) -> IntArray | None:
    """Return the times of arrays in integer [ns], shape (n,); None where each target stands for itself.

    Raises:
        OptionError: With all that is wrong with arrays and their times.
    """
    seconds = None if t is None else _numbers("t", t)
    faults = list(_faults(count, seconds, tsp))
    if faults:
        raise OptionError(*faults)
    if tsp is not None:
        seconds = np.asarray(np.arange(count) * tsp, dtype=float)
    return None if seconds is None else np.round(seconds * 1e9).astype(np.int64)


def _faults(count: int, t: FloatArray | None, tsp: float | None) -> Iterator[Finding]:
    """Yield what is wrong with arrays and their times in [s]."""
    if not count:
        yield Finding(parameter="targets", found="none", allowed="one or more")
    if t is not None and tsp is not None:
        yield Finding(found="t and tsp", allowed="one of the two")
    if t is None:
        return
    if t.shape != (count,):
        allowed = f"({count},), one time for each target, in s"
        yield Finding(parameter="t", found=f"shape {t.shape}", allowed=allowed)
    elif not (np.abs(t) < LONGEST).all():
        found = "a time that is not finite or too large"
        yield Finding(parameter="t", found=found, allowed=f"up to {LONGEST:g} s")
    elif (np.diff(np.round(t * 1e9)) <= 0.0).any():
        allowed = "strictly increasing, by 1 ns or more"
        yield Finding(parameter="t", found="times that do not increase", allowed=allowed)
