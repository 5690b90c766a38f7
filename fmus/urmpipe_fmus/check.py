"""Validation and short run of an FMU, of any tool.

1. FMPy validates the description: variable names, model structure.
2. The FMU runs for at most `MAX_STEPS` steps of its default experiment, in a separate process
   (`check_run`, started and watched as in `process`).
3. Problems of both, warnings, and each variable with its values before and after are reported.
"""

from __future__ import annotations

import json
import math
import mmap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

from urmpipe_fmus.check_run import CALL_BYTES, LOG_BYTES
from urmpipe_fmus.fmu_file import FmuFile, host_platforms, open_fmu
from urmpipe_fmus.process import DEFAULT_TIMEOUT, CallWatchdog, FmuProcess
from urmpipe_fmus.python_fmu.place import why_not_in
from urmpipe_models.errors import Finding, FmuError
from urmpipe_models.processes import describe_exit

MAX_STEPS = 20  # fewer if the default experiment is shorter
DEFAULT_STEP = 0.005  # s; communication step of an FMU that states none
MAX_LOG_LINES = 5  # last lines of the log in the problems of an FMU that fails
START_TIMEOUT = 60.0  # s from the start of the job (`FmuProcess.run`) to the first call of the FMU
CO_SIMULATION = "FMI 2.0 for co-simulation, as most tools export it, too"
PLATFORM_SUFFIXES = (".so", ".dll", ".dylib")


@dataclass(frozen=True, slots=True)
class CheckedVariable:
    """A variable of a checked FMU.

    Attributes:
        name: Its name.
        causality: input, output, parameter, ...
        variability: fixed, tunable, discrete, ...
        type: Real, Integer, Boolean, String or Enumeration.
        unit: As the FMU spells it; empty without one.
        start: The start value as the FMU writes it; empty without one.
        min: The minimum; None without a bound.
        max: The maximum; None without a bound.
        before: Its value after the initialization; None if unknown or not finite.
        after: Its value after the last step; None if unknown or not finite.
        description: One line of text.
    """

    name: str
    causality: str
    variability: str
    type: str
    unit: str
    start: str
    min: float | None
    max: float | None
    before: float | int | bool | str | None
    after: float | int | bool | str | None
    description: str


@dataclass(frozen=True, slots=True)
class CheckReport:
    """The result of a check.

    Attributes:
        path: The file.
        name: Name of the model.
        guid: Its GUID.
        generator: The tool that exported it.
        platforms: FMI's names of the platforms of its binaries.
        problems: Errors, one line each; empty if there are none.
        warnings: Warnings of the run, one line each.
        variables: Its variables.
        step: Communication step of the run in [s].
        steps: Number of requested steps.
        ran: Whether it ran to the end without an error.
    """

    path: Path
    name: str
    guid: str
    generator: str
    platforms: tuple[str, ...]
    problems: tuple[str, ...]
    warnings: tuple[str, ...]
    variables: tuple[CheckedVariable, ...]
    step: float
    steps: int
    ran: bool

    def to_dict(self) -> dict[str, Any]:
        """Return all fields as values that JSON can hold."""
        return {**asdict(self), "path": str(self.path)}


@dataclass(slots=True)
class RunReport:
    """The report of the process that ran an FMU.

    Attributes:
        ended: The call that did not return, and how the process ended; empty if it completed.
        log: The lines that the FMU logged.
        failed: The call that failed, and how; empty if none did.
        before: Values by variable after the initialization; empty if that failed.
        after: Values by variable after the last step.
        first_non_finite: Time in [s], index of the variable, and value where an output is first not finite.
        warned: Each call that returned fmi2Warning, and what the FMU logged meanwhile.
    """

    ended: str = ""
    log: list[str] = field(default_factory=list)
    failed: str = ""
    before: list[Any] = field(default_factory=list)
    after: list[Any] = field(default_factory=list)
    first_non_finite: list[tuple[float, int, float]] = field(default_factory=list)
    warned: list[tuple[str, str]] = field(default_factory=list)


def check_fmu(path: Path, *, timeout: float = DEFAULT_TIMEOUT) -> CheckReport:
    """Check an FMU 2.0 for co-simulation, of any tool.

    FMPy validates it. It runs for some steps of its default experiment in a separate process, which may use
    8 GB of memory.

    Args:
        path: The file.
        timeout: Maximum duration of a call of the FMU in [s].

    Raises:
        FmuError: If the file is no such FMU, or its archive or description exceeds the limits.
    """
    file = open_fmu(path)
    description = _read_description(file)
    problems = _validate(path)
    paths = [Path(name).parts for name in file.names if name.endswith(PLATFORM_SUFFIXES)]
    platforms = tuple(sorted({parts[1] for parts in paths if len(parts) == 3 and parts[0] == "binaries"}))
    experiment = description.defaultExperiment
    start = _finite_number(experiment and experiment.startTime, 0.0)
    step = _finite_number(experiment and experiment.stepSize, DEFAULT_STEP)
    step = step if step > 0.0 else DEFAULT_STEP
    length = (_finite_number(experiment and experiment.stopTime, math.inf) - start) / step
    steps = MAX_STEPS if length >= MAX_STEPS or length <= 0.0 else max(1, round(length))
    if set(host_platforms()) & set(platforms):
        run = _run(file, description, {"start": start, "step": step, "steps": steps}, timeout)
    else:
        available, here = ", ".join(platforms) or "no platform", " or ".join(host_platforms())
        run = RunReport(
            failed=f"found binaries for {available}, allowed for a run here: {here}; it was not run"
        )
    run_problems = _run_problems(run)
    return CheckReport(
        path=path,
        name=description.modelName,
        guid=description.guid,
        generator=description.generationTool or "",
        platforms=platforms,
        problems=(*problems, *run_problems, *_non_finite_problems(description.modelVariables, run)),
        warnings=tuple(_warnings(run)),
        variables=tuple(_variables(description.modelVariables, run)),
        step=step,
        steps=steps,
        ran=not run_problems,
    )


def _read_description(file: FmuFile) -> Any:
    if file.version != "2.0":
        version = f"FMI {file.version}" if file.version else "no version of FMI"
        raise FmuError(Finding(f"found {version}, allowed: {CO_SIMULATION}", file=str(file.path)))
    if "CoSimulation" not in file.kinds:
        message = f"found no FMU for co-simulation, allowed: {CO_SIMULATION}"
        raise FmuError(Finding(message, file=str(file.path)))
    return file.read_description()


def _validate(path: Path) -> list[str]:
    """Return the problems that FMPy's validation finds."""
    from fmpy import read_model_description
    from fmpy.model_description import ValidationError

    problems: list[Any] = []
    try:
        read_model_description(
            path, validate=True, validate_variable_names=True, validate_model_structure=True
        )
    except ValidationError as error:
        problems = error.problems
    except Exception as error:  # a description that breaks the validation is wrong too
        problems.append(f"the validation ended with {type(error).__name__}: {error}")
    return [" ".join(str(problem).split()) for problem in problems]


def _finite_number(text: Any, default: float) -> float:
    """Return the finite number of an attribute, or a default."""
    try:
        value = float(text)
    except (TypeError, ValueError):
        return default
    return value if math.isfinite(value) else default


def _run(file: FmuFile, description: Any, experiment: Mapping[str, Any], timeout: float) -> RunReport:
    """Run an FMU in a separate process.

    Args:
        file: The FMU.
        description: FMPy's description of it.
        experiment: Start and communication step in [s], and number of steps.
        timeout: Maximum duration of a call in [s].
    """
    variables = description.modelVariables
    job = {
        "guid": description.guid,
        "identifier": description.coSimulation.modelIdentifier,
        "variables": [
            ("Integer" if variable.type == "Enumeration" else str(variable.type), variable.valueReference)
            for variable in variables
        ],
        "watched": [
            (i, variable.valueReference)
            for i, variable in enumerate(variables)
            if variable.causality == "output" and variable.type == "Real"
        ],
        **experiment,
    }
    with FmuProcess(
        "urmpipe_fmus.check_run", prefix="urmpipe-check-", keep_stdout=False, max_output=LOG_BYTES
    ) as process:
        folder = process.folder
        file.unpack(folder / "fmu")
        if reason := why_not_in(folder / "fmu"):
            return RunReport(failed=reason)
        (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
        (folder / "call").write_bytes(bytes(CALL_BYTES))
        (folder / "log").touch()
        watchdog = CallWatchdog()
        with (folder / "call").open("r+b") as shared, mmap.mmap(shared.fileno(), CALL_BYTES) as call:

            def watch() -> str:
                number = int.from_bytes(call[:8], "little")
                return watchdog.overdue(number, timeout if number else START_TIMEOUT)

            ended = process.run(watch)
            name = bytes(call[8:]).rstrip(b"\0").decode("utf-8", "replace") or "loading"
        if process.exit_code > 0:
            ended = ": ".join((ended, *process.last_lines(1)))
        return _read_report(folder, name, ended)


def _read_report(folder: Path, last_call: str, ended: str) -> RunReport:
    """Read what the process wrote; without its last line it ended during its last call."""
    run = RunReport(log=(folder / "log").read_text("utf-8", "replace").splitlines())
    results, complete = folder / "results", False
    for line in results.read_text("utf-8").splitlines() if results.exists() else ():
        kind, value = json.loads(line)
        if kind == "complete":
            complete = True
        elif kind in ("first_non_finite", "warned"):
            getattr(run, kind).append(tuple(value))
        else:
            setattr(run, kind, value)
    if ended or not complete:
        run.ended = f"{last_call} {ended or describe_exit(0)}"
    return run


def _run_problems(run: RunReport) -> list[str]:
    """Return the errors of a run, with the last lines that the FMU logged."""
    unreadable = sum(value is None for value in run.before)
    problems = [f"{unreadable} variables cannot be read after the initialization"] if unreadable else []
    problems += [problem for problem in (run.failed, run.ended) if problem]
    return problems and problems + [f"its log: {line}" for line in run.log][-MAX_LOG_LINES:]


def _non_finite_problems(variables: Sequence[Any], run: RunReport) -> Iterator[str]:
    """Yield the outputs that are not finite, by the time at which this begins."""
    for t, outputs in groupby(run.first_non_finite, key=lambda output: output[0]):
        names = ", ".join(f"{variables[i].name} = {value:g}" for _, i, value in outputs)
        yield f"at {t:.9g} s: found {names}, allowed: outputs that are finite"


def _warnings(run: RunReport) -> Iterator[str]:
    """Yield for each function the first call that returned fmi2Warning, with what the FMU logged."""
    functions = [call.split(" ")[0] for call, _ in run.warned]
    for function in dict.fromkeys(functions):
        call, logged = run.warned[functions.index(function)]
        count = functions.count(function) - 1
        more = f", and {count} more of its calls" if count else ""
        yield f"{call} returned fmi2Warning{more}{logged and f'; its log: {logged}'}"


def _variables(variables: Sequence[Any], run: RunReport) -> Iterator[CheckedVariable]:
    """Yield the variables of an FMU with their values, if it ran."""
    unknown = [None] * len(variables)
    for variable, before, after in zip(variables, run.before or unknown, run.after or unknown, strict=True):
        declared = variable.declaredType
        low, high = (
            _finite_number(getattr(variable, bound) or getattr(declared, bound, None), math.nan)
            for bound in ("min", "max")
        )
        yield CheckedVariable(
            name=variable.name,
            causality=variable.causality or "local",
            variability=variable.variability or "",
            type=variable.type,
            unit=variable.unit or (declared.unit if declared else None) or "",
            start="" if variable.start is None else str(variable.start),
            min=_finite_or_none(low),
            max=_finite_or_none(high),
            before=_finite_or_none(before),
            after=_finite_or_none(after),
            description=variable.description or "",
        )


def _finite_or_none(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
