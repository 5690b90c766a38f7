"""What the tests of this folder share: every shipped unit as an FMU."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from peers import need_builds_for
from systems import shipped_unit
from urmpipe_fmus.build.description import Backend
from urmpipe_fmus.build.fmu import build_fmu, cached_fmu
from urmpipe_fmus.native import this_platform

Fmu = Callable[..., Path]


@pytest.fixture(scope="session")
def fmu_of() -> Fmu:
    """Return a function that gives a shipped unit's FMU by name and backend, built once a session."""

    def build(name: str, backend: Backend = "native") -> Path:
        if backend == "native":
            need_builds_for(this_platform())
        return cached_fmu(shipped_unit(name), backend)

    return build


@pytest.fixture(scope="session")
def cross_built(session_folder: Path) -> Callable[[str], Path]:
    """Return a function that gives a unit for linux64 and win64 by name, built by zig once a session."""
    platforms = ["linux64", "win64"]
    need_builds_for(*platforms)

    def build(name: str) -> Path:
        path = session_folder / "cross_built" / f"{name}.fmu"
        if not path.exists():  # it is renamed into its place when it is whole
            path.parent.mkdir(exist_ok=True)
            build_fmu(shipped_unit(name), path, platforms=platforms)
        return path

    return build
