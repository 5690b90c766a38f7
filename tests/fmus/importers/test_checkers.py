"""What other people's checkers find in the exported FMUs: nothing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from peers import fmutool
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
    name: str, backend: str, fmu_of: Callable[..., Path]
) -> None:
    said = fmutool("-input", str(fmu_of(name, backend)), "-check")
    assert said.returncode == 0, said.stdout
    assert "This FMU seems to be compliant with FMI-2.0." in said.stdout
    assert "No semantic error against the FMI-2 standard." in said.stdout
    assert not [
        line for line in said.stdout.splitlines() if line.startswith(("ERROR", "WARNING", "CRITICAL"))
    ]
