"""`urmpipe.compare`: logs against a reference, and the result against an earlier one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Unpack

from urmpipe.arm_placing import Robot
from urmpipe.output_files import guarded_outputs
from urmpipe.parameters import kinds
from urmpipe.parameters.comparing import LOG_PARAMETERS, Compare
from urmpipe.public_functions import (
    PathLike,
    as_list,
    check_types,
    public_function,
    raise_warnings,
    require_recordings,
)
from urmpipe.reading import map_files, resolve_reading
from urmpipe_models.errors import Finding, Hint, OptionError, RecordingError, map_collecting_errors
from urmpipe_pipeline.comparison.baseline import compare_with_baseline, complete_noise
from urmpipe_pipeline.comparison.compare import (
    CompareOptions,
    compare_runs,
    compare_with_recorded_tcp,
    skip_failed_logs,
)
from urmpipe_pipeline.comparison.comparison import Comparison, FailedLog
from urmpipe_pipeline.comparison.iso import IsoOptions, measure_iso
from urmpipe_pipeline.comparison.warnings import CLOCKS_DIFFER, LARGE_NOISE, SWAPPED, large_noises
from urmpipe_pipeline.logs import LogMap, MemoryTable, TableLike, dataframe_to_table, is_table
from urmpipe_pipeline.operands import (
    BASELINE_HINT,
    is_log,
    load_comparison,
    load_runs,
    reject_reading_options,
)
from urmpipe_pipeline.outputs import OutputKind
from urmpipe_pipeline.results import present, read_recording, result_kind
from urmpipe_pipeline.runs.recorded_tcp import MISSING_TOOL
from urmpipe_pipeline.runs.run import Run, RunLike
from urmpipe_pipeline.simulations.simulation import Simulation
from urmpipe_pipeline.tables.csv_files import write_table
from urmpipe_pipeline.tables.junit import errors_in_junit, write_junit

Operand = PathLike | TableLike | RunLike | Simulation

EARLIER = Hint("baseline", None, "sets one")

OPERANDS = (
    "a log, a path, a recording, a DataFrame or Arrow table, a Run, IkResult, PlannedPath or Simulation;"
    " arrays are ingested first: urmpipe.ingest(t=t, q=q)"
)


@public_function(Compare, robot=kinds.ROBOT)
def compare(
    reference: Operand | Comparison,
    logs: Operand | Sequence[Operand] = (),
    robot: Robot | None = None,
    **options: Unpack[Compare],
) -> Comparison:
    """Compare logs with a reference, and write what is named: all or none. docs/python.md has the keywords.

    Args:
        reference: A path, a log, a recording, a run or a simulation; alone, it is compared with the TCP that
            it recorded. With a `baseline` alone: a comparison, which is used unchanged.
        logs: Logs, recordings, runs and simulations to judge, or one of them.
        robot: The arm; a recording or a run with another one is computed again with it.
        **options: What is judged, how logs are read, what is written: the options of `urmpipe compare`, by
            their names.

    Raises:
        UrmpipeError: With everything that is wrong with the input or the output.

    Source: [UrmArm2021]_ eq. 19-23.
    """
    values: Mapping[str, Any] = options  # as their kinds read them
    return run_comparison(reference, logs, robot, values, lambda operand, read: log_by_log(values))


def log_by_log(values: Mapping[str, Any], *, diagnose: bool = False) -> CompareOptions:
    """Return how each log is judged."""
    tolerance = values["tolerance"]
    return CompareOptions(
        tolerance.by_kind, values["tcp"], values["sync"], values.get("align", "none"), tolerance.from_text,
        diagnose, values["defaults"],
    )  # fmt: skip


def run_comparison(
    reference: Any,
    logs: Any,
    robot: Robot | None,
    values: Mapping[str, Any],
    judge: Callable[[object, LogMap], CompareOptions | IsoOptions],
    judged: Sequence[Hint] = (BASELINE_HINT,),
    finished: Comparison | None = None,
) -> Comparison:
    """Return a comparison, and write what is named: all or none.

    Args:
        reference: The reference.
        logs: Logs, or one of them.
        robot: The arm.
        values: Values of the parameters of `compare`, `iso` or `diagnose`.
        judge: Returns how the logs are judged, of the reference and of how logs are read.
        judged: Where the recording of a comparison, which is not a log, can be given.
        finished: The comparison to write, where it is made already.
    """
    several = as_list(logs)
    operands = normalise_operands(
        {"reference": [reference]} | ({"logs": several} if several else {}), Comparison
    )
    reference, baseline = operands[0], values["baseline"]
    kept = [*_files([*operands, baseline]), *map_files(values), *values["inputs"]]
    outputs: dict[OutputKind, PathLike | None] = {
        "recording": values["output"], "junit": values["junit"], "statistics": values["csv"],
    }  # fmt: skip
    with errors_in_junit(values["junit"], kept), guarded_outputs(outputs, kept) as written:
        if values["noise"] is not None and baseline is None:
            allowed = "with an earlier comparison"
            raise OptionError(
                Finding(parameter="noise", found="no baseline", allowed=allowed, hints=(EARLIER,))
            )
        noise = complete_noise(values["noise"])
        resolved = resolve_reading(values, robot)
        options = judge(reference, resolved.options)
        _check_log_parameters(operands, values)
        earlier = None if baseline is None else _read_baseline(baseline)
        load = partial(
            load_runs, robot=resolved.arm, read=resolved.options, comparison_hints=judged,
            **{name: values[name] for name in ("sides", "tsp", "derivative", "block")},
        )  # fmt: skip

        def checked(comparison: Comparison) -> Comparison:
            """Return a comparison with the warnings about the noise, if no warning is an error."""
            if earlier is not None:
                kept = [warning for warning in comparison.warnings if warning.kind != LARGE_NOISE]
                warnings = (*kept, *large_noises(noise, comparison.tolerance))
                comparison = replace(comparison, warnings=warnings)
            _raise_warnings(values["strict"], comparison)
            return comparison

        ready = finished
        if ready is None and earlier is not None and not operands[1:]:
            ready = _load_comparison(reference, values["output"])
        failed: list[FailedLog] | None = [] if values.get("keep_going") else None
        result = checked(ready) if ready else _compare(operands, load, options, checked, failed)
        if earlier is not None:
            result = replace(result, baseline=compare_with_baseline(result, earlier, noise))
        shown = present(result)
        written.write("junit", lambda part, path: write_junit(shown, part, path))
        if (rows := shown.rows) is not None:
            written.write("statistics", lambda part, path: write_table(rows(), part, path))
        return written.recorded(result, values["progress"])


def normalise_operands(operands: Mapping[str, Sequence[Any]], *further: type) -> list[Any]:
    """Return operands, tables as logs named after their keywords.

    Args:
        operands: Operands by keyword.
        *further: Classes that are allowed in addition to those of runs.

    Raises:
        OptionError: With everything that is not an operand.
    """
    types = (RunLike, Simulation, MemoryTable, *further)
    named = {name: list(_with_tables(name.removesuffix("s"), values)) for name, values in operands.items()}
    map_collecting_errors(lambda item: check_types(*item, types, OPERANDS), named.items())
    return [operand for values in named.values() for operand in values]


def _with_tables(name: str, operands: Sequence[Any]) -> Iterator[Any]:
    """Yield operands, the tables among them as logs with this name, and a number if there are several."""
    for k, operand in enumerate(operands, start=1):
        label = f"{name} {k}" if len(operands) > 1 else name
        yield dataframe_to_table(operand, label) if is_table(operand) else operand


def _check_log_parameters(operands: Sequence[Any], values: Mapping[str, Any]) -> None:
    """Raise an `OptionError` with all parameters of logs if every operand was ingested before."""
    logs = (Path(operand) if isinstance(operand, str) else operand for operand in operands)
    if not any(map(is_log, logs)):
        reject_reading_options({name: values[name] for name in (*LOG_PARAMETERS, "sides")})


def _compare(
    operands: Sequence[Path | str | MemoryTable | RunLike | Simulation | Comparison],
    load: Callable[..., list[Run]],
    options: CompareOptions | IsoOptions,
    checked: Callable[[Comparison], Comparison],
    failed: list[FailedLog] | None,
) -> Comparison:
    """Return the comparison of logs with a reference, or of a log with the TCP that it recorded."""
    if any(isinstance(operand, Comparison) for operand in operands):
        raise OptionError("found a comparison as the reference, allowed: with a baseline, and without logs")
    files = (Path(operand) if isinstance(operand, (str, Path)) else operand for operand in operands)
    reference, *logs = load([file for file in files if not isinstance(file, Comparison)], failed=failed)
    if isinstance(options, IsoOptions):
        if not logs:
            raise OptionError(
                Finding(
                    about="logs", found="none", allowed="one or more logs of its cycles, after the reference"
                )
            )
        return checked(measure_iso(reference, logs, options))
    if not logs:
        return checked(compare_with_recorded_tcp(reference, options))

    def judge(runs: Sequence[Run]) -> Comparison:
        return checked(compare_runs(reference, runs, options))

    if failed is None:
        return judge(logs)
    return replace(skip_failed_logs(judge, logs, failed), failed_logs=tuple(failed))


def _load_comparison(reference: Operand | Comparison, output: PathLike | None) -> Comparison | None:
    """Return the comparison that the reference is; None if it is a log, a path or a run.

    Raises:
        OptionError: If it is to be recorded again.
    """
    if not isinstance(reference, (str, Path, Comparison)):
        return None
    comparison = reference if isinstance(reference, Comparison) else load_comparison(Path(reference))
    if comparison is not None and output is not None:
        allowed = "no output, as nothing new is recorded"
        value = f"{output} with the recording of a comparison"
        raise OptionError(Finding(parameter="output", found=value, allowed=allowed))
    return comparison


def _read_baseline(baseline: PathLike | Comparison) -> Comparison:
    """Return the comparison that a baseline is."""
    if isinstance(baseline, Comparison):
        return baseline
    path = Path(baseline)
    if not path.exists():
        message = "found no such file, allowed: the recording of an earlier comparison"
        raise RecordingError(Finding(message, str(path), parameter="baseline"))
    require_recordings([path])
    result = read_recording(path)
    if not isinstance(result, Comparison):
        message = f"found a recording ({result_kind(result).name}), allowed: that of a comparison"
        raise RecordingError(Finding(message, str(path), parameter="baseline"))
    return result


def _raise_warnings(strict: bool, result: Comparison) -> None:
    """Raise a `LogError` with the warnings of the logs and the comparison, if they are errors."""
    of_logs = [warning.of(run.name) for run in result.runs for warning in run.run.warnings]
    explaining = (MISSING_TOOL, SWAPPED, CLOCKS_DIFFER)  # they explain a result
    of_result = [warning for warning in result.warnings if warning.kind not in explaining]
    raise_warnings(strict, (*of_logs, *of_result))


def _files(operands: Sequence[Operand | Comparison | None]) -> list[Path]:
    """Return the files that no output may replace: operands, and the recordings of those that are results."""
    files = [
        operand if isinstance(operand, (str, Path)) else getattr(operand, "recording", None)
        for operand in operands
    ]
    return [Path(file) for file in files if file is not None]
