"""From a unit to a file: both backends, the choice between them, the content."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from fmpy.validation import validate_fmu

from asserting import there
from loaded_fmu import Loaded
from made_masses import with_drives, with_masses
from urmpipe_fmus.block import BlockModel, Input, Output
from urmpipe_fmus.blocks import block_names, make_block
from urmpipe_fmus.blocks.logs import log_source
from urmpipe_fmus.build.fmu import build_fmu, cached_fmu
from urmpipe_fmus.fmu_file import content_guid
from urmpipe_fmus.native import native_unavailable_reason, this_platform
from urmpipe_fmus.run import run
from urmpipe_models.errors import FmuError
from urmpipe_models.robots.catalogue import load_robot

Make = Callable[..., BlockModel]
WHY = native_unavailable_reason([this_platform()])
needs_native = pytest.mark.skipif(WHY is not None, reason=f"needs the native backend: {WHY}")


def contents(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def guid_in(path: Path) -> str:
    return ET.fromstring(contents(path)["modelDescription.xml"]).get("guid", "")


@pytest.mark.slow
@needs_native
def test_a_native_fmu_is_valid(model: BlockModel) -> None:
    assert validate_fmu(str(cached_fmu(model, "native"))) == []


@pytest.mark.slow
@needs_native
def test_native_is_the_default_where_it_can_be_built_and_the_same_bytes_again(
    make: Make, tmp_path: Path
) -> None:
    made = build_fmu(make("playback"), tmp_path / "any.fmu")
    assert (made.path, made.backend, made.platforms, made.note) == (
        tmp_path / "any.fmu",
        "native",
        (this_platform(),),
        "",
    )
    assert guid_in(made.path) == made.guid
    assert cached_fmu(make("playback"), "native").read_bytes() == made.path.read_bytes()  # built by itself


@pytest.mark.slow
@needs_native
def test_a_native_fmu_holds_description_binary_sources_and_documentation(make: Make) -> None:
    found = contents(cached_fmu(make("playback"), "native"))
    compiled = [one.get("name") for one in ET.fromstring(found["modelDescription.xml"]).findall(".//File")]
    assert compiled == sorted(
        name.removeprefix("sources/") for name in found if name.startswith("sources/") and name.endswith(".c")
    )
    assert "model.c" in compiled
    assert {"sources/guid.h", "resources/table.bin", "documentation/index.html"} <= set(found)
    assert sum(name.startswith("binaries/") for name in found) == 1


def test_the_guid_is_that_of_the_content(make: Make, tmp_path: Path) -> None:
    made = build_fmu(make("spring"), tmp_path, backend="python")
    found = contents(made.path)
    assert guid_in(made.path) == made.guid
    found["modelDescription.xml"] = found["modelDescription.xml"].replace(made.guid.encode(), b"")
    assert content_guid(found) == made.guid
    assert (made.to_dict()["guid"], made.to_dict()["unit"]) == (made.guid, "spring")
    assert list(made.to_frame()["name"]) == [one.name for one in made.unit.variables]


@pytest.mark.slow
def test_other_descriptions_tables_and_backends_have_other_guids(make: Make, tmp_path: Path) -> None:
    units = [make("spring"), make("playback"), make("playback", gain=2.0)]
    guids = {build_fmu(one, tmp_path, backend="python").guid for one in units}
    assert len(guids) == len(units)


@pytest.fixture
def no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    found = "urmpipe_fmus.native.compile.find_spec"
    monkeypatch.setattr(found, lambda name: None if name == "ziglang" else find_spec(name))


@pytest.mark.usefixtures("no_compiler")
def test_without_a_compiler_it_is_python_and_a_line_says_why(make: Make, tmp_path: Path) -> None:
    made = build_fmu(make("arm"), tmp_path)
    assert made.backend == "python"
    assert made.platforms == ("linux64", "win64")
    assert (
        made.note
        == f"arm.fmu runs on Python, as no native one can be built here: {native_unavailable_reason(())}"
    )
    assert "no C compiler" in made.note
    with pytest.raises(FmuError, match="backend: found native, which cannot be built here: no C compiler"):
        build_fmu(make("arm"), tmp_path, backend="native")


@pytest.mark.usefixtures("no_compiler")
@pytest.mark.parametrize("platforms", [["win64"], ["linux64", "win64"]])
def test_platforms_that_cannot_be_compiled_here_are_refused_unless_python_is_asked_for(
    make: Make, tmp_path: Path, platforms: list[str]
) -> None:
    with pytest.raises(FmuError) as caught:
        build_fmu(make("arm"), tmp_path, platforms=platforms)
    assert str(caught.value) == (
        f"platforms: found {', '.join(platforms)}, which cannot be compiled here: ziglang is not installed"
        " (pip install 'urmpipe[cross]'); backend=\"python\" packages an FMU that needs Python with NumPy"
    )
    assert list(tmp_path.iterdir()) == []
    made = build_fmu(make("arm"), tmp_path, backend="python", platforms=platforms)
    assert (made.backend, list(made.platforms)) == ("python", platforms)


@pytest.mark.slow
def test_a_failed_build_leaves_the_file_that_was_there(make: Make, tmp_path: Path) -> None:
    path = build_fmu(make("arm"), tmp_path, backend="python").path
    before = path.read_bytes()
    with pytest.raises(FmuError):
        build_fmu(make("arm"), tmp_path, backend="python", platforms=["no-such-platform"])
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


OPTIONS: dict[str, dict[str, Any]] = {
    "kinematic_chain": {"robot": load_robot("urm6"), "rates": True},
    "repolarizer": {"joints": 6},
    "network_motion": {"network": "rssr", "points": ["output:0.25,0.04,0"]},
    "chain_dynamics": {"robot": with_drives(with_masses(load_robot("urm6")))},
    "driven_arm": {"robot": with_drives(with_masses(load_robot("urm6")))},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in block_names() if name != "log_source"])
def test_every_shipped_unit_is_a_valid_python_fmu_that_starts_as_it_says(name: str) -> None:
    model = make_block(name, **OPTIONS.get(name, {}))
    path = cached_fmu(model, "python")
    assert validate_fmu(str(path)) == []
    fmu = Loaded(path)
    starts = {
        scalar: one.starts[one.names.index(scalar)]
        for scalar, one in model.scalars
        if one not in model.computed
    }
    assert fmu.get(list(starts)) == list(starts.values())
    fmu.get([scalar for one in model.computed for scalar in one.names])
    fmu.free()


def test_a_log_source_as_python_fmu_plays_the_table_in_its_resources(make: Make, tmp_path: Path) -> None:
    table = there(make("playback").table)
    model = log_source(table, [("q", "rad"), ("x", "m")], interpolate=True)
    path = build_fmu(model, tmp_path, backend="python").path
    assert validate_fmu(str(path)) == []
    fmu = Loaded(path)
    played = run(model, np.array([k * 0.05 for k in range(8)]))
    for k in range(8):
        assert fmu.get(["q", "x"]) == [played["q"][k], played["x"][k]]
        fmu.do_step(k * 0.05, 0.05)
    fmu.free()


@pytest.mark.slow
@needs_native
def test_numbers_of_numpy_are_numbers_in_c_and_in_the_description(tmp_path: Path) -> None:
    angles = tuple(np.deg2rad([30.0, 45.0]))
    phi = Input(
        name="phi", description="", size=2, start=angles, minimum=np.deg2rad(-90), maximum=np.float64(1.5)
    )
    model = BlockModel(
        name="angles",
        description="",
        variables=(phi, Output(name="y", description="")),
        outputs=lambda v: {"y": v.phi[0] + v.phi[1]},
    )
    fmu = Loaded(build_fmu(model, tmp_path, backend="native").path)
    described = {one.name: one for one in fmu.described.modelVariables}["phi[1]"]
    assert [float(one) for one in (described.start, described.min, described.max)] == [
        np.pi / 6.0,
        -np.pi / 2.0,
        1.5,
    ]
    assert fmu.get(["phi[1]", "phi[2]"]) == list(angles)
    fmu.free()
