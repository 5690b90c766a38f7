"""The programs and packages of others that these tests drive, or the reason why a test skips."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module

import pytest

from urmpipe_fmus.native import native_unavailable_reason

NEEDS = {
    "ecospy": "needs ecospy and Debian's libtbb12 and unzip",
    "fmu_manipulation_toolbox": "needs fmu-manipulation-toolbox",
    "libcosimpy": "needs libcosimpy",
}


def need(module: str) -> None:
    """Skip a test whose peer is not there, or cannot load its own library."""
    try:
        import_module(module)
    except (ImportError, OSError) as error:
        pytest.skip(f"{NEEDS.get(module, f'needs {module}')}: {error}")


def need_builds_for(*platforms: str) -> None:
    """Skip a test that builds native FMUs where that cannot be done."""
    if missing := native_unavailable_reason(platforms):
        pytest.skip(f"needs what builds for {' and '.join(platforms)}: {missing}")


def fmutool(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run fmutool of the FMU manipulation toolbox; what it says comes in one stream."""
    need("fmu_manipulation_toolbox")
    code = "from fmu_manipulation_toolbox.cli.fmutool import fmutool; fmutool()"
    return said_by(sys.executable, "-c", code, *arguments)


def fmpy(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run FMPy's command; what it says comes in one stream."""
    return said_by(sys.executable, "-m", "fmpy", *arguments)


def said_by(*command: str) -> subprocess.CompletedProcess[str]:
    """Run a command, whatever it ends with."""
    return subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8", check=False, timeout=600
    )
