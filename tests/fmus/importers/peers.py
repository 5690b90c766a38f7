"""FMUs, and the programs and packages of others that these tests drive, or the reason why a test skips."""

from __future__ import annotations

import os
import sys
from importlib import import_module
from pathlib import Path
from subprocess import PIPE, STDOUT, CompletedProcess, run

import pytest

from systems import shipped_unit
from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.build.description import Backend
from urmpipe_fmus.build.fmu import cached_fmu
from urmpipe_fmus.native import native_unavailable_reason, this_platform

NEEDS = {"ecospy": "ecospy and Debian's libtbb12 and unzip"}


def need(module: str) -> None:
    """Skip a test whose peer is not there, or cannot load its own library."""
    try:
        import_module(module)
    except (ImportError, OSError) as error:
        pytest.skip(f"needs {NEEDS.get(module, module)}: {error}")


def need_builds_for(*platforms: str) -> None:
    """Skip a test that builds native FMUs where that cannot be done."""
    if missing := native_unavailable_reason(platforms):
        pytest.skip(f"needs what builds for {' and '.join(platforms)}: {missing}")


def fmu_of(unit: str | BlockModel, backend: Backend = "native") -> Path:
    """Return the FMU of a block model, or of a shipped unit by name, out of the session's cache."""
    if backend == "native":
        need_builds_for(this_platform())
    return cached_fmu(shipped_unit(unit) if isinstance(unit, str) else unit, backend)


def fmutool(*arguments: str) -> CompletedProcess[str]:
    """Run fmutool of the FMU manipulation toolbox."""
    need("fmu_manipulation_toolbox")
    return python("-c", "from fmu_manipulation_toolbox.cli.fmutool import fmutool; fmutool()", *arguments)


def python(*arguments: str) -> CompletedProcess[str]:
    """Run Python, whatever it ends with; its output and errors come in one stream."""
    command, env = [sys.executable, *arguments], os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    return run(command, stdout=PIPE, stderr=STDOUT, encoding="utf-8", check=False, timeout=600, env=env)
