"""What other people's checkers find in the exported FMUs: nothing."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import redirect_stdout
from importlib import import_module
from io import StringIO
from pathlib import Path

import pytest

from peers import need
from shipped_units import shipped
from urmpipe_fmus.build.description import Backend

CASES: list[tuple[str, Backend]] = [
    *((name, "native") for name in shipped()),
    *((name, "python") for name in ("repolarizer", "log_source")),
]
"""Both backends describe a unit by the same template, and package Python alike for every unit."""


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped())
def test_fmpy_validate_finds_nothing(name: str, fmu_of: Callable[..., Path]) -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(fmu_of(name))) == []  # of Python FMUs: packaging/test_build.py


@pytest.mark.slow
@pytest.mark.parametrize(("name", "backend"), CASES)
def test_the_fmu_manipulation_toolbox_finds_nothing(
    name: str, backend: Backend, fmu_of: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    need("fmu_manipulation_toolbox")
    fmutool = import_module("fmu_manipulation_toolbox.cli.fmutool").fmutool  # it publishes no types
    monkeypatch.setattr(sys, "argv", ["fmutool", "-input", str(fmu_of(name, backend)), "-check"])
    with redirect_stdout(StringIO()) as out:
        fmutool()
    said = out.getvalue()
    assert "This FMU seems to be compliant with FMI-2.0." in said
    assert "No semantic error against the FMI-2 standard." in said
    assert not [line for line in said.splitlines() if line.startswith(("ERROR", "WARNING", "CRITICAL"))]
