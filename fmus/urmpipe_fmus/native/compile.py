"""Compiling the C sources of an FMU: by the system's compiler for this platform, by zig for several."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path

from urmpipe_fmus.native.sources import GUID_HEADER, guid_header
from urmpipe_fmus.platforms import is_windows, suffix_of, this_platform
from urmpipe_fmus.unit import Unit
from urmpipe_models.errors import FmuError
from urmpipe_models.processes import end_group

TARGETS = {"linux64": "x86_64-linux-gnu.2.17", "win64": "x86_64-windows-gnu"}
"""zig's name of the platforms, by FMI's."""

FLAGS = (
    "-shared", "-std=c99", "-O2", "-ffp-contract=off", "-fvisibility=hidden", "-s",
    "-Wall", "-Wextra", "-Wfatal-errors",
)  # fmt: skip
"""No fused multiply-add: a product is rounded before it is added, as NumPy does. No symbols but FMI's."""

ALONE = "sources/resources.c"
"""Of the sources this one alone reads the headers of Windows, whose names must not meet those of a model."""

TEMPORARY = ("TMPDIR", "TMP", "TEMP", "ZIG_LOCAL_CACHE_DIR")
"""Variables that tell compilers where to put temporary files."""

LINES_OF_AN_ERROR = 12


def native_missing(platforms: Sequence[str] = ()) -> str | None:
    """Return why no native FMU can be built here for some platforms (default: this one), None if it can."""
    wanted = list(platforms) or [this_platform()]
    local = wanted == [this_platform()]
    if find_spec("casadi") is None:
        return f"casadi is not installed (pip install 'urmpipe[{'native' if local else 'cross'}]')"
    if local and system_compiler():
        return None
    reasons = ["no C compiler is found (cc, or what the variable CC names)"] if local else []
    unknown = [one for one in wanted if one not in TARGETS]
    if unknown:
        reasons.append(
            f"platform {', '.join(unknown)}: zig is asked for {' and '.join(sorted(TARGETS))} only"
        )
    elif find_spec("ziglang") is None:
        reasons.append("ziglang is not installed (pip install 'urmpipe[cross]')")
    else:
        return None
    return ", and ".join(reasons)


def native_binaries(
    unit: Unit,
    sources: Mapping[str, bytes],
    guid: str,
    platforms: Sequence[str],
    *,
    told: Callable[[str], None] | None = None,
) -> dict[str, bytes]:
    """Compile the sources of a unit's FMU.

    The same sources and GUID give the same bytes, whatever the folder.

    Args:
        unit: The unit, of which the binaries take the name.
        sources: What `native_sources` gave.
        guid: GUID of the FMU.
        platforms: FMI's names of the platforms; this platform alone is compiled by the system's compiler.
        told: Told each platform that zig compiles for, before it does.

    Returns:
        The binaries by their path in the FMU.

    Raises:
        FmuError: If a compiler is missing or fails, with its last lines.
    """
    missing = native_missing(platforms)
    if missing:
        raise FmuError(f"unit {unit.name}: no native FMU can be built: {missing}")
    files = {**sources, GUID_HEADER: guid_header(guid)}
    binaries = {}
    for k, one in enumerate(platforms):
        command = _command(platforms, one)
        if told and "ziglang" in command:
            place = f" ({k + 1} of {len(platforms)})" if len(platforms) > 1 else ""
            told(f"compiling for {one}{place}; zig's first time for a platform takes minutes")
        binaries[f"binaries/{one}/{unit.name}{suffix_of(one)}"] = _compiled(unit, files, one, command)
    return binaries


def system_compiler() -> list[str] | None:
    """Return the command of the system's compiler: what CC names, else cc."""
    command = shlex.split(os.environ.get("CC") or "cc", posix=os.name == "posix")
    return command if command and shutil.which(command[0]) else None


def _command(platforms: Sequence[str], one: str) -> list[str]:
    """Return the compiler and flags for one of some platforms."""
    position = [] if is_windows(one) else ["-fPIC"]
    local = system_compiler()
    if local and list(platforms) == [this_platform()]:
        linked = ["-Wl,--build-id=none"] if suffix_of(one) == ".so" else []
        return [*local, *FLAGS, *position, *linked]
    return [sys.executable, "-P", "-m", "ziglang", "cc", "-target", TARGETS[one], *FLAGS, *position]


def _compiled(unit: Unit, files: Mapping[str, bytes], target: str, command: Sequence[str]) -> bytes:
    """Return the binary of some sources for one platform, made in a folder that is removed again."""
    with tempfile.TemporaryDirectory(prefix="urmpipe-fmu-") as folder:
        for name, content in files.items():
            path = Path(folder, name)
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(content)
        # As one text, so that a compiler starts once and reads the headers once: a third less of its time.
        together = sorted(name for name in files if name.endswith(".c") and name != ALONE)
        Path(folder, "together.c").write_text("".join(f'#include "{name}"\n' for name in together))
        binary = f"binary{suffix_of(target)}"
        libraries = [] if is_windows(target) else ["-lm"]
        _run(unit, target, [*command, "-o", binary, "together.c", ALONE, *libraries], folder)
        return Path(folder, binary).read_bytes()


def _run(unit: Unit, target: str, command: Sequence[str], folder: str) -> None:
    """Run a compiler in a folder that takes its temporary files; whatever ends the run ends it, too."""
    pipe, kept_inside = subprocess.PIPE, dict.fromkeys(TEMPORARY, folder)
    try:
        process = subprocess.Popen(
            command, cwd=folder, env={**os.environ, **kept_inside}, start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, text=True, errors="replace",
        )  # fmt: skip
    except OSError as error:
        raise FmuError(f"unit {unit.name}: {command[0]} cannot be run: {error}") from error
    with process:
        try:
            out, err = process.communicate()
        finally:
            end_group(process)
            process.communicate()  # until each process that it started has closed its output
    if process.returncode:
        said = (err or out).splitlines()[-LINES_OF_AN_ERROR:]
        raise FmuError(
            f"unit {unit.name}: the C compiler failed for {target} (exit code {process.returncode})",
            *(line for line in said if line.strip()),
        )
