"""Whether an FMU is right and runs: validation, a short run of its default experiment, its variables."""

from __future__ import annotations

import json
import math
import subprocess
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from urmpipe_fmus.check_run import CALL
from urmpipe_fmus.fmu_process import command, ending, environment
from urmpipe_fmus.platforms import platforms_here
from urmpipe_fmus.python_fmu.place import why_not_in
from urmpipe_models.errors import Finding, FmuError
from urmpipe_models.files.missing import meant_by

STEPS = 20
"""So many steps are tried, less if the default experiment is shorter."""

STEP = 0.005
"""The communication step in [s] of an FMU that tells none."""

SECONDS = 60.0
"""A run that takes longer has hung."""

LINES = 5
"""So many of the last lines of its log are shown where an FMU fails."""

AN_FMU = "an FMU, such as urmpipe fmu build makes of a unit"
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
    variables: tuple[CheckedVariable, ...]
    step: float
    steps: int
    ran: bool

    def to_dict(self) -> dict[str, Any]:
        """Return all of it as what JSON can hold."""
        return {**asdict(self), "path": str(self.path)}


def check_fmu(path: Path) -> Checked:
    """Check an FMU 2.0 for co-simulation, of whatever tool.

    It is validated by FMPy and runs for some steps of its default experiment in a process of its own.

    Raises:
        FmuError: If the file is no such FMU.
    """
    described = _described(path)
    problems = _validated(path)
    platforms = _platforms(path)
    start, step, steps = _experiment(described)
    here = platforms_here()
    if set(here) & set(platforms):
        run = _run(path, described, (start, step, steps))
    else:
        found = ", ".join(platforms) or "no platform"
        said = f"found binaries for {found}, allowed for a run here: {' or '.join(here)}; it was not run"
        run = {"before": [], "after": [], "problems": [said]}
    return Checked(
        path=path,
        name=described.modelName,
        guid=described.guid,
        generator=described.generationTool or "",
        platforms=platforms,
        problems=(*problems, *run["problems"], *_not_finite(described, run, (start, start + steps * step))),
        variables=tuple(_variables(described, run["before"], run["after"])),
        step=step,
        steps=steps,
        ran=not run["problems"],
    )


def _described(path: Path) -> Any:
    """Return the model description of an FMU 2.0 for co-simulation."""
    from fmpy import read_model_description

    try:
        if path.is_dir():  # which Windows only says may not be read
            raise _refused(path, f"found a folder, allowed: {AN_FMU}")
        with zipfile.ZipFile(path) as archive:
            if "modelDescription.xml" not in archive.namelist():
                raise _refused(path, f"found a zip without modelDescription.xml, allowed: {AN_FMU}")
            root = ET.fromstring(archive.read("modelDescription.xml"))
    except FileNotFoundError as error:
        meant = meant_by(path, (".fmu",))
        raise _refused(path, f"found no such file{meant}, allowed: {AN_FMU}") from error
    except OSError as error:
        raise _refused(path, f"cannot be read: {error.strerror or error}") from error
    except (zipfile.BadZipFile, zlib.error) as error:
        raise _refused(path, f"found {_no_zip(path)}, allowed: {AN_FMU}") from error
    except (ET.ParseError, LookupError, ValueError) as error:
        said = f"modelDescription.xml cannot be read: {error}; allowed: XML as FMI 2.0 has it"
        raise _refused(path, said) from error
    version = root.get("fmiVersion")
    if version != "2.0":
        raise _refused(path, f"found FMI {version}, allowed: {CO_SIMULATION}")
    if root.find("CoSimulation") is None:
        raise _refused(path, f"found no FMU for co-simulation, allowed: {CO_SIMULATION}")
    try:
        return read_model_description(str(path), validate=False)
    except Exception as error:  # what FMPy raises for a description it does not expect is of any kind
        said = f"modelDescription.xml cannot be read: {type(error).__name__}: {error}"
        raise _refused(path, said) from error


def _no_zip(path: Path) -> str:
    """Return what a file is that cannot be opened as the zip that an FMU is."""
    with path.open("rb") as file:
        head = file.read(2)
    if not head:
        return "an empty file"
    return "a zip that is cut off or damaged" if head == b"PK" else "no zip, as an FMU is one"


def _refused(path: Path, said: str) -> FmuError:
    return FmuError(Finding(said, file=str(path)))


def _validated(path: Path) -> list[str]:
    """Return what FMPy's validation finds."""
    from fmpy import read_model_description
    from fmpy.model_description import ValidationError

    with zipfile.ZipFile(path) as archive:
        names = [one.orig_filename for one in archive.filelist]
    problems = [f"{name}: found a backslash in a path, allowed: /" for name in names if "\\" in name]
    try:
        read_model_description(
            str(path), validate=True, validate_variable_names=True, validate_model_structure=True
        )
    except ValidationError as error:
        problems += error.problems
    except Exception as error:  # what FMPy's validation stumbles over is wrong too
        problems.append(f"the validation ended with {type(error).__name__}: {error}")
    return [" ".join(str(one).split()) for one in problems]


def _platforms(path: Path) -> tuple[str, ...]:
    """Return FMI's names of the platforms that an FMU has binaries for."""
    with zipfile.ZipFile(path) as archive:
        parts = [Path(name).parts for name in archive.namelist() if name.endswith(PLATFORM_SUFFIXES)]
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


def _run(path: Path, described: Any, experiment: tuple[float, float, int]) -> dict[str, Any]:
    """Run an FMU in a process of its own; return values before and after, and problems."""
    from fmpy import extract

    start, step, steps = experiment
    with tempfile.TemporaryDirectory(prefix="urmpipe-check-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        try:
            extract(str(path), unzipdir=str(folder / "fmu"))
        except Exception as error:  # FMPy raises Exception itself, zlib its own
            raise _refused(path, f"cannot be extracted: {error}") from error
        misplaced = why_not_in(folder / "fmu")
        if misplaced:
            return {"before": [], "after": [], "problems": [misplaced]}
        job = {
            "folder": str(folder / "fmu"),
            "guid": described.guid,
            "identifier": described.coSimulation.modelIdentifier,
            "variables": [(_type(one), one.valueReference) for one in described.modelVariables],
            "start": start,
            "step": step,
            "steps": steps,
        }
        (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
        ended = _process(folder)
        whole = (folder / "result.json").exists()
        log = (folder / "log").read_text("utf-8", "replace").splitlines() if (folder / "log").exists() else []
        result = {"failed": "", "before": [], "after": []}
        if whole:
            result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    if not whole:
        ended = ended or ending(0)
    return {**result, "problems": _problems(result, ended, log)}


def _process(folder: Path) -> str:
    """Run the job of a folder; return how the process ended, empty if well."""
    try:
        done = subprocess.run(
            command("urmpipe_fmus.check_run", str(folder / "job.json")),
            env=environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"did not return within {SECONDS:g} s"
    said = done.stderr.decode("utf-8", "replace").strip().splitlines() if done.returncode > 0 else []
    return ": ".join((ending(done.returncode), *said[-1:])) if done.returncode else ""


def _problems(result: Mapping[str, Any], ended: str, log: Sequence[str]) -> list[str]:
    """Return what went wrong in a run, with the last lines that the FMU logged."""
    calls = [line.removeprefix(CALL) for line in log if line.startswith(CALL)]
    refused = sum(one is None for one in result["before"])
    said = [f"{refused} variables cannot be read after the initialization"] if refused else []
    if ended:
        said.append(f"{calls[-1] if calls else 'loading'} {ended}")
    elif result["failed"]:
        said.append(str(result["failed"]))
    if not said:
        return []
    return said + [f"its log: {line}" for line in log if not line.startswith(CALL)][-LINES:]


def _not_finite(described: Any, run: Mapping[str, Any], times: tuple[float, float]) -> Iterator[str]:
    """Yield which outputs are not finite after the initialization and the last step, at times in [s]."""
    ran = {"before": times[0]} if run["problems"] else dict(zip(("before", "after"), times, strict=True))
    for when, t in ran.items():
        odd = [
            f"{one.name} = {value:g}"
            for one, value in zip(described.modelVariables, run[when], strict=False)
            if one.causality == "output" and value is not None and _finite(value) is None
        ]
        if odd:
            yield f"at {t:.9g} s: found {', '.join(odd)}, allowed: outputs that are finite"


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
