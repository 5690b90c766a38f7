"""FMUs that nobody here exported: small models in C, with descriptions written by hand."""

from __future__ import annotations

import atexit
import shutil
import subprocess
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from typing import Any

import numpy as np
import pytest

from asserting import there
from urmpipe_fmus import cosim

GUID = "{f0e1d2c3}"
CALLS = ("load", "start", "setup", "enter", "exit", "get", "set", "free", "terminate")


@dataclass(frozen=True)
class Scalar:
    """A variable of a foreign FMU: its place is its value reference in the C array of its type."""

    name: str
    place: int
    causality: str = "output"
    type: str = "Real"
    start: str | None = None
    unit: str = ""
    extra: str = ""
    initial: str = ""
    on: tuple[str, ...] | None = ()

    def xml(self) -> str:
        """Return its line of the model description."""
        is_set = self.causality in ("parameter", "input")
        start = (self.start or {"Boolean": "false"}.get(self.type, "0")) if is_set else self.start
        variability = "continuous" if self.type == "Real" else "discrete"
        variable = {"name": self.name, "valueReference": self.place, "causality": self.causality}
        variable["variability"] = "tunable" if self.causality == "parameter" else variability
        value = _attributes(unit=self.unit, start=start)
        return (
            f"<ScalarVariable{_attributes(**variable, initial=self.initial)}>"
            f"<{self.type}{value}{self.extra}/></ScalarVariable>"
        )


def _attributes(**values: object) -> str:
    """Return those attributes of an XML element that are stated."""
    return "".join(f' {name}="{value}"' for name, value in values.items() if value not in ("", None))


@cache
def compiled(model: str) -> bytes:
    """Return the library of a model.h: the same for models that differ by their descriptions alone."""
    import fmpy

    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("needs a C compiler: cc")
    with TemporaryDirectory() as folder:
        Path(folder, "model.h").write_text(model)
        source, library = Path(__file__).with_suffix(".c"), Path(folder, "library")
        headers = Path(fmpy.__file__).parent / "c-code"
        # not optimized: it takes longer to compile than to run
        flags = ("-shared", "-fPIC", "-O0", "-w", f"-I{folder}", f"-I{headers}")
        subprocess.run([compiler, *flags, source, "-o", library, "-lm"], check=True)
        return library.read_bytes()


@dataclass(frozen=True)
class Foreign:
    """A foreign FMU: variables and C.

    `load` to `terminate` hold C that a call begins with, `load` what runs when the library is loaded. In
    `start`, `get`, `set` and `step`, `m` is the instance.
    """

    name: str
    scalars: tuple[Scalar, ...]
    compute: str = ""
    step: str = ""
    start: str = ""
    load: str = ""
    setup: str = ""
    enter: str = ""
    exit: str = ""
    get: str = ""
    set: str = ""
    free: str = ""
    terminate: str = ""
    fresh: bool = True
    can_save: bool = True
    once: bool = False
    variable_step: bool = True
    units: str = ""

    def write(self, folder: Path) -> Path:
        """Compile and pack it; return the FMU."""
        import fmpy

        macros = {"GUID": f'"{GUID}"', "FRESH": int(self.fresh), "VARIABLE_STEP": int(self.variable_step)}
        for call in CALLS:
            macros[f"ON_{call.upper()}" if call in ("get", "set") else call.upper()] = getattr(self, call)
        library = compiled(
            "".join(f"#define {macro} {code}\n" for macro, code in macros.items())
            + f"static void compute(Model *m) {{ Values *v = &m->v; (void)v; {self.compute} }}\n"
            "static fmi2Status step(Model *m, double t, double h) {\n"
            f"    Values *v = &m->v; (void)v; {self.step}\n    return fmi2OK;\n}}\n"
        )
        path = folder / f"{self.name}.fmu"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("modelDescription.xml", self.description())
            archive.writestr(f"binaries/{fmpy.platform}/{self.name}{fmpy.sharedLibraryExtension}", library)
        return path

    def description(self) -> str:
        """Return the model description."""
        places = {scalar.name: str(i) for i, scalar in enumerate(self.scalars, 1)}
        outputs = ""
        for scalar in (scalar for scalar in self.scalars if scalar.causality == "output"):
            dependencies = ""
            if scalar.on is not None:
                dependencies = f' dependencies="{" ".join(places[name] for name in scalar.on)}"'
            outputs += f'<Unknown index="{places[scalar.name]}"{dependencies}/>'
        abilities = {
            "canHandleVariableCommunicationStepSize": self.variable_step,
            "canGetAndSetFMUstate": self.can_save,
            "canBeInstantiatedOnlyOncePerProcess": self.once,
        }
        stated = _attributes(**{name: str(value).lower() for name, value in abilities.items()})
        return (
            '<?xml version="1.0" encoding="UTF-8"?>'
            f'<fmiModelDescription fmiVersion="2.0" modelName="{self.name}" guid="{GUID}">'
            f'<CoSimulation modelIdentifier="{self.name}"{stated}/>'
            + (f"<UnitDefinitions>{self.units}</UnitDefinitions>" if self.units else "")
            + f"<ModelVariables>{''.join(scalar.xml() for scalar in self.scalars)}</ModelVariables>"
            + f"<ModelStructure><Outputs>{outputs}</Outputs></ModelStructure></fmiModelDescription>"
        )


def gain(
    name: str = "gain", formula: str = "k * u + c", unit: str = "", on: Any = ("u",), **options: Any
) -> Foreign:
    """y = k u + c, at once; or only after a step if it is not fresh."""
    k, c = Scalar("k", 0, "parameter", start="1"), Scalar("c", 1, "parameter", start="0")
    return Foreign(
        name=name,
        scalars=(k, c, Scalar("u", 2, "input", unit=unit), Scalar("y", 3, unit=unit, on=on)),
        compute=f"double k = v->r[0], c = v->r[1], u = v->r[2]; (void)k; v->r[3] = {formula};",
        start="m->v.r[0] = 1;",
        **options,
    )


HANGS = "for (;;) pause();"  # does not return
OVERFLOWS = "overflow(0);"  # the stack
TAKES_MEMORY = "take(20000000000u);"  # 20 GB in one piece; where it gets none, it writes to NULL

STAIR = Foreign(
    name="stair",
    scalars=(Scalar("at", 0, "parameter", start="0.9"), Scalar("y", 1)),
    compute="v->r[1] = v->time;",
    step="""
    if (t + h > v->r[0] - 1e-9) { m->last = v->time = v->r[0]; m->terminated = 1; return fmi2Discard; }
    """,
    start="m->v.r[0] = 0.9;",
)
"""Ends the run at the time `at` within a step, as Reference-FMUs' Stair does; y is the time there."""


def trouble_in(call: str, code: str) -> Foreign:
    """Return an FMU that runs some C in `step` or in one of `CALLS`; `start` is fmi2Instantiate."""
    trouble: dict[str, Any] = {call: code.replace("\n", " ")}
    return Foreign(f"in_{call}", (Scalar("u", 0, "input"), Scalar("y", 1)), **trouble)


INTEGRATOR = Foreign(
    name="integrator",
    scalars=(Scalar("u", 0, "input"), Scalar("y", 1), Scalar("x", 2, "local", start="0", initial="exact")),
    compute="v->r[1] = v->r[2];",
    step="v->r[2] += h * v->r[0];",
)
"""y = x, x' = u by Euler's method: no direct feedthrough."""

COUNTER = Foreign(
    name="counter",
    scalars=(
        Scalar("by", 0, "input", "Integer"),
        Scalar("n", 1, "output", "Integer"),
        Scalar("on", 0, "input", "Boolean"),
        Scalar("even", 1, "output", "Boolean", on=()),
        Scalar("label", 0, "parameter", "String", start="none"),
    ),
    compute="v->b[1] = v->i[1] % 2 == 0;",
    step="if (v->b[0]) v->i[1] += v->i[0];",
)
"""Counts by an Integer while a Boolean is true."""


FOLDER = Path(mkdtemp(prefix="foreign-"))
atexit.register(shutil.rmtree, FOLDER, ignore_errors=True)


@cache
def fmu(foreign: Foreign) -> Path:
    """Return a foreign FMU, compiled once a test run."""
    return foreign.write(Path(mkdtemp(dir=FOLDER)))


def port(text: str) -> cosim.Port:
    """Return the port `block.variable`."""
    return cosim.Port(*text.split(".", 1))


def system(
    blocks: Mapping[str, Foreign | Path],
    connections: Mapping[str, str] | None = None,
    start: Mapping[str, Mapping[str, Any]] | None = None,
    inputs: Sequence[cosim.LogInput] = (),
    **options: Any,
) -> cosim.System:
    """Return a system of FMUs; connections are destination: source."""
    paths = {name: model if isinstance(model, Path) else fmu(model) for name, model in blocks.items()}
    starts, wires = start or {}, connections or {}
    return cosim.System(
        name="test",
        path=Path("test.toml"),
        blocks=tuple(cosim.Block(name=name, fmu=paths[name], start=starts.get(name, {})) for name in blocks),
        connections=tuple(cosim.Connection(port(to), port(source)) for to, source in wires.items()),
        inputs=tuple(inputs),
        **{"step": 0.1, "duration": 1.0, **options},
    )


ZEROS = cosim.LogColumn(np.array([0, 10**9]), np.zeros(2))  # a column of 1 s


def follow(to: str, column: str = "u", log: str = "run.csv", *, interpolate: bool = False) -> cosim.LogInput:
    """Return an input that follows a column of a log."""
    return cosim.LogInput(destination=port(to), log=log, column=column, interpolate=interpolate)


def copy_changed(path: Path, copy: Path, name: str, change: Callable[[bytes], bytes]) -> Path:
    """Copy an FMU, with a change of its entries whose names begin so."""
    with zipfile.ZipFile(path) as archive, zipfile.ZipFile(copy, "w") as changed:
        for entry in archive.namelist():
            data = archive.read(entry)
            changed.writestr(entry, change(data) if entry.startswith(name) else data)
    return copy


def fmu_of(block: cosim.Block) -> Path:
    """Return the FMU of a block that names one."""
    return there(block.fmu)


def planned(*arguments: Any, column: Any = None, **options: Any) -> cosim.Plan:
    """Return the plan of a system of foreign FMUs: the arguments are those of `system` and `prepare`."""
    return cosim.prepare(system(*arguments, **options), fmu_of, column=column)


def ran(*arguments: Any, **options: Any) -> cosim.CosimulationRecord:
    """Return what a system of foreign FMUs recorded: the arguments are those of `planned`."""
    return cosim.simulate(planned(*arguments, **options))
