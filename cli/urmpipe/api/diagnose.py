"""`urmpipe.diagnose`: why logs deviate from their reference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Unpack, overload

from urmpipe.api.compare import Operand, log_by_log, run_comparison
from urmpipe.arm_placing import Robot
from urmpipe.parameters import kinds
from urmpipe.parameters.comparing import Diagnose
from urmpipe.public_functions import public_function
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.diagnosis.result import Diagnosis


@overload
def diagnose(
    reference: Operand,
    logs: Sequence[Operand],
    robot: Robot | None = None,
    **options: Unpack[Diagnose],
) -> Comparison: ...


@overload
def diagnose(
    reference: Operand,
    logs: Operand | None = None,
    robot: Robot | None = None,
    **options: Unpack[Diagnose],
) -> Diagnosis: ...


@public_function(Diagnose, robot=kinds.ROBOT)
def diagnose(
    reference: Operand,
    logs: Operand | Sequence[Operand] | None = None,
    robot: Robot | None = None,
    **options: Unpack[Diagnose],
) -> Diagnosis | Comparison:
    """Find out why logs deviate from their reference: the causes that make both agree. See docs/diagnose.md.

    Args:
        reference: A path, a log, a recording, a run or a simulation; alone, a log that is compared with the
            TCP that it recorded.
        logs: A log, a recording, a run or a simulation to diagnose, or a list of them.
        robot: The arm; a recording or a run with another one is computed again with it.
        **options: What is judged, how logs are read, what is written: the options of `urmpipe diagnose`, by
            their names. The verdict is that of `compare`.

    Returns:
        The `Diagnosis` of a single log, with its `comparison`; of a list of logs their `Comparison`,
        whose `runs` have their `diagnosis`.

    Raises:
        UrmpipeError: With everything that is wrong with the input or the output.
    """
    values: Mapping[str, Any] = options  # as their kinds read them
    comparison = run_comparison(
        reference, [] if logs is None else logs, robot, values,
        lambda operand, read: log_by_log(values, diagnose=True), judged=(),
    )  # fmt: skip
    if isinstance(logs, (list, tuple)):
        return comparison
    (run,) = comparison.runs
    assert run.diagnosis is not None
    warnings = (*run.diagnosis.warnings, *comparison.general_warnings, *comparison.warnings_of(run))
    return replace(run.diagnosis, warnings=warnings, recording=comparison.recording, comparison=comparison)
