"""What the tests of this folder share: every shipped unit as an FMU."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from peers import need_builds_for
from shipped_units import CROSS_BUILT, shipped_unit
from urmpipe_fmus.build import build_fmu
from urmpipe_fmus.cache import cached_fmu
from urmpipe_fmus.description import Backend
from urmpipe_fmus.native import this_platform

Fmu = Callable[..., Path]


@pytest.fixture(scope="session")
def fmu_of() -> Fmu:
    """Return a function that gives a shipped unit's FMU by name and backend, built once a session."""

    def build(name: str, backend: Backend = "native") -> Path:
        """Return the FMU out of the session's cache."""
        if backend == "native":
            need_builds_for(this_platform())
        return cached_fmu(shipped_unit(name), backend)

    return build


@pytest.fixture(scope="session")
def cross_built(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Units built by zig for linux64 and win64, by name: one set for all tests."""
    platforms = ["linux64", "win64"]
    need_builds_for(*platforms)
    folder = tmp_path_factory.mktemp("cross_built")
    return {
        name: build_fmu(shipped_unit(name), folder / f"{name}.fmu", platforms=platforms).path
        for name in CROSS_BUILT
    }
