"""Units built natively, and instances of them by FMPy's low-level calls."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from c_host import GUID, host
from urmpipe_fmus.block import (
    TABLE_FILE,
    BlockModel,
    Input,
    Memory,
    Output,
    Parameter,
    State,
    Table,
    table_bytes,
)
from urmpipe_fmus.native import (
    guid_header,
    native_binaries,
    native_sources,
    native_unavailable_reason,
    this_platform,
)


class Native:
    """An instance of a native FMU, ready to step.

    Attributes:
        fmu: FMPy's.
        said: What it told its logger.
    """

    def __init__(self, folder: Path, name: str, *, guid: str = GUID, start: float = 0.0) -> None:
        from fmpy import fmi2

        self.said: list[str] = []
        self.fmu = fmi2.FMU2Slave(
            guid=guid, modelIdentifier=name, unzipDirectory=str(folder), instanceName="one"
        )
        self._callbacks = fmi2.fmi2CallbackFunctions()
        self._callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._hear)
        self._callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmi2.calloc)
        self._callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmi2.free)
        self.fmu.instantiate(callbacks=self._callbacks)
        self.fmu.setupExperiment(startTime=start)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def _hear(self, _environment: Any, _name: bytes, _status: int, _category: bytes, message: bytes) -> None:
        self.said.append(message.decode())

    def step(self, time: float, size: float) -> None:
        self.fmu.doStep(time, size)

    def refused(self, call: Callable[[], Any]) -> list[str]:
        """Return what is told when a call gives fmi2Error."""
        self.said.clear()
        with pytest.raises(Exception, match="status 3"):
            call()
        return self.said

    def close(self) -> None:
        self.fmu.freeInstance()


@pytest.fixture(scope="session")
def c_host(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the host in C, compiled for this platform."""
    if shutil.which("cc") is None:
        pytest.skip("needs a C compiler: cc")
    return host(tmp_path_factory.mktemp("host"), ["cc", "-O1"])


@pytest.fixture(scope="session")
def compiled() -> dict[int, tuple[BlockModel, dict[str, bytes]]]:
    """Units that were compiled before, each by its identity, and the files of its FMU."""
    return {}


@pytest.fixture
def built(tmp_path: Path, compiled: dict[int, tuple[BlockModel, dict[str, bytes]]]) -> Callable[..., Path]:
    """Build a unit in an FMU's folder, without the description."""
    missing = native_unavailable_reason()
    if missing:
        pytest.skip(f"no native FMU can be built here: {missing}")

    done: set[Path] = set()

    def build(model: BlockModel, folder: str = "") -> Path:
        place = tmp_path / (folder or model.name)
        if place in done:  # a library that is loaded must not be written again
            return place
        done.add(place)
        if id(model) not in compiled:
            sources = native_sources(model)
            files = {**sources, **native_binaries(model, sources, GUID, [this_platform()])}
            files["sources/guid.h"] = guid_header(GUID)
            if model.table is not None:
                files[TABLE_FILE] = table_bytes(model.table)
            compiled[id(model)] = model, files
        for name, content in compiled[id(model)][1].items():
            path = place / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        return place

    return build


@pytest.fixture
def native(built: Callable[..., Path]) -> Iterator[Callable[..., Native]]:
    """Build a unit and make an instance of it."""
    made: list[Native] = []

    def make(model: BlockModel, **options: Any) -> Native:
        made.append(Native(built(model), model.name, **options))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture(scope="session")
def oscillator() -> BlockModel:
    """A unit with something of every kind and type."""

    def outputs(v: Any) -> dict[str, Any]:
        return {
            "force": v.k * (v.goal - v.x[0]) + np.sin(v.time),
            "turns": v.x[0] / 0.25,
            "far": np.abs(v.x[0]) > 1.0,
            "inverse": 1.0 / v.k,
        }

    def derivatives(v: Any) -> dict[str, Any]:
        push = np.where(v.on > 0.5, v.k, 0.0) * (v.goal - v.x[0])
        return {"x": (v.x[1], push - v.damping * v.x[1] + 0.1 * np.cos(v.time))}

    def update(v: Any) -> dict[str, Any]:
        return {"count": np.remainder(v.count + 1.0, 1000.0), "last": v.goal}

    return BlockModel(
        name="oscillator",
        description="a mass on a spring",
        variables=(
            Parameter(name="k", description="stiffness", start=2.0, minimum=0.0, maximum=100.0),
            Parameter(name="damping", description="damping", start=0.5, tunable=False),
            Input(name="goal", description="goal", start=1.0),
            Input(name="on", description="on", type="Boolean", start=1.0),
            Input(name="gear", description="gear", type="Integer", start=1.0, minimum=-1.0, maximum=5.0),
            State(name="x", description="place and speed", size=2, start=(0.1, 0.0), output=True),
            Memory(name="count", description="steps", type="Integer"),
            Memory(name="last", description="the goal before"),
            Output(name="force", description="force"),
            Output(name="turns", description="turns", type="Integer"),
            Output(name="far", description="far", type="Boolean"),
            Output(name="inverse", description="inverse"),
        ),
        outputs=outputs,
        derivatives=derivatives,
        update=update,
        internal_step=3e-3,
    )


@pytest.fixture(scope="session")
def player() -> BlockModel:
    """A unit that plays a table."""

    def outputs(v: Any) -> dict[str, Any]:
        before, after = v.table.before, v.table.after
        pairs = zip(before, after, strict=True)
        return {"held": before[0], "between": tuple(a + v.table.fraction * (b - a) for a, b in pairs)}

    return BlockModel(
        name="player",
        description="a table",
        variables=(
            Output(name="held", description="held"),
            Output(name="between", description="between", size=2),
        ),
        outputs=outputs,
        table=Table(np.array([-5, 0, 10_000_000, 25_000_000]), np.array([[1.0, 5], [2, 6], [4, 7], [-1, 8]])),
    )


@pytest.fixture(scope="session")
def elementary() -> BlockModel:
    """A unit with the elementary functions that a C library computes in its own way."""
    ones = ("sin", "cos", "tan", "arctan", "tanh", "arcsinh")
    damped = ("exp", "expm1", "sinh", "cosh")

    def outputs(v: Any) -> dict[str, Any]:
        small = np.tanh(v.x)
        far = 1.0 + np.abs(v.x)
        found = {name: getattr(np, name)(v.x) for name in ones}
        found |= {name: getattr(np, name)(-np.abs(v.x)) for name in damped}
        found |= {name: getattr(np, name)(small) for name in ("arcsin", "arccos")}
        found |= {"log": np.log(far), "log1p": np.log1p(small * 0.5), "arccosh": np.arccosh(far)}
        found |= {"hypot": np.hypot(v.x, v.y), "arctan2": np.arctan2(v.y, v.x)}
        return found | {
            "arctanh": np.arctanh(small * 0.5),
            "cube": v.x**3,
            "power": far**v.y,
            "root": np.sqrt(far),
        }

    names = outputs(type("Given", (), {"x": 0.5, "y": 0.5}))
    return BlockModel(
        name="elementary",
        description="",
        variables=(
            *(Input(name=name, description="", start=0.5) for name in "xy"),
            *(Output(name=f"np_{name}", description="") for name in names),
        ),
        outputs=lambda v: {f"np_{name}": value for name, value in outputs(v).items()},
    )
