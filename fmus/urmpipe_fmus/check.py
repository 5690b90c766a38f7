"""Whether an FMU is right and runs: validation, a short run of its default experiment, its variables."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from urmpipe_fmus.fmu_file import FmuFile, host_platforms, open_fmu
from urmpipe_fmus.process import TIMEOUT, Run, run_job
from urmpipe_fmus.python_fmu.place import why_not_in
from urmpipe_models.errors import Finding, FmuError

STEPS = 20
"""So many steps are tried, less if the default experiment is shorter."""

STEP = 0.005
"""The communication step in [s] of an FMU that tells none."""

LINES = 5
"""So many of the last lines of its log are shown where an FMU fails."""

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
        min: The least value allowed; None without a bound.
        max: The largest value allowed.
        before: Its value after the initialization; None if it is not known or not finite.
        after: Its value after the last step.
        description: One line for people.
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
class Checked:
    """What was found in an FMU.

    Attributes:
        path: The file.
        name: Name of the model.
        guid: Its GUID.
        generator: The tool that made it.
        platforms: FMI's names of the platforms that it has binaries for.
        problems: All that is wrong, one line each; empty if nothing is.
        warnings: What it warned of while it ran, one line each.
        variables: Its variables.
        step: Communication step of the run in [s].
        steps: How many steps were asked for.
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
        """Return all of it as what JSON can hold."""
        return {**asdict(self), "path": str(self.path)}


def check_fmu(path: Path, *, timeout: float = TIMEOUT) -> Checked:
    """Check an FMU 2.0 for co-simulation, of whatever tool.

    It is validated by FMPy and runs for some steps of its default experiment in a process of its own, which
    may take 8 GB of memory.

    Args:
        path: The file.
        timeout: How long a call of the FMU may take, in [s].

    Raises:
        FmuError: If the file is no such FMU, or its archive or description exceeds the limits.
    """
    file = open_fmu(path)
    described = _described(file)
    problems = _validated(path)
    platforms = _platforms(file)
    start, step, steps = _experiment(described)
    here = host_platforms()
    if set(here) & set(platforms):
        run = _run(file, described, (start, step, steps), timeout)
    else:
        found = ", ".join(platforms) or "no platform"
        run = Run(
            failed=f"found binaries for {found}, allowed for a run here: {' or '.join(here)}; it was not run"
        )
    wrong = _problems(run)
    return Checked(
        path=path,
        name=described.modelName,
        guid=described.guid,
        generator=described.generationTool or "",
        platforms=platforms,
        problems=(*problems, *wrong, *_not_finite(described.modelVariables, run)),
        warnings=tuple(_warnings(run)),
        variables=tuple(_variables(described, run.before, run.after)),
        step=step,
        steps=steps,
        ran=not wrong,
    )


def _described(file: FmuFile) -> Any:
    """Return the model description of an FMU 2.0 for co-simulation."""
    if file.version != "2.0":
        found = f"FMI {file.version}" if file.version else "no version of FMI"
        said = f"found {found}, allowed: {CO_SIMULATION}"
        raise FmuError(Finding(said, file=str(file.path)))
    if "CoSimulation" not in file.kinds:
        said = f"found no FMU for co-simulation, allowed: {CO_SIMULATION}"
        raise FmuError(Finding(said, file=str(file.path)))
    return file.read_description()


def _validated(path: Path) -> list[str]:
    """Return what FMPy's validation finds."""
    from fmpy import read_model_description
    from fmpy.model_description import ValidationError

    problems: list[Any] = []
    try:
        read_model_description(
            path, validate=True, validate_variable_names=True, validate_model_structure=True
        )
    except ValidationError as error:
        problems = error.problems
    except Exception as error:  # what FMPy's validation stumbles over is wrong too
        problems.append(f"the validation ended with {type(error).__name__}: {error}")
    return [" ".join(str(one).split()) for one in problems]


def _platforms(file: FmuFile) -> tuple[str, ...]:
    """Return FMI's names of the platforms that an FMU has binaries for."""
    parts = [Path(name).parts for name in file.names if name.endswith(PLATFORM_SUFFIXES)]
    return tuple(sorted({one[1] for one in parts if len(one) == 3 and one[0] == "binaries"}))


def _experiment(described: Any) -> tuple[float, float, int]:
    """Return start time and communication step in [s] of the default experiment, and a number of steps."""
    told = described.defaultExperiment
    start = _number(told and told.startTime, 0.0)
    step = _number(told and told.stepSize, STEP)
    step = step if step > 0.0 else STEP
    stop = _number(told and told.stopTime, math.inf)
    wanted = (stop - start) / step
    return start, step, STEPS if wanted >= STEPS or wanted <= 0.0 else max(1, round(wanted))


def _number(text: Any, default: float) -> float:
    """Return the finite number of an attribute, or a default."""
    try:
        value = float(text)
    except (TypeError, ValueError):
        return default
    return value if math.isfinite(value) else default


def _run(file: FmuFile, described: Any, experiment: tuple[float, float, int], timeout: float) -> Run:
    """Run an FMU in a process of its own."""
    start, step, steps = experiment
    variables = described.modelVariables
    with tempfile.TemporaryDirectory(prefix="urmpipe-check-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        file.unpack(folder / "fmu")
        misplaced = why_not_in(folder / "fmu")
        if misplaced:
            return Run(failed=misplaced)
        job = {
            "guid": described.guid,
            "identifier": described.coSimulation.modelIdentifier,
            "variables": [(_type(one), one.valueReference) for one in variables],
            "watched": [
                (i, one.valueReference)
                for i, one in enumerate(variables)
                if one.causality == "output" and one.type == "Real"
            ],
            "start": start,
            "step": step,
            "steps": steps,
        }
        return run_job(folder, job, timeout)


def _problems(run: Run) -> list[str]:
    """Return what went wrong in a run, with the last lines that the FMU logged."""
    refused = sum(one is None for one in run.before)
    said = [f"{refused} variables cannot be read after the initialization"] if refused else []
    said += [one for one in (run.failed, run.ended) if one]
    return said and said + [f"its log: {line}" for line in run.log][-LINES:]


def _not_finite(variables: Sequence[Any], run: Run) -> Iterator[str]:
    """Yield which outputs are not finite from when on."""
    for t, odd in groupby(run.odd, key=lambda one: one[0]):
        found = ", ".join(f"{variables[i].name} = {value:g}" for _, i, value in odd)
        yield f"at {t:.9g} s: found {found}, allowed: outputs that are finite"


def _warnings(run: Run) -> Iterator[str]:
    """Yield what returned fmi2Warning: of each function the first call, with what the FMU logged."""
    functions = [what.split(" ")[0] for what, _ in run.warned]
    for function in dict.fromkeys(functions):
        what, logged = run.warned[functions.index(function)]
        count = functions.count(function) - 1
        more = f", and {count} more of its calls" if count else ""
        yield f"{what} returned fmi2Warning{more}{logged and f'; its log: {logged}'}"


def _variables(described: Any, before: Sequence[Any], after: Sequence[Any]) -> list[CheckedVariable]:
    """Return the variables of an FMU with their values, if it ran."""
    count = len(described.modelVariables)
    unknown = [None] * count
    return [
        CheckedVariable(
            name=one.name,
            causality=one.causality or "local",
            variability=one.variability or "",
            type=one.type,
            unit=one.unit or (one.declaredType.unit if one.declaredType else None) or "",
            start="" if one.start is None else str(one.start),
            min=_bound(one, "min"),
            max=_bound(one, "max"),
            before=_finite(first),
            after=_finite(last),
            description=one.description or "",
        )
        for one, first, last in zip(
            described.modelVariables, before or unknown, after or unknown, strict=True
        )
    ]


def _bound(one: Any, which: str) -> float | None:
    """Return a bound of a variable, its own or that of its declared type."""
    told = getattr(one, which) or getattr(one.declaredType, which, None)
    value = _number(told, math.nan)
    return None if math.isnan(value) else value


def _type(one: Any) -> str:
    """Return by which function a variable is read."""
    return "Integer" if one.type == "Enumeration" else str(one.type)


def _finite(value: Any) -> Any:
    """Return a value; None for a number that is not finite."""
    return None if isinstance(value, float) and not math.isfinite(value) else value
