"""`urmpipe.diagnose`: why a log deviates from its reference."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from inspect import unwrap
from typing import Unpack

from urmpipe.api.compare import Operand, compare, operands_of
from urmpipe.arm_placing import Frame, Robot
from urmpipe.keyword_checks import PathLike, public_reading
from urmpipe.reading import Reading
from urmpipe_models import DEFAULT_TOLERANCE
from urmpipe_pipeline.comparison.compare import Tcp
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.sync import SyncOption
from urmpipe_pipeline.diagnosis.result import Diagnosis
from urmpipe_pipeline.runs.derivatives import Method


@public_reading(Reading)
def diagnose(
    reference: Operand,
    log: Operand | None = None,
    robot: Robot | None = None,
    *,
    base: Frame | None = None,
    tool: Frame | None = None,
    base_link: str | None = None,
    tip_link: str | None = None,
    tsp: float | None = None,
    derivative: Method | None = None,
    tolerance: float | str | Mapping[str, float] = DEFAULT_TOLERANCE,
    tcp: Tcp = "fk",
    sync: SyncOption | None = None,
    sides: tuple[str, str] | None = None,
    block: str | Sequence[str] | None = None,
    strict: bool = False,
    output: PathLike | None = None,
    inputs: Sequence[PathLike] = (),
    defaults: Sequence[str] = (),
    progress: Callable[[float], None] | None = None,
    **reading: Unpack[Reading],
) -> Diagnosis:
    """Say why a log deviates from its reference: the causes that make both agree. docs/diagnose.md has them.

    Args:
        reference: A path, a log, a recording, a run or a simulation; alone, a log that is held against the
            TCP that it recorded itself.
        log: What is diagnosed: a log, a recording, a run or a simulation.
        robot: The arm; a recording or a run that has another one is computed anew with it.
        base: Where the arm stands in the world, in [m] and [rad]; as a matrix of shape (4, 4).
        tool: The tool centre point in the frame of the arm's tip, likewise.
        base_link: Link of a URDF where the arm begins; default: its root.
        tip_link: Link of a URDF where the arm ends; default: its end.
        tsp: Period of a log's grid in [s].
        derivative: How a log is differentiated: central or savgol.
        tolerance: Largest deviation allowed, as of `compare`: the verdict is the same.
        tcp: Where a log was: fk or recorded.
        sync: How the clocks are put together first, as of `compare`.
        sides: Two words in the names of the columns of one log, such as ("target", "actual").
        block: The block of a simulation whose motion is meant, as of `compare`.
        strict: Whether a warning is an error.
        output: The recording (.rrd) to write: that of the comparison, with its diagnosis.
        inputs: Files besides the operands that are never replaced.
        defaults: Options that a file set, as of `compare`.
        progress: Told the share of the recording that is written, 0..1.
        **reading: How to read the logs where they cannot tell by themselves, as of `compare`.

    Raises:
        UrmpipeError: With everything that is wrong with the input or the output.
    """
    operands = {"reference": [reference]} | ({} if log is None else {"log": [log]})
    reference, *logs = operands_of(operands)
    made: Comparison = unwrap(
        compare
    )(  # without its checks of keywords and its warnings, which are given here
        reference,
        logs,
        robot,
        base=base,
        tool=tool,
        base_link=base_link,
        tip_link=tip_link,
        tsp=tsp,
        derivative=derivative,
        tolerance=tolerance,
        tcp=tcp,
        sync=sync,
        sides=sides,
        block=block,
        diagnose=True,
        strict=strict,
        output=output,
        inputs=inputs,
        defaults=defaults,
        progress=progress,
        **reading,
    )
    (run,) = made.runs
    if run.diagnosis is None:
        raise TypeError(f"{made.name} was compared without a diagnosis")
    told = (*run.diagnosis.warnings, *made.general_warnings, *made.warnings_of(run))
    return replace(run.diagnosis, warnings=told, recording=made.recording, comparison=made)
