"""Compiling: clean, repeatable, for two platforms with the same bits, and errors that tell."""

from __future__ import annotations

import shutil
import struct
import subprocess
import sys
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from c_host import GUID, host, ran, script, write
from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.instance import Instance
from urmpipe_fmus.native import native_binaries, native_sources, native_unavailable_reason, this_platform
from urmpipe_fmus.native.compile import TARGETS
from urmpipe_models.errors import FmuError

needs_compiler = pytest.mark.skipif(
    native_unavailable_reason() is not None, reason=f"needs {native_unavailable_reason()}"
)
needs_zig = pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang")


@pytest.mark.slow
@needs_compiler
def test_the_same_unit_gives_the_same_bytes(
    oscillator: BlockModel, built: Callable[..., Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    folder, sources = built(oscillator), native_sources(oscillator)
    assert {name: (folder / name).read_bytes() for name in sources} == sources
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    ((name, content),) = native_binaries(oscillator, sources, GUID, [this_platform()]).items()
    assert content == (folder / name).read_bytes()
    assert str(tmp_path).encode() not in content


@needs_compiler
def test_only_fmi_is_visible(built: Callable[..., Path], oscillator: BlockModel) -> None:
    if shutil.which("nm") is None:
        pytest.skip("needs nm")
    (path,) = built(oscillator).glob("binaries/*/oscillator*")
    listed = subprocess.run(
        ["nm", "-D", "--defined-only", str(path)], capture_output=True, text=True, check=True
    )
    names = {line.split()[-1] for line in listed.stdout.splitlines()}
    assert all(name.startswith("fmi2") for name in names)
    assert {"fmi2Instantiate", "fmi2DoStep", "fmi2GetReal", "fmi2SetFMUstate"} <= names


@pytest.mark.slow
def test_the_error_of_a_compiler_is_told(oscillator: BlockModel, monkeypatch: pytest.MonkeyPatch) -> None:
    if native_unavailable_reason() is not None:
        pytest.skip(f"needs {native_unavailable_reason()}")
    sources = {**native_sources(oscillator), "sources/model.c": b"int broken = ;\n"}
    with pytest.raises(FmuError) as error:
        native_binaries(oscillator, sources, GUID, [this_platform()])
    said = [str(one) for one in error.value.findings]
    assert said[0] == f"unit oscillator: the C compiler failed for {this_platform()} (exit code 1)"
    assert said[2].startswith("sources/model.c:1:14: error")
    assert "-Wfatal-errors" in said[-1]  # one error, not what follows from it
    monkeypatch.setenv("CC", "no-such-compiler")
    only_casadi(monkeypatch)
    with pytest.raises(FmuError) as error:
        native_binaries(oscillator, native_sources(oscillator), GUID, [this_platform()])
    assert str(error.value) == (
        "unit oscillator: no native FMU can be built:"
        " no C compiler is found (cc, or what the variable CC names),"
        " and ziglang is not installed (pip install 'urmpipe[cross]')"
    )


def only_casadi(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hide ziglang."""
    monkeypatch.setattr(
        "urmpipe_fmus.native.compile.find_spec", lambda name: None if name == "ziglang" else name
    )


def test_what_is_missing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    assert native_unavailable_reason(["amiga", "linux64"]) == (
        "platform amiga: zig is asked for linux64 and win64 only"
    )
    monkeypatch.setattr("urmpipe_fmus.native.compile.this_platform", lambda: "amiga")
    monkeypatch.setattr("urmpipe_fmus.native.compile.system_compiler", lambda: None)
    assert native_unavailable_reason() == (
        "no C compiler is found (cc, or what the variable CC names),"
        " and platform amiga: zig is asked for linux64 and win64 only"
    )
    monkeypatch.undo()
    only_casadi(monkeypatch)
    assert (
        native_unavailable_reason(["linux64", "win64"])
        == "ziglang is not installed (pip install 'urmpipe[cross]')"
    )
    monkeypatch.setattr("urmpipe_fmus.native.compile.find_spec", lambda _: None)
    assert native_unavailable_reason() == "casadi is not installed (pip install 'urmpipe[native]')"


@pytest.fixture(scope="module")
def crossed(oscillator: BlockModel) -> dict[str, bytes]:
    """Return the oscillator's binaries that zig makes for both platforms."""
    return native_binaries(oscillator, native_sources(oscillator), GUID, sorted(TARGETS))


@pytest.mark.slow
@needs_zig
def test_windows_and_linux_give_the_same_bits(
    elementary: BlockModel,
    oscillator: BlockModel,
    player: BlockModel,
    crossed: dict[str, bytes],
    c_host: str,
    wine: Mapping[str, str],
    tmp_path: Path,
) -> None:
    # stripped like FMUs: zig builds its C libraries anew, in a minute, for programs that are not
    zig = [sys.executable, "-m", "ziglang", "cc", "-s", "-target", TARGETS["win64"]]
    windows = host(tmp_path, zig, "host.exe")
    for model in (elementary, oscillator, player):
        folder = tmp_path / f"a {model.name} \u00fc"
        write(folder, model, [] if model is oscillator else ["linux64", "win64"])
        for name, content in crossed.items() if model is oscillator else ():
            (folder / name).parent.mkdir(parents=True)
            (folder / name).write_bytes(content)
        given = script(model, 1000, 1)
        resources = (folder / "resources").as_uri()
        on_linux = ran([c_host, str(folder / f"binaries/linux64/{model.name}.so")], folder, given, resources)
        # wine's drive Z: is the root of the file system
        local = resources.replace("file:///", "file:///Z:/")
        library = folder / f"binaries/win64/{model.name}.dll"
        (tmp_path / "unit.dll").write_bytes(library.read_bytes())
        on_windows = ran(["wine", windows, str(tmp_path / "unit.dll")], folder, given, local, wine)
        assert len(on_linux) == 3100
        assert [a for a, b in zip(on_linux, on_windows, strict=True) if a != b] == []


@pytest.mark.slow
@needs_zig
def test_cross_compiled_binaries_are_the_same_bytes_in_any_folder(
    oscillator: BlockModel, crossed: dict[str, bytes], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    sources = native_sources(oscillator)
    assert sorted(crossed) == ["binaries/linux64/oscillator.so", "binaries/win64/oscillator.dll"]
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("ZIG_LOCAL_CACHE_DIR", str(tmp_path / "cache"))
    assert native_binaries(oscillator, sources, GUID, ["linux64", "win64"]) == crossed


@pytest.mark.slow
@needs_zig
def test_zig_compiles_for_this_platform_where_there_is_no_other_compiler(
    oscillator: BlockModel, crossed: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    if this_platform() not in TARGETS:
        pytest.skip("needs a platform that zig compiles for")
    monkeypatch.setenv("CC", "no-such-compiler")
    sources = native_sources(oscillator)
    ((name, content),) = native_binaries(oscillator, sources, GUID, [this_platform()]).items()
    assert crossed[name] == content


@pytest.mark.slow
@needs_compiler
def test_a_host_in_c_sees_what_python_sees(
    oscillator: BlockModel, built: Callable[..., Path], c_host: str
) -> None:
    folder = built(oscillator)
    (library,) = folder.glob("binaries/*/oscillator*")
    seen = ran([c_host, str(library)], folder, "set 2 3.5\nstep 0 0.05\nget 5 6 9\n")
    instance = Instance(oscillator)
    instance.set([2], [3.5])
    instance.do_step(0.0, 0.05)
    found = [struct.unpack(">d", bytes.fromhex(one))[0] for one in seen[-1].split()[2:]]
    # C's math library and NumPy's differ by some units in the last place
    np.testing.assert_allclose(found, instance.get([5, 6, 9]), rtol=1e-13)
