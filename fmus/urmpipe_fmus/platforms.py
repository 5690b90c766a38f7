"""FMI's names of platforms, and where in an FMU the binary for this one is."""

from __future__ import annotations

import platform
import sys
from pathlib import Path

X86 = ("x86_64", "amd64", "i386", "i486", "i586", "i686", "x86")
"""What processors call themselves that FMI 2.0's linux64, win64 and their like stand for."""


def this_platform() -> str:
    """Return FMI's name of the platform that this runs on: linux64, or aarch64-linux.

    FMI 2.0's short names are those of x86; FMI 2.0.4 takes the names of FMI 3.0 for all others.
    """
    system, processor = platform.system(), platform.machine().lower()
    if processor in X86:
        return _short(system)
    long = {"Windows": "windows", "Darwin": "darwin"}.get(system, "linux")
    return f"{'aarch64' if processor == 'arm64' else processor}-{long}"


def is_windows(name: str) -> bool:
    """Return whether a platform's name is one of Windows."""
    return name.startswith("win") or name.endswith("-windows")


def suffix_of(name: str) -> str:
    """Return how a binary's name ends on a platform."""
    return ".dll" if is_windows(name) else ".dylib" if "darwin" in name else ".so"


def platforms_here() -> tuple[str, ...]:
    """Return the names under which a binary for this platform may be, the better first.

    The second of an ARM processor is the short name, which other tools of FMI 2.0 still give it.
    """
    return tuple(dict.fromkeys((this_platform(), _short(platform.system()))))


def binaries_here(identifier: str) -> tuple[str, ...]:
    """Return the paths in an FMU at which its binary for this platform may be, the better first."""
    return tuple(f"binaries/{one}/{identifier}{suffix_of(one)}" for one in platforms_here())


def binary_in(folder: Path, identifier: str) -> Path:
    """Return the binary for this platform in the folder of an FMU; the better path, if there is none."""
    paths = [folder / one for one in binaries_here(identifier)]
    return next((one for one in paths if one.is_file()), paths[0])


def _short(system: str) -> str:
    bits = "64" if sys.maxsize > 2**32 else "32"
    return {"Windows": "win", "Darwin": "darwin"}.get(system, "linux") + bits
