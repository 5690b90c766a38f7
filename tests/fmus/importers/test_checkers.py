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

BACKENDS = ("native", "python")


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped())
@pytest.mark.parametrize("backend", BACKENDS)
def test_fmpy_validate_finds_nothing(name: str, backend: str, fmu_of: Callable[..., Path]) -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(fmu_of(name, backend))) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped())
@pytest.mark.parametrize("backend", BACKENDS)
def test_the_fmu_manipulation_toolbox_finds_nothing(
    name: str, backend: str, fmu_of: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
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
