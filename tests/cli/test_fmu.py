"""FMUs and systems where no native FMU can be built; fmu.cases has the commands."""

from __future__ import annotations

from pathlib import Path

import pytest

import urmpipe
from answered import ran

REASON = "casadi is not installed"
REFUSED = f"backend (--backend): found native, which cannot be built here: {REASON}, allowed: python"


@pytest.fixture(autouse=True)
def without_casadi(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """No native FMU can be built, and the working folder is empty."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("urmpipe_fmus.native.native_unavailable_reason", lambda platforms=(): REASON)


def test_without_casadi_it_is_python_and_a_note_gives_the_reason() -> None:
    code, out, err = ran("fmu build delta_meter")
    assert (code, out.splitlines()[1].split(", ")[0]) == (0, "FMU: delta_meter.fmu  (python")
    assert err.startswith("note: delta_meter.fmu runs on Python, as no native one can be built here: casadi")
    for line in ("fmu build delta_meter", "simulate one-drive"):
        assert ran(f"{line} --backend native") == (2, "", f"error: {REFUSED}\n")


@pytest.mark.slow
def test_units_on_python_are_a_warning_of_the_simulation() -> None:
    lines: list[str] = []
    with pytest.warns(UserWarning, match="the units run on Python"):
        result = urmpipe.simulate("one-drive", duration=0.002, on_message=lines.append)
    expected = f"the units run on Python, a hundred times slower than native ones: {REASON}"
    assert [(one.kind, one.message) for one in result.warnings] == [("on-python", expected)]
    assert lines[0] == expected
