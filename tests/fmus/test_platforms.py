"""FMI's names of platforms: the short ones are those of x86, others are named as FMI 3.0 does."""

from __future__ import annotations

import platform
from collections.abc import Callable
from pathlib import Path

import pytest

from urmpipe_fmus.fmu_file import binary_suffix, find_binary, host_binaries, host_platforms, this_platform


@pytest.fixture
def on(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], None]:
    """Be on a system with a processor."""

    def be(system: str, processor: str) -> None:
        monkeypatch.setattr(platform, "system", lambda: system)
        monkeypatch.setattr(platform, "machine", lambda: processor)
        monkeypatch.setattr("sys.maxsize", 2**63 - 1)

    return be


@pytest.mark.parametrize(
    ("system", "processor", "name", "suffix"),
    [
        ("Linux", "x86_64", "linux64", ".so"),
        ("Windows", "AMD64", "win64", ".dll"),
        ("Darwin", "x86_64", "darwin64", ".dylib"),
        ("Linux", "aarch64", "aarch64-linux", ".so"),
        ("Darwin", "arm64", "aarch64-darwin", ".dylib"),
        ("Windows", "ARM64", "aarch64-windows", ".dll"),
        ("Linux", "riscv64", "riscv64-linux", ".so"),
    ],
)
def test_a_platform_has_fmis_name(
    on: Callable[[str, str], None], system: str, processor: str, name: str, suffix: str
) -> None:
    on(system, processor)
    assert (this_platform(), binary_suffix(name)) == (name, suffix)


def test_on_arm_the_binary_under_its_own_name_is_taken_before_that_under_the_short_one(
    on: Callable[[str, str], None], tmp_path: Path
) -> None:
    on("Linux", "x86_64")
    assert (host_platforms(), host_binaries("arm")) == (("linux64",), ("binaries/linux64/arm.so",))
    on("Linux", "aarch64")
    own, short = (tmp_path / one for one in host_binaries("arm"))
    assert (own.parent.name, short.parent.name) == ("aarch64-linux", "linux64") == host_platforms()
    assert find_binary(tmp_path, "arm") == own
    for one in (short, own):
        one.parent.mkdir(parents=True)
        one.touch()
        assert find_binary(tmp_path, "arm") == one
