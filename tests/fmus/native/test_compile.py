"""Compiling: repeatable, for two platforms with the same bits, and errors with their lines."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

import pytest

from asserting import refusal
from c_host import GUID, host, ran, script, write
from urmpipe_fmus.native import native_binaries, native_sources, native_unavailable_reason, this_platform
from urmpipe_fmus.native.compile import TARGETS
from urmpipe_models.errors import FmuError
from written_units import unit_of

OSCILLATOR = unit_of("oscillator")
needs_zig = pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang")


@pytest.mark.slow
@pytest.mark.skipif(native_unavailable_reason() is not None, reason=f"needs {native_unavailable_reason()}")
def test_of_an_error_of_the_compiler_the_lines_are_shown() -> None:
    sources = {**native_sources(OSCILLATOR), "sources/model.c": b"int broken = ;\n"}
    lines = refusal(FmuError, native_binaries, OSCILLATOR, sources, GUID, [this_platform()]).splitlines()
    assert lines[0] == f"unit oscillator: the C compiler failed for {this_platform()} (exit code 1)"
    assert lines[2].startswith("sources/model.c:1:14: error")
    assert "-Wfatal-errors" in lines[-1]  # one error, not what follows from it


@pytest.fixture(scope="module")
def crossed() -> dict[str, bytes]:
    """Return the oscillator's binaries that zig makes for both platforms."""
    return native_binaries(OSCILLATOR, native_sources(OSCILLATOR), GUID, sorted(TARGETS))


@pytest.mark.slow
@needs_zig
def test_windows_and_linux_give_the_same_bits(
    crossed: dict[str, bytes], c_host: str, wine: Mapping[str, str], tmp_path: Path
) -> None:
    # stripped like FMUs: zig builds its C libraries anew, in a minute, for programs that are not
    zig = [sys.executable, "-m", "ziglang", "cc", "-s", "-target", TARGETS["win64"]]
    windows = host(tmp_path, zig, "host.exe")
    for model in (OSCILLATOR, unit_of("player"), unit_of("elementary")):
        folder = tmp_path / f"a {model.name} \u00fc"
        write(folder, model, [] if model is OSCILLATOR else ["linux64", "win64"])
        for name, content in crossed.items() if model is OSCILLATOR else ():
            (folder / name).parent.mkdir(parents=True)
            (folder / name).write_bytes(content)
        given = script(model, 1000, 1)
        resources = (folder / "resources").as_uri()
        on_linux = ran([c_host, str(folder / f"binaries/linux64/{model.name}.so")], folder, given, resources)
        # wine's drive Z: is the root of the file system
        local = resources.replace("file:///", "file:///Z:/")
        library = tmp_path / "unit.dll"
        library.write_bytes((folder / f"binaries/win64/{model.name}.dll").read_bytes())
        on_windows = ran(["wine", windows, str(library)], folder, given, local, wine)
        assert len(on_linux) == 3100
        assert [a for a, b in zip(on_linux, on_windows, strict=True) if a != b] == []


@pytest.mark.slow
@needs_zig
@pytest.mark.parametrize("platforms", [["linux64", "win64"], [this_platform()]])
def test_zig_gives_the_same_bytes_in_any_folder_and_where_there_is_no_other_compiler(
    platforms: list[str], crossed: dict[str, bytes], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    if not set(platforms) <= set(TARGETS):
        pytest.skip("needs a platform that zig compiles for")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("ZIG_LOCAL_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("CC", "no-such-compiler")
    assert sorted(crossed) == ["binaries/linux64/oscillator.so", "binaries/win64/oscillator.dll"]
    again = native_binaries(OSCILLATOR, native_sources(OSCILLATOR), GUID, platforms)
    assert again == {name: crossed[name] for name in again}
    assert len(again) == len(platforms)
