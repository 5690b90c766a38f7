"""Units for two systems, built once a session."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from peers import need_builds_for
from systems import shipped_unit
from urmpipe_fmus.build.fmu import build_fmu


@pytest.fixture(scope="session")
def cross_built(session_folder: Path) -> Callable[[str], Path]:
    """Return a function that gives a unit for linux64 and win64 by name, built by zig."""
    platforms = ["linux64", "win64"]
    need_builds_for(*platforms)

    def build(name: str) -> Path:
        path = session_folder / "cross_built" / f"{name}.fmu"
        if not path.exists():  # it is renamed into its place when it is whole
            path.parent.mkdir(exist_ok=True)
            build_fmu(shipped_unit(name), path, platforms=platforms)
        return path

    return build
