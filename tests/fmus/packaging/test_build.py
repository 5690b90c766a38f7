"""From a unit to a file: both backends, the choice between them, the content."""

from __future__ import annotations

import zipfile
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from fmpy.validation import validate_fmu

from asserting import refusal
from loaded_fmu import Loaded
from shipped_units import UNITS
from small_models import block, variable
from stepped_unit import needs_native
from urmpipe_fmus.block import Input, Output
from urmpipe_fmus.blocks import block_names, make_block
from urmpipe_fmus.build.fmu import build_fmu, cached_fmu
from urmpipe_fmus.fmu_file import content_guid
from urmpipe_fmus.native import native_unavailable_reason, this_platform
from urmpipe_models.errors import FmuError
from written_units import unit_of


def contents(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.mark.slow
@needs_native
def test_native_is_the_default_with_description_binary_sources_and_documentation(tmp_path: Path) -> None:
    made = build_fmu(unit_of("playback"), tmp_path / "any.fmu")
    assert (made.path, made.backend) == (tmp_path / "any.fmu", "native")
    assert (made.platforms, made.note) == ((this_platform(),), "")
    assert cached_fmu(unit_of("playback"), "native").read_bytes() == made.path.read_bytes()  # built by itself
    found = contents(made.path)
    description = ET.fromstring(found["modelDescription.xml"])
    assert description.get("guid") == made.guid
    compiled = [f"sources/{one.get('name')}" for one in description.findall(".//File")]
    assert compiled == sorted(name for name in found if name.startswith("sources/") and name.endswith(".c"))
    needed = {"sources/model.c", "sources/guid.h", "resources/table.bin", "documentation/index.html"}
    assert needed <= set(found)
    assert sum(name.startswith("binaries/") for name in found) == 1


def test_the_guid_is_that_of_the_content(tmp_path: Path) -> None:
    made = build_fmu(unit_of("spring"), tmp_path, backend="python")
    found = contents(made.path)
    assert f' guid="{made.guid}"'.encode() in found["modelDescription.xml"]
    found["modelDescription.xml"] = found["modelDescription.xml"].replace(made.guid.encode(), b"")
    assert content_guid(found) == made.guid
    assert (made.to_dict()["guid"], made.to_dict()["unit"]) == (made.guid, "spring")
    assert list(made.to_frame()["name"]) == [one.name for one in made.unit.variables]


@pytest.fixture
def no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    found = "urmpipe_fmus.native.compile.find_spec"
    monkeypatch.setattr(found, lambda name: None if name == "ziglang" else find_spec(name))


@pytest.mark.usefixtures("no_compiler")
def test_without_a_compiler_it_is_python_and_a_line_says_why(tmp_path: Path) -> None:
    arm = unit_of("arm")
    made, reason = build_fmu(arm, tmp_path), native_unavailable_reason(())
    assert (made.backend, made.platforms) == ("python", ("linux64", "win64"))
    assert made.note == f"arm.fmu runs on Python, as no native one can be built here: {reason}"
    assert refusal(FmuError, build_fmu, arm, tmp_path, backend="native") == (
        f"backend (--backend): found native, which cannot be built here: {reason}, allowed: python"
    )


@pytest.mark.usefixtures("no_compiler")
@pytest.mark.parametrize("platforms", [["win64"], ["linux64", "win64"]])
def test_platforms_that_cannot_be_compiled_here_need_python(tmp_path: Path, platforms: list[str]) -> None:
    assert refusal(FmuError, build_fmu, unit_of("arm"), tmp_path, platforms=platforms) == (
        f"platforms (--platforms): found {', '.join(platforms)}, which cannot be compiled here: ziglang is"
        " not installed"
        " (pip install 'urmpipe[cross]'); --backend python packages an FMU that needs Python with NumPy"
    )
    assert list(tmp_path.iterdir()) == []
    made = build_fmu(unit_of("arm"), tmp_path, backend="python", platforms=platforms)
    assert (made.backend, list(made.platforms)) == ("python", platforms)
    before = made.path.read_bytes()
    refusal(FmuError, build_fmu, unit_of("arm"), tmp_path, backend="python", platforms=["no-such-platform"])
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [before]


@pytest.mark.slow
@pytest.mark.parametrize("name", block_names())
def test_every_shipped_unit_is_a_valid_python_fmu_that_starts_as_it_says(name: str) -> None:
    model = make_block(name, **dict(UNITS.values())[name])
    path = cached_fmu(model, "python")
    assert validate_fmu(str(path)) == []
    fmu = Loaded(path)
    given = [one for one in model.variables if one not in model.computed]
    starts = [start for one in given for start in one.starts]
    assert fmu.get([scalar for one in given for scalar in one.names]) == starts
    fmu.get([scalar for one in model.computed for scalar in one.names])
    fmu.free()


@pytest.mark.slow
@needs_native
def test_numbers_of_numpy_are_numbers_in_c_and_in_the_description(tmp_path: Path) -> None:
    angles = tuple(np.deg2rad([30.0, 45.0]))
    bounds = {"minimum": np.deg2rad(-90), "maximum": np.float64(1.5)}
    phi = variable(Input, "phi", size=2, start=angles, **bounds)
    model = block(phi, variable(Output, "y"), name="angles", outputs=lambda v: {"y": v.phi[0] + v.phi[1]})
    fmu = Loaded(build_fmu(model, tmp_path, backend="native").path)
    first = fmu.described.modelVariables[0]
    assert [float(one) for one in (first.start, first.min, first.max)] == [np.pi / 6.0, -np.pi / 2.0, 1.5]
    assert fmu.get(["phi[1]", "phi[2]"]) == list(angles)
    fmu.free()
