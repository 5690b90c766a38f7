"""What other people's checkers find in the exported FMUs: nothing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from peers import fmutool
from urmpipe_fmus.blocks import block_names
from urmpipe_fmus.build.description import Backend

# Both backends describe a unit by the same template, and package Python alike for every unit.
CASES: list[tuple[str, Backend]] = [
    *((name, "native") for name in block_names()),
    *((name, "python") for name in ("repolarizer", "log_source")),
]


@pytest.mark.slow
@pytest.mark.parametrize("name", block_names())
def test_fmpy_validate_finds_nothing(name: str, fmu_of: Callable[..., Path]) -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(fmu_of(name))) == []  # of Python FMUs: packaging/test_build.py


@pytest.mark.slow
@pytest.mark.parametrize(("name", "backend"), CASES)
def test_the_fmu_manipulation_toolbox_finds_nothing(
    name: str, backend: Backend, fmu_of: Callable[..., Path]
) -> None:
    output = fmutool("-input", str(fmu_of(name, backend)), "-check").stdout
    assert "This FMU seems to be compliant with FMI-2.0." in output
    assert "No semantic error against the FMI-2 standard." in output
    assert not [line for line in output.splitlines() if line.startswith(("ERROR", "WARNING", "CRITICAL"))]
