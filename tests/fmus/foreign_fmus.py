"""FMUs that nobody here exported: small models in C, with descriptions written by hand."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from typing import Any

import numpy as np
import pytest

from asserting import there
from urmpipe_fmus.cosim import (
    Block,
    Connection,
    CosimulationRecord,
    LogColumn,
    LogInput,
    Plan,
    Port,
    System,
    prepare,
    simulate,
)

HERE = Path(__file__).parent


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


@cache
def compiled(model: str) -> bytes:
    """Return the library of a model.h: the same for models that differ by their descriptions alone."""
    import fmpy

    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("needs a C compiler: cc")
    with TemporaryDirectory() as folder:
        Path(folder, "model.h").write_text(model)
        includes = (f"-I{folder}", f"-I{Path(fmpy.__file__).parent / 'c-code'}")
        # not optimized: it takes longer to compile than to run
        flags = ("-shared", "-fPIC", "-O0", "-w", *includes)
        library = Path(folder, "library")
        subprocess.run([compiler, *flags, HERE / "foreign_fmus.c", "-o", library, "-lm"], check=True)
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
    guid: str = field(default="{f0e1d2c3}")

    def write(self, folder: Path) -> Path:
        """Compile and pack it; return the FMU."""
        import fmpy

        made = folder / f"{self.name}.fmu"
        library = compiled(
            f'#define GUID "{self.guid}"\n#define FRESH {int(self.fresh)}\n'
            f"#define VARIABLE_STEP {int(self.variable_step)}\n"
            + "".join(f"#define {macro} {code}\n" for macro, code in self._calls().items())
            + f"static void compute(Model *m) {{ Values *v = &m->v; (void)v; {self.compute} }}\n"
            "static fmi2Status step(Model *m, double t, double h) {\n"
            f"    Values *v = &m->v; (void)v; {self.step}\n    return fmi2OK;\n}}\n"
        )
        with zipfile.ZipFile(made, "w") as archive:
            archive.writestr("modelDescription.xml", self.description())
            archive.writestr(f"binaries/{fmpy.platform}/{self.name}{fmpy.sharedLibraryExtension}", library)
        return made

    def _calls(self) -> dict[str, str]:
        """Return the C of each call by its macro."""
        return {
            "LOAD": self.load,
            "START": self.start,
            "SETUP": self.setup,
            "ENTER": self.enter,
            "EXIT": self.exit,
            "ON_GET": self.get,
            "ON_SET": self.set,
            "FREE": self.free,
            "TERMINATE": self.terminate,
        }

    def description(self) -> str:
        places = {one.name: i for i, one in enumerate(self.scalars, 1)}
        outputs = "".join(
            f'<Unknown index="{places[one.name]}"'
            + ("" if one.on is None else f' dependencies="{" ".join(str(places[n]) for n in one.on)}"')
            + "/>"
            for one in self.scalars
            if one.causality == "output"
        )
        variables = "".join(_variable(one) for one in self.scalars)
        return (
            '<?xml version="1.0" encoding="UTF-8"?>'
            f'<fmiModelDescription fmiVersion="2.0" modelName="{self.name}" guid="{self.guid}">'
            f'<CoSimulation modelIdentifier="{self.name}"'
            f' canHandleVariableCommunicationStepSize="{str(self.variable_step).lower()}"'
            f' canGetAndSetFMUstate="{str(self.can_save).lower()}"'
            f' canBeInstantiatedOnlyOncePerProcess="{str(self.once).lower()}"/>'
            + (f"<UnitDefinitions>{self.units}</UnitDefinitions>" if self.units else "")
            + f"<ModelVariables>{variables}</ModelVariables>"
            + f"<ModelStructure><Outputs>{outputs}</Outputs></ModelStructure></fmiModelDescription>"
        )


def _variable(one: Scalar) -> str:
    changes = "continuous" if one.type == "Real" else "discrete"
    changes = "tunable" if one.causality == "parameter" else changes
    initial = f' initial="{one.initial}"' if one.initial else ""
    needs_start = one.causality in ("parameter", "input")
    start = one.start or (("false" if one.type == "Boolean" else "0") if needs_start else None)
    told = f' start="{start}"' if start is not None else ""
    unit = f' unit="{one.unit}"' if one.unit else ""
    return (
        f'<ScalarVariable name="{one.name}" valueReference="{one.place}" causality="{one.causality}"'
        f' variability="{changes}"{initial}><{one.type}{unit}{told}{one.extra}/></ScalarVariable>'
    )


def gain(name: str = "gain", *, fresh: bool = True, formula: str = "k * u + c", **options: object) -> Foreign:
    """y = k u + c, at once; or only after a step."""
    unit = str(options.pop("unit", ""))
    on = options.pop("on", ("u",))
    return Foreign(
        name=name,
        scalars=(
            Scalar("k", 0, "parameter", start="1"),
            Scalar("c", 1, "parameter", start="0"),
            Scalar("u", 2, "input", unit=unit),
            Scalar("y", 3, unit=unit, on=on),  # type: ignore[arg-type]
        ),
        compute=f"double k = v->r[0], c = v->r[1], u = v->r[2]; (void)k; v->r[3] = {formula};",
        start="m->v.r[0] = 1;",
        fresh=fresh,
        **options,  # type: ignore[arg-type]
    )


HANGS = "for (;;) pause();"
"""C that does not return."""

OVERFLOWS = "overflow(0);"
"""C that overflows the stack."""

TAKES_MEMORY = "take(20000000000u);"
"""C that takes 20 GB in one piece; where it gets none, it writes to NULL."""

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
    """Return an FMU of which a call runs some C.

    Args:
        call: load, start (fmi2Instantiate), setup, enter, exit, get, set, step, terminate or free.
        code: The C.
    """
    return Foreign(
        name=f"in_{call}",
        scalars=(Scalar("u", 0, "input"), Scalar("y", 1)),
        **{call: code.replace("\n", " ")},  # type: ignore[arg-type]
    )


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

TROUBLE = Foreign(
    name="trouble",
    scalars=(
        Scalar("kind", 0, "parameter", "Integer", extra=' min="0" max="9"', start="0"),
        Scalar("at", 0, "parameter", start="0.05"),
        Scalar("y", 1),
    ),
    compute="v->r[1] = v->time;",
    step="""
    if (t < v->r[0] - 1e-9) return fmi2OK;
    LOG(m, fmi2OK, "%s: all is well at %g s", "trouble", t);
    switch (v->i[0]) {
    case 1: LOG(m, fmi2Warning, "about to break"); raise(SIGSEGV); break;
    case 2: abort();
    case 3: exit(7);
    case 4: LOG(m, fmi2Error, "the motor is %s", "hot"); return fmi2Error;
    case 5: return fmi2Discard;
    case 6: m->terminated = 1; return fmi2Discard;
    case 7: LOG(m, fmi2Warning, "warm"); return fmi2Warning;
    case 8: return fmi2Fatal;
    case 9: for (;;) pause();
    }
    """,
    start="m->v.r[0] = 0.05;",
)
"""Breaks from a time on, in the way of its parameter `kind`."""


@cache
def _folder() -> Path:
    import atexit

    folder = Path(mkdtemp(prefix="foreign-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


@cache
def fmu(foreign: Foreign) -> Path:
    """Return a foreign FMU, compiled once a test run."""
    return foreign.write(Path(mkdtemp(dir=_folder())))


def system(
    blocks: Mapping[str, Foreign | Path],
    connections: Mapping[str, str] | None = None,
    start: Mapping[str, Mapping[str, Any]] | None = None,
    inputs: Sequence[LogInput] = (),
    **options: Any,
) -> System:
    """Return a system of FMUs; connections are destination: source."""
    made = {"step": 0.1, "duration": 1.0, **options}
    return System(
        name="test",
        path=Path("test.toml"),
        blocks=tuple(
            Block(
                name=name,
                fmu=model if isinstance(model, Path) else fmu(model),
                start=(start or {}).get(name, {}),
            )
            for name, model in blocks.items()
        ),
        connections=tuple(
            Connection(Port(*to.split(".", 1)), Port(*source.split(".", 1)))
            for to, source in (connections or {}).items()
        ),
        inputs=tuple(inputs),
        **made,
    )


ZEROS = LogColumn(np.array([0, 10**9]), np.zeros(2))
"""A column of 1 s."""


def follow(port: str, column: str = "u", log: str = "run.csv", *, interpolate: bool = False) -> LogInput:
    """Return an input that follows a column of a log."""
    destination = Port(*port.split(".", 1))
    return LogInput(destination=destination, log=log, column=column, interpolate=interpolate)


def copy_changed(path: Path, copy: Path, name: str, change: Callable[[bytes], bytes]) -> Path:
    """Copy an FMU, with a change of its entries whose names begin so."""
    with zipfile.ZipFile(path) as archive, zipfile.ZipFile(copy, "w") as changed:
        for entry in archive.namelist():
            data = archive.read(entry)
            changed.writestr(entry, change(data) if entry.startswith(name) else data)
    return copy


def fmu_of(block: Block) -> Path:
    """Return the FMU of a block that names one."""
    return there(block.fmu)


def planned(*arguments: Any, column: Callable[[LogInput], LogColumn] | None = None, **options: Any) -> Plan:
    """Return the plan of a system of foreign FMUs: the arguments are those of `system`."""
    return prepare(system(*arguments, **options), fmu_of, column=column)


def ran(*arguments: Any, **options: Any) -> CosimulationRecord:
    """Return what a system of foreign FMUs recorded: the arguments are those of `planned`."""
    return simulate(planned(*arguments, **options))
